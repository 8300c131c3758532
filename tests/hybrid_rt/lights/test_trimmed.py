"""Trimmed surfaces that shine: irradiance, densities, power, all integrators."""

import math
from functools import cache

import numpy as np
import pytest
from scipy import stats
from shining import ALARM, assert_mean, chosen, met
from trimmed_surfaces import (
    OUTLINE,
    ball_piece,
    bumpy,
    cap,
    cut_lens,
    part_of_cone,
    plate,
    ring,
    sheet,
    slanted_plane,
    turned_part,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Emissive,
    Lambertian,
    Object,
    PathOptions,
    PhotonMapOptions,
    PPMOptions,
    Rectangle,
    Scene,
    Sphere,
    render,
)
from hybrid_rt.lights.surface import shining_surface
from meshing import TrimmedSurface, circle, polygon

# Points sampled for a mean.
N = 8192
SURFACES = (
    plate, bumpy, sheet, ball_piece, slanted_plane, windowed_cylinder, part_of_cone, cap,
    turned_part, ring, windowed_ball, windowed_torus, cut_lens,
)  # fmt: skip


@cache
def made(make):
    """Return one surface of each kind: its cells are made once."""
    return make()


FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")


def ring_lamp(gap=0.0):
    """A ring of radii 0.8 and 0.4 at height 1, facing down, the hole off its middle by 0.1 in y."""
    square = Rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0))
    return TrimmedSurface(square, [circle((0.5, 0.5), 0.4), circle((0.55, 0.5), 0.2)], gap)


RING_AREA = math.pi * (0.8**2 - 0.4**2)


def disc(x, y, radius, height=1.0):
    """Irradiance by a disc above a floor, at x, y from below its middle (Hottel 1967)."""
    a, r = x * x + y * y, radius**2
    total = a + height**2 + r
    return 0.5 * math.pi * (1.0 - (total - 2.0 * r) / math.sqrt(total**2 - 4.0 * r * a))


def ring_irradiance(x, y):
    return disc(x, y, 0.8) - disc(x, y - 0.1, 0.4)


@pytest.mark.statistical
@pytest.mark.parametrize("place", [(0.0, 0.0), (0.6, -0.3), (50.0, 0.0)])
def test_irradiance_of_a_ring(place):
    """The whole square spreads as much: by area far away, evenly in solid angle nearby."""
    _, _, points, value = chosen(ring_lamp(), (*place, 0.0), n=N)
    assert_mean(value, ring_irradiance(*place), 0.8)
    assert (points.pdf_area > 0.0).mean() > 0.97


@pytest.mark.statistical
@pytest.mark.parametrize("distance", [1e-3, 0.1, 1.0, 30.0])
def test_irradiance_of_a_cap(distance):
    """What fills a cone of half angle theta gives pi sin^2 theta, whatever its shape."""
    v = 0.05
    loop = polygon([(0, 0), (1, 0), (1, v), (0, v)])
    rim, height = math.sin(math.pi * v), 1.0 - math.cos(math.pi * v)
    ball = TrimmedSurface(Sphere((0, 0, 1), 1.0), [loop])
    # From below, all of it is seen from where its tangents at the rim do not hide it.
    if distance > 1.0 / math.cos(math.pi * v) - 1.0:
        _, _, _, value = chosen(ball, (0, 0, -distance), n=N)
        assert_mean(value, math.pi * rim**2 / (rim**2 + (distance + height) ** 2), 1.0)
    # From within, on the axis: the floor faces down, the lamp's pole lies below it.
    inside = TrimmedSurface(Sphere((0, 0, 1), 1.0).flipped(), [_flipped(loop)])
    away = 1.0 + min(distance, 0.9)
    _, _, _, value = chosen(inside, (0, 0, away), n=N, up=(0.0, 0.0, -1.0))
    assert_mean(value, math.pi * rim**2 / (rim**2 + (away - height) ** 2), 1.0)


def _flipped(loop):
    ball = TrimmedSurface(Sphere((0, 0, 1), 1.0), [loop])
    return list(ball.flipped().loops[0])


@pytest.mark.statistical
@pytest.mark.parametrize("make", SURFACES, ids=lambda make: make.__name__)
def test_every_kind_sends_what_a_sum_over_its_parameters_says(make):
    """Both sides of open surfaces count, since nothing hides them here."""
    surface = made(make)
    middle, size = surface.middle, surface.size
    place = middle + size * np.array([0.3, 0.2, -1.1])
    for lamp in (surface, surface.flipped()):
        _, _, points, value = chosen(lamp, place, n=N)
        n = 300
        grid = (np.arange(n) + 0.5) / n
        u, v = (x.ravel() for x in np.meshgrid(grid, grid, indexing="ij"))
        inside, _ = lamp.contains(u, v)
        u, v = u[inside], v[inside]
        across = np.cross(*lamp.partials(u, v))
        to = lamp.point(u, v) - place
        facing = np.maximum(-np.einsum("ij,ij->i", to, across), 0.0)
        square = np.einsum("ij,ij->i", to, to)
        truth = (facing * np.maximum(to[:, 2], 0.0) / square**2).sum() / n**2
        # Of a sum over 300 x 300 points errors at edges cancel all but a part in 300.
        assert_mean(value, truth, 2.0, rounding=3e-3)
        assert (points.pdf_area > 0.0).mean() > 0.95


