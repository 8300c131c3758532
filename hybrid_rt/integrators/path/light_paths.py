"""Light subpaths of each pass: traced from area lights, splatted to the film, kept for connections.

Where mirrors, glass or narrow lobes lead a light subpath to a surface with a non-delta lobe, that vertex is
splatted to the pixel that sees it, and kept as a light vertex for camera paths to connect to.
`hybrid_rt.integrators.kernels.light_paths` derives the weights.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.memory import available_bytes, bytes_in_words
from hybrid_rt.core.records import BoolArray, FloatArray, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import SurfaceLight
from hybrid_rt.integrators.kernels import light_paths as kernels
from hybrid_rt.integrators.kernels.connections import (
    CANDIDATE_COLUMNS,
    CANDIDATES,
    splat_light_vertices,
)
from hybrid_rt.integrators.kernels.light_paths import LightPaths, LightVertices
from hybrid_rt.integrators.kernels.light_sampling import choose_lights
from hybrid_rt.integrators.light_points import leaving_points
from hybrid_rt.integrators.media.absorption import absorb, square_of_index
from hybrid_rt.integrators.media.beginnings import MediaAroundCamera, MediaAroundLights
from hybrid_rt.integrators.media.contacts import Contacts, first_hits
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.rows import joined, new_rows, rows_of
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.light_kinds import SURFACE
from hybrid_rt.shading.kernels.lobes.register import DELTA, DIFFUSE, SPREADS, TRANSMITS

# Dimensions of light paths, far from those of the camera's: light, place, direction, lens, then
# two for each direction taken at a surface.
FIRST_LIGHT_DIMENSION = 2**20
LIGHT, PLACE, TURN, LENS, FIRST_STEP = 0, 1, 2, 3, 4
# A pass that no render reaches tells how many light paths are useful. It is
# only a weight: a wrong figure costs noise and no more.
PILOT_PASS, PILOT_PATHS = 2**32 - 1, 4096
# Part of the usual distance between light vertices below which connections are too noisy.
NEAR = 0.2
# Paths that are traced at once, of one pass or several: each takes about 300 bytes. A pass of more is
# shared among threads.
AT_ONCE = 2**16
# Paths of all passes that are prepared together, unless one pass has more: what they leave stays in memory.
MOST_TOGETHER = 2**20
# Of each light vertex that is kept, with what connections compare and the splat.
PER_VERTEX = 600
# Bytes of a line of the cache.
LINE = 64


@dataclass(frozen=True)
class LightVertexPasses:
    """The light vertices of some passes, or of a part of one, and their splats."""

    passes: range
    points: LightVertices  # those that camera paths are connected to, in the order of the passes
    offsets: NDArray[np.int64]  # (passes + 1,), first row of each pass
    first_splat: NDArray[np.int64]  # (passes + 1,), first splat of each pass
    pixel: NDArray[np.int64]  # (splats,), that sees a light vertex; -1: none
    value: FloatArray  # (splats, 3), radiance splatted there


class LightOfPasses(NamedTuple):
    """The light vertices that the camera paths of some passes are connected with."""

    first_pass: int
    points: LightVertices  # see `packed`
    first_of_pass: IntArray  # (passes + 1,), first row of each pass
    candidates: FloatArray  # see `candidates_of`
    first_group: IntArray


class LightPathTracer:
    """Traces light subpaths, pass by pass; each pass is a pure function of seed and number.

    ``contacts``: None if no dielectric touches another surface.
    ``keeps_all``: the vertices of all light are kept, not only of what mirrors and lenses throw.
    ``n_paths``: light subpaths per pass.
    ``is_smooth`` (objects,) bool: objects with interpolated shading normals.
    ``min_distance``: from which on light is found by connections alone; inf until it is estimated.
    """

    def __init__(
        self,
        context: RenderContext,
        light: SurfaceLight,
        contacts: Contacts | None,
        around_camera: MediaAroundCamera,
        options: PathOptions,
        keeps_all: bool,
    ) -> None:
        self.keeps_all, self.min_distance = keeps_all, np.inf
        self._context, self._light, self._contacts = context, light, contacts
        scene = context.scene
        camera = scene.camera
        self.n_paths = options.n_light_paths(camera.width * camera.height)
        self._emit = scene.lights.emit
        self._before = np.cumsum(self._emit)
        sends = np.flatnonzero(self._emit[:-1])
        self._media_around = MediaAroundLights(context, contacts, sends.tolist())
        self._media_around_camera = around_camera
        # Rough glass is a delta surface where it is hidden, or the index is the same on both sides.
        self._may_be_delta = scene.materials_with(DELTA | TRANSMITS)
        self._narrow = scene.narrow_materials
        self.is_smooth = np.zeros(max(len(scene.surfaces), 1), dtype=np.bool_)
        self.is_smooth[list(scene.vertex_normals)] = True

    def estimate_vertices_per_path(self) -> float:
        """Estimate the number of light vertices per light subpath, and `min_distance`, from a few subpaths.

        Raises
        ------
        MemoryError
            If those of a pass are more than this process can have.
        """
        points, _, _ = self._trace(range(PILOT_PASS, PILOT_PASS + 1), PILOT_PATHS, PILOT_PATHS)
        n_found = points.density.size
        points, _ = self._to_connect(points)
        needed = PER_VERTEX * self.n_paths * n_found // PILOT_PATHS
        if needed > available_bytes():
            raise MemoryError(
                f"a pass of {self.n_paths} light subpaths takes about {bytes_in_words(needed)} of memory, this "
                f"process can have {bytes_in_words(available_bytes())}: pass a smaller light_paths (--light-paths)"
            )
        half = points.density.size // 2
        if self.keeps_all and half:
            between = points.position[:half] - points.position[half : 2 * half]
            self.min_distance = NEAR * float(np.median(np.linalg.norm(between, axis=1)))
        # Those that are splatted alone are useful as well.
        return float(max(points.density.size, min(n_found, 1)) / PILOT_PATHS)

    @property
    def most_at_once(self) -> int:
        """How many passes may be traced before camera paths use them up."""
        return max(MOST_TOGETHER // self.n_paths, 1)

    @property
    def parts(self) -> int:
        """In how many parts the light subpaths of a pass are traced."""
        return -(-self.n_paths // AT_ONCE)

    def trace(self, passes: range, part: int = 0) -> LightVertexPasses:
        """Trace a part of the light subpaths of some passes."""
        first = part * AT_ONCE
        count = min(AT_ONCE, self.n_paths - first)
        step = AT_ONCE // count
        runs = [
            self._trace(passes[i : i + step], self.n_paths, count, first)
            for i in range(0, len(passes), step)
        ]
        points = joined([run[0] for run in runs])
        number, path = (np.concatenate([run[k] for run in runs]) for k in (1, 2))
        self._context.ledger.rays["light paths"] += count * len(passes)
        splats = self._shown(points, number, path)
        points, kept = self._to_connect(points)
        ends = np.arange(passes.start, passes.stop + 1)
        offsets, first_splat = np.searchsorted(number[kept], ends), np.searchsorted(number, ends)
        return LightVertexPasses(passes, points, offsets, first_splat, *splats)

    def _to_connect(self, points: LightVertices) -> tuple[LightVertices, NDArray[np.int64]]:
        """Return the light vertices that camera paths are connected to, and their rows."""
        rows = np.flatnonzero(~self._narrow[points.material])
        if rows.size < points.density.size:
            points = rows_of(points, rows)
        return points, rows

    def _trace(
        self, passes: range, n: int, count: int, first: int = 0
    ) -> tuple[LightVertices, UIntArray, UIntArray]:
        """Return light vertices, the passes that they belong to and the numbers of their paths.

        Of the n paths of each pass ``count`` are traced, from number ``first`` on.
        """
        context, scene = self._context, self._context.scene
        paths = self._leaving_lights(passes, n, np.arange(first, first + count, dtype=np.uint64))
        found = [(new_light_vertices(0, self._light.n_slots), paths.sample[:0], paths.number[:0])]
        # The way to the camera takes one direction more than those before the point; so does a mirror or lens
        # at its beginning.
        for step in range(context.max_depth + bool(self._narrow.any())):
            with context.ledger.stage("intersect"):
                source = NamedPoints(paths.source_id, paths.origins)
                hits, second = first_hits(
                    context.tracer, self._contacts, paths.origins, paths.directions, source
                )
            material = self._light.material(hits)
            absorb(context, paths.media, material, hits, second, paths.flux)
            ends = self._ends(paths, material, step)
            material = np.where(ends, np.int32(NOTHING), material)
            shading = self._light.shading(hits, paths.directions, material, paths.media, second)
            hits = shading.hits
            if step > 0 or self.keeps_all:
                out, row = (
                    new_light_vertices(material.size, self._light.n_slots),
                    np.empty_like(material),
                )
                n_out = kernels.store_light_vertices(
                    paths, scene.lobes, self._narrow, shading.vertices, hits.object_id, step,
                    self.keeps_all, out, row,
                )  # fmt: skip
                points = rows_of(out, slice(n_out))
                found.append((points, paths.sample[row[:n_out]], paths.number[row[:n_out]]))
            going = LightPaths(*(np.empty_like(column) for column in paths))
            n_going = kernels.extend_light_paths(
                paths, scene.lobes, scene.lights, self._narrow, shading.vertices, hits.object_id,
                self.is_smooth, second,
                self._points(paths.sample, paths.number, FIRST_STEP + 2 * step),
                self._points(paths.sample, paths.number, FIRST_STEP + 2 * step + 1), step,
                self.keeps_all, going,
            )  # fmt: skip
            paths = rows_of(going, slice(n_going))
            if n_going == 0:
                break
        lists, samples, numbers = zip(*found, strict=True)
        sample = np.concatenate(samples)
        # Within a pass by steps and number, whichever passes were traced together.
        order = np.argsort(sample, kind="stable")
        return rows_of(joined(lists), order), sample[order], np.concatenate(numbers)[order]

    def _ends(self, paths: LightPaths, material: IntArray, step: int) -> BoolArray:
        """Return which paths end: their light is not kept, and nothing narrow leads on."""
        passes = self._narrow[material]  # see `is_treated_as_specular`
        if step == 0:
            passes &= self._context.scene.lights.kind[paths.light_id] != SURFACE
        ends: BoolArray = (paths.is_direct & ~passes) | (paths.density == 0.0)
        ends &= ~self._may_be_delta[material]
        if self.keeps_all:
            ends &= paths.number % np.uint64(kernels.FOLLOWED_FAR) != 0
        return ends

    def _leaving_lights(self, passes: range, n: int, numbers: UIntArray) -> LightPaths:
        context, scene = self._context, self._context.scene
        sample = np.repeat(np.arange(passes.start, passes.stop, dtype=np.uint64), numbers.size)
        number = np.tile(numbers, len(passes))
        light = np.empty(number.size, dtype=np.int32)
        place = self._points(sample, number, PLACE)
        choose_lights(self._before, self._emit, self._points(sample, number, LIGHT), light)
        paths = LightPaths(
            sample=sample,
            number=number,
            origins=np.empty((number.size, 3)),
            directions=np.empty((number.size, 3)),
            flux=np.empty((number.size, 3)),
            density=np.empty(number.size),
            is_direct=np.ones(number.size, dtype=np.bool_),
            is_left=np.zeros(number.size, dtype=np.bool_),
            media=np.empty((number.size, 0), dtype=np.int32),
            source_id=scene.surface_of_light.take(light),
            begins_late=np.zeros(number.size, dtype=np.bool_),
            light_id=light,
            cosine=np.empty(number.size),
        )
        kernels.leave_lights(
            scene.lights, scene.textures, leaving_points(scene, light, place), self._emit, light, place,
            self._points(sample, number, TURN), 1.0 / n, paths.origins, paths.directions, paths.flux,
            paths.density, paths.cosine,
        )  # fmt: skip
        with context.ledger.stage("intersect"):
            media = self._media_around.at(light, paths.origins, paths.directions)
        paths = paths._replace(media=media)
        if context.plan["medium stack"]:
            paths.density[:] /= square_of_index(paths.media, scene.lobes)
        return paths

    def _shown(
        self, points: LightVertices, sample: UIntArray, path: UIntArray
    ) -> tuple[NDArray[np.int64], FloatArray]:
        """Return the pixels that see light vertices, and what each adds to them."""
        context, camera = self._context, self._context.scene.camera
        n = points.density.size
        lens = None
        if context.plan["lens samples"]:
            lens = self._points(sample, path, LENS)
        way, pixel, pdf = camera.sees(points.position, lens)
        value = np.empty((n, 3))
        splat_light_vertices(
            points, context.scene.lobes, way, pdf, float(self.n_paths),
            self._media_around_camera.of_rays(points.position - way), context.max_depth, value,
        )  # fmt: skip
        rows = np.flatnonzero(value.any(axis=1))
        named = NamedPoints(points.object_id[rows], points.position[rows])
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(named.position, -way[rows], 1.0, source=named)
        context.ledger.rays["shadow"] += rows.size
        pixel[value.max(axis=1, initial=0.0) == 0.0] = NOTHING
        pixel[rows[blocked]] = NOTHING
        return pixel, value

    def _points(self, sample: UIntArray, path: UIntArray, use: int) -> FloatArray:
        # The paths of a pass are the samples of one sequence, so they fill lights and directions
        # evenly; each pass has a sequence of its own.
        return self._context.sampler.points(sample, FIRST_LIGHT_DIMENSION + use, path)


def diffuse_materials(lobes: LobeTable) -> BoolArray:
    """Return which materials spread light by diffuse lobes and no others, (materials,)."""
    is_diffuse = lobes.kind == DIFFUSE
    spreads = lobes.traits & SPREADS != 0
    return np.array(
        [
            bool(is_diffuse[i:j].any() and not (spreads & ~is_diffuse)[i:j].any())
            for i, j in pairwise(lobes.first.tolist())
        ],
        dtype=np.bool_,
    )


def finds_all_light(scene: CompiledScene) -> bool:
    """Tell whether light subpaths carry the light of all lamps to all surfaces.

    None begin at lamps without area, on planes or in the sky, and none go on from mirrors or lenses
    with interpolated normals.
    """
    shines = scene.lights.strength.any(axis=1)
    begins = scene.lights.emit[:-1] > 0.0
    return scene.environment is None and not scene.vertex_normals and bool((begins | ~shines).all())


def new_light_vertices(n: int, n_slots: int) -> LightVertices:
    """Allocate n light vertices."""
    form = f"3f8, 3f8, 3f8, 3f8, i4, ({n_slots},3)f8, 3f8, f8, f8, f8, f8, i4, i8"
    return new_rows(LightVertices, n, form)


def packed(points: LightVertices) -> LightVertices:
    """Return light vertices with all columns of a row next to each other in memory.

    A connection reads one row at random: so it waits for memory a few times instead of once a column.
    There are two rows at least, and no column is empty: else columns would be of another type for
    numba, and the kernels that follow paths be compiled twice.
    """
    n, columns = points.density.size, points._asdict()
    row = [
        (name, column.dtype, tuple(max(width, 1) for width in column.shape[1:]))
        for name, column in columns.items()
    ]
    table = np.empty(max(n, 2), dtype=np.dtype(row, align=True))
    for name, column in columns.items():
        if column.size:
            table[name][:n] = column
    return LightVertices(*(table[name] for name in points._fields))


def candidates_of(
    points: LightVertices, first_of_pass: IntArray, diffuse_only: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Return what `choose_far` compares, (groups, CANDIDATE_COLUMNS, CANDIDATES), and the first group of each pass.

    A light vertex whose material is not among ``diffuse_only`` has strength zero, as the members that a group
    lacks do.
    """
    sizes = -(-np.diff(first_of_pass) // CANDIDATES)
    first_group = np.concatenate([[0], np.cumsum(sizes)])
    facing = np.einsum("ij,ij->i", points.geometric, points.direction)
    strength = np.where(diffuse_only[points.material], -np.sign(facing) * points.strength, 0.0)
    column = np.column_stack(
        [points.position, strength[:, None] * points.geometric, points.steps.astype(np.float64)]
    )
    table = _aligned_zeros((int(first_group[-1]), CANDIDATE_COLUMNS, CANDIDATES))
    for number, (begin, end) in enumerate(pairwise(first_of_pass.tolist())):
        first, n_groups = first_group[number], sizes[number]
        for j in range(CANDIDATES):
            rows = column[begin + j * n_groups : min(begin + (j + 1) * n_groups, end)]
            table[first : first + len(rows), :, j] = rows
    return table, first_group


def _aligned_zeros(shape: tuple[int, ...]) -> FloatArray:
    """Return zeros that begin at a line of the cache."""
    n = math.prod(shape)
    memory = np.zeros(n + LINE // 8)
    first = -(memory.ctypes.data // 8) % (LINE // 8)
    return memory[first : first + n].reshape(shape)
