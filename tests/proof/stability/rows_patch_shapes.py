"""Rows A06, A08, A10 and A14: degrees, degenerate and touching patches."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from math import comb, hypot

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import Status
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.catalogue import (
    cuspidal_edge,
    saddle,
)
from proof.exact.truth import ExactScene
from proof.stability.measure import (
    EPS,
    apart,
    by_times,
    traced,
)
from proof.stability.measure_exact import by_set, catalogue, exact_errors
from proof.stability.patch_nets import bumpy_chords, bumpy_net, elevated, flat_net
from proof.stability.row import Effort, Outcome, Plot, row

DEGREES = (1, 2, 3, 5, 8, 12, 17, 23, 30)


@row("A06", "degree up to 30 x 30", "exact crossings of the same surface at low degree; fractions")
def high_degrees(effort: Effort) -> Outcome:
    """A bilinear and a bicubic patch with degrees raised: the same hits as exact ones before."""
    total, curves = Outcome(), []
    n = effort.count(200, 8)
    for net, label in ((saddle().patches[0], "bilinear"), (bumpy_net(), "bicubic")):
        own = len(net) - 1
        surface = BezierPatches([net])
        scene, size = ExactScene([surface]), float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
        plot = Plot("degree", f"{label} patch, degree raised")
        origins, directions = bumpy_chords(n if own == 1 else max(n // 3, 4), effort.rng(own))
        if own == 1:
            origins, directions = 1.5 * (origins - 0.5), 1.5 * directions
        low = Intersector([surface], coarse="none").intersect(origins, directions)
        for degree in (d for d in DEGREES if d >= own):
            raised = BezierPatches([elevated(net, degree - own)])
            tracer = Intersector([raised], coarse="none")
            hits = tracer.intersect(origins, directions)
            error, expected = exact_errors(scene, hits, origins, directions)
            work = tracer.counters["most_pieces"]
            wrong = apart(surface, low, hits, origins, directions)
            total += Outcome(
                rays=len(hits), wrong=int(wrong.sum()), work=work,
                undecided=int((hits.status == Status.TANGENT).sum()),
            )  # fmt: skip
            total += plot.add(degree, error / size, expected / size, work)
        curves.append(plot)
    return replace(total, curves=tuple(curves)) + _point_of_degree_30(effort)


def _point_of_degree_30(effort: Effort) -> Outcome:
    """S(u, v) of a random net of degree 30 against fractions: 2 (m + n) roundings."""
    n, rng = 30, effort.rng(30)
    net = rng.normal(size=(n + 1, n + 1, 3))
    surface, worst, count = BezierPatches([net]), 0.0, effort.count(20, 1)
    exact = [[[Fraction(float(x)) for x in p] for p in line] for line in net]
    for u, v in rng.random((count, 2)):
        a, b = (
            [comb(n, k) * Fraction(s) ** k * (1 - Fraction(s)) ** (n - k) for k in range(n + 1)]
            for s in (float(u), float(v))
        )
        point = [
            sum(x * y * exact[i][j][c] for i, x in enumerate(a) for j, y in enumerate(b))
            for c in range(3)
        ]
        found = surface.point(np.array([u]), np.array([v]), np.array([0]))[0]
        gap = hypot(*(float(Fraction(float(x)) - y) for x, y in zip(found, point, strict=True)))
        worst = max(worst, gap)
    allowed = 4 * n * EPS * float(np.linalg.norm(net, axis=-1).max())
    return Outcome(rays=count, error=worst / allowed)


@row("A08", "collapsed edge", "exact arithmetic; closed form")
def collapsed_edges(effort: Effort) -> Outcome:
    """The apex of the teapot's lid: through it, and 1e-1 to 1e-14 beside."""
    total = catalogue("A08", effort)
    apex = np.array([0.0, 0.0, 3.15])
    n = effort.count(2000, 16)
    directions = unit(effort.rng(1).normal(size=(n, 3)) * (0.2, 0.2, 1.0))
    directions[:, 2] = -np.abs(directions[:, 2])
    # From above the apex itself comes first: the knob is convex there.
    total += by_times(
        [teapot()], apex - 3.0 * directions, directions, np.full(n, 3.0), most_pieces=500
    )
    # Some of these graze the lid as well: that is the work of a tangent.
    near = by_set("apex of the lid", effort, 12, against="distance from a collapsed apex / size")
    return (total + near).checked(near.work < 5000, f"{near.work} pieces beside the apex")


@row("A10", "cusp inside a patch", "exact arithmetic")
def cusps(effort: Effort) -> Outcome:
    """(s^2, s^3) drawn along z: aimed at its edge and beside."""
    total = catalogue("A10", effort)
    total += by_set("cuspidal edge", effort, 20, against="distance from a cusp / size")
    n, rng = effort.count(5000, 50), effort.rng()
    targets = np.stack([np.zeros(n), np.zeros(n), rng.uniform(0.01, 0.99, n)], axis=1)
    directions = unit(rng.normal(size=(n, 3)))
    hits, found = traced([cuspidal_edge()], targets - 2.0 * directions, directions)
    # With s = 2 u - 1 the normal is along (3 s, -2, 0), up to its sign: also at s = 0.
    s = 2.0 * hits.u[hits.hit] - 1.0
    normal = unit(np.stack([3.0 * s, np.full_like(s, -2.0), np.zeros_like(s)], axis=1))
    # Rounding of a normal that is as short as s.
    allowed = 1e-9 + 16 * EPS / np.maximum(np.abs(s), EPS)
    off = np.linalg.norm(np.cross(normal, hits.normal[hits.hit]), axis=1) > allowed
    return total + found + Outcome(wrong=int(off.sum()))


@row("A14", "neighbours with different subdivision", "closed form")
def t_junction(effort: Effort) -> Outcome:
    """One patch, its neighbour in two halves: no ray passes where they meet."""
    upper, lower = flat_net(), flat_net()
    upper[..., 0] = lower[..., 0] = 2 + flat_net()[..., 0]
    upper[..., 1] = 0.5 + 0.5 * flat_net()[..., 1]
    lower[..., 1] = -0.5 + 0.5 * flat_net()[..., 1]
    n, rng = effort.count(30_000, 600), effort.rng()
    y = np.concatenate([np.zeros(n // 6), rng.uniform(-0.99, 0.99, n - n // 6)])
    x = 1 + np.where(np.arange(n) < n // 2, 0.0, rng.normal(0, 1e-15, n))
    targets = np.column_stack([x, y, np.zeros(n)])
    directions = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.5) - (0, 0, 3)
    hits, found = traced(
        [BezierPatches([flat_net(), upper, lower])], targets - directions, directions
    )
    return found + Outcome(wrong=int((~hits.hit | (np.abs(hits.t - 1) > 1e-14)).sum()))
