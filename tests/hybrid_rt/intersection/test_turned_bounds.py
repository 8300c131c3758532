"""Rays that broke a bound of t on a turned surface, found by `tools/verify.py`."""

import numpy as np

from hybrid_rt import Intersector
from meshing import SurfaceOfRevolution
from proof.cases.campaign import placed_surfaces


def hexes(*words):
    return np.array([float.fromhex(word) for word in words])


def test_the_bound_covers_a_disc_met_flatly_beside_its_rim():
    """Where a disc meets a wall the exact root may be 5e-6 radii away on the disc: cos 3.8e-10."""
    profile = [
        [(0, 0), (0, 3e8), (0, 6e8), (0, 9e8)],
        [(0, 9e8), (2.5e8, 1e9), (3e8, 6.2e8), (5.5e8, 7.2e8)],
    ]
    origin = hexes("-0x1.505dac6c81837p+42", "-0x1.7db66e19fece3p+41", "-0x1.3bd27d646bd37p+11")
    direction = hexes("0x1.bd5804c1805fcp-1", "0x1.f93966e4632bdp-2", "0x1.a21ebfd67c623p-32")
    hits = Intersector([SurfaceOfRevolution(profile, (0, 0, 0), (0, 0, 1))]).intersect(
        origin, direction
    )
    exact = -origin[2] / direction[2]
    assert abs(hits.t[0] - exact) <= hits.t_bound[0] + np.spacing(exact)


def test_the_bound_at_a_tip_goes_by_the_angle_between_ray_and_cone():
    """A ray that begins 1e-15 sizes from a lens' tip, along the cone there up to 7e-4."""
    lens = placed_surfaces("lens tips", "small")
    origin = hexes("0x1.045b3aedbcf9cp-29", "-0x1.d8f3d7c13a3e3p-30", "0x1.5708492f1cc6fp-29")
    direction = hexes("0x1.e3862e53dc51fp-2", "0x1.3f144307e22bfp-5", "-0x1.c2e297cb04d38p-1")
    hits = Intersector(lens).intersect(origin, direction)
    exact = float.fromhex("0x1.a01c650efaf92p-71")  # by exact arithmetic
    assert abs(hits.t[0] - exact) <= hits.t_bound[0]
