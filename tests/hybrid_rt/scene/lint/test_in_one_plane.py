"""Rectangles in one plane are named, and nothing else is."""

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
    Rectangle,
    Scene,
    render,
)
from hybrid_rt.lights import RectangleLight
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.lint.in_one_plane import surfaces_in_one_plane
from meshing import TrimmedSurface, circle, polygon

CAMERA = Camera((0, -3, 1), (0, 0, 1), (0, 0, 1), 40, 4, 4)
LAMP = RectangleLight((-0.5, -0.5, 3), (0, 1, 0), (1, 0, 0), 1.0)
# Parallelograms in a slanted plane, by their coordinates there.
ORIGIN, ALONG, UP = np.array([1.0, 2.0, 3.0]), np.array([3.0, 1.0, 0.5]), np.array([-0.5, 0.3, 2.0])


def piece(x, y, u, v, away=0.0):
    out = away * np.cross(ALONG, UP) / np.linalg.norm(np.cross(ALONG, UP))
    corner = ORIGIN + x * ALONG + y * UP + out
    return Rectangle(corner, u[0] * ALONG + u[1] * UP, v[0] * ALONG + v[1] * UP)


WALL = piece(0, 0, (1, 0), (0, 1))


def named(one, other, material=None):
    objects = [
        Object(one, Lambertian(0.5), "wall"),
        Object(other, Mirror(0.9) if material is None else material, "mirror"),
    ]
    return surfaces_in_one_plane(compile_scene(Scene(CAMERA, objects, [LAMP])))


@pytest.mark.parametrize(
    "other",
    [
        piece(0.2, 0.3, (0.1, 0), (0, 0.1)),
        piece(-1, -1, (3, 0), (0, 3)),
        piece(0.5, -0.5, (1, 1), (-1, 1)),
        piece(0, 0, (0, 1), (1, 0)),
        piece(0.9, 0.9, (1, 0), (0, 1), away=1e-11),
    ],
    ids=["within", "around", "turned", "the same", "at a corner"],
)
def test_overlaps_are_named(other):
    assert named(WALL, other) == [["object 'wall'", "object 'mirror'"]]
    assert len(named(other, WALL)) == 1


@pytest.mark.parametrize(
    "other",
    [
        piece(1, 0, (1, 0), (0, 1)),
        piece(1, 1, (1, 0), (0, 1)),
        piece(1.3, -0.8, (1, 1), (-0.5, 0.5)),
        piece(0.2, 0.3, (0.1, 0), (0, 0.1), away=1e-6),
        Rectangle(ORIGIN, ALONG, np.cross(ALONG, UP)),
        Box((1, 2, 3), (2, 3, 4)),
    ],
    ids=["beside", "at a corner", "turned", "in front", "across", "box"],
)
def test_others_are_not(other):
    assert named(WALL, other) == []


def test_glass_and_one_material_are_left_alone():
    within = piece(0.2, 0.3, (0.1, 0), (0, 0.1))
    assert named(WALL, within, Dielectric(1.5)) == []
    paint = Lambertian(0.5)
    scene = Scene(CAMERA, [Object(WALL, paint), Object(within, paint)], [LAMP])
    assert surfaces_in_one_plane(compile_scene(scene)) == []


TURNED = [[0.8, -0.6, 0, 3], [0.6, 0.8, 0, -1], [0, 0, 1, 0.5], [0, 0, 0, 1]]


@pytest.mark.parametrize("is_turned", [False, True])
@pytest.mark.parametrize("flips", [False, True])
def test_a_label_on_a_face_of_a_box_is_named(is_turned, flips):
    box = Box((-2.5, -1.5, 0.001), (2.5, 1.5, 6.001))
    on_it = [
        Rectangle((-1.6, -1.5, 1.2), (3.2, 0, 0), (0, 0, 2)),
        Rectangle((2.5, -1.5, 1.2), (0, 3, 0), (0, 0, 2)),
    ]
    off_it = [
        Rectangle((-1.6, -1.5001, 1.2), (3.2, 0, 0), (0, 0, 2)),
        Rectangle((-1.6, 0, 1.2), (3.2, 0, 0), (0, 0, 2)),
        # Larger than the face, as the floor that it stands on.
        Rectangle((-9, -9, 0.001), (18, 0, 0), (0, 18, 0)),
        Rectangle((2.5, -1.5, 1.2), (1, 0, 0), (0, 0, 2)),
    ]
    if is_turned:
        box, on_it, off_it = (
            box.transformed(TURNED),
            [label.transformed(TURNED) for label in on_it],
            [label.transformed(TURNED) for label in off_it],
        )
    box = box.flipped() if flips else box
    for label in on_it:
        assert named(box, label, Lambertian(0.1)) == [["object 'wall'", "object 'mirror'"]]
        assert len(named(label, box, Lambertian(0.1))) == 1
        assert named(box, label, Dielectric(1.5)) == []
    for label in off_it:
        assert named(box, label, Lambertian(0.1)) == []


