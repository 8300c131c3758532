"""Cells: a patch cut into a grid, each piece with a box that fits it and a proof about rays.

The proof (three numbers, computed once): two points of a cell that one ray meets would make d
parallel to du A + dv B with A, B in the convex hulls of the net's differences, so d . (A x B) = 0;
this is bilinear, hence settled by its signs at all pairs of differences. Every cross product of a
pair is n + x + y times a positive number, with n the unit normal of the mean tangents p and q, and
x, y across it; their ranges, seen along p and q, make a fan of four sides. With d = a p + b q + c n
the ray meets the cell at most once whenever |c| > |a| fan_u + |b| fan_v. (The cone of Sederberg and
Meyers 1988, "Loop detection in surface patch intersections", turned from surfaces to rays, and
made four-sided: most patches bend much more one way than the other.) It is computed on the cell
grown by `GROWTH` to each side, so a root that lies a little beside the cell proves that there is
none inside.

The box is a skew one, along the mean tangents and the normal. For rational patches see
`patch.rational_fan`.
"""

import numpy as np

from hybrid_rt.intersection.kernels.patch.nets import columns_of, projected, restrict
from hybrid_rt.intersection.kernels.patch.rational_fan import rational_fan
from hybrid_rt.intersection.kernels.patch.skew_box import CENTRE, COLUMN, LOWER, UPPER
from meshing.kernels.jit import inner, kernel

# A cell's record, float64. Columns of the dual basis of half the mean tangents and the unit normal
# (rows along u, v, n), each followed by a coordinate of the middle of the box; lower and upper
# bounds along u, v, n (`patch.skew_box`), each followed by a parameter of the middle.
ROW_U, ROW_V, ROW_N = 0, 1, 2
MIDDLE_U, MIDDLE_V = LOWER + 3, UPPER + 3
HALF = 20  # 2: half the sides in parameters
FAN = 22  # 2: at most one root if |d_n| > fan_u |d_u| + fan_v |d_v| + `FAN_SLACK`, same basis

# Rays that pass beside a cell mostly meet its continuation within this part of its side.
GROWTH = 0.15
# Rounding of a coordinate in the skew basis is 2**-52 of |row| * (|o| + |centre|) <= 4 |row|. The rest is
# for rays that pass within the band of a patch: from up to 2**24 away it is narrower than this.
BOX_SLACK = 2.0**-22
# Tangents this close to parallel, or normals this short beside others, prove nothing.
THIN = 1e-6
SHORT = 1e-4
# Differences of a restricted net are right to 1e-14 of the longest, hence directions to 1e-10.
FAN_MARGIN = 1e-9
# A fan this wide in multiples of the tangents proves next to nothing.
WIDEST = 256.0
# Rounding of d in the skew basis, |d| < 2: 2**-52 of |row| * |d|, twice, in all three terms.
FAN_SLACK = 2.0**-50 * (1.0 + 2.0 * WIDEST)
# Control points are right to a few units of the largest coordinate.
SAME_POINT = 16.0 * 2.0**-52
# No ray that matters comes here.
NOWHERE = 1e30
# Beyond this many pairs of differences their box is taken instead of all pairs.
MOST_PAIRS = 1200


@inner
def _differences(net, degree_u, degree_v, along_u, row):
    """Mean of the differences along u or v, times half the degree (the half tangent)."""
    x = 0.0
    if along_u:
        for j in range(degree_v + 1):
            x += net[degree_u, j, row] - net[0, j, row]
        return 0.5 * x / (degree_v + 1)
    for i in range(degree_u + 1):
        x += net[i, degree_v, row] - net[i, 0, row]
    return 0.5 * x / (degree_u + 1)


@inner
def _fan_by_pairs(net, degree_u, degree_v, px, py, pz, qx, qy, qz, nx, ny, nz):
    """Half widths of the fan that holds all cross products of a u- with a v-difference.

    Infinite where one is too short beside others, or does not point along n.
    """
    fan_u, fan_v, shortest, longest = 0.0, 0.0, np.inf, 0.0
    for i in range(degree_u):
        for j in range(degree_v + 1):
            ux = net[i + 1, j, 0] - net[i, j, 0]
            uy = net[i + 1, j, 1] - net[i, j, 1]
            uz = net[i + 1, j, 2] - net[i, j, 2]
            for k in range(degree_u + 1):
                for m in range(degree_v):
                    vx = net[k, m + 1, 0] - net[k, m, 0]
                    vy = net[k, m + 1, 1] - net[k, m, 1]
                    vz = net[k, m + 1, 2] - net[k, m, 2]
                    cx, cy, cz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
                    length = np.sqrt(cx * cx + cy * cy + cz * cz)
                    shortest = min(shortest, length)
                    longest = max(longest, length)
                    along = cx * nx + cy * ny + cz * nz
                    if not along > THIN * length:
                        return np.inf, np.inf
                    fan_u = max(fan_u, abs(px * cx + py * cy + pz * cz) / along)
                    fan_v = max(fan_v, abs(qx * cx + qy * cy + qz * cz) / along)
    if not shortest > SHORT * longest:
        return np.inf, np.inf
    return fan_u, fan_v


