"""Lenses: printed focal lengths, light that meets in one point, and another tracer's rays."""

import math
from dataclasses import replace

import mpmath
import numpy as np
import pytest
from scipy.optimize import minimize_scalar

from hybrid_rt.analysis.lens import Fate, Lens, LensSurface
from hybrid_rt.analysis.lens_examples import (
    COOKE_PRINTED,
    COOKE_TRIPLET,
    DOUBLE_GAUSS,
    DOUBLE_GAUSS_PRINTED,
    stigmatic_singlet,
)


def test_the_printed_focal_lengths_come_out():
    lens = Lens(COOKE_TRIPLET)
    traced, paraxial = lens.focus(), lens.paraxial_focus()
    # As many digits as the book gives.
    np.testing.assert_allclose(traced, COOKE_PRINTED, atol=5e-4)
    # The ray runs 3e-3 beside the axis: third order changes f by f (h / f)^2 = 1e-7.
    np.testing.assert_allclose(traced, paraxial, atol=2e-7)
    gauss = Lens(DOUBLE_GAUSS)
    np.testing.assert_allclose(gauss.focus(), gauss.paraxial_focus(), atol=2e-6)
    # Indices are printed to three decimals: 5e-4 of 0.7 in the power of each surface.
    np.testing.assert_allclose(gauss.focus(), DOUBLE_GAUSS_PRINTED, atol=0.05)


def test_a_hyperboloid_brings_parallel_light_to_a_point():
    lens = Lens(stigmatic_singlet(1.5, 50.0, 60.0))
    focus = 25.0 + 50.0
    points, chief, rms = lens.spot(0.0, focus, 58.0)
    assert len(points) > 3000
    # Rounding: units in the last place of 75, over slopes of 1.
    assert np.abs(points).max() < 1e-13
    assert rms < 5e-14
    assert np.abs(chief).max() < 1e-14
    assert lens.focus().back_focal_distance == pytest.approx(50.0, abs=1e-9)
    # All paths to the focus are as long: of the ray on the axis, 25 of glass and 50 of air.
    x = np.linspace(-29, 29, 101)
    origins = np.stack([x, 0 * x, np.full(101, -10.0)], axis=1)
    rays = lens.trace(origins, np.broadcast_to([0.0, 0.0, 1.0], (101, 3)))
    assert rays.passed.all()
    last = np.linalg.norm(rays.position - (0, 0, focus), axis=1)
    np.testing.assert_allclose(rays.path + last, 10 + 1.5 * 25 + 50, atol=1e-13)
    # A sphere of the same power does not.
    front, back = stigmatic_singlet(1.5, 50.0, 30.0)
    ball = Lens((front, replace(back, conic=0.0)))
    assert ball.spot(0.0, focus, 28.0)[2] > 0.5


