"""Closest points by branch and bound, certified.

Cells come from a tree, the nearest first. About a point x* of a cell found by Newton's method on
F(x) = |S(x) - p|^2 / 2, within the cell's sides,

    F(x* + d) >= F* + g.d + 1/2 d^T (H* - E) d,   E_ij = 1/3 sum over k of |F_ijk| r_k,   |d_k| <= r_k,

with |F_ijk| bounded by the bounds on derivatives. Where H* - E is positive definite, lambda its least
eigenvalue, and g pushes outward at the sides that x* is on, F >= F* - g^2 / (2 lambda): nothing on the cell is
nearer than sqrt(|S* - p|^2 - g^2 / lambda). Else the cell is halved. Parts that wait lie on a heap, by what
they cannot be nearer than: what is left when the search ends is in ``bound``.

Of a cell that loops cut, a point where F is stationary counts if it is inside them; other points of it are no
nearer than the curves, which are cells themselves. About an axis, every point gets nearer as it turns toward
the azimuth of p; so turned cells are curves in the half plane of an azimuth.
"""

import numpy as np

from hybrid_rt.distance.kernels import table as tb
from hybrid_rt.distance.kernels.build import side_of_part
from hybrid_rt.distance.kernels.evaluate import (
    CURVE_POINT,
    POINT,
    PROFILE_POINT,
    SCRATCH_COLUMNS,
    SCRATCH_ROWS,
    edge_at,
    profile_at,
    sheet_at,
)
from hybrid_rt.intersection.kernels.search.tree import CHILD, COUNT, WIDTH
from meshing.kernels.jit import inner, kernel
from meshing.kernels.trims import classify, is_entered

# Rows of `found`: the least distance; what it may be less by; whether others are as near; u, v on the sheet; the
# point; sheet and patch; whether it is on an edge; what nothing need be searched beyond, a slack included.
DISTANCE, FLOOR, SEVERAL_AT, U, V, X, Y, Z, OF_SHEET, OF_PIECE, ON_EDGE, LIMIT = range(12)
FOUND = 12
ROUNDOFF = 2.0**-53
# Roundings in a distance of a point from one of a sheet, besides the sheet's error.
ROUNDINGS = 12.0
# Cells are left out if they are farther by this many errors; what is as near by less is as near.
SLACK = 4.0
# Points that are as near within the error e, at distance d, may be this times sqrt(e d) apart and count as one.
SAME_PLACE = 16.0
NEWTON_STEPS = 12
# A step below this, of a cell, squares to nothing; points on a side are looked at from this far inside it.
FINAL_STEP = 2.0**-26
# Parts of cells that may wait at once, and that are looked into for one point.
HEAP, MOST_PARTS = 1024, 4000
# Columns of the heap: what the part cannot be nearer than; its sides; where to begin; its state; its cell.
LEAST, SIDES, START, PART_STATE, OF_CELL, HEAP_COLUMNS = 0, 1, 5, 7, 8, 9
# Cells smaller than rounding by this part are not halved.
SMALLEST_PART = 2.0**-44


@inner
def write(heap, i, least, row, a0, a1, b0, b1, s, t, state):
    """Write a part of a cell into a row of the heap."""
    heap[i, 0], heap[i, 1], heap[i, 2], heap[i, 3], heap[i, 4] = least, a0, a1, b0, b1
    heap[i, 5], heap[i, 6], heap[i, 7], heap[i, 8] = s, t, state, row


@inner(outlined=True)
def keep(found, heap, size, least, row, a0, a1, b0, b1, s, t, state):
    """Put a part of a cell on the heap if it may have what is nearer; return the heap's size."""
    if least > found[LIMIT]:
        return size
    if size >= HEAP:
        found[FLOOR], found[SEVERAL_AT] = min(found[FLOOR], least), 1.0
        return size
    i = size
    while i > 0:
        above = (i - 1) // 2
        if heap[above, LEAST] <= least:
            break
        for c in range(HEAP_COLUMNS):
            heap[i, c] = heap[above, c]
        i = above
    write(heap, i, least, row, a0, a1, b0, b1, s, t, state)
    return size + 1


@inner(outlined=True)
def pop(heap, size):
    """Move the nearest part from the top into the row behind the heap; return the heap's size."""
    last = size - 1
    for c in range(HEAP_COLUMNS):
        heap[HEAP, c] = heap[0, c]
    i = 0
    while True:
        below = 2 * i + 1
        if below >= last:
            break
        if below + 1 < last and heap[below + 1, LEAST] < heap[below, LEAST]:
            below += 1
        if heap[last, LEAST] <= heap[below, LEAST]:
            break
        for c in range(HEAP_COLUMNS):
            heap[i, c] = heap[below, c]
        i = below
    for c in range(HEAP_COLUMNS):
        heap[i, c] = heap[last, c]
    return last


@inner
def offer(found, shapes, k, piece, d, slack, u, v, x, y, z, is_edge):
    """Take a point of sheet k at distance d if it is the nearest; note others as near in other places."""
    best = found[DISTANCE]
    if d > best + slack:
        return
    found[LIMIT] = min(found[LIMIT], d + slack)
    if found[OF_SHEET] >= 0.0 and d >= best - slack:
        dx, dy, dz = x - found[X], y - found[Y], z - found[Z]
        if dx * dx + dy * dy + dz * dz > SAME_PLACE * SAME_PLACE * slack * (d + slack):
            found[SEVERAL_AT] = 1.0
    else:
        found[SEVERAL_AT] = 0.0
    other = np.int64(found[OF_SHEET])
    whole = shapes.sheet_id
    if (
        other < 0
        or d < best
        or (
            d == best
            and (
                whole[k, tb.OBJECT] < whole[other, tb.OBJECT]
                or (whole[k, tb.OBJECT] == whole[other, tb.OBJECT] and piece < found[OF_PIECE])
            )
        )
    ):
        found[DISTANCE], found[U], found[V] = d, u, v
        found[X], found[Y], found[Z] = x, y, z
        found[OF_SHEET], found[OF_PIECE], found[ON_EDGE] = k, piece, is_edge


