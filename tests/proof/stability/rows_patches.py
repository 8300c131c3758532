"""Rows of Bezier patches that the catalogue and the singular sets do not hold."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray, Status
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.catalogue import cuspidal_edge, parabola_sheet, saddle
from proof.cases.rays import chords, secondary
from proof.cases.scenes import torus
from proof.cases.singular_rays import size_of
from proof.stability.measure import BAND, DISTANCES, EPS, LEAST_COSINE, differences, traced
from proof.stability.measure_exact import by_degrees, by_set, catalogue, plotted
from proof.stability.patch_nets import bumpy_chords, bumpy_net, cosines, elevated, flat_net
from proof.stability.row import Effort, Outcome, Plot, row

# What a similarity by a power of two must leave as it is.
SCALED = ("t", "u", "v", "object_id", "patch_id", "status")


@row("A02", "exactly tangent ray", "closed form")
def tangents(effort: Effort) -> Outcome:
    """Rays along x at y = +-k over y = x^2: they meet it at -sqrt(y)."""
    total = catalogue("A02", effort)
    tracer, size = Intersector([parabola_sheet()], coarse="none"), size_of(parabola_sheet())
    plot = Plot("distance from tangency / size", "parabola, rays parallel to its tangent")
    n = effort.count(2000, 20)
    for k in DISTANCES:
        tracer.counters["most_pieces"] = 0
        rng = effort.rng(round(-np.log10(k)))
        depth = size * k * rng.uniform(0.5, 1.0, n) * rng.choice([-1.0, 1.0], n)
        origins = np.stack([np.full(n, -2.0), depth, rng.uniform(0.05, 0.95, n)], axis=1)
        hits = tracer.intersect(origins, (1.0, 0.0, 0.0))
        band = BAND * np.maximum(np.linalg.norm(origins - tracer.surfaces[0].middle, axis=1), size)
        sure = hits.status != Status.TANGENT
        wrong = sure & (hits.hit != (depth > 0.0))
        both = sure & hits.hit & (depth > 0.0)
        error = np.abs(hits.t[both] - (2.0 - np.sqrt(depth[both])))
        slope = 2.0 * np.sqrt(depth[both]) / np.sqrt(1.0 + 4.0 * depth[both])
        expected = band[both] / np.maximum(slope, LEAST_COSINE)
        work = tracer.counters["most_pieces"]
        total += Outcome(
            rays=n, wrong=int(wrong.sum()), undecided=int((~sure).sum()), work=work,
            broken=int((error - 4.0 * EPS > hits.t_bound[both]).sum()),
        ).checked(
            not ((np.abs(depth) <= 0.9 * band) & sure).any(), f"no mark within the band at {k:.0e}"
        ).checked(
            not (~sure & (np.abs(depth) > 4.0 * band)).any(), f"marks beyond the band at {k:.0e}"
        ).checked(work < 5000, f"{work} pieces at {k:.0e}")  # fmt: skip
        total += plot.add(k, error / size, expected / size, work)
    return replace(total, curves=(plot,))


@row("A06", "degree up to 30 x 30", "exact crossings of the same surface at low degree")
def high_degrees(effort: Effort) -> Outcome:
    """A bilinear and a bicubic patch with degrees raised; `TestRoundings` holds their points."""
    total, n = Outcome(), effort.count(200, 8)
    for net, label, count in (
        (saddle().patches[0], "bilinear", n),
        (bumpy_net(), "bicubic", n // 3),
    ):
        own = len(net) - 1
        origins, directions = bumpy_chords(max(count, 4), effort.rng(own))
        if own == 1:
            origins, directions = 1.5 * (origins - 0.5), 1.5 * directions

        def raised(times: int, net: FloatArray = net) -> BezierPatches:
            return BezierPatches([elevated(net, times)])

        total += by_degrees(f"{label} patch", own, raised, origins, directions)
    return total


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
    sheet = BezierPatches([flat_net(), upper, lower])
    hits, found = traced([sheet], targets - directions, directions)
    return found + Outcome(wrong=int((~hits.hit | (np.abs(hits.t - 1) > 1e-14)).sum()))


def _scaled(effort: Effort, sign: int) -> Outcome:
    """Powers of two change no bit; at powers of ten exact crossings judge."""
    total, curves = Outcome(), []
    makers: tuple[Callable[[], Any], ...] = (teapot, torus)
    for make in makers:
        surface = make()
        rays = chords([surface], effort.count(20_000, 200), seed=effort.seed + 4)
        a = Intersector([surface]).intersect(rays.origins, rays.directions)
        for exponent in (10 * sign, 20 * sign, 30 * sign):
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
        for exponent in range(sign, 10 * sign, 2 * sign):
            factor = 10.0**exponent
            moved = surface.transformed(np.diag([factor, factor, factor, 1.0]))
            total += plotted(plot, factor, moved, rays.origins * factor, rays.directions * factor)
        curves.append(plot)
    return replace(total, curves=tuple(curves))


@row("A17", "scale 1e-9", "identity under powers of two; exact crossings")
def small_scenes(effort: Effort) -> Outcome:
    """The whole scene, 1 down to 1e-9."""
    return _scaled(effort, -1)


@row("A18", "scale 1e9", "identity under powers of two; exact crossings")
def large_scenes(effort: Effort) -> Outcome:
    """The whole scene, 1 up to 1e9."""
    return _scaled(effort, 1)


@row("A19", "far from the origin", "identity under translations that floats hold")
def far_away(effort: Effort) -> Outcome:
    """Moved by powers of two up to 1e8: nothing is lost, as images keep what rounding leaves."""
    total, curves = Outcome(), []
    grain = 2.0**-20
    makers: tuple[tuple[str, Callable[[], Any]], ...] = (("teapot", teapot), ("torus", torus))
    for label, make in makers:
        surface = make()
        rays = chords([surface], effort.count(10_000, 200), seed=effort.seed + 5)
        origins = np.round(rays.origins / grain) * grain
        a = Intersector([surface]).intersect(origins, rays.directions)
        size, plot = size_of(surface), Plot("offset from the origin / size", label)
        cosine = cosines(a, rays.directions)
        length = np.linalg.norm(rays.directions, axis=1)
        moved = 64 * EPS * np.maximum(size, length)
        for exponent in (0, 3, 7, 10, 13, 17, 20, 23, 26):
            offset = 2.0**exponent
            move = np.eye(4)
            move[:3, 3] = offset
            tracer = Intersector([surface.transformed(move)])
            b = tracer.intersect(origins + offset, rays.directions)
            sure = (a.status != Status.TANGENT) & (b.status != Status.TANGENT)
            both = a.hit & b.hit & sure
            error = np.abs(a.t[both] - b.t[both]) * length[both]
            expected = (moved / np.maximum(cosine, LEAST_COSINE))[both]
            # The moved surface may turn a graze into a miss.
            clear = sure & ~(cosine < np.sqrt(moved / size))
            work = tracer.counters["most_pieces"]
            total += Outcome(
                rays=len(a), wrong=int((clear & (a.hit != b.hit)).sum()),
                undecided=int((b.status == Status.TANGENT).sum()), work=work,
            )  # fmt: skip
            total += plot.add(offset / size, error / size, expected / size, work)
        curves.append(plot)
    return replace(total, curves=tuple(curves))


@row("A20", "aspect ratio up to 1e8", "exact arithmetic; affine maps keep t; exact crossings")
def long_and_thin(effort: Effort) -> Outcome:
    """Stretched by powers of two, which floats hold: t, u and v are those from before."""
    net, n = bumpy_net(), effort.count(30, 2)
    rays = secondary([BezierPatches([net])], n, seed=effort.seed + 7)
    aimed = chords([BezierPatches([net])], n, seed=effort.seed + 8)
    origins = np.concatenate([rays.origins, aimed.origins])
    directions = np.concatenate([rays.directions, aimed.directions])
    total, plot = catalogue("A20", effort), Plot("aspect ratio", "bicubic patch, stretched")
    for exponent in (0, 4, 7, 10, 13, 17, 20, 23, 27):
        stretch = np.array([2.0 ** (exponent - exponent // 2), 2.0 ** -(exponent // 2), 1.0])
        # What is given up says TANGENT: the judge tells whether there was need.
        total += plotted(
            plot, 2.0**exponent, BezierPatches([net * stretch]), origins * stretch,
            directions * stretch, may_give_up=True,
        )  # fmt: skip
    return replace(total, curves=(plot,))


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