class TestLightOfAPoint:
    """A sphere of radius 10 from glass of n = 1.5 into air, and its aplanatic points.

    Light of a point at R / n from the centre seems to come from n R, whatever its direction.
    """

    N, R = 1.5, 10.0
    SURFACE = LensSurface(-R, 0.0, 1.0, 12.0)
    LENS = Lens([SURFACE], index=N)

    def conjugates(self, degrees):
        turn = math.radians(degrees)
        way = np.array([0.0, math.sin(turn), -math.cos(turn)])
        centre = np.array([0.0, 0.0, -self.R])
        return centre + self.R / self.N * way, centre + self.R * self.N * way

    @pytest.mark.parametrize("z", [-0.1, -0.01, -0.001])
    def test_a_source_next_to_the_lens_lights_it(self, z):
        """All that is not steeper than the rim passes: a wide search meets the lens nowhere."""
        ball = Lens([LensSurface(1.5, 2, 1.5, 2.4), LensSurface(-1.5, 0, 1, 2.4)])
        rays = ball.from_point((0, 0, z))
        assert rays.passed.mean() > 0.5
        slopes = rays.direction[rays.passed]
        assert np.abs(slopes.mean(axis=0)[:2]).max() < 0.02

    @pytest.mark.parametrize("degrees", [0.0, 7.0, -20.0])
    def test_aplanatic_points(self, degrees):
        source, image = self.conjugates(degrees)
        met, centroid, rms = self.LENS.spot(source, image[2])
        assert len(met) > 1000
        # 100 units in the last place of 25: rays lead back 20 from where three steps rounded their direction.
        assert rms < 4e-13
        np.testing.assert_allclose(centroid, image[:2], atol=4e-13)
        z = self.LENS.plane_of_least_spread(-10.0, field=source)
        assert z == pytest.approx(image[2], abs=1e-12)

    def test_paths_begin_at_the_point(self):
        """Paths to the virtual image are as long: n s - s', with s to the surface and s' back from it."""
        source, image = self.conjugates(0.0)
        rays = self.LENS.from_point(source, pupil=8.0)
        assert rays.passed.all()
        np.testing.assert_array_equal(rays.origins, np.broadcast_to(source, rays.origins.shape))
        back = np.linalg.norm(rays.position - image, axis=1)
        np.testing.assert_allclose(rays.path - back, self.N * -source[2] + image[2], atol=1e-13)

    def test_without_a_pupil_it_fills_the_apertures(self):
        """Off the axis of a triplet: the same spot as by a cone of which one ray in ten gets through."""
        lens, point = Lens(COOKE_TRIPLET), (0.0, 30.0, -300.0)
        assert lens.from_point(point).passed.mean() > 0.4
        assert lens.from_point(point, pupil=80.0).passed.mean() < 0.2
        spots = [lens.spot(point, 150.0, pupil, n)[1:] for pupil, n in ((None, 200), (80.0, 600))]
        # Borders of what passes are resolved to 1 in 200.
        np.testing.assert_allclose(spots[0][0], spots[1][0], atol=0.02 * spots[1][1])
        assert spots[0][1] == pytest.approx(spots[1][1], rel=0.02)

    @pytest.mark.parametrize(
        ("field", "words"),
        [
            ((0, 0), r"Lens field is \(0, 0\): pass an angle in degrees, or a point"),
            ((0, 0, math.nan), "pass an angle in degrees, or a point"),
            ((0, 0, -1.0), r"begins at z = -2: pass a point in front of that; trace takes rays"),
            ((0, 0, -1e9), "farther away than 1e\\+06 times the width of the lens: pass an angle"),
            ((0, 40, -4.0), r"no light from \(0, 40, -4\) passes the lens"),
        ],
    )
    def test_what_is_no_field_is_refused(self, field, words):
        with pytest.raises(ValueError, match=words):
            self.LENS.spot(field, 0.0)


def asphere_hit(s, o, d, vertex):
    """Return t, by the secant method on the sag, and the unit normal of an asphere."""
    curvature, conic = 1 / mpmath.mpf(s.radius), mpmath.mpf(s.conic)

    def sag(r):
        root = mpmath.sqrt(1 - (1 + conic) * (curvature * r) ** 2)
        even = [mpmath.mpf(a) * r ** (2 * k + 2) for k, a in enumerate(s.coefficients)]
        return curvature * r * r / (1 + root) + mpmath.fsum(even)

    def gap(t):
        return o[2] + t * d[2] - vertex - sag(mpmath.hypot(o[0] + t * d[0], o[1] + t * d[1]))

    start = (vertex - o[2]) / d[2]
    t = mpmath.findroot(gap, (start, start + s.aperture / 100))
    x, y = o[0] + t * d[0], o[1] + t * d[1]
    r = mpmath.hypot(x, y)
    slope = mpmath.diff(sag, r)
    length = mpmath.sqrt(1 + slope * slope)
    return t, [-slope * x / r / length, -slope * y / r / length, 1 / length]


