"""What connections read of light vertices."""

from typing import Any, NamedTuple

import numpy as np
import pytest

from hybrid_rt.integrators.kernels.connections import (
    CANDIDATES,
    NONE,
    choose_far,
)
from hybrid_rt.integrators.path.light_paths import (
    candidates_of,
    new_light_vertices,
    packed,
)

PASSES = (0, 0, 5, 5 + CANDIDATES, 100 + 3 * CANDIDATES)  # first rows: none, few, a group, more


def some_light_vertices(n):
    rng = np.random.default_rng(7)
    points = new_light_vertices(n, 1)
    for column in (points.position, points.geometric, points.direction):
        column[...] = rng.normal(size=column.shape)
    points.material[...] = rng.integers(0, 2, n)
    points.strength[...] = rng.random(n)
    points.steps[...] = rng.integers(0, 4, n)
    return points


def lit_sides(points):
    """Return the normals on the side that the light comes from."""
    facing = (points.geometric * points.direction).sum(axis=1, keepdims=True)
    return points.geometric * -np.sign(facing)


class PartOfWorld(NamedTuple):
    light_vertices: Any
    candidates: Any
    first_of_pass: Any
    first_group: Any


class PartOfRules(NamedTuple):
    min_distance: float
    max_depth: int


class PartOfVertex(NamedTuple):
    target_pdf: Any


class PartOfVertices(NamedTuple):
    position: Any
    normal: Any
    direction: Any


@pytest.mark.parametrize("number", range(len(PASSES) - 1))
def test_a_candidate_stands_for_all(number):
    """Over all groups, the mean of factor times what the chosen one brings is what all bring."""
    first_of_pass, near, depth, max_depth = np.array(PASSES), 0.8, 1, 4
    points = some_light_vertices(PASSES[-1])
    table, first_group = candidates_of(points, first_of_pass, np.array([True, False]))
    world = PartOfWorld(packed(points), table, first_of_pass, first_group)
    rules, vertex = PartOfRules(near, max_depth), PartOfVertex(np.empty(CANDIDATES))
    at, normal = np.array([[0.1, -0.2, 0.3]]), np.array([[0.6, 0.0, -0.8]])
    vertices = PartOfVertices(at, normal, -normal)

    rows = slice(PASSES[number], PASSES[number + 1])
    way = points.position[rows] - at
    square = (way**2).sum(axis=1)
    target_pdf = points.strength[rows] * np.maximum(way @ normal[0], 0.0) / square**2
    target_pdf *= np.maximum(-(lit_sides(points)[rows] * way).sum(axis=1), 0.0)
    target_pdf[(square < near**2) | (points.material[rows] != 0)] = 0.0
    target_pdf[points.steps[rows] > max_depth - depth - 1] = 0.0

    n_groups = int(np.diff(first_group)[number])
    found, n_t = np.zeros(target_pdf.size), 200
    for group, i in np.ndindex(n_groups, n_t):
        s, t = (group + 0.5) / n_groups, (i + 0.5) / n_t
        k, factor = choose_far(world, rules, vertex, vertices, depth, number, s, t)
        if k != NONE:
            found[k - PASSES[number]] += factor * target_pdf[k - PASSES[number]] / (n_groups * n_t)
    assert found.sum() == pytest.approx(target_pdf.sum(), rel=1e-12)
    # Each as often as in proportion to what it brings: to one value of t, at either end of its range.
    most = max((target_pdf[g::n_groups].sum() for g in range(n_groups)), default=0.0)
    np.testing.assert_allclose(found, target_pdf, rtol=0, atol=1.01 * most / n_t)


def test_nothing_to_choose():
    """No light vertex in the pass, or none that faces the surface."""
    points = some_light_vertices(PASSES[-1])
    table, first_group = candidates_of(points, np.array(PASSES), np.array([False, False]))
    world = PartOfWorld(packed(points), table, np.array(PASSES), first_group)
    rules, vertex = PartOfRules(0.0, 9), PartOfVertex(np.empty(CANDIDATES))
    vertices = PartOfVertices(np.zeros((1, 3)), *(np.array([[0.0, 0.0, z]]) for z in (1.0, -1.0)))
    for number in range(len(PASSES) - 1):
        assert choose_far(world, rules, vertex, vertices, 0, number, 0.5, 0.5) == (NONE, 0.0)
