"""What photons are sent: the power of each light, their sequences and blocks, and the projection map.

Jensen's projection map ("Global illumination using photon maps", EGWR 1996) marks the directions in
which a light sees surfaces that cast caustics; photons are aimed there. Bounding spheres of such surfaces
serve all points of all lights at once, and the pdf of directions toward them has a closed form. A
surface that fills its sphere poorly is covered by several smaller ones.
"""

import functools
import math
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_emission import Targets
from hybrid_rt.integrators.path import PATH
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives.instances import Instances
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.sensor.passes import GROUPS, group_of
from hybrid_rt.shading.kernels.lobes.register import FOLLOWED, WIDE
from meshing.surface import Surface, box_around

# About how many photons one thread follows at a time, and how many at least, if others may join them.
AT_ONCE, FEWEST = 2**16, 2**12
# A photon is named by its sequence, and below that by so many bits of its number there.
NUMBER_BITS = np.uint64(42)
# Camera rays, across and down, that tell how large a part of the scene is seen; how many surfaces they
# meet at most, two ways at each; and what is far less.
VIEWS, MOST_VIEWS, FAR_LESS = 8, 6, 0.01
# Sizes of scenes, scene units. Float32 loses 1e-5 of the light at 1e-18, a tenth at 1e-20; from 1e21 on
# pictures are infinite.
SMALLEST, LARGEST = 1e-17, 1e18
# Balls about one surface, and about all that are covered by several: each photon looks at all balls of a scene.
MOST_BALLS, MOST_BALLS_OF_ALL = 16, 64
# Cells that a surface is cut into, about, and all together; balls hold whole cells. A quarter of them has 1.6
# times the noise where a pane is much larger than what is seen.
CELLS, CELLS_OF_ALL = 4096, 2**14
# A ball about the corners of cells reaches this much farther, as cells are curved. What sticks out
# nevertheless is found by photons that are not aimed.
MARGIN = 1.01
# Covers whose sums of squared radii are at most this times the least.
ABOUT_AS_GOOD = 1.25

Ball = tuple[FloatArray, float]


@dataclass(frozen=True)
class Group:
    """The photons of one light and kind.

    ``light`` is a row of the light table; the number of lights stands for the environment.
    ``n_spread`` and ``n_aimed`` are the photons per pass of either kind from this light.
    """

    number: int
    light: int
    is_aimed: bool
    n_spread: int
    n_aimed: int

    @property
    def n(self) -> int:
        """Photons of this group per pass."""
        return self.n_aimed if self.is_aimed else self.n_spread


class Piece(NamedTuple):
    """Consecutive photons of a group in one pass."""

    group: Group
    first: int
    stop: int


def sequence_of(group: Group, pass_number: int) -> tuple[int, int]:
    """Return the sequence that a pass continues, and the index of its first point there.

    Each group of passes has a sequence of its own, so that the differences between groups measure
    the noise (`hybrid_rt.sensor.film`).
    """
    compared, number = _place_of(pass_number)
    return group.number * GROUPS + compared, number * group.n


@functools.lru_cache
def _place_of(pass_number: int) -> tuple[int, int]:
    compared, number = group_of(np.array([pass_number], dtype=np.uint64))
    return int(compared[0]), int(number[0])


def names_of(piece: Piece, pass_number: int) -> UIntArray:
    """Return what names the random numbers of each photon of a piece, (n,) uint64."""
    sequence, begin = sequence_of(piece.group, pass_number)
    number = np.arange(begin + piece.first, begin + piece.stop, dtype=np.uint64)
    return number + (np.uint64(sequence) << NUMBER_BITS)


def blocks_of(groups: list[Group]) -> list[list[Piece]]:
    """Return the blocks in which the photons of a pass are traced: small groups share one."""
    blocks, some, waiting = list[list[Piece]](), list[Piece](), 0
    for group in groups:
        if group.n >= FEWEST:
            parts = max(round(group.n / AT_ONCE), 1)
            edges = np.linspace(0, group.n, parts + 1).round().astype(int).tolist()
            blocks += [[Piece(group, *part)] for part in pairwise(edges)]
            continue
        some.append(Piece(group, 0, group.n))
        waiting += group.n
        if waiting >= FEWEST:
            blocks.append(some)
            some, waiting = [], 0
    return [*blocks, some] if some else blocks


