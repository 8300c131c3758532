"""Points and derivatives of sheets, of their profiles, and of curves on them."""

import numpy as np

from hybrid_rt.distance.kernels import table as tb
from meshing.kernels.jit import inner

# Rows of scratch: Bernstein polynomials and two derivatives in u and in v; a point and its derivatives (six of a
# sheet, three of a profile, three of a curve), each (x, y, z, w).
BASIS_U, BASIS_V, POINT, PROFILE_POINT, CURVE_POINT = 0, 3, 6, 12, 15
SCRATCH_ROWS, SCRATCH_COLUMNS = 18, 32


@inner
def fill_basis(n, x, work, row):
    """Fill three rows with the Bernstein polynomials of degree n at x, and their two derivatives."""
    y = 1.0 - x
    work[row, 0] = 1.0
    for d in range(1, n + 1):
        if d == n:
            for i in range(n + 1):
                low = work[row, i - 1] if i > 0 else 0.0
                work[row + 1, i] = n * (low - (work[row, i] if i < n else 0.0))
        if d == n - 1:
            for i in range(n + 1):
                low = work[row, i - 2] if i > 1 else 0.0
                middle = work[row, i - 1] if 0 < i < n else 0.0
                high = work[row, i] if i < n - 1 else 0.0
                work[row + 2, i] = n * (n - 1.0) * (low - 2.0 * middle + high)
        carry = 0.0
        for i in range(d):
            b = work[row, i]
            work[row, i] = carry + y * b
            carry = x * b
        work[row, d] = carry
    if n == 1:
        work[row + 2, 0] = work[row + 2, 1] = 0.0


@inner
def quotient_row(work, row):
    """Divide homogeneous C, C', C'' in three rows by the weight."""
    w, w1, w2 = work[row, 3], work[row + 1, 3], work[row + 2, 3]
    for c in range(3):
        x = work[row, c] / w
        x1 = (work[row + 1, c] - x * w1) / w
        work[row + 2, c] = (work[row + 2, c] - 2.0 * x1 * w1 - x * w2) / w
        work[row, c], work[row + 1, c] = x, x1


@inner
def row_at(net, start, n, s, work, row):
    """Fill three rows with C, C' and C'' of a rational Bezier curve at s."""
    fill_basis(n, s, work, BASIS_V)
    for c in range(4):
        a = a1 = a2 = 0.0
        for i in range(n + 1):
            x = net[start + i, c]
            a += work[BASIS_V, i] * x
            a1 += work[BASIS_V + 1, i] * x
            a2 += work[BASIS_V + 2, i] * x
        work[row, c], work[row + 1, c], work[row + 2, c] = a, a1, a2
    quotient_row(work, row)


@inner
def patch_at(net, start, m, n, rational, u, v, work):
    """Fill six rows with S, S_u, S_v, S_uu, S_uv, S_vv of a Bezier patch."""
    fill_basis(m, u, work, BASIS_U)
    fill_basis(n, v, work, BASIS_V)
    p = POINT
    for c in range(4 if rational else 3):
        s = su = sv = suu = suv = svv = 0.0
        k = start
        for i in range(m + 1):
            r = r1 = r2 = 0.0
            for j in range(n + 1):
                x = net[k, c]
                r += work[BASIS_V, j] * x
                r1 += work[BASIS_V + 1, j] * x
                r2 += work[BASIS_V + 2, j] * x
                k += 1
            b, b1 = work[BASIS_U, i], work[BASIS_U + 1, i]
            s += b * r
            su += b1 * r
            sv += b * r1
            suu += work[BASIS_U + 2, i] * r
            suv += b1 * r1
            svv += b * r2
        work[p, c], work[p + 1, c], work[p + 2, c] = s, su, sv
        work[p + 3, c], work[p + 4, c], work[p + 5, c] = suu, suv, svv
    if rational:
        w, wu, wv = work[p, 3], work[p + 1, 3], work[p + 2, 3]
        wuu, wuv, wvv = work[p + 3, 3], work[p + 4, 3], work[p + 5, 3]
        for c in range(3):
            x = work[p, c] / w
            xu, xv = (work[p + 1, c] - x * wu) / w, (work[p + 2, c] - x * wv) / w
            work[p + 3, c] = (work[p + 3, c] - 2.0 * xu * wu - x * wuu) / w
            work[p + 4, c] = (work[p + 4, c] - xu * wv - xv * wu - x * wuv) / w
            work[p + 5, c] = (work[p + 5, c] - 2.0 * xv * wv - x * wvv) / w
            work[p, c], work[p + 1, c], work[p + 2, c] = x, xu, xv


@inner
def sag_at(net, start, n, k, number, w):
    """Return z, dz/dw and d2z/dw2 of a sag; its polynomial about a centre has n + 1 coefficients."""
    curvature, under_root = number[k, tb.PROFILE + 1], number[k, tb.PROFILE + 2]
    root = np.sqrt(max(1.0 - under_root * w, 0.0))
    rate = 0.5 * curvature / root
    bend = 0.5 * rate * under_root / (root * root)
    a = b = e = 0.0
    q = w - number[k, tb.PROFILE + 3]
    for j in range(n, -1, -1):
        e = e * q + b
        b = b * q + a
        a = a * q + net[start + j, 0]
    return curvature * w / (1.0 + root) + a, rate + b, bend + 2.0 * e


