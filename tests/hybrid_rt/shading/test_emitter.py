import math

import numpy as np
import pytest

from hybrid_rt.shading.kernels import light_kinds
from hybrid_rt.shading.kernels.light_kinds import POINT, RECTANGLE, LightPoints, LightTable

pytestmark = pytest.mark.interpreted


def table(kind, origin, edge_u=(0, 0, 0), edge_v=(0, 0, 0)):
    one = [np.array([x], dtype=float) for x in (origin, edge_u, edge_v, (1, 1, 1))]
    none, always = np.full(1, -1, np.int32), np.array([1.0, 0.0])
    return LightTable(np.array([kind], np.int32), *one, none, always, always)


def light_point(lights, row, *where):
    nowhere = LightPoints(np.zeros((1, 3)), np.zeros((1, 3)), *np.zeros((3, 1)))
    return light_kinds.light_point(lights, nowhere, 0, row, *where)


def test_point_light_falls_off_with_the_square():
    x, y, z, distance, factor = light_point(table(POINT, (0, 0, 4)), 0, 0.0, 3.0, 0.0, 0.3, 0.6)
    assert (x, y, z, distance) == (0, -3, 4, 5)
    assert factor == pytest.approx(1 / 25, rel=1e-15)


def test_light_in_the_lit_point_gives_nothing():
    assert light_point(table(POINT, (1, 2, 3)), 0, 1.0, 2.0, 3.0, 0.5, 0.5)[4] == 0.0


def test_back_of_a_rectangle_is_dark():
    lights = table(RECTANGLE, (-1, -1, 2), (2, 0, 0), (0, 2, 0))  # shines upward
    assert light_point(lights, 0, 0.0, 0.0, 0.0, 0.5, 0.5)[4] == 0.0
    assert light_point(lights, 0, 0.0, 0.0, 4.0, 0.5, 0.5)[4] == pytest.approx(1.0)


def irradiance_of_corner(a, b, height):
    """Irradiance, for radiance one, below the corner of a parallel a x b rectangle.

    Closed form, e.g. Siegel and Howell, "Thermal radiation heat transfer", configuration C-11.
    """
    p, q = math.hypot(a, height), math.hypot(b, height)
    return 0.5 * (a / p * math.atan(b / p) + b / q * math.atan(a / q))


def test_irradiance_of_a_rectangle_is_the_closed_form():
    a, b, height = 1.5, 0.7, 0.9
    lights = table(RECTANGLE, (0, 0, height), (0, b, 0), (a, 0, 0))  # shines downward
    n = 100
    total = 0.0
    for i in range(n):
        for j in range(n):
            s, t = (i + 0.5) / n, (j + 0.5) / n
            _, _, z, distance, factor = light_point(lights, 0, 0.0, 0.0, 0.0, s, t)
            total += factor * z / distance
    # Midpoint rule, error proportional to 1 / n^2.
    assert total / n**2 == pytest.approx(irradiance_of_corner(a, b, height), rel=1e-4)
