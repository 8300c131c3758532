"""Studies of tiny scenes of which everything is known."""

import base64
import io
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.analysis import answers, study_diagrams, study_runs, tables
from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.bias import least_by_mean, least_by_tiles, shared_error
from hybrid_rt.analysis.curves import Curve, Point, Spread, renamed, spread
from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, as_svg, save
from hybrid_rt.analysis.hit_study import RULE_OF_THREE, camera_rays, study_hits
from hybrid_rt.analysis.method_forecast import forecast, forecasts_of
from hybrid_rt.analysis.methods import Method, size_of
from hybrid_rt.analysis.page import Study, page
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.study_runs import next_passes
from hybrid_rt.analysis.work_precision import StudyInterrupted, study_picture
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.verify.light.light_tracer import BEHIND_PANE
from meshing import SurfaceOfRevolution, TrimmedSurface, polygon

TUBE = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
VIEW = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
SKY = GradientSky(0.3, 1.0, up=(0, 0, 1))
SCENE = Scene(VIEW, [Object(TUBE, Lambertian(0.5))], environment=SKY)


def test_spread_and_names():
    assert spread([3.0, 1.0, 2.0]) == Spread(2.0, 1.0, 3.0, (3.0, 1.0, 2.0))
    assert renamed([Curve("law", "", [])], "A")[0].name == "A: law"


@pytest.fixture(scope="module")
def room():
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    truth = Picture("truth", np.full((12, 16, 3), 2.0, np.float32), None, None)
    methods = [Method("path", "path"), Method("again", "path")]
    return study_picture(scene, (4, 16, 64), runs=2, reference=truth, methods=methods, threads=1)


@pytest.mark.parametrize(("half", "is_biased"), [(0.06, False), (0.001, True)])
def test_blur_of_the_reference_is_no_bias_of_what_it_judges(half, is_biased):
    """A reference 2 % too dark that allows for 3 % proves nothing; one that denies it does."""
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    report = {
        "noise": {"half_interval_95_of_image_mean": half},
        "relative_error": {"both": 0.5 * half, "noise": 0.01, "blur": 0.5 * half},
        "settings": {"integrator": "ppm"},
        "passes": 64,
    }
    dark = Picture("dark.npz", np.full((12, 16, 3), 1.96, np.float32), report, None)
    study = study_picture(
        scene, (64, 256), runs=2, reference=dark, methods=[Method("path", "path")], threads=1
    )
    last = study.curves[0].points[-1].more
    assert last["mean_error"] == pytest.approx(2 / 1.96 - 1, abs=0.002)
    assert (abs(last["mean_error"]) > last["mean_error_noise"]) == is_biased
    assert (study.curves[0].bias > 0.0) == is_biased
    assert study.reference.made_by == "the file dark.npz (ppm, 64 passes)"
    assert ("its check", "none: the reference was given") in answers.picture_conditions(
        study, (16, 12)
    )


class TestNextPasses:
    def test_four_times_as_many_until_the_seconds_are_filled(self):
        """0.5 s and 0.1 s a pass: 10 s are filled by 95 passes."""
        spent = {}
        while (n := next_passes(spent, 10.0)) is not None:
            spent[n] = 0.5 + 0.1 * n
        assert list(spent) == [1, 4, 16, 95]

    def test_a_pass_that_takes_as_long_is_the_only_one(self):
        assert next_passes({1: 9.1}, 10.0) is None
        assert next_passes({1: 30.0}, 10.0) is None

    def test_hardly_more_passes_are_not_worth_a_render(self):
        assert next_passes({1: 1.0, 80: 80.0}, 91.0) is None
        assert next_passes({1: 1.0, 80: 80.0}, 93.0) == 93

    def test_times_of_a_busy_machine_end_nothing(self):
        assert next_passes({1: 1.0, 4: 0.9}, 10.0) == 16


@pytest.mark.parametrize("work", [{}, {"passes": (1, 4), "seconds": 1.0}])
def test_passes_or_seconds(work):
    with pytest.raises(ValueError, match="pass the one or the other"):
        study_picture(SCENE, **work)


@pytest.fixture(scope="module")
def tube():
    return study_hits([TUBE], camera_rays(SCENE, 4000), tolerances=(1e-2, 1e-4), runs=2, threads=1)


