"""Part reports of parts of known answers, made by OpenCASCADE, read from files."""

import csv
import json
from functools import cache

import numpy as np
import pytest
from marks import nightly_but

from hybrid_rt import part_report, read_cad
from hybrid_rt.cli import main
from hybrid_rt.part.cells import BORDER, FACE, Cells
from hybrid_rt.part.report import surfaces_of_part
from hybrid_rt.part.walls import Walls

shapes = pytest.importorskip("cad_shapes", reason="needs OCP")

from OCP.BRepAlgoAPI import BRepAlgoAPI_Cut, BRepAlgoAPI_Fuse
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeFace, BRepBuilderAPI_MakePolygon
from OCP.BRepGProp import BRepGProp
from OCP.BRepPrimAPI import (
    BRepPrimAPI_MakeBox,
    BRepPrimAPI_MakeCone,
    BRepPrimAPI_MakeCylinder,
    BRepPrimAPI_MakePrism,
    BRepPrimAPI_MakeSphere,
)
from OCP.gp import gp_Ax2, gp_Dir, gp_Pnt, gp_Vec
from OCP.GProp import GProp_GProps

DRAFT = np.arctan(1.0 / 20.0)


def box(x, y, z, at=(0, 0, 0)):
    return BRepPrimAPI_MakeBox(gp_Pnt(*map(float, at)), float(x), float(y), float(z)).Shape()


def rod(radius, length, at=(0, 0, 0), way=(0, 0, 1)):
    place = gp_Ax2(gp_Pnt(*map(float, at)), gp_Dir(*map(float, way)))
    return BRepPrimAPI_MakeCylinder(place, float(radius), float(length)).Shape()


def ball(radius, at=(0, 0, 0)):
    return BRepPrimAPI_MakeSphere(gp_Pnt(*map(float, at)), float(radius)).Shape()


def cut(one, *others):
    for other in others:
        one = BRepAlgoAPI_Cut(one, other).Shape()
    return one


def fused(one, other):
    return BRepAlgoAPI_Fuse(one, other).Shape()


def prism(corners, length):
    """Return a polygon in x and z, drawn out along y."""
    wire = BRepBuilderAPI_MakePolygon()
    for x, z in corners:
        wire.Add(gp_Pnt(float(x), 0.0, float(z)))
    wire.Close()
    face = BRepBuilderAPI_MakeFace(wire.Wire()).Face()
    return BRepPrimAPI_MakePrism(face, gp_Vec(0.0, float(length), 0.0)).Shape()


# Name: shape, least thickness along normals, least diameter of balls.
WALLS = {
    "plate": (lambda: box(60, 40, 3), 3.0, 3.0),
    "tube": (lambda: cut(rod(10, 30), rod(6, 30)), 4.0, 4.0),
    "eccentric bore": (lambda: cut(box(30, 32, 20), rod(5, 20, (9, 15, 0))), 4.0, 4.0),
    "tilted bore": (lambda: cut(rod(10, 30), rod(3, 80, (-40, 5, 15), (1, 0, 0))), 2.0, 2.0),
    "stepped shaft": (lambda: fused(rod(10, 20), rod(6, 50)), 12.0, 12.0),
    "shell off its centre": (lambda: cut(ball(10), ball(8, (0.3, 0, 0.4))), 1.5, 1.5),
    # The ray goes on through the groove where its walls are steep; its tip is what is near.
    "groove": (
        lambda: cut(box(40, 30, 10), prism([(14, 11), (26, 11), (20, 5)], 30)),
        5.0,
        5.0,
    ),
    # At the top of a rib with draft: from one corner to the other side, and a circle that touches three sides.
    "rib": (
        lambda: prism([(-1, 0), (1, 0), (2, -20), (-2, -20)], 30),
        2.0 * np.cos(DRAFT) / np.cos(2.0 * DRAFT),
        2.0 * np.cos(DRAFT) / (1.0 - np.cos(DRAFT) / 20.0),
    ),
    # 30 and 60 degrees: both edges are named, what is left is between the ends.
    "wedge": (lambda: prism([(0, 0), (40, 0), (40, 40 * np.tan(np.pi / 6))], 10), 10.0, 10.0),
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")

    @cache
    def model_of(name):
        shape = WALLS[name][0]()
        return shape, read_cad(shapes.write(shape, folder / f"{name.replace(' ', '_')}.step"))

    return model_of


@pytest.fixture(scope="module")
def walls_of(made):
    @cache
    def found(name):
        return Walls(surfaces_of_part(made(name)[1], 0)[0], np.deg2rad(20.0))

    return found


# Balls of these are found, and their bounds hold, but it takes long until both meet: nearest points from an axis are
# many, and the narrowest ball of the rib touches three sides.
LONG = ("stepped shaft", "rib")


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", nightly_but(WALLS, *(WALLS.keys() - {"tilted bore", "stepped shaft"}))
)
def test_the_least_thickness_is_proven(name, walls_of):
    walls = walls_of(name)
    tolerance = 1e-6 * walls.size
    ray = walls.least_ray(tolerance, 600.0)
    ball = walls.least_ball(tolerance, 2.0 if name in LONG else 600.0)
    for found, exact in zip((ray, ball), WALLS[name][1:], strict=True):
        assert not found.touching
        # What is real is no less than exact but for rounding, here of coordinates moved into faces by 1e-7.
        assert exact - 1e-8 * walls.size <= found.value
        assert found.bound <= exact + 1e-9 * walls.size
        if found is ray or name not in LONG:
            assert found.is_proven
            assert found.value <= exact + 2.0 * tolerance
            assert exact - 2.0 * tolerance <= found.bound


