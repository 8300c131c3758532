"""Lamps that light nothing as they lie wholly inside of an opaque body.

Only bodies count that one surface encloses by itself: spheres, boxes and tori. What leaves such a
body crosses its surface, so light stays there; a room with the camera in it is no such body. Bodies of
several surfaces, and those of meshes, are not looked at, as they may be open.
"""

from __future__ import annotations

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
    low, high = np.stack([scene.surfaces[i].bounds for i in bodies], axis=1)
    camera = scene.camera
    found = []
    for light in range(scene.n_lights):
        own = int(scene.surface_of_light[light])
        points, radius = _extent(scene, own, light)
        if points is None:
            continue
        around = ((low < points.min(axis=0)) & (points.max(axis=0) < high)).all(axis=1)
        for body in (bodies[k] for k in np.flatnonzero(around)):
            surface = scene.surfaces[body]
            slack = SLACK * float(np.abs(surface.bounds).max())
            if (
                body != own
                and _depth(surface, points, radius) > slack
                and _depth(surface, camera.look_from[None], 0.0) < -camera.reach - slack
            ):
                around_it = name_of(scene, body, int(scene.light_of[body]))
                found.append(LampInBody(name_of(scene, own, light), around_it))
                break
    return found


def _extent(scene: CompiledScene, own: int, light: int) -> tuple[FloatArray | None, float]:
    """Return points and a radius: the lamp is in the convex hull of balls about the points."""
    if own == NOTHING:
        return scene.lights.origin[[light]], 0.0
    surface = scene.surfaces[own]
    if isinstance(surface, Sphere):
        return surface.center[None], surface.radius
    if not surface.is_bounded:
        return None, 0.0
    low, high = surface.bounds
    return np.where(_CORNERS == 1, high, low), 0.0


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