def test_hits_on_trimmed_surfaces_are_studied():
    window = polygon([(-0.1, 0.3), (0.15, 0.25), (0.12, 0.7), (-0.08, 0.6)])
    loops = [polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), window]
    surfaces = [TrimmedSurface(TUBE, loops)]
    study = study_hits(surfaces, camera_rays(SCENE, 1000), tolerances=(1e-2,), runs=1, threads=1)
    wrong = {curve.name: curve.points[0].error.median for curve in study.curves}
    assert wrong["certified"] == wrong["certified, no Embree"] == 0.0
    # Triangles that an edge crosses stay whole.
    assert wrong["mesh"] > 0.0
    assert 0 < study.judged < 1000


@pytest.mark.parametrize("more", [{"u_range": (0, 0.5)}, {"weights": [1, 0.5]}])
def test_hits_on_parts_of_turns_and_rational_surfaces_are_studied(more):
    tube = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.2]], (0, 0, 0), (0, 0, 1), **more)
    study = study_hits([tube], camera_rays(SCENE, 1000), tolerances=(0.1,), runs=1, threads=1)
    wrong = {curve.name: curve.points[0].error.median for curve in study.curves}
    assert wrong["certified"] == wrong["certified, no Embree"] == 0.0
    mean_dt = {curve.name: curve.points[0].more["mean_dt"] for curve in study.curves}
    assert mean_dt["certified"] < 1e-14
    assert mean_dt["mesh"] > 1e-4
    assert study.judged > 200
    # Steps are counted on whole turns of plain profiles only.
    assert study.newton == []


class TestPictures:
    """A closed room that shines and reflects half: radiance 2 everywhere, by Whitted 3/2."""

    @pytest.mark.statistical
    def test_errors_fall_as_noise_does(self, room):
        for curve in room.curves:
            first, _, last = (point.error.median for point in curve.points)
            assert 2.0 < first / last < 10.0  # 4 by independent passes, more by nets
            assert [point.setting for point in curve.points] == [4, 16, 64]
            assert all(point.seconds.least <= point.seconds.most for point in curve.points)

    @pytest.mark.statistical
    def test_stated_errors_are_the_true_ones(self, room):
        """192 pixels, 2 runs: 20 % is some 4 standard deviations."""
        point = room.curves[0].points[-1]
        assert point.more["stated_error"] == pytest.approx(point.error.median, rel=0.2)

    def test_same_method_same_errors(self, room):
        one, other = (curve.points[-1].error for curve in room.curves)
        assert one == other
        np.testing.assert_array_equal(room.images["path"], room.images["again"])

    def test_recommended_is_the_cheapest(self, room):
        found = forecasts_of(room, 0.05)
        seconds = [f.seconds.median for f in found]
        assert seconds == sorted(seconds)
        assert all(f.seconds.least <= f.seconds.median <= f.seconds.most for f in found)
        assert all(f.bias == 0.0 for f in found)

    def test_curves_without_an_error_cannot_be_drawn(self, room):
        none = Spread(0.0, 0.0, 0.0)
        curves = [
            replace(c, points=[replace(p, error=none) for p in c.points]) for c in room.curves
        ]
        with pytest.raises(ValueError, match="all are equal to the reference"):
            study_diagrams.picture_diagram(curves, math.nan)

    def test_page_needs_no_other_file(self, room):
        advice = advise(room, 0.05, "a <room>.py")
        diagram = study_diagrams.picture_diagram(room.curves, room.reference.own_error)
        study = Study(
            "A <room>", "Asked: which?", advice.headline, advice.command, advice.details,
            measured=answers.conditions(answers.picture_conditions(room, (32, 24)), "room.py"),
            diagrams=[diagram], tables=[tables.picture_table(room.curves)], images=room.images,
        )  # fmt: skip
        text = page(study)
        assert "A &lt;room&gt;" in text
        assert f'<p class="answer">{advice.headline}</p>' in text
        assert "16 x 12 pixels; the scene&#x27;s own camera has 32 x 24" in text
        assert "relative RMSE against the reference" in text
        # One diagram, for wide screens and narrow ones.
        assert text.count("data:image/svg+xml") == 2
        links = re.findall(r'(?:src|href|srcset)="([^"]*)"', text)
        assert len(links) == 2 + 1 + 2 * 2
        assert not re.findall(r"https?://", re.sub(r'(?:src|srcset)="[^"]*"', "", text))
        for link in links:
            kind, data = link.split(",", 1)
            file = base64.b64decode(data)
            if kind == "data:image/svg+xml;base64":
                assert ElementTree.fromstring(file).tag.endswith("svg")
                continue
            assert kind == "data:image/png;base64"
            assert imageio.imread(io.BytesIO(file)).shape == (12, 16, 3)


