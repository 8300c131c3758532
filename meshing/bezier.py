"""Tensor Bezier patches, polynomial and rational: evaluation, bounds, transformations, files."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.bpt import read_patches, write_patches
from meshing.checks import FloatArray, IdArray, as_affine, as_path, check_is_file, freeze
from meshing.double_double import Pair, affine_image
from meshing.kernels import bernstein, subdivision
from meshing.nets import as_nets, as_weights, check_finite, degrees_in_words, is_rational
from meshing.parametric import ParametricSurface
from meshing.polynomials import net_of_polynomial


class BezierPatches(ParametricSurface):
    """One or more tensor product Bezier patches, polynomial or rational, as one surface.

    A point of patch p is the sum of its control points (i, j) times B_i(u) B_j(v): u follows the
    row index of the net, v the column index. If there are weights w_ij, the point is the mean of
    the control points with weights B_i(u) B_j(v) w_ij, which represents cylinders, spheres and
    other quadrics exactly. The normal is along S_u x S_v.

    Parameters
    ----------
    control : (k, m + 1, n + 1, 3) array, or a sequence of (m + 1, n + 1, 3) arrays
        Control points in scene units, any real dtype. The degrees m and n are from 1 to 30; in a
        sequence each patch may have its own.
    weights : (k, m + 1, n + 1) array, or a sequence of (m + 1, n + 1) arrays, optional
        Weights of the control points: positive, the smallest of a patch at least 1e-6 of its
        largest. Only their ratios within a patch matter; if all are equal the patches are
        polynomial.

    Raises
    ------
    ValueError, TypeError
        For a wrong shape, a degree outside 1 to 30, NaN or infinity, a patch without area, and
        weights that are not positive or too far apart.

    References
    ----------
    Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, chapters 13 and 16.
    """

    flip_of_uv = "swapped"

    remainder: FloatArray | None = None
    """(total, 3) float64: what rounding to `control` left of the points that are meant; None: nothing.

    Patches that are converted or transformed have it. Rays meet the sum of both.
    """

    moved = 0.0
    """How far, at most, the patches are from the surface that they were converted from."""

    def __new__(
        cls,
        control: ArrayLike | Iterable[ArrayLike],
        weights: ArrayLike | Sequence[ArrayLike] | None = None,
    ) -> Self:
        """Make `RationalPatches` where weights differ."""
        del control
        kind: Any = RationalPatches if cls is BezierPatches and is_rational(weights) else cls
        return super().__new__(kind)

    def __init__(
        self,
        control: ArrayLike | Iterable[ArrayLike],
        weights: ArrayLike | Sequence[ArrayLike] | None = None,
    ) -> None:
        self._set_control(control)
        if weights is not None:
            as_weights(weights, self._degrees)
        # What kernels evaluate, and what kind of net it is: None is a polynomial one.
        self._net, self._rational = self._control, None
        self._check_area()

    _rational: bool | None

    def _set_control(self, control: ArrayLike | Iterable[ArrayLike]) -> None:
        nets = as_nets(control)
        shapes = np.array([net.shape[:2] for net in nets], dtype=np.int64).reshape(-1, 2)
        self._degrees: NDArray[np.int64] = shapes - 1
        self._starts = np.concatenate(([0], np.cumsum(shapes.prod(axis=1))))
        if isinstance(nets, np.ndarray):
            self._control = freeze(nets.reshape(-1, 3).copy())
        else:
            self._control = freeze(np.concatenate([net.reshape(-1, 3) for net in nets]))
        check_finite(self._control, self._starts, self._degrees)
        for array in (self._degrees, self._starts):
            array.setflags(write=False)

    def _check_area(self) -> None:
        reach = np.maximum.reduceat(np.abs(self._control).max(axis=1), self._starts[:-1])
        collapsed = bernstein.first_collapsed_patch(
            self._net, self._starts, self._degrees, reach, self._rational
        )
        if collapsed >= 0:
            raise ValueError(
                f"BezierPatches patch {collapsed} has no area (a curve or a point is left): remove it"
            )

    @classmethod
    def of_pairs(
        cls,
        nets: Sequence[Pair],
        weights: ArrayLike | Sequence[ArrayLike] | None = None,
        moved: float = 0.0,
    ) -> BezierPatches:
        """Return patches whose control points, (m + 1, n + 1, 3) pairs, are known beyond float64."""
        made = BezierPatches([high for high, _ in nets], weights)
        left = np.concatenate([low.reshape(-1, 3) for _, low in nets])
        made.remainder = freeze(left) if left.any() else None
        made.moved = moved
        return made

    @classmethod
    def read(cls, path: str | Path) -> BezierPatches:
        """Read a .bpt file.

        Raises
        ------
        FileNotFoundError, ValueError
            If the file is missing or malformed. The message names the file and the line, and says
            what was expected there.
        """
        file = as_path(path, "BezierPatches file")
        check_is_file(file, f"BezierPatches file {str(path)!r}")
        return cls(read_patches(file))

    @classmethod
    def from_polynomial(cls, coefficients: ArrayLike, x: ArrayLike, y: ArrayLike) -> BezierPatches:
        """Return the graph of a polynomial over a rectangle: z = sum of c_ij x^i y^j.

        It is one patch. u follows x and v follows y, each linearly, and the normal points to +z.
        Control points are the floats next to the true ones.

        Parameters
        ----------
        coefficients : (m + 1, n + 1) array
            c_ij, as for ``numpy.polynomial.polynomial.polyval2d``. The degrees m and n are up to 30.
        x, y : (2,) array
            Where the rectangle begins and ends, in scene units.

        Raises
        ------
        ValueError, TypeError
            For a wrong shape, a degree above 30, NaN or infinity, and a rectangle that is empty.

        Notes
        -----
        Points are exact to rounding of the largest control point. A Zernike polynomial is at most 1 on
        the unit disc, but control points over the square around it reach 18 at degree 4, 1700 at degree
        10 and 8e6 at degree 20.

        References
        ----------
        Farin, "Curves and Surfaces for CAGD", 5th edition, 2002, section 6.5.
        """
        net, left = net_of_polynomial(coefficients, x, y)
        try:
            return BezierPatches.of_pairs([(net, left)])
        except ValueError:
            wide, long, _ = np.ptp(net, axis=(0, 1))
            raise ValueError(
                f"BezierPatches.from_polynomial leaves no area: z reaches {np.abs(net[..., 2]).max():g} "
                f"over a rectangle {wide:g} x {long:g}: pass smaller coefficients, a lower degree, or another rectangle"
            ) from None

    def write(self, path: str | Path) -> None:
        """Write a .bpt file, from which `read` returns the same float64 control points.

        Raises
        ------
        ValueError, OSError
            If the patches are rational, since .bpt files hold no weights; if the file cannot be
            written.
        """
        file = as_path(path, "BezierPatches file")
        if self.weights is not None:
            raise ValueError(
                f"BezierPatches file {str(path)!r}: .bpt files hold no weights; keep `patches` and "
                "`weights` in a file of your own, for instance by numpy.savez"
            )
        write_patches(file, self.patches)

    @cached_property
    def patches(self) -> tuple[FloatArray, ...]:
        """Control nets, each (m + 1, n + 1, 3) float64, read-only."""
        return tuple(self._nets_of(self._control))

    @cached_property
    def remainders(self) -> tuple[FloatArray, ...]:
        """What rounding left of the control points of each patch, (m + 1, n + 1, 3): `remainder`."""
        whole = np.zeros_like(self._control) if self.remainder is None else self.remainder
        return tuple(map(freeze, self._nets_of(whole)))

    @property
    def pieces(self) -> Self:
        """The patches themselves: each has (u, v) in the unit square."""
        return self

    @property
    def control(self) -> FloatArray:
        """(total, 3) float64: the control points of all patches in order, read-only; see `remainder`."""
        return self._control

    @property
    def weights(self) -> tuple[FloatArray, ...] | None:
        """Weights of each patch, (m + 1, n + 1) float64, read-only; None if polynomial."""
        return None

    @property
    def starts(self) -> NDArray[np.int64]:
        """(k + 1,) int64: patch p holds the rows ``starts[p]`` to ``starts[p + 1]`` of `control`."""
        return self._starts

    @property
    def degrees(self) -> NDArray[np.int64]:
        """(k, 2) int64: degrees in u and in v."""
        return self._degrees

    @cached_property
    def closes(self) -> tuple[bool, bool]:
        """Whether a single patch meets itself bit for bit, at u = 0 and 1, and at v = 0 and 1.

        Several patches have a (u, v) each, so they do not close as one; a `PatchSheet` may.
        """
        return (self.meet(0, 0, 0), self.meet(0, 0, 1)) if len(self) == 1 else (False, False)

    def meet(self, one: int, other: int, axis: int) -> bool:
        """Tell whether patch ``one`` begins with the border that patch ``other`` ends with.

        They do if the control points are equal bit for bit, and the weights up to a power of two.

        Parameters
        ----------
        one, other : int
            Patches.
        axis : int
            0: the borders u = 0 and u = 1; 1: those of v.
        """
        begin, end = self.patches[one].take(0, axis), self.patches[other].take(-1, axis)
        if not np.array_equal(begin, end):
            return False
        if self.weights is None:
            return True
        w_begin: FloatArray = np.take(self.weights[one], 0, axis)
        w_end: FloatArray = np.take(self.weights[other], -1, axis)
        # Exact, as the ratio is a power of two.
        ratio = w_end[0] / w_begin[0]
        return bool(np.frexp(ratio)[0] == 0.5 and (w_begin * ratio == w_end).all())

    def __len__(self) -> int:
        """Return the number of patches."""
        return len(self._degrees)

    def __repr__(self) -> str:
        """Name the number of patches and their degrees."""
        return f"BezierPatches({len(self)} of {degrees_in_words(self._degrees)})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle control nets and weights; loading checks them again."""
        parts = [self.patches] if self.weights is None else [self.patches, self.weights]
        state = None
        if self.remainder is not None or self.moved != 0.0:
            left = None if self.remainder is None else np.array(self.remainder)
            state = {"remainder": left, "moved": self.moved}
        return type(self), tuple([np.array(net) for net in part] for part in parts), state

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch, read-only."""
        return freeze(self._widened(self._boxes_of_nets()))

    def _widened(self, boxes: FloatArray) -> FloatArray:
        """Return boxes around the points that are meant, where control points are rounded."""
        if self.remainder is not None:
            # A remainder is at most half an ulp of its coordinate.
            low = np.minimum.reduceat(self.remainder, self._starts[:-1]) < 0.0
            high = np.maximum.reduceat(self.remainder, self._starts[:-1]) > 0.0
            boxes[:, 0] = np.where(low, np.nextafter(boxes[:, 0], -np.inf), boxes[:, 0])
            boxes[:, 1] = np.where(high, np.nextafter(boxes[:, 1], np.inf), boxes[:, 1])
        if self.moved > 0.0:
            boxes[:, 0] -= 2.0 * self.moved
            boxes[:, 1] += 2.0 * self.moved
        return boxes

    def _boxes_of_nets(self) -> FloatArray:
        boxes = np.empty((len(self), 2, 3))
        subdivision.patch_boxes(self._net, self._starts, self._degrees, self._rational, boxes)
        return boxes

    def transformed(self, matrix: ArrayLike) -> BezierPatches:
        """Return the image under an affine map; see `meshing.surface.Surface.transformed`.

        The matrix is applied to the control points, in double-double: rays meet the image of the surface
        itself, not that of rounded points. The normal stays along S_u x S_v, so a reflection moves it to
        the other side.
        """
        linear, shift = as_affine(matrix, "BezierPatches")
        left = np.concatenate([net.reshape(-1, 3) for net in self.remainders])
        high, low = affine_image(linear, shift, (self._control, left))
        nets = list(zip(self._nets_of(high), self._nets_of(low), strict=True))
        moved = self.moved * float(np.linalg.norm(linear, 2))
        return BezierPatches.of_pairs(nets, self.weights, moved)

    def flipped(self) -> BezierPatches:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        nets = [
            (net.swapaxes(0, 1), left.swapaxes(0, 1))
            for net, left in zip(self.patches, self.remainders, strict=True)
        ]
        weights = None if self.weights is None else [w.T for w in self.weights]
        return BezierPatches.of_pairs(nets, weights, self.moved)

    def _nets_of(self, columns: FloatArray) -> list[FloatArray]:
        """Return an array of one row for each control point as one for each patch."""
        pieces = np.split(columns, self._starts[1:-1])
        sizes = (self._degrees + 1).tolist()
        return [
            piece.reshape(*size, *columns.shape[1:])
            for piece, size in zip(pieces, sizes, strict=True)
        ]

    def _derivatives(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray, order_u: int, order_v: int
    ) -> FloatArray:
        out = np.empty((u.size, 3))
        bernstein.evaluate_patches(
            self._net, self._starts, self._degrees, patch_id, u, v, order_u, order_v,
            self._rational, out,
        )  # fmt: skip
        return out

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        out, is_degenerate = np.empty((u.size, 3)), np.empty(u.size, np.bool_)
        bernstein.normals_of_patches(
            self._net,
            self._starts,
            self._degrees,
            patch_id,
            u,
            v,
            self._rational,
            out,
            is_degenerate,
        )
        return out


class RationalPatches(BezierPatches):
    """Rational Bezier patches; ``BezierPatches(control, weights)`` makes them.

    Weights count up to a factor of each patch. Arithmetic is that of the homogeneous net
    (w (P - c), w), c the middle of each patch's net: a quotient of two Bernstein sums whose terms
    in w are all positive, so it is as accurate as one of them.
    """

    def __init__(
        self, control: ArrayLike | Iterable[ArrayLike], weights: ArrayLike | Sequence[ArrayLike]
    ) -> None:
        self._set_control(control)
        given = as_weights(weights, self._degrees)
        self._weights = freeze(np.concatenate([net.reshape(-1) for net in given]))
        first = self._starts[:-1]
        low = np.minimum.reduceat(self._control, first)
        high = np.maximum.reduceat(self._control, first)
        self._centres = freeze(0.5 * low + 0.5 * high)
        counts = np.diff(self._starts)
        # A power of two each, so that weights stay exact: the largest is in [1/2, 1).
        exponent = np.frexp(np.maximum.reduceat(self._weights, first))[1]
        w = np.ldexp(self._weights, -np.repeat(exponent, counts))
        away = self._control - np.repeat(self._centres, counts, axis=0)
        self._net = freeze(np.concatenate([w[:, None] * away, w[:, None]], axis=1))
        self._rational = True
        self._check_area()

    @cached_property
    def weights(self) -> tuple[FloatArray, ...]:
        """Weights of each patch, (m + 1, n + 1) float64, as given, read-only."""
        return tuple(self._nets_of(self._weights))

    @property
    def homogeneous(self) -> FloatArray:
        """(total, 4) float64: (w (P - c), w), each patch's largest w in [1/2, 1), read-only."""
        return self._net

    @property
    def centres(self) -> FloatArray:
        """(k, 3) float64: the point c of each patch, read-only."""
        return self._centres

    def __repr__(self) -> str:
        """Name the number of patches and their degrees."""
        return super().__repr__()[:-1] + ", rational)"

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch, read-only."""
        boxes = self._boxes_of_nets() + self._centres[:, None]
        # The sum rounds once more; the box of the control points needs no rounding.
        boxes[:, 0] = np.nextafter(boxes[:, 0], -np.inf)
        boxes[:, 1] = np.nextafter(boxes[:, 1], np.inf)
        first = self._starts[:-1]
        boxes[:, 0] = np.maximum(boxes[:, 0], np.minimum.reduceat(self._control, first))
        boxes[:, 1] = np.minimum(boxes[:, 1], np.maximum.reduceat(self._control, first))
        return freeze(self._widened(boxes))

    def _derivatives(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray, order_u: int, order_v: int
    ) -> FloatArray:
        out = super()._derivatives(u, v, patch_id, order_u, order_v)
        return out + self._centres[patch_id] if order_u == order_v == 0 else out
