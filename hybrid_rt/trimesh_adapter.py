"""trimesh's ray interface on true surfaces: a drop-in replacement.

``RayMeshIntersector`` has the names, arguments, shapes and dtypes of trimesh's class of that name.
trimesh's triangle indices become indices of pieces: faces of meshes, patches of Bezier surfaces and
segments of profiles, numbered consecutively through all objects.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.coincident import coincident_hits
from hybrid_rt.intersection.crossings import Crossings
from hybrid_rt.primitives import TriangleMesh
from meshing.checks import as_floats, whole

IdArray = NDArray[np.int64]

# No ordinary model favours these.
DIRECTIONS = np.array(
    [[0.4395, 0.6176, 0.6522], [-0.7071, 0.1234, 0.6963], [0.2193, -0.8731, 0.4354]]
)


class RayMeshIntersector:
    """Ray queries with the interface of trimesh's ``RayMeshIntersector``.

    Parameters
    ----------
    geometry : trimesh.Trimesh, surface, or sequence of them
    **options : as for `Intersector`

    Attributes
    ----------
    intersector : Intersector
    """

    def __init__(self, geometry: Any, **options: Any) -> None:
        parts = geometry if isinstance(geometry, Sequence) else [geometry]
        surfaces = [TriangleMesh(part) if _is_trimesh(part) else part for part in parts]
        self.intersector = Intersector(surfaces, **options)
        counts = [len(surface) for surface in self.intersector.surfaces]
        self._first = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[FloatArray, IdArray, IdArray]:
        """Find where rays meet the surfaces.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) array-like
            Scene units; directions of any length but zero.
        multiple_hits : bool
            Return all crossings, not only the first of each ray.

        Returns
        -------
        locations : (h, 3) float64
            Scene units.
        index_ray : (h,) int64
        index_tri : (h,) int64
            Pieces, numbered through all objects.

        Raises
        ------
        ValueError, TypeError
            As `Intersector.intersect` does.
        """
        hits, rays = self._find(ray_origins, ray_directions, multiple_hits, None)
        return hits.position, rays, self._number(hits)

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 20,
        return_locations: bool = False,
    ) -> tuple[NDArray[Any], ...]:
        """Find which pieces rays meet.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) array-like
            Scene units; directions of any length but zero.
        multiple_hits : bool
            Return all crossings, not only the first of each ray.
        max_hits : int
            Largest number of crossings per ray, at least 1.
        return_locations : bool
            Return the hit points as well.

        Returns
        -------
        index_tri : (h,) int64
        index_ray : (h,) int64
        locations : (h, 3) float64, only if ``return_locations``

        Raises
        ------
        ValueError, TypeError
            As `Intersector.intersect`; if ``max_hits`` is not an integer of at least 1.
        """
        hits, rays = self._find(ray_origins, ray_directions, multiple_hits, max_hits)
        found: tuple[NDArray[Any], ...] = (self._number(hits), rays)
        return (*found, hits.position) if return_locations else found

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> IdArray:
        """Return the piece that each ray meets first: (n,) int64, -1 where it meets none.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) array-like
            Scene units; directions of any length but zero.

        Raises
        ------
        ValueError, TypeError
            As `Intersector.intersect` does.
        """
        hits = self.intersector.intersect(ray_origins, ray_directions)
        return np.where(hits.hit, self._number(hits), -1)

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> BoolArray:
        """Tell for each ray whether it meets anything: (n,) bool.

        Parameters
        ----------
        ray_origins, ray_directions : (n, 3) array-like
            Scene units; directions of any length but zero.

        Raises
        ------
        ValueError, TypeError
            As `Intersector.intersect` does.
        """
        return self.intersector.occluded(ray_origins, ray_directions)

    def contains_points(self, points: ArrayLike) -> BoolArray:
        """Tell for each point whether it lies inside the closed surfaces.

        Uses the parity of crossings along a ray; if the ray is tangent to something, another
        direction is tried.

        Parameters
        ----------
        points : (n, 3) array-like
            Scene units.

        Returns
        -------
        (n,) bool

        Raises
        ------
        ValueError, TypeError
            If they are not finite numbers of that shape.
        """
        points = as_floats(points, "contains_points points")
        if points.ndim != 2 or points.shape[1] != 3:
            raise ValueError(f"contains_points points have shape {points.shape}: pass (n, 3)")
        inside = np.zeros(len(points), np.bool_)
        left = np.arange(len(points))
        for direction in DIRECTIONS:
            found = self.intersector.intersect_all(points[left], direction)
            inside[left] = self._faces_met(points[left], direction, found) % 2 == 1
            touched = found.ray[found.hits.status == Status.TANGENT]
            left = left[np.unique(touched)]
            if not len(left):
                break
        return inside

    def _faces_met(
        self, points: FloatArray, direction: FloatArray, found: Crossings
    ) -> NDArray[np.int64]:
        """Return how many faces each ray crosses: where two bodies touch there are two."""
        count = found.count
        if len(self.intersector.surfaces) < 2 or not len(found):
            return count
        directions = np.tile(direction, (len(found), 1))
        others = coincident_hits(self.intersector, points[found.ray], directions, found.hits)
        return count + np.bincount(found.ray[others.hit], minlength=len(points))

    def _find(
        self, origins: ArrayLike, directions: ArrayLike, multiple_hits: bool, most: int | None
    ) -> tuple[HitRecord, IdArray]:
        if not multiple_hits:
            hits = self.intersector.intersect(origins, directions)
            return hits[hits.hit], np.flatnonzero(hits.hit)
        if most is not None:
            whole(most, "max_hits", at_least=1)
        found = self.intersector.intersect_all(origins, directions)
        if most is None:
            return found.hits, found.ray
        rank = np.arange(len(found)) - found.offsets[found.ray]
        return found.hits[rank < most], found.ray[rank < most]

    def _number(self, hits: HitRecord) -> IdArray:
        numbers: IdArray = self._first[hits.object_id] + hits.patch_id
        return numbers


def _is_trimesh(part: Any) -> bool:
    return hasattr(part, "vertices") and hasattr(part, "faces") and hasattr(part, "triangles")
