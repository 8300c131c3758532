"""The fan of a cell's normals, and bounds of second partials, for rational patches.

Along a line v = const a rational patch is a rational curve in u, and two of its points differ by a
sum, with positive factors, of the differences of its consecutive control points (Floater 1992,
"Derivatives of rational Bezier curves"). Those are, but for positive factors, Bernstein sums in v of
degree 2 n with the coefficients

    sum over j + k = l of C(n, j) C(n, k) w_(i+1)j w_ik (P_(i+1)j - P_ik),

so S(u1, v) - S(u0, v) lies in the cone of these m (2 n + 1) vectors, and likewise along v. Two points
of a cell on one ray differ by a vector of the one cone and one of the other, going first along v,
then along u; so d . (A x B) = 0 with A and B in the cones, which their cross products decide by
signs as in `patch.cells`. All weights of the cell must be positive.
"""

import numpy as np

from meshing.kernels.bernstein import BINOMIAL
from meshing.kernels.jit import inner, kernel
from meshing.kernels.leaves import rational_second_differences
from meshing.kernels.subdivision import halve

# Of the weights of a cell that is grown; where they differ more nothing is proven.
LEAST_WEIGHT = 2.0**-6
# Vectors shorter than this part of the longest have no certain direction: a restricted net is right
# to 1e-14, so directions are to 1e-10.
SHORT = 1e-2
# Cross products this close to the plane of the tangents prove nothing.
THIN = 1e-6
# From more pairs on the cones are put into boxes.
MOST_PAIRS = 3100
# Halvings of a patch before its second partials are bounded.
LEVELS = 6


@inner
def _hodograph_cone(net, degree_u, degree_v, along_u, out):
    """Fill ``out`` with the vectors of a cone; return their number, 0 if any is short."""
    m, n = (degree_u, degree_v) if along_u else (degree_v, degree_u)
    count, shortest, longest = 0, np.inf, 0.0
    for i in range(m):
        for total in range(2 * n + 1):
            x = y = z = weight = 0.0
            for j in range(max(0, total - n), min(n, total) + 1):
                k = total - j
                p = net[i + 1, j] if along_u else net[j, i + 1]
                q = net[i, k] if along_u else net[k, i]
                factor = BINOMIAL[n, j] * BINOMIAL[n, k]
                x += factor * (q[3] * p[0] - p[3] * q[0])
                y += factor * (q[3] * p[1] - p[3] * q[1])
                z += factor * (q[3] * p[2] - p[3] * q[2])
                weight += factor * p[3] * q[3]
            out[count, 0], out[count, 1], out[count, 2] = x / weight, y / weight, z / weight
            length = np.sqrt(x * x + y * y + z * z) / weight
            shortest, longest = min(shortest, length), max(longest, length)
            count += 1
    return count if shortest > SHORT * longest else 0


@inner
def _by_pairs(along_u, n_u, along_v, n_v, px, py, pz, qx, qy, qz, nx, ny, nz):
    """Half widths of the fan that holds all cross products of the vectors of two cones."""
    fan_u, fan_v = 0.0, 0.0
    for a in range(n_u):
        ux, uy, uz = along_u[a, 0], along_u[a, 1], along_u[a, 2]
        for b in range(n_v):
            vx, vy, vz = along_v[b, 0], along_v[b, 1], along_v[b, 2]
            cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            length = np.sqrt(cx * cx + cy * cy + cz * cz)
            along = cx * nx + cy * ny + cz * nz
            if not along > THIN * length:
                return np.inf, np.inf
            fan_u = max(fan_u, abs(px * cx + py * cy + pz * cz) / along)
            fan_v = max(fan_v, abs(qx * cx + qy * cy + qz * cz) / along)
    return fan_u, fan_v