@inner(outlined=True)
def stays_inside(shapes, trims, k, u, v):
    """Tell whether (u, v) of sheet k is inside its loops, or on them within rounding; and which."""
    member = shapes.sheet_id[k, tb.LOOPS]
    if member < 0:
        return True, False
    number = shapes.sheet
    a, c = number[k, tb.SPAN], number[k, tb.SPAN + 2]
    u, v = a + u * (number[k, tb.SPAN + 1] - a), c + v * (number[k, tb.SPAN + 3] - c)
    off = 4.0 * ROUNDOFF
    is_inside, may_be_near = classify(trims, member, u, v, off, off)
    return is_inside, may_be_near and is_entered(trims, member, u, v, off, off)


@inner
def within_box(g1, g2, h11, h12, h22, a0, a1, b0, b1):
    """Return the step d in a box that makes g.d + d.H.d / 2 least; H positive."""
    det = h11 * h22 - h12 * h12
    if det > 2.0**-40 * h11 * h22:
        d1, d2 = (h12 * g2 - h22 * g1) / det, (h12 * g1 - h11 * g2) / det
    else:
        d1, d2 = (-g1 / h11 if h11 > 0.0 else 0.0), (-g2 / h22 if h22 > 0.0 else 0.0)
        if h11 > h22:
            d2 = 0.0
        else:
            d1 = 0.0
    if a0 <= d1 <= a1 and b0 <= d2 <= b1:
        return d1, d2
    best, e1, e2 = np.inf, 0.0, 0.0
    if d1 < a0 or d1 > a1 or not h22 > 0.0:
        s = min(max(d1, a0), a1)
        t = min(max(-(g2 + h12 * s) / h22 if h22 > 0.0 else 0.0, b0), b1)
        best, e1, e2 = s * (g1 + 0.5 * h11 * s + h12 * t) + t * (g2 + 0.5 * h22 * t), s, t
    if d2 < b0 or d2 > b1 or best == np.inf:
        t = min(max(d2, b0), b1)
        s = min(max(-(g1 + h12 * t) / h11 if h11 > 0.0 else 0.0, a0), a1)
        if s * (g1 + 0.5 * h11 * s + h12 * t) + t * (g2 + 0.5 * h22 * t) < best:
            e1, e2 = s, t
    return e1, e2


@inner
def from_parallelogram(rx, ry, rz, ax, ay, az, bx, by, bz):
    """Return what |r + s a + t b| is at least and at most where it is least in [-1, 1]^2, and s, t there."""
    h11, h22 = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    h12 = ax * bx + ay * by + az * bz
    s, t = within_box(
        rx * ax + ry * ay + rz * az, rx * bx + ry * by + rz * bz, h11, h12, h22,
        -1.0, 1.0, -1.0, 1.0,
    )  # fmt: skip
    x, y, z = rx + s * ax + t * bx, ry + s * ay + t * by, rz + s * az + t * bz
    d = np.sqrt(x * x + y * y + z * z)
    if d == 0.0:
        return 0.0, 0.0, s, t
    # Convex: no other point is nearer than by what the slopes at this one allow.
    g1, g2 = x * ax + y * ay + z * az, x * bx + y * by + z * bz
    loss = g1 * (1.0 + s) if g1 > 0.0 else -g1 * (1.0 - s)
    loss += g2 * (1.0 + t) if g2 > 0.0 else -g2 * (1.0 - t)
    return d - loss / d, d, s, t


@inner
def least_in_patch(shapes, row, p, slack, found, heap):
    """Tell whether a cell of a patch may have what is nearer; make it the part to look into."""
    cell = shapes.cell
    least, most, s, t = from_parallelogram(
        cell[row, tb.MIDDLE] - p[0], cell[row, tb.MIDDLE + 1] - p[1], cell[row, tb.MIDDLE + 2] - p[2],
        cell[row, tb.ALONG_U], cell[row, tb.ALONG_U + 1], cell[row, tb.ALONG_U + 2],
        cell[row, tb.ALONG_V], cell[row, tb.ALONG_V + 1], cell[row, tb.ALONG_V + 2],
    )  # fmt: skip
    off, state = cell[row, tb.OFF] + slack, shapes.cell_id[row, tb.STATE]
    if state == tb.WHOLE:
        found[LIMIT] = min(found[LIMIT], most + off + slack)
    write(heap, HEAP, least - off, row, -1.0, 1.0, -1.0, 1.0, s, t, state)
    return least - off <= found[LIMIT]