@inner
def _fan_by_box(net, degree_u, degree_v, record, w):
    """As `_fan_by_pairs`, from the boxes of the differences in the skew basis (for high degree).

    With A = (1 + a, b, c), B = (e, 1 + f, g) in half tangents p, q and n, |a|.. |g| at most the
    widths found: n.(A x B) is at least (1 - a)(1 - f) - b e, p.(A x B) at most b g + c (1 + f),
    q.(A x B) at most c e + (1 + a) g, all times n.(p x q).
    """
    w[:, :] = 0.0
    for along in range(2):
        for i in range(degree_u + 1 - (1 - along)):
            for j in range(degree_v + 1 - along):
                k, m = (i + 1, j) if along == 0 else (i, j + 1)
                half = 0.5 * degree_u if along == 0 else 0.5 * degree_v
                x = half * (net[k, m, 0] - net[i, j, 0])
                y = half * (net[k, m, 1] - net[i, j, 1])
                z = half * (net[k, m, 2] - net[i, j, 2])
                for axis in range(3):
                    c = record[axis] * x + record[COLUMN + axis] * y + record[2 * COLUMN + axis] * z
                    w[along, axis] = max(w[along, axis], abs(c - (1.0 if axis == along else 0.0)))
    a, b, c = w[0, 0], w[0, 1], w[0, 2]
    e, f, g = w[1, 0], w[1, 1], w[1, 2]
    if a >= 1.0 or f >= 1.0:
        return np.inf, np.inf
    along_n = (1.0 - a) * (1.0 - f) - b * e
    if along_n <= SHORT:
        return np.inf, np.inf
    return (b * g + c * (1.0 + f)) / along_n, (c * e + (1.0 + a) * g) / along_n


@inner
def row_length(record, row):
    """Return the length of a row of the dual basis."""
    x, y, z = record[row], record[COLUMN + row], record[2 * COLUMN + row]
    return np.sqrt(x * x + y * y + z * z)


@inner
def _nets(control, start, degree_u, degree_v, u0, u1, v0, v1, scratch, cones):
    """Fill ``scratch[0]`` and ``[1]`` with the nets of a cell and of the cell grown."""
    net, grown = scratch[0], scratch[1]
    rational = None if cones is None else True
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            for c in range(columns_of(rational)):
                p = control[start + i * (degree_v + 1) + j, c]
                net[i, j, c] = p
                grown[i, j, c] = p
    restrict(net, degree_u, degree_v, u0, u1, v0, v1, rational)
    if cones is None:
        hu, hv, g = 0.5 * (u1 - u0), 0.5 * (v1 - v0), 2.0 * GROWTH
        restrict(
            grown, degree_u, degree_v, u0 - g * hu, u1 + g * hu, v0 - g * hv, v1 + g * hv, rational
        )
        return
    # From the cell's own net: so roundings stay small beside its weights, however small these are.
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            for c in range(4):
                grown[i, j, c] = net[i, j, c]
    restrict(grown, degree_u, degree_v, -GROWTH, 1.0 + GROWTH, -GROWTH, 1.0 + GROWTH, rational)


@inner
def _fan(
    net, degree_u, degree_v, record, room, cones, px, py, pz, qx, qy, qz, nx, ny, nz
):  # fmt: skip
    """Return the half widths of a grown cell's fan, and the margin for their rounding."""
    if cones is None:
        if degree_u * (degree_v + 1) * degree_v * (degree_u + 1) <= MOST_PAIRS:
            fan_u, fan_v = _fan_by_pairs(
                net, degree_u, degree_v, px, py, pz, qx, qy, qz, nx, ny, nz
            )  # fmt: skip
        else:
            fan_u, fan_v = _fan_by_box(net, degree_u, degree_v, record, room)
        return fan_u, fan_v, FAN_MARGIN
    fan_u, fan_v = rational_fan(
        net, degree_u, degree_v, cones, px, py, pz, qx, qy, qz, nx, ny, nz
    )  # fmt: skip
    # Growing by de Casteljau's algorithm enlarges roundings by 1.3 a degree, at most.
    return fan_u, fan_v, FAN_MARGIN * max(1.0, 1.3 ** (degree_u + degree_v - 12))


