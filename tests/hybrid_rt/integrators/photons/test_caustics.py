"""Caustics against geometric optics, a light tracer of its own, and the first published update."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from shared_statistics_ppm import (
    all_photons,
    make_photon_tracer,
    shared_statistics,
)

from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR
from hybrid_rt.lights import PointLight, RectangleLight, SphereLight
from hybrid_rt.materials import Dielectric, Lambertian, Mirror
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import SurfaceOfRevolution
from proof.light.light_tracer import BALL, BEHIND_PANE

# A test below decides wrongly once in 1e5 runs with another seed.
ALARM = 1e-5

pytestmark = pytest.mark.statistical

VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 45, 8, 8)


def plane(z=0.0, half=6.0):
    return Rectangle((-half, -half, z), (2 * half, 0, 0), (0, 2 * half, 0))


def fresnel(n, i):
    """Unpolarised reflectance from air into index n, at angle i."""
    t = np.arcsin(np.sin(i) / n)
    across = (np.cos(i) - n * np.cos(t)) / (np.cos(i) + n * np.cos(t))
    along = (np.cos(t) - n * np.cos(i)) / (np.cos(t) + n * np.cos(i))
    return 0.5 * (across**2 + along**2)


def test_sphere_throws_the_light_that_geometric_optics_says():
    """Power within circles about the axis, of light refracted twice by a glass ball.

    A ray that leaves the lamp at angle a meets the ball, radius R at distance D, at incidence i
    with sin i = D sin a / R; it is turned by 2 (i - r), and the point where it leaves lies
    2 (i - r) + ... farther round: all by plane trigonometry.
    """
    index, radius, lamp_z, center_z = 1.5, 0.6, 5.0, 1.1
    lamp = PointLight((0, 0, lamp_z), 3.0)
    glass = Object(Sphere((0, 0, center_z), radius), Dielectric(index))
    scene = Scene(VIEW, [Object(plane(), Lambertian(0.5)), glass], [lamp])
    n = 60_000
    photons = all_photons(make_photon_tracer(scene, 1, max_depth=2), n, 0)
    only_glass = photons.history == MET_SPECULAR
    across = np.hypot(photons.position[only_glass, 0], photons.position[only_glass, 1])
    power = photons.power[only_glass, 0].astype(float)

    distance = lamp_z - center_z
    a = np.linspace(0, math.asin(radius / distance), 20_001)
    a = 0.5 * (a[1:] + a[:-1])
    i = np.arcsin(np.minimum(distance * np.sin(a) / radius, 1))
    r = np.arcsin(np.sin(i) / index)
    # Place on the ball by the angle from its top: entry at i - a, exit pi - 2 r farther round.
    exit_angle = i - a + math.pi - 2 * r
    x, z = radius * np.sin(exit_angle), center_z + radius * np.cos(exit_angle)
    turn = 2 * (i - r) - a  # inward from straight down
    landed = np.abs(x - np.tan(turn) * z)
    passes = (1 - fresnel(index, i)) ** 2
    ring = 2 * math.pi * 3.0 * passes * np.sin(a) * (a[1] - a[0])
    # Mirrored light lands outside the shadow; beyond that radius it would be counted too.
    for limit in (0.02, 0.05, 0.1, 0.2, 0.4):
        expected = ring[landed < limit].sum()
        found = power[across < limit].sum()
        # Half of the photons are aimed: each carries about the same power, so a binomial bound.
        share = power.max()
        sigma = math.sqrt(expected * share)
        assert abs(found - expected) < stats.norm.isf(ALARM / 10) * sigma + 1e-3 * expected


def test_paraboloid_makes_light_parallel():
    """A lamp in the focus: every mirrored ray is parallel to the axis, at its own distance."""
    focus, rim = 0.5, 1.2
    depth = rim**2 / (4 * focus)
    # z = r^2 / (4 f) is a quadratic in r: these three points are the parabola itself. It opens
    # downward, its apex at z = 3.
    profile = [(0, 0), (0, rim / 2), (depth, rim)]
    bowl = SurfaceOfRevolution(profile, (0, 0, 3), (0, 0, -1))
    lamp = PointLight((0, 0, 3 - focus), 2.0)
    scene = Scene(VIEW, [Object(plane(), Lambertian(0.5)), Object(bowl, Mirror(), "bowl")], [lamp])
    n = 40_000
    photons = all_photons(make_photon_tracer(scene, 2, max_depth=1), n, 0)
    mirrored = photons.history == MET_SPECULAR
    across = np.hypot(photons.position[mirrored, 0], photons.position[mirrored, 1])
    direction = photons.direction[mirrored].astype(float)
    # Directions are kept as float32: half an ulp of what is not zero.
    np.testing.assert_allclose(direction, np.broadcast_to([0, 0, -1], direction.shape), atol=1e-7)
    assert across.max() < rim * (1 + 1e-9)
    power = photons.power[mirrored, 0].astype(float)
    for limit in (0.3, 0.6, 0.9, rim):
        # The point at r is seen from the focus at angle 2 atan(r / 2f) from the apex.
        cosine = math.cos(2 * math.atan(limit / (2 * focus)))
        expected = 2.0 * 2 * math.pi * (1 - cosine)
        sigma = math.sqrt(expected * power.max())
        found = power[across < limit].sum()
        assert abs(found - expected) < stats.norm.isf(ALARM / 8) * sigma


@pytest.mark.parametrize(
    "bench",
    [
        pytest.param(BALL, id="ball"),
        pytest.param(BEHIND_PANE, id="pane", marks=pytest.mark.nightly),
    ],
)
def test_picture_agrees_with_a_light_tracer_of_its_own(bench):
    """Patches of the picture of a lit floor, glass ball and pane included."""
    camera = Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 64, 64)
    n = 4_000_000
    counts = bench.floor_light(n, 256, seed=11)
    expected = bench.picture(counts, n, camera)
    image = render(
        bench.scene(camera), "ppm", passes=6, seed=2, options=PPMOptions(60_000), max_depth=30
    ).image[:, :, 0]

    def patches(picture):
        return picture.astype(float).reshape(8, 8, 8, 8).mean(axis=(1, 3))

    # The lamp, and what shows of it in glass, is seen in one picture only: left out is where it is all
    # that shows above a black floor, and what is far beyond any caustic.
    dark = replace(bench, albedo=0.0).scene(camera)
    is_lamp = render(dark, "whitted", passes=64).image[:, :, 0] > 0.002 * expected.max()
    is_lamp |= image > 3 * expected.max()
    assert is_lamp.mean() < 0.02
    a, b = (patches(np.where(is_lamp, 0.0, picture)) for picture in (expected, image))
    # A cell of k photons has noise 1 / sqrt(k); a patch of mean L has at least as many as cells
    # under one of its pixels.
    per_photon = bench.albedo / math.pi * bench.power / (n * (2 * bench.half / 256) ** 2)
    noise = np.sqrt(per_photon * np.maximum(a, per_photon) / 8)
    limit = stats.norm.isf(ALARM / 128) * noise + 0.05 * a + 0.01 * a.mean()
    assert (np.abs(a - b) < limit).all(), (np.abs(a - b) / limit).max()
    assert abs(a.mean() / b.mean() - 1) < 0.01


def test_a_caustic_that_no_camera_ray_meets_straight_is_not_shown():
    """Dense places behind a pane are found, but no photon is sent to the camera in vain."""
    camera = Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 64, 64)
    for bench, is_shown in ((BALL, True), (BEHIND_PANE, False)):
        result = render(bench.scene(camera), "ppm", passes=1, options=PPMOptions(60_000))
        assert ("photons to camera" in result.report["rays"]) is is_shown
        assert (result.report["photons"]["shown_to_camera"] > 0) is is_shown


@pytest.mark.parametrize("aperture", [0.0, 0.1])
def test_photons_shown_to_the_camera_are_what_discs_leave_out(aperture):
    """Dense caustics photon by photon, and by discs alone: the same but for the blur of small discs.

    The ball mirrors and shows the caustic as well: there discs count all photons.
    """
    camera = Camera((0, -3, 2.2), (0, 0, 0.1), (0, 0, 1), 30, 32, 32, aperture, 3.7)
    images = []
    for radius in (None, 0.02):
        # Many passes: what discs find hangs on where in a pixel the camera looks.
        options = PPMOptions(8_000, initial_radius=radius)
        result = render(BALL.scene(camera), "ppm", passes=16, seed=1, options=options)
        shown = result.report["photons"]["shown_to_camera"]
        assert shown > 50_000 if radius is None else shown == 0
        images.append(result.image[:, :, 0].astype(float))
    photons, discs = images
    # The caustic lies in the middle; almost all light of the picture is there. Both sums together
    # have a standard deviation of 1.3 %, mostly of the discs.
    part = np.ix_(np.arange(10, 24), np.arange(10, 22))
    assert photons[part].sum() == pytest.approx(discs[part].sum(), rel=0.03)
    is_sharp = np.abs(photons - discs) < 0.1 * discs.max()
    assert is_sharp.mean() > 0.95


def corner(n=16):
    """A lamp over a floor beside a wall: light from the wall on the floor."""
    wall = Rectangle((-3, 0, 0), (6, 0, 0), (0, 0, 3))
    objects = [Object(plane(half=3.0), Lambertian(0.6)), Object(wall, Lambertian(0.6))]
    lamp = RectangleLight((-0.5, -1.5, 2.5), (0, 0.5, 0), (0.5, 0, 0.3), 20.0)
    return Scene(Camera((0, -0.8, 3), (0, -0.8, 0), (0, 1, 0), 30, n, n), objects, [lamp])


def test_independent_passes_agree_with_shared_statistics():
    """Both updates have the same limit: the soft light on the floor."""
    photon_tracer = make_photon_tracer(corner(), 3)
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, 8), np.linspace(-1.4, -0.4, 8))
    points = np.stack([x.ravel(), y.ravel(), np.zeros(64)], axis=1)
    shared = shared_statistics(photon_tracer, points, np.array([0, 0, 1.0]), 0.6, 12, 20_000, 0.25)[
        -1
    ]
    image = render(corner(), "ppm", passes=24, seed=5, options=PPMOptions(20_000)).image
    straight = render(corner(), "whitted", passes=64, seed=6).image
    soft = image.astype(float) - straight
    # The camera sees [-0.8, 0.8]^2 about (0, -0.8): the means over the same part of the floor.
    half = 3 * math.tan(math.radians(15))
    centers = (np.arange(16) + 0.5) / 16 * 2 * half - half
    inside_x = np.abs(centers) <= 0.6
    inside_y = (-centers - 0.8 >= -1.4) & (-centers - 0.8 <= -0.4)
    expected = soft[np.ix_(inside_y, inside_x)].mean(axis=(0, 1))
    np.testing.assert_allclose(shared.mean(axis=0), expected, rtol=0.05)


@pytest.fixture(scope="module")
def caustic():
    """A close view of the caustic under the ball, and a picture of it with hardly any error."""
    scene = BALL.scene(Camera((0, -3, 2.2), (0, 0, 0.1), (0, 0, 1), 14, 32, 32))
    truth = render(scene, "ppm", passes=16, seed=7, options=PPMOptions(100_000)).image
    return scene, truth.astype(float)


@pytest.mark.nightly
def test_error_falls_as_the_third_root_of_the_passes(caustic):
    """With alpha = 2/3 noise and blur both fall as n^(-1/3); the truth has 16 times the photons."""
    scene, truth = caustic
    passes = [1, 4, 16, 64]
    errors = []
    for n in passes:
        options = PPMOptions(1500, initial_radius=0.03)
        image = render(scene, "ppm", passes=n, seed=5, options=options).image
        errors.append(math.sqrt(np.square(image - truth).mean()))
    slope = np.polyfit(np.log(passes), np.log(errors), 1)[0]
    assert -0.45 < slope < -0.25, errors


class TestBlur:
    def test_estimate_is_the_blur_there_is(self, caustic):
        """Discs of one large size against a picture with hardly any blur."""
        scene, truth = caustic
        with pytest.warns(UserWarning, match="never shrink"):
            options = PPMOptions(60_000, alpha=1.0, initial_radius=0.04)
        results = [render(scene, "ppm", passes=6, seed=seed, options=options) for seed in (8, 9)]
        # Products of what two renders are off by have the blur's square as their mean, no noise.
        squares = np.prod([result.image.astype(float) - truth for result in results], axis=0)
        for name, weight in (
            ("blur_root_mean_square", 1.0),
            ("blur_relative_rmse", truth**2 + 0.01),
        ):
            gap = math.sqrt((squares / weight).mean())
            # To first order in the area of a disc; edges of caustics are no smooth functions.
            for result in results:
                assert 0.6 < result.report["photons"][name] / gap < 1.6

    @pytest.mark.nightly
    def test_photon_map_keeps_its_blur_and_says_so(self, caustic):
        scene, truth = caustic
        gaps = []
        for nearest in (30, 800):
            options = PhotonMapOptions(30_000, nearest)
            result = render(scene, "photon_map", passes=12, seed=8, options=options)
            report = result.report["photons"]
            assert report["stored_in_caustic_map"] > 100
            gaps.append((math.sqrt(np.square(result.image - truth).mean()), report))
        assert gaps[1][0] > 1.3 * gaps[0][0]
        # To first order again, and the gap has the noise of 12 passes in it.
        assert 0.4 < gaps[1][1]["blur_root_mean_square"] / gaps[1][0] < 2.0


def test_lamp_within_glass_lights_the_floor():
    """From the middle of a ball light leaves along the normals: 0.96 of it, unbent.

    What is thrown back, 0.04, meets the lamp, which is black. Shadow rays see nothing of this.
    """
    lamp = SphereLight((0, 0, 1), 0.02, 300.0)
    ball = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))
    ground = Object(plane(half=3.0), Lambertian(0.5))
    camera = Camera((0, -2, 4), (0, -1.2, 0), (0, 0, 1), 20, 16, 16)
    bare = render(Scene(camera, [ground], [lamp]), "whitted", passes=16).image
    options = PPMOptions(60_000)
    found = render(Scene(camera, [ground, ball], [lamp]), "ppm", passes=8, options=options).image
    assert not render(Scene(camera, [ground, ball], [lamp]), "whitted", passes=1).image.any()
    assert found.mean() / bare.mean() == pytest.approx(0.96, rel=0.02)
