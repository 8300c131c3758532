import json
import math
import subprocess
import sys
from dataclasses import replace

import imageio.v3 as imageio
import numpy as np
import pytest

from benchmarks.photon_truth import PHOTON_PICTURES
from hybrid_rt.integrators import (
    PhotonMapOptions,
    PPMOptions,
    workers,
)
from hybrid_rt.integrators.media import beginnings as clear_bodies
from hybrid_rt.integrators.media.contacts import Contacts
from hybrid_rt.integrators.path.light_paths import LightPathTracer
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.surface import ShiningBox
from hybrid_rt.materials import (
    Dielectric,
    Emissive,
    Lambertian,
    Mirror,
)
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from hybrid_rt.rendering import memory, report_warnings
from hybrid_rt.rendering import renderer as rendering
from hybrid_rt.rendering import summary as numbers
from hybrid_rt.rendering.limits import MOST_PASSES, Limit
from hybrid_rt.rendering.report import ClusterFigures
from hybrid_rt.scene.plan import explain
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.image_files import save_image
from hybrid_rt.textures import CheckerTexture
from meshing import BezierPatches, SurfaceOfRevolution


def render(scene, integrator="whitted", **settings):
    return rendering.render(scene, integrator, **settings)


SKY = GradientSky(0.1, 0.9, up=(0, 0, 1))
LAMP = PointLight((3, -3, 3), 20)


def scene(material=None, lights=(LAMP,), environment=SKY, **camera):
    view = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), **{"width": 12, "height": 8, **camera})
    objects = [Object(Sphere((0, 0, 0), 1), material, "ball")] if material else []
    return Scene(view, objects, lights, environment)


def test_nothing_but_the_sky():
    image = render(scene(), passes=2).image
    assert image.dtype == np.float32
    assert image.shape == (8, 12, 3)
    assert (image[0] > image[-1]).all()  # row 0 is at the top


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_pictures_are_means_of_passes_and_more_passes_continue_the_fewer(integrator, monkeypatch):
    """A pass is a function of its number: both pictures begin with the same ones, to the bit."""
    found, add = [], Film.add

    def recorded(film, radiance):
        found.append(radiance.copy())
        add(film, radiance)

    monkeypatch.setattr(Film, "add", recorded)
    three, five = (render(scene(Lambertian(0.5)), integrator, passes=n).image for n in (3, 5))
    np.testing.assert_array_equal(found[:3], found[3:6])
    assert (found[0] != found[1]).any()
    # One rounding to float32.
    np.testing.assert_allclose(three, np.mean(found[:3], axis=0), rtol=2**-24)
    np.testing.assert_allclose(five, np.mean(found[3:], axis=0), rtol=2**-24)


def test_report_is_plain_and_complete():
    result = render(scene(Dielectric(1.5)), passes=2, seed=7)
    report = json.loads(json.dumps(result.report, allow_nan=False))
    assert report == result.report
    assert report["settings"]["seed"] == 7
    assert report["passes"] == 2
    assert report["stopped_by"] == "passes"
    assert report["rays"]["camera"] == 2 * 12 * 8
    traced = report["rays"]["camera"] + report["rays"]["reflected"] + report["rays"]["refracted"]
    assert sum(report["hits"].values()) == traced
    assert set(report["versions"]) >= {"hybrid_rt", "numpy", "numba", "python"}
    assert report["seconds"]["total"] > 0
    assert report["noise"]["image_mean"] == pytest.approx(result.image.mean(), rel=1e-5)


