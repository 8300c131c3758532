"""White furnaces: radiances in even light, known in closed form."""

import math
from itertools import product
from typing import ClassVar

import numpy as np
import pytest
import trimesh
from path_means import assert_mean_equals, many_rays, samples
from shapes import ball_of_revolution

from hybrid_rt.integrators import PathOptions
from hybrid_rt.lights import GradientSky, ImageEnvironment, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Metal, Mirror, Mix, Phong
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

WHITE_SKY = GradientSky(1.0, 1.0)

pytestmark = pytest.mark.statistical


class TestFurnace:
    """In the midst of radiance one a surface sends on its albedo, whoever shines."""

    ENCLOSURES: ClassVar = {
        "sky": ([], [], WHITE_SKY),
        "picture": ([], [], ImageEnvironment(np.ones((4, 8, 3)))),
        "sphere": ([Sphere((0.3, 0, 0), 4).flipped()], [], None),
        "box": ([Box((-4, -3, -5), (4, 5, 3)).flipped()], [], None),
        "mesh": ([TriangleMesh(trimesh.creation.icosahedron()).transformed(
            np.diag([5.0, 4, 4, 1])).flipped()], [], None),
        "revolution": ([ball_of_revolution((0, 0, 0.4), 4.0).flipped()], [], None),
        "planes": ([Plane((0, 0, -3), (0, 0, 1)), Plane((0, 0, 3), (0, 0, -1))], [], WHITE_SKY),
    }  # fmt: skip

    def scene(self, material, enclosure):
        surfaces, lights, sky = self.ENCLOSURES[enclosure]
        objects = [Object(Sphere((0, 0, 0), 1), material, "ball")]
        objects += [Object(surface, Emissive(1.0), "enclosure") for surface in surfaces]
        return Scene(many_rays((2, -1, 0.5), (0.2, -0.1, 0)), objects, lights, sky)

    # No point of a plane can be chosen: planes that shine are found by directions only.
    WAYS: ClassVar = [
        (enclosure, strategy)
        for enclosure, strategy in product(ENCLOSURES, ("both", "lights", "directions"))
        if (enclosure, strategy) != ("planes", "lights")
    ]

    @pytest.mark.parametrize(("enclosure", "strategy"), WAYS)
    def test_every_way_of_finding_every_light(self, enclosure, strategy):
        color = np.array([0.2, 0.5, 1.0])
        found = samples(
            self.scene(Lambertian(color), enclosure), options=PathOptions(strategy=strategy)
        )
        assert_mean_equals(found, color)

    @pytest.mark.parametrize(
        ("material", "albedo"),
        [
            (Mirror(0.7), 0.7),
            (Metal(0.7, 0.0), 0.7),
            (Dielectric(1.5), 1.0),
            (Dielectric(1.5, schlick=True), 1.0),
            (Dielectric(0.6), 1.0),
            (Mix([(0.3, Lambertian(0.5)), (0.5, Mirror(0.4)), (0.2, Dielectric(1.3))]), None),
            (Mix([(0.25, Lambertian(0.5)), (0.5, Lambertian(0.2))]), 0.225),
            (Emissive((0.1, 0.2, 0.3), Lambertian(0.5)), np.array([0.6, 0.7, 0.8])),
            (Emissive(0.25), 0.25),
        ],
    )
    def test_every_material(self, material, albedo):
        # What is clear and white is followed to its end: a path in 1e6 that roulette ends would
        # decide the mean of these few.
        found = samples(
            self.scene(material, "sky"), max_depth=60, options=PathOptions(survival=1.0)
        )
        if albedo is None:
            # Light that enters the clear part meets the mixed inside again: only bounds are known.
            assert 0.15 + 0.2 < found.mean() < 1.0
            return
        assert_mean_equals(found, np.broadcast_to(albedo, 3))

    @pytest.mark.parametrize("exponent", [1.0, 20.0])
    def test_highlights_at_normal_incidence(self, exponent):
        """There the lobe is cut nowhere: its albedo is (n + 2) times the integral of c^(n + 1)."""
        scene = self.scene(Phong(0.25, 0.5, exponent), "sky")
        camera = many_rays((2, 0, 0), (0, 0, 0))
        assert_mean_equals(samples(scene.with_camera(camera)), np.full(3, 0.75))

    @pytest.mark.parametrize("fuzz", [0.2, 1.0])
    def test_metal_at_normal_incidence(self, fuzz):
        """Integral of p cos: closed form for fuzz one, 2 c^4 dc 2 = 4/5; else by quadrature."""
        scene = self.scene(Metal(0.5, fuzz), "sky").with_camera(many_rays((2, 0, 0), (0, 0, 0)))
        c = 1 - (1 - math.sqrt(1 - fuzz**2)) * (np.arange(20000) + 0.5) / 20000
        h = np.sqrt(fuzz**2 - 1 + c * c)
        density = h * (3 * c * c + h * h) / fuzz**3
        albedo = 0.5 * (density * c).mean() * (1 - math.sqrt(1 - fuzz**2))
        if fuzz == 1.0:
            assert albedo == pytest.approx(0.4, rel=1e-4)
        assert_mean_equals(samples(scene), np.full(3, albedo))

    @pytest.mark.parametrize("albedo", [0.0, 0.5, 0.8])
    def test_closed_shining_room(self, albedo):
        room = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(albedo)))
        camera = Camera((0, 0, 0), (1, 0, 0), (0, 0, 1), 90, 24, 24)
        found = samples(Scene(camera, [room]), max_depth=100)
        assert_mean_equals(found, np.full(3, 1 / (1 - albedo)))

    def test_white_room_ends_and_says_what_is_lost(self):
        room = Object(Sphere((0, 0, 0), 1).flipped(), Emissive(1.0, Lambertian(1.0)), "room")
        camera = Camera((0, 0, 0), (1, 0, 0), (0, 0, 1), 90, 8, 8)
        result = render(
            Scene(camera, [room]), passes=4, max_depth=9, options=PathOptions(survival=1.0)
        )
        # Emission at the hit, after each of nine directions, and by the last ray: 1 + 9 + 1.
        np.testing.assert_allclose(result.image, 11.0, rtol=1e-5)
        ended = result.report["ended_branches"]
        assert ended["at max_depth"] == 4 * 8 * 8
        assert ended["lost_weight_per_camera_ray"] == pytest.approx(1.0)
        assert ended["lost_share"] == pytest.approx(1.0)

    @pytest.mark.parametrize("integrator", ["path", "whitted", "ppm"])
    @pytest.mark.parametrize("bodies", ["cube", "overlapping"])
    def test_what_is_lost_in_glass_is_what_is_missing(self, bodies, integrator):
        # Before a white sky clear glass is as bright as the sky: the rest was cut off in it.
        glass = [(Box((-0.8, -0.7, -0.6), (0.8, 0.7, 0.6)), Dielectric(2.4))]
        if bodies == "overlapping":
            places = [((0, 0, 0), 1.0, 1.5), ((0.6, 0, 0), 0.8, 2.2), ((-0.5, 0.2, 0), 0.7, 1.8)]
            glass = [
                (Sphere(at, radius), Dielectric(n, priority=k))
                for k, (at, radius, n) in enumerate(places)
            ]
        camera = Camera((1.5, -4.6, 1.2), (0, 0, 0), (0, 0, 1), 16, 24, 24)
        scene = Scene(camera, [Object(*body) for body in glass], [], GradientSky(1.0, 1.0))
        result = render(scene, integrator, passes=16, max_depth=3, threads=1)
        missing = 1.0 - float(result.image.mean())
        ended = result.report["ended_branches"]
        assert missing > 0.05
        # By path and ppm each is a mean over 9216 rays, of which nearly all agree.
        assert ended["lost_share"] == pytest.approx(missing, rel=0.01)
        assert ended["lost_weight_per_camera_ray"] == pytest.approx(missing, rel=0.01)

    def test_what_is_lost_counts_by_what_emissive_surfaces_send(self):
        # A pipe of mirrors with an emissive end, against a render that cuts nothing off. What is cut
        # off would have lost some more in further reflections, so half of it is allowed.
        walls = [
            Rectangle((-1, -1, 0), (0, 0, 6), (2, 0, 0)),
            Rectangle((1, -1, 0), (0, 0, 6), (0, 2, 0)),
            Rectangle((1, 1, 0), (0, 0, 6), (-2, 0, 0)),
            Rectangle((-1, 1, 0), (0, 0, 6), (0, -2, 0)),
        ]
        end = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Emissive(1.0))
        camera = Camera((0.1, 0.2, 5.9), (0, 0, 0), (0, 1, 0), 140, 24, 24)
        scene = Scene(camera, [end, *(Object(wall, Mirror(0.9)) for wall in walls)])
        short, deep = (render(scene, passes=16, max_depth=depth) for depth in (3, 200))
        missing = 1.0 - float(short.image.mean()) / float(deep.image.mean())
        assert missing > 0.1
        assert short.report["ended_branches"]["lost_share"] == pytest.approx(missing, rel=0.5)
        assert deep.report["ended_branches"]["lost_share"] == 0.0

    def test_what_is_lost_counts_by_the_light_that_there_is(self):
        # In a white room so large that no path comes back; half of the picture is a dark square, half
        # a lamp, which loses nothing.
        room = Object(Sphere((0, 0, 0), 1e6).flipped(), Lambertian(1.0))
        square = Object(Rectangle((-1, -1, 0), (1, 0, 0), (0, 2, 0)), Lambertian(0.02))
        lamp = RectangleLight((0, -1, 0), (1, 0, 0), (0, 2, 0), 1.0)
        camera = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 60, 8, 8)
        result = render(
            Scene(camera, [room, square], [lamp]), passes=4, options=PathOptions(survival=1.0)
        )
        ended = result.report["ended_branches"]
        assert ended["lost_weight_per_camera_ray"] == pytest.approx(0.01)
        assert ended["lost_share"] == pytest.approx(0.01 / (0.5 + 0.01))
