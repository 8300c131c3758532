import io
import json
import zipfile

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.analysis import picture_comparison
from hybrid_rt.analysis.nearer_picture import Verdict, verdicts
from hybrid_rt.analysis.picture_comparison import (
    compare_pictures,
    in_words,
    load_picture,
)
from hybrid_rt.analysis.picture_sheet import GAP, MARGIN, error_colors
from hybrid_rt.analysis.reference import given_reference
from hybrid_rt.cli import program as cli
from hybrid_rt.sensor.image_files import save_image, sidecar_of
from meshing.outputs import check_writable, replacing

RNG = np.random.default_rng(12)
TRUTH = RNG.uniform(0.2, 0.9, (20, 30, 3)).astype(np.float32)
REPORT = {"noise": {"relative_rmse": 0.03}, "seconds": {"total": 2.5}}


def write(path, image, report=REPORT, **channels):
    save_image(path, image, report, channels)
    return path


@pytest.mark.parametrize("ending", [".npz", ".exr", ".png"])
def test_what_was_saved_is_read(tmp_path, ending):
    if ending == ".exr":
        pytest.importorskip("OpenEXR")
    error = np.full_like(TRUTH, 0.25)
    channels = {} if ending == ".png" else {"standard_error": error}
    picture = load_picture(write(tmp_path / f"a{ending}", TRUTH, **channels))
    # Half a step of 8 bits is at most 0.5 / 255 times the steepest slope of the curve, 2.3 at one.
    np.testing.assert_allclose(picture.image, TRUTH, atol=0.0046 if ending == ".png" else 0)
    assert picture.report == REPORT
    if ending != ".png":
        np.testing.assert_array_equal(picture.standard_error, error)


@pytest.mark.parametrize(
    ("name", "error", "words"),
    [
        ("missing.npz", FileNotFoundError, "no such file"),
        ("a.jpg", ValueError, "unknown ending"),
        ("empty.npz", ValueError, "no array named image, but other: pass"),
        ("grey.npz", ValueError, r"holds float64 of shape \(3, 4\): pass floats"),
        ("errors.npz", ValueError, r"its standard_error \(2, 2\)"),
        ("nothing.png", ValueError, r"nothing\.png' cannot be read .*: pass a complete \.png"),
        ("nothing.exr", ValueError, r"nothing\.exr' cannot be read .*: pass a complete \.exr"),
        ("half.npz", ValueError, "cannot be read"),
        ("sixteen.png", ValueError, r"pixels of shape \(2, 2\): pass 8 bit RGB"),
    ],
)
def test_what_is_no_picture_is_refused(tmp_path, name, error, words):
    (tmp_path / "a.jpg").touch()
    if name.endswith(".exr"):
        pytest.importorskip("OpenEXR")
    np.savez(tmp_path / "empty.npz", other=np.zeros(3))
    np.savez(tmp_path / "grey.npz", image=np.zeros((3, 4)))
    np.savez(tmp_path / "words.npz", image=np.full((1, 1, 3), "a"))
    np.savez(tmp_path / "errors.npz", image=TRUTH, standard_error=np.zeros((2, 2)))
    imageio.imwrite(tmp_path / "sixteen.png", np.zeros((2, 2), np.uint16))
    ending = name.rpartition(".")[2]
    if name.startswith("nothing"):
        (tmp_path / name).touch()
    if name.startswith("half"):
        whole = write(tmp_path / f"whole.{ending}", TRUTH).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(error, match=words):
        load_picture(tmp_path / name)


@pytest.mark.parametrize(
    "text",
    [
        "no JSON {",
        '{"noise": 3, "settings": {"integrator": ["path"]}, "passes": "many", "light_not_found": 1}',
    ],
)
def test_reports_of_other_programs_tell_nothing(tmp_path, text):
    write(tmp_path / "a.png", TRUTH)
    (tmp_path / "a.json").write_bytes(text.encode("latin-1"))
    picture = load_picture(tmp_path / "a.png")
    row = compare_pictures(picture, picture)["errors"]["a.png (1)"]
    assert (row["expected"], row["seconds"]) == (None, None)
    reference = given_reference(picture)
    assert np.isnan([reference.own_error, reference.seconds, reference.mean_noise]).all()


