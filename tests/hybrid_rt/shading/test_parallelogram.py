"""Parallelograms sampled by solid angle: against spherical polygons in 40 digits."""

import math

import mpmath
import numpy as np
import pytest

from hybrid_rt.shading.kernels import light_kinds
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE, LightPoints, LightTable
from hybrid_rt.shading.kernels.parallelogram import EVEN, even_point, is_even, solid_angle

pytestmark = pytest.mark.interpreted

EPS = np.finfo(np.float64).eps
# Edges u and v of lamps that shine downward, with the longer one first, last, and as long.
SHAPES = {
    "square": ((0, 1, 0), (1, 0, 0)),
    "long": ((0, 0.05, 0), (1, 0, 0)),
    "needle": ((0, 1, 0), (1e-7, 0, 0)),
    "slanted": ((0, 1, 0), (0.7, 0.4, 0)),
    "slanted back": ((-0.3, 0.2, 0), (0.9, -0.1, 0)),
    "very slanted": ((0.9, 0.2, 0), (1, 0, 0)),
}
# Where on the lamp, by its edges, the foot of the point is: within, at edges and corners, outside.
FEET = [
    (0.5, 0.5),
    (0.2, 0.9),
    (0.0, 0.5),
    (1.0, 0.3),
    (1.0, 1.0),
    (0.0, 0.0),
    (-0.5, 0.4),
    (3, -2),
]
HEIGHTS = (1e-9, 1e-4, 0.3, 5.0)


def lamp(shape, foot, height):
    """Return corner and edges as seen from 0, nine floats."""
    u, v = (np.array(edge, dtype=float) for edge in SHAPES[shape])
    return [float(x) for x in (*((0, 0, height) - foot[0] * u - foot[1] * v), *u, *v)]


def exactly(numbers):
    corner, u, v = np.array([mpmath.mpf(x) for x in numbers]).reshape(3, 3)
    return corner, u, v


def triangle(a, b, c):
    """Solid angle of a triangle with corners a, b, c (Van Oosterom and Strackee 1983)."""
    la, lb, lc = (mpmath.sqrt(x @ x) for x in (a, b, c))
    below = la * lb * lc + (a @ b) * lc + (b @ c) * la + (a @ c) * lb
    return 2 * mpmath.atan2(a @ np.cross(b, c), below)


def seen(numbers, u_part=(0, 1), v_part=(0, 1)):
    """Solid angle of the part of a parallelogram between parameters, before its front."""
    corner, u, v = exactly(numbers)
    (a, b), (c, d) = u_part, v_part
    p, q, r, s = (corner + x * u + y * v for x, y in ((a, c), (b, c), (b, d), (a, d)))
    return -triangle(p, q, r) - triangle(p, r, s)


def near_cases():
    return [
        pytest.param(shape, foot, height, id=f"{shape} {foot} {height:g}")
        for shape in SHAPES
        for foot in FEET
        for height in HEIGHTS
        if not is_even(*lamp(shape, foot, height))
    ]


@pytest.mark.parametrize(("shape", "foot", "height"), near_cases())
def test_points_are_even_in_solid_angle(shape, foot, height):
    """The first number is the part of the solid angle before the line, the second that along it."""
    numbers = lamp(shape, foot, height)
    _, u_edge, v_edge = (np.array(x) for x in np.reshape(numbers, (3, 3)))
    # The longer edge is one; a coordinate that is off by a rounding is off by that in heights.
    rounding = 1e-13 + 4.0 * EPS / height
    with mpmath.workdps(40):
        whole = seen(numbers)
        assert solid_angle(*numbers) == pytest.approx(float(whole), rel=rounding)
        corner, long, short = exactly(numbers)
        is_u_long = u_edge @ u_edge >= v_edge @ v_edge
        if not is_u_long:
            long, short = short, long
        for s, t in ((0.3, 0.8), (0.01, 0.5), (0.999, 0.02), (0.0, 0.0), (1.0 - EPS, 1.0 - EPS)):
            x, y, z, u, v, angle = even_point(*numbers, s, t)
            assert angle == solid_angle(*numbers)
            assert 0.0 <= u <= 1.0
            assert 0.0 <= v <= 1.0
            place = np.array(numbers[:3]) + u * u_edge + v * v_edge
            assert np.abs(place - (x, y, z)).max() <= 8.0 * EPS * max(1.0, np.abs(place).max())
            before = seen(numbers, u_part=(0, u)) if is_u_long else seen(numbers, v_part=(0, v))
            first, second = (s, t) if is_u_long else (t, s)
            assert float(before / whole) == pytest.approx(first, abs=rounding)
            # Along the line the solid angle goes with the sine z / sqrt(d^2 + z^2).
            start = corner + (u if is_u_long else v) * long
            length = mpmath.sqrt(short @ short)
            foot_z = start @ short / length
            square = start @ start - foot_z**2
            ends = (foot_z, foot_z + (v if is_u_long else u) * length, foot_z + length)
            low, middle, high = (z / mpmath.sqrt(square + z * z) for z in ends)
            # Coordinates are of the size of the longer edge, the line may be shorter.
            of_line = rounding + 16.0 * EPS / float(length)
            assert float((middle - low) / (high - low)) == pytest.approx(second, abs=of_line)