def in_sequence(names: UIntArray) -> tuple[UIntArray, UIntArray]:
    """Return which sequences the photons of these names take their points from, and the indices there.

    A sequence has 2**32 points; beyond, the next one begins.
    """
    low, bits = names & np.uint64(2**32 - 1), np.uint64(32)
    number = names & ((np.uint64(1) << NUMBER_BITS) - np.uint64(1))
    return (names >> NUMBER_BITS << bits) + (number >> bits), low


def ball_of_world(scene: CompiledScene) -> FloatArray:
    """Return centre and radius of a ball around all surfaces that end."""
    bounds = scene.bounds[np.isfinite(scene.bounds).all(axis=(1, 2))]
    if not len(bounds):
        return np.array([0.0, 0.0, 0.0, 1.0])
    low, high = box_around(bounds)
    return np.array([*(0.5 * (low + high)), 0.5 * np.linalg.norm(high - low)])


def size_for_discs(context: RenderContext) -> float:
    """Return the size that radii are compared with, scene units.

    It is the diagonal of the box around all surfaces that end. A room may have huge spheres as walls, so
    the box around the camera and the points that it sees, directly or by way of mirrors and glass, is
    taken instead if its diagonal is a `FAR_LESS` part of that.
    """
    scene, camera = context.scene, context.scene.camera
    size = 2.0 * float(ball_of_world(scene)[3])
    place = (np.arange(VIEWS) + 0.5) / VIEWS
    column, row = np.meshgrid(place * camera.width, place * camera.height)
    rays = camera.rays(column.ravel(), row.ravel())
    seen = _points_seen(scene, context.tracer.with_own_counters(), *rays)
    if not len(seen):
        return size
    in_view = float(np.linalg.norm(np.ptp(np.vstack([seen, camera.look_from]), axis=0)))
    return in_view if 0.0 < in_view < FAR_LESS * size else size


def _points_seen(
    scene: CompiledScene, tracer: Intersector, origins: FloatArray, directions: FloatArray
) -> FloatArray:
    """Return where rays meet lamps and surfaces on which photons are gathered, (n, 3).

    Elsewhere they go on both straight ahead, which is about where glass sends them, and mirrored.
    """
    ends = np.append(scene.materials_with(WIDE)[:-1], True)  # lamps have no material: -1
    found, source = [], None
    for _ in range(MOST_VIEWS):
        hits = tracer.intersect(origins, directions, source=source)
        is_end = hits.hit.copy()
        is_end[is_end] = ends[scene.material_of[hits.object_id[is_end]]]
        found.append(hits.position[is_end])
        on = np.flatnonzero(hits.hit & ~is_end)
        if not len(on):
            break
        ahead, normal = directions[on], hits.normal[on]
        mirrored = ahead - 2.0 * (ahead * normal).sum(axis=1, keepdims=True) * normal
        origins, directions = np.tile(hits.position[on], (2, 1)), np.vstack([ahead, mirrored])
        source = NamedPoints(np.tile(hits.object_id[on], 2), origins)
    return np.concatenate(found)


def powers_of_lights(scene: CompiledScene, world: FloatArray) -> FloatArray:
    """Return about how much each light sends out, (lights + 1,), the sky last; see `PhotonTracer`."""
    size = 2.0 * float(world[3])
    if size > 0.0 and not SMALLEST <= size <= LARGEST:
        raise ValueError(
            f"the scene is {size:.3g} across: photons need {SMALLEST:g} to {LARGEST:g}, so choose "
            f"another unit of length, or use integrator {PATH.name!r}"
        )
    power = np.append(scene.power, 0.0)
    endless = [i for i, surface in enumerate(scene.surfaces) if not surface.is_bounded]
    shining = np.intersect1d(endless, scene.surface_of_light)
    if shining.size:
        raise ValueError(
            f"{scene.called[shining[0]]} is a plane that shines, so sends out photons "
            f"without end: pass a Rectangle, or use integrator {PATH.name!r}"
        )
    if scene.environment is not None:
        if endless:
            raise ValueError(
                f"{scene.called[endless[0]]} is a plane, to which the sky sends photons "
                f"without end: pass a Rectangle, or use integrator {PATH.name!r}"
            )
        power[-1] = 4.0 * math.pi**2 * world[3] ** 2 * scene.brightness.mean
    return power


