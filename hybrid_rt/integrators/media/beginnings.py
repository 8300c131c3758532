"""The media in which paths begin: at the camera, and at each point of the lamps."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.media.contacts import Contacts, first_hits
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.scene.lamp_points import points_of_lamps
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA
from hybrid_rt.shading.kernels.medium_stack import STACK

# Surfaces that one ray is followed through.
MOST_CROSSINGS = 256
# None of a scene's likely directions, unit: a ray along an edge would count both faces.
SKEW = np.array([[0.5612, 0.6383, 0.5269]])
SKEW /= np.linalg.norm(SKEW)
# Points of a lens or film, each way, that are looked at.
ACROSS = 32


def media_at(
    context: RenderContext,
    contacts: Contacts | None,
    origins: FloatArray,
    directions: FloatArray = SKEW,
    source: HitRecord | NamedPoints | None = None,
) -> IntArray:
    """Return the dielectrics that contain each of some points, the outermost first.

    A ray from the point to infinity leaves each of them once more often than it enters it. These rays
    are not counted as work of the picture.

    ``origins`` (n, 3); ``directions`` (n, 3) or (1, 3).
    ``contacts``: None if no dielectric touches another surface.
    ``source``, HitRecord or NamedPoints of n rows: the surface points, if the origins are such.
    Returns (n, STACK) int32: the innermost ones, if there are more.
    """
    scene, tracer = context.scene, context.tracer.with_own_counters()
    contacts = None if contacts is None else contacts.with_tracer(tracer)
    glass_of = np.append(scene.glass_of, np.int32(NOTHING))  # the last for what has no material
    rows = np.arange(len(origins))
    directions = np.tile(directions, (len(origins) // len(directions), 1))
    around = np.full((len(origins), STACK), NOTHING, dtype=np.int32)  # the innermost first
    entered = around.copy()  # and not yet left, in any order, by the rays that go on
    for _ in range(MOST_CROSSINGS):
        hits, second = first_hits(tracer, contacts, origins, directions, source)
        on = np.flatnonzero(hits.hit)
        if on.size == 0:
            break
        hits, directions, rows, entered = hits[on], directions[on], rows[on], entered[on]
        second = second[on] if second.size else np.zeros(on.size, dtype=np.int32)
        passed = (
            (glass_of[scene.material_of[hits.object_id]], hits.front_face),
            (np.abs(second) - 1, second > 0),
        )
        # What is entered comes first.
        for body, is_entered in passed:
            entered = _put(entered, np.where(is_entered, body, NOTHING), grows=True)
        for body, is_entered in passed:
            left = np.where(is_entered, NOTHING, body)
            was = (entered == left[:, None]) & (left != NOTHING)[:, None]
            has = was.any(axis=1)
            entered[np.flatnonzero(has), was[has].argmax(axis=1)] = NOTHING
            around[rows] = _put(around[rows], np.where(has, NOTHING, left), grows=False)
        origins, source = hits.position, hits
    place = (around != NOTHING).sum(axis=1)[:, None] - 1 - np.arange(STACK)
    turned = np.take_along_axis(around, np.maximum(place, 0), axis=1)
    return np.where(place >= 0, turned, np.int32(NOTHING))


def _put(held: IntArray, bodies: IntArray, grows: bool) -> IntArray:
    """Put a body into the first free column of each row; return the table.

    A row without one is left as it is, or, if the table grows, gets more columns.
    """
    rows = np.flatnonzero(bodies != NOTHING)
    is_free = held[rows] == NOTHING
    if grows and not is_free.any(axis=1).all():
        held = np.hstack([held, np.full((len(held), STACK), NOTHING, dtype=np.int32)])
        is_free = held[rows] == NOTHING
    fits = is_free.any(axis=1)
    held[rows[fits], is_free[fits].argmax(axis=1)] = bodies[rows[fits]]
    return held


class MediaAroundCamera:
    """The medium stacks in which camera rays begin.

    1024 points of a lens or film are looked at. If all of them lie in the same bodies, so does all of it.
    Else each ray is looked at by itself.

    ``contacts``: None if no dielectric touches another surface.
    ``middle`` (STACK,) int32: at the middle of the lens or film; (0,) without dielectrics.
    ``differs``: whether rays begin in several media.
    ``is_in_the_open``: whether all begin outside of all dielectrics.
    """

    def __init__(self, context: RenderContext, contacts: Contacts | None) -> None:
        self._context, self._contacts = context, contacts
        self.middle: IntArray = np.empty(0, dtype=np.int32)
        self.differs, self.is_in_the_open = False, True
        if not context.plan["medium stack"]:
            return
        camera = context.scene.camera
        self._boxes = _boxes_of_clear_bodies(context.scene)
        self.middle = media_at(context, contacts, camera.look_from[None])[0]
        media = self.middle[None]
        if camera.reach > 0.0:
            side = (np.arange(ACROSS) + 0.5) / ACROSS
            xi = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
            places, _ = camera.rays(xi[:, 0] * camera.width, xi[:, 1] * camera.height, xi)
            media = self.at(places)
        self.differs = bool((media != self.middle).any())
        self.is_in_the_open = not (media != NOTHING).any()

    def at(self, origins: FloatArray) -> IntArray:
        """Return the medium stack at each of the points (n, 3) of the lens or film, (n, STACK)."""
        media = np.full((len(origins), self.middle.size), NOTHING, dtype=np.int32)
        if self.middle.size:
            low, high = self._boxes[:, 0], self._boxes[:, 1]
            above, below = low <= origins[:, None], origins[:, None] <= high
            rows = np.flatnonzero(np.all(above & below, axis=2).any(axis=1))
            media[rows] = media_at(self._context, self._contacts, origins[rows])
        return media

    def of_rays(self, origins: FloatArray) -> IntArray:
        """Return the medium stacks of rays that begin in these points (n, 3), (n, STACK)."""
        return self.at(origins) if self.differs else np.repeat(self.middle[None], len(origins), 0)

    def groups(self, origins: FloatArray) -> Iterator[tuple[IntArray, NDArray[np.intp]]]:
        """Yield each medium stack in which some of these rays (n, 3) begin, and the rows of these."""
        stacks, number = np.unique(self.at(origins), axis=0, return_inverse=True)
        for k, stack in enumerate(stacks):
            yield stack, np.flatnonzero(number.ravel() == k)


def _boxes_of_clear_bodies(scene: CompiledScene) -> FloatArray:
    """Return a box around each clear body, (bodies, 2, 3); it may be infinite."""
    boxes: dict[int, FloatArray] = {}
    for i in range(len(scene.called)):
        material, box = int(scene.material_of[i]), scene.bounds[i]
        if scene.glass_of[material] == NOTHING:
            continue
        low, high = boxes.get(material, box)
        boxes[material] = np.array([np.minimum(low, box[0]), np.maximum(high, box[1])])
    return np.array(list(boxes.values())).reshape(-1, 2, 3)


class MediaAroundLights:
    """The medium stacks in which light paths and photons begin.

    256 points of each lamp are looked at. If all of them lie in the same bodies, so does the lamp. Else
    it lies in some of them in part, and each beginning is looked at by itself.

    ``contacts``: None if no dielectric touches another surface.
    ``lights``, iterable of int: rows of the light table of which light is sent; the others count as
    in vacuum.
    ``differs`` (lights + 1,) bool: lamps of which not all points lie in the same bodies; the last
    row is the environment.
    """

    def __init__(
        self, context: RenderContext, contacts: Contacts | None, lights: Iterable[int]
    ) -> None:
        self._context, self._contacts = context, contacts
        n = context.scene.n_lights + 1
        self.differs: BoolArray = np.zeros(n, dtype=np.bool_)
        has_media = context.plan["medium stack"]
        self._around: IntArray = np.full((n, STACK if has_media else 0), NOTHING, dtype=np.int32)
        sending = np.array(list(lights), dtype=np.intp)
        if has_media and sending.size:
            name = ("media around lights", sending.tobytes())
            self._around, self.differs = context.scene.once(name, lambda: self._look(sending))

    def at(self, light: IntArray, origins: FloatArray, directions: FloatArray) -> IntArray:
        """Return the medium stack of each beginning.

        ``origins``, ``directions`` (n, 3).
        ``light`` (n,) int: the lights that they leave; the number of lights stands for the
        environment.
        Returns (n, STACK) int32; (n, 0) if the scene has no dielectric.
        """
        media: IntArray = self._around.take(light, axis=0)
        rows = np.flatnonzero(self.differs[light])
        if rows.size:
            # The ray that leaves the point also tells what is around it: so the path that follows it
            # leaves what it began in.
            media[rows] = self._media_at(light[rows], origins[rows], directions[rows])
        return media

    def _look(self, lights: NDArray[np.intp]) -> tuple[IntArray, BoolArray]:
        """Look at points of some lamps, all at once; return what is around each, and ``differs``."""
        scene, around, differs = self._context.scene, self._around, self.differs
        points = points_of_lamps(scene)
        is_place = np.isin(scene.lights.kind[points.light], WITHOUT_AREA)
        is_first = np.diff(points.light, prepend=-1) != 0
        rows = np.flatnonzero(np.isin(points.light, lights) & (is_first | ~is_place))
        light, inward = points.light[rows], points.inward[rows]
        outward = -inward / np.linalg.norm(inward, axis=1, keepdims=True)
        directions = np.where(is_place[rows, None], SKEW, outward + 0.5 * SKEW)
        media = self._media_at(light, points.place[rows], directions)
        around[light[is_first[rows]]] = media[is_first[rows]]
        differs[light[(media != around[light]).any(axis=1)]] = True
        return around, differs

    def _media_at(
        self, light: NDArray[Any], origins: FloatArray, directions: FloatArray
    ) -> IntArray:
        source = NamedPoints(self._context.scene.surface_of_light.take(light), origins)
        return media_at(self._context, self._contacts, origins, directions, source)
