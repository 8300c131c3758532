"""The triangles that a turned body is compared with are closed and have its shape."""

import math
from collections import Counter

import numpy as np
import pytest

from benchmarks.mesh_caustics import PROFILE, body, grid_mesh


@pytest.mark.parametrize("n", [200, 1000, 10_000])
def test_grid_is_closed_and_fills_the_body(n):
    mesh = grid_mesh(body(), n)
    assert 0.6 * n < len(mesh.faces) < 1.5 * n
    # Each edge is passed once in either direction: closed, and all faces turned alike.
    edges = Counter((int(face[k]), int(face[(k + 1) % 3])) for face in mesh.faces for k in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    volume = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6
    # pi times the integral of r^2 dz along the profile; Gauss-Legendre is exact to its degree 9.
    x, w = np.polynomial.legendre.leggauss(6)
    t = 0.5 * (x + 1)
    exact = 0.0
    for segment in np.array(PROFILE):
        basis = np.stack([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t * t * (1 - t), t**3])
        slope = np.stack(
            [-3 * (1 - t) ** 2, 3 * (1 - t) * (1 - 3 * t), 3 * t * (2 - 3 * t), 3 * t * t]
        )
        z_slope, r = segment[:, 0] @ slope, segment[:, 1] @ basis
        exact += math.pi * 0.5 * (w * r * r * z_slope).sum()
    # Chords lie inside an outward-bent body: less volume, and the gap falls as one over n.
    assert 0 < 1 - volume / exact < 60 / n
