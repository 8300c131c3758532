"""Clear bodies that a camera or a lamp stands in."""

from __future__ import annotations

import numpy as np

from hybrid_rt.integrators.contacts import Contacts
from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.kernels.media import STACK
from hybrid_rt.records import FloatArray, HitRecord, NamedPoints
from hybrid_rt.scene import NOTHING

# Surfaces that one ray is followed through.
MOST_CROSSINGS = 256


# None of a scene's likely directions: a ray along an edge would count both faces.
SKEW = np.array([[0.5612, 0.6383, 0.5269]])


def media_at(
    context: RenderContext,
    contacts: Contacts | None,
    origin: FloatArray,
    direction: FloatArray = SKEW,
    source: HitRecord | NamedPoints | None = None,
) -> list[int]:
    """Return the dielectric lobes around a point (1, 3), the outermost first.

    A ray from there to infinity leaves each closed body around it once more often than it
    enters it. ``source`` names the point where it lies on a surface.
    """
    scene, tracer = context.scene, context.tracer
    entered: list[int] = []
    around: list[int] = []
    for _ in range(MOST_CROSSINGS):
        hits = tracer.intersect(origin, direction, source=source)
        if not hits.hit[0]:
            break
        second = 0 if contacts is None else int(contacts.at(hits, origin, direction, source)[0])
        material = scene.material_of[hits.object_id[0]]
        lobe = NOTHING if material == NOTHING else int(scene.glass_of[material])
        passed = [(lobe, bool(hits.front_face[0]))] if lobe != NOTHING else []
        if second:
            passed.append((abs(second) - 1, second > 0))
        # What is entered comes first.
        for body, is_entered in sorted(passed, key=lambda item: not item[1]):
            if is_entered:
                entered.append(body)
            elif body in entered:
                entered.remove(body)
            else:
                around.append(body)
        origin, source = hits.position, hits
    return around[::-1][-STACK:]
