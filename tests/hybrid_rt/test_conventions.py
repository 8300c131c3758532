"""What docs/conventions.md says of sides, depths, and scenes of other programs."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Camera,
    Dielectric,
    Emissive,
    GradientSky,
    ImageEnvironment,
    Lambertian,
    Metal,
    Mirror,
    Object,
    PointLight,
    Rectangle,
    RectangleLight,
    RoughConductor,
    Scene,
    Sphere,
    SphereLight,
    TriangleMesh,
    render,
)

SQUARE = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))  # its normal is +z
ABOVE = Camera((0, 0, 3), (0, 0, 0), up=(0, 1, 0), vertical_fov=20, width=8, height=8)
WHITE = GradientSky(1, 1)


def seen(surface, material, lights=(), sky=None, **settings):
    scene = Scene(ABOVE, [Object(surface, material, "square")], list(lights), sky)
    return render(scene, passes=4, threads=1, **settings).image


@pytest.mark.slow
def test_a_left_handed_scene_by_a_mirrored_image_and_by_reflected_objects():
    mirror = np.diag([1.0, 1.0, -1.0, 1.0])  # z to -z
    glass = TriangleMesh(trimesh.creation.box((1, 1, 1)))
    panorama = np.random.default_rng(0).random((8, 16, 3))

    def view(body, picture, sign, u, v):
        floor = Rectangle((-3, -1, -3), (6, 0, 0), (0, 0, 6))
        things = [Object(body, Dielectric(1.5), "glass"), Object(floor, Lambertian(0.6), "floor")]
        eye = Camera((1, 2, 4 * sign), (0, 0, sign), up=(0, 1, 0), width=24, height=16)
        lamp = RectangleLight((-1, 3, 2 * sign), u, v, 20)  # shines down
        return render(Scene(eye, things, [lamp], ImageEnvironment(picture)), passes=256, threads=1)

    u, v = np.array([2.0, 0, 0]), np.array([0, 0, 1.0])  # u x v is -y
    kept = view(glass, panorama[:, ::-1], 1, u, v).image[:, ::-1]
    reflected = view(glass.transformed(mirror).flipped(), panorama, -1, mirror[:3, :3] @ v, u)
    # Either image is known to 1 % or so.
    assert abs(kept - reflected.image).mean() < 0.02 * kept.mean()
    assert not reflected.report["clear_bodies_not_closed"]

    left_as_it_was = view(glass.transformed(mirror), panorama, -1, u, mirror[:3, :3] @ v)
    assert left_as_it_was.image.mean() < 0.8 * kept.mean()  # the lamp shines up
    assert left_as_it_was.report["clear_bodies_not_closed"]


def square_of_mitsuba(to_world):
    """Corner and edges of a `rectangle` of Mitsuba, as the page says."""
    x, y, _, t = np.asarray(to_world, dtype=float)[:3].T
    edges = (2 * x, 2 * y) if np.linalg.det(to_world) > 0 else (2 * y, 2 * x)
    return t - x - y, *edges


@pytest.mark.slow
def test_a_scene_of_mitsuba():
    """Directions and mean are those of Mitsuba 3.9.1: 16384 samples a pixel, "box", `max_depth` 18."""
    lamp = np.array([(0.8, 0, 0, 0.5), (0, 0, -1, 3), (0, 0.5, 0, 0.5), (0, 0, 0, 1)])
    floor = np.array([(4, 0, 0, 0), (0, 0, 1, 0), (0, -4, 0, 0), (0, 0, 0, 1)])
    for to_world in (lamp, lamp @ np.diag([-1, 1, 1, 1])):
        _, u, v = square_of_mitsuba(to_world)
        normal = np.linalg.inv(to_world[:3, :3]).T @ (0, 0, 1)  # as Mitsuba has it: (0, -1, 0)
        assert np.allclose(np.cross(u, v) / np.linalg.norm(np.cross(u, v)), normal)

    fov = np.degrees(2 * np.arctan(np.tan(np.radians(45) / 2) * 32 / 48))  # 45 degrees along x
    camera = Camera((1, 2, 6), (0.2, 0.8, 0), up=(0, 1, 0), vertical_fov=fov, width=48, height=32)
    _, ways = camera.rays(np.array([48.0, 24.0]), np.array([16.0, 0.0]))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    # Mitsuba computes in float32 and prints six digits.
    assert np.allclose(ways[0], (0.259554, -0.179659, -0.948870), atol=2e-6)
    assert np.allclose(ways[1], (-0.131805, 0.073653, -0.988536), atol=2e-6)

    metal = RoughConductor((0.2, 0.92, 1.1), (3.9, 2.45, 2.1), roughness=0.09**0.5)
    objects = [
        Object(Rectangle(*square_of_mitsuba(floor)), Lambertian((0.6, 0.5, 0.4)), "floor"),
        Object(Sphere((0, 1, 0), 0.9), metal, "ball"),
        Object(Sphere((2, 0.5, 0.5), 0.4), Lambertian((0.2, 0.3, 0.7)), "small"),
    ]
    bulb = SphereLight((-2, 1.5, 1), 0.2, (10, 12, 14))
    lights = [RectangleLight(*square_of_mitsuba(lamp), (20, 18, 15)), bulb]
    result = render(Scene(camera, objects, lights), passes=64, threads=1)
    assert abs(result.mean - 0.2046) < 0.004  # half of the 95 % interval here is 0.004


@pytest.mark.slow
def test_sides_that_reflect_and_shine():
    lamp = [PointLight((1, 0, 3), 10)]
    front, back = (seen(s, Lambertian(0.5), lamp) for s in (SQUARE, SQUARE.flipped()))
    assert (front == back).all()
    assert (seen(SQUARE, Emissive(2)) == 2).all()
    assert (seen(SQUARE.flipped(), Emissive(2)) == 0).all()
    assert (seen(SQUARE, Lambertian(0.5), lamp, max_depth=0) == front).all()  # direct light


@pytest.mark.slow
def test_depths_of_mirrors_and_metal():
    assert (seen(SQUARE, Mirror(), sky=WHITE, max_depth=0) == 0).all()
    assert (seen(SQUARE, Mirror(), sky=WHITE, max_depth=1) == 1).all()
    metal = Metal(1, fuzz=0.01)  # no mirror to path, but to the others
    assert (seen(SQUARE, metal, sky=WHITE, max_depth=0) > 0.9).all()
    for integrator in ("whitted", "ppm", "photon_map"):
        assert (seen(SQUARE, metal, sky=WHITE, max_depth=0, integrator=integrator) == 0).all()
        assert (seen(SQUARE, metal, sky=WHITE, max_depth=1, integrator=integrator) > 0.9).all()
