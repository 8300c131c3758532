import math
from dataclasses import replace

import pytest
import trimesh

from helpers.reports import changed
from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    GradientSky,
    Lambertian,
    Mirror,
    Object,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    SphereLight,
    SpotLight,
    TriangleMesh,
    render,
)
from hybrid_rt.rendering.forecast import further
from hybrid_rt.rendering.report import EndedBranches
from hybrid_rt.rendering.report_warnings import warnings_in_words
from hybrid_rt.rendering.summary import _cut_off, in_words
from hybrid_rt.rendering.units import duration, per_cent


def test_weight_that_was_lost_is_the_depths_unless_branches_were_faint():
    """Integrators from elsewhere may say how much is lost, and not how many paths lost it."""
    camera = Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40, 2, 2)
    report = render(Scene(camera, [], [], GradientSky(1, 1)), passes=1, threads=1).report

    def ending(lost_share, **by_reason):
        ended = EndedBranches(
            by_reason=by_reason, lost_weight_per_camera_ray=0.0, lost_share=lost_share
        )
        return replace(report, ended_branches=ended)

    faint, deep = {"below least contribution": 7}, {"at max_depth": 1}
    assert ending(0.02).depth_cuts_off
    assert not ending(0.02, **faint).depth_cuts_off
    assert ending(0.02, **faint, **deep).depth_cuts_off
    assert not ending(0.0).depth_cuts_off
    (line,) = _cut_off(ending(0.02))
    assert line.startswith("  cut off   paths at max_depth 16, with 2 % of")


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (0.0, "0 %"),
        (0.00123, "0.12 %"),
        (0.994, "99 %"),
        (123.4, "12,000 %"),
        (1e9, "1e+11 %"),
    ],
)
def test_two_digits_of_a_share(share, text):
    assert per_cent(share) == text


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_black_picture_is_a_warning(integrator):
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
    # Of a mesh it is not known whether it is closed.
    ball = TriangleMesh(trimesh.creation.icosphere().apply_scale(0.5).apply_translation((0, 0, 1)))
    shade = Object(ball, Lambertian(0.5))
    camera = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=8, height=6)
    inside, above = PointLight((0, 0, 1), 50), PointLight((0, 0, 3), 50)
    dark = render(Scene(camera, [floor, shade], [inside]), integrator, passes=2, threads=1).report
    assert "WARNING   the picture is black: no light arrives" in in_words(dark)
    lit = render(Scene(camera, [floor, shade], [inside, above]), integrator, passes=2, threads=1)
    assert not warnings_in_words(lit.report)


def test_a_bright_spot_in_a_dark_picture_does_not_hide_its_noise():
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
    camera = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=16, height=12)
    for radiance, is_dark in ((0.5, True), (500.0, False)):
        lamp = SphereLight((0, 0, 1), 0.3, radiance)
        report = render(Scene(camera, [floor], [lamp]), passes=4, threads=1).report
        noise = report["noise"]
        share = noise["pixels_dark"] / (16 * 12 - noise["pixels_without_light"])
        assert (share > 0.5) is is_dark
        words = f"{per_cent(share)} of the pixels with light are darker than 0.1, and their errors count"
        assert (words in in_words(report)) is is_dark


@pytest.mark.parametrize(("integrator", "share"), [("path", "100 %"), ("whitted", "80 %")])
def test_a_picture_that_max_depth_blackens_says_so(integrator, share):
    """The mirror reflects 0.8 of the sky, which is all that the camera would see."""
    mirror = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Mirror(0.8))
    camera = Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40, 8, 8)
    scene = Scene(camera, [mirror], [], GradientSky(1, 1))
    report = render(scene, integrator, passes=2, max_depth=0, threads=1).report
    (words,) = warnings_in_words(report)
    assert words.startswith(
        f"the picture is black: no light arrives. Pass max_depth 16: 0 cut off {share} of the "
        "light that was followed. Else look for lamps inside"
    )
    assert not warnings_in_words(render(scene, integrator, passes=2, max_depth=1, threads=1).report)


