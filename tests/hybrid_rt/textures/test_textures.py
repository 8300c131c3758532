import math

import imageio.v3 as imageio
import numpy as np
import pytest
from PIL import Image

from hybrid_rt import Emissive, Lambertian
from hybrid_rt.sensor.color import srgb_to_linear
from hybrid_rt.shading.kernels.texture import texture_color
from hybrid_rt.textures import CheckerTexture, ImageTexture
from hybrid_rt.textures.table import compile_textures

PICTURE = np.random.default_rng(3).uniform(size=(3, 4, 3))


def look_up(texture, u, v, position=(0.0, 0.0, 0.0)):
    # A second texture before it: the row must be found.
    table = compile_textures([ImageTexture(np.ones((2, 2, 3))), texture])
    return np.array(texture_color(table, 1, u, v, *position))


def bilinear(picture, u, v, wrap):
    """The same by its definition: u right, v up, samples at pixel centres."""
    height, width = picture.shape[:2]
    x, y = u * width - 0.5, (1 - v) * height - 0.5
    total = np.zeros(3)
    for row in (np.floor(y), np.floor(y) + 1):
        for column in (np.floor(x), np.floor(x) + 1):
            weight = (1 - abs(x - column)) * (1 - abs(y - row))
            if wrap == "repeat":
                total += weight * picture[int(row) % height, int(column) % width]
            else:
                r, c = np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)
                total += weight * picture[int(r), int(c)]
    return total


@pytest.mark.parametrize("wrap", ["repeat", "clamp"])
def test_images_are_filtered_between_pixel_centres(wrap):
    texture = ImageTexture(PICTURE, wrap)
    for u, v in np.random.default_rng(1).uniform(0, 1, (100, 2)):
        expected = bilinear(PICTURE.astype(np.float32), u, v, wrap)
        np.testing.assert_allclose(look_up(texture, u, v), expected, rtol=1e-6)


def test_first_row_is_at_the_top_and_u_runs_right():
    texture = ImageTexture(PICTURE, "clamp")
    np.testing.assert_allclose(look_up(texture, 0, 1), PICTURE[0, 0], rtol=1e-6)
    np.testing.assert_allclose(look_up(texture, 1, 0), PICTURE[-1, -1], rtol=1e-6)


@pytest.mark.parametrize("shift", [-1, 1, 1e9])
def test_repeating_images_have_period_one(shift):
    texture = ImageTexture(PICTURE)
    near = look_up(texture, 0.625, 0.25)
    np.testing.assert_allclose(look_up(texture, 0.625 + shift, 0.25 - shift), near, atol=1e-6)


def test_one_pixel_is_a_constant():
    assert (look_up(ImageTexture(np.full((1, 1, 3), 0.25)), 0.3, 1.0) == 0.25).all()


def test_eight_and_sixteen_bits_grey_and_alpha(tmp_path):
    eight = np.arange(0, 240, 10, dtype=np.uint8).reshape(2, 4, 3)
    for picture, top in ((eight, 255), (eight.astype(np.uint16) * 257, 65535)):
        brightest = srgb_to_linear(picture.max(axis=(0, 1)) / top)
        np.testing.assert_allclose(ImageTexture(picture).brightest, brightest, rtol=1e-6)
    imageio.imwrite(tmp_path / "a.png", np.dstack([eight, eight[:, :, :1]]))
    np.testing.assert_array_equal(
        ImageTexture(tmp_path / "a.png").brightest, ImageTexture(eight).brightest
    )
    assert ImageTexture(eight[:, :, 0]).brightest.shape == (3,)


def test_inks_and_grey_with_alpha_are_no_colours(tmp_path):
    Image.new("CMYK", (4, 4), (200, 200, 200, 200)).save(tmp_path / "inks.jpg", quality=100)
    # A fifth of the paper shows between the colours, and of that a fifth between the black.
    np.testing.assert_allclose(
        ImageTexture(tmp_path / "inks.jpg").brightest, srgb_to_linear((55 / 255) ** 2), rtol=0.1
    )
    Image.new("LA", (4, 4), (100, 7)).save(tmp_path / "grey.png")
    np.testing.assert_allclose(
        ImageTexture(tmp_path / "grey.png").brightest, srgb_to_linear(100 / 255), rtol=1e-6
    )
    swapped = ImageTexture(np.full((2, 2), 1000, dtype=">u2"))
    np.testing.assert_allclose(swapped.brightest, srgb_to_linear(1000 / 65535), rtol=1e-6)


def test_grey_of_one_channel_and_of_two():
    grey = np.arange(6, dtype=np.uint8).reshape(2, 3, 1) * 40
    for picture in (grey, np.dstack([grey, 255 - grey]), grey[:, :, 0]):
        expected = srgb_to_linear(grey / 255.0).repeat(3, axis=2)
        np.testing.assert_allclose(ImageTexture(picture).texels, expected, rtol=1e-6)


