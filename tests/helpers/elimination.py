"""Exact crossings by elimination: roots of one rational polynomial, where a surface admits it."""

from math import comb

import flint
import numpy as np

from meshing import BezierPatches
from proof.exact.crossings import bits, rational, value

# 60 decimal digits.
BITS = 200
# Heights are multiples of this, and so are the entries of the shears: products stay exact.
GRAIN = 2.0**-8


def bernstein(degree, k, x):
    """Bernstein polynomial of a polynomial."""
    return comb(degree, k) * x**k * (1 - x) ** (degree - k)


def height_field(heights, shear, origin):
    """Make the patch origin + (u, v, h(u, v)) shear, with h the Bernstein sum of ``heights``.

    All figures must be multiples of `GRAIN` of moderate size: then the control points are exact
    where the degrees divide them (1, 2, 4).
    """
    m, n = heights.shape[0] - 1, heights.shape[1] - 1
    u, v = np.meshgrid(np.arange(m + 1) / m, np.arange(n + 1) / n, indexing="ij")
    return BezierPatches([np.stack([u, v, heights], axis=-1) @ shear + origin])


def height_field_roots(heights, shear, at, origin, direction):
    """Return the t of all crossings of a ray with a `height_field`, u and v from 0 to 1."""
    matrix = flint.fmpq_mat(3, 3, [rational(x) for x in shear.T.ravel()])
    start = flint.fmpq_mat(
        3, 1, [rational(a) - rational(b) for a, b in zip(origin, at, strict=True)]
    )
    along = flint.fmpq_mat(3, 1, [rational(x) for x in direction])
    o, d = matrix.solve(start), matrix.solve(along)
    u, v, w = (flint.fmpq_poly([o[k, 0], d[k, 0]]) for k in range(3))
    m, n = heights.shape[0] - 1, heights.shape[1] - 1
    across = [bernstein(n, j, v) for j in range(n + 1)]
    gap = -w
    for i in range(m + 1):
        row = flint.fmpq_poly([0])
        for j in range(n + 1):
            row += rational(heights[i, j]) * across[j]
        gap += bernstein(m, i, u) * row
    with bits(BITS):
        roots = [root.real for root, _ in gap.numer().complex_roots() if root.imag == 0]
        return [t for t in roots if not any(x < 0 or x > 1 for x in (value(u, t), value(v, t)))]
