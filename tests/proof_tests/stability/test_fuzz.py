"""Random surfaces, scenes and files: a few of each; `run_fuzz` tries more."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings

from hybrid_rt.analysis.picture_comparison import load_picture
from hybrid_rt.rendering import renderer
from proof.stability import fuzz, fuzz_light, fuzz_properties
from proof.stability.fuzz_cases import NumpyDraws, build
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


# Rooms whose means one render knows to 0.7 %, so that 4 % too much light is seen.
@pytest.mark.parametrize("number", [3, 17])
def test_integrators_agree_in_random_rooms(monkeypatch, number):
    monkeypatch.setattr(fuzz_light, "RENDERS", 1)
    case = fuzz.make_case(NumpyDraws(np.random.default_rng(number)), "light")
    assert fuzz.faults_of(case) == ()


def test_integrators_that_disagree_are_found(monkeypatch):
    def brighter(scene, integrator, *args, **keywords):
        result = renderer.render(scene, integrator, *args, **keywords)
        if integrator != "whitted":
            return result
        report = dict(result.report)
        report["noise"] = {**report["noise"], "image_mean": 1.1 * report["noise"]["image_mean"]}
        return SimpleNamespace(report=report)

    monkeypatch.setattr(fuzz_light, "render", brighter)
    monkeypatch.setattr(fuzz_light, "RENDERS", 1)
    case = fuzz.make_case(NumpyDraws(np.random.default_rng(3)), "light")
    (fault,) = fuzz.faults_of(case)
    assert fault.startswith("whitted has")


@pytest.mark.parametrize("row_id", FOUND)
def test_what_was_found_holds(row_id):
    outcome = FOUND[row_id].run(Effort())
    assert outcome.holds, outcome.faults


def test_failures_are_cut_down_kept_and_run_again(tmp_path, monkeypatch):
    """A tracer that loses hits on spheres from one side is found, on one sphere and one ray."""
    judged = fuzz_properties.compare

    def losing(hits, truth):
        lost = hits.hit & (truth.directions[:, 0] > 0)
        hits.t[lost], hits.object_id[lost] = np.inf, -1
        return judged(hits, truth)

    monkeypatch.setattr(fuzz_properties, "compare", losing)
    monkeypatch.setattr(fuzz, "SHARES", ("mixed",))
    failures = []
    for number in range(2):
        draws = NumpyDraws(np.random.default_rng([1, number]))
        failure = fuzz.tried(draws, "mixed")
        if failure is not None:
            failures.append(fuzz.cut_down(failure))
    assert failures
    smallest = min(failures, key=lambda failure: len(failure.case["surfaces"]))
    assert len(smallest.case["surfaces"]) == len(smallest.case["origins"]) == 1
    file = smallest.save(tmp_path)
    again = fuzz.read_failure(file)
    assert again == smallest
    assert fuzz.faults_of(again.case) == smallest.faults
    monkeypatch.undo()
    assert fuzz.faults_of(again.case) == ()
    build(again.case["surfaces"][0])


def test_the_loop_keeps_what_it_finds(tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "faults_of", lambda *_: ("something does not hold",))
    found = fuzz.run_fuzz(0.002, seed=3, out=tmp_path)
    assert len(list((tmp_path / "failures").glob("*.json"))) == len(found) > 0
