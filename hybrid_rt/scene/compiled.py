"""The compiled scene: flat tables of surfaces, BSDFs, textures and lights for the kernels."""

import math
from collections.abc import Callable, Hashable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from typing import Any, TypeVar, cast

import numpy as np

from hybrid_rt.core.checks import FARTHEST
from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.lights.light import BLACK, Environment, LightRow
from hybrid_rt.lights.surface import ShiningSurface, shining_surface, with_shape
from hybrid_rt.lights.table import compile_lights
from hybrid_rt.lights.unevenness import Brightness, brightness
from hybrid_rt.materials.material import Material
from hybrid_rt.materials.table import color_factor, compile_materials
from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.primitives.vertex_normals import vertex_normals
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.projection import Projection
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.environment import EnvironmentTable
from hybrid_rt.shading.kernels.light_kinds import SURFACE, LightTable
from hybrid_rt.shading.kernels.lobes.register import NARROW, TRANSMITS, WIDE
from hybrid_rt.shading.kernels.texture import CHECKER_UV, IMAGE, TextureTable
from hybrid_rt.textures.texture import ConstantTexture, Texture

NOTHING = -1
"""In a table of indices: there is none."""

T = TypeVar("T")


@dataclass(frozen=True)
class CompiledScene:
    """A scene in the form that integrators and kernels take."""

    camera: Projection
    environment: Environment | None  # None as well if it is black
    surfaces: list[Any]  # of the intersector: first the objects, then the lights that rays can hit
    names: list[str]  # of each object; if it has none, its place: "objects[3] (a Sphere)"
    called: list[str]  # the same in messages: "object 'lamp'", or the place
    material_of: IntArray  # (surfaces,), row in ``lobes.first``; `NOTHING` for lights
    light_of: IntArray  # (surfaces,), row in ``lights``; `NOTHING` if it does not shine
    surface_of_light: IntArray  # (lights,), index in ``surfaces``; `NOTHING`: rays cannot hit it
    lobes: LobeTable
    color_factor: FloatArray  # (lobes,), on the colour of each
    glass_of: IntArray  # (materials,), the dielectric lobe of each; `NOTHING` if it has none
    textures: TextureTable
    lights: LightTable
    power: FloatArray  # (lights,), emitted power, mean of the channels
    shining: dict[int, ShiningSurface]  # of lights of kind `SURFACE`, by row in ``lights``
    sky: EnvironmentTable
    brightness: Brightness  # of the sky
    vertex_normals: dict[
        int, FloatArray
    ]  # (vertices, 3) of smooth meshes, by index in ``surfaces``
    found: dict[Hashable, Any] = field(default_factory=dict)  # by `once`

    def once(self, name: Hashable, find: Callable[[], T]) -> T:
        """Return what follows from surfaces and materials alone: it is found at the first call.

        A copy by `dataclasses.replace`, with other lights say, knows it too.
        """
        if name not in self.found:
            self.found[name] = find()
        return self.found[name]

    @property
    def n_lights(self) -> int:
        """Return the number of lights, without the environment."""
        return int(self.lights.kind.size)

    @property
    def bounds(self) -> FloatArray:
        """(surfaces, 2, 3): the box around each; without end in all directions if the surface is."""
        endless = np.array([[-np.inf] * 3, [np.inf] * 3])

        def find() -> FloatArray:
            boxes = [s.bounds if s.is_bounded else endless for s in self.surfaces]
            return np.array(boxes, dtype=np.float64).reshape(-1, 2, 3)

        return self.once("bounds", find)

    @cached_property
    def widths(self) -> FloatArray:
        """(surfaces,): the second longest side of the box around each, how wide a flat or long body is."""
        return np.sort(self.bounds[:, 1] - self.bounds[:, 0], axis=1)[:, 1]

    @cached_property
    def colored_by_uv(self) -> BoolArray:
        """(surfaces,) bool: which reflect or emit by a texture over (u, v).

        These are an `ImageTexture`, and a `CheckerTexture` in "uv", in any colour.
        """
        # A last row, found by `NOTHING`, for what has no material, does not shine or shines evenly.
        follows = np.append(np.isin(self.textures.kind, (IMAGE, CHECKER_UV)), False)
        of_material = [
            bool(follows[self.lobes.texture[start:stop]].any())
            for start, stop in pairwise(self.lobes.first)
        ]
        of_light = [*follows[self.lights.texture].tolist(), False]
        by_material = np.array([*of_material, False])[self.material_of]
        return by_material | np.array(of_light)[self.light_of]

    @cached_property
    def unwrapped(self) -> dict[int, Any]:
        """The meshes, and instances of meshes, that textures are looked up on by texture coordinates, by index in ``surfaces``."""
        return {
            i: surface
            for i, surface in enumerate(self.surfaces)
            if getattr(surface, "texture_coordinates", None) is not None and self.colored_by_uv[i]
        }

    def lobes_with(self, traits: int) -> BoolArray:
        """Return which lobes of each material have one of these traits, (materials + 1, most lobes) bool.

        The last row is for `NOTHING` and is False.
        """
        first = self.lobes.first
        marks = np.zeros((first.size, int(np.diff(first).max(initial=0))), dtype=np.bool_)
        for m, (start, stop) in enumerate(pairwise(first)):
            marks[m, : stop - start] = self.lobes.traits[start:stop] & traits != 0
        return marks

    def materials_with(self, traits: int) -> BoolArray:
        """Return which materials have lobes with one of these traits, (materials + 1,)."""
        return np.asarray(self.lobes_with(traits).any(axis=1))

    @cached_property
    def narrow_materials(self) -> BoolArray:
        """(materials + 1,) bool: which spread light by narrow lobes and no wide ones."""
        return self.materials_with(NARROW) & ~self.materials_with(WIDE)


