"""Hard rays at singular sets, their judge, and the mutants that both must notice."""

import dataclasses
import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere
from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import Status
from meshing import SurfaceOfRevolution
from proof.cases.campaign import (
    HARD,
    ORDINARY,
    SINGULAR,
    Batch,
    Group,
    _judge,
    added,
    ordinary_rays,
    placed_surfaces,
    result,
    trace_cell,
)
from proof.cases.mutant_campaign import compared
from proof.cases.mutants import MUTANTS, Mutant, applied
from proof.cases.singular_rays import beside, parallel, within
from proof.cases.singular_sets import DISTANCES, KINDS, PLACEMENTS, SETS
from proof.exact.judge import BatchVerdict, ExactJudge
from proof.exact.truth import ExactScene
from proof.judge import Judge
from proof.surface import judged_of

ROOT = Path(__file__).parents[3]
TOOLS = ROOT / "tools"
HOME = {"placements": ("home",)}

# Sets on which no fault has ever been seen, cheap ones of every kind and aim: they stay so.
CLEAN = (
    "spindle", "cone tip", "egg poles", "lens tips", "rim", "joint, sharp", "joint, smooth", "joint, leaving",
    "torus, tangents", "cone, along rulings", "rational torus, tangents", "rational torus, leaving",
    "part of a torus, ends", "part of a cylinder, ends", "part, leaving", "uneven weights",
    "rulings, parallel", "patch tangents", "collapsed edge", "lune", "uneven lune",
    "cuspidal edge", "open border", "shared edge, sharp", "edges of a cube of patches",
    "rational, leaving", "rational poles", "rational seams", "sphere, tangents", "sphere, leaving", "plane, nearly within",
    "skew box, leaving", "open mesh, edges", "mesh edges and vertices",
)  # fmt: skip


@pytest.mark.parametrize("name", CLEAN)
def test_no_promise_is_broken(name):
    # Images of meshes and closed forms are rounded, which asks for marks; the judge knows them rounded.
    places = tuple(PLACEMENTS)[: 2 if SETS[name].kind in ("mesh", "closed") else None]
    cells = {"distances": DISTANCES[:15:3], "placements": places}
    group = result(SINGULAR, name, 10 * len(places), 3, marks=True, **cells)
    assert group.count.faults == 0, group.examples
    assert group.count.hits > 0
    assert group.count.left_open == 0


@pytest.mark.parametrize("name", list(SETS))
def test_every_set_has_rays_at_every_distance(name):
    """Finite rays of unit length, the same for the same seed, on surfaces in every place."""
    entry = SETS[name]
    for place in PLACEMENTS:
        surfaces = placed_surfaces(name, place)
        for k in (DISTANCES[0], DISTANCES[-1]):
            one, two = (
                entry.aim(entry.find(surfaces, 7, rng), k, rng)
                for rng in (np.random.default_rng(1), np.random.default_rng(1))
            )
            assert np.array_equal(one.origins, two.origins)
            assert np.isfinite(one.origins).all()
            np.testing.assert_allclose(np.linalg.norm(one.directions, axis=1), 1.0, atol=1e-12)
    assert entry.kind in KINDS


def test_rays_pass_their_targets_at_the_distance_that_is_said():
    surfaces = SETS["cone tip"].surfaces()
    for k in (1e-1, 1e-6, 1e-12):
        rng = np.random.default_rng(5)
        targets = SETS["cone tip"].find(surfaces, 200, rng)
        rays = beside(targets, k, rng)
        away = targets.points - rays.origins
        along = np.einsum("ij,ij->i", away, rays.directions)
        foot = away - along[:, None] * rays.directions
        distance = np.linalg.norm(foot, axis=1)
        # Origins up to a thousand sizes away are rounded, and so are unit directions.
        slack = 8 * 2.0**-52 * (np.abs(rays.origins).max(axis=1) + np.abs(along))
        assert (np.abs(distance - rays.distance) <= slack).all()
    ring = SETS["ring, nearly within"]
    for aim in (within, parallel):
        targets = ring.find(ring.surfaces(), 50, np.random.default_rng(6))
        rays = aim(targets, 1e-5, np.random.default_rng(7))
        sine = np.abs(rays.directions[:, 2])
        assert np.allclose(sine, 1e-5 if aim is within else 0.0, atol=1e-12)