class TestTargetWithoutLamps:
    """A mirror ball shows a small lamp, which one camera ray in 300 finds; the floor is smooth.

    A ray that finds it adds a fortieth of the picture's mean, times the passes.
    """

    FLOOR = Object(Rectangle((-8, -8, 0), (16, 0, 0), (0, 16, 0)), Lambertian(0.6))
    LAMP = SphereLight((1.5, 1.5, 4), 0.1, 240)
    CAMERA = Camera((0, -4, 2.5), (0, 0, 0.3), (0, 0, 1), 45, 16, 16)

    def report(self, material, **settings):
        ball = Object(Sphere((0, 0, 0.601), 0.6), material)
        scene = Scene(self.CAMERA, [self.FLOOR, ball], [self.LAMP])
        return render(scene, threads=1, **settings).report

    @pytest.mark.parametrize("integrator", ["whitted", "path"])
    def test_a_target_reached_before_the_lamp_is_met_is_a_warning(self, integrator):
        report = self.report(Mirror(), integrator=integrator, target_error=0.02)
        assert report["stopped_by"] == "target_error"
        (words,) = (w for w in warnings_in_words(report) if w.startswith("the target error"))
        assert f"add up to {report['noise']['unmet_lamps_95']:.2g} to the image mean" in words
        assert f"WARNING   {words}" in in_words(report)
        assert ("(integrator path" in words) == (integrator != "path")
        passes = int(words.split("but about ")[1].split(" passes")[0].replace(",", ""))
        longer = self.report(Mirror(), passes=passes)
        mean = report["noise"]["image_mean"]
        half = longer["noise"]["half_interval_95_of_image_mean"]
        assert longer["noise"]["image_mean"] - mean > max(0.02 * mean, half)

    def test_nothing_is_said_once_it_is_met_or_without_a_mirror(self):
        assert not warnings_in_words(self.report(Mirror(), target_error=0.01))
        assert not warnings_in_words(self.report(Lambertian(0.5), target_error=0.02))

    def test_most_of_the_light_may_be_that_of_a_lamp_behind_glass(self):
        """A lamp far away, which no light path of the pilot and no camera ray finds through two panes."""
        panes = [Object(Box((-9, -9, z), (9, 9, z + 0.1)), Dielectric(1.5)) for z in (5, 6)]
        sun = SphereLight((0, 300, 1000), 5.0, 4e4)
        view = Scene(self.CAMERA, [self.FLOOR, *panes], [sun], GradientSky(0.2, 0.2))
        report = render(view, threads=1, passes=16).report
        lacks, words = warnings_in_words(report)
        assert lacks.startswith("the part of the picture in row 4")
        assert words.startswith("lamps, or a sun in the sky, that camera rays meet by chance alone")
        assert words.endswith("take ppm, which sends photons from there")
        photons = render(view, "ppm", threads=1, passes=16, options=PPMOptions(20_000)).report
        assert photons["noise"]["image_mean"] > 2.0 * report["noise"]["image_mean"]

    def test_a_target_that_was_not_reached_claims_nothing(self):
        assert not warnings_in_words(self.report(Mirror(), passes=8, target_error=1e-3))


@pytest.mark.parametrize(("radiance", "is_far"), [(1e-4, True), (1.0, False), (1e7, True)])
def test_a_unit_far_from_one_is_said(radiance, is_far):
    """Relative errors count radiances below 0.1 as 0.1."""
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.5))
    lamp = RectangleLight((-0.5, -0.5, 1), (0, 1, 0), (1, 0, 0), radiance)
    camera = Camera((0, 0, 0.9), (0, 0, 0), (0, 1, 0), 40, 8, 8)
    text = in_words(render(Scene(camera, [floor], [lamp]), passes=2).report)
    assert ("scale the lamps, or read its standard errors" in text) == is_far


# Noise of 3 % beside 4 % of blur is 5 %; beside 2 % that stay, 1.5 % of noise are left of 2.5.
BLURRED = {"noise": 0.03, "blur": 0.04, "blur_at_most": 0.04, "both": 0.05, "both_trimmed": 0.05}
STAYS = {
    **BLURRED,
    "blur": 0.02,
    "blur_at_most": 0.02,
    "blur_stays": True,
    "both": math.sqrt(13e-4),
}
FEW = {"worst_pixels_share_of_squared_error": 0.95}
RISES = {**FEW, "relative_rmse_trimmed": 0.15, "relative_rmse_trimmed_ahead": 0.95}
WILL_RISE = {"both": 2.5, "both_trimmed": 0.15, "both_trimmed_ahead": 0.95}


