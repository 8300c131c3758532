"""What passes do not remove, and what proves it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from hybrid_rt.analysis import answers
from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.bias import least_by_mean, least_by_tiles, shared_error
from hybrid_rt.analysis.curves import Spread
from hybrid_rt.analysis.method_forecast import forecast
from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.work_precision import study_picture
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.lights import PointLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera


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