def table(numbers):
    one = [np.array([x], dtype=float) for x in (*np.reshape(numbers, (3, 3)), (1, 1, 1))]
    none, always = np.full(1, -1, np.int32), np.array([1.0, 0.0])
    return LightTable(np.array([RECTANGLE], np.int32), *one, none, always, always)


def asked(lights, s, t, place=(0.0, 0.0, 0.0)):
    nowhere = LightPoints(np.zeros((1, 3)), np.zeros((1, 3)), *np.zeros((3, 1)))
    return light_kinds.light_point(lights, nowhere, 0, 0, *place, s, t)


@pytest.mark.parametrize("height", [1e-9, 0.01, 1.0, 20.0, 1e4])
@pytest.mark.parametrize("shape", SHAPES)
def test_density_of_what_is_run_into_is_that_of_asking(shape, height):
    """The factor of a point is one over its density, whichever way it was sampled."""
    lights = table(lamp(shape, (0.3, -0.2), height))
    for s, t in np.random.default_rng(1).random((20, 2)).tolist():
        x, y, z, distance, factor, _, _ = asked(lights, s, t)
        assert distance == pytest.approx(math.hypot(x, y, z), rel=4 * EPS)
        density = light_kinds.pdf_of_light(lights, 0, 0.0, 0.0, 0.0, distance, z / distance, 0.0)
        assert density * factor == pytest.approx(1.0, rel=1e-13)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("direction", [(0, 0, 1), (1, 0, 0.3), (0.2, 0.9, 0.1)])
def test_both_ways_meet_where_one_follows_the_other(shape, direction):
    """On both sides of the distance where the way changes the means are the same, points nearly."""

    def at(distance):
        return lamp(shape, (0.5 - distance * direction[0], 0.5 - distance * direction[1]),
                    distance * direction[2])  # fmt: skip

    below, above = 0.1, 1e3
    while above - below > 1e-12 * above:
        middle = 0.5 * (below + above)
        below, above = (below, middle) if is_even(*at(middle)) else (middle, above)
    near, far = at(below), at(above)
    assert not is_even(*near)
    _, u, v = np.reshape(near, (3, 3))
    angle = solid_angle(*near)
    for s, t in np.random.default_rng(2).random((50, 2)).tolist():
        a, b = (asked(table(numbers), s, t) for numbers in (near, far))
        assert a[4] == angle
        # As 1 / distance^3, which is its mean somewhere on the lamp.
        assert abs(math.log(b[4] / angle)) <= 1.5 * math.log((1 + EVEN) / (1 - EVEN))
        # The longest way is a quarter of the largest change of the density.
        assert math.dist(a[:3], b[:3]) <= 0.25 * 1.5 * 2 * EVEN * max(
            math.hypot(*u), math.hypot(*v)
        )
    nodes, weights = np.polynomial.legendre.leggauss(16)
    mean = sum(
        0.25 * p * q * asked(table(far), (s + 1) / 2, (t + 1) / 2)[4]
        for s, p in zip(nodes.tolist(), weights, strict=True)
        for t, q in zip(nodes.tolist(), weights, strict=True)
    )
    # The rule is exact to 1e-12, the places differ by as much.
    assert mean == pytest.approx(angle, rel=1e-10)


def test_close_numbers_give_close_directions():
    """Seen from very near the map is as continuous as from afar: points of a net stay even."""
    numbers = lamp("slanted", (0.4, 0.6), 1e-3)
    n = 16
    points = [
        [even_point(*numbers, (i + 0.5) / n, (j + 0.5) / n)[:3] for j in range(n)] for i in range(n)
    ]
    directions = np.array(points)
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    # A cell has 1 / n^2 of the half sphere; few are wider than some sides of such a square.
    for axis in (0, 1):
        steps = np.linalg.norm(np.diff(directions, axis=axis), axis=2)
        assert steps.max() <= 6.0 * math.sqrt(2.0 * math.pi) / n


def test_the_back_and_the_plane_itself_get_nothing():
    for height in (0.0, -1e-9, -0.3):
        lights = table(lamp("square", (0.5, 0.5), height))
        assert asked(lights, 0.3, 0.6)[4] == 0.0
        assert light_kinds.pdf_of_light(lights, 0, 0.0, 0.0, 0.0, 1.0, 1.0, 0.0) == 0.0


@pytest.mark.parametrize("scale", [1e-60, 1e-20, 1e20, 1e55])
def test_any_unit_of_length_will_do(scale):
    numbers = lamp("slanted", (0.2, 1.4), 0.3)
    point = np.array(even_point(*numbers, 0.3, 0.6))
    scaled = np.array(even_point(*(scale * x for x in numbers), 0.3, 0.6))
    np.testing.assert_allclose(scaled[:3], scale * point[:3], rtol=1e-13, atol=1e-13 * scale)
    np.testing.assert_allclose(scaled[3:], point[3:], rtol=1e-13)


@pytest.mark.parametrize("height", [1e-300, 1e-100, 1e-30])
def test_as_near_as_numbers_go(height):
    """Inside its outline the lamp fills half of all directions, at an edge a quarter."""
    for foot, angle in (((0.5, 0.5), 2.0), ((0.0, 0.5), 1.0), ((1.0, 1.0), 0.5)):
        assert solid_angle(*lamp("square", foot, height)) == pytest.approx(angle * math.pi)
        x, y, z, u, v, _ = even_point(*lamp("square", foot, height), 0.3, 0.6)
        assert all(map(math.isfinite, (x, y, z, u, v)))
