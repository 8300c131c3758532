"""Exact crossings against closed forms to 60 digits, and against elimination."""

import flint
import mpmath
import numpy as np
import pytest
import trimesh
from elimination import height_field, height_field_roots

from hybrid_rt import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution
from proof.cases.catalogue import (
    cone,
    cylinder,
    parabola_sheet,
    ring,
    saddle,
    square,
)
from proof.cases.singular_surfaces import lid, petal
from proof.exact.answers import answers_to
from proof.exact.crossings import ALONG, OPEN, POINT, bits, rationals
from proof.exact.patches import patches_crosser
from proof.exact.revolution import revolution_crosser
from proof.exact.truth import ExactScene

DIGITS = 60
# Balls are narrower than 2^-84 of the way to the crossing.
CLOSE = 1e-24


def rays_at(surface, n, seed, tilt=1.0):
    rng = np.random.default_rng(seed)
    low, high = surface.bounds
    origins = rng.normal(size=(n, 3)) * 3.0
    return origins, (rng.uniform(low, high, (n, 3)) - origins) * (1.0, 1.0, tilt)


def ts(crosser, origin, direction):
    found = crosser(rationals(origin), rationals(direction))
    assert all(one.kind == POINT for one in found)
    return sorted((one.t for one in found), key=lambda t: float(t.mid()))


def agree(found, expected):
    """Balls hold the expected numbers, one each."""
    assert len(found) == len(expected), (found, expected)
    for ball, t in zip(found, sorted(expected), strict=True):
        with bits(256):
            error = abs(ball - flint.arb(mpmath.nstr(t, 50))).upper()
        assert float(error) <= CLOSE * max(1.0, abs(float(t)))


def exact(values):
    return [mpmath.mpf(float(x)) for x in values]


def quadratic(a, b, c):
    """Roots of a t^2 + 2 b t + c."""
    square = b * b - a * c
    return [] if square < 0 else [(-b - mpmath.sqrt(square)) / a, (-b + mpmath.sqrt(square)) / a]


def within(roots, at, low, high):
    return [t for t in roots if low <= at(t) <= high]


