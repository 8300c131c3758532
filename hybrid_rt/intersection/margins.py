"""Detection of decisions within rounding (status TANGENT), by tracing displaced rays.

The band is 64 eps x scale. A hit or miss is TANGENT if displacing the ray by the band changes it.
The search itself notes surfaces that pass within the band in front of the first hit. The other case
are hits that a displaced ray might lose: near a border, a crease, a pole, a silhouette. Those are
traced again by the same search, displaced by the band in several directions; so no adjacency is
needed. Few hits are near such places, so the cost is negligible.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, SUSPECT, WITHIN_BAND, Nearest, Rays
from hybrid_rt.intersection.kernels.search.tolerances import CLEAR_CROSSING
from hybrid_rt.intersection.kind import Finished, Kind, finished_part, new_nearest, new_record
from hybrid_rt.intersection.ray_batch import locked

Rows = NDArray[np.int64]

# A circle has this many directions. A border is crossed straight, and to both sides as far as it can
# be without running along it; elsewhere a few directions show most changes, and the rest is asked
# where they show none.
DIRECTIONS = 32
ACROSS = np.array([0, 4, 7, 25, 28])
SOME = np.arange(0, DIRECTIONS, 4)
REST = np.setdiff1d(np.arange(DIRECTIONS), SOME)
NONE = np.arange(0)
# A ray that moves by the band meets the same surface within band / |n.d| of before, were it flat;
# this allows for its bend, and for as much again where the slope changes on the way.
SAME = 2.0
# The same surface is met within this of before, whatever the slopes; wider bands leave nothing
# certain. Part of the frame.
WIDEST = 2.0**-10


class Aim(NamedTuple):
    """Where to displace rays whose hits are in doubt; k rows."""

    band: FloatArray  # (k,) float64: 64 eps x scale, world units
    outward: FloatArray  # (k, 3) float64: a unit normal of the ray; at a border, straight across it
    is_edge: BoolArray  # (k,) bool: there is one border nearby, and nothing else
    frame: FloatArray  # (k,) float64: size of all that shares its frame, world units


class Probes(NamedTuple):
    """Displaced rays, k rows, and where they come from."""

    rays: Rays  # where they were before
    aside: FloatArray  # (k, 3) float64: by what to displace them, world units
    before: Nearest  # what all rays of the slice have hit
    rows: Rows  # (k,) which of these they are


# Displaces rays, lowers what is nearest to them, and counts its work.
Search: TypeAlias = Callable[[Probes, Nearest, FloatArray], None]


@runtime_checkable
class Probing(Kind, Protocol):
    """A kind of surface that leaves some of its hits `SUSPECT`."""

    @property
    def searches(self) -> tuple[Search, ...]:
        """Its search; before it what may find the hit with less work, if there is such a thing."""

    def aim(self, rays: Rays, best: Nearest, out: Finished, rows: Rows) -> Aim:
        """Return where to displace the rays of some rows."""


def settle(
    kind: Probing,
    number: int,
    kind_of: IntArray,
    rays: Rays,
    best: Nearest,
    out: Finished,
    work: FloatArray,
) -> None:
    """Decide for the `SUSPECT` rows of a kind whether they are `WITHIN_BAND` or `CLEAR`.

    Their rays are displaced by the band, and traced and described again: do they still hit? All kinds
    have described their hits in ``out``; ``number`` is that of this kind in ``kind_of``.
    """
    rows: Rows = (best.tangent == SUSPECT).nonzero()[0]
    rows = rows[kind_of[best.object_id[rows]] == number]
    if not len(rows):
        return
    aim, here = kind.aim(rays, best, out, rows), _rows_of(rays, rows)
    t, t_bound, object_id = best.t[rows], best.t_bound[rows], best.object_id[rows]
    slope = _slopes(out.normal[rows], here)
    length = np.linalg.norm(here.direction, axis=1)
    grazes = slope < CLEAR_CROSSING * length
    across = np.cross(here.direction / length[:, None], aim.outward)
    widest = WIDEST * aim.frame
    stays, moved = aim.band <= widest, np.zeros(len(rows))

    def still_met(search: Search, k: Rows, aside: FloatArray) -> BoolArray:
        """Tell which rays, moved, meet the same surface as before; note how far t has moved."""
        if not len(k):
            return np.zeros(0, np.bool_)
        probes, band = _rows_of(here, k), aim.band[k]
        _widen(probes, band * np.maximum(1.0, 1.0 / length[k]))
        found, record = new_nearest(t[k] + 2.0 * widest[k] / length[k]), new_record(len(k))
        search(Probes(probes, aside, best, rows[k]), found, work)
        kind.finish(probes, found, kind_of, number, finished_part(record))
        with np.errstate(all="ignore"):  # normals of misses are nothing
            slack = SAME * band * (1.0 / slope[k] + 1.0 / _slopes(record.normal, probes))
            slack += 2.0 * (t_bound[k] + found.t_bound)
            gap = np.abs(found.t - t[k])
        same: BoolArray = (found.object_id == object_id[k]) & (gap * length[k] <= widest[k])
        same &= ~(gap > slack)
        np.maximum.at(moved, k[same], gap[same])
        return same

    *quick, complete = kind.searches
    for across_edges, elsewhere in ((ACROSS, SOME), (NONE, REST)):
        sets = [(np.flatnonzero(stays & aim.is_edge), across_edges)]
        sets.append((np.flatnonzero(stays & ~aim.is_edge), elsewhere))
        sets = [(some, turns) for some, turns in sets if len(some) and len(turns)]
        if not sets:
            break
        k = np.concatenate([np.repeat(some, len(turns)) for some, turns in sets])
        turn = np.concatenate([np.tile(turns, len(some)) for some, turns in sets])[:, None]
        turn = turn * (2.0 * np.pi / DIRECTIONS)
        aside = aim.band[k, None] * (np.cos(turn) * aim.outward[k] + np.sin(turn) * across[k])
        left = np.arange(len(k))
        for search in quick:
            left = left[~still_met(search, k[left], aside[left])]
        # Of rays that graze one that is lost is enough, mostly the first of those that are left.
        # Others are asked all the same: how far they move t counts.
        first = np.unique(k[left], return_index=True)[1]
        for some in (left[first], np.delete(left, first)):
            asked = some[stays[k[some]] | ~grazes[k[some]]]
            stays[k[asked[~still_met(complete, k[asked], aside[asked])]]] = False
    best.tangent[rows] = np.where(stays, CLEAR, WITHIN_BAND)
    # At a crease, a pole or a bend the slope of one piece does not say how far t is off; this does.
    best.t_bound[rows] = np.maximum(t_bound, moved)
    # The surface passes beside the ray, but goes on where it is met.
    with np.errstate(divide="ignore"):
        same_place = stays & (best.doubt[rows] >= t - 2.0 * (moved + t_bound + aim.band / slope))
    best.doubt[rows[same_place]] = np.inf


def _rows_of(rays: Rays, rows: Rows) -> Rays:
    """Return copies of some rows; what is empty stays empty."""
    some = Rays(*(x[rows] if len(x) else x for x in rays))
    return some._replace(origin=locked(some.origin))


def _slopes(normals: FloatArray, rays: Rays) -> FloatArray:
    return np.abs(np.einsum("ij,ij->i", normals, rays.direction))


def _widen(probes: Rays, more: FloatArray) -> None:
    """Let points that rays leave from and go to be known by rays that pass beside them."""
    if len(probes.known):
        for column in (1, 3):
            some = probes.known[:, column] >= 0.0
            probes.known[some, column] += more[some]