@pytest.fixture(scope="module")
def result():
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
    lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 5.0)
    camera = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=48, height=36)
    result = render(Scene(camera, [floor], [lamp]), passes=8, threads=1)
    once = {"build": 0.125, "set-up": 0.125, "cluster": 0.125, "channels": 0.125}
    timed = replace(result.report, seconds={**once, "paths": 1.0, "total": 2.0})
    return replace(result, report=timed)


class TestFurther:
    """Of 8 passes in 2 s, of which half a second is spent once."""

    @pytest.mark.parametrize(
        ("targets", "error", "noise", "passes", "trimmed"),
        [
            ({}, {"both": 0.06}, {}, 32, False),  # half of the error there is
            ({"target_error": 0.01}, {"both": 0.02}, {}, 32, False),
            ({"target_error_trimmed": 0.01}, {"both": 0.08, "both_trimmed": 0.02}, {}, 32, True),
            ({"target_error": 0.025}, BLURRED, {}, 32, False),
            ({"target_error": 0.025}, {**BLURRED, "error_power": 2 / 3}, {}, 64, False),
            ({"target_error": 0.025}, STAYS, {}, 32, False),
            # Without the worst it falls to 2^-0.5 with twice the passes: 2^4 for a quarter, not 2^2.
            ({"target_error_trimmed": 0.05},
             {"both": 0.4, "both_trimmed": 0.1, "both_trimmed_ahead": 0.1 * 2.0**-0.25}, FEW, 128, True),
            # Few pixels decide: the other figure is to be trusted, unless it will rise.
            ({}, {"both": 0.4, "both_trimmed": 0.08, "both_trimmed_ahead": 0.05}, FEW, 32, True),
            ({}, WILL_RISE, RISES, 50, False),
            ({"target_error_trimmed": 0.9}, WILL_RISE, RISES, 50, False),
            # It never comes, or nothing is known.
            ({"target_error": 0.015}, STAYS, {}, None, False),
            ({}, {"both": None, "both_trimmed": None, "blur_at_most": None}, {}, None, False),
        ],
    )  # fmt: skip
    def test_passes_and_seconds_follow_from_the_law_of_the_error(
        self, result, targets, error, noise, passes, trimmed
    ):
        report = changed(result.report, settings=targets, relative_error=error, noise=noise)
        found = further(report)
        if passes is None:
            assert found is None
            assert "further" not in in_words(report)
            return
        assert (found.passes, found.option) == (passes, f"target_error{'_trimmed' * trimmed}")
        assert found.seconds == pytest.approx(0.5 + 1.5 * passes / 8)
        which = " without the worst 0.1 % of the pixels" * trimmed
        told = f"{per_cent(found.target)}{which} takes about {passes} passes in all, "
        last = in_words(report).splitlines()[-1]
        assert last.startswith(f"  further   {told}{duration(found.seconds)}: ")

    def test_python_is_told_the_same(self, result):
        told = result.forecast(0.001)
        assert told == further(changed(result.report, settings={"target_error": 0.001}))
        trimmed = result.forecast(0.001, trimmed=True)
        assert trimmed.passes == math.ceil(8 * (result.error_trimmed / 0.001) ** 2)
        assert result.forecast(2 * result.error).passes == 2
        with pytest.raises(ValueError, match="error is 0"):
            result.forecast(0)

    def test_a_single_pass_tells_nothing(self, result):
        single = replace(result, report=replace(result.report, noise=None, relative_error=None))
        assert single.forecast(0.1) is None
        assert "further" not in in_words(single.report)

    def test_figures_that_few_pixels_decide_are_not_trusted(self, result):
        assert "rough" not in in_words(result.report)
        words = in_words(changed(result.report, noise=FEW))
        assert "the first figure that it is rough; trust the second, but not" in words
        rises = {"settings": {"target_error_trimmed": 0.9}, "noise": RISES}
        words = in_words(changed(result.report, relative_error=WILL_RISE, **rises))
        assert "outnumber 0.1 %, and it will rise to 95 % or so" in words
        assert "trust the second" not in words
        assert "0.9 does not count as reached" in words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (9.64, "9.6 s"),
        (99.7, "100 s"),
        (125.0, "2 min"),
        (3595.0, "1 h 0 min"),
        (1e7, "2,777 h 47 min"),
    ],
)
def test_long_times_are_in_hours(seconds, words):
    assert duration(seconds) == words


