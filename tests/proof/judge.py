"""The judge of first hits: a screen in ball arithmetic, and exact arithmetic behind it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, Status
from proof.exact.judge import BatchVerdict, ExactJudge
from proof.filters.screen import Screen


class Judge:
    """Judges hits on a list of surfaces.

    ``tangent_every``: of the rows with TANGENT that the screen does not confirm each so-manyth is judged:
    no decision of theirs is guaranteed.
    ``marks``: whether to ask which rows need the mark TANGENT, and which say it without need. Then exact
    arithmetic judges every row.
    """

    def __init__(
        self, surfaces: Sequence[Any], tangent_every: int = 1, marks: bool = False
    ) -> None:
        self._every, self._seen, self._marks = tangent_every, 0, marks
        self._surfaces, self._screen = list(surfaces), Screen(surfaces)
        self._exact: ExactJudge | None = None

    def judge(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        leaves: IntArray | None = None,
        near: float = 0.0,
    ) -> BatchVerdict:
        """Judge the first hits of rays.

        ``leaves``: the objects that the rays leave from; -1 for none.
        ``near``: how near the rays come to a singular set, scene units: far ones are not asked whether they
        need the mark.
        Worst errors of the verdict are those of the rows that exact arithmetic was asked about.
        """
        unsure = np.ones(len(hits), np.bool_)
        if not self._marks:
            unsure = ~self._screen.confirmed(hits, origins, directions, leaves)
        is_tangent = hits.status == Status.TANGENT
        marked = np.flatnonzero(unsure & is_tangent)
        kept = marked[(self._seen + np.arange(len(marked))) % self._every == 0]
        self._seen += len(marked)
        rows = np.union1d(np.flatnonzero(unsure & ~is_tangent), kept)
        verdict = BatchVerdict()
        if len(rows):
            if self._exact is None:
                self._exact = ExactJudge(self._surfaces)
            left = None if leaves is None else np.asarray(leaves)[rows]
            verdict = self._exact.judge(
                hits[rows], origins[rows], directions[rows], leaves=left, marks=self._marks,
                distance=np.full(len(rows), near),
            )  # fmt: skip
        verdict.rays, verdict.hits = len(hits), int(hits.hit.sum())
        verdict.tangent, verdict.asked = int(is_tangent.sum()), len(rows)
        verdict.passed_over = len(marked) - len(kept)
        verdict.examples = {
            fault: rows[found].tolist() for fault, found in verdict.examples.items()
        }
        return verdict
