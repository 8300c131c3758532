import math

import numpy as np
import pytest

from hybrid_rt.shading.kernels import light_kinds
from hybrid_rt.shading.kernels.light_kinds import POINT, SPOT, LightPoints, LightTable

pytestmark = pytest.mark.interpreted


def table(kind, origin, edge_u=(0, 0, 0), edge_v=(0, 0, 0)):
    one = [np.array([x], dtype=float) for x in (origin, edge_u, edge_v, (1, 1, 1))]
    none, always = np.full(1, -1, np.int32), np.array([1.0, 0.0])
    return LightTable(np.array([kind], np.int32), *one, none, always, always)


def light_point(lights, row, *where):
    nowhere = LightPoints(np.zeros((1, 3)), np.zeros((1, 3)), *np.zeros((3, 1)))
    return light_kinds.light_point(lights, nowhere, 0, row, *where)


def test_point_light_falls_off_with_the_square():
    x, y, z, distance, factor, _, _ = light_point(
        table(POINT, (0, 0, 4)), 0, 0.0, 3.0, 0.0, 0.3, 0.6
    )
    assert (x, y, z, distance) == (0, -3, 4, 5)
    assert factor == pytest.approx(1 / 25, rel=1e-15)


def test_light_in_the_lit_point_gives_nothing():
    assert light_point(table(POINT, (1, 2, 3)), 0, 1.0, 2.0, 3.0, 0.5, 0.5)[4] == 0.0


@pytest.mark.parametrize("angles", [(25, 30), (0, 30), (40, 40), (120, 180), (0.0006, 0.001)])
def test_angles_of_a_spot_hold_the_power_that_chose_them(angles):
    """Within 1 - cos = v of the axis lies v up to the edge, there half of 1 - x^3 (2 - x) of it."""
    bright, dark = (2.0 * math.sin(math.radians(0.5 * a)) ** 2 for a in angles)
    lights = table(SPOT, (0, 0, 0), (0, 0, 1), (bright, dark, 0))
    for s in (0.0, 1e-9, 0.1, 0.5, 0.9, 0.999, 1.0 - 1e-9, 1.0 - 1e-16):
        d = np.array(light_kinds.leaving_direction(lights, 0, 0.0, 0.0, 0.0, s, 0.3))
        v = 0.5 * ((d - (0, 0, 1)) ** 2).sum()
        assert math.hypot(*d) == pytest.approx(1.0, rel=1e-14)
        assert v <= dark * (1.0 + 1e-9)
        x = min((dark - v) / (dark - bright), 1.0) if dark > bright else 1.0
        within = v
        if v > bright:
            within = bright + (dark - bright) * 0.5 * (1.0 - x**3 * (2.0 - x))
        # The narrowest cone is 1.7e-5 wide, a hundred billion roundings.
        assert within == pytest.approx(s * 0.5 * (bright + dark), rel=1e-9, abs=1e-11 * dark)
        share = light_kinds.share_of_direction(lights, 0, 0.0, 0.0, 0.0, *d)
        if v <= dark:  # at a hard edge it may round out of the cone
            assert share == pytest.approx(x * x * (3.0 - 2.0 * x), abs=1e-9)


def test_the_widest_spot_shines_straight_back():
    lights = table(SPOT, (0, 0, 0), (0, 0.6, 0.8), (2, 2, 0))
    assert light_kinds.share_of_direction(lights, 0, 0.0, 0.0, 0.0, 0.0, -0.6, -0.8) == 1.0
