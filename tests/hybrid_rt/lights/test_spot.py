"""Spots against closed forms, in all integrators."""

import math

import mpmath
import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Lambertian,
    Metal,
    Object,
    PhotonMapOptions,
    PointLight,
    PPMOptions,
    Rectangle,
    Scene,
    Sphere,
    SpotLight,
    render,
)
from hybrid_rt.integrators.kernels.photon_emission import Launch, Targets, launch_from_lights
from hybrid_rt.lights.table import compile_lights
from hybrid_rt.materials.table import compile_materials
from hybrid_rt.shading.kernels.light_kinds import LightPoints

ALL = ("whitted", "path", "ppm", "photon_map")
# Light that comes straight from a lamp is found by shadow rays, however few photons there are.
FEW = {"ppm": PPMOptions(500), "photon_map": PhotonMapOptions(500)}
FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
AXIS = np.array([0.3, -0.5, -1.0])


def share(theta, cone, edge):
    """Return the share of the axis' intensity at theta degrees, to many digits."""
    theta, cone, edge = (mpmath.radians(x) for x in (theta, cone, edge))
    if theta >= cone:
        return 0.0
    if theta <= cone - edge:
        return 1.0
    x = (mpmath.cos(theta) - mpmath.cos(cone)) / (mpmath.cos(cone - edge) - mpmath.cos(cone))
    return float(x * x * (3 - 2 * x))


def power_within(theta, cone, edge):
    """Return the power sent within theta degrees of the axis, by quadrature in mpmath."""
    ends = [0, *sorted({min(x, theta) for x in (cone - edge, cone, theta)})]
    ends = [mpmath.radians(x) for x in ends]
    # Midpoints of the pieces say which formula holds; the ends belong to two.
    return float(
        2 * mpmath.pi * mpmath.quad(
            lambda t: share(mpmath.degrees(t), cone, edge) * mpmath.sin(t), ends
        )
    )  # fmt: skip


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"direction": (0, 0, 0)}, "SpotLight direction"),
        ({"position": (0, 0)}, "SpotLight position"),
        ({"intensity": -1.0}, "SpotLight intensity is -1.0: pass numbers from 0"),
        ({"cone_angle": 0.0}, "SpotLight cone_angle is 0: .*degrees"),
        ({"cone_angle": 9.99e-4}, "SpotLight cone_angle is 0.000999"),
        ({"cone_angle": 181.0}, "SpotLight cone_angle is 181: .* at most 180"),
        ({"cone_angle": 20.0, "edge_angle": 21.0}, "SpotLight edge_angle is 21: .* at most 20"),
        ({"edge_angle": -1.0}, "SpotLight edge_angle is -1: .*degrees"),
        ({"cone_angle": math.nan}, "SpotLight cone_angle is nan"),
    ],
)
def test_bad_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        SpotLight(**{"position": (0, 0, 1), "direction": (0, 0, -1), "intensity": 1.0, **settings})


SHAPES = [(30.0, 5.0), (30.0, 30.0), (90.0, 0.0), (130.0, 60.0), (180.0, 0.0), (0.001, 0.0004)]


@pytest.mark.parametrize(("cone", "edge"), SHAPES)
def test_power_is_the_integral_of_the_profile(cone, edge):
    spot = SpotLight((0, 0, 0), AXIS, (1.0, 2.0, 6.0), cone, edge)
    assert spot.row.power == pytest.approx(3.0 * power_within(180.0, cone, edge), rel=1e-12)


@pytest.mark.parametrize(("cone", "edge"), [(30.0, 5.0), (5.0, 5.0), (4.0, 4.0), (0.001, 0.001)])
def test_without_an_edge_angle_it_is_5_degrees_or_the_whole_cone(cone, edge):
    plain, given = (SpotLight((0, 0, 1), AXIS, 2.0, cone, *more).row for more in ((), (edge,)))
    np.testing.assert_array_equal(plain.edge_v, given.edge_v)
    assert plain.power == given.power


def looking_at(x, y):
    """Look at one place of the floor through a single pixel, a millionth of a degree wide."""
    return Camera((x - 4.0, y - 1.0, 6.0), (x, y, 0.0), (0, 0, 1), 1e-6, 1, 1)


