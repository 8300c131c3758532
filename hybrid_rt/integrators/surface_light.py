"""Light at surfaces, for every integrator: what they emit and what lights send them directly."""

from __future__ import annotations

import numpy as np

from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.kernels.light import sample_hemisphere, sample_lights
from hybrid_rt.kernels.lobes import DIFFUSE, PHONG, eval_lobes
from hybrid_rt.kernels.texture import lobe_colors
from hybrid_rt.records import BoolArray, FloatArray, HitRecord, IntArray
from hybrid_rt.sampler import UIntArray
from hybrid_rt.scene import NOTHING


class SurfaceLight:
    """The rendering equation's terms at a batch of hits.

    Parameters
    ----------
    context : RenderContext
    """

    def __init__(self, context: RenderContext) -> None:
        self._context = context
        lobes = context.scene.lobes
        sizes = np.diff(lobes.first)
        self.n_slots = int(sizes.max(initial=0))
        spreads = np.isin(lobes.kind, (DIFFUSE, PHONG))
        owner = np.repeat(np.arange(sizes.size), sizes)
        self._spreads = np.zeros(sizes.size, dtype=bool)
        self._spreads[owner[spreads]] = True
        self._constant_colors = self._colors_without_lookup()

    def material(self, hits: HitRecord) -> IntArray:
        """Return the material of each hit; `NOTHING` for misses and for lights."""
        of_surface = self._context.scene.material_of
        if of_surface.size == 0:
            return np.full(len(hits), NOTHING, dtype=np.int32)
        return np.where(hits.hit, of_surface[hits.object_id], np.int32(NOTHING))

    def spreads(self, material: IntArray) -> BoolArray:
        """Tell which materials have a lobe that lights reach."""
        return self._spreads[material]

    def colors(self, material: IntArray, hits: HitRecord) -> FloatArray:
        """Return the colour of each lobe of each hit, (n, n_slots, 3)."""
        if self._constant_colors is not None:
            return self._constant_colors[material]
        scene = self._context.scene
        colors = np.zeros((len(hits), self.n_slots, 3))
        lobe_colors(
            scene.textures,
            scene.lobes.texture,
            scene.lobes.first,
            material,
            hits.u,
            hits.v,
            hits.position,
            colors,
        )
        return colors

    def arriving(self, hits: HitRecord, directions: FloatArray) -> FloatArray:
        """Return the radiance that rays run into, (n, 3): lights and what lies around the scene."""
        scene = self._context.scene
        radiance = np.zeros_like(directions)
        if self._context.plan["visible lights"]:
            light = scene.light_of[hits.object_id]
            # A light's back is black.
            rows = np.flatnonzero(hits.hit & (light != NOTHING) & hits.front_face)
            radiance[rows] = scene.lights.strength[light[rows]]
        if scene.environment is not None:
            missed = ~hits.hit
            radiance[missed] = scene.environment.radiance(directions[missed])
        return radiance

    def direct(
        self,
        hits: HitRecord,
        directions: FloatArray,
        material: IntArray,
        colors: FloatArray,
        pixel: UIntArray,
        dimension: UIntArray,
        pass_number: int,
    ) -> FloatArray:
        """Return what lights and sky send through the spreading lobes, (n, 3).

        Every light is asked once per hit; hit i uses the dimensions ``dimension[i] + 0, 1, ...``,
        one for each light and one for the sky.
        """
        context = self._context
        total = np.zeros_like(directions)
        if context.plan["light samples"]:
            for light in range(context.scene.n_lights):
                xi = context.sampler.points(pixel, dimension + np.uint64(light), pass_number)
                total += self._from_light(light, xi, hits, directions, material, colors)
        if context.plan["sky samples"]:
            sky = np.uint64(context.scene.n_lights)
            xi = context.sampler.points(pixel, dimension + sky, pass_number)
            total += self._from_sky(xi, hits, directions, material, colors)
        return total

    def _from_light(
        self,
        light: int,
        xi: FloatArray,
        hits: HitRecord,
        directions: FloatArray,
        material: IntArray,
        colors: FloatArray,
    ) -> FloatArray:
        scene = self._context.scene
        point, irradiance = np.empty_like(directions), np.empty_like(directions)
        light_id = np.full(len(hits), light, dtype=np.int32)
        sample_lights(scene.lights, light_id, hits.position, xi, point, irradiance)
        to_light = point - hits.position
        distance = np.sqrt(np.einsum("ij,ij->i", to_light, to_light))
        with np.errstate(invalid="ignore", divide="ignore"):
            wi = to_light / distance[:, None]
        value = irradiance * self._scattered(material, colors, hits, directions, wi)
        # A light in the very point that it lights has no direction to it; irradiance is 0 there.
        rows = np.flatnonzero(largest_channel(value) > 0.0)
        target = None
        if scene.surface_of_light[light] != NOTHING:
            surface = int(scene.surface_of_light[light])
            target = _points_on(surface, xi[rows], point[rows], scene.surfaces[surface])
        source = hits[rows]
        return self._unless_blocked(value, rows, source, to_light[rows], 1.0, target)

    def _from_sky(
        self,
        xi: FloatArray,
        hits: HitRecord,
        directions: FloatArray,
        material: IntArray,
        colors: FloatArray,
    ) -> FloatArray:
        wi = np.empty_like(directions)
        sample_hemisphere(hits.normal, directions, xi, wi)
        cosine = np.abs(np.einsum("ij,ij->i", hits.normal, wi))
        value = self._scattered(material, colors, hits, directions, wi)
        # The density of the cosine law is cosine / pi.
        assert self._context.scene.environment is not None
        sky = self._context.scene.environment.radiance(wi)
        value *= sky * (np.pi / np.maximum(cosine, np.finfo(float).tiny))[:, None]
        rows = np.flatnonzero(largest_channel(value) > 0.0)
        return self._unless_blocked(value, rows, hits[rows], wi[rows], np.inf, None)

    def _scattered(
        self,
        material: IntArray,
        colors: FloatArray,
        hits: HitRecord,
        directions: FloatArray,
        wi: FloatArray,
    ) -> FloatArray:
        """Return f cos of all spreading lobes together, (n, 3)."""
        value = np.empty_like(directions)
        lobes = self._context.scene.lobes
        eval_lobes(lobes, material, colors, hits.normal, directions, wi, value)
        return value

    def _unless_blocked(
        self,
        value: FloatArray,
        rows: np.ndarray,
        source: HitRecord,
        to_light: FloatArray,
        t_max: float,
        target: HitRecord | None,
    ) -> FloatArray:
        """Return the rows of ``value`` whose way to the light is free; the others are zero."""
        context = self._context
        context.ledger.rays["shadow"] += rows.size
        arriving = np.zeros_like(value)
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(
                source.position, to_light, t_max, source=source, target=target
            )
        free = rows[~blocked]
        arriving[free] = value[free]
        return arriving

    def _colors_without_lookup(self) -> FloatArray | None:
        if self._context.plan["texture lookups"]:
            return None
        scene = self._context.scene
        first = scene.lobes.first
        colors = np.zeros((first.size - 1, self.n_slots, 3))
        for material in range(first.size - 1):
            textures = scene.lobes.texture[first[material] : first[material + 1]]
            colors[material, : textures.size] = scene.textures.number[textures, :3]
        return colors


def largest_channel(color: FloatArray) -> FloatArray:
    """Return the largest of the three channels, (n,); many times faster than a maximum along rows."""
    largest: FloatArray = np.maximum(np.maximum(color[:, 0], color[:, 1]), color[:, 2])
    return largest


def _points_on(surface_id: int, xi: FloatArray, points: FloatArray, surface: object) -> HitRecord:
    """Name points of a light's surface, so that a shadow ray may end there."""
    n = points.shape[0]
    return HitRecord(
        t=np.ones(n),
        object_id=np.full(n, surface_id, dtype=np.int32),
        patch_id=np.zeros(n, dtype=np.int32),
        u=np.ascontiguousarray(xi[:, 0]),
        v=np.ascontiguousarray(xi[:, 1]),
        position=points,
        normal=surface.normal(xi[:, 0], xi[:, 1]),  # type: ignore[attr-defined]
        front_face=np.ones(n, dtype=bool),
        status=np.full(n, 1, dtype=np.uint8),
        flags=np.zeros(n, dtype=np.uint8),
        t_bound=np.zeros(n),
        residual=np.zeros(n),
    )