def test_an_interrupt_before_the_figures_of_a_picture_loses_no_other(monkeypatch):
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    truth = Picture("truth", np.full((12, 16, 3), 2.0, np.float32), None, None)
    errors, calls = study_runs.picture_errors, []

    def interrupted(*pictures):
        calls.append(pictures)
        if len(calls) == 2:
            raise KeyboardInterrupt
        return errors(*pictures)

    monkeypatch.setattr(study_runs, "picture_errors", interrupted)
    methods = [Method("path", "path"), Method("again", "path")]
    with pytest.raises(StudyInterrupted) as caught:
        study_picture(scene, (4, 16), runs=2, reference=truth, methods=methods, threads=1)
    assert [curve.name for curve in caught.value.study.curves] == ["path"]


@pytest.mark.statistical
def test_two_methods_agree_and_a_mesh_does_not():
    larger = SCENE.with_camera(SCENE.camera.resized(48, 32))
    study = study_picture(
        larger, (4, 16), runs=1, reference_passes=64, methods=[Method("path", "path")], threads=1
    )
    check = study.reference.check
    # Whichever states the smaller error is the reference, and checked by the other.
    made_by = {study.reference.made_by.partition(",")[0], check["made_by"].partition(",")[0]}
    assert made_by == {"path", "ppm"}
    # By Student's t with 3 degrees of freedom four 95 % intervals are passed once in 1000 runs.
    assert abs(check["gap"]) < 4.0 * check["gap_half_interval"]
    explained = math.hypot(check["by_noise"], check["by_blur"])
    assert check["difference"] == pytest.approx(explained, rel=0.3)
    refined, coarse, _, fine = study.meshes
    assert (refined["accuracy"], coarse["accuracy"]) == ("refined", "mesh")
    assert coarse["error"] > 3.0 * fine["error_at_most"]
    assert coarse["error"] > 3.0 * refined["error_at_most"]
    assert coarse["triangles"] < fine["triangles"]
    assert coarse["error"] < coarse["error_at_most"]


class TestAnswer:
    """Methods that take 1 s for 10 passes of an error of 10 %, and variants of it."""

    @staticmethod
    def method(name, seconds, errors, flags="--integrator path"):
        points = [Point(10, spread(seconds), spread(errors), {"error_of_most": 0.05})]
        return Curve(name, flags, points, converges="--accuracy" not in flags)

    def advice(self, room, *curves, runs=2):
        reference = replace(room.reference, own_error=0.01)
        study = replace(room, reference=reference, curves=list(curves), runs=runs)
        return advise(study, 0.1, "a b.py"), study

    def test_a_mesh_is_not_named_where_a_dot_of_one_run_decides(self, room):
        """Certified hits met a dot in one run of two; what takes longer in all runs is no rival."""
        mesh = "--integrator path --accuracy mesh --tolerance 1"
        fast = self.method("mesh", [1.0, 1.01], [0.1, 0.1], mesh)
        slow = self.method("slow", [2.0, 2.1], [0.1, 0.1])
        dots = self.method("dots", [1.0, 1.05], [0.099, 0.5])
        assert self.advice(room, fast, slow)[0].headline.startswith("For 10 %: mesh, 10 passes")
        found, study = self.advice(room, fast, slow, dots)
        assert found.headline.startswith("For 10 %: dots, ")
        assert any(
            "do not tell it apart from mesh (1.0 s to 1.0 s), slow" in d for d in found.details
        )
        (words,) = answers.dots_answers(study, 0.1)
        assert "97 % of dots. So runs differ by a few dots" in words
        assert words.endswith("--target-trimmed 0.1 leaves these pixels out of all errors.")
        assert not answers.dots_answers(replace(study, trimmed=True), 0.1)

    def test_one_run_names_no_hits_without_proof(self, room):
        fast = self.method("mesh", [1.0], [0.1], "--integrator path --accuracy mesh")
        found, _ = self.advice(room, fast, self.method("slow", [2.0], [0.1]), runs=1)
        assert found.headline.startswith("For 10 %: slow, ")
        assert any(
            d.startswith("mesh would take 1.0 s, by one run, and its") for d in found.details
        )

    def test_the_command_for_an_integrator_of_the_script_names_none(self, room):
        own = self.method("mine", [1.0, 1.0], [0.1, 0.1], "--integrator mine")
        found, _ = self.advice(room, own)
        assert found.command.startswith("hybrid-rt render 'a b.py' --passes 10 --width 16 ")
        assert any("let it say INTEGRATOR = 'mine'" in d for d in found.details)


