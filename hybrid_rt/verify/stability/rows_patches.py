"""Rows A01 to A32: Bezier patches."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from math import comb, hypot
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, Status
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Rectangle
from hybrid_rt.verify.cases.campaign import torus
from hybrid_rt.verify.cases.catalogue import (
    cuspidal_edge,
    loop_sheet,
    parabola_sheet,
    saddle,
    square,
)
from hybrid_rt.verify.cases.rays import chords, secondary, unit
from hybrid_rt.verify.exact.truth import ExactScene
from hybrid_rt.verify.judges.oracle import first_hits
from hybrid_rt.verify.stability.measure import (
    BAND,
    DISTANCES,
    EPS,
    LEAST_COSINE,
    Plot,
    by_exact,
    by_oracle,
    by_set,
    by_times,
    catalogue,
    differences,
    exact_errors,
    judged,
    traced,
)
from hybrid_rt.verify.stability.row import Effort, Outcome, refusal, row
from meshing import BezierPatches, SurfaceOfRevolution

WAYS = ("none", "embree")
# What a similarity by a power of two must leave as it is.
SCALED = ("t", "u", "v", "object_id", "patch_id", "status")
DEGREES = (1, 2, 3, 5, 8, 12, 17, 23, 30)


def flat_net(z: float = 0.0, degree: int = 3) -> FloatArray:
    """Return the net of the flat square [-1, 1]^2 at a height."""
    line = np.linspace(-1.0, 1.0, degree + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    return np.stack([x, y, np.full_like(x, z)], axis=-1)


def bumpy_net(degree_u: int = 3, degree_v: int = 3, seed: int = 1) -> FloatArray:
    """Return a height field over the unit square with random bumps."""
    u, v = np.meshgrid(np.linspace(0, 1, degree_u + 1), np.linspace(0, 1, degree_v + 1))
    height = 0.4 * np.random.default_rng(seed).normal(size=u.T.shape)
    return np.stack([u.T, v.T, height], axis=-1)


def elevated(net: FloatArray, times: int) -> FloatArray:
    """Raise both degrees without changing the surface: exactly, then rounded once."""
    exact = np.vectorize(lambda x: Fraction(float(x)), otypes=[object])(net)
    for _ in range(times):
        for _ in range(2):
            n = len(exact)
            weight = np.array([Fraction(k, n) for k in range(n + 1)]).reshape(-1, 1, 1)
            none = np.full_like(exact[:1], Fraction(0))
            below, above = np.concatenate([none, exact]), np.concatenate([exact, none])
            exact = (weight * below + (1 - weight) * above).swapaxes(0, 1)
    rounded: FloatArray = exact.astype(np.float64)
    return rounded


def bumpy_chords(n: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Return rays between random points of a ball around the unit square."""
    a, b = (1.5 * unit(rng.normal(size=(n, 3))) for _ in range(2))
    return np.array([0.5, 0.5, 0.0]) + a, b - a


def cosines(hits: HitRecord, directions: FloatArray) -> FloatArray:
    """Return |n.d| / |d| of hits."""
    found: FloatArray = np.abs(np.einsum("ij,ij->i", hits.normal, unit(directions)))
    return found


@row("A01", "rays near a silhouette", "oracle; exact crossings")
def silhouettes(effort: Effort) -> Outcome:
    """Teapot, 1e-2 to 1e-10 of the size from tangency; two patches down to 1e-14."""
    return catalogue("A01", effort) + by_set(
        "patch tangents", effort, 100, against="distance from tangency / size"
    )


