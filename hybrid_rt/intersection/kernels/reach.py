"""Which parallelograms and spheres a ray may meet: rejected in one go, the rest one by one.

The exact test of a surface takes branches, roots and a division. These conditions take none, so they
compile to vector instructions that test several surfaces at once. They reject only what the exact test
leaves without effect, so hits keep their bits.
"""

import numpy as np

from meshing.kernels.jit import inlined

# Surfaces that share a mask, and columns of a table of them: a multiple of what fits a vector register.
BLOCK, LANES = 32, 8
# So few surfaces are tested one by one: the conditions would cost more than they spare.
FEW = 2
# Relative error that the conditions on parallelograms are given: what they round is below 2**-47, and
# the band in which the exact test notes a doubt is below 2**-42.
CLEARANCE = 2.0**-38
# Of spheres, see `spheres_in_reach`: far above the rounding of a sum of squares, far below what matters.
SURE, FARTHER = 2.0**-40, 1.0 + 2.0**-16
# Planes met at a smaller cosine are left to the exact test.
STEEP = 2e-9
# Where squares and products can neither overflow nor underflow.
LEAST, MOST = 1e-70, 1e70
# Masks. Unsigned, as are the indices: those that might be negative would keep loops from vectors.
_NONE, ALL = np.uint64(0), np.uint64((1 << BLOCK) - 1)
FIRST_BIT, NEXT = np.uint64(1), np.uint64(1)


