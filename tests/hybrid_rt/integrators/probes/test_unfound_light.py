"""The size of light that is not found, against closed forms and against those who find it."""

import math
from functools import partial

import numpy as np
import pytest

from hybrid_rt.integrators import INTEGRATORS, PPMOptions
from hybrid_rt.integrators.probes import probe
from hybrid_rt.integrators.probes import unfound_light as unfound
from hybrid_rt.integrators.probes.probe import beginnings_of
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian, Metal, Mirror, Mix
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from hybrid_rt.rendering import summary
from hybrid_rt.rendering.limits import DEFAULT_DEPTH
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.units import per_cent
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

# A floor, seen from above, and a mirror beside it that shows the floor the lamp once more.
VIEW = Camera((0.0, 0.0, 1.5), (0, 0, 0), (0, 1, 0), vertical_fov=45, width=12, height=8)
# From low above the floor, half of it by way of the mirror.
INTO_THE_MIRROR = Camera(
    (0.2, -1.0, 0.9), (1.0, 0, 0.2), (0, 0, 1), vertical_fov=30, width=12, height=8
)
LAMP = PointLight((0.5, 0.0, 1.0), 3.0)
AREA_LAMP = RectangleLight((0.3, -0.2, 1.2), (0, 0.4, 0), (0.4, 0, 0), 6.0)
FLOOR = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.5), "floor")
WALL = Rectangle((1.0, -4, 0), (0, 8, 0), (0, 0, 1))
MIRROR = Object(WALL, Mirror(0.8), "mirror")
BALL = Object(Sphere((0.3, 0.2, 0.4), 0.2), Dielectric(1.5), "ball")
DEEP = 16


def room(*objects, lights=(LAMP,), environment=None, camera=VIEW):
    return Scene(camera, [FLOOR, *objects], lights, environment)


def measured(scene, integrator="path", **settings):
    return render(scene, integrator, 1, threads=1, **settings).report["light_not_found_measured"]


def mean_by_mirror(view):
    """Return the mean, 16 places a pixel, of what the lamp's image at x = 1.5 adds to the floor.

    Rays that meet the mirror see the floor in it, where they would meet it behind the mirror.
    """
    row, column = (np.mgrid[: 4 * view.height, : 4 * view.width] + 0.5) / 4
    origin, way = view.rays(column.ravel(), row.ravel())
    place = origin - (origin[:, 2] / way[:, 2])[:, None] * way
    is_mirrored = place[:, 0] > 1.0
    place[is_mirrored, 0] = 2.0 - place[is_mirrored, 0]
    assert np.all((way[:, 2] < 0.0) & (np.abs(place[:, :2]) < 4.0).all(axis=1))
    to_image = np.array([1.5, 0.0, 1.0]) - place
    distance = np.linalg.norm(to_image, axis=1)
    seen = np.where(is_mirrored, 0.8, 1.0)
    return float((seen * 0.8 * 0.5 / math.pi * 3.0 / distance**3).mean())


@pytest.mark.statistical
@pytest.mark.parametrize("view", [VIEW, INTO_THE_MIRROR], ids=["floor", "floor in the mirror"])
def test_it_is_that_of_the_lamps_image(view):
    """The truth is in the 95 % interval by all but 3 of 24 seeds at most (chance of more: 3 %)."""
    truth = mean_by_mirror(view)
    found = [measured(room(MIRROR, camera=view), seed=seed) for seed in range(24)]
    outside = [abs(m["mean"] - truth) > m["half_interval_95"] for m in found]
    assert sum(outside) <= 3
    # 24 estimates of 7 % each.
    assert np.mean([m["mean"] for m in found]) == pytest.approx(truth, rel=0.05)
    assert np.median([m["half_interval_95"] for m in found]) < 0.25 * truth


@pytest.mark.statistical
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_it_is_what_others_find_more(integrator):
    """Without mirrors to look into, all that is missing leaves the floor and the wall."""
    wall = Object(WALL, Lambertian((0.9, 0.5, 0.1)), "wall")
    scene, finder = (room(wall), "path") if integrator == "whitted" else (room(MIRROR), "ppm")
    options = PPMOptions(20_000) if finder == "ppm" else None
    more = render(scene, finder, 16, options=options, threads=1).report["noise"]["image_mean"]
    less = render(scene, integrator, 16, threads=1).report
    found = less["light_not_found_measured"]
    gap = more - less["noise"]["image_mean"]
    # Half an interval is 3.2 standard errors; the pictures' own are below a third of that.
    assert found["mean"] == pytest.approx(gap, abs=2.0 * found["half_interval_95"])
    assert found["half_interval_95"] < 0.4 * gap
    assert found["share_of_image_mean"] == pytest.approx(
        found["mean"] / less["noise"]["image_mean"]
    )


