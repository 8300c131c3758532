"""Checks of control nets and of weights, and their degrees in words."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import FloatArray, as_floats, shown
from meshing.kernels import bernstein

# Below this ratio of weights the convex hull of a net says next to nothing of its surface.
LEAST_RATIO = 1e-6


def as_nets(control: ArrayLike | Iterable[ArrayLike]) -> FloatArray | list[FloatArray]:
    """Return control nets: (k, m + 1, n + 1, 3), or a list of (m + 1, n + 1, 3) arrays."""
    if isinstance(control, np.ndarray) and control.dtype != object:
        stack = as_floats(control, "BezierPatches control")
        if stack.ndim != 4 or stack.shape[3] != 3:
            raise ValueError(
                f"BezierPatches control has shape {control.shape}: pass (patches, m + 1, n + 1, 3)"
                + (", put one net into a list" if stack.ndim == 3 else "")
            )
        if stack.shape[0] == 0:
            raise ValueError("BezierPatches control holds no patches: pass at least one")
        _check_shape(stack.shape[1:], "BezierPatches: each patch")
        return stack
    if isinstance(control, str | bytes) or not isinstance(control, Iterable):
        raise TypeError(f"BezierPatches control is {shown(control)}: pass a sequence of nets")
    nets = [as_floats(net, f"BezierPatches patch {p}") for p, net in enumerate(control)]
    if not nets:
        raise ValueError("BezierPatches control holds no patches: pass at least one")
    for p, net in enumerate(nets):
        _check_shape(net.shape, f"BezierPatches patch {p}")
    return nets


def _check_shape(shape: tuple[int, ...], name: str) -> None:
    if len(shape) != 3 or shape[2] != 3:
        raise ValueError(f"{name} has shape {shape}: pass (m + 1, n + 1, 3)")
    for degree, direction in ((shape[0] - 1, "u"), (shape[1] - 1, "v")):
        if not 1 <= degree <= bernstein.MAX_DEGREE:
            raise ValueError(
                f"{name} has degree {degree} in {direction}: pass 1 to {bernstein.MAX_DEGREE}"
                + (" (degree 0 would make it a curve)" if degree == 0 else "")
            )


def check_finite(
    control: FloatArray, starts: NDArray[np.int64], degrees: NDArray[np.int64]
) -> None:
    """Refuse control points (total, 3) that are not finite, by patch and place."""
    bad = np.flatnonzero(~np.isfinite(control).all(axis=1))
    if bad.size:
        p = int(np.searchsorted(starts, bad[0], side="right")) - 1
        i, j = divmod(int(bad[0] - starts[p]), int(degrees[p, 1]) + 1)
        raise ValueError(
            f"BezierPatches patch {p}, control point ({i}, {j}) is {control[bad[0]].tolist()}: "
            "pass finite numbers"
        )


def as_weights(
    weights: ArrayLike | Sequence[ArrayLike], degrees: NDArray[np.int64]
) -> list[FloatArray]:
    """Return the weights (m + 1, n + 1) of each patch."""
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
    """Refuse weights of a curve or patch that leave no convex hull."""
    for at in np.argwhere(~(np.isfinite(weights) & (weights > 0.0)))[:1].tolist():
        raise ValueError(
            f"{what} is {weights[tuple(at)]:g} at {at[0] if len(at) == 1 else tuple(at)}: pass finite "
            "numbers above 0 (with others, what they weight may leave the convex hull of its points)"
        )
    least, most = float(weights.min()), float(weights.max())
    if not least >= LEAST_RATIO * most:
        raise ValueError(
            f"{what} lies between {least:g} and {most:g}, more than {1.0 / LEAST_RATIO:g} apart: "
            "pass weights closer together (subdivide the patch or segment first)"
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


def degrees_in_words(degrees: ArrayLike) -> str:
    """Return "degree 3", or "degrees 1 to 3", for degrees of any shape."""
    low, high = np.min(degrees), np.max(degrees)
    return f"degree {low}" if low == high else f"degrees {low} to {high}"
