"""Tests certified first hits against exact crossings: decisions, bounds, points, status TANGENT.

A wrong first hit is defined in one place, `answers.Answers.fault`. Most rows need less: a hit within
64 eps x scale / cos of the first exact crossing, and a miss of a ray without crossings, are right by
that definition in any case. Only for the others eight displaced rays are traced.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, Status
from proof.exact.answers import answers_to
from proof.exact.crossings import EITHER, OPEN, POINT, bits, norm, rational
from proof.exact.trims import Trims
from proof.exact.truth import (
    LEAST_SLOPE,
    SURELY_ROUNDED,
    ExactScene,
    Placed,
    departure_reach,
    departures,
    same_place,
)
from proof.kernels.bands import BAND, LEAST_COSINE

EPS = 2.0**-52
# A decision must be marked that changes within this part of 64 eps x size, even if the ray comes
# from far: the object's own rounding ...
MUST = 1.0 / 8.0
# ... and must not be if it stands beyond so many bands.
MUST_NOT = 4.0
# Rays this near to a singular set (bands), or crossings this flat, may need the mark.
NEAR_BANDS = 1e3
FLAT = 1e-6
# Flatter than this not the angle says how far a band moves a crossing, but how the surface bends.
BENDS = math.sqrt(2.0 * BAND)
# The point of a row that says TANGENT lies within so many bands of its ray, and so many roundings of
# the coordinates of its origin: far from 0 these are more.
MOST_GAP, MOST_ROUNDINGS = 3.0, 16.0

WRONG = ("missed", "phantom", "farther", "nearer", "wrong object", "departure")


@dataclass
class BatchVerdict:
    """Results of one batch, or of a sum of batches.

    ``wrong``: rows without TANGENT whose first hit is wrong, outside the band, by kind: a miss where there
    is a hit, a hit where there is none, one behind the first crossing, one in front of it, the right t on
    another object, and "departure" for rays that hit the point that they leave.
    ``wrong_tangent``: the same for rows with TANGENT.
    ``bounds_broken``: hits with |t - exact t| > t_bound, exact t being the nearest exact crossing. Of rows
    that say TANGENT, or that only the band makes right, only crossings with the patch that they name count,
    and only if one ahead is within 64 eps x scale / cos: the exact ray may pass by.
    ``off_ray``: HIT rows whose S(u, v) is farther than 64 eps x scale from o + t d.
    ``off_ray_tangent``: hits that say TANGENT and are farther than three times that, and 16 eps x (distance
    from 0).
    ``unmarked``: rows without TANGENT whose decision is another than the exact ray's (within the band), or
    changes when the ray is moved by 8 eps x size.
    ``tangent``, ``tangent_needlessly``: rows with TANGENT; those whose decision stands when the ray is
    moved by four bands.
    ``left_open``: rays that could not be decided.
    ``asked``: rays that a screen did not confirm: exact arithmetic judged these.
    ``passed_over``: rows with TANGENT that neither confirmed nor judged.
    ``seconds``: of whoever adds up.
    ``worst_error``: largest |t - exact t| |d| cos / (eps x scale) of HIT rows, but for those that only the
    band makes right.
    ``worst_bound``: largest |t - exact t| / t_bound of hits, as above.
    ``worst_gap``: largest distance of S(u, v) from o + t d, over 64 eps x scale; of rows that say TANGENT
    over what is allowed for these.
    ``examples``: the first rows of each fault.
    """

    rays: int = 0
    hits: int = 0
    wrong: dict[str, int] = field(default_factory=lambda: dict.fromkeys(WRONG, 0))
    wrong_tangent: int = 0
    bounds_broken: int = 0
    off_ray: int = 0
    off_ray_tangent: int = 0
    unmarked: int = 0
    tangent: int = 0
    tangent_needlessly: int = 0
    left_open: int = 0
    asked: int = 0
    passed_over: int = 0
    seconds: float = 0.0
    worst_error: float = 0.0
    worst_bound: float = 0.0
    worst_gap: float = 0.0
    examples: dict[str, list[int]] = field(default_factory=dict)

    @property
    def n_wrong(self) -> int:
        """Number of wrong first hits of all kinds, but for rows with TANGENT."""
        return sum(self.wrong.values())

    @property
    def faults(self) -> int:
        """Number of faults: wrong hits, bounds, points, needless and missing TANGENT.

        Wrong hits that say TANGENT are none: no decision of these rows is guaranteed.
        """
        return (
            self.n_wrong + self.bounds_broken + self.off_ray + self.off_ray_tangent
            + self.unmarked + self.tangent_needlessly
        )  # fmt: skip

    def __add__(self, other: BatchVerdict) -> BatchVerdict:
        """Judge two batches as one; ``examples`` are those of the first that has any."""
        joined: dict[str, Any] = {}
        for item in fields(self):
            a, b = getattr(self, item.name), getattr(other, item.name)
            if item.name == "wrong":
                joined["wrong"] = {kind: a[kind] + b[kind] for kind in a}
            elif item.name == "examples":
                joined["examples"] = {**b, **a}
            else:
                joined[item.name] = max(a, b) if item.name.startswith("worst") else a + b
        return BatchVerdict(**joined)

    def note(self, fault: str, row: int) -> None:
        """Keep one of the first rows of a fault."""
        rows = self.examples.setdefault(fault, [])
        if len(rows) < 5:
            rows.append(row)


class ExactJudge:
    """Judges hits on a list of surfaces."""

    def __init__(self, surfaces: Sequence[Any]) -> None:
        self.scene = ExactScene(surfaces)
        self._gaps = [exact.gap() for exact in self.scene.exact]
        self._touches = [exact.touch() for exact in self.scene.exact]
        self._trims = Trims(surfaces)

    def judge(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        *,
        distance: FloatArray | None = None,
        leaves: IntArray | None = None,
        marks: bool = True,
    ) -> BatchVerdict:
        """Judge the first hits of rays.

        ``distance``: how near the rays come to a singular set, scene units; far ones are not asked whether
        they need the mark. Default: 0.
        ``leaves``: the objects that the rays leave from; -1 for none.
        ``marks``: whether to ask which rows need status TANGENT: that takes most of the time.
        """
        verdict = BatchVerdict(rays=len(hits), hits=int(hits.hit.sum()))
        near = np.zeros(len(hits)) if distance is None else distance
        for i in range(len(hits)):
            left = -1 if leaves is None else int(leaves[i])
            self._judge_row(
                verdict, i, hits, origins[i], directions[i], float(near[i]), left, marks
            )
        return verdict

    def _judge_row(
        self,
        verdict: BatchVerdict,
        i: int,
        hits: HitRecord,
        o: FloatArray,
        d: FloatArray,
        near: float,
        leaves: int,
        marks: bool,
    ) -> None:
        """Count in the verdict what is wrong with hit i of the ray from o along d.

        The last three arguments are those of `judge` for this row; ``leaves`` is -1 for none.
        """
        length = norm(d)
        is_tangent = bool(hits.status[i] == Status.TANGENT)
        verdict.tangent += int(is_tangent)
        crossings = self.scene.crossings(o, d)
        at_start = departures(crossings, leaves, o, length)
        is_one = len({one.t for one in at_start}) == 1
        if is_one:
            if hits.hit[i] and _meets_departure(hits, i, at_start[0], crossings, length):
                if departures(crossings, leaves, o, length, roundings=SURELY_ROUNDED):
                    self._note_wrong(verdict, "departure", hits, i)
                    return
                is_one = False  # it may be another crossing: either answer is right
            else:
                crossings = [one for one in crossings if one not in at_start]
        ahead = [one for one in crossings if one.t > 0.0]
        explained = self._is_explained(hits, i, ahead, length)
        is_plain = is_one or not at_start
        is_flat = any(one.crossing.cosine < BENDS for one in _firsts(ahead, length))
        found, fault, is_doubtful = None, None, False
        if not (is_plain and explained) or is_flat:
            found = answers_to(self.scene, o, d, leaves)
            fault, is_doubtful = found.fault(hits, i, self._gap(hits, i, o, d))
        if hits.hit[i]:
            # A row that only the band makes right may have no crossing there.
            passes = not explained and found is not None and fault is None
            self._measure(verdict, i, hits, o, d, crossings, length, is_near=is_tangent or passes)
        if found is not None:
            if found.undecided:
                verdict.left_open += 1
                verdict.note("left open", i)
                return
            if fault is not None:
                self._note_wrong(verdict, fault, hits, i)
                return
            # Where t itself is within rounding of 0, and at the end of a gap, no mark is promised.
            at_limit = any(
                abs(one.t) * length * max(one.cosine, LEAST_SLOPE) <= one.band
                or one.crossing.kind == EITHER
                for one in crossings
            )
            # What a flat crossing explains may not be certain: the rays around say so.
            is_doubtful &= explained and is_plain and not at_limit
            if not (is_tangent or explained) and is_plain:
                if not at_limit:
                    verdict.unmarked += 1
                    verdict.note("unmarked", i)
                    return
                marks = False
        if is_tangent:
            if not marks:
                return
            if self._stands(o, d, MUST_NOT, leaves) is True and not self._is_touched(o, d, leaves):
                verdict.tangent_needlessly += 1
                verdict.note("tangent needlessly", i)
            return
        asked = is_doubtful
        if marks:
            first = min((one.t for one in ahead), default=math.inf)
            asked |= near <= NEAR_BANDS * self._widest_narrow_band() or any(
                one.crossing.cosine < FLAT or one.crossing.kind != POINT
                for one in ahead
                if one.t <= first
            )
        if asked and self._stands(o, d, MUST, leaves, True) is False:
            verdict.unmarked += 1
            verdict.note("unmarked", i)

    def _is_touched(self, o: FloatArray, d: FloatArray, leaves: int) -> bool:
        """Tell whether the ray grazes some surface within a few bands."""
        unit = d / norm(d)
        return any(
            is_touched(o, unit, MUST_NOT * self.scene.band(k, o, d, 0.0), k == leaves)
            for k, is_touched in enumerate(self._touches)
        )

    @staticmethod
    def _note_wrong(verdict: BatchVerdict, kind: str, hits: HitRecord, i: int) -> None:
        if hits.status[i] == Status.TANGENT:
            verdict.wrong_tangent += 1
            verdict.note("wrong, TANGENT", i)
        else:
            verdict.wrong[kind] += 1
            verdict.note(kind, i)

    def _widest_narrow_band(self) -> float:
        """Return the largest of the bands 64 eps x size of the objects."""
        return max(self.scene.narrow_band(k) for k in range(len(self.scene.surfaces)))

    @staticmethod
    def _is_explained(hits: HitRecord, i: int, ahead: list[Placed], length: float) -> bool:
        """Tell whether a row names the first exact crossing, as far as its angle says."""
        if any(one.crossing.kind == OPEN for one in ahead):
            return False
        if not hits.hit[i]:
            return not ahead
        return any(
            abs(float(hits.t[i]) - one.t) <= _slack(one, length)
            for one in _firsts(ahead, length)
            if one.object_id == hits.object_id[i]
        )

    def _stands(
        self, o: FloatArray, d: FloatArray, bands: float, leaves: int, narrow: bool = False
    ) -> bool | None:
        """Tell whether the first hit stays when the ray is moved; None where that is open.

        Crossings that the move takes from before the origin to behind it, or back, do not count:
        t > 0 is no question of rounding.
        """
        length = norm(d)
        own, *rings = (
            self._without_start(crossings, leaves, o, length, bands)
            for crossings in (
                self.scene.crossings(o, d), *self.scene.around(o, d, bands, narrow)
            )
        )  # fmt: skip
        if own is None or any(one.crossing.kind in (OPEN, EITHER) for one in own):
            return None
        first = next((one for one in own if one.t > 0.0), None)
        if first is not None and first.crossing.kind != POINT:
            return False
        for ring in rings:
            if ring is None:
                return None
            same = [
                other
                for other in ring
                if first is not None and self._same(first, other, bands, narrow, length)
            ]
            if first is not None and not same:
                return False
            limit = min((other.t for other in same), default=math.inf)
            for other in ring:
                if not 0.0 < other.t < limit:
                    continue
                band = self.scene.narrow_band(other.object_id) if narrow else other.band
                if self._trims.comes_from_behind(other, o, d, bands * band):
                    continue
                if other.crossing.kind == OPEN:
                    return None
                if not any(self._same(one, other, bands, narrow, length) for one in own):
                    return False
        return True

    def _same(self, one: Placed, other: Placed, bands: float, narrow: bool, length: float) -> bool:
        band = self.scene.narrow_band(one.object_id) if narrow else one.band
        return same_place(one, other, bands * band, length)

    @staticmethod
    def _without_start(
        crossings: list[Placed], leaves: int, o: FloatArray, length: float, bands: float
    ) -> list[Placed] | None:
        """Return crossings but for the departure; None where it cannot be told from others."""
        at_start = departures(crossings, leaves, o, length, bands)
        if len({one.t for one in at_start}) > 1:
            return None
        return [one for one in crossings if one not in at_start]

    def _gap(self, hits: HitRecord, i: int, o: FloatArray, d: FloatArray) -> float:
        """Return the distance of S(u, v) from o + t d, in bands; inf for a miss, or outside of loops."""
        number, t = int(hits.object_id[i]), float(hits.t[i])
        patch, u, v = int(hits.patch_id[i]), float(hits.u[i]), float(hits.v[i])
        if not hits.hit[i] or not np.isfinite([t, u, v]).all():
            return math.inf
        band = self.scene.band(number, o, d, t)
        if self._trims.is_outside(number, patch, u, v, d, band):
            return math.inf
        point = [rational(x) + rational(t) * rational(y) for x, y in zip(o, d, strict=True)]
        return self._gaps[number](patch, u, v, point) / band

    def _measure(
        self,
        verdict: BatchVerdict,
        i: int,
        hits: HitRecord,
        o: FloatArray,
        d: FloatArray,
        crossings: list[Placed],
        length: float,
        is_near: bool,
    ) -> None:
        """Hold a hit's t against its bound, and its point against the ray.

        ``is_near``: whether only crossings with its own patch count, and only if one ahead is near by.
        """
        number, t = int(hits.object_id[i]), float(hits.t[i])
        points = POINT, EITHER
        own = [one for one in crossings if one.object_id == number and one.crossing.kind in points]
        if is_near:
            own = [one for one in own if one.crossing.patch_id == int(hits.patch_id[i])]
            # Next to one ahead the row may also mean one behind the origin.
            if not any(
                one.t > 0.0
                and abs(one.t - t) * length * max(one.crossing.cosine, LEAST_SLOPE) <= one.band
                for one in own
            ):
                own = []
        if own:
            exact = rational(t)
            with bits(512):
                gaps = [(float(abs(one.crossing.t - exact).upper()), one) for one in own]
            error, one = min(gaps, key=lambda gap: gap[0])
            bound = float(hits.t_bound[i])
            ratio = error / bound if bound > 0.0 else (math.inf if error > 0.0 else 0.0)
            verdict.worst_bound = max(verdict.worst_bound, ratio)
            if ratio > 1.0:
                verdict.bounds_broken += 1
                verdict.note("bound broken", i)
            if not is_near:
                unit = one.band * (EPS / BAND)
                cosine = one.crossing.cosine
                verdict.worst_error = max(verdict.worst_error, error * length * cosine / unit)
        is_tangent = bool(hits.status[i] == Status.TANGENT)
        gap = self._gap(hits, i, o, d)
        if is_tangent and math.isfinite(gap):
            band = self.scene.band(int(hits.object_id[i]), o, d, float(hits.t[i]))
            gap /= MOST_GAP + MOST_ROUNDINGS * EPS * float(np.abs(o).max()) / band
        verdict.worst_gap = max(verdict.worst_gap, gap)
        if gap <= 1.0:
            return
        if is_tangent:
            verdict.off_ray_tangent += 1
            verdict.note("off ray, TANGENT", i)
        else:
            verdict.off_ray += 1
            verdict.note("off ray", i)


def _slack(one: Placed, length: float) -> float:
    """Return how far the band moves a crossing, by its angle alone."""
    return one.band / (max(one.crossing.cosine, LEAST_COSINE) * length)


def _firsts(ahead: list[Placed], length: float) -> list[Placed]:
    """Return the first of some crossings in order of t, and those as near to it as its angle says."""
    return [one for one in ahead if one.t <= ahead[0].t + _slack(ahead[0], length)]


def _meets_departure(
    hits: HitRecord, i: int, own: Placed, crossings: list[Placed], length: float
) -> bool:
    """Tell whether a hit is the point of departure, and no other crossing."""
    if int(hits.object_id[i]) != own.object_id:
        return False
    t = float(hits.t[i])
    reach = departure_reach(own, length)
    return abs(t) <= reach and not any(
        abs(one.t - t) <= reach for one in crossings if one.t != own.t
    )
