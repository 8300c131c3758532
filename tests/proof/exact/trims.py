"""What the judge asks of surfaces with edges in u and v: hits in holes, crossings behind the origin."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import SurfaceOfRevolution
from meshing.trimmed import TrimmedSurface
from proof.exact.crossings import norm
from proof.exact.truth import ExactScene, Placed, same_place
from proof.judges.trim_edges import TrimEdges


class Trims:
    """The trimmed surfaces, and the parts of a turn, of a list.

    Parameters
    ----------
    surfaces : sequence of surfaces, as `Intersector` takes them
    """

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
        if number not in self._edges:
            return False
        at = np.array([u]), np.array([v]), np.array([patch])
        return bool(self._edges[number].are_outside(*at, d[None], np.array([band]))[0])

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