@pytest.fixture(scope="module")
def traced():
    surface = SurfaceOfRevolution([(0, 0.5), (1, 1.5), (2, 0.7)], (0.1, 0, 0), (1, 2, 2))
    rng = np.random.default_rng(8)
    origins = rng.normal(size=(60, 3)) * 4.0
    directions = rng.uniform(*surface.bounds, (60, 3)) - origins
    hits = Intersector([surface], coarse="none").intersect(origins, directions)
    return ExactJudge([surface]), hits, origins, directions


class TestJudge:
    def changed(self, hits, rows, **columns):
        out = {}
        for name, value in columns.items():
            out[name] = getattr(hits, name).copy()
            out[name][rows] = value
        return dataclasses.replace(hits, **out)

    def test_right_hits_are_right(self, traced):
        judge, hits, origins, directions = traced
        verdict = judge.judge(hits, origins, directions)
        assert verdict.faults == 0
        assert verdict.hits == hits.hit.sum() > 30
        assert 0 < verdict.worst_error < 64
        assert 0 < verdict.worst_bound < 1

    def test_what_is_made_wrong_is_found(self, traced):
        judge, hits, origins, directions = traced
        rows = np.flatnonzero(hits.hit)[:5]
        t = hits.t[rows]
        found = judge.judge(self.changed(hits, rows, t=t + 1e-3), origins, directions)
        assert found.wrong["farther"] + found.wrong["phantom"] == 5
        assert found.bounds_broken == found.off_ray == 5
        assert judge.judge(
            self.changed(hits, rows, t=t - 1e-3), origins, directions
        ).wrong["nearer"] == 5  # fmt: skip
        lost = self.changed(hits, rows, t=np.inf, object_id=-1, status=Status.MISS)
        assert judge.judge(lost, origins, directions).wrong["missed"] == 5
        marked = self.changed(lost, rows, status=Status.TANGENT)
        assert judge.judge(marked, origins, directions).wrong_tangent == 5
        tight = self.changed(hits, rows, t_bound=1e-19, t=np.nextafter(t, np.inf))
        assert judge.judge(tight, origins, directions).bounds_broken == 5
        v = hits.v[rows]
        beside_ray = self.changed(hits, rows, v=v + 1e-9)
        assert judge.judge(beside_ray, origins, directions).off_ray == 5
        needless = self.changed(hits, rows, status=Status.TANGENT)
        assert judge.judge(needless, origins, directions).tangent_needlessly == 5

    def test_the_mark_is_wanted_where_a_move_changes_the_decision(self):
        judge = ExactJudge([Sphere((0, 0, 0), 1)])
        tracer = Intersector([Sphere((0, 0, 0), 1)])
        band = 64 * 2.0**-52 * 2.0
        origins = np.array([[-3.0, 1.0 - 0.02 * band, 0.0], [-3.0, 1.0 + 8 * band, 0.0]])
        directions = np.array([[1.0, 0.0, 0.0]] * 2)
        hits = tracer.intersect(origins, directions)
        assert hits.status.tolist() == [Status.TANGENT, Status.MISS]
        assert judge.judge(hits, origins, directions).faults == 0
        bare = dataclasses.replace(
            hits, status=np.array([Status.HIT, Status.TANGENT], dtype=np.uint8)
        )
        verdict = judge.judge(bare, origins, directions)
        assert (verdict.unmarked, verdict.tangent_needlessly) == (1, 1)


def test_the_other_side_of_an_edge_is_no_departure():
    """Far from 0 a ray cuts a ridge 3.8e-9 from where it leaves: eight eps of its coordinates."""
    name, place = "joint, leaving", "far"
    tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
    cell = trace_cell(tracer, name, 1e-9, place, 375, 401)
    assert cell.hits.t[36] == pytest.approx(3.7641912e-9)
    assert cell.source is not None
    source, hit = cell.source[36], cell.hits[36]
    assert (source.patch_id[0], hit.patch_id[0]) == (1, 0)
    verdict = ExactJudge(tracer.surfaces).judge(
        hit, cell.origins[36:37], cell.directions[36:37], leaves=source.object_id
    )
    assert verdict.n_wrong == verdict.bounds_broken == 0