# An asphere as moulded lenses have them, and a meniscus behind it with a stop between.
ASPHERES = (
    LensSurface(50.0, 8.0, 1.5168, 36.0, conic=-0.58, coefficients=(0.0, 1.1e-6, -2.0e-10)),
    LensSurface(-300.0, 4.0, 1.0, 34.0, conic=2.0, coefficients=(1e-4, -3e-7)),
    LensSurface(math.inf, 0.0, 1.0, 30.0),
    LensSurface(-60.0, 3.0, 1.62, 34.0),
    LensSurface(-90.0, 0.0, 1.0, 36.0, conic=-1.0, coefficients=(0.0, 2e-7)),
)


def through(prescription, origin, direction):
    """Trace one ray to 40 digits through spheres and planes, each by its quadratic; None: blocked."""
    o, d = [mpmath.mpf(float(x)) for x in origin], [mpmath.mpf(float(x)) for x in direction]
    length = mpmath.norm(mpmath.matrix(d))
    d, index, vertex = [x / length for x in d], mpmath.mpf(1), mpmath.mpf(0)
    for s in prescription:
        if s.conic or s.coefficients:
            t, normal = asphere_hit(s, o, d, vertex)
        elif math.isinf(s.radius):
            t, normal = (vertex - o[2]) / d[2], [mpmath.mpf(0), mpmath.mpf(0), mpmath.mpf(1)]
        else:
            centre = [0, 0, vertex + mpmath.mpf(s.radius)]
            away = [a - b for a, b in zip(o, centre, strict=True)]
            b, c = mpmath.fdot(away, d), mpmath.fdot(away, away) - mpmath.mpf(s.radius) ** 2
            t = -b - mpmath.sign(s.radius) * mpmath.sqrt(b * b - c)
            normal = [(a + t * x) / s.radius for a, x in zip(away, d, strict=True)]
        o = [a + t * x for a, x in zip(o, d, strict=True)]
        if mpmath.hypot(o[0], o[1]) > s.aperture / 2:
            return None
        cosine = mpmath.fdot(d, normal)
        ratio = index / mpmath.mpf(s.index)
        beyond = mpmath.sign(cosine) * mpmath.sqrt(1 - ratio**2 * (1 - cosine**2))
        d = [ratio * x + (beyond - ratio * cosine) * y for x, y in zip(d, normal, strict=True)]
        index, vertex = mpmath.mpf(s.index), vertex + mpmath.mpf(s.thickness)
    return o, d


@pytest.mark.parametrize(
    "prescription",
    [COOKE_TRIPLET, DOUBLE_GAUSS, ASPHERES],
    ids=["Cooke", "Gauss", "aspheres"],
)
def test_rays_are_those_of_another_tracer(prescription):
    rng = np.random.default_rng(4)
    half = 0.5 * prescription[0].aperture
    origins = np.column_stack([rng.uniform(-half, half, (150, 2)), np.full(150, -20.0)])
    directions = np.column_stack([rng.normal(0, 0.1, (150, 2)), np.ones(150)])
    lens = Lens(prescription)
    rays = lens.trace(origins, directions)
    with mpmath.workdps(40):
        wanted = [through(prescription, o, d) for o, d in zip(origins, directions, strict=True)]
    assert np.array_equal(rays.passed, [ray is not None for ray in wanted])
    assert 30 < rays.passed.sum() < 150
    for k in np.flatnonzero(rays.passed):
        position, direction = ([float(x) for x in part] for part in wanted[k])
        # Five to eleven surfaces, a few roundings of 100 at each, over cosines above a half.
        np.testing.assert_allclose(rays.position[k], position, atol=2e-13)
        np.testing.assert_allclose(rays.direction[k], direction, atol=1e-14)


def test_a_stop_may_touch_the_next_surface_or_lie_behind_its_rim():
    # In the plane of a flat face, and in that of the vertex of a concave one, whose rim lies in front.
    for front in (math.inf, -80.0):
        bare = [LensSurface(front, 6.0, 1.5, 25.0), LensSurface(-30.0, 0.0, 1.0, 25.0)]
        stop = LensSurface(math.inf, 0.0, 1.0, 8.0)
        origins = np.array([[3.0, 0, -10], [0, 3.5, -10], [5.0, 0, -10]])
        with_stop, without = (Lens(one).trace(origins, (0, 0, 1)) for one in ([stop, *bare], bare))
        assert with_stop.passed.tolist() == [True, True, False]
        assert without.passed.all()
        np.testing.assert_array_equal(with_stop.position[:2], without.position[:2])
        np.testing.assert_array_equal(with_stop.path[:2], without.path[:2])
        assert Lens([stop, *bare]).focus().focal_length == pytest.approx(
            Lens(bare).paraxial_focus().focal_length, rel=1e-6
        )


