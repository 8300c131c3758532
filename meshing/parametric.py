"""What parametric surfaces share: partial derivatives of any order at (u, v), boxes of their pieces."""

from abc import abstractmethod

from numpy.typing import ArrayLike

from meshing.checks import FloatArray, IdArray
from meshing.surface import Surface, box_around


class ParametricSurface(Surface):
    """A surface of one or more pieces, each a map S(u, v) of the unit square."""

    is_freeform = True

    @property
    @abstractmethod
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each piece."""

    @abstractmethod
    def _derivatives(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray, order_u: int, order_v: int
    ) -> FloatArray:
        """Return partial derivatives of the given orders, (n, 3)."""

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        return self._derivatives(u, v, patch_id, 0, 0)

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        return self._derivatives(u, v, patch_id, 1, 0), self._derivatives(u, v, patch_id, 0, 1)

    def second_partials(
        self, u: ArrayLike, v: ArrayLike, patch_id: ArrayLike | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return S_uu, S_uv and S_vv; arguments, shapes and errors are those of `Surface.point`."""
        u, v, ids, shape = self._flat(u, v, patch_id)
        s_uu, s_uv, s_vv = (
            self._derivatives(u, v, ids, *orders).reshape(*shape, 3)
            for orders in ((2, 0), (1, 1), (0, 2))
        )
        return s_uu, s_uv, s_vv

    @property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner of a box around the surface.

        The box is conservative: it exceeds the tight box by about 1/256 of what the box of the
        control points exceeds it by.
        """
        return box_around(self.patch_bounds)
