"""What a matt floor receives from each light, in closed form or by ways that agree."""

import math
from typing import ClassVar

import numpy as np
import pytest
import trimesh
from path_means import assert_mean_equals, assert_means_agree, many_rays, samples
from shapes import ball_of_revolution, dome

from hybrid_rt.integrators import PathOptions
from hybrid_rt.lights import GradientSky, ImageEnvironment, PointLight, RectangleLight, SphereLight
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture

pytestmark = pytest.mark.statistical


class TestLights:
    """What a matt floor receives from each light."""

    FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
    LIGHTS: ClassVar = {
        "rectangle": ([], [RectangleLight((0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 2, 3))], None),
        "sphere": ([], [SphereLight((0.5, 0, 1.5), 0.6, 2.0)], None),
        "near sphere": ([], [SphereLight((0, 0, 0.501), 0.5, 2.0)], None),
        "patch": ([Object(dome(), Emissive((1, 2, 4)))], [], None),
        "revolution": ([Object(ball_of_revolution((0.5, 0, 1.5), 0.6), Emissive(2.0))], [], None),
        "shining sphere": ([Object(Sphere((0.5, 0, 1.5), 0.6), Emissive(2.0))], [], None),
        "checkered sphere": (
            [Object(Sphere((0.5, 0, 1.5), 0.6), Emissive(CheckerTexture(3.0, 0.5, 9)))], [], None),
        "box": ([Object(Box((-0.5, -0.5, 1), (0.5, 1, 1.5)), Emissive(1.0))], [], None),
        "mesh": ([Object(TriangleMesh(trimesh.creation.torus(0.6, 0.2, 12, 8)).transformed(
            [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 1.0], [0, 0, 0, 1]]), Emissive(1.0))], [], None),
        # It is shaded as if round, but sampled and seen by its faces.
        "smooth mesh": ([Object(TriangleMesh(trimesh.creation.icosahedron()).transformed(
            [[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 0.5, 0.7], [0, 0, 0, 1]]), Emissive(1.0),
            smooth=True)], [], None),
        "torus": ([Object(Torus((0.2, 0, 1), (0.3, 0, 1), 0.6, 0.2), Emissive(2.0))], [], None),
        "gradient": ([], [], GradientSky((0.1, 0.2, 0.3), (0.9, 0.3, 0.0), (0, 0.6, 0.8))),
        "picture": ([], [], ImageEnvironment(
            np.random.default_rng(2).random((8, 16, 3)) ** 4, (0, 0, 1))),
        "two and sky": (
            [], [SphereLight((1, 0, 1.5), 0.6, 2), RectangleLight((-1, 0, 1), (0, 1, 0), (1, 0, 0), 9)],
            GradientSky(0.1, 0.5, (0, 0, 1))),
    }  # fmt: skip

    def scene(self, name):
        objects, lights, sky = self.LIGHTS[name]
        camera = many_rays((0.0, -1.0, 0.02), (0, 0, 0))
        return Scene(camera, [self.FLOOR, *objects], lights, sky)

    @pytest.mark.parametrize("name", LIGHTS)
    def test_asking_lights_running_into_them_and_both_agree(self, name):
        found = {
            strategy: samples(self.scene(name), 32, options=PathOptions(strategy=strategy), seed=i)
            for i, strategy in enumerate(("both", "lights", "directions"))
        }
        assert found["both"].mean() > 0.02
        assert_means_agree(found["both"], found["lights"])
        assert_means_agree(found["both"], found["directions"])
        # Together they are never much worse than the better one.
        spread = {strategy: values.std() for strategy, values in found.items()}
        assert spread["both"] < 1.6 * min(spread["lights"], spread["directions"]) + (
            0.01 * found["both"].mean()
        )

    @pytest.mark.parametrize("name", [name for name in LIGHTS if name != "near sphere"])
    def test_whitteds_method_asks_all_lights_for_the_same(self, name):
        scene = self.scene(name)
        asked = render(scene, "whitted", passes=16).image.reshape(-1, 3).astype(float)
        assert_means_agree(asked, samples(scene, 16, max_depth=0, seed=5))

    @pytest.mark.parametrize("name", ["sphere", "shining sphere", "revolution"])
    def test_irradiance_of_a_sphere(self, name):
        """A sphere wholly above the horizon: pi L (r / d)^2 cos."""
        square = 0.5**2 + 1.5**2
        irradiance = math.pi * 2.0 * 0.6**2 / square * 1.5 / math.sqrt(square)
        assert_mean_equals(samples(self.scene(name)), np.full(3, 0.5 / math.pi * irradiance))

    def test_point_light(self):
        lamp = PointLight((0, 0, 2), (4, 8, 12))
        found = samples(Scene(many_rays((0, -1, 1), (0, 0, 0)), [self.FLOOR], [lamp]), 2)
        np.testing.assert_allclose(
            found, np.tile(0.5 / math.pi * np.array([1, 2, 3]), (1024, 1)), rtol=1e-5
        )

    def test_backs_are_black_and_cast_shadows(self):
        down = RectangleLight((-1, -1, 1), (0, 2, 0), (2, 0, 0), 1.0)
        camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 30, 4, 4)
        assert not samples(Scene(camera, [self.FLOOR], [down]), 2).any()
