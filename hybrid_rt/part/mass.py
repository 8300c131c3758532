"""Volume, area, centre and moments of a closed body: by its faces, and by chords.

By faces: the divergence theorem makes integrals over the body those over its faces, and Green's theorem, in the
(u, v) of each face, makes these integrals along its trim curves of integrals along v. Both are done by
Gauss-Legendre quadrature on the exact surfaces and curves, piece by piece, so the error falls exponentially with
the number of nodes. The error that is stated is the difference of two numbers of nodes: an estimate.

By chords: parallel rays, one at random in each square of a grid, have certified entries and exits. Grids with
other random numbers give the confidence interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from hybrid_rt.cad.pairs import in_pairs
from hybrid_rt.core.records import FloatArray
from hybrid_rt.intersection.intersector import Intersector
from hybrid_rt.part.cells import Ints, Solid
from meshing.curve2 import Curve2

# Nodes along curves and along v; the second numbers are used, the first tell the error.
NODES = (16, 24)
# Grids of rays, squares along each of their sides, and the quantile of Student's t of 7 degrees of freedom for 99 %.
GRIDS, SQUARES, QUANTILE = 8, 100, 3.499
# What no ray has met has, at 99 %, no more than so many squares: else one of the grids would have met it.
UNSEEN = float(-np.log(0.01) / GRIDS)
# Points at which the integrand is computed at once.
AT_ONCE = 200_000


@dataclass(frozen=True)
class Mass:
    """Integrals over a body of density 1, and their errors.

    Attributes
    ----------
    volume, area : float
    center : (3,) of mass
    inertia : (3, 3) about the centre
    volume_error, area_error, center_error : float
        Estimates, from two numbers of nodes.
    chord_volume, chord_center
        The same by chords, an independent way.
    chord_error, chord_center_error : float
        Half of the 99 % confidence interval, and the proven bounds of the chords.
    unpaired : int
        Rays of which entries and exits did not pair up, within the error, too.
    """

    volume: float
    area: float
    center: FloatArray
    inertia: FloatArray
    volume_error: float
    area_error: float
    center_error: float
    chord_volume: float
    chord_center: FloatArray
    chord_error: float
    chord_center_error: float
    chords: int
    unpaired: int


def mass_of(solid: Solid, tracer: Intersector, box: FloatArray) -> tuple[Mass, FloatArray]:
    """Integrate over a closed body within a box (2, 3); return the areas of its faces, too."""
    middle = box.mean(axis=0)
    faces = range(len(solid.surfaces))
    by_face = [np.array([_over_face(solid, k, middle, n) for k in faces]) for n in NODES]
    coarse, fine = (x.sum(axis=0) for x in by_face)
    (volume, area), center = fine[:2], fine[2:5] / fine[0]
    second = np.diag(fine[5:8])
    for k, (i, j) in enumerate(((0, 1), (1, 2), (2, 0))):
        second[i, j] = second[j, i] = fine[8 + k]
    second -= volume * np.outer(center, center)
    error = np.abs(fine - coarse)
    chords = _by_chords(tracer, box, solid.size)
    mass = Mass(
        float(volume), float(area), middle + center, np.trace(second) * np.eye(3) - second,
        float(error[0]), float(error[1]), float(np.linalg.norm(error[2:5] / volume)), *chords,
    )  # fmt: skip
    return mass, by_face[1][:, 1]


def _over_face(solid: Solid, face: int, middle: FloatArray, n: int) -> FloatArray:
    """Return the integrals of a face: volume, area, first moments, squares, products."""
    surface = solid.surfaces[face]
    total = np.zeros(11)
    closes = surface.closes[1]
    breaks = np.array([0.0, 1.0]) if surface.spans is None else np.unique(surface.spans[:, 2:])
    if closes:
        breaks = np.unique(np.concatenate([breaks + k for k in (-1.0, 0.0, 1.0)]))
    nodes, weights = np.polynomial.legendre.leggauss(n)
    nodes, weights = 0.5 * (nodes + 1.0), 0.5 * weights
    for loop in surface.loops:
        sign = _sign(solid, face, loop)
        places, steps = [], []
        for curve in loop:
            for a, b in solid.arcs(face, curve):
                s = a + (b - a) * nodes
                places.append(curve.point(s))
                steps.append(sign * (b - a) * weights * _slope_of_u(curve, s))
        uv, step = np.concatenate(places), np.concatenate(steps)
        is_used = step != 0.0
        uv, step = uv[is_used], step[is_used]
        # Green: the integral of f is that of F du, F = -(integral of f from the lowest v on).
        for low, high in pairwise(breaks):
            wide = np.clip(uv[:, 1], low, high) - low
            rows = np.flatnonzero(wide > 0.0)
            for some in np.array_split(rows, len(rows) * n // AT_ONCE + 1):
                v = low + wide[some, None] * nodes
                u = np.broadcast_to(uv[some, :1], v.shape)
                values = _integrand(solid, face, u.ravel(), v.ravel(), middle).reshape(*v.shape, 11)
                total -= np.einsum("i,ij,ijk->k", step[some], wide[some, None] * weights, values)
    return total


def _sign(solid: Solid, face: int, loop: tuple[Curve2, ...]) -> float:
    """Return 1 if the face is on the left of a loop, as its curves run, else -1."""
    own = {id(side.curve): side for side in solid.sides[face]}
    votes = [1.0 if own[id(c)].is_left else -1.0 for c in loop if id(c) in own]
    if not votes:  # all of it seams: an outline
        uv = np.concatenate([c.point(np.linspace(0, 1, 9)[:-1]) for c in loop])
        (u, v), (x, y) = uv.T, np.roll(uv, -1, axis=0).T
        votes = [float((u * y - v * x).sum())]
    return 1.0 if sum(votes) > 0.0 else -1.0


def _slope_of_u(curve: Curve2, s: FloatArray) -> FloatArray:
    """Return du/ds: (A' - w' u) / w with A = w u."""
    rows = curve.homogeneous()[:, [0, 2]]
    n = len(rows) - 1
    value, slope = (_bernstein(x, s) for x in (rows, n * np.diff(rows, axis=0)))
    result: FloatArray = (slope[:, 0] - slope[:, 1] * value[:, 0] / value[:, 1]) / value[:, 1]
    return result


def _bernstein(rows: FloatArray, s: FloatArray) -> FloatArray:
    """Evaluate polynomials with Bernstein coefficients (n + 1, k) at s, by de Casteljau."""
    net = np.repeat(rows[:, None], len(s), axis=1)
    while len(net) > 1:
        net = (1.0 - s[:, None]) * net[:-1] + s[:, None] * net[1:]
    return net[0]


def _integrand(
    solid: Solid, face: int, u: FloatArray, v: FloatArray, middle: FloatArray
) -> FloatArray:
    surface, base = solid.surfaces[face], solid.bases[face]
    # Beside the border of the unit square, not on it: there the patch would be another one.
    place = solid.local(face, u, v)
    x = base._points(*place) - middle
    cross = np.cross(*base._partials(*place))
    if surface.spans is not None:
        wide = surface.spans[place[2], 1::2] - surface.spans[place[2], ::2]
        cross /= np.prod(wide, axis=1)[:, None]
    nxt = np.roll(x, -1, axis=1)
    return np.column_stack([
        (x * cross).sum(axis=1) / 3.0, np.linalg.norm(cross, axis=1), 0.5 * x**2 * cross,
        x**3 * cross / 3.0, 0.5 * x**2 * nxt * cross,
    ])  # fmt: skip


def _by_chords(
    tracer: Intersector, box: FloatArray, size: float
) -> tuple[float, FloatArray, float, float, int, int]:
    """Return volume, centre, their errors, rays, and how many did not pair up."""
    low, high = box.copy()
    axis = int(np.argmin(high - low))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    low[axis], high[axis] = low[axis] - 1e-6 * size, high[axis] + 1e-6 * size
    cell = (high - low) / SQUARES
    rng = np.random.default_rng(7)
    sums, proven, lost = np.empty((GRIDS, 4)), 0.0, 0
    square = cell[i] * cell[j]
    grid: Ints = np.stack(np.meshgrid(*2 * [np.arange(SQUARES)]), axis=-1).reshape(-1, 2)
    for k in range(GRIDS):
        at = grid + rng.random(grid.shape)
        origins = np.empty((len(at), 3))
        origins[:, i], origins[:, j] = low[i] + cell[i] * at[:, 0], low[j] + cell[j] * at[:, 1]
        origins[:, axis] = low[axis]
        crossings, is_paired = in_pairs_of_one(tracer, origins, np.eye(3)[axis])
        lost += int((~is_paired).sum())
        good = is_paired[crossings.ray]
        sign = np.where(crossings.hits.front_face, -1.0, 1.0)[good]
        t = crossings.hits.t[good]
        own = origins[crossings.ray[good]]
        sums[k, 3] = (sign * t).sum()
        sums[k, axis] = (sign * (low[axis] * t + 0.5 * t**2)).sum()
        for other in (i, j):
            sums[k, other] = (sign * t * own[:, other]).sum()
        proven = max(
            proven,
            float(crossings.hits.t_bound[good].sum() + (~is_paired).sum() * (high - low)[axis]),
        )
    volume = square * sums[:, 3]
    means = sums.mean(axis=0)
    center = means[:3] / means[3]
    spread = (sums[:, :3] - center * sums[:, 3:]) / means[3]
    root = QUANTILE / np.sqrt(GRIDS)
    proven += UNSEEN * float((high - low)[axis])
    error = float(root * volume.std(ddof=1) + square * proven)
    off = root * float(np.linalg.norm(spread.std(axis=0, ddof=1))) + size * proven / means[3]
    return float(volume.mean()), center, error, float(off), GRIDS * len(grid), lost


def in_pairs_of_one(
    tracer: Intersector, origins: FloatArray, direction: FloatArray
) -> tuple[Any, Any]:
    """Return all crossings of parallel rays with one closed body, in pairs, and for which rays they are."""
    crossings = tracer.intersect_all(origins, np.broadcast_to(direction, origins.shape))
    crossings, is_paired = in_pairs(crossings, np.zeros(len(crossings), np.int64))
    # What is left must go in and out in turn.
    front = crossings.hits.front_face
    turn = (np.arange(len(front)) - crossings.offsets[crossings.ray]) % 2 == 0
    wrong = np.zeros(len(origins), np.bool_)
    wrong[crossings.ray[front != turn]] = True
    return crossings, is_paired & ~wrong & (crossings.count % 2 == 0)