@pytest.mark.statistical
def test_noise_explains_the_difference_of_two_noisy_pictures(tmp_path):
    """1800 normal values: their root mean square is known to 1.7 %."""
    sigma = 0.01 + 0.02 * TRUTH
    noisy = [(TRUTH + sigma * RNG.normal(size=TRUTH.shape)).astype(np.float32) for _ in range(2)]
    one, other = (
        load_picture(write(tmp_path / f"{k}.npz", image, standard_error=sigma))
        for k, image in enumerate(noisy)
    )
    row = compare_pictures(one, other)["errors"]["0.npz"]
    assert row["relative_rmse"] == pytest.approx(row["expected"], rel=0.1)
    assert row["seconds"] == 2.5


def test_noise_of_reports_adds_in_squares(tmp_path):
    one, other = (load_picture(write(tmp_path / f"{k}.npz", TRUTH)) for k in "ab")
    row = compare_pictures(one, other)["errors"]["a.npz"]
    assert row["expected"] == pytest.approx(0.03 * np.sqrt(2))
    assert row["rmse"] == 0.0


def test_a_single_pass_knows_no_noise(tmp_path):
    """Which of two is nearer is told by the rest of the picture, as without any noise."""
    unknown = np.full_like(TRUTH, np.nan)
    one, other = (
        load_picture(write(tmp_path / f"{k}.npz", TRUTH, standard_error=unknown)) for k in "ab"
    )
    assert compare_pictures(one, other)["errors"]["a.npz"]["expected"] is None


@pytest.mark.parametrize(("off", "is_told"), [(0.0005, False), (-0.0055, True)])
def test_means_are_compared_with_their_intervals(tmp_path, off, is_told):
    """The intervals 0.003 and 0.004 add to 0.005."""
    halves = {"one": 0.003, "other": 0.004}
    one, other = (
        load_picture(
            write(
                tmp_path / f"{name}.npz",
                TRUTH + np.float32(off * (name == "one")),
                {"noise": {"half_interval_95_of_image_mean": half}},
            )
        )
        for name, half in halves.items()
    )
    found = compare_pictures(one, other)
    assert found["errors"]["one.npz"]["mean_half_interval"] == pytest.approx(0.005)
    said = (
        "mean of one.npz: -0.0055 from other.npz, more than both reports' intervals of the mean explain "
        "(+-0.005, 95 %)"
    )
    assert (said in in_words(found)) == is_told
    no_report = load_picture(write(tmp_path / "none.npz", TRUTH, {}))
    assert compare_pictures(one, no_report)["errors"]["one.npz"]["mean_half_interval"] is None


def test_what_reports_warn_of_is_told_again(tmp_path):
    report = REPORT | {"warnings": ["whitted does not find diffuse reflection"]}
    one = load_picture(write(tmp_path / "one.npz", TRUTH, report))
    other = load_picture(write(tmp_path / "other.npz", TRUTH, {"warnings": "of another program"}))
    for found in (compare_pictures(one, other), compare_pictures(other, one)):
        assert found["warnings"] == [("one.npz", "whitted does not find diffuse reflection")]
        assert "WARNING: one.npz, by its report: whitted does not find " in in_words(found)


def test_a_png_that_is_clipped_is_said_to_be(tmp_path):
    """A quarter of the pixels shows a radiance of 3."""
    image = np.full((4, 6, 3), 0.5, np.float32)
    image[:2, :3] = 3.0
    whole = load_picture(write(tmp_path / "whole.npz", image, {}))
    save_image(tmp_path / "cut.png", image, {})
    cut = load_picture(tmp_path / "cut.png")
    found = compare_pictures(cut, whole)
    assert found["clipped"] == {"cut.png": 0.25}
    assert "WARNING: cut.png is clipped at 1 in 25 % of its pixels" in in_words(found)
    assert compare_pictures(cut, cut)["clipped"] == {}


