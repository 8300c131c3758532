"""An integrator is known by its declaration alone."""

import json
from collections import defaultdict
from dataclasses import dataclass
from types import SimpleNamespace
from unittest import mock

import numpy as np
import pytest

from hybrid_rt.analysis.methods import default_methods
from hybrid_rt.cli.program import main
from hybrid_rt.integrators import INTEGRATORS, Declaration, Options
from hybrid_rt.integrators.direct_light import SurfaceLight
from hybrid_rt.integrators.integrator import Integrator
from hybrid_rt.integrators.options import Flag, setting
from hybrid_rt.integrators.workers import Workers
from hybrid_rt.lights import PointLight
from hybrid_rt.materials import Lambertian
from hybrid_rt.primitives import Rectangle
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

VIEW = Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40, 8, 6)
WALL = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian((0.1, 0.2, 0.3)))
SCENE = Scene(VIEW, [WALL], [PointLight((0, 0, 1), 1.0)])


@dataclass(frozen=True)
class ColorOptions(Options):
    gain: float = setting(1.0, Flag("gain", float, "G", "brightens ({})", "gain {:g}"))


class Colors(Integrator):
    """Shows the colour of what a ray meets first."""

    def _radiance(self, block):
        hits, _ = self._first_hits(block.origins, block.directions, None)
        light = SurfaceLight(self.context)
        return self.context.options.gain * light.colors(light.material(hits), hits)[:, 0]


@pytest.fixture
def colors(monkeypatch):
    declared = Declaration(
        name="colors",
        make=lambda context, threads: Workers(context, threads, Colors),
        finds=lambda _: "",
        options=ColorOptions,
        without_light_paths="no light is looked at",
    )
    monkeypatch.setitem(INTEGRATORS, "colors", declared)


def test_one_light_for_all_needs_a_strategy():
    """By default each light counts whole, so one of several would stand for itself alone."""
    context = SimpleNamespace(scene=compile_scene(SCENE), plan=defaultdict(bool))
    light = SurfaceLight(context)
    with pytest.raises(ValueError, match="make it with LIGHT_ONLY or BOTH"):
        light.from_one(None, None, None, None, None, None)


@pytest.mark.usefixtures("colors")
def test_a_render_asks_the_declaration():
    result = render(SCENE, "colors", 2, options=ColorOptions(2.0))
    np.testing.assert_allclose(result.image, np.broadcast_to((0.2, 0.4, 0.6), (6, 8, 3)), rtol=1e-6)
    assert result.report["plan"]["light"]["left_out"]["light paths"] == "no light is looked at"
    assert result.report["light_not_found"] == ["light straight from lamps without area (PDE)"]
    with pytest.raises(TypeError, match="integrator 'path' takes PathOptions"):
        render(SCENE, options=ColorOptions())
    with pytest.raises(TypeError, match="integrator 'whitted' takes no options"):
        render(SCENE, "whitted", options=Options())


@pytest.mark.usefixtures("colors")
def test_the_command_line_and_the_tools_ask_it_too(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    script = tmp_path / "s.py"
    script.write_text(
        "from hybrid_rt import *\n"
        "def scene():\n"
        "    wall = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.2))\n"
        "    return Scene(Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40, 8, 6), [wall])\n"
    )
    methods = default_methods(SCENE, ["colors"], {"gain": [1.0, 3.0], "photons": [7]})
    assert [method.name for method in methods] == ["colors, gain 1", "colors, gain 3"]
    assert methods[1].flags == "--integrator colors --gain 3.0"
    assert main(["render", "s.py", *methods[1].flags.split(), "--passes", "1", "--quiet"]) == 0
    settings = json.loads((tmp_path / "s.json").read_text("utf-8"))["settings"]
    assert settings["options"] == {"gain": 3.0}
    assert main(["render", "s.py", "--gain", "2"]) == 2
    assert "--gain: integrator 'path' has none, pass --integrator colors" in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main(["render", "--help"])
    assert "brightens (colors)" in capsys.readouterr().out


def test_a_scene_script_declares_an_integrator_with_flags(tmp_path, monkeypatch):
    """Its flags come too late to be read, and keep their defaults."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "s.py").write_text(
        "from hybrid_rt import *\n"
        "from hybrid_rt.integrators import INTEGRATORS\n"
        "from dataclasses import make_dataclass, replace\n"
        "from hybrid_rt.integrators.options import Flag, Options, setting\n"
        "gain = setting(1.0, Flag('fog', float, 'F', 'how much ({})', 'fog {:g}'))\n"
        "Fog = make_dataclass('Fog', [('fog', float, gain)], bases=(Options,), frozen=True)\n"
        "INTEGRATORS['own'] = replace(INTEGRATORS['whitted'], name='own', options=Fog)\n"
        "INTEGRATOR = 'own'\n"
        "def scene():\n"
        "    wall = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.2))\n"
        "    return Scene(Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), 40, 8, 6), [wall])\n"
    )
    with mock.patch.dict(INTEGRATORS):
        assert main(["render", "s.py", "--passes", "1", "--quiet"]) == 0
    settings = json.loads((tmp_path / "s.json").read_text("utf-8"))["settings"]
    assert settings["integrator"] == "own"


@pytest.mark.parametrize(
    ("wrong", "error", "message"),
    [
        ({"make": None}, TypeError, "make is None: pass a function"),
        ({"finds": "[LPK]DE"}, TypeError, "finds is '\\[LPK\\]DE': pass a function"),
        ({"finds": lambda _: "[LPK"}, ValueError, "finds returned '\\[LPK', which is no regular"),
        ({"finds": lambda _: None}, ValueError, "finds returned None, which is no regular"),
    ],
)
def test_a_declaration_that_cannot_be_used_is_refused(wrong, error, message):
    right = {"name": "mine", "make": print, "finds": lambda _: ""}
    assert Declaration(**right).finds(Options()) == ""
    with pytest.raises(error, match=f"Declaration 'mine': {message}"):
        Declaration(**(right | wrong))
