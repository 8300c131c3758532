"""Deviation bounds for surfaces of revolution: into how many cells to cut each ring.

The bound is that of `meshing.kernels.leaves`. Over a piece of the profile, with its parameter
running over [0, 1], |S_uu| <= 4 pi^2 R, |S_uv| <= 2 pi |R'|, and S_vv is that of the profile; of a part
of the turn, with its share for the 1 in 2 pi. A rational profile C = N / w has C' = D / w^2 with D = N' w -
N w', and C'' = E / w^3 with E = D' w - 2 D w', whose Bezier points bound them over the least of w.
S_uv points along the circle; the other two lie in the meridian plane. Over an angle of at most
pi hu to each side of the middle the two directions mix by the sine of that angle, so the two parts
add up like the legs of a right triangle.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from meshing.checks import FloatArray
from meshing.kernels.leaves import MAX_DEPTH
from meshing.profiles import halve_curve, radius_rounding
from meshing.revolution import SurfaceOfRevolution

# A ring has one of these numbers of cells, times a power of two: a circle shared by two rings then
# has the vertices of the finer one. The count that needs fewest cells over the surface is taken.
RING_BASES = (4, 5, 6, 7)
MAX_RING_DOUBLINGS = 17
HALF_ULP = 2.0**-53
# Radii up to this part of the largest count as poles.
POLE = 2.0**-40
# Digits that are kept of a tolerance.
TARGET_STEPS = 2.0**12


class TooManyTrianglesError(ValueError):
    """The tolerance needs more triangles, about ``estimate``, than are allowed."""

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
    turn: float
    """The share of a whole turn."""

    def __post_init__(self) -> None:
        uu, uv = 4.0 * math.pi**2 * self.turn**2, 2.0 * math.pi * self.turn
        if self.points.shape[1] == 3:
            radius, radius_rate, self.vv = _of_rational(self.points)
            self.uu, self.uv = uu * radius, uv * radius_rate
        else:
            n = len(self.points) - 1
            step = np.diff(self.points, axis=0)
            bend = np.hypot(*np.diff(step, axis=0).T).max(initial=0.0)
            self.uu = uu * float(self.points[:, 1].max())
            self.uv = uv * n * float(np.abs(step[:, 1]).max())
            self.vv = n * (n - 1) * float(bend)
        self._halves: tuple[_Piece, _Piece] | None = None

    def deviation(self, cells: float) -> float:
        h = 1.0 / cells
        meridian = (h * h * self.uu + self.vv) / 8.0
        along = h * self.uv / 4.0
        mix = math.sin(math.pi * self.turn * h)
        legs = math.hypot(meridian + mix * along, along + mix * meridian)
        return min(meridian + along, legs)

    def cells(self, base: int, target: float) -> int:
        """Return the number of cells around that meets the target; 0: none does, or none is a triangle."""
        radii = self.points[:, 1]
        is_between_poles = max(radii[0], radii[-1]) <= POLE * radii.max()
        if is_between_poles or self.vv > 8.0 * target:
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
                _Piece(self.segment, first, self.v0, middle, self.turn),
                _Piece(self.segment, second, middle, self.v1, self.turn),
            )
        return self._halves

    def forecast(self, target: float, levels: int = 4) -> float:
        """Guess the number of cells: the product of what the two curvatures ask for."""
        if levels and self.v1 - self.v0 > 1:
            return sum(half.forecast(target, levels - 1) for half in self.halves())
        return self.least_cells(target) * max(1.0, math.sqrt(self.vv / (8.0 * target)))


def rings_of(
    surface: SurfaceOfRevolution, tolerance: float, slack: float, max_triangles: int
) -> tuple[int, tuple[tuple[int, int, int, int], ...], float]:
    """Cut a surface of revolution into rings of cells; ``slack`` is reserved for later rounding.

    Returns a number; rings (segment, v0, v1, cells), v in units of 2**-MAX_DEPTH and cells that number times a
    power of two; and the proven distance of the triangles, without ``slack``. Segments on the axis have none.
    """
    on_axis = radius_rounding(surface.segments)
    turn = surface.u_range[1] - surface.u_range[0]
    parts = zip(surface.segments, surface.weights, surface.homogeneous, strict=True)
    profile = tuple(
        (i, 2, segment.tobytes()) if w is None else (i, 3, net.tobytes())
        for i, (segment, w, net) in enumerate(parts)
        if segment[:, 1].max() > on_axis
    )
    largest = max(float(np.abs(segment).max()) for segment in surface.segments)
    degree = max(len(segment) - 1 for segment in surface.segments)
    rounding = (degree * MAX_DEPTH + 8) * (degree + 2) ** 2 * 4.0 * HALF_ULP * largest
    target = max(tolerance - slack - rounding, rounding)
    # Rounded down to few digits, so that equal profiles at other places need no search of their own.
    mantissa, exponent = math.frexp(target)
    target = math.ldexp(math.floor(mantissa * TARGET_STEPS), exponent) / TARGET_STEPS
    triangles, base, rings, deviation = _fewest_cells(profile, turn, target, max_triangles)
    if triangles > max_triangles:
        raise TooManyTrianglesError(triangles, max_triangles, tolerance)
    return base, rings, deviation + rounding


@lru_cache(maxsize=256)
def _fewest_cells(
    profile: tuple[tuple[int, int, bytes], ...], turn: float, target: float, max_triangles: int
) -> tuple[float, int, tuple[tuple[int, int, int, int], ...], float]:
    """Return how many triangles the rings of a profile have, then what `rings_of` does, not rounded.

    A profile is the number, columns and bytes of its segments. Of more than ``max_triangles``, the first
    number is about what they would be, and there are no rings.
    """
    roots = [
        _Piece(i, np.frombuffer(points).reshape(-1, columns), 0, 1 << MAX_DEPTH, turn)
        for i, columns, points in profile
    ]
    forecast = 2.0 * sum(root.forecast(target) for root in roots)
    if forecast > 4.0 * max_triangles:
        return forecast, 0, (), 0.0
    choices = []
    for base in RING_BASES:
        leaves: list[tuple[_Piece, int]] = []
        for root in roots:
            leaves.extend(_best_cut(root, base, target)[1])
        choices.append((sum(cells for _, cells in leaves), base, leaves))
    cells, base, leaves = min(choices, key=lambda choice: choice[:2])
    rings = tuple((piece.segment, piece.v0, piece.v1, n) for piece, n in leaves)
    return 2.0 * cells, base, rings, max(piece.deviation(n) for piece, n in leaves)


def _of_rational(net: FloatArray) -> tuple[float, float, float]:
    """Bound R, |R'| and |C''| of a rational segment C = (Z, R), rows (w z, w r, w)."""
    least = float(net[:, 2].min())
    plain, w = net[:, :2], net[:, 2:]
    first = _product(_rate(plain), w) - _product(plain, _rate(w))
    second = _product(_rate(first), w) - 2.0 * _product(first, _rate(w))
    return (
        float((plain[:, 1] / net[:, 2]).max()),
        float(np.abs(first[:, 1]).max()) / least**2,
        float(np.hypot(*second.T).max()) / least**3,
    )


def _rate(net: FloatArray) -> FloatArray:
    """Return the Bezier points of a derivative."""
    return (len(net) - 1) * np.diff(net, axis=0)


def _product(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the Bezier points of a product; one of the two has one column."""
    m, n = len(one) - 1, len(other) - 1
    total = np.zeros((m + n + 1, max(one.shape[1], other.shape[1])))
    for i in range(m + 1):
        for j in range(n + 1):
            share = math.comb(m, i) * math.comb(n, j) / math.comb(m + n, i + j)
            total[i + j] += share * one[i] * other[j]
    return total


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