@pytest.mark.parametrize(("integrator", "max_depth", "is_said"), [
    ("path", 16, True), ("path", 15, False), ("path", 400, False), ("ppm", 16, True),
])  # fmt: skip
def test_much_light_that_max_depth_cuts_off_is_a_warning(integrator, max_depth, is_said):
    """In a room that reflects 0.9 a part of 0.9^17, or 0.17, is left after 17 directions.

    Nothing is said where less than the default was asked for, or where 0.9^401 is left.
    """
    room = Object(Sphere((0, 0, 0), 1).flipped(), Lambertian(0.9), "room")
    lamp = RectangleLight((-0.1, -0.1, 0.5), (0, 0.2, 0), (0.2, 0, 0), 1.0)
    camera = Camera((0, 0, 0), (1, 0, 0), (0, 0, 1), 90, 8, 8)
    report = render(
        Scene(camera, [room], [lamp]),
        integrator,
        passes=2,
        max_depth=max_depth,
        options=PPMOptions(photons_per_pass=2000) if integrator == "ppm" else None,
    ).report
    words = f"max_depth {max_depth} cut off "
    lines = [line for line in warnings_in_words(report) if line.startswith(words)]
    assert len(lines) == is_said
    assert all(f"pass max_depth {2 * max_depth} or more" in line for line in lines)


@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_much_light_that_is_not_found_is_a_warning(integrator):
    """A lens of glass throws all light of a point onto a floor that nothing else lights."""
    floor = Object(Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), Lambertian(0.5), "floor")
    ball = Object(Sphere((0, 0, 2), 0.5), Dielectric(1.5), "ball")
    camera = Camera((0, 0, 1), (0, 0, 0), (0, 1, 0), 40, 16, 16)
    lamp = SpotLight((0, 0, 4), (0, 0, -1), 20.0, 12.0, 2.0)
    dark = render(Scene(camera, [floor, ball], [lamp]), integrator, passes=2, threads=1)
    (words,) = warnings_in_words(dark.report)
    assert words.startswith(f"{integrator} does not find light")
    assert words.endswith("(95 %), which no error estimate counts: take ppm")
    # More light comes straight: path lacks a part of it, which is usual for whitted.
    beside = SpotLight((1.5, 0, 4), (-1.5, 0, -4), 100.0, 12.0, 2.0)
    half = render(Scene(camera, [floor, ball], [lamp, beside]), integrator, passes=2, threads=1)
    words = warnings_in_words(half.report)
    assert len(words) == (integrator == "path")
    assert all("of what it finds, which no error" in line for line in words)


def test_a_mean_that_photons_blur_is_a_warning():
    """A ball throws light to a focus narrower than the discs, which the camera sees through it, enlarged.

    By rays and Fresnel's formulas the mean is 0.0380.
    """
    floor = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.5), "floor")
    ball = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5), "ball")
    camera = Camera((0, 0, 8), (0, 0, 0), (0, 1, 0), 50, 48, 48)
    lamp = SpotLight((0, 0, 2), (0, 0, -1), 3.0, 40.0, 15.0)
    few = PPMOptions(photons_per_pass=50_000)
    blurred = render(Scene(camera, [floor, ball], [lamp]), "ppm", passes=8, options=few).report
    (words,) = [line for line in warnings_in_words(blurred) if line.startswith("discs of photons")]
    assert "% too dark" in words
    assert blurred["noise"]["image_mean"] < 0.036
    without = render(Scene(camera, [floor], [lamp]), "ppm", passes=8, options=few).report
    assert not warnings_in_words(without)