@inner
def search_patch(shapes, trims, p, slack, found, heap, size, work):
    """Look into the part of a patch behind the heap; return the heap's size with what is left of it."""
    row, cell = np.int64(heap[HEAP, OF_CELL]), shapes.cell
    k = shapes.cell_id[row, tb.SHEET]
    piece = shapes.sheet_id[k, tb.PIECE]
    u0, v0 = cell[row, tb.BOX], cell[row, tb.BOX + 2]
    hu, hv = 0.5 * (cell[row, tb.BOX + 1] - u0), 0.5 * (cell[row, tb.BOX + 3] - v0)
    bu, bv = cell[row, tb.BOUNDS], cell[row, tb.BOUNDS + 1]
    buu, buv, bvv = cell[row, tb.BOUNDS + 2], cell[row, tb.BOUNDS + 3], cell[row, tb.BOUNDS + 4]
    b30, b21 = cell[row, tb.BOUNDS + 5], cell[row, tb.BOUNDS + 6]
    b12, b03 = cell[row, tb.BOUNDS + 7], cell[row, tb.BOUNDS + 8]
    px, py, pz, q = p[0], p[1], p[2], POINT
    least, s, t, state = (
        heap[HEAP, LEAST],
        heap[HEAP, START],
        heap[HEAP, START + 1],
        heap[HEAP, PART_STATE],
    )
    a0, a1 = heap[HEAP, SIDES], heap[HEAP, SIDES + 1]
    b0, b1 = heap[HEAP, SIDES + 2], heap[HEAP, SIDES + 3]
    is_done = False
    for step in range(NEWTON_STEPS):
        sheet_at(shapes, k, u0 + hu * (1.0 + s), v0 + hv * (1.0 + t), work)
        x, y, z = work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz
        f = x * x + y * y + z * z
        d = np.sqrt(f)
        g1 = hu * (x * work[q + 1, 0] + y * work[q + 1, 1] + z * work[q + 1, 2])
        g2 = hv * (x * work[q + 2, 0] + y * work[q + 2, 1] + z * work[q + 2, 2])
        j11 = j12 = j22 = 0.0
        for c in range(3):
            j11 += work[q + 1, c] * work[q + 1, c]
            j12 += work[q + 1, c] * work[q + 2, c]
            j22 += work[q + 2, c] * work[q + 2, c]
        j11, j12, j22 = hu * hu * j11, hu * hv * j12, hv * hv * j22
        h11 = j11 + hu * hu * (x * work[q + 3, 0] + y * work[q + 3, 1] + z * work[q + 3, 2])
        h12 = j12 + hu * hv * (x * work[q + 4, 0] + y * work[q + 4, 1] + z * work[q + 4, 2])
        h22 = j22 + hv * hv * (x * work[q + 5, 0] + y * work[q + 5, 1] + z * work[q + 5, 2])
        if state == tb.WHOLE:
            offer(
                found, shapes, k, piece, d, slack, u0 + hu * (1.0 + s), v0 + hv * (1.0 + t),
                work[q, 0], work[q, 1], work[q, 2], False,
            )  # fmt: skip
        if not (h11 > 0.0 and h22 > 0.0 and h11 * h22 > h12 * h12):
            d1, d2 = within_box(g1, g2, j11, j12, j22, a0 - s, a1 - s, b0 - t, b1 - t)
        else:
            d1, d2 = within_box(g1, g2, h11, h12, h22, a0 - s, a1 - s, b0 - t, b1 - t)
        is_final = max(abs(d1), abs(d2)) <= FINAL_STEP
        if is_final or (state != tb.WHOLE and step == 0):
            # Bounds on third derivatives, and on how second ones change.
            r1, r2 = max(a1 - s, s - a0), max(b1 - t, t - b0)
            far = d + bu * r1 + bv * r2
            e112 = 2.0 * buv * bu + buu * bv + far * b21
            e122 = 2.0 * buv * bv + bvv * bu + far * b12
            e11 = (3.0 * buu * bu + far * b30) * r1 + e112 * r2
            e22 = (3.0 * bvv * bv + far * b03) * r2 + e122 * r1
            e12 = e112 * r1 + e122 * r2
            if state != tb.WHOLE and (
                abs(g1) > (abs(h11) + 0.5 * e11) * r1 + (abs(h12) + 0.5 * e12) * r2
                or abs(g2) > (abs(h22) + 0.5 * e22) * r2 + (abs(h12) + 0.5 * e12) * r1
            ):
                is_done = True  # nowhere stationary
                break
            if is_final:
                # Is nothing else on this part as near? If it is cut, is nothing else stationary: is F convex?
                counts = state == tb.WHOLE or d > found[DISTANCE] + 2.0 * slack
                share = 1.0 / 3.0 if counts else 1.0
                m11, m22, m12 = h11 - share * e11, h22 - share * e22, abs(h12) + share * e12
                # What pushes outward at a side is no loss; and as |d| <= r, |g d| >= |g| d^2 / r.
                f1 = 0.0 if (s == a0 and g1 > 0.0) or (s == a1 and g1 < 0.0) else g1
                f2 = 0.0 if (t == b0 and g2 > 0.0) or (t == b1 and g2 < 0.0) else g2
                if counts:
                    m11 += 2.0 * abs(g1 - f1) / r1
                    m22 += 2.0 * abs(g2 - f2) / r2
                det = m11 * m22 - m12 * m12
                if not (m11 > 0.0 and m22 > 0.0 and det > 0.0):
                    break
                loss = (f1 * f1 + f2 * f2) * (m11 + m22) / det
                is_exact = d - np.sqrt(max(f - loss, 0.0)) <= slack
                if is_exact or (step > NEWTON_STEPS - 4 and state == tb.WHOLE):
                    is_done = True
                    found_least = np.sqrt(max(f - loss, 0.0))
                    s, t = s + d1, t + d2
                    for c in range(3):
                        work[q, c] += hu * d1 * work[q + 1, c] + hv * d2 * work[q + 2, c]
                    # On a side by a push that is not rounding nothing is stationary.
                    pushed = (g1 - f1) ** 2 / m11 + (g2 - f2) ** 2 / m22
                    is_stationary = pushed <= 2.0**-40 * min(j11, j22)
                    u, v = u0 + hu * (1.0 + s), v0 + hv * (1.0 + t)
                    if state == tb.WHOLE:
                        offer(
                            found, shapes, k, piece, d, slack, u, v,
                            work[q, 0], work[q, 1], work[q, 2], False,
                        )  # fmt: skip
                        found[FLOOR] = min(found[FLOOR], found_least)
                    elif is_stationary and d <= found[LIMIT]:
                        is_inside, is_near = stays_inside(shapes, trims, k, u, v)
                        if is_inside or is_near:
                            offer(
                                found, shapes, k, piece, d, slack, u, v,
                                work[q, 0], work[q, 1], work[q, 2], is_near,
                            )  # fmt: skip
                            found[FLOOR] = min(found[FLOOR], found_least)
                    break
        if d1 == 0.0 and d2 == 0.0 and step > 0:
            break
        s, t = min(max(s + d1, a0), a1), min(max(t + d2, b0), b1)
    if is_done:
        return size
    # Halve it, where it bends most.
    r1, r2 = 0.5 * (a1 - a0), 0.5 * (b1 - b0)
    if max(bu * r1, bv * r2) < SMALLEST_PART:
        found[FLOOR] = min(found[FLOOR], least)
        found[SEVERAL_AT] = 1.0
        return size
    off_u, off_v = buu * r1 * r1, bvv * r2 * r2
    along_u = bu * r1 >= bv * r2 if max(off_u, off_v) < buv * r1 * r2 else off_u >= off_v
    for side in range(2):
        c0, c1, e0, e1 = a0, a1, b0, b1
        if along_u:
            c0, c1 = (a0, a0 + r1) if side == 0 else (a0 + r1, a1)
        else:
            e0, e1 = (b0, b0 + r2) if side == 0 else (b0 + r2, b1)
        w1, w2 = 0.5 * (c1 - c0), 0.5 * (e1 - e0)
        s, t = c0 + w1, e0 + w2
        now = state
        if state != tb.WHOLE:
            now = side_of_part(
                shapes, trims, k, u0 + hu * (1.0 + c0), u0 + hu * (1.0 + c1),
                v0 + hv * (1.0 + e0), v0 + hv * (1.0 + e1),
            )  # fmt: skip
            if now > tb.CUT:
                continue
        sheet_at(shapes, k, u0 + hu * (1.0 + s), v0 + hv * (1.0 + t), work)
        f, g = hu * w1, hv * w2
        low, _, i, j = from_parallelogram(
            work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz,
            f * work[q + 1, 0], f * work[q + 1, 1], f * work[q + 1, 2],
            g * work[q + 2, 0], g * work[q + 2, 1], g * work[q + 2, 2],
        )  # fmt: skip
        low -= 0.5 * buu * w1 * w1 + buv * w1 * w2 + 0.5 * bvv * w2 * w2 + slack
        low = max(low, least)
        size = keep(found, heap, size, low, row, c0, c1, e0, e1, s + i * w1, t + j * w2, now)
    return size


