import contextlib
import json
import resource

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.sensor import image_files
from hybrid_rt.sensor.color import linear_to_srgb, srgb_to_linear
from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.image_files import check_output, save_image
from hybrid_rt.sensor.image_metrics import picture_errors
from hybrid_rt.sensor.passes import group_of, pass_of
from meshing import outputs

IMAGE = np.random.default_rng(4).uniform(0, 1.2, (5, 7, 3)).astype(np.float32)


def test_transfer_function_is_the_standards():
    values = linear_to_srgb([0, 0.002, 0.5, 1, 7, -1])
    np.testing.assert_allclose(values, [0, 0.02584, 0.735356983, 1, 1, 0], atol=1e-9)
    x = np.linspace(0, 1, 256)
    # The standard's two pieces meet to within 1e-7 of each other, no better.
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(x)), x, atol=1e-7)


def test_png_holds_the_encoded_picture_and_the_sidecar_the_report(tmp_path):
    sidecar = save_image(tmp_path / "a.png", IMAGE, {"seed": 3})
    expected = np.rint(linear_to_srgb(IMAGE) * 255)
    np.testing.assert_array_equal(imageio.imread(tmp_path / "a.png"), expected)
    assert json.loads(sidecar.read_text()) == {"seed": 3}
    assert sidecar == tmp_path / "a.json"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.json", "a.png"]


def test_npz_holds_the_picture_bit_for_bit(tmp_path):
    save_image(tmp_path / "a.npz", IMAGE, {"seed": 3})
    with np.load(tmp_path / "a.npz") as data:
        np.testing.assert_array_equal(data["image"], IMAGE)
        assert data["image"].dtype == np.float32
        assert json.loads(str(data["report"])) == {"seed": 3}


def test_exr_holds_named_channels_bit_for_bit(tmp_path):
    OpenEXR = pytest.importorskip("OpenEXR")
    depth = np.where(IMAGE[:, :, 0] > 0.5, np.inf, IMAGE[:, :, 0]).astype(np.float32)
    channels = {"depth": depth, "normal": -IMAGE, "albedo": IMAGE}
    save_image(tmp_path / "a.exr", IMAGE, {"seed": 3}, channels, parts={"normal": "XYZ"})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        planes = {name: channel.pixels for name, channel in file.channels().items()}
        assert json.loads(file.header()["hybrid_rt"]) == {"seed": 3}
    assert {plane.dtype for plane in planes.values()} == {np.dtype(np.float32)}
    assert set(planes) == {
        *"RGB", "depth", *(f"normal.{x}" for x in "XYZ"), *(f"albedo.{x}" for x in "RGB"),
    }  # fmt: skip
    np.testing.assert_array_equal(np.stack([planes[c] for c in "RGB"], axis=2), IMAGE)
    np.testing.assert_array_equal(planes["depth"], depth)
    np.testing.assert_array_equal(planes["normal.Y"], -IMAGE[:, :, 1])
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.exr", "a.exr.json"]


