"""Lamps inside of opaque bodies are named, and the picture is the same without them."""

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Emissive,
    Lambertian,
    Mirror,
    Object,
    PointLight,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    SpotLight,
    Torus,
    TrimmedSurface,
    render,
)
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.lint.lamps_in_bodies import lamps_in_bodies
from meshing.curve2 import polygon

MATT = Lambertian(0.5)
FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), MATT, "floor")
BALL, BRICK = Sphere((0, 0, 3), 1), Box((-1, -1, 2), (1, 1, 4))
TURNED = BRICK.transformed(
    [[0.6, -0.8, 0, 0], [0.8, 0.6, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
)  # about the z axis
RING = Torus((0, 0, 3), (0, 0, 1), 2, 0.5)
INSIDE = PointLight((0.1, 0.2, 3.1), 9)
OUTSIDE = PointLight((0, 0, 6), 9)


def named(objects, lamps, eye=(0, -7, 3), **lens):
    camera = Camera(eye, (0, 0, 3.5), (0, 0, 1), width=8, height=6, **lens)
    return [vars(note) for note in lamps_in_bodies(compile_scene(Scene(camera, objects, lamps)))]


@pytest.mark.parametrize("body", [BALL, BALL.flipped(), BRICK, BRICK.flipped(), TURNED])
def test_the_picture_is_the_same_without_them(body, caplog):
    """Also if another lamp lights the scene, and whichever way the normals of the body point."""
    camera = Camera((0, -7, 3), (0, 0, 2), (0, 0, 1), width=8, height=6)
    objects = [FLOOR, Object(body, MATT, "body")]
    # Every lamp is asked at each hit, so the numbers are the same without one.
    both = render(Scene(camera, objects, [OUTSIDE, INSIDE]), "whitted", passes=2)
    alone = render(Scene(camera, objects, [OUTSIDE]), "whitted", passes=2)
    np.testing.assert_array_equal(both.image, alone.image)
    assert both.report["lamps_in_bodies"] == [{"lamp": "lights[1]", "body": "object 'body'"}]
    words = "lights[1] lights nothing: it lies inside of object 'body', which is opaque"
    assert f"WARNING   {words}" in in_words(both.report)
    assert [words in record.message for record in caplog.records] == [True]
    assert alone.report["lamps_in_bodies"] == []


@pytest.mark.parametrize(
    "lamp",
    [
        INSIDE,
        SpotLight((0, 0, 3), (0, 0, -1), 9),
        SphereLight((0, 0, 3), 0.9, 9),
        RectangleLight((-0.5, -0.5, 2.9), (1, 0, 0), (0, 1, 0), 9),
    ],
)
@pytest.mark.parametrize("body", [BALL, BRICK, TURNED])
def test_all_kinds_of_lamps(lamp, body):
    assert named([FLOOR, Object(body, MATT)], [lamp]) == [
        {"lamp": "lights[0]", "body": "objects[1] (a Sphere)"}
        if body is BALL
        else {"lamp": "lights[0]", "body": f"objects[1] (a {type(body).__name__})"}
    ]


def test_objects_that_shine_and_bodies_that_do():
    lamp = Object(Sphere((0, 0, 3), 0.3), Emissive(9), "lamp")
    assert named([FLOOR, lamp, Object(BRICK, MATT, "brick")], []) == [
        {"lamp": "object 'lamp'", "body": "object 'brick'"}
    ]
    bulb = Object(BALL, Emissive(9), "bulb")
    assert named([FLOOR, bulb], [INSIDE]) == [{"lamp": "lights[0]", "body": "object 'bulb'"}]
    assert named([FLOOR, bulb], []) == []


@pytest.mark.parametrize(
    ("place", "is_in"),
    [((2.0, 0, 3), True), ((0, -2.4, 3), True), ((0, 0, 3), False), ((2.0, 0, 3.6), False)],
)
def test_in_the_tube_of_a_ring_and_in_its_hole(place, is_in):
    assert len(named([Object(RING, MATT)], [PointLight(place, 9)])) == is_in
    assert len(named([Object(RING, MATT)], [SphereLight(place, 0.05, 9)])) == is_in


@pytest.mark.parametrize(
    ("objects", "lamp", "camera"),
    [
        ([Object(BALL, MATT)], SphereLight((0, 0, 3.5), 0.6, 9), {}),
        ([Object(BRICK, MATT)], RectangleLight((-0.5, 0, 3), (2, 0, 0), (0, 1, 0), 9), {}),
        ([Object(BRICK, MATT)], RectangleLight((-1, -1, 4), (0, 2, 0), (2, 0, 0), 9), {}),
        ([Object(BALL, Dielectric(1.5))], INSIDE, {}),
        ([Object(BALL, Emissive(1, Dielectric(1.5)))], INSIDE, {}),
        ([Object(Box((-9, -9, 0), (9, 9, 9)), MATT)], INSIDE, {}),
        ([Object(Box((-9, -9, 0), (9, 9, 9)).flipped(), MATT)], INSIDE, {}),
        ([Object(Sphere((0, 0, 3), 8), Mirror())], INSIDE, {}),
        ([Object(Box((-1, -6, 0), (1, 6, 9)), MATT)], INSIDE, {"aperture": 2.5}),
        ([Object(TrimmedSurface(BALL, [polygon([(0, 0), (1, 0), (1, 0.9), (0, 0.9)])]), MATT)],
         INSIDE, {}),
        ([Object(Rectangle((-1, -1, z), (2, 0, 0), (0, 2, 0)), MATT) for z in (2, 4)], INSIDE, {}),
    ],
    ids=["ball that comes through", "rectangle that comes through", "in a face", "glass",
         "glass that shines", "room", "flipped room", "mirror room", "a part of the lens inside",
         "with a hole", "between walls"],
)  # fmt: skip
def test_others_are_not(objects, lamp, camera):
    assert named([FLOOR, *objects], [lamp], **camera) == []


def test_lamps_within_lamps():
    """A lamp hides what is within it; where two balls pass through each other, both light."""
    bulb = SphereLight((0, 0, 3), 1, 2)
    for lamp in (
        SphereLight((0.2, 0, 3), 0.5, 9),
        RectangleLight((0, 0, 3), (0, 0.2, 0), (0.2, 0, 0), 9),
    ):
        assert named([FLOOR], [bulb, lamp]) == [{"lamp": "lights[1]", "body": "lights[0]"}]
        assert named([FLOOR], [lamp, bulb]) == [{"lamp": "lights[0]", "body": "lights[1]"}]
    assert named([FLOOR], [bulb, SphereLight((0.8, 0, 3), 0.5, 9)]) == []
