"""Kernels run interpreted (NUMBA_DISABLE_JIT=1) give what they give compiled."""

import os
import subprocess
import sys

import numba
import numpy as np
import pytest

from benchmarks.embree_newton import Rival, buffers, evaluate_with_numpy
from hybrid_rt.intersection.kernels.patch.bicubic import evaluate_bicubic_plain
from hybrid_rt.intersection.kernels.patch.skew_box import (
    LOWER,
    RECORD,
    UPPER,
    meet_box,
    meet_box_plain,
)
from hybrid_rt.intersection.kernels.search.boxes import FARTHEST, BoxRay, push_boxes, sort_key_plain
from hybrid_rt.intersection.kernels.search.boxes import push_boxes_plain as boxes_plain

SCRIPT = """
import sys
import numpy as np
from hybrid_rt import Box, Intersector, Rectangle, Sphere, Torus
from meshing import BezierPatches, SurfaceOfRevolution

SKEW = [[1, 0.2, 0, 0], [-0.3, 1, 0, 0], [0, 0.1, 1, 0], [0, 0, 0, 1]]
rng = np.random.default_rng(3)
x, y = np.meshgrid(np.linspace(-1, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
bicubic = np.stack([x, y, rng.normal(0, 0.3, (4, 4))], axis=-1)
x, y = np.meshgrid(np.linspace(-1, 1, 3), np.linspace(-1, 1, 5), indexing="ij")
other = np.stack([x, y, 2 + rng.normal(0, 0.3, (3, 5))], axis=-1)
surfaces = [
    BezierPatches([bicubic, other]),
    SurfaceOfRevolution([(-1, 0.4), (0, 1.2), (1, 0.3)], (0, 0, 4), (0, 0.2, 1)),
    Sphere((0.5, 0, 6), 0.6),
    Rectangle((-2, -2, -2), (4, 0, 0), (0, 4, 0)),
    Box((1, 1, 1), (1.5, 1.5, 1.5)),
    Torus((0, 0, 6.5), (0.3, 1, 0.2), 1.3, 0.2),
    Box((-1.5, 1, 2), (-0.5, 2, 3)).transformed(SKEW),
]
tracer = Intersector(surfaces, coarse="none", threads=1)
origins = rng.normal(size=(60, 3)) + (0, 0, 9)
targets = rng.uniform((-1, -1, -2), (1, 1, 6), (60, 3))
hits = tracer.intersect(origins, targets - origins)
columns = [hits.t, hits.object_id, hits.patch_id, hits.u, hits.v, hits.status, hits.t_bound]
np.save(sys.argv[1], np.array([np.asarray(c, float) for c in columns]))
"""


@pytest.mark.interpreted
def test_first_hits_are_the_same_interpreted(tmp_path):
    found = {}
    for flag in ("0", "1"):
        file = tmp_path / f"hits{flag}.npy"
        subprocess.run(
            [sys.executable, "-c", SCRIPT, str(file)],
            check=True,
            timeout=300,
            env={**os.environ, "NUMBA_DISABLE_JIT": flag},
        )
        found[flag] = np.load(file)
    compiled, interpreted = found["0"], found["1"]
    assert np.isfinite(compiled[0]).sum() > 30
    assert set(compiled[1]) >= {0.0, 1.0, 2.0, 3.0, 5.0, 6.0}
    # Ids and statuses are decisions; figures may differ by the last bits of sqrt, hypot and atan2.
    for row in (1, 2, 5):
        assert np.array_equal(compiled[row], interpreted[row])
    for row in (0, 3, 4):
        assert np.allclose(compiled[row], interpreted[row], rtol=1e-13, atol=1e-15, equal_nan=True)


def test_bicubic_points_have_a_twin_in_numpy():
    rng = np.random.default_rng(4)
    nets, (u, v) = rng.normal(size=(50, 4, 4, 3)), rng.random((2, 50))
    control = np.zeros((800, 4))
    control[:, :3] = nets.reshape(-1, 3)
    plain = [evaluate_bicubic_plain(control, 16 * i, u[i], v[i]) for i in range(50)]
    twin = evaluate_with_numpy(nets, u, v)
    assert np.allclose(np.reshape(plain, (50, 3, 3)).transpose(1, 0, 2), twin, atol=1e-14)


@numba.njit
def _push(rows, o, r, sign, t_lo, t_hi, keys, parents):
    ray = BoxRay(o[0], o[1], o[2], r[0], r[1], r[2], sign[0], sign[1], sign[2])
    return push_boxes(rows, 1, ray, t_lo, t_hi, keys, parents, 2)


