"""Rows A01 to A05, A15 and A21 to A30: rays at Bezier patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import Status
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.catalogue import (
    parabola_sheet,
    saddle,
    square,
)
from proof.cases.rays import chords
from proof.stability.measure import (
    BAND,
    DISTANCES,
    EPS,
    LEAST_COSINE,
    by_judges,
    by_times,
    catalogue,
    differences,
    traced,
)
from proof.stability.measure_exact import by_exact, by_set
from proof.stability.patch_nets import flat_net
from proof.stability.row import Effort, Outcome, Plot, row

WAYS = ("none", "embree")


@row("A01", "rays near a silhouette", "exact arithmetic")
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
    return replace(total, curves=(plot,))


@row("A03", "ray lying in a flat patch", "closed form; exact arithmetic")
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


@row("A04", "ray along a straight line of a ruled patch", "closed form; exact arithmetic")
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


@row("A05", "bilinear patch that is not flat", "exact arithmetic")
def bilinear(effort: Effort) -> Outcome:
    """Both roots of the quadratic."""
    rays = chords([saddle()], effort.count(600, 20), seed=effort.seed + 3)
    return catalogue("A05", effort) + by_exact([saddle()], rays.origins, rays.directions)


@row("A15", "rays that leave the surface", "exact arithmetic; closed form")
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


@row("A21", "extremely uneven parametrisation", "exact arithmetic")
def uneven(effort: Effort) -> Outcome:
    """Control points crowd in a corner: |S_u| from 1e-6 to 1; aimed at that corner as well."""
    return catalogue("A21", effort) + by_set(
        "uneven patch corner", effort, 16, against="distance from a crowded corner / size"
    )


@row("A22", "wavy patch of degree 12", "exact arithmetic")
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


@row("A30", "one patch only", "exact arithmetic")
def one_patch(effort: Effort) -> Outcome:
    """The same answers as by the slow way, without a scene around."""
    net = flat_net()
    net[1:3, 1:3, 2] = 1.0
    surface = BezierPatches([net])
    rays = chords([surface], effort.count(10_000, 100), seed=effort.seed + 14)
    return catalogue("A30", effort) + by_judges([surface], rays.origins, rays.directions)
