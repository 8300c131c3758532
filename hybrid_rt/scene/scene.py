"""Scene description: objects (a surface and its material), lights, environment, camera."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.core.suggestions import explains
from hybrid_rt.lights.light import Environment, Light
from hybrid_rt.materials.material import Material
from hybrid_rt.sensor.projection import Projection
from meshing.surface import Surface


@explains(shape="surface", geometry="surface", primitive="surface")
class Object:
    """A surface with a material.

    Parameters
    ----------
    surface : Surface
        Any surface of `hybrid_rt` or `meshing`, such as Sphere, TriangleMesh or BezierPatches.
    material : Material
    name : str, optional
        The name in messages and reports. Without it the object is named by its place in the scene:
        "objects[3] (a Sphere)".
    smooth : bool
        Shade a triangle mesh with interpolated vertex normals, which are means over the faces around,
        also across sharp edges; normals of files are not read. Silhouettes and shadows stay those
        of the triangles.

    Raises
    ------
    TypeError
        If an argument has another type, or ``smooth`` is set for a surface that is not a mesh.

    Attributes
    ----------
    surface, material, name, smooth
        The arguments.

    Examples
    --------
    A copy in another place shares the material object:

    >>> import numpy as np
    >>> from hybrid_rt import Lambertian, Object, Sphere
    >>> ball = Object(Sphere((0, 0, 1), 1), Lambertian(0.5), "ball")
    >>> shift = np.array([[1, 0, 0, 3], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])
    >>> Object(ball.surface.transformed(shift), ball.material, ball.name).surface.center
    array([3., 0., 1.])
    """

    def __init__(
        self, surface: Surface, material: Material, name: str | None = None, smooth: bool = False
    ) -> None:
        if name is not None and not isinstance(name, str):
            raise TypeError(f"Object name is {checks.shown(name)}: pass a word, or None")
        self.name = name
        called = "object" if name is None else f"object {name!r}"
        if not isinstance(surface, Surface):
            raise TypeError(
                f"{called} is made of {checks.shown(surface)}: pass a Sphere, Rectangle, "
                "TriangleMesh, BezierPatches, SurfaceOfRevolution or another surface"
                + _of_a_mesh(surface)
            )
        if name is None:
            called = f"object (a {type(surface).__name__})"
        if not isinstance(material, Material):
            raise TypeError(
                f"{called} has the material {checks.shown(material)}: pass one of "
                "hybrid_rt.materials"
            )
        if checks.flag(smooth, f"{called}, smooth") and not surface.is_triangular:
            raise TypeError(
                f"{called} is a smooth {type(surface).__name__}: leave smooth to "
                "TriangleMesh, other surfaces have exact normals"
            )
        self.surface = surface
        self.material = material
        self.smooth = smooth

    def __repr__(self) -> str:
        """Return the call that makes it."""
        further: dict[str, Any] = {} if self.name is None else {"name": self.name}
        further |= {"smooth": True} if self.smooth else {}
        return call(self, self.surface, self.material, **further)


@explains(background="environment", sky="environment", lamps="lights")
class Scene:
    """A camera, objects, lights and an environment.

    Parameters
    ----------
    camera : Camera, OrthographicCamera or PanoramicCamera
    objects : sequence of Object
    lights : sequence of `hybrid_rt.lights.light.Light`
    environment : GradientSky or ImageEnvironment, optional
        Radiance of rays that leave the scene. Default: black.

    Raises
    ------
    TypeError
        If an argument has another type; the message names it.

    Attributes
    ----------
    camera, environment
        The arguments.
    objects, lights : tuples
        The arguments' items.
    """

    def __init__(
        self,
        camera: Projection,
        objects: Sequence[Object] = (),
        lights: Sequence[Light] = (),
        environment: Environment | None = None,
    ) -> None:
        if not isinstance(camera, Projection):
            raise TypeError(
                f"Scene camera is {checks.shown(camera)}: pass a Camera, OrthographicCamera or PanoramicCamera"
            )
        objects = checks.items(objects, "Scene objects")
        lights = checks.items(lights, "Scene lights")
        for i, item in enumerate(objects):
            if not isinstance(item, Object):
                hint = "lights go into lights=" if isinstance(item, Light) else "pass an Object"
                raise TypeError(f"Scene objects[{i}] is {checks.shown(item)}: {hint}")
        for i, light in enumerate(lights):
            if not isinstance(light, Light):
                hint = "pass a light"
                if isinstance(light, Object):
                    hint = (
                        "an Object goes into objects=, also one with Emissive, which lights there"
                    )
                elif isinstance(light, Environment):
                    hint = "a sky goes into environment="
                raise TypeError(f"Scene lights[{i}] is {checks.shown(light)}: {hint}")
        if environment is not None and not isinstance(environment, Environment):
            raise TypeError(
                f"Scene environment is {checks.shown(environment)}: pass a GradientSky, an "
                "ImageEnvironment or None"
            )
        self.camera = camera
        self.objects: tuple[Object, ...] = objects
        self.lights: tuple[Light, ...] = lights
        self.environment = environment

    def __repr__(self) -> str:
        """Count what is in the scene."""
        counts = [
            f"{n} {word}{'' if n == 1 else 's'}"
            for n, word in ((len(self.objects), "object"), (len(self.lights), "light"))
        ]
        sky = [] if self.environment is None else [type(self.environment).__name__]
        size = f"camera {self.camera.width} x {self.camera.height}"
        return f"Scene({', '.join([*counts, *sky, size])})"

    def with_camera(self, camera: Projection) -> Scene:
        """Return the same scene with another camera."""
        return Scene(camera, self.objects, self.lights, self.environment)


def _of_a_mesh(given: object) -> str:
    """Return how a mesh, a scene of meshes, or a file, becomes a surface; "" for anything else."""
    if isinstance(given, str | os.PathLike):
        return "; of a mesh file: TriangleMesh.read(FILE)"
    if checks.has(given, "vertices", "faces"):
        return "; of a mesh: TriangleMesh(MESH)"
    if checks.has(given, "to_mesh", "dump"):
        return (
            "; of a trimesh.Scene: TriangleMesh(SCENE.to_mesh()), or an object for each mesh of "
            "SCENE.dump()"
        )
    return ""
