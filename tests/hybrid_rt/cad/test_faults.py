"""Files that are wrong, and a child process that fails: one sentence each, and no harm."""

import os
import re
import signal
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from hybrid_rt import Flag, Intersector, read_cad
from hybrid_rt.cad import edges, process
from hybrid_rt.cad.faces import Raw, parts_of
from hybrid_rt.cad.loops import Arc, RefusedFaceError, closed_loops
from hybrid_rt.cad.records import USE

DATA = Path(__file__).parents[2] / "data"
STEP = b"ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\n#1=CARTESIAN_POINT('',(0.,0.,0.));\nENDSEC;\nEND-ISO-10303-21;\n"


def refused(path, match, kind=ValueError, **options):
    with pytest.raises(kind, match=match) as raised:
        read_cad(path, **options)
    message = str(raised.value)
    assert path.name in message
    assert "\n" not in message


def test_no_file_and_unknown_endings_are_named(tmp_path):
    refused(tmp_path / "none.step", "no such file", FileNotFoundError)
    (tmp_path / "part.stl").write_bytes(b"solid")
    refused(tmp_path / "part.stl", r"ends in '.stl': pass one of .step.*TriangleMesh.read")
    (tmp_path / "lens.zmx").write_bytes(b"VERS 1")
    refused(tmp_path / "lens.zmx", r"ends in '.zmx'")


def test_the_missing_extra_is_named(tmp_path, monkeypatch):
    (tmp_path / "part.step").write_bytes(STEP)
    monkeypatch.setattr(process.importlib.util, "find_spec", lambda _: None)
    refused(tmp_path / "part.step", r"pip install 'hybrid-rt\[cad\]'", ImportError)


