"""What the user describes, and the flat tables it is compiled to once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.camera import Camera
from hybrid_rt.kernels.light import LightTable
from hybrid_rt.kernels.lobes import LobeTable
from hybrid_rt.kernels.texture import TextureTable
from hybrid_rt.lights.light import Environment, Light
from hybrid_rt.lights.table import compile_lights
from hybrid_rt.materials.material import Material
from hybrid_rt.materials.table import compile_materials
from hybrid_rt.records import IntArray

NOTHING = -1
"""In a table of indices: there is none."""


class Object:
    """A surface made of something.

    Parameters
    ----------
    surface : Sphere, Rectangle, Plane, Box, TriangleMesh, BezierPatches or SurfaceOfRevolution
    material : Material
    name : str, optional
        What messages and reports call it.
    """

    def __init__(self, surface: Any, material: Material, name: str | None = None) -> None:
        self.name = type(surface).__name__ if name is None else name
        if not (hasattr(surface, "bounds") and hasattr(surface, "transformed")):
            raise TypeError(
                f"object {self.name!r}: {type(surface).__name__} is no surface; use Sphere, "
                "Rectangle, Plane, Box, TriangleMesh, BezierPatches or SurfaceOfRevolution"
            )
        if not isinstance(material, Material):
            raise TypeError(
                f"object {self.name!r}: {material!r} is no material; use one of hybrid_rt.materials"
            )
        self.surface = surface
        self.material = material


class Scene:
    """A camera, objects, lights, and what lies around them.

    Parameters
    ----------
    camera : Camera
    objects : sequence of Object
    lights : sequence of PointLight or RectangleLight
    environment : GradientSky, optional
        What rays see that leave the scene; None is black.

    Raises
    ------
    TypeError
        If a part is of another type; the message says which.
    """

    def __init__(
        self,
        camera: Camera,
        objects: Sequence[Object] = (),
        lights: Sequence[Light] = (),
        environment: Environment | None = None,
    ) -> None:
        if not isinstance(camera, Camera):
            raise TypeError(f"Scene camera: expected a Camera, got {camera!r}")
        for i, item in enumerate(objects):
            if not isinstance(item, Object):
                raise TypeError(f"Scene objects[{i}]: expected an Object, got {item!r}")
        for i, light in enumerate(lights):
            if not isinstance(light, Light):
                raise TypeError(f"Scene lights[{i}]: expected a light, got {light!r}")
        if environment is not None and not isinstance(environment, Environment):
            raise TypeError(f"Scene environment: expected GradientSky or None, got {environment!r}")
        self.camera = camera
        self.objects = tuple(objects)
        self.lights = tuple(lights)
        self.environment = environment

    def with_camera(self, camera: Camera) -> Scene:
        """Return the same scene seen by another camera."""
        return Scene(camera, self.objects, self.lights, self.environment)


@dataclass(frozen=True)
class CompiledScene:
    """A scene as integrators and kernels take it.

    Attributes
    ----------
    surfaces : list
        What the intersector is built over: first the objects, then the lights that can be seen.
    material_of : (surfaces,) int32
        Row in ``lobes.first`` of each surface; `NOTHING` for lights.
    light_of : (surfaces,) int32
        Row in ``lights`` of each surface; `NOTHING` for objects.
    surface_of_light : (lights,) int32
        Index in ``surfaces`` of each light; `NOTHING` where it is not seen.
    """

    camera: Camera
    environment: Environment | None
    surfaces: list[Any]
    material_of: IntArray
    light_of: IntArray
    surface_of_light: IntArray
    lobes: LobeTable
    textures: TextureTable
    lights: LightTable

    @property
    def n_lights(self) -> int:
        """Return the number of lights, the environment not counted."""
        return int(self.lights.kind.size)


def compile_scene(scene: Scene) -> CompiledScene:
    """Lay a scene out in flat tables."""
    surfaces = [item.surface for item in scene.objects]
    materials: list[Material] = []
    row_of: dict[int, int] = {}  # a material used twice is stored once
    for item in scene.objects:
        if id(item.material) not in row_of:
            row_of[id(item.material)] = len(materials)
            materials.append(item.material)
    material_of = [row_of[id(item.material)] for item in scene.objects]
    light_of = [NOTHING] * len(surfaces)
    surface_of_light = []
    for i, light in enumerate(scene.lights):
        if light.surface is None:
            surface_of_light.append(NOTHING)
            continue
        surface_of_light.append(len(surfaces))
        surfaces.append(light.surface)
        material_of.append(NOTHING)
        light_of.append(i)
    lobes, textures = compile_materials(materials)
    return CompiledScene(
        camera=scene.camera,
        environment=scene.environment,
        surfaces=surfaces,
        material_of=np.array(material_of, dtype=np.int32),
        light_of=np.array(light_of, dtype=np.int32),
        surface_of_light=np.array(surface_of_light, dtype=np.int32),
        lobes=lobes,
        textures=textures,
        lights=compile_lights(scene.lights),
    )
