"""A second certificate for Bezier patches, fast enough for 1e8 rays.

The first proves by the fan of a cell's normals that it holds at most one root, on up to 8 x 8 cells
a patch, and bisects the rest. The second has other cells, its own bounding volume hierarchy, and no
fans: every cell that a ray hits is bisected until Krawczyk's test, or a box, decides. Where the two
differ by more than their bounds, the oracle decides which is wrong.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core.records import BoolArray, HitRecord, Status
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.kernels.patch.cells import FAN
from hybrid_rt.intersection.kinds.patches import PatchKind
from meshing import BezierPatches
from proof.cases.rays import hard_rays
from proof.judges.judge import compare
from proof.judges.oracle import first_hits

STEP = 100_000
CELLS = 2


class Bisection(Intersector):
    """First hits on Bezier patches, proven without fans.

    Parameters
    ----------
    surfaces : sequence of BezierPatches
    threads : int, optional

    Raises
    ------
    TypeError
        For other surfaces.
    """

    def __init__(self, surfaces: Sequence[BezierPatches], threads: int | None = None) -> None:
        for i, surface in enumerate(surfaces):
            if not isinstance(surface, BezierPatches):
                raise TypeError(f"surfaces[{i}] is a {type(surface).__name__}: pass BezierPatches")
        super().__init__(surfaces, coarse="none", threads=threads)
        kind = PatchKind(list(enumerate(surfaces)), Pool(threads), finest=CELLS)
        kind.table.record[:, FAN : FAN + 2] = np.inf
        self._curved = [kind]
        self._number_kinds()


@dataclass
class Duel:
    """Results of comparing the two certificates.

    Attributes
    ----------
    rays, hits, tangent : int
        Of the first certificate.
    apart : int
        Rays on which the two differ by more than their bounds.
    wrong, wrong_second : int
        How many of those the oracle finds wrong, by either certificate.
    undecided : int
        How many of those the oracle leaves open.
    worst : float
        Largest difference of t over the sum of the bounds, where both hit and neither is TANGENT.
    given_up : int
        Searches that ended without an answer, by either.
    examples : list of (seed, ray)
    seconds, second_seconds : float
    """

    rays: int = 0
    hits: int = 0
    tangent: int = 0
    apart: int = 0
    wrong: int = 0
    wrong_second: int = 0
    undecided: int = 0
    worst: float = 0.0
    given_up: int = 0
    examples: list[tuple[int, int]] | None = None
    seconds: float = 0.0
    second_seconds: float = 0.0


def duel(surfaces: Sequence[Any], n: int, seed: int, threads: int | None = None) -> Iterator[Duel]:
    """Compare the two on n hard rays, `STEP` at a time; yield the totals after each step."""
    first, second = (
        Intersector(surfaces, coarse="none", threads=threads),
        Bisection(surfaces, threads),
    )
    total = Duel(examples=[])
    for k, begin in enumerate(range(0, n, STEP)):
        rays = hard_rays(surfaces, min(STEP, n - begin), seed + k)
        start = time.perf_counter()
        a = first.intersect(rays.origins, rays.directions)
        between = time.perf_counter()
        b = second.intersect(rays.origins, rays.directions)
        end = time.perf_counter()
        rows = np.flatnonzero(~_agree(a, b))
        if len(rows):
            truth = first_hits(surfaces, rays.origins[rows], rays.directions[rows], threads=threads)
            verdict = compare(a[rows], truth)
            total.wrong += verdict.n_wrong
            total.undecided += verdict.undecided
            total.wrong_second += compare(b[rows], truth).n_wrong
            bad = [i for found in verdict.rows.values() for i in rows[found]]
            total.examples = ((total.examples or []) + [(seed + k, int(i)) for i in bad])[:20]
        sure = a.hit & b.hit & (a.status == Status.HIT) & (b.status == Status.HIT)
        sure[rows] = False
        bounds = a.t_bound[sure] + b.t_bound[sure]
        total.worst = max(
            total.worst, float((np.abs(a.t[sure] - b.t[sure]) / bounds).max(initial=0.0))
        )
        total.rays += len(a)
        total.hits += int(a.hit.sum())
        total.tangent += int((a.status == Status.TANGENT).sum())
        total.apart += len(rows)
        total.given_up = first.counters["given_up"] + second.counters["given_up"]
        total.seconds += between - start
        total.second_seconds += end - between
        yield total


def _agree(a: HitRecord, b: HitRecord) -> BoolArray:
    """Both miss, or both hit the same object at the same t up to their bounds."""
    with np.errstate(invalid="ignore"):
        close = np.abs(a.t - b.t) <= a.t_bound + b.t_bound
    same = (a.object_id == b.object_id) & (close | ~a.hit)
    return np.asarray(same)
