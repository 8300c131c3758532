"""Coincident faces of different objects: a hit reports one of them, this finds the other."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, NamedPoints
from hybrid_rt.intersection.intersector import Intersector

# Two faces coincide where their hits differ by no more than the bounds of both, and by what
# rounding has made of faces that were meant to coincide: a few ulp of their coordinates.
FACE_ROUNDING = 16 * 2.0**-52


def coincident_hits(
    tracer: Intersector,
    origins: FloatArray,
    directions: FloatArray,
    hits: HitRecord,
    source: NamedPoints | None = None,
) -> HitRecord:
    """Return hits at the same points on other objects; misses where there is no other.

    ``origins``, ``directions`` (n, 3).
    ``hits``, HitRecord of n rows: all of them hits, of these rays.
    ``source``, NamedPoints of n rows: surface points that the rays leave.
    """
    size = np.maximum(np.abs(origins), np.abs(hits.position)).max(axis=1, initial=0.0)
    slope = np.abs(np.einsum("ij,ij->i", directions, hits.normal))
    # Of triangles alone nothing is proven: their bounds are infinite.
    bound = np.where(np.isfinite(hits.t_bound), hits.t_bound, 0.0)
    width = FACE_ROUNDING * size / np.maximum(slope, 1e-300) + 2.0 * bound
    found = tracer.intersect(
        origins,
        directions,
        t_min=np.maximum(hits.t - width, 0.0),
        t_max=hits.t + width,
        source=source,
        unseen=hits.object_id,
    )
    # Triangles alone (accuracy "mesh") cannot leave an object out.
    found.object_id[found.object_id == hits.object_id] = -1
    return found