def test_eight_boxes_have_a_plain_twin():
    rng = np.random.default_rng(5)
    low = rng.uniform(-1, 1, (2, 3, 8)).astype(np.float32)
    rows = np.zeros((2, 8, 8), np.float32)
    rows[:, :3], rows[:, 3:6] = low, low + rng.uniform(0, 2, (2, 3, 8)).astype(np.float32)
    # No child at all, as in a node with few.
    rows[:, :3, 5], rows[:, 3:6, 5] = np.inf, -np.inf
    heights = set()
    for _ in range(300):
        o, d = rng.uniform(-2, 2, 3).astype(np.float32), rng.normal(size=3)
        r = (1.0 / d).astype(np.float32)
        sign = np.where(r > 0, 0, 3)
        t_lo, t_hi = np.float32(rng.uniform(-1, 0.5)), np.float32(rng.choice([1.0, np.inf]))
        stacks = [(np.empty(16, np.int32), np.empty(16, np.uint32)) for _ in range(2)]
        top, nearest = boxes_plain(rows, 1, BoxRay(*o, *r, *sign), t_lo, t_hi, *stacks[0], 2)
        assert _push(rows, o, r, sign, t_lo, t_hi, *stacks[1]) == (top, nearest)
        assert nearest == (stacks[0][0][top - 1] if top > 2 else FARTHEST)
        for plain, compiled in zip(*stacks, strict=True):
            assert np.array_equal(plain[2:top], compiled[2:top])
        # The same by sorting slabs, where rounding does not decide.
        assert 5 not in stacks[0][0][2:top] & 7
        ts = (rows[1, :6].reshape(2, 3, 8) - o[:, None]) * r[:, None]
        near, far = ts.min(axis=0).max(axis=0), ts.max(axis=0).min(axis=0)
        near, far = np.maximum(near, t_lo), np.minimum(far, t_hi)
        clear = (np.abs(far - near) > 1e-4) & (np.arange(8) != 5)
        met = np.isin(np.arange(8), stacks[0][0][2:top] & 7)
        assert np.array_equal(met[clear], (near <= far)[clear])
        assert (np.diff(near[stacks[0][0][2:top] & 7]) <= 1e-5).all()
        heights.add(top - 2)
    assert len(heights) > 4


@numba.njit
def _meet(record, cell, o, d):
    return meet_box(record, cell, o[0], o[1], o[2], d[0], d[1], d[2])


@pytest.mark.parametrize("flat", [(), (1,), (0, 2)])
def test_a_skew_box_has_a_plain_twin(flat):
    rng = np.random.default_rng(6)
    record = rng.normal(size=(2, RECORD))
    # Rows along the axes, so that a direction can run exactly along slabs.
    record[:, :12] = np.hstack([np.eye(3), np.zeros((3, 1))]).ravel()
    low = rng.uniform(-1, 1, (2, 3))
    record[:, LOWER : LOWER + 3], record[:, UPPER : UPPER + 3] = low, low + 1
    n_met = 0
    for _ in range(100):
        o, d = rng.uniform(-1, 2, 3), rng.normal(size=3)
        d[list(flat)] = 0.0
        plain = meet_box_plain(record, 1, *o, *d)
        assert _meet(record, 1, o, d) == plain
        # A point of the ray is in the box wherever it is said to be, and beside it nowhere.
        t0, t1 = plain[:2]
        inside = [
            np.all((low[1] <= o + t * d) & (o + t * d <= low[1] + 1)) for t in _around(t0, t1)
        ]
        assert inside == ([False, True, False] if t0 < t1 else [False])
        n_met += t0 < t1
    assert 3 < n_met < 97


def _around(t0, t1):
    """Points before, within and after a range of t; some point if it is empty."""
    if not t0 < t1:
        return (0.1,)
    return (t0 - 1e-6, 0.5 * (t0 + t1), t1 + 1e-6)


def test_keys_order_as_floats_do():
    x = np.float32([-np.inf, -3.5, -1e-30, 0.0, 1e-30, 1.0, np.nextafter(np.float32(1), 2), np.inf])
    keys = [sort_key_plain(v) for v in x]
    assert keys == sorted(set(keys))


def test_the_rival_finds_what_a_plain_newton_finds():
    from hybrid_rt import Intersector
    from hybrid_rt.analysis.ray_sets import at_box
    from hybrid_rt.demo import teapot
    from hybrid_rt.intersection.hit_errors import certified_hits, compare

    surface = teapot()
    rays, out = at_box([surface], 5000, seed=6), buffers(5000)
    Rival(surface, threads=2).intersect(rays.origins, rays.directions, out)
    exact = certified_hits(Intersector([surface]), rays.origins, rays.directions)
    errors = compare(exact, out[0], np.where(np.isfinite(out[0]), 0, -1))
    # It loses about one hit in a hundred, and never finds one that is not there.
    assert errors.wrong_hits.counts["phantom"] == 0
    assert 0 < errors.wrong_hits.wrong < 0.03 * 5000
    assert errors.worst < 1e-6
