"""Whitted ray tracing: direct light, mirrors and glass; a batch of rays, one level of depth at a time.

Whitted, "An improved illumination model for shaded display", CACM 23(6), 1980. Diffuse and glossy
surfaces are lit directly by every light (where there are more than 32, by 32 sampled in proportion
to their power); at mirrors and glass the reflected and the refracted ray are both followed. Glass casts a full shadow: caustics need photons or light subpaths.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import NO_CONNECTION, largest_channel
from hybrid_rt.integrators.integrator import BLOCK, FIRST_PATH_DIMENSION, CameraBlock, Integrator
from hybrid_rt.integrators.kernels.compaction import add_to_pixels
from hybrid_rt.integrators.media.absorption import absorb, square_of_index
from hybrid_rt.integrators.rows import rows_of
from hybrid_rt.integrators.shading import NO_RATIO, Shading, glass_branches
from hybrid_rt.integrators.whitted.all_lights import AllLights
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.shading.kernels.bsdf import sample_lobes
from hybrid_rt.shading.kernels.fresnel import mirror_directions
from hybrid_rt.shading.kernels.lobes.register import DELTA, NARROW, TRANSMITS

# A branch that changes its pixel by less than this, per unit of radiance, is not followed.
LEAST_CONTRIBUTION = 1e-3


@dataclass(frozen=True)
class Branches:
    """Active rays, in the order of their camera rays."""

    depth: int  # number of reflections and refractions so far
    camera_ray: NDArray[np.int64]  # (n,) int64: row in the block of camera rays
    # (n,) uint64: key of the branch's random numbers: its place in the ray tree, 1 at the camera
    node: UIntArray
    # (n, 3): directions are unit vectors
    origins: FloatArray
    directions: FloatArray
    throughput: FloatArray  # (n, 3)
    media: IntArray  # (n, STACK) int32: medium stacks; (n, 0) if the scene has no dielectric
    source: HitRecord | None  # hits that the rays leave; None at the camera

    def __len__(self) -> int:
        """Return the number of rays."""
        return int(self.camera_ray.size)


class Whitted(Integrator):
    """See the module; `Integrator` for what it offers."""

    def __init__(self, context: RenderContext) -> None:
        super().__init__(context)
        self._light = AllLights(context)
        lobes = context.scene.lobes
        # Traits of the n-th lobe of each material, and a last row for what has none (`NOTHING`).
        self._traits_in_slot = np.zeros((self._light.n_slots, lobes.first.size), dtype=np.int32)
        for material, (first, stop) in enumerate(pairwise(lobes.first)):
            self._traits_in_slot[: stop - first, material] = lobes.traits[first:stop]

    def _radiance(self, block: CameraBlock) -> FloatArray:
        radiance = np.zeros_like(block.directions)
        # Depth first over batches, breadth first within one: few batches wait at each depth, so
        # memory stays bounded however often glass splits the rays.
        waiting = [self._leaving_camera(block)]
        while waiting:
            rays = waiting.pop()
            # --- where the rays arrive
            hits, second = self._first_hits(rays.origins, rays.directions, rays.source)
            with self.context.ledger.stage("shade"):
                material = self._light.material(hits)
                # --- what the way there absorbed
                absorb(self.context, rays.media, material, hits, second, rays.throughput)
                # --- light they ran into
                no_choice = np.zeros(len(rays))
                gathered = rays.throughput * self._light.arriving(
                    hits, rays.origins, rays.directions, no_choice, NO_CONNECTION, rays.media
                )
                # --- light we reach for
                met = np.flatnonzero(material != NOTHING)
                hit_rays, second = rows_of(rays, met), rows_of(second, met)
                hits, material = hits[met], material[met]
                shading = self._light.shading(
                    hits, hit_rays.directions, material, hit_rays.media, second
                )
                gathered[met] += hit_rays.throughput * self._light.from_all(
                    shading,
                    hit_rays.media,
                    block.pixel[hit_rays.camera_ray],
                    self._dimension(hit_rays.node),
                    block.sample[hit_rays.camera_ray],
                )
                add_to_pixels(rays.camera_ray, gathered, radiance)
                # --- where they go next
                onward = self._onward(_Arrival(hit_rays, shading, second), block)
            waiting.extend(onward)
        return radiance

    def _leaving_camera(self, block: CameraBlock) -> Branches:
        n = block.pixel.size
        return Branches(
            depth=0,
            camera_ray=np.arange(n),
            node=np.ones(n, dtype=np.uint64),
            origins=block.origins,
            directions=block.directions,
            throughput=np.ones((n, 3)),
            media=np.repeat(self._camera_media[None], n, axis=0),
            source=None,
        )

    def _dimension(self, node: UIntArray) -> UIntArray:
        """Return the first of each branch's dimensions: one per light, sky, and one per lobe.

        Where glass is rough there is one more for each lobe.
        """
        n_slots = self._light.n_slots * (2 if self.context.plan["rough glass"] else 1)
        per_node = np.uint64(self.context.scene.n_lights + 1 + n_slots)
        return np.uint64(FIRST_PATH_DIMENSION) + node * per_node

    def _onward(self, met: _Arrival, block: CameraBlock) -> list[Branches]:
        """Return the mirrored and refracted rays, in batches of bounded size."""
        parts: list[_BranchBatch] = []
        plan = self.context.plan
        for slot, traits_of in enumerate(self._traits_in_slot):
            traits = traits_of[met.shading.material]
            passes, spreads = traits & TRANSMITS != 0, traits & NARROW != 0
            if plan["rough glass"]:
                spreads &= ~passes | (met.shading.ratio != 0.0)
            if plan["mirror rays"]:
                rows = np.flatnonzero(traits & (DELTA | TRANSMITS) == DELTA)
                parts.append(_mirrored(met, rows, 2 * slot, met.shading.colors[rows, slot]))
            rows = np.flatnonzero(spreads)
            if rows.size:
                parts += self._spread(met, rows, slot, block)
            if plan["glass rays"]:
                rows = np.flatnonzero(passes & ~spreads)
                parts += self._at_glass(met, rows, slot)
        if met.shading.geometric.size:
            parts = [_on_its_side(met, part) for part in parts]
        if not parts:
            return []
        return _in_batches(self._joined(met, parts))

    def _spread(
        self, met: _Arrival, rows: NDArray[np.intp], slot: int, block: CameraBlock
    ) -> list[_BranchBatch]:
        """Send rays on by a narrow lobe, each in one sampled direction."""
        lobes, shading = self.context.scene.lobes, met.shading
        rays = rows_of(met.rays, rows)
        pixel, sample = block.pixel[rays.camera_ray], block.sample[rays.camera_ray]
        dimension = self._dimension(rays.node)
        dimension += np.uint64(self.context.scene.n_lights + 1 + slot)
        xi = self.context.sampler.points(pixel, dimension, sample)
        ratio = branch = NO_RATIO
        if shading.ratio.size:
            ratio = shading.ratio[rows]
            dimension += np.uint64(self._light.n_slots)
            branch = self.context.sampler.points(pixel, dimension, sample)[:, 0].copy()
        # Only this lobe of the material: as a table of its own.
        lobe = lobes.first[shading.material[rows]] + np.int32(slot)
        alone = lobes._replace(first=np.arange(lobes.kind.size + 1, dtype=np.int32))
        colors = np.ascontiguousarray(shading.colors[rows, slot][:, None])
        n = rows.size
        directions, value, pdf = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
        sample_lobes(
            alone, lobe, colors, shading.hits.normal[rows], rays.directions, ratio, xi, branch,
            NARROW, directions, value, pdf,
        )  # fmt: skip
        going = _BranchBatch(rows, 2 * slot, directions, rays.throughput * value, rays.media)
        goes = pdf > 0.0
        if not ratio.size:
            return [rows_of(going, goes)]
        normal = shading.hits.normal[rows]
        before = np.einsum("ij,ij->i", normal, rays.directions)
        passes = before * np.einsum("ij,ij->i", normal, directions) > 0.0
        through = replace(going, choice=2 * slot + 1, media=shading.beyond[rows])
        return [rows_of(going, goes & ~passes), rows_of(through, goes & passes)]

    def _at_glass(self, met: _Arrival, rows: NDArray[np.intp], slot: int) -> list[_BranchBatch]:
        """Split rays at a dielectric: one part goes back, the other passes the surface."""
        lobes, shading = self.context.scene.lobes, met.shading
        lobe = lobes.first[shading.material[rows]] + np.int32(slot)
        reflectance, refracted, eta, beyond = glass_branches(
            lobes, lobe, shading, rows, met.rays.media, met.second
        )
        is_hidden = eta == 0.0
        eta[is_hidden] = 1.0
        weight = lobes.weight[lobe]
        tint = np.where(is_hidden[:, None], 1.0, shading.colors[rows, slot])
        back = _mirrored(met, rows, 2 * slot, (weight * reflectance)[:, None])
        # Radiance over the index squared is what stays the same across the surface.
        share = (weight * (1.0 - reflectance) / eta**2)[:, None] * tint
        through = _BranchBatch(
            rows, 2 * slot + 1, refracted, met.rays.throughput[rows] * share, beyond
        )
        return [back, rows_of(through, reflectance < 1.0)]

    def _joined(self, met: _Arrival, parts: list[_BranchBatch]) -> Branches:
        """Sort the surviving branches in the order of their parents."""
        parent = np.concatenate([part.parent for part in parts])
        choice = np.repeat([part.choice for part in parts], [part.parent.size for part in parts])
        throughput = np.concatenate([part.throughput for part in parts])
        media = np.concatenate([part.media for part in parts])
        depth = met.rays.depth + 1
        going = np.flatnonzero(self._goes_on(throughput, media, depth))
        order = going[np.argsort(parent[going], kind="stable")]
        parent, choice = parent[order], choice[order].astype(np.uint64)
        is_refracted = choice % np.uint64(2) == 1
        n_refracted = int(np.count_nonzero(is_refracted))
        self.context.ledger.rays["refracted"] += n_refracted
        self.context.ledger.rays["reflected"] += order.size - n_refracted
        hits = met.shading.hits
        return Branches(
            depth=depth,
            camera_ray=met.rays.camera_ray[parent],
            # Odd, as powers of an even factor leave nothing of 64 bits in a deep tree.
            node=met.rays.node[parent] * np.uint64(2 * self._light.n_slots + 1) + choice,
            origins=hits.position.take(parent, axis=0),
            directions=np.concatenate([part.directions for part in parts]).take(order, axis=0),
            throughput=throughput.take(order, axis=0),
            media=media.take(order, axis=0),
            source=hits[parent],
        )

    def _goes_on(self, throughput: FloatArray, media: IntArray, depth: int) -> BoolArray:
        """Tell which branches are followed; count the others and what they might have carried."""
        ledger = self.context.ledger
        weight = largest_channel(throughput) * square_of_index(media, self.context.scene.lobes)
        is_faint = weight < LEAST_CONTRIBUTION
        is_deep = ~is_faint & (depth > self.context.max_depth)
        ends = is_faint | is_deep
        ledger.ended["below least contribution"] += int(np.count_nonzero(is_faint & (weight > 0.0)))
        ledger.ended["at max_depth"] += int(np.count_nonzero(is_deep))
        ledger.lost_weight += float(weight[ends].sum())
        return ~ends


@dataclass(frozen=True)
class _Arrival:
    """Rays on arrival at an object, where, and on what other face (see `Contacts.at`)."""

    rays: Branches
    shading: Shading
    second: IntArray


@dataclass(frozen=True)
class _BranchBatch:
    """Branches of one kind: row of the parent, number of the choice, and the new ray.

    Choices of refracted branches are odd.
    """

    parent: NDArray[np.intp]
    choice: int
    directions: FloatArray
    throughput: FloatArray
    media: IntArray

    @property
    def is_refracted(self) -> bool:
        """Whether the branches pass the surface."""
        return self.choice % 2 == 1


def _on_its_side(met: _Arrival, part: _BranchBatch) -> _BranchBatch:
    """Leave out branches that a shading normal sends to the wrong side of the face."""
    geometric = met.shading.geometric[part.parent]
    before = np.einsum("ij,ij->i", geometric, met.shading.directions[part.parent])
    passes = before * np.einsum("ij,ij->i", geometric, part.directions) >= 0.0
    return rows_of(part, passes == part.is_refracted)


def _mirrored(
    met: _Arrival, rows: NDArray[np.intp], choice: int, color: FloatArray
) -> _BranchBatch:
    directions = np.empty((rows.size, 3))
    mirror_directions(met.shading.directions[rows], met.shading.hits.normal[rows], directions)
    return _BranchBatch(
        rows, choice, directions, met.rays.throughput[rows] * color, met.rays.media[rows]
    )


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
    return [rows_of(rays, slice(first, last)) for first, last in pairwise(edges) if last > first]
