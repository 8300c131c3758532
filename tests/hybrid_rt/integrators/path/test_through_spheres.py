"""Lamps and the sky by way of mirror and glass balls, against rays traced by Snell's law."""

import itertools
import math
from typing import ClassVar

import numpy as np
import pytest
import trimesh
from marks import nightly_but
from same_light import assert_same_light

from hybrid_rt import (
    Box,
    Camera,
    CheckerTexture,
    Dielectric,
    ImageEnvironment,
    Lambertian,
    Mirror,
    Mix,
    Object,
    PathOptions,
    Rectangle,
    RectangleLight,
    RoughDielectric,
    Scene,
    Sphere,
    SphereLight,
    TriangleMesh,
    render,
)
from hybrid_rt.integrators.kernels.ball_optics import (
    MOST_WAYS,
    place_of_reflection,
    section_of_crossed,
    section_of_reflected,
    turn,
    turn_slope,
    ways_across,
)
from hybrid_rt.integrators.kernels.through_spheres import NO_CORE
from hybrid_rt.integrators.path.balls import balls_of
from hybrid_rt.scene.compiled import compile_scene

# Distances from the centre of a unit ball, from almost on it to far away.
DISTANCES = (1.0 + 1e-9, 1.001, 1.05, 1.3, 2.0, 5.0, 100.0)
ANGLES = (1e-9, 1e-3, 0.1, 0.7, 1.5, 2.2, 3.0, math.pi - 1e-3)


def bent(d, n, ratio):
    """Refract unit directions (k, 3) by Snell's law in vectors; n on their side, index ratio."""
    cos_i = -(d * n).sum(axis=1, keepdims=True)
    cos_t = np.sqrt(1 - (1 - cos_i**2) / ratio**2)
    return d / ratio + (cos_i / ratio - cos_t) * n


def far_root(o, d):
    """Return where rays from the unit sphere or its outside leave it, or first meet it."""
    half = (o * d).sum(axis=1, keepdims=True)
    inside = (o * o).sum(axis=1, keepdims=True) < 1 + 1e-7
    root = np.sqrt(half**2 - (o * o).sum(axis=1, keepdims=True) + 1)
    return o + np.where(inside, -half + root, -half - root) * d


def through(o, d, ior, core=None):
    """Follow rays (k, 3) through a unit ball of glass; return where and how they leave it.

    ``core`` is the radius and the index of a ball within, which they cross too.
    """
    a = far_root(o, d)
    d = bent(d, a, ior)
    if core is not None:
        radius, within = core
        a = radius * far_root(a / radius, d)
        d = bent(d, a / radius, within / ior)
        a = radius * far_root(a / radius, d)
        d = bent(d, -a / radius, ior / within)
    b = far_root(a, d)
    return b, bent(d, -b, 1 / ior)


def reflected(o, d):
    a = far_root(o, d)
    return a, d - 2 * (d * a).sum(axis=1, keepdims=True) * a


def crossings(ior, eye, lamp, between, core=None):
    """Return the ways through the ball that the kernels find: (side, b) each."""
    found = np.empty(MOST_WAYS)
    core, last = scaled(core, ior)
    n = ways_across(0.0, last, math.pi - between, ior, eye, lamp, core, found)
    return [(math.copysign(1.0, b), abs(b)) for b in found[:n]]


def scaled(core, ior):
    """Return a core of a radius and an index as kernels take it, and the largest b that crosses it."""
    if core is None:
        return NO_CORE, 1.0
    radius, within = core
    return (ior * radius, within * radius), min(ior * radius, within * radius, 1.0)


