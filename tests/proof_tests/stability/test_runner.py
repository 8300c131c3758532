"""What runs rows: verdicts, limits, crashes, missing ids; and the tool's exit codes."""

import json
import os
import runpy
import sys
import time
from pathlib import Path

import pytest

from proof.stability import fuzz, runner
from proof.stability.row import (
    IDS,
    NOT_BUILT,
    Effort,
    Outcome,
    Plot,
    Row,
    all_ids,
    all_rows,
)
from proof.stability.runner import Result, expand, run_rows

TOOL = Path(__file__).parents[3] / "tools" / "stability.py"
SOME = ("T01", "T02", "T03", "T04", "T05", "T06", "T07", "D29")


def _right(effort):
    values = [1e-3, 1e-2], [1e-16, 0.0], [1e-15, 1e-15], [3.0, 4.0]
    curve = Plot("angle", "cone", "size", *values)
    return Outcome(rays=effort.count(100), error=0.5, work=4, curves=(curve,))


def _wrong(_):
    return Outcome(rays=3, wrong=1)


def _raises(_):
    raise RuntimeError("no such luck")


def _hangs(_):
    time.sleep(60)


def _dies(_):
    os._exit(7)


def _large(_):
    return Outcome(rays=1, error=1.5)


def some_rows():
    """Rows of every sort; T07 is missing."""
    runs = (_right, _wrong, _raises, _hangs, _dies, _large)
    return {f"T{k:02d}": Row(f"T{k:02d}", f.__name__, "none", f) for k, f in enumerate(runs, 1)}


def test_every_row_gets_its_verdict():
    effort = Effort(0.25)
    results = list(run_rows((), effort, limit=2.0, rows=some_rows, ids=SOME))
    assert [r.verdict for r in results] == [
        "holds", "fails", "fails", "does not end", "crashed", "fails", "missing",
        "not built: normal maps",
    ]  # fmt: skip
    assert [r.is_right for r in results] == [True, *[False] * 6, True]
    assert results[0].outcome.rays == 25
    assert results[2].outcome.faults == ("raised RuntimeError: no such luck",)
    assert "within 2 s" in results[3].outcome.faults[0]
    assert "process ended" in results[4].outcome.faults[0]
    json.dumps([r.figures() for r in results])


def test_words_select_rows_by_how_they_begin():
    assert expand(["B"]) == [row for row in IDS if row.startswith("B")]
    assert expand(["A01", " C13"]) == ["A01", "C13"]
    assert expand([]) == list(all_ids())
    assert expand(["G01"]) == ["G01"]
    with pytest.raises(ValueError, match=r"--only names 'Z9'"):
        expand(["A01", "Z9"])
    with pytest.raises(ValueError, match=r"--only names 'A011'"):
        expand(["A011"])


def test_the_register_has_the_rows_of_the_catalogue():
    rows = all_rows()
    assert {row_id for row_id in rows if row_id[0] != "G"} == set(IDS) - set(NOT_BUILT)
    assert all(row.title and row.truth for row in rows.values())


def _tool(monkeypatch, arguments, results):
    monkeypatch.setattr(sys, "argv", [str(TOOL), *arguments])
    monkeypatch.setattr(runner, "run_rows", lambda *_, **__: iter(results))
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOL), run_name="__main__")
    return ended.value.code


@pytest.mark.parametrize(
    ("verdicts", "code"),
    [
        (("holds", "not built: NURBS"), 0),
        (("holds", "fails"), 1),
        (("holds", "missing"), 1),
        (("does not end",), 1),
        (("crashed",), 1),
    ],
)
def test_the_exit_code_says_whether_all_hold(monkeypatch, tmp_path, capsys, verdicts, code):
    results = [
        Result(f"T{k:02d}", "a title", "a truth", verdict, _right(Effort()), 1.5)
        for k, verdict in enumerate(verdicts)
    ]
    assert _tool(monkeypatch, ["--only", "A", "--quick", "--out", str(tmp_path)], results) == code
    figures = json.loads((tmp_path / "stability.json").read_text())
    assert [row["verdict"] for row in figures["rows"]] == list(verdicts)
    page = (tmp_path / "stability.html").read_text()
    assert page.count('<img class="diagram"') == 2  # error and work
    assert "http" not in page
    assert "T00" in capsys.readouterr().out


def test_bad_ids_are_refused_by_name(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys, "argv", [str(TOOL), "--only", "A01,Q7", "--out", str(tmp_path)])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOL), run_name="__main__")
    assert ended.value.code == 2
    assert "Q7" in capsys.readouterr().err


def test_the_tool_keeps_what_random_search_finds(monkeypatch, tmp_path):
    failure = fuzz.Failure({"kind": "file", "text": "x"}, ("does not hold",))
    monkeypatch.setattr(fuzz, "run_fuzz", lambda *_: [failure])
    assert _tool(monkeypatch, ["--only", "A07", "--fuzz", "1", "--out", str(tmp_path)], []) == 1
    kept = json.loads((tmp_path / "stability.json").read_text())
    assert kept["fuzz"] == [{"case": failure.case, "faults": ["does not hold"]}]
