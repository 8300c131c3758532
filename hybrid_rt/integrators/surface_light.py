"""Light at surfaces, for every integrator: what they emit and what lights send them directly."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.kernels.environment import PICTURE
from hybrid_rt.kernels.light import UNWEIGHTED, LightPoints, light_on_hits, light_on_rays
from hybrid_rt.kernels.lobes import PHONG, sample_lobes
from hybrid_rt.kernels.media import weaken_by_ways
from hybrid_rt.kernels.pack import ShadowRays, add_unblocked, choose_lights, pack_shadow_rays
from hybrid_rt.kernels.texture import lobe_colors
from hybrid_rt.records import BoolArray, FloatArray, HitRecord, IntArray, NamedPoints
from hybrid_rt.sampler import UIntArray
from hybrid_rt.scene import NOTHING
from hybrid_rt.smooth import shading_normals

_Number = TypeVar("_Number", bound=np.generic)

NO_NORMALS = np.zeros((0, 3))
NO_RIVAL = np.zeros(0)
NONE_SMOOTH = np.zeros(0, dtype=np.bool_)


@dataclass(frozen=True)
class Shading:
    """Hits as shading needs them: where, on what, from where.

    Attributes
    ----------
    hits : HitRecord of n rows
    directions : (n, 3) float64
        Of the rays that arrived.
    material : (n,) int32
    colors : (n, lobes of a material at most, 3) float64
    geometric : (n, 3) float64, or (0, 3)
        Normals of the surfaces themselves where ``hits`` has been given others to shade by.
    """

    hits: HitRecord
    directions: FloatArray
    material: IntArray
    colors: FloatArray
    geometric: FloatArray


@dataclass(frozen=True)
class _Question:
    """What one light would send to some of the hits: rows, way there, value, end of the way."""

    rows: NDArray[np.intp]
    way: FloatArray
    t_max: float
    target_id: IntArray
    value: FloatArray


class SurfaceLight:
    """The rendering equation's terms at a batch of hits.

    Parameters
    ----------
    context : RenderContext
    strategy : int
        How light found in two ways is weighted: see `hybrid_rt.kernels.light`.
    last_kind : int
        Lobes that lights are asked for: see `hybrid_rt.kernels.lobes.scattered`.
    """

    def __init__(
        self, context: RenderContext, strategy: int = UNWEIGHTED, last_kind: int = PHONG
    ) -> None:
        self._context = context
        self._strategy, self._last_kind = strategy, last_kind
        self.n_slots = int(np.diff(context.scene.lobes.first).max(initial=0))
        self._constant_colors = self._colors_without_lookup()
        self._before = np.cumsum(context.scene.lights.chance)

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
        lobe_colors(
            scene.textures,
            scene.lobes.texture,
            scene.color_factor,
            scene.lobes.first,
            material,
            hits.u,
            hits.v,
            hits.position,
            colors,
        )
        return colors

    def shading(self, hits: HitRecord, directions: FloatArray, material: IntArray) -> Shading:
        """Return hits with the colours of their lobes and the normals to shade by.

        Parameters
        ----------
        hits : HitRecord of n rows
        directions : (n, 3) float64
            Of the rays that arrived.
        material : (n,) int32
        """
        colors = self.colors(material, hits)
        meshes = self._context.scene.vertex_normals
        if not meshes:
            return Shading(hits, directions, material, colors, NO_NORMALS)
        normal = hits.normal.copy()
        for object_id, normals in meshes.items():
            rows = np.flatnonzero(hits.object_id == object_id)
            mesh = self._context.scene.surfaces[object_id]
            normal[rows] = shading_normals(hits, directions, rows, mesh, normals)
        return Shading(replace(hits, normal=normal), directions, material, colors, hits.normal)

    def arriving(
        self,
        hits: HitRecord,
        origins: FloatArray,
        directions: FloatArray,
        pdf: FloatArray,
        rival: FloatArray,
        media: IntArray,
    ) -> FloatArray:
        """Return the radiance that rays run into, (n, 3): lights and what lies around the scene.

        Parameters
        ----------
        hits : HitRecord of n rows
        origins, directions : (n, 3) float64
        pdf : (n,) float64
            Density with which each direction was chosen, 0 where it had no choice; what lights were
            asked for already counts less.
        rival : (n,) float64, or (0,)
            Above 0: what light paths find counts less as well.
        media : (n, STACK) int32, or (n, 0)
            The stacks of the rays.
        """
        scene, plan = self._context.scene, self._context.plan
        radiance = np.zeros_like(directions)
        light = np.full(len(hits), NOTHING, dtype=np.int32)
        if plan["visible lights"]:
            # A light's back is black.
            light = np.where(hits.front_face, scene.light_of[hits.object_id], light)
        if scene.environment is not None:
            light[~hits.hit] = scene.n_lights
        if not (light != NOTHING).any():
            return radiance
        light_on_rays(
            scene.lights,
            scene.sky,
            scene.textures,
            light,
            hits.t,
            hits.u,
            hits.v,
            hits.position,
            hits.normal,
            origins,
            directions,
            pdf,
            self._pdf_area(hits, light, pdf, rival),
            rival if rival.size else np.zeros_like(pdf),
            media,
            scene.lobes,
            self._strategy,
            radiance,
        )
        return radiance

    def from_all(
        self,
        shading: Shading,
        media: IntArray,
        pixel: UIntArray,
        dimension: UIntArray,
        pass_number: UIntArray,
    ) -> FloatArray:
        """Return what lights and sky send through the spreading lobes, (n, 3): all are asked.

        Parameters
        ----------
        shading : Shading of n rows
        media : (n, STACK) int32, or (n, 0)
            The stacks of the rays.
        pixel, dimension, pass_number : (n,) uint64
            Name the random numbers. Hit i uses the dimensions ``dimension[i] + 0, 1, ...``, one for
            each light and one for the sky.
        """
        context, n = self._context, len(shading.hits)
        questions: list[_Question] = []
        if context.plan["light samples"]:
            for light in range(context.scene.n_lights):
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

    def from_one(
        self,
        shading: Shading,
        camera_ray: NDArray[np.int64],
        throughput: FloatArray,
        media: IntArray,
        xi: FloatArray,
        radiance: FloatArray,
    ) -> None:
        """Add what lights and sky send through the spreading lobes: one is asked for each hit.

        Parameters
        ----------
        camera_ray : (n,) int64
            Row in ``radiance`` of each hit.
        throughput : (n, 3) float64
        media : (n, STACK) int32, or (n, 0)
            Dielectrics that the paths are in.
        xi : (n, 2) float64 in [0, 1), changed
            Chooses the light, by its chance, and a point of it.
        radiance : (rows, 3) float64, changed
        """
        scene, hits = self._context.scene, shading.hits
        n = len(hits)
        light = np.empty(n, dtype=np.int32)
        choose_lights(self._before, scene.lights.chance, xi, light)
        to_light, value = self._asked(shading, light, xi)
        if media.shape[1]:
            weaken_by_ways(media, scene.lobes, to_light, light < scene.n_lights, value)
        rays = shadow_rays(n)
        n_rays = pack_shadow_rays(
            camera_ray, throughput, hits.object_id, hits.position, light, scene.surface_of_light,
            to_light, value, rays,
        )  # fmt: skip
        self.add_unblocked(rays, n_rays, radiance)

    def add_unblocked(self, rays: ShadowRays, n_rays: int, radiance: FloatArray) -> None:
        """Add what arrives along shadow rays where nothing stands in the way.

        Parameters
        ----------
        rays : ShadowRays
        n_rays : int
            The first so many of them.
        radiance : (rows, 3) float64, changed
            In the rows that ``camera_ray`` names.
        """
        if n_rays == 0:
            return
        context = self._context
        rays = ShadowRays(*(column[:n_rays] for column in rays))
        context.ledger.rays["shadow"] += n_rays
        with context.ledger.stage("shadow rays"):
            blocked = context.tracer.occluded(
                rays.origin,
                rays.way,
                rays.t_max,
                source=NamedPoints(rays.source_id, rays.origin),
                target=NamedPoints(rays.target_id, rays.end),
            )
        add_unblocked(rays.camera_ray, blocked, rays.value, radiance)

    def _ask(self, shading: Shading, light_id: IntArray, xi: FloatArray) -> list[_Question]:
        """Ask one light per hit; sky and lights end at different lengths of their ways."""
        to_light, value = self._asked(shading, light_id, xi)
        shines = largest_channel(value) > 0.0
        return _split(shines, light_id, to_light, value, self._context.scene.surface_of_light)

    def _asked(
        self, shading: Shading, light_id: IntArray, xi: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return the ways to chosen points of lights, and what they send."""
        scene, hits = self._context.scene, shading.hits
        to_light, value = np.empty_like(shading.directions), np.empty_like(shading.directions)
        light_on_hits(
            scene.lights,
            scene.sky,
            scene.textures,
            self.points(light_id, xi),
            light_id,
            scene.lobes,
            shading.material,
            shading.colors,
            hits.position,
            hits.normal,
            shading.directions,
            shading.geometric,
            xi,
            self._strategy,
            self._last_kind,
            to_light,
            value,
        )
        return to_light, value

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
            xi,
            self._last_kind,
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

    def points(self, light_id: IntArray, xi: FloatArray) -> LightPoints:
        """Choose points on the surfaces among the lights.

        Parameters
        ----------
        light_id : (n,) int32
        xi : (n, 2) float64 in [0, 1)

        Returns
        -------
        LightPoints of n rows
            Zero for lights of other kinds; (0,) where no surface is a light.
        """
        shining = self._context.scene.shining
        points = new_light_points(light_id.size if shining else 0)
        for light, chooser in shining.items():
            rows = np.flatnonzero(light_id == light)
            if rows.size == 0:
                continue
            for column, chosen in zip(points, chooser.points(xi[rows]), strict=True):
                column[rows] = chosen
        return points

    def _pdf_area(
        self, met: HitRecord, light: IntArray, pdf: FloatArray, rival: FloatArray
    ) -> FloatArray:
        """Return the density per area of points met on surfaces among the lights."""
        shining = self._context.scene.shining
        density = np.zeros(light.size if shining else 0)
        if self._strategy == UNWEIGHTED:
            return density
        is_weighed = (pdf > 0.0) | (rival > 0.0) if rival.size else pdf > 0.0
        for number, chooser in shining.items():
            rows = np.flatnonzero((light == number) & is_weighed)
            if rows.size:
                density[rows] = chooser.pdf_area(
                    met.patch_id[rows].astype(np.int64), met.u[rows], met.v[rows]
                )
        return density

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
    """Return n rays to be filled."""
    return ShadowRays(
        camera_ray=np.empty(n, dtype=np.int64),
        origin=np.empty((n, 3)),
        way=np.empty((n, 3)),
        t_max=np.empty(n),
        end=np.empty((n, 3)),
        source_id=np.empty(n, dtype=np.int32),
        target_id=np.empty(n, dtype=np.int32),
        value=np.empty((n, 3)),
    )


def new_light_points(n: int) -> LightPoints:
    """Return n points to be filled; (0,) where no surface is a light."""
    return LightPoints(
        position=np.zeros((n, 3)),
        normal=np.zeros((n, 3)),
        pdf_area=np.zeros(n),
        u=np.zeros(n),
        v=np.zeros(n),
    )


def largest_channel(color: FloatArray) -> FloatArray:
    """Return the largest of the three channels, (n,); many times faster than a maximum along rows."""
    largest: FloatArray = np.maximum(np.maximum(color[:, 0], color[:, 1]), color[:, 2])
    return largest


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
