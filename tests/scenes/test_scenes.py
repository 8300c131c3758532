"""Every scene script gives a picture, as a module and as a program."""

import runpy
import sys
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.cli.scene_file import load_script
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.report_warnings import warnings_in_words

SCRIPTS = sorted((Path(__file__).parents[2] / "scenes").glob("*.py"))


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_scene_renders_to_a_picture_with_light_and_shade(script):
    scene, integrator = load_script(script)
    result = render(
        scene.with_camera(scene.camera.resized(48, 36)),
        integrator,
        passes=1,
        options=PPMOptions(20_000) if integrator == "ppm" else None,
    )
    image = result.image
    # None of a lamp that is turned away, or of two faces in one plane.
    assert warnings_in_words(result.report) == []
    assert np.isfinite(image).all()
    assert image.min() < 0.1
    assert image.max() > 0.5
    assert image.std() > 0.3 * image.mean()


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_scene_runs_as_a_program(script, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    arguments = [str(script), "--passes", "1", "--width", "24", "--height", "16", "--quiet"]
    arguments += ["--photons", "5000"] if load_script(script)[1] == "ppm" else []
    monkeypatch.setattr(sys, "argv", arguments)
    with pytest.raises(SystemExit) as caught:
        runpy.run_path(str(script), run_name="__main__")
    assert caught.value.code == 0
    assert imageio.imread(f"{script.stem}.png").shape == (16, 24, 3)
