"""Rows A17 to A20: patches very small, large, far away, long and thin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_rt.core.records import Status
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.catalogue import (
    saddle,
)
from proof.cases.rays import chords, secondary
from proof.cases.scenes import torus
from proof.exact.truth import ExactScene
from proof.stability.measure import (
    EPS,
    LEAST_COSINE,
    differences,
)
from proof.stability.measure_exact import by_exact, catalogue, exact_errors
from proof.stability.patch_nets import bumpy_net, cosines
from proof.stability.row import Effort, Outcome, Plot, row

# What a similarity by a power of two must leave as it is.
SCALED = ("t", "u", "v", "object_id", "patch_id", "status")


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
        curves.append(plot)
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
    """Moved by powers of two up to 1e8: nothing is lost, as images keep what rounding leaves."""
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
            moved = 64 * EPS * np.maximum(size, length)
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
        curves.append(plot)
    return replace(total, curves=tuple(curves))


@row("A20", "aspect ratio up to 1e8", "exact arithmetic; affine maps keep t; exact crossings")
def long_and_thin(effort: Effort) -> Outcome:
    """Stretched by powers of two, which floats hold: t, u and v are those from before."""
    total = catalogue("A20", effort)
    net, n = bumpy_net(), effort.count(30, 2)
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
    return replace(total, curves=(plot,))
