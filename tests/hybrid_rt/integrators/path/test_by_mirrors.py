"""Lamps by way of flat mirrors: the light is that found by chance, with less noise."""

from typing import ClassVar

import numpy as np
import pytest
import trimesh
from marks import nightly_but
from same_light import assert_same_light

from hybrid_rt import (
    Box,
    Camera,
    CheckerTexture,
    Dielectric,
    ImageEnvironment,
    Lambertian,
    Mirror,
    Mix,
    Object,
    PathOptions,
    Phong,
    Plane,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    TriangleMesh,
    TrimmedSurface,
    circle,
    render,
)
from hybrid_rt.demo import teapot
from hybrid_rt.integrators.path.mirrors import mirrors_of
from hybrid_rt.scene.compiled import compile_scene

FLOOR = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.6))
POLISHED = Mix([(0.6, Lambertian(0.5)), (0.4, Mirror((0.9, 0.7, 0.5)))])
# A pane before the camera: all is seen through glass, so no light path can be connected to it.
FRONT = Object(Box((-0.4, -3.3, 2.9), (0.4, -3.25, 3.9)), Dielectric(1.5))
SKEW = Rectangle((-2.5, 1.5, -0.5), (4.5, 0.7, 0.4), (0.8, 0.5, 3.0))
BESIDE = Rectangle((2.0, -2.0, 0.2), (0.3, 4.0, 0.0), (0.4, 0.0, 3.0))
LAMP = RectangleLight((-0.6, -0.6, 4.0), (0, 1.2, 0), (1.2, 0, 0), 20.0)
BULB = SphereLight((1.0, -0.5, 2.5), 0.3, 20.0)


def scene(objects, lights, environment=None, n=24):
    camera = Camera((0, -3.5, 3.5), (0, 0.8, 0.4), (0, 0, 1), 50, n, n)
    return Scene(camera, [FRONT, *objects], lights, environment)


def table(objects, *, alone=False):
    return mirrors_of(compile_scene(scene(objects, [LAMP])), alone=alone)


@pytest.mark.statistical
class TestPictures:
    SCENES: ClassVar = {
        "mirror": ([FLOOR, Object(SKEW, Mirror((0.9, 0.7, 0.5)))], [LAMP], {}),
        "bulb": ([FLOOR, Object(SKEW, Mirror(0.9))], [BULB], {}),
        "two, and two lamps": (
            [FLOOR, Object(SKEW, Mirror(0.9)), Object(BESIDE, Mirror(0.8))], [LAMP, BULB], {}),
        "mirrors in part": (
            [Object(FLOOR.surface, POLISHED), Object(SKEW, POLISHED)], [LAMP], {}),
        "a glossy floor": (
            [Object(FLOOR.surface, Phong(0.3, 0.4, 20)), Object(SKEW, Mirror(0.9))], [LAMP], {}),
        "seen from behind": (
            [FLOOR, Object(Rectangle(SKEW.corner, SKEW.edge_v, SKEW.edge_u), Mirror(0.9))],
            [BULB], {}),
        "beside a ball": (
            [Object(FLOOR.surface, POLISHED), Object(SKEW, Mirror(0.9)),
             Object(Sphere((0.3, 0.4, 0.8), 0.5), Dielectric(1.5))], [BULB], {}),
        "short": ([Object(FLOOR.surface, POLISHED), Object(SKEW, POLISHED)], [BULB], {"max_depth": 4}),
    }  # fmt: skip

    @pytest.mark.parametrize(
        "name", nightly_but(SCENES, "two, and two lamps", "mirrors in part", "short")
    )
    def test_same_light_as_by_chance(self, name):
        """Without light paths no mirror is asked."""
        objects, lights, settings = self.SCENES[name]
        found = assert_same_light(
            scene(objects, lights), PathOptions(light_paths=0.0), 240, 80, **settings
        )
        n_mirrors = sum(isinstance(o.surface, Rectangle) for o in objects if o is not FLOOR)
        n_mirrors -= name == "a glossy floor"
        used = found.report["plan"]["light"]["used"]["ways by mirrors and glass"]
        assert f"flat mirrors ({n_mirrors})" in used

    @pytest.mark.nightly
    def test_same_light_beside_a_sky(self):
        """With a sky that is asked by glass, a mirror in part is left to chance."""
        sky = np.full((16, 32, 3), 0.1)
        sky[3:6, 16:20] = 30.0
        objects = [Object(FLOOR.surface, POLISHED), Object(SKEW, Mirror(0.9))]
        world = scene(objects, [BULB], ImageEnvironment(sky, (0, 0, 1)))
        found = assert_same_light(world, PathOptions(light_paths=0.0), 240, 120)
        used = found.report["plan"]["light"]["used"]["ways by mirrors and glass"]
        assert "flat mirrors (1)" in used
        assert "the sky" in used

    def test_noise_falls(self):
        """By chance a path meets the bulb by way of the mirror once in hundreds of times. 0.10 was measured."""
        noise = [
            render(scene([FLOOR, Object(SKEW, mirror)], [BULB], n=48), passes=64, seed=1).report[
                "noise"
            ]["relative_rmse_trimmed"]
            for mirror in (Mirror(0.9), Mirror(CheckerTexture(0.9, 0.9)))
        ]
        assert noise[0] < 0.4 * noise[1]


