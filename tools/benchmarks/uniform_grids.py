"""The baseline of adaptive tessellation: the smallest uniform grid of equal deviation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray

# Sides of a grid that are tried, u over v: bends may lie all in one direction.
ASPECTS = tuple(2.0**k for k in range(-5, 6))
# Points per cell and side at which a grid's deviation is measured.
SAMPLES = 4


@dataclass(frozen=True)
class Grid:
    """A grid of equal cells on each piece of a surface, two triangles a cell.

    Attributes
    ----------
    columns, rows : int
        Cells along u and v.
    triangles : int
    deviation : float
        Largest distance at equal parameters, measured. Scene units.
    """

    columns: int
    rows: int
    triangles: int
    deviation: float


def best_uniform_grid(surface: Any, deviation: float) -> Grid:
    """Find the grid of fewest triangles whose measured deviation is at most the given one.

    Parameters
    ----------
    surface : BezierPatches or SurfaceOfRevolution
    deviation : float
        Scene units.
    """
    found = [_smallest(surface, aspect, deviation) for aspect in ASPECTS]
    return min(found, key=lambda grid: grid.triangles)


def _smallest(surface: Any, aspect: float, deviation: float) -> Grid:
    """Find the smallest grid of about the given aspect: deviations fall with the square."""
    root = np.sqrt(aspect)
    low, high = 0, 1
    grid = _grid(surface, root * high, high / root)
    while grid.deviation > deviation:
        low = high
        high = max(int(high * min(np.sqrt(grid.deviation / deviation), 8.0)), high + 1)
        grid = _grid(surface, root * high, high / root)
    while high - low > 1:
        middle = (low + high) // 2
        other = _grid(surface, root * middle, middle / root)
        if other.deviation <= deviation:
            high, grid = middle, other
        else:
            low = middle
    return grid


def _grid(surface: Any, columns: float, rows: float) -> Grid:
    nu, nv = max(round(columns), 1), max(round(rows), 1)
    n_pieces = len(surface)
    return Grid(nu, nv, 2 * nu * nv * n_pieces, _deviation(surface, nu, nv))


def _deviation(surface: Any, nu: int, nv: int) -> float:
    """Measure both triangles of each cell at a lattice of points."""
    x, y = (np.arange(SAMPLES) + 0.5) / SAMPLES, (np.arange(SAMPLES) + 0.5) / SAMPLES
    x, y = (part.ravel() for part in np.meshgrid(x, y, indexing="ij"))
    lower = x + y <= 1.0
    # Weights of the corners (0, 0), (1, 0), (0, 1), (1, 1) of a cell.
    weights = np.stack(
        [
            np.where(lower, 1 - x - y, 0.0),
            np.where(lower, x, 1 - y),
            np.where(lower, y, 1 - x),
            np.where(lower, 0.0, x + y - 1),
        ],
        axis=1,
    )
    worst = 0.0
    for piece in range(len(surface)):
        corners = _points(surface, np.arange(nu + 1) / nu, np.arange(nv + 1) / nv, piece)
        cells = np.stack(
            [corners[:-1, :-1], corners[1:, :-1], corners[:-1, 1:], corners[1:, 1:]], axis=2
        )
        for a, b, w in zip(x, y, weights, strict=True):
            true = _points(surface, (np.arange(nu) + a) / nu, (np.arange(nv) + b) / nv, piece)
            flat = np.einsum("k,ijkc->ijc", w, cells)
            worst = max(worst, float(np.linalg.norm(flat - true, axis=-1).max()))
    return worst


def _points(surface: Any, u: FloatArray, v: FloatArray, piece: int) -> FloatArray:
    uu, vv = (part.ravel() for part in np.meshgrid(u, v, indexing="ij"))
    which: NDArray[np.int64] = np.full(len(uu), piece)
    return np.asarray(surface.point(uu, vv, which)).reshape(len(u), len(v), 3)
