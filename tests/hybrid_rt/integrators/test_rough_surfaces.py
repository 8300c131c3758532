"""Rough metal and rough glass: all integrators and all ways of finding light agree."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Camera,
    Dielectric,
    GradientSky,
    Lambertian,
    Mirror,
    Object,
    PathOptions,
    PhotonMapOptions,
    PPMOptions,
    Rectangle,
    RectangleLight,
    RoughConductor,
    Scene,
    Sphere,
    render,
)

# A test below decides wrongly once in 1e5 runs with another seed.
ALARM = 1e-5
FLOOR = Object(Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), Lambertian((0.7, 0.6, 0.5)), "floor")
WALL = Object(Rectangle((-3, 2, 0), (6, 0, 0), (0, 0, 4)), Lambertian((0.3, 0.5, 0.7)), "wall")
LAMP = RectangleLight((-1.0, -1.0, 3.5), (0, 2, 0), (2, 0, 0), (4, 5, 3))
SKY = GradientSky((0.2, 0.3, 0.2), (1.0, 0.8, 1.2))
BALL = Sphere((0, 0, 0.8), 0.7)

pytestmark = pytest.mark.statistical


def view(objects, lights, sky=None, n=24, **place):
    place = {"look_from": (0, -5, 2.0), "look_at": (0, 0, 0.7), "vertical_fov": 30, **place}
    return Scene(Camera(up=(0, 0, 1), width=n, height=n, **place), objects, lights, sky)


def means(scene, integrator, passes, runs=6, **settings):
    """Means over blocks of pixels of runs of their own, (runs, blocks)."""
    found = []
    for seed in range(runs):
        image = render(scene, integrator, passes=passes, seed=seed, **settings).image
        n = image.shape[0] // 3
        found.append(image.reshape(3, n, 3, n, 3).astype(float).mean(axis=(1, 3)).ravel())
    return np.array(found)


def assert_agree(a, b, bias=0.0):
    """A t-test for every block; ``bias`` is what blur may change."""
    gap = np.abs(a.mean(axis=0) - b.mean(axis=0))
    # A few runs tell their scatter roughly: that of all blocks, relative to the light, steadies it.
    level = 0.5 * (a.mean(axis=0) + b.mean(axis=0)) + 1e-3
    spread = np.sqrt(a.var(axis=0, ddof=1) / len(a) + b.var(axis=0, ddof=1) / len(b)) / level
    error = level * np.maximum(spread, np.sqrt(np.mean(spread**2)))
    limit = stats.t.isf(ALARM / (2 * gap.size), 2 * len(a) - 2) * error
    assert (gap <= limit + bias * level + 1e-9).all(), (gap / error).max()


METALS = {
    "narrow": RoughConductor.of("gold", 0.25),
    "follows": RoughConductor.of("copper", 0.5),
    "gathers": RoughConductor.of("aluminium", 0.8),
}
WAYS = ("both", "lights", "directions")


class TestMetal:
    @pytest.mark.parametrize("name", METALS)
    def test_all_integrators_see_lamps_and_sky_in_it_alike(self, name):
        """A ball alone: no light goes from surface to surface, which Whitted's method leaves out."""
        scene = view([Object(BALL, METALS[name])], [LAMP], SKY)
        path = means(scene, "path", 16)
        for integrator, options in (
            ("whitted", None),
            ("ppm", PPMOptions(2000)),
            ("photon_map", PhotonMapOptions(2000)),
        ):
            assert_agree(path, means(scene, integrator, 16, options=options))

    @pytest.mark.parametrize("name", ["narrow", "gathers"])
    def test_paths_and_photons_agree_on_what_goes_between_surfaces(self, name):
        scene = view([FLOOR, WALL, Object(BALL, METALS[name])], [LAMP])
        path = means(scene, "path", 32)
        # Discs blur; those of ppm shrink.
        ppm = means(scene, "ppm", 12, options=PPMOptions(10_000))
        assert_agree(path, ppm, 0.02)
        photon_map = means(scene, "photon_map", 6, options=PhotonMapOptions(20_000))
        assert_agree(path, photon_map, 0.06)

    @pytest.mark.parametrize("name", METALS)
    def test_lamps_asked_run_into_and_both(self, name):
        scene = view([FLOOR, WALL, Object(BALL, METALS[name])], [LAMP])
        both, lights, directions = (
            means(scene, "path", 48, options=PathOptions(strategy=way)) for way in WAYS
        )
        assert_agree(both, lights)
        assert_agree(both, directions)

    def test_the_smoothest_metal_looks_like_the_mirror(self):
        """A metal that hardly absorbs; facets lean by less than 1e-4, mostly."""
        white = RoughConductor(1.0, 1e3, 0.01)
        a, b = (
            render(view([FLOOR, Object(BALL, material)], [LAMP], SKY), "path", passes=64).image
            for material in (white, Mirror())
        )
        # The same floor and lamp, but other random numbers: to a few per cent of each pixel.
        gap = (a - b).astype(float).reshape(-1, 3)
        error = gap.std(axis=0, ddof=1) / math.sqrt(len(gap))
        assert (np.abs(gap.mean(axis=0)) <= stats.norm.isf(ALARM) * error + 2e-3).all()

    @pytest.mark.parametrize("roughness", [0.1, 0.8])
    def test_light_paths_find_the_same_light(self, roughness):
        """Rough metal lights and is lit by way of glass and a mirror."""
        objects = [
            FLOOR, WALL, Object(BALL, RoughConductor.of("gold", roughness)),
            Object(Sphere((1.2, -0.4, 0.5), 0.45), Dielectric(1.5)),
            Object(Sphere((-1.2, -0.4, 0.5), 0.45), Mirror(0.9)),
        ]  # fmt: skip
        scene = view(objects, [LAMP])
        without, found = (
            means(scene, "path", 48, options=PathOptions(light_paths=share)) for share in (0, 1)
        )
        assert_agree(without, found)