@pytest.mark.parametrize("integrator", ALL)
@pytest.mark.parametrize("theta", [0.0, 20.0, 24.9, 26.0, 27.5, 29.0, 29.9, 30.1, 45.0])
def test_irradiance_on_a_plane(integrator, theta):
    """Across the edge and beyond, along an axis that is not square to the floor."""
    cone, edge, place = 30.0, 5.0, np.array([0.2, 0.1, 2.0])
    axis = AXIS / np.linalg.norm(AXIS)
    beside = np.cross(axis, (1.0, 0.0, 0.0))
    beside /= np.linalg.norm(beside)
    angle = math.radians(theta)
    way = math.cos(angle) * axis + math.sin(angle) * beside
    length = -place[2] / way[2]
    x, y, _ = place + length * way
    color = np.array([1.0, 2.0, 3.0])
    spot = SpotLight(place, 7.0 * AXIS, color, cone, edge)
    scene, options = Scene(looking_at(x, y), [FLOOR], [spot]), FEW.get(integrator)
    image = render(scene, integrator, 2, options=options).image[0, 0]
    expected = 0.5 / math.pi * share(theta, cone, edge) * -way[2] / length**2 * color
    # The pixel reaches 7e-8 to either side, 3e-8 of a radian as seen from the spot; at 29.9 degrees
    # the edge falls by its own height in 1e-3. float32 rounds to 6e-8.
    np.testing.assert_allclose(image, expected, rtol=1e-4, atol=1e-9)


@pytest.mark.parametrize("integrator", ["path", "whitted", "ppm"])
def test_the_widest_spot_is_a_point_light(integrator):
    camera = Camera((0, -5, 4), (0, 0, 0), (0, 0, 1), 50, 12, 9)
    wide = SpotLight((0, 0, 2), AXIS, (4, 8, 12), 180.0, 0.0)
    one, other = (
        render(Scene(camera, [FLOOR], [lamp]), integrator, 2, options=FEW.get(integrator)).image
        for lamp in (wide, PointLight((0, 0, 2), (4, 8, 12)))
    )
    np.testing.assert_array_equal(one, other)


# --- photons


def launch(spot, n, xi, targets, counts, is_aimed):
    """Return photons (n,) of a spot as the kernel sends them; counts are of spread, aimed ones."""
    lights = compile_lights([spot.row], [-1], has_sky=False)
    _, textures = compile_materials([Lambertian(0.5)])
    nowhere = LightPoints(np.zeros((0, 3)), np.zeros((0, 3)), *np.zeros((3, 0)))
    out = Launch(np.empty((n, 3)), np.empty((n, 3)), np.empty((n, 3)))
    launch_from_lights(
        lights, textures, nowhere, np.zeros(n, np.int64), targets, *np.tile([[*counts, is_aimed]], (n, 1)).T.copy(),
        np.zeros((n, 2)), xi[:, :2].copy(),
        xi[:, 2].copy(), np.empty((targets.radius.size, 5)), out,
    )  # fmt: skip
    return out


NO_TARGETS = Targets(np.zeros((0, 3)), np.zeros(0))


def angle_from(axis, direction):
    """Return degrees between unit vectors, small ones without cancellation."""
    gap = np.linalg.norm(direction - axis, axis=1)
    return np.degrees(2.0 * np.arcsin(np.minimum(0.5 * gap, 1.0)))