@inner
def curve_of_cell(shapes, row, kind, s, work):
    """Fill three rows with a curve of a cell at t = s, by its own parameter; return the first, and u, v."""
    cell, k = shapes.cell, shapes.cell_id[row, tb.SHEET]
    if kind == tb.EDGE:
        at = cell[row, tb.BOX] + 0.5 * (cell[row, tb.BOX + 1] - cell[row, tb.BOX]) * (1.0 + s)
        u, v = edge_at(
            shapes, k, shapes.cell_id[row, tb.ARC], shapes.cell_id[row, tb.DEGREE], at, work
        )
        return CURVE_POINT, u, v
    v = cell[row, tb.BOX + 2] + 0.5 * (cell[row, tb.BOX + 3] - cell[row, tb.BOX + 2]) * (1.0 + s)
    profile_at(shapes, k, v, work)
    return PROFILE_POINT, 0.0, v


@inner
def toward(cell, row, column, x, y):
    """Return the direction between two of a cell that is nearest to (x, y), and whether that is its own."""
    size = np.sqrt(x * x + y * y)
    c0, s0 = cell[row, column], cell[row, column + 1]
    c1, s1 = cell[row, column + 2], cell[row, column + 3]
    band = -4.0 * ROUNDOFF * size
    if c0 * y - s0 * x >= band and x * s1 - y * c1 >= band:
        return (x / size, y / size, True) if size > 0.0 else (c0, s0, True)
    if c0 * x + s0 * y >= c1 * x + s1 * y:
        return c0, s0, False
    return c1, s1, False


@inner
def place_on_turned(shapes, k, c, s, z, r):
    """Return the point at an azimuth of a turned sheet, and its u."""
    number = shapes.sheet
    x = number[k, tb.FRAME] + z * number[k, tb.FRAME + 9]
    y = number[k, tb.FRAME + 1] + z * number[k, tb.FRAME + 10]
    w = number[k, tb.FRAME + 2] + z * number[k, tb.FRAME + 11]
    x += r * (c * number[k, tb.FRAME + 3] + s * number[k, tb.FRAME + 6])
    y += r * (c * number[k, tb.FRAME + 4] + s * number[k, tb.FRAME + 7])
    w += r * (c * number[k, tb.FRAME + 5] + s * number[k, tb.FRAME + 8])
    way = number[k, tb.TURN + 1] - number[k, tb.TURN]
    # From the beginning of the turn, in its sense; just before it is 0, not nearly a whole turn.
    angle = np.arctan2(s, c) - number[k, tb.TURN]
    angle -= 2.0 * np.pi * np.floor(angle / (2.0 * np.pi))
    if angle > 0.5 * (abs(way) + 2.0 * np.pi):
        angle -= 2.0 * np.pi
    return x, y, w, min(max(angle / way, 0.0), 1.0)