@row("A02", "exactly tangent ray", "closed form")
def tangents(effort: Effort) -> Outcome:
    """Rays along x at y = +-k over y = x^2: they meet it at -sqrt(y)."""
    total = catalogue("A02", effort)
    tracer = Intersector([parabola_sheet()], coarse="none")
    size = float(np.linalg.norm(np.ptp(parabola_sheet().bounds, axis=0)))
    plot = Plot("distance from tangency / size", "parabola, rays parallel to its tangent")
    n = effort.count(2000, 20)
    for k in DISTANCES:
        tracer.counters["most_pieces"] = 0
        rng = effort.rng(round(-np.log10(k)))
        y = size * k * rng.uniform(0.5, 1.0, n)
        depth = y * rng.choice([-1.0, 1.0], n)
        origins = np.stack([np.full(n, -2.0), depth, rng.uniform(0.05, 0.95, n)], axis=1)
        hits = tracer.intersect(origins, (1.0, 0.0, 0.0))
        band = BAND * np.maximum(np.linalg.norm(origins - tracer.surfaces[0].middle, axis=1), size)
        sure = hits.status != Status.TANGENT
        within = np.abs(depth) <= 0.9 * band
        wrong = sure & (hits.hit != (depth > 0.0))
        both = sure & hits.hit & (depth > 0.0)
        error = np.abs(hits.t[both] - (2.0 - np.sqrt(depth[both])))
        slope = 2.0 * np.sqrt(depth[both]) / np.sqrt(1.0 + 4.0 * depth[both])
        expected = band[both] / np.maximum(slope, LEAST_COSINE)
        work = tracer.counters["most_pieces"]
        total += Outcome(
            rays=n, wrong=int(wrong.sum()), undecided=int((~sure).sum()), work=work,
            broken=int((error - 4.0 * EPS > hits.t_bound[both]).sum()),
        ).checked(not (within & sure).any(), f"no mark within the band at {k:.0e}").checked(
            not (~sure & (np.abs(depth) > 4.0 * band)).any(), f"marks beyond the band at {k:.0e}"
        ).checked(work < 5000, f"{work} pieces at {k:.0e}")  # fmt: skip
        total += plot.add(k, error / size, expected / size, work)
    return replace(total, curves=(plot.curve,))


@row("A03", "ray lying in a flat patch", "closed form; oracle")
def within_a_plane(effort: Effort) -> Outcome:
    """The entry at the border, or a miss: the same in every run."""
    total = catalogue("A03", effort)
    tracer = Intersector([square()], coarse="none")
    y = effort.rng().uniform(0.05, 0.95, effort.count(1000, 20))
    origins = np.stack([np.full_like(y, -1.0), y, np.zeros_like(y)], axis=1)
    one, two = (tracer.intersect(origins, (1.0, 0.0, 0.0)) for _ in range(2))
    total = total.checked(not differences(one, two), "two runs differ")
    entry = np.abs(one.t - 1.0) <= 8 * EPS
    return total + Outcome(
        rays=len(y), wrong=int((one.hit & ~entry).sum()), work=tracer.counters["most_pieces"],
        undecided=int((one.status == Status.TANGENT).sum()),
    )  # fmt: skip


@row("A04", "ray along a straight line of a ruled patch", "closed form; oracle")
def along_a_ruling(effort: Effort) -> Outcome:
    """On z = x y the line y = c, z = c x begins at x = -1; half of them are lines of floats."""
    total = catalogue("A04", effort)
    n = effort.count(400, 16)
    c = np.round(effort.rng().uniform(-0.95, 0.95, n) * 2.0**20) / 2.0**20
    origins = np.stack([np.full(n, -3.0), c, -3.0 * c], axis=1)
    directions = np.stack([np.ones(n), np.zeros(n), c], axis=1)
    hits, traced_ = traced([saddle()], origins, directions)
    off = np.abs(hits.t - 2.0) > 64 * EPS
    sure = hits.status == Status.HIT
    return total + traced_ + Outcome(wrong=int((hits.hit & off & sure).sum()))


@row("A05", "bilinear patch that is not flat", "oracle; exact crossings")
def bilinear(effort: Effort) -> Outcome:
    """Both roots of the quadratic."""
    rays = chords([saddle()], effort.count(600, 20), seed=effort.seed + 3)
    return catalogue("A05", effort) + by_exact([saddle()], rays.origins, rays.directions)


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
            sure = (low.status != Status.TANGENT) & (hits.status != Status.TANGENT)
            error, expected = exact_errors(scene, hits, origins, directions)
            work = tracer.counters["most_pieces"]
            total += Outcome(
                rays=len(hits), wrong=int((sure & (low.hit != hits.hit)).sum()), work=work,
                undecided=int((hits.status == Status.TANGENT).sum()),
            )  # fmt: skip
            total += plot.add(degree, error / size, expected / size, work)
        curves.append(plot.curve)
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