@pytest.mark.parametrize("lamp", DISTANCES)
@pytest.mark.parametrize("eye", DISTANCES)
def test_rays_to_the_place_of_reflection_go_on_to_the_lamp(eye, lamp):
    for between in ANGLES:
        place = place_of_reflection(eye, lamp, between)
        # Both see the same part of the sphere, or they do not.
        if between > math.acos(1 / eye) + math.acos(1 / lamp):
            assert math.isnan(place)
            continue
        m = np.array([math.cos(place), math.sin(place)])
        e = np.array([eye, 0.0])
        y = lamp * np.array([math.cos(between), math.sin(between)])
        # The mirrored direction is parallel to the way to the lamp: their cross product vanishes. The
        # rounding of m is amplified by the curvature at a short distance.
        d = (m - e) / np.linalg.norm(m - e)
        out = d - 2 * (d @ m) * m
        way = y - m
        gap = abs(out[0] * way[1] - out[1] * way[0])
        assert gap < 1e-12 * (1 + np.linalg.norm(way) * (1 + 1 / np.linalg.norm(m - e)))
        assert m @ e >= 1 - 1e-12
        assert m @ y >= 1 - 1e-12


# Radius and index of a ball within one of radius 1, or none.
CORES = [(0.05, 1.0), (0.6, 1.0), (0.9, 1.33), (0.6, 1.8), (0.98, 1.33), (0.3, 1.45)]
WITH_CORES = list(zip((1.1, 1.5, 2.4) * 2, CORES, strict=True))


@pytest.mark.parametrize(
    ("ior", "core"),
    [*((ior, None) for ior in (1.0001, 1.1, 1.33, 1.5, 2.4, 50.0)), *WITH_CORES],
)
def test_all_ways_through_a_ball_are_found(ior, core):
    """As many as sign changes of the turn over a fine grid; each is a root."""
    inside, last = scaled(core, ior)
    b = last * np.sin(np.linspace(0, math.pi / 2, 4001))
    inner = 2 * np.arcsin(b) - 2 * np.arcsin(b / ior)
    if core is not None:
        before, within = inside
        inner += 2 * np.arcsin(b / before) - 2 * np.arcsin(np.minimum(b / within, 1))
    for eye, lamp in itertools.product(DISTANCES, (*DISTANCES, math.inf)):
        turns = inner - np.arcsin(b / eye) - np.arcsin(b / lamp)
        for between in ANGLES:
            asked = math.pi - between
            found = crossings(ior, eye, lamp, between, core)
            for side, root in found if core is None else ():
                # The rounding of b moves the turn by its slope, which is inf at 1; and what the
                # last step leaves by the curvature, at most by the slope's share of the step.
                slope = abs(turn_slope(root, ior, eye, lamp, NO_CORE))
                off = turn(root, ior, eye, lamp, NO_CORE) + side * asked
                assert abs(off) < 1e-12 + 2e-14 * min(slope, 1e7)
            for side in (1, -1):
                excess = turns + side * asked
                if np.abs(excess).min() < 1e-5:
                    continue  # at a caustic the grid cannot tell
                n = int((np.diff(np.sign(excess)) != 0).sum())
                assert n == sum(one == side for one, _ in found), (eye, lamp, between, side)


@pytest.mark.parametrize(("ior", "core"), [*((ior, None) for ior in (1.1, 1.5, 2.4)), *WITH_CORES])
def test_rays_through_a_ball_go_on_to_the_lamp(ior, core):
    n_three = 0
    for eye, lamp, between in itertools.product(
        (1.05, 1.3, 2.0, 5.0), (1.05, 2.0, 5.0, math.inf), (0.3, 1.5, 2.5, 3.0, 3.1)
    ):
        found = crossings(ior, eye, lamp, between, core)
        n_three += len(found) == 3
        y = np.array([math.cos(between), math.sin(between), 0.0])
        for side, b in found:
            angle = math.asin(b / eye)
            d = np.array([[-math.cos(angle), side * math.sin(angle), 0]])
            place, out = through(np.array([[eye, 0.0, 0.0]]), d, ior, core)
            way = y if lamp == math.inf else lamp * y - place[0]
            gap = np.linalg.norm(np.cross(out[0], way)) / np.linalg.norm(way)
            # Grazing rays turn by the root of what b is off by.
            grazing = b > 0.999 * scaled(core, ior)[1]
            assert gap < (1e-6 if grazing else 1e-11 if core is None else 1e-10)
            assert out[0] @ way > 0
    # Points near the axis of the ball are reached by three ways.
    assert n_three > 0 or core is not None


