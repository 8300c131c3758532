"""Cells of sheets and curves, with bounds on their derivatives.

A net is restricted to a part of its parameters by de Casteljau's algorithm. Of N and w about a point c, in units of the half width, with M_ij and W_ij
the largest differences of order (i, j) and rho the radius, the quotient has

    B_ij = (M_ij + sum over (k, l) below (i, j) of C(i, k) C(j, l) B_kl W_(i-k)(j-l)) / min w,   B_00 = rho

(Floater 1992, "Derivatives of rational Bezier curves"). For polynomials this is the hull of the hodographs.
"""

import math

import numpy as np

from hybrid_rt.distance.kernels import table as tb
from hybrid_rt.distance.kernels.evaluate import (
    CURVE_POINT,
    POINT,
    PROFILE_POINT,
    edge_at,
    profile_at,
    sheet_at,
)
from meshing.kernels.jit import inner, kernel
from meshing.kernels.trims import classify

# Bounds are widened by this part, and by this part of the frame times the square of the degree: their roundings.
WIDENED, DIFFERENCES = 1.0 + 2.0**-40, 2.0**-50
# A cell of a curve turns by no more than this from its middle, so that it has one closest point to what is near.
BENDING = 0.25
# Cells of patches are halved so often at most, and turned ones along the profile; and cut ones while they are
# more than this part of the whole (u, v).
MOST_HALVED, MOST_IN_PROFILE, CUT_PART = 14, 10, 1.0 / 24.0
# A turn has so many cells: the hull of each is narrow.
PARTS_OF_TURN = 8
# Below this in the frame nothing is halved.
SMALLEST_CELL = 2.0**-20
# Scratch for a net, its restriction and a row; orders (i, j) of bounds.
ORDERS = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3))
_ORDERS = np.array(ORDERS)
_BINOMIAL = np.array([[math.comb(n, k) for k in range(4)] for n in range(4)], np.float64)
_SIGNED = np.array([[(-1.0) ** (n - k) * math.comb(n, k) for k in range(4)] for n in range(4)])


@inner
def restrict_row(net, first, step, n, a, b):
    """Restrict n + 1 rows of a net, ``step`` apart, to the parameters from a to b, in place."""
    # First cut off what is beyond b, then what is before a.
    for level in range(1, n + 1):
        for i in range(n, level - 1, -1):
            k = first + i * step
            for c in range(4):
                net[k, c] = (1.0 - b) * net[k - step, c] + b * net[k, c]
    rest = a / b
    for level in range(1, n + 1):
        for i in range(n - level + 1):
            k = first + i * step
            for c in range(4):
                net[k, c] = (1.0 - rest) * net[k, c] + rest * net[k + step, c]


@inner
def bounds_of_net(net, m, n, bounds):
    """Fill bounds (10,) on derivatives of a net over [-1, 1]^2, in the order of `ORDERS`."""
    count, stride = (m + 1) * (n + 1), n + 1
    middle = (m + 1) // 2 * stride + (n + 1) // 2
    w = net[middle, 3]
    cx, cy, cz = net[middle, 0] / w, net[middle, 1] / w, net[middle, 2] / w
    least, radius, largest = np.inf, 0.0, 0.0
    for k in range(count):
        w = net[k, 3]
        least = min(least, w)
        largest = max(largest, abs(net[k, 0]) + abs(net[k, 1]) + abs(net[k, 2]), w)
        x, y, z = net[k, 0] / w - cx, net[k, 1] / w - cy, net[k, 2] / w - cz
        radius = max(radius, np.sqrt(x * x + y * y + z * z))
    rounding = DIFFERENCES * (1.0 + m + n) ** 2 * largest
    bounds[0] = radius + rounding
    # bounds[10 + o]: those of w.
    for o in range(10):
        i, j = _ORDERS[o, 0], _ORDERS[o, 1]
        size = heavy = 0.0
        if i <= m and j <= n:
            factor = 1.0
            for d in range(i):
                factor *= 0.5 * (m - d)
            for d in range(j):
                factor *= 0.5 * (n - d)
            for p in range(m - i + 1):
                for q in range(n - j + 1):
                    x = y = z = w = 0.0
                    for a in range(i + 1):
                        for b in range(j + 1):
                            f = _SIGNED[i, a] * _SIGNED[j, b]
                            k = (p + a) * stride + q + b
                            h = net[k, 3]
                            x += f * (net[k, 0] - h * cx)
                            y += f * (net[k, 1] - h * cy)
                            z += f * (net[k, 2] - h * cz)
                            w += f * h
                    size = max(size, x * x + y * y + z * z)
                    heavy = max(heavy, abs(w))
            size, heavy = factor * np.sqrt(size), factor * heavy
        bounds[10 + o] = heavy
        if o == 0:
            continue
        for below in range(o):
            k, l = _ORDERS[below, 0], _ORDERS[below, 1]
            if k <= i and l <= j:
                for other in range(1, o + 1):
                    if _ORDERS[other, 0] == i - k and _ORDERS[other, 1] == j - l:
                        size += (
                            _BINOMIAL[i, k] * _BINOMIAL[j, l] * bounds[below] * bounds[10 + other]
                        )
        bounds[o] = WIDENED * size / least + rounding


