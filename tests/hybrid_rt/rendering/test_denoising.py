"""Denoised pictures: what they are made of, how they are named, what is refused."""

import importlib.util
import json
import sys

import numpy as np
import pytest
from ball_script import SCRIPT

from hybrid_rt.cli import program
from hybrid_rt.cli.command import BAD_INPUT
from hybrid_rt.rendering.denoising import BIASED, DenoisedPicture, denoised_name
from hybrid_rt.rendering.result import RenderResult

REPORT = {"passes": 4, "settings": {"seed": 0}, "versions": {}, "noise": {"relative_rmse": 0.1}}
HEIGHT, WIDTH = 48, 64


def noisy():
    """A ramp of radiance from 0 to 4 with relative noise of 20 %, on a wall."""
    truth = np.broadcast_to(np.linspace(0.0, 4.0, WIDTH)[None, :, None], (HEIGHT, WIDTH, 3))
    noise = np.random.default_rng(3).normal(1.0, 0.2, (HEIGHT, WIDTH, 1))
    channels = {
        "albedo": np.full((HEIGHT, WIDTH, 3), 0.5, np.float32),
        "normal": np.broadcast_to(np.float32([0.0, 0.0, 1.0]), (HEIGHT, WIDTH, 3)).copy(),
    }
    return truth, RenderResult((truth * noise).astype(np.float32), dict(REPORT), channels)


@pytest.fixture
def folder(tmp_path, monkeypatch):
    (tmp_path / "ball.py").write_text(SCRIPT)
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("a.png", "a.denoised.png"),
        ("b/a.b.npz", "b/a.b.denoised.npz"),
        ("denoised_a.exr", "denoised_a.exr"),
    ],
)
def test_every_file_is_called_denoised(given, name):
    assert str(denoised_name(given)) == name


def test_its_report_states_no_error(tmp_path):
    picture = DenoisedPicture(np.zeros((2, 2, 3), np.float32), {"passes": 4, "denoised": BIASED})
    assert picture.save(tmp_path / "a.png").name == "a.denoised.png"
    names = sorted(path.name for path in tmp_path.iterdir())
    assert names == ["a.denoised.json", "a.denoised.png"]
    assert "biased" in json.loads((tmp_path / "a.denoised.json").read_text())["denoised"]


def test_a_missing_denoiser_is_told_in_one_line_before_any_work(folder, monkeypatch, capsys):
    is_there = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name: None if name == "pyoidn" else is_there(name)
    )
    assert program.main(["render", "ball.py", "--quiet", "--denoise"]) == BAD_INPUT
    told = capsys.readouterr().err.strip()
    expected = "hybrid-rt: denoising needs the package pyoidn: pip install 'hybrid-rt[denoise]'"
    assert told == expected
    assert sorted(path.name for path in folder.iterdir()) == ["ball.py"]
    with pytest.raises(ModuleNotFoundError, match=r"pip install 'hybrid-rt\[denoise\]'"):
        noisy()[1].denoised()


def test_a_denoiser_that_cannot_be_imported_is_told_before_any_work(
    folder, tmp_path_factory, monkeypatch, capsys
):
    half = tmp_path_factory.mktemp("half")
    (half / "pyoidn.py").write_text("import no_such_package")
    monkeypatch.syspath_prepend(half)
    monkeypatch.delitem(sys.modules, "pyoidn", raising=False)
    assert program.main(["render", "ball.py", "--quiet", "--denoise"]) == BAD_INPUT
    told = capsys.readouterr().err
    assert "pip install 'hybrid-rt[denoise]' (it cannot be imported: No module named" in told
    assert sorted(path.name for path in folder.iterdir()) == ["ball.py"]


def test_a_ramp_under_noise_comes_out_nearer_to_the_truth():
    """Of independent noise of 20 % a smooth guide leaves the denoiser less than a quarter."""
    pytest.importorskip("pyoidn")
    truth, result = noisy()
    before = result.image.copy()
    picture = result.denoised()
    assert np.array_equal(result.image, before)
    assert picture.image.dtype == np.float32
    was, is_now = (np.sqrt(np.mean((x - truth) ** 2)) for x in (before, picture.image))
    assert is_now < 0.25 * was
    assert picture.report["denoised"]["warning"] == BIASED
    assert "noise" not in picture.report
    assert "relative_error" not in picture.report


def test_what_cannot_guide_is_refused():
    pytest.importorskip("pyoidn")
    _, result = noisy()
    with pytest.raises(ValueError, match=r"no channel 'normal', by which.*pass outputs="):
        RenderResult(result.image, REPORT, {"albedo": result.channels["albedo"]}).denoised()
    result.image[3, 5] = np.inf
    with pytest.raises(ValueError, match="image has 1 pixels that are not finite"):
        result.denoised()


def test_the_command_writes_a_second_picture_beside_the_honest_one(folder, capsys):
    pytest.importorskip("pyoidn")
    words = ["render", "ball.py", "--passes", "2", "--quiet", "--out", "a.npz"]
    assert program.main(words) == 0
    honest = np.load("a.npz")["image"]
    capsys.readouterr()
    assert program.main([*words, "--out", "b.png", "--denoise"]) == 0
    assert f"a.denoised.npz  ({BIASED}" in capsys.readouterr().out
    assert np.array_equal(np.load("a.npz")["image"], honest)
    second = np.load("a.denoised.npz")["image"]
    assert second.shape == honest.shape
    assert not np.array_equal(second, honest)
    assert (folder / "b.denoised.png").is_file()
    assert "relative_error" not in json.loads((folder / "b.denoised.json").read_text())
    assert "relative_error" in json.loads((folder / "b.json").read_text())


def test_a_name_that_is_taken_is_refused_before_any_work(folder, capsys):
    pytest.importorskip("pyoidn")
    words = ["--out", "a.png", "--out", "a.denoised.png", "--denoise", "--quiet"]
    assert program.main(["render", "ball.py", *words]) == BAD_INPUT
    assert "would be 'a.denoised.png', which is an --out as well" in capsys.readouterr().err
    assert sorted(path.name for path in folder.iterdir()) == ["ball.py"]
