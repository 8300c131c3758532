import csv
import json
import re
import runpy
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from hybrid_rt.analysis import hit_study, study_runs
from hybrid_rt.cli import main, study_files

ROOT = Path(__file__).parents[3]
TEAPOT = ROOT / "hybrid_rt" / "data" / "teapot.bpt"
SCRIPT = """
from hybrid_rt import Camera, GradientSky, Lambertian, Object, Scene
from meshing import SurfaceOfRevolution


def scene():
    camera = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
    tube = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
    return Scene(camera, [Object(tube, Lambertian(0.5))], environment=GradientSky(0.3, 1.0))
"""
SMALL = (
    "--quick --width 24 --passes 2 4 --reference-passes 32 --rays 500 --threads 1 --photons 2000"
)


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    (tmp_path / "tube.py").write_text(SCRIPT)
    (tmp_path / "flat.py").write_text(SCRIPT.replace("[Object(tube, Lambertian(0.5))]", "[]"))
    monkeypatch.chdir(tmp_path)

    def run_command(arguments):
        try:
            code = main(["study", *arguments.split()])
        except SystemExit as ended:  # by argparse
            code = ended.code
        return code, capsys.readouterr()

    return run_command


@pytest.mark.nightly
def test_study_of_a_scene_and_the_overlay_of_two(run, tmp_path):
    pytest.importorskip("matplotlib")
    code, captured = run(f"tube.py {SMALL} --out a")
    assert code == 0
    assert "Asked: which method renders this scene soonest to an error of 1 %" in captured.out
    assert "1 % cannot be judged: the reference is itself off by" in captured.out
    assert "--width 24 --height 16 --threads 1 --seed 1" in captured.out
    assert "phantom: rays that meet nothing" in captured.out
    assert "At equal time, " in captured.out
    assert "judged rays" in captured.out
    written = {path.name for path in (tmp_path / "a").iterdir()}
    reference = {"reference.npz", "reference.npz.json"}
    assert (
        written
        == {"curves.csv", "curves.json", "curves.pdf", "curves.png", "page.html", "tables.tex"}
        | reference
    )
    data = json.loads((tmp_path / "a" / "curves.json").read_text())
    assert [c["name"] for c in data["hits"]["curves"]][:3] == ["mesh", "refined", "certified"]
    paths = next(c for c in data["picture"]["curves"] if c["name"] == "path")
    assert [p["setting"] for p in paths["points"]] == [2, 4]
    photons = next(c for c in data["picture"]["curves"] if c["name"] == "ppm, 2000 photons")
    assert photons["flags"] == "--integrator ppm --photons 2000"
    assert photons["power"] == pytest.approx(2 / 3)
    # Whichever states the smaller error is the reference, and the other checks it.
    reference = data["picture"]["reference"]
    made_by = {reference["made_by"], reference["check"]["made_by"]}
    assert made_by in (
        {"path, certified, 32 passes", "ppm, 8 passes"},
        {"ppm, certified, 8 passes", "path, 32 passes"},
    )
    assert [p["setting"] for p in data["hits"]["newton"][0]["points"]] == [0, 1, 2, 3, 4, 6]
    with (tmp_path / "a" / "curves.csv").open() as file:
        rows = list(csv.DictReader(file))
    by_path = [row for row in rows if (row["method"], row["setting"]) == ("path", "4")]
    assert [(row["part"], row["run"]) for row in by_path] == [("picture", "1")]
    assert float(by_path[0]["error"]) == paths["points"][1]["error"]["median"]
    assert {row["run"] for row in rows if row["part"] == "hits"} == {""}

    code, captured = run("--compare a/curves.json a/curves.json --out both")
    assert code == 0
    assert "A: path" in captured.out
    assert "B: path" in captured.out
    # Whatever is known of a curve is read again: the forecasts of a run against itself are alike.
    assert re.search(r", path: (.*) in A, \1 in B\.", captured.out)
    assert (tmp_path / "both" / "page.html").read_text().count("data:image/svg+xml") == 4


def test_integrators_alone(run, tmp_path):
    code, captured = run(
        f"tube.py {SMALL} --only pictures --integrators path --certified-only --out alone"
    )
    assert code == 0
    assert "path, mesh" not in captured.out
    data = json.loads((tmp_path / "alone" / "curves.json").read_text())
    assert [curve["name"] for curve in data["picture"]["curves"]] == ["path"]
    assert [slope["method"] for slope in data["picture"]["slopes"]] == ["path"]
    assert "\\begin{tabular}" in (tmp_path / "alone" / "tables.tex").read_text()


SURFACE = f"{TEAPOT} --quick --rays 300 --threads 1"


def test_a_comparison_replaces_none_of_its_runs_and_is_none(run, tmp_path, monkeypatch):
    def closed(_):
        raise OSError("the pipe is closed")

    assert run(f"{SURFACE} --out a")[0] == 0
    before = (tmp_path / "a" / "curves.json").read_bytes()
    code, captured = run("--compare a/curves.json a/curves.json --out ./a")
    assert code == 2
    assert "--out a is the folder of a/curves.json, which would be replaced: name" in captured.err
    assert (tmp_path / "a" / "curves.json").read_bytes() == before
    with monkeypatch.context() as patched:  # files are written before anything is printed
        patched.setattr(study_files, "say", closed)
        assert run("--compare a/curves.json a/curves.json --out both")[0] == 2
    code, captured = run("--compare both/curves.json a/curves.json")
    assert code == 2
    assert "both/curves.json holds no figures of its own, but a comparison: pass" in captured.err