ALL = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])
HOLE = polygon([(0.25, 0.25), (0.5, 0.25), (0.5, 0.5), (0.25, 0.5)])
DIAL = TrimmedSurface(piece(0.2, 0.2, (0.6, 0), (0, 0.6)), [circle((0.5, 0.5), 0.5)])
WINDOW = TrimmedSurface(WALL, [ALL, HOLE])
RING = TrimmedSurface(DIAL.surface, [circle((0.5, 0.5), 0.5), circle((0.5, 0.5), 0.4)])


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (DIAL, piece(0.49, 0.5, (0.02, 0), (0, 0.25))),
        (WALL, DIAL),
        (WALL.flipped(), DIAL.flipped()),
        (piece(-1, -1, (9, 0), (0, 9)), DIAL),
        (WINDOW, piece(0.4, 0.3, (0.2, 0), (0, 0.1))),
        (WINDOW, DIAL),
        (RING, piece(0.4, 0.4, (0.9, 0), (0, 0.2))),
    ],
    ids=[
        "hand on dial",
        "poster",
        "flipped",
        "far larger",
        "over the edge of a hole",
        "two trimmed",
        "ring",
    ],
)
def test_trimmed_rectangles_are_named(one, other):
    assert len(named(one, other)) == len(named(other, one)) == 1


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (DIAL, piece(0.49, 0.5, (0.02, 0), (0, 0.25), away=1e-6)),
        (DIAL, piece(0.2, 0.2, (0.08, 0), (0, 0.08))),
        (WINDOW, piece(0.25, 0.25, (0.25, 0), (0, 0.25))),
        (WINDOW, TrimmedSurface(WALL, [HOLE])),
        (WINDOW, TrimmedSurface(piece(0.25, 0.25, (0.25, 0), (0, 0.25)), [circle((0.5, 0.5), 0.5)])),
        (RING, TrimmedSurface(DIAL.surface, [circle((0.5, 0.5), 0.4)])),
        (RING, piece(0.4, 0.4, (0.2, 0), (0, 0.2))),
        (WALL, TrimmedSurface(WALL, [polygon([(1.2, 0), (1.5, 0), (1.5, 1)])])),
    ],
    ids=["in front", "beside a dial", "pane", "inlay", "round pane", "disc in a ring", "in a ring",
         "nothing left"],
)  # fmt: skip
def test_what_loops_cut_away_does_not_count(one, other):
    assert named(one, other) == named(other, one) == []


def test_a_dial_on_a_face_of_a_box_is_named():
    box = Box((-2, -1, 0), (2, 1, 6))
    face = Rectangle((-1, -1, 3), (2, 0, 0), (0, 0, 2))
    assert len(named(box, TrimmedSurface(face, [circle((0.5, 0.5), 0.5)]))) == 1
    # The box stands on a disc that is larger, or reaches less far than its plane.
    floor = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    assert named(box, TrimmedSurface(floor, [circle((0.5, 0.5), 0.3)])) == []
    wide = Rectangle((-9, -1, 3), (18, 0, 0), (0, 0, 2))
    assert len(named(box, TrimmedSurface(wide, [circle((0.5, 0.5), 0.1)]))) == 1


def lamp(rectangle, radiance, turned=False):
    edges = (rectangle.edge_u, rectangle.edge_v)
    return RectangleLight(rectangle.corner, *(edges[::-1] if turned else edges), radiance)


BESIDE = piece(1.0, 0, (1, 0), (0, 1))
PART = piece(0.9, 0.4, (0.7, 0.1), (0, 0.2))


@pytest.mark.parametrize("other", [PART, piece(-1, -1, (9, 0), (0, 9))])
def test_lamps_that_hide_each_other_are_named(other):
    shining, dial = Object(other, Emissive(4), "shining"), Object(DIAL, Emissive(4), "dial")

    def named_of(objects, lights):
        return surfaces_in_one_plane(compile_scene(Scene(CAMERA, objects, lights)))

    for lights in ([lamp(WALL, 1), lamp(other, 5)], [lamp(other, (1, 1, 2)), lamp(WALL, 1)]):
        assert named_of([], lights) == [["lights[0]", "lights[1]"]]
    assert named_of([shining], [lamp(WALL, 1)]) == [["object 'shining'", "lights[0]"]]
    assert named_of([dial], [lamp(WALL, 1)]) == [["object 'dial'", "lights[0]"]]
    for alone in (
        # One lamp of two parts; to both sides; side by side; one before the other; out of a wall.
        ([], [lamp(WALL, 1), lamp(other, 1)]),
        ([], [lamp(WALL, 1), lamp(other, 5, turned=True)]),
        ([shining], [lamp(WALL, 1, turned=True)]),
        ([], [lamp(WALL, 1), lamp(BESIDE, 5)]),
        ([], [lamp(WALL, 1), lamp(piece(0.9, 0.4, (0.7, 0), (0, 0.2), away=1e-6), 5)]),
        ([Object(other, Lambertian(0.5))], [lamp(WALL, 1)]),
    ):
        assert named_of(*alone) == []


@pytest.mark.parametrize("far", [1.0, 1e4])
def test_lamps_are_named_in_either_order_however_far_they_were_lifted(far):
    """They are moved by 2^-32 of the distance of the camera before they are looked at."""
    lamps = [
        RectangleLight((-1, -1, 2), (0, 2, 0), (2, 0, 0), 1),
        RectangleLight((-0.5, -0.5, 2), (0, 1, 0), (1, 0, 0), 5),
    ]
    floor = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.5), "floor")
    camera = Camera((0, -far, 1), (0, 0, 0), (0, 0, 1), 1, 4, 4)
    for lights in (lamps, lamps[::-1]):
        report = render(Scene(camera, [floor], lights), "whitted", 1, threads=1).report
        assert report["surfaces_in_one_plane"] == [["lights[0]", "lights[1]"]]
        assert any(
            "lights[0] and lights[1] lie in one plane" in line for line in report["warnings"]
        )