class TestTurned:
    @pytest.mark.parametrize("tilt", [1.0, 1e-9, 0.0])
    def test_cone_and_cylinder_by_their_quadratics(self, tilt):
        for surface, slope, base in ((cone(), 1, 0), (cylinder(0.75), 0, mpmath.mpf(0.75))):
            crosser = revolution_crosser(surface)
            low, high = surface.segments[0][0, 0], surface.segments[0][-1, 0]
            for o, d in zip(*rays_at(surface, 40, 1, tilt), strict=True):
                with mpmath.workdps(DIGITS):
                    (x, y, z), (p, q, r) = exact(o * (1, 1, 0.2)), exact(d)
                    radius, grows = base + slope * z, slope * r
                    roots = quadratic(
                        p * p + q * q - grows * grows,
                        x * p + y * q - radius * grows,
                        x * x + y * y - radius * radius,
                    )
                    inside = within(roots, lambda t, z=z, r=r: z + t * r, low, high)
                    agree(ts(crosser, o * (1, 1, 0.2), d), inside)

    def test_paraboloid_by_its_quadratic_also_next_to_the_pole(self):
        surface = SurfaceOfRevolution([(0, 0), (0, 0.5), (1, 1)], (0, 0, 0), (0, 0, 1))
        crosser = revolution_crosser(surface)
        rng = np.random.default_rng(2)
        for exponent in range(0, 16, 3):
            targets = 10.0**-exponent * rng.normal(size=(8, 3))
            directions = rng.normal(size=(8, 3))
            for o, d in zip(targets - 2 * directions, directions, strict=True):
                with mpmath.workdps(DIGITS):
                    (x, y, z), (p, q, r) = exact(o), exact(d)
                    roots = quadratic(p * p + q * q, x * p + y * q - r / 2, x * x + y * y - z)
                    agree(
                        ts(crosser, o, d),
                        within(roots, lambda t, z=z, r=r: z + t * r, 0, 1),
                    )

    def test_a_bulge_by_its_quartic(self):
        """R = 1 + 2 z (1 - z), so x^2 + y^2 = R(z)^2 is of degree four in t, as a torus is."""
        surface = SurfaceOfRevolution([(0, 1), (0.5, 2), (1, 1)], (0, 0, 0), (0, 0, 1))
        crosser = revolution_crosser(surface)
        for o, d in zip(*rays_at(surface, 30, 3), strict=True):
            with mpmath.workdps(DIGITS):
                (x, y, z), (p, q, r) = exact(o), exact(d)
                a, b, c = -2 * r * r, 2 * r - 4 * z * r, 1 + 2 * z - 2 * z * z
                quartic = [
                    a * a, 2 * a * b, b * b + 2 * a * c - p * p - q * q,
                    2 * b * c - 2 * (x * p + y * q), c * c - x * x - y * y,
                ]  # fmt: skip
                roots = mpmath.polyroots(quartic[::-1], maxsteps=200, extraprec=400, asc=True)
                real = [t.real for t in roots if abs(t.imag) < mpmath.mpf(10) ** -40]
                agree(ts(crosser, o, d), within(real, lambda t, z=z, r=r: z + t * r, 0, 1))

    def test_turned_and_moved_frames_are_inverted_exactly(self):
        """The mean of the frame is a rotation only up to rounding: crossings lie on S(u, v)."""
        surface = SurfaceOfRevolution(
            [(0, 0.2), (1, 1.3), (2, 0.5)], (1e3, 2e3, -3e3), (0.3, -0.5, 0.8)
        )
        origin, axis, radial, binormal = (
            rationals(v) for v in (surface.origin, surface.axis, surface.radial, surface.binormal)
        )
        crosser = revolution_crosser(surface)
        middle = surface.bounds.mean(axis=0)
        rng = np.random.default_rng(4)
        n_found = 0
        for d in rng.normal(size=(20, 3)):
            o = middle - 3 * d
            for one in crosser(rationals(o), rationals(d)):
                n_found += 1
                s = flint.arb(one.v)
                z = 2 * s
                r = (1 - s) ** 2 * flint.arb(0.2) + 2 * s * (1 - s) * flint.arb(1.3) + s * s / 2
                turn = flint.arb(2 * one.u)
                c, w = turn.cos_pi(), turn.sin_pi()
                for k in range(3):
                    point = origin[k] + z * axis[k] + r * (c * radial[k] + w * binormal[k])
                    there = flint.arb(rationals(o)[k]) + one.t * rationals(d)[k]
                    # u and v are rounded to float64, and so is the middle of the sum.
                    assert abs(float((point - there).mid())) < 1e-11
        assert n_found > 15

    def test_degenerate_rays(self):
        along_axis = ((0, 0, -1), (0, 0, 2))
        assert [float(t) for t in ts(revolution_crosser(cone()), *along_axis)] == [0.5]
        assert ts(revolution_crosser(cylinder()), *along_axis) == []
        (found,) = revolution_crosser(cylinder())(rationals((1, 0, -3)), rationals((0, 0, 1)))
        assert (found.kind, float(found.t), float(found.t_end)) == (ALONG, 2.0, 4.0)
        (found,) = revolution_crosser(cone())(rationals((-2, 0, -2)), rationals((1, 0, 1)))
        assert (found.kind, float(found.t), float(found.t_end)) == (ALONG, 2.0, 3.0)
        first, second = revolution_crosser(ring())(rationals((-3, 0, 0)), rationals((1, 0, 0)))
        assert [float(x) for x in (first.t, first.t_end, second.t, second.t_end)] == [
            2,
            2.5,
            3.5,
            4,
        ]
        tangent = revolution_crosser(cylinder())(rationals((-3, 1, 0)), rationals((1, 0, 0)))
        assert [float(one.t) for one in tangent] == [3.0]
        on_axis = SurfaceOfRevolution([[(0, 1), (1, 0)], [(1, 0), (2, 0)]], (0, 0, 0), (0, 0, 1))
        assert ts(revolution_crosser(on_axis), (-1, 0, 1.5), (1, 0, 0)) == []


@pytest.mark.parametrize("part", [(0.0, 0.5), (-0.25, 0.0), (-0.25, 0.25)])
def test_a_ruling_that_may_leave_its_part_of_a_turn_is_open(part):
    """x^2 + y^2 = 225 + 25 z^2 holds the line (15, 5 z, z), from -53 to 53 degrees about the axis."""
    surface = SurfaceOfRevolution(
        [(-4, 25), (0, 9), (4, 25)], (0, 0, 0), (0, 0, 1), (1, 0, 0), [(3, 5, 3)], part
    )
    ray = rationals((15.0, -30.0, -6.0)), rationals((0.0, 5.0, 1.0))
    (found,) = revolution_crosser(surface)(*ray)
    assert (found.kind, float(found.t), float(found.t_end)) == (OPEN, 2.0, 10.0)
    ray = np.array([15.0, -30.0, -6.0]), np.array([0.0, 5.0, 1.0])
    assert answers_to(ExactScene([surface]), *ray).undecided


@pytest.mark.parametrize(("part", "n"), [((-0.1, 0.1), 1), ((0.2, 0.3), 0)])
def test_a_ruling_within_a_half_plane_is_there_or_not(part, n):
    tube = SurfaceOfRevolution([(-1, 1), (1, 1)], (0, 0, 0), (0, 0, 1), (1, 0, 0), u_range=part)
    found = revolution_crosser(tube)(rationals((1.0, 0.0, -3.0)), rationals((0.0, 0.0, 1.0)))
    assert [one.kind for one in found] == n * [ALONG]


