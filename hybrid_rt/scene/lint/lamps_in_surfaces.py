"""Area lights that coincide with a surface: found before a render, and offset to their lit side.

Where a light coincides with a surface, rounding would decide which of the two each ray hits, while
next-event estimation takes the light to be visible: each integrator would mix the two differently.
So the light counts as lying in front of the surface, on the side to which it emits. It is moved
there by a tiny offset; after that nothing coincides, and no special case is left.
"""

import logging
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.coincident import FACE_ROUNDING
from hybrid_rt.lights import RectangleLight
from hybrid_rt.scene.compiled import NOTHING, CompiledScene, compile_scene
from hybrid_rt.scene.lamp_points import points_of_lamps, size_by_camera
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA

LOG = logging.getLogger(__name__)

# A lamp is moved by this much of the largest coordinate of its corners and of the camera: rounding
# no longer decides for rays of up to 2**16 times that length, and no float32 pixel shows it.
LIFT = 2.0**-32
# Each of them settles what lies in a surface; further ones part lamps that lie in each other.
MOST_LIFTS = 4
# Lamps coincide where they run alike: a wall that a lamp passes through does not count.
ALIKE = 0.999
# A body stands with so many faces on others at most.
MOST_FACES = 3


@dataclass(frozen=True)
class Sunken:
    """A light that coincides with another surface."""

    light: int  # its row in the light table
    lamp: str  # its name
    surface: str  # that of the other surface
    partner: int  # row in the light table of the other surface; `NOTHING` if that is not a light
    share: float  # about the part of the light's area that coincides
    way: FloatArray | None  # (3,), where to move it; None: nowhere


@dataclass(frozen=True)
class LampInSurface:
    """A lamp that coincides with a surface, for the report."""

    lamp: str
    surface: str
    share: float  # of the lamp's area, the part that lies in the surface
    lifted_by: float = (
        0.0  # offset by which the lamp was moved, scene units; 0: it could not be moved
    )


def with_lamps_lifted(
    scene: Scene, compiled: CompiledScene, build: Callable[[CompiledScene], Intersector]
) -> tuple[CompiledScene, Intersector, list[LampInSurface]]:
    """Offset all coincident lights; return the scene, its tracer, and a note for each of them.

    ``build`` makes the tracer over a compiled scene. A light that cannot be moved is logged as a warning as well.
    """
    tracer = build(compiled)
    notes: dict[int, LampInSurface] = {}  # by row in the light table, as names may be alike
    for _ in range(MOST_LIFTS):
        lights, objects, n_lifted = list(scene.lights), list(scene.objects), 0
        for lamp in sunken_lamps(compiled, tracer):
            if not _counts(lamp, notes):
                continue
            light, own = lamp.light, int(compiled.surface_of_light[lamp.light])
            first = LampInSurface(lamp.lamp, lamp.surface, lamp.share)
            note = notes.setdefault(light, first)
            is_object = light >= len(lights)
            if lamp.way is None or not (is_object or isinstance(lights[light], RectangleLight)):
                LOG.warning(lamp_in_words(note))
                continue
            surface = compiled.surfaces[own]
            height = LIFT * max(size_by_camera(compiled), float(np.abs(surface.bounds).max()))
            notes[light] = replace(note, lifted_by=note.lifted_by + height)
            to_there = np.eye(4)
            to_there[:3, 3] = height * lamp.way
            image = surface.transformed(to_there)
            if is_object:
                item = objects[own]
                objects[own] = Object(image, item.material, item.name, item.smooth)
            else:
                strength = lights[light].row.strength
                lights[light] = RectangleLight(image.corner, image.edge_u, image.edge_v, strength)
            n_lifted += 1
        if n_lifted == 0:
            break
        scene = Scene(scene.camera, objects, lights, scene.environment)
        compiled = compile_scene(scene)
        tracer = build(compiled)
    return compiled, tracer, list(notes.values())