@inner
def profile_at(shapes, k, v, work):
    """Fill three rows with (Z, R) of a turned sheet at v, and two derivatives."""
    number, p = shapes.sheet, PROFILE_POINT
    form, start = shapes.sheet_id[k, tb.FORM], shapes.sheet_id[k, tb.NET]
    if form == tb.CIRCLE:
        # Z + r sin b, R + r cos b, b from one angle to another
        way = number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3]
        b, r = number[k, tb.PROFILE + 3] + v * way, number[k, tb.PROFILE + 2]
        c, s = r * np.cos(b), r * np.sin(b)
        work[p, 0], work[p, 1] = number[k, tb.PROFILE] + s, number[k, tb.PROFILE + 1] + c
        work[p + 1, 0], work[p + 1, 1] = way * c, -way * s
        work[p + 2, 0], work[p + 2, 1] = -way * way * s, -way * way * c
    elif form == tb.SAG:
        half = number[k, tb.PROFILE]
        way = -half if number[k, tb.PROFILE + 4] < 0.0 else half
        r = half * (1.0 - v) if way < 0.0 else half * v
        z, z1, z2 = sag_at(shapes.net, start, shapes.sheet_id[k, tb.DEGREE_V], k, number, r * r)
        work[p, 0], work[p, 1] = z, r
        work[p + 1, 0], work[p + 1, 1] = 2.0 * r * z1 * way, way
        work[p + 2, 0], work[p + 2, 1] = (2.0 * z1 + 4.0 * r * r * z2) * half * half, 0.0
    else:
        row_at(shapes.net, start, shapes.sheet_id[k, tb.DEGREE_V], v, work, p)
    work[p, 2] = work[p + 1, 2] = work[p + 2, 2] = 0.0


@inner
def sheet_at(shapes, k, u, v, work):
    """Fill six rows with S, S_u, S_v, S_uu, S_uv, S_vv of a sheet."""
    whole = shapes.sheet_id
    if not whole[k, tb.IS_TURNED]:
        patch_at(
            shapes.net, whole[k, tb.NET], whole[k, tb.DEGREE_U], whole[k, tb.DEGREE_V],
            whole[k, tb.RATIONAL] != 0, u, v, work,
        )  # fmt: skip
        return
    profile_at(shapes, k, v, work)
    number, p, q = shapes.sheet, POINT, PROFILE_POINT
    way = number[k, tb.TURN + 1] - number[k, tb.TURN]
    angle = number[k, tb.TURN] + u * way
    c, s = np.cos(angle), np.sin(angle)
    z, r, z1, r1 = work[q, 0], work[q, 1], work[q + 1, 0], work[q + 1, 1]
    z2, r2 = work[q + 2, 0], work[q + 2, 1]
    for i in range(3):
        x, y = number[k, tb.FRAME + 3 + i], number[k, tb.FRAME + 6 + i]
        axis = number[k, tb.FRAME + 9 + i]
        out, around = c * x + s * y, way * (c * y - s * x)
        work[p, i] = number[k, tb.FRAME + i] + z * axis + r * out
        work[p + 1, i], work[p + 2, i] = r * around, z1 * axis + r1 * out
        work[p + 3, i], work[p + 4, i] = -r * way * way * out, r1 * around
        work[p + 5, i] = z2 * axis + r2 * out


@inner
def edge_at(shapes, k, start, degree, s, work):
    """Fill `CURVE_POINT` with C, C', C'' of a curve on sheet k; return (u, v) there, of the sheet."""
    row_at(shapes.net, start, degree, s, work, CURVE_POINT)
    number, q, p = shapes.sheet, CURVE_POINT, POINT
    u0, v0 = number[k, tb.SPAN], number[k, tb.SPAN + 2]
    by_u, by_v = 1.0 / (number[k, tb.SPAN + 1] - u0), 1.0 / (number[k, tb.SPAN + 3] - v0)
    u, v = (work[q, 0] - u0) * by_u, (work[q, 1] - v0) * by_v
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    u1, v1 = work[q + 1, 0] * by_u, work[q + 1, 1] * by_v
    u2, v2 = work[q + 2, 0] * by_u, work[q + 2, 1] * by_v
    sheet_at(shapes, k, u, v, work)
    for c in range(3):
        work[q, c] = work[p, c]
        work[q + 1, c] = work[p + 1, c] * u1 + work[p + 2, c] * v1
        work[q + 2, c] = (
            work[p + 3, c] * u1 * u1 + 2.0 * work[p + 4, c] * u1 * v1 + work[p + 5, c] * v1 * v1
            + work[p + 1, c] * u2 + work[p + 2, c] * v2
        )  # fmt: skip
    return u, v