@inner
def bounds_of_profile(shapes, k, v0, v1, net, bounds):
    """Fill bounds[:4] on (Z, R) about its middle and three derivatives over part of a profile; return R's most."""
    number, whole = shapes.sheet, shapes.sheet_id
    half = 0.5 * (v1 - v0)
    form = whole[k, tb.FORM]
    if form == tb.CIRCLE:
        r = number[k, tb.PROFILE + 2]
        turn = abs(number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3]) * half
        bounds[0], bounds[1] = r * turn, r * turn
        bounds[2], bounds[3] = r * turn * turn, r * turn**3
        way = number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3]
        middle = np.cos(number[k, tb.PROFILE + 3] + 0.5 * (v0 + v1) * way)
        return number[k, tb.PROFILE + 1] + r * min(middle + turn, 1.0)
    if form == tb.SAG:
        reach = number[k, tb.PROFILE]
        far = reach * (1.0 - v0) if number[k, tb.PROFILE + 4] < 0.0 else reach * v1
        w = far * far
        # Of the conic's part all derivatives grow with w; of the polynomial terms their sizes.
        curvature, under_root = abs(number[k, tb.PROFILE + 1]), number[k, tb.PROFILE + 2]
        root = np.sqrt(1.0 - under_root * w) if under_root > 0.0 else 1.0
        z1 = 0.5 * curvature / root
        z2 = 0.5 * z1 * abs(under_root) / root**2
        z3 = 1.5 * z2 * abs(under_root) / root**2
        centre = number[k, tb.PROFILE + 3]
        q, power = max(centre, abs(w - centre)), 1.0
        for j in range(1, whole[k, tb.DEGREE_V] + 1):
            a = abs(shapes.net[whole[k, tb.NET] + j, 0])
            z1 += j * a * power
            if j > 1:
                z2 += j * (j - 1) * a * power / q
            if j > 2:
                z3 += j * (j - 1) * (j - 2) * a * power / (q * q)
            power *= q
        h = half * reach
        bounds[1] = WIDENED * h * np.sqrt(1.0 + (2.0 * far * z1) ** 2)
        bounds[2] = WIDENED * h * h * (2.0 * z1 + 4.0 * w * z2)
        bounds[3] = WIDENED * h**3 * (12.0 * far * z2 + 8.0 * far * w * z3)
        bounds[0] = bounds[1]
        return far
    n, start = whole[k, tb.DEGREE_V], whole[k, tb.NET]
    most = 0.0
    for i in range(n + 1):
        for c in range(4):
            net[i, c] = shapes.net[start + i, c]
    restrict_row(net, 0, 1, n, v0, v1)
    for i in range(n + 1):
        most = max(most, net[i, 1] / net[i, 3])
    bounds_of_net(net, 0, n, bounds)
    bounds[1], bounds[2], bounds[3] = bounds[2], bounds[5], bounds[9]
    return most