@pytest.mark.parametrize("thickness", [-3.0, -64.0])
def test_light_starts_in_front_of_a_lens_whose_entrance_pupil_is_virtual(thickness):
    bare = [LensSurface(24.3, 2.6, 1.5231, 24.0), LensSurface(61.7, 0.0, 1.0, 24.0)]
    # As wide as the lens: the probe of both then runs at the same height.
    wide = Lens([LensSurface(math.inf, thickness, 1.0, 24.0), *bare])
    # The same rays; places on the axis are those of the other frame, to a few units in the last place.
    np.testing.assert_allclose(wide.focus(), Lens(bare).focus(), rtol=1e-13)
    narrow = Lens([LensSurface(math.inf, thickness, 1.0, 4.9), *bare])
    # Third order, at 1e-4 of the aperture: (5e-4 / 24)^2.
    np.testing.assert_allclose(narrow.focus(), narrow.paraxial_focus(), rtol=1e-8)
    assert narrow.parallel(0.0, pupil=4.8, n=16).passed.all()
    assert not narrow.parallel(0.0, pupil=5.6, n=16).passed.all()


def test_a_plate_has_its_focus_at_infinity():
    plate = Lens([LensSurface(math.inf, 6.0, 1.5, 25.0), LensSurface(math.inf, 0.0, 1.0, 25.0)])
    assert plate.focus() == plate.paraxial_focus() == (math.inf, math.inf)
    with pytest.raises(ValueError, match="its spot is as wide everywhere"):
        plate.plane_of_least_spread(10.0, pupil=5.0)


def test_what_surfaces_reflect_is_that_of_fresnels_formulas():
    """A slanted ray through a stop and a plate between air and water, by the angles."""
    lens = Lens(
        [
            LensSurface(np.inf, 1.0, 1.0, 20.0),
            LensSurface(np.inf, 1.0, 1.7, 20.0),
            LensSurface(np.inf, 0.0, 1.33, 20.0),
        ]
    )
    angles = np.radians([0.001, 20.0, 45.0, 70.0])
    ways = np.column_stack([np.sin(angles), 0 * angles, np.cos(angles)])
    expected = np.ones(4)
    for before, after in ((1.0, 1.7), (1.7, 1.33)):
        i, t = np.arcsin(np.sin(angles) / before), np.arcsin(np.sin(angles) / after)
        s, p = np.sin(i - t) / np.sin(i + t), np.tan(i - t) / np.tan(i + t)
        expected *= 1.0 - 0.5 * (s * s + p * p)
    rays = lens.trace(-ways, ways)
    np.testing.assert_allclose(rays.transmittance, expected, rtol=1e-10)
    lost = lens.trace([(0.0, 30.0, -1.0)], (0, 0, 1))
    assert np.isnan(lost.transmittance).all()


def test_one_direction_goes_with_all_origins_and_the_table_reads_back(tmp_path):
    lens = Lens(COOKE_TRIPLET)
    origins = np.array([[0.0, 0, -10], [0.1, 5, -10], [40, 0, -10]])
    rays = lens.trace(origins, (0, 0, 2))
    np.testing.assert_array_equal(
        rays.position, lens.trace(origins, np.tile((0.0, 0, 1), (3, 1))).position
    )
    assert repr(rays) == "Traced(3 rays, 2 passed)"
    rays.to_csv(tmp_path / "rays.csv")
    header, *lines = (tmp_path / "rays.csv").read_text().splitlines()
    assert header == "passed,ox,oy,oz,x,y,z,dx,dy,dz,path,t_bound,stopped_at,fate,transmittance"
    values = np.genfromtxt(lines, delimiter=",")
    np.testing.assert_array_equal(values[:, 0], [1, 1, 0])
    np.testing.assert_array_equal(values[:, 1:4], origins)
    np.testing.assert_array_equal(values[:, 4:7], rays.position)
    np.testing.assert_array_equal(values[:, 7:10], rays.direction)
    np.testing.assert_array_equal(values[:, 10], rays.path)
    np.testing.assert_array_equal(values[:, 11], rays.t_bound)
    np.testing.assert_array_equal(values[:, 12], [-1, -1, 0])
    np.testing.assert_array_equal(values[:, 13], [Fate.PASSED, Fate.PASSED, Fate.OUTSIDE])


