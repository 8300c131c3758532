"""Rows E03, E05, E09: arguments, processes and threads, layouts of arrays."""

from __future__ import annotations

import multiprocessing
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import at_box
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from proof.cases.campaign import torus
from proof.cases.rays import chords
from proof.stability.measure import differences
from proof.stability.row import Effort, Outcome, row

# Seconds for a child process, its compilations included.
LIMIT = 120


@row("E03", "arguments are used twice", "identity")
def twice(effort: Effort) -> Outcome:
    """Two calls give the same, and leave what they are given as it is."""
    tracer = Intersector([teapot()])
    rays = chords([teapot()], effort.count(50_000, 500), seed=effort.seed + 8)
    t_max = np.full(len(rays.origins), 20.0)
    kept = rays.origins.copy(), rays.directions.copy()
    a, b = (tracer.intersect(rays.origins, rays.directions, t_max=t_max) for _ in range(2))
    same = (t_max == 20.0).all() and all(
        np.array_equal(x, y) for x, y in zip(kept, (rays.origins, rays.directions), strict=True)
    )
    return (
        Outcome(rays=2 * len(a))
        .checked(not differences(a, b), "the second call differs from the first")
        .checked(bool(same), "an argument was written to")
    )


def hits_in_a_child(queue: Any, n: int, seed: int) -> None:
    """Trace rays in another process."""
    rays = chords([teapot()], n, seed=seed)
    hits = Intersector([teapot()], threads=2).intersect(rays.origins, rays.directions)
    queue.put((hits.t, hits.u, hits.status))


@row("E05", "one worker, many; spawn and fork", "identity")
def workers(effort: Effort) -> Outcome:
    """Threads and processes change no bit."""
    n, total = effort.count(20_000, 500), Outcome()
    rays = chords([teapot()], n, seed=effort.seed + 13)
    one = Intersector([teapot()], threads=1).intersect(rays.origins, rays.directions)
    for threads in (2, 3, 8):
        many = Intersector([teapot()], threads=threads).intersect(rays.origins, rays.directions)
        names = differences(one, many)
        total += Outcome(rays=n).checked(not names, f"{threads} threads change {', '.join(names)}")
    for method in ("spawn", "fork"):
        context: Any = multiprocessing.get_context(method)
        queue = context.Queue()
        child = context.Process(target=hits_in_a_child, args=(queue, n, effort.seed + 13))
        child.start()
        t, u, status = queue.get(timeout=LIMIT)
        child.join(timeout=60)
        same = np.array_equal(t, one.t) and np.array_equal(u, one.u, equal_nan=True)
        same &= np.array_equal(status, one.status)
        total += Outcome(rays=n).checked(
            same and child.exitcode == 0, f"a process by {method} has other hits"
        )
    return total


@row("E09", "arrays of any layout", "identity")
def layouts(effort: Effort) -> Outcome:
    """Read-only, Fortran-ordered and strided arrays are taken."""
    total, n = Outcome(), effort.count(20_000, 200)
    for surface in (torus(), teapot()):
        tracer = Intersector([surface])
        rays = at_box([surface], n, seed=effort.seed + 3)
        o, d = rays.origins, rays.directions
        expected = tracer.intersect(o, d)
        frozen = o.copy(), d.copy()
        for array in frozen:
            array.flags.writeable = False
        others = {
            "Fortran-ordered": (np.asfortranarray(o), np.asfortranarray(d)),
            "strided": (np.repeat(o, 2, axis=0)[::2], np.repeat(d, 2, axis=0)[::2]),
            "read-only": frozen,
            "reversed": (o[::-1].copy()[::-1], d[::-1].copy()[::-1]),
        }
        for name, arrays in others.items():
            names = differences(tracer.intersect(*arrays), expected)
            total += Outcome(rays=n).checked(not names, f"{name} arrays change {', '.join(names)}")
    return total
