"""Rows D02, D03, D05: rays of any length and direction."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Box, Sphere
from proof.cases.rays import axis_parallel, chords
from proof.cases.scenes import torus
from proof.stability.measure import by_judges, catalogue, traced
from proof.stability.row import Effort, Outcome, refusal, row


def _refused(direction: Any, words: str) -> Outcome:
    """Return what comes of a bad direction among good ones, by each way to ask."""
    tracer, total = Intersector([torus()]), Outcome()
    directions = np.tile([0.0, 0.0, 1.0], (9, 1))
    directions[4] = direction
    for ask in (tracer.intersect, tracer.occluded, tracer.intersect_all):
        total += refusal(partial(ask, np.zeros((9, 3)), directions), "directions[4]", words)
    return total


@row("D02", "directions of length 1e-300 and 1e300, nan, inf", "closed form; refusal")
def lengths(effort: Effort) -> Outcome:
    """The same answers at any length that has a square or not."""
    total = catalogue("D02", effort)
    total += _refused((0, np.nan, 1), "finite") + _refused((np.inf, 0, 0), "finite")
    n, rng = effort.count(20_000, 100), effort.rng()
    for surface in (Sphere((0.1, 0, 0), 0.7), torus(), teapot()):
        rays = chords([surface], n, seed=effort.seed + 2)
        tracer = Intersector([surface])
        a = tracer.intersect(rays.origins, rays.directions)
        power = rng.choice([-990, -500, 500, 990], n)
        b = tracer.intersect(rays.origins, np.ldexp(rays.directions, power[:, None]))
        same = np.array_equal(np.ldexp(b.t, power), a.t) and np.array_equal(
            a.position, b.position, equal_nan=True
        )
        total += Outcome(rays=n).checked(same, f"lengths change hits on a {type(surface).__name__}")
    return total


@row("D03", "directions that are no unit vectors", "identity")
def units(effort: Effort) -> Outcome:
    """T counts lengths of the given direction; so do limits."""
    total, n = Outcome(), effort.count(20_000, 200)
    lengths_ = 2.0 ** effort.rng().integers(-40, 40, n)
    for surface in (teapot(), torus(), Sphere((0.1, 0, 0), 0.7)):
        rays = chords([surface], n, seed=effort.seed + 11)
        tracer = Intersector([surface])
        longer = rays.directions * lengths_[:, None]
        a = tracer.intersect(rays.origins, rays.directions)
        b = tracer.intersect(rays.origins, longer)
        # Powers of two are exact: so is everything but the unit of t.
        same = np.array_equal(b.t * lengths_, a.t)
        same &= np.array_equal(b.position, a.position, equal_nan=True)
        limited = tracer.intersect(rays.origins, longer, t_max=0.5 * np.where(a.hit, b.t, 1.0))
        late = limited.hit & (limited.t >= b.t)
        total += Outcome(rays=2 * n, wrong=int(late.sum())).checked(
            bool(same), f"the length of directions changes hits on a {type(surface).__name__}"
        )
    return total


@row("D05", "components of direction 0 and -0", "closed form; exact arithmetic")
def axis_parallels(effort: Effort) -> Outcome:
    """Rays along axes: on the faces of boxes, and at curved surfaces."""
    total = catalogue("D05", effort)
    for surfaces in ([torus()], [teapot()], [Sphere((0.1, 0, 0), 0.7)]):
        rays = axis_parallel(surfaces, effort.count(5000, 60), seed=effort.seed + 13)
        total += by_judges(surfaces, rays.origins, rays.directions)
    # On the planes of a box's faces, within them and clear beside them.
    box, n, rng = Box((0, 0, 0), (1, 1, 1)), effort.count(5000, 60), effort.rng()
    axis, sign = rng.integers(3, size=n), rng.choice([-1.0, 1.0], n)
    origins = rng.choice([0.0, 1.0, 0.5, 0.25, -0.25, 1.25], (n, 3))
    directions = np.where(rng.random((n, 3)) < 0.5, 0.0, -0.0)
    rows = np.arange(n)
    origins[rows, axis], directions[rows, axis] = 0.5 - 2.5 * sign, sign
    others = np.stack([(axis + 1) % 3, (axis + 2) % 3], axis=1)
    across = np.take_along_axis(origins, others, axis=1)
    outside = ((across < 0) | (across > 1)).any(axis=1)
    inside = ((across > 0) & (across < 1)).all(axis=1)
    hits, found = traced([box], origins, directions)
    wrong = (outside & hits.hit) | (inside & (hits.t != 2.0)) | np.isnan(hits.t)
    wrong |= ~outside & hits.hit & (hits.t != 2.0)
    return total + found + Outcome(wrong=int(wrong.sum()))