@row("A07", "degree 0 in one direction", "refusal")
def curves_are_refused(effort: Effort) -> Outcome:
    """A curve is no surface."""
    rng = effort.rng()
    return sum(
        (
            refusal(
                partial(BezierPatches, rng.random(shape)), "degree 0 in", "would make it a curve"
            )
            for shape in ((1, 1, 4, 3), (1, 4, 1, 3))
        ),
        Outcome(),
    )


@row("A08", "collapsed edge", "oracle; exact crossings; closed form")
def collapsed_edges(effort: Effort) -> Outcome:
    """The apex of the teapot's lid: through it, and 1e-1 to 1e-14 beside."""
    total = catalogue("A08", effort)
    apex = np.array([0.0, 0.0, 3.15])
    n = effort.count(2000, 40)
    directions = unit(effort.rng(1).normal(size=(n, 3)) * (0.2, 0.2, 1.0))
    directions[:, 2] = -np.abs(directions[:, 2])
    # From above the apex itself comes first: the knob is convex there.
    total += by_times(
        [teapot()], apex - 3.0 * directions, directions, np.full(n, 3.0), most_pieces=500
    )
    # Some of these graze the lid as well: that is the work of a tangent.
    near = by_set("apex of the lid", effort, 12, against="distance from a collapsed apex / size")
    return (total + near).checked(near.work < 5000, f"{near.work} pieces beside the apex")


@row("A09", "patch collapsed to a curve or a point", "refusal")
def no_area(effort: Effort) -> Outcome:
    """Refused by default; the message names the patch."""
    del effort
    return sum(
        (
            refusal(partial(BezierPatches, [flat_net(), net]), "patch 1 has no area")
            for net in (np.ones((4, 4, 3)), flat_net()[:, :1].repeat(4, axis=1))
        ),
        Outcome(),
    )


@row("A10", "cusp inside a patch", "oracle; exact crossings")
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


@row("A11", "patch through itself", "oracle; exact crossings")
def self_crossing(effort: Effort) -> Outcome:
    """The nearest sheet of a loop drawn along z."""
    rays = chords([loop_sheet()], effort.count(150, 8), seed=effort.seed + 5)
    return catalogue("A11", effort) + by_exact([loop_sheet()], rays.origins, rays.directions)


@row("A12", "two coincident patches", "closed form; oracle")
def coincident(effort: Effort) -> Outcome:
    """The lower object is hit, whatever the order."""
    total = catalogue("A12", effort)
    flat = [
        BezierPatches([flat_net()]),
        BezierPatches([flat_net()]),
        Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)),
    ]
    n = effort.count(5000, 50)
    targets = effort.rng().uniform((-0.9, -0.9, 0), (0.9, 0.9, 0), (n, 3))
    for order in ((0, 1, 2), (2, 1, 0)):
        hits, found = traced(
            [flat[k] for k in order],
            targets + np.array([0.0, 0.0, 3.0]),
            np.tile((0.0, 0.0, -1.0), (n, 1)),
        )
        total += found + Outcome(wrong=int(((hits.t != 3.0) | (hits.object_id != 0)).sum()))
    return total