@pytest.mark.parametrize("make", SURFACES, ids=lambda make: make.__name__)
@pytest.mark.parametrize("height", [1e-6, 0.5])
def test_density_of_what_is_run_into_is_that_of_asking(make, height):
    """Both walk the same tree, one by random numbers and one to a given place."""
    surface = made(make)
    u, v = np.random.default_rng(1).random((2, 1000))
    first = int(np.flatnonzero(surface.contains(u, v)[0])[0])
    at = u[[first]], v[[first]]
    place = surface.point(*at)[0] + height * surface.normal(*at)[0]
    light, seen_from, points, _ = chosen(surface, place, n=100)
    rows = np.flatnonzero(points.pdf_area > 0.0)
    assert rows.size >= 80
    density = light.seen_pdf_area(seen_from[rows], met(surface, points, rows))
    # A place within a rounding of the border of two parts may belong to either.
    assert (np.abs(density / points.pdf_area[rows] - 1.0) > 1e-6).sum() <= 1


AREAS = {
    plate: 4.0 - math.pi / 4.0,
    cap: 2.0 * math.pi * (1.0 - math.sqrt(0.5)),
    ring_lamp: RING_AREA,
}


@pytest.mark.statistical
@pytest.mark.parametrize("make", AREAS, ids=lambda make: make.__name__)
def test_one_over_the_density_is_the_area_in_the_mean(make):
    light = shining_surface(make())
    density = light.points(np.random.default_rng(2).random((20_000, 2))).pdf_area
    value = np.divide(1.0, density, out=np.zeros_like(density), where=density > 0.0)
    assert_mean(value, AREAS[make], 0.3)
    # As many photons as lamps are given by their area: 16 points of cells at edges estimate it.
    assert light.area == pytest.approx(AREAS[make], rel=3e-3)


@pytest.mark.parametrize("width", [1e-3, 1e-6])
def test_narrow_and_tiny_parts_shine(width):
    """Of a strip as narrow as the smallest cells most points are outside, and counted."""
    whole = Rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0))
    tiny = TrimmedSurface(whole, [circle((0.3, 0.4), max(width, 1e-5))])
    density = shining_surface(tiny).points(np.random.default_rng(4).random((4096, 2))).pdf_area
    assert (density > 0.0).mean() > 0.95
    strip = polygon([(0.1, 0.1), (0.9, 0.7), (0.9, 0.7 + width), (0.1, 0.1 + width)])
    light = shining_surface(TrimmedSurface(whole, [strip]))
    assert light.area > 0.0
    density = light.points(np.random.default_rng(5).random((30_000, 2))).pdf_area
    value = np.divide(1.0, density, out=np.zeros_like(density), where=density > 0.0)
    assert_mean(value, 0.8 * width, 50.0)


def test_what_has_nothing_inside_its_loops_is_refused_by_name():
    beyond = TrimmedSurface(Rectangle((0, 0, 1), (0, 1, 0), (1, 0, 0)), [circle((1.5, 0.5), 0.2)])
    scene = Scene(view(), [FLOOR, Object(beyond, Emissive(1.0), "lamp")])
    with pytest.raises(ValueError, match=r"object 'lamp' has no area inside its loops"):
        render(scene, "path", 1)


def test_hits_beside_an_edge_within_the_gap_are_found_by_directions_alone():
    lamp = ring_lamp(gap=0.01)
    light = shining_surface(lamp)
    n = 64
    turn = 2.0 * np.pi * np.arange(n) / n
    for beside, is_sampled in ((-1e-3, True), (1e-3, False)):
        r = 0.4 + beside
        u, v = 0.5 + r * np.cos(turn), 0.5 + r * np.sin(turn)
        points = light.points(np.zeros((n, 2)))._replace(u=u, v=v, position=lamp.point(u, v))
        hits = met(lamp, points, np.arange(n))
        density = light.seen_pdf_area(np.zeros((n, 3)), hits)
        assert ((density > 0.0) == is_sampled).all()
        assert ((light.pdf_area(np.zeros(n, np.int64), u, v) > 0.0) == is_sampled).all()


def view(size=16):
    return Camera((0, -0.5, 0.5), (0.2, 0.0, 0), (0, 0, 1), 1e-6, size, size)


WAYS = {
    **{f"path, {s}": ("path", PathOptions(strategy=s)) for s in ("both", "lights", "directions")},
    "whitted": ("whitted", None),
    "ppm": ("ppm", PPMOptions(200)),
    "photon_map": ("photon_map", PhotonMapOptions(2000, 20)),
}


