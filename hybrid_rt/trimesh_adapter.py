"""trimesh's ray interface on true surfaces: a drop-in replacement.

``RayMeshIntersector`` has the names, arguments, shapes and dtypes of trimesh's class of that name.
Indices are always int64, as those of trimesh's own engine; its Embree engine returns int32 from
``intersects_first`` alone. trimesh's triangle indices become indices of pieces: faces of meshes, patches of Bezier surfaces and
segments of profiles, numbered consecutively through all objects.
"""

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.coincident import coincident_hits
from hybrid_rt.intersection.crossings import Crossings
from hybrid_rt.intersection.intersector import check_settings
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND
from hybrid_rt.primitives import TriangleMesh
from meshing.checks import as_floats, shown, whole
from meshing.surface import Surface

IdArray = NDArray[np.int64]

# No ordinary model favours these.
DIRECTIONS = np.array(
    [[0.4395, 0.6176, 0.6522], [-0.7071, 0.1234, 0.6963], [0.2193, -0.8731, 0.4354]]
)


class RayMeshIntersector:
    """Ray queries with the interface of trimesh's ``RayMeshIntersector``.

    As with trimesh's engines, a surface on which a ray starts, within rounding, counts as a hit,
    whereas `Intersector` finds only what lies ahead. Nothing is built before the first query.

    All queries take ``ray_origins`` and ``ray_directions``, (n, 3) array-like: scene units, directions of any
    length but zero. They raise ValueError and TypeError as `Intersector.intersect` does.

    Parameters
    ----------
    geometry : trimesh.Trimesh, surface, or sequence of them
        If a mesh is changed later, the next query uses the changed mesh.
    scale_to_box : bool
        Accepted for compatibility. It changes nothing: hits are found in float64 at any scale.
    accuracy, coarse, tolerance, threads
        As for `Intersector`.

    Attributes
    ----------
    mesh
        The geometry, as given.

    Raises
    ------
    TypeError, ValueError
        If an item is neither a mesh nor a surface, or a setting is unknown.
    """

    def __init__(
        self,
        geometry: Any,
        scale_to_box: bool = True,
        *,
        accuracy: str = "certified",
        coarse: str = "embree",
        tolerance: float | None = None,
        threads: int | None = None,
    ) -> None:
        del scale_to_box
        check_settings(accuracy, coarse, tolerance)
        self._settings = (accuracy, coarse, tolerance, threads)
        self.mesh = geometry
        self._parts = list(geometry) if isinstance(geometry, Sequence) else [geometry]
        for i, part in enumerate(self._parts):
            if not (_is_trimesh(part) or isinstance(part, Surface)):
                raise TypeError(
                    f"RayMeshIntersector geometry[{i}] is {shown(part)}: pass a trimesh.Trimesh or "
                    "a surface such as BezierPatches"
                )
        self._intersector: Intersector | None = None
        self._built_for: list[int] = []

    @property
    def intersector(self) -> Intersector:
        """The tracer of the geometry as it is now."""
        now = [hash(part) for part in self._parts if _is_trimesh(part)]
        if self._intersector is None or now != self._built_for:
            self._intersector = Intersector(
                [_shape_of(part) if _is_trimesh(part) else part for part in self._parts],
                *self._settings,
            )
            self._built_for = now
            surfaces = self._intersector.surfaces
            counts = [len(surface) for surface in surfaces]
            self._first_piece = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
            self._reach = max((s.reach for s in surfaces if s.is_bounded), default=0.0)
        return self._intersector

    def intersects_location(
        self, ray_origins: ArrayLike, ray_directions: ArrayLike, multiple_hits: bool = True
    ) -> tuple[FloatArray, IdArray, IdArray]:
        """Find where rays meet the surfaces.

        Parameters
        ----------
        multiple_hits : bool
            Return all crossings, not only the first of each ray.

        Returns
        -------
        locations : (h, 3) float64
            Scene units.
        index_ray : (h,) int64
        index_tri : (h,) int64
            Pieces (patches, profile segments, faces), numbered consecutively across all objects.
        """
        hits, rays = self._find(ray_origins, ray_directions, multiple_hits, None)
        return hits.position, rays, self._number(hits)

    def intersects_id(
        self,
        ray_origins: ArrayLike,
        ray_directions: ArrayLike,
        multiple_hits: bool = True,
        max_hits: int = 100,
        return_locations: bool = False,
    ) -> tuple[NDArray[Any], ...]:
        """Find which pieces rays meet.

        Parameters
        ----------
        multiple_hits : bool
            Return all crossings, not only the first of each ray.
        max_hits : int
            Largest number of crossings per ray, at least 1; those beyond it are left out. The default
            is that of trimesh 5. `intersects_location` has no limit.
        return_locations : bool
            Return the hit points as well.

        Returns
        -------
        index_tri, index_ray : (h,) int64
        locations : (h, 3) float64, only if ``return_locations``
        """
        hits, rays = self._find(ray_origins, ray_directions, multiple_hits, max_hits)
        found: tuple[NDArray[Any], ...] = (self._number(hits), rays)
        return (*found, hits.position) if return_locations else found

    def intersects_first(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> IdArray:
        """Return the piece that each ray meets first: (n,) int64, -1 where it meets none."""
        tracer, begin = self._begin(ray_origins, ray_directions)
        hits = tracer.intersect(ray_origins, ray_directions, t_min=begin)
        return np.where(hits.hit, self._number(hits), -1)

    def intersects_any(self, ray_origins: ArrayLike, ray_directions: ArrayLike) -> BoolArray:
        """Tell for each ray whether it meets anything: (n,) bool."""
        tracer, begin = self._begin(ray_origins, ray_directions)
        return tracer.occluded(ray_origins, ray_directions, t_min=begin)

    def contains_points(self, points: ArrayLike) -> BoolArray:
        """Tell for each point (n, 3), scene units, whether it lies inside the closed surfaces: (n,) bool.

        The answer is the parity of the crossings along a ray. If the ray is tangent to a surface,
        another direction is tried. Of bodies that touch, each is an item of the geometry: where two
        that are joined to one mesh touch, a ray meets one face instead of two, and the answer may be
        wrong.
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
        """Return how many faces each ray crosses: two where it enters, or leaves, two bodies at once."""
        count = found.count
        if len(self.intersector.surfaces) < 2 or not len(found):
            return count
        directions = np.tile(direction, (len(found), 1))
        others = coincident_hits(self.intersector, points[found.ray], directions, found.hits)
        # Where it leaves one and enters the other both have a row.
        is_left_out = others.hit & (others.front_face == found.hits.front_face)
        return count + np.bincount(found.ray[is_left_out], minlength=len(points))

    def _begin(self, origins: ArrayLike, directions: ArrayLike) -> tuple[Intersector, FloatArray]:
        """Return the tracer and, for each ray, the t within rounding before its start."""
        tracer = self.intersector
        at = np.abs(as_floats(origins, "ray_origins"))
        length = np.abs(as_floats(directions, "ray_directions"))
        with np.errstate(all="ignore"):  # what is wrong with them, the tracer says
            size = np.maximum(at.max(axis=-1, initial=0.0), self._reach)
            begin: FloatArray = -TANGENT_BAND * size / length.max(axis=-1, initial=0.0)
        return tracer, np.where(np.isfinite(begin), begin, 0.0)

    def _find(
        self, origins: ArrayLike, directions: ArrayLike, multiple_hits: bool, most: int | None
    ) -> tuple[HitRecord, IdArray]:
        if most is not None:
            whole(most, "max_hits", at_least=1)
        tracer, begin = self._begin(origins, directions)
        if not multiple_hits:
            hits = tracer.intersect(origins, directions, t_min=begin)
            return hits[hits.hit], np.flatnonzero(hits.hit)
        found = tracer.intersect_all(origins, directions, t_min=begin)
        if most is None:
            return found.hits, found.ray
        rank = np.arange(len(found)) - found.offsets[found.ray]
        return found.hits[rank < most], found.ray[rank < most]

    def _number(self, hits: HitRecord) -> IdArray:
        return self._first_piece[hits.object_id] + hits.patch_id


def _is_trimesh(part: Any) -> bool:
    # trimesh's primitives ask for their engine before they have vertices; their class has them.
    names = ("vertices", "faces", "triangles")
    return all(hasattr(type(part), name) or hasattr(part, name) for name in names)


def _shape_of(mesh: Any) -> TriangleMesh:
    """Return a mesh without its texture coordinates, which may be wrong: rays do not ask for them."""
    shape: Any = SimpleNamespace(vertices=mesh.vertices, faces=mesh.faces)
    return TriangleMesh(shape)