@row("A13", "shared edges and corners", "oracle; no ray may pass")
def shared_edges(effort: Effort) -> Outcome:
    """10^5 rays from above at the inner edges of a sheet of 16 patches: none passes."""
    total = catalogue("A13", effort)
    sheet = _cut_up(bumpy_net(seed=4), 4)
    surface, n, rng = BezierPatches(sheet), effort.count(100_000, 500), effort.rng(1)
    patch, at, along = rng.integers(16, size=n), rng.integers(4, size=n), rng.random(n)
    along = np.where(rng.random(n) < 0.25, np.round(along), along)
    u, v = np.where(at < 2, at, along), np.where(at < 2, along, at - 2)
    targets = surface.point(u.astype(float), v.astype(float), patch)
    directions = rng.normal(size=(n, 3)) * (0.1, 0.1, 1.0) - (0, 0, 3)
    hits, found = traced([surface], targets - 2.0 * directions, directions)
    border = (np.abs(targets[:, :2] - 0.5) > 0.5 - 1e-9).any(axis=1)
    passed = ~border & ~(hits.hit & (hits.t <= 2.0 + 1e-12))
    return total + found + Outcome(wrong=int(passed.sum()))


def _cut_up(net: FloatArray, n: int) -> list[FloatArray]:
    """Cut a patch into n x n, so that neighbours share their edges' control points."""

    def halves(points: FloatArray) -> tuple[FloatArray, FloatArray]:
        left, right = [points[0]], [points[-1]]
        while len(points) > 1:
            points = 0.5 * (points[:-1] + points[1:])
            left.append(points[0])
            right.append(points[-1])
        return np.stack(left), np.stack(right[::-1])

    nets = [net]
    while len(nets) < n * n:
        nets = [part for one in nets for part in halves(one)]
        nets = [part.swapaxes(0, 1) for one in nets for part in halves(one.swapaxes(0, 1))]
    return nets


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


@row("A15", "rays that leave the surface", "oracle; closed form")
def leaving(effort: Effort) -> Outcome:
    """From y = x^2 at cos 0.5 to 1e-6: below nothing, above the other root, m - 2 x along x."""
    total = catalogue("A15", effort)
    n, rng = effort.count(50_000, 300), effort.rng()
    x = rng.uniform(-0.9, 0.9, n)
    for coarse in WAYS:
        tracer = Intersector([parabola_sheet()], coarse=coarse)
        origins = np.stack([x, np.full(n, -1.0), np.full(n, 0.5)], axis=1)
        source = tracer.intersect(origins, (0.0, 1.0, 0.0))
        # Directions (1, m), m beside the tangent's slope 2 x.
        beside = 10.0 ** rng.uniform(-6, -0.3, n) * rng.choice([-1.0, 1.0], n)
        directions = np.stack([np.ones(n), 2.0 * x + beside, np.zeros(n)], axis=1)
        hits = tracer.intersect(source.position, directions, source=source)
        end = x + beside
        meets = (beside > 0.0) & (end <= 1.0)
        clear = np.abs(end - 1.0) > 1e-12
        wrong = clear & (hits.hit != meets) & (hits.status != Status.TANGENT)
        both = hits.hit & meets & clear
        slope = np.abs(beside[both]) / np.hypot(1.0, 2.0 * end[both])
        # The point of departure is rounded too: that moves the chord by as much over the cosine.
        error = np.abs(hits.t[both] - beside[both]) * slope / (BAND * 3.0)
        total += Outcome(
            rays=n, wrong=int(wrong.sum()), error=float(error.max(initial=0.0)),
            undecided=int((hits.status == Status.TANGENT).sum()),
        )  # fmt: skip
    return total


@row("A16", "control points that are no numbers", "refusal")
def not_finite(effort: Effort) -> Outcome:
    """Refused, naming the patch or the profile."""
    del effort
    total = Outcome()
    for value in (np.nan, np.inf, -np.inf):
        net = np.array(teapot().patches[3])
        net[1, 2, 0] = value
        profile = [(0.0, 1.0), (value, 2.0)]
        total += refusal(partial(BezierPatches, [teapot().patches[0], net]), "finite")
        total += refusal(partial(SurfaceOfRevolution, profile, (0, 0, 0), (0, 0, 1)), "finite")
    return total