def test_the_nearer_picture_is_named(tmp_path):
    far, near, truth = (
        load_picture(write(tmp_path / f"{name}.npz", TRUTH + np.float32(off)))
        for name, off in (("far", 0.02), ("near", -0.01), ("truth", 0.0))
    )
    found = compare_pictures(far, near, truth)
    assert found["nearest"] == "near.npz"
    assert "nearer to truth.npz: near.npz (far.npz " in in_words(found)
    alike = compare_pictures(near, near, truth)
    assert alike["nearest"] is None
    assert "nearer to" not in in_words(alike)
    assert compare_pictures(far, near)["nearest"] is None


def pictures_with_dots(tmp_path, noise, off, n_dots=3, shape=(60, 80, 3), error=True):
    """Return a picture with dots, one that is off everywhere, and the truth; of 0.1 % 4 pixels."""
    rng = np.random.default_rng(5)
    truth = rng.uniform(0.2, 0.9, shape)
    dotted, other = (truth + noise * rng.normal(size=shape) for _ in range(2))
    dotted.reshape(-1, 3)[rng.choice(4800, n_dots, replace=False)] += 50.0
    images = {"dotted": dotted, "other": other + off, "truth": truth}
    errors = {"dotted": 4.0, "other": noise, "truth": 0.0}
    return [
        load_picture(
            write(
                tmp_path / f"{name}.npz",
                image.astype(np.float32),
                **({"standard_error": np.full(shape, errors[name], np.float32)} if error else {}),
            )
        )
        for name, image in images.items()
    ]


def test_a_few_dots_do_not_decide_which_picture_is_nearer(tmp_path):
    """Three pixels of 4800 are 50 off, some 230 % in all; the other picture is 0.05 off everywhere."""
    found = compare_pictures(*pictures_with_dots(tmp_path, 0.01, 0.05))
    rows = found["errors"]
    assert rows["dotted.npz"]["relative_rmse"] > 10 * rows["other.npz"]["relative_rmse"]
    assert found["nearest_of_most"] == "dotted.npz"
    # Three dots within the stated noise: another seed may have none.
    assert (found["nearest"], found["nearest_told"]) == (None, False)
    lines = in_words(found).splitlines()
    first = next(
        i for i, line in enumerate(lines) if line.startswith("nearer to truth.npz: dotted")
    )
    assert lines[first].endswith("without the worst 0.1 % of the pixels;")
    assert "with them: cannot be told, the difference may be noise (dotted.npz " in lines[first + 1]


def test_both_measures_are_named_where_they_disagree(tmp_path):
    """Nobody states noise that would explain the dots: the reports say 3 %."""
    found = compare_pictures(*pictures_with_dots(tmp_path, 0.01, 0.05, error=False))
    assert (found["nearest_of_most"], found["nearest"]) == ("dotted.npz", "other.npz")
    assert "with them: other.npz (dotted.npz " in in_words(found)


@pytest.mark.parametrize(("off", "nearest"), [(0.0, None), (0.02, "dotted.npz")])
def test_what_noise_explains_is_not_told(tmp_path, off, nearest):
    """Of two equally noisy pictures of 14400 values neither is nearer, but an offset of 0.4 sigma shows."""
    found = compare_pictures(*pictures_with_dots(tmp_path, 0.05, off, n_dots=0))
    assert found["nearest"] == found["nearest_of_most"] == nearest
    said = nearest or "cannot be told"
    assert f"nearer to truth.npz: {said}" in in_words(found)


@pytest.mark.parametrize("shape", [(1, 1), (1, 5), (3, 2)])
def test_verdicts_of_tiny_pictures_are_not_told_where_noise_explains_all(shape):
    truth = np.full((*shape, 3), 0.5)
    for noise, is_told in ((1.0, shape != (1, 1)), (0.0, True)):
        for verdict in verdicts(truth + 0.2, truth - 0.1, truth, noise):
            assert verdict == Verdict(False, is_told)


