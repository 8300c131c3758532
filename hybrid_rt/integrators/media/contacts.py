"""Dielectrics that touch: a ray crosses two coincident faces at once, with no air between.

A first hit reports one of two coincident faces. If it belongs to a dielectric, the other face is
found here, so that the ray changes from the medium before both to the medium behind both. If the
other surface is opaque, the ray is scattered by that surface, from within the dielectric.
"""

from __future__ import annotations

import copy
from dataclasses import fields

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.coincident import coincident_hits
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.touching import touching

NO_SECOND = np.zeros(0, dtype=np.int32)


def first_hits(
    tracer: Intersector,
    contacts: Contacts | None,
    origins: FloatArray,
    directions: FloatArray,
    source: HitRecord | NamedPoints | None,
) -> tuple[HitRecord, IntArray]:
    """Return first hits and their second faces.

    ``origins``, ``directions`` (n, 3).
    ``contacts``: None if no dielectric touches another surface: there are no second faces.
    ``source``, HitRecord or NamedPoints of n rows, or None: surface points that the rays leave.
    Returns ``hits`` HitRecord of n rows.
    ``second`` (n,) int32, or (0,): see `Contacts.at`.
    """
    hits: HitRecord = tracer.intersect(origins, directions, source=source)
    if contacts is None:
        return hits, NO_SECOND
    return hits, contacts.at(hits, origins, directions, source)


class Contacts:
    """Finds the second one of two coincident faces."""

    def __init__(self, scene: CompiledScene, tracer: Intersector) -> None:
        self._scene, self._tracer = scene, tracer
        self._touches = touching(scene)

    def with_tracer(self, tracer: Intersector) -> Contacts:
        """Return the same with another tracer of these surfaces."""
        own = copy.copy(self)
        own._tracer = tracer
        return own

    def at(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        source: HitRecord | NamedPoints | None,
    ) -> IntArray:
        """Return the second face of each hit, (n,) int32: see `hybrid_rt.shading.kernels.medium_stack`.

        ``origins``, ``directions`` (n, 3).
        ``hits``, HitRecord of n rows, changed: a hit on a dielectric that lies on an opaque surface
        becomes a hit on the latter.
        ``source``, HitRecord or NamedPoints of n rows, or None: surface points that the rays leave.
        """
        second = np.zeros(len(hits), dtype=np.int32)
        rows = np.flatnonzero(hits.hit & self._touches[hits.object_id])
        if rows.size == 0:
            return second
        named = None
        if source is not None:
            named = NamedPoints(source.object_id[rows], source.position[rows])
        found = coincident_hits(self._tracer, origins[rows], directions[rows], hits[rows], named)
        met = found.hit
        rows, found = rows[met], found[met]
        glass = self._glass(found)
        is_clear = glass != NOTHING
        second[rows[is_clear]] = np.where(found.front_face, glass + 1, -glass - 1)[is_clear]
        for column in fields(HitRecord):
            getattr(hits, column.name)[rows[~is_clear]] = getattr(found, column.name)[~is_clear]
        return second

    def _glass(self, hits: HitRecord) -> IntArray:
        material = self._scene.material_of[hits.object_id]
        return np.where(
            material == NOTHING, np.int32(NOTHING), self._scene.glass_of[material]
        ).astype(np.int32)