def _scaled(effort: Effort, exponents: tuple[int, ...], decimals: tuple[int, ...]) -> Outcome:
    """Powers of two change no bit; at powers of ten exact crossings judge."""
    total, curves = Outcome(), []
    makers: tuple[Callable[[], Any], ...] = (teapot, torus)
    for make in makers:
        surface = make()
        rays = chords([surface], effort.count(20_000, 200), seed=effort.seed + 4)
        a = Intersector([surface]).intersect(rays.origins, rays.directions)
        for exponent in exponents:
            factor = 2.0**exponent
            moved = surface.transformed(np.diag([factor, factor, factor, 1.0]))
            b = Intersector([moved]).intersect(rays.origins * factor, rays.directions * factor)
            names = differences(a, b, SCALED)
            total += Outcome(rays=len(a)).checked(
                not names, f"scale 2^{exponent} changes {', '.join(names)}"
            )
    simple: tuple[tuple[str, Any, int], ...] = (
        ("bilinear patch", saddle(), 200), ("turned torus", torus(), 60),
    )  # fmt: skip
    for label, surface, n in simple:
        rays = chords([surface], effort.count(n, 6), seed=effort.seed + 6)
        plot = Plot("scale of the scene", label)
        for exponent in decimals:
            factor = 10.0**exponent
            moved = surface.transformed(np.diag([factor, factor, factor, 1.0]))
            size = float(np.linalg.norm(np.ptp(moved.bounds, axis=0)))
            o, d = rays.origins * factor, rays.directions * factor
            total += by_exact([moved], o, d)
            tracer = Intersector([moved], coarse="none")
            errors = exact_errors(ExactScene([moved]), tracer.intersect(o, d), o, d)
            work = tracer.counters["most_pieces"]
            total += plot.add(factor, errors[0] / size, errors[1] / size, work)
        curves.append(plot.curve)
    return replace(total, curves=tuple(curves))


@row("A17", "scale 1e-9", "identity under powers of two; exact crossings")
def small_scenes(effort: Effort) -> Outcome:
    """The whole scene, 1 down to 1e-9."""
    return _scaled(effort, (-10, -20, -30), (-9, -7, -5, -3, -1))


@row("A18", "scale 1e9", "identity under powers of two; exact crossings")
def large_scenes(effort: Effort) -> Outcome:
    """The whole scene, 1 up to 1e9."""
    return _scaled(effort, (10, 20, 30), (1, 3, 5, 7, 9))


@row("A19", "far from the origin", "identity under translations that floats hold")
def far_away(effort: Effort) -> Outcome:
    """Moved by powers of two up to 1e8: only the input's rounding is lost."""
    total, curves = Outcome(), []
    grain = 2.0**-20
    makers: tuple[tuple[str, Callable[[], Any]], ...] = (("teapot", teapot), ("torus", torus))
    for label, make in makers:
        surface = make()
        rays = chords([surface], effort.count(10_000, 200), seed=effort.seed + 5)
        origins = np.round(rays.origins / grain) * grain
        a = Intersector([surface]).intersect(origins, rays.directions)
        size = float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
        plot = Plot("offset from the origin / size", label)
        for exponent in (0, 3, 7, 10, 13, 17, 20, 23, 26):
            offset = 2.0**exponent
            move = np.eye(4)
            move[:3, 3] = offset
            tracer = Intersector([surface.transformed(move)])
            b = tracer.intersect(origins + offset, rays.directions)
            sure = (a.status != Status.TANGENT) & (b.status != Status.TANGENT)
            cosine = cosines(a, rays.directions)
            length = np.linalg.norm(rays.directions, axis=1)
            both = a.hit & b.hit & sure
            # Control points are rounded at the offset: that far the surface itself has moved.
            moved = 4 * EPS * (offset + length)
            error = np.abs(a.t[both] - b.t[both]) * length[both]
            expected = (moved / np.maximum(cosine, LEAST_COSINE))[both]
            # The moved surface may turn a graze into a miss.
            clear = sure & ~(cosine < np.sqrt(moved / size))
            total += Outcome(
                rays=len(a), wrong=int((clear & (a.hit != b.hit)).sum()),
                undecided=int((b.status == Status.TANGENT).sum()),
                work=tracer.counters["most_pieces"],
            )  # fmt: skip
            total += plot.add(
                offset / size, error / size, expected / size, tracer.counters["most_pieces"]
            )
        curves.append(plot.curve)
    return replace(total, curves=tuple(curves))