def test_a_lens_whose_surfaces_cross_is_no_better_without_a_word():
    """At a height of 12.7 the front is 1.58 deep, and the lens 0.5 thick."""
    thin = Lens([LensSurface(51.68, 0.5, 1.5168, 25.4), LensSurface(math.inf, 0.0, 1.0, 25.4)])
    words = r"meet the surface of prescription\[1\] from behind"
    with pytest.warns(UserWarning, match=words):
        points, _, _ = thin.spot(0.0, 100.0, n=16)
    with pytest.warns(UserWarning, match=words):
        thin.plane_of_least_spread(100.0, n=16)
    with pytest.warns(UserWarning, match=words) as caught:
        rays = thin.parallel(0.0, n=16)
    assert len(points) == np.count_nonzero(rays.passed)
    with pytest.warns(UserWarning, match=rf"Lens: 1 of 2 rays {words}") as also:
        thin.trace([(0, 0, -9), (0, 12.6, -9)], (0, 0, 1))
    assert {warning.filename for warning in (*caught, *also)} == {__file__}
    thick = Lens([LensSurface(51.68, 2.0, 1.5168, 25.4), LensSurface(math.inf, 0.0, 1.0, 25.4)])
    assert (thick.parallel(0.0, n=16).fate != Fate.BEHIND).all()
    thick.spot(0.0, 100.0, n=16)


def test_some_of_the_rays_are_selected_as_hits_are():
    lens = Lens(COOKE_TRIPLET)
    rays = lens.trace([[0.0, 0, -10], [0.1, 5, -10], [40, 0, -10]], (0, 0, 2))
    assert len(rays) == 3
    through = rays[rays.passed]
    np.testing.assert_array_equal(through.position, rays.position[:2])
    np.testing.assert_array_equal(through.at(70.0), rays.at(70.0)[:2])
    assert (len(through), len(rays[2]), len(rays[1:])) == (2, 1, 2)
    assert rays[-1].fate[0] == Fate.OUTSIDE


def test_lost_rays_name_the_surface_that_stopped_them():
    # Inside glass of index 1.5 light at 45 degrees does not leave through a plane: sin > 1 / 1.5.
    prism = Lens(
        [LensSurface(math.inf, 5.0, 1.5, 30.0), LensSurface(math.inf, 0.0, 1.0, 20.0)], 1.5
    )
    slant = (0.0, math.sqrt(0.5), math.sqrt(0.5))
    rays = prism.trace(
        [(0, 0, -1), (0, -6, -1), (0, 20, -1), (0, 12, -1)],
        [(0, 0, 1), slant, (0, 0, 1), (0, 0, 1)],
    )
    np.testing.assert_array_equal(rays.stopped_at, [-1, 1, 0, 1])
    np.testing.assert_array_equal(rays.passed, [True, False, False, False])
    assert rays.fate.tolist() == [
        Fate.PASSED, Fate.TOTAL_REFLECTION, Fate.OUTSIDE, Fate.OUTSIDE
    ]  # fmt: skip
    np.testing.assert_array_equal(np.isnan(rays.t_bound), ~rays.passed)
    with pytest.raises(
        ValueError, match=r"from 45 degrees .* most is stopped at prescription\[1\]"
    ):
        prism.parallel(45.0, 2.0)