@inner
def bounds_of_sheet(shapes, k, u0, u1, v0, v1, net, bounds):
    """Fill bounds (10,) on derivatives of a sheet over part of it."""
    whole = shapes.sheet_id
    if whole[k, tb.IS_TURNED]:
        most = bounds_of_profile(shapes, k, v0, v1, net, bounds)
        turn = 0.5 * (u1 - u0) * abs(shapes.sheet[k, tb.TURN + 1] - shapes.sheet[k, tb.TURN])
        p1, p2, p3 = bounds[1], bounds[2], bounds[3]
        bounds[1], bounds[2] = most * turn, p1
        bounds[3], bounds[4], bounds[5] = most * turn * turn, p1 * turn, p2
        bounds[6], bounds[7], bounds[8], bounds[9] = most * turn**3, p1 * turn**2, p2 * turn, p3
        return
    m, n, start = whole[k, tb.DEGREE_U], whole[k, tb.DEGREE_V], whole[k, tb.NET]
    for i in range((m + 1) * (n + 1)):
        for c in range(4):
            net[i, c] = shapes.net[start + i, c]
    for i in range(m + 1):
        restrict_row(net, i * (n + 1), 1, n, v0, v1)
    for j in range(n + 1):
        restrict_row(net, j, n + 1, m, u0, u1)
    bounds_of_net(net, m, n, bounds)


@inner
def side_of_part(shapes, trims, k, u0, u1, v0, v1):
    """Tell on which side of the loops a part of a sheet is; `CUT` + 1: outside."""
    member = shapes.sheet_id[k, tb.LOOPS]
    if member < 0:
        return tb.WHOLE
    number = shapes.sheet
    a, b = number[k, tb.SPAN], number[k, tb.SPAN + 1] - number[k, tb.SPAN]
    c, d = number[k, tb.SPAN + 2], number[k, tb.SPAN + 3] - number[k, tb.SPAN + 2]
    # Some roundings more.
    du, dv = 0.5000005 * (u1 - u0) * b, 0.5000005 * (v1 - v0) * d
    is_inside, may_be_near = classify(
        trims, member, a + 0.5 * (u0 + u1) * b, c + 0.5 * (v0 + v1) * d, du, dv
    )
    if may_be_near:
        return tb.CUT
    return tb.WHOLE if is_inside else tb.CUT + 1


@inner
def length_at(work, row, half):
    """Return the length of a row, times a half width."""
    x, y, z = work[row, 0], work[row, 1], work[row, 2]
    return half * np.sqrt(x * x + y * y + z * z)


@inner
def write_vector(cell, row, column, work, at, factor):
    """Write a row of scratch, times a factor, into three columns of a cell."""
    for c in range(3):
        cell[row, column + c] = factor * work[at, c]


@inner
def write_directions(cell, row, column, low, high):
    """Write cosine and sine of two angles, the lower first."""
    a, b = min(low, high), max(low, high)
    cell[row, column], cell[row, column + 1] = np.cos(a), np.sin(a)
    cell[row, column + 2], cell[row, column + 3] = np.cos(b), np.sin(b)


@inner
def _begin_cell(cell, cell_id, row, kind, k, state):
    for c in range(cell.shape[1]):
        cell[row, c] = 0.0
    for c in range(cell_id.shape[1]):
        cell_id[row, c] = 0
    cell_id[row, tb.KIND], cell_id[row, tb.SHEET], cell_id[row, tb.STATE] = kind, k, state


