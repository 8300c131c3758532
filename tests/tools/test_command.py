"""Tools end with an exit code and a line, and keep what they have found when they are stopped."""

import argparse
import importlib.util
import io
import json
import resource
import runpy
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from hybrid_rt.cli import command
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from proof.cases import campaign

TOOLS = Path(__file__).parents[2] / "tools"


def test_ctrl_c_keeps_what_was_found(tmp_path, monkeypatch, capsys):
    """The first figures of one scene are there when the second ones are interrupted."""

    def stopped(*arguments, **options):
        yield next(run(*arguments, **options))
        raise KeyboardInterrupt

    run = campaign.run
    monkeypatch.setattr(campaign, "run", stopped)
    file = tmp_path / "figures.json"
    words = ["verify.py", "--hard", "500", "--only", "vase", "--out", str(file)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / "verify.py"), run_name="__main__")
    assert ended.value.code == 130
    captured = capsys.readouterr()
    assert "vase   " in captured.out
    assert "interrupted: what was found so far stands above" in captured.err
    assert json.loads(file.read_text())[0]["count"]["rays"] == 500


@pytest.mark.parametrize(
    ("change", "words", "code"),
    [
        ({}, "500 rays, 0 faults", 0),
        ({"bounds_broken": 1}, "500 rays, 1 faults", 1),
        ({"rays": 0}, "0 rays, 0 faults", 1),
    ],
)
def test_what_breaks_a_promise_or_judges_nothing_fails(change, words, code, monkeypatch, capsys):
    def spoiled(*arguments, **options):
        for group in run(*arguments, **options):
            group.count = replace(group.count, unmarked=0, **change)
            yield group

    run = campaign.run
    monkeypatch.setattr(campaign, "run", spoiled)
    monkeypatch.setattr(sys, "argv", ["verify.py", "--hard", "500", "--only", "vase"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / "verify.py"), run_name="__main__")
    assert ended.value.code == code
    assert words in capsys.readouterr().out


@pytest.mark.parametrize("end", [KeyboardInterrupt, MemoryError])
@pytest.mark.parametrize("figures", [[1, 2], []])
def test_whatever_ends_a_block_its_figures_are_kept_and_an_earlier_file_if_there_are_none(
    tmp_path, end, figures
):
    file = tmp_path / "figures.json"
    file.write_text("[7]")
    with pytest.raises(end), command.kept(file, lambda: figures):
        raise end
    assert json.loads(file.read_text()) == (figures or [7])


def test_the_minutes_of_random_cases_are_checked_before_any_row(tmp_path, monkeypatch, capsys):
    words = ["stability.py", "--only", "A01", "--fuzz", "0", "--out", str(tmp_path / "new")]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / "stability.py"), run_name="__main__")
    assert ended.value.code == 2
    out, error = capsys.readouterr()
    assert out == ""
    assert "--fuzz is 0" in error
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("nowhere/a.json", "nowhere': make it, or name another"),
        ("folder", "folder' cannot be written (it is a folder): name another file"),
    ],
)
def test_figures_that_cannot_be_kept_are_refused_first(tmp_path, capsys, name, words):
    (tmp_path / "folder").mkdir()

    def main():
        with command.kept(tmp_path / name, dict):
            raise AssertionError("began")

    assert command.run_tool(main) == 2
    assert words in capsys.readouterr().err


def test_figures_that_a_full_disk_loses_are_named(tmp_path):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (2**15, limits[1]))
    try:
        with (
            pytest.raises(OSError, match=r"a\.json' cannot be written \(File too large\): name"),
            command.kept(tmp_path / "a.json", lambda: [0.5] * 2**14),
        ):
            pass
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)


def test_an_error_whose_text_raises_is_called_by_its_kind(capsys):
    class BadError(ValueError):
        def __str__(self):
            raise self

    def main():
        raise BadError

    assert command.run_tool(main) == 2
    assert capsys.readouterr().err.endswith(": BadError\n")


def test_letters_that_the_output_does_not_have_are_numbers(monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)

    def main():
        sys.stdout.write("3.5°\n")
        return 0

    assert command.run_tool(main) == 0
    assert stream.buffer.getvalue() == b"3.5\\xb0\n"


@pytest.fixture
def without(monkeypatch):
    """Make a package look as if it were not installed."""

    def hide(package):
        find = importlib.util.find_spec
        monkeypatch.setattr(
            importlib.util, "find_spec", lambda name: None if name == package else find(name)
        )

    return hide


