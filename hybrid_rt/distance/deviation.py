"""Deviation of measured points from a model: signed distances, statistics, and the best fit before."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.distance.closest import ClosestPoint
from hybrid_rt.distance.record import Closeness, ClosestRecord

FACE = np.dtype(
    [("face", "i4"), ("n", "i8"), *((name, "f8") for name in ("mean", "rms", "least", "most"))]
)
PERCENTILES = (1, 5, 50, 95, 99)
# So many deviations, evenly taken, give the percentiles.
KEPT = 1_000_000
# A direction of the fit along which deviations change by less than this part of what they change at most is free.
FREE = 1e-6
# Of a model of this size a distance below this part has the normal for its gradient.
NEARLY_ON = 1e-9
# Blue, white and red, at minus the limit, 0 and the limit.
COLORS = np.array([(59, 76, 192), (242, 242, 242), (180, 4, 38)], np.float64)


class Measured(NamedTuple):
    """Deviations of some points."""

    deviation: FloatArray  # (n,) signed distance
    is_signed: BoolArray  # (n,) by a closed body, not only by the normal of what is nearest
    closest: ClosestRecord


@dataclass(frozen=True)
class Fit:
    """A rigid motion that makes the sum of squared deviations least.

    Attributes
    ----------
    matrix : (4, 4) float64
        Acts on columns (x, y, z, 1) of measured points.
    center : (3,) float64
        The mean of the measured points, about which they are turned.
    covariance : (6, 6) float64
        Of the shift, in scene units, and of the rotation vector about ``center``, in radians: the residual
        variance times the inverse of J^T J. It supposes that errors of points are independent and alike. Along free
        directions it is 0.
    free : int
        How many directions the points do not determine, as the rotation of a shaft about its axis.
    rms_before, rms : float
        Of the deviations of these points.
    n : int
        Number of points that were used.
    """

    matrix: FloatArray
    center: FloatArray
    covariance: FloatArray
    free: int
    rms_before: float
    rms: float
    n: int

    def moved(self, points: FloatArray) -> FloatArray:
        """Return the images of points (n, 3)."""
        images: FloatArray = points @ self.matrix[:3, :3].T + self.matrix[:3, 3]
        return images


@dataclass(frozen=True)
class Deviation:
    """Statistics of deviations, scene units.

    Attributes
    ----------
    n : int
    mean, rms, least, most : float
        Of the signed deviations, positive outside.
    percentiles : dict of int to float
        Of up to a million points, evenly taken.
    bound : float
        The largest proven bound on a distance.
    by_normal : int
        How many points are signed by the normal of what is nearest only, as it bounds no closed body.
    undecided : int
        Points whose search ended early: their bounds are wide.
    faces : structured array, a row for each face that points are nearest to
        ``face``, ``n``, ``mean``, ``rms``, ``least``, ``most``.
    fit : Fit or None
        The motion of the points before.
    """

    n: int
    mean: float
    rms: float
    least: float
    most: float
    percentiles: dict[int, float]
    bound: float
    by_normal: int
    undecided: int
    faces: NDArray[Any]
    fit: Fit | None = None


def measure(search: ClosestPoint, points: ArrayLike) -> Measured:
    """Return the deviations of points: their distances, negative inside.

    What is nearest may bound no closed body: then the sign is that of its normal, and ``is_signed`` is False.
    """
    found = search.query(points)
    at = np.asarray(points, np.float64).reshape(-1, 3)
    is_signed = found.side != 0
    along = ((at - found.position) * found.normal).sum(axis=1)
    by_normal = np.where(along < 0.0, -found.distance, found.distance)
    return Measured(np.where(is_signed, found.distance, by_normal), is_signed, found)


def deviation(
    search: ClosestPoint,
    pieces: Iterable[FloatArray],
    *,
    face_of: Callable[[ClosestRecord], NDArray[Any]] | None = None,
    fit: Fit | None = None,
    each: Callable[[FloatArray, Measured, NDArray[Any]], None] | None = None,
) -> Deviation:
    """Return the statistics of deviations of points that come in pieces, so in bounded memory.

    Parameters
    ----------
    search : ClosestPoint
        Of the model.
    pieces : iterable of (k, 3) arrays
        The measured points; see `Scan.pieces`.
    face_of : callable, optional
        Takes a `ClosestRecord`, and returns the number of a face for each row. Of a `CadModel` its ``face_at``.
        Default: the number of the surface.
    fit : Fit, optional
        The motion that the points are moved by before.
    each : callable, optional
        Is given the points of each piece as they were measured, their `Measured`, and faces.
    """
    rows: dict[int, FloatArray] = {}
    kept: list[FloatArray] = []
    n = n_kept = by_normal = undecided = 0
    step, bound = 1, 0.0
    for points in pieces:
        found = measure(search, points if fit is None else fit.moved(points))
        closest = found.closest
        face = closest.object_id if face_of is None else face_of(closest)
        if each is not None:
            each(points, found, face)
        for number, row in _by_face(face, found.deviation):
            old = rows.get(number)
            rows[number] = row if old is None else _joined(old, row)
        kept.append(found.deviation[(-n) % step :: step])
        n, n_kept = n + len(points), n_kept + len(kept[-1])
        if n_kept > KEPT:
            whole = np.concatenate(kept)[::2]
            kept, n_kept, step = [whole], len(whole), 2 * step
        bound = max(bound, float(closest.bound.max(initial=0.0)))
        by_normal += int(np.count_nonzero(~found.is_signed))
        undecided += int(np.count_nonzero(closest.status == Closeness.UNDECIDED))
    if n == 0:
        raise ValueError("deviation of no points: pass at least one")
    faces = np.array([(number, *_statistics(row)) for number, row in sorted(rows.items())], FACE)
    total = np.array([0.0, 0.0, 0.0, np.inf, -np.inf])
    for row in rows.values():
        total = _joined(total, row)
    _, mean, rms, least, most = _statistics(total)
    at = np.percentile(np.concatenate(kept), PERCENTILES).tolist()
    percentiles = dict(zip(PERCENTILES, at, strict=True))
    return Deviation(
        n, mean, rms, least, most, percentiles, bound, by_normal, undecided, faces, fit
    )


def _by_face(face: NDArray[Any], value: FloatArray) -> Iterator[tuple[int, FloatArray]]:
    """Yield number, sum, sum of squares, least and most of the values of each face."""
    order = np.argsort(face, kind="stable")
    numbers, begins = np.unique(face[order], return_index=True)
    for number, part in zip(numbers.tolist(), np.split(value[order], begins[1:]), strict=True):
        yield number, np.array([len(part), part.sum(), part @ part, part.min(), part.max()])


def _joined(a: FloatArray, b: FloatArray) -> FloatArray:
    return np.array([*(a[:3] + b[:3]), min(a[3], b[3]), max(a[4], b[4])])


def _statistics(row: FloatArray) -> tuple[int, float, float, float, float]:
    n, total, squares, least, most = row.tolist()
    return int(n), total / n, math.sqrt(squares / n), least, most


def best_fit(search: ClosestPoint, points: ArrayLike) -> Fit:
    """Find the rigid motion of measured points with the least sum of squared deviations.

    `scipy.optimize.least_squares` begins with no motion, so points must be nearly in place: each has to be near
    the face that it belongs to.

    Raises
    ------
    ValueError
        For fewer than seven points.
    """
    from scipy.optimize import least_squares
    from scipy.spatial.transform import Rotation

    at = np.asarray(points, np.float64).reshape(-1, 3)
    if len(at) < 7:
        raise ValueError(f"best_fit has {len(at)} points: pass at least seven, better thousands")
    center = at.mean(axis=0)
    away = at - center
    reach = float(np.sqrt((away**2).sum(axis=1).mean()))
    last: dict[bytes, tuple[FloatArray, FloatArray]] = {}

    def look(x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return deviations, and their derivatives by the shift and by the rotation vector times ``reach``."""
        key = x.tobytes()
        if key not in last:
            last.clear()
            turned = Rotation.from_rotvec(x[3:] / reach).apply(away)
            found = measure(search, center + turned + x[:3])
            d, closest = found.deviation, found.closest
            gradient, is_far = closest.normal.copy(), np.abs(d) > NEARLY_ON * reach
            way = center + turned + x[:3] - closest.position
            gradient[is_far] = way[is_far] / d[is_far, None]
            turns = np.cross(turned, gradient) @ _left_jacobian(x[3:] / reach) / reach
            last[key] = d, np.concatenate([gradient, turns], axis=1)
        return last[key]

    start = np.zeros(6)
    before = float(np.sqrt((look(start)[0] ** 2).mean()))
    scale = np.repeat(reach, 6)

    def values_at(x: FloatArray) -> FloatArray:
        return look(x)[0]

    def slopes_at(x: FloatArray) -> FloatArray:
        return look(x)[1]

    found = least_squares(values_at, start, slopes_at, x_scale=scale, xtol=1e-12)
    values, jacobian = look(found.x)
    _, singular, rows = np.linalg.svd(jacobian, full_matrices=False)
    is_held = singular > FREE * singular[0]
    inverse = np.where(is_held, 1.0 / np.maximum(singular, 1e-300), 0.0)
    variance = float(values @ values) / (len(at) - int(is_held.sum()))
    half = (rows.T * inverse) / np.repeat([1.0, reach], 3)[:, None]
    matrix = np.eye(4)
    matrix[:3, :3] = Rotation.from_rotvec(found.x[3:] / reach).as_matrix()
    matrix[:3, 3] = center + found.x[:3] - matrix[:3, :3] @ center
    rms = float(np.sqrt((values**2).mean()))
    covariance = variance * half @ half.T
    return Fit(matrix, center, covariance, int(6 - is_held.sum()), before, rms, len(at))


def _left_jacobian(w: FloatArray) -> FloatArray:
    """Return how the rotation of a vector w turns on when w changes: R(w + dw) = R(J dw) R(w)."""
    angle = float(np.linalg.norm(w))
    cross = np.cross(np.eye(3), -w)  # cross @ x = w x x
    if angle < 1e-6:
        return np.asarray(np.eye(3) + 0.5 * cross)
    a, b = (1.0 - math.cos(angle)) / angle**2, (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) + a * cross + b * cross @ cross)


def colors_of(values: FloatArray, limit: float) -> NDArray[np.uint8]:
    """Return RGB colours (n, 3) of deviations: blue at -limit and below, white at 0, red at limit."""
    at = np.clip(values / limit, -1.0, 1.0)
    channels = [np.interp(at, (-1.0, 0.0, 1.0), channel) for channel in COLORS.T]
    colors: NDArray[np.uint8] = np.rint(np.stack(channels, axis=1)).astype(np.uint8)
    return colors