@pytest.mark.statistical
@pytest.mark.parametrize(("cone", "edge"), SHAPES)
def test_photons_follow_the_profile_and_carry_equal_power(cone, edge):
    n, rng = 200_000, np.random.default_rng(11)
    spot = SpotLight((1.0, 2.0, 3.0), AXIS, 2.0, cone, edge)
    out = launch(spot, n, rng.random((n, 3)), NO_TARGETS, (n, 0), False)
    axis = AXIS / np.linalg.norm(AXIS)
    np.testing.assert_array_equal(out.origin, np.tile((1.0, 2.0, 3.0), (n, 1)))
    np.testing.assert_allclose(np.linalg.norm(out.direction, axis=1), 1.0, rtol=1e-14)
    # Photons at the very edge may round out of the cone, where no power is sent: in the narrowest
    # cone, 1.7e-5 wide, a direction's rounding of 1e-16 is 6e-12 of that.
    power = out.power[:, 0]
    assert np.count_nonzero(power == 0.0) <= 1
    np.testing.assert_allclose(power[power > 0.0], spot.row.power / n, rtol=1e-12)
    theta = angle_from(axis, out.direction)
    inside = [0.5 * (cone - edge)] if cone > edge else []
    ends = np.unique([0.0, *inside, *np.linspace(cone - edge, cone, 9), cone])
    inner = np.array([power_within(end, cone, edge) for end in ends])
    expected = n * np.diff(inner) / inner[-1]
    keeps = expected > 20.0
    counts = np.histogram(theta, [*ends[:-1], 180.001])[0]
    assert counts[~keeps].sum() <= 20 + 5 * expected[~keeps].sum()
    scale = counts[keeps].sum() / expected[keeps].sum()
    assert stats.chisquare(counts[keeps], expected[keeps] * scale).pvalue > 1e-4
    # Evenly around the axis.
    across = np.cross(axis, (0.0, 0.0, 1.0))
    turn = np.arctan2(out.direction @ np.cross(axis, across), out.direction @ across)
    assert stats.chisquare(np.histogram(turn, 16, (-np.pi, np.pi))[0]).pvalue > 1e-4


@pytest.mark.statistical
def test_aimed_photons_and_others_add_up_to_the_profile():
    """Two targets, one across the edge of the cone, one beyond it that gets nothing."""
    n, rng, cone, edge = 200_000, np.random.default_rng(5), 40.0, 20.0
    spot = SpotLight((0, 0, 0), (0, 0, 1), 1.0, cone, edge)
    at = [np.radians(a) for a in (30.0, 80.0)]
    targets = Targets(np.array([[np.sin(a), 0, np.cos(a)] for a in at]), np.array([0.15, 0.2]))
    bins = [np.linspace(0, 60, 13), np.linspace(-180, 180, 9)]
    sums, squares = np.zeros((12, 8)), np.zeros((12, 8))
    for is_aimed in (False, True):
        out = launch(spot, n, rng.random((n, 3)), targets, (n, n), is_aimed)
        theta = angle_from(np.array([0.0, 0.0, 1.0]), out.direction)
        turn = np.degrees(np.arctan2(out.direction[:, 1], out.direction[:, 0]))
        weight = out.power[:, 0]
        if is_aimed:
            assert (weight > 0.0).mean() > 0.5  # none goes to the target beyond
        sums += np.histogram2d(theta, turn, bins, weights=weight)[0]
        squares += np.histogram2d(theta, turn, bins, weights=weight**2)[0]
    rings = np.diff([power_within(end, cone, edge) for end in bins[0]])
    error = (sums - rings[:, None] / 8) / np.sqrt(np.maximum(squares, 1e-30))
    lit = rings > 0.0
    assert np.abs(error[lit]).max() < 4.5  # of 64 normal numbers: exceeded once in 2000
    assert not sums[~lit].any()


def test_emitted_power_is_the_closed_form():
    color = np.array([1.0, 2.0, 4.0])
    spot = SpotLight((0, 0, 2), AXIS, color, 35.0, 15.0)
    power = power_within(180.0, 35.0, 15.0) * color
    ball = Object(Sphere((0.3, -0.5, 0.7), 0.3), Dielectric(1.5), "ball")
    camera = Camera((0, -5, 4), (0, 0, 0), (0, 0, 1), 50, 8, 6)
    for objects, tolerance in (([FLOOR], 1e-12), ([FLOOR, ball], 3e-3)):
        # Aimed photons and others share the power, so it is right in the mean only.
        report = render(Scene(camera, objects, [spot]), "ppm", 4, options=PPMOptions(40_000)).report
        found = np.array(report["photons"]["power_of_all_passes"]["emitted"]) / 4
        np.testing.assert_allclose(found, power, rtol=tolerance)


# --- light by way of other surfaces