class TestTable:
    def test_only_mirrors_of_one_colour(self):
        for material in (
            Lambertian(0.5),
            Phong(0.3, 0.4, 20),
            Dielectric(1.5),
            Mirror(CheckerTexture(0.2, 0.9)),
            Mix([(0.5, Mirror(1.0)), (0.5, Dielectric(1.5))]),
        ):
            assert table([Object(SKEW, material)]).surface.size == 0
        assert table([Object(SKEW, POLISHED)]).surface.tolist() == [1]
        assert table([Object(SKEW, POLISHED)], alone=True).surface.size == 0

    def test_the_lobe_of_a_mixture(self):
        mirrors = table([Object(SKEW, POLISHED)])
        np.testing.assert_allclose(mirrors.color[0], 0.4 * np.array([0.9, 0.7, 0.5]), rtol=1e-12)
        assert mirrors.chance[0] == pytest.approx(0.4)

    def test_places_on_a_skew_mirror(self):
        mirrors = table([Object(SKEW, Mirror(0.9))])
        np.testing.assert_allclose(
            mirrors.along[0] @ (SKEW.point(0.3, 0.8) - mirrors.corner[0]), [0.3, 0.8], rtol=1e-12
        )

    @pytest.mark.parametrize(
        "other",
        [
            Rectangle((1, 1, 0), (1, 0, 0), (0, 1, 0)),
            Plane((0, 0, 0), (0, 0, 1)),
            TriangleMesh(trimesh.Trimesh([(1, 1, 0), (2, 1, 0), (2, 2, 0)], [(0, 1, 2)])),
            TrimmedSurface(Rectangle((1, 1, 0), (1, 0, 0), (0, 1, 0)), [circle((0.5, 0.5), 0.3)]),
        ],
        ids=["rectangle", "plane", "mesh", "trimmed"],
    )
    def test_covered_ones_are_left_to_chance(self, other):
        assert table([Object(FLOOR.surface, Mirror(0.9))]).surface.size == 1
        covered = table([Object(FLOOR.surface, Mirror(0.9)), Object(other, Lambertian(0.5))])
        assert covered.surface.size == 0

    def test_on_a_slanted_mirror(self):
        on_it = Rectangle(SKEW.point(0.4, 0.4), 0.2 * SKEW.edge_u, 0.2 * SKEW.edge_v)
        away = Rectangle(SKEW.point(0.4, 0.4) + 1e-6, 0.2 * SKEW.edge_u, 0.2 * SKEW.edge_v)
        for other, n in ((on_it, 0), (away, 1)):
            found = table([Object(SKEW, Mirror(0.9)), Object(other, Lambertian(0.5))])
            assert found.surface.size == n

    def test_bodies_that_stand_on_a_mirror_cover_nothing(self):
        bodies = [Box((1, 1, 0), (2, 2, 1)), Sphere((0, 0, 1), 1), teapot()]
        objects = [Object(body, Lambertian(0.5)) for body in bodies]
        assert table([Object(FLOOR.surface, Mirror(0.9)), *objects]).surface.tolist() == [1]

    def test_walls_at_the_rim_cover_nothing(self):
        wall = Rectangle((-4, 4, 0), (8, 0, 0), (0, 0, 4))
        beside = Rectangle((4, -4, 0), (8, 0, 0), (0, 8, 0))
        objects = [
            Object(FLOOR.surface, Mirror(0.9)),
            Object(wall, Mirror(0.9)),
            Object(beside, Mirror(0.9)),
        ]
        assert table(objects).surface.size == 3
