"""All integrators where formulas divide by nothing, or overflow: pictures of nothing, dark lamps, radiance
from 1e-30 to 1e30, lamps of 1e-6 to 1e6 of the scene, and lamps that touch what they light."""

import math

import numpy as np
import pytest
from scipy import stats

from hybrid_rt import (
    Camera,
    Dielectric,
    Emissive,
    GradientSky,
    Lambertian,
    Object,
    PhotonMapOptions,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    render,
)

OWN = {"path": None, "whitted": None, "ppm": PPMOptions, "photon_map": PhotonMapOptions}
each = pytest.mark.parametrize("integrator", OWN)
# How often a comparison fails by chance.
ALARM = 1e-5
# Pictures are float32: a few roundings of that. The camera sees a point 1e-8 beside: nothing that counts.
FLOAT32, BESIDE = 1e-6, 1e-5
VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
SQUARE = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
FLOOR = Object(SQUARE, Lambertian(0.5), "floor")
GLASS = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5), "glass")
DARK = Object(Sphere((0, 0, 3), 0.5), Emissive(0.0), "dark")


def lamp(radiance):
    return RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), radiance)


def picture(scene, integrator, passes=1, n_photons=4000, **settings):
    options = OWN[integrator] and OWN[integrator](n_photons)
    result = render(scene, integrator, passes, threads=1, options=options, **settings)
    assert np.isfinite(result.image).all()
    assert result.image.min() >= 0.0
    return result


@each
@pytest.mark.parametrize(("width", "height"), [(1, 1), (40, 1), (1, 7)])
def test_in_even_light_every_pixel_of_the_smallest_pictures_shows_it(integrator, width, height):
    shining = Object(SQUARE, Emissive(0.5), "floor")
    scene = Scene(VIEW.resized(width, height), [shining], environment=GradientSky(0.5, 0.5))
    np.testing.assert_array_equal(
        picture(scene, integrator, 2).image, np.full((height, width, 3), 0.5)
    )


@pytest.mark.parametrize(
    ("size", "word"), [((0, 4), "width"), ((4, 0), "height"), ((-3, 4), "width")]
)
def test_pictures_of_no_pixel_are_refused(size, word):
    with pytest.raises(ValueError, match=word):
        VIEW.resized(*size)


@each
@pytest.mark.parametrize("lights", [[], [PointLight((0, 0, 5), 1.0)]], ids=["dark", "point"])
@pytest.mark.parametrize("sky", [None, 0.25])
def test_of_nothing_the_background_is_seen(integrator, lights, sky):
    scene = Scene(VIEW, [], lights, sky and GradientSky(sky, sky))
    assert (picture(scene, integrator).image == (sky or 0.0)).all()


@each
@pytest.mark.parametrize(
    "scene",
    [
        Scene(VIEW, [FLOOR, GLASS], [lamp(0.0)]),
        Scene(VIEW, [FLOOR, GLASS], [SphereLight((0, 0, 3), 0.5, 0.0), PointLight((0, 0, 5), 0.0)]),
        Scene(VIEW, [FLOOR, GLASS]),
        Scene(VIEW, [FLOOR, DARK]),
        Scene(VIEW, [FLOOR, GLASS], environment=GradientSky(0, 0)),
    ],
    ids=["rectangle", "sphere and point", "none", "object", "sky"],
)
def test_lamps_without_power_light_nothing(integrator, scene):
    assert not picture(scene, integrator, 2).image.any()


@each
def test_a_dark_lamp_beside_a_bright_one_changes_no_bit(integrator):
    # Whitted's method asks every light, with random numbers for each: a point needs none.
    bright = PointLight((0, 0, 3), 2.0) if integrator == "whitted" else lamp(2.0)
    one, two = (
        picture(Scene(VIEW, [FLOOR], lights), integrator, 2, max_depth=0).image
        for lights in ([bright], [bright, SphereLight((8, 8, 3), 0.5, 0.0)])
    )
    np.testing.assert_array_equal(one, two)


@pytest.mark.parametrize(
    "edges",
    [((1, 0, 0), (2, 0, 0)), ((0, 0, 0), (0, 1, 0)), ((1e-200, 0, 0), (0, 1e-200, 0))],
)
def test_lamps_of_no_area_are_refused(edges):
    with pytest.raises(ValueError, match="RectangleLight edge"):
        RectangleLight((0, 0, 1), *edges, 1.0)


@each
def test_light_is_linear(integrator):
    """Scale all light: the picture is scaled, to roundings of float32, and the report is finite."""

    def lit(strength):
        lights = [lamp(strength), PointLight((2, -2, 3), strength)]
        scene = Scene(VIEW, [FLOOR, GLASS], lights, GradientSky(strength, 0.5 * strength))
        return picture(scene, integrator, 3, n_photons=1000)

    plain = lit(1.0).image.astype(float)
    for factor in (1e-30, 2.0**-99, 2.0**10, 2.0**99, 1e30):
        result = lit(factor)
        np.testing.assert_allclose(result.image, plain * factor, rtol=FLOAT32, atol=0.0)
        noise = [v for v in result.report["noise"].values() if isinstance(v, float)]
        assert np.isfinite(noise).all()


# Radius, height of the middle above the floor, distance aside: 1 above it; touching it, or reaching into it.
ABOVE = [(10.0**k, 1.0 + 10.0**k, 0.0) for k in range(-6, 7, 3)]
TOUCHING = [(0.2, 0.2 + gap, 0.3) for gap in (0.0, 1e-15, 1e-12, -1e-12, 1e-6, 1e-3)]


@each
@pytest.mark.statistical
@pytest.mark.parametrize(("radius", "height", "aside"), [*ABOVE, *TOUCHING])
def test_irradiance_of_balls(integrator, radius, height, aside):
    """Of radiance one, wholly above the floor: pi (r / d)^2 cos. `test_rectangle` has squares."""
    away, middle = math.hypot(aside, height), (-aside, 0, height)
    truth = 0.5 * (radius / away) ** 2 * height / away
    # All pixels see the same point.
    camera = Camera((0, -0.5, 0.05 if aside else 0.5), (0, 0, 0), (0, 0, 1), 1e-6, 16, 16)
    for scene in (
        Scene(camera, [FLOOR], [SphereLight(middle, radius, 1.0)]),
        Scene(camera, [FLOOR, Object(Sphere(middle, radius), Emissive(1.0))]),
    ):
        values = picture(scene, integrator, 1, 200, max_depth=0).image.reshape(-1, 3).astype(float)
        spread = values.std(axis=0, ddof=1) / math.sqrt(len(values))
        allowed = stats.t.isf(ALARM / 6.0, len(values) - 1) * spread + (FLOAT32 + BESIDE) * truth
        assert (np.abs(values.mean(axis=0) - truth) <= allowed).all()