@inner
def offer_on_curve(shapes, trims, row, kind, c, s, d, slack, u, v, x, y, z, least, found):
    """Offer a point of a curve cell that is the nearest of its part, or of a turned one at an azimuth."""
    k, state = shapes.cell_id[row, tb.SHEET], shapes.cell_id[row, tb.STATE]
    if d > found[LIMIT]:
        return
    is_edge = kind == tb.EDGE
    if not is_edge:
        x, y, z, u = place_on_turned(shapes, k, c, s, x, y)
    if state == tb.CUT:
        is_inside, is_near = stays_inside(shapes, trims, k, u, v)
        if not (is_inside or is_near):
            return
        is_edge = is_edge or is_near
    piece = shapes.sheet_id[k, tb.PIECE]
    offer(found, shapes, k, piece, d, slack, u, v, x, y, z, is_edge)
    found[FLOOR] = min(found[FLOOR], least)


@inner
def search_curve(shapes, trims, row, p, slack, found, heap, size, work):
    """Look into a cell of an edge, or into a turned one in the half plane of the azimuth nearest to p.

    Or into the part of one that is behind the heap: then ``row`` is -1. Returns the heap's size.
    """
    is_whole = row >= 0
    if not is_whole:
        row = np.int64(heap[HEAP, OF_CELL])
    cell, k, state = shapes.cell, shapes.cell_id[row, tb.SHEET], shapes.cell_id[row, tb.STATE]
    kind = shapes.cell_id[row, tb.KIND]
    px, py, pz, more = p[0], p[1], p[2], 0.0
    cu, su, is_own = 1.0, 0.0, True
    if kind == tb.TURNED:
        number = shapes.sheet
        x, y, w = (
            px - number[k, tb.FRAME],
            py - number[k, tb.FRAME + 1],
            pz - number[k, tb.FRAME + 2],
        )
        a = x * number[k, tb.FRAME + 3] + y * number[k, tb.FRAME + 4] + w * number[k, tb.FRAME + 5]
        b = x * number[k, tb.FRAME + 6] + y * number[k, tb.FRAME + 7] + w * number[k, tb.FRAME + 8]
        px = (
            x * number[k, tb.FRAME + 9]
            + y * number[k, tb.FRAME + 10]
            + w * number[k, tb.FRAME + 11]
        )
        cu, su, is_own = toward(cell, row, tb.AZIMUTH, a, b)
        if state == tb.CUT and not is_own:
            return size
        py, pz = cu * a + su * b, 0.0
        across = su * a - cu * b
        more = 0.0 if is_own else across * across
        if shapes.sheet_id[k, tb.FORM] == tb.CIRCLE:
            z, r = number[k, tb.PROFILE], number[k, tb.PROFILE + 1]
            radius = number[k, tb.PROFILE + 2]
            x, y = py - r, px - z
            c, s, is_there = toward(cell, row, tb.TUBE, x, y)
            if state == tb.CUT and not is_there:
                return size
            away = np.sqrt(x * x + y * y)
            if is_there:
                d = np.sqrt((away - radius) ** 2 + more)
            else:
                d = np.sqrt((x - radius * c) ** 2 + (y - radius * s) ** 2 + more)
            if d > found[LIMIT]:
                return size
            angle = np.arctan2(s, c) - number[k, tb.PROFILE + 3]
            way = number[k, tb.PROFILE + 4] - number[k, tb.PROFILE + 3]
            # Within the arc of this cell, a turn more or less.
            middle = 0.5 * (cell[row, tb.BOX + 2] + cell[row, tb.BOX + 3]) * way
            angle += 2.0 * np.pi * np.floor((middle - angle) / (2.0 * np.pi) + 0.5)
            v = min(max(angle / way, 0.0), 1.0)
            z, r = z + radius * s, r + radius * c
            offer_on_curve(shapes, trims, row, kind, cu, su, d, slack, 0.0, v, z, r, 0.0, d, found)
            note_rings(found, k, d, slack, away, radius, abs(py), r)
            return size
    b1, b2, b3 = cell[row, tb.BOUNDS], cell[row, tb.BOUNDS + 1], cell[row, tb.BOUNDS + 2]
    least, a0, a1, s = (
        heap[HEAP, LEAST],
        heap[HEAP, SIDES],
        heap[HEAP, SIDES + 1],
        heap[HEAP, START],
    )
    if is_whole:
        least, most, s, _ = from_parallelogram(
            cell[row, tb.MIDDLE] - px, cell[row, tb.MIDDLE + 1] - py, cell[row, tb.MIDDLE + 2] - pz,
            cell[row, tb.ALONG_U], cell[row, tb.ALONG_U + 1], cell[row, tb.ALONG_U + 2], 0.0, 0.0, 0.0,
        )  # fmt: skip
        off, a0, a1 = cell[row, tb.OFF] + slack, -1.0, 1.0
        least = max(least - off, 0.0)
        least = np.sqrt(least * least + more)
        if least > found[LIMIT]:
            return size
        if state == tb.WHOLE:
            found[LIMIT] = min(found[LIMIT], np.sqrt((most + off) ** 2 + more) + slack)
    half = 0.5 * (
        cell[row, tb.BOX + 1] - cell[row, tb.BOX]
        if kind == tb.EDGE
        else cell[row, tb.BOX + 3] - cell[row, tb.BOX + 2]
    )
    is_done = False
    for step in range(NEWTON_STEPS):
        q, u, v = curve_of_cell(shapes, row, kind, s, work)
        x, y, z = work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz
        f = x * x + y * y + z * z + more
        d = np.sqrt(f)
        g = half * (x * work[q + 1, 0] + y * work[q + 1, 1] + z * work[q + 1, 2])
        j = work[q + 1, 0] ** 2 + work[q + 1, 1] ** 2 + work[q + 1, 2] ** 2
        j *= half * half
        h = j + half * half * (x * work[q + 2, 0] + y * work[q + 2, 1] + z * work[q + 2, 2])
        curvature = h if h > 0.0 else j
        to = min(max(s - g / curvature, a0), a1) - s if curvature > 0.0 else 0.0
        if b1 * (a1 - a0) <= slack:  # a point
            offer_on_curve(
                shapes, trims, row, kind, cu, su, d, slack, u, v,
                work[q, 0], work[q, 1], work[q, 2], d - slack, found,
            )  # fmt: skip
            is_done = True
            break
        r = max(a1 - s, s - a0)
        e = (3.0 * b1 * b2 + (d + b1 * r) * b3) * r
        if state == tb.CUT and abs(g) > (abs(h) + 0.5 * e) * r:
            is_done = True  # nowhere stationary
            if kind == tb.EDGE:  # the end of a border may be one of the surface
                q, u, v = curve_of_cell(shapes, row, kind, a0 if g > 0.0 else a1, work)
                x, y, z = work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz
                d = np.sqrt(x * x + y * y + z * z)
                offer_on_curve(
                    shapes, trims, row, kind, cu, su, d, slack, u, v,
                    work[q, 0], work[q, 1], work[q, 2], d, found,
                )  # fmt: skip
            break
        if abs(to) <= FINAL_STEP:
            is_pushed = (s == a0 and g > 0.0) or (s == a1 and g < 0.0)
            counts = state == tb.WHOLE or d > found[DISTANCE] + 2.0 * slack
            m = h - (e / 3.0 if counts else e)
            if is_pushed and counts:
                m += 2.0 * abs(g) / r
            if not m > 0.0:
                break
            loss = 0.0 if is_pushed else g * g / m
            is_exact = d - np.sqrt(max(f - loss, 0.0)) <= slack
            if is_exact or (step > NEWTON_STEPS - 4 and state == tb.WHOLE):
                is_done = True
                # Of a cut turned cell only what is stationary counts.
                if kind == tb.TURNED and state == tb.CUT and is_pushed and g * g > 2.0**-40 * m * j:
                    break
                least = np.sqrt(max(f - loss, 0.0))
                if least > found[LIMIT]:
                    break
                q, u, v = curve_of_cell(shapes, row, kind, s + to, work)
                x, y, z = work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz
                d, r = np.sqrt(x * x + y * y + z * z + more), work[q, 1]
                offer_on_curve(
                    shapes, trims, row, kind, cu, su, d, slack, u, v,
                    work[q, 0], work[q, 1], work[q, 2], least, found,
                )  # fmt: skip
                if kind == tb.TURNED:
                    note_rings(found, k, d, slack, np.inf, 0.0, abs(py), r)
                break
        if to == 0.0 and step > 0:
            break
        s = min(max(s + to, a0), a1)
    if is_done:
        return size
    if state == tb.WHOLE:  # any point will do as an upper bound
        offer_on_curve(
            shapes, trims, row, kind, cu, su, d, slack, u, v,
            work[q, 0], work[q, 1], work[q, 2], np.inf, found,
        )  # fmt: skip
    w = 0.5 * (a1 - a0)
    if b1 * w < SMALLEST_PART:
        found[FLOOR] = min(found[FLOOR], least)
        found[SEVERAL_AT] = 1.0
        return size
    for side in range(2):
        c0 = a0 if side == 0 else a0 + w
        c1 = a0 + w if side == 0 else a1
        middle, wide = 0.5 * (c0 + c1), 0.5 * (c1 - c0)
        if state == tb.CUT:
            _, u0, v0 = curve_of_cell(shapes, row, kind, c0, work)
            _, u1, v1 = curve_of_cell(shapes, row, kind, c1, work)
            if kind == tb.TURNED:
                _, _, _, u0 = place_on_turned(shapes, k, cu, su, 0.0, 0.0)
                u1 = u0
            low_u, low_v = min(u0, u1), min(v0, v1)
            high_u, high_v = max(u0, u1), max(v0, v1)
            if side_of_part(shapes, trims, k, low_u, high_u, low_v, high_v) > tb.CUT:
                continue
        q, u, v = curve_of_cell(shapes, row, kind, middle, work)
        f = half * wide
        low, _, i, _ = from_parallelogram(
            work[q, 0] - px, work[q, 1] - py, work[q, 2] - pz,
            f * work[q + 1, 0], f * work[q + 1, 1], f * work[q + 1, 2], 0.0, 0.0, 0.0,
        )  # fmt: skip
        low = max(low - 0.5 * b2 * wide * wide - slack, 0.0)
        low = max(np.sqrt(low * low + more), least)
        size = keep(found, heap, size, low, row, c0, c1, 0.0, 0.0, middle + i * wide, 0.0, state)
    return size


