"""Lamps that have everything behind them are named; others are not."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Emissive,
    ImageTexture,
    Lambertian,
    Object,
    Plane,
    Rectangle,
    RectangleLight,
    Scene,
    SpotLight,
    render,
)
from hybrid_rt.rendering.summary import in_words

FLOOR = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5), "floor")
BELOW, ABOVE = (0, -6, 2), (0, -6, 5)
UP, DOWN = ((1, 0, 0), (0, 1, 0)), ((0, 1, 0), (1, 0, 0))


def report_of(eye, objects, lights=(), **lens):
    camera = Camera(eye, (0, 0, 0), (0, 0, 1), width=8, height=6, **lens)
    return render(Scene(camera, objects, lights), passes=2, threads=1).report


def test_a_lamp_with_swapped_edges_is_named(caplog):
    report = report_of(BELOW, [FLOOR], [RectangleLight((0, 0, 4), *UP, 9)])
    assert report["noise"]["image_mean"] == 0.0
    assert report["lamps_turned_away"] == ["lights[0]"]
    assert "WARNING   lights[0] lights nothing: its light comes" in in_words(report)
    assert [record.name for record in caplog.records] == ["hybrid_rt.report.scene"]


def test_a_scene_that_is_wrong_is_said_to_be_before_it_is_rendered(caplog):
    scene = Scene(
        Camera(BELOW, (0, 0, 0), (0, 0, 1), width=8, height=6),
        [FLOOR],
        [RectangleLight((0, 0, 4), *UP, 9)],
    )

    def stop(stage, *_):
        if stage == "Rendering":
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        render(scene, passes=1000, threads=1, progress=stop)
    assert ["lights[0] lights nothing" in words for words in caplog.messages] == [True]


def test_so_is_a_rectangle_that_shines():
    lamp = Object(Rectangle((0, 0, 4), *UP), Emissive(9), "lamp")
    report = report_of(BELOW, [FLOOR, lamp])
    assert report["lamps_turned_away"] == ["object 'lamp'"]
    assert report["pictures_turned_away"] == []
    assert "(swap its edges to turn it)" in in_words(report)


def test_a_picture_is_turned_without_being_laid_on_its_side():
    picture = ImageTexture(np.ones((2, 3, 3)))
    corner, across, up = np.array([(2, -1, 4), (-3, 0, 0), (0, 2, 0)], float)
    away = Rectangle(corner, across, up).flipped()
    shown = Object(Rectangle(away.corner, away.edge_u, away.edge_v), Emissive(picture), "ruler")
    report = report_of(BELOW, [FLOOR, shown])
    assert report["pictures_turned_away"] == report["lamps_turned_away"] == ["object 'ruler'"]
    words = in_words(report)
    assert "begin at the other end of edge_u and negate edge_u" in words
    assert "swap its edges" not in words
    turned = Rectangle(away.corner + away.edge_u, -away.edge_u, away.edge_v)
    np.testing.assert_array_equal(turned.normal(0.5, 0.5), -away.normal(0.5, 0.5))
    np.testing.assert_allclose(turned.point(0.25, 0.3), away.point(0.75, 0.3), rtol=1e-15)
    again = report_of(BELOW, [FLOOR, Object(turned, Emissive(picture), "ruler")])
    assert again["lamps_turned_away"] == again["warnings"] == []


def test_a_pattern_in_space_is_no_picture():
    lamp = Object(Rectangle((0, 0, 4), *UP), Emissive(CheckerTexture(1, 2, 3, "world")), "lamp")
    assert report_of(BELOW, [FLOOR, lamp])["pictures_turned_away"] == []


@pytest.mark.parametrize(
    ("eye", "objects", "edges", "lens"),
    [
        (BELOW, [FLOOR], DOWN, {}),
        (ABOVE, [FLOOR], UP, {}),  # seen by the camera
        (BELOW, [FLOOR], UP, {"aperture": 5.0}),  # seen by a part of the lens
        (BELOW, [FLOOR, Object(Rectangle((0, 0, 5), *UP), Lambertian(0.5))], UP, {}),
        (BELOW, [Object(Plane((0, 1, 0), (0, 1, 0)), Lambertian(0.5))], UP, {}),
    ],
    ids=["shines at the floor", "seen", "seen by the lens", "ceiling", "without bounds"],
)
def test_lamps_that_light_something_are_not(eye, objects, edges, lens):
    lamp = RectangleLight((0, 0, 4), *edges, 9)
    assert report_of(eye, objects, [lamp], **lens)["lamps_turned_away"] == []


@pytest.mark.parametrize(
    ("direction", "cone", "is_away"),
    [
        ((0, 0, -1), 30.0, False),
        ((0, 0, 4), 30.0, True),  # the place, given as a direction
        ((1, 0, 0), 30.0, True),
        # The ball around the floor has a radius of 2 sqrt(2), seen from 4 above at 45 degrees.
        ((1, 0, 0), 46.0, False),
        ((1, 0, 0), 44.0, True),
        ((0, 0, 1), 180.0, False),
    ],
)
def test_spot_lights_that_have_all_objects_beside_their_cones_are_named(direction, cone, is_away):
    spot = SpotLight((0, 0, 4), direction, 9, cone_angle=cone)
    report = report_of(ABOVE, [FLOOR], [spot])
    assert report["lamps_turned_away"] == ["lights[0]"] * is_away
    assert report["noise"]["image_mean"] == 0.0 or not is_away