@pytest.mark.statistical
def test_of_many_lights_some_are_chosen(monkeypatch):
    """40 lamps of powers 1 to 40, and 8 of them by power: the same mean over 16 seeds."""
    turn = 0.05 * np.pi * np.arange(1, 41)
    lamps = [
        PointLight((0.6 * math.cos(a) - 0.2, 0.6 * math.sin(a), 1.0), 0.01 * k)
        for k, a in enumerate(turn, start=1)
    ]
    scene = room(MIRROR, lights=lamps)
    means = {}
    for most in (8, 40):
        monkeypatch.setattr(probe, "MOST_LIGHTS", most)
        means[most] = np.array([measured(scene, seed=seed)["mean"] for seed in range(16)])
    error = np.sqrt(sum(found.var(ddof=1) / found.size for found in means.values()))
    assert means[8].mean() == pytest.approx(means[40].mean(), abs=4.0 * error)
    # Else the comparison says little; the error is itself known to a fifth.
    assert error < 0.07 * means[40].mean()


def test_pictures_and_counts_are_as_without_it(monkeypatch):
    scene = room(MIRROR, BALL)
    expected = render(scene, "path", 2, threads=1)
    monkeypatch.setattr(unfound, "unfound_light", lambda *_: None)
    found = render(scene, "path", 2, threads=1)
    np.testing.assert_array_equal(found.image, expected.image)
    for name in ("rays", "hits", "intersection", "ended_branches", "noise"):
        assert found.report[name] == expected.report[name]
    assert found.report["light_not_found_measured"] is None
    text = summary.in_words(found.report)
    assert "its size is not measured: the image mean lacks it, and no error below counts it" in text


def test_only_paths_that_begin_so_are_counted():
    """Metal and rough glass are asked for lamps: what comes by way of them is found."""
    assert measured(room(Object(WALL, Metal(0.8, 0.2)))) is None
    gray = Mix([(0.5, Mirror(0.8)), (0.5, Metal(0.8, 0.2))])
    half, whole = measured(room(Object(WALL, gray)), seed=1), measured(room(MIRROR), seed=1)
    assert half["mean"] == pytest.approx(0.5 * whole["mean"], rel=0.1)
    clear = Mix([(0.5, Mirror(0.8)), (0.5, RoughDielectric(1.5, 0.2))])
    told = measured(room(Object(WALL, clear)))
    assert told["mean"] is told["share_of_image_mean"] is told["half_interval_95"] is None
    # A part that cannot be told makes the whole unknown.
    beside = Object(Rectangle((-1.0, -4, 0), (0, 8, 0), (0, 0, 1)), clear, "beside")
    for objects in ([Object(WALL, clear)], [MIRROR, beside]):
        report = render(room(*objects), "path", 2, threads=1).report
        assert (
            "its size is not known: photons cannot follow a mirror alone that is mixed with rough glass"
            in summary.in_words(report)
        )


@pytest.mark.statistical
def test_it_does_not_depend_on_the_depth_of_the_picture():
    """Whitted's picture of matt walls is the same at any max_depth, and so is what it lacks."""
    wall = Object(WALL, Lambertian(0.8), "wall")
    scene = room(wall, lights=[AREA_LAMP])
    finder = render(scene, "path", 64, max_depth=DEEP, threads=1).report["noise"]
    reports = [render(scene, "whitted", 4, max_depth=d, threads=1).report for d in (0, 1, 2, DEEP)]
    found = [report["light_not_found_measured"] for report in reports]
    assert all(part == found[0] for part in found)
    assert found[0]["max_depth"] == unfound.LEAST_DEPTH == DEFAULT_DEPTH
    gap = finder["image_mean"] - reports[0]["noise"]["image_mean"]
    assert gap > 0.005
    assert found[0]["mean"] == pytest.approx(gap, abs=2.0 * found[0]["half_interval_95"])


@pytest.mark.statistical
def test_what_has_more_bounces_is_said():
    """A closed room of albedo 0.9: of what leaves the first surface, 0.9^16 leaves the 17th."""
    closed = Object(Box((-2, -2, -2), (2, 2, 2)).flipped(), Lambertian(0.9), "room")
    scene = Scene(VIEW, [closed], [PointLight((0, 0, 0), 1.0)])
    report = render(scene, "whitted", 2, max_depth=1, threads=1).report
    # 2000 photons of equal power, of which 370 are expected: 5 % of that is their deviation.
    assert report["light_not_found_measured"]["lost_share"] == pytest.approx(0.9**16, rel=0.2)
    assert " (95 %) of it in up to 16 bounces, " in summary.in_words(report)
    deep = render(scene, "whitted", 2, max_depth=80, threads=1).report
    assert deep["light_not_found_measured"]["max_depth"] == 80
    assert deep["light_not_found_measured"]["lost_share"] < 0.01
    assert "in up to 80 bounces" not in summary.in_words(deep)


