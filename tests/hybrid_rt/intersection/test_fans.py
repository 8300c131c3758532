"""The fans of cells, against exact arithmetic: where one says "at most one root", that holds.

A fan is computed in float64. Here the cell's net is restricted, grown and differenced in rationals, and
every cross product that the proof is about (`patch.cells`, `patch.rational_fan`) is looked at.
"""

from fractions import Fraction
from itertools import pairwise, product
from math import comb

import numpy as np
import pytest
from exact_vectors import cross, dot, minus

from hybrid_rt.intersection.kernels.patch.cells import (
    FAN,
    FAN_SLACK,
    GROWTH,
    ROW_N,
    ROW_U,
    ROW_V,
    fill_cells,
)
from hybrid_rt.intersection.kernels.patch.skew_box import COLUMN, RECORD, meet_box_plain

GRID = 4


def bent_patch(rng, degree_u, degree_v, weights=None):
    """Return a net (rows, columns, 4) within 1 of the origin that bends gently, as in a table."""
    u, v = np.meshgrid(
        np.linspace(-0.6, 0.6, degree_u + 1), np.linspace(-0.6, 0.6, degree_v + 1), indexing="ij"
    )
    net = np.stack([u, v, 0.2 * (u**2 - u * v), np.zeros_like(u)], axis=-1)
    net[..., :3] += rng.normal(0.0, 0.03, (*u.shape, 3))
    if weights is not None:
        net[..., 3] = weights / (1.5 * weights.max())
        net[..., :3] *= net[..., 3:]
    return net


def cells_of(net, is_rational):
    """Return the records of the GRID x GRID cells of one patch."""
    m, n = net.shape[0] - 1, net.shape[1] - 1
    records = np.empty((GRID * GRID, RECORD))
    fill_cells(
        np.ascontiguousarray(net.reshape(-1, 4)), np.zeros(1, np.int64), np.array([[m, n]]),
        np.zeros((1, 3)), True if is_rational else None, np.array([[GRID, GRID]]),
        np.zeros(1, np.int64), 0, 1, records, np.empty((GRID * GRID, 6)),
        np.empty(GRID * GRID, np.uint32),
    )  # fmt: skip
    return records


def blossom(points, a, b):
    """Return the control points of a curve's part [a, b] by polar forms, exactly."""
    n = len(points) - 1
    out = []
    for k in range(n + 1):
        level = points
        for s in [b] * k + [a] * (n - k):
            level = [
                [(1 - s) * x + s * y for x, y in zip(p, q, strict=True)] for p, q in pairwise(level)
            ]
        out.append(level[0])
    return out


def grown_net(net, a, b):
    """Return the net, in rationals, of cell (a, b) grown by `GROWTH` of its sides."""
    g, step = Fraction(GROWTH), Fraction(1, GRID)
    exact = [[[Fraction(x) for x in point] for point in row] for row in net.tolist()]
    (u0, u1), (v0, v1) = (((k - g) * step, (k + 1 + g) * step) for k in (a, b))
    rows = [blossom(row, v0, v1) for row in exact]
    columns = [blossom([row[j] for row in rows], u0, u1) for j in range(len(rows[0]))]
    return [[column[i] for column in columns] for i in range(len(rows))]


def polynomial_cones(net):
    """Return the differences along u and along v."""
    m, n = len(net) - 1, len(net[0]) - 1
    along_u = [minus(net[i + 1][j], net[i][j])[:3] for i in range(m) for j in range(n + 1)]
    along_v = [minus(net[i][j + 1], net[i][j])[:3] for i in range(m + 1) for j in range(n)]
    return along_u, along_v


def rational_cones(net):
    """Return the vectors whose cones hold S(u1, v) - S(u0, v) and S(u, v1) - S(u, v0).

    For rows a, b of homogeneous points, coefficients of w_a (p_b) - w_b (p_a) as a polynomial.
    """

    def along(rows):
        found, n = [], len(rows[0]) - 1
        for low, high in pairwise(rows):
            for total in range(2 * n + 1):
                vector = [Fraction(0)] * 3
                for j in range(max(0, total - n), min(n, total) + 1):
                    p, q = high[j], low[total - j]
                    c = comb(n, j) * comb(n, total - j)
                    vector = [
                        x + c * (q[3] * s - p[3] * t) for x, s, t in zip(vector, p, q, strict=False)
                    ]
                found.append(tuple(vector))
        return found

    return along(net), along([list(column) for column in zip(*net, strict=True)])


