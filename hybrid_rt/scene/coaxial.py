"""Whether two surfaces of revolution about one axis may coincide in a ring.

Both are given by their profiles in one half-plane, so the question is whether two plane Bezier
curves share an arc. Pairs of pieces are ruled out by disjoint boxes, or because no tangent of one is
parallel to a tangent of the other: such pieces cross, and share no arc. What is left is halved.
"""

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing.profiles import halve_curve
from meshing.revolution import SurfaceOfRevolution

# Axes count as one up to this angle, and up to this share of the size: far above rounding, far below
# any gap that halving can find.
ONE_AXIS = 1e-12
# Halvings, and pairs of pieces left at a time: gaps down to a millionth of the size are found.
MOST_HALVINGS, MOST_PAIRS = 20, 2**13
# Sine of the angle from which on tangents are not parallel. Curves that cross at it are closer than
# rounding on a millionth of a millionth of their length.
LEAST_SINE = 1e-4


def may_share_ring(one: SurfaceOfRevolution, other: SurfaceOfRevolution, slack: float) -> bool:
    """Tell whether two surfaces may coincide in part, within ``slack``; True if that is not known."""
    # Weights would have to be halved with the points.
    if one.is_rational or other.is_rational:
        return True
    sign = float(np.sign(one.axis @ other.axis))
    apart = other.origin - one.origin
    size = max(
        float(np.abs(segment).max())
        for surface in (one, other)
        for segment in (*surface.segments, surface.origin)
    )
    if np.abs(np.cross(one.axis, other.axis)).max() > ONE_AXIS:
        return True
    if np.abs(np.cross(apart, one.axis)).max() > ONE_AXIS * size:
        return True
    slack += 4.0 * ONE_AXIS * size
    place = np.array([apart @ one.axis, 0.0])
    moved = [place + segment * (sign, 1.0) for segment in other.segments]
    degree = max(map(len, (*one.segments, *moved))) - 1
    first, second = (
        np.stack([_elevated(segment, degree) for segment in segments])
        for segments in (one.segments, moved)
    )
    i, j = np.meshgrid(np.arange(len(first)), np.arange(len(second)))
    a, b = first[i.ravel()], second[j.ravel()]
    for _ in range(MOST_HALVINGS):
        kept = _meet(a, b, slack) & ~_cross(a, b)
        a, b = a[kept], b[kept]
        if len(a) == 0:
            return False
        if 4 * len(a) > MOST_PAIRS:
            return True
        (a0, a1), (b0, b1) = _halves(a), _halves(b)
        a, b = np.concatenate((a0, a0, a1, a1)), np.concatenate((b0, b1, b0, b1))
    return True


def _elevated(points: FloatArray, degree: int) -> FloatArray:
    """Return the Bezier points of the same curve at a higher degree."""
    while len(points) <= degree:
        n = len(points)
        share = (np.arange(n + 1) / n)[:, None]
        before, after = np.vstack((points[:1], points)), np.vstack((points, points[-1:]))
        points = share * before + (1.0 - share) * after
    return points


def _halves(curves: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Halve curves (n, points, 2): Bezier points of the first halves, and of the second ones."""
    turned = [np.moveaxis(half, 1, 0) for half in halve_curve(np.moveaxis(curves, 1, 0))]
    return turned[0], turned[1]


def _meet(a: FloatArray, b: FloatArray, slack: float) -> BoolArray:
    """Tell for pairs of curves (n, points, 2) whether their boxes meet, within the slack."""
    return (
        (a.min(axis=1) <= b.max(axis=1) + slack) & (b.min(axis=1) <= a.max(axis=1) + slack)
    ).all(axis=1)


def _cross(a: FloatArray, b: FloatArray) -> BoolArray:
    """Tell for pairs of curves whether no tangent of one is parallel to one of the other.

    Products of tangents are positive combinations of those of the steps between Bezier points.
    """
    one, other = np.diff(a, axis=1)[:, :, None], np.diff(b, axis=1)[:, None]
    products = one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0]
    lengths = np.hypot(one[..., 0], one[..., 1]) * np.hypot(other[..., 0], other[..., 1])
    least = LEAST_SINE * lengths.max(axis=(1, 2), keepdims=True)
    return (products > least).all(axis=(1, 2)) | (products < -least).all(axis=(1, 2))