class TestPatches:
    def test_saddle_by_its_quadratic(self):
        crosser = patches_crosser(saddle())
        for o, d in zip(*rays_at(saddle(), 60, 6), strict=True):
            with mpmath.workdps(DIGITS):
                (x, y, z), (p, q, r) = exact(o), exact(d)
                roots = quadratic(p * q, (x * q + y * p - r) / 2, x * y - z)
                inside = [t for t in roots if abs(x + t * p) <= 1 and abs(y + t * q) <= 1]
                agree(ts(crosser, o, d), inside)

    @pytest.mark.parametrize("offset", [1e-2, 1e-7, 1e-13])
    def test_parabola_near_its_tangent(self, offset):
        crosser = patches_crosser(parabola_sheet())
        for side in (-1.0, 1.0):
            o, d = (-0.5, side * offset, 0.25), (1.0, 0.0, 0.125)
            with mpmath.workdps(DIGITS):
                height = mpmath.mpf(side * offset)
                roots = [] if height < 0 else [0.5 - mpmath.sqrt(height), 0.5 + mpmath.sqrt(height)]
                agree(ts(crosser, o, d), roots)

    def test_the_same_as_elimination_on_height_fields(self):
        rng = np.random.default_rng(7)
        for m, n in ((4, 4), (1, 2)):
            heights = np.round(rng.normal(0.0, 0.4, (m + 1, n + 1)) * 256) / 256
            shear = np.round((np.eye(3) + rng.normal(0.0, 0.3, (3, 3))) * 256) / 256
            at = np.round(rng.normal(size=3) * 256) / 256
            surface = height_field(heights, shear, at)
            crosser = patches_crosser(surface)
            for o, d in zip(*rays_at(surface, 25, m), strict=True):
                expected = sorted(height_field_roots(heights, shear, at, o, d), key=float)
                found = ts(crosser, o, d)
                assert len(found) == len(expected)
                assert all(a.overlaps(b) for a, b in zip(found, expected, strict=True))

    def test_rays_that_hold_edges_and_planes(self):
        flat = patches_crosser(square())
        (found,) = flat(rationals((-1, 0.5, 0)), rationals((1, 0, 0)))
        assert (found.kind, float(found.t), float(found.t_end)) == (ALONG, 1.0, 2.0)
        assert flat(rationals((-1, 0.5, 1e-300)), rationals((1, 0, 0))) == []
        assert flat(rationals((-1, 1.5, 0)), rationals((1, 0, 0))) == []
        edge = patches_crosser(saddle())(rationals((-2, 1, -2)), rationals((1, 0, 1)))
        assert [(one.kind, float(one.t), float(one.t_end)) for one in edge] == [(ALONG, 1.0, 3.0)]
        met = patches_crosser(lid())(rationals((0, 0, 9)), rationals((0, 0, -1)))
        assert {round(float(one.t), 12) for one in met} == {5.85}

    def test_beside_a_collapsed_edge(self):
        """Aimed at a point of the patch at v next to nothing: that crossing is found."""
        surface = petal()
        crosser = patches_crosser(surface)
        rng = np.random.default_rng(8)
        for exponent in range(1, 16, 2):
            u = 10.0**-exponent
            target = surface.point(u, 0.4).reshape(3)
            d = rng.normal(size=3)
            found = ts(crosser, target - d, d)
            normal = surface.normal(u, 0.4).reshape(3)
            if abs(normal @ d) > 0.2:  # rounding of the target moves the crossing by that much less
                assert min((abs(float(t) - 1.0) for t in found), default=1.0) < 1e-13

    def test_what_cannot_be_told_is_left_open(self):
        """A ruling within a saddle: f and g have a factor in common."""
        found = patches_crosser(saddle())(rationals((-3, 0.5, -1.5)), rationals((1, 0, 0.5)))
        assert [one.kind for one in found] == [OPEN]
        assert float(found[0].t) < 2.0 + 1e-6
        assert float(found[0].t_end) > 4.0 - 1e-6


def test_spheres_by_their_quadratic():
    rng = np.random.default_rng(9)
    for center, radius in (((0.3, -0.2, 0.1), 0.7), ((0, -1000, 0), 1000.0)):
        scene = ExactScene([Sphere(center, radius)])
        for d in rng.normal(size=(40, 3)):
            o = np.array([0.1, 0.6, -0.2]) - 2 * d
            with mpmath.workdps(DIGITS):
                w = [a - b for a, b in zip(exact(o), exact(center), strict=True)]
                v = exact(d)
                roots = quadratic(
                    mpmath.fdot(v, v),
                    mpmath.fdot(v, w),
                    mpmath.fdot(w, w) - mpmath.mpf(radius) ** 2,
                )
                agree([one.crossing.t for one in scene.crossings(o, d)], roots)


