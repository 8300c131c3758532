"""Tools end with an exit code and a line, and keep what they have found when they are stopped."""

import json
import runpy
import sys
import time
from pathlib import Path

import pytest

from hybrid_rt import command, progress
from hybrid_rt.verify import campaign

TOOLS = Path(__file__).parents[2] / "tools"


def test_ctrl_c_keeps_what_was_found(tmp_path, monkeypatch, capsys):
    """The first figures of one scene are there when the second ones are interrupted."""

    def stopped(*arguments):
        yield next(steps(*arguments))
        raise KeyboardInterrupt

    steps = campaign.steps
    monkeypatch.setattr(campaign, "steps", stopped)
    file = tmp_path / "figures.json"
    words = ["verify_hits.py", "--rays", "500", "--scene", "vase", "--out", str(file)]
    monkeypatch.setattr(sys, "argv", words)
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / "verify_hits.py"), run_name="__main__")
    assert ended.value.code == 130
    captured = capsys.readouterr()
    assert "vase: 500 rays" in captured.out
    assert "interrupted: what was found so far stands above" in captured.err
    assert json.loads(file.read_text())["vase"]["verdict"]["rays"] > 0


@pytest.mark.parametrize(
    ("name", "words"),
    [("nowhere/a.json", "has no folder"), ("folder", "is a folder: name a file")],
)
def test_figures_that_cannot_be_kept_are_refused_first(tmp_path, capsys, name, words):
    (tmp_path / "folder").mkdir()

    def main():
        with command.kept(tmp_path / name, dict):
            raise AssertionError("began")

    assert command.run_tool(main) == 2
    assert words in capsys.readouterr().err


def test_long_compilations_are_announced(monkeypatch, capsys):
    monkeypatch.setattr(progress, "ANNOUNCE_AFTER", 0.0)

    def main():
        from numba import njit

        njit(lambda x: x + 1)(1)
        time.sleep(0.1)
        return 7

    assert command.run_tool(main) == 7
    assert capsys.readouterr().err == "Compiling kernels (first run only) ...\n"


@pytest.mark.parametrize("tool", sorted(TOOLS.glob("*.py")), ids=lambda path: path.stem)
def test_help_keeps_its_lines(tool, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [tool.name, "--help"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(tool), run_name="__main__")
    assert ended.value.code == 0
    about = runpy.run_path(str(tool))["__doc__"].strip()
    assert about in capsys.readouterr().out
