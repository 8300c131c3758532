"""What the judge asks of surfaces with edges in u and v: hits in holes, crossings behind the origin.

On which side of the loops a point is, integers tell (`proof.exact.loops`). Whether a curve passes within a
distance is asked of its control points as seen from there: they are halved until their hull is beyond
it, or an end within.
"""

from __future__ import annotations

import copy
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import two_normals
from hybrid_rt.core.records import FloatArray
from meshing import SurfaceOfRevolution
from meshing.trimmed import TrimmedSurface
from proof.exact.crossings import norm
from proof.exact.loops import ExactLoops
from proof.exact.truth import ExactScene, Placed, same_place

# A hit may lie so many bands outside: as far as those that say TANGENT may be from their ray.
OUTSIDE = 3.0
# Rays that meet an edge more flatly than this have the gap of a ray that meets it so; what lies within
# a part of that of its end may be decided either way.
FLATTEST_EDGE, AROUND_GAP = 1e-3, 0.02
# Points are taken this far inside the border of the unit square: loops along it enclose them.
WITHIN = 2.0**-53
# Hulls smaller than this part of the distance asked for are points.
SMALL = 1e-6
DEEPEST = 200


class TrimEdges:
    """The loops of one trimmed surface, in (u, v) and in space."""

    def __init__(self, surface: TrimmedSurface) -> None:
        self.surface, self._loops = surface, ExactLoops(surface.loops, surface.closes)
        turns: list[tuple[float, ...]]
        turns = [(-2.0, -1.0, 0.0, 1.0, 2.0) if closed else (0.0,) for closed in surface.closes]
        self._arcs = list(_edges(surface, turns))

    def is_outside(
        self, u: float, v: float, patch: int, d: FloatArray, band: float | None = None
    ) -> bool | None:
        """Tell whether a point is outside the loops, beyond the gap; None near the end of the gap.

        With a band, in scene units: of a hit that may lie outside by three of it, and as far as the gap
        may reach.
        """
        u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        at = (min(max(x, WITHIN), 1.0 - WITHIN) for x in (u, v))
        # On a curve either side will do.
        if self._loops.is_inside(*at) is not False:
            return False
        seen, lies, cosine = self._steps(u, v, patch, d)
        if band is not None and self.passes(u, v, seen, OUTSIDE * band) is not False:
            return False
        if self.surface.gap == 0.0:
            return True
        reach = self.surface.gap / max(cosine, FLATTEST_EDGE)
        if self.passes(u, v, lies, (1.0 + AROUND_GAP) * reach) is False:
            return True
        if band is None and not self.passes(u, v, lies, (1.0 - AROUND_GAP) * reach):
            return None
        return False

    def _steps(
        self, u: float, v: float, patch: int, d: FloatArray
    ) -> tuple[FloatArray, FloatArray, float]:
        """Return S_u and S_v as seen along a ray and in the tangent plane, (2, 2), and |cos|."""
        at = np.array([u]), np.array([v]), np.array([patch])
        both = np.stack(self.surface.partials(*at), axis=2)[0]
        way, normal = d / np.linalg.norm(d), np.cross(both[:, 0], both[:, 1])
        length = float(np.linalg.norm(normal))
        seen = np.concatenate(two_normals(way[None])) @ both
        if length == 0.0:
            return seen, np.full((2, 2), np.nan), FLATTEST_EDGE
        normal /= length
        lies = np.concatenate(two_normals(normal[None])) @ both
        return seen, lies, abs(float(normal @ way))

    def passes(self, u: float, v: float, steps: FloatArray, reach: float) -> bool | None:
        """Tell whether a curve passes within a reach, to first order.

        ``steps`` has as columns where a step of 1 in u leads in a plane, and one in v. None: first order
        says nothing, as the distance reaches past a pole, or a quarter turn.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            half = reach * np.linalg.norm(steps, axis=0)[::-1] / abs(np.linalg.det(steps))
        at, poles = np.array([u, v]), self.surface.poles
        if not (half <= 0.25).all() or (poles[0] and v < half[1]) or (poles[1] and 1 - v < half[1]):
            return None
        return any(
            (points.min(axis=0) <= at + half).all()
            and (points.max(axis=0) >= at - half).all()
            and _comes_near(points, weights, at, steps, reach)
            for points, weights in self._arcs
        )


def _edges(
    surface: TrimmedSurface, turns: list[tuple[float, ...]]
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield control points and weights of the curves that bound a surface, in all turns.

    Lines that lie on each other in pairs, as outlines at a seam do, cancel; at a pole there is no edge.
    """
    curves = [curve for loop in surface.loops for curve in loop]
    arcs = [
        (c.control + np.array(t), np.ones(len(c.control)) if c.weights is None else c.weights)
        for t in product(*turns)
        for c in curves
    ]
    lines = [
        tuple(sorted(map(tuple, points.tolist()))) if len(points) == 2 else k
        for k, (points, _) in enumerate(arcs)
    ]
    count = Counter(lines)
    poles = [v for v, is_pole in zip((0.0, 1.0), surface.poles, strict=True) if is_pole]
    for line, arc in zip(lines, arcs, strict=True):
        points = arc[0]
        # Nothing is asked for farther away than a quarter.
        is_near = (points.min(axis=0) <= 1.25).all() and (points.max(axis=0) >= -0.25).all()
        if is_near and count[line] % 2 and not any((points[:, 1] == v).all() for v in poles):
            yield arc