@inner
def note_rings(found, k, d, slack, away, radius, off_axis, r):
    """Note that a whole circle is as near as what was found: about p on the axis, or on the centre of an arc."""
    apart = SAME_PLACE * np.sqrt(slack * (d + slack))
    is_ring = (away <= slack and radius > apart) or (off_axis * r <= slack * d and r > apart)
    if is_ring and found[OF_SHEET] == k and d <= found[LIMIT]:
        found[SEVERAL_AT] = 1.0


@inner
def search_triangle(shapes, row, p, slack, found):
    """Search a triangle: the foot of the perpendicular, or the nearest point of its sides."""
    cell, k = shapes.cell, shapes.cell_id[row, tb.SHEET]
    x, y, z = (
        cell[row, tb.MIDDLE] - p[0],
        cell[row, tb.MIDDLE + 1] - p[1],
        cell[row, tb.MIDDLE + 2] - p[2],
    )
    ax, ay, az = cell[row, tb.ALONG_U], cell[row, tb.ALONG_U + 1], cell[row, tb.ALONG_U + 2]
    bx, by, bz = cell[row, tb.ALONG_V], cell[row, tb.ALONG_V + 1], cell[row, tb.ALONG_V + 2]
    aa, ab = ax * ax + ay * ay + az * az, ax * bx + ay * by + az * bz
    bb, ga, gb = bx * bx + by * by + bz * bz, x * ax + y * ay + z * az, x * bx + y * by + z * bz
    det = aa * bb - ab * ab
    s, t = ab * gb - bb * ga, ab * ga - aa * gb
    # The foot, then the sides: along a, along b, and from the end of a to that of b.
    best, least, i, j, is_edge = np.inf, 0.0, 0.0, 0.0, False
    for side in range(4):
        if side == 0:
            if not (s > 0.0 and t > 0.0 and s + t < det):
                continue
            u, v = s / det, t / det
        else:
            cx, cy, cz, cc, g = ax, ay, az, aa, ga
            if side == 2:
                cx, cy, cz, cc, g = bx, by, bz, bb, gb
            elif side == 3:
                cx, cy, cz = bx - ax, by - ay, bz - az
                cc = cx * cx + cy * cy + cz * cz
                g = (x + ax) * cx + (y + ay) * cy + (z + az) * cz
            at = min(max(-g / cc, 0.0), 1.0) if cc > 0.0 else 0.0
            u = at if side == 1 else (0.0 if side == 2 else 1.0 - at)
            v = 0.0 if side == 1 else at
        dx, dy, dz = x + u * ax + v * bx, y + u * ay + v * by, z + u * az + v * bz
        d = np.sqrt(dx * dx + dy * dy + dz * dz)
        if d < best:
            # Convex: no other point is nearer than by what the slopes toward the corners allow.
            qa, qb = dx * ax + dy * ay + dz * az, dx * bx + dy * by + dz * bz
            loss = u * qa + v * qb - min(0.0, qa, qb)
            best, i, j, is_edge = d, u, v, side > 0
            least = max(d - loss / d, 0.0) if d > 0.0 else 0.0
        if best - least <= slack:
            break
    x, y, z = x + i * ax + j * bx + p[0], y + i * ay + j * by + p[1], z + i * az + j * bz + p[2]
    offer(found, shapes, k, shapes.cell_id[row, tb.ARC], best, slack, i, j, x, y, z, is_edge)
    if best <= found[LIMIT]:
        found[FLOOR] = min(found[FLOOR], least)