@pytest.mark.slow
def test_sharp_edges_are_named_and_do_not_count(walls_of):
    edges = walls_of("wedge").sharp
    assert sorted(np.rad2deg([j.least for j in edges.values()])) == pytest.approx([30.0, 60.0])
    assert not walls_of("plate").sharp


@pytest.mark.slow
@pytest.mark.parametrize("name", WALLS)
def test_bounds_of_cells_hold(name, walls_of):
    """Dense samples do not leave them: points, normals, and the core plus rho times the normal."""
    solid = walls_of(name).solid
    cells, rng = Cells([solid]), np.random.default_rng(5)
    leaves = cells.roots(0)
    leaves = leaves[leaves >= 0]
    for _ in range(3):
        cells.halved(leaves)
        leaves = cells.children[leaves].ravel()
        leaves = leaves[leaves >= 0]
    ways = rng.normal(size=(40, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    for cell in rng.choice(cells.n, min(cells.n, 150), replace=False).tolist():
        _, face, patch, kind, side, _, _ = cells.ints[cell]
        low, high = cells.box[cell, ::2], cells.box[cell, 1::2]
        if kind == FACE:
            place = (
                *(low + (high - low) * rng.random((30, 2))).T,
                np.full(30, patch - solid.first[face]),
            )
            points, normals = solid.bases[face]._points(*place), solid.bases[face]._normals(*place)
        else:
            assert kind == BORDER
            s = cells.box[cell, 0] + (cells.box[cell, 1] - cells.box[cell, 0]) * rng.random(30)
            points, normals = solid.at(face, *solid.sides[face][side].curve.point(s).T)
        frame, spread = cells.frame[cell].reshape(3, 3), cells.spread[cell]
        turned = normals @ frame.T
        rounding = 1e-12 * solid.size
        assert (1.0 - turned[:, 0] <= spread[0] + 1e-12).all()
        assert (np.abs(turned[:, 1:]) <= spread[1:] + 1e-12).all()
        way = np.concatenate([ways, frame])
        eps = cells.eps_along(np.full(len(way), cell), way[:, None])[:, 0]
        corners, core = cells.corners[cell].reshape(4, 3), cells.core[cell].reshape(4, 3)
        assert (
            (points @ way.T).max(axis=0) <= (corners @ way.T).max(axis=0) + eps + rounding
        ).all()
        inner = points - cells.rho[cell] * normals
        reach = (core @ way.T).max(axis=0) + cells.core_eps[cell] + rounding
        assert ((inner @ way.T).max(axis=0) <= reach).all()


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """A plate with a hole through it, a blind one, and a boss with draft."""
    shape = cut(box(60, 40, 8), rod(3, 8, (10, 10, 0)), rod(2, 5, (30, 10, 3)))
    cone = BRepPrimAPI_MakeCone(
        gp_Ax2(gp_Pnt(45, 25, 8), gp_Dir(0, 0, 1)), 8.0, 8.0 - 10.0 * np.tan(np.deg2rad(3.0)), 10.0
    ).Shape()
    file = shapes.write(fused(shape, cone), tmp_path_factory.mktemp("bracket") / "bracket.step")
    return file, part_report(read_cad(file), pull=(0, 0, 1), seconds=5.0)


def frustum():
    small = 8.0 - 10.0 * np.tan(np.deg2rad(3.0))
    return np.pi * 10.0 * (64.0 + 8.0 * small + small**2) / 3.0


@pytest.mark.slow
def test_volume_and_box(bracket):
    part = bracket[1].parts[0]
    exact = 60.0 * 40.0 * 8.0 - np.pi * 9.0 * 8.0 - np.pi * 4.0 * 5.0 + frustum()
    mass = part.mass
    assert mass.volume == pytest.approx(exact, rel=1e-10)
    assert mass.volume_error < 1e-8 * exact
    # The interval is of 99 %, and the seed is fixed.
    assert abs(mass.chord_volume - exact) <= mass.chord_error < 0.01 * exact
    assert mass.unpaired == 0
    assert np.abs(mass.center - mass.chord_center).max() <= mass.chord_center_error
    assert np.abs(part.box.corners - [[0, 0, 0], [60, 40, 18]]).max() <= part.box.bound + 1e-9
    assert part.box.bound <= 1e-4


@pytest.mark.slow
def test_draft_and_undercut(bracket):
    part = bracket[1].parts[0]
    by_kind = {}
    for row in part.faces:
        by_kind.setdefault(row.kind, []).append(row.draft)
    (cone,) = by_kind["cone"]
    assert cone == pytest.approx((3.0, 3.0, 3.0, 3.0), abs=1e-6)
    assert all(draft == pytest.approx((0.0,) * 4, abs=1e-6) for draft in by_kind["cylinder"])
    assert {round(draft.least, 6) for draft in by_kind["plane"]} == {-90.0, 0.0, 90.0}
    # A blind hole opens upward: nothing of it is covered on both sides but for its walls.
    assert max(row.undercut for row in part.faces) == 0.0


@pytest.mark.slow
def test_undercuts_are_found(tmp_path):
    tee = cut(box(40, 20, 20), box(20, 20, 6, (10, 0, 5)), box(8, 20, 15, (16, 0, 5)))
    file = shapes.write(tee, tmp_path / "tee.step")
    part = part_report(read_cad(file), pull=(0, 0, 1), seconds=2.0).parts[0]
    covered = [row for row in part.faces if row.undercut > 0.9 and row.draft.most < -89.0]
    assert len(covered) == 2  # the undersides of the slot's lips


@pytest.mark.slow
def test_holes_and_bosses(bracket):
    features = bracket[1].parts[0].features
    assert [(f.kind, f.radius, f.end) for f in features] == [
        ("hole", 3.0, "through"),
        ("hole", 2.0, "blind"),
    ]
    assert [f.depth for f in features] == pytest.approx([8.0, 5.0])


@pytest.mark.slow
@pytest.mark.nightly  # half a minute
def test_rounds_of_a_box(tmp_path):
    file = shapes.write(shapes.filleted_box(), tmp_path / "rounds.step")
    part = part_report(read_cad(file), seconds=20.0).parts[0]
    assert {(f.kind, round(f.radius, 9)) for f in part.features} == {("round", 2.0)}
    assert len(part.features) == 12 + 8
    assert part.ray.value == pytest.approx(10.0)
    assert 9.99 <= part.ray.bound <= 10.0  # round borders take longer to prove
    assert not part.sharp_edges


@pytest.mark.slow
@pytest.mark.parametrize("name", ["eccentric bore", "tilted bore", "shell off its centre", "rib"])
def test_volume_and_area_are_those_of_opencascade(name, made, walls_of):
    from hybrid_rt.part.mass import mass_of

    walls = walls_of(name)
    mass = mass_of(walls.solid, walls.tracer, made(name)[1].bounds)
    for what, of, own in (
        ("Volume", BRepGProp.VolumeProperties_s, mass.volume),
        ("Surface", BRepGProp.SurfaceProperties_s, mass.area),
    ):
        judge = GProp_GProps()
        of(made(name)[0], judge, 1e-7)
        assert own == pytest.approx(judge.Mass(), rel=1e-5), what
    assert abs(mass.chord_volume - mass.volume) <= mass.chord_error


# Two parts, and how far they are apart.
PAIRS = {
    "boxes": (box(10, 10, 10), box(10, 10, 10, (11.25, 3, 2)), 1.25),
    "corners": (box(10, 10, 10), box(5, 5, 5, (12, 13, 16)), 7.0),
    "skew rods": (rod(2, 40, (0, -20, 0), (0, 1, 0)), rod(3, 40, (-20, 0, 10), (1, 0, 0)), 5.0),
    "ball over a plate": (ball(4, (0, 0, 7)), box(40, 40, 1, (-20, -20, -1)), 3.0),
    "rod in a bore": (cut(rod(10, 30), rod(6, 30)), rod(5, 30, (0.25, 0, 0)), 0.75),
    "touching": (box(10, 10, 10), box(10, 10, 10, (10, 0, 0)), 0.0),
    "one in the other": (box(10, 10, 10), box(4, 4, 4, (8, 3, 3)), 0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", nightly_but(PAIRS, *(PAIRS.keys() - {"ball over a plate"})))
def test_clearance(name, tmp_path):
    one, other, exact = PAIRS[name]
    file = shapes.write(shapes.compound([one, other]), tmp_path / "pair.step")
    seconds = 5.0 if name == "rod in a bore" else 60.0
    (clearance,) = part_report(read_cad(file), seconds=seconds).clearances
    found = clearance.found
    assert exact - 1e-9 <= found.value <= exact + (0.01 if name == "rod in a bore" else 1e-4)
    assert found.bound <= exact + 1e-9
    if name != "rod in a bore":  # ends of both are borders in parallel planes: that takes longer
        assert found.is_proven
        assert exact - 1e-4 <= found.bound


@pytest.mark.slow
def test_meshes_are_worse(made):
    rows = part_report(made("tube")[1], meshes=True, clearances=False, seconds=5.0).parts[0].meshes
    tolerances = [row.tolerance for row in rows]
    assert tolerances == sorted(tolerances, reverse=True)
    assert all(row.deviation <= row.tolerance for row in rows)
    errors = [row.volume_error for row in rows]
    assert errors == sorted(errors, reverse=True)
    assert errors[0] > 10.0 * errors[-1]
    assert rows[-1].thickness_error < 0.001


@pytest.mark.slow
def test_command_writes_page_json_table_and_map(bracket, tmp_path, capsys):
    outs = [tmp_path / name for name in ("part.html", "part.json", "faces.csv")]
    words = ["part", str(bracket[0]), "--seconds", "5", "--map", str(tmp_path / "map.ply")]
    assert main([*words, *(word for out in outs for word in ("--out", str(out)))]) == 0
    said = capsys.readouterr().out
    assert "thickness along normals" in said
    assert "proven" in said
    page = outs[0].read_text("utf-8")
    assert page.count("data:image/png;base64,") == 2
    assert "https://" not in page
    report = json.loads(outs[1].read_text("utf-8"))
    assert report["parts"][0]["ray"]["value"] == pytest.approx(bracket[1].parts[0].ray.value)
    with outs[2].open(encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == len(bracket[1].parts[0].faces)
    assert (tmp_path / "map.ply").read_bytes().startswith(b"ply\n")


def test_wrong_arguments(tmp_path):
    with pytest.raises(TypeError, match="pass what read_cad returns"):
        part_report([])
    file = (
        shapes.write(shapes.SHAPES["cylinder"](), tmp_path / "open.step")
        if "cylinder" in shapes.SHAPES
        else None
    )
    if file is not None:
        model = read_cad(file)
        if not any(part.is_closed for part in model.parts):
            with pytest.raises(ValueError, match="it is open"):
                part_report(model)