@kernel(allocates=True)
def cells_of_sheets(shapes, trims, is_left_out, cell, cell_id):
    """Cut sheets into cells, but for some; return how many there are, of which as many as fit are written."""
    net, bounds, work = np.empty((1024, 4)), np.empty(20), np.empty((18, 32))
    stack = np.empty((96, 4))
    depth = np.empty(96, np.int64)
    count = 0
    number, whole = shapes.sheet, shapes.sheet_id
    for k in range(whole.shape[0]):
        if is_left_out[k]:
            continue
        is_turned, form = whole[k, tb.IS_TURNED] != 0, whole[k, tb.FORM]
        share = (number[k, tb.SPAN + 1] - number[k, tb.SPAN]) * (
            number[k, tb.SPAN + 3] - number[k, tb.SPAN + 2]
        )
        stack[0, 0], stack[0, 1], stack[0, 2], stack[0, 3] = 0.0, 1.0, 0.0, 1.0
        depth[0], top = 0, 1
        size = -1.0
        while top > 0:
            top -= 1
            u0, u1, v0, v1 = stack[top, 0], stack[top, 1], stack[top, 2], stack[top, 3]
            level = depth[top]
            state = side_of_part(shapes, trims, k, u0, u1, v0, v1)
            if state > tb.CUT:
                continue
            hu, hv = 0.5 * (u1 - u0), 0.5 * (v1 - v0)
            u, v = u0 + hu, v0 + hv
            is_large = state == tb.CUT and 4.0 * hu * hv * share > CUT_PART
            halves, along_u = False, True
            if is_turned:
                most = bounds_of_profile(shapes, k, v0, v1, net, bounds)
                profile_at(shapes, k, v, work)
                turn = 2.0 * hu * abs(number[k, tb.TURN + 1] - number[k, tb.TURN])
                bends = bounds[2] > BENDING * length_at(work, PROFILE_POINT + 1, hv)
                if form == tb.CIRCLE:
                    tube = 2.0 * hv * abs(number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3])
                    bends = tube > 2.1 * np.pi / PARTS_OF_TURN
                if turn > 2.1 * np.pi / PARTS_OF_TURN:
                    halves = True
                elif bends and hv > 2.0**-MOST_IN_PROFILE and bounds[1] > SMALLEST_CELL:
                    halves, along_u = True, False
                elif is_large:
                    halves, along_u = True, most * turn > 2.0 * bounds[1]
            else:
                bounds_of_sheet(shapes, k, u0, u1, v0, v1, net, bounds)
                sheet_at(shapes, k, u, v, work)
                along, across = length_at(work, POINT + 1, hu), length_at(work, POINT + 2, hv)
                if size < 0.0:
                    size = max(bounds[0], SMALLEST_CELL)
                # Is the square of the distance convex on the cell, for what is near?
                a, b = along * along, across * across
                mixed = 0.0
                for c in range(3):
                    mixed += hu * hv * work[POINT + 1, c] * work[POINT + 2, c]
                e = (
                    3.0 * bounds[3] * bounds[1]
                    + 2.0 * bounds[4] * bounds[1]
                    + bounds[3] * bounds[2]
                )
                f = (
                    3.0 * bounds[5] * bounds[2]
                    + 2.0 * bounds[4] * bounds[2]
                    + bounds[5] * bounds[1]
                )
                g = 2.0 * bounds[4] * (bounds[1] + bounds[2]) + bounds[3] * bounds[2]
                g += bounds[5] * bounds[1]
                a, b, mixed = a - 0.5 * e, b - 0.5 * f, abs(mixed) + 0.5 * g
                bends = not (a > 0.0 and b > 0.0 and a * b > mixed * mixed)
                can = level < MOST_HALVED and bounds[0] > size * 2.0**-7
                if bends and can:
                    halves = True
                    along_u = bounds[3] > bounds[5]
                    if max(bounds[3], bounds[5]) < 0.5 * bounds[4]:
                        along_u = along >= across
                elif is_large:
                    halves, along_u = True, along >= across
            if halves:
                for side in range(2):
                    stack[top + side, 0], stack[top + side, 1] = u0, u1
                    stack[top + side, 2], stack[top + side, 3] = v0, v1
                if along_u:
                    stack[top, 1] = stack[top + 1, 0] = u
                else:
                    stack[top, 3] = stack[top + 1, 2] = v
                depth[top] = depth[top + 1] = level + 1
                top += 2
                continue
            if count < cell.shape[0]:
                _begin_cell(cell, cell_id, count, tb.TURNED if is_turned else tb.PATCH, k, state)
                for c in range(4):
                    cell[count, tb.BOX + c] = (u0, u1, v0, v1)[c]
                if is_turned:
                    write_vector(cell, count, tb.MIDDLE, work, PROFILE_POINT, 1.0)
                    write_vector(cell, count, tb.ALONG_U, work, PROFILE_POINT + 1, hv)
                    cell[count, tb.OFF] = 0.5 * bounds[2]
                    for c in range(3):
                        cell[count, tb.BOUNDS + c] = bounds[1 + c]
                    way = number[k, tb.TURN + 1] - number[k, tb.TURN]
                    a = number[k, tb.TURN]
                    write_directions(cell, count, tb.AZIMUTH, a + u0 * way, a + u1 * way)
                    if form == tb.CIRCLE:
                        way = number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3]
                        a = number[k, tb.PROFILE + 3]
                        write_directions(cell, count, tb.TUBE, a + v0 * way, a + v1 * way)
                else:
                    write_vector(cell, count, tb.MIDDLE, work, POINT, 1.0)
                    write_vector(cell, count, tb.ALONG_U, work, POINT + 1, hu)
                    write_vector(cell, count, tb.ALONG_V, work, POINT + 2, hv)
                    cell[count, tb.OFF] = 0.5 * bounds[3] + bounds[4] + 0.5 * bounds[5]
                    for c in range(9):
                        cell[count, tb.BOUNDS + c] = bounds[1 + c]
            count += 1
    return count