class TestPlan:
    """What a scene does not need is left out: here it raises when it is used nevertheless."""

    @pytest.fixture
    def forbid(self, monkeypatch):
        def forbid_name(module, name):
            def used(*_args, **_kwargs):
                raise AssertionError(f"{name} was used")

            monkeypatch.setattr(module, name, used)

        return forbid_name

    ON_A_TABLE = Scene(
        scene().camera,
        [Object(Rectangle((-2, -2, -1), (4, 0, 0), (0, 4, 0)), Lambertian(0.5), "table"),
         Object(Box((-1, -1, -1), (1, 1, 1)), Dielectric(1.5), "cube")],
        [SphereLight((0, 0, 3), 0.5, 9)],
    )  # fmt: skip
    SHINING = Object(Box((2, 2, 2), (3, 3, 3)), Emissive(5.0), "lamp")

    @pytest.mark.parametrize(
        ("module", "name", "needless", "needed"),
        [
            (clear_bodies, "media_at", scene(Lambertian(0.5)), scene(Dielectric())),
            (ShiningBox, "seen_points", scene(Lambertian(0.5)),
             Scene(scene().camera, [*scene(Lambertian(0.5)).objects, SHINING])),
            (LightPathTracer, "trace", scene(Dielectric()), ON_A_TABLE),
            (LightPathTracer, "trace", scene(Lambertian(0.5), [SphereLight((0, 0, 3), 0.5, 9)]),
             ON_A_TABLE),
            (Contacts, "at", scene(Dielectric()), ON_A_TABLE),
        ],
        ids=["start", "area", "nothing lit by glass", "nothing that throws light", "contacts"],
    )  # fmt: skip
    def test_paths_call_only_what_the_scene_needs(self, forbid, module, name, needless, needed):
        before = render(needless, "path", passes=1).image
        forbid(module, name)
        np.testing.assert_array_equal(render(needless, "path", passes=1).image, before)
        with pytest.raises(AssertionError, match=name):
            render(needed, "path", passes=1)

    def test_reasons_are_in_words(self):
        plan = render(scene(Mirror()), passes=1).report["plan"]
        assert plan["light"]["left_out"]["lens samples"] == "the camera has no lens"
        assert "  + mirror rays: at least one surface is a mirror" in explain(plan)
        assert "  - glass rays: no surface is a dielectric" in explain(plan)


