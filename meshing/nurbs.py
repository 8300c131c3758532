"""B-spline and NURBS surfaces, as the Bezier patches that they consist of."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from meshing.bezier import BezierPatches
from meshing.checks import FloatArray, as_affine, as_floats, freeze, shown, whole
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.knots import as_knots, bezier_matrix, combined
from meshing.nets import check_weights
from meshing.sheet import PatchSheet


class NurbsSurface(PatchSheet):
    """A tensor product B-spline surface, rational with weights.

    Knot insertion turns it into one Bezier patch for each pair of non-empty knot spans.
    ``patch_id`` counts these patches, with u outermost. u and v of hits, textures and `point` are
    the parameters of the whole surface, mapped from the domain to [0, 1]. Knot vectors need not be
    clamped (periodic surfaces repeat their first control points), and may repeat knots:
    multiplicity ``degree`` makes a crease, ``degree + 1`` a break. The normal is along S_u x S_v.

    Parameters
    ----------
    control : (p, q, 3) array
        Control points in scene units: u follows the first index, v the second.
    knots_u : (p + degree_u + 1,) array
        Ascending, in any unit. The domain of u is from ``knots_u[degree_u]`` to ``knots_u[p]``.
        Knots that are closer than 1e-12 of its length count as one.
    knots_v : (q + degree_v + 1,) array
        The same for v.
    degree : int, or (degree_u, degree_v)
        From 1 to 30.
    weights : (p, q) array, optional
        Positive; the smallest at least 1e-6 of the largest. If all are equal, they are ignored.

    Raises
    ------
    ValueError, TypeError
        For shapes that do not match, knots that descend or repeat more than degree + 1 times, an
        empty domain, weights that are not positive or too far apart, and a patch without area.

    References
    ----------
    Piegl and Tiller, "The NURBS Book", 2nd edition, 1997. Goldman, "Blossoming and knot insertion
    algorithms for B-spline curves", Computer Aided Geometric Design 7, 1990.
    """

    def __init__(
        self,
        control: ArrayLike,
        knots_u: ArrayLike,
        knots_v: ArrayLike,
        degree: int | tuple[int, int],
        weights: ArrayLike | None = None,
    ) -> None:
        net = as_floats(control, "NurbsSurface control")
        if net.ndim != 3 or net.shape[2] != 3:
            raise ValueError(f"NurbsSurface control has shape {net.shape}: pass (p, q, 3)")
        for i, j in np.argwhere(~np.isfinite(net).all(axis=2))[:1]:
            raise ValueError(
                f"NurbsSurface control point ({i}, {j}) is {net[i, j].tolist()}: pass finite numbers"
            )
        self._degree = _as_degrees(degree)
        self._knots = (
            _as_knots(knots_u, "u", self._degree[0], net.shape[0]),
            _as_knots(knots_v, "v", self._degree[1], net.shape[1]),
        )
        self._control, self._weights = freeze(net.copy()), None
        if weights is not None:
            w = as_floats(weights, "NurbsSurface weights")
            if w.shape != net.shape[:2]:
                raise ValueError(
                    f"NurbsSurface weights has shape {w.shape}: pass {net.shape[:2]}, one weight "
                    "for each control point"
                )
            check_weights(w, "NurbsSurface weights")
            if np.ptp(w) > 0.0:
                self._weights = freeze(w.copy())
        (by_u, at_u), (by_v, at_v) = (
            bezier_matrix(knots, d) for knots, d in zip(self._knots, self._degree, strict=True)
        )
        w = np.ones(net.shape[:2]) if self._weights is None else self._weights
        columns = np.concatenate([net * w[..., None], w[..., None]], axis=2)
        # One row of the result for each point that neighbours share, so they share it to the bit.
        fine = combined(by_v, combined(by_u, columns).swapaxes(0, 1)).swapaxes(0, 1)
        first_u, span_u = at_u
        first_v, span_v = at_v
        m, n = self._degree
        cuts = [(i, j) for i in range(len(first_u)) for j in range(len(first_v))]
        nets = [
            fine[first_u[i] : first_u[i] + m + 1, first_v[j] : first_v[j] + n + 1] for i, j in cuts
        ]
        spans = [(*span_u[i], *span_v[j]) for i, j in cuts]
        try:
            if self._weights is None:
                pieces = BezierPatches([piece[..., :3] for piece in nets])
            else:
                points = [piece[..., :3] / piece[..., 3:] for piece in nets]
                pieces = BezierPatches(points, [piece[..., 3] for piece in nets])
        except ValueError as error:
            raise ValueError(f"NurbsSurface: {error}") from None
        super().__init__(pieces, np.array(spans))

    @property
    def control(self) -> FloatArray:
        """(p, q, 3) float64: the control points, read-only."""
        return self._control

    @property
    def weights(self) -> FloatArray | None:
        """(p, q) float64, read-only; None if the surface is not rational."""
        return self._weights

    @property
    def knots(self) -> tuple[FloatArray, FloatArray]:
        """The knot vectors along u and v, read-only."""
        return self._knots

    @property
    def degree(self) -> tuple[int, int]:
        """Degrees in u and in v."""
        return self._degree

    def __repr__(self) -> str:
        """Name the net and the degrees."""
        (p, q), (m, n) = self._control.shape[:2], self._degree
        kind = "" if self._weights is None else ", rational"
        return f"NurbsSurface({p} x {q} points of degree {m} x {n}, {len(self)} patches{kind})"

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:
        """Pickle what the surface was made of; loading checks it again."""
        w = None if self._weights is None else np.array(self._weights)
        return type(self), (np.array(self._control), *map(np.array, self._knots), self._degree, w)

    def transformed(self, matrix: ArrayLike) -> Self:
        """Return the image under an affine map, applied to the control points."""
        linear, shift = as_affine(matrix, "NurbsSurface")
        # Term by term, as `BezierPatches` does it: equal points get equal images.
        x, y, z = np.moveaxis(self._control, 2, 0)
        image = [
            row[0] * x + row[1] * y + row[2] * z + s for row, s in zip(linear, shift, strict=True)
        ]
        return type(self)(np.stack(image, axis=2), *self._knots, self._degree, self._weights)

    def flipped(self) -> Self:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        w = None if self._weights is None else self._weights.T
        return type(self)(
            self._control.swapaxes(0, 1), *self._knots[::-1], self._degree[::-1], w
        )  # fmt: skip


def _as_degrees(degree: int | tuple[int, int]) -> tuple[int, int]:
    pair = degree if isinstance(degree, tuple | list) else (degree, degree)
    if len(pair) != 2:
        raise ValueError(f"NurbsSurface degree is {shown(degree)}: pass one number or two")
    return (
        whole(pair[0], "NurbsSurface degree in u", at_least=1, up_to=MAX_DEGREE),
        whole(pair[1], "NurbsSurface degree in v", at_least=1, up_to=MAX_DEGREE),
    )


def _as_knots(values: ArrayLike, side: str, degree: int, n_points: int) -> FloatArray:
    what = f"NurbsSurface knots_{side}"
    return as_knots(values, what, degree, "NurbsSurface control", n_points, f" along {side}")
