"""Outputs beside radiance, in closed form."""

import numpy as np
import pytest

from hybrid_rt.lights import GradientSky
from hybrid_rt.materials import Lambertian, Phong
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.rendering.channels import OUTPUTS, Output
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture

CAMERA = Camera((0, 0, 5), (0, 0, 0), (0, 1, 0), 60, 15, 11)
WALL = Object(Rectangle((-2, -2, -1), (4, 0, 0), (0, 4, 0)), Phong((0.1, 0.2, 0.3), 0.4, 9), "wall")
BALL = Object(Sphere((0, 0, 0), 1), Lambertian(CheckerTexture(0.9, 0.3, 4, "uv")), "ball")
SCENE = Scene(CAMERA, [WALL, BALL], environment=GradientSky(0.5, 1.0))


@pytest.fixture(scope="module")
def result():
    return render(SCENE, passes=4, outputs=list(OUTPUTS))


def test_middle_of_the_picture(result):
    c = {name: values[5, 7] for name, values in result.channels.items()}
    assert c["depth"] == pytest.approx(4.0)
    np.testing.assert_allclose(c["position"], (0, 0, 1), atol=1e-7)
    np.testing.assert_allclose(c["normal"], (0, 0, 1), atol=1e-7)
    assert c["object_id"] == 1
    assert c["samples"] == 4


def test_wall_beside_the_ball(result):
    row, column = 5, 10
    x = (column + 0.5 - 7.5) / 5.5 * np.tan(np.pi / 6) * 6
    c = {name: values[row, column] for name, values in result.channels.items()}
    assert c["object_id"] == 0
    np.testing.assert_allclose(c["position"], (x, 0, -1), atol=1e-6)
    assert c["depth"] == pytest.approx(np.hypot(x, 6))
    np.testing.assert_allclose(c["uv"], ((x + 2) / 4, 0.5), rtol=1e-6)
    np.testing.assert_allclose(c["albedo"], (0.5, 0.6, 0.7), rtol=1e-6)


def test_nothing_behind_a_corner(result):
    c = {name: values[0, 0] for name, values in result.channels.items()}
    assert np.isinf(c["depth"])
    assert c["object_id"] == -1
    assert np.isnan(c["normal"]).all()
    assert not c["albedo"].any()


def test_albedo_follows_the_texture(result):
    on_ball = result.channels["object_id"] == 1
    assert set(np.unique(result.channels["albedo"][on_ball])) == {np.float32(0.9), np.float32(0.3)}


def test_standard_error_is_that_of_the_passes(result):
    passes = [
        render(SCENE, passes=n).image.astype(float) * n
        - render(SCENE, passes=n - 1).image * (n - 1.0)
        if n > 1
        else render(SCENE, passes=1).image.astype(float)
        for n in (1, 2, 3, 4)
    ]
    expected = np.std(passes, axis=0, ddof=1) / 2
    # Passes from differences of float32 pictures, up to four times as large.
    np.testing.assert_allclose(result.channels["standard_error"], expected, atol=1e-5)


def test_radiance_does_not_depend_on_outputs(result):
    np.testing.assert_array_equal(render(SCENE, passes=4).image, result.image)
    assert render(SCENE, passes=1, outputs=("depth",)).channels.keys() == {"depth"}


def test_one_pass_has_no_standard_error():
    names = ("standard_error", "half_interval")
    channels = render(SCENE, passes=1, outputs=names).channels
    assert all(np.isnan(channels[name]).all() for name in names)


def test_unknown_outputs_are_refused():
    with pytest.raises(ValueError, match="output is 'deepness': pass one of depth"):
        render(SCENE, outputs=("deepness",))


def test_an_output_is_one_function(monkeypatch, tmp_path):
    """Registered under its name: rendered, and kept with the names of its parts."""
    exr = pytest.importorskip("OpenEXR")

    def facing(behind):
        return np.stack([behind.hits.front_face, behind.hits.normal[:, 2]], axis=1)

    monkeypatch.setitem(OUTPUTS, "facing", Output(("U", "V"), facing))  # forgotten at the end
    result = render(SCENE, passes=1, outputs=["facing", "depth"])
    np.testing.assert_allclose(result.channels["facing"][5, 7], (1.0, 1.0), atol=1e-7)
    result.save(tmp_path / "a.exr")
    with exr.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert set(file.channels()) == {*"RGB", "depth", "facing.U", "facing.V"}
