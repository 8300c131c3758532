"""Direct light, mirrors and glass: the recursion of Whitted, a batch at a time.

Whitted, "An improved illumination model for shaded display", CACM 23(6), 1980. Lights send light to
matt and glossy surfaces directly; mirrors and glass show what lies in the mirrored and the refracted
direction, both branches followed. Glass casts a full shadow: bending light onto other surfaces is
for photons.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.integrator import (
    BLOCK,
    FIRST_PATH_DIMENSION,
    CameraBlock,
    Integrator,
    RenderContext,
)
from hybrid_rt.integrators.surface_light import SurfaceLight, largest_channel
from hybrid_rt.kernels.film import add_to_pixels
from hybrid_rt.kernels.fresnel import mirror_directions, split_at_glass
from hybrid_rt.kernels.lobes import DIELECTRIC, MIRROR, LobeTable
from hybrid_rt.records import BoolArray, FloatArray, HitRecord, IntArray
from hybrid_rt.sampler import UIntArray
from hybrid_rt.scene import NOTHING

# A branch that changes its pixel by less than this, per unit of radiance, is not followed.
LEAST_CONTRIBUTION = 1e-3


@dataclass(frozen=True)
class Branches:
    """Rays on their way, in the order of the camera rays they come from.

    Attributes
    ----------
    depth : int
        Mirrored and refracted directions taken so far.
    camera_ray : (n,) int64
        Row in the block of camera rays.
    node : (n,) uint64
        Place in the tree of branches, 1 at the camera; it names the branch's random numbers.
    origins, directions : (n, 3) float64
        Directions are unit vectors.
    throughput : (n, 3) float64
        What one unit of radiance on this ray adds to its pixel.
    medium : (n,) int32
        Lobe of the dielectric that the ray runs in; `NOTHING` in empty space.
    source : HitRecord or None
        Where the rays start; None at the camera.
    """

    depth: int
    camera_ray: NDArray[np.int64]
    node: UIntArray
    origins: FloatArray
    directions: FloatArray
    throughput: FloatArray
    medium: IntArray
    source: HitRecord | None

    def __len__(self) -> int:
        """Return the number of rays."""
        return int(self.camera_ray.size)

    def __getitem__(self, rows: object) -> Branches:
        """Select rows by a mask, an index array or a slice."""
        columns = [getattr(self, field.name) for field in fields(self)][1:]
        chosen: list[Any] = [None if column is None else column[rows] for column in columns]
        return Branches(self.depth, *chosen)


class Whitted(Integrator):
    """See the module; `Integrator` for what it offers."""

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self._light = SurfaceLight(context)
        lobes = context.scene.lobes
        # The dielectric of each material, if it has one: its inside is what absorbs.
        self._glass_of = np.full(lobes.first.size - 1, NOTHING, dtype=np.int32)
        for row in np.flatnonzero(lobes.kind == DIELECTRIC):
            self._glass_of[np.searchsorted(lobes.first, row, side="right") - 1] = row
        # Kind of the n-th lobe of each material, and a last row for what has none (`NOTHING`).
        self._kinds_in_slot = np.full((self._light.n_slots, lobes.first.size), NOTHING)
        for material, (first, stop) in enumerate(pairwise(lobes.first)):
            self._kinds_in_slot[: stop - first, material] = lobes.kind[first:stop]

    def _radiance(self, block: CameraBlock, pass_number: int) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        # Depth first over batches, breadth first within one: few batches wait at each depth, so
        # memory stays bounded however often glass splits the rays.
        waiting = [_leaving_camera(block)]
        while waiting:
            rays = waiting.pop()
            # --- where the rays arrive
            hits = self._first_hits(rays.origins, rays.directions, rays.source)
            with self.context.ledger.stage("shade"):
                material = self._light.material(hits)
                # --- what the way there absorbed
                medium = self._medium(rays, hits, material)
                throughput = self._after_absorption(rays.throughput, medium, hits.t)
                # --- light they ran into
                gathered = throughput * self._light.arriving(hits, rays.directions)
                # --- light we reach for
                colors = self._light.colors(material, hits)
                gathered += throughput * self._light.direct(
                    hits,
                    rays.directions,
                    material,
                    colors,
                    block.pixel[rays.camera_ray],
                    self._dimension(rays.node),
                    pass_number,
                )
                add_to_pixels(rays.camera_ray, gathered, radiance)
                # --- where they go next
                met = _Meeting(rays, hits, material, colors, throughput, medium)
                onward = self._onward(met)
            waiting.extend(onward)
        return radiance

    def _medium(self, rays: Branches, hits: HitRecord, material: IntArray) -> IntArray:
        """Return the lobe of the dielectric that each ray has just crossed.

        Whoever meets a dielectric from within has crossed it, wherever the ray began; so a camera
        may stand inside glass. Otherwise it is what the ray set out into.
        """
        if not self.context.plan["absorption"]:
            return rays.medium
        glass = np.where(material != NOTHING, self._glass_of[material], NOTHING)
        return np.where(~hits.front_face & (glass != NOTHING), glass, rays.medium)

    def _after_absorption(
        self, throughput: FloatArray, medium: IntArray, length: FloatArray
    ) -> FloatArray:
        """Weaken throughput by Beer and Lambert's law over the way just gone."""
        if not self.context.plan["absorption"]:
            return throughput
        result = throughput.copy()
        rows = np.flatnonzero(medium != NOTHING)
        density = self.context.scene.lobes.number[medium[rows], 2:5]
        # A ray that never leaves clear glass is not weakened: 0 x inf is 0 here.
        depth = (
            np.where(density > 0.0, density, 0.0)
            * np.minimum(length[rows], np.finfo(np.float64).max)[:, None]
        )
        result[rows] *= np.exp(-depth)
        return result

    def _dimension(self, node: UIntArray) -> UIntArray:
        """Return the first of the dimensions that belong to each branch: one per light, and sky."""
        per_node = np.uint64(self.context.scene.n_lights + 1)
        return np.uint64(FIRST_PATH_DIMENSION) + node * per_node

    def _onward(self, met: _Meeting) -> list[Branches]:
        """Return the mirrored and refracted rays, in batches of bounded size."""
        parts: list[_Part] = []
        lobes, plan = self.context.scene.lobes, self.context.plan
        for slot, kinds in enumerate(self._kinds_in_slot):
            if plan["mirror rays"]:
                rows = np.flatnonzero(kinds[met.material] == MIRROR)
                parts.append(_mirrored(met, rows, 2 * slot, met.colors[rows, slot]))
            if plan["glass rays"]:
                rows = np.flatnonzero(kinds[met.material] == DIELECTRIC)
                parts += _at_glass(met, rows, slot, lobes)
        if not parts:
            return []
        return _in_batches(self._joined(met, parts))

    def _joined(self, met: _Meeting, parts: list[_Part]) -> Branches:
        """Put the branches that go on into the order of their parents."""
        parent = np.concatenate([part.parent for part in parts])
        choice = np.repeat([part.choice for part in parts], [part.parent.size for part in parts])
        throughput = np.concatenate([part.throughput for part in parts])
        medium = np.concatenate([part.medium for part in parts])
        depth = met.rays.depth + 1
        going = np.flatnonzero(self._goes_on(throughput, medium, depth))
        order = going[np.argsort(parent[going], kind="stable")]
        parent, choice = parent[order], choice[order].astype(np.uint64)
        is_refracted = choice % np.uint64(2) == 1
        n_refracted = int(np.count_nonzero(is_refracted))
        self.context.ledger.rays["refracted"] += n_refracted
        self.context.ledger.rays["reflected"] += order.size - n_refracted
        return Branches(
            depth=depth,
            camera_ray=met.rays.camera_ray[parent],
            node=met.rays.node[parent] * np.uint64(2 * self._light.n_slots) + choice,
            origins=met.hits.position.take(parent, axis=0),
            directions=np.concatenate([part.directions for part in parts]).take(order, axis=0),
            throughput=throughput.take(order, axis=0),
            medium=medium[order],
            source=met.hits[parent],
        )

    def _goes_on(self, throughput: FloatArray, medium: IntArray, depth: int) -> BoolArray:
        """Tell which branches are followed; count the others and what they might have carried."""
        ledger, ior = self.context.ledger, self.context.scene.lobes.number[:, 0]
        weight = largest_channel(throughput)
        # Within glass radiance counts by its index squared, which is given back on the way out.
        weight = np.where(medium != NOTHING, weight * ior[medium] ** 2, weight)
        is_faint = weight < LEAST_CONTRIBUTION
        is_deep = ~is_faint & (depth > self.context.max_depth)
        ends = is_faint | is_deep
        ledger.ended["below least contribution"] += int(np.count_nonzero(is_faint & (weight > 0.0)))
        ledger.ended["at max_depth"] += int(np.count_nonzero(is_deep))
        ledger.lost_weight += float(weight[ends].sum())
        return ~ends


