"""The right answers to one ray, and the definition of a wrong first hit.

A crossing is certain if eight rays around, displaced by 1.3 bands, cross the surface there too; else
either answer is right. "There" means: no farther than the displacement accounts for at the angle of
either crossing, or of the displaced one where a normal is lost; then the displaced rays say how far t
goes. Crossings of displaced rays only are doubtful.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import groupby

from hybrid_rt.core.records import FloatArray, HitRecord, Status
from proof.exact.crossings import ALONG, OPEN, POINT, norm
from proof.exact.truth import (
    SURELY_ROUNDED,
    ExactScene,
    Placed,
    departure_reach,
    departures,
    same_place,
)
from proof.kernels.bands import BAND, LEAST_COSINE, SHIFT

CERTAIN, DOUBTFUL, UNDECIDED = range(3)


@dataclass(frozen=True)
class Root:
    """A crossing of a ray, or of one beside it.

    ``t``: in lengths of the given direction.
    ``cosine``: |n.d| / |d|.
    ``band``: 64 eps x scale, scene units.
    ``kind``: certain; doubtful, either decision is right; or left open.
    ``at_edge``: within the band of an edge of its patch.
    """

    t: float
    object_id: int
    patch_id: int
    cosine: float
    band: float
    kind: int
    at_edge: bool

    def slack(self, length: float) -> float:
        """Return how far the band moves it, in t."""
        return self.band / (max(self.cosine, LEAST_COSINE) * length)


@dataclass(frozen=True)
class Answers:
    """What is right to say of a ray.

    ``roots``: in order of t, within the limits.
    ``first``: the first certain one.
    ``undecided``: a crossing is left open.
    ``left``: object whose crossing at the origin, the point of departure, was left out; -1 for none.
    ``departure``: up to this t a hit on that object is the point of departure; -inf for none.
    ``length``: of the ray's direction.
    ``limits``: a hit needs a t between them.
    """

    roots: list[Root]
    first: Root | None
    undecided: bool
    left: int
    departure: float
    length: float
    limits: tuple[float, float]

    def fault(self, hits: HitRecord, i: int, gap: float) -> tuple[str | None, bool]:
        """Compare a first hit.

        A hit is right if it is the first certain crossing or a doubtful one before it, with t within
        64 eps x scale / cos of it; or if it lies ahead of the origin, before that crossing, at a
        point of the surface ((u, v) in its domain) within 64 eps x scale of the ray: either decision
        is right then. The point that the ray leaves is no such point. A miss is right if there is no
        certain crossing.

        ``gap``: distance of S(u, v), (u, v) in its domain, from o + t d, over 64 eps x scale.
        The first of both returned is "missed", "phantom", "farther", "nearer" or "wrong object"; None where it is
        right.
        The second tells whether it is right by a doubtful crossing, or by its point, without status
        TANGENT.
        """
        first, length = self.first, self.length
        if self.undecided:
            return None, False
        if not hits.hit[i]:
            return ("missed" if first is not None else None), False
        t, number = float(hits.t[i]), int(hits.object_id[i])
        end = math.inf if first is None else first.t + first.slack(length)
        within = self.limits[0] < t < self.limits[1]
        close = [r for r in self.roots if within and abs(t - r.t) <= r.slack(length)]
        certain = [r for r in close if r.kind == CERTAIN and first is not None and r.t <= first.t]
        # Roots at the same t, up to rounding, are one answer: whichever object holds it.
        allowed = [r for r in close if first is None or r.t <= first.t + r.slack(length)]
        is_again = number == self.left and t <= self.departure
        in_band = within and gap <= 1.0 and not t > end and not is_again
        if not (allowed or in_band):
            if first is None:
                return "phantom", False
            return ("farther" if t > first.t else "nearer"), False
        if not (in_band or any(r.object_id == number for r in allowed)):
            return "wrong object", False
        return None, not certain and bool(hits.status[i] != Status.TANGENT)


def answers_to(
    scene: ExactScene,
    origin: FloatArray,
    direction: FloatArray,
    leaves: int = -1,
    t_min: float = 0.0,
    t_max: float = math.inf,
) -> Answers:
    """Find all crossings of a ray, what is certain of them, and the first.

    ``leaves``: object that the ray leaves, -1 for none: the crossing at the origin is left out. Where there
    are several, up to rounding, all are doubtful.
    ``t_min``, ``t_max``: only crossings between them count; those at a limit, up to the band, are doubtful.
    """
    length = norm(direction)
    found, reach = _roots(scene, origin, direction, leaves, length)
    roots = []
    for root in _merged(found, length):
        slack = root.slack(length)
        kind = root.kind
        if kind != UNDECIDED:
            if not t_min - slack < root.t < t_max + slack:
                continue
            if min(abs(root.t - t_min), abs(root.t - t_max)) <= slack:
                kind = DOUBTFUL
        roots.append(replace(root, kind=kind))
    roots.sort(key=lambda root: (root.t, root.object_id))
    return Answers(
        roots,
        next((root for root in roots if root.kind == CERTAIN), None),
        any(root.kind == UNDECIDED for root in roots),
        leaves if reach > -math.inf else -1,
        reach,
        length,
        (t_min, t_max),
    )


def _roots(
    scene: ExactScene, origin: FloatArray, direction: FloatArray, leaves: int, length: float
) -> tuple[list[Root], float]:
    """Return the roots of one ray and of those around, and what was left out.

    That is up to which t a hit is the point of departure; -inf where it may be another crossing.
    """
    own = scene.crossings(origin, direction)
    rings = scene.around(origin, direction, SHIFT)
    at_start = departures(own, leaves, origin, length)
    reach = -math.inf
    if len({one.t for one in at_start}) == 1:
        if departures(own, leaves, origin, length, roundings=SURELY_ROUNDED):
            reach = departure_reach(at_start[0], length)
        own = [one for one in own if one not in at_start]
        at_start = []
        for k, ring in enumerate(rings):
            left = departures(ring, leaves, origin, length, SHIFT)
            rings[k] = [one for one in ring if one not in left]
    found = []
    for one in own:
        kind, cosine = CERTAIN, one.crossing.cosine
        if one.crossing.kind == OPEN and not _is_short(one, length):
            kind = UNDECIDED
        elif one.crossing.kind != POINT or one in at_start:
            kind = DOUBTFUL
        else:
            same = [_nearest(one, ring, length) for ring in rings]
            there = [t for t in same if t is not None]
            if len(there) < len(rings):
                kind = DOUBTFUL
            else:
                steep = (max(there) - min(there)) * length / one.band
                spread = 1.0 / math.hypot(1.0, steep)
                if one.crossing.to_edge <= SHIFT * one.band and cosine > 0.0:
                    # On which side of the edge it is met is open, and so is t, as far as both go.
                    cosine = min(cosine, spread)
                else:
                    # Where it bends, and where the normal is lost, the angle says too little.
                    cosine = max(cosine, spread)
        found.append(_root(one, kind, cosine))
    for ring in rings:
        for other in ring:
            if not any(
                one.object_id == other.object_id
                and (same_place(one, other, SHIFT * one.band, length) or one.crossing.kind == ALONG)
                for one in own
            ):
                found.append(_root(other, DOUBTFUL, other.crossing.cosine))
    return found, reach


def _root(one: Placed, kind: int, cosine: float) -> Root:
    if kind == DOUBTFUL:
        # Where it touches curvature ends the contact: the root of the band, relative to the scale.
        cosine = max(cosine, math.sqrt(2.0 * BAND))
    at_edge = one.crossing.to_edge <= SHIFT * one.band
    return Root(one.t, one.object_id, one.crossing.patch_id, cosine, one.band, kind, at_edge)


def _nearest(one: Placed, ring: list[Placed], length: float) -> float | None:
    """Return where another ray has the same crossing; None if it has not."""
    same = [
        other.t
        for other in ring
        if one.object_id == other.object_id
        and other.crossing.kind == POINT
        and same_place(one, other, SHIFT * one.band, length)
    ]
    return min(same, key=lambda t: abs(t - one.t), default=None)


def _is_short(one: Placed, length: float) -> bool:
    """Tell whether what was left open is within what a touch within the band leaves open."""
    end = one.crossing.t_end
    assert end is not None
    return (float(end) - one.t) * length <= math.sqrt(one.band * one.band / BAND)


def _merged(found: list[Root], length: float) -> list[Root]:
    """Keep one of the roots that neighbouring patches have at a shared edge."""
    kept = [root for root in found if not root.at_edge]
    at_edge = sorted((r for r in found if r.at_edge), key=lambda r: (r.object_id, r.t))
    for _, roots in groupby(at_edge, key=lambda r: r.object_id):
        group: list[Root] = []
        for root in roots:
            # All of a group are as near to its first: what lies between does not join two edges.
            is_near = all(
                root.t - one.t <= 2.0 * max(one.slack(length), root.slack(length))
                for one in (group[:1] + group[-1:])
            )
            if group and not is_near:
                kept.append(_most_certain(group))
                group = []
            group.append(root)
        kept.append(_most_certain(group))
    return kept


def _most_certain(group: list[Root]) -> Root:
    """Return the root that is most certain, then the nearest, then that of the first patch."""
    return min(group, key=lambda root: (root.kind, root.t, root.patch_id))
