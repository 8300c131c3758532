"""All crossings of rays with surfaces, one after the other."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core.hit_table import to_csv, to_dataframe
from hybrid_rt.core.records import HitRecord
from hybrid_rt.intersection.ray_batch import as_limit, as_rays

# A ray meets a polynomial surface of degree 30 x 30 at most 1800 times; meshes may have more.
MOST_CROSSINGS = 1_000_000


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
    intersect: Callable[..., HitRecord],
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike,
    t_max: ArrayLike,
) -> Crossings:
    """Find all crossings by stepping from hit to hit; each hit is the ``source`` of the next step.

    So a point that patches share (an edge, a seam, a pole, a mesh edge) is one crossing. So are
    coincident points of different objects; the lower ``object_id`` is reported. A ray that is
    tangent to a surface without crossing it has one row there.

    Parameters
    ----------
    intersect : callable
        `Intersector.intersect`, or what takes and returns the same.
    origins, directions, t_min, t_max : array-like
        As `Intersector.intersect` takes them.

    Returns
    -------
    Crossings

    Raises
    ------
    ValueError
        For shapes that do not fit.
    RuntimeError
        For a ray with more than `MOST_CROSSINGS` crossings.
    """
    o, d, shape = as_rays(origins, directions)
    lowest, highest = as_limit(t_min, "t_min", shape), as_limit(t_max, "t_max", shape)
    n = len(o)
    active, source = np.arange(n), None
    parts: list[HitRecord] = []
    rays: list[NDArray[np.int64]] = []
    for _ in range(MOST_CROSSINGS):
        hits = intersect(o[active], d[active], t_min=lowest, t_max=highest[active], source=source)
        found = hits.hit
        source, active = hits[found], active[found]
        parts.append(source)
        rays.append(active)
        if not len(active):
            break
        lowest = source.t
    else:
        raise RuntimeError(
            f"ray {active[0]} has more than {MOST_CROSSINGS} crossings: pass t_max, or fewer surfaces"
        )
    ray = np.concatenate(rays).astype(np.int64)
    # Stable: the steps of one ray stay in their order, which is that of t.
    order = np.argsort(ray, kind="stable")
    columns: dict[str, Any] = {
        item.name: np.concatenate([getattr(part, item.name) for part in parts])[order]
        for item in fields(HitRecord)
    }
    offsets = np.searchsorted(ray[order], np.arange(n + 1)).astype(np.int64)
    return Crossings(HitRecord(**columns), ray[order], offsets)