def test_exr_without_its_package_is_refused_before_any_work(tmp_path, monkeypatch):
    monkeypatch.setattr(image_files.importlib.util, "find_spec", lambda _: None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'hybrid-rt\[exr\]'"):
        check_output(tmp_path / "a.exr")


def test_exposure_counts_stops(tmp_path):
    save_image(tmp_path / "a.png", IMAGE, {}, exposure=-1.0)
    expected = np.rint(linear_to_srgb(IMAGE.astype(float) / 2) * 255)
    np.testing.assert_array_equal(imageio.imread(tmp_path / "a.png"), expected)


def test_what_is_not_finite_is_shown(tmp_path):
    strange = np.array([[[np.nan, np.inf, -np.inf]]], np.float32)
    save_image(tmp_path / "a.png", strange, {}, exposure=-3.0)
    assert imageio.imread(tmp_path / "a.png").tolist() == [[[0, 255, 0]]]


def test_interrupted_write_leaves_the_old_file_and_no_other(tmp_path, monkeypatch):
    target = tmp_path / "a.png"
    target.write_bytes(b"old")

    def interrupted(file, *_):
        file.write(b"half")
        raise KeyboardInterrupt

    monkeypatch.setitem(image_files.WRITERS, ".png", interrupted)
    with pytest.raises(KeyboardInterrupt):
        save_image(target, IMAGE, {})
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_impossible_outputs_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"unknown ending: pass \.png, \.npz"):
        check_output("a.jpg")
    with pytest.raises(FileNotFoundError, match="no folder"):
        check_output(tmp_path / "missing" / "a.png")


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("folder.png", IsADirectoryError, "cannot be written .it is a folder.: name"),
        ("b.npz", IsADirectoryError, r"b\.npz\.json' cannot be written"),
        ("file/a.png", FileNotFoundError, "no folder"),
        (f"{300 * 'a'}.png", OSError, "cannot be written .*: name another file"),
    ],
)
def test_outputs_that_cannot_be_written_are_refused(tmp_path, name, error, words):
    (tmp_path / "folder.png").mkdir()
    (tmp_path / "b.npz.json").mkdir()
    (tmp_path / "file").touch()
    with pytest.raises(error, match=words):
        check_output(tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 3


@contextlib.contextmanager
def only_bytes(n):
    """As if every disk had room for n bytes in a file; not longer, as the log may be a file."""
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (n, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_full_disks_are_found_before_the_work(tmp_path):
    """An empty file can be made on a full disk."""
    words = r"output '.*a\.png' cannot be written .*: name another"
    with only_bytes(1000), pytest.raises(OSError, match=words):
        check_output(tmp_path / "a.png")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("ending", [".png", ".npz", ".exr"])
def test_a_disk_that_fills_is_named_with_its_file_and_the_old_one_stays(tmp_path, ending):
    if ending == ".exr":
        pytest.importorskip("OpenEXR")
    target = tmp_path / f"a{ending}"
    target.write_bytes(b"old")
    noise = np.random.default_rng(1).random((100, 100, 3)).astype(np.float32)
    words = rf"output '.*a\{ending}' cannot be written \(File too large\)"
    with only_bytes(outputs.TRIAL_SIZE), pytest.raises(OSError, match=words):
        save_image(target, noise, {})
    assert target.read_bytes() == b"old"
    assert list(tmp_path.iterdir()) == [target]


def test_pictures_of_one_name_keep_their_own_reports(tmp_path):
    endings = (".png", ".npz", ".npz.png", ".npz.png.npz", ".png.png")
    for seed, ending in enumerate(endings):
        save_image(tmp_path / f"a{ending}", IMAGE, {"seed": seed})
    assert len(list(tmp_path.iterdir())) == 2 * len(endings)
    assert json.loads((tmp_path / "a.json").read_text()) == {"seed": 0}
    assert json.loads((tmp_path / "a.npz.json").read_text()) == {"seed": 1}


def test_film_is_the_mean_and_its_noise_the_standard_error():
    passes = np.random.default_rng(5).uniform(size=(6, 4, 3, 3))
    sheet = Film(4, 3)
    for radiance in passes:
        sheet.add(radiance)
    np.testing.assert_allclose(sheet.image, passes.mean(axis=0), rtol=1e-6)
    noise = sheet.noise()
    assert noise.errs_on_the_safe_side
    per_pixel = passes.var(axis=0, ddof=1) / 6
    assert noise.root_mean_square_standard_error_of_pixels == pytest.approx(
        np.sqrt(per_pixel.mean())
    )
    means = passes.mean(axis=(1, 2, 3))
    assert noise.standard_error_of_image_mean == pytest.approx(means.std(ddof=1) / np.sqrt(6))


def test_errors_come_from_the_differences_between_groups():
    """Passes that cancel within each group leave the groups' means alone."""
    rng = np.random.default_rng(6)
    level, wobble = rng.uniform(1, 2, (4, 3, 2, 3)), rng.normal(size=(4, 3, 2, 3))
    sheet = Film(3, 2)
    for n in range(32):
        sheet.add(level[n // 4 % 4] + (-1.0) ** n * wobble[n // 4 % 4])
    expected = level.std(axis=0, ddof=1) / 2
    np.testing.assert_allclose(sheet.standard_error, expected)
    noise = sheet.noise()
    assert not noise.errs_on_the_safe_side
    assert noise.interval_factor == 3.182
    means = level.mean(axis=(1, 2, 3))
    assert noise.standard_error_of_image_mean == pytest.approx(means.std(ddof=1) / 2)


@pytest.mark.statistical
@pytest.mark.parametrize("n", [4, 22])
def test_rare_bright_paths_do_not_excuse_themselves(n):
    """Of independent samples of 1 one in 500 is 51: mean 1.1, variance 2500 p (1 - p).

    3e5 pixels meet 600 n of them, so the error of the picture is known to 2 % or better. Most pixels
    have met none and stand for 1 instead of 1.1, so the estimate is up to 10 % larger; an early one
    takes a darker neighbour for a pixel and may be larger still.
    """
    rng = np.random.default_rng(2)
    sheet = Film(500, 600)
    for _ in range(n):
        sheet.add(np.repeat(1.0 + 50.0 * (rng.random((500, 600, 1)) < 1 / 500), 3, axis=2))
    truth = np.sqrt(2500 / 500 * (1 - 1 / 500) / n / (1.1**2 + 0.01))
    error = np.sqrt(((sheet.image - 1.1) ** 2 / (1.1**2 + 0.01)).mean())
    assert error == pytest.approx(truth, rel=0.05)
    assert 0.97 * truth < sheet.relative_error() < (1.15 if n >= 16 else 1.5) * truth


@pytest.mark.statistical
@pytest.mark.parametrize("n", [16, 22])
@pytest.mark.parametrize("rare", [0.0, 1e-5, 1e-4])
def test_noise_is_told_from_fireflies(n, rare):
    """Even noise of 30 %, and one sample in 1 / rare that is brighter by 50.

    Errors against the truth, with and without the worst 60 of 6e4 pixels. From 16 passes on the
    estimates are up to 3 % too large, as for even noise alone; the share of the worst is that of a
    few dozen pixels, which their own estimates know to a tenth.
    """
    rng = np.random.default_rng(n)
    level = rng.uniform(0.2, 2.0, (200, 300, 3))
    sheet = Film(200, 300)
    for _ in range(n):
        noise = level * (1.0 + 0.3 * rng.normal(size=(200, 300, 1)))
        sheet.add(noise + 50.0 * (rng.random((200, 300, 1)) < rare))
    truth, found = picture_errors(sheet.image, level + 50.0 * rare), sheet.relative_errors()
    assert found.n_worst == 60
    assert found.whole == pytest.approx(truth.relative_rmse, rel=0.06)
    assert found.trimmed == pytest.approx(truth.relative_rmse_of_most, rel=0.04)
    share = 1.0 - 0.999 * (truth.relative_rmse_of_most / truth.relative_rmse) ** 2
    assert found.share_of_worst == pytest.approx(share, abs=0.05)


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("p", "n", "at_most"),
    [(0.01, 16, 1.6), (0.01, 64, 1.15), (0.05, 64, 1.3), (0.2, 16, 1.3)],
)  # fmt: skip
def test_pixels_that_have_met_few_paths_are_not_much_overstated(p, n, at_most):
    """Each pass of a pixel is 300 with probability p, over 0.3: as of a small lamp out of focus.

    The squared relative error is 300^2 p (1 - p) / n / (r^2 + 0.01), r = 0.3 + 300 p. Divided by
    what a pixel's other groups found it would be stated 3 to 70 times too large in these cases but
    the last. What is left is the spread of what stands for r: the hits of a pixel, or of 49 where
    these are few; with p = 0.01 and n = 16 three groups of 49 pixels have 5.9 of them.
    """
    rng = np.random.default_rng(n)
    sheet = Film(150, 200)
    for _ in range(n):
        hits = 300.0 * (rng.random((150, 200, 1)) < p)
        sheet.add(np.repeat(0.3 * (1.0 + 0.3 * rng.normal(size=hits.shape)) + hits, 3, axis=2))
    r = 0.3 + 300.0 * p
    variance = 300.0**2 * p * (1.0 - p) + (0.3 * 0.3) ** 2
    truth = np.sqrt(variance / n / (r * r + 0.01))
    errors = sheet.relative_errors()
    assert 0.9 < errors.whole / truth < at_most
    found = picture_errors(sheet.image, np.full((150, 200, 3), r))
    assert 0.9 < errors.trimmed / found.relative_rmse_of_most < at_most


@pytest.mark.parametrize(("n_dots", "n_spilled"), [(2, 0), (4, 2), (8, 6)])
def test_dots_spill_over_the_worst_pixels_as_passes_are_added(n_dots, n_spilled):
    """Of 8000 pixels the worst are 8; after 16 passes in place of 4 the brightest 2 of today fill them.

    Even pixels are 0.9 and 1.1 in turn, so s^2 = 0.01 / 3; a dot has one pass of 101 more: without
    its neighbours' even ones, it has the variance of (101, 0, 0, 0) + (0.1, -0.1, 0.1, -0.1).
    """
    sheet = Film(80, 100)
    dots = [(10 * k + 5, 50) for k in range(n_dots)]
    for n in range(4):
        radiance = np.full((80, 100, 3), 1.0 + 0.1 * (-1.0) ** n)
        for y, x in dots:
            radiance[y, x] += 101.0 * (n == 0)
        sheet.add(radiance)
    even = 0.01 / 3 / 1.01
    dot = np.var([101.1, -0.1, 0.1, -0.1], ddof=1) / 4 / 1.01
    errors = sheet.relative_errors()
    assert errors.trimmed == pytest.approx(np.sqrt(even), rel=1e-6)
    n_even = 7992 + 6 - n_spilled
    ahead = (n_even * even + n_spilled * dot) / 4 / 7992
    assert errors.ahead == pytest.approx(np.sqrt(ahead), rel=1e-3)
    assert (errors.ahead > errors.trimmed) == (n_spilled > 0)


def test_early_errors_of_fireflies_claim_no_safety():
    """One bright sample of 16 000: 15 pixels in 16 that hide what they have not met."""
    for n_bright in (0, 1):
        sheet = Film(40, 50)
        for n in range(8):
            radiance = np.full((40, 50, 3), 1.0 + 0.1 * (-1.0) ** n)
            radiance[0, :n_bright] += 100.0 * (n == 0)
            sheet.add(radiance)
        noise = sheet.noise()
        assert noise.errs_on_the_safe_side == (n_bright == 0)
        assert noise.worst_pixels == 2
    assert noise.worst_pixels_share_of_squared_error > 0.9
    assert noise.relative_rmse_trimmed == pytest.approx(0.1 / np.sqrt(7 * 1.01), rel=1e-3)


def test_worst_pixels_of_few_are_none():
    sheet = Film(31, 32)
    for value in (1.0, 2.0):
        sheet.add(np.full((31, 32, 3), value))
    errors = sheet.relative_errors()
    assert (errors.trimmed, errors.n_worst, errors.share_of_worst) == (errors.whole, 0, 0.0)


@pytest.mark.parametrize("n_passes", [2, 3, 16])
def test_black_pixels_and_dark_ones_are_counted_before_runs_are_whole_and_after(n_passes):
    """Dark ones have some light, below 0.1."""
    sheet = Film(4, 5)
    for _ in range(n_passes):
        radiance = np.ones((4, 5, 3))
        radiance[1:3], radiance[0] = 0.09, 0.0
        sheet.add(radiance)
    noise = sheet.noise()
    assert (noise.pixels_dark, noise.pixels_without_light) == (10, 5)


def test_what_is_not_finite_or_black_is_counted():
    sheet = Film(40, 50)
    for n in range(16):
        radiance = np.random.default_rng(n).random((40, 50, 3))
        radiance[0, 0] = np.nan
        radiance[1] = 0.0
        sheet.add(radiance)
    assert np.isnan(sheet.relative_errors().trimmed)
    assert sheet.noise().pixels_without_light == 50


def test_groups_take_runs_of_four_passes_in_turn():
    group, sample = group_of(np.arange(40, dtype=np.uint64))
    assert np.array_equal(pass_of(group, sample), np.arange(40))
    assert group.tolist() == [k for _ in range(3) for k in range(4) for _ in range(4)][:40]
    for k in range(4):
        assert sample[group == k].tolist() == list(range(np.count_nonzero(group == k)))


def test_intervals_use_students_t():
    from scipy.stats import t

    sheet = Film(1, 1)
    for n in range(1, 21):
        sheet.add(np.full((1, 1, 3), float(n)))
        if n > 1:
            freedom = n - 1 if n < 16 else 3
            assert sheet.noise().interval_factor == pytest.approx(t.ppf(0.975, freedom), abs=6e-4)


@pytest.mark.statistical
@pytest.mark.parametrize("n", [2, 5, 21])
def test_squares_of_errors_are_unbiased(n):
    """The mean square is the variance of the mean, whatever the sizes of the groups.

    Independent normal passes, 6e4 values; the squares have 1 or more degrees of freedom, so their
    mean is known to 0.6 % or better: 3 % is a matter of 5 standard deviations.
    """
    rng = np.random.default_rng(8)
    sheet = Film(100, 200)
    for _ in range(n):
        sheet.add(rng.normal(size=(100, 200, 3)))
    assert np.square(sheet.standard_error).mean() == pytest.approx(1 / n, rel=0.03)


def test_one_pass_tells_nothing_of_noise():
    sheet = Film(1, 1)
    sheet.add(np.ones((1, 1, 3)))
    assert sheet.noise() is None


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_extreme_brightness_neither_overflows_nor_vanishes(scale):
    sheet = Film(1, 1)
    for value in (1.0, 2.0):
        sheet.add(np.full((1, 1, 3), value * scale))
    assert sheet.noise().root_mean_square_standard_error_of_pixels == pytest.approx(scale / 2)
    assert sheet.image[0, 0, 0] == pytest.approx(1.5 * scale)