@inner
def _by_boxes(along_u, n_u, along_v, n_v, px, py, pz, qx, qy, qz, nx, ny, nz):
    """As `_by_pairs`, from the widths of each cone: A = (1, b, c), B = (e, 1, g) along p, q and n.

    p.(A x B) is at most b g + c, q.(A x B) at most c e + g and n.(A x B) at least 1 - b e, all times
    n.(p x q).
    """
    area = nx * (py * qz - pz * qy) + ny * (pz * qx - px * qz) + nz * (px * qy - py * qx)
    b = c = e = g = 0.0
    for a in range(n_u + n_v):
        is_u = a < n_u
        x = along_u[a, 0] if is_u else along_v[a - n_u, 0]
        y = along_u[a, 1] if is_u else along_v[a - n_u, 1]
        z = along_u[a, 2] if is_u else along_v[a - n_u, 2]
        # Coordinates in the basis p, q, n; n is normal to the others and a unit.
        up = x * nx + y * ny + z * nz
        on_p = ((y * qz - z * qy) * nx + (z * qx - x * qz) * ny + (x * qy - y * qx) * nz) / area
        on_q = ((py * z - pz * y) * nx + (pz * x - px * z) * ny + (px * y - py * x) * nz) / area
        own, other = (on_p, on_q) if is_u else (on_q, on_p)
        if not own > 0.0:
            return np.inf, np.inf
        if is_u:
            b, c = max(b, abs(other) / own), max(c, abs(up) / own)
        else:
            e, g = max(e, abs(other) / own), max(g, abs(up) / own)
    along = 1.0 - b * e
    if not along > SHORT:
        return np.inf, np.inf
    return (b * g + c) / along, (c * e + g) / along


@inner
def rational_fan(net, degree_u, degree_v, cones, px, py, pz, qx, qy, qz, nx, ny, nz):
    """Half widths of the fan of a rational net (grown); infinite where nothing is proven.

    ``cones`` (2, m, 3): scratch; p, q: mean half tangents, n: their unit normal.
    """
    least, most = np.inf, 0.0
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            least, most = min(least, net[i, j, 3]), max(most, net[i, j, 3])
    if not least > LEAST_WEIGHT * most:
        return np.inf, np.inf
    n_u = _hodograph_cone(net, degree_u, degree_v, True, cones[0])
    n_v = _hodograph_cone(net, degree_u, degree_v, False, cones[1])
    if n_u == 0 or n_v == 0:
        return np.inf, np.inf
    if n_u * n_v <= MOST_PAIRS:
        return _by_pairs(
            cones[0], n_u, cones[1], n_v, px, py, pz, qx, qy, qz, nx, ny, nz
        )  # fmt: skip
    return _by_boxes(cones[0], n_u, cones[1], n_v, px, py, pz, qx, qy, qz, nx, ny, nz)


@kernel(allocates=True)
def bound_rational_bends(control, start, degree, bends):
    """Write bounds of |S_uu|, |S_uv| and |S_vv| of homogeneous nets into ``bends`` (k, 3)."""
    largest_net = 0
    for p in range(start.shape[0]):
        largest_net = max(largest_net, (degree[p, 0] + 1) * (degree[p, 1] + 1))
    stack = np.empty((LEVELS + 2, largest_net, 4))
    depth = np.empty(LEVELS + 2, np.int64)
    for p in range(start.shape[0]):
        m, n = degree[p, 0], degree[p, 1]
        for k in range((m + 1) * (n + 1)):
            for c in range(4):
                stack[0, k, c] = control[start[p] + k, c]
        bends[p, 0] = bends[p, 1] = bends[p, 2] = 0.0
        depth[0] = 0
        top = 0
        while top >= 0:
            if depth[top] == LEVELS:
                # A piece's parameters run over [0, 1]: those of the patch are 2^(LEVELS / 2) finer.
                uu, uv, vv, _ = rational_second_differences(stack, top, m, n)
                bends[p, 0] = max(bends[p, 0], 2.0**LEVELS * uu)
                bends[p, 1] = max(bends[p, 1], 2.0**LEVELS * uv)
                bends[p, 2] = max(bends[p, 2], 2.0**LEVELS * vv)
                top -= 1
                continue
            halve(stack, top, top + 1, m, n, depth[top] % 2 == 0)
            depth[top] += 1
            depth[top + 1] = depth[top]
            top += 1
