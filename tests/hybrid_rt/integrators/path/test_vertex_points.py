"""Points drawn for runs of vertices are those that the sampler gives one by one."""

from typing import NamedTuple

import numpy as np
import pytest

from hybrid_rt.integrators.kernels.vertex_points import (
    CONNECT,
    LATER,
    N_SLOTS,
    PER_STEP,
    RUN_ACROSS,
    RUN_ALONG,
    TO_SPHERE,
    RunPoints,
    draw_across,
    draw_along,
    draw_later,
    new_run_points,
)
from hybrid_rt.sampling.sampler import Sampler
from meshing.kernels.jit import kernel

SEED, FIRST, DEPTH = 2**40 + 7, 5, 9
PIXEL = np.arange(3 * RUN_ACROSS, dtype=np.uint64) * np.uint64(2**31 + 11)
SAMPLE = np.arange(PIXEL.size, dtype=np.uint64) * np.uint64(977)


class Rules(NamedTuple):
    seed: np.uint64 = np.uint64(SEED)
    first_dimension: np.uint64 = np.uint64(FIRST)
    samples_lights: bool = True
    has_light_paths: bool = True
    min_distance: float = 0.5


@kernel
def along(rules, pixel, sample, points):
    draw_along(rules, DEPTH, pixel, sample, points)


@kernel
def across(rules, pixel, sample, begin, points):
    draw_across(rules, DEPTH, pixel, sample, begin, points)


@kernel
def to_sphere(rules, pixel, sample, out):
    out[0], out[1] = draw_later(rules, DEPTH, TO_SPHERE, pixel, sample)


def expected(rows: slice, depth: int) -> np.ndarray:
    """(2, N_SLOTS + 1, rows), by the sampler."""
    of_vertex = FIRST + depth * PER_STEP
    dimensions = [of_vertex + k for k in range(CONNECT)]
    dimensions += [of_vertex + CONNECT + j * LATER for j in range(3)]
    sampler = Sampler(SEED)
    found = [sampler.points(PIXEL[rows], d, SAMPLE[rows]) for d in dimensions]
    return np.array(found).transpose(2, 0, 1)


def test_along_a_path():
    points = new_run_points(RUN_ALONG)
    along(Rules(), PIXEL[100], SAMPLE[100], points)
    for k in range(RUN_ALONG):
        truth = expected(slice(100, 101), DEPTH + k)[:, :N_SLOTS, 0]
        np.testing.assert_array_equal(points.xi[:, :, k], truth)


@pytest.mark.parametrize("begin", [0, RUN_ACROSS, PIXEL.size - 7])
def test_across_paths(begin):
    points = new_run_points(RUN_ACROSS)
    across(Rules(), PIXEL, SAMPLE, begin, points)
    truth = expected(slice(begin, begin + RUN_ACROSS), DEPTH)[:, :N_SLOTS]
    np.testing.assert_array_equal(points.xi[:, :, : truth.shape[2]], truth)


def test_by_way_of_spheres():
    out = np.empty(2)
    to_sphere(Rules(), PIXEL[100], SAMPLE[100], out)
    np.testing.assert_array_equal(out, expected(slice(100, 101), DEPTH)[:, N_SLOTS, 0])


def test_unused_slots_are_left_alone():
    points = RunPoints(np.full((2, N_SLOTS, RUN_ALONG), -1.0), *new_run_points(RUN_ALONG)[1:])
    along(Rules(samples_lights=False, min_distance=np.inf), PIXEL[0], SAMPLE[0], points)
    is_drawn = (points.xi >= 0.0).all(axis=(0, 2))
    np.testing.assert_array_equal(is_drawn, [False, True, True, True, False])
