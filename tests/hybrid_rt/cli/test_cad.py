"""CAD files on the command line: what they hold, rays of a file, pictures."""

import csv
import json
import re

import numpy as np
import pytest

from hybrid_rt import Intersector, read_cad
from hybrid_rt.cli import main

shapes = pytest.importorskip("cad_shapes", reason="needs OCP")


@pytest.fixture(scope="module")
def part(tmp_path_factory):
    return shapes.write(shapes.drilled_cylinder(), tmp_path_factory.mktemp("cad") / "part.brep")


@pytest.fixture(scope="module")
def rays(part):
    rng = np.random.default_rng(6)
    aims = rng.uniform((-12, -12, -2), (12, 12, 42), (1000, 3))
    ways = rng.normal(size=(1000, 3))
    rows = np.hstack([aims - 20 * ways, ways]).astype(np.float32)
    file = part.with_name("rays.npy")
    np.save(file, rows)
    return file


def test_a_part_is_described(part, capsys):
    assert main(["cad", str(part)]) == 0
    text = capsys.readouterr().out
    assert "1 part(s) of 1 shape(s), 1 closed; 4 faces" in text
    assert text.split("cylinder")[1].split()[:4] == ["2", "0", "0", "0"]
    assert "free edges: 0" in text


def test_it_is_described_as_json(part, capsys):
    assert main(["cad", str(part), "--json", "--unit", "m"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["unit"] == "m"
    assert report["faces"] == {"cylinder": {"exact": 2}, "plane": {"exact": 2}}
    assert len(report["faces_listed"]) == 4
    assert np.ptp(report["bounds"], axis=0)[2] == pytest.approx(
        0.04, rel=1e-4
    )  # surfaces reach a little beyond their edges


def test_rays_of_a_file_are_traced_in_pieces(part, rays, tmp_path, capsys):
    model = read_cad(part)
    rows = np.load(rays).astype(np.float64)
    hits = Intersector(model.surfaces, coarse="none").intersect(rows[:, :3], rows[:, 3:])
    out, table = tmp_path / "hits.npz", tmp_path / "hits.csv"
    assert main(["rays", str(part), str(rays), "--out", str(out), "--piece", "300"]) == 0
    assert f"1,000 rays, {hits.hit.sum()} hit" in capsys.readouterr().out
    with np.load(out) as found:
        assert (found["t"] == hits.t).all()  # the same bits, in whatever pieces
        assert (found["face"][hits.hit] == model.face_at(hits)[hits.hit]).all()
        assert (found["face"][~hits.hit] == -1).all()
    assert main(["rays", str(part), str(rays), "--out", str(table), "--piece", "999"]) == 0
    lines = list(csv.DictReader(table.read_text().splitlines()))
    assert [float(line["t"]) for line in lines] == hits.t.tolist()


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("none.npy", None, "there is no such file"),
        ("text.npy", "1 2 3", "is no .npy file"),
        ("flat.npy", np.zeros((4, 3)), r"holds \(4, 3\) of float64: pass real numbers \(n, 6\)"),
        ("both.npy", np.zeros((4, 6), complex), r"holds \(4, 6\) of complex128: pass real"),
        ("folder", "folder", "is a folder: pass a file"),
    ],
)
def test_rays_that_are_none_are_named(part, tmp_path, capsys, name, content, words):
    if name == "folder":
        (tmp_path / name).mkdir()
    elif isinstance(content, str):
        (tmp_path / name).write_text(content)
    elif content is not None:
        np.save(tmp_path / name, content)
    arguments = ["rays", str(part), str(tmp_path / name), "--out", str(tmp_path / "hits.npz")]
    assert main(arguments) == 2
    assert re.search(words, capsys.readouterr().err)
    assert not (tmp_path / "hits.npz").exists()


@pytest.mark.parametrize("ending", ["npz", "csv", "parquet"])
def test_columns_have_names_without_rays_too(part, tmp_path, ending):
    if ending == "parquet":
        pytest.importorskip("pyarrow")
    rays, out = tmp_path / "none.npy", tmp_path / f"hits.{ending}"
    np.save(rays, np.empty((0, 6)))
    assert main(["rays", str(part), str(rays), "--out", str(out)]) == 0
    if ending == "npz":
        with np.load(out) as found:
            assert found["face"].shape == (0,)
    elif ending == "csv":
        assert out.read_text().startswith("t,face,part,")
    else:
        from pyarrow import parquet

        assert parquet.read_table(out).column_names[:3] == ["t", "face", "part"]


def test_rays_are_written_as_parquet(part, rays, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    out, same = tmp_path / "hits.parquet", tmp_path / "hits.npz"
    for file in (out, same):
        assert main(["rays", str(part), str(rays), "--out", str(file), "--piece", "300"]) == 0
    table = parquet.read_table(out)
    with np.load(same) as found:
        assert set(table.column_names) == set(found.files)
        for name in found.files:
            np.testing.assert_array_equal(table[name].to_pylist(), found[name])


def test_how_fine_a_mesh_of_a_part_must_be(part, capsys):
    assert main(["accuracy", str(part), "--quick", "--rays", "500", "--threads", "1"]) == 0
    rows = [line.split() for line in capsys.readouterr().out.splitlines() if line[:3] == "   "]
    rungs = [row for row in rows if row[0].replace(".", "").replace("e-", "").isdigit()]
    wrong = [float(row[8]) for row in rungs if len(row) > 12]  # random rays at the mesh, in %
    assert len(wrong) == 3
    assert wrong[-1] <= wrong[0]
    assert wrong[-1] < 2.0  # planes have no error, and edges are cut


def test_other_outputs_are_refused_before_the_work(part, rays, tmp_path, capsys):
    assert main(["rays", str(part), str(rays), "--out", str(tmp_path / "hits.txt")]) == 2
    assert "pass .npz, .csv or .parquet" in capsys.readouterr().err


def test_a_picture_is_made_at_once(part, tmp_path):
    out = tmp_path / "part.png"
    arguments = ["render", str(part), "--passes", "1", "--width", "48", "--height", "36", "--quiet"]
    assert main([*arguments, "--out", str(out)]) == 0
    assert out.stat().st_size > 500


def test_options_for_cad_files_are_refused_for_others(rays, tmp_path, capsys):
    (tmp_path / "part.stl").write_bytes(b"solid\nendsolid\n")
    out = str(tmp_path / "hits.npz")
    args = ["rays", str(tmp_path / "part.stl"), str(rays), "--out", out, "--unit", "inch"]
    assert main(args) == 2
    assert "is no CAD file: leave out --unit" in capsys.readouterr().err
