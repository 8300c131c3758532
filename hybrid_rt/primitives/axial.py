"""What closed-form surfaces about an axis have in common: their frame and their orientation."""

import copy
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from meshing.checks import as_direction, as_vector, direction_across
from meshing.surface import Surface


class AxialSurface(Surface):
    """A surface about an axis; u runs about it, right-handed, and is 0 along ``radial``."""

    origin: FloatArray
    axis: FloatArray  # unit
    radial: FloatArray  # unit, normal to the axis
    orientation: int  # 1, or -1 if it is flipped

    def _set_frame(self, origin: ArrayLike, axis: ArrayLike, reference: ArrayLike | None) -> None:
        """Check and set the frame, not flipped."""
        name = type(self).__name__
        self.origin = as_vector(origin, f"{name} origin")
        self.axis = as_direction(axis, f"{name} axis")
        self.radial = direction_across(self.axis, reference, f"{name} reference")
        self.orientation = 1

    @property
    def binormal(self) -> FloatArray:
        """(3,): where u is a quarter."""
        return np.cross(self.axis, self.radial)

    @property
    def revolution_frame(self) -> FloatArray:
        """(4, 3): origin, axis, radial, binormal."""
        return np.stack([self.origin, self.axis, self.radial, self.binormal])

    @property
    def middle(self) -> FloatArray:
        """(3,): the origin."""
        return self.origin

    def flipped(self) -> Self:
        """Return the same surface with its normal reversed; parameters become (u, 1 - v)."""
        image = copy.copy(self)
        image.orientation = -self.orientation
        return image

    def _world(self, x: FloatArray, y: FloatArray, z: FloatArray) -> FloatArray:
        """Return vectors (..., 3) from their parts along radial, binormal and axis."""
        return x[..., None] * self.radial + y[..., None] * self.binormal + z[..., None] * self.axis
