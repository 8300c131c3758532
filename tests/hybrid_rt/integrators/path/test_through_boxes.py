"""Lamps and the sky through boxes of glass, against high precision and against chance."""

import math
from typing import ClassVar

import mpmath
import numpy as np
import pytest
from marks import nightly_but
from same_light import assert_same_light
from trimesh import Trimesh
from trimesh.transformations import rotation_matrix

from hybrid_rt import (
    Box,
    Camera,
    CheckerTexture,
    Dielectric,
    GradientSky,
    ImageEnvironment,
    Lambertian,
    Object,
    PathOptions,
    Phong,
    Plane,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    TriangleMesh,
    render,
)
from hybrid_rt.integrators.kernels.plate_optics import section_through, tangent_through
from hybrid_rt.integrators.path.boxes import open_faces
from hybrid_rt.lights.unevenness import brightness
from meshing import SurfaceOfRevolution


@pytest.mark.parametrize("ior", [1.0001, 1.33, 1.5, 4.0])
@pytest.mark.parametrize("inside", [0.0, 1e-9, 0.3, 1e6])
def test_the_way_through_a_plate(ior, inside):
    """Thirty digits of the distance along the faces that the angle belongs to."""
    with mpmath.workdps(30):
        for across in (0.0, 1e-12, 1e-3, 1.0, 40.0, 1e9):
            tangent = mpmath.mpf(tangent_through(0.7, inside, across, ior))
            sine = tangent / mpmath.sqrt(1 + tangent**2) / ior
            found = mpmath.mpf(0.7) * tangent + inside * sine / mpmath.sqrt(1 - sine**2)
            # The steps end when they are 1e-14 of the tangent; the distance is concave in it.
            assert abs(found - across) <= 2e-14 * across


@pytest.mark.parametrize("is_inside", [False, True])
def test_the_section_is_that_of_a_narrow_pencil(is_inside):
    """Central differences of where rays go, by both angles of the direction where they begin."""
    outside, inside, ior, step = 0.7, 0.4, 1.5, 1e-5
    for sine in (0.05, 0.3, 0.6, 0.9):
        cos_o, cos_i = math.sqrt(1 - sine**2), math.sqrt(1 - (sine / ior) ** 2)

        def distance(angle):
            s = math.sin(angle) * (ior if is_inside else 1.0)
            return outside * s / math.sqrt(1 - s * s) + inside * s / math.sqrt(ior**2 - s * s)

        angle = math.asin(sine / ior if is_inside else sine)
        slope = (distance(angle + step) - distance(angle - step)) / (2 * step)
        # Over the solid angle sin(angle) d angle d azimuth, projected across the ray at its end.
        expected = slope * distance(angle) / math.sin(angle) * cos_o
        section = section_through(outside / cos_o, inside / cos_i, cos_o, cos_i, ior, is_inside)
        # Truncation, the square of the step.
        assert section == pytest.approx(expected, rel=1e-8)


def test_faces_that_something_lies_on():
    box = Box((0, 0, 0), (1, 1, 1))
    ring = SurfaceOfRevolution([[(1.0, 0.2), (1.0, 0.4)]], (0.5, 0.5, 0), (0, 0, 1))
    others = {
        "table": (Box((-2, -2, -1), (3, 3, 0)), {4}),
        "part of a wall": (Rectangle((1, 0.5, 0.5), (0, 9, 0), (0, 0, 9)), {1}),
        "wall beside": (Rectangle((1, 1, 0), (0, 9, 0), (0, 0, 9)), set()),
        "plane": (Plane((9, 9, 0), (0, 0, -1)), {4}),
        "plane across": (Plane((0.5, 0, 0.5), (1, 0, 1)), set()),
        "room": (Box((-5, -5, -5), (5, 5, 5)).flipped(), set()),
        "ball": (Sphere((0.5, 0.5, 1.2), 0.2), set()),
        "flat ring": (ring, {5}),
        "ring across": (ring.transformed(rotation_matrix(0.1, (1, 0, 0), (0.5, 0.5, 1.0))), set()),
        "mesh": (TriangleMesh(Trimesh([(0, 0, 1), (1, 0, 1), (0, 1, 1)], [(0, 1, 2)])), {5}),
        "table below a gap": (Box((-2, -2, -1), (3, 3, -1e-6)), set()),
        "mesh above": (
            TriangleMesh(Trimesh([(0, 0, 1), (1, 0, 1), (0, 1, 2)], [(0, 1, 2)])),
            set(),
        ),
    }
    for name, (other, closed) in others.items():
        assert set(np.flatnonzero(~open_faces([box, other], [0])[0])) == closed, name
    turned = box.transformed(rotation_matrix(0.7, (1, 2, 3)))
    table = others["table"][0].transformed(rotation_matrix(0.7, (1, 2, 3)))
    assert set(np.flatnonzero(~open_faces([turned, table], [0])[0])) == {4}


