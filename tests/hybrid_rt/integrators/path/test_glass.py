"""Paths through glass, and through bodies within bodies, in closed form."""

import math

import numpy as np
import pytest
from path_means import assert_mean_equals, many_rays, samples
from shapes import ball_of_revolution

from hybrid_rt.lights import GradientSky, PointLight, SphereLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture

WHITE_SKY = GradientSky(1.0, 1.0)

pytestmark = pytest.mark.statistical


def through_layers(indices, depths):
    """Return the radiance that layers show head-on in the midst of radiance one: all reflections.

    Layer by layer (the adding method); ``depths`` are the optical depths of the inner layers.
    """
    through, back_front, back_rear = 1.0, 0.0, 0.0
    for k in range(len(indices) - 1):
        r = ((indices[k] - indices[k + 1]) / (indices[k] + indices[k + 1])) ** 2
        t, ring = 1.0 - r, 1.0 / (1.0 - back_rear * r)
        back_front += through**2 * r * ring
        back_rear = r + t * t * back_rear * ring
        through *= t * ring
        if k < len(depths):
            a = math.exp(-depths[k])
            through, back_rear = through * a, back_rear * a * a
    return back_front + through


class TestGlass:
    def view(self, bodies, look_from=(0, 0, 5), sky=WHITE_SKY):
        camera = many_rays(look_from, (0, 0, -9), (0, 1, 0), n=32)
        return Scene(camera, bodies, environment=sky)

    @staticmethod
    def slab(low, high, material):
        return Object(Box((-50, -50, low), (50, 50, high)), material, f"slab {low}")

    def test_absorbing_slab(self):
        scene = self.view([self.slab(0, 1, Dielectric(1.5, (0.1, 0.7, 2.0)))])
        expected = [through_layers([1, 1.5, 1], [a]) for a in (0.1, 0.7, 2.0)]
        assert_mean_equals(samples(scene, max_depth=60), expected)

    def test_body_within_a_body(self):
        scene = self.view([
            self.slab(0, 3, Dielectric(1.5, 0.1)), self.slab(1, 2, Dielectric(2.4, 0.4)),
        ])  # fmt: skip
        expected = through_layers([1, 1.5, 2.4, 1.5, 1], [0.1, 0.4, 0.1])
        assert_mean_equals(samples(scene, max_depth=60), np.full(3, expected))

    @pytest.mark.parametrize("order", [1, -1])
    def test_overlapping_bodies_by_priority(self, order):
        glass = self.slab(1, 2, Dielectric(1.8, 0.2, priority=2))
        drink = self.slab(0, 1.5, Dielectric(1.3, 0.5, priority=1))
        scene = self.view([glass, drink][::order])
        expected = through_layers([1, 1.8, 1.3, 1], [0.2, 0.5])
        assert_mean_equals(samples(scene, max_depth=60), np.full(3, expected))

    def test_camera_within_nested_bodies(self):
        bodies = [self.slab(0, 3, Dielectric(1.5, 0.1)), self.slab(1, 2, Dielectric(2.4, 0.4))]
        bodies.append(Object(Box((-40, -40, 1.5), (40, 40, 1.6)), Dielectric(1.1), "bubble"))
        inside = self.view(bodies, (0, 0, 1.55))
        # Beyond the walls of the bubble nothing but clear layers: no light is lost without
        # absorption, and what absorbs is what lies on the way.
        clear = self.view(
            [Object(body.surface, Dielectric(float(ior)), "clear") for body, ior in
             zip(bodies, (1.5, 2.4, 1.1), strict=True)], (0, 0, 1.55))  # fmt: skip
        # Radiance within an index n is n^2 times that outside.
        assert_mean_equals(samples(clear, max_depth=200), np.full(3, 1.1**2))
        assert samples(inside, max_depth=60).mean() < 0.95 * 1.1**2

    @pytest.mark.parametrize("n_shells", [5, 8])
    @pytest.mark.parametrize("integrator", ["path", "whitted"])
    def test_shells_in_an_even_light_are_not_seen(self, n_shells, integrator):
        """White furnace: radiance 1 outside, and n^2 times that within an index n."""
        shells = [
            Object(Sphere((0, 0, 0), 3.0 - 0.3 * k), Dielectric(1.2 + 0.1 * k), f"shell {k}")
            for k in range(n_shells)
        ]
        sky = GradientSky((1, 1, 1), (1, 1, 1))
        for eye, expected in (((0, -12, 0), 1.0), ((0, -0.1, 0), (1.1 + 0.1 * n_shells) ** 2)):
            camera = Camera(eye, (0, 1, 0), (0, 0, 1), 20, 8, 8)
            scene = Scene(camera, shells, environment=sky)
            result = render(scene, integrator, passes=8, max_depth=200)
            # What roulette takes from some it gives to others.
            assert result.image.mean() == pytest.approx(expected, rel=0.02)
            assert not result.report["clear_bodies_not_closed"]

    @pytest.mark.parametrize("order", [1, -1])
    @pytest.mark.parametrize("integrator", ["path", "whitted"])
    def test_cube_of_glass_on_cube_of_glass(self, integrator, order):
        """No air comes between: two slabs of the same glass are one, of others three media."""
        lower, upper = Dielectric(1.5, 0.1), Dielectric(1.5, 0.1)
        water = Dielectric(1.33, 0.3)
        for bodies, indices, depths in (
            ([self.slab(0, 1, lower), self.slab(1, 3, upper)], [1, 1.5, 1], [0.3]),
            ([self.slab(0, 1, lower), self.slab(1, 3, lower)], [1, 1.5, 1], [0.3]),
            ([self.slab(0, 1, lower), self.slab(1, 3, water), self.slab(3, 4, upper)],
             [1, 1.5, 1.33, 1.5, 1], [0.1, 0.6, 0.1]),
        ):  # fmt: skip
            scene = self.view(bodies[::order])
            image = render(scene, integrator, passes=16, max_depth=40).image.reshape(-1, 3)
            expected = through_layers(indices, depths)
            if integrator == "path":
                assert_mean_equals(image.astype(float), np.full(3, expected))
            else:
                # Branches below a thousandth are not followed: a few of them are lost here.
                np.testing.assert_allclose(image, expected, atol=2e-3)

    @pytest.mark.parametrize("order", [1, -1])
    def test_camera_within_the_lower_of_two_cubes(self, order):
        bodies = [self.slab(0, 1, Dielectric(1.5)), self.slab(1, 3, Dielectric(1.33))][::order]
        scene = self.view(bodies, (0, 0, 0.5))
        # Clear layers lose nothing; radiance within an index n is n^2 times that outside.
        assert_mean_equals(samples(scene, max_depth=200), np.full(3, 1.5**2))

    @pytest.mark.parametrize("order", [1, -1])
    def test_water_that_fills_a_glass(self, order):
        """A shell and what fills it, sharing a sphere: as a ball of water within a ball of glass."""
        water, glass = Dielectric(1.33, (0.1, 0.2, 0.4)), Dielectric(1.5, (0.4, 0.1, 0.2))
        camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 30, 24, 24)
        outer, inner = Sphere((0, 0, 0), 1), Sphere((0, 0, 0), 0.8)
        shell = [Object(outer, glass), Object(inner.flipped(), glass), Object(inner, water)]
        sky = GradientSky((0.1, 0.5, 0.9), (0.9, 0.4, 0.1))
        filled = Scene(camera, shell[::order], environment=sky)
        nested = Scene(camera, [Object(outer, glass), Object(inner, water)], environment=sky)
        a, b = (render(scene, passes=32, seed=3).image.reshape(-1, 3) for scene in (filled, nested))
        # Surfaces and random numbers are the same.
        np.testing.assert_allclose(a, b, rtol=1e-4, atol=1e-5)

    @pytest.mark.parametrize("order", [1, -1])
    @pytest.mark.parametrize("integrator", ["path", "whitted"])
    def test_glass_that_lies_on_a_floor(self, integrator, order):
        """Light meets the floor through the glass, whichever comes first in the list."""
        floor = Object(Rectangle((-50, -50, 0), (100, 0, 0), (0, 100, 0)), Emissive(1.0))
        scene = self.view([floor, self.slab(0, 1, Dielectric(1.5, 0.3))][::order], sky=None)
        image = render(scene, integrator, passes=16, max_depth=20).image.reshape(-1, 3)
        # Radiance one within the glass; a share r stays inside and is lost in the black floor.
        expected = math.exp(-0.3) * (1 - 0.04) / 1.5**2
        if integrator == "path":
            assert_mean_equals(image.astype(float), np.full(3, expected))
        else:
            np.testing.assert_allclose(image, expected, rtol=1e-4)

    @pytest.mark.parametrize(
        "square", [Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Sphere((0, 0, 0), 0.9)]
    )
    def test_of_two_identical_surfaces_the_first_is_seen(self, square):
        """Also where clear bodies touch elsewhere."""
        camera = Camera((0, -2, 2), (0, 0, 0), (0, 0, 1), 50, 12, 12)
        lamp = SphereLight((0, 0, 3), 0.5, 3.0)

        def picture(*colors):
            objects = [Object(square, Lambertian(color)) for color in colors]
            objects += [self.slab(-9, -8, Dielectric(1.5)), self.slab(-8, -7, Dielectric(1.3))]
            return render(Scene(camera, objects, [lamp], WHITE_SKY), passes=4, max_depth=4).image

        np.testing.assert_array_equal(picture(0.8, 0.1), picture(0.8))

    def test_exact_ball_of_revolution_looks_like_the_sphere(self):
        def scene(surface):
            floor = Object(
                Rectangle((-4, -4, -1.2), (8, 0, 0), (0, 8, 0)),
                Lambertian(CheckerTexture(0.8, 0.2, 3)),
            )
            lamp = SphereLight((2, -2, 4), 1.0, 12.0)
            camera = Camera((0, -5, 1.5), (0, 0, -0.2), (0, 0, 1), 40, 40, 30)
            return Scene(camera, [Object(surface, Dielectric(1.5)), floor], [lamp], WHITE_SKY)

        exact = render(scene(Sphere((0, 0, 0), 1)), passes=16).image
        lathe = render(scene(ball_of_revolution((0, 0, 0), 1.0)), passes=16, seed=1).image
        gap = (exact - lathe).astype(float).reshape(-1, 3)
        assert_mean_equals(gap, np.zeros(3))

    @pytest.mark.parametrize("integrator", ["path", "whitted"])
    def test_lamps_shine_through_what_absorbs(self, integrator):
        """A lamp, a floor and the camera within one dark body of index one."""
        floor = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
        dark = Object(Box((-20, -20, -1), (20, 20, 20)), Dielectric(1.0, (0.2, 0.5, 1.0)), "body")
        camera = many_rays((0, -3, 4), (0, 0, 0), n=4)
        scene = Scene(camera, [floor, dark], [PointLight((0, 0, 2), 4.0)])
        image = render(scene, integrator, passes=1).image.reshape(-1, 3)
        way = 2.0 + 5.0
        expected = 0.5 / math.pi * np.exp(-np.array([0.2, 0.5, 1.0]) * way)
        np.testing.assert_allclose(image, np.tile(expected, (16, 1)), rtol=1e-5)