@inner
def fill_cell(
    control, start, degree_u, degree_v, cx, cy, cz, u0, u1, v0, v1, scratch, cones, record, box
):  # fmt: skip
    """Fill the record and the axis-aligned box (6) of the cell [u0, u1] x [v0, v1] of a patch."""
    _nets(control, start, degree_u, degree_v, u0, u1, v0, v1, scratch, cones)
    rational = None if cones is None else True
    net = projected(scratch[0], degree_u, degree_v, scratch[2], rational)
    hu, hv = 0.5 * (u1 - u0), 0.5 * (v1 - v0)
    px = _differences(net, degree_u, degree_v, True, 0)
    py = _differences(net, degree_u, degree_v, True, 1)
    pz = _differences(net, degree_u, degree_v, True, 2)
    qx = _differences(net, degree_u, degree_v, False, 0)
    qy = _differences(net, degree_u, degree_v, False, 1)
    qz = _differences(net, degree_u, degree_v, False, 2)
    nx, ny, nz = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    lp, lq = np.sqrt(px * px + py * py + pz * pz), np.sqrt(qx * qx + qy * qy + qz * qz)
    provable = area > THIN * lp * lq and area > 0.0
    if provable:
        nx, ny, nz = nx / area, ny / area, nz / area
        record[ROW_U] = (qy * nz - qz * ny) / area
        record[COLUMN + ROW_U] = (qz * nx - qx * nz) / area
        record[2 * COLUMN + ROW_U] = (qx * ny - qy * nx) / area
        record[ROW_V] = (ny * pz - nz * py) / area
        record[COLUMN + ROW_V] = (nz * px - nx * pz) / area
        record[2 * COLUMN + ROW_V] = (nx * py - ny * px) / area
        record[ROW_N], record[COLUMN + ROW_N], record[2 * COLUMN + ROW_N] = nx, ny, nz
    else:
        record[: 3 * COLUMN] = 0.0
        record[ROW_U], record[COLUMN + ROW_V], record[2 * COLUMN + ROW_N] = 1.0, 1.0, 1.0
    mx = my = mz = 0.0
    box[:3] = np.inf
    box[3:] = -np.inf
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            mx += net[i, j, 0]
            my += net[i, j, 1]
            mz += net[i, j, 2]
            for c in range(3):
                box[c] = min(box[c], net[i, j, c])
                box[3 + c] = max(box[3 + c], net[i, j, c])
    weight = 1.0 / ((degree_u + 1) * (degree_v + 1))
    mx, my, mz = mx * weight, my * weight, mz * weight
    for axis in range(3):
        rx, ry, rz = record[axis], record[COLUMN + axis], record[2 * COLUMN + axis]
        lo, hi = np.inf, -np.inf
        for i in range(degree_u + 1):
            for j in range(degree_v + 1):
                y = rx * (net[i, j, 0] - mx) + ry * (net[i, j, 1] - my) + rz * (net[i, j, 2] - mz)
                lo, hi = min(lo, y), max(hi, y)
        slack = BOX_SLACK * np.sqrt(rx * rx + ry * ry + rz * rz)
        record[LOWER + axis] = lo - slack
        record[UPPER + axis] = hi + slack
    record[CENTRE], record[COLUMN + CENTRE] = mx + cx, my + cy
    record[2 * COLUMN + CENTRE] = mz + cz
    record[MIDDLE_U], record[MIDDLE_V] = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
    record[HALF], record[HALF + 1] = hu, hv
    fan_u, fan_v, margin = np.inf, np.inf, FAN_MARGIN
    if provable:
        fan_u, fan_v, margin = _fan(
            scratch[1], degree_u, degree_v, record, scratch[2, 0, :2], cones,
            px, py, pz, qx, qy, qz, nx, ny, nz,
        )  # fmt: skip
    if not max(fan_u * row_length(record, ROW_U), fan_v * row_length(record, ROW_V)) < WIDEST:
        fan_u = fan_v = np.inf
    record[FAN], record[FAN + 1] = fan_u + margin * lp, fan_v + margin * lq
    for c in range(3):
        centre = cx if c == 0 else (cy if c == 1 else cz)
        box[c] += centre
        box[3 + c] += centre


