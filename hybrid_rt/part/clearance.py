"""Clearance: how near two bodies come to each other, proven by the search that finds thin walls."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.distance import ClosestPoint
from hybrid_rt.part.cells import BORDER, FACE, Cells, Ints, Solid
from hybrid_rt.part.kernels.bounds import ANY, BOTH, FIRST
from hybrid_rt.part.pairs import Found, Heard, PairSearch
from meshing import TrimmedSurface


def least_clearance(
    one: list[TrimmedSurface], other: list[TrimmedSurface], tolerance: float, seconds: float,
    threads: int | None = None, heard: Heard = None,
) -> Found:  # fmt: skip
    """Find the least distance of two closed bodies; 0 if they touch, or one reaches into the other.

    Within two faces the shortest way is along both normals; from a border to a face along the face's; between
    borders any way may be the shortest.
    """
    bodies = [Solid(one), Solid(other)]
    size = max(body.size for body in bodies)
    nearest = [
        ClosestPoint(body, closed=np.ones(len(body), np.bool_), threads=threads)
        for body in (one, other)
    ]
    cells = Cells(bodies)
    roots = [cells.roots(0), cells.roots(1)]
    found = Found()

    def values(a: Ints, b: Ints, kind: Ints) -> tuple[FloatArray, FloatArray, Ints]:
        del kind
        value, place = np.full(len(a), np.inf), np.full((len(a), 2, 3), np.nan)
        faces = cells.ints[np.stack([a, b], axis=1), 1].copy()
        for number in (0, 1):
            rows = np.flatnonzero((cells.ints[a, 0] == number) & _is_real(cells, a))
            if not len(rows):
                continue
            near = nearest[1 - number].query(cells.middle[a[rows]])
            value[rows] = np.where((near.side < 0) & ~near.on_edge, 0.0, np.abs(near.distance))
            place[rows] = np.stack([cells.middle[a[rows]], near.position], axis=1)
            faces[rows, 1] = near.object_id
        return value, place, faces

    some = np.concatenate(roots)
    found.take(*values(some, some, some))
    search = PairSearch(cells, size, np.pi, sign=-1.0, threads=threads, heard=heard)
    kinds = [cells.ints[r, 3] for r in roots]
    (flat, rim), (flat_2, rim_2) = (
        (r[k == FACE], r[k == BORDER]) for r, k in zip(roots, kinds, strict=True)
    )
    whole = []
    for kind, first, second in (
        (BOTH, flat, flat_2), (FIRST, flat, rim_2), (FIRST, flat_2, rim), (ANY, rim, rim_2),
    ):  # fmt: skip
        a, b = search.near(first, second, found.value)
        whole.append((a, b, np.full(len(a), kind)))
    a, b, kind_of = (np.concatenate(x) for x in zip(*whole, strict=True))
    return search.least((a, b, kind_of), found, values, tolerance, seconds)


def _is_real(cells: Cells, some: Ints) -> FloatArray:
    real: FloatArray = (cells.ints[some, 3] == BORDER) | (cells.ints[some, 6] == 1)
    return real