def test_a_joint_left_within_rounding_is_not_met_again_without_a_mark():
    """The flat segment beside it leaves t open, so that it may be the departure: 10 of these rays."""
    total = result(SINGULAR, "joint, leaving", 600, 3, distances=(1e-14, 3e-15), **HOME).count
    assert total.hits > 200
    assert total.n_wrong == 0
    assert total.tangent > total.wrong_tangent > 0


def test_touches_are_found_at_their_distance():
    cylinder = SurfaceOfRevolution([(-1, 1), (1, 1)], (0, 0, 0), (0, 0, 1))
    is_touched = judged_of(cylinder).touch()
    for gap in (1e-3, 1e-9, 1e-13):
        ray = np.array([-3.0, 1.0 + gap, 0.2]), unit(np.array([[2.0, 0.0, 0.1]]))[0]
        assert is_touched(*ray, 1.1 * gap, False)
        assert not is_touched(*ray, 0.9 * gap, False)
    behind = np.array([3.0, 1.0, 0.2]), unit(np.array([[2.0, 0.0, 0.1]]))[0]
    assert not is_touched(*behind, 1e-3, False)


def test_scenes_that_are_moved_far_keep_their_crossings():
    """By a power of two times their own coordinates nothing is rounded."""
    near = SurfaceOfRevolution([(0, 0), (2, 1)], (0, 0, 0), (0, 0, 1))
    far = SurfaceOfRevolution([(0, 0), (2, 1)], (2.0**20, 0, 0), (0, 0, 1))
    o, d = np.array([-3.0, -0.25, 1.5]), np.array([1.0, 0.125, -0.25])
    one, two = (
        ExactScene([surface]).crossings(o + shift, d)
        for surface, shift in ((near, 0.0), (far, np.array([2.0**20, 0, 0])))
    )
    assert [a.t for a in one] == [b.t for b in two]
    assert len(one) == 2


class TestMutants:
    @pytest.mark.parametrize("mutant", MUTANTS, ids=lambda mutant: mutant.name)
    def test_each_changes_one_text_that_is_there(self, mutant):
        """Where one is not: the function has changed, so say anew what the mutant changes."""
        file, text = applied(ROOT, mutant)
        assert text != file.read_text("utf-8")
        compile(text, str(file), "exec")

    def test_names_are_told_apart(self):
        assert len({mutant.name for mutant in MUTANTS}) == len(MUTANTS)
        assert all(set(mutant.kinds) <= set(KINDS) for mutant in MUTANTS)

    @pytest.mark.parametrize(
        ("where", "old", "words"),
        [
            ("no_such", "a", "no function"),
            ("GROWTH", "a", "is in"),
            ("offer_root", "\0", "0 times"),
        ],
    )
    def test_what_does_not_fit_is_refused(self, where, old, words):
        with pytest.raises(ValueError, match=words):
            applied(ROOT, Mutant("m", where, old, "b", "nothing", ("patches",)))

    def test_rows_with_new_faults_are_noticed(self):
        """A bound too tight by a factor of 1e6, made here instead of by a mutant."""
        name, place, k = "torus, tangents", "home", 1e-3
        tracer = Intersector(placed_surfaces(name, place), coarse="none", threads=1)
        cell = trace_cell(tracer, name, k, place, 20, 1)
        tight = dataclasses.replace(cell.hits, t_bound=1e-6 * cell.hits.t_bound)
        before, after = ({(name, place, k): cell._replace(hits=x)} for x in (cell.hits, tight))
        notice, differing, judged = compared(before, after, 10, {})
        assert differing == cell.hits.hit.sum()
        assert notice is not None
        assert (notice.set_name, notice.faults) == (name, ["bound broken"])
        assert 1 <= judged <= 10
        assert compared(before, before, 10, {}) == (None, 0, 0)