@row("A20", "aspect ratio up to 1e8", "oracle; affine maps keep t; exact crossings")
def long_and_thin(effort: Effort) -> Outcome:
    """Stretched by powers of two, which floats hold: t, u and v are those from before."""
    total = catalogue("A20", effort)
    net, n = bumpy_net(), effort.count(30, 6)
    rays = secondary([BezierPatches([net])], n, seed=effort.seed + 7)
    aimed = chords([BezierPatches([net])], n, seed=effort.seed + 8)
    origins = np.concatenate([rays.origins, aimed.origins])
    directions = np.concatenate([rays.directions, aimed.directions])
    plot = Plot("aspect ratio", "bicubic patch, stretched")
    for exponent in (0, 4, 7, 10, 13, 17, 20, 23, 27):
        stretch = np.array([2.0 ** (exponent - exponent // 2), 2.0 ** -(exponent // 2), 1.0])
        surface = BezierPatches([net * stretch])
        o, d = origins * stretch, directions * stretch
        # What is given up says TANGENT: the judge tells whether there was need.
        total += by_exact([surface], o, d, may_give_up=True)
        tracer = Intersector([surface], coarse="none")
        hits = tracer.intersect(o, d)
        size = float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
        error, expected = exact_errors(ExactScene([surface]), hits, o, d)
        total += plot.add(
            2.0**exponent, error / size, expected / size, tracer.counters["most_pieces"]
        )
    return replace(total, curves=(plot.curve,))


@row("A21", "extremely uneven parametrisation", "oracle; exact crossings")
def uneven(effort: Effort) -> Outcome:
    """Control points crowd in a corner: |S_u| from 1e-6 to 1; aimed at that corner as well."""
    return catalogue("A21", effort) + by_set(
        "uneven patch corner", effort, 16, against="distance from a crowded corner / size"
    )


@row("A22", "wavy patch of degree 12", "oracle")
def wavy(effort: Effort) -> Outcome:
    """Several roots in every cell."""
    return catalogue("A22", effort)


@row("A23", "origin on the surface", "closed form")
def on_the_surface(effort: Effort) -> Outcome:
    """T = 0 is no hit."""
    total = catalogue("A23", effort)
    n, rng = effort.count(2000, 40), effort.rng()
    origins = np.column_stack([rng.uniform(0.05, 0.95, (n, 2)), np.zeros(n)])
    directions = rng.normal(size=(n, 3))
    return total + by_times([square()], origins, directions, np.full(n, np.inf))


@row("A24", "origin inside boxes of pieces", "closed form")
def inside_boxes(effort: Effort) -> Outcome:
    """A steep sheet z = 4 x y fills its box; rays begin inside, on either side of it."""
    x, y = np.meshgrid([-1.0, 1.0], [-1.0, 1.0], indexing="ij")
    sheet = BezierPatches([np.stack([x, y, 4 * x * y], axis=-1)])
    n = effort.count(20_000, 100)
    origins = effort.rng().uniform((-0.9, -0.9, -3), (0.9, 0.9, 3), (n, 3))
    hits, found = traced([sheet], origins, np.tile((0.0, 0.0, 1.0), (n, 1)))
    above = 4 * origins[:, 0] * origins[:, 1] - origins[:, 2]
    clear = np.abs(above) > 1e-12
    error = np.abs(hits.t - above)[hits.hit] / 1e-14
    return found + Outcome(
        wrong=int((hits.hit != (above > 0))[clear].sum()), error=float(error.max(initial=0.0))
    )


@row("A25", "pointing away from everything", "closed form")
def pointing_away(effort: Effort) -> Outcome:
    """A miss, whatever lies behind."""
    total = catalogue("A25", effort)
    n = effort.count(5000, 50)
    directions = unit(effort.rng().normal(size=(n, 3)))
    directions[:, 2] = np.abs(directions[:, 2])
    return total + by_times(
        [teapot()], np.tile((0.0, 0.0, 10.0), (n, 1)), directions, np.full(n, np.inf)
    )


@row("A26", "t_max just before and behind the hit", "closed form")
def limits(effort: Effort) -> Outcome:
    """A hit lies strictly between t_min and t_max: to the last bit of a plane's t."""
    del effort
    total = Outcome()
    ray = (0.1, 0.2, 3.0), (0, 0, -1)
    for coarse in WAYS:
        tracer = Intersector([BezierPatches([flat_net()])], coarse=coarse)
        for factor in (1 - 1e-12, 1 - 4e-16, 1.0, 1 + 4e-16, 1 + 1e-12):
            ok = (
                tracer.occluded(*ray, 3.0 * factor)[0] == (factor > 1)
                and tracer.intersect(*ray, t_max=3.0 * factor).hit[0] == (factor > 1)
                and tracer.intersect(*ray, t_min=3.0 * factor).hit[0] == (factor < 1)
            )
            total += Outcome(rays=3, wrong=int(not ok))
    return total


@row("A29", "thousands of patches in one place", "closed form; counts of work")
def piled_up(effort: Effort) -> Outcome:
    """Squares 1e-3 apart, all over each other: what lies behind the first is not solved."""
    m, n = effort.count(100_000, 5000), effort.count(2000, 50)
    heights = effort.rng(1).permutation(m) * 1e-3
    nets = np.repeat(flat_net(degree=1)[None], m, axis=0)
    nets[..., 2] = heights[:, None, None]
    tracer = Intersector([BezierPatches(nets)], coarse="none")
    top = float(heights.max())
    origins = effort.rng(2).uniform((-0.9, -0.9, top + 1), (0.9, 0.9, top + 2), (n, 3))
    hits = tracer.intersect(origins, (0.0, 0.0, -1.0))
    wrong = (hits.patch_id != heights.argmax()) | (
        np.abs(hits.t - (origins[:, 2] - top)) > 4 * EPS * top
    )
    solves = tracer.counters["newton_solves"]
    return Outcome(
        rays=n, wrong=int(wrong.sum()), work=tracer.counters["most_pieces"],
        notes=(f"{m} patches",),
    ).checked(solves < 3 * n, f"{solves} solves for {n} rays")  # fmt: skip


@row("A30", "one patch only", "oracle")
def one_patch(effort: Effort) -> Outcome:
    """The same answers as by the slow way, without a scene around."""
    net = flat_net()
    net[1:3, 1:3, 2] = 1.0
    surface = BezierPatches([net])
    rays = chords([surface], effort.count(10_000, 100), seed=effort.seed + 14)
    return catalogue("A30", effort) + by_oracle([surface], rays.origins, rays.directions)


@row("A32", "nets of wrong shape or type", "refusal; identity")
def shapes_and_types(effort: Effort) -> Outcome:
    """Other shapes are refused; degrees may be mixed; other types become float64."""
    total = Outcome()
    for shape in ((4, 4, 3), (4, 3), (1, 4, 4, 2), (1, 4, 4, 4)):
        total += refusal(partial(BezierPatches, np.zeros(shape)), "control has shape")
    for dtype in (np.float32, np.int64):
        net = np.round(4 * flat_net()).astype(dtype)
        surface = BezierPatches([net, flat_net(2.0, degree=2)])
        same = surface.control.dtype == np.float64 and np.array_equal(surface.patches[0], net)
        total += Outcome(rays=1, wrong=int(not same))
    nets = [
        np.add(bumpy_net(m, n, 10 + m), (0.0, 0.0, 0.02 * m))
        for m, n in ((1, 1), (2, 5), (4, 4), (7, 3), (12, 1), (9, 9))
    ]
    mixed = BezierPatches(nets)
    origins, directions = bumpy_chords(effort.count(5000, 100), effort.rng(32))
    hits, found = traced([mixed], origins, directions)
    return total + found + judged(hits, first_hits([mixed], origins, directions))
