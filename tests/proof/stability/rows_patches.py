"""Rows A01 to A05, A15 and A21 to A30: rays at Bezier patches."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybrid_rt.core.records import Status
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.catalogue import (
    parabola_sheet,
)
from proof.stability.measure import (
    BAND,
    DISTANCES,
    EPS,
    LEAST_COSINE,
    traced,
)
from proof.stability.measure_exact import catalogue
from proof.stability.patch_nets import flat_net
from proof.stability.row import Effort, Outcome, Plot, row


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
