"""Hits as tables: nothing is lost, and who lacks pandas is told."""

import builtins
import csv

import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere


@pytest.fixture(scope="module")
def hits():
    rng = np.random.default_rng(0)
    tracer = Intersector([Sphere((0, 0, 0), 1), Sphere((3, 0, 0), 1).flipped()])
    return tracer.intersect(rng.normal(size=(200, 3)), rng.normal(size=(200, 3)))


def test_csv_holds_every_bit(hits, tmp_path):
    file = tmp_path / "hits.csv"
    file.write_text("what was there before")
    hits.to_csv(file)
    with file.open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    assert len(rows) == 200
    assert 20 < sum(row["status"] == "HIT" for row in rows) < 200
    for name in ("t", "u", "v", "t_bound", "residual"):
        read = np.array([float(row[name]) for row in rows])
        assert np.array_equal(read, getattr(hits, name), equal_nan=True)
    for k, (x, nx) in enumerate((("x", "nx"), ("y", "ny"), ("z", "nz"))):
        assert np.array_equal([float(row[x]) for row in rows], hits.position[:, k], equal_nan=True)
        assert np.array_equal([float(row[nx]) for row in rows], hits.normal[:, k], equal_nan=True)
    assert [int(row["object_id"]) for row in rows] == hits.object_id.tolist()
    assert [row["front_face"] == "True" for row in rows] == hits.front_face.tolist()


def test_no_rays_make_a_header(hits, tmp_path):
    hits[:0].to_csv(str(tmp_path / "none.csv"))
    text = (tmp_path / "none.csv").read_text()
    assert text == (
        "t,object_id,patch_id,u,v,x,y,z,nx,ny,nz,front_face,status,"
        "normal_degenerate,edge,t_bound,residual,instance_id\n"
    )


def test_what_is_no_path_is_refused(hits, tmp_path):
    with pytest.raises(TypeError, match=r"HitRecord\.to_csv path is 3: pass a path"):
        hits.to_csv(3)
    with pytest.raises(OSError, match="nowhere"):
        hits.to_csv(tmp_path / "nowhere" / "hits.csv")


def test_a_dataframe_has_the_same_columns(hits):
    pytest.importorskip("pandas", reason="pip install -e '.[dev]'")
    frame = hits.to_dataframe()
    assert len(frame) == 200
    assert np.array_equal(frame["t"], hits.t)
    assert np.array_equal(frame[["x", "y", "z"]], hits.position, equal_nan=True)
    assert frame["object_id"].dtype == np.int32
    assert "scene units" in frame.attrs["units"]
    met = frame[frame.status == "HIT"].groupby("object_id").t.min()
    assert met[0] == hits.t[hits.object_id == 0].min()


def test_crossings_name_their_rays(tmp_path):
    tracer = Intersector([Sphere((0, 0, 0), 1), Sphere((3, 0, 0), 1)])
    # Through both balls, past them, and through the first: four rows, none, two.
    found = tracer.intersect_all(
        [(-5, 0, 0), (-5, 9, 0), (0, -5, 0)], [(1, 0, 0)] * 2 + [(0, 1, 0)]
    )
    found.to_csv(tmp_path / "all.csv")
    with (tmp_path / "all.csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    assert [int(row["ray"]) for row in rows] == [0, 0, 0, 0, 2, 2]
    assert [float(row["t"]) for row in rows] == found.hits.t.tolist() == [4, 6, 7, 9, 4, 6]
    with pytest.raises(TypeError, match=r"Crossings\.to_csv path is 3: pass a path"):
        found.to_csv(3)
    pytest.importorskip("pandas", reason="pip install -e '.[dev]'")
    frame = found.to_dataframe()
    assert list(frame) == ["ray", *found.hits.to_dataframe()]
    assert frame.groupby("ray").t.max().to_dict() == {0: 9.0, 2: 6.0}


def test_without_pandas_the_way_out_is_named(hits, monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **more):
        if name == "pandas":
            raise ImportError(name)
        return real(name, *rest, **more)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ImportError, match=r"pip install 'hybrid-rt\[dataframe\]', or use \.to_csv"):
        hits.to_dataframe()
