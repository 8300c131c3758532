"""Random surfaces, scenes and files: a few of each; `run_fuzz` tries more."""

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from hybrid_rt.analysis.picture_comparison import load_picture
from proof.stability import fuzz, fuzz_properties
from proof.stability.fuzz_cases import build
from proof.stability.row import Effort, all_rows

pytestmark = pytest.mark.slow

FOUND = {row_id: entry for row_id, entry in all_rows().items() if row_id[0] == "G"}

READERS = {**fuzz.READERS, "npz": load_picture}
# No database, the same cases every time, and no clock: kernels compile when they are first used.
SETTINGS = settings(
    derandomize=True,
    database=None,
    deadline=None,
    phases=(Phase.explicit, Phase.generate, Phase.shrink),
    suppress_health_check=list(HealthCheck),
)


@settings(SETTINGS, max_examples=50)
@given(fuzz.strategy("surfaces"))
def test_hits_on_surfaces_of_one_class(case):
    assert fuzz.faults_of(case) == ()


@settings(SETTINGS, max_examples=40)
@given(fuzz.strategy("mixed"))
def test_hits_on_mixtures(case):
    assert fuzz.faults_of(case) == ()


@settings(SETTINGS, max_examples=150)
@given(fuzz.strategy("scene"))
def test_scenes_are_rendered_or_refused(case):
    assert fuzz.faults_of(case) == ()


@settings(SETTINGS, max_examples=200)
@given(fuzz.strategy("file", tuple(READERS)))
def test_damaged_files_are_read_or_refused(case):
    assert fuzz.faults_of(case, READERS) == ()


@pytest.mark.parametrize("row_id", FOUND)
def test_what_was_found_holds(row_id):
    outcome = FOUND[row_id].run(Effort())
    assert outcome.holds, outcome.faults


def test_failures_are_cut_down_kept_and_run_again(tmp_path, monkeypatch):
    """A tracer that loses hits is found, on one surface and few rays."""
    judge = fuzz_properties.Judge.judge

    def losing(self, hits, origins, directions):
        lost = hits.hit & (directions[:, 0] > 0)
        hits.t[lost], hits.object_id[lost] = np.inf, -1
        return judge(self, hits, origins, directions)

    monkeypatch.setattr(fuzz_properties.Judge, "judge", losing)
    failure = fuzz.searched("surfaces", 1)
    assert len(failure.case["surfaces"]) == 1
    assert len(failure.case["origins"]) < fuzz.N_RAYS
    file = failure.save(tmp_path)
    again = fuzz.read_failure(file)
    assert again == failure
    assert fuzz.faults_of(again.case) == failure.faults
    monkeypatch.undo()
    assert fuzz.faults_of(again.case) == ()
    build(again.case["surfaces"][0])


def test_the_loop_keeps_what_it_finds(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "faults_of", lambda *_: ("something does not hold",))
    found = fuzz.run_fuzz(0.002, seed=3, out=tmp_path)
    assert len(list((tmp_path / "failures").glob("*.json"))) == len(found) > 0