@pytest.mark.parametrize(
    ("other", "is_warned"),
    [
        ({"integrator": "path", "seed": 3}, True),
        ({"integrator": "ppm", "seed": 3}, False),
        (None, False),
    ],
)
def test_equal_seeds_are_warned_of(tmp_path, other, is_warned):
    settings = {"integrator": "path", "seed": 3}
    one, two = (
        load_picture(write(tmp_path / f"{name}.npz", TRUTH, REPORT | {"settings": of}))
        for name, of in (("one", settings), ("two", other))
    )
    found = compare_pictures(one, two)
    assert found["same_noise"] == (["one.npz"] if is_warned else [])
    words = in_words(found)
    assert ("WARNING: one.npz and two.npz were rendered with one integrator" in words) == is_warned


def test_colours_are_logarithmic():
    colors = error_colors(np.array([1e-9, 1e-3, 10 ** (-1.5), 1.0, 7.0]))
    np.testing.assert_array_equal(colors[0], colors[1])
    np.testing.assert_array_equal(colors[3], colors[4])
    np.testing.assert_array_equal(colors[2], (188, 55, 84))  # half way


def test_command_prints_errors_and_draws_a_map(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write("truth.npz", TRUTH)
    write("dark.npz", 0.5 * TRUTH)
    write("off.npz", TRUTH + np.float32(0.01))
    assert cli.main(["compare", "dark.npz", "off.npz", "--reference", "truth.npz"]) == 0
    out = capsys.readouterr().out
    assert "against truth.npz" in out
    assert f"{0.5 * np.sqrt((TRUTH.astype(float) ** 2).mean()):9.3g}" in out
    assert "+0.01" in out
    # Two columns of pictures 30 wide, 11 times as large.
    assert imageio.imread("compare.png").shape[1] == 2 * 330 + GAP + 2 * MARGIN
    figures = json.loads((tmp_path / "compare.json").read_text())
    assert figures["against"] == "truth.npz"
    assert figures["errors"]["off.npz"]["mean_error"] == pytest.approx(0.01, rel=1e-5)
    assert cli.main(["compare", "dark.npz", "off.npz", "--out", "two.png"]) == 0
    assert imageio.imread("two.png").shape[1] == 2 * 330 + GAP + 2 * MARGIN


def test_pictures_of_other_sizes_are_one_clear_line(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write("a.npz", TRUTH)
    write("b.npz", TRUTH[:10])
    assert cli.main(["compare", "a.npz", "b.npz"]) == 2
    error = capsys.readouterr().err
    assert error == (
        "hybrid-rt: a.npz has 30 x 20 pixels, b.npz 30 x 10: pass pictures of one size\n"
    )
    assert not (tmp_path / "compare.png").exists()
    assert json.loads((tmp_path / "a.npz.json").read_text()) == REPORT


def test_pictures_compared_are_not_replaced(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    before = write(tmp_path / "a.png", TRUTH).read_bytes()
    write("b.npz", TRUTH)
    assert cli.main(["compare", "b.npz", "a.png", "--out", "./a.png"]) == 2
    assert "output 'a.png' is one of the pictures: name another" in capsys.readouterr().err
    assert (tmp_path / "a.png").read_bytes() == before
    assert json.loads((tmp_path / "a.json").read_text()) == REPORT


@pytest.mark.parametrize("scale", [1e-300, 1e299])
def test_extreme_pictures_are_compared(tmp_path, monkeypatch, capsys, scale):
    """A file of float64 may hold what no picture of ours does."""
    monkeypatch.chdir(tmp_path)
    for name, factor in (("a", 1.5 * scale), ("b", scale)):
        image = factor * TRUTH.astype(np.float64)
        np.savez(tmp_path / f"{name}.npz", image=image, standard_error=0.1 * image)
    assert cli.main(["compare", "a.npz", "b.npz", "--exposure", "9"]) == 0
    errors = json.loads((tmp_path / "compare.json").read_text())["errors"]["a.npz"]
    if scale > 1.0:
        assert errors["relative_rmse"] == pytest.approx(0.5)
        assert errors["expected"] == pytest.approx(0.1 * np.sqrt(1.0 + 1.5**2))
        assert errors["rmse"] / scale == pytest.approx(0.5 * np.sqrt((TRUTH**2).mean()), rel=1e-6)
    assert errors["relative_mean_error"] == pytest.approx(0.5)
    np.savez(tmp_path / "c.npz", image=np.full(TRUTH.shape, 1.7e308))
    assert cli.main(["compare", "a.npz", "c.npz"]) == 2
    assert "holds numbers beyond 1e+300: pass" in capsys.readouterr().err


def test_reports_of_pictures_compared_are_not_replaced(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write("a.npz", TRUTH)
    write("b.npz", 0.5 * TRUTH)
    assert cli.main(["compare", "a.npz", "b.npz", "--out", "a.npz.png"]) == 0
    assert json.loads((tmp_path / "a.npz.json").read_text()) == REPORT
    assert json.loads((tmp_path / "a.npz.png.json").read_text())["against"] == "b.npz"


def test_a_trial_leaves_what_is_being_written_alone(tmp_path):
    with replacing(tmp_path / "a.npz") as file:
        check_writable(tmp_path / "a.npz")
        file.write(b"whole")
    assert (tmp_path / "a.npz").read_bytes() == b"whole"
    assert [item.name for item in tmp_path.iterdir()] == ["a.npz"]
    # Where names differ by case, so do those of reports.
    assert sidecar_of(tmp_path / "z.png") != sidecar_of(tmp_path / "z.PNG")


def member(shape, dtype=np.float32, write=np.lib.format.write_array_header_1_0):
    """Return the header of an array, without the array."""
    file = io.BytesIO()
    write(file, np.lib.format.header_data_from_array_1_0(np.zeros(0, dtype)) | {"shape": shape})
    return file.getvalue()


BOMBS = {
    "a picture beyond memory": ({"image": member((2**20, 2**20, 3))}, "takes 96 TiB of memory, this"),
    "a report beyond memory": (
        {"image": member((2, 2, 3)), "report": member((), "<U500000000")}, "takes 14.9 GiB of memory, this process can have 1 GiB"
    ),
    }  # fmt: skip


@pytest.mark.parametrize(("members", "words"), BOMBS.values(), ids=BOMBS)
def test_arrays_are_judged_by_their_headers_before_they_are_unpacked(
    tmp_path, monkeypatch, members, words
):
    monkeypatch.setattr(picture_comparison, "available_bytes", lambda: 2**30)
    with zipfile.ZipFile(tmp_path / "bomb.npz", "w") as archive:
        for name, content in members.items():
            archive.writestr(f"{name}.npy", content)
    with pytest.raises(ValueError, match=words):
        load_picture(tmp_path / "bomb.npz")


def test_a_small_file_of_a_large_picture_is_not_unpacked(tmp_path, monkeypatch):
    """Zeros pack to a thousandth; what is written by np.savez is taken, and so are real pictures."""
    monkeypatch.setattr(picture_comparison, "MOST_UNPACKED", 2**16)
    black = np.zeros((100, 100, 3), np.float32)
    np.savez_compressed(tmp_path / "a.npz", image=black)
    with pytest.raises(ValueError, match=r"unpacks to .* if that is meant, write it by np\.savez"):
        load_picture(tmp_path / "a.npz")
    np.savez(tmp_path / "a.npz", image=black)
    assert not load_picture(tmp_path / "a.npz").image.any()
    noise = RNG.random((100, 100, 3)).astype(np.float32)
    np.savez_compressed(tmp_path / "a.npz", image=noise)
    np.testing.assert_array_equal(load_picture(tmp_path / "a.npz").image, noise)