class TestLimit:
    def test_sixteen_passes_unless_said(self):
        assert Limit(None, None).passes == 16
        assert Limit(None, 3.0).passes is None

    @pytest.mark.parametrize(
        ("passes", "budget", "n_passes", "stopped_by"),
        [
            (5, None, 5, "passes"),
            (None, 1.0, 9, "time_budget"),
            (3, 1.0, 3, "passes"),
            (50, 1.0, 9, "time_budget"),
            (None, 0.01, 1, "time_budget"),
        ],
    )
    def test_first_limit_reached_stops(self, passes, budget, n_passes, stopped_by):
        """Set-up takes 0.05 s, each pass 0.1 s."""
        limit, n, seconds = Limit(passes, budget), 0, 0.05
        while limit.begins(n, seconds):
            assert limit.expected_passes(n) > n
            n, seconds = n + 1, seconds + 0.1
        assert n == n_passes
        assert limit.reached(n, seconds) == stopped_by

    def test_a_budget_holds_where_earlier_passes_are_gone_on_from(self):
        """They say nothing of how long a pass takes: set-up takes 2 s, each pass 3 s."""
        limit, n, seconds = Limit(None, 20.0), 40, 2.0
        while n_together := limit.begins(n, seconds, at_most=16):
            n, seconds = n + n_together, seconds + 3.0 * n_together
        assert (n, seconds) == (46, 20.0)

    def test_each_call_makes_a_pass_however_short_its_budget(self):
        """Or renders that go on from a store would never get further: set-up takes 2 s."""
        limit = Limit(None, 0.01)
        assert limit.begins(40, 2.0) == 1
        assert limit.begins(41, 5.0) == 0
        assert limit.reached(41, 5.0) == "time_budget"
        limit = Limit(40, 0.01)
        assert limit.begins(40, 2.0) == 0
        assert limit.reached(40, 2.0) == "passes"

    def test_target_error_ends_where_the_estimate_is_below_it(self):
        """Errors fall as 1 / sqrt(passes) from 0.399: 0.05 takes 64, looked for more and more often"""
        limit, n, looks = Limit(None, None, 0.05), 0, []
        while n_together := limit.begins(n, 0.0, at_most=100):
            n += n_together
            if n >= limit.next_estimate():
                looks.append(n)
                limit.note_error(n, 0.399 / np.sqrt(n))
                assert limit.expected_passes(n) in (64, n + 1)
        assert looks == [4, 8, 16, 28, 40, 48, 52, 56, 60, 64]
        assert limit.reached(n, 0.0) == "target_error"

    def test_blur_counts_and_falls_by_its_own_law(self):
        """3 and 4 % are 5 %; squares that fall as n^(-2/3) halve the error in 8 times the passes."""
        limit = Limit(None, None, 0.025)
        limit.note_error(16, 0.03, 0.04, power=2 / 3)
        assert limit.error == pytest.approx(0.05)
        assert limit.expected_passes(16) in (128, 129)
        assert limit.reached(16, 0.0) is None
        limit.note_error(128, 0.015, 0.02, power=2 / 3)
        assert limit.reached(128, 0.0) == "target_error"

    def test_passes_beyond_all_numbers_are_expected_to_be_the_most_there_are(self):
        """A squared error that falls as n^-0.002 is a quarter after 2^1000 passes, a 16th after 2^2000."""
        for target in (0.05, 0.025):
            limit = Limit(None, None, target)
            limit.note_error(4, 0.1, power=0.002)
            assert limit.expected_passes(4) == MOST_PASSES
        limit = Limit(40, None, 0.025)
        limit.note_error(4, 0.1, power=0.002)
        assert limit.expected_passes(4) == 40

    def test_blur_that_stays_ends_what_nothing_else_would(self):
        """Noise of 3 % beside 4 % that stay: 5 % is reached, 4.5 % after more passes, 3.9 % never."""
        stays = {"blur_stays": True}
        for target, expected, reached in ((0.05, 17, "target_error"), (0.045, 34, None)):
            limit = Limit(None, None, target)
            limit.note_error(16, 0.03, 0.04, **stays)
            assert limit.expected_passes(16) == expected
            assert limit.reached(16, 0.0) == reached
        limit = Limit(None, None, 0.039)
        limit.note_error(16, 0.03, 0.04, **stays)
        assert limit.blur_out_of_reach is None  # it may be noise
        limit.note_error(64, 0.015, 0.04, **stays)
        assert limit.blur_out_of_reach == 0.04
        assert limit.reached(64, 0.0) == "blur"
        limit = Limit(100, None, 0.039)
        limit.note_error(64, 0.015, 0.04, **stays)
        assert limit.reached(64, 0.0) is None
        assert limit.reached(100, 0.0) == "passes"

    def test_photon_map_says_that_its_blur_keeps_the_target_out_of_reach(self):
        class Heard(list):
            def __call__(self, *event):
                pass

            def note_out_of_reach(self, blur):
                self.append(blur)

        heard, floor = Heard(), PHOTON_PICTURES["soft shadow"]().scene
        options = PhotonMapOptions(5000)
        result = render(floor, "photon_map", target_error=0.05, options=options, progress=heard)
        report, error = result.report, result.report["relative_error"]
        assert report["stopped_by"] == "blur"
        assert error["both"] == pytest.approx(np.hypot(error["noise"], error["blur"]))
        assert error["noise"] == report["noise"]["relative_rmse"]
        assert error["blur"] == report["photons"]["blur_relative_rmse"]
        assert error["blur"] > max(0.05, 2 * error["noise"])
        assert heard == [error["blur"]]
        text = numbers.in_words(report)
        assert "more passes do not lessen it" in text
        assert "stopped   by the blur" in text
        assert "the blur alone keeps the target 0.05 out of reach" in text

    @pytest.mark.parametrize(
        ("integrator", "options", "passes_words"),
        [("ppm", PPMOptions(2000), "lessen it"),
         ("photon_map", PhotonMapOptions(2000, 10), "do not lessen it")],
    )  # fmt: skip
    def test_blur_below_its_own_noise_is_a_limit(self, integrator, options, passes_words):
        """Few photons, small discs: the estimated square is below zero as often as above."""
        floor = PHOTON_PICTURES["smooth floor"]().scene
        results = [
            render(floor, integrator, passes=2, seed=seed, options=options) for seed in range(8)
        ]
        reports = [result.report for result in results]
        assert all(r.error == r.report["relative_error"]["both"] for r in results)
        limits = [report for report in reports if report["relative_error"]["blur"] is None]
        assert len(limits) >= 4
        for report in reports:
            error = report["relative_error"]
            counted = error["blur_at_most"] if error["blur"] is None else error["blur"]
            assert 0.0 < counted <= error["blur_at_most"]
            assert error["blur_at_most"] == report["photons"]["blur_relative_rmse_at_most"]
            assert error["both"] == pytest.approx(np.hypot(error["noise"], counted))
            assert error["blur_stays"] == (integrator == "photon_map")
        text = numbers.in_words(limits[0])
        at_most = limits[0]["relative_error"]["blur_at_most"]
        assert f"  blur      at most about {100 * at_most:.2g} % of the picture" in text
        assert f"more passes {passes_words}" in text
        assert f"blur at most {at_most:.2g})" in text

    def test_discs_that_no_photon_lies_in_are_said_and_reach_no_target(self):
        floor = PHOTON_PICTURES["smooth floor"]().scene
        options = PPMOptions(100, initial_radius=1e-5)
        report = render(floor, "ppm", target_error=0.5, options=options).report
        assert json.loads(json.dumps(report, allow_nan=False)) == report
        assert report["photons"]["stored"] > 50
        assert report["points_missed_by_photons"] == report["photons"]["gather_points"] > 0
        assert report["relative_error"]["blur_at_most"] is None
        assert report["stopped_by"] == "blur"
        text = numbers.in_words(report)
        assert "WARNING   100 % of the points that gather light have met no photon" in text
        assert "blur      unknown: no point has met a photon" in text
        assert "relative error unknown" in text

    def test_no_photon_on_its_way_by_other_surfaces_is_no_fault(self):
        """The light of a single floor is straight: no photon is stored, none is missed."""
        report = render(scene(Lambertian(0.5), environment=None), "ppm", passes=2).report
        assert report["photons"]["stored"] == 0
        assert report["points_missed_by_photons"] == 0
        assert report["relative_error"]["blur"] == 0.0
        assert "blur" not in numbers.in_words(report)

    def test_target_error_is_reached_with_the_same_pass_by_any_number_of_threads(self):
        busy = scene(Lambertian(CheckerTexture(0.9, 0.1)), width=40, height=30)
        target = 0.02
        results = [
            render(busy, "path", target_error=target, threads=k, progress=hear)
            for k, hear in ((1, None), (2, lambda *_: None))
        ]
        np.testing.assert_array_equal(results[0].image, results[1].image)
        report = results[0].report
        assert report["stopped_by"] == "target_error"
        assert report["passes"] > 4
        assert report["noise"]["relative_rmse"] <= target
        before = render(busy, "path", passes=report["passes"] - 4).report
        assert before["noise"]["relative_rmse"] > target
        assert before["stopped_by"] == "passes"

    def test_targets_are_about_all_pixels_and_about_most(self):
        """Noise of 90 % that is 31 % in most pixels: the second falls to 20 % in 2.4 times the passes."""
        limit = Limit(None, None, None, 0.2)
        limit.note_error(16, 0.9, trimmed=0.31)
        assert limit.expected_passes(16) == 39  # 16 (0.31 / 0.2)^2
        assert limit.next_estimate() == 24
        assert limit.reached(16, 0.0) is None
        limit.note_error(40, 0.6, trimmed=0.19)
        assert limit.reached(40, 0.0) == "target_error_trimmed"
        limit = Limit(None, None, 0.5, 0.2)  # whichever comes first
        limit.note_error(32, 0.49, trimmed=0.21)
        assert limit.reached(32, 0.0) == "target_error"
        limit = Limit(None, None, None, 0.2)
        limit.note_error(40, 0.6, 0.1, trimmed=0.19)
        assert limit.error_trimmed == pytest.approx(np.hypot(0.19, 0.1))
        assert limit.reached(40, 0.0) is None

    def test_no_target_is_reached_that_dots_will_exceed(self):
        """Most pixels have 15 %, but dots soon outnumber the worst: 88 % after more passes."""
        limit = Limit(None, None, None, 0.2)
        limit.note_error(4, 2.5, trimmed=0.15, ahead=0.88)
        assert limit.reached(4, 0.0) is None
        assert limit.next_estimate() == 8
        assert limit.expected_passes(4) == 78  # 4 (0.88 / 0.2)^2
        limit.note_error(40, 2.5, trimmed=0.15, ahead=0.33)
        assert limit.next_estimate() == 64  # 40 (0.33 / 0.2) is 66
        limit.note_error(4, 2.5, trimmed=0.15, ahead=0.19)
        assert limit.reached(4, 0.0) == "target_error_trimmed"
        limit = Limit(None, None, 1.0, 0.2)  # the target of all pixels is as ever
        limit.note_error(4, 0.95, trimmed=0.15, ahead=0.88)
        assert limit.reached(4, 0.0) == "target_error"

    def test_trimmed_target_stops_a_render(self):
        busy = scene(Lambertian(CheckerTexture(0.9, 0.1)), width=40, height=30)
        report = render(busy, "path", target_error_trimmed=0.03).report
        assert report["stopped_by"] == "target_error_trimmed"
        error, noise = report["relative_error"], report["noise"]
        assert noise["worst_pixels"] == 1
        assert error["both_trimmed"] == noise["relative_rmse_trimmed"] <= 0.03
        assert error["both_trimmed"] <= error["both"]
        assert "without the worst 0.1 % of the pixels, which hold" in numbers.in_words(report)

    def test_picture_without_noise_ends_with_the_first_estimate(self):
        report = render(scene(environment=None), target_error=1e-12).report
        assert (report["passes"], report["stopped_by"]) == (4, "target_error")
        assert report["noise"]["relative_rmse"] == 0.0

    @pytest.mark.parametrize("integrator", ["path", "whitted", "ppm", "photon_map"])
    def test_rays_by_kind_add_up_to_all_that_were_traced(self, integrator):
        report = render(scene(), integrator, passes=2).report
        work = report["intersection"]
        assert sum(report["rays"].values()) == work["rays"] + work["shadow_rays"]

    def test_budget_runs_at_least_one_pass(self):
        report = render(scene(), time_budget=1e-9).report
        assert (report["passes"], report["stopped_by"]) == (1, "time_budget")
        (words,) = (line for line in report["warnings"] if "time budget" in line)
        assert (
            "of 1e-09 s was enough for one pass, of which no error is known: pass 1 s or" in words
        )
        assert not any("time budget" in w for w in render(scene(), passes=1).report["warnings"])

    def test_no_estimate_ends_the_search_for_it(self):
        limit = Limit(None, None, 0.1)
        limit.note_error(4, math.nan)
        assert limit.next_estimate() == 8
        assert limit.reached(4, 1.0) == "not_finite"
        assert limit.begins(4, 1.0) == 0


