"""The media around camera and lights, and Beer-Lambert absorption along rays."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.media.contacts import Contacts, first_hits
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.medium_stack import STACK, cross_media, indices_within

# Surfaces that one ray is followed through.
MOST_CROSSINGS = 256
# None of a scene's likely directions, unit: a ray along an edge would count both faces.
SKEW = np.array([[0.5612, 0.6383, 0.5269]])
SKEW /= np.linalg.norm(SKEW)


def media_at(
    context: RenderContext,
    contacts: Contacts | None,
    origin: FloatArray,
    direction: FloatArray = SKEW,
    source: HitRecord | NamedPoints | None = None,
) -> list[int]:
    """Return the dielectrics that contain a point, the outermost first.

    A ray from the point to infinity leaves each of them once more often than it enters it.

    Parameters
    ----------
    context : RenderContext
    contacts : Contacts or None
        None if no dielectric touches another surface.
    origin, direction : (1, 3) float64
    source : HitRecord or NamedPoints of one row, optional
        The surface point, if the origin is one.
    """
    scene, tracer = context.scene, context.tracer
    entered: list[int] = []
    around: list[int] = []
    for _ in range(MOST_CROSSINGS):
        hits, faces = first_hits(tracer, contacts, origin, direction, source)
        if not hits.hit[0]:
            break
        second = int(faces[0]) if faces.size else 0
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


def media_around_camera(context: RenderContext, contacts: Contacts | None) -> IntArray:
    """Return the medium stack of camera rays, (STACK,); (0,) without dielectrics."""
    media: IntArray = _no_media(context, 1)[0]
    if media.size:
        around = media_at(context, contacts, context.scene.camera.look_from[None])
        media[: len(around)] = around
    return media


def media_around_lights(
    context: RenderContext, contacts: Contacts | None, lights: Iterable[int]
) -> IntArray:
    """Return the medium stacks around the lights; the last row is the environment's.

    Parameters
    ----------
    context : RenderContext
    contacts : Contacts or None
        None if no dielectric touches another surface.
    lights : iterable of int
        Rows of the light table to compute; the others are left as in vacuum.

    Returns
    -------
    (lights + 1, STACK) int32; (lights + 1, 0) if the scene has no dielectric.
    """
    scene = context.scene
    media = _no_media(context, scene.n_lights + 1)
    if not media.size:
        return media
    for light in lights:
        origin, direction = _leaving(scene, light)
        source = NamedPoints(scene.surface_of_light[[light]], origin)
        around = media_at(context, contacts, origin, direction, source)
        media[light, : len(around)] = around
    return media


def _leaving(scene: CompiledScene, light: int) -> tuple[FloatArray, FloatArray]:
    """Return a point of a light, and a direction from there to its shining side, both (1, 3)."""
    if light in scene.shining:
        point = scene.shining[light].one_point()
        return point.position, point.normal + 0.5 * SKEW
    if scene.surface_of_light[light] == NOTHING:
        return scene.lights.origin[[light]], SKEW
    surface = scene.surfaces[scene.surface_of_light[light]]
    return surface.point([0.5], [0.5]), surface.normal([0.5], [0.5]) + 0.5 * SKEW


def absorb(
    context: RenderContext,
    media: IntArray,
    material: IntArray,
    hits: HitRecord,
    second: IntArray,
    carried: FloatArray,
) -> None:
    """Attenuate throughput by the Beer-Lambert law between ray origins and hits.

    Parameters
    ----------
    context : RenderContext
    media : (n, STACK) int32, changed
        Medium stacks of the rays, see `hybrid_rt.shading.kernels.medium_stack`.
    material : (n,) int32
    hits : HitRecord of n rows
    second : (n,) int32, or (0,)
        Faces that coincide with the hits: see `Contacts.at`.
    carried : (n, 3) float64, changed
    """
    if context.plan["medium stack"]:
        scene = context.scene
        unclosed = np.zeros(scene.lobes.kind.size, dtype=np.int64)
        cross_media(
            media, scene.lobes, scene.glass_of, material, hits.front_face, second, hits.t, carried,
            unclosed,
        )  # fmt: skip
        for lobe in np.flatnonzero(unclosed):
            context.ledger.unclosed[int(lobe)] += int(unclosed[lobe])


def unclosed_bodies(context: RenderContext) -> tuple[dict[str, int], dict[str, int]]:
    """Return the number of rays that lost count of the dielectrics they are in, by objects' names.

    Such rays left a dielectric without having entered it, or never left it. Planes bound
    half-spaces, so they do not count.

    Returns
    -------
    not_closed : dict
        Of dielectrics with a surface that may be open; the names are those of such surfaces.
    lost : dict
        Of those made of spheres, boxes and tori, which are closed: their normals point inward, or
        there are too many within each other.
    """
    scene = context.scene
    not_closed: dict[str, int] = {}
    lost: dict[str, int] = {}
    n_objects = len(scene.names)
    for lobe, n_rays in sorted(context.ledger.unclosed.items()):
        objects = np.flatnonzero(scene.glass_of[scene.material_of[:n_objects]] == lobe)
        if all(scene.surfaces[i].is_bounded for i in objects):
            may_be_open = [i for i in objects if not scene.surfaces[i].is_closed]
            names = dict.fromkeys(scene.names[i] for i in may_be_open or objects)
            (not_closed if may_be_open else lost)[", ".join(names)] = n_rays
    return not_closed, lost


def _no_media(context: RenderContext, n: int) -> IntArray:
    depth = STACK if context.plan["medium stack"] else 0
    return np.full((n, depth), NOTHING, dtype=np.int32)


def square_of_index(media: IntArray, lobes: LobeTable) -> FloatArray:
    """Return the squared index of what fills the space around each ray, (n,).

    By it radiance in glass scales: refraction multiplies what a path carries by the square of the index
    that it comes from over that of the one that it enters, and gives it back on the way out.
    """
    ior = np.ones(len(media))
    if media.shape[1]:
        indices_within(ior, media, lobes)
    square: FloatArray = ior * ior
    return square