def run_tool(tool, monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", [tool, *words])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOLS / tool), run_name="__main__")
    return ended.value.code


class TestCounts:
    @pytest.fixture
    def traced(self):
        surfaces = SETS["egg poles"].surfaces()
        rays = ordinary_rays(surfaces, 60, 2)
        hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
        assert hits.hit.sum() > 15
        return surfaces, hits, rays

    def judged(self, judge, hits, rays, **columns):
        """Judge with the first four hits changed."""
        rows, out = np.flatnonzero(hits.hit)[:4], {}
        for name, value in columns.items():
            out[name] = getattr(hits, name).copy()
            out[name][rows] = value
        group = Group(ORDINARY, "egg", "turned", 1)
        changed = dataclasses.replace(hits, **out)
        _judge(judge, group, Batch("batch", changed, rays.origins, rays.directions))
        return group

    def test_faults_are_counted_by_kind(self, traced):
        surfaces, hits, rays = traced
        rows = np.flatnonzero(hits.hit)[:4]
        count = self.judged(Judge(surfaces), hits, rays).count
        assert (count.faults, count.asked, count.rays) == (0, 0, 60)
        lost = {"t": np.inf, "object_id": -1, "status": Status.MISS}
        group = self.judged(Judge(surfaces), hits, rays, **lost)
        assert (group.count.n_wrong, group.count.asked) == (4, 4)
        fault, ray = group.examples[0]
        assert fault == "missed"
        assert [float.fromhex(x) for x in ray["origin"]] == rays.origins[ray["row"]].tolist()
        shifted = self.judged(Judge(surfaces), hits, rays, t=(hits.t + 3.0 * hits.t_bound)[rows])
        assert shifted.count.bounds_broken == 4
        aside = self.judged(Judge(surfaces), hits, rays, v=0.99 * hits.v[rows])
        assert aside.count.off_ray == 4

    def test_rows_that_say_tangent_are_no_faults_and_may_be_passed_over(self, traced):
        surfaces, hits, rays = traced
        marked = {"t": np.inf, "object_id": -1, "status": Status.TANGENT}
        count = self.judged(Judge(surfaces), hits, rays, **marked).count
        assert (count.faults, count.wrong_tangent, count.passed_over) == (0, 4, 0)
        count = self.judged(Judge(surfaces, 3), hits, rays, **marked).count
        assert (count.wrong_tangent, count.asked, count.passed_over) == (2, 2, 2)
        # Asked for marks, exact arithmetic judges all rows.
        needless = self.judged(Judge(surfaces, marks=True), hits, rays, status=Status.TANGENT)
        assert (needless.count.tangent_needlessly, needless.count.asked) == (4, 60)


def test_runs_add_up_unless_their_rays_are_the_same():
    one = Group(SINGULAR, "cone tip", "turned", 1, BatchVerdict(rays=5, hits=3, seconds=1.0))
    two = dataclasses.replace(one, seed=2, count=BatchVerdict(rays=7, off_ray=1, seconds=0.5))
    scene = Group(HARD, "vase", "scene", 1, BatchVerdict(rays=2))
    table = added([one, two, scene])
    assert table[SINGULAR, "turned"] == BatchVerdict(rays=12, hits=3, off_ray=1, seconds=1.5)
    assert table[HARD, "scene"].rays == 2
    with pytest.raises(ValueError, match="'cone tip' with seed 1 are there twice"):
        added([one, two, one])


def test_the_tool_keeps_runs_and_adds_them_up(tmp_path, monkeypatch, capsys):
    files = [str(tmp_path / f"{k}.json") for k in range(2)]
    for k, file in enumerate(files):
        assert run_tool(
            "verify.py", monkeypatch, "--singular", "80", "--only", "sphere, tangents",
            "--ordinary", "60", "--only", "fan", "--seed", str(k), "--out", file,
        ) == 0  # fmt: skip
    assert json.loads(Path(files[0]).read_text())[0]["count"]["rays"] == 60
    assert run_tool("verify.py", monkeypatch, "--add-up", *files) == 0
    assert "280 rays, 0 faults, 0 left open" in capsys.readouterr().out
    broken = json.loads(Path(files[1]).read_text())
    broken[0]["count"]["off_ray"] = 1
    Path(files[1]).write_text(json.dumps(broken))
    assert run_tool("verify.py", monkeypatch, "--add-up", *files) == 1
    assert run_tool("verify.py", monkeypatch, "--add-up", files[0], files[0]) == 2


def test_no_rays_are_refused(monkeypatch, capsys):
    assert run_tool("verify.py", monkeypatch) == 2
    assert "pass --hard" in capsys.readouterr().err
    assert run_tool("verify.py", monkeypatch, "--singular", "3") == 2
    assert "one for each cell" in capsys.readouterr().err


def test_mutants_are_listed(monkeypatch, capsys):
    assert run_tool("mutants.py", monkeypatch, "--list", "--only", "fans") == 0
    assert "fans halved: at most one root in a cell; in fill_cell" in capsys.readouterr().out
