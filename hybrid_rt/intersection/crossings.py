"""All crossings of rays with surfaces, one after the other."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.hit_table import to_csv, to_dataframe
from hybrid_rt.core.records import BoolArray, Flag, FloatArray, HitRecord, Status
from hybrid_rt.intersection.ray_batch import POINT_ROUNDING, as_limit, as_rays

# A ray meets a polynomial surface of degree 30 x 30 at most 1800 times; meshes may have more.
MOST_CROSSINGS = 1_000_000
# Crossings of adjoining pieces are one up to so many roundings of their coordinates, if their bounds
# allow that. Farther apart they are the ends of a wall that the ray runs in.
SAME = 64.0
# Normals of faces that touch are opposite up to 1e-6; those at a folded edge are not.
BACK_TO_BACK = -1.0 + 2.0**-40


@dataclass(frozen=True)
class Crossings:
    """All crossings of n rays, sorted by ray, then by t.

    Attributes
    ----------
    hits : HitRecord of m rows
    ray : (m,) int64
        Index of the ray of each row.
    offsets : (n + 1,) int64
        Ray i has the rows from ``offsets[i]`` up to, but not including, ``offsets[i + 1]``.
    """

    hits: HitRecord
    ray: NDArray[np.int64]
    offsets: NDArray[np.int64]

    def __len__(self) -> int:
        """Return the number of crossings."""
        return len(self.hits)

    def __repr__(self) -> str:
        """Count rays and crossings."""
        most = int(self.count.max(initial=0))
        return f"Crossings({len(self):,} of {self.count.size:,} rays, at most {most} of one)"

    @property
    def count(self) -> NDArray[np.int64]:
        """(n,) int64: how many crossings each ray has."""
        return np.diff(self.offsets)

    def of(self, ray: int) -> HitRecord:
        """Return the crossings of one ray, in the order of t.

        Raises
        ------
        IndexError
            If there is no such ray.
        """
        if not 0 <= ray < len(self.offsets) - 1:
            raise IndexError(f"ray is {ray}: pass 0 to {len(self.offsets) - 2}")
        return self.hits[self.offsets[ray] : self.offsets[ray + 1]]

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame of m rows: ``ray``, then the columns of `HitRecord.to_dataframe`.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        return to_dataframe(self._columns(), "Crossings.to_dataframe")

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the columns of `to_dataframe` as `HitRecord.to_csv` does; rays that miss have no row.

        Raises
        ------
        TypeError, OSError
            If ``path`` is not a path, or cannot be written.
        """
        to_csv(self._columns(), path, "Crossings.to_csv path")

    def _columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of a table, each (m,), in order."""
        return {"ray": self.ray, **self.hits.columns()}


def find_crossings(
    step: Callable[[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray | None], HitRecord],
    reach: FloatArray,
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
) -> Crossings:
    """Find all crossings by stepping from hit to hit.

    A root is the crossing before it, met again, if the bounds of both allow them the same t and the
    surface is crossed the same way: so it is where patches share a point (an edge, a seam, a pole) and
    at mesh edges. So are points where different objects coincide; the lower ``object_id`` is reported. But
    faces are not where one is crossed from in front and one from behind, if they are within the gap of an edge,
    or back to back, as those of bodies that touch.
    Rounding may have moved patches of one object apart that were meant to share a border: what is
    crossed twice the same way, so near that coordinates round by more, is one crossing, of status
    TANGENT. A ray that is tangent to a surface without crossing it may have one row there.

    ``step``: takes origins, directions, t_min, t_max, and t and object of the crossing behind which
    each search goes on, (n, 2) (None: of none). Returns the first hits.
    ``reach`` (objects,): the ``rounding_reach`` of each surface.
    ``origins``, ``directions``, ``t_min``, ``t_max``, array-like: as `Intersector.intersect` takes
    them.
    Raises ValueError for shapes that do not fit.
    Raises RuntimeError for a ray with more than `MOST_CROSSINGS` crossings.
    """
    o, d, shape = as_rays(origins, directions)
    lowest, highest = as_limit(t_min, "t_min", shape), as_limit(t_max, "t_max", shape)
    n = len(o)
    highest = np.broadcast_to(highest, n)
    active, last = np.arange(n), None
    parts: list[HitRecord] = []
    rays: list[NDArray[np.int64]] = []
    # Of each ray the row of its last crossing; and the rows that hold more than one.
    row_of, n_rows, merged = np.full(n, -1), 0, [np.zeros(0, np.int64)]
    for _ in range(MOST_CROSSINGS):
        passed = None if last is None else np.column_stack([last.t, last.object_id])
        hits = step(o[active], d[active], lowest, highest[active], passed)
        found = hits.hit
        again = np.zeros(len(hits), np.bool_)
        if last is not None:
            again, is_open = _met_again(last, hits, d[active], reach)
            merged.append(row_of[active[again & is_open]])
        new = found & ~again
        parts.append(hits[new])
        rays.append(active[new])
        row_of[active[new]] = n_rows + np.arange(len(parts[-1]))
        n_rows += len(parts[-1])
        last, active = hits[found], active[found]
        if not len(active):
            break
        lowest = np.nextafter(last.t, -np.inf)  # at the same t there may be other objects
    else:
        raise RuntimeError(
            f"ray {active[0]} has more than {MOST_CROSSINGS} crossings: pass t_max, or fewer surfaces"
        )
    ray = np.concatenate(rays).astype(np.int64)
    # Stable: the steps of one ray stay in their order, which is that of t.
    order = np.argsort(ray, kind="stable")
    columns: dict[str, Any] = {
        item.name: np.concatenate([getattr(part, item.name) for part in parts])
        for item in fields(HitRecord)
    }
    columns["status"][np.concatenate(merged)] = Status.TANGENT
    offsets = np.searchsorted(ray[order], np.arange(n + 1)).astype(np.int64)
    hits = HitRecord(**{name: column[order] for name, column in columns.items()})
    return Crossings(hits, ray[order], offsets)


def _met_again(
    last: HitRecord, hits: HitRecord, directions: FloatArray, reach: FloatArray
) -> tuple[BoolArray, BoolArray]:
    """Tell which hits are the crossings before them, and for which of these rounding leaves that open.

    A crossing that leaves a surface is another one than that which entered it, however near. But two
    pieces whose normals oppose each other may be one sheet, whose pieces have opposite orientations.
    """
    before, after = _slopes(last, directions), _slopes(hits, directions)
    step = hits.t - last.t
    across = step * np.maximum(np.abs(before), np.abs(after))
    # The bounds of both allow them the same t; of unproven hits nothing is known.
    meets = np.isfinite(hits.t_bound) & (step <= hits.t_bound + last.t_bound)
    rounding = _rounding(last, reach)
    is_near, is_far = across <= rounding, across > SAME * rounding
    is_same = (hits.object_id == last.object_id) & (hits.instance_id == last.instance_id)
    is_piece = is_same & (hits.patch_id == last.patch_id)
    goes_on = before * after > 0.0
    # Two faces of an edge, one met from in front and one from behind, are two crossings: their bounds, which
    # hold the gap, say nothing about that.
    is_edge = ((last.flags | hits.flags) & Flag.EDGE) != 0
    cosine = np.einsum("ij,ij->i", last.normal, hits.normal)
    turns = is_same & ~is_piece & ~goes_on & (cosine < 0.0) & is_near & ~is_edge
    # One body is left where another begins.
    is_apart = is_edge | (cosine < BACK_TO_BACK)
    borders = is_same & ~is_piece & goes_on & (is_near | (meets & ~is_far))
    is_one = (~is_same & (goes_on | ~is_apart)) | (is_piece & goes_on)
    again = hits.hit & ((meets & is_one) | borders | turns)
    return again, turns | (is_same & (is_far | ~meets))


def _slopes(hits: HitRecord, directions: FloatArray) -> FloatArray:
    """Return the directions' parts along the normals; nan for misses."""
    return np.einsum("ij,ij->i", hits.normal, directions)


def _rounding(hits: HitRecord, reach: FloatArray) -> FloatArray:
    """Return how far rounding of the coordinates moves points of hits, scene units."""
    size: FloatArray = np.maximum(
        np.abs(hits.position).max(axis=1, initial=0.0), reach[hits.object_id]
    )
    return POINT_ROUNDING * size