def test_the_unevenness_of_skies():
    assert brightness(GradientSky(0.3, 0.3).table).unevenness == pytest.approx(1.0)
    assert brightness(GradientSky(0.0, 1.0).table) == pytest.approx((0.5, 4 / 3, 1.0))
    half = np.zeros((8, 16, 3))
    half[:4, :4] = 5.0  # an eighth of all directions
    assert brightness(ImageEnvironment(half).table) == pytest.approx((5 / 8, 8.0, 5.0))


# --- pictures

SKY = np.full((16, 32, 3), 0.1)
SKY[3:6, 16:20] = (30.0, 25.0, 20.0)
WINDOW = ImageEnvironment(SKY, (0, 0, 1))
MATT = Lambertian(0.6)
FLOOR = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), MATT, "floor")
# A pane before the camera: all is seen through glass, so no light path can be connected to it.
FRONT = Object(Box((-0.4, -3.3, 2.9), (0.4, -3.25, 3.9)), Dielectric(1.5))
GLASS = Dielectric(1.5, (0.2, 0.1, 0.4), tint=0.9)
PANE, CUBE = Box((-1, -0.5, 1), (1, 1.5, 1.1)), Box((-0.6, 0.2, 0.3), (0.6, 1.4, 1.5))
INNER = Object(Sphere((0, 0.8, 0.9), 0.4), MATT)
SKEW = [[1, 0.4, 0.2, 0], [0, 1, 0.3, 0], [0, 0, 1, 0.1], [0, 0, 0, 1]]
LAMP = RectangleLight((-0.6, -0.6, 4.0), (0, 1.2, 0), (1.2, 0, 0), 20.0)
BULB = SphereLight((1.5, 0.5, 3.0), 0.5, 20.0)


