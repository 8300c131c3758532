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
from hybrid_rt.part.clearance import least_clearance
from hybrid_rt.part.extremes import box_of
from hybrid_rt.part.features import features_of
from hybrid_rt.part.kernels.bounds import BOTH, FIRST, TOUCHING
from hybrid_rt.part.mass import mass_of
from hybrid_rt.part.pairs import PairSearch
from hybrid_rt.part.report import surfaces_of_part
from hybrid_rt.part.walls import Walls

shapes = pytest.importorskip("cad_shapes", reason="needs OCP")

from proof.cases.known_parts import KNOWN_PARTS, ball, box, cone, cut, fused, rod

KNOWN = {known.name: known for known in KNOWN_PARTS}
# Others are like these, or take seconds.
AT_NIGHT = {
    "rounded box", "stepped shaft", "loft", "eccentric bore", "elliptic wall", "hollow sphere", "skew bores", "counterbore",
}  # fmt: skip


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parts")

    @cache
    def model_of(name):
        shape = KNOWN[name].make()
        return shape, read_cad(shapes.write(shape, folder / f"{name.replace(' ', '_')}.step"))

    return model_of


@pytest.fixture(scope="module")
def walls_of(made):
    @cache
    def found(name):
        return Walls(surfaces_of_part(made(name)[1], 0)[0], np.deg2rad(20.0))

    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    nightly_but(KNOWN, *(KNOWN.keys() - AT_NIGHT)),
)
def test_parts_of_known_answer(name, walls_of):
    """The rest of their answers is judged by tools/verify_part.py."""
    walls, known = walls_of(name), KNOWN[name]
    tolerance = 1e-6 * walls.size
    for long, least, exact in zip(
        known.takes_long, (walls.least_ray, walls.least_ball), (known.ray, known.ball), strict=True
    ):
        found = least(tolerance, 0.5 if long else 600.0)
        assert not found.touching
        # What is real is no less than exact but for rounding, here of coordinates moved into faces by 1e-7.
        assert exact - 1e-8 * walls.size <= found.value
        assert found.bound <= exact + 1e-9 * walls.size
        if not long:
            assert found.is_proven
            assert found.value <= exact + 2.0 * tolerance
            assert exact - 2.0 * tolerance <= found.bound
    box = box_of(walls.cells, walls.roots, walls.size, 1e-9 * walls.size)
    # The bound of both ends, and roundings of coordinates that were written with 15 digits.
    assert (
        np.abs(np.diff(box.corners, axis=0)[0] - known.sides).max()
        <= 2.0 * box.bound + 1e-12 * walls.size
    )
    assert box.bound <= 1e-9 * walls.size
    mass, areas = mass_of(walls.solid, walls.tracer, box.corners)
    assert mass.volume == pytest.approx(known.volume, rel=1e-9)
    assert abs(mass.chord_volume - known.volume) <= mass.chord_error
    assert areas.sum() == pytest.approx(mass.area, rel=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "tilted bore",
        "torus tube",
        "cone shell",
        "loft",
        "tapered bore",
        "elliptic wall",
        "shell off its centre",
    ],
)
def test_no_real_chord_is_below_the_bound_of_its_cells(name, walls_of):
    """Chords and balls between samples, and the cells of all sizes that both ends are in."""
    walls, rng = walls_of(name), np.random.default_rng(8)
    cells, search = walls.cells, PairSearch(walls.cells, walls.size, walls.angle, threads=1)
    some = rng.choice(len(walls.samples), 150)
    p, n, own, exits = walls.sampled
    p, n, own, t, normal = p[some], n[some], own[some], exits.t[some], exits.normal[some]
    q = p - np.where(np.isfinite(t), t, 0.0)[:, None] * n
    balls, ends, faces = walls.balls_at(p, n, own)
    off = np.linalg.norm(n + normal, axis=1)
    chords = [
        *(
            (k, FIRST, t[k], q[k], exits.face[some[k]])
            for k in np.flatnonzero(off < 0.99 * walls.angle)
        ),
        *((k, BOTH, t[k], q[k], exits.face[some[k]]) for k in np.flatnonzero(off < 1e-9)),
        *(
            (k, TOUCHING, balls[k], ends[k, 1], faces[k, 1])
            for k in np.flatnonzero(np.isfinite(balls))
        ),
    ]
    assert len(chords) > 20
    leaves = walls.roots[cells.ints[walls.roots, 3] == FACE]
    while len(leaves) < 3000:
        (low, high), face = search._boxes(leaves), cells.ints[leaves, 1]
        for k, kind, value, end, other in chords:
            a, b = (
                leaves[
                    (face == of) & (low <= x + 1e-9).all(axis=1) & (x - 1e-9 <= high).all(axis=1)
                ]
                for x, of in ((p[k], own[k]), (end, other))
            )
            x, y = (z.ravel() for z in np.meshgrid(a, b))
            # One pair of these cells has both ends. Ends are rounded, and shrinking balls stop within 1e-9.
            assert search._bounds(x, y, np.full(len(x), kind), np.inf).min() <= value + 1e-8
        cells.halved(leaves)
        leaves = cells.children[leaves].ravel()
        leaves = leaves[leaves >= 0]