def lamp_in_words(note: LampInSurface) -> str:
    """Format a note of `with_lamps_lifted` as a sentence."""
    place = f"{note.lamp} lies in {note.surface}"
    if note.lifted_by > 0.0:
        return f"{place}: it counts as lying before it, and was moved there by {note.lifted_by:.1g}"
    if note.share < 0.995:
        place += f", with {100.0 * note.share:.2g} % of its area"
    return (
        f"{place}: which of the two is met there is not defined, and integrators differ: move it "
        "away from there, a millionth of its size is enough"
    )


def sunken_lamps(scene: CompiledScene, tracer: Intersector) -> list[Sunken]:
    """Return the lights that coincide with surfaces other than dielectrics.

    Points spread evenly over each light are tested, so an overlap of less than a hundredth of its
    area may be missed. Coincident dielectrics are handled by `hybrid_rt.integrators.media.contacts`.
    """
    if not scene.surfaces:
        return []
    of_light, place, direction = points_of_lamps(scene)
    if not of_light.size:
        return []
    # From beside each point back to it: t is 1 there.
    origin = place - direction
    size = np.maximum(np.abs(origin), np.abs(place)).max(axis=1)
    width = FACE_ROUNDING * size / np.linalg.norm(direction, axis=1)
    own_surface = scene.surface_of_light[of_light]
    own = tracer.with_own_counters()  # no work for the picture
    found = own.intersect(
        origin, direction, t_min=1.0 - width, t_max=1.0 + width, unseen=own_surface
    )
    cosine = np.einsum("ij,ij->i", found.normal, direction) / np.linalg.norm(direction, axis=1)
    is_point = np.isin(scene.lights.kind[of_light], WITHOUT_AREA)
    # Triangles alone (accuracy "mesh") cannot leave an object out.
    others = found.hit & (found.object_id != own_surface)
    glass_of = np.append(scene.glass_of, NOTHING)  # the last for what has no material
    is_clear = glass_of[scene.material_of[found.object_id]] != NOTHING
    rows = np.flatnonzero(others & ~is_clear & (is_point | (np.abs(cosine) > ALIKE)))
    sunken = []
    for light in np.unique(of_light[rows]).tolist():
        met = rows[of_light[rows] == light]
        other = int(found.object_id[met[0]])
        partner = int(scene.light_of[other])
        surface = int(scene.surface_of_light[light])
        first, end = np.searchsorted(of_light, [light, light + 1])
        sunken.append(
            Sunken(
                light=light,
                lamp=name_of(scene, surface, light),
                surface=name_of(scene, other, partner),
                partner=partner,
                share=met.size / int(end - first),
                way=None if surface < 0 else _way_out(-direction[first:end], -direction[met]),
            )
        )
    return sunken


def _counts(lamp: Sunken, notes: dict[int, LampInSurface]) -> bool:
    """Tell whether a lamp is to be lifted: of two lamps in each other, the first one is."""
    has_been_told = lamp.light in notes and notes[lamp.light].lifted_by == 0.0
    return not has_been_told and (lamp.partner == NOTHING or lamp.light < lamp.partner)


def _way_out(normals: FloatArray, sunken: FloatArray) -> FloatArray | None:
    """Return where a lamp with these normals, of any equal length, leaves what it lies in."""
    length = np.linalg.norm(normals[0])
    mean = normals.mean(axis=0) / length
    if np.linalg.norm(mean) > ALIKE:
        return np.asarray(mean)
    faces = np.unique(np.round(sunken / length, 3), axis=0)
    way: FloatArray = -faces.sum(axis=0)
    # Between two surfaces there is no way out, and of a curved one no single direction is.
    return way if len(faces) <= MOST_FACES and np.linalg.norm(way) > 0.5 else None


def name_of(scene: CompiledScene, surface: int, light: int) -> str:
    """Return what messages call a surface or, where it is no object, a light."""
    if 0 <= surface < len(scene.called):
        return scene.called[surface]
    return f"lights[{light}]"
