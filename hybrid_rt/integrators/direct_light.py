"""Direct light at hits: emission that a ray hits, and next-event estimation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.compaction import add_unblocked
from hybrid_rt.integrators.kernels.light_sampling import (
    Lamps,
    Receivers,
    ShadowRays,
    choose_lights,
    sample_lights,
)
from hybrid_rt.integrators.light_points import new_light_points, pdf_area_of_hits, seen_points
from hybrid_rt.integrators.rows import new_rows, rows_of
from hybrid_rt.integrators.shading import NO_MEDIA, NO_NORMALS, NO_RATIO, Shading, mesh_points
from hybrid_rt.scene.compiled import NOTHING
from hybrid_rt.shading.kernels.emitter import UNWEIGHTED, Met, light_on_rays
from hybrid_rt.shading.kernels.light_kinds import LightPoints
from hybrid_rt.shading.kernels.lobes.register import SPREADS, WIDE
from hybrid_rt.shading.kernels.medium_stack import STACK, look_beyond
from hybrid_rt.shading.kernels.mesh_points import MeshPoints, shading_normals, texture_points
from hybrid_rt.shading.kernels.scatter import ConnectionPdf
from hybrid_rt.shading.kernels.texture import lobe_colors

NO_CONNECTION = NO_FACTOR = np.zeros(0)
NO_LOBES = np.zeros(0, dtype=np.int32)
NONE_SMOOTH = np.zeros(0, dtype=np.bool_)


class SurfaceLight:
    """The rendering equation's terms at a batch of hits.

    Parameters
    ----------
    context : RenderContext
    strategy : int
        MIS weights, see `hybrid_rt.shading.kernels.emitter`.
    traits : int
        Traits of the lobes evaluated by next-event estimation, see
        `hybrid_rt.shading.kernels.bsdf.scattered`.
    """

    def __init__(
        self, context: RenderContext, strategy: int = UNWEIGHTED, traits: int = WIDE
    ) -> None:
        self._context = context
        self._strategy, self._traits = strategy, traits
        self.n_slots = int(np.diff(context.scene.lobes.first).max(initial=0))
        self._constant_colors = self._colors_without_lookup()
        self.meshes: MeshPoints = context.scene.once(
            "mesh points", lambda: mesh_points(context.scene)
        )
        self._before = np.cumsum(context.scene.lights.chance)
        self._rough_glass_of = self._lobes_of_rough_glass()

    def material(self, hits: HitRecord) -> IntArray:
        """Return the material of each hit; `NOTHING` for misses and for lights."""
        of_surface = self._context.scene.material_of
        if of_surface.size == 0:
            return np.full(len(hits), NOTHING, dtype=np.int32)
        return np.where(hits.hit, of_surface[hits.object_id], np.int32(NOTHING))

    def colors(self, material: IntArray, hits: HitRecord) -> FloatArray:
        """Return the colour of each lobe of each hit, (n, n_slots, 3); undefined for `NOTHING`."""
        if self._constant_colors is not None:
            return self._constant_colors.take(material, axis=0, mode="clip")
        scene = self._context.scene
        colors = np.zeros((len(hits), self.n_slots, 3))
        u, v = self.texture_points(hits)
        lobe_colors(
            scene.textures, scene.lobes.texture, scene.color_factor, scene.lobes.first, material, u, v,
            hits.position, colors,
        )  # fmt: skip
        return colors

    def texture_points(self, hits: HitRecord) -> tuple[FloatArray, FloatArray]:
        """Return where textures are looked up at hits, (n,) each.

        At texture coordinates on meshes that have some, and at (u, v) elsewhere. Densities of points
        on lights are those of (u, v).
        """
        if self.meshes.first_patch.size == 0:
            return hits.u, hits.v
        place = np.empty((2, len(hits)))
        texture_points(self.meshes, hits.object_id, hits.patch_id, hits.u, hits.v, place)
        return place[0], place[1]

    def shading(
        self,
        hits: HitRecord,
        directions: FloatArray,
        material: IntArray,
        media: IntArray,
        second: IntArray,
    ) -> Shading:
        """Return hits with lobe colours and shading normals.

        Parameters
        ----------
        hits : HitRecord of n rows
        directions : (n, 3) float64
            Directions of the incoming rays.
        material : (n,) int32
        media : (n, STACK) int32, or (n, 0)
            Medium stacks of the incoming rays.
        second : (n,) int32, or (0,)
            Faces that coincide with the hits, see `Contacts.at`.
        """
        colors = self.colors(material, hits)
        ratio, beyond = self._across(hits, material, media, second)
        normal = self.shading_normals(hits, directions)
        if not normal.size:
            return Shading(hits, directions, material, colors, NO_NORMALS, ratio, beyond)
        to_shade_by = replace(hits, normal=normal)
        return Shading(to_shade_by, directions, material, colors, hits.normal, ratio, beyond)

    def arriving(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        pdf: FloatArray,
        connection_pdf: FloatArray,
        media: IntArray,
    ) -> FloatArray:
        """Return the emitted radiance that rays hit, (n, 3): lights and environment, MIS-weighted.

        Parameters
        ----------
        hits : HitRecord of n rows
        origins, directions : (n, 3) float64
        pdf : (n,) float64
            pdf of each direction per solid angle; 0 after a delta lobe and for camera rays, which
            are not weighted against next-event estimation.
        connection_pdf : (n,) float64, or (0,)
            Above 0: density to weigh against light subpaths, see
            `hybrid_rt.shading.kernels.emitter.light_on_rays`.
        media : (n, STACK) int32, or (n, 0)
            Medium stacks of the rays.
        """
        scene = self._context.scene
        radiance = np.zeros_like(directions)
        light = self._light_met(hits)
        if not (light != NOTHING).any():
            return radiance
        u, v = self.texture_points(hits)
        light_on_rays(
            scene.lights, scene.sky, scene.textures, light,
            Met(hits.t, u, v, hits.position, hits.normal), origins, directions, pdf,
            self._pdf_area(hits, light, origins, pdf, connection_pdf),
            connection_pdf if connection_pdf.size else np.zeros_like(pdf), media, scene.lobes, self._strategy, radiance,
        )  # fmt: skip
        return radiance

    def _light_met(self, hits: HitRecord) -> IntArray:
        """Return the light on whose shining side each ray ends, (n,) int32; `NOTHING`: none."""
        scene = self._context.scene
        light = np.full(len(hits), NOTHING, dtype=np.int32)
        if self._context.plan["visible lights"]:
            # A light's back is black.
            light = np.where(hits.front_face, scene.light_of[hits.object_id], light)
        if scene.environment is not None:
            light[~hits.hit] = scene.n_lights
        return light

    def _pdf_area(
        self,
        hits: HitRecord,
        light: IntArray,
        origins: FloatArray,
        pdf: FloatArray,
        connection_pdf: FloatArray,
    ) -> FloatArray:
        """Return the pdf per area of points met on lights of kind `SURFACE`, (n,); or (0,)."""
        is_asked = np.zeros(len(hits), dtype=np.bool_)
        has_left = is_asked
        if self._strategy != UNWEIGHTED:
            is_asked = pdf > 0.0
            has_left = ~is_asked & (connection_pdf > 0.0) if connection_pdf.size else has_left
        return pdf_area_of_hits(self._context.scene, hits, light, origins, is_asked, has_left)

    def pdf_area_met(
        self, hits: HitRecord, origins: FloatArray, pdf: FloatArray, connection_pdf: FloatArray
    ) -> FloatArray:
        """Return the pdf per area of points met on lights of kind `SURFACE`, (n,).

        Parameters are those of `arriving`; (0,) if there are no such lights.
        """
        if not self._context.scene.shining:
            return np.zeros(0)
        return self._pdf_area(hits, self._light_met(hits), origins, pdf, connection_pdf)

    def points_of_one(self, hits: HitRecord, xi: FloatArray) -> LightPoints:
        """Sample points on the lights of kind `SURFACE` that next-event estimation chooses; see `from_one`."""
        light = self._choose(xi)
        return seen_points(self._context.scene, hits.position, self.material(hits), light, xi)

    def _choose(self, xi: FloatArray) -> IntArray:
        """Choose a light for each row, (n,) int32, by its probability; rescale the number for reuse."""
        light = np.empty(len(xi), dtype=np.int32)
        choose_lights(self._before, self._context.scene.lights.chance, xi, light)
        return light

    @property
    def rough_glass_of(self) -> IntArray:
        """(materials + 1,) int32: the lobe of rough glass of each material; (0,): there is none."""
        return NO_LOBES if self._rough_glass_of is None else self._rough_glass_of

    def shading_normals(self, hits: HitRecord, directions: FloatArray) -> FloatArray:
        """Return normals to shade by, (n, 3); (0, 3) if all are those of the hits."""
        if self.meshes.first_face.size == 0:
            return NO_NORMALS
        normal = np.empty_like(hits.normal)
        shading_normals(
            self.meshes, hits.object_id, hits.patch_id, hits.u, hits.v, directions, hits.normal, normal
        )  # fmt: skip
        return normal

    def from_one(
        self,
        shading: Shading,
        camera_ray: NDArray[np.int64],
        throughput: FloatArray,
        media: IntArray,
        xi: FloatArray,
        radiance: FloatArray,
    ) -> None:
        """Next-event estimation: sample one light or the environment per hit, add its radiance.

        Parameters
        ----------
        camera_ray : (n,) int64
            Row in ``radiance`` of each hit.
        throughput : (n, 3) float64
        media : (n, STACK) int32, or (n, 0)
            Medium stacks of the paths.
        xi : (n, 2) float64 in [0, 1), changed
            Sample the light, by its probability, and a point on it.
        radiance : (rows, 3) float64, changed

        Raises
        ------
        ValueError
            If the strategy is `UNWEIGHTED`, which is for all lights, each in turn.
        """
        if self._strategy == UNWEIGHTED:
            raise ValueError(
                "SurfaceLight.from_one samples one light for all of them: make it with LIGHT_ONLY or BOTH"
            )
        rays, paths = shadow_rays(len(xi)), self._receivers(shading, camera_ray, throughput, media)
        n_rays = self._sample_lights(shading, paths, self._choose(xi), NO_FACTOR, xi, rays, 0)
        self.add_unblocked(rays, n_rays, radiance)

    def _receivers(
        self,
        shading: Shading,
        camera_ray: NDArray[np.int64],
        throughput: FloatArray,
        media: IntArray,
    ) -> Receivers:
        no_points = new_light_points(0)
        object_id = shading.hits.object_id
        return Receivers(camera_ray, object_id, throughput, media, shading.beyond, no_points)

    def _sample_lights(
        self,
        shading: Shading,
        paths: Receivers,
        light_id: IntArray,
        factor: FloatArray,
        xi: FloatArray,
        rays: ShadowRays,
        n_rays: int,
    ) -> int:
        """Sample a point of a light for each hit; write shadow rays, and return their number then."""
        scene, hits = self._context.scene, shading.hits
        points = seen_points(scene, hits.position, shading.material, light_id, xi)
        none = ConnectionPdf(hits.t, hits.t, NONE_SMOOTH, hits.object_id, NO_CONNECTION)
        lamps = Lamps(scene.lights, scene.sky, scene.textures, scene.surface_of_light, scene.lobes)
        n: int = sample_lights(
            lamps, self._strategy, self._traits, shading.vertices, paths._replace(light_point=points),
            light_id, factor, none, xi, rays, n_rays,
        )  # fmt: skip
        return n

    def add_unblocked(self, rays: ShadowRays, n_rays: int, radiance: FloatArray) -> None:
        """Trace the first shadow rays; add the values of the unoccluded ones to their rows of ``radiance``."""
        if n_rays == 0:
            return
        context = self._context
        rays = rows_of(rays, slice(n_rays))
        context.ledger.rays["shadow"] += n_rays
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(
                rays.origin,
                rays.way,
                rays.t_max,
                source=NamedPoints(rays.source_id, rays.origin),
                target=NamedPoints(rays.target_id, rays.end),
            )
        add_unblocked(rays.camera_ray, rays.follows, blocked, rays.value, radiance)

    def _across(
        self, hits: HitRecord, material: IntArray, media: IntArray, second: IntArray
    ) -> tuple[FloatArray, IntArray]:
        """Return what lies beyond rough glass, for `Shading`."""
        if self._rough_glass_of is None:
            return NO_RATIO, NO_MEDIA
        n, lobes = len(hits), self._context.scene.lobes
        ratio, beyond = np.empty(n), np.empty((n, STACK), dtype=np.int32)
        lobe = self._rough_glass_of[material]
        look_beyond(lobes, lobe, media, hits.front_face, second, beyond, ratio)
        return ratio, beyond

    def _lobes_of_rough_glass(self) -> IntArray | None:
        """Return the lobe of rough glass of each material; a last row is for `NOTHING`."""
        scene = self._context.scene
        if not self._context.plan["rough glass"]:
            return None
        is_rough = scene.lobes.traits[scene.glass_of] & SPREADS != 0
        is_rough &= scene.glass_of != NOTHING
        return np.append(np.where(is_rough, scene.glass_of, NOTHING), NOTHING).astype(np.int32)

    def _colors_without_lookup(self) -> FloatArray | None:
        if self._context.plan["texture lookups"]:
            return None
        scene = self._context.scene
        first = scene.lobes.first
        # One row at least: a scene without objects still looks its colours up.
        colors = np.zeros((max(first.size - 1, 1), self.n_slots, 3))
        for material in range(first.size - 1):
            rows = slice(first[material], first[material + 1])
            color = scene.textures.number[scene.lobes.texture[rows], :3]
            colors[material, : color.shape[0]] = scene.color_factor[rows, None] * color
        return colors


def shadow_rays(n: int) -> ShadowRays:
    """Allocate n shadow rays."""
    return new_rows(ShadowRays, n, "i8, 3f8, 3f8, f8, 3f8, i4, i4, 3f8, ?")


def largest_channel(color: FloatArray) -> FloatArray:
    """Return the largest channel of each row, (n,); much faster than a maximum along an axis."""
    return np.maximum(np.maximum(color[:, 0], color[:, 1]), color[:, 2])