@pytest.mark.parametrize("name", ["curves.json", "curves.csv", "reference.npz"])
def test_a_file_that_cannot_be_written_is_said_before_the_work(run, tmp_path, name):
    (tmp_path / "a" / name).mkdir(parents=True)
    code, captured = run(f"tube.py {SMALL} --out a")
    assert code == 2
    assert f"{name}' cannot be written (it is a folder): name another file" in captured.err
    assert "..." not in captured.err


def test_an_error_after_the_pictures_keeps_them(run, tmp_path, monkeypatch):
    def no_memory(*_):
        raise MemoryError("Unable to allocate 745. GiB")

    monkeypatch.setattr(hit_study, "camera_rays", no_memory)
    some = "tube.py --quick --width 8 --threads 1 --certified-only --integrators whitted"
    some += " --passes 1 2 --reference-passes 8 --reference-by path"
    code, captured = run(f"{some} --out a")
    assert code == 2
    assert "Unable to allocate 745. GiB" in captured.err
    assert "Pictures" in captured.out
    assert json.loads((tmp_path / "a" / "curves.json").read_text())["picture"]["curves"]
    # Pictures alone need no rays.
    code, captured = run(f"{some} --only pictures")
    assert code == 0
    assert captured.out


@pytest.fixture
def replace_render(monkeypatch):
    """Let a function take the place of `run_method`; its first argument is the one replaced."""

    def replace(run_method):
        monkeypatch.setattr(study_runs, "run_method", partial(run_method, study_runs.run_method))

    return replace


def test_by_seconds_against_a_kept_reference(run, tmp_path, replace_render):
    """A pass takes 0.01 s by Whitted's method and 0.1 s by ppm: a second is 100 passes, and 10."""

    def run_method(as_before, scene, method, passes, *rest):
        result = as_before(scene, method, passes, *rest)
        total = passes * {"whitted": 0.01, "ppm": 0.1}[method.integrator]
        seconds = {**result.report.seconds, "total": total}
        return replace(result, report=replace(result.report, seconds=seconds))

    replace_render(run_method)
    some = "tube.py --quick --width 24 --threads 1 --only pictures --certified-only --photons 2000 --integrators whitted ppm"
    code, captured = run(f"{some} --passes 1 --reference-passes 8 --out a")
    assert code == 0
    kept = Path("a") / "reference.npz"
    assert f"wrote {kept}: --reference {kept} spares it next time" in captured.err
    code, captured = run(f"{some} --seconds 1 --runs 2 --reference {kept} --out b")
    assert code == 0
    assert "reference of" not in captured.err
    assert "2 methods: whitted; ppm, 2000 photons" in captured.err
    assert "each up to about 1.0 s, together about 5.3 s" in captured.err
    curves = json.loads((tmp_path / "b" / "curves.json").read_text())["picture"]["curves"]
    passes = {curve["name"]: [p["setting"] for p in curve["points"]] for curve in curves}
    assert passes == {"whitted": [1, 4, 16, 100], "ppm, 2000 photons": [1, 4, 10]}
    assert "10 of the slowest method, 100 of the fastest; 2 runs of each" in captured.out
    assert "At equal time, 1.00 s" in captured.out
    assert not (tmp_path / "b" / "reference.npz").exists()


def test_ctrl_c_keeps_the_pictures_measured(run, replace_render):
    made = []

    def run_method(as_before, scene, method, passes, *rest):
        made.append((method.name, passes))
        if made[-1] == ("whitted", 4):
            raise KeyboardInterrupt
        return as_before(scene, method, passes, *rest)

    replace_render(run_method)
    code, captured = run(
        f"tube.py {SMALL} --passes 1 4 --integrators path whitted --certified-only"
    )
    assert code == 130
    assert made[-2:] == [("path", 4), ("whitted", 4)]
    rows = [line.split()[:2] for line in captured.out.split("Pictures\n")[1].splitlines()[1:4]]
    assert rows == [["path", "1"], ["path", "4"], ["whitted", "1"]]


def test_surface_alone(run):
    code, captured = run(f"surface {TEAPOT} {SMALL}")
    assert code == 0
    assert "First hits" in captured.out
    assert "Pictures" not in captured.out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ("missing.py", 2, "scene script 'missing.py'"),
        ("surface", 2, "surface has no file: name a .bpt file"),
        ("tube.py flat.py", 2, "tube.py and flat.py are two studies: name one at a time"),
        ("tube.py --compare x.json y.json", 2, "measures nothing: leave out tube.py"),
        ("--compare tube.py tube.py", 2, "tube.py holds no figures: pass the curves.json"),
        (f"tube.py {SMALL} --rays 0", 2, "argument --rays: '0': pass a whole number from 1 on"),
        (
            "tube.py --seconds 1 --passes 4",
            2,
            "argument --passes: not allowed with argument --seconds",
        ),
        (f"tube.py {SMALL} --integrators magic", 2, "integrator is 'magic'"),
        (
            "flat.py --only hits",
            2,
            "flat.py has no surface that ends, whose first hits could be timed: leave out --only",
        ),
    ],
)
def test_bad_input_is_refused(run, arguments, code, words):
    found, captured = run(arguments)
    assert found == code
    assert words in captured.err


@pytest.mark.parametrize("name", ["error_vs_time", "tessellation_accuracy"])
def test_tools_are_the_commands(name, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", [f"{name}.py", "missing.bpt", "--quick"])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(ROOT / "tools" / f"{name}.py"), run_name="__main__")
    assert ended.value.code == 2
    message = capsys.readouterr().err
    assert message.startswith(f"{name}.py: ")
    assert "missing.bpt" in message