def test_meshes_are_judged_by_the_method_with_less_noise():
    """Whitted's method leaves out light; half a million photons bring little to a tube under a sky."""
    methods = [
        Method("whitted", "whitted"),
        Method("photons", "ppm", options=PPMOptions(500_000)),
        Method("paths", "path"),
    ]
    truth = Picture("truth", np.full((16, 24, 3), 0.5, np.float32), None, None)
    common = {"runs": 1, "reference": truth, "methods": methods, "threads": 1}
    study = study_picture(SCENE, (2,), trimmed=True, **common)
    assert study.trimmed
    assert [row["method"].partition(",")[0] for row in study.meshes] == ["paths"] * 4
    study = study_picture(SCENE, (2,), meshes_by="whitted", **common)
    assert {row["method"].partition(",")[0] for row in study.meshes} == {"whitted"}
    with pytest.raises(ValueError, match=r"meshes_by is 'photon_map', .* pass whitted or ppm"):
        study_picture(SCENE, (2,), meshes_by="photon_map", **common)


@pytest.fixture(scope="module")
def mirror_room():
    walls = Object(Box((-2, -2, 0), (2, 2, 3)).flipped(), Lambertian(0.6))
    ball = Object(Sphere((0.5, 0.2, 0.8), 0.5), Dielectric(1.5))
    mirror = Object(Rectangle((-1.9, 1, 0.2), (1.6, 0.8, 0), (0, 0, 1.8)), Mirror())
    scene = Scene(
        Camera((0, -1.8, 1.4), (0, 0, 1), (0, 0, 1), 70, 24, 18),
        [walls, ball, mirror],
        [PointLight((-0.5, -0.3, 2.6), 6.0)],
    )
    methods = [
        Method("path", "path"),
        Method("ppm", "ppm", options=PPMOptions(5_000)),
        Method("whitted", "whitted"),
    ]
    # Few photons, but many enough to know the mean to 1.6 % (95 %).
    truth = render(scene, "ppm", 32, seed=9, threads=1, options=PPMOptions(10_000))
    reference = Picture("truth.npz", truth.image, truth.report, None)
    return study_picture(scene, (4, 64), runs=1, reference=reference, methods=methods, threads=1)


