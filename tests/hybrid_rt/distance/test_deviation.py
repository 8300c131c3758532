"""Deviation of measured points: statistics, best fit, files in and out, and the command."""

import csv
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hybrid_rt import BezierPatches, Box, ClosestPoint, Cylinder, Sphere
from hybrid_rt.cli import main
from hybrid_rt.distance import Scan, best_fit, deviation, measure

RNG = np.random.default_rng(4)
TRUNCATED = b"""ply
format binary_little_endian 1.0
element vertex 9
property float x
property float y
property float z
end_header
1234"""


def on_box(n):
    box = Box((0, 0, 0), (1, 2, 3))
    u, v = RNG.random((2, n))
    face = RNG.integers(0, 6, n)
    return box, box.point(u, v, face), box.normal(u, v, face), face


def test_statistics_are_those_of_what_was_added():
    box, points, normal, face = on_box(5000)
    # Well inside the faces, so that each stays the nearest.
    off = 0.01 * RNG.normal(size=len(points)).clip(-2, 2)
    inner = np.sort(np.minimum(points, np.array([1, 2, 3]) - points), axis=1)[:, 1] > 0.05
    points, off, face = (points + off[:, None] * normal)[inner], off[inner], face[inner]
    search, seen = ClosestPoint(box), []
    result = deviation(
        search,
        np.array_split(points, 7),
        face_of=lambda found: found.patch_id,
        each=lambda _, measured, faces: seen.append((measured.deviation, faces)),
    )
    np.testing.assert_allclose(np.concatenate([d for d, _ in seen]), off, atol=1e-15)
    assert (np.concatenate([f for _, f in seen]) == face).all()
    assert result.n == len(points)
    assert result.by_normal == result.undecided == 0
    assert result.mean == pytest.approx(off.mean(), abs=1e-15)
    assert result.rms == pytest.approx(np.sqrt((off**2).mean()), rel=1e-12)
    assert (result.least, result.most) == pytest.approx((off.min(), off.max()), abs=1e-15)
    assert result.percentiles[95] == pytest.approx(np.percentile(off, 95), abs=1e-15)
    assert result.faces["face"].tolist() == list(range(6))
    assert result.faces["n"].tolist() == np.bincount(face).tolist()
    np.testing.assert_allclose(
        result.faces["mean"], [off[face == k].mean() for k in range(6)], atol=1e-15
    )


def test_of_open_surfaces_the_normal_gives_the_sign():
    tube = Cylinder((0, 0, 0), (0, 0, 1), 1, 2)
    found = measure(ClosestPoint(tube), [[0.875, 0, 1], [1.125, 0, 1]])
    assert found.deviation.tolist() == [-0.125, 0.125]
    assert not found.is_signed.any()


def test_a_best_fit_undoes_a_motion():
    """Without noise it is exact; with noise it is off by what its covariance says."""
    box, points, _, _ = on_box(4000)
    turn, shift = Rotation.from_rotvec((0.01, -0.02, 0.015)), np.array([0.02, -0.01, 0.03])
    moved = turn.apply(points) + shift
    search = ClosestPoint(box, threads=1)
    fit = best_fit(search, moved)
    np.testing.assert_allclose(fit.moved(moved), points, atol=2e-9)
    assert fit.rms < 1e-9
    assert fit.rms_before > 1e-3
    assert fit.free == 0
    noisy = moved + 1e-4 * RNG.normal(size=moved.shape)
    fit = best_fit(search, noisy)
    assert fit.rms == pytest.approx(1e-4, rel=0.05)
    center = fit.center
    undone = turn.inv().apply(center - shift)
    off = np.concatenate([
        fit.moved(center[None])[0] - undone,
        (Rotation.from_matrix(fit.matrix[:3, :3]) * turn).as_rotvec(),
    ])  # fmt: skip
    # A chi-square of six: above 30 once in 2e4.
    assert off @ np.linalg.solve(fit.covariance, off) < 30.0


