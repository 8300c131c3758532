"""The closest points of surfaces of all kinds, certified."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

from hybrid_rt.distance.record import ClosestRecord
from meshing.surface import Surface


class ClosestPoint:
    """Finds the closest point of surfaces: built once, asked by batches of points.

    Parameters
    ----------
    surfaces : Surface or sequence of Surface
        As of an `Intersector`; trimmed ones and `Instances` as well. Of a `CadModel` its ``surfaces``.
    closed : (surfaces,) bool array-like, optional
        Which of them bound closed bodies, alone or together: there distances are signed, negative on the side
        opposite to the normals. Of a `CadModel` its ``closed``. Default: those that are closed by
        themselves (`Sphere`, `Box`, `Torus`, a `TriangleMesh` all of whose edges have two faces).
    threads : int, optional
        Default: as many as this process may use. They change no bit of the result.
    """

    def __init__(
        self,
        surfaces: Surface | Sequence[Surface],
        *,
        closed: ArrayLike | None = None,
        threads: int | None = None,
    ) -> None:
        raise NotImplementedError

    def query(self, points: ArrayLike) -> ClosestRecord:
        """Find the closest point of each of n points.

        Parameters
        ----------
        points : (n, 3), (3,) or (h, w, 3) array-like
            Scene units, finite.

        Returns
        -------
        ClosestRecord of n rows
        """
        raise NotImplementedError


def closest_point(
    surfaces: Surface | Sequence[Surface],
    points: ArrayLike,
    *,
    closed: ArrayLike | None = None,
    threads: int | None = None,
) -> ClosestRecord:
    """Find the closest points of surfaces once; of several batches by one `ClosestPoint`."""
    return ClosestPoint(surfaces, closed=closed, threads=threads).query(points)
