"""The projection map: bounding spheres of caustic casters, at which photons are aimed.

Jensen's projection map ("Global illumination using photon maps", EGWR 1996) marks the directions in
which a light sees such surfaces. Bounding spheres serve all points of all lights at once, and the
pdf of directions toward them has a closed form. A surface that fills its sphere poorly is covered
by several smaller ones.
"""

import math

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.integrators.kernels.photon_emission import Targets
from hybrid_rt.primitives.instances import Instances
from hybrid_rt.scene.compiled import CompiledScene
from meshing.surface import Surface

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


def targets_of(scene: CompiledScene, throws: BoolArray) -> Targets:
    """Return the bounding spheres of all bounded surfaces that cast caustics.

    ``throws`` (materials + 1,) bool: materials that cast caustics; the last row is for `NOTHING`.
    Returns the largest first; none lies within another.
    """
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
