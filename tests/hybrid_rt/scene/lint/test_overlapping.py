"""Clear bodies of one priority that overlap in part are named; those within each other are not."""

import itertools

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Emissive,
    Intersector,
    Object,
    PointLight,
    Scene,
    Sphere,
    SurfaceOfRevolution,
    render,
)
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.lint.overlapping import _pairs_of_boxes, overlapping_bodies

CAMERA = Camera((0, -9, 3), (0, 0, 1), (0, 0, 1), 40, 16, 12)
LAMP = PointLight((3, -4, 9), 300.0)
GLASS, WATER = Dielectric(1.5), Dielectric(1.33)


def found(*objects):
    scene = compile_scene(Scene(CAMERA, list(objects), [LAMP]))
    return overlapping_bodies(scene, Intersector(scene.surfaces))


def turned(*points):
    pairs = list(itertools.pairwise(points))
    return SurfaceOfRevolution(pairs, (0, 0, 0), (0, 0, 1))


TUMBLER = turned((0, 0), (0, 1), (2.5, 1), (2.5, 0.92), (0.2, 0.92), (0.2, 0))
DRINK = turned((0.18, 0), (0.18, 0.94), (1.8, 0.94), (1.8, 0))


@pytest.mark.parametrize("glass", [GLASS, Dielectric(1.5, absorption=0.1)])
def test_a_drink_that_reaches_into_its_glass(glass):
    pair = [["object 'tumbler'", "object 'drink'"]]
    assert found(Object(TUMBLER, glass, "tumbler"), Object(DRINK, WATER, "drink")) == pair


@pytest.mark.parametrize(
    ("glass", "drink"),
    [
        (Dielectric(1.5, priority=1), WATER),
        (GLASS, Dielectric(1.33, priority=-1)),
        (GLASS, Dielectric(1.5)),  # one medium
    ],
)
def test_what_is_decided(glass, drink):
    assert found(Object(TUMBLER, glass, "tumbler"), Object(DRINK, drink, "drink")) == []


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (Sphere((0, 0, 0), 1.0), Sphere((0, 0, 0.3), 0.5)),  # within
        (Sphere((0, 0, 0), 1.0), Sphere((1.3, 1.3, 0), 0.8)),  # apart, but not their boxes
        (Box((0, 0, 0), (1, 1, 1)), Box((0, 0, 1), (1, 1, 2))),  # beside each other
        (Box((0, 0, 0), (1, 1, 1)), Box((0.2, 0.2, 0.5), (0.8, 0.8, 1.0))),  # a common face, within
        (Box((0, 0, 0), (1, 1, 1)), Box((0, 0, 1.0 - 1e-9), (1, 1, 2))),  # as good as beside
    ],
)
def test_bodies_within_or_beside_each_other(one, other):
    assert found(Object(one, GLASS), Object(other, WATER)) == []
    assert found(Object(other, GLASS), Object(one, WATER)) == []


def test_bodies_of_several_surfaces():
    """A bottle with a hollow, and a box that is in it as well as in the wall."""
    outside, hollow = Box((0, 0, 0), (2, 2, 3)), Box((0.2, 0.2, 0.2), (1.8, 1.8, 2.8)).flipped()
    bottle = [Object(outside, GLASS, "outside"), Object(hollow, GLASS, "hollow")]
    assert found(*bottle, Object(Box((0.3, 0.3, 0.3), (1.7, 1.7, 1.5)), WATER, "water")) == []
    wet = Object(Box((0.1, 0.1, 0.1), (1.9, 1.9, 1.5)), WATER, "water")
    assert found(*bottle, wet) == [["object 'outside'", "object 'water'"]]


def test_balls():
    balls = [Object(Sphere((x, 0, 0), 1.0), m) for x, m in ((-0.6, GLASS), (0.6, WATER))]
    assert found(*balls) == [["objects[0] (a Sphere)", "objects[1] (a Sphere)"]]


def test_what_only_shines_has_no_medium():
    assert found(Object(Sphere((0, 0, 0), 1.0), Emissive(2.0)), Object(DRINK, Emissive(1.0))) == []


def test_pairs_of_boxes_are_those_of_a_look_at_all():
    rng = np.random.default_rng(3)
    low = rng.random((60, 3))
    boxes = np.stack([low, low + rng.uniform(0.05, 0.6, low.shape)], axis=1)
    medium = rng.integers(0, 2, (60, 5)).astype(float)
    wanted = {
        (i, k)
        for i, k in itertools.combinations(range(60), 2)
        if (boxes[i, 0] < boxes[k, 1]).all()
        and (boxes[k, 0] < boxes[i, 1]).all()
        and medium[i, 4] == medium[k, 4]
        and (medium[i] != medium[k]).any()
    }
    pairs = list(_pairs_of_boxes(boxes, medium))
    assert len(pairs) == len(wanted) > 50
    assert set(pairs) == wanted


def test_open_bodies_say_nothing():
    lens = SurfaceOfRevolution([[(0, 0), (0, 1)]], (0, 0, 0.5), (0, 0, 1))  # a disc
    assert found(Object(lens, GLASS), Object(Sphere((0, 0, 0), 1.0), WATER)) == []


def test_a_render_warns_of_it():
    objects = [Object(TUMBLER, GLASS, "tumbler"), Object(DRINK, WATER, "drink")]
    report = render(Scene(CAMERA, objects, [LAMP]), passes=1).report
    assert report["clear_bodies_overlap"] == [["object 'tumbler'", "object 'drink'"]]
    (line,) = [line for line in report["warnings"] if "overlap" in line]
    assert "Give one of them a higher priority" in line
