"""Rational tensor Bezier patches: weights, evaluation about each patch's centre, bounds."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.bezier import BezierPatches
from meshing.checks import BoolArray, FloatArray, as_floats, freeze, shown
from meshing.kernels import bernstein, subdivision

# Below this ratio of weights the convex hull of a net says next to nothing of its surface.
LEAST_RATIO = 1e-6


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
        self._homogeneous = freeze(np.concatenate([w[:, None] * away, w[:, None]], axis=1))
        self._check_area(self._homogeneous, True)

    @cached_property
    def weights(self) -> tuple[FloatArray, ...]:
        """Weights of each patch, (m + 1, n + 1) float64, as given, read-only."""
        starts, degrees = self._starts.tolist(), self._degrees.tolist()
        return tuple(
            self._weights[start:stop].reshape(m + 1, n + 1)
            for start, stop, (m, n) in zip(starts[:-1], starts[1:], degrees, strict=True)
        )

    @property
    def homogeneous(self) -> FloatArray:
        """(total, 4) float64: (w (P - c), w), each patch's largest w in [1/2, 1), read-only."""
        return self._homogeneous

    @property
    def centres(self) -> FloatArray:
        """(k, 3) float64: the point c of each patch, read-only."""
        return self._centres

    def __repr__(self) -> str:
        """Name the number of patches and their degrees."""
        return super().__repr__()[:-1] + ", rational)"

    def __reduce__(self) -> tuple[type[BezierPatches], tuple[list[FloatArray], ...]]:
        """Pickle control nets and weights; loading checks them again."""
        nets = [np.array(net) for net in self.patches]
        return RationalPatches, (nets, [np.array(w) for w in self.weights])

    def write(self, path: str | Path) -> None:
        """Refuse: .bpt files have no weights.

        Raises
        ------
        ValueError
        """
        raise ValueError(
            f"BezierPatches file {str(path)!r}: .bpt files hold no weights; keep `patches` and "
            "`weights` in a file of your own, for instance by numpy.savez"
        )

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each patch, read-only."""
        boxes = np.empty((len(self), 2, 3))
        subdivision.patch_boxes(self._homogeneous, self._starts, self._degrees, True, boxes)
        boxes += self._centres[:, None]
        # The sum rounds once more; the box of the control points needs no rounding.
        boxes[:, 0] = np.nextafter(boxes[:, 0], -np.inf)
        boxes[:, 1] = np.nextafter(boxes[:, 1], np.inf)
        first = self._starts[:-1]
        boxes[:, 0] = np.maximum(boxes[:, 0], np.minimum.reduceat(self._control, first))
        boxes[:, 1] = np.minimum(boxes[:, 1], np.maximum.reduceat(self._control, first))
        return freeze(boxes)

    def flipped(self) -> RationalPatches:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        nets = [net.transpose(1, 0, 2) for net in self.patches]
        return RationalPatches(nets, [w.T for w in self.weights])

    def _with_control(self, control: FloatArray) -> RationalPatches:
        return RationalPatches(self._nets_of(control), self.weights)

    def _fill(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        order_u: int,
        order_v: int,
        out: FloatArray,
    ) -> None:
        bernstein.evaluate_patches(
            self._homogeneous, self._starts, self._degrees, ids, u, v, order_u, order_v, True, out
        )
        if order_u == order_v == 0:
            out += self._centres[ids]

    def _fill_normals(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        out: FloatArray,
        is_degenerate: BoolArray,
    ) -> None:
        bernstein.normals_of_patches(
            self._homogeneous, self._starts, self._degrees, ids, u, v, True, out, is_degenerate
        )


def as_weights(
    weights: ArrayLike | Sequence[ArrayLike], degrees: NDArray[np.int64]
) -> list[FloatArray]:
    """Return the weights of each patch.

    Parameters
    ----------
    weights : (k, m + 1, n + 1) array, or a sequence of (m + 1, n + 1) arrays
    degrees : (k, 2) int64

    Raises
    ------
    ValueError, TypeError
        For a wrong shape, and weights that are not positive and finite, or differ by more than 1e6
        within a patch.
    """
    if not isinstance(weights, Sequence | np.ndarray) or isinstance(weights, str | bytes):
        raise TypeError(f"BezierPatches weights is {shown(weights)}: pass one array for each patch")
    if len(weights) != len(degrees):
        raise ValueError(
            f"BezierPatches weights has {len(weights)} arrays for {len(degrees)} patches: pass one "
            "for each"
        )
    nets = []
    for p, (net, degree) in enumerate(zip(weights, degrees, strict=True)):
        w = as_floats(net, f"BezierPatches weights of patch {p}")
        shape = (int(degree[0]) + 1, int(degree[1]) + 1)
        if w.shape != shape:
            raise ValueError(
                f"BezierPatches weights of patch {p} has shape {w.shape}: pass {shape}, one weight "
                "for each control point"
            )
        check_weights(w, f"BezierPatches weights of patch {p}")
        nets.append(w)
    return nets


def check_weights(weights: FloatArray, what: str) -> None:
    """Refuse weights (m + 1, n + 1) that leave no convex hull; ``what`` is named.

    Raises
    ------
    ValueError
    """
    for i, j in np.argwhere(~(np.isfinite(weights) & (weights > 0.0)))[:1]:
        raise ValueError(
            f"{what} is {weights[i, j]:g} at ({i}, {j}): pass finite numbers above 0 (a surface "
            "with others may leave the convex hull of its control points)"
        )
    least, most = float(weights.min()), float(weights.max())
    if not least >= LEAST_RATIO * most:
        raise ValueError(
            f"{what} lies between {least:g} and {most:g}, more than {1.0 / LEAST_RATIO:g} apart: "
            "pass weights of one patch closer together (subdivide it first)"
        )


def is_rational(weights: object) -> bool:
    """Tell whether any patch has weights that are not all equal, or may not be weights at all."""
    if weights is None:
        return False
    try:
        arrays = [np.asarray(net, dtype=np.float64) for net in weights]  # type: ignore[attr-defined]
        return any(array.min() != array.max() for array in arrays)
    except (TypeError, ValueError):
        return True
