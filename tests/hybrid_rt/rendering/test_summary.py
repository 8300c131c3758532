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


class TestFurther:
    FLOOR = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
    LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 5.0)
    CAMERA = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=48, height=36)

    def report(self, **settings):
        scene = Scene(self.CAMERA, [self.FLOOR], [self.LAMP])
        return render(scene, threads=1, **settings).report

    def test_half_the_noise_takes_about_four_times_the_passes(self):
        report = self.report(passes=8)
        last = in_words(report).splitlines()[-1]
        target = float(last.split("target error ")[1])
        noise = report["relative_error"]["noise"]
        assert target == pytest.approx(noise / 2, rel=0.34)  # of one digit
        passes = int(last.split("about ")[1].split(" passes")[0])
        assert passes == math.ceil(8 * (noise / target) ** 2)

    @pytest.mark.parametrize(
        "settings", [{"time_budget": 1.0}, {"target_error": 0.5}, {"passes": 4}]
    )
    def test_whatever_ended_it(self, settings):
        assert "  further   " in in_words(self.report(**settings)).splitlines()[-1]

    def test_a_single_pass_tells_nothing(self):
        assert "further" not in in_words(self.report(passes=1))

    @pytest.mark.parametrize("name", ["target_error", "target_error_trimmed"])
    def test_the_target_that_was_asked_for_is_forecast(self, name):
        report = self.report(passes=8, **{name: 0.001})
        key = {"target_error": "both", "target_error_trimmed": "both_trimmed"}[name]
        last = in_words(report).splitlines()[-1]
        which = " without the worst 0.1 % of the pixels" if "trimmed" in name else ""
        passes = math.ceil(8 * (report["relative_error"][key] / 0.001) ** 2)
        assert last.startswith(f"  further   0.1 %{which} takes about {passes:,} passes in all, ")
        assert last.endswith(f": {name.replace('_', ' ')} 0.001")

    @pytest.mark.parametrize(
        ("blur", "stays", "power", "times"),
        [(0.04, False, 1.0, 4.0), (0.04, False, 2 / 3, 8.0), (0.02, True, 1.0, 9 / 2.25)],
    )
    def test_blur_is_forecast_by_its_own_law(self, blur, stays, power, times):
        """Noise of 3 % beside 4 % of blur is 5 %, halved; beside 2 % that stay, 1.5 % are left of 2.5."""
        noise = 0.03
        report = self.report(passes=2, target_error=0.025, target_error_trimmed=0.5)
        both = math.hypot(noise, blur)
        error = {
            "noise": noise, "blur": blur, "blur_at_most": blur, "both": both, "both_trimmed": both,
            "blur_stays": stays, "error_power": power,
        }  # fmt: skip
        report = changed(report, passes=8, relative_error=error)
        last = in_words(report).splitlines()[-1]
        assert last.startswith(f"  further   2.5 % takes about {8 * times:.0f} passes in all, ")

    def test_python_is_told_the_same(self):
        scene = Scene(self.CAMERA, [self.FLOOR], [self.LAMP])
        result = render(scene, passes=8, threads=1, target_error=0.001)
        told = result.forecast(0.001)
        last = in_words(result.report).splitlines()[-1]
        assert f" takes about {told.passes:,} passes in all, {duration(told.seconds)}: " in last
        trimmed = result.forecast(0.001, trimmed=True)
        assert trimmed.passes == math.ceil(8 * (result.error_trimmed / 0.001) ** 2)
        assert result.forecast(2 * result.error).passes == 2
        assert render(scene, passes=1, threads=1).forecast(0.1) is None
        with pytest.raises(ValueError, match="error is 0"):
            result.forecast(0)

    def test_nothing_is_forecast_that_never_comes(self):
        report = self.report(passes=8, target_error=0.01)
        blur = {"blur": 0.02, "blur_at_most": 0.02, "blur_stays": True}
        report = changed(report, relative_error=blur)
        assert "further" not in in_words(report)
        unknown = {"both": None, "both_trimmed": None, "blur_at_most": None}
        report = changed(report, relative_error=unknown)
        assert "further" not in in_words(report)

    @pytest.mark.parametrize("settings", [{}, {"target_error_trimmed": 0.9}])
    def test_a_figure_that_will_rise_is_not_forecast(self, settings):
        noise = {
            "worst_pixels_share_of_squared_error": 0.99, "relative_rmse_trimmed": 0.15,
            "relative_rmse_trimmed_ahead": 0.95,
        }  # fmt: skip
        error = {"both": 2.5, "both_trimmed": 0.15, "both_trimmed_ahead": 0.95}
        rendered = self.report(passes=8)
        report = changed(rendered, settings=settings, noise=noise, relative_error=error)
        words = in_words(report)
        assert words.splitlines()[-1].startswith("  further   100 % takes about 50 passes in all, ")
        assert "outnumber 0.1 %, and it will rise to 95 % or so" in words
        assert "trust the second" not in words
        assert ("0.9 does not count as reached" in words) == bool(settings)

    def test_dots_that_become_more_are_forecast(self):
        """A squared error that falls to 2^-0.5 with twice the passes takes 2^4 for a quarter, not 2^2."""
        report = self.report(passes=8, target_error_trimmed=0.05)
        noise = {"worst_pixels_share_of_squared_error": 0.95, "relative_rmse": 0.4}
        error = {"both": 0.4}
        for key, value in (("", 0.1), ("_ahead", 0.1 * 2.0**-0.25)):
            noise[f"relative_rmse_trimmed{key}"] = value
            error[f"both_trimmed{key}"] = value
        report = changed(report, noise=noise, relative_error=error)
        assert " takes about 128 passes in all, " in in_words(report).splitlines()[-1]

    def test_what_is_done_once_is_not_forecast_for_every_pass(self):
        """0.5 s once, and 4 times 1.5 s for 4 times as many passes."""
        report = self.report(passes=8, target_error=0.001)
        report = changed(report, relative_error={"both": 0.002, "both_trimmed": 0.002})
        for once in ({"build": 0.25, "set-up": 0.25}, {"cluster": 0.25, "channels": 0.25}):
            report = replace(report, seconds={**once, "paths": 1.0, "total": 2.0})
            assert " about 32 passes in all, 6.5 s: " in in_words(report).splitlines()[-1]

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
    def test_long_times_are_in_hours(self, seconds, words):
        assert duration(seconds) == words

    def test_a_few_bright_pixels_are_not_trusted(self):
        report = self.report(passes=8)
        assert "rough" not in in_words(report)
        report = changed(report, noise={"worst_pixels_share_of_squared_error": 0.6})
        assert "the first figure that it is rough; trust the second, but not" in in_words(report)
        assert "without the worst" in in_words(report).splitlines()[-1]


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