def test_memory_is_that_of_pixels_and_of_two_sets_of_photons_together(monkeypatch):
    """Of 96 pixels and 1000 photons: 340 bytes each and 200 each; one pass alone has one set."""
    monkeypatch.setattr(memory, "available_bytes", lambda: 340 * 96 + 2 * 200 * 1000 - 1)
    lit = scene(Lambertian(0.5), environment=None)
    with pytest.raises(
        MemoryError, match=r"12 x 8 pixels by passes of 1000 photons .* fewer photon"
    ):
        render(lit, "ppm", passes=2, options=PPMOptions(1000))
    render(lit, "ppm", passes=1, options=PPMOptions(1000))
    render(lit, "ppm", passes=2, options=PPMOptions(999))


def test_counts_do_not_hang_on_threads_and_stages_add_up():
    """Each thread looks up the bodies around the camera: that counts once."""
    of_threads = []
    for threads in (1, 3):
        glass, matt = scene(Dielectric(1.5)), Lambertian(0.5)
        lamp = SphereLight((2, 0, 3), 0.5, 9)
        floor = Object(Rectangle((-5, -5, -1), (10, 0, 0), (0, 10, 0)), matt)
        view = Scene(glass.camera, [*glass.objects, floor], [lamp])
        report = render(view, "path", passes=2, threads=threads).report
        seconds = dict(report.seconds)
        total = seconds.pop("total")
        assert seconds["other"] >= 0
        # Each stage is rounded to 1e-4.
        assert sum(seconds.values()) == pytest.approx(total, abs=1e-4 * len(seconds))
        of_threads.append(
            [report[k] for k in ("rays", "hits", "intersection", "ended_branches", "geometry")]
        )
    assert of_threads[0] == of_threads[1]


