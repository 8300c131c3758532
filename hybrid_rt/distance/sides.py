"""On which side of closed bodies points are: by the normal of what is nearest, else by rays."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, Flag, FloatArray, Status
from hybrid_rt.intersection.intersector import Intersector
from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.primitives.instances import Instances
from meshing.surface import Surface

# Directions of rays, along nothing that people draw along, tried one after the other.
DIRECTIONS = np.array([
    (0.3713906763541037, 0.5570860145311556, 0.7427813527082074),
    (-0.6331100150313203, 0.2110366716771068, 0.7447387215113721),
    (0.1925007731520261, -0.8662534791841174, 0.4610257194138823),
    (-0.5192416820831121, -0.3461611213887414, -0.7813982104712193),
])  # fmt: skip
# Of a closest point inside a face the way to it is along the normal, up to this.
ALONG_NORMAL = 0.9


def is_closed(surface: Surface) -> bool:
    """Tell whether a surface encloses a body by itself."""
    if isinstance(surface, Instances):
        return all(is_closed(one) for one in surface.surfaces)
    if not isinstance(surface, TriangleMesh):
        return surface.is_closed
    # Every side of a face is that of another, in the opposite sense; vertices at one place are one.
    _, vertex = np.unique(surface.vertices, axis=0, return_inverse=True)
    faces = vertex.reshape(-1)[surface.faces]
    sides = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    sides = sides[sides[:, 0] != sides[:, 1]]
    one, other = (s[np.lexsort(s.T)] for s in (sides, sides[:, ::-1]))
    return bool(len(one)) and np.array_equal(one, other)


class Sides:
    """Tells on which side of closed bodies points are."""

    def __init__(self, surfaces: Sequence[Surface], closed: BoolArray, threads: int | None) -> None:
        self.surfaces = [s for s, is_one in zip(surfaces, closed, strict=True) if is_one]
        self.closed, self._threads = closed, threads
        self._tracer: Intersector | None = None

    def of(
        self, points: FloatArray, position: FloatArray, normal: FloatArray, object_id: NDArray[np.int64],
        distance: FloatArray, bound: FloatArray, on_edge: BoolArray,
    ) -> NDArray[np.int8]:  # fmt: skip
        """Return the side of each point, given what is nearest: -1 inside, 1 outside, 0 not known.

        No surface is between a point and what is nearest to it. Inside a face the normal tells the side from
        which it is reached. At edges a ray does: its first hit on a closed body is from inside or outside.
        """
        is_one = self.closed[object_id] & (distance > bound)
        along = ((points - position) * normal).sum(axis=1)
        is_clear = is_one & ~on_edge & (np.abs(along) >= ALONG_NORMAL * distance)
        side = np.where(is_clear, np.sign(along), 0.0).astype(np.int8)
        rows = np.flatnonzero(is_one & ~is_clear)
        for direction in DIRECTIONS:
            if not len(rows):
                break
            if self._tracer is None:
                self._tracer = Intersector(self.surfaces, coarse="none", threads=self._threads)
            hits = self._tracer.intersect(points[rows], np.broadcast_to(direction, (len(rows), 3)))
            is_sure = (hits.status != Status.TANGENT) & ((hits.flags & Flag.EDGE) == 0)
            side[rows[is_sure]] = np.where(hits.hit & ~hits.front_face, -1, 1)[is_sure]
            rows = rows[~is_sure]
        return side
