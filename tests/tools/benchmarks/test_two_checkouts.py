"""Renders by two checkouts in turn; `tools/bench_render.py --against` prints what is found."""

import json
import runpy
import sys
from pathlib import Path

import pytest

from benchmarks import renders_on_request
from benchmarks.two_checkouts import HERE, Job, checkout_at, compare

TOOL = HERE / "tools" / "bench_render.py"
SCENE = """
print("what a script prints is no answer")
from hybrid_rt import Camera, Lambertian, Object, PointLight, Scene, Sphere

def scene():
    camera = Camera((0.0, -3.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), width=32, height=16)
    ball = Object(Sphere((0.0, 0.0, 0.0), 1.0), Lambertian(0.5), "ball")
    return Scene(camera=camera, objects=[ball], lights=[PointLight((3.0, -3.0, 3.0), 10.0)])
"""


@pytest.fixture
def script(tmp_path):
    file = tmp_path / "ball.py"
    file.write_text(SCENE)
    return file


@pytest.mark.slow
def test_a_checkout_against_itself_has_the_same_errors(script, tmp_path, monkeypatch, capsys):
    """Equal seeds give equal bits, so the ratios of errors are exactly one."""
    out = tmp_path / "ratios.json"
    words = [str(TOOL), str(script), "--against", str(HERE), "--passes", "2", "--rounds", "2"]
    words += ["--reference-passes", "8", "--width", "16", "--threads", "1", "--json", str(out)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOL), run_name="__main__")
    assert ended.value.code == 0
    (row,) = json.loads(out.read_text())
    assert row["size"] == [16, 8]
    assert row["old"]["relmse"] == row["new"]["relmse"]
    assert len(set(row["new"]["relmse"])) == 2  # each round has its own seed
    assert row["ratios"]["relmse"] == {"mean": 1.0, "least": 1.0, "most": 1.0}
    for k in range(2):
        product = row["old"]["relmse"][k] * row["old"]["processor"][k]
        assert row["old"]["work"][k] == pytest.approx(product)
    assert row["relmse_of_reference"] > 0.0
    assert "old / new" in capsys.readouterr().out


def test_a_checkout_whose_cameras_do_not_keep_proportions_is_told_the_height(tmp_path):
    """In e10b952 `Camera.resized` takes both numbers."""
    old = """
from types import SimpleNamespace as Camera

def scene():
    camera = Camera(width=32, height=16, resized=lambda width, height: (width, height))
    return Camera(camera=camera, with_camera=lambda size: size)
"""
    (tmp_path / "old.py").write_text(old)
    assert renders_on_request._scene({"scene": str(tmp_path / "old.py"), "width": 16}) == (16, 8)


def test_a_folder_without_the_packages_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"is no checkout: it has no hybrid_rt/__init__\.py; make"):
        checkout_at(tmp_path)


def test_a_checkout_that_cannot_render_is_named(script, tmp_path):
    for package in ("hybrid_rt", "meshing"):
        (tmp_path / package).mkdir()
        (tmp_path / package / "__init__.py").touch()
    job = Job(script, "path", passes=1, rounds=1, reference_passes=1)
    with pytest.raises(ValueError, match=rf"checkout {tmp_path}: ImportError: cannot import name"):
        compare(checkout_at(Path(tmp_path)), job)
