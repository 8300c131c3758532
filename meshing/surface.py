"""The interface of surfaces: points, partials, normals, bounds, transformations, area sampling.

A new surface derives from `Surface`, implements the abstract methods and overrides the defaults
that do not hold for it. A surface knows nothing of rays: ray intersection, and the tests of its
hits, are registered elsewhere by class.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import FloatArray, IdArray, broadcast_parameters

if TYPE_CHECKING:
    from meshing.area import AreaSampler
    from meshing.certified_mesh import CertifiedMesh


def box_around(boxes: FloatArray) -> FloatArray:
    """Return the box (2, 3), lower and upper corner, around boxes (n, 2, 3)."""
    return np.stack([boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)])


class Surface(ABC):
    """A surface S(u, v) of one or more patches, with its normal along S_u x S_v."""

    is_freeform: ClassVar[bool] = False
    """Given by control points: `tessellate` cuts it, and Embree meets its triangles first."""
    is_bounded: ClassVar[bool] = True
    """Is bounded: has a box around it and an area, and photons can be sent to it."""
    is_flat: ClassVar[bool] = False
    """Lies in one plane, so that no light goes from one point of it to another."""
    is_closed: ClassVar[bool] = False
    """Always encloses a body by itself, whatever its parameters."""
    is_triangular: ClassVar[bool] = False
    """(u, v) are barycentric weights, u + v <= 1; otherwise they fill the unit square."""

    moved: float = 0.0
    """Bound on the distance of its points from those that were meant, scene units: what rounding did to an
    image (`transformed`) or a conversion, and is carried in no other number."""

    flip_of_uv: ClassVar[str] = ""
    """What `flipped` does to (u, v): "swapped", "u reversed" or "v reversed". "": loops cannot trim it."""

    def __len__(self) -> int:
        """Return the number of patches; ``patch_id`` counts them from 0."""
        return 1

    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None) -> FloatArray:
        """Return the points (..., 3) float64 at (u, v) of patches, scene units.

        The leading axes are those that ``u``, ``v`` and ``patch_id`` broadcast to: (3,) for scalars.

        Parameters
        ----------
        u, v : float array-like
            Parameters, from 0 to 1 on the surface: beyond, its polynomials go on. They broadcast with each
            other and with ``patch_id``.
        patch_id : int array-like, optional
            Patch, profile segment or face of each (u, v). Default: the first, or on a sheet of patches the
            one that holds (u, v).

        Raises
        ------
        ValueError, TypeError
            If they do not broadcast, or there is no such patch.
        """
        u, v, ids, shape = self._flat(u, v, patch_id)
        return self._points(u, v, ids).reshape(*shape, 3)

    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the first partials S_u and S_v; arguments, shapes and errors are those of `point`."""
        u, v, ids, shape = self._flat(u, v, patch_id)
        s_u, s_v = self._partials(u, v, ids)
        return s_u.reshape(*shape, 3), s_v.reshape(*shape, 3)

    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None) -> FloatArray:
        """Return unit normals along S_u x S_v; arguments, shapes and errors are those of `point`.

        Where S_u x S_v vanishes (a collapsed edge, a cusp, a pole), this is its limit from inside.
        """
        u, v, ids, shape = self._flat(u, v, patch_id)
        return self._normals(u, v, ids).reshape(*shape, 3)

    def _flat(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None
    ) -> tuple[FloatArray, FloatArray, IdArray, tuple[int, ...]]:
        patch = self._patch_at(u, v) if patch_id is None else patch_id
        return broadcast_parameters(u, v, patch, len(self))

    # --- of n points, whose patches exist

    def _patch_at(self, u: ArrayLike, v: ArrayLike) -> ArrayLike:
        """Return the patches that hold (u, v), where none are given."""
        del u, v
        return 0

    @abstractmethod
    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        """Return the points (n, 3)."""

    @abstractmethod
    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return S_u and S_v, each (n, 3)."""

    @abstractmethod
    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        """Return the unit normals (n, 3)."""

    # --- shape

    @property
    @abstractmethod
    def bounds(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner of the axis-aligned bounding box."""

    @abstractmethod
    def transformed(self, matrix: ArrayLike) -> Surface:
        """Return the image under an affine map; (u, v) stay with their points.

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1); last row (0, 0, 0, 1); not singular. Spheres, tori, aspheres and
            surfaces of revolution take similarities: rotation, shift, uniform scale, reflection.

        Raises
        ------
        ValueError, TypeError
            For any other matrix.
        """

    @abstractmethod
    def flipped(self) -> Self:
        """Return the same surface with its normals reversed."""

    @property
    def pieces(self) -> Surface:
        """The patches, each with (u, v) in the unit square: the surface itself, but for sheets."""
        return self

    @property
    def spans(self) -> FloatArray | None:
        """(k, 4): u0, u1, v0, v1 of each patch on a sheet; None if each fills the unit square."""
        return None

    @property
    def closes(self) -> tuple[bool, bool]:
        """Whether u = 0 and u = 1 are the same points, and v = 0 and v = 1."""
        return False, False

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether all points of v = 0 are one, and all of v = 1: no edge of a surface about an axis."""
        return False, False

    @property
    def bend(self) -> tuple[float, float, float] | None:
        """Bounds on |S_uu|, |S_uv| and |S_vv| of a surface of one piece; None: none is known."""
        return None

    @property
    def v_breaks(self) -> FloatArray | None:
        """(k + 1,) float64, where pieces that follow each other along v begin and end; else None.

        That is in one v from 0 to 1 for all of them.
        """
        return None

    # --- size and rounding

    @property
    def middle(self) -> FloatArray:
        """(3,) float64: the point from which rounding tolerances measure distances."""
        low, high = self.bounds
        return np.asarray(0.5 * (low + high))

    @property
    def size(self) -> float:
        """Diameter, scene units; 0 for an unbounded surface."""
        low, high = self.bounds
        return math.hypot(*(high - low).tolist())

    @property
    def reach(self) -> float:
        """Largest absolute coordinate of its points, scene units."""
        return float(np.abs(self.bounds).max())

    @property
    def rounding_reach(self) -> float:
        """The largest number in the computation of a hit point; rounding is relative to it.

        0 if only the coordinates of the point itself are rounded.
        """
        return self.reach

    def area_sampler(self) -> AreaSampler | None:
        """Return the area sampler; None: it is unbounded. A ValueError says that the area is 0."""
        from meshing.area import Grid

        return Grid(self) if self.is_bounded else None

    @property
    def ball(self) -> tuple[FloatArray, float] | None:
        """Centre and radius if the surface is a sphere, otherwise None."""
        return None

    @property
    def revolution_frame(self) -> FloatArray | None:
        """(4, 3): origin, axis, radial, binormal of a surface about an axis; otherwise None."""
        return None

    @property
    def carrier(self) -> Hashable | None:
        """A key that is equal for surfaces that are the same set of points.

        None if parts of the surface may coincide with parts of others, as flat faces do. Surfaces
        with different keys share no area.
        """
        return None

    def triangles(self) -> CertifiedMesh:
        """Return the triangles of a surface that is made of them; of others `tessellate` makes some."""
        raise TypeError(f"{type(self).__name__} is not made of triangles")