def padded(columns):
    """Return the columns (m, k) of k surfaces with k rounded up to a multiple of `LANES`."""
    m, k = columns.shape
    result = np.zeros((m, -(-k // LANES) * LANES))
    result[:, :k] = columns
    return result


def parallelogram_columns(corner, normal, row_u, row_v, size):
    """Return what `parallelograms_in_reach` reads, (15, more) float64; see `padded`.

    ``corner``, ``normal``, ``row_u``, ``row_v`` (k, 3).
    ``size`` (k,): see `hybrid_rt.intersection.kernels.rectangle.RectangleTable`.
    """
    columns = []
    for rows in (normal, row_u, row_v):
        columns += [*rows.T, np.einsum("ij,ij->i", rows, corner)]
    reach = np.abs(corner).sum(axis=1) + size
    columns += [reach, np.abs(row_u).sum(axis=1), np.abs(row_v).sum(axis=1)]
    result = np.array(columns).reshape(15, -1)
    # No comparison with NaN holds, so these are never rejected.
    inverse = result[13:]
    is_extreme = ~((size > LEAST) & (reach < MOST))
    is_extreme |= ~((inverse.min(axis=0) > LEAST) & (inverse.max(axis=0) < MOST))
    result[:, is_extreme] = np.nan
    return padded(result)


@inlined
def parallelograms_in_reach(columns, begin, end, ox, oy, oz, dx, dy, dz, t_min, t_best):
    """Return a mask of the parallelograms from ``begin`` to ``end`` that a ray may meet; bit 0: the first.

    Let h be the distance of the origin from the plane, on the side that the ray leaves, s = |n.d|, and
    (u, v) + t (u', v') where the ray is in the parallelogram's coordinates. The plane is met at
    t = -h / s. Multiplied by s, everything is a sum of products, each off by less than 2^-47 of
    the sum e of the sizes that enter it. Rejected are, with `CLEARANCE` e to spare,

    - h > 0: the plane lies behind, if t_min >= 0;
    - -h > t_best s: it lies beyond the nearest root;
    - s u - h u' outside [0, s], or the same for v: it is met outside the rim.

    ``columns`` (15, more): see `parallelogram_columns`.
    ``begin``, ``end``: at most `BLOCK` columns.
    ``ox``, ``oy``, ``oz``, ``dx``, ``dy``, ``dz``: origin and direction; the direction is scaled as
    in `Rays`.
    ``t_min``, ``t_best``: the range in which a root has an effect.
    """
    size = abs(ox) + abs(oy) + abs(oz)
    if not (t_min >= 0.0 and size < MOST):
        return ALL
    mask, first = _NONE, np.uint64(begin)
    for k in range(first, np.uint64(end)):
        slope = columns[0, k] * dx + columns[1, k] * dy + columns[2, k] * dz
        height = columns[0, k] * ox + columns[1, k] * oy + columns[2, k] * oz - columns[3, k]
        du = columns[4, k] * dx + columns[5, k] * dy + columns[6, k] * dz
        u = columns[4, k] * ox + columns[5, k] * oy + columns[6, k] * oz - columns[7, k]
        dv = columns[8, k] * dx + columns[9, k] * dy + columns[10, k] * dz
        v = columns[8, k] * ox + columns[9, k] * oy + columns[10, k] * oz - columns[11, k]
        height *= np.copysign(1.0, slope)
        slope = abs(slope)
        u, v = u * slope - height * du, v * slope - height * dv
        error = CLEARANCE * (size + columns[12, k])
        error_u, error_v = error * columns[13, k], error * columns[14, k]
        is_out = (height > error) | (-height - error > t_best * slope)
        is_out |= (u < -error_u) | (u > slope + error_u)
        is_out |= (v < -error_v) | (v > slope + error_v)
        mask |= np.uint64(not (is_out & (slope > STEEP))) << (k - first)
    return mask


def sphere_columns(center, radius):
    """Return what `spheres_in_reach` reads, (4, more) float64, for centres (k, 3) and radii (k,)."""
    columns = np.vstack([center.T.reshape(3, -1), radius])
    columns[3, ~((radius > LEAST) & (radius < MOST))] = np.nan  # never rejected, as above
    return padded(columns)


@inlined
def spheres_in_reach(columns, begin, end, ox, oy, oz, dx, dy, dz, t_min, t_best):
    """Return a mask of the spheres from ``begin`` to ``end`` that a ray may meet; bit 0: the first.

    With f = o - c, b = f.d and C = |f|^2 - r^2 the roots have the product C / dd and the sum -2 b / dd,
    dd = |d|^2. Let S be |f|^2 + r^2. In float64 C is off by less than 16 u S, and D = b^2 - dd C by less
    than 32 u dd S. A ray within the band, 64 eps max(|f|, 2 r), has D > -2^-43 dd S. 2^-40 S is more
    than all of it.

    - C > 0 and b >= 0: the sphere lies behind. Either both roots are negative or, where b has the wrong
      sign by rounding, |b| <= 8 u |f| |d|, D is far below the band. t_min >= 0 rejects the roots.
    - C > 0 and b < 0: the farther root is less than the sum, so the nearer one exceeds C / (-2 b). If
      that exceeds t_best, so do both roots and, half the sum, what would be doubted. Unless D is below
      the band, |b| > 2^-22 |f| |d| is known to 2^-27; and the root that the exact test would compute
      is within 2^-20 of the true one. `FARTHER` is more.
    - D is below the band: there is no root and no doubt.

    Parameters are those of `parallelograms_in_reach`, with the columns of `sphere_columns`.
    """
    if not t_min >= 0.0:
        return ALL
    dd = dx * dx + dy * dy + dz * dz
    mask, first = _NONE, np.uint64(begin)
    for k in range(first, np.uint64(end)):
        fx, fy, fz, r = ox - columns[0, k], oy - columns[1, k], oz - columns[2, k], columns[3, k]
        b = fx * dx + fy * dy + fz * dz
        ff = fx * fx + fy * fy + fz * fz
        c, rounding = ff - r * r, SURE * (ff + r * r)
        is_beyond = (b >= 0.0) | (c - rounding > -2.0 * t_best * b * FARTHER)
        is_out = ((c > rounding) & is_beyond) | (b * b - dd * c < -dd * rounding)
        mask |= np.uint64(not is_out) << (k - first)
    return mask
