"""Where a picture lies on each kind of surface: its parameters in closed form."""

import math

import numpy as np
import pytest
import trimesh

from hybrid_rt.materials import Emissive
from hybrid_rt.primitives import Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import ImageTexture
from meshing import BezierPatches, SurfaceOfRevolution

SIZE = 64
# Red is u and green is v, exactly, between the centres of the outermost pixels.
ACROSS, UP = np.meshgrid(
    (np.arange(SIZE) + 0.5) / SIZE, 1 - (np.arange(SIZE) + 0.5) / SIZE, indexing="xy"
)
PICTURE = ImageTexture(np.stack([ACROSS, UP, np.zeros_like(UP)], axis=-1))

TRIANGLE = trimesh.Trimesh([[0, 0, 0], [2, 0, 0], [0, 2, 0]], [[0, 1, 2]], process=False)

# surface, (point seen, from where), (u, v) there
CASES = {
    "rectangle": (
        Rectangle((-1, -1, 0), (4, 0, 0), (0, 2, 0)), (0.2, 0.3, 0), (0, 0, 3), (0.3, 0.65)),
    "sphere": (
        Sphere((0, 0, 0), 2), (0, 2 * math.cos(0.4), 2 * math.sin(0.4)), (0, 9, 4),
        (0.25, 0.5 + 0.4 / math.pi)),
    "turned sphere": (
        Sphere((0, 0, 0), 1, (1, 0, 0), (0, 1, 0)), (0, 0, 1), (0, 0.1, 5), (0.25, 0.5)),
    "plane, fractions of the world": (
        Plane((0, 0, 0), (0, 0, 1)), (3.25, -1.4, 0), (3, -1, 4), (0.25, 0.6)),
    "patch": (
        BezierPatches(np.array([[[[0, 0, 0], [0, 1, 0]], [[2, 0, 0], [2, 1, 0]]]], float)),
        (0.8, 0.3, 0), (1, 0, 5), (0.4, 0.3)),
    "revolution": (
        SurfaceOfRevolution([(0, 1), (4, 1)], (0, 0, 0), (0, 0, 1), (1, 0, 0)),
        (0, 1, 1), (0, 6, 2), (0.25, 0.25)),
    "torus, an eighth over its outer rim": (
        Torus((0, 0, 0), (0, 0, 1), 2, 0.5, (1, 0, 0)),
        (0, 2 + 0.5 * math.sqrt(0.5), 0.5 * math.sqrt(0.5)), (0, 6, 4), (0.25, 0.125)),
    "mesh, weights of two corners": (
        TriangleMesh(TRIANGLE), (0.6, 0.8, 0), (1, 1, 5), (0.3, 0.4)),
}  # fmt: skip


@pytest.mark.parametrize("integrator", ["path", "whitted"])
@pytest.mark.parametrize("name", CASES)
def test_pictures_lie_on_surfaces_by_their_parameters(name, integrator):
    surface, point, eye, (u, v) = CASES[name]
    up = (0.1, 0.2, 1.0) if abs(eye[2] - point[2]) < 3 else (0, 1, 0.1)
    camera = Camera(eye, point, up, 1e-6, 1, 1)
    image = render(Scene(camera, [Object(surface, Emissive(PICTURE))]), integrator, passes=1).image
    np.testing.assert_allclose(image[0, 0], (u, v, 0), atol=1e-6)
