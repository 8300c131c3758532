"""Lamps that light nothing as they lie wholly inside of an opaque body.

Only bodies count that one surface encloses by itself: spheres, boxes and tori. What leaves such a
body crosses its surface, so light stays there; a room with the camera in it is no such body. Bodies of
several surfaces, and those of meshes, are not looked at, as they may be open.
"""

import itertools
from dataclasses import dataclass

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Box, Sphere
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.lint.lamps_in_surfaces import name_of
from hybrid_rt.shading.kernels.lobes.register import TRANSMITS

# Of the body's size: nearer to its surface rounding may decide.
SLACK = 1e-9
_CORNERS = np.array(list(itertools.product((0, 1), repeat=3)))


@dataclass(frozen=True)
class LampInBody:
    """The names of a lamp and of the first opaque body that it lies in."""

    lamp: str
    body: str


def lamps_in_bodies(scene: CompiledScene) -> list[LampInBody]:
    """Return the lamps inside of an opaque body without the camera in it: they change no picture."""
    is_clear = scene.materials_with(TRANSMITS)
    bodies = [
        i
        for i, surface in enumerate(scene.surfaces)
        if isinstance(surface, Sphere | Box | Torus) and not is_clear[scene.material_of[i]]
    ]
    if not bodies:
        return []
    low, high = scene.bounds[bodies].swapaxes(0, 1)
    camera = scene.camera
    extents = [_extent(scene, light) for light in range(scene.n_lights)]
    least, most = (
        np.array([(box[0], box[1]) for box, _ in extents]).reshape(-1, 2, 3).swapaxes(0, 1)
    )
    order = np.argsort(least[:, 0])
    first = np.searchsorted(least[order, 0], low[:, 0], side="right")
    end = np.searchsorted(least[order, 0], high[:, 0])
    found: dict[int, LampInBody] = {}
    for k in np.flatnonzero(first < end).tolist():
        rows, body = order[first[k] : end[k]], bodies[k]
        inside = ((low[k] < least[rows]) & (most[rows] < high[k])).all(axis=1)
        for light in rows[inside].tolist():
            own, surface = int(scene.surface_of_light[light]), scene.surfaces[body]
            slack = SLACK * float(np.abs(surface.bounds).max())
            (near, far), radius = extents[light]
            if (
                light not in found
                and body != own
                and _depth(surface, np.where(_CORNERS == 1, far, near), radius) > slack
                and _depth(surface, camera.look_from[None], 0.0) < -camera.reach - slack
            ):
                around_it = name_of(scene, body, int(scene.light_of[body]))
                found[light] = LampInBody(name_of(scene, own, light), around_it)
    return [found[light] for light in sorted(found)]


def _extent(scene: CompiledScene, light: int) -> tuple[FloatArray, float]:
    """Return a box (2, 3) and a radius: the lamp is in the convex hull of balls about the box's corners."""
    own = int(scene.surface_of_light[light])
    if own == NOTHING:
        return scene.lights.origin[[light, light]], 0.0
    surface = scene.surfaces[own]
    if isinstance(surface, Sphere):
        return np.stack([surface.center, surface.center]), surface.radius
    return scene.bounds[own], 0.0


def _depth(body: Sphere | Box | Torus, points: FloatArray, radius: float) -> float:
    """Return how deep in a body the hull of balls about points lies, at least; outside minus the distance."""
    if isinstance(body, Sphere):
        depth = body.radius - np.linalg.norm(points - body.center, axis=1)
    elif isinstance(body, Box):
        along = np.linalg.inv(body.edges)  # of each column: from 0 to 1 through the box
        share = (points - body.lo) @ along
        depth = (np.minimum(share, 1.0 - share) / np.linalg.norm(along, axis=0)).min(axis=1)
    else:
        # It is not convex: one ball around all.
        middle = points.mean(axis=0)
        radius += float(np.linalg.norm(points - middle, axis=1).max())
        away = middle - body.origin
        height = float(away @ body.axis)
        from_axis = float(np.linalg.norm(away - height * body.axis))
        depth = np.array([body.minor_radius - np.hypot(from_axis - body.major_radius, height)])
    return float(depth.min()) - radius