@pytest.mark.slow
def test_narrow_faces_have_samples(tmp_path):
    """The step of this shaft is a twentieth of the distance between samples wide."""
    file = shapes.write(fused(rod(10, 20), rod(9.95, 50)), tmp_path / "step.step")
    walls = Walls(surfaces_of_part(read_cad(file), 0)[0], np.deg2rad(20.0))
    assert set(walls.sampled[2].tolist()) == set(range(len(walls.solid.surfaces)))


@pytest.mark.slow
def test_sharp_edges_are_named_and_do_not_count(walls_of):
    edges = walls_of("wedge").sharp
    assert sorted(np.rad2deg([j.least for j in edges.values()])) == pytest.approx([30.0, 60.0])
    assert not walls_of("plate").sharp


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["tilted bore", "torus tube", "cone shell", "dimple", "dish", "elliptic wall"]
)
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
        if cells.is_support[cell] > 0.0:  # tangent planes of a cone pass through its apex
            assert np.abs(((points - core[0]) * normals).sum(axis=1)).max() <= 100.0 * rounding
            assert np.abs(normals @ cells.way[cell] - cells.lean[cell]).max() <= 1e-12
        else:
            assert ((inner @ way.T).max(axis=0) <= reach).all()


@pytest.fixture(scope="module")
def bracket(tmp_path_factory):
    """A plate with a hole through it, a blind one, and a boss with draft."""
    shape = cut(box(60, 40, 8), rod(3, 8, (10, 10, 0)), rod(2, 5, (30, 10, 3)))
    boss = cone(8.0, 8.0 - 10.0 * np.tan(np.deg2rad(3.0)), 10.0, (45, 25, 8))
    file = shapes.write(fused(shape, boss), tmp_path_factory.mktemp("bracket") / "bracket.step")
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
    assert np.abs(part.box.corners - [[0, 0, 0], [60, 40, 18]]).max() <= part.box.bound + 1e-12
    assert part.box.bound <= 1e-7
    by_radius = {row.radius: row.area for row in part.faces if not np.isnan(row.radius)}
    assert by_radius == pytest.approx({3.0: 48.0 * np.pi, 2.0: 20.0 * np.pi}, rel=1e-12)
    assert sum(row.area for row in part.faces) == pytest.approx(mass.area, rel=1e-14)


@pytest.mark.slow
def test_draft_and_undercut(bracket):
    part = bracket[1].parts[0]
    by_kind = {}
    for row in part.faces:
        by_kind.setdefault(row.kind, []).append(row.draft)
    (boss,) = by_kind["cone"]
    assert boss == pytest.approx((3.0, 3.0, 3.0, 3.0), abs=1e-6)
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
def test_rounds_of_a_box(made):
    model = made("rounded box")[1]
    walls = Walls(surfaces_of_part(model, 0)[0], np.deg2rad(20.0))
    features = features_of(walls)
    assert {(f.kind, round(f.radius, 9)) for f in features} == {("round", 2.0)}
    assert len(features) == 12 + 8
    assert not walls.sharp


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
@pytest.mark.parametrize("name", PAIRS)
def test_clearance(name, tmp_path):
    one, other, exact = PAIRS[name]
    model = read_cad(shapes.write(shapes.compound([one, other]), tmp_path / "pair.step"))
    bodies = [surfaces_of_part(model, k)[0] for k in (0, 1)]
    size = float(np.linalg.norm(np.diff(model.bounds, axis=0)))
    found = least_clearance(*bodies, 1e-6 * size, 2.0 if name == "rod in a bore" else 60.0)
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
    words = [
        "part",
        str(bracket[0]),
        "--seconds",
        "5",
        "--map",
        str(tmp_path / "map.ply"),
        "--progress",
        "plain",
    ]
    assert main([*words, *(word for out in outs for word in ("--out", str(out)))]) == 0
    said, shown = capsys.readouterr()
    assert "Thickness of part 0" in shown
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
