"""Light between diffuse surfaces, by connections to light vertices and by paths."""

import itertools
from typing import ClassVar

import numpy as np
import pytest
from marks import nightly_but

from hybrid_rt.integrators import PathOptions
from hybrid_rt.integrators.path import path_tracer
from hybrid_rt.lights import RectangleLight, SphereLight
from hybrid_rt.materials import Dielectric, Lambertian, Metal, Mirror, Mix
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

pytestmark = pytest.mark.statistical


class TestConnections:
    """Light between diffuse surfaces, found by connections to light vertices or by paths."""

    @pytest.mark.parametrize("by_connections", [True, False])
    def test_integrating_sphere(self, monkeypatch, by_connections):
        """A matt ball around a lamp is lit evenly: E = pi L r^2 + a (1 - r^2) E, r the lamp's radius.

        The lamp is black to what comes back. The mirror takes 1e-4 of the light of its place.
        """
        asked = itertools.cycle([0.0, 1.0] if by_connections else [1.0, 0.0])
        monkeypatch.setattr(path_tracer, "work_times_noise", lambda *_: next(asked))
        albedo, radius, radiance = 0.5, 0.2, 10.0
        objects = [
            Object(Sphere((0, 0, 0), 1).flipped(), Lambertian(albedo), "wall"),
            Object(Sphere((0.5, 0.5, 0.5), 0.02), Mirror(), "mirror"),
        ]
        camera = Camera((0, -0.5, 0), (0, -1, 0), (0, 0, 1), 60, 64, 64)
        scene = Scene(camera, objects, [SphereLight((0, 0, 0), radius, radiance)])
        result = render(scene, passes=8, seed=3, threads=1)
        exact = albedo * radiance * radius**2 / (1 - albedo * (1 - radius**2))
        error = result.report["noise"]["standard_error_of_image_mean"]
        assert result.image.mean() == pytest.approx(exact, abs=5 * error + 5e-4 * exact)
        assert error < 0.01 * exact
        n_rays = result.report["rays"]
        # Most paths end where they meet the wall for the second time.
        assert (n_rays["scattered"] < 2 * n_rays["camera"]) == by_connections

    PARTITION = Object(
        Rectangle((-0.4, 0, -1), (0, 0.7, 0), (0, 0, 1.4)), Lambertian((0.7, 0.6, 0.3)), "partition"
    )
    # What mirrors throw is found beside what matt surfaces send on.
    SMALL_MIRROR = Object(Sphere((0.6, 0.6, -0.9), 0.1), Mirror(0.9), "mirror")
    # (objects in the room, settings of the render)
    ROOMS: ClassVar = {
        "both sides of a partition": ([PARTITION], {}),
        "glass that absorbs": ([Object(Sphere((0.3, 0.2, -0.5), 0.45), Dielectric(1.5, (0.5, 1, 2)))], {}),
        "half mirror, half matt": (
            [Object(Sphere((0.3, 0.2, -0.4), 0.5), Mix([(0.5, Mirror(0.9)), (0.5, Lambertian(0.8))]))], {}),
        "rough metal and glass": (
            [Object(Sphere((0.4, 0.2, -0.5), 0.45), RoughDielectric(1.5, 0.3)),
             Object(Sphere((-0.5, 0.3, -0.6), 0.4), Metal(0.9, 0.2))], {}),
        "few directions": ([PARTITION], {"max_depth": 2}),
    }  # fmt: skip

    @pytest.mark.parametrize(
        "name", nightly_but(ROOMS, "both sides of a partition", "few directions")
    )
    def test_same_light_with_and_without_connections(self, monkeypatch, name):
        """In a room: no part of 64 of the picture differs by more than chance, nor does the whole.

        Connections of 1.03 times their light are found in two of these rooms.
        """
        objects, settings = self.ROOMS[name]
        walls = [
            Object(Rectangle(corner, u, v), Lambertian(color))
            for corner, u, v, color in (
                ((-1, -1, -1), (2, 0, 0), (0, 2, 0), 0.7),
                ((-1, -1, 1), (0, 2, 0), (2, 0, 0), 0.7),
                ((-1, -1, -1), (0, 2, 0), (0, 0, 2), (0.7, 0.1, 0.1)),
                ((1, -1, -1), (0, 0, 2), (0, 2, 0), (0.1, 0.2, 0.7)),
                ((-1, 1, -1), (0, 0, 2), (2, 0, 0), 0.7),
                ((-1, -1.2, -1), (2, 0, 0), (0, 0, 2), 0.5),
            )
        ]
        camera = Camera((0, -0.95, 0.1), (0, 0.2, -0.2), (0, 0, 1), 75, 64, 64)
        lamp = RectangleLight((0.2, -0.2, 0.95), (0, 0.4, 0), (0.4, 0, 0), (10, 11, 12))
        scene = Scene(camera, [*walls, self.SMALL_MIRROR, *objects], [lamp])
        parts = []
        for by_connections in (True, False):
            asked = itertools.cycle([0.0, 1.0] if by_connections else [1.0, 0.0])
            monkeypatch.setattr(
                path_tracer, "work_times_noise", lambda *_, asked=asked: next(asked)
            )
            images = [
                render(scene, passes=5, seed=seed, threads=1, **settings).image.astype(float)
                for seed in range(12)
            ]
            parts.append(np.array(images).reshape(12, 8, 8, 8, 8, 3).mean(axis=(2, 4)))
        a, b = (part.mean(axis=0) for part in parts)
        error = np.sqrt(sum(part.var(axis=0, ddof=1) / 12 for part in parts))
        # Student's t with some 22 degrees of freedom; 192 parts, whose colours go together.
        score = (a - b) / error
        assert abs(score).max() < 5.5
        assert np.mean(score**2) < 1.6
        whole = (parts[0].mean(axis=(1, 2, 3)), parts[1].mean(axis=(1, 2, 3)))
        off = whole[0].mean() - whole[1].mean()
        assert abs(off) < 4 * np.sqrt(sum(w.var(ddof=1) / 12 for w in whole))

    def test_a_pilot_lets_them_light_a_room_without_mirrors(self):
        """A lamp in a tray below the ceiling lights a matt room: a twentieth of the squared error, the same mean."""
        lamp = RectangleLight((0.9, 0.9, 2.3), (0.2, 0, 0), (0, 0.2, 0), 100.0)
        tray = Object(
            Rectangle((0.9, 0.9, 2.29), (0.2, 0, 0), (0, 0.2, 0)), Lambertian(0.0), "tray"
        )
        room = Object(Box((-2, -2, 0), (2, 2, 2.5)).flipped(), Lambertian(0.7), "room")
        camera = Camera((0, -1.9, 1.2), (0, 1, 1), (0, 0, 1), 60, 64, 64)
        scene = Scene(camera, [room, tray], [lamp])
        ours, others = (
            render(scene, passes=16, seed=2, threads=1, options=options)
            for options in (None, PathOptions(light_paths=0))
        )
        assert "light paths" in ours.report.plan["light"]["used"]
        assert "light paths" not in others.report.plan["light"]["used"]
        error = np.hypot(ours.mean_half_interval, others.mean_half_interval)
        assert abs(ours.mean - others.mean) < 1.5 * error
        assert ours.error**2 < 0.05 * others.error**2
