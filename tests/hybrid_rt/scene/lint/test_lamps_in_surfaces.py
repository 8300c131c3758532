"""Lamps in surfaces: one answer for all integrators, or a warning."""

import math
import re

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Emissive,
    Lambertian,
    Object,
    Plane,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    render,
)
from hybrid_rt.rendering import summary as numbers

BLACK, GREY = Lambertian(0.0), Lambertian(0.5)
SETTINGS = {
    "path": {"passes": 64},
    "whitted": {"passes": 64},
    "ppm": {"passes": 32, "options": PPMOptions(2000)},
}
SIDE = 0.5


def turned(angle):
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def room(height, angle=0.0, floor="plane", as_object=False):
    """A black floor, a lamp of side 1/2 at a height above it, a grey ceiling 1 above, seen from below."""
    turn = turned(angle)
    corner, edges = (-SIDE / 2, -SIDE / 2, height), ((SIDE, 0, 0), (0, SIDE, 0))
    wide = [turn @ edge for edge in ((4, 0, 0), (0, 4, 0))]
    ground = {
        "plane": Plane((0, 0, 0), turn @ (0, 0, 1)),
        "rectangle": Rectangle(turn @ (-2, -2, 0), *wide),
    }[floor]
    ceiling = Rectangle(turn @ (-2, -2, 1), *wide)
    objects = [Object(ground, BLACK, name="floor"), Object(ceiling, GREY)]
    lights = []
    if as_object:
        surface = Rectangle(turn @ corner, *(turn @ edge for edge in edges))
        objects.append(Object(surface, Emissive(1.0), name="lamp"))
    else:
        lights.append(RectangleLight(turn @ corner, *(turn @ edge for edge in edges), 1.0))
    camera = Camera(turn @ (0, 0, 0.5), turn @ (0, 0, 1), turn @ (0, 1, 0), 2, 8, 8)
    return Scene(camera, objects, lights)


def ceiling_above_the_lamp(height):
    """Radiance of the ceiling above the middle of the lamp: its albedo times the form factor."""
    x = SIDE / 2 / (1.0 - height)
    root = math.sqrt(1.0 + x * x)
    return 0.5 * 4.0 / math.pi * x / root * math.atan(x / root)


def assert_all_agree(scene, truth):
    for integrator, settings in SETTINGS.items():
        report = (result := render(scene, integrator, **settings)).report
        noise = report["noise"]
        half = noise["interval_factor"] * noise["standard_error_of_image_mean"]
        # Twice the 95 % interval; 1e-3 for what the picture sees beside the middle, and for blur.
        assert abs(result.image.mean() - truth) <= 2.0 * half + 1e-3 * truth
    return report


@pytest.mark.parametrize(
    ("height", "angle"),
    [(0.0, 0.0), *((h, 0.3) for h in (0.0, -1e-16, 1e-12, -1e-6))],
)
def test_all_integrators_agree_on_lamps_at_the_floor(height, angle):
    truth = 0.0 if height < -1e-15 else ceiling_above_the_lamp(height)
    report = assert_all_agree(room(height, angle), truth)
    notes = report["lamps_in_surfaces"]
    assert len(notes) == (abs(height) < 1e-15)
    if notes:
        assert notes[0]["lamp"] == "lights[0]"
        assert notes[0]["surface"] == "object 'floor'"
        assert 0.0 < notes[0]["lifted_by"] < 1e-9
        assert "lights[0] lies in object 'floor'" in numbers.in_words(report)


@pytest.mark.parametrize("floor", ["plane", "rectangle"])
def test_shining_objects_are_lamps(floor):
    report = assert_all_agree(room(0.0, 0.3, floor, as_object=True), ceiling_above_the_lamp(0.0))
    assert report["lamps_in_surfaces"][0]["lamp"] == "object 'lamp'"


def test_lamps_are_seen_from_the_side_on_which_they_shine():
    scene = room(0.0)
    above = scene.with_camera(Camera((0, 0, 0.9), (0, 0, 0), (0, 1, 0), 10, 8, 8))
    assert (render(above, passes=1).image == 1.0).all()
    # From below it is the floor that is seen, grey here, and not the lamp's black back.
    objects = [Object(Plane((0, 0, 0), (0, 0, 1)), GREY)]
    lights = [*scene.lights, PointLight((0, 0, -1), 1.0)]
    camera = Camera((0, 0, -1), (0, 0, 0), (0, 1, 0), 2, 8, 8)
    below = render(Scene(camera, objects, lights), "whitted", passes=1).image
    np.testing.assert_allclose(below, 0.5 / math.pi, rtol=1e-3)


