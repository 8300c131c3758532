"""Deviation bounds for surfaces of revolution: into how many cells to cut each ring.

The bound is that of `meshing.kernels.leaves`. Over a piece of the profile, with its parameter
running over [0, 1], |S_uu| <= 4 pi^2 R, |S_uv| <= 2 pi |R'|, and S_vv is that of the profile.
S_uv points along the circle; the other two lie in the meridian plane. Over an angle of at most
pi hu to each side of the middle the two directions mix by the sine of that angle, so the two parts
add up like the legs of a right triangle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from meshing.checks import FloatArray
from meshing.kernels.leaves import MAX_DEPTH
from meshing.revolution import SurfaceOfRevolution, halve_curve, radius_rounding

# A ring has one of these numbers of cells, times a power of two: a circle shared by two rings then
# has the vertices of the finer one. The count that needs fewest cells over the surface is taken.
RING_BASES = (4, 5, 6, 7)
MAX_RING_DOUBLINGS = 17
HALF_ULP = 2.0**-53


class TooManyTrianglesError(ValueError):
    """The tolerance needs more triangles than are allowed.

    Parameters
    ----------
    estimate : float
        Approximate number of triangles needed.
    max_triangles : int
    tolerance : float
    """

    def __init__(self, estimate: float, max_triangles: int, tolerance: float) -> None:
        super().__init__(
            f"tolerance {tolerance:g} needs about {estimate:.2g} triangles, more than "
            f"max_triangles = {max_triangles}: raise the tolerance or max_triangles"
        )


@dataclass
class _Piece:
    """A piece of a profile segment: between ``v0`` and ``v1`` in units of 2**-MAX_DEPTH."""

    segment: int
    points: FloatArray
    v0: int
    v1: int

    def __post_init__(self) -> None:
        n = len(self.points) - 1
        step = np.diff(self.points, axis=0)
        bend = np.hypot(*np.diff(step, axis=0).T).max(initial=0.0)
        self.uu = 4.0 * math.pi**2 * float(self.points[:, 1].max())
        self.uv = 2.0 * math.pi * n * float(np.abs(step[:, 1]).max())
        self.vv = n * (n - 1) * float(bend)
        self._halves: tuple[_Piece, _Piece] | None = None

    def deviation(self, cells: float) -> float:
        h = 1.0 / cells
        meridian = (h * h * self.uu + self.vv) / 8.0
        along = h * self.uv / 4.0
        mix = math.sin(math.pi * h)
        legs = math.hypot(meridian + mix * along, along + mix * meridian)
        return min(meridian + along, legs)

    def cells(self, base: int, target: float) -> int:
        """Return the number of cells around that meets the target; 0: none does."""
        if self.vv > 8.0 * target:
            return 0
        n = base
        while self.deviation(n) > target:
            n *= 2
            if n > base << MAX_RING_DOUBLINGS:
                return 0
        return n

    def least_cells(self, target: float) -> float:
        return max(4.0, math.sqrt(self.uu / (8.0 * target)))

    def halves(self) -> tuple[_Piece, _Piece]:
        if self._halves is None:
            first, second = halve_curve(self.points)
            middle = (self.v0 + self.v1) // 2
            self._halves = (
                _Piece(self.segment, first, self.v0, middle),
                _Piece(self.segment, second, middle, self.v1),
            )
        return self._halves

    def forecast(self, target: float, levels: int = 4) -> float:
        """Guess the number of cells: the product of what the two curvatures ask for."""
        if levels and self.v1 - self.v0 > 1:
            return sum(half.forecast(target, levels - 1) for half in self.halves())
        return self.least_cells(target) * max(1.0, math.sqrt(self.vv / (8.0 * target)))


def rings_of(
    surface: SurfaceOfRevolution, tolerance: float, slack: float, max_triangles: int
) -> tuple[int, list[tuple[int, int, int, int]], float]:
    """Cut a surface of revolution into rings of cells.

    Parameters
    ----------
    tolerance : float
        Scene units; ``slack`` of it is reserved for later rounding.

    Returns
    -------
    base : int
        Every ring has this number of cells times a power of two.
    rings : list of (segment, v0, v1, cells)
        v in units of 2**-MAX_DEPTH; segments that lie on the axis have none.
    bound : float
        Proven distance of the triangles, without ``slack``.
    """
    on_axis = radius_rounding(surface.segments)
    roots = [
        _Piece(i, np.asarray(segment), 0, 1 << MAX_DEPTH)
        for i, segment in enumerate(surface.segments)
        if segment[:, 1].max() > on_axis
    ]
    largest = max(float(np.abs(segment).max()) for segment in surface.segments)
    degree = max(len(segment) - 1 for segment in surface.segments)
    rounding = (degree * MAX_DEPTH + 8) * (degree + 2) ** 2 * 4.0 * HALF_ULP * largest
    target = max(tolerance - slack - rounding, rounding)
    forecast = 2.0 * sum(root.forecast(target) for root in roots)
    if forecast > 4.0 * max_triangles:
        raise TooManyTrianglesError(forecast, max_triangles, tolerance)
    choices = []
    for base in RING_BASES:
        leaves: list[tuple[_Piece, int]] = []
        for root in roots:
            leaves.extend(_best_cut(root, base, target)[1])
        choices.append((sum(cells for _, cells in leaves), base, leaves))
    cells, base, leaves = min(choices, key=lambda choice: choice[:2])
    if 2 * cells > max_triangles:
        raise TooManyTrianglesError(2.0 * cells, max_triangles, tolerance)
    rings = [(piece.segment, piece.v0, piece.v1, cells) for piece, cells in leaves]
    return base, rings, max(piece.deviation(cells) for piece, cells in leaves) + rounding


def _best_cut(piece: _Piece, base: int, target: float) -> tuple[int, list[tuple[_Piece, int]]]:
    """Cut a piece into rings with the fewest cells, among all ways of repeated halving."""
    cells = piece.cells(base, target)
    whole = (cells, [(piece, cells)])
    if piece.v1 - piece.v0 == 1:
        return whole if cells else (base, [(piece, base << MAX_RING_DOUBLINGS)])
    halves = piece.halves()
    if cells and cells <= sum(half.least_cells(target) for half in halves):
        return whole
    cuts = [_best_cut(half, base, target) for half in halves]
    total = cuts[0][0] + cuts[1][0]
    return whole if 0 < cells <= total else (total, cuts[0][1] + cuts[1][1])