def test_pixels_beyond_float32_are_counted_and_said(tmp_path):
    """A lamp of 1e30 at a distance of 1e-6 sends 1e42: more than float32 holds."""
    camera = Camera((0, 0, 5e-6), (0, 0, 0), (0, 1, 0), width=4, height=3)
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.5))
    result = render(Scene(camera, [floor], [PointLight((0, 0, 1e-6), 1e30)]), "path", passes=20)
    assert result.report["pixels_not_finite"] == 12
    assert "WARNING   12 pixels are not finite" in numbers.in_words(result.report)
    result.save(tmp_path / "a.png")
    assert (imageio.imread(tmp_path / "a.png") == 255).all()


def test_photons_beyond_float32_are_said_too():
    size = 1e6
    camera = Camera((0, -4 * size, size), (0, 0, 0), (0, 0, 1), width=16, height=12)
    ball = Object(Sphere((0, 0, 0), size), Dielectric(1.5))
    floor = Rectangle((-2 * size, -2 * size, -size), (4 * size, 0, 0), (0, 4 * size, 0))
    lamp = RectangleLight((-size, -size, 4 * size), (0, size, 0), (size, 0, 0), 1e30)
    scene = Scene(camera, [ball, Object(floor, Lambertian(0.5))], [lamp])
    report = render(scene, "ppm", passes=np.int64(4), options=PPMOptions(500)).report
    words = numbers.in_words(report)
    assert "pixels are not finite" in words
    assert "blur      unknown: not finite" in words
    assert report["photons"]["blur_relative_rmse_at_most"] is None
    json.dumps(report)