@pytest.mark.statistical
@pytest.mark.parametrize("way", WAYS)
def test_pictures_show_it(way):
    """A point of a floor, in every way of finding the light of a ring above."""
    integrator, options = WAYS[way]
    scene = Scene(view(), [FLOOR, Object(ring_lamp(), Emissive(1.0), "lamp")])
    result = render(scene, integrator, 4, seed=5, threads=1, max_depth=0, options=options)
    image = result.image[..., 0].ravel().astype(float)
    # A quarter of the directions meet the ring: that alone makes 0.5 sqrt(3), of four samples each.
    assert_mean(image, 0.5 / math.pi * ring_irradiance(0.2, 0.0), 0.9)
    assert result.report["lamps_in_surfaces"] == []


@pytest.mark.statistical
@pytest.mark.parametrize("make", [sheet, turned_part, windowed_torus])
def test_all_ways_of_finding_its_light_agree(make):
    """A floor below lamps that hide parts of themselves, with a texture along their (u, v)."""
    lift = np.eye(4)
    lift[2, 3] = 2.5
    lamp = make().transformed(lift)
    # The sheet's normals point up.
    lamp = lamp.flipped() if make is sheet else lamp
    texture = CheckerTexture(1.0, 0.25, (5, 7), "uv")
    objects = [FLOOR, Object(lamp, Emissive(texture), "lamp")]
    images = []
    for way in ("path, lights", "path, both", "path, directions", "ppm"):
        integrator, options = WAYS[way]
        result = render(
            Scene(view(), objects), integrator, 8, seed=7, threads=1, max_depth=0, options=options
        )
        images.append(result.image[..., 0].ravel().astype(float))
    for other in images[1:]:
        assert stats.ttest_ind(images[0], other, equal_var=False).pvalue > ALARM
    error = [image.std() for image in images]
    assert error[1] < 1.2 * min(error[0], error[2])


@pytest.mark.statistical
def test_photons_carry_the_power_of_what_is_inside_the_loops():
    scene = Scene(view(), [FLOOR, Object(ring_lamp(), Emissive(2.0), "lamp")])
    report = render(scene, "ppm", 2, seed=1, threads=1, options=PPMOptions(20_000)).report
    power = np.array(report["photons"]["power_of_all_passes"]["emitted"]) / 2
    # Low-discrepancy points: far better than the 1.3 / sqrt(40 000) of independent ones.
    np.testing.assert_allclose(power, math.pi * RING_AREA * 2.0, rtol=5e-3)


def test_camera_sees_through_the_hole():
    """Straight from below: pixels wholly on the ring have its radiance, all others outside none."""
    n = 32
    camera = Camera((0, 0, -1), (0, 0, 0), (0, 1, 0), math.degrees(2.0 * math.atan(0.5)), n, n)
    scene = Scene(camera, [Object(ring_lamp(), Emissive(3.0), "lamp")])
    image = render(scene, "path", 4, seed=2, threads=1).image[..., 0]
    edge = 2.0 * np.arange(n + 1) / n - 1.0
    corner = np.stack(np.meshgrid(edge, edge), axis=-1)
    sides = []
    # The picture's rows go down, and seen from below x may run either way: the ring is even in x.
    for y, radius in ((0.0, 0.8), (0.1, 0.4)):
        away = np.hypot(corner[..., 0], -corner[..., 1] - y)
        four = np.stack([away[:-1, :-1], away[1:, :-1], away[:-1, 1:], away[1:, 1:]])
        step = 2.0 / n
        sides.append((four.max(axis=0) < radius, four.min(axis=0) > radius + step))
    (in_outer, out_outer), (in_hole, out_hole) = sides
    assert (image[in_outer & out_hole] == 3.0).all()
    assert (image[out_outer | in_hole] == 0.0).all()
    assert in_hole.sum() > 50
    assert image.mean() == pytest.approx(3.0 * RING_AREA / 4.0, rel=0.02)


def test_a_plug_in_the_hole_does_not_hide_the_lamp():
    """Only points inside the loops are looked at, where lamps in surfaces are sought."""
    square = Rectangle((-1, -1, 1), (0, 2, 0), (2, 0, 0))
    lamp = TrimmedSurface(square, [OUTLINE, circle((0.5, 0.5), 0.25)])
    plug = TrimmedSurface(square, [circle((0.5, 0.5), 0.25)])
    objects = [FLOOR, Object(plug, Lambertian(0.5), "plug"), Object(lamp, Emissive(1.0), "lamp")]
    result = render(Scene(view(), objects), "whitted", 1, seed=1, threads=1)
    assert result.report["lamps_in_surfaces"] == []
    point = shining_surface(lamp).one_point()
    assert lamp.contains(point.u, point.v)[0].all()
    # Where both fill the square the whole lamp lies in the other, and is moved out of it.
    objects[1] = Object(square, Lambertian(0.5), "ceiling")
    (note,) = render(Scene(view(), objects), "whitted", 1, seed=1, threads=1).report[
        "lamps_in_surfaces"
    ]
    assert note["lifted_by"] > 0.0