class TestBias:
    """A room with a point light, a mirror and a ball of glass: only photons find what these throw."""

    @pytest.mark.statistical
    def test_means_and_declarations_tell_what_passes_do_not_remove(self, mirror_room):
        path, photons, whitted = mirror_room.curves
        # What is thrown by mirror and glass is a tenth of the light, measured at 120 x 90 pixels.
        assert -0.15 < path.points[-1].more["mean_error"] < -0.03
        assert abs(path.points[-1].more["mean_error"]) > path.points[-1].more["mean_error_noise"]
        assert path.bias > 0.01
        assert "its mean is off by -" in path.bias_known_by
        assert "that mirrors or glass throw" in path.left_out[0]
        assert whitted.bias > path.bias
        assert (photons.bias, photons.left_out) == (0.0, [])

    @pytest.mark.statistical
    def test_what_cannot_arrive_is_not_named(self, mirror_room):
        """Given a good reference, and long photon curves, paths are not the answer at any speed."""
        good = replace(mirror_room, reference=replace(mirror_room.reference, own_error=0.003))
        found = {f.method: f for f in advise(good, 0.01, "room.py").forecasts}
        assert found["path"].passes is None
        assert found["whitted"].passes is None
        assert found["ppm"].passes is not None
        advice = advise(good, 0.01, "room.py")
        assert advice.headline.startswith("For 1 %: ppm, ")
        # As the study stands its reference cannot judge that.
        advice = advise(mirror_room, 0.01, "room.py")
        assert advice.headline.startswith("1 % cannot be judged: the reference is itself off by ")

    @pytest.mark.statistical
    def test_unfound_light_rules_out_what_a_blind_reference_does_not(self, mirror_room):
        """By a picture that lacks what paths lack, paths look right to 1 %.

        432 pixels have 2000 photons, which know that light to a fifth or so.
        """
        path = mirror_room.curves[0]
        assert path.unfound == pytest.approx(-path.points[-1].more["mean_error"], rel=0.4)
        looks_right = [replace(p, error=Spread(0.01, 0.01, 0.01)) for p in path.points]
        blind = replace(
            mirror_room,
            reference=replace(mirror_room.reference, own_error=0.001),
            curves=[replace(path, points=looks_right, bias=0.0)],
        )
        advice = advise(blind, 0.5 * path.unfound, "room.py")
        assert advice.headline.startswith("No method here reaches")
        assert advice.details[0].startswith("path: does not find light that is ")
        assert advise(blind, 2.0 * path.unfound, "room.py").forecasts[0].passes == 4
        assert [curve.unfound for curve in mirror_room.curves[1:2]] == [0.0]
        assert any("photons find" in text for text in answers.bias_answers(mirror_room))

    def test_means_of_all_pixels_tell_nothing_of_most_pixels(self, mirror_room):
        """One pixel of the worst 0.1 % may hold all of what the mean lacks: errors are as measured."""
        walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
        scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 40, 30), [walls])
        image = np.full((30, 40, 3), 2.0, np.float32)
        image[11, 7] = 900.0
        truth, methods = Picture("truth", image, None, None), [Method("path", "path")]
        curves = [
            study_picture(
                scene, (16,), runs=2, reference=truth, methods=methods, trimmed=trimmed, threads=1
            ).curves[0]
            for trimmed in (False, True)
        ]
        target = 1.5 * curves[1].points[0].error.most
        assert curves[0].bias > target > curves[1].bias == 0.0
        assert [forecast(curve, target).passes for curve in curves] == [None, 16]
        assert mirror_room.curves[0].error_by_unfound < mirror_room.curves[0].unfound

    def test_command_is_what_was_measured(self, mirror_room):
        good = replace(mirror_room, reference=replace(mirror_room.reference, own_error=0.003))
        advice = advise(good, 0.5, "my room.py", (240, 180))
        best = next(f for f in advice.forecasts if f.passes is not None)
        assert advice.command == (
            f"hybrid-rt render 'my room.py' {best.flags} --passes {best.passes} --width 24 "
            "--height 18 --threads 1 --seed 1"
        )
        size = next(text for text in advice.details if "240 x 180" in text)
        assert "100 times as long" in size
        assert "24 x 18 pixels, as measured" in size

    def test_reference_that_leaves_out_light_names_nothing(self, mirror_room):
        lacks = replace(mirror_room.reference, own_error=0.001, light_not_found=["light (PSDE)"])
        advice = advise(replace(mirror_room, reference=lacks), 0.1, "room.py")
        assert advice.headline.startswith("No method is named for 10 %")
        assert advice.command == ""
        assert "does not find light, how much of it is not measured." in advice.details[0]
        share = {
            "mean": 0.02,
            "half_interval_95": 0.002,
            "share_of_image_mean": 0.1,
            "photons": 2000,
        }
        advice = advise(
            replace(mirror_room, reference=replace(lacks, measured=share)), 0.1, "room.py"
        )
        assert "alone 10 % +- 1.0 % (95 %, by 2,000 photons) of its mean" in advice.details[0]

    @pytest.mark.parametrize(("measured", "words"), [
        ((0.02, 0.002, None, ""), "alone 0.02 +- 0.002 (95 %, by 2,000 photons); it is black."),
        ((None, None, None, "of 2,000 photons none reach the camera"),
         "is not known (of 2,000 photons none reach the camera)."),
    ])  # fmt: skip
    def test_size_that_photons_do_not_tell(self, mirror_room, measured, words):
        names = ("mean", "half_interval_95", "share_of_image_mean", "why_unknown")
        lacks = replace(
            mirror_room.reference,
            own_error=0.001,
            light_not_found=["light (PSDE)"],
            measured=dict(zip(names, measured, strict=True), photons=2000),
        )
        advice = advise(replace(mirror_room, reference=lacks), 0.1, "room.py")
        assert words in advice.details[0]

    def test_proofs_of_bias(self):
        """A picture too dark by a tenth everywhere, once with noise that differs between runs."""
        truth = np.full((32, 32, 3), 0.5, np.float32)
        rng = np.random.default_rng(3)
        dark = [0.9 * truth + 0.1 * rng.normal(size=truth.shape) for _ in range(3)]
        least = 0.05 / math.sqrt(0.26)
        assert least_by_mean(-0.05, 0.0, truth) == pytest.approx(least)
        assert least_by_mean(-0.05, 0.06, truth) == 0.0
        assert least_by_mean(-0.05, math.nan, truth) == 0.0
        found = least_by_tiles(dark, truth, 0.0)
        # 64 tiles of 48 values in 3 pairs: the doubt taken off is a tenth of the square.
        assert 0.85 * least < found < least
        assert least_by_tiles(dark, truth, 0.2) == 0.0
        assert least_by_tiles(dark[:1], truth, 0.0) == 0.0
        noise = [truth + 0.1 * rng.normal(size=truth.shape) for _ in range(3)]
        assert least_by_tiles(noise, truth, 0.0) < 0.02

    def test_without_the_worst_pixels_two_dots_hide_no_error_of_a_mesh(self):
        """20 % of bias in 40 x 50 pixels; two of them, 0.1 %, are off by 100 in one of the pictures."""
        rng = np.random.default_rng(6)
        truth = np.full((40, 50, 3), 0.5)
        one, other = (0.1 + 0.02 * rng.normal(size=truth.shape) for _ in "ab")
        one[3, 4] = other[20, 7] = 100.0
        assert shared_error(one, other, truth**2)[0] > 0.25
        error, at_most = shared_error(one, other, truth**2, trimmed=True)
        assert error == pytest.approx(0.2, abs=0.002)
        assert error < at_most < 0.21

    def test_noise_of_dots_is_no_error_of_a_mesh(self):
        """Pictures of one dot in 50 pixels, each of its own: 1 % and then 20 % of bias are told from that."""
        rng = np.random.default_rng(5)
        truth = np.full((40, 50, 3), 0.5)

        def off(bias):
            dots = [
                (rng.random((40, 50, 1)) < 0.02) * rng.exponential(20.0, (40, 50, 1)) for _ in "ab"
            ]
            return (dots[0] - dots[1]) / 5 + bias * truth

        def found(bias):
            return [shared_error(off(bias), off(bias), truth**2) for _ in range(100)]

        errors, at_most = np.transpose(found(0.0))
        # Products of heavy tails are not normal: a few in a hundred pass for an error.
        assert np.count_nonzero(errors) <= 6
        errors, at_most = np.transpose(found(0.8))
        assert np.median(errors) == pytest.approx(0.8, rel=0.05)
        assert np.count_nonzero(at_most > 0.8) >= 90