LATHE = SurfaceOfRevolution([(-0.8, 0.6), (0, 1.2), (0.8, 0.6)], (0, 0, 0), (0, 0, 1))
LIDS = [
    SurfaceOfRevolution([(z, r), (z, 0.6 - r)], (0, 0, 0), (0, 0, 1))
    for z, r in ((-0.8, 0.0), (0.8, 0.6))
]
PANE = Rectangle((-1, 0, -1), (2, 0, 0), (0, 0, 2))


@pytest.mark.parametrize("integrator", ["path", "whitted", "ppm"])
@pytest.mark.parametrize(
    ("surfaces", "is_open"),
    [
        ([Sphere((0, 0, 0), 1)], False),
        ([LATHE, *LIDS], False),
        ([LATHE], True),
        ([PANE], True),
        ([PANE.flipped()], True),
        ([Plane((0, 0, -0.5), (0, 0, 1))], False),
    ],
    ids=["ball", "closed profile", "open profile", "pane", "pane from behind", "water"],
)
def test_clear_bodies_that_are_not_closed_are_named(surfaces, is_open, integrator):
    """Rays that only enter, or only leave, tell it; a body may have several surfaces."""
    glass = Dielectric(1.5)
    floor = Object(Rectangle((-5, -5, -1), (10, 0, 0), (0, 10, 0)), Lambertian(0.5))
    bodies = [Object(surface, glass, "glass") for surface in surfaces]
    lamp = SphereLight((1, -2, 3), 0.3, 9)
    view = Scene(scene().camera, [floor, *bodies], [lamp])
    few = PPMOptions(2000) if integrator == "ppm" else None
    report = render(view, integrator, passes=1, threads=1, options=few).report
    assert list(report["clear_bodies_not_closed"]) == (["glass"] if is_open else [])
    words = numbers.in_words(report)
    assert ("WARNING   'glass' is clear: " in words) == is_open
    assert ("it is not closed (all surfaces of a body" in words) == is_open