@pytest.mark.parametrize("field", [0.0, 8.3, -11.86])
def test_the_plane_of_least_spread_is_the_smallest_spot(field):
    lens = Lens(COOKE_TRIPLET)
    near = lens.vertices[-1] + lens.paraxial_focus().back_focal_distance
    plane = lens.plane_of_least_spread(near, field=field, pupil=29.2, n=16)
    found = minimize_scalar(
        lambda z: lens.spot(field, z, 29.2, 16)[2] ** 2, bracket=(near - 5, near + 5), tol=1e-10
    )
    # The square of the spot is a parabola in z: its minimum is found to the root of the tolerance.
    assert plane == pytest.approx(found.x, abs=1e-5)
    # From anywhere: least squares of a line.
    again = lens.plane_of_least_spread(0.0, field=field, pupil=29.2, n=16)
    assert again == pytest.approx(plane, abs=1e-10)


@pytest.mark.parametrize("field", [0.0, -8.3, 11.86])
def test_all_light_that_passes_is_found(field):
    """The spot is that of a disc so wide that all light beyond it is lost."""
    lens = Lens(COOKE_TRIPLET)
    rays = lens.parallel(field, n=200)
    # What passes touches all four sides of the rectangle, to the cells of the first look.
    assert rays.passed.mean() > 0.6
    z = lens.vertices[-1] + 77.4
    wide = lens.spot(field, z, 60.0, 600)[2]
    # A rim of cells of either grid is in doubt, a hundredth of the light.
    assert lens.spot(field, z, n=200)[2] == pytest.approx(wide, rel=0.01)


@pytest.mark.parametrize("pupil", [None, 8.0])
def test_one_ray_goes_through_the_middle_of_a_plane(pupil):
    """It begins in front of the surface, not on it."""
    lens = Lens([LensSurface(math.inf, 3.0, 1.5, 20.0), LensSurface(-50.0, 0.0, 1.0, 20.0)])
    ray = lens.parallel(0.0, pupil, n=1)
    assert ray.fate.tolist() == [Fate.PASSED]
    np.testing.assert_allclose(ray.position, [(0.0, 0.0, 3.0)], atol=1e-12)


@pytest.mark.parametrize(
    ("prescription", "stop", "field", "diameter"),
    [(DOUBLE_GAUSS, 5, 12.0, 0.02), (COOKE_TRIPLET, 4, 8.3, 1e-6)],
)
def test_a_stop_between_the_rays_of_a_grid_is_found(prescription, stop, field, diameter):
    """Few enough light passes that no ray of 512 x 512 does."""
    lines = list(prescription)
    lines[stop] = replace(lines[stop], aperture=diameter)
    rays = Lens(lines).parallel(field, n=64)
    assert rays.passed.mean() > 0.2
    # They fill the stop, to the cells of the rectangle, of which a fifth of the rays or more pass.
    met = (
        Lens(lines[: stop + 1])
        .trace(rays.origins[rays.passed], direction_of(field))
        .at(sum(line.thickness for line in lines[:stop]))
    )
    assert np.hypot(*met.T).max() <= 0.5 * diameter * (1 + 1e-6)
    assert (np.ptp(met, axis=0) > 0.9 * diameter).all()


def direction_of(field):
    return (0.0, math.sin(math.radians(field)), math.cos(math.radians(field)))


def test_a_long_and_narrow_rest_of_the_light_is_found():
    """Two apertures of radius 5, which the field shifts against each other by 10 less the width."""
    width = 1e-3
    field = math.degrees(math.atan((10.0 - width) / 80.0))
    lens = Lens([LensSurface(math.inf, 80.0, 1.0, 10.0), LensSurface(math.inf, 0.0, 1.0, 10.0)])
    rays = lens.parallel(field, n=1000)
    points = rays.at(0.0)[rays.passed]
    half = math.sqrt(25.0 - (5.0 - 0.5 * width) ** 2)
    # It tapers to its ends, and few rays lie across it.
    assert np.abs(points[:, 0]).max() == pytest.approx(half, rel=0.15)
    assert np.abs(points[:, 1] + 5.0 - 0.5 * width).max() <= 0.5 * width + 1e-12


