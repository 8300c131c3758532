"""What workers of a cluster send is taken only if it is what they were asked for."""

import pickle
from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from hybrid_rt import Camera, Lambertian, Object, Scene, SphereLight
from hybrid_rt.core.ledger import Ledger
from hybrid_rt.integrators.options import PathOptions, PPMOptions
from hybrid_rt.integrators.workers import Pass
from hybrid_rt.primitives.rectangle import Rectangle
from hybrid_rt.rendering import cluster, cluster_tasks
from hybrid_rt.rendering.cluster_tasks import keep_scene, make_passes
from hybrid_rt.rendering.run import ClusterLost
from hybrid_rt.rendering.set_up import set_up
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.sensor.passes import GROUPS, RUN

# The last pass of the first runs, which come one by one, and a whole run.
FIRST, STOP = GROUPS * RUN - 1, GROUPS * RUN + RUN
OPTIONS = {"path": PathOptions(), "ppm": PPMOptions(photons_per_pass=100)}


def request_of(integrator):
    floor = Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Lambertian(0.7), "floor")
    scene = Scene(
        Camera((0, -3, 3), (0, 0, 0), (0, 0, 1), width=4, height=3),
        [floor],
        [SphereLight((0, 0, 2), 0.1, 100)],
    )
    return scene, Settings(integrator, coarse="none", options=OPTIONS[integrator])


class Future:
    def __init__(self, result):
        self._result = result

    def result(self, timeout):
        del timeout
        return self._result

    def release(self):
        pass


@pytest.fixture(scope="module", params=["path", "ppm"])
def honest(request):
    asked = request_of(request.param)
    keep_scene("test", request.param, pickle.dumps(asked))
    made = make_passes("test", FIRST, STOP)
    cluster_tasks.forget_scene("test")
    return asked, made


def taken(asked, result):
    """Return what the client takes of it, sent as pickled as it would be."""
    here = set_up(*asked, 1, Ledger()).workers
    source = cluster.Cluster("local:1", *asked, here)
    future = Future(pickle.loads(pickle.dumps(result)))
    source._tasks = deque([cluster._Task(FIRST, STOP, future, frozenset())])
    source._looked = np.inf
    return source._next(lambda: None)


def with_made(result, k, **changes):
    part = result.parts[k]
    parts = [*result.parts]
    parts[k] = replace(part, made=replace(part.made, **changes))
    return replace(result, parts=parts)


def spoiled(array, value):
    array = array.copy()
    array.flat[3] = value
    return array


def counted(result, **changes):
    first, *others = result.parts
    return replace(result, parts=[replace(first, counts=replace(first.counts, **changes)), *others])


def ledger_with(result, **changes):
    return {**result.parts[0].counts.ledger, **changes}


LIES = {
    "no result": (lambda r: r.parts, "it is list, no list of passes"),
    "a part twice": (lambda r: replace(r, parts=[*r.parts, r.parts[0]]), "not each of .* once"),
    "in another order": (lambda r: replace(r, parts=r.parts[::-1]), "not each of .* once"),
    "other passes": (
        lambda r: replace(r, parts=[replace(r.parts[0], passes=range(1)), r.parts[1]]),
        "not each of .* once",
    ),
    "a pass as a run": (
        lambda r: replace(r, parts=[replace(r.parts[0], made=r.parts[1].made), r.parts[1]]),
        r"range\(15, 16\) came as Run",
    ),
    "another size": (
        lambda r: with_made(r, 0, radiance=np.zeros((3, 5, 3))), r"float64 \(3, 5, 3\), not float64"
    ),
    "one number": (lambda r: with_made(r, 0, radiance=np.float64(1)), r"float64 \(\), not float64"),
    "objects": (lambda r: with_made(r, 1, total=np.full((3, 4, 3), None)), "object .*, not"),
    "negative": (
        lambda r: with_made(r, 0, radiance=spoiled(r.parts[0].made.radiance, -1e-9)),
        "a radiance is negative",
    ),
    "nan": (
        lambda r: with_made(r, 0, radiance=spoiled(r.parts[0].made.radiance, np.nan)),
        "its radiance is not finite",
    ),
    "means missing": (lambda r: with_made(r, 1, means=(1.0,)), "no mean from 0 on for each of 4"),
    "blur of another size": (lambda r: with_made(r, 0, blur_change=np.zeros((2, 3))), "its blur is"),
    "blur in one part": (
        lambda r: with_made(
            r, 0, blur_change=None if r.parts[0].made.blur_change is not None else np.zeros((12, 3))
        ),
        "do not agree whether there is blur",
    ),
    "seconds": (lambda r: replace(r, seconds="1"), "its seconds are no number"),
    "no counts": (lambda r: counted(r, ledger=None), "counts are not those"),
    "a count missing": (lambda r: counted(r, work={}), "counts are not those"),
    "a count of nan": (
        lambda r: counted(r, ledger=ledger_with(r, carried=np.nan)), "counts are not those"
    ),
    "a count of another kind": (
        lambda r: counted(r, ledger=ledger_with(r, rays=1)), "counts are not those"
    ),
    "own counts": (lambda r: counted(r, own={"more": 1}), "counts are not those"),
}  # fmt: skip


@pytest.mark.parametrize(("lie", "words"), LIES.values(), ids=LIES)
def test_what_no_worker_makes_is_refused(honest, lie, words):
    asked, result = honest
    start = "a worker's result of passes 15 to 19 is refused: "
    with pytest.raises(ClusterLost, match=f"cluster 'local:1': {start}.*{words}.*Render without"):
        taken(asked, lie(result))


def test_what_a_worker_makes_is_taken(honest):
    asked, result = honest
    parts = taken(asked, result)
    assert [part.passes for part in parts] == [range(15, 16), range(16, 20)]
    own = list(set_up(*asked, 1, Ledger()).workers.render_passes(range(FIRST, STOP)))
    assert isinstance(parts[0].made, Pass)
    np.testing.assert_array_equal(parts[0].made.radiance, own[0].radiance)