@pytest.mark.parametrize("ior", [None, 1.1, 1.5, 2.4])
def test_the_solid_angle_is_that_of_a_long_pencil(ior):
    """Far behind the ball the cross-section is the solid angle times the distance squared."""
    for before in (1e-3, 0.3, 4.0):
        for cos_i in (0.05, 0.4, 0.9):
            far = 1e9
            if ior is None:
                sections = [section_of_reflected(before, after, cos_i) for after in (far, math.inf)]
            else:
                b = math.sqrt(1 - cos_i**2)
                eye = math.hypot(b, before + cos_i)
                sections = [
                    section_of_crossed(b, ior, eye, lamp, NO_CORE) for lamp in (far, math.inf)
                ]
            # What a width of the order of the ball is over the distance.
            assert sections[0] / far**2 == pytest.approx(sections[1], rel=1e-6)


@pytest.mark.parametrize(
    ("ior", "core"),
    [*((ior, None) for ior in (None, 1.1, 1.5, 2.4)), *((1.5, core) for core in CORES)],
)
def test_sections_are_those_of_a_narrow_pencil(ior, core):
    """Against differences of traced rays, in two directions across the pencil."""
    rng = np.random.default_rng(5)
    step = 1e-6
    for _ in range(200):
        eye, b, after = rng.uniform(1.1, 4), rng.uniform(0.05, 0.95), rng.uniform(0.1, 3)
        b *= 1.0 if core is None else scaled(core, ior)[1]
        angle = math.asin(b / eye)
        axis = np.array([-math.cos(angle), math.sin(angle), 0.0])
        across = np.array([[math.sin(angle), math.cos(angle), 0.0], [0.0, 0.0, 1.0]])
        d = np.concatenate([axis + step * across, axis - step * across])
        d /= np.linalg.norm(d, axis=1, keepdims=True)
        d = np.concatenate([axis[None], d])
        o = np.tile([eye, 0.0, 0.0], (5, 1))
        place, out = reflected(o, d) if ior is None else through(o, d, ior, core)
        ends = place[0] + after * out[0]
        # Where the rays cross the plane through the end of the middle one, normal to it.
        t = ((ends - place) @ out[0]) / (out @ out[0])
        points = place + t[:, None] * out
        one, two = ((points[i] - points[i + 2]) / (2 * step) for i in (1, 2))
        expected = np.linalg.norm(np.cross(one, two))
        cos_i = math.sqrt(1 - b * b)
        before = math.sqrt(eye * eye - b * b) - cos_i
        if ior is None:
            section = section_of_reflected(before, after, cos_i)
        else:
            inside = scaled(core, ior)[0]
            section = section_of_crossed(b, ior, eye, np.linalg.norm(ends), inside)
        # Truncation of central differences, relative to the widths that may cancel at a caustic.
        slack = 1e-5 if core is None else 1e-4
        assert section == pytest.approx(expected, rel=slack, abs=slack)


# --- pictures: a floor behind glass, that a ball throws light on

FLOOR = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.6))
# A pane before the camera: all is seen through glass, so no light path can be connected to it.
FRONT = Object(Box((-0.4, -3.3, 2.9), (0.4, -3.25, 3.9)), Dielectric(1.5))
GLASS = Dielectric(1.5, (0.2, 0.1, 0.4), tint=0.9)
PANE = Dielectric(1.5)
LAMP = RectangleLight((-0.6, -0.6, 4.0), (0, 1.2, 0), (1.2, 0, 0), 20.0)
UPWARD = RectangleLight((-0.5, -0.5, 1.5), (1, 0, 0), (0, 1, 0), 20.0)
BULB = SphereLight((1.5, 0.5, 3.0), 0.5, 20.0)
BALL = Sphere((0.0, 1.0, 1.2), 0.8)