def test_light_that_slips_between_given_rays_is_hinted_at():
    lines = [replace(DOUBLE_GAUSS[0]), *DOUBLE_GAUSS[1:5], replace(DOUBLE_GAUSS[5], aperture=1e-3)]
    with pytest.raises(ValueError, match=r"prescription\[5\]; .*; or pass a larger n, if light"):
        Lens(lines).parallel(0.0, pupil=80.0)
    with pytest.raises(ValueError, match=r"order; or pass pupil=, if very little light passes"):
        Lens(lines).parallel(70.0)


def test_origins_are_those_of_the_rays_and_lead_to_the_stop():
    lens, field = Lens(COOKE_TRIPLET), 8.3
    given = np.array([[0.0, 1.0, -10.0], [0.0, 90.0, -10.0]])
    rays = lens.trace(given, (0, 0, 1))
    np.testing.assert_array_equal(rays.origins, given)  # lost ones included
    rays = lens.parallel(field)
    way = direction_of(field)
    # In a plane across the light: coordinates of 100 are rounded.
    assert np.ptp(rays.origins @ way) < 1e-13
    again = lens.trace(rays.origins, way)
    np.testing.assert_array_equal(again.position, rays.position)
    # Up to the stop a lens that ends there bends the same rays, to the bit.
    at_stop = Lens(COOKE_TRIPLET[:5]).trace(rays.origins, way)
    assert at_stop.passed[rays.passed].all()
    np.testing.assert_array_equal(
        at_stop.passed, (rays.stopped_at > 4) | rays.passed
    )  # fmt: skip
    before = Lens(COOKE_TRIPLET[:4]).trace(rays.origins, way)
    np.testing.assert_allclose(
        at_stop.position[at_stop.passed, :2], before.at(23.33)[at_stop.passed], atol=1e-13
    )


FRONT = LensSurface(50.0, 6.0, 1.5, 25.0)
BACK = LensSurface(math.inf, 0.0, 1.0, 25.0)


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        ([], "prescription is empty: pass"),
        ([(50.0, 6.0, 1.5, 25.0)], r"prescription\[0\] is \(50.0, .*: pass LensSurface\("),
        (
            [FRONT, replace(BACK, radius=10.0)],
            r"prescription\[1\]: Asphere aperture is 25 .* at most",
        ),
        ([replace(FRONT, index=-1.0), BACK], r"prescription\[0\].index is -1.*mirrors are no part"),
        (
            [replace(FRONT, index=587.6), BACK],
            r"index is 587.6: .* at most 100.*not the wavelength",
        ),
        (
            [LensSurface(math.inf, math.inf, 1.0, 25.0), FRONT, BACK],
            r"prescription\[0\].thickness is inf: .*leave out the line of the object",
        ),
        (
            [replace(FRONT, thickness=-6.0), BACK],
            r"prescription\[0\].thickness is -6.0: pass at least 0.*behind a stop",
        ),
    ],
)
def test_a_bad_prescription_is_refused_by_its_line(lines, message):
    with pytest.raises((ValueError, TypeError), match=message):
        Lens(lines)


def test_rays_from_behind_do_not_get_through():
    """Neither surface of one line refracts glass to air what goes from air to glass."""
    rays = Lens([replace(FRONT, thickness=0.0)]).trace((5, 0, 100), (0, 0, -1))
    assert not rays.passed[0]
    assert rays.stopped_at[0] == 0
    assert rays.fate[0] == Fate.BEHIND
    assert np.isnan(rays.direction).all()


def test_rays_are_lost_where_surfaces_cross():
    """Two spheres of radius 50 and 6 between the vertices meet where either sag is 3: r^2 = 291."""
    lens = Lens([LensSurface(50.0, 6.0, 1.5, 50.0), LensSurface(-50.0, 0.0, 1.0, 50.0)])
    inside, beyond = math.sqrt(291) - 1e-9, math.sqrt(291) + 0.5
    with pytest.warns(UserWarning, match="1 of 2 rays meet"):
        rays = lens.trace([(0, inside, -9), (0, beyond, -9)], (0, 0, 1))
    assert rays.fate.tolist() == [Fate.PASSED, Fate.BEHIND]
    assert rays.stopped_at.tolist() == [-1, 1]


