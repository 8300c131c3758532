"""A result in a notebook: the picture of a .png file, and the report of the command line."""

import base64
import html
import io
import math
import re
from dataclasses import replace

import imageio.v3 as imageio
import numpy as np
import pytest

import hybrid_rt as rt
from helpers.reports import changed
from hybrid_rt.core.one_line import WIDEST
from hybrid_rt.rendering import display
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.rendering.units import per_cent

NAME = "<b>\"ball\" & 'co'</b>"


@pytest.fixture(scope="module")
def result():
    camera = rt.Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=16, height=12)
    objects = [rt.Object(rt.Sphere((0, 0, 0), 1), rt.Lambertian(0.5), NAME)]
    scene = rt.Scene(camera, objects, environment=rt.GradientSky(0, 2))
    return rt.render(scene, passes=2, threads=1)


def text_of(page):
    return html.unescape(re.sub(r"<[^>]*>", " ", page.replace("<br>", "\n")))


def test_one_line_has_size_error_and_seconds(result):
    error = per_cent(result.report["relative_error"]["both"])
    seconds = f"{result.report['seconds']['total']:.3g} s"
    assert repr(result) == f"RenderResult(16 x 12, path, 2 passes, {seconds}, error {error})"


def test_errors_and_the_mean_with_its_interval_are_those_of_the_report(result):
    errors, noise = result.report["relative_error"], result.report["noise"]
    assert (result.error, result.error_trimmed) == (errors["both"], errors["both_trimmed"])
    # The picture is rounded to float32.
    assert result.mean == pytest.approx(noise["image_mean"], rel=1e-7)
    assert result.mean_half_interval == noise["half_interval_95_of_image_mean"]
    single = rt.RenderResult(result.image, replace(result.report, noise=None))
    assert single.mean == result.mean
    assert math.isnan(single.mean_half_interval)


@pytest.mark.parametrize("error", [None, {"both": None}, {"both": float("nan")}])
def test_an_error_that_is_unknown_is_said_to_be(result, error):
    again = rt.RenderResult(result.image, changed(result.report, relative_error=error))
    assert repr(again).endswith(" s, error unknown)")


@pytest.mark.parametrize(
    ("noise", "words"),
    [
        (
            {
                "worst_pixels": 1,
                "worst_pixels_share_of_squared_error": 0.9,
                "relative_rmse_trimmed": 0.02,
            },
            "few pixels decide it: noise 2 % without the worst 0.1 %",
        ),
        ({"pixels_dark": 192}, "relative to 0.1 where pixels are darker, as most are"),
        ({"unmet_lamps_95": 9.0}, "without lamps seen in glass or metal that were not met yet"),
    ],
)
def test_what_is_to_be_known_of_an_error_stands_beside_it(result, noise, words):
    again = rt.RenderResult(result.image, changed(result.report, noise=noise))
    assert repr(again).endswith(f" % ({words}))")
    assert "(" + words not in repr(result)


def test_a_part_of_the_light_is_named_beside_its_error(result):
    holds = "the light that whitted finds in up to 16 bounces"
    again = rt.RenderResult(result.image, replace(result.report, picture_holds=holds))
    assert "% of the light that whitted finds" in repr(again)
    assert len(repr(again)) <= WIDEST


def test_the_picture_is_that_of_the_file(result, tmp_path):
    result.save(tmp_path / "a.png")
    shown = imageio.imread(io.BytesIO(result._repr_png_()))
    np.testing.assert_array_equal(shown, imageio.imread(tmp_path / "a.png"))
    (data,) = re.findall(r"base64,([^\"]+)\"", result._repr_html_())
    assert base64.b64decode(data) == result._repr_png_()


def test_the_page_says_what_the_command_line_says(result):
    said = " ".join(text_of(result._repr_html_()).split())
    assert repr(result) in said
    for line in in_words(result.report).splitlines():
        assert " ".join(line.split()) in said


def test_names_are_text_and_colors_those_of_the_page(result):
    """A name that looks like a tag is one of the report's words, no part of the page."""
    lost = replace(result.report, clear_bodies_not_closed={NAME: 7})
    again = rt.RenderResult(result.image, lost)
    page = again._repr_html_()
    assert NAME not in page
    assert html.escape(repr(NAME)) in page
    assert "WARNING" in page
    assert not re.search(r"(?<![-\w])(color|background)\s*:\s*(?!inherit|none)", page)


@pytest.mark.parametrize(
    ("width", "shown"), [(1, 320), (16, 320), (300, 600), (320, 320), (960, 960), (1601, 960)]
)
def test_pictures_get_a_sensible_width(result, width, shown):
    page = rt.RenderResult(np.zeros((2, width, 3), np.float32), result.report)._repr_html_()
    assert f'width="{shown}"' in page
    assert ("pixelated" in page) == (width < 320)
    assert "max-width:100%" in page


def test_large_pictures_are_sent_as_means():
    """Each pixel of the copy is the mean of its square; at the edges of what there is."""
    assert display.MOST_PIXELS == 1600
    image = np.random.default_rng(3).uniform(size=(3, 3201, 3))
    small = display.reduced(image)
    assert small.shape == (1, 1067, 3)
    np.testing.assert_allclose(small[0, 0], image[:, :3].mean(axis=(0, 1)), rtol=1e-14)
    np.testing.assert_allclose(small[0, -1], image[:, 3198:].mean(axis=(0, 1)), rtol=1e-14)
    assert display.reduced(image[:, :1600]).shape == (3, 1600, 3)


def test_pixels_that_are_not_finite_do_not_hide_the_others(result):
    image = np.full((1, 2, 3), 0.5, np.float32)
    image[0, 0] = np.nan, np.inf, -1.0
    again = rt.RenderResult(image, result.report)
    assert imageio.imread(io.BytesIO(again._repr_png_())).tolist() == [[[0, 255, 0], [188] * 3]]
    assert repr(again).startswith("RenderResult(2 x 1, path, ")