# A sky with a window.
SKY = np.full((16, 32, 3), 0.1)
SKY[3:6, 16:20] = (30.0, 25.0, 20.0)
WINDOW = ImageEnvironment(SKY, (0, 0, 1))


@pytest.mark.statistical
class TestPictures:
    SCENES: ClassVar = {
        "glass": ([Object(BALL, GLASS)], [LAMP], {}),
        "mirror": ([Object(BALL, Mirror((0.9, 0.7, 0.5)))], [LAMP], {}),
        "mirror ball": ([Object(BALL, Mirror(0.8))], [LAMP], {}),
        "bulb": ([Object(BALL, GLASS)], [BULB], {}),
        "both lamps": ([Object(BALL, Mirror(0.8))], [LAMP, BULB], {}),
        "schlick": ([Object(BALL, Dielectric(1.5, schlick=True))], [LAMP], {}),
        "on the floor": ([Object(Sphere((0.0, 1.0, 0.8), 0.8), PANE)], [LAMP], {}),
        "three balls": (
            [
                Object(Sphere((-1.2, 1.0, 1.0), 0.5), GLASS),
                Object(Sphere((0.0, 1.5, 1.2), 0.6), Mirror(0.9)),
                Object(Sphere((1.2, 1.0, 0.7), 0.5), PANE),
            ], [LAMP], {}),
        # From most of the floor, none is asked at most vertices.
        "small balls": (
            [Object(Sphere((-0.5, 1.0, 0.6), 0.2), Mirror(0.9)),
             Object(Sphere((0.6, 0.8, 0.4), 0.2), PANE)], [LAMP], {}),
        "something in the way": (
            [Object(BALL, GLASS), Object(Sphere((0.3, 1.0, 1.2), 0.3), Lambertian(0.5))], [LAMP], {}),
        "ball in a ball": (
            [Object(BALL, PANE), Object(Sphere((0.0, 1.0, 1.2), 0.5), Dielectric(1.8))], [LAMP], {}),
        "within a mirror": (
            [Object(Sphere((0, 0, 1), 9.0), Mirror(0.6)), Object(Sphere((0, 1.6, 0.5), 0.4), GLASS)],
            [UPWARD], {}),
        "beside a mesh": (
            [Object(BALL, GLASS), Object(Sphere((1.6, 1.0, 0.8), 0.6), Mirror(0.9)),
             Object(TriangleMesh(trimesh.creation.box((0.4, 0.4, 0.4))), Lambertian(0.5))],
            [LAMP], {}),
        "flipped mirror": ([Object(BALL.flipped(), Mirror(0.9))], [LAMP], {}),
        "hollow": ([Object(BALL, PANE), Object(Sphere((0.0, 1.0, 1.2), 0.5).flipped(), PANE)],
                   [LAMP], {}),
        "full of water": (
            [Object(BALL, PANE), Object(Sphere((0.0, 1.0, 1.2), 0.6).flipped(), PANE),
             Object(Sphere((0.0, 1.0, 1.2), 0.6), Dielectric(1.33, (0.2, 0.1, 0.0)))], [BULB], {}),
        "beside touching cubes": (
            [Object(BALL, GLASS), Object(Box((1.5, 0, 0), (2, 1, 0.5)), PANE),
             Object(Box((1.5, 0, 0.5), (2, 1, 0.8)), PANE)], [LAMP], {}),
        "short": ([Object(BALL, GLASS)], [LAMP], {"max_depth": 4}),
        "shorter": ([Object(BALL, GLASS)], [LAMP], {"max_depth": 3}),
    }  # fmt: skip

    def scene(self, name, n=24):
        objects, lights, settings = self.SCENES[name]
        camera = Camera((0, -3.5, 3.5), (0, 0.8, 0.4), (0, 0, 1), 50, n, n)
        return Scene(camera, [FLOOR, FRONT, *objects], lights), settings

    @pytest.mark.parametrize("name", nightly_but(SCENES, "three balls", "hollow", "short"))
    def test_same_light_as_by_chance(self, name):
        """Without light paths no ball is asked."""
        scene, settings = self.scene(name)
        assert_same_light(scene, PathOptions(light_paths=0.0), 240, 80, **settings)

    @pytest.mark.parametrize(
        "name",
        nightly_but(
            ["glass", "mirror ball", "three balls", "beside a mesh", "hollow", "full of water"],
            "three balls",
        ),
    )
    def test_same_light_of_the_sky(self, name):
        """Without next-event estimation, no ball is asked."""
        scene, _ = self.scene(name)
        scene = Scene(scene.camera, scene.objects, [], WINDOW)
        found = assert_same_light(scene, PathOptions(strategy="directions"), 320, 120)
        assert "to the sky" in found.report["plan"]["light"]["used"]["ways by mirrors and glass"]

    def test_a_ball_seen_from_within(self):
        """The ball stands about the origin, where its points round least.

        Shadow rays that began beside it met it at once, and a twentieth of the light was lost.
        """
        ball = Object(Sphere((0, 0, 0), 1), PANE)
        floor = Object(Rectangle((-5, -5, -1.2), (10, 0, 0), (0, 10, 0)), Lambertian(0.6))
        camera = Camera((0, 0, 0.2), (0, 0.3, -1), (0, 1, 0), 60, 16, 12)
        scene = Scene(camera, [ball, floor], [SphereLight((1, 1, 4), 0.5, 10)])
        assert_same_light(scene, PathOptions(light_paths=0.0), 1504, 1000)

    def test_noise_falls(self):
        """By chance, a path meets the lamp by way of the ball once in hundreds of times.

        The brightest 0.1 % are left out: few paths find the light that is left to chance in
        either picture (by way of the ball and another surface). 0.21 was measured.
        """
        scene, _ = self.scene("mirror ball", 48)
        lamp = RectangleLight((-0.5, -0.5, 4.0), (0, 1, 0), (1, 0, 0), 28.0)
        scene = Scene(scene.camera, scene.objects, [lamp])
        unasked = [
            Object(BALL, Mirror(CheckerTexture(0.8, 0.8))) if item.surface is BALL else item
            for item in scene.objects
        ]
        noise = [
            render(one, passes=64, seed=1).report["noise"]["relative_rmse_trimmed"]
            for one in (scene, Scene(scene.camera, unasked, [lamp]))
        ]
        assert noise[0] < 0.4 * noise[1]

    def test_cores_that_turn_rays_by_more_than_a_turn_are_left_out(self):
        centre = (0.0, 1.0, 1.2)
        for within, has_core in ((1.8, True), (4.0, False)):
            core = Object(Sphere(centre, 0.66 * 0.8), Dielectric(within))
            camera = self.scene("glass", 4)[0].camera
            scene = compile_scene(Scene(camera, [FLOOR, Object(BALL, PANE), core], [LAMP]))
            assert (balls_of(scene).core[0] > 0.0) == has_core

    @pytest.mark.parametrize(
        "ball",
        [
            Object(BALL, Dielectric(0.8)),
            Object(BALL.flipped(), GLASS),
            Object(BALL, Mix([(0.5, Mirror(1)), (0.4, Lambertian(1))])),
            Object(BALL, Mirror(CheckerTexture(0.2, 0.9, 4.0))),
            Object(BALL, RoughDielectric(1.5, 0.2)),
        ],
        ids=["lower index", "glass outside", "mixture", "texture", "rough"],
    )
    def test_other_balls_are_left_to_chance(self, ball):
        scene, _ = self.scene("glass", 4)
        scene = Scene(scene.camera, [FLOOR, ball], [LAMP])
        plan = render(scene, passes=1).report["plan"]["light"]
        assert "ways by mirrors and glass" in plan["left_out"]
