import numpy as np
import pytest
import trimesh

from hybrid_rt.lights import GradientSky, PointLight
from hybrid_rt.materials import Dielectric, Lambertian, Metal
from hybrid_rt.primitives import Sphere, TriangleMesh
from hybrid_rt.primitives.vertex_normals import vertex_normals
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.shading.kernels.bsdf import leaves_through_face

CAMERA = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), 32, 48, 48)


def ball(subdivisions):
    return TriangleMesh(trimesh.creation.icosphere(subdivisions))


def test_normals_at_the_vertices_of_a_cube_point_along_its_diagonals():
    cube = trimesh.creation.box((2, 2, 2))
    for mesh in (
        cube,
        trimesh.Trimesh(cube.triangles.reshape(-1, 3), np.arange(36).reshape(12, 3), process=False),
    ):
        surface = TriangleMesh(mesh)
        # Angles, not areas or counts: each side of the cube weighs the same however it is cut.
        np.testing.assert_allclose(
            vertex_normals(surface), surface.vertices / np.sqrt(3), atol=1e-12
        )


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_smooth_mesh_is_shaded_as_the_ball(integrator):
    def image(surface, smooth=False):
        lamp = PointLight((3, -5, 4), 60.0)
        objects = [Object(surface, Lambertian(0.8), smooth=smooth)]
        return render(Scene(CAMERA, objects, [lamp]), integrator, passes=16, max_depth=0).image

    exact = image(Sphere((0, 0, 0), 1))
    inside = np.zeros(exact.shape, bool)
    inside[12:36, 12:36] = True  # away from the outline and the border of the shadow
    rough = np.abs(image(ball(2)) - exact)[inside].mean()
    smooth = np.abs(image(ball(2), smooth=True) - exact)[inside].mean()
    # What remains is that the triangles lie below the ball.
    assert smooth < 0.2 * rough


@pytest.mark.statistical
@pytest.mark.parametrize("material", [Lambertian(1.0), Metal(1.0, 0.6), Dielectric(1.5)])
def test_smooth_mesh_makes_no_light(material):
    sky = GradientSky(1.0, 1.0)
    scene = Scene(CAMERA, [Object(ball(1), material, smooth=True)], environment=sky)
    image = render(scene, passes=32, max_depth=40).image
    # The noise of 32 passes. Some light is lost: where a normal would send it into the face.
    assert image.mean() <= 1.0 + 0.01
    assert image[20:28, 20:28].mean() > 0.6


def test_light_behind_the_face_does_not_leak_in():
    geometric, direction = np.array([[0.0, 0.0, 1.0]]), np.array([[0.6, 0.0, -0.8]])
    # A shading normal tilted to (0.7, 0, 0.7) would have let the second one in.
    assert not leaves_through_face(geometric, 0, direction, 1.0, 0.0, 0.1)
    assert leaves_through_face(geometric, 0, direction, 1.0, 0.0, -0.1)
    assert not leaves_through_face(np.zeros((0, 3)), 0, direction, 1.0, 0.0, -0.1)


def test_smooth_is_for_meshes_only():
    with pytest.raises(
        TypeError, match="object 'ball' is a smooth Sphere: leave smooth to TriangleMesh"
    ):
        Object(Sphere((0, 0, 0), 1), Lambertian(0.5), "ball", smooth=True)
