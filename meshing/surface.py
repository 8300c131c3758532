"""What every surface can say about itself: the one interface that the rest of the program asks.

Whoever writes a new surface derives from `Surface`, gives the abstract methods, and overrides of
the others what is not true of it. How rays meet it is said elsewhere, in a registry by class, and
so is how its hits are judged: a surface knows nothing of rays.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable
from typing import TYPE_CHECKING, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import FloatArray

if TYPE_CHECKING:
    from meshing.area import AreaSampler
    from meshing.certified_mesh import CertifiedMesh


class Surface(ABC):
    """Points S(u, v) of one or more patches, with a normal along S_u x S_v."""

    is_freeform: ClassVar[bool] = False
    """Given by control points: `tessellate` cuts it, and Embree meets its triangles first."""
    is_bounded: ClassVar[bool] = True
    """Has an end: a box around it, an area, photons that can be sent to it."""
    is_flat: ClassVar[bool] = False
    """Lies in one plane, so that no light goes from one point of it to another."""
    is_triangular: ClassVar[bool] = False
    """(u, v) are weights of a triangle's corners, u + v <= 1; else they fill the unit square."""

    def __len__(self) -> int:
        """Return the number of patches; ``patch_id`` counts them from 0."""
        return 1

    @abstractmethod
    def point(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return the points (n, 3) float64 at (u, v) of patches, scene units.

        Parameters
        ----------
        u, v : floats that broadcast with each other and with ``patch_id``
        patch_id : whole numbers

        Raises
        ------
        ValueError, TypeError
            If they do not broadcast, or there is no such patch.
        """

    @abstractmethod
    def partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0
    ) -> tuple[FloatArray, FloatArray]:
        """Return the first partials S_u and S_v, each shaped like `point`.

        Arguments and errors are those of `point`.
        """

    @abstractmethod
    def normal(self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike = 0) -> FloatArray:
        """Return unit normals along S_u x S_v, shaped like `point`.

        Arguments and errors are those of `point`.
        """

    @property
    @abstractmethod
    def bounds(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner of a box around it, along the axes."""

    @abstractmethod
    def transformed(self, matrix: ArrayLike) -> Self:
        """Return the image under a (4, 4) matrix that acts on columns (x, y, z, 1)."""

    @abstractmethod
    def flipped(self) -> Self:
        """Return the same surface with its normals reversed."""

    # --- size and rounding

    @property
    def middle(self) -> FloatArray:
        """(3,) float64: the point from which distances count in what is decided within rounding."""
        low, high = self.bounds
        return np.asarray(0.5 * (low + high))

    @property
    def size(self) -> float:
        """Its diameter, scene units; 0 where it has no end."""
        low, high = self.bounds
        return math.hypot(*(high - low).tolist())

    @property
    def reach(self) -> float:
        """The largest coordinate of its points."""
        return float(np.abs(self.bounds).max())

    @property
    def rounding_reach(self) -> float:
        """The largest number from which points of hits are computed: they round relative to it.

        0 where nothing but a point's own coordinates rounds.
        """
        return self.reach

    # --- light

    def area_sampler(self) -> AreaSampler | None:
        """Return what chooses points by area; None where it has no end.

        Raises
        ------
        ValueError
            If it has no area. The caller names the surface.
        """
        from meshing.area import Grid

        return Grid(self) if self.is_bounded else None

    # --- shape

    @property
    def ball(self) -> tuple[FloatArray, float] | None:
        """Centre and radius of the ball whose boundary it is; None for all but spheres."""
        return None

    @property
    def revolution_frame(self) -> FloatArray | None:
        """(4, 3): origin, axis, radial, binormal if it is turned about an axis; else None."""
        return None

    @property
    def carrier(self) -> Hashable | None:
        """What equals that of another surface where the two are the same set of points.

        None if parts of it may coincide with parts of others, as flat faces do. A surface that has
        one shares area with none but its equals.
        """
        return None

    def triangles(self) -> CertifiedMesh:
        """Return the triangles that it is made of (`tessellate` cuts those given by control points).

        Raises
        ------
        TypeError
            If it is not made of triangles.
        """
        raise TypeError(f"{type(self).__name__} is not made of triangles")