@pytest.mark.parametrize(
    ("name", "content", "match"),
    [
        ("empty.step", b"", "no STEP data|fail"),
        ("points.stp", STEP, "no faces|nothing"),
        ("bytes.step", np.random.default_rng(3).bytes(4000), "no STEP data|fail|nothing|no faces"),
        ("bytes.iges", np.random.default_rng(4).bytes(4000), "no IGES data|fail|nothing|no faces"),
        ("bytes.brep", b"DBRep_DrawableShape\n\nCASCADE Topology V1\n", "no BREP data|fail"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_damaged_files_are_refused(tmp_path, name, content, match):
    pytest.importorskip("OCP")
    (tmp_path / name).write_bytes(content)
    refused(tmp_path / name, match)


@pytest.mark.parametrize("value", ["NAN", "-inf", "1.E400"])
def test_what_is_no_number_is_named_at_once(tmp_path, value):
    """OpenCASCADE reads such points, and then iterates for ever."""
    pytest.importorskip("OCP")
    whole = (DATA / "nist_ftc_11_asme1_rb.stp").read_text("latin-1")
    file = tmp_path / "wrong.stp"
    file.write_text(re.sub(r"(CARTESIAN_POINT\('',\()[^,]*", rf"\g<1>{value}", whole), "latin-1")
    refused(file, f"holds '{value}' where a number is expected", seconds=30.0)


def test_a_text_may_speak_of_nan(tmp_path):
    pytest.importorskip("OCP")
    whole = (DATA / "nist_ftc_11_asme1_rb.stp").read_text("latin-1")
    file = tmp_path / "named.stp"
    file.write_text(whole.replace("DATA;", "DATA; /* (nan, inf) */", 1), "latin-1")
    assert len(read_cad(file).faces) == 6


def test_folders_and_limits_that_cannot_be_are_named(tmp_path):
    (tmp_path / "part.step").mkdir()
    refused(tmp_path / "part.step", "is a folder: pass a file", IsADirectoryError)
    for name, value in (("gigabytes", 1e300), ("gigabytes", 1e-12), ("seconds", 1e300)):
        with pytest.raises(ValueError, match=f"read_cad {name} is"):
            read_cad(tmp_path / "a.step", **{name: value})


def test_a_truncated_file_is_refused_or_read_in_part(tmp_path):
    shapes = pytest.importorskip("cad_shapes")
    file = shapes.write(shapes.SHAPES["cone"](), tmp_path / "cone.step")
    content = file.read_bytes()
    file.write_bytes(content[: int(0.6 * len(content))])
    try:
        model = read_cad(file, refuse="skip")
    except ValueError as error:
        assert "cone.step" in str(error)  # noqa: PT017 (either is a right answer)
    else:
        assert len(model.faces) <= 2


CHILDREN = {
    "dies": (
        f"import os\nos.kill(os.getpid(), {int(signal.SIGSEGV)})",
        "ended by signal",
        ValueError,
    ),
    "raises": ("raise RuntimeError('no such thing')", "RuntimeError: no such thing", ValueError),
    "hangs": ("import time\ntime.sleep(60)", "longer than seconds=0.3", TimeoutError),
    "writes nothing": ("pass", "OpenCASCADE fail", ValueError),
}


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("fault", list(CHILDREN))
def test_a_child_that_fails_does_no_harm(tmp_path, monkeypatch, fault):
    program, match, kind = CHILDREN[fault]
    monkeypatch.setattr(process.importlib.util, "find_spec", lambda _: True)
    monkeypatch.setattr(process, "PROGRAM", program)
    (tmp_path / "part.step").write_bytes(STEP)
    refused(tmp_path / "part.step", match, kind, seconds=0.3 if fault == "hangs" else 60.0)


@pytest.mark.skipif(os.name != "posix", reason="limits of memory")
def test_memory_is_bounded(tmp_path):
    pytest.importorskip("OCP")
    (tmp_path / "part.step").write_bytes(STEP)
    refused(tmp_path / "part.step", "memory|fail", gigabytes=0.05)


def square(reach=1e-6):
    """Four sides of a unit square; space is (u, v, 0)."""
    corners = np.array([(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)], np.float64)
    sides = np.stack([corners[:-1], corners[1:]], axis=1)
    return [Arc(p, ends=np.column_stack([p, np.zeros(2)]), reach=reach) for p in sides]


def test_small_gaps_of_loops_are_closed_by_lines_and_wide_ones_refused():
    sides = square()
    off = np.array([[0.0, 0.0], [1e-7, 0.0]])
    sides[1] = Arc(sides[1].points + off, ends=sides[1].ends, reach=1e-6)
    (loop,) = closed_loops([sides], (0.0, 0.0))
    assert len(loop) == 5  # a line more
    assert all((a.points[-1] == b.points[0]).all() for a, b in pairwise(loop))
    del sides[2]
    with pytest.raises(RefusedFaceError, match="loop 0 is open by 1"):
        closed_loops([sides], (0.0, 0.0))


def bezier_face(gap, beyond=0.0):
    """A plane as a spline over the unit square, up to its border or beyond."""
    net = [(x, y, 0.0) for x in (0.0, 0.5, 1.0) for y in (0.0, 1.0)]
    size = [2, 1, 3, 2, 0, 0, 0, 0]
    numbers = np.concatenate([np.ravel(net), [0.0] * 3 + [1.0] * 3, [0.0] * 2 + [1.0] * 2])
    wires = [[arc.moved((1.0 + beyond, 1.0), (0, 0)) for arc in square()]]
    wires = [[replace(arc, gap=gap) for arc in wire] for wire in wires]
    return Raw("bspline", False, size, numbers, wires, gap)


def test_splines_go_on_where_their_edges_do():
    """By so much edges of files leave the domain of their surface, which is a polynomial there, too."""
    face = bezier_face(0.0, beyond=1e-5)
    (part,) = parts_of(face)
    (u, v) = part.unit(np.array([[1.0 + 1e-5, 0.5]]))
    assert 0.0 <= u[0] <= 1.0
    assert np.abs(part.point(u, v) - (1.0 + 1e-5, 0.5, 0.0)).max() < 1e-15


def test_rays_do_not_slip_through_gaps_at_the_ends_of_splines():
    face = bezier_face(1e-4)
    (part,) = parts_of(face)
    x = np.array([0.5, -0.9e-4, 1.0 + 0.9e-4, -1.1e-4, 1.0 + 1.1e-4])
    origins = np.column_stack([x, np.full(5, 0.5), np.ones(5)])
    down = np.tile((0.0, 0.0, -1.0), (5, 1))
    hits = Intersector([part.trimmed(face)], coarse="none").intersect(origins, down)
    assert hits.hit.tolist() == [True, True, True, False, False]
    assert (hits.flags & Flag.EDGE > 0).tolist() == [False, True, True, False, False]


def test_edges_in_any_order_are_put_into_a_loop():
    sides = square()
    (loop,) = closed_loops([[sides[k] for k in (0, 2, 3, 1)]], (0.0, 0.0))
    assert len(loop) == 4


def test_gaps_are_measured_across_the_edge():
    s = np.linspace(0.0, 1.0, 33)
    uses = np.zeros(2, USE)
    uses["face"], uses["edge"] = [0, 1], 7
    one = np.column_stack([np.cos(s), np.sin(s), 0 * s])
    # The same arc run through unevenly, and 0.01 above.
    t = s + 0.005 * np.sin(np.pi * s)
    other = np.column_stack([np.cos(t), np.sin(t), 0 * t + 0.01])
    found = edges.measured(uses, np.stack([one, other]), 2)
    # At the same parameter they are 0.0112 apart; chords of 1/32 leave 1e-4.
    assert found.gap[0] == pytest.approx(0.01, abs=1e-4)
    assert found.face.tolist() == [[0, 1]]
    assert found.n_free.tolist() == [0, 0]


def test_a_solid_that_lacks_a_face_is_named(tmp_path, caplog):
    whole = (DATA / "nist_ftc_11_asme1_rb.stp").read_text("latin-1")
    file = tmp_path / "lost.stp"
    file.write_text(re.sub(r"#163=ADVANCED_FACE[^;]*;", "", whole, count=1), "latin-1")
    assert len(read_cad(file).faces) == 5
    (record,) = caplog.records
    assert "1 of its solids are not closed" in record.getMessage()
    assert "lost.stp" in record.getMessage()
    caplog.clear()
    assert read_cad(DATA / "nist_ftc_11_asme1_rb.stp").parts[0].is_closed
    assert not caplog.records