@pytest.fixture
def refusal_of(monkeypatch, capsys):
    """Return a function that runs a tool, which says nothing but why it refuses its words."""

    def run(words):
        monkeypatch.setattr(sys, "argv", words)
        with pytest.raises(SystemExit) as ended:
            runpy.run_path(str(TOOLS / words[0]), run_name="__main__")
        assert ended.value.code == 2
        out, error = capsys.readouterr()
        assert out == ""
        return error

    return run


def test_spots_that_cannot_be_drawn_are_said_before_they_are_traced(
    without, tmp_path, monkeypatch, refusal_of
):
    without("matplotlib")
    monkeypatch.chdir(tmp_path)
    error = refusal_of(["lens_spots.py", "--out", "spots.png"])
    assert error == (
        "lens_spots.py: --out spots.png: the spots need matplotlib: pip install 'hybrid-rt[plot]', "
        "or leave out --out\n"
    )


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (
            [
                "calibrate.py", "--integrator", "whitted", "--picture", "caustic edge",
                "--blur-seeds", "0", "--hits", "0", "--exact-hits", "0",
            ],
            "no picture is by whitted: 'caustic edge' is by ppm. Pass one of these as --integrator, or",
        ),
        (["calibrate.py", "--seeds", "1"], "--seeds is 1, which tells nothing of the noise: pass 2"),
        (["bench_render.py", "--caustics", "--width", "7"], "--width: nothing of this kind of run"),
        (["bench_render.py", "a.py", "--photons", "7"], "--photons: nothing of this kind of run"),
        (
            ["bench_render.py", "a.py", "--against", "b", "--targets", "0.1"],
            "--targets: nothing of this kind of run depends on it, leave it out",
        ),
    ],
)  # fmt: skip
def test_what_would_be_ignored_or_check_nothing_is_refused(words, refusal, refusal_of):
    error = refusal_of(words)
    assert refusal in error


@pytest.mark.parametrize(
    ("integrator", "options"),
    [("ppm", PPMOptions(7)), ("photon_map", PhotonMapOptions(7)), ("path", None)],
)
@pytest.mark.parametrize("measure", ["_measure", "_memory"])
def test_speed_and_memory_are_those_of_the_photons_asked_for(
    integrator, options, measure, tmp_path, monkeypatch
):
    class AskedError(Exception):
        """Nothing need be rendered."""

    def asked(*_, **settings):
        raise AskedError(settings["options"])

    (tmp_path / "empty.py").write_text(
        "from hybrid_rt import Camera, Scene\n"
        "def scene():\n"
        "    return Scene(Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=4, height=3), [])\n"
    )
    function = runpy.run_path(str(TOOLS / "bench_render.py"))[measure]
    monkeypatch.setitem(function.__globals__, "render", asked)
    words = argparse.Namespace(integrator=integrator, photons=7, threads=1, width=None)
    with pytest.raises(AskedError) as found:
        function(tmp_path / "empty.py", "none", words)
    assert found.value.args == (options,)


def test_what_was_rendered_is_shown_and_kept_before_memory_is_measured(
    tmp_path, monkeypatch, capsys
):
    """Ctrl-C in the last part of a scene loses none of its figures but the memory."""
    curve = [{"passes": 1, "seconds": {"total": 2.0}, "relmse": 0.5, "trimmed": 0.25}]
    row = {
        "scene": "a", "integrator": "path", "coarse": {"stage": "none", "share_of_seconds": 0.0},
        "size": [4, 3], "rays_per_second": 1e6, "rays_per_camera_ray": 2.0, "curve": curve,
        "relmse_of_reference": 0.1, "seconds_to": {"0.01": 3.0, "0.001": 4.0}, "photons": None,
        "peak_memory_mib": 8.0,
    }  # fmt: skip
    tool = runpy.run_path(str(TOOLS / "bench_render.py"))

    def apart(function, *_):
        if function is tool["_memory"]:
            raise KeyboardInterrupt
        return row

    monkeypatch.setitem(tool["main"].__globals__, "_apart", apart)
    file = tmp_path / "a.json"
    monkeypatch.setattr(sys, "argv", ["bench_render.py", "a.py", "--json", str(file)])
    assert command.run_tool(tool["main"]) == 130
    assert "to relMSE 0.01: 3.00 s" in capsys.readouterr().out
    assert [one["scene"] for one in json.loads(file.read_text())] == ["a"]


@pytest.mark.parametrize("tool", sorted(TOOLS.glob("*.py")), ids=lambda path: path.stem)
def test_help_keeps_its_lines(tool, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [tool.name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(tool), run_name="__main__")
    assert ended.value.code == 0
    about = runpy.run_path(str(tool))["__doc__"].strip()
    assert about in capsys.readouterr().out