def test_two_lamps_back_to_back_shine_to_both_sides():
    corner, u, v = (-0.25, -0.25, 0.0), (0.5, 0, 0), (0, 0.5, 0)
    lights = [RectangleLight(corner, u, v, 1.0), RectangleLight(corner, v, u, 2.0)]
    for side, radiance in ((1.0, 1.0), (-1.0, 2.0)):
        camera = Camera((0, 0, side), (0, 0, 0), (0, 1, 0), 10, 8, 8)
        assert (render(Scene(camera, lights=lights), passes=1).image == radiance).all()


def test_a_body_that_shines_stands_on_what_it_stands_on():
    """Its foot sends no light through the floor: below it is dark."""
    cube = Object(Box((-0.25, -0.25, 0), (0.25, 0.25, 0.5)), Emissive(1.0), name="cube")
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), GREY)
    ground = Object(Plane((0, 0, -0.5), (0, 0, 1)), GREY)
    camera = Camera((0, 0, -0.2), (0, 0, -0.5), (0, 1, 0), 40, 8, 8)
    result = render(Scene(camera, [floor, ground, cube]), "whitted", passes=4)
    assert result.report["lamps_in_surfaces"][0]["lifted_by"] > 0.0
    assert not result.image.any()


@pytest.mark.parametrize("height", [0.0, -1e-6])
def test_a_ball_that_touches_the_floor_needs_no_word(height):
    scene = room(0.0)
    lamp = SphereLight((0, 0, 0.2 + height), 0.2, 1.0)
    # A sphere from outside: the solid angle's share is (r / distance)^2.
    report = assert_all_agree(Scene(scene.camera, scene.objects, [lamp]), 0.5 * (0.2 / 0.8) ** 2)
    assert not report["lamps_in_surfaces"]


@pytest.mark.parametrize(
    ("objects", "lights"),
    [
        ([Object(Plane((0, 0, 0), (0, 0.1, 1)), GREY)], [PointLight((0, 0, 0), 1.0)]),
        ([Object(Sphere((0, 0, 0.5), 0.2), GREY)], [SphereLight((0, 0, 0.5), 0.2, 1.0)]),
        (
            [
                Object(Box((-1, -1, 0), (1, 1, 1)), Emissive(1.0)),
                Object(Plane((0, 0, 0), (0, 0, 1)), GREY),
                Object(Plane((0, 0, 1), (0, 0, 1)), GREY),
            ],
            [],
        ),
    ],
    ids=["point", "sphere in sphere", "wedged in"],
)
def test_lamps_without_a_way_out_are_warned_of_before_the_render(objects, lights, caplog):
    camera = Camera((0, -3, 0.5), (0, 0, 0.5), (0, 0, 1), 40, 4, 4)

    report = render(Scene(camera, objects, lights), passes=1).report
    (record,) = caplog.records
    assert (record.name, record.levelname) == ("hybrid_rt.scene.lint.lamps_in_surfaces", "WARNING")
    assert re.search(r"lies in objects\[\d\] .* move it away", record.getMessage())
    assert report["lamps_in_surfaces"][0]["lifted_by"] == 0.0
    assert "WARNING" in numbers.in_words(report)


def test_what_stands_in_the_way_or_crosses_is_no_matter():
    """A wall through a lamp, a frame beside it: nothing coincides but lines."""
    lamp = RectangleLight((-0.25, -0.25, 0), (0.5, 0, 0), (0, 0.5, 0), 1.0)
    wall = Object(Rectangle((0, -1, -1), (0, 2, 0), (0, 0, 2)), GREY)
    frame = Object(Rectangle((0.25, -1, 0), (2, 0, 0), (0, 2, 0)), GREY)
    camera = Camera((0, -3, 0.5), (0, 0, 0.5), (0, 0, 1), 40, 4, 4)
    report = render(Scene(camera, [wall, frame], [lamp]), passes=1).report
    assert not report["lamps_in_surfaces"]
