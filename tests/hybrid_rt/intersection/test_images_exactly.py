"""t_bound and TANGENT hold for the exact image of a closed form or mesh, however rounding moved it."""

import pickle

import numpy as np
import pytest

from hybrid_rt import Box, Intersector, Plane, Sphere, Status
from proof.exact.images import SHAPES, judge, matrices_for, similarity

SIZES = (1e-3, 1.0, 1e3)
QUARTER = np.eye(4)[[1, 2, 0, 3]]


def shift(*by):
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


@pytest.mark.parametrize("far", [0.0, 1.0, 1e3, 1e7])
@pytest.mark.parametrize("name", SHAPES)
def test_rows_hold_for_the_exact_image(name, far):
    rng = np.random.default_rng(41)
    for size in SIZES:
        for matrices in matrices_for(SHAPES[name], rng, size, far):
            hits, wrong, broken = judge(SHAPES[name], matrices, rng, 32)
            assert wrong.tolist() == broken.tolist() == []
            # Chords, from afar, are decided.
            assert (hits.status[::4] == Status.HIT).mean() >= 0.75


@pytest.mark.parametrize("name", ["sphere", "torus", "asphere", "rectangle", "box"])
def test_rows_hold_for_images_in_a_tree(name):
    rng = np.random.default_rng(43)
    # A row of others a million sizes away, which the rays cannot meet in front of the image.
    others = [SHAPES[name].transformed(shift(3.0 * k, 1e9, 0.0)) for k in range(220)]
    matrices = [similarity(rng, 1e-2, 0.0), shift(0.1, 1e7, 3e5)]
    _, wrong, broken = judge(SHAPES[name], matrices, rng, 12, others)
    assert wrong.tolist() == broken.tolist() == []


@pytest.mark.parametrize("name", SHAPES)
def test_what_rounds_nothing_moves_nothing(name):
    given = SHAPES[name].transformed(shift(-0.1, -0.7, 0.3))  # to 0, where ulps are small
    matrices = [np.eye(4), np.diag([-1.0, 1, 1, 1]), np.diag([0.25, 0.25, 0.25, 1]), QUARTER]
    for matrix in matrices[:3] if name == "box" else matrices:  # edges of a turned box are rounded
        image = given.transformed(matrix)
        scale = abs(np.linalg.det(matrix)) ** (1 / 3)
        assert image.moved == pytest.approx(scale * given.moved, rel=1e-9, abs=0.0)
    assert SHAPES[name].moved == 0.0
    whole = Sphere((1, 2, 3), 0.7).transformed(shift(5, -7, 1e6))
    assert whole.moved == 0.0


def test_how_far_rounding_has_moved_an_image():
    # 0.1 + 1e7 is rounded to a multiple of 2^-29: by 0.1 - 0.10000000149 there.
    ball = Sphere((0.1, 0, 0), 1.0).transformed(shift(1e7, 0, 0))
    assert ball.moved == pytest.approx(abs((1e7 + 0.1) - 1e7 - 0.1), rel=1e-6)
    # Images of images, mirrored, pickled and flipped ones keep it, times the scale.
    image = ball.transformed(np.diag([2.0, -2, 2, 1]))
    assert image.moved == pytest.approx(2.0 * ball.moved, rel=1e-9)
    assert pickle.loads(pickle.dumps(image)).flipped().flipped().moved == image.moved
    for given in SHAPES.values():
        image = given.transformed(shift(1e7, 1e7, 1e7))
        assert 1e-10 < image.moved < 4e-9
        assert image.flipped().moved == image.moved


def test_a_plane_is_tilted_by_the_rounding_of_its_normal():
    a = 0.7
    turn = np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0],
                     [0, 0, 1, 0], [0, 0, 0, 1.0]])  # fmt: skip
    image = Plane((0, 0, 0), (1, 2, 3)).transformed(turn)
    assert 0.0 < image.tilt < 2.0**-52
    assert image.flipped().tilt == image.tilt
    # Along the plane, at a height of one: whether the exact image is met, and where, is open.
    u = np.cross(image.exact_normal, (1.0, 0, 0))
    hits = Intersector([image], coarse="none").intersect(image.unit_normal, u)
    assert hits.status[0] == Status.TANGENT


def test_a_ray_that_begins_in_an_image_as_rounded_is_in_doubt():
    """Exactly at t = 0 by rounding: the exact image may be ahead."""
    away = shift(1e7 / 3, 1e7 / 7, 1e7 / 9)
    box = Box((0.1, 0.1, 0.1), (1, 1, 1))
    for given in (box, box.transformed(shift(1e6, 0, 0.3))):
        image = given.transformed(away)
        o = image.point(0.5, 0.5, 1)
        hits = Intersector([image], coarse="none").intersect(o, (1.0, 0, 0))
        assert hits.status[0] == Status.TANGENT
        # Without rounding there is none.
        o = box.point(0.5, 0.5, 1)
        assert Intersector([box], coarse="none").intersect(o, (1.0, 0, 0)).status[0] == Status.MISS
