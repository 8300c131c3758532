"""Direct light from every light at every hit, as in Whitted's method; of very many lights from some."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.integrators.direct_light import NO_FACTOR, SurfaceLight, shadow_rays
from hybrid_rt.integrators.integrator import BLOCK
from hybrid_rt.integrators.kernels.light_sampling import cast_to_sky, choose_lights
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.shading.kernels.bsdf import sample_lobes
from hybrid_rt.shading.kernels.environment import PICTURE

# Of more lights so many are sampled at each hit, in proportion to their power: its time does not grow.
MOST_LIGHTS = 32


class _Sample(NamedTuple):
    """A light for each hit, the dimension of its random numbers, and a weight if it was chosen."""

    dimension: int
    light_id: IntArray
    weight: FloatArray  # (n,), or (0,): 1


class AllLights(SurfaceLight):
    """A `SurfaceLight` that samples all lights at each hit, up to `MOST_LIGHTS`; same parameters."""

    def from_all(
        self,
        shading: Shading,
        media: IntArray,
        pixel: UIntArray,
        dimension: UIntArray,
        pass_number: UIntArray,
    ) -> FloatArray:
        """Return the direct light at hits, (n, 3): the sum over all lights and the environment.

        ``shading``, Shading of n rows.
        ``media`` (n, STACK) int32, or (n, 0): medium stacks of the rays.
        ``pixel``, ``dimension``, ``pass_number`` (n,) uint64: keys of the random numbers. Hit i
        uses the dimensions ``dimension[i] + 0, 1, ...``, one for each light and one for the
        environment.
        """
        context, n = self._context, len(shading.hits)
        # Planes that shine have no end, so no point can be sampled on them; what is dark sends nothing.
        lights = np.flatnonzero(context.scene.lights.chance[:-1])
        if not context.plan["light samples"]:
            lights = lights[:0]
        total = np.zeros((n, 3))
        samples = self._of_each(lights, n)
        if lights.size > MOST_LIGHTS:
            xi = context.sampler.points(pixel, dimension + np.uint64(MOST_LIGHTS), pass_number)
            samples = self._of_some(xi[:, 0])
        if context.plan["sky samples"]:
            samples = itertools.chain(samples, self._of_each(np.array([context.scene.n_lights]), n))
        # Memory is bounded by the block of camera rays: not all lights at once.
        together = max(BLOCK // max(n, 1), 1)
        while some := list(itertools.islice(samples, together)):
            self._add(some, shading, media, (pixel, dimension, pass_number), total)
        return total

    def _of_each(self, lights: NDArray[np.intp], n: int) -> Iterator[_Sample]:
        for light in lights.tolist():
            yield _Sample(light, np.full(n, light, dtype=np.int32), NO_FACTOR)

    def _of_some(self, xi: FloatArray) -> Iterator[_Sample]:
        """Choose `MOST_LIGHTS` lights for each hit by systematic sampling of their power."""
        chance = self._context.scene.lights.chance
        # The sky, which comes last, is sampled for itself.
        part = self._before[-2] / MOST_LIGHTS
        for k in range(MOST_LIGHTS):
            light_id = np.empty(xi.size, dtype=np.int32)
            choose_lights(self._before, chance, np.column_stack([(k + xi) * part, xi]), light_id)
            yield _Sample(k, light_id, part / chance[light_id])

    def _add(
        self,
        samples: Sequence[_Sample],
        shading: Shading,
        media: IntArray,
        keys: tuple[UIntArray, UIntArray, UIntArray],
        total: FloatArray,
    ) -> None:
        """Add what some of the lights send, and nothing blocks."""
        context, n = self._context, len(shading.hits)
        pixel, dimension, pass_number = keys
        rays, n_rays = shadow_rays(len(samples) * n), 0
        paths = self._receivers(shading, np.arange(n), np.ones((n, 3)), media)
        for own_dimension, light_id, weight in samples:
            xi = context.sampler.points(pixel, dimension + np.uint64(own_dimension), pass_number)
            if own_dimension == context.scene.n_lights and context.scene.sky.kind != PICTURE:
                way, value = self._sample_sky_by_lobes(shading, xi)
                lobes = context.scene.lobes
                n_rays = cast_to_sky(lobes, shading.vertices, paths, way, value, rays, n_rays)
            else:
                n_rays = self._sample_lights(shading, paths, light_id, weight, xi, rays, n_rays)
        self.add_unblocked(rays, n_rays, total)

    def _sample_sky_by_lobes(
        self, shading: Shading, xi: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Sample a direction of the sky by the BSDF: best where the sky hardly varies."""
        scene, hits = self._context.scene, shading.hits
        wo, value = np.empty_like(shading.directions), np.empty_like(shading.directions)
        sample_lobes(
            scene.lobes, shading.material, shading.colors, hits.normal, shading.directions, NO_RATIO,
            xi, NO_RATIO, self._traits, wo, value, np.empty(len(hits)),
        )  # fmt: skip
        if shading.geometric.size:
            # What passes the surface itself is no light on this side.
            before = np.einsum("ij,ij->i", shading.geometric, shading.directions)
            value[before * np.einsum("ij,ij->i", shading.geometric, wo) >= 0.0] = 0.0
        assert scene.environment is not None
        lit = np.flatnonzero(value.any(axis=1))
        value[lit] *= scene.environment.radiance(wo[lit])
        return wo, value