def targets_of(scene: CompiledScene) -> Targets:
    """Return the bounding spheres of all bounded surfaces that cast caustics.

    Returns the largest first; none lies within another.
    """
    throws = scene.materials_with(FOLLOWED)
    surfaces = [scene.surfaces[i] for i in np.flatnonzero(throws[scene.material_of])]
    others = [surface for surface in surfaces if surface.is_bounded and surface.ball is None]
    most = min(max(MOST_BALLS_OF_ALL // max(len(others), 1), 1), MOST_BALLS)
    balls = [ball for surface in surfaces if (ball := surface.ball) is not None]
    for surface in others:
        balls += covering(_cells(surface, min(CELLS, CELLS_OF_ALL // len(others))), most)
    return _without_those_inside(balls)


def covering(cells: FloatArray, most: int = MOST_BALLS) -> list[Ball]:
    """Cover cells (n, corners, 3) by a few balls with a small sum of squared radii.

    That sum is proportional to the solid angle aimed at. The cells of the largest ball are split in
    two repeatedly, which gives a cover for each number of balls. Of the covers whose sum is near
    the least, the finest is returned: around a flat part seen edge-on, smaller balls waste less.
    """
    parts, middle = [np.arange(len(cells))], cells.mean(axis=1)
    balls = [_ball(cells)]
    covers = [balls]
    while len(balls) < most:
        largest = max(range(len(balls)), key=lambda k: balls[k][1])
        part = parts.pop(largest)
        if len(part) < 2:
            break
        extent = np.ptp(middle[part], axis=0)
        along = middle[part, extent.argmax()]
        order = np.argsort(along, kind="stable")
        # In the middle of the extent, not of the cells: they may be smaller in one half.
        cut = int(np.searchsorted(along[order], 0.5 * (along.min() + along.max())))
        halves = np.split(part[order], [min(max(cut, 1), len(part) - 1)])
        balls = balls[:largest] + balls[largest + 1 :] + [_ball(cells[half]) for half in halves]
        parts += halves
        covers.append(balls)
    squares = [sum(radius * radius for _, radius in balls) for balls in covers]
    good = np.flatnonzero(np.array(squares) <= ABOUT_AS_GOOD * min(squares))
    return covers[good[-1]]


def _cells(surface: Surface, n_cells: int) -> FloatArray:
    """Cut a surface into cells, instances into their places; return their corners (n, corners, 3)."""
    if surface.is_triangular:
        corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
        u, v = np.tile(corners, (len(surface), 1)).T
        return surface.point(u, v, np.repeat(np.arange(len(surface)), 3)).reshape(-1, 3, 3)
    if isinstance(surface, Instances):
        ends = np.array([(i, j, k) for i in (0, 1) for j in (0, 1) for k in (0, 1)])
        return np.stack([surface.boxes[:, ends[:, axis], axis] for axis in range(3)], axis=-1)
    n_patches = len(surface)
    n = max(math.isqrt(n_cells // n_patches), 4)
    edge = np.linspace(0.0, 1.0, n + 1)
    patch, u, v = np.meshgrid(np.arange(n_patches), edge, edge, indexing="ij")
    point: FloatArray = surface.point(u.ravel(), v.ravel(), patch.ravel())
    point = point.reshape(n_patches, n + 1, n + 1, 3)
    corners = np.empty((n_patches, n, n, 4, 3))
    for k, (i, j) in enumerate(((0, 0), (0, 1), (1, 0), (1, 1))):
        corners[:, :, :, k] = point[:, i : n + i, j : n + j]
    return corners.reshape(-1, 4, 3)


def _ball(cells: FloatArray) -> Ball:
    points = cells.reshape(-1, 3)
    center = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return center, MARGIN * float(np.sqrt(np.square(points - center).sum(axis=1).max()))


def _without_those_inside(balls: list[Ball]) -> Targets:
    """Leave out balls that lie within another one: they would only be aimed at twice."""
    balls = sorted(balls, key=lambda ball: -ball[1])
    center = np.array([center for center, _ in balls]).reshape(-1, 3)
    radius = np.array([radius for _, radius in balls], dtype=np.float64)
    kept: list[int] = []
    for k in range(len(balls)):
        reach = np.linalg.norm(center[kept] - center[k], axis=1) + radius[k]
        if (reach > radius[kept]).all():
            kept.append(k)
    return Targets(center[kept], radius[kept])
