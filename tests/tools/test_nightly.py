"""The tool that runs what the ordinary suite leaves out says when it last did, and how it ended."""

import re
import runpy
import sys
from pathlib import Path

TOOL = Path(__file__).parents[2] / "tools" / "nightly.py"


def test_the_page_keeps_what_was_not_run_again(tmp_path, monkeypatch):
    parts = {"tests": ["-c", "print('3 passed')"], "stability": ["-c", "print('1 | 2'); exit(3)"]}
    page = tmp_path / "nightly.md"
    # The script's own globals: a dictionary that it shares with nobody.
    tool = runpy.run_path(str(TOOL))
    monkeypatch.setitem(tool["main"].__globals__, "PARTS", parts)
    rows = []
    for arguments, code in ([], 1), (["--only", "tests"], 0):
        monkeypatch.setattr(sys, "argv", ["nightly.py", *arguments, "--page", str(page)])
        assert tool["main"]() == code
        rows.append(page.read_text().splitlines()[-2:])
    (_, failed), (passed, kept) = rows
    assert kept == failed
    assert re.search(r"\d\d:\d\d UTC \| \S+ \| 0 \| holds: 3 passed \|$", passed)
    assert failed.endswith("**fails** (exit code 3): 1 / 2 |")


def test_the_ordinary_suite_leaves_out_what_is_marked(pytestconfig):
    options = pytestconfig.getini("addopts")
    assert options[options.index("-m") + 1] == "not nightly"
