"""Photons of many lamps are followed together, and are the same as if each lamp had its own."""

import numpy as np

from helpers.shared_statistics_ppm import make_photon_tracer
from hybrid_rt import (
    Camera,
    Dielectric,
    Emissive,
    GradientSky,
    Lambertian,
    Object,
    PointLight,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
)
from hybrid_rt.integrators.photons.emission import FEWEST, Group, blocks_of
from hybrid_rt.integrators.photons.photon_tracer import PHOTON_DIMENSION
from hybrid_rt.integrators.rows import joined
from meshing import BezierPatches

CAMERA = Camera((0, -8, 4), (0, 0, 0), (0, 0, 1), 40, 16, 16)
FLOOR = Object(Rectangle((-6, -6, 0), (12, 0, 0), (0, 12, 0)), Lambertian(0.6))
BALL = Object(Sphere((0, 0, 1), 0.8), Dielectric(1.5))
SAIL = BezierPatches([[[[2, 0, 3], [3, 0, 3]], [[2, 1, 3], [3, 1, 4]]]])


def test_photons_do_not_depend_on_those_that_are_followed_with_them():
    lamps = [
        PointLight((3, 3, 3), 5.0),
        RectangleLight((-3, 0, 3), (0, 1, 0), (1, 0, 0), 4.0),
        PointLight((-3, -3, 2), 1.0),
    ]
    objects = [FLOOR, BALL, Object(SAIL.flipped(), Emissive(2.0))]
    tracer = make_photon_tracer(Scene(CAMERA, objects, lamps, GradientSky(0.1, 0.2)), 1)
    groups = tracer.groups(2000)
    assert len({group.light for group in groups}) == 5
    (block,) = blocks_of(groups)
    together, _ = tracer.shoot(block, 3, PHOTON_DIMENSION, 0)
    apart = joined([tracer.shoot([piece], 3, PHOTON_DIMENSION, 0)[0] for piece in block])
    assert len(together.position) > 1000
    for one, other in zip(in_order(together), in_order(apart), strict=True):
        np.testing.assert_array_equal(one, other)


def in_order(photons):
    order = np.lexsort(photons.position.T)
    return [column[order] for column in photons]


def test_blocks_hold_each_photon_once():
    sizes = [FEWEST - 1, 1, 3 * 2**16, 5, 5]
    groups = [Group(k, k, False, n, 0) for k, n in enumerate(sizes)]
    blocks = blocks_of(groups)
    assert [len(block) for block in blocks] == [2, 1, 1, 1, 2]
    held = [(p.group.number, i) for block in blocks for p in block for i in range(p.first, p.stop)]
    assert sorted(held) == [(k, i) for k, n in enumerate(sizes) for i in range(n)]