@pytest.mark.parametrize(
    ("bodies", "not_closed", "lost"),
    [
        ({"ball": Sphere((0, 0, 0), 1).flipped()}, [], ["ball"]),
        ({f"ball {k}": Sphere((0, 0, 0), 1.0 - 0.05 * k) for k in range(10)}, [], ["ball 8", "ball 9"]),
        ({"ball": Sphere((0, 0, 0), 1), "pane": PANE}, ["pane"], []),
        ({"box": Box((-1, -1, -1), (1, 1, 1)).flipped()}, [], ["box"]),
    ],
    ids=["ball from within", "ten balls", "a pane of its glass", "box from within"],
)  # fmt: skip
def test_closed_bodies_are_never_called_open(bodies, not_closed, lost):
    """Ten balls are of ten kinds of glass; the ball and the pane are of one."""
    glass = [Dielectric(1.5 + (0.01 * k if len(bodies) > 2 else 0.0)) for k in range(len(bodies))]
    glass = glass if len(bodies) > 2 else [glass[0]] * 2
    objects = [
        Object(surface, material, name)
        for (name, surface), material in zip(bodies.items(), glass, strict=False)
    ]
    report = render(Scene(scene().camera, objects, [LAMP], SKY), "path", passes=1).report
    assert list(report["clear_bodies_not_closed"]) == not_closed
    assert [name for name in lost if name not in report["clear_bodies_lost"]] == []
    assert bool(report["clear_bodies_lost"]) == bool(lost)
    text = numbers.in_words(report)
    assert ("it is not closed (all" in text) == bool(not_closed)
    assert (": its normals point inward" in text) == bool(lost)


X, Y, Z = np.eye(3)
FACES = [(X, Y, Z), (-X, Z, Y), (Y, Z, X), (-Y, X, Z), (Z, X, Y), (-Z, Y, X)]  # normal, u, v


def test_one_turned_patch_of_a_clear_body_has_a_remedy_of_its_own():
    """A box of six patches, of which one is turned: transposing its net mends it."""
    box = [0.7 * np.array([[n - u - v, n - u + v], [n + u - v, n + u + v]]) for n, u, v in FACES]
    nets = [*box[:5], box[5].transpose(1, 0, 2)]
    turned = BezierPatches(nets)
    inward = [i for i in range(6) if turned.normal(0.5, 0.5, i) @ turned.point(0.5, 0.5, i) < 0]
    assert inward == [5]
    nets[5] = turned.patches[5].transpose(1, 0, 2)
    found = {}
    for name, surface in {"turned": turned, "mended": BezierPatches(nets)}.items():
        body = Object(surface, Dielectric(1.5), name)
        found[name] = render(Scene(scene().camera, [body], [LAMP], SKY), passes=1, threads=1).report
    assert found["mended"]["warnings"] == []
    (words,) = found["turned"]["warnings"]
    assert "or of single patches (compare surface.normal(0.5, 0.5, i)" in words
    assert words in numbers.in_words(found["turned"])