@inner
def open_node(rows, links, node, p, limit, todo, at, top):
    """Put the children of a node that are within a distance on the stack, the nearest on top; leaves below 0."""
    first = top
    for child in range(WIDTH):
        square = 0.0
        for axis in range(3):
            a = np.float64(rows[node, axis, child]) - p[axis]
            b = p[axis] - np.float64(rows[node, 3 + axis, child])
            away = max(a, b, 0.0)
            square += away * away
        if not square <= limit * limit:
            continue
        place = top
        while place > first and at[place - 1] < square:
            at[place], todo[place] = at[place - 1], todo[place - 1]
            place -= 1
        at[place] = square
        is_leaf = links[node, COUNT, child] > 0
        todo[place] = -1 - (node * WIDTH + child) if is_leaf else links[node, CHILD, child]
        top += 1
    return top


@inner
def search_group(shapes, trims, groups, root, p, slack, found, heap, work, todo, at):
    """Search the cells of a group for what is nearer to p than ``found``, all in its frame.

    Each cell once, as the tree leads to it, then what is left of them.
    """
    top, todo[0], at[0], size = 1, root, 0.0, 0
    while top > 0:
        top -= 1
        limit, node = found[LIMIT], todo[top]
        if at[top] > limit * limit:
            continue
        if node >= 0:
            top = open_node(groups.rows, groups.links, node, p, limit, todo, at, top)
            continue
        parent, child = (-1 - node) // WIDTH, (-1 - node) % WIDTH
        begin = groups.links[parent, CHILD, child]
        for i in range(begin, begin + groups.links[parent, COUNT, child]):
            row = np.int64(groups.order[i])
            kind = shapes.cell_id[row, tb.KIND]
            if kind == tb.PATCH:
                if least_in_patch(shapes, row, p, slack, found, heap):
                    size = search_patch(shapes, trims, p, slack, found, heap, size, work)
            elif kind == tb.TRIANGLE:
                search_triangle(shapes, row, p, slack, found)
            else:
                size = search_curve(shapes, trims, row, p, slack, found, heap, size, work)
    for _ in range(MOST_PARTS):
        if size == 0 or heap[0, LEAST] > found[LIMIT]:
            return
        size = pop(heap, size)
        if shapes.cell_id[np.int64(heap[HEAP, OF_CELL]), tb.KIND] == tb.PATCH:
            size = search_patch(shapes, trims, p, slack, found, heap, size, work)
        else:
            size = search_curve(shapes, trims, np.int64(-1), p, slack, found, heap, size, work)
    if size > 0:
        found[FLOOR] = min(found[FLOOR], heap[0, LEAST])


