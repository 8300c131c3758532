"""Compares a hit record with the oracle, and classifies the wrong rows."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, Status
from proof.judges.kernels.events import BAND, COVERED, DOUBTFUL, LEAST_COSINE
from proof.judges.oracle import Truth
from proof.judges.surface_judge import judge_of


@dataclass(frozen=True)
class Verdict:
    """Results of a comparison with the oracle.

    Attributes
    ----------
    rays : int
        Rays judged: all but the undecided ones.
    undecided, ambiguous : int
        Rays on which the oracle gave up; rays with more than one right answer.
    wrong : dict of int
        Number of rays by kind: a miss where there is a hit, a hit where there is none, a root
        behind the first one, something in front of it, the right t on another object.
    rows : dict of (k,) int64
        The same, as indices of rays.
    unmarked : int
        Rows that rest on a doubtful root without status TANGENT.
    tangent : int
        Rows with status TANGENT.
    tangent_needlessly : int
        Those of them for which the oracle finds the decision clear of the band.
    worst_band : float
        Largest |t - exact| cos / (64 eps x scale) among rows judged right.
    worst_bound : float
        Largest |t - exact| / t_bound among them where both name the same patch, beyond half an ulp
        of t: above 1, a bound is broken.
    worst_gap : float
        Largest distance of a hit's point on the surface from its point on the ray, over
        64 eps x scale; of rows that say TANGENT a third of that.
    small_cosines : int
        Rays whose first root has a cosine below 1e-3.
    """

    rays: int
    undecided: int
    ambiguous: int
    wrong: dict[str, int]
    rows: dict[str, NDArray[np.int64]] = field(repr=False)
    unmarked: int
    tangent: int
    tangent_needlessly: int
    worst_band: float
    worst_bound: float
    worst_gap: float
    small_cosines: int

    def __add__(self, other: Verdict) -> Verdict:
        """Judge two lots of rays as one; ``rows`` stay those of the first."""
        joined: dict[str, Any] = {}
        for item in fields(self):
            a, b = getattr(self, item.name), getattr(other, item.name)
            if item.name == "wrong":
                joined["wrong"] = {kind: a[kind] + b[kind] for kind in a}
            elif item.name == "rows":
                joined["rows"] = a
            else:
                joined[item.name] = max(a, b) if item.name.startswith("worst") else a + b
        return Verdict(**joined)

    @property
    def n_wrong(self) -> int:
        """Number of wrong rays of all kinds."""
        return sum(self.wrong.values())


def compare(hits: HitRecord, truth: Truth, gap: FloatArray | None = None) -> Verdict:
    """Compare first hits with the oracle's.

    A hit is right if it is the first certain root or a doubtful one before it, with t within
    64 eps x scale / cos of it; or if it lies ahead of the origin and within the limits, before that
    root, at a point of the surface (u, v in its domain) that is within 64 eps x scale of the ray:
    either decision is right then. The point that the ray leaves is no such point. A miss is right if
    there is no certain root.

    Parameters
    ----------
    hits : HitRecord of n rows
    truth : Truth of the same n rays
    gap : (n,) float64, optional
        Distance of S(u, v), (u, v) in its domain, from o + t d over 64 eps x scale; default: as
        float64 has it, which is not enough for surfaces far from 0.

    Raises
    ------
    ValueError
        If the two differ in length.
    """
    if len(hits) != len(truth):
        raise ValueError(f"{len(hits)} hits but truth for {len(truth)} rays: pass the same rays")
    roots, length = truth.roots, truth.length
    ray = roots.ray
    slack = roots.band / (np.maximum(roots.cosine, LEAST_COSINE) * length[ray])
    is_first = (roots.kind <= COVERED) & (roots.t <= truth.t[ray])
    # Roots at the same t, up to rounding, are one answer: whichever object holds it.
    reach = np.where(np.isfinite(truth.t[ray]), truth.t[ray] + slack, np.inf)
    allowed = (is_first | (roots.kind <= DOUBTFUL)) & (roots.t <= reach)
    with np.errstate(invalid="ignore"):
        apart = np.abs(hits.t[ray] - roots.t)
        within = hits.hit & (hits.t > truth.t_min) & (hits.t < truth.t_max)
    close = within[ray] & (apart <= slack)
    accepted = _any(allowed & close, ray, len(hits))
    right_object = _any(allowed & close & (roots.object_id == hits.object_id[ray]), ray, len(hits))
    certain = _any(is_first & close, ray, len(hits))
    gap_in_bands = _gap(hits, truth) if gap is None else gap
    first = truth.t + truth.band / (np.maximum(truth.cosine, LEAST_COSINE) * length)
    is_again = (hits.object_id == truth.left) & (hits.t <= truth.departure)
    in_band = within & (gap_in_bands <= 1.0) & ~(hits.t > first) & ~is_again
    accepted, right_object = accepted | in_band, right_object | in_band
    some = truth.object_id >= 0
    judged = ~truth.undecided
    with np.errstate(invalid="ignore"):
        behind = hits.t > truth.t
    rows = {
        "missed": judged & ~hits.hit & some,
        "phantom": judged & hits.hit & ~accepted & ~some,
        "farther": judged & hits.hit & ~accepted & some & behind,
        "nearer": judged & hits.hit & ~accepted & some & ~behind,
        "wrong object": judged & accepted & ~right_object,
    }
    tangent = hits.status == Status.TANGENT
    clear = judged & ~truth.ambiguous
    fine = certain & clear & truth.exact & (hits.object_id == truth.object_id)
    fine &= (hits.patch_id == truth.patch_id) & right_object
    error = np.abs(hits.t[fine] - truth.t[fine])
    in_bands = error * length[fine] * truth.cosine[fine] / truth.band[fine]
    excess = np.maximum(error - 0.5 * np.spacing(np.abs(hits.t[fine])), 0.0)
    bound = hits.t_bound[fine]
    ratio = np.divide(excess, bound, out=np.zeros_like(excess), where=excess > 0.0)
    return Verdict(
        rays=int(judged.sum()),
        undecided=int(truth.undecided.sum()),
        ambiguous=int((truth.ambiguous & judged).sum()),
        wrong={kind: int(mask.sum()) for kind, mask in rows.items()},
        rows={kind: np.flatnonzero(mask) for kind, mask in rows.items()},
        unmarked=int((judged & accepted & ~certain & ~tangent).sum()),
        tangent=int(tangent.sum()),
        tangent_needlessly=int((tangent & clear).sum()),
        worst_band=float(in_bands.max(initial=0.0)),
        worst_bound=float(ratio.max(initial=0.0)),
        worst_gap=float((gap_in_bands / np.where(tangent, 3.0, 1.0))[hits.hit].max(initial=0.0)),
        small_cosines=int((truth.cosine < 1e-3).sum()),
    )


def _gap(hits: HitRecord, truth: Truth) -> FloatArray:
    """Distance between point of the surface, in its domain, and of the ray, over 64 eps x scale."""
    gap = np.full(len(hits), np.inf)
    for i, surface in enumerate(truth.surfaces):
        rows = np.flatnonzero(hits.object_id == i)
        origins = truth.origins[rows]
        along = hits.t[rows, None] * truth.directions[rows]
        # What has no end is as large as the way to the hit.
        size = surface.size if surface.is_bounded else np.linalg.norm(along, axis=1)
        distance = judge_of(surface).gap(
            origins, along, hits.u[rows], hits.v[rows], hits.patch_id[rows]
        )
        scale = np.maximum(np.linalg.norm(origins - surface.middle, axis=1), size)
        gap[rows] = distance / (BAND * scale)
    return gap


def _any(mask: BoolArray, ray: NDArray[np.int64], n: int) -> BoolArray:
    found: BoolArray = np.bincount(ray[mask], minlength=n) > 0
    return found
