"""Each setting of a render is declared once: `render`, the command line and the store agree."""

import argparse
import inspect
import re
from dataclasses import fields

import pytest

from hybrid_rt import Camera, PPMOptions, Scene, render
from hybrid_rt.cli.options import add_render_options
from hybrid_rt.rendering.arguments import Arguments, other_names
from hybrid_rt.rendering.settings import Settings, declared_in

DECLARED = declared_in(Arguments)
SCENE = Scene(Camera((0, 0, 2), (0, 0, 0), (0, 1, 0), width=2, height=2), [])


def test_render_takes_and_explains_every_setting():
    taken = list(inspect.signature(render).parameters.values())
    assert taken[0].name == "scene"
    assert [(one.name, one.default) for one in taken[1:]] == [
        (one.name, one.default) for one in fields(Arguments)
    ]
    positional = [one.name for one in taken if one.kind is one.POSITIONAL_OR_KEYWORD]
    assert positional == ["scene", "integrator", "passes", "time_budget", "target_error"]
    explained = re.findall(r"^    (\w[\w, ]*?)(?: : .*)?$", render.__doc__, re.MULTILINE)
    assert set(DECLARED) <= {name for names in explained for name in names.split(", ")}


def test_options_have_the_defaults_of_render():
    """But for the integrator, which a scene script may name."""
    parser = argparse.ArgumentParser()
    add_render_options(parser)
    given = vars(parser.parse_args([]))
    assert given.pop("integrator") is None
    for one in fields(Arguments):
        if DECLARED[one.name].help and one.name in given:
            assert given[one.name] == one.default
    without = {name for name, setting in DECLARED.items() if not setting.help}
    assert without == {"options", "progress", "watch"}


@pytest.mark.parametrize(
    ("words", "name", "value"),
    [
        ("--passes 1e3", "passes", 1000),
        ("--time-budget 1.5", "time_budget", 1.5),
        ("--target-error-trimmed 2%", "target_error_trimmed", 0.02),
        ("--outputs depth,,uv", "outputs", ("depth", "uv")),
        ("--resume", "resume", True),
    ],
)
def test_options_are_read_as_render_takes_them(words, name, value):
    parser = argparse.ArgumentParser()
    add_render_options(parser)
    assert getattr(parser.parse_args(words.split()), name) == value


def test_what_decides_the_bits_of_a_pass_is_what_a_store_compares():
    """Neither threads nor the coarse stage do, nor limits: a store of earlier versions goes on."""
    settings = Settings("ppm", passes=3, threads=2, coarse="none", options=PPMOptions(500))
    assert settings.decisive == {
        "integrator": "ppm", "seed": 0, "max_depth": 16, "accuracy": "certified", "tolerance": None,
        "options": {"photons_per_pass": 500, "alpha": 2 / 3, "initial_radius": None},
    }  # fmt: skip
    assert Settings().decisive["options"] is None


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"passes": 0}, "passes is 0: pass an integer from 1"),
        ({"passes": 2.5}, "passes is 2.5: pass an integer"),
        ({"time_budget": -1.0}, "time_budget is -1: pass a finite number above 0"),
        ({"time_budget": float("nan")}, "time_budget is nan: pass a finite number above 0"),
        ({"target_error": -0.01}, "target_error is -0.01"),
        ({"target_error_trimmed": 0.0}, "target_error_trimmed is 0"),
        ({"target_error": 2}, "target_error is 2: .*a share: 0.05 for 5 %"),
        ({"seed": -1}, "seed is -1: pass an integer from 0"),
        ({"threads": 0}, "threads is 0: pass an integer from 1"),
        ({"max_depth": -1}, "max_depth is -1: pass an integer from 0"),
        ({"max_depth": None}, "max_depth is None: pass an integer"),
        ({"integrator": "magic"}, "integrator is 'magic': pass one of path"),
        ({"options": PPMOptions(9)}, "options are PPMOptions.*: integrator 'path' takes PathOptions"),
        ({"accuracy": "exact"}, "accuracy is 'exact': pass one of"),
        ({"coarse": "triangles"}, "coarse is 'triangles': pass one of embree, none"),
        ({"tolerance": -1.0}, "tolerance is -1"),
        ({"coarse": "none", "accuracy": "mesh"}, 'coarse="none" leaves no triangles'),
        ({"outputs": ["z"]}, "output is 'z': pass one of depth"),
        ({"progress": 3}, r"progress is 3: pass a function such as progress_bar\(\)"),
        ({"watch": 3}, "watch is 3, without 'film_lock'"),
        ({"resume": True}, "resume is True, but there is no store"),
        ({"resume": 1}, "resume is 1: pass True or False"),
        ({"cluster": "here"}, "cluster is 'here': pass 'tcp://HOST:PORT' or 'local:N'"),
        ({"iterations": 3}, "render has no argument 'iterations': pass passes"),
    ],
)  # fmt: skip
def test_what_is_out_of_range_is_refused(keywords, message):
    with pytest.raises((ValueError, TypeError), match=message):
        render(SCENE, **keywords)


def test_photons_beyond_the_machines_memory_are_refused():
    words = "passes of 1000000000000 photons takes about .* TiB of memory, this process can have"
    with pytest.raises(MemoryError, match=words):
        render(SCENE, "ppm", options=PPMOptions(10**12))


def test_names_of_other_programs_are_of_settings_and_none_of_them():
    assert set(other_names().values()) <= set(DECLARED)
    assert not set(other_names()) & set(DECLARED)
