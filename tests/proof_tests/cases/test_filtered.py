"""Campaigns on very many rays: their figures, their sums, and their tool."""

import dataclasses
import json
import runpy
import sys
from pathlib import Path

import numpy as np
import pytest

from hybrid_rt import Intersector
from hybrid_rt.core.records import Status
from proof.cases.filtered_campaign import (
    ORDINARY,
    ORDINARY_SCENES,
    SINGULAR,
    Checker,
    Count,
    Group,
    added,
    ordinary_rays,
    run_ordinary,
    run_singular,
)
from proof.cases.singular_sets import KINDS, SETS

TOOL = Path(__file__).parents[3] / "tools" / "verify_many.py"


def test_nothing_is_wrong_at_a_few_sets():
    for name in ("cone tip", "sphere, tangents", "collapsed edge", "open mesh, edges"):
        group = list(run_singular(name, 240, 7))[-1]
        assert group.count.rays == 240
        assert group.count.faults == group.count.left_open == 0
        assert group.count.asked < 100
        assert group.kind == SETS[name].kind


def test_ordinary_rays_hardly_need_exact_arithmetic():
    for name in ("spindle", "bent sheet", "skew box", "fan"):
        kind = ORDINARY_SCENES[name][0]
        group = list(run_ordinary(name, 300, 7))[-1]
        assert (group.count.rays, group.kind, group.rays) == (300, kind, ORDINARY)
        assert group.count.hits > 20
        assert group.count.faults == 0
        assert group.count.asked <= 3
    assert {kind for kind, _ in ORDINARY_SCENES.values()} == set(KINDS)


class TestChecker:
    @pytest.fixture
    def traced(self):
        surfaces = SETS["egg poles"].surfaces()
        rays = ordinary_rays(surfaces, 60, 2)
        hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
        assert hits.hit.sum() > 15
        return Checker, surfaces, hits, rays

    def checked(self, checker, hits, rays):
        group = Group("egg", "turned", ORDINARY, 1)
        checker.check(group, "batch", hits, rays.origins, rays.directions, None)
        return group

    def changed(self, hits, **columns):
        """Change the first four hits."""
        rows, out = np.flatnonzero(hits.hit)[:4], {}
        for name, value in columns.items():
            out[name] = getattr(hits, name).copy()
            out[name][rows] = value
        return dataclasses.replace(hits, **out)

    def test_faults_are_counted_by_kind(self, traced):
        make, surfaces, hits, rays = traced
        rows = np.flatnonzero(hits.hit)[:4]
        t, bound = hits.t[rows], hits.t_bound[rows]
        count = self.checked(make(surfaces), hits, rays).count
        assert (count.faults, count.asked, count.rays) == (0, 0, 60)
        lost = self.changed(hits, t=np.inf, object_id=-1, status=Status.MISS)
        group = self.checked(make(surfaces), lost, rays)
        assert (group.count.wrong, group.count.asked) == (4, 4)
        fault, ray = group.examples[0]
        assert fault == "missed"
        assert [float.fromhex(x) for x in ray["origin"]] == rays.origins[ray["row"]].tolist()
        shifted = self.changed(hits, t=t + 3.0 * bound)
        assert self.checked(make(surfaces), shifted, rays).count.bounds_broken == 4
        aside = self.changed(hits, v=0.99 * hits.v[rows])
        assert self.checked(make(surfaces), aside, rays).count.off_ray == 4

    def test_rows_that_say_tangent_are_no_faults_and_may_be_passed_over(self, traced):
        make, surfaces, hits, rays = traced
        marked = self.changed(hits, t=np.inf, object_id=-1, status=Status.TANGENT)
        count = self.checked(make(surfaces), marked, rays).count
        assert (count.faults, count.wrong_tangent, count.passed_over) == (0, 4, 0)
        count = self.checked(make(surfaces, 3), marked, rays).count
        assert (count.wrong_tangent, count.asked, count.passed_over) == (2, 2, 2)


def test_runs_add_up_unless_their_rays_are_the_same():
    one = Group("cone tip", "turned", SINGULAR, 1, Count(rays=5, hits=3, seconds=1.0))
    two = dataclasses.replace(one, seed=2, count=Count(rays=7, wrong=1, seconds=0.5))
    ball = Group("fan", "mesh", ORDINARY, 1, Count(rays=2))
    table = added([one, two, ball])
    assert table[SINGULAR, "turned"] == Count(rays=12, hits=3, wrong=1, seconds=1.5)
    assert table[ORDINARY, "mesh"].rays == 2
    with pytest.raises(ValueError, match="'cone tip' with seed 1 are there twice"):
        added([one, two, one])


def run_tool(monkeypatch, *words):
    monkeypatch.setattr(sys, "argv", ["verify_many.py", *words])
    with pytest.raises(SystemExit) as ended:
        runpy.run_path(str(TOOL), run_name="__main__")
    return ended.value.code


def test_the_tool_keeps_runs_and_adds_them_up(tmp_path, monkeypatch, capsys):
    files = [str(tmp_path / f"{k}.json") for k in range(2)]
    for k, file in enumerate(files):
        assert run_tool(
            monkeypatch, "--singular", "80", "--set", "sphere, tangents", "--ordinary", "60",
            "--scene", "fan", "--seed", str(k), "--out", file,
        ) == 0  # fmt: skip
    assert json.loads(Path(files[0]).read_text())[0]["count"]["rays"] == 80
    assert run_tool(monkeypatch, "--add-up", *files) == 0
    assert "280 rays, 0 faults, 0 left open" in capsys.readouterr().out
    broken = json.loads(Path(files[1]).read_text())
    broken[0]["count"]["wrong"] = 1
    Path(files[1]).write_text(json.dumps(broken))
    assert run_tool(monkeypatch, "--add-up", *files) == 1
    assert run_tool(monkeypatch, "--add-up", files[0], files[0]) == 2


def test_no_rays_are_refused(monkeypatch, capsys):
    assert run_tool(monkeypatch) == 2
    assert "pass --singular" in capsys.readouterr().err
    assert run_tool(monkeypatch, "--singular", "3") == 2
    assert "one for each cell" in capsys.readouterr().err