@dataclass(frozen=True)
class _Meeting:
    """Rays on arrival: where, on what, and what they carry."""

    rays: Branches
    hits: HitRecord
    material: IntArray
    colors: FloatArray
    throughput: FloatArray
    medium: IntArray


@dataclass(frozen=True)
class _Part:
    """Branches of one kind: row of the parent, number of the choice, and the new ray."""

    parent: NDArray[np.intp]
    choice: int
    directions: FloatArray
    throughput: FloatArray
    medium: IntArray


def _leaving_camera(block: CameraBlock) -> Branches:
    n = block.pixel.size
    return Branches(
        depth=0,
        camera_ray=np.arange(n),
        node=np.ones(n, dtype=np.uint64),
        origins=block.origins,
        directions=block.directions,
        throughput=np.ones((n, 3)),
        medium=np.full(n, NOTHING, dtype=np.int32),
        source=None,
    )


def _mirrored(met: _Meeting, rows: NDArray[np.intp], choice: int, color: FloatArray) -> _Part:
    directions = np.empty((rows.size, 3))
    mirror_directions(met.rays.directions[rows], met.hits.normal[rows], directions)
    return _Part(rows, choice, directions, met.throughput[rows] * color, met.medium[rows])


def _at_glass(met: _Meeting, rows: NDArray[np.intp], slot: int, lobes: LobeTable) -> list[_Part]:
    """Split rays at a dielectric: one part goes back, the other passes the surface."""
    lobe = lobes.first[met.material[rows]] + np.int32(slot)
    numbers, tint = lobes.number[lobe], met.colors[rows, slot]
    n = rows.size
    reflectance, refracted, eta = np.empty(n), np.empty((n, 3)), np.empty(n)
    incoming, normal = met.rays.directions[rows], met.hits.normal[rows]
    ior, use_schlick = np.ascontiguousarray(numbers[:, 0]), np.ascontiguousarray(numbers[:, 1])
    split_at_glass(incoming, normal, ior, use_schlick, reflectance, refracted, eta)
    back = _mirrored(met, rows, 2 * slot, reflectance[:, None])
    passes = reflectance < 1.0
    # Radiance over the index squared is what stays the same across the surface.
    share = ((1.0 - reflectance) / eta**2)[:, None] * tint
    through = _Part(
        rows[passes],
        2 * slot + 1,
        refracted[passes],
        (met.throughput[rows] * share)[passes],
        np.where(met.hits.front_face[rows], lobe, NOTHING)[passes],
    )
    return [back, through]


def _in_batches(rays: Branches) -> list[Branches]:
    """Cut a batch between camera rays so that no piece is much larger than a block.

    The branches of one camera ray stay together, so each pixel's sum has one order of terms
    whatever the size of a block.
    """
    if len(rays) == 0:
        return []
    n_pieces = -(-len(rays) // BLOCK)
    cuts = rays.camera_ray[[len(rays) * k // n_pieces for k in range(1, n_pieces)]]
    edges = [0, *np.searchsorted(rays.camera_ray, cuts), len(rays)]
    return [rays[first:last] for first, last in pairwise(edges) if last > first]
