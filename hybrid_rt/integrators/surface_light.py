"""Light at surfaces, for every integrator: what they emit and what lights send them directly."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.kernels.light import light_on_hits
from hybrid_rt.kernels.lobes import sample_lobes
from hybrid_rt.kernels.texture import lobe_colors
from hybrid_rt.records import FloatArray, HitRecord, IntArray, Status
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
        self.n_slots = int(np.diff(context.scene.lobes.first).max(initial=0))
        self._constant_colors = self._colors_without_lookup()

    def material(self, hits: HitRecord) -> IntArray:
        """Return the material of each hit; `NOTHING` for misses and for lights."""
        of_surface = self._context.scene.material_of
        if of_surface.size == 0:
            return np.full(len(hits), NOTHING, dtype=np.int32)
        return np.where(hits.hit, of_surface[hits.object_id], np.int32(NOTHING))

    def colors(self, material: IntArray, hits: HitRecord) -> FloatArray:
        """Return the colour of each lobe of each hit, (n, n_slots, 3); anything without material."""
        if self._constant_colors is not None:
            return self._constant_colors.take(material, axis=0, mode="clip")
        scene = self._context.scene
        colors = np.zeros((len(hits), self.n_slots, 3))

        def look_up(i: int, j: int) -> None:
            lobe_colors(
                scene.textures,
                scene.lobes.texture,
                scene.lobes.first,
                material[i:j],
                hits.u[i:j],
                hits.v[i:j],
                hits.position[i:j],
                colors[i:j],
            )

        self._context.pool.run(look_up, len(hits))
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
        to_light, value = np.empty_like(directions), np.empty_like(directions)
        light_id = np.full(len(hits), light, dtype=np.int32)

        def ask(i: int, j: int) -> None:
            light_on_hits(
                scene.lights,
                light_id[i:j],
                scene.lobes,
                material[i:j],
                colors[i:j],
                hits.position[i:j],
                hits.normal[i:j],
                directions[i:j],
                xi[i:j],
                to_light[i:j],
                value[i:j],
            )

        self._context.pool.run(ask, len(hits))
        rows = np.flatnonzero(largest_channel(value) > 0.0)
        source, way = hits[rows], to_light.take(rows, axis=0)
        target = None
        if scene.surface_of_light[light] != NOTHING:
            surface_id = int(scene.surface_of_light[light])
            surface = scene.surfaces[surface_id]
            target = _points_on(surface, surface_id, xi.take(rows, axis=0), source.position + way)
        return self._unless_blocked(value, rows, source, way, 1.0, target)

    def _from_sky(
        self,
        xi: FloatArray,
        hits: HitRecord,
        directions: FloatArray,
        material: IntArray,
        colors: FloatArray,
    ) -> FloatArray:
        scene = self._context.scene
        wi, value = np.empty_like(directions), np.empty_like(directions)

        def choose(i: int, j: int) -> None:
            sample_lobes(
                scene.lobes,
                material[i:j],
                colors[i:j],
                hits.normal[i:j],
                directions[i:j],
                xi[i:j],
                wi[i:j],
                value[i:j],
            )

        self._context.pool.run(choose, len(hits))
        rows = np.flatnonzero(largest_channel(value) > 0.0)
        way = wi.take(rows, axis=0)
        assert scene.environment is not None
        value[rows] *= scene.environment.radiance(way)
        return self._unless_blocked(value, rows, hits[rows], way, np.inf, None)

    def _unless_blocked(
        self,
        value: FloatArray,
        rows: NDArray[np.intp],
        source: HitRecord,
        way: FloatArray,
        t_max: float,
        target: HitRecord | None,
    ) -> FloatArray:
        """Return ``value`` where the way to the light is free and zero elsewhere.

        ``rows`` are those that are not zero anyway; the other arguments have one row for each.
        """
        context = self._context
        if rows.size == 0:
            return value
        context.ledger.rays["shadow"] += rows.size
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(
                source.position, way, t_max, source=source, target=target
            )
        value[rows[blocked]] = 0.0
        return value

    def _colors_without_lookup(self) -> FloatArray | None:
        if self._context.plan["texture lookups"]:
            return None
        scene = self._context.scene
        first = scene.lobes.first
        # One row at least: a scene without objects still looks its colours up.
        colors = np.zeros((max(first.size - 1, 1), self.n_slots, 3))
        for material in range(first.size - 1):
            textures = scene.lobes.texture[first[material] : first[material + 1]]
            colors[material, : textures.size] = scene.textures.number[textures, :3]
        return colors


def largest_channel(color: FloatArray) -> FloatArray:
    """Return the largest of the three channels, (n,); many times faster than a maximum along rows."""
    largest: FloatArray = np.maximum(np.maximum(color[:, 0], color[:, 1]), color[:, 2])
    return largest


def _points_on(surface: Any, surface_id: int, xi: FloatArray, points: FloatArray) -> HitRecord:
    """Name points of a light's surface, so that a shadow ray may end there."""
    n = points.shape[0]
    return HitRecord(
        t=np.ones(n),
        object_id=np.full(n, surface_id, dtype=np.int32),
        patch_id=np.zeros(n, dtype=np.int32),
        u=np.ascontiguousarray(xi[:, 0]),
        v=np.ascontiguousarray(xi[:, 1]),
        position=points,
        normal=surface.normal(xi[:, 0], xi[:, 1]),
        front_face=np.ones(n, dtype=bool),
        status=np.full(n, Status.HIT, dtype=np.uint8),
        flags=np.zeros(n, dtype=np.uint8),
        t_bound=np.zeros(n),
        residual=np.zeros(n),
    )