def test_what_points_do_not_determine_is_counted():
    ball = Sphere((0, 0, 0), 1)
    points = RNG.normal(size=(500, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    fit = best_fit(ClosestPoint(ball), points + np.array([0.01, 0, 0]))
    assert fit.free == 3
    np.testing.assert_allclose(fit.moved(np.array([[0.01, 0, 0]])), 0, atol=1e-9)


def write_ply(file, points, form):
    kind = {"ascii": None, "binary_little_endian": "<f4", "binary_big_endian": ">f4"}[form]
    head = (
        f"ply\nformat {form} 1.0\ncomment a scan\nelement vertex {len(points)}\nproperty float nx\n"
        "property float x\nproperty float y\nproperty float z\nelement face 0\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    rows = np.column_stack([np.zeros(len(points)), points])
    if kind is None:
        file.write_bytes(
            head + "".join(f"{a!r} {b!r} {c!r} {d!r}\n" for a, b, c, d in rows.tolist()).encode()
        )
    else:
        file.write_bytes(head + rows.astype(kind).tobytes())


def test_scans_of_all_kinds_are_read_in_pieces(tmp_path):
    points = RNG.integers(-99, 99, (1003, 3)) / 8.0  # floats of any kind
    files = []
    for form in ("ascii", "binary_little_endian", "binary_big_endian"):
        files.append(tmp_path / f"{form}.ply")
        write_ply(files[-1], points, form)
    np.save(tmp_path / "a.npy", np.hstack([points, points]).astype(np.float32))
    np.savetxt(tmp_path / "b.csv", points, delimiter=",", header="x,y,z", comments="")
    np.savetxt(tmp_path / "c.xyz", points)
    files += [tmp_path / name for name in ("a.npy", "b.csv", "c.xyz")]
    for file in files:
        scan = Scan(file)
        pieces = list(scan.pieces(100))
        assert scan.n == 1003
        assert [len(piece) for piece in pieces] == [100] * 10 + [3]
        assert (np.concatenate(pieces) == points).all(), file
        assert (scan.sample(200) == points[::5]).all()


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("b.ply", b"ply\nformat ascii 1.0\nelement face 1\nend_header\n", "does not begin with its vertices"),
        ("c.ply", TRUNCATED, "ends before its 9 vertices do"),
        ("e.csv", b"x,y,z\n", "holds no points"),
        ("f.las", b"", "ends in '.las'"),
        ("g.csv", b"id;height\n1;2\n", "name the columns x, y and z"),
        ("h.xyz", b"17.5 0 bad\n17.5 0 1.5\n", "pass x, y and z in each line"),
        ],
)  # fmt: skip
def test_scans_that_are_refused(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(ValueError, match=message):
        Scan(tmp_path / name)


def test_columns_are_those_that_the_first_line_names(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("id,z,y,x\n7,3,2,1\n8,6,5,4\n")
    (points,) = Scan(file).pieces()
    assert points.tolist() == [[1, 2, 3], [4, 5, 6]]


def test_a_point_that_is_not_finite_is_named_by_its_row(tmp_path):
    points = np.zeros((25, 3))
    points[17, 1] = np.nan
    np.save(tmp_path / "a.npy", points)
    with pytest.raises(ValueError, match=r"point 17 \(from 0\) is \[0.0, nan, 0.0\]: leave"):
        list(Scan(tmp_path / "a.npy").pieces(10))


def test_no_output_replaces_an_input_or_another(tmp_path, capsys):
    (tmp_path / "scan.csv").write_text("0,0,0\n")
    model, scan, twice = (str(tmp_path / name) for name in ("a.bpt", "scan.csv", "b.csv"))
    assert main(["deviation", model, scan, "--out", scan]) == 2
    assert "is a file that is read, too" in capsys.readouterr().err
    assert (tmp_path / "scan.csv").read_text() == "0,0,0\n"
    assert main(["deviation", model, scan, "--out", twice, "--out", twice]) == 2
    assert "is a file that is written, too" in capsys.readouterr().err


def test_a_line_that_is_no_point_is_named(tmp_path):
    file = tmp_path / "a.csv"
    file.write_text("1,2,3\n4,5\n")
    with pytest.raises(ValueError, match=r"a.csv', lines from 1 on"):
        list(Scan(file).pieces())


def test_the_command_colors_a_scan(tmp_path, capsys):
    model, scan = tmp_path / "bowl.bpt", tmp_path / "scan.csv"
    bowl = BezierPatches.from_polynomial([[0, 0, 0.5], [0, 0, 0], [0.5, 0, 0]], (-1, 1), (-1, 1))
    bowl.write(model)
    u, v = RNG.uniform(0.2, 0.8, (2, 700))
    off = np.linspace(-0.01, 0.01, 700)
    points = bowl.point(u, v) + off[:, None] * bowl.normal(u, v)
    np.savetxt(scan, points, delimiter=",", fmt="%.17g")
    out = [tmp_path / name for name in ("colored.ply", "faces.csv", "report.json")]
    words = ["deviation", str(model), str(scan), "--limit", "0.01", "--threads", "1"]
    assert main([*words, *(word for file in out for word in ("--out", str(file)))]) == 0
    told = capsys.readouterr().out
    assert "700 points: mean" in told
    assert "700 are signed by normals only" in told
    head, _, body = out[0].read_bytes().partition(b"end_header\n")
    assert b"element vertex 700\n" in head
    kind = [("xyz", "<f8", 3), ("deviation", "<f8"), ("rgb", "u1", 3), ("face", "<i4")]
    rows = np.frombuffer(body, kind)
    assert (rows["xyz"] == points).all()
    np.testing.assert_allclose(rows["deviation"], off, atol=1e-15)
    assert rows["rgb"][[0, -1]].tolist() == [[59, 76, 192], [180, 4, 38]]
    table = list(csv.DictReader(out[1].read_text(encoding="utf-8").splitlines()))
    assert [row["n"] for row in table] == ["700"]
    report = json.loads(out[2].read_text(encoding="utf-8"))
    assert report["most"] == pytest.approx(0.01, abs=1e-15)
    assert report["bound"] < 1e-12
    assert main([*words[:3], "--fit"]) == 0
    assert "best fit of 700 points" in capsys.readouterr().out
    assert main([*words[:3], "--out", "a.txt"]) == 2
    assert "pass .ply, .csv or .json" in capsys.readouterr().err