@kernel(allocates=True)
def cells_of_edges(shapes, edge, edge_id, cell, cell_id):
    """Cut curves (e, 2), from s0 to s1, into cells; ``edge_id`` (e, 4): sheet, net, degree, whether to be checked.

    Returns how many there are, of which as many as fit are written.
    """
    net, bounds, work = np.empty((1024, 4)), np.empty(20), np.empty((18, 32))
    u_bounds, v_bounds = np.empty(20), np.empty(20)
    stack = np.empty((96, 2))
    count = 0
    number = shapes.sheet
    for e in range(edge.shape[0]):
        k, start, n, checked = edge_id[e, 0], edge_id[e, 1], edge_id[e, 2], edge_id[e, 3]
        stack[0, 0], stack[0, 1], top = edge[e, 0], edge[e, 1], 1
        length = edge[e, 1] - edge[e, 0]
        while top > 0:
            top -= 1
            a, b = stack[top, 0], stack[top, 1]
            half = 0.5 * (b - a)
            for i in range(n + 1):
                for c in range(4):
                    net[i, c] = shapes.net[start + i, c]
            restrict_row(net, 0, 1, n, a, b)
            low_u = low_v = np.inf
            high_u = high_v = -np.inf
            for i in range(n + 1):
                u = (net[i, 0] / net[i, 3] - number[k, tb.SPAN]) / (
                    number[k, tb.SPAN + 1] - number[k, tb.SPAN]
                )
                v = (net[i, 1] / net[i, 3] - number[k, tb.SPAN + 2]) / (
                    number[k, tb.SPAN + 3] - number[k, tb.SPAN + 2]
                )
                # Each as a curve of its own, about the sheet.
                net[i, 0], net[i, 1] = u * net[i, 3], v * net[i, 3]
                low_u, high_u = min(low_u, u), max(high_u, u)
                low_v, high_v = min(low_v, v), max(high_v, v)
            for i in range(n + 1):
                net[200 + i, 0], net[200 + i, 1], net[200 + i, 2] = net[i, 1], 0.0, 0.0
                net[200 + i, 3], net[i, 1], net[i, 2] = net[i, 3], 0.0, 0.0
            bounds_of_net(net, 0, n, u_bounds)
            bounds_of_net(net[200:], 0, n, v_bounds)
            low_u, high_u = max(low_u, 0.0), min(high_u, 1.0)
            low_v, high_v = max(low_v, 0.0), min(high_v, 1.0)
            # Bounds of the sheet want a part with an inside.
            wide_u, wide_v = max(high_u - low_u, 2.0**-30), max(high_v - low_v, 2.0**-30)
            low_u, low_v = max(min(low_u, 1.0 - wide_u), 0.0), max(min(low_v, 1.0 - wide_v), 0.0)
            bounds_of_sheet(shapes, k, low_u, low_u + wide_u, low_v, low_v + wide_v, net, bounds)
            f, g = 2.0 / wide_u, 2.0 / wide_v
            x1, x2, x3 = f * u_bounds[2], f * u_bounds[5], f * u_bounds[9]
            y1, y2, y3 = g * v_bounds[2], g * v_bounds[5], g * v_bounds[9]
            c1 = bounds[1] * x1 + bounds[2] * y1
            c2 = bounds[3] * x1 * x1 + 2.0 * bounds[4] * x1 * y1 + bounds[5] * y1 * y1
            c2 += bounds[1] * x2 + bounds[2] * y2
            c3 = bounds[6] * x1**3 + 3.0 * bounds[7] * x1 * x1 * y1
            c3 += 3.0 * bounds[8] * x1 * y1 * y1 + bounds[9] * y1**3
            mixed = bounds[3] * x1 * x2 + bounds[4] * (x1 * y2 + x2 * y1) + bounds[5] * y1 * y2
            c3 += 3.0 * mixed + bounds[1] * x3 + bounds[2] * y3
            edge_at(shapes, k, start, n, a + half, work)
            runs = length_at(work, CURVE_POINT + 1, half)
            if c2 > BENDING * runs and c1 > SMALLEST_CELL and half > 2.0**-12 * length:
                stack[top, 0] = a
                stack[top, 1] = stack[top + 1, 0] = a + half
                stack[top + 1, 1] = b
                top += 2
                continue
            if count < cell.shape[0]:
                _begin_cell(cell, cell_id, count, tb.EDGE, k, tb.CUT if checked else tb.WHOLE)
                cell_id[count, tb.ARC], cell_id[count, tb.DEGREE] = start, n
                cell_id[count, tb.CHECKED] = checked
                cell[count, tb.BOX], cell[count, tb.BOX + 1] = a, b
                write_vector(cell, count, tb.MIDDLE, work, CURVE_POINT, 1.0)
                write_vector(cell, count, tb.ALONG_U, work, CURVE_POINT + 1, half)
                cell[count, tb.OFF] = 0.5 * c2
                for c in range(3):
                    cell[count, tb.BOUNDS + c] = (c1, c2, c3)[c]
            count += 1
    return count


