"""What float64 can tell of the zeros of two Bernstein sums: which pieces certainly hold none.

Exact arithmetic of patches asks it where to look; it takes nothing on trust but rejections, and
those clear rounding by far.
"""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel

# Coefficients are rounded once, to 2^-53 of the largest, and again in each of up to 60 halvings of
# degree up to 30: below 2^-42 of it in all.
CLEAR = 2.0**-38
# Pieces this small beside the whole are left: rounding would soon decide.
SMALLEST = 2.0**-24
# Jacobians this close to singular say nothing.
SINGULAR = 1e-7
DEPTH = 80
MOST_PIECES = 20_000


@inner
def _halve_table(table, first, second, rows, columns, along_u):
    """Halve a table: ``first`` and ``second`` (may be the table itself) receive the halves."""
    for r in range(rows):
        for c in range(columns):
            second[r, c] = table[r, c]
    if along_u:
        for c in range(columns):
            for level in range(rows):
                first[level, c] = second[0, c]
                for r in range(rows - 1 - level):
                    second[r, c] = 0.5 * (second[r, c] + second[r + 1, c])
    else:
        for r in range(rows):
            for level in range(columns):
                first[r, level] = second[r, 0]
                for c in range(columns - 1 - level):
                    second[r, c] = 0.5 * (second[r, c] + second[r, c + 1])


@inner
def _has_one_sign(table, rows, columns, air):
    low, high = table[0, 0], table[0, 0]
    for r in range(rows):
        for c in range(columns):
            low, high = min(low, table[r, c]), max(high, table[r, c])
    return low > air or high < -air


@inner
def _combined_has_one_sign(f, g, rows, columns, x, y, air):
    low = high = x * f[0, 0] + y * g[0, 0]
    for r in range(rows):
        for c in range(columns):
            w = x * f[r, c] + y * g[r, c]
            low, high = min(low, w), max(high, w)
    return low > air or high < -air


@inner
def _turn(f, g, rows, columns, fu, fv, gu, gv, det):
    """How far derivatives leave the identity after the mean Jacobian's inverse."""
    k = rows * columns
    u0 = u1 = v0 = v1 = 0.0
    for r in range(rows):
        for c in range(columns):
            if r + 1 < rows:
                p, q = f[r + 1, c] - f[r, c], g[r + 1, c] - g[r, c]
                u0 = max(u0, abs(k * (rows - 1) * (gv * p - fv * q) / det - 1.0))
                v0 = max(v0, abs(k * (rows - 1) * (fu * q - gu * p) / det))
            if c + 1 < columns:
                p, q = f[r, c + 1] - f[r, c], g[r, c + 1] - g[r, c]
                u1 = max(u1, abs(k * (columns - 1) * (gv * p - fv * q) / det))
                v1 = max(v1, abs(k * (columns - 1) * (fu * q - gu * p) / det - 1.0))
    return max(u0 + u1, v0 + v1)


@kernel(allocates=True)
def pieces_left(f, g, may_turn, out):
    """Return how many pieces may hold zeros of both sums, -1 if more than fit or too much work.

    Parameters
    ----------
    f, g : (m + 1, n + 1) float64
        Each rounded to 2^-53 of its largest number, in one scale.
    may_turn : float
        Pieces that turn by less are not halved any more.
    out : (room, 4) int64
        Receives a, i, b, j: u from a / 2^i to (a + 1) / 2^i, v from b / 2^j to (b + 1) / 2^j.
    """
    rows, columns = f.shape
    fs, gs = np.empty((DEPTH, rows, columns)), np.empty((DEPTH, rows, columns))
    place = np.zeros((DEPTH, 4), np.int64)
    fs[0], gs[0] = f, g
    air_f, air_g = CLEAR * np.abs(f).max(), CLEAR * np.abs(g).max()
    air = max(air_f, air_g)
    smallest = SMALLEST / CLEAR * air
    top, count, pieces = 1, 0, 0
    while top > 0:
        top -= 1
        pieces += 1
        a, b = fs[top], gs[top]
        if _has_one_sign(a, rows, columns, air_f) or _has_one_sign(b, rows, columns, air_g):
            continue
        fu = fv = gu = gv = extent_u = extent_v = 0.0
        for c in range(columns):
            fu += a[rows - 1, c] - a[0, c]
            gu += b[rows - 1, c] - b[0, c]
            way = 0.0
            for r in range(rows - 1):
                way += abs(a[r + 1, c] - a[r, c]) + abs(b[r + 1, c] - b[r, c])
            extent_u = max(extent_u, way)
        for r in range(rows):
            fv += a[r, columns - 1] - a[r, 0]
            gv += b[r, columns - 1] - b[r, 0]
            way = 0.0
            for c in range(columns - 1):
                way += abs(a[r, c + 1] - a[r, c]) + abs(b[r, c + 1] - b[r, c])
            extent_v = max(extent_v, way)
        fu, gu, fv, gv = fu * rows, gu * rows, fv * columns, gv * columns
        x, y = fu, gu
        if x * x + y * y < fv * fv + gv * gv:
            x, y = fv, gv
        length = math.sqrt(x * x + y * y)
        if length > smallest:
            x, y = x / length, y / length
            if _combined_has_one_sign(a, b, rows, columns, -y, x, 2.0 * air):
                continue
            if _combined_has_one_sign(a, b, rows, columns, x, y, 2.0 * air):
                continue
        det = fu * gv - fv * gu
        is_left = max(extent_u, extent_v) <= smallest
        if rows > 1 and columns > 1 and not is_left:
            squares = fu * fu + fv * fv + gu * gu + gv * gv
            is_left = (
                abs(det) <= SINGULAR * squares
                or _turn(a, b, rows, columns, fu, fv, gu, gv, det) < may_turn
            )
        if is_left and pieces > 1:
            if count >= out.shape[0]:
                return -1
            out[count] = place[top]
            count += 1
            continue
        if pieces > MOST_PIECES or top + 2 > DEPTH:
            return -1
        along_u = (extent_u >= extent_v and rows > 1) or columns == 1
        _halve_table(a, fs[top + 1], a, rows, columns, along_u)
        _halve_table(b, gs[top + 1], b, rows, columns, along_u)
        k = 0 if along_u else 2
        for c in range(4):
            place[top + 1, c] = place[top, c]
        place[top, k] = 2 * place[top, k] + 1
        place[top + 1, k] = 2 * place[top + 1, k]
        place[top, k + 1] += 1
        place[top + 1, k + 1] += 1
        top += 2
    return count