@pytest.mark.parametrize("mode", ["P", "L", "RGB"])
def test_gif_of_one_picture_is_one_and_of_several_is_refused(tmp_path, mode):
    grey = np.array([[0, 255, 255, 0], [255, 0, 0, 255], [0, 0, 255, 0]], dtype=np.uint8)
    picture = Image.fromarray(grey)
    picture.convert(mode).save(tmp_path / "one.gif")
    expected = (grey / 255.0)[:, :, None].repeat(3, axis=2)
    np.testing.assert_array_equal(ImageTexture(tmp_path / "one.gif").texels, expected)
    more = [Image.fromarray(255 - grey)]
    picture.save(tmp_path / "two.gif", save_all=True, append_images=more)
    with pytest.raises(ValueError, match=r"two.gif', of several pictures: pass one of them"):
        ImageTexture(tmp_path / "two.gif")


@pytest.mark.parametrize(
    ("name", "values"),
    [("#ff0000", "(1, 0, 0)"), ("#808080", "(0.2159, 0.2159, 0.2159)"), ("lime", "(0, 1, 0)")],
)
def test_names_of_colours_are_answered_with_their_linear_values(name, values):
    for make in (Lambertian, Emissive):
        with pytest.raises(TypeError) as caught:
            make(name)
        assert f"pass three numbers, linear; of this colour {values}" in str(caught.value)
    with pytest.raises(TypeError, match="ImageTexture"):
        Lambertian("red.png")


def test_arrays_are_copied():
    image = np.ones((2, 2, 3), dtype=np.float32)
    texture = ImageTexture(image)
    image[:] = np.nan
    assert (texture.brightest == 1.0).all()


def test_pictures_of_one_bit_are_black_and_white(tmp_path):
    bits = np.random.default_rng(4).random((4, 8)) < 0.5
    Image.fromarray(bits).save(tmp_path / "bits.png")
    assert imageio.imread(tmp_path / "bits.png").dtype == np.bool_
    for texture in (ImageTexture(bits), ImageTexture(tmp_path / "bits.png")):
        assert (texture.texels == bits[:, :, None]).all()


def test_uv_checker_counts_squares():
    texture = CheckerTexture(0.9, (0.1, 0.2, 0.3), (4, 2), "uv")
    for u, v in (
        (0.1, 0.1), (0.3, 0.6), (0.9, 0.7), (1.0, 0.0), (0.25, 0.5), (1.0, 1.0), (-0.25, 0.1),
        (-1e-300, 0.1), (1e9 + 0.25, -1e9), (1e300, 1e300),
    ):  # fmt: skip
        even = (math.floor(u * 4) + math.floor(v * 2)) % 2 == 0
        assert look_up(texture, u, v)[0] == (0.9 if even else 0.1)


def test_world_checker_is_the_sign_of_three_sines():
    texture = CheckerTexture(0.9, 0.1, 6.0)
    for position in np.random.default_rng(1).uniform(-3, 3, (50, 3)):
        even = np.sin(6 * position).prod() >= 0
        assert look_up(texture, 0, 0, position)[0] == (0.9 if even else 0.1)


def test_world_checker_on_a_plane_through_the_origin_is_a_board():
    """The third sine is 0 there, at any frequency; with a frequency of 0 it is so everywhere."""
    for z, scale in ((0.0, 6.0), (-1.3, (6.0, 6.0, 0.0))):
        texture = CheckerTexture(0.9, 0.1, scale)
        for x, y in np.random.default_rng(2).uniform(-3, 3, (50, 2)):
            even = np.sin(6 * x) * np.sin(6 * y) >= 0
            assert look_up(texture, 0, 0, (x, y, z))[0] == (0.9 if even else 0.1)


@pytest.mark.parametrize("channels", ["RGB", "Y"])
def test_radiance_of_an_exr_file_is_taken_as_it_is(tmp_path, channels):
    openexr = pytest.importorskip("OpenEXR")
    planes = {name: np.float32([[0.25, 400.0], [k, 1.5]]) for k, name in enumerate(channels)}
    written = dict(planes)  # OpenEXR puts its own channels into it
    with openexr.File({"type": openexr.scanlineimage}, written) as file:
        file.write(str(tmp_path / "sky.exr"))
    texels = ImageTexture(tmp_path / "sky.exr").texels
    expected = [planes[name] for name in (channels * 3)[:3]]
    np.testing.assert_array_equal(texels, np.stack(expected, axis=2))


def test_half_precision_is_taken_as_it_is():
    bright = np.full((2, 2, 3), 6e4, dtype=np.float16)
    assert ImageTexture(bright).brightest.tolist() == bright[0, 0].tolist()


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: ImageTexture("missing.png"), FileNotFoundError, r"missing\.png"),
        (lambda: ImageTexture(np.full((2, 2, 3), np.nan)), ValueError, "non-finite"),
        (lambda: ImageTexture(-np.ones((2, 2, 3))), ValueError, "negative"),
        (lambda: ImageTexture(np.ones((2, 2, 5))), ValueError, "shape"),
        (lambda: ImageTexture(np.ones((2, 2, 3), dtype=np.int64)), TypeError, "int64"),
        (lambda: ImageTexture(PICTURE, "mirror"), ValueError, "wrap"),
        (lambda: CheckerTexture(1, 0, (0, 0, 0)), ValueError, "scale is 0"),
        (lambda: CheckerTexture(1, 0, (1, 2, 3), "uv"), ValueError, "scale"),
        (lambda: CheckerTexture(-1, 0), ValueError, "even"),
    ],
)
def test_impossible_textures_are_refused(make, error, words):
    with pytest.raises(error, match=words):
        make()