def test_lights_are_grouped_by_what_is_missed():
    scene = compile_scene(room(MIRROR, lights=[LAMP, AREA_LAMP], environment=GradientSky(1, 1)))

    def of(name):
        declared = INTEGRATORS[name]
        begin = partial(unfound._begin, declared.finds(declared.options()))
        found = beginnings_of(scene, begin)
        return [(part.lights, part.firsts, part.direct) for part in found]

    assert of("path") == [("P", "S", False)]
    assert of("whitted") == [("PLK", "DGS", False)]
    assert of("ppm") == []


@pytest.mark.parametrize(
    "scene",
    [
        room(MIRROR, Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5)), environment=GradientSky(1, 1)),
        room(BALL, camera=Camera((0.3, 0.2, 0.4), (0, 0, 0), (0, 1, 0), width=8, height=6)),
    ],
    ids=["sky on a plane", "camera in glass"],
)  # fmt: skip
def test_what_photons_cannot_measure_is_said(scene):
    report = render(scene, "whitted", 2).report
    assert report["light_not_found"]
    assert report["light_not_found_measured"] is None
    assert "its size is not measured" in summary.in_words(report)


class TestSentences:
    def test_of_a_picture_that_is_blurred(self):
        options = PPMOptions(2000)
        for objects, is_blurred in (([MIRROR], True), ([], False)):
            scene = room(*objects) if is_blurred else room(lights=[])
            report = render(scene, "ppm", 2, options=options).report
            assert report["picture_is_blurred"] == is_blurred
            assert ("image mean, blurred, 0." in summary.in_words(report)) == is_blurred

    def test_nothing_that_arrives(self):
        """The ball throws its light aside, out of the picture; a black sky throws none."""
        black = render(room(lights=[], environment=GradientSky(0, 0)), "whitted", 2).report
        assert black["light_not_found_measured"] is None
        far = Object(Sphere((3.0, 3.0, 0.5), 0.1), Dielectric(1.5), "far")
        closed = Object(Rectangle((-1, 2, 0), (8, 0, 0), (0, 0, 8)), Lambertian(0.0), "screen")
        report = render(room(far, closed), "path", 2).report
        found = report["light_not_found_measured"]
        assert found["mean"] is found["half_interval_95"] is found["share_of_image_mean"] is None
        assert "its size is not known: of 2,000 photons none reach the camera;" in (
            summary.in_words(report)
        )

    def test_a_narrow_view_knows_no_size(self):
        """Nearly all photons of a lamp in a ball pass a view of a tenth of a degree by."""
        view = Camera((-1.0, 0.0, 3.0), (-1.0, 0.0, 0.0), (0, 1, 0), 0.1, 8, 8)
        lamp = PointLight((0.3, 0.2, 0.4), 1.0)
        found = measured(room(BALL, lights=[lamp], camera=view))
        assert found["mean"] is found["half_interval_95"] is None
        assert found["why_unknown"] in {
            f"of 2,000 photons {few} reach the camera" for few in ("none", "too few")
        }

    @pytest.mark.parametrize("integrator", ["path", "whitted", "ppm"])
    def test_what_max_depth_cuts_off(self, integrator):
        """Two mirrors that face each other, and nothing else: all weight is lost at max_depth."""
        walls = [
            Object(Rectangle((-9, -9, z), (18, 0, 0), (0, 18, 0)), Mirror(0.5)) for z in (0, 1)
        ]
        camera = Camera((0, 0, 0.5), (0, 0, 0), (0, 1, 0), vertical_fov=5, width=4, height=3)
        report = render(Scene(camera, walls, [AREA_LAMP]), integrator, 2, max_depth=3).report
        lost = report["ended_branches"]["lost_weight_per_camera_ray"]
        # After the first mirror ppm plays Russian roulette: the same in the mean.
        expected = pytest.approx(0.5**4, rel=1.0 if integrator == "ppm" else 1e-9)
        assert lost == expected
        text = summary.in_words(report)
        n_lost = report["ended_branches"]["at max_depth"]
        # Of what paths carry to their ends, which is nothing else.
        share = 1.0 if integrator == "path" else lost
        assert f"  cut off   {n_lost} paths at max_depth 3, with {per_cent(share)} of what" in text
        assert report["picture_holds"] == (
            "the light that whitted finds in up to 3 bounces"
            if integrator == "whitted" and report["light_not_found"]
            else "all light in up to 3 bounces"
        )
        assert "of all light in up to 3 bounces" in text or integrator == "whitted"