def compile_scene(scene: Scene) -> CompiledScene:
    """Lay a scene out in flat tables; errors name the object whose settings do not fit together."""
    surfaces = [item.surface for item in scene.objects]
    places = [f"objects[{i}] (a {type(x).__name__})" for i, x in enumerate(surfaces)]
    names = [item.name for item in scene.objects]
    called = [
        place if name is None else f"object {name!r}"
        for name, place in zip(names, places, strict=True)
    ]
    materials: list[Material] = []
    row_of: dict[int, int] = {}  # a material used twice is stored once
    for item in scene.objects:
        if id(item.material) not in row_of:
            row_of[id(item.material)] = len(materials)
            materials.append(item.material)
    material_of = [row_of[id(item.material)] for item in scene.objects]
    light_of = [NOTHING] * len(surfaces)
    rows = [light.row for light in scene.lights]
    surface_of_light = []
    for i, light in enumerate(scene.lights):
        if light.surface is None:
            surface_of_light.append(NOTHING)
            continue
        surface_of_light.append(len(surfaces))
        surfaces.append(light.surface)
        material_of.append(NOTHING)
        light_of.append(i)
    shining: dict[int, ShiningSurface] = {}
    for i, item in enumerate(scene.objects):
        if item.material.radiance is None:
            continue
        light_of[i] = len(rows)
        surface_of_light.append(i)
        row, chooser = _shining_object(item, item.material.radiance, called[i])
        if chooser is not None:
            shining[len(rows)] = chooser
        rows.append(row)
    pictures = [row.texture for row in rows if row.texture is not None]
    lobes, textures = compile_materials(materials, pictures)
    n_before = textures.kind.size - len(pictures)
    numbers = iter(range(n_before, textures.kind.size))
    texture_of = [NOTHING if row.texture is None else next(numbers) for row in rows]
    environment = scene.environment
    sky = BLACK if environment is None else environment.table
    shines = brightness(sky)
    if shines.mean == 0.0:
        # Else as many light samples would go to a black sky as to a lamp.
        environment, sky = None, BLACK
    return CompiledScene(
        camera=scene.camera,
        environment=environment,
        surfaces=surfaces,
        names=[place if name is None else name for name, place in zip(names, places, strict=True)],
        called=called,
        material_of=np.array(material_of, dtype=np.int32),
        light_of=np.array(light_of, dtype=np.int32),
        surface_of_light=np.array(surface_of_light, dtype=np.int32),
        lobes=lobes,
        color_factor=color_factor(lobes),
        glass_of=_glass_of(lobes),
        textures=textures,
        lights=compile_lights(rows, texture_of, environment is not None),
        power=np.array([row.power for row in rows], dtype=np.float64),
        shining=shining,
        sky=sky,
        brightness=shines,
        vertex_normals={
            i: vertex_normals(cast("TriangleMesh", item.surface))
            for i, item in enumerate(scene.objects)
            if item.smooth
        },
    )


def _glass_of(lobes: LobeTable) -> IntArray:
    glass = np.full(lobes.first.size - 1, NOTHING, dtype=np.int32)
    for row in np.flatnonzero(lobes.traits & TRANSMITS):
        glass[np.searchsorted(lobes.first, row, side="right") - 1] = row
    return glass


def _shining_object(
    item: Object, radiance: Texture, called: str
) -> tuple[LightRow, ShiningSurface | None]:
    """Return the light that an object is, and what chooses its points unless the kernels do."""
    surface = item.surface
    if surface.is_bounded and not surface.size <= FARTHEST:
        raise ValueError(
            f"{called} shines and is {surface.size:g} across: lamps may be up to {FARTHEST:g}"
        )
    try:
        chooser = shining_surface(surface, radiance)
    except ValueError as error:
        raise ValueError(f"{called} {error}") from error
    # A plane has no end: scattered rays find it, but nothing is chosen on it.
    area = 0.0 if chooser is None else chooser.area
    nothing = np.zeros(3)
    row = LightRow(
        kind=SURFACE,
        origin=nothing,
        edge_u=nothing,
        edge_v=nothing,
        strength=radiance.brightest,
        texture=None if isinstance(radiance, ConstantTexture) else radiance,
        power=math.pi * area * float(radiance.mean.mean()),
    )
    row = with_shape(surface, row)
    return row, chooser if row.kind == SURFACE else None
