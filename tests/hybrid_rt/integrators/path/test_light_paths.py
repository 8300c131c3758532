"""Light by way of mirrors and glass, with light subpaths and without."""

import math
from typing import ClassVar

import numpy as np
import pytest
import trimesh
from path_means import ALARM, irradiance
from scipy import stats
from shapes import dome

from hybrid_rt.integrators import PathOptions, workers
from hybrid_rt.lights import RectangleLight, SphereLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Metal, Mirror, Mix, Phong
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

pytestmark = pytest.mark.statistical


class TestLightPaths:
    """Light that mirrors and glass throw: from the lamps, and by chance from the camera."""

    FLOOR = Object(Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), Lambertian((0.7, 0.6, 0.5)))
    WALL = Object(Rectangle((-3, 3, 0), (6, 0, 0), (0, 0, 4)), Lambertian(0.6))
    LAMP = RectangleLight((-0.5, -0.5, 3.5), (0, 1, 0), (1, 0, 0), (10, 12, 8))
    BALL = Sphere((0, 0, 0.8), 0.6)
    GLASS = Object(BALL, Dielectric(1.5), "glass")
    MIRROR = Object(Sphere((1.4, 0.5, 0.6), 0.6), Mirror(0.9), "mirror")
    LENS = TriangleMesh(trimesh.creation.icosphere(2)).transformed(
        [[0.6, 0, 0, 0], [0, 0.6, 0, 0], [0, 0, 0.6, 0.8], [0, 0, 0, 1]])  # fmt: skip
    FROSTED = Object(BALL, RoughDielectric(1.5, 0.3, (0.1, 0.2, 0.3)), "frosted glass")
    SATIN = Object(Sphere((-1.2, -0.4, 0.45), 0.45), Metal(0.9, 0.2), "satin metal")
    POND = Object(Box((-2, -2, -0.1), (2, 2, 1.2)), Dielectric(1.33, (0.1, 0.2, 0.3)), "pond")
    STONE = Object(Sphere((0.8, 0, 0.4), 0.3), Lambertian(0.8), "stone")
    # Camera, lamp and a plate in it, all in one body of glass.
    AROUND = Object(Box((-2.5, -2.5, -0.5), (2.5, 2.5, 3)), Dielectric(1.5, priority=1), "around")
    PLATE = Box((-1, -1, 0.6), (1, 1, 0.9))
    INSIDE: ClassVar = {"look_from": (0, -1.6, 0.9), "look_at": (0, 0, 0.2), "vertical_fov": 70}

    # (objects beside the wall, lights, where the camera is, other settings)
    SCENES: ClassVar = {
        "rectangle": ([FLOOR, GLASS, MIRROR], [LAMP], {}, {}),
        "sphere": ([FLOOR, GLASS], [SphereLight((0, 0.5, 3), 0.3, 20)], {}, {}),
        "patch": ([FLOOR, GLASS, MIRROR, Object(dome(3.0), Emissive((6, 8, 9)))], [], {}, {}),
        "lens": ([FLOOR, GLASS, MIRROR], [LAMP], {"aperture": 0.3}, {}),
        "absorbing": (
            [FLOOR, Object(BALL, Dielectric(1.5, (0.5, 1, 0.1), tint=0.9))], [LAMP], {}, {}),
        "mixtures": (
            [Object(FLOOR.surface, Mix([(0.5, Lambertian(0.7)), (0.3, Mirror(0.9))])), GLASS,
             Object(MIRROR.surface, Mix([(0.4, Mirror(0.9)), (0.3, Dielectric(1.4)),
                                         (0.2, Phong(0.2, 0.7, 20))]))], [LAMP], {}, {}),
        "metal": ([Object(FLOOR.surface, Metal(0.8, 0.4)), GLASS, MIRROR], [LAMP], {}, {}),
        # What the metal shows is reached from the camera far more often than by a join.
        "lit wall in metal": (
            [Object(Box((-1.5, -1.5, 0), (1.5, 1.5, 0.6)), Metal(0.9, 0.3)),
             Object(Sphere((0, 0, 2.2), 0.6), Dielectric(1.5))],
            [SphereLight((0, 0, 2.2), 0.5, 9)], {}, {}),
        "camera in water": (
            [FLOOR, POND, STONE], [LAMP],
            {"look_from": (0, -1.5, 0.6), "look_at": (0, 0, 0.3), "vertical_fov": 60}, {}),
        "lamp in water": (
            [FLOOR, POND, STONE, Object(Sphere((-0.8, 0, 0.4), 0.3), Mirror())],
            [SphereLight((0, 0, 0.7), 0.2, 20)], {}, {}),
        "smooth glass": ([FLOOR, MIRROR, Object(LENS, Dielectric(1.5), smooth=True)], [LAMP], {}, {}),
        "smooth floor": (
            [MIRROR, GLASS, Object(LENS.transformed(np.diag([4, 4, 0.5, 1])), Lambertian(0.7),
                                   smooth=True)], [LAMP], {}, {}),
        "shining mirror": (
            [FLOOR, GLASS, Object(MIRROR.surface, Emissive(2.0, Mirror(0.5)))], [LAMP], {}, {}),
        "short": ([FLOOR, GLASS, MIRROR], [LAMP], {}, {"max_depth": 3}),
        # Narrow lobes: by next-event estimation there, by chance, and from the lamp.
        "frosted": ([FLOOR, FROSTED, SATIN, MIRROR], [LAMP], {}, {}),
        "frosted, short": ([FLOOR, FROSTED, SATIN], [LAMP], {}, {"max_depth": 2}),
        "frosted, shortest": ([FLOOR, FROSTED, SATIN], [LAMP], {}, {"max_depth": 1}),
        "frosted, of several lamps": (
            [FLOOR, FROSTED, SATIN, Object(dome(3.0), Emissive((6, 8, 9)))],
            [SphereLight((0, 0.5, 3), 0.3, 20), SphereLight((2, -1, 2), 0.1, 50)], {}, {}),
        "frosted lamp": (
            [FLOOR, FROSTED, MIRROR], [SphereLight((0, 0, 0.8), 0.2, 20)], {}, {}),
        "satin floor": ([Object(FLOOR.surface, SATIN.material), FROSTED, STONE], [LAMP], {}, {}),
        "satin mixtures": (
            [FLOOR, Object(BALL, Mix([(0.5, Metal(0.9, 0.2)), (0.3, Mirror(0.9))])),
             Object(SATIN.surface, Mix([(0.5, Metal(0.9, 0.15)), (0.4, Lambertian(0.7))])),
             Object(MIRROR.surface, Mix([(0.5, RoughDielectric(1.5, 0.3)), (0.3, Mirror(0.9))]))],
            [LAMP], {}, {}),
        # Rough glass is a delta surface where it is hidden in glass of higher priority.
        "hidden frosted": (
            [FLOOR, AROUND, Object(Torus((0, 0, 1.6), (0, 0, 1), 0.5, 0.2), Emissive(6.0)),
             Object(PLATE, RoughDielectric(1.5, 0.3))], [], INSIDE, {}),
        "hidden in a mixture": (
            [FLOOR, AROUND, Object(PLATE, Mix([(0.5, RoughDielectric(1.5, 0.3)),
                                               (0.5, Lambertian(0.8))]))],
            [RectangleLight((-0.5, -0.5, 2), (0, 1, 0), (1, 0, 0), 6)], INSIDE, {}),
        "camera in frosted glass": (
            [FLOOR, Object(Sphere((0, -1, 1), 2.5), RoughDielectric(1.5, 0.3)), STONE, SATIN],
            [LAMP], {"look_from": (0, -2, 1.2), "vertical_fov": 70}, {}),
    }  # fmt: skip

    def scene(self, name, n=24):
        objects, lights, view, settings = self.SCENES[name]
        place = {"look_from": (0, -5, 2.5), "look_at": (0, 0, 0.5), "vertical_fov": 45, **view}
        camera = Camera(up=(0, 0, 1), width=n, height=n, **place)
        return Scene(camera, [self.WALL, *objects], lights), settings

    @pytest.mark.parametrize("name", SCENES)
    def test_same_light_with_and_without(self, name):
        scene, settings = self.scene(name)
        without, found = (
            render(scene, passes=n, seed=n, options=PathOptions(light_paths=share), **settings)
            .report["noise"]
            for share, n in ((0.0, 120), (1.0, 60))
        )  # fmt: skip
        # Light paths are shared by all pixels of a pass: the errors are those between passes.
        errors = [noise["standard_error_of_image_mean"] for noise in (without, found)]
        gap = abs(without["image_mean"] - found["image_mean"])
        assert gap < stats.norm.isf(ALARM / 2) * math.hypot(*errors)

    @pytest.mark.parametrize(("share", "passes"), [(0.0, 64), (64.0, 16)])
    def test_irradiance_by_way_of_a_mirror(self, share, passes):
        """The lamp shines up into a mirror at z = 3; its image hangs at z = 5."""
        n, low, high = 24, np.array([-0.6, -0.4]), np.array([0.4, 0.8])
        lamp = RectangleLight((*low, 1.0), (1.0, 0, 0), (0, 1.2, 0), 20.0)
        mirror = Object(Rectangle((-20, -20, 3), (40, 0, 0), (0, 40, 0)), Mirror(0.8))
        floor = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5))
        camera = Camera((3.0, -4.0, 2.5), (2.0, 0.5, 0.0), (0, 0, 1), 30, n, n)
        result = render(
            Scene(camera, [floor, mirror], [lamp]), passes=passes, max_depth=2,
            options=PathOptions(light_paths=share),
        )  # fmt: skip
        fine = (np.arange(4 * n) + 0.5) / 4
        row, column = (a.ravel() for a in np.meshgrid(fine, fine, indexing="ij"))
        origins, directions = camera.rays(column, row)
        places = origins - directions * (origins[:, 2:] / directions[:, 2:])
        expected = 0.5 / math.pi * 0.8 * 20 * irradiance(places[:, 0], places[:, 1], 5, low, high)
        # The lamp's own back hides a part of its image, but not from where the camera looks.
        assert directions[:, 2].max() < 0
        noise = result.report["noise"]
        limit = stats.norm.isf(ALARM / 2) * noise["standard_error_of_image_mean"]
        assert abs(noise["image_mean"] - expected.mean()) < limit
        if share:
            # Part by part: nothing is put where it does not belong. Each part counts about 300
            # paths: four standard errors.
            found = result.image[:, :, 0].reshape(4, n // 4, 4, n // 4).mean(axis=(1, 3))
            wanted = expected.reshape(4, n, 4, n).mean(axis=(1, 3))
            assert np.abs(found / wanted - 1).max() < 0.25

    def test_noise_falls(self):
        """Here to 0.53, at equal passes; chance alone would not take it below 0.9."""
        scene, _ = self.scene("sphere", 48)
        noise = [
            render(scene, passes=16, options=PathOptions(light_paths=share)).report["noise"]
            for share in (0.0, 0.5)
        ]
        with_, without = (n["root_mean_square_standard_error_of_pixels"] for n in noise[::-1])
        assert with_ < 0.6 * without

    def test_threads_and_blocks_change_no_bit(self, monkeypatch):
        scene, _ = self.scene("mixtures")
        before = render(scene, passes=5, threads=2).image
        monkeypatch.setattr(workers, "BLOCK", 1000)
        monkeypatch.setattr(workers, "TOGETHER", 1000)
        np.testing.assert_array_equal(render(scene, passes=5, threads=3).image, before)

    def test_mirrors_that_no_lamp_reaches_cost_nothing(self):
        """The first light paths say so; plan and report show that no more were sent."""
        scene, _ = self.scene("rectangle")
        beyond = Object(Sphere((50, 50, -40), 0.5), Mirror())
        result = render(Scene(scene.camera, [self.FLOOR, beyond], scene.lights), passes=2)
        assert "light paths" in result.report["plan"]["light"]["left_out"]
        assert "light paths" not in result.report["rays"]