@inner
def search_place(shapes, trims, groups, place, points, i, answers, found, p, heap, work, todo, at):
    """Search one place for what is nearer to point i than the answer so far, and take it."""
    move, unit = groups.place, groups.place[place, 12]
    x, y, z = (
        points[i, 0] - move[place, 9],
        points[i, 1] - move[place, 10],
        points[i, 2] - move[place, 11],
    )
    far = 2.0
    for axis in range(3):
        k = 3 * axis
        p[axis] = move[place, k] * x + move[place, k + 1] * y + move[place, k + 2] * z
        far += abs(p[axis])
    error = move[place, 13] + (ROUNDINGS * ROUNDOFF + move[place, 14]) * far
    slack = SLACK * error
    found[DISTANCE] = answers.distance[i] / unit + 2.0 * slack
    found[FLOOR], found[SEVERAL_AT], found[OF_SHEET] = np.inf, 0.0, -1.0
    found[LIMIT] = found[DISTANCE] + slack
    root = groups.root[groups.group[place]]
    search_group(shapes, trims, groups, root, p, slack, found, heap, work, todo, at)
    least = min(found[FLOOR], found[DISTANCE]) * unit
    if found[OF_SHEET] < 0.0:
        answers.least[i] = min(answers.least[i], least)
        return
    d, off = found[DISTANCE] * unit, 2.0 * error * unit
    x, y, z = found[X], found[Y], found[Z]
    # Lengths of the matrix are 1 / unit.
    square = unit * unit
    wx = square * (move[place, 0] * x + move[place, 3] * y + move[place, 6] * z) + move[place, 9]
    wy = square * (move[place, 1] * x + move[place, 4] * y + move[place, 7] * z) + move[place, 10]
    wz = square * (move[place, 2] * x + move[place, 5] * y + move[place, 8] * z) + move[place, 11]
    sheet = np.int64(found[OF_SHEET])
    thing = shapes.sheet_id[sheet, tb.OBJECT]
    if take(
        answers, i, d, least, off, found[SEVERAL_AT] > 0.0, wx, wy, wz, found[U], found[V], thing
    ):
        answers.sheet[i], answers.place[i] = sheet, place
        answers.piece[i], answers.on_edge[i] = np.int64(found[OF_PIECE]), found[ON_EDGE] > 0.0


@inner
def take(answers, i, d, least, off, several, x, y, z, u, v, thing):
    """Take a point of an object as the answer, and tell so, if it is the nearest so far."""
    best = answers.distance[i]
    slack = SLACK * max(off, answers.error[i])
    answers.least[i] = min(answers.least[i], least)
    if d > best + slack:
        return False
    if best < np.inf and d >= best - slack:
        dx, dy = x - answers.position[i, 0], y - answers.position[i, 1]
        dz = z - answers.position[i, 2]
        apart = dx * dx + dy * dy + dz * dz > SAME_PLACE * SAME_PLACE * slack * (d + slack)
        answers.several[i] = answers.several[i] or several or apart
    else:
        answers.several[i] = several
    answers.error[i] = max(answers.error[i], off)
    if d > best or (d == best and thing >= answers.thing[i]):
        return False
    answers.distance[i], answers.u[i], answers.v[i], answers.thing[i] = d, u, v, thing
    answers.position[i, 0], answers.position[i, 1], answers.position[i, 2] = x, y, z
    answers.sheet[i] = answers.place[i] = -1
    answers.piece[i], answers.on_edge[i] = 0, False
    return True


@kernel(allocates=True)
def closest_points(shapes, trims, groups, planes, points, answers):
    """Find the closest points of points (n, 3): see `Answers`.

    ``planes`` (m, 8): a point and the unit normal of each unbounded one, its object, and its error.
    """
    heap, work = np.empty((HEAP + 1, HEAP_COLUMNS)), np.empty((SCRATCH_ROWS, SCRATCH_COLUMNS))
    found, p = np.zeros(FOUND), np.empty(3)
    depth = groups.depth
    todo, at = np.empty(depth, np.int64), np.empty(depth)
    above, apart = np.empty(depth, np.int64), np.empty(depth)
    q = np.empty(3)
    for i in range(points.shape[0]):
        answers.distance[i] = answers.least[i] = np.inf
        answers.error[i], answers.several[i], answers.sheet[i] = 0.0, False, -1
        for k in range(planes.shape[0]):
            d = size = 0.0
            for axis in range(3):
                q[axis] = points[i, axis] - planes[k, axis]
                d += q[axis] * planes[k, 3 + axis]
                size += abs(q[axis]) + abs(planes[k, axis])
            off = planes[k, 7] * (1.0 + size) + 8.0 * ROUNDOFF * size
            take(
                answers, i, abs(d), abs(d), off, False, points[i, 0] - d * planes[k, 3],
                points[i, 1] - d * planes[k, 4], points[i, 2] - d * planes[k, 5], 0.0, 0.0,
                np.int64(planes[k, 6]),
            )  # fmt: skip
        if groups.group.shape[0] == 0:
            continue
        # The tree over places is in a frame of its own.
        for axis in range(3):
            q[axis] = (points[i, axis] - groups.frame[axis]) / groups.frame[3]
        top, above[0], apart[0] = 1, 0, 0.0
        while top > 0:
            top -= 1
            limit, node = answers.distance[i] / groups.frame[3], above[top]
            limit += 2.0**-40 * (1.0 + limit)
            if apart[top] > limit * limit:
                continue
            if node >= 0:
                top = open_node(
                    groups.top_rows, groups.top_links, node, q, limit, above, apart, top
                )
                continue
            parent, child = (-1 - node) // WIDTH, (-1 - node) % WIDTH
            begin = groups.top_links[parent, CHILD, child]
            for j in range(begin, begin + groups.top_links[parent, COUNT, child]):
                place = np.int64(groups.top_order[j])
                search_place(
                    shapes, trims, groups, place, points, i, answers, found, p, heap, work, todo, at
                )