class TestReference:
    """Paths and photons check each other where both find all light."""

    GLOSSY = Object(Sphere((0, 0, 1.5), 0.3), Mirror())
    POINT = (PointLight((3, -5, 3), 40),)

    def study(self, objects, lights=(), sky=None, **settings):
        scene = Scene(VIEW, objects, lights, sky)
        methods = [Method("whitted", "whitted")]
        settings = {"runs": 1, "reference_passes": 8, "methods": methods, **settings}
        return study_picture(scene, (1,), **settings).reference

    def test_paths_by_photons_and_photons_by_paths(self):
        ball = Object(Sphere((0, 0, 0), 1), Lambertian(0.5))
        found = [self.study([ball], self.POINT, reference_by=name) for name in ("path", "ppm")]
        assert [r.made_by.split(",")[0] for r in found] == ["path", "ppm"]
        assert [r.check["made_by"] for r in found] == ["ppm, 2 passes", "path, 2 passes"]
        # The ball lights nothing: only jitter within pixels differs.
        assert found[0].mean == pytest.approx(found[1].mean, rel=0.02)

    def test_what_a_point_light_throws_is_found_by_photons_alone(self):
        floor = Object(Rectangle((-2, -2, -1), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
        found = self.study([floor, self.GLOSSY], self.POINT)
        assert found.made_by.startswith("ppm")
        assert found.check is None
        with pytest.raises(ValueError, match=r"'path'.* all light of this scene: pass ppm"):
            self.study([floor, self.GLOSSY], self.POINT, reference_by="path")

    def test_a_black_reference_is_refused(self):
        ball = Object(Sphere((0, 0, 0), 1), Lambertian(0.5))
        with pytest.raises(ValueError, match=r"reference is black.*Give the scene a lamp"):
            self.study([ball])

    def test_the_smaller_stated_error_is_the_reference(self):
        """A ring's caustic, seen through a pane: rare and bright for paths, easy for photons.

        Paths state 0.58 to 0.73 over six seeds, photons 0.08 to 0.10.
        """
        bench = BEHIND_PANE.scene(Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 16, 16))
        ring = Object(Torus((0, 0, 0.9), (0, 0, 1), 0.45, 0.2), Dielectric(1.5))
        others = [thing for thing in bench.objects if thing.name != "sphere"]
        lamp = RectangleLight((-0.5, -0.5, 3.5), (0, 1, 0), (1, 0, 0), 5.0)
        scene = Scene(bench.camera, [ring, *others], [lamp], bench.environment)
        methods = [Method("path", "path")]
        study = study_picture(scene, (1, 4), runs=1, reference_passes=16, methods=methods)
        assert study.reference.made_by == "ppm, certified, 4 passes"
        assert study.reference.check["made_by"] == "path, 16 passes"

    def test_reference_worse_than_what_it_judges_is_said_so(self, room):
        worse = replace(room, reference=replace(room.reference, own_error=0.5))
        found = advise(worse, 0.05, "r.py")
        assert found.headline == "5 % cannot be judged: the reference is itself off by 50 %."
        assert found.command == ""
        (todo,) = found.details
        assert "may be off by 1.7 % at most" in todo
        assert "--reference FILE.npz" in todo

    def test_poor_reference_names_its_remedy_and_what_it_can_judge(self, room):
        """Off by 4 % with 100 passes: for 6 % it needs four times as many, and it can judge 12 %."""
        own = replace(room.reference, own_error=0.04, passes=100, seconds=3.0)
        found = advise(replace(room, reference=own), 0.06, "r.py")
        assert found.headline.startswith(
            "6 % cannot be judged: the reference is itself off by 4.0 %. For 15 %: "
        )
        assert found.target == 0.15
        assert "--reference-passes 400, about 12 s instead of 3.0 s" in found.details[-1]

    def test_fewer_passes_of_photons_are_not_promised_more_than_noise_allows(self, room):
        """ppm, off by 3 % after 100 passes, for 4 times that: 100 / 16 passes, not 100 / 4^3."""
        check = {"made_by": "ppm, 100 passes", "passes": 100, "seconds": 5.0, "own_error": 0.03}
        own = replace(room.reference, own_error=0.5, passes=400, seconds=900.0, check=check)
        todo = advise(replace(room, reference=own), 0.36, "r.py").details[-1]
        assert "--reference-by ppm --reference-passes 7," in todo

    def test_a_longer_reference_is_counted_with_its_check(self, room):
        """Photons were to check with a quarter of the passes, and became the reference.

        Asked for themselves they make all passes, and paths a quarter: 100 instead of 400.
        """
        own = replace(
            room.reference,
            made_by="ppm, certified, 100 passes",
            own_error=0.04,
            passes=100,
            seconds=30.0,
            check={"made_by": "path, 400 passes", "passes": 400, "seconds": 4.0, "own_error": 0.2},
            power=1.0,
        )
        found = advise(replace(room, reference=own), 0.06, "r.py")
        said = "--reference-by ppm --reference-passes 400, about 2.0 min instead of 34 s"
        assert said in found.details[-1]

    def test_the_longer_reference_is_by_the_method_that_needs_less_time(self, room):
        """Paths are off by 8 % after 400 passes: they need 16 times as many, and photons 4 times.

        Photons take 0.03 or 30 s a pass, paths 0.01 s. Either is checked by a quarter as many passes of
        the other, or as many as take as long, but at least eight.
        """
        cheap = replace(
            room.reference,
            made_by="ppm, certified, 100 passes",
            own_error=0.04,
            passes=100,
            seconds=3.0,
            check={"made_by": "path, 400 passes", "passes": 400, "seconds": 4.0, "own_error": 0.08},
            power=1.0,
        )
        dear = replace(cheap, own_error=0.16, seconds=3000.0)
        for reference, photons, others in (
            # 400 x 0.03 + 100 x 0.01 s
            (cheap, "ppm --reference-passes 400, about 13 s", "by ppm, 400 passes, about 12 s"),
            # 6400 x 0.01 + 8 x 30 s
            (
                dear,
                "path --reference-passes 6400, about 5.1 min",
                "by path, 6400 passes, about 64 s",
            ),
        ):
            (*_, todo) = advise(replace(room, reference=reference), 0.06, "r.py").details
            assert f"--reference-by {photons}" in todo
            assert f"(not checked; {others})" in todo
        # A hundredth of that error takes ten thousand times the passes, 180 hours.
        (*_, todo) = advise(replace(room, reference=dear), 0.0006, "r.py").details
        assert (
            "What to do: ask for less with --target, or pass a better picture of your own" in todo
        )

    def test_where_photons_cannot_be_sent_paths_check_paths(self):
        ground = Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5))
        found = self.study([ground], sky=SKY)
        assert found.check["made_by"].startswith("path, never asking a light")