@inner(outlined=True)
def side_at_point(control, start, degree_u, degree_v, rational, u0, u1, v0, v1):
    """Return on which side of a cell its patch ends in a point, to within rounding; else -1.

    Sides 0 and 1 are those of u = 0 and 1, 2 and 3 those of v.
    """
    first, last, size = start, start + (degree_u + 1) * (degree_v + 1) - 1, 0.0
    for k in range(first, last + 1):
        w = 1.0 if rational is None or not rational else control[k, 3]
        for c in range(3):
            size = max(size, abs(control[k, c]) / w)
    for side in range(4):
        if (u0 != 0.0, u1 != 1.0, v0 != 0.0, v1 != 1.0)[side]:
            continue
        step = 1 if side < 2 else degree_v + 1
        begin = start + (degree_u * (degree_v + 1), degree_v)[side // 2] * (side % 2)
        spread = 0.0
        for k in range(1, (degree_v if side < 2 else degree_u) + 1):
            p, q = control[begin], control[begin + k * step]
            v = w = 1.0
            if rational is not None and rational:
                v, w = p[3], q[3]
            for c in range(3):
                spread = max(spread, abs(q[c] / w - p[c] / v))
        if spread <= SAME_POINT * size:
            return side
    return -1


@kernel(allocates=True)
def _new_cones(widest, rational):
    """Return scratch of `rational_fan`; None for polynomial patches."""
    if rational is None:
        return None
    return np.empty((2, (widest - 1) * (2 * widest - 1), 3))


@kernel(allocates=True)
def fill_cells(
    control, start, degree, centre, rational, grid, first_cell, begin, end, records, boxes,
    cell_patch
):  # fmt: skip
    """Fill the cells of patches ``begin .. end``: grid[k] = (columns, rows) cells of patch k.

    ``control`` (total, 4) holds nets relative to ``centre`` (k, 3) as in `PatchTable`; ``records``
    (n, `RECORD`), ``boxes`` (n, 6) and ``cell_patch`` (n,) are filled from ``first_cell[k]`` on.
    """
    widest = 2
    for k in range(begin, end):
        widest = max(widest, degree[k, 0] + 1, degree[k, 1] + 1)
    scratch = np.empty((3, widest, widest, columns_of(rational)))
    cones = _new_cones(widest, rational)
    for k in range(begin, end):
        nu, nv = grid[k, 0], grid[k, 1]
        cell = first_cell[k]
        for a in range(nu):
            for b in range(nv):
                fill_cell(
                    control, start[k], degree[k, 0], degree[k, 1],
                    centre[k, 0], centre[k, 1], centre[k, 2],
                    a / nu, (a + 1) / nu, b / nv, (b + 1) / nv,
                    scratch, cones, records[cell], boxes[cell],
                )  # fmt: skip
                cell_patch[cell] = k
                cell += 1


@kernel(allocates=True)
def fill_quarters(
    control, start, degree, centre, rational, record, cell_patch, begin, end, quarter, quarter_patch
):  # fmt: skip
    """Fill the four quarters of cells ``begin .. end``.

    ``quarter`` (4 n, `RECORD`) and ``quarter_patch`` (4 n,) hold those of cell k from 4 k on.
    """
    widest = 2
    for k in range(degree.shape[0]):
        widest = max(widest, degree[k, 0] + 1, degree[k, 1] + 1)
    scratch = np.empty((3, widest, widest, columns_of(rational)))
    cones = _new_cones(widest, rational)
    box = np.empty(6)
    for cell in range(begin, end):
        k = cell_patch[cell]
        um, vm = record[cell, MIDDLE_U], record[cell, MIDDLE_V]
        hu, hv = record[cell, HALF], record[cell, HALF + 1]
        # Where a border is a point, all quarters there meet all rays that pass it, and each is a
        # search: two of them are one, and the other is nowhere.
        side = side_at_point(
            control, start[k], degree[k, 0], degree[k, 1], rational,
            um - hu, um + hu, vm - hv, vm + hv,
        )  # fmt: skip
        for part in range(4):
            u0 = um - hu if part < 2 else um
            v0 = vm - hv if part % 2 == 0 else vm
            u1, v1 = u0 + hu, v0 + hv
            is_other = False
            if side >= 0 and (part // 2 if side < 2 else part % 2) == side % 2:
                is_other = (part % 2 if side < 2 else part // 2) == 1
                if side < 2:
                    v0, v1 = vm - hv, vm + hv
                else:
                    u0, u1 = um - hu, um + hu
            fill_cell(
                control, start[k], degree[k, 0], degree[k, 1],
                centre[k, 0], centre[k, 1], centre[k, 2], u0, u1, v0, v1,
                scratch, cones, quarter[4 * cell + part], box,
            )  # fmt: skip
            if is_other:
                quarter[4 * cell + part, LOWER : LOWER + 3] = NOWHERE
                quarter[4 * cell + part, UPPER : UPPER + 3] = NOWHERE
            quarter_patch[4 * cell + part] = k
