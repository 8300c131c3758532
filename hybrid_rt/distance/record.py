"""Closest points and what is proven of them. Data only."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray, selected


class Closeness(IntEnum):
    """What is known of a closest point.

    UNIQUE: every point of the surfaces that is as near, within ``bound``, is this one: the same place, up to
    what ``bound`` allows. SEVERAL: others, elsewhere, are as near within ``bound``, or may be, as from a
    centre of curvature or a point of the medial axis. UNDECIDED: the search ended before ``bound`` came down
    to rounding; ``bound`` holds all the same.
    """

    UNIQUE = 0
    SEVERAL = 1
    UNDECIDED = 2


@dataclass(frozen=True)
class ClosestRecord:
    """Closest points, one row for each query point, in their order.

    Attributes
    ----------
    distance : (n,) float64
        From the query point, scene units; negative where ``side`` is -1.
    bound : (n,) float64
        Proven bound on ``| |distance| - exact distance |``, rounding included.
    status : (n,) uint8
        `Closeness` of the row.
    side : (n,) int8
        -1: inside a closed body, 1: outside all of them, 0: not known, since what is nearest bounds no closed
        body, or rounding leaves it undecided.
    object_id : (n,) int32
        Index in the sequence of surfaces.
    patch_id : (n,) int32
        Patch, profile segment or face, as in a `HitRecord`.
    instance_id : (n,) int32
        Row of the place of `Instances`; -1 on other surfaces.
    u, v : (n,) float64
        Parameters of the closest point on its surface.
    position : (n, 3) float64
        The closest point, scene units.
    normal : (n, 3) float64
        Unit normal there, along S_u x S_v.
    on_edge : (n,) bool
        Whether it lies on a border: of a surface, a trim curve, or of a triangle.
    """

    distance: FloatArray
    bound: FloatArray
    status: NDArray[np.uint8]
    side: NDArray[np.int8]
    object_id: IntArray
    patch_id: IntArray
    instance_id: IntArray
    u: FloatArray
    v: FloatArray
    position: FloatArray
    normal: FloatArray
    on_edge: BoolArray

    def __len__(self) -> int:
        """Return the number of points."""
        return int(self.distance.size)

    def __getitem__(self, rows: object) -> ClosestRecord:
        """Select rows by a mask, an index array or a slice; one integer gives a record of one."""
        return ClosestRecord(*selected(self, rows))

    def __repr__(self) -> str:
        """Count points and statuses; name the range of distances and the largest bound."""
        n = len(self)
        counts = [(int(np.count_nonzero(self.status == s)), s.name) for s in Closeness]
        line = f"ClosestRecord({n:,} point{'' if n == 1 else 's'}: "
        line += ", ".join(f"{k:,} {name}" for k, name in counts if k)
        if n:
            d = self.distance
            line += f"; distance {d.min():.4g} to {d.max():.4g}, bound up to {self.bound.max():.2g}"
        return line + ")"
