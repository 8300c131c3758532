"""Fields of view in radians: a few degrees, in which no object would fit."""

from __future__ import annotations

import numpy as np

from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.sensor.camera import Camera

# Radians of fields of view that are in use. A telescope may have as many degrees, but what it is pointed
# at is about as large as its picture.
LEAST, MOST = 0.2, 2.5
# An object that is less than so many pictures high, where it stands, may be what is looked at.
FITS = 3.0


def narrow_view(scene: CompiledScene) -> float | None:
    """Return the field of view in degrees if it may have been meant in radians; else None."""
    camera = scene.camera
    if not (isinstance(camera, Camera) and LEAST <= camera.vertical_fov <= MOST):
        return None
    objects = [surface for surface in scene.surfaces[: len(scene.called)] if surface.is_bounded]
    if not objects:
        return None
    bounds = np.array([surface.bounds for surface in objects])
    away = np.linalg.norm(bounds.mean(axis=1) - camera.look_from, axis=1)
    fits = np.ptp(bounds, axis=1).max(axis=1) < FITS * camera.pixel_size * camera.height * away
    return None if fits.any() else camera.vertical_fov