class TestHits:
    def test_certified_hits_are_right_and_meshes_are_not(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        assert tube.rays == pytest.approx(4000, rel=0.02)
        assert all(
            p.error.median == 0.0
            for name, points in curves.items()
            if name.startswith("certified")
            for p in points
        )
        coarse, fine = curves["mesh"]
        assert coarse.error.median > fine.error.median
        assert coarse.more["triangles"] < fine.more["triangles"]
        # A chord of tolerance e lies within e of the arc, on average two thirds of it; slant adds.
        assert 0.3 * coarse.setting < coarse.more["mean_dt"] < 3.0 * coarse.setting
        assert curves["refined"][0].more["mean_dt"] < 1e-14
        assert math.isinf(curves["certified, no Embree"][0].setting)

    def test_answers_and_diagrams(self, tube):
        cost, share, mesh, newton = answers.hit_answers(tube)
        assert "us a ray" in cost
        assert f"Of {tube.judged:,} judged rays" in share
        assert "triangles^-" in mesh
        marks = [m for line in study_diagrams.hit_diagram(tube.curves, 9).lines for m in line.marks]
        n_none = sum(p.error.median == 0.0 for c in tube.curves for p in c.points)
        assert len(marks) == sum(len(curve.points) for curve in tube.curves)
        assert sum(mark.is_limit for mark in marks) == n_none
        limits = {mark.y[0] for mark in marks if mark.is_limit}
        assert limits == {100.0 * (RULE_OF_THREE / 9)}
        for table in (tables.hit_table(tube.curves), tables.newton_table(tube)):
            assert all(len(row) == len(table.head) for row in table.rows)
            words = " ".join(table.words)
            assert all(f"{word}:" in words for word in ("us a ray", "missed", "phantom", "farther"))
            assert table.words[-1] in " ".join(tables.in_text(table).split())

        assert "before the first step" in newton
        for diagram in study_diagrams.newton_diagrams(tube.newton, tube.size):
            assert [len(line.marks) for line in diagram.lines] == [6] * len(tube.newton)

    def test_newton_mends_distances_and_no_decisions(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        # Rounding may decide one ray otherwise; triangles are met in float32 here, there in float64.
        one_ray = 1.5 / tube.judged
        for stepped, mesh, refined in zip(
            tube.newton, curves["mesh"], curves["refined"], strict=True
        ):
            points = stepped.points
            assert [p.setting for p in points] == [0, 1, 2, 3, 4, 6]
            assert points[0].more["mean_dt"] == pytest.approx(mesh.more["mean_dt"], rel=1e-4)
            assert points[0].error.median == pytest.approx(mesh.error.median, abs=one_ray)
            assert points[-1].error.median == pytest.approx(refined.error.median, abs=one_ray)
            assert points[-1].more["mean_dt"] < 1e-13
            assert points[-1].more["worst_residual"] < 1e-12

    def test_size_is_the_diagonal(self):
        assert size_of([TUBE]) == pytest.approx(math.sqrt(12), rel=1e-9)


class TestDiagram:
    def mark(self, x, y, **more):
        return Mark((x, x, x), (y, y, y), **more)

    def test_words_and_marks_are_drawn(self, tmp_path):
        marks = [self.mark(10.0**k, 10.0 ** (-0.5 * k), label=f"n{k}") for k in range(5)]
        marks.append(self.mark(1e5, 1e-3, is_limit=True))
        diagram = Diagram(
            "t", "x", "y", [Line("half", marks)], ((-0.5, "noise"),), ("<floor>", 0.02), "n"
        )
        svg = as_svg(diagram)
        assert svg == as_svg(diagram)
        words = {text.text.strip() for text in ElementTree.fromstring(svg).iter() if text.text}
        assert words >= {"x", "y", "half", "noise", "<floor>", "n0", "n4"}
        save([diagram] * 3, tmp_path / "a.png")
        assert imageio.imread(tmp_path / "a.png").shape[:2] == (3 * 517, 924)

    @pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
    def test_what_has_no_logarithm_is_refused(self, value):
        with pytest.raises(ValueError, match=rf"diagram 't' has the value {value}: pass"):
            Diagram("t", "x", "y", [Line("l", [self.mark(1.0, value)])])

    def test_nothing_to_draw_is_refused(self):
        with pytest.raises(ValueError, match="has no marks"):
            Diagram("t", "x", "y", [])
