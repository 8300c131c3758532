"""Cylinders and cones, and circular arcs as rational profiles: turned surfaces of engineering."""

import math
from fractions import Fraction
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import FloatArray, as_floats, as_vector, number, shown
from meshing.revolution import SurfaceOfRevolution

# Arcs are cut into pieces of at most this, in turns: the middle weight is then at least sqrt 1/2.
WIDEST_ARC = 0.25
# Angles are computed in whole numbers of 2**-160.
ONE = 1 << 160
# 2 pi to 60 digits.
TWO_PI = Fraction("6.28318530717958647692528676655900576839433879875021164194989")


def Cylinder(
    origin: ArrayLike,
    axis: ArrayLike,
    radius: float,
    length: float,
    *,
    reference: ArrayLike | None = None,
    u_range: ArrayLike = (0.0, 1.0),
) -> SurfaceOfRevolution:
    """Return the side of a cylinder, without its ends. The normal points outward.

    Parameters
    ----------
    origin : (3,) scene units
        The middle of the end at v = 0.
    axis : (3,) direction of any length
        From ``origin`` to the middle of the other end.
    radius, length : positive numbers, scene units
    reference, u_range
        As for `SurfaceOfRevolution`.

    Raises
    ------
    ValueError, TypeError
        For a radius or length that is not positive and finite, and as `SurfaceOfRevolution` does.
    """
    r = number(radius, "Cylinder radius", above=0.0, hint="for the inside, use .flipped()")
    end = number(length, "Cylinder length", above=0.0)
    origin = as_vector(origin, "Cylinder origin")
    return SurfaceOfRevolution([(0.0, r), (end, r)], origin, axis, reference, u_range=u_range)


def Cone(
    origin: ArrayLike,
    axis: ArrayLike,
    radius: float,
    length: float,
    top_radius: float = 0.0,
    *,
    reference: ArrayLike | None = None,
    u_range: ArrayLike = (0.0, 1.0),
) -> SurfaceOfRevolution:
    """Return the side of a cone or frustum, without its ends. The normal points outward.

    Parameters
    ----------
    origin : (3,) scene units
        The middle of the end at v = 0.
    axis : (3,) direction of any length
        From ``origin`` to the middle of the other end, or to the tip.
    radius : positive number, scene units
        At ``origin``.
    length : positive number, scene units
        Along the axis.
    top_radius : number at least 0, scene units
        At the other end; 0 for a tip.
    reference, u_range
        As for `SurfaceOfRevolution`.

    Raises
    ------
    ValueError, TypeError
        For sizes that are not positive and finite, a negative radius at the top, and as
        `SurfaceOfRevolution` does.
    """
    r = number(radius, "Cone radius", above=0.0, hint="for the inside, use .flipped()")
    end = number(length, "Cone length", above=0.0)
    top = number(top_radius, "Cone top_radius", at_least=0.0)
    origin = as_vector(origin, "Cone origin")
    return SurfaceOfRevolution([(0.0, r), (end, top)], origin, axis, reference, u_range=u_range)


def circular_arc(
    center: ArrayLike, radius: float, begin: float, end: float
) -> tuple[list[FloatArray], list[FloatArray]]:
    """Return a circular arc as rational quadratic segments, for profiles.

    Parameters
    ----------
    center : (2,) numbers
        Axial position and radius, scene units.
    radius : positive number, scene units
    begin, end : numbers
        Angles in whole turns, counted from the axial direction toward larger radii; at most one
        turn apart. A closed circle, as of a ring, needs ``begin > end`` (1 to 0, say) for normals
        that point outward.

    Returns
    -------
    segments : list of (3, 2) float64
        Bezier points in scene units, segment by segment along the arc: the floats next to the true
        ones. ``t_bound`` of a turned surface allows for that rounding, so it holds for the circle.
    weights : list of (3,) float64
        1, the cosine of half a segment's angle, 1. To be passed on with the points: without them the
        same points make parabolas.

    Raises
    ------
    ValueError, TypeError
        If a number is not finite, the center is not two of them, the radius is not positive, or the
        arc is empty or too long.
    """
    given = as_floats(center, "circular_arc center")
    if given.shape != (2,):
        raise ValueError(
            f"circular_arc center is {shown(center)}: pass its axial position and its radius"
        )
    middle = np.array([number(x, "circular_arc center") for x in given.tolist()])
    r = number(radius, "circular_arc radius", above=0.0)
    first, last = number(begin, "circular_arc begin"), number(end, "circular_arc end")
    if not 0.0 < abs(last - first) <= 1.0:
        raise ValueError(
            f"circular_arc goes from {first:g} to {last:g}: pass angles in turns, at most one apart"
        )
    n = math.ceil(abs(last - first) / WIDEST_ARC - 1e-12)
    ends = Fraction(first), Fraction(last)
    reach, _ = _cosine_and_sine((ends[1] - ends[0]) / (2 * n))

    def point(turns: Fraction, scale: Fraction = Fraction(1)) -> list[float]:
        around = _cosine_and_sine(turns)
        return [
            float(Fraction(at) + Fraction(r) * x / scale)
            for at, x in zip(middle.tolist(), around, strict=True)
        ]

    cuts = [ends[0] + (ends[1] - ends[0]) * k / n for k in range(n + 1)]
    segments = [
        np.array([point(a), point((a + b) / 2, reach), point(b)]) for a, b in pairwise(cuts)
    ]
    return segments, [np.array([1.0, float(reach), 1.0]) for _ in segments]


def _cosine_and_sine(turns: Fraction) -> tuple[Fraction, Fraction]:
    """Return cosine and sine of an angle in whole turns, to 150 bits, exact at quarters."""
    quarter = math.floor(4 * turns + Fraction(1, 2))
    angle = TWO_PI * (turns - Fraction(quarter, 4))
    x = math.floor(angle * ONE)
    cosine, sine, term = ONE, 0, ONE
    for k in range(1, 50):
        term = term * x // (k * ONE)
        if k % 2:
            sine += term if k % 4 == 1 else -term
        else:
            cosine += term if k % 4 == 0 else -term
    c, s = Fraction(cosine, ONE), Fraction(sine, ONE)
    return ((c, s), (-s, c), (-c, -s), (s, -c))[quarter % 4]
