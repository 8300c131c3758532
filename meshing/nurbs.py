"""B-spline and NURBS surfaces, as the Bezier patches that they consist of."""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from meshing.bezier import BezierPatches
from meshing.checks import FloatArray, as_affine, as_floats, freeze, shown, whole
from meshing.double_double import Pair, affine_image, over, pair_of, times
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.knots import SHORT_SPAN, Splitting, as_knots, combined, split
from meshing.nets import check_weights
from meshing.sheet import PatchSheet

# Of the surface's size. Rounded knots move it by their own errors times its slopes.
MOST_MOVED = 1e-10


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
        A span shorter than 1e-12 of its length is no patch of its own: the patch beside it goes on
        there. By how far that moves the surface is part of ``t_bound``.
    knots_v : (q + degree_v + 1,) array
        The same for v.
    degree : int, or (degree_u, degree_v)
        From 1 to 30.
    weights : (p, q) array, optional
        Positive; the smallest at least 1e-6 of the largest. If all are equal, they are ignored.

    Raises
    ------
    ValueError, TypeError
        For shapes that do not match, knots that descend or repeat more than degree + 1 times, knots
        that differ by less than 1e-12 of the domain where the surface differs by more than 1e-10 of its
        size (knots of a break that were meant to be equal), an empty domain, weights that are not
        positive or too far apart, and a patch without area.

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
        net = self._take(control, (knots_u, knots_v), degree, weights)
        self._set_control(pair_of(net))

    def _take(
        self,
        control: ArrayLike,
        knots: tuple[ArrayLike, ArrayLike],
        degree: int | tuple[int, int],
        weights: ArrayLike | None,
    ) -> FloatArray:
        """Check the arguments, keep all but the control points, and return these."""
        net = as_floats(control, "NurbsSurface control")
        if net.ndim != 3 or net.shape[2] != 3:
            raise ValueError(f"NurbsSurface control has shape {net.shape}: pass (p, q, 3)")
        for i, j in np.argwhere(~np.isfinite(net).all(axis=2))[:1]:
            raise ValueError(
                f"NurbsSurface control point ({i}, {j}) is {net[i, j].tolist()}: pass finite numbers"
            )
        self._degree = _as_degrees(degree)
        self._knots = (
            _as_knots(knots[0], "u", self._degree[0], net.shape[0]),
            _as_knots(knots[1], "v", self._degree[1], net.shape[1]),
        )
        w = None
        if weights is not None:
            w = as_floats(weights, "NurbsSurface weights")
            if w.shape != net.shape[:2]:
                raise ValueError(
                    f"NurbsSurface weights has shape {w.shape}: pass {net.shape[:2]}, one weight "
                    "for each control point"
                )
            check_weights(w, "NurbsSurface weights")
            w = freeze(w.copy()) if np.ptp(w) > 0.0 else None
        self._weights = w
        return freeze(net.copy())

    def _set_control(self, control: Pair) -> None:
        """Take control points, known beyond float64, and make the patches."""
        self._control, self._left = control
        by_u, by_v = (
            split(knots, d, SHORT_SPAN) for knots, d in zip(self._knots, self._degree, strict=True)
        )
        columns = self._homogeneous()
        moved = sum(self._moved(by, columns, axis) for axis, by in enumerate((by_u, by_v)))
        # One row of the result for each point that neighbours share, so they share it to the bit.
        along_v = combined(by_u.rows, columns)
        fine = combined(by_v.rows, (along_v[0].swapaxes(0, 1), along_v[1].swapaxes(0, 1)))
        points, heavy = _apart((fine[0].swapaxes(0, 1), fine[1].swapaxes(0, 1)))
        m, n = self._degree
        cuts = [
            (slice(i, i + m + 1), slice(j, j + n + 1))
            for i in by_u.first_row
            for j in by_v.first_row
        ]
        spans = [(*u, *v) for u in by_u.spans for v in by_v.spans]
        nets = [(points[0][cut], points[1][cut]) for cut in cuts]
        weights = None if heavy is None else [heavy[cut][..., 0] for cut in cuts]
        try:
            pieces = BezierPatches.of_pairs(nets, weights, moved)
        except ValueError as error:
            raise ValueError(f"NurbsSurface: {error}") from None
        super().__init__(pieces, np.array(spans))

    def _homogeneous(self) -> Pair:
        """Return the control points; with weights, their products with these, and the weights."""
        if self._weights is None:
            return self._control, self._left
        w = self._weights[..., None]
        high, low = times((self._control, self._left), pair_of(w))
        return np.concatenate([high, w], axis=2), np.concatenate([low, np.zeros_like(w)], axis=2)

    def _moved(self, by: Splitting, columns: Pair, axis: int) -> float:
        """Return how far the surface moves where spans too short for patches follow their neighbours."""
        if not by.short:
            return 0.0
        points = columns[0].swapaxes(0, axis), columns[1].swapaxes(0, axis)
        (there, w), (here, w_own) = (_apart(combined(r, points)) for r in (by.neighbour, by.own))
        gaps = np.linalg.norm((there[0] - here[0]) + (there[1] - here[1]), axis=2)
        size = float(np.linalg.norm(np.ptp(self._control, axis=(0, 1))))
        if w is not None and w_own is not None:
            # A point is a mean: weights that are off by a part move it by as much of the size, twice.
            gaps += 2.0 * size * np.abs(w / w_own - 1.0)[..., 0]
        worst = int(gaps.max(axis=1).argmax())
        moved = float(gaps[worst].max())
        if moved > MOST_MOVED * size:  # more than knots of a dozen digits explain
            k, side = by.short[worst], "uv"[axis]
            a, b = self._knots[axis][k : k + 2].tolist()
            raise ValueError(
                f"NurbsSurface knots_{side} holds {a!r} and {b!r}, closer than {SHORT_SPAN:g} of the domain, "
                f"and between them the surface goes on by {moved:.3g}, or breaks: pass equal knots, or knots "
                "farther apart"
            )
        return moved

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

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle what the surface was made of; loading checks it again."""
        w = None if self._weights is None else np.array(self._weights)
        control = np.array(self._control), np.array(self._left)
        return type(self)._remade, (control, tuple(map(np.array, self._knots)), self._degree, w)

    def transformed(self, matrix: ArrayLike) -> Self:
        """Return the image under an affine map, applied to the control points in double-double."""
        linear, shift = as_affine(matrix, "NurbsSurface")
        image = affine_image(linear, shift, (self._control, self._left))
        return self._remade(image, self._knots, self._degree, self._weights)

    def flipped(self) -> Self:
        """Return the same surface with u and v swapped, so with the opposite normal."""
        w = None if self._weights is None else self._weights.T
        control = self._control.swapaxes(0, 1), self._left.swapaxes(0, 1)
        return self._remade(
            control, (self._knots[1], self._knots[0]), (self._degree[1], self._degree[0]), w
        )

    @classmethod
    def _remade(
        cls,
        control: Pair,
        knots: tuple[FloatArray, FloatArray],
        degree: tuple[int, int],
        weights: FloatArray | None,
    ) -> Self:
        """Return the surface of control points that are known beyond float64."""
        made = cls.__new__(cls)
        net = made._take(control[0], knots, degree, weights)
        made._set_control((net, freeze(np.array(control[1]))))
        return made


def _apart(columns: Pair) -> tuple[Pair, FloatArray | None]:
    """Return points and weights of what `NurbsSurface._homogeneous` begins with."""
    high, low = columns
    if high.shape[-1] == 3:
        return columns, None
    weights = high[..., 3:], low[..., 3:]
    return over((high[..., :3], low[..., :3]), weights), high[..., 3:]


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