def _halves(net: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both halves of a curve (n + 1, k) in Bernstein form."""
    left, right = [net[0]], [net[-1]]
    while len(net) > 1:
        net = 0.5 * (net[:-1] + net[1:])
        left.append(net[0])
        right.append(net[-1])
    return np.stack(left), np.stack(right[::-1])


def _comes_near(
    points: FloatArray, weights: FloatArray, at: FloatArray, steps: FloatArray, reach: float
) -> bool:
    """Tell whether an arc passes a point within a distance of the plane of steps."""
    away = (points - at) @ steps.T
    stack = [(np.column_stack([away * weights[:, None], weights]), 0)]
    while stack:
        net, depth = stack.pop()
        points = net[:, :2] / net[:, 2:]
        if min(np.hypot(*points[0]), np.hypot(*points[-1])) <= reach:
            return True
        chord, middle = points[-1] - points[0], points[0] + points[-1]
        ways = np.array([(1.0, 0.0), (0.0, 1.0), (-chord[1], chord[0]), middle])
        ways /= np.maximum(np.linalg.norm(ways, axis=1), 1e-300)[:, None]
        # Beyond: on one side of a line that is as far from the point as is asked for.
        beside = points @ ways.T
        low, high = beside.min(axis=0), beside.max(axis=0)
        if (low > reach).any() or (high < -reach).any():
            continue
        if depth == DEEPEST or (high - low).max() <= SMALL * reach:
            return True
        stack += [(half, depth + 1) for half in _halves(net)]
    return False


class Trims:
    """The trimmed surfaces, and the parts of a turn, of a list of surfaces."""

    def __init__(self, surfaces: Sequence[Any]) -> None:
        self._edges = {
            k: TrimEdges(s) for k, s in enumerate(surfaces) if isinstance(s, TrimmedSurface)
        }
        self._whole = ExactScene([_whole_of(surface) for surface in surfaces])

    def is_outside(
        self, number: int, patch: int, u: float, v: float, d: FloatArray, band: float
    ) -> bool:
        """Tell whether a hit on an object is outside its loops, beyond the band.

        The surface goes on there, so the distance of S(u, v) from the ray does not tell.
        """
        return number in self._edges and bool(self._edges[number].is_outside(u, v, patch, d, band))

    def comes_from_behind(self, one: Placed, o: FloatArray, d: FloatArray, moved: float) -> bool:
        """Tell whether moving a ray takes a crossing from behind the origin to ahead of it.

        Whether t > 0 is no question of rounding. The ray itself may have the crossing outside the loops
        or the part of the turn: so it is sought on the whole surface. If even there it is ahead, the
        move takes it past an edge, which is one. If it is nowhere, the ray grazes: within rounding of
        the origin no mark is promised.
        """
        length = norm(d)
        same = [
            other
            for other in self._whole.crossings(o, d)
            if other.object_id == one.object_id and same_place(one, other, moved, length)
        ]
        if not same:
            return one.t * length * one.crossing.cosine <= 2.0 * moved
        return all(other.t <= 0.0 for other in same)


def _whole_of(surface: Any) -> Any:
    """Return a surface without its loops, around the whole of its axis."""
    if isinstance(surface, TrimmedSurface):
        surface = surface.surface
    if isinstance(surface, SurfaceOfRevolution) and not surface.is_whole_turn:
        surface = copy.copy(surface)
        surface.u_range = (0.0, 1.0)
    return surface