@pytest.mark.parametrize("scale", [5e-324, 1e-310, 1e-170, 1e200])
def test_directions_have_any_length(scale):
    lens = Lens([FRONT, BACK])
    rays, unit = (lens.trace((0, 1, -9), (0, 0, length)) for length in (scale, 1.0))
    np.testing.assert_array_equal(rays.position, unit.position)


def test_bad_rays_and_spots_are_refused():
    lens = Lens([FRONT, BACK])
    with pytest.raises(ValueError, match="got 3 origins and 2 directions"):
        lens.trace(np.zeros((3, 3)), np.ones((2, 3)))
    with pytest.raises(ValueError, match=r"directions\[1\] has length zero"):
        lens.trace((0, 0, -1), [(0, 0, 1), (0, 0, 0)])
    with pytest.raises(ValueError, match=r"origins\[0\] is not finite"):
        lens.trace((0, 0, math.nan), (0, 0, 1))
    for changed, name in (({"field": 95}, "field"), ({"pupil": -1}, "pupil"), ({"n": 0}, "n")):
        with pytest.raises(ValueError, match=f"Lens {name} is"):
            lens.spot(**{"field": 0.0, "z": 50.0, "pupil": 5.0, "n": 8} | changed)


@pytest.mark.parametrize("field", [0.0, 5.0])
@pytest.mark.parametrize(
    ("touching", "apart"),
    [
        # A stop on the plane back, and on the vertex of a bent one.
        ([(60, 6, 1.5), (math.inf, 0, 1), (math.inf, 0, 1)], [(60, 6, 1.5), (math.inf, 0, 1)]),
        ([(60, 6, 1.5), (-60, 0, 1), (math.inf, 0, 1)], [(60, 6, 1.5), (-60, 0, 1)]),
        # A surface given twice, as at a cement.
        (
            [(60, 6, 1.5), (-45, 0, 1.67), (-45, 2, 1.67), (math.inf, 0, 1)],
            [(60, 6, 1.5), (-45, 2, 1.67), (math.inf, 0, 1)],
        ),
        # No air between equal surfaces: that refracts as if they were cemented.
        (
            [(60, 6, 1.5), (-45, 0, 1), (-45, 2, 1.67), (math.inf, 0, 1)],
            [(60, 6, 1.5), (-45, 2, 1.67), (math.inf, 0, 1)],
        ),
    ],
    ids=["plane stop", "stop at a vertex", "twice", "no air"],
)
def test_surfaces_may_touch(touching, apart, field):
    one, other = (
        Lens([LensSurface(*line, 24.0) for line in lines]).parallel(field, pupil=20.0)
        for lines in (touching, apart)
    )
    assert one.passed.all()
    plane = other.position[:, 2].max()
    # Roundings of coordinates below 30, some of which a slope of 1 multiplies.
    np.testing.assert_allclose(one.at(plane), other.at(plane), atol=1e-13)
    if len(touching) > len(apart):
        np.testing.assert_allclose(one.direction, other.direction, atol=1e-14)


def test_rays_may_start_on_the_first_surface():
    lens = Lens([LensSurface(60.0, 6.0, 1.5, 24.0), LensSurface(-60.0, 0.0, 1.0, 24.0)])
    x = np.linspace(-11.5, 11.5, 101)
    z = 60.0 - np.sqrt(3600.0 - x * x)
    origins = np.stack([x, np.zeros(101), z], axis=1)
    on, before = (lens.trace(origins - (0, 0, way), (0.0, 0.0, 1.0)) for way in (0.0, 5.0))
    assert on.passed.all()
    np.testing.assert_allclose(on.position, before.position, atol=1e-14)
    np.testing.assert_allclose(on.path + 5.0, before.path, rtol=1e-15)