def rows_of(record):
    """Return the rows of the dual basis, in rationals."""
    return [
        [Fraction(record[row]), Fraction(record[COLUMN + row]), Fraction(record[2 * COLUMN + row])]
        for row in (ROW_U, ROW_V, ROW_N)
    ]


def least_margin(net, record, cell, is_rational):
    """Return by how much, in shares of |n.(A x B)|, the fan is wider than it must be at least."""
    a, b = divmod(cell, GRID)
    grown = grown_net(net, a, b)
    along_u, along_v = (rational_cones if is_rational else polynomial_cones)(grown)
    r_u, r_v, r_n = rows_of(record)
    # The basis that the rows are dual to, times its volume.
    volume = dot(r_u, cross(r_v, r_n))
    p, q, n = cross(r_v, r_n), cross(r_n, r_u), cross(r_u, r_v)
    fan_u, fan_v = Fraction(record[FAN]), Fraction(record[FAN + 1])
    least = None
    for vector_u, vector_v in product(along_u, along_v):
        c = cross(vector_u, vector_v)
        k_u, k_v, k_n = (dot(c, x) / volume for x in (p, q, n))
        assert k_n > 0
        margin = min(fan_u - abs(k_u) / k_n, fan_v - abs(k_v) / k_n)
        least = margin if least is None else min(least, margin)
    return float(least)


@pytest.mark.parametrize(("degree_u", "degree_v"), [(1, 1), (2, 2), (3, 3), (1, 4)])
def test_fans_hold_all_normals(degree_u, degree_v):
    rng = np.random.default_rng(degree_u + 8 * degree_v)
    net = bent_patch(rng, degree_u, degree_v)
    records = cells_of(net, False)
    proven = np.flatnonzero(np.isfinite(records[:, FAN]))
    assert proven.size >= 8
    margins = [least_margin(net, records[cell], cell, False) for cell in proven[:8]]
    assert min(margins) >= 0.0
    # Not by much: a wider fan proves less.
    assert max(margins) < 1e-6


@pytest.mark.parametrize(("degree_u", "degree_v"), [(1, 2), (2, 2), (3, 2)])
def test_fans_of_rational_cells_hold_all_normals(degree_u, degree_v):
    """The weights differ by up to 6, and most along v: what decides lies anywhere in the cones."""
    rng = np.random.default_rng(degree_u + 8 * degree_v)
    margins = []
    for _ in range(2):
        weights = np.exp(rng.normal(0.0, 0.5, (degree_u + 1, degree_v + 1)))
        net = bent_patch(rng, degree_u, degree_v, weights)
        records = cells_of(net, True)
        proven = np.flatnonzero(np.isfinite(records[:, FAN]))
        assert proven.size >= 4
        margins += [least_margin(net, records[cell], cell, True) for cell in proven[::3]]
    assert min(margins) >= 0.0
    assert max(margins) < 1e-6


def test_rounding_of_the_ray_is_allowed_for():
    """Directions on the very edge of a fan, 1e-17 to 1e-13 beside it: the float64 test is never too sure."""
    rng = np.random.default_rng(5)
    net = bent_patch(rng, 3, 3)
    records = cells_of(net, False)
    n_sure = n_near = 0
    for cell in np.flatnonzero(np.isfinite(records[:, FAN]))[:8]:
        record = records[cell]
        basis = np.linalg.inv(np.array(rows_of(record), dtype=np.float64))
        rows = rows_of(record)
        fan_u, fan_v = Fraction(record[FAN]), Fraction(record[FAN + 1])
        for _ in range(400):
            du, dv = rng.normal(size=2)
            dn = (float(fan_u) * abs(du) + float(fan_v) * abs(dv)) * (
                1.0 + rng.choice([-1, 1]) * 10.0 ** rng.uniform(-17, -13)
            )
            d = basis @ (du, dv, dn)
            d /= np.linalg.norm(d)
            *_, fu, fv, fn = meet_box_plain(records, int(cell), 0.0, 0.0, 0.0, *map(float, d))
            exact = [Fraction(x) for x in d.tolist()]
            eu, ev, en = (dot(row, exact) for row in rows)
            is_one = abs(en) > fan_u * abs(eu) + fan_v * abs(ev)
            is_sure = abs(fn) > record[FAN] * abs(fu) + record[FAN + 1] * abs(fv) + FAN_SLACK
            assert is_one or not is_sure
            n_sure += is_sure
            n_near += is_one
    assert n_near > 1000
