"""Direct light from every light at every hit, as in Whitted's method."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.integrators.direct_light import SurfaceLight, shadow_rays
from hybrid_rt.integrators.kernels.compaction import ShadowRays
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.sampling.sampler import UIntArray
from hybrid_rt.shading.kernels.bsdf import sample_lobes
from hybrid_rt.shading.kernels.environment import PICTURE


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
        # Planes that shine have no end, so no point can be sampled on them; what is dark sends nothing.
        lights = np.flatnonzero(context.scene.lights.chance[:-1]).tolist()
        if not context.plan["light samples"]:
            lights = []
        if context.plan["sky samples"]:
            lights.append(context.scene.n_lights)
        rays, n_rays = shadow_rays(len(lights) * n), 0
        ones, total = np.ones((n, 3)), np.zeros((n, 3))
        for light in lights:
            xi = context.sampler.points(pixel, dimension + np.uint64(light), pass_number)
            light_id = np.full(n, light, dtype=np.int32)
            if light == context.scene.n_lights and context.scene.sky.kind != PICTURE:
                to_light, value = self._sample_sky_by_lobes(shading, xi)
            else:
                to_light, value = self._sample_lights(shading, light_id, xi)
            rest = ShadowRays(*(column[n_rays:] for column in rays))
            n_rays += self._pack(
                shading, np.arange(n), ones, media, light_id, to_light, value, rest
            )
        self.add_unblocked(rays, n_rays, total)
        return total

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
