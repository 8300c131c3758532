"""Direct light from every light at every hit, as in Whitted's method."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray, NamedPoints
from hybrid_rt.integrators.direct_light import SurfaceLight, largest_channel
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.shading.kernels.bsdf import sample_lobes
from hybrid_rt.shading.kernels.environment import PICTURE
from hybrid_rt.shading.kernels.medium_stack import weaken_by_ways

_Number = TypeVar("_Number", bound=np.generic)


@dataclass(frozen=True)
class _Question:
    """What one light would send to some of the hits: rows, way there, value, end of the way."""

    rows: NDArray[np.intp]
    way: FloatArray
    t_max: float
    target_id: IntArray
    value: FloatArray


class AllLights(SurfaceLight):
    """A `SurfaceLight` that samples all lights at each hit; same parameters."""

    def from_all(
        self,
        shading: Shading,
        media: IntArray,
        pixel: UIntArray,
        dimension: UIntArray,
        pass_number: UIntArray,
    ) -> FloatArray:
        """Return the direct light at hits, (n, 3): the sum over all lights and the environment.

        Parameters
        ----------
        shading : Shading of n rows
        media : (n, STACK) int32, or (n, 0)
            Medium stacks of the rays.
        pixel, dimension, pass_number : (n,) uint64
            Keys of the random numbers. Hit i uses the dimensions ``dimension[i] + 0, 1, ...``, one
            for each light and one for the environment.
        """
        context, n = self._context, len(shading.hits)
        questions: list[_Question] = []
        if context.plan["light samples"]:
            # Planes that shine have no end, so no point that could be asked for; nor has what is dark.
            for light in np.flatnonzero(context.scene.lights.chance[:-1]).tolist():
                xi = context.sampler.points(pixel, dimension + np.uint64(light), pass_number)
                light_id = np.full(n, light, dtype=np.int32)
                questions += self._ask(shading, light_id, xi)
        if context.plan["sky samples"]:
            sky = np.uint64(context.scene.n_lights)
            xi = context.sampler.points(pixel, dimension + sky, pass_number)
            if context.scene.sky.kind == PICTURE:
                light_id = np.full(n, context.scene.n_lights, dtype=np.int32)
                questions += self._ask(shading, light_id, xi)
            else:
                questions += self._ask_sky_by_lobes(shading, xi)
        return self._answered(shading, media, questions)

    def _ask(self, shading: Shading, light_id: IntArray, xi: FloatArray) -> list[_Question]:
        """Ask one light per hit; sky and lights end at different lengths of their ways."""
        to_light, value = self._asked(shading, light_id, xi)
        shines = largest_channel(value) > 0.0
        return _split(shines, light_id, to_light, value, self._context.scene.surface_of_light)

    def _ask_sky_by_lobes(self, shading: Shading, xi: FloatArray) -> list[_Question]:
        """Ask the sky in a direction chosen by the lobes: best where it hardly varies."""
        scene, hits = self._context.scene, shading.hits
        wi, value = np.empty_like(shading.directions), np.empty_like(shading.directions)
        pdf = np.empty(len(hits))

        sample_lobes(
            scene.lobes,
            shading.material,
            shading.colors,
            hits.normal,
            shading.directions,
            NO_RATIO,
            xi,
            NO_RATIO,
            self._traits_asked,
            wi,
            value,
            pdf,
        )
        shines = largest_channel(value) > 0.0
        if shading.geometric.size:
            # What passes the surface itself is no light on this side.
            before = np.einsum("ij,ij->i", shading.geometric, shading.directions)
            shines &= before * np.einsum("ij,ij->i", shading.geometric, wi) < 0.0
        rows = np.flatnonzero(shines)
        way = wi.take(rows, axis=0)
        assert scene.environment is not None
        value = value.take(rows, axis=0) * scene.environment.radiance(way)
        nowhere = np.full(rows.size, NOTHING, dtype=np.int32)
        return [_Question(rows, way, np.inf, nowhere, value)]

    def _answered(
        self, shading: Shading, media: IntArray, questions: list[_Question]
    ) -> FloatArray:
        """Add up what is asked where nothing stands in the way, all shadow rays in one batch."""
        context = self._context
        total = np.zeros_like(shading.directions)
        questions = [question for question in questions if question.rows.size]
        if not questions:
            return total
        rows = _joined([question.rows for question in questions])
        way = _joined([question.way for question in questions])
        value = _joined([question.value for question in questions])
        target_id = _joined([question.target_id for question in questions])
        t_max = np.repeat([q.t_max for q in questions], [q.rows.size for q in questions])
        context.ledger.rays["shadow"] += rows.size
        position = shading.hits.position.take(rows, axis=0)
        source = NamedPoints(shading.hits.object_id[rows], position)
        target = None
        if (target_id != NOTHING).any():
            target = NamedPoints(target_id, position + way)
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(position, way, t_max, source=source, target=target)
        value[blocked] = 0.0
        if media.shape[1]:
            around = media.take(rows, axis=0)
            weaken_by_ways(around, context.scene.lobes, way, np.isfinite(t_max), value)
        first = 0
        for question in questions:
            total[question.rows] += value[first : first + question.rows.size]
            first += question.rows.size
        return total


def _split(
    shines: BoolArray,
    light_id: IntArray,
    to_light: FloatArray,
    value: FloatArray,
    surface_of_light: IntArray,
) -> list[_Question]:
    """Part ways to lights, which end there, from ways to the sky, which do not end."""
    questions = []
    is_sky = light_id == surface_of_light.size
    for chosen, t_max in ((shines & ~is_sky, 1.0), (shines & is_sky, np.inf)):
        rows = np.flatnonzero(chosen)
        if rows.size == 0:
            continue
        if t_max == 1.0:
            target_id = surface_of_light[light_id[rows]]
        else:
            target_id = np.full(rows.size, NOTHING, dtype=np.int32)
        way = to_light.take(rows, axis=0)
        questions.append(_Question(rows, way, t_max, target_id, value.take(rows, axis=0)))
    return questions


def _joined(parts: list[NDArray[_Number]]) -> NDArray[_Number]:
    return parts[0] if len(parts) == 1 else np.concatenate(parts)
