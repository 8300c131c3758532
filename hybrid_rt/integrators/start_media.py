"""Clear bodies that the camera stands in."""

from __future__ import annotations

import numpy as np

from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.kernels.media import STACK
from hybrid_rt.scene import NOTHING

# Surfaces that one ray is followed through.
MOST_CROSSINGS = 256


def media_at(context: RenderContext) -> list[int]:
    """Return the dielectric lobes around the camera, the outermost first.

    A ray from the camera to infinity leaves each closed body around it once more often than it
    enters it. Its direction is none of a scene's likely directions: a ray along an edge would
    count both faces.
    """
    scene, tracer = context.scene, context.tracer
    origin = scene.camera.look_from[None]
    direction = np.array([[0.5612, 0.6383, 0.5269]])
    entered: list[int] = []
    around: list[int] = []
    source = None
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