def test_one_square_of_many_kinds():
    """A rectangle, a patch, two triangles, a plane and the face of a box agree to the last bit."""
    corners = np.array([(0, 0, 0.5), (1, 0, 0.5), (1, 1, 0.5), (0, 1, 0.5)])
    mesh = TriangleMesh(trimesh.Trimesh(corners, [(0, 1, 2), (0, 2, 3)], process=False))
    kinds = [
        Rectangle((0, 0, 0.5), (1, 0, 0), (0, 1, 0)), square(0.5), mesh,
        BezierPatches([[[(0, 0, 0.5), (0, 1, 0.5)], [(1, 0, 0.5), (1, 1, 0.5)]]]),
    ]  # fmt: skip
    scenes = [ExactScene([one]) for one in kinds]
    plane, box = (
        ExactScene([Plane((0, 0, 0.5), (0, 0, 1))]),
        ExactScene([Box((0, 0, -9), (1, 1, 0.5))]),
    )
    rng = np.random.default_rng(10)
    for _ in range(60):
        o, d = rng.normal(size=3) + np.array([0, 0, 5]), rng.normal(size=3) - np.array([0, 0, 2])
        first, *others = ([one.t for one in scene.crossings(o, d)] for scene in scenes)
        assert all(other == first for other in others)
        (t,) = [one.t for one in plane.crossings(o, d)]
        assert first in ([], [t])
        top = [one.t for one in box.crossings(o, d) if one.crossing.patch_id == 5]
        assert top == first


def test_tori_by_the_quartic_to_many_digits():
    """Every crossing lies on the torus to 60 digits, and touches are double."""
    torus = Torus((0.2, -0.1, 0.3), (0.3, -0.2, 1.0), 1.0, 0.4)
    scene = ExactScene([torus])
    rng = np.random.default_rng(12)
    center, axis = exact(torus.origin), exact(torus.axis)
    counts = set()
    for d in rng.normal(size=(60, 3)):
        o = rng.normal(size=3) * 0.7 - 2 * d
        found = scene.crossings(o, d)
        counts.add(len(found))
        with mpmath.workdps(DIGITS):
            for one in found:
                t = mpmath.mpf(one.crossing.t.mid().str(70, radius=False))
                w = [a + t * b - c for a, b, c in zip(exact(o), exact(d), center, strict=True)]
                height = mpmath.fdot(w, axis) / mpmath.sqrt(mpmath.fdot(axis, axis))
                ring = mpmath.sqrt(mpmath.fdot(w, w) - height**2) - 1
                assert abs(mpmath.sqrt(ring**2 + height**2) - mpmath.mpf(0.4)) < 1e-25
    assert counts == {0, 2, 4}
    upright = ExactScene([Torus((0, 0, 0), (0, 0, 1), 1.0, 0.5)])
    along = upright.crossings(np.array([1.0, 0.0, -3.0]), np.array([0.0, 0.0, 1.0]))
    assert [one.t for one in along] == [2.5, 3.5]
    assert [one.crossing.cosine for one in along] == [1.0, 1.0]
    (touch,) = upright.crossings(np.array([1.5, -3.0, 0.0]), np.array([0.0, 1.0, 0.0]))
    assert (touch.t, touch.crossing.cosine) == (3.0, 0.0)


def test_turned_boxes_are_six_parallelograms():
    """A box turned by 3, 4, 5 and its ray, and the upright box and its ray: the same t."""
    upright = Box((-1, -0.5, -0.25), (1, 1, 0.5))
    turn = np.array(((0.75, -1.0, 0, 0), (1.0, 0.75, 0, 0), (0, 0, 1.25, 0), (0, 0, 0, 1)))
    scenes = ExactScene([upright]), ExactScene([upright.transformed(turn)])
    rng = np.random.default_rng(13)
    n_met = 0
    for _ in range(60):
        # On a grid that products with the matrix keep.
        d = np.round(rng.normal(size=3) * 64) / 64
        o = np.round(rng.normal(size=3) * 8) / 16 - 2 * d
        one = scenes[0].crossings(o, d)
        two = scenes[1].crossings(turn[:3, :3] @ o, turn[:3, :3] @ d)
        assert [x.t for x in one] == [x.t for x in two]
        assert [x.crossing.patch_id for x in one] == [x.crossing.patch_id for x in two]
        assert np.allclose([x.crossing.cosine for x in one], [x.crossing.cosine for x in two])
        n_met += len(one)
    assert n_met > 20