def test_warnings_of_the_report_are_all_that_its_text_warns_of(caplog):
    """A point light within a floor cannot be moved: that is said before the passes."""
    floor = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
    few = {"passes": 1, "threads": 1}
    assert render(Scene(scene().camera, [floor], [LAMP]), **few).report["warnings"] == []
    away = RectangleLight((0, 0, 4), (1, 0, 0), (0, 1, 0), 9)
    lamps = [PointLight((0, 0, 0), 1), LAMP, away]
    report = render(Scene(scene().camera, [floor], lamps), **few).report
    told = report["warnings"]
    assert [words.split(":")[0] for words in told] == [
        "lights[0] lies in object 'floor'",
        "lights[2] lights nothing",
    ]
    assert json.loads(json.dumps(told)) == told
    assert [record.getMessage() for record in caplog.records] == told
    assert numbers.in_words(report).count("WARNING") == 2
    for words in told:
        assert f"WARNING   {words}" in numbers.in_words(report)
    cluster = ClusterFigures(
        "local:1", 1, 1, {"tcp://a": "numpy 1.0"}, 2, 0, 0.1, 0.1, "the scheduler is gone"
    )
    of_cluster = ["tcp://a made no passes: numpy 1.0", "the scheduler is gone"]
    assert report_warnings.all_warnings(replace(report, cluster=cluster)) == [*told, *of_cluster]


def test_progress_hears_every_block(monkeypatch):
    monkeypatch.setattr(workers, "BLOCK", 12 * 8)
    heard = []
    render(scene(), passes=2, progress=lambda *event: heard.append(event))
    assert heard[0] == ("Building", 0, 0)
    assert heard[-2:] == [("Rendering", 96, 192), ("Rendering", 192, 192)]


def test_progress_that_listens_hears_the_error():
    class Heard(list):
        def __call__(self, *event):
            self.append(event)

        def note_error(self, error, trimmed, is_limit):
            assert (trimmed, is_limit) == (error, False)  # no pixel is one of 1000
            self.append(error)

    heard = Heard()
    result = render(scene(Lambertian(0.5)), passes=18, progress=heard)
    errors = [event for event in heard if isinstance(event, float)]
    assert len(errors) == 1  # all passes of so small a picture run together
    assert errors[-1] == result.report["noise"]["relative_rmse"]


def test_scene_of_closed_forms_imports_no_mesh_library():
    code = """
import sys
from hybrid_rt import Camera, Mirror, Object, Scene, Sphere, render
camera = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=4, height=3)
scene = Scene(camera, [Object(Sphere((0, 0, 0), 1), Mirror())])
for integrator in ("path", "ppm"):
    render(scene, integrator, passes=1)
# Numba itself imports the bare package scipy.
print({"trimesh", "embreex", "scipy.spatial", "imageio"} & set(sys.modules))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.strip() == "set()"


def test_settings_of_numpy_are_written(tmp_path):
    """What was computed is kept: numbers of numpy become plain ones, what is not finite null."""
    camera = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), width=4, height=3)
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.5))
    scene = Scene(camera=camera, objects=[floor], lights=[PointLight((0, 0, 2), 9)])
    result = render(scene, passes=np.int64(1), seed=np.int32(3), max_depth=np.int64(2))
    made_up = {"made up": [np.float32(np.inf), float("nan"), np.bool_(True)]}
    save_image(tmp_path / "a.npz", result.image, {**result.report, **made_up})
    report = json.loads((tmp_path / "a.npz.json").read_text("utf-8"))
    assert report["settings"]["seed"] == 3
    assert report["made up"] == [None, None, True]
    with pytest.raises(TypeError, match=r"seed is 1\.5: pass an integer"):
        render(scene, passes=1, seed=1.5)