@pytest.mark.statistical
class TestPictures:
    SKIES: ClassVar = {
        "pane": [FLOOR, Object(PANE, GLASS)],
        "turned": [FLOOR, Object(CUBE.transformed(rotation_matrix(0.7, (1, 2, 3))), GLASS)],
        "skew": [FLOOR, Object(CUBE.transformed(SKEW), GLASS)],
        "within": [FLOOR, Object(Box((-1.2, -0.2, 0.3), (1.2, 1.9, 1.5)), GLASS), INNER],
        "two": [FLOOR, Object(PANE, GLASS),
                Object(Box((-1, -0.5, 1.6), (1, 1.5, 1.7)), Dielectric(1.3, schlick=True))],
        "flat": [FLOOR, Object(Box((-1, 0, 0.3), (1, 1.6, 0.7)), Dielectric(1.5))],
        "tall": [FLOOR, Object(Box((-0.3, 0.3, 0.3), (0.3, 0.9, 1.8)), Dielectric(1.5))],
        "low index": [FLOOR, Object(CUBE, Dielectric(1.2))],
        "standing": [Object(Box((-4, -4, -1), (4, 4, 0)), Phong((0.5, 0.4, 0.3), 0.3, 20.0)),
                     Object(Box((-1, -0.2, 0), (1, 1.4, 0.8)), GLASS)],
        "at a wall": [FLOOR, Object(Box((-0.6, 0.2, 0), (0.6, 1.4, 1.5)), GLASS),
                      Object(Rectangle((-1, 1.4, 0), (2, 0, 0), (0, 0, 1)), MATT)],
    }  # fmt: skip
    LAMPS: ClassVar = {
        "pane": ([FLOOR, FRONT, Object(PANE, GLASS)], LAMP),
        "within": ([FLOOR, FRONT, Object(Box((-1.2, -0.2, 0.3), (1.2, 1.9, 1.5)), GLASS), INNER], BULB),
    }  # fmt: skip

    def scene(self, objects, lights=(), environment=None, n=24):
        return Scene(
            Camera((0, -3.5, 3.5), (0, 0.8, 0.4), (0, 0, 1), 50, n, n), objects, lights, environment
        )

    @pytest.mark.parametrize("name", nightly_but(SKIES, "turned", "at a wall"))
    def test_same_light_of_the_sky(self, name):
        """Without next-event estimation no box is asked."""
        scene = self.scene(self.SKIES[name], environment=WINDOW)
        found = assert_same_light(scene, PathOptions(strategy="directions"), 600, 200)
        used = found.report["plan"]["light"]["used"]["ways by mirrors and glass"]
        assert "to the sky" in used

    @pytest.mark.nightly
    def test_same_light_below_a_skew_box(self):
        """All light comes from the zenith, through the box."""
        sky = np.zeros((16, 32, 3))
        sky[:2] = (30.0, 25.0, 20.0)
        skew = [[1, 0, 0.6, 0], [0, 1, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]]
        box = Object(Box((-0.8, -0.8, 0), (0.8, 0.8, 1.2)).transformed(skew), Dielectric(1.5))
        camera = Camera((0, 0, 0.95), (0, 0, 0), (0, 1, 0), 60, 16, 16)
        scene = Scene(camera, [FLOOR, box], [], ImageEnvironment(sky, (0, 0, 1)))
        assert_same_light(scene, PathOptions(strategy="directions"), 4096, 768, max_depth=4)

    @pytest.mark.parametrize("max_depth", nightly_but([2, 3], 2))
    def test_same_light_in_few_bounces(self, max_depth):
        scene = self.scene(self.SKIES["pane"], environment=WINDOW)
        without = PathOptions(strategy="directions")
        assert_same_light(scene, without, 600, 200, max_depth=max_depth)

    @pytest.mark.parametrize("name", nightly_but(LAMPS, "pane"))
    def test_same_light_of_lamps(self, name):
        """Without light paths no box is asked."""
        objects, lamp = self.LAMPS[name]
        assert_same_light(self.scene(objects, [lamp]), PathOptions(light_paths=0.0), 300, 100)

    @pytest.mark.parametrize("distance", [10.0, 1000.0])
    def test_a_small_lamp_behind_a_pane(self, distance):
        """As large as the sun: few of its light paths meet the pane, or none.

        The floor is dark, so that what it sends to the pane and back is less than a thousandth. Of what
        goes to and fro within the pane, 2 R^2 of the light, nearly all is left to chance.
        """
        floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.005))
        pane = Object(Box((-2.5, -2.5, 0.5), (2.5, 2.5, 0.6)), Dielectric(1.5))
        angle, half = math.radians(30), math.radians(0.265)
        toward = distance * np.array([0.0, math.sin(angle), math.cos(angle)])
        radiance = 3.0 / (math.pi * math.sin(half) ** 2)
        lamp = SphereLight(tuple(toward), distance * math.sin(half), radiance)
        camera = Camera((0, 0, 0.45), (0, 0, 0), (0, 1, 0), 10, 64, 64)
        report = render(Scene(camera, [floor, pane], [lamp]), passes=16).report
        inside = math.asin(math.sin(angle) / 1.5)
        s = (math.sin(angle - inside) / math.sin(angle + inside)) ** 2
        p = (math.tan(angle - inside) / math.tan(angle + inside)) ** 2
        through = 0.5 * sum((1 - r) / (1 + r) for r in (s, p))
        # The lamp nearer by is nearer to some places, by less than a hundredth.
        expected = 0.005 / math.pi * 3.0 * math.cos(angle) * through
        assert report["noise"]["image_mean"] == pytest.approx(expected, rel=0.01)
        assert report["noise"]["standard_error_of_image_mean"] < 5e-3 * expected
        assert "from lamps" not in report["plan"]["light"]["used"]

    def test_noise_falls(self):
        """A pane between the floor and a lamp, seen through another one."""
        objects, lamp = self.LAMPS["pane"]
        tint = CheckerTexture(0.9, 0.9)
        unasked = [FLOOR, FRONT, Object(PANE, Dielectric(1.5, (0.2, 0.1, 0.4), tint=tint))]
        noise = [
            render(self.scene(one, [lamp]), passes=64, seed=1).report["noise"][
                "relative_rmse_trimmed"
            ]
            for one in (objects, unasked)
        ]
        assert noise[0] < 0.4 * noise[1]

    def test_skies_of_one_colour_are_left_to_chance(self):
        scene = self.scene(self.SKIES["pane"], environment=GradientSky(0.5, 1.0), n=4)
        plan = render(scene, passes=1).report["plan"]["light"]
        assert "bright in few directions" in plan["left_out"]["ways by mirrors and glass"]