@kernel
def boxes_of_cells(shapes, cell, cell_id, lower, upper):
    """Fill the boxes of cells."""
    number = shapes.sheet
    for row in range(cell.shape[0]):
        kind, k = cell_id[row, tb.KIND], cell_id[row, tb.SHEET]
        for axis in range(3):
            a, b = cell[row, tb.ALONG_U + axis], cell[row, tb.ALONG_V + axis]
            m = cell[row, tb.MIDDLE + axis]
            if kind == tb.TURNED:
                # The cone about the profile's chord: its corners, and where tangents of its circles meet.
                c0, s0 = cell[row, tb.AZIMUTH], cell[row, tb.AZIMUTH + 1]
                c1, s1 = cell[row, tb.AZIMUTH + 2], cell[row, tb.AZIMUTH + 3]
                to = 1.0 / max(1.0 + c0 * c1 + s0 * s1, 0.5)
                x, y = number[k, tb.FRAME + 3 + axis], number[k, tb.FRAME + 6 + axis]
                low, high = np.inf, -np.inf
                for end in range(2):
                    sign = 2.0 * end - 1.0
                    z, r = cell[row, tb.MIDDLE], cell[row, tb.MIDDLE + 1]
                    z, r = z + sign * cell[row, tb.ALONG_U], r + sign * cell[row, tb.ALONG_U + 1]
                    z = number[k, tb.FRAME + axis] + z * number[k, tb.FRAME + 9 + axis]
                    r = max(r, 0.0)
                    for c, s in ((c0, s0), (c1, s1), (to * (c0 + c1), to * (s0 + s1))):
                        at = z + r * (c * x + s * y)
                        low, high = min(low, at), max(high, at)
                # Within OFF of the chord, along and across.
                off = 2.0 * cell[row, tb.OFF]
                lower[row, axis], upper[row, axis] = low - off, high + off
            elif kind == tb.TRIANGLE:
                lower[row, axis], upper[row, axis] = m + min(0.0, a, b), m + max(0.0, a, b)
            else:
                reach = abs(a) + abs(b) + cell[row, tb.OFF]
                lower[row, axis], upper[row, axis] = m - reach, m + reach
