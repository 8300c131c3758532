"""All faults of a scene, as a report has them."""

from dataclasses import dataclass

import numpy as np

from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.scene.lint.in_one_plane import surfaces_in_one_plane
from hybrid_rt.scene.lint.lamps_in_bodies import LampInBody, lamps_in_bodies
from hybrid_rt.scene.lint.lamps_turned_away import lamps_turned_away
from hybrid_rt.scene.lint.overlapping import overlapping_bodies
from hybrid_rt.sensor.camera import Camera

# Radians of fields of view that are in use. A telescope may have as many degrees, but what it is pointed
# at is about as large as its picture.
LEAST, MOST = 0.2, 2.5
# An object that is less than so many pictures high, where it stands, may be what is looked at.
FITS = 3.0


@dataclass(frozen=True)
class Faults:
    """The faults of a scene: names of lamps, objects and bodies, or pairs of them.

    ``narrow_view`` is the field of view in degrees, if no object fits into it as if radians had been
    meant. Each is explained in the module, or at the function, of its name.
    """

    lamps_turned_away: list[str]
    pictures_turned_away: list[str]
    lamps_in_bodies: list[LampInBody]
    surfaces_in_one_plane: list[list[str]]
    clear_bodies_overlap: list[list[str]]
    pictures_on_meshes: list[str]
    narrow_view: float | None


def faults_of(scene: CompiledScene, tracer: Intersector) -> Faults:
    """Return the faults of a scene whose lamps are lifted out of the surfaces in which they lie."""
    return Faults(
        *lamps_turned_away(scene),
        lamps_in_bodies(scene),
        surfaces_in_one_plane(scene),
        overlapping_bodies(scene, tracer),
        pictures_on_meshes(scene),
        narrow_view(scene),
    )


def pictures_on_meshes(scene: CompiledScene) -> list[str]:
    """Return the names of meshes of which each face shows the whole texture.

    They are coloured by (u, v), which is barycentric in each face, and have no texture coordinates: a
    picture that was meant to cover them once is put onto every triangle.
    """
    return [
        scene.called[i]
        for i, surface in enumerate(scene.surfaces)
        if isinstance(surface, TriangleMesh)
        and len(surface) > 1
        and surface.texture_coordinates is None
        and scene.colored_by_uv[i]
    ]


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
