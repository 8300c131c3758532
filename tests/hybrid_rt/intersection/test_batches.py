"""Batches whose parts do not fit are refused; those that fit are matched ray by ray."""

from dataclasses import replace

import numpy as np
import pytest
from numba import typeof

from hybrid_rt import Intersector, Sphere
from hybrid_rt.core.records import NamedPoints
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.margins import _rows_of
from hybrid_rt.intersection.ray_batch import make_batch

O, D = np.tile([0.0, -4.0, 0.0], (2, 3, 1)), np.tile([0.0, 1.0, 0.0], (2, 3, 1))
SIX = np.zeros(6, np.int32)


@pytest.fixture(scope="module")
def tracer():
    return Intersector([Sphere((0, 0, 0), 1), Sphere((0, 3, 0), 1)], threads=1)


@pytest.mark.parametrize(
    ("rays", "settings", "error", "words"),
    [
        ((O, D), {"t_max": np.ones((3, 2))}, ValueError, r"t_max .*\(3, 2\) .*\(2, 3, 3\)"),
        ((O, D), {"t_min": np.ones(3)}, ValueError, r"t_min .*\(3,\) .*\(6,\) or \(2, 3\)"),
        ((O, D), {"t_max": None}, TypeError, "t_max is None: pass a number, or inf"),
        ((O, D), {"t_max": "far"}, TypeError, "t_max is 'far': pass real numbers"),
        ((O, D), {"t_min": np.nan}, ValueError, "t_min holds nan"),
        ((O, D.reshape(3, 2, 3)), {}, ValueError, r"\(2, 3, 3\) and \(3, 2, 3\)"),
        ((O + 1j, D), {}, TypeError, "origins is .*: pass real numbers"),
        ((O, D), {"source": 5}, TypeError, "source is 5: pass hits of this intersector"),
        ((O, D), {"source": NamedPoints(SIX[:5], O[0])}, ValueError, r"source .*\(5,\) for 6 rays"),
        ((O, D), {"source": NamedPoints(SIX, O)}, ValueError, r"source position .*\(2, 3, 3\)"),
        ((O, D), {"unseen": [0, 1]}, ValueError, r"unseen has shape \(2,\) for 6 rays"),
        ((O, D), {"unseen": SIX.reshape(2, 3)}, ValueError, r"unseen has shape \(2, 3\)"),
        ((O, D), {"unseen": SIX + 0.5}, TypeError, "unseen names objects by float64"),
        ((O, D), {"unseen": SIX + 2}, ValueError, "unseen names object 2 of 2: pass 0 to 1"),
        ((O, D), {"unseen": SIX - 2}, ValueError, "unseen names object -2 of 2"),
    ],
)
def test_parts_that_do_not_fit_are_refused(tracer, rays, settings, error, words):
    with pytest.raises(error, match=words):
        tracer.intersect(*rays, **settings)


@pytest.mark.parametrize("settings", [{"target": 5}, {"t_max": np.ones((3, 2))}])
def test_shadow_rays_are_checked_alike(tracer, settings):
    with pytest.raises((TypeError, ValueError), match=r"target is 5|t_max has shape \(3, 2\)"):
        tracer.occluded(O, D, **settings)


def test_a_single_surface_need_not_stand_in_a_list():
    ball = Sphere((0, 0, 0), 1)
    hits = [Intersector(surfaces).intersect(O, D) for surfaces in (ball, [ball])]
    assert hits[0].object_id.tolist() == [0] * 6
    np.testing.assert_array_equal(hits[0].t, hits[1].t)
    with pytest.raises(TypeError, match="surfaces is 5: pass a list"):
        Intersector(5)


def test_crossings_are_checked_alike(tracer):
    with pytest.raises(ValueError, match=r"t_max has shape \(3, 2\)"):
        tracer.intersect_all(O, D, t_max=np.ones((3, 2)))
    assert tracer.intersect_all(O, D[0, 0], t_max=4.0).count.tolist() == [1] * 6


def test_limits_and_unseen_objects_belong_to_their_rays(tracer):
    far = np.array([[np.inf, 3.5, 2.5], [3.0, 3.5, np.inf]])
    near = np.array([[3, 3, np.inf], [np.inf, 3, 3]])
    for limit in (far, far.ravel()):
        assert tracer.intersect(O, D, t_max=limit).t.tolist() == near.ravel().tolist()
    hidden = tracer.intersect(O, D, unseen=[0, -1, 0, -1, 1, 0])
    assert hidden.t.tolist() == [6, 3, 6, 3, 3, 6]


def test_displaced_rays_need_no_kernels_of_their_own():
    """Rays that are traced again, beside themselves, have the types of all rays."""
    o, d = np.zeros((3, 3)), np.ones((3, 3))
    rays, _, _ = make_batch(o, d, 0.0, np.inf, None, None, np.zeros(1), Pool(1)).rows(0, 3)
    for rows in (np.arange(2), np.array([2, 2, 0])):
        assert typeof(_rows_of(rays, rows)) == typeof(rays)


def test_hits_may_be_written_into_memory_that_is_there(tracer):
    o, d = O.reshape(-1, 3), D.reshape(-1, 3)
    wanted, room = tracer.intersect(o, -d), tracer.intersect(o, d)
    assert room.hit.all()
    assert not wanted.hit.any()
    assert tracer.intersect(o, -d, out=room) is room
    for name, column in vars(room).items():
        assert column.tobytes() == getattr(wanted, name).tobytes(), name
    tracer.intersect(o[:2], d[:2], out=room[2:4])
    assert room.hit.tolist() == [False, False, True, True, False, False]


@pytest.mark.parametrize(
    ("out", "error", "words"),
    [
        (5, TypeError, "out is 5: pass a HitRecord of 6 rows"),
        (0, ValueError, r"out.t is float64 \(5,\): pass float64 \(6,\) that is writable"),
        (1, ValueError, r"out.position .*pass float64 \(6, 3\) that is writable and in C order"),
        (2, ValueError, r"out.object_id is int64 \(6,\): pass int32 \(6,\)"),
    ],
)
def test_memory_that_does_not_fit_is_refused(tracer, out, error, words):
    room = tracer.intersect(O, D)
    faults = {
        0: lambda: room[:5],
        1: lambda: replace(room, position=np.zeros((3, 6)).T),
        2: lambda: replace(room, object_id=np.zeros(6, np.int64)),
    }
    with pytest.raises(error, match=words):
        tracer.intersect(O, D, out=faults.get(out, lambda: out)())