@pytest.mark.parametrize("integrator", ["ppm", "photon_map"])
def test_caustic_of_a_narrow_spot_is_that_of_a_point_light(integrator):
    """The cone holds the ball and little else, so all that the ball throws is the same."""
    ball = Object(Sphere((0, 0, 0.7), 0.3), Dielectric(1.5), "ball")
    # The caustic: nearer to the middle than the ball's shadow is wide.
    camera = Camera((0, -0.9, 0.25), (0, 0, 0), (0, 0, 1), 8, 12, 9)
    edge_of_ball = math.degrees(math.asin(0.3 / 1.3))
    lamps = (
        SpotLight((0, 0, 2), (0, 0, -1), 5.0, edge_of_ball + 4.0, 2.0),
        PointLight((0, 0, 2), 5.0),
    )
    kind = PPMOptions if integrator == "ppm" else PhotonMapOptions
    noises = [
        render(Scene(camera, [FLOOR, ball], [lamp]), integrator, 8, options=kind(30_000)).report["noise"]
        for lamp in lamps
    ]  # fmt: skip
    gap = noises[0]["image_mean"] - noises[1]["image_mean"]
    error = math.hypot(*(noise["standard_error_of_image_mean"] for noise in noises))
    assert noises[0]["image_mean"] > 0.6  # direct light would be 5 / (2^2 pi) / 2 = 0.2
    assert abs(gap) < 4.0 * error + 1e-3 * noises[1]["image_mean"]


@pytest.mark.parametrize("integrator", ALL)
def test_spot_within_a_body_that_absorbs(integrator):
    """A spot, a floor and the camera within one dark body of index one."""
    dark = Object(Box((-20, -20, -1), (20, 20, 20)), Dielectric(1.0, (0.2, 0.5, 1.0)), "body")
    scene = Scene(looking_at(0, 0), [FLOOR, dark], [SpotLight((0, 0, 2), (0, 0, -1), 4.0)])
    way = 2.0 + math.sqrt(16.0 + 1.0 + 36.0)
    expected = 0.5 / math.pi * np.exp(-np.array([0.2, 0.5, 1.0]) * way)
    image = render(scene, integrator, 2, options=FEW.get(integrator)).image[0, 0]
    np.testing.assert_allclose(image, expected, rtol=1e-4)


@pytest.mark.parametrize("integrator", ["ppm", "photon_map"])
def test_spot_at_the_centre_of_a_glass_ball(integrator):
    """All its light meets the ball squarely: some goes through, some back and through the other side.

    With reflectance R and e = exp(-absorption r): (1 - R) e of it leaves at once, R^2 e^4 of that after
    each way there and back, so (1 - R) e / (1 - R^2 e^4) leaves downward.
    """
    absorption, radius = np.array([0.0, 0.4, 1.0]), 0.5
    ball = Object(Sphere((0, 0, 2), radius), Dielectric(1.5, tuple(absorption)), "ball")
    # Narrow: more of its photons fall on the piece of floor that is seen.
    spot = SpotLight((0, 0, 2), (0, 0, -1), 4.0, 6.0, 2.0)
    # A piece of floor 0.06 high under the middle, seen beside the ball; there the irradiance
    # falls by 1.5 (0.05 / 2)^2, a thousandth. Discs reach a little farther.
    camera = Camera((3, 0, 2.2), (0, 0, 0), (0, 0, 1), 1.0, 8, 6)
    options = (PPMOptions if integrator == "ppm" else PhotonMapOptions)(20_000)
    found = render(Scene(camera, [FLOOR, ball], [spot]), integrator, 16, options=options)
    reflectance, e = 0.04, np.exp(-absorption * radius)
    through = (1.0 - reflectance) * e / (1.0 - reflectance**2 * e**4)
    expected = 0.5 / math.pi * through
    # The noise is 0.3 %, the blur of a photon map's discs 0.5 %.
    np.testing.assert_allclose(found.image.mean(axis=(0, 1)), expected, rtol=0.015)


def test_metal_shows_the_spot_to_those_that_ask_there():
    """A highlight of the spot: paths and photons agree, Whitted's method has none."""
    floor = Object(Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), Metal(0.8, 0.3), "metal")
    spot = SpotLight((1, 0, 1), (-1, 0, -1), 3.0, 20.0, 10.0)
    scene = Scene(Camera((-1, 0, 1), (0, 0, 0), (0, 0, 1), 20, 8, 6), [floor], [spot])
    path, ppm, whitted = (
        render(scene, name, 16).image.mean() for name in ("path", "ppm", "whitted")
    )
    assert path > 0.1
    assert ppm == pytest.approx(path, rel=0.01)
    assert whitted == 0.0
