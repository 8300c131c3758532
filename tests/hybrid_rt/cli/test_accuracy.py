import csv
import json
from itertools import pairwise
from pathlib import Path

import pytest

from hybrid_rt.cli import main

BALL = """
from hybrid_rt import Camera, GradientSky, Lambertian, Object, Scene
from meshing import circular_arc, SurfaceOfRevolution



def scene():
    camera = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
    profile, weights = circular_arc((0, 0), 1.0, 0.5, 0.0)
    return Scene(camera, [Object({}, Lambertian(0.5))], environment=GradientSky(0.3, 1.0))
"""
CURVED = "SurfaceOfRevolution(profile, (0, 0, 0), (0, 0, 1), weights=weights)"


@pytest.fixture
def run(tmp_path, monkeypatch, capsys):
    (tmp_path / "ball.py").write_text(BALL.format(CURVED))
    flat = BALL.replace(
        "import circular_arc", "import circular_arc\nfrom hybrid_rt import Sphere\n#"
    )
    (tmp_path / "flat.py").write_text(flat.format("Sphere((0, 0, 0), 1.0)"))
    monkeypatch.chdir(tmp_path)

    def run_command(arguments):
        code = main(["accuracy", *arguments.split()])
        return code, capsys.readouterr()

    return run_command


def test_finer_meshes_are_nearer_and_stay_within_what_is_proven(run, tmp_path):
    (tmp_path / "made").mkdir()
    (tmp_path / "made" / "notes.txt").touch()
    code, captured = run("ball.py --quick --rays 2000 --threads 1 --out made")
    assert code == 0
    written = captured.out.splitlines()[-1].removeprefix("wrote ").split(", ")
    assert {"made/table.json", "made/table.csv"} <= set(written)
    assert {Path(file) for file in written} == set(Path("made").iterdir()) - {
        Path("made/notes.txt")
    }
    assert "Exactness costs" in captured.out
    rungs = json.loads((tmp_path / "made" / "table.json").read_text())
    assert len(rungs) == 3
    for coarse, fine in pairwise(rungs):
        assert fine["triangles"] > coarse["triangles"]
        assert fine["bound"] < coarse["bound"]
    assert all(rung["worst"] <= rung["bound"] <= rung["tolerance"] for rung in rungs)
    with (tmp_path / "made" / "table.csv").open() as file:
        assert len(list(csv.reader(file))) == 4


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ("missing.bpt", "missing.bpt"),
        ("flat.py", "flat.py has neither patches nor a surface of revolution"),
        ("ball.py --redraw made/table.json", "--redraw has no folder: pass --out as well"),
        ("ball.py --redraw ball.py --out made", "ball.py holds no table"),
    ],
)
def test_bad_input_is_refused(run, arguments, words):
    code, captured = run(arguments)
    assert code == 2
    assert words in captured.err


@pytest.mark.parametrize("name", ["table.json", "table.csv"])
def test_files_of_others_in_the_folder_stay(name, tmp_path, capsys):
    """Before anything is measured; figures of an earlier run are replaced."""
    (tmp_path / name).write_text('{"mine": 1}')
    script = str(Path(__file__).parents[3] / "scenes" / "vase.py")
    assert main(["accuracy", script, "--quick", "--out", str(tmp_path)]) == 2
    said = capsys.readouterr().err
    assert f"has a file '{name}', and 'table.json' there is not of an earlier run: name" in said
    assert (tmp_path / name).read_text() == '{"mine": 1}'
    assert len(list(tmp_path.iterdir())) == 1
