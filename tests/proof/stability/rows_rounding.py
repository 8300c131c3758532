"""Rows F13 to F15: pairs of crossings, limits of t, and sags whose terms cancel, all within rounding."""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import comb

import numpy as np

from hybrid_rt.core.records import FloatArray, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Box, Sphere
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution
from meshing.surface import Surface
from proof.cases.campaign import ellipsoid, torus
from proof.cases.rays import chords
from proof.stability.measure import BAND
from proof.stability.row import Effort, Outcome, row

# Coordinates that hold those of the nets below without rounding.
FAR = np.array([2.0**17, -(2.0**16), 2.0**15])
HALF_ROOT = 2.0**-0.5


def _tube(at: FloatArray) -> BezierPatches:
    """Return half a cylinder of radius 1, of two rational patches."""
    quarters = np.array([[(1, 0), (1, 1), (0, 1)], [(0, 1), (-1, 1), (-1, 0)]], np.float64)
    nets = [np.stack([np.insert(q, 2, z, axis=1) for z in (-1.0, 1.0)], 1) + at for q in quarters]
    weights = np.array([[1.0, 1.0], [HALF_ROOT, HALF_ROOT], [1.0, 1.0]])
    return BezierPatches(nets, weights=[weights, weights])


# Surfaces about a place that have the unit circle across z as an outline, and the place's use of z.
ROUND: tuple[tuple[Callable[[FloatArray], Surface], int], ...] = (
    (lambda at: Sphere(at, 1.0), 3),
    (lambda at: Torus(at, (0, 0, 1), 0.75, 0.25), 3),
    (lambda at: SurfaceOfRevolution([[(-1, 1), (1, 1)]], at, (0, 0, 1)), 2),
    (_tube, 2),
)


@row("F13", "both crossings of grazing rays, far from 0", "exact distances from the axis")
def grazing_pairs(effort: Effort) -> Outcome:
    """Rays 3 to 4096 bands within an outline, at 0 and 1e5 sizes away: where no row is TANGENT, all are there."""
    n, total = effort.count(2000, 40), Outcome()
    for stream, (make, axes) in enumerate(ROUND):
        for at in (np.zeros(3), FAR):
            rng, tracer = effort.rng(stream), Intersector([make(at)])
            a = rng.uniform(0.1, 0.9, n) * np.pi
            bands = rng.choice([3.0, 8.0, 64.0, 512.0, 4096.0], n)
            out = np.stack([np.cos(a), np.sin(a), 0.0 * a], 1)
            way = np.stack([-np.sin(a), np.cos(a), 0.0 * a], 1)
            o = (1.0 - bands * 3.0 * BAND)[:, None] * out - 2.0 * way + at
            found = tracer.intersect_all(o, way)
            open_rays = found.ray[found.hits.status == Status.TANGENT]
            sure = np.setdiff1d(np.arange(n), open_rays)
            depth = np.array([_depth(o[i], way[i], at, axes) for i in sure])
            clear = np.abs(depth) > 6.0 * BAND
            expected = np.where(depth > 0.0, 2, 0)
            wrong = int((found.count[sure] != expected)[clear].sum())
            total += Outcome(rays=n, wrong=wrong, undecided=len(np.unique(open_rays)))
    return total


def _depth(o: FloatArray, d: FloatArray, at: FloatArray, axes: int) -> float:
    """Return by how much a line passes within distance 1 of a point or an axis, from exact squares."""
    f = [Fraction(p) - Fraction(q) for p, q in zip(o.tolist(), at.tolist(), strict=True)][:axes]
    way = [Fraction(p) for p in d.tolist()][:axes]
    along = sum(p * q for p, q in zip(f, way, strict=True))
    square = sum(p * p for p in f) - along * along / sum(p * p for p in way)
    return float(1 - square) / 2.0


@row("F14", "limits of t within a bound of the root", "the root itself")
def open_limits(effort: Effort) -> Outcome:
    """T_min and t_max half a bound beside the root: TANGENT; three bounds beside it: decided."""
    n, total = effort.count(5000, 60), Outcome()
    flat = Box((-1, -1, -1e-6), (1, 1, 1e-6))
    for surface in (Sphere((0, 0, 0), 1), flat, torus(), _tube(np.zeros(3)), ellipsoid()):
        rays, tracer = chords([surface], n, seed=effort.seed + 21), Intersector([surface])
        hits = tracer.intersect(rays.origins, rays.directions)
        # What begins within its bound is open from the first.
        rows = (hits.status == Status.HIT) & (hits.t > 8.0 * hits.t_bound)
        o, d = rays.origins[rows], rays.directions[rows]
        t, bound = hits.t[rows], hits.t_bound[rows]
        for share in (-3.0, -0.5, 0.5, 3.0):
            limit, is_open = t + share * bound, abs(share) < 1.0
            before = tracer.intersect(o, d, t_max=limit)
            behind = tracer.intersect(o, d, t_min=limit)
            wrong = before.hit != (share > 0.0)
            wrong |= tracer.occluded(o, d, t_max=limit) != before.hit
            wrong |= (before.status == Status.TANGENT) != is_open
            wrong |= (np.abs(behind.t - t) <= bound) != (share < 0.0)
            if is_open:
                wrong |= behind.status != Status.TANGENT
            total += Outcome(rays=2 * len(t), wrong=int(wrong.sum()))
    return total


@row("F15", "aspheres whose terms cancel", "fractions")
def cancelling_sags(effort: Effort) -> Outcome:
    """Chebyshev polynomials of w = r^2, terms up to 1e10 times their sum, in five sizes; rays along the axis."""
    n, total = effort.count(400, 20), Outcome()
    for degree, height in ((8, 1e-2), (12, 1e-3), (16, 1e-3)):
        # T_n(2 w - 1) = sum of (-1)^(n - k) 4^k n / (n + k) binomial(n + k, 2 k) w^k
        powers = [
            float(
                Fraction((-1) ** (degree - k) * 4**k * degree, degree + k) * comb(degree + k, 2 * k)
            )
            for k in range(1, degree + 1)
        ]
        for size in (1e-6, 1e-3, 1.0, 1e3, 1e6):
            terms = [height * a * size ** (1 - 2 * k) for k, a in enumerate(powers, start=1)]
            tracer = Intersector(Asphere(np.inf, 0.0, terms, 2.0 * size, (0, 0, 0), (0, 0, 1)))
            o = size * effort.rng(degree).uniform((-0.7, -0.7, -2), (0.7, 0.7, -1), (n, 3))
            hits = tracer.intersect(o, (0.0, 0.0, 1.0))
            exact = []
            for x, y, z in o.tolist():
                w, sag = Fraction(x) ** 2 + Fraction(y) ** 2, Fraction(0)
                for a in reversed(terms):
                    sag = (sag + Fraction(a)) * w
                exact.append(sag - Fraction(z))
            error = np.array([
                float(abs(Fraction(t) - e)) for t, e in zip(hits.t.tolist(), exact, strict=True)
            ])  # fmt: skip
            broken = int((error > hits.t_bound).sum())
            cosine = np.abs(hits.normal[:, 2])
            share = float((error * cosine / (BAND * 3.0 * size)).max())
            total += Outcome(rays=n, wrong=int((~hits.hit).sum()), broken=broken, error=share)
    return total
