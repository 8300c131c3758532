"""Clear bodies that a camera or a lamp stands in."""

from __future__ import annotations

import numpy as np

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
        material = scene.material_of[hits.object_id[0]]
        lobe = NOTHING if material == NOTHING else int(scene.glass_of[material])
        if lobe != NOTHING:
            if hits.front_face[0]:
                entered.append(lobe)
            elif lobe in entered:
                entered.remove(lobe)
            else:
                around.append(lobe)
        origin, source = hits.position, hits
    return around[::-1][-STACK:]
