"""Which side of closed loops of rational Bezier arcs a point of the plane is on.

The arcs are cut into pieces along which both coordinates are monotone, with end points that
neighbours share bit for bit. Parity is that of the pieces to the right of the point: a piece counts
where ``low <= v < high`` of its end points, so it is defined for every point, vertices and horizontal
pieces included. Inside the box of a piece its parameter is halved until the point is beside the box
of what is left (Schollmeyer and Froehlich, "Direct trimming of NURBS surfaces on the GPU", SIGGRAPH
2009). Everything is computed on the arcs as given, so no error grows with the number of halvings.
"""

from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import inlined, inner, kernel

# What a tile of the map is known to be: the point sets of the sides, or asked piece by piece.
OUTSIDE, INSIDE, CROSSED = 0, 1, 2
# Columns of `TrimTable.piece`: parameter and place of the lower end, then of the upper; its part of the gap.
S_LOW, X_LOW, Y_LOW, S_HIGH, X_HIGH, Y_HIGH, GAP_SHARE = 0, 1, 2, 3, 4, 5, 6
# Columns of `TrimTable.member`.
FIRST_SLAB, N_SLABS, FIRST_TILE, N_TILES, N_PIECES = 0, 1, 2, 3, 4
# The border u = 1 or v = 1 is asked this far inside, u = 0 and v = 0 as well: less than rounding.
WITHIN = 2.0**-53
# So far from a straight piece at their height, besides their rectangle, points are beside it whatever rounding does.
BESIDE_LINE = 2.0**-46
# Chords that a piece of curve near a point is measured by, and how often: the part shrinks to 3/8 each
# time, its sagitta to 1/7, so to 2e-9 of what the box holds.
CHORDS, PASSES = 8, 10


class TrimTable(NamedTuple):
    """Loops of one or more trimmed surfaces."""

    net: Any  # (total, 3) float64: w x, w y, w of the arcs, the largest w of each in [1/2, 1)
    arc: Any  # (p, 2) int64: first row in `net` and degree of the arc of each piece
    piece: Any  # (p, 7) float64
    slab: Any  # (s + 1,) int64: where the pieces of each slab of v begin in `listed`
    listed: Any  # (l,) int32
    tile: Any  # (t,) uint8: OUTSIDE, INSIDE or CROSSED
    member: Any  # (m, 5) int64: first slab, slabs, first tile, tiles per side, pieces
    error: Any  # (m,) float64: bound on the rounding of a point of an arc, and of (u, v)


@inner
def point_of_arc(net, start, degree, s):
    """Return x and y at s, by Horner's scheme in Bernstein form: only sums of weighted terms.

    With positive weights the terms of numerator and denominator carry at most 4 n + 5 roundings
    each, so the quotient is off by at most (8 n + 12) u max |x|.
    """
    r = 1.0 - s
    x, y, w = net[start, 0] * r, net[start, 1] * r, net[start, 2] * r
    h = 1.0
    for i in range(1, degree):
        h = h * s * (degree - i + 1) / i
        k = start + i
        x = (x + h * net[k, 0]) * r
        y = (y + h * net[k, 1]) * r
        w = (w + h * net[k, 2]) * r
    h = h * s / degree if degree > 1 else s
    k = start + degree
    x += h * net[k, 0]
    y += h * net[k, 1]
    w += h * net[k, 2]
    return x / w, y / w


@inner
def point_of_piece(table, p, s):
    """Return the point of piece p at s, within the box of the piece."""
    piece = table.piece
    x, y = point_of_arc(table.net, table.arc[p, 0], table.arc[p, 1], s)
    x_low, x_high = piece[p, X_LOW], piece[p, X_HIGH]
    x = min(max(x, min(x_low, x_high)), max(x_low, x_high))
    return x, min(max(y, piece[p, Y_LOW]), piece[p, Y_HIGH])


@inner
def side_of_piece(table, p, u, v, du, dv):
    """Tell whether the piece is crossed to the right of (u, v), and whether it may be near.

    Near: it may enter the rectangle of half sides du and dv about the point.
    """
    piece = table.piece
    a, xa, ya = piece[p, S_LOW], piece[p, X_LOW], piece[p, Y_LOW]
    b, xb, yb = piece[p, S_HIGH], piece[p, X_HIGH], piece[p, Y_HIGH]
    if v < ya - dv or v > yb + dv or u > max(xa, xb) + du:
        return False, False
    straddles = ya <= v < yb
    if u < min(xa, xb) - du:
        return straddles, False
    is_near = v <= ya + dv or v >= yb - dv
    if not straddles:
        return False, True
    if table.arc[p, 1] == 1:
        slope = (xb - xa) / (yb - ya)
        x = xa + (v - ya) * slope
        if abs(u - x) > du + abs(slope) * dv + BESIDE_LINE:
            return u < x, is_near
    while True:
        low, high = min(xa, xb), max(xa, xb)
        if u < low and (is_near or u < low - du):
            return True, is_near
        if u >= high and (is_near or u > high + du):
            return False, is_near
        m = 0.5 * (a + b)
        if m in (a, b):
            return u < high, True
        x, y = point_of_piece(table, p, m)
        if abs(v - y) <= dv:
            is_near = True
        if v < y:
            b, xb = m, x
        else:
            a, xa = m, x


@inner
def first_beyond(table, p, limit, of_x, grows):
    """Return the s of a piece from its lower end on from which x or y is beyond a limit."""
    a, b = table.piece[p, S_LOW], table.piece[p, S_HIGH]
    while True:
        m = 0.5 * (a + b)
        if m in (a, b):
            return m
        x, y = point_of_piece(table, p, m)
        value = x if of_x else y
        if (value >= limit) == grows:
            b = m
        else:
            a = m


@inner
def part_in_box(table, p, u, v, du, dv):
    """Return the range of s of a piece inside a rectangle: meets, from, to."""
    piece = table.piece
    a, xa, ya = piece[p, S_LOW], piece[p, X_LOW], piece[p, Y_LOW]
    b, xb, yb = piece[p, S_HIGH], piece[p, X_HIGH], piece[p, Y_HIGH]
    if v + dv < ya or v - dv > yb or u + du < min(xa, xb) or u - du > max(xa, xb):
        return False, a, b
    forward = 1.0 if b >= a else -1.0
    first, last = a, b
    if ya < v - dv:
        first = first_beyond(table, p, v - dv, False, True)
    if yb > v + dv:
        last = first_beyond(table, p, v + dv, False, True)
    grows = xb >= xa
    near, far = (u - du, u + du) if grows else (u + du, u - du)
    if (xa < near) if grows else (xa > near):
        s = first_beyond(table, p, near, True, grows)
        first = s if (s - first) * forward > 0.0 else first
    if (xb > far) if grows else (xb < far):
        s = first_beyond(table, p, far, True, grows)
        last = s if (s - last) * forward < 0.0 else last
    return (last - first) * forward >= 0.0, first, last


@inner
def gap_to_piece(table, p, u, v, du, dv, px, py, pz, qx, qy, qz):
    """Return the least square of |a p + b q|, (a, b) from (u, v) to a piece within a box.

    The part of the piece in the box is measured by its chords, then the part around the nearest of
    these in the same way, and so on: seen nearly along the surface, the box is long and narrow.
    """
    meets, first, last = part_in_box(table, p, u, v, du, dv)
    least = np.inf
    if not meets:
        return least
    chords = 1 if table.arc[p, 1] == 1 else CHORDS
    for _ in range(1 if chords == 1 else PASSES):
        step = (last - first) / chords
        x, y = point_of_piece(table, p, first)
        x, y = x - u, y - v
        ax, ay, az = x * px + y * qx, x * py + y * qy, x * pz + y * qz
        least, nearest = ax * ax + ay * ay + az * az, 0
        for k in range(1, chords + 1):
            x, y = point_of_piece(table, p, first + k * step)
            x, y = x - u, y - v
            bx, by, bz = x * px + y * qx, x * py + y * qy, x * pz + y * qz
            cx, cy, cz = bx - ax, by - ay, bz - az
            run = cx * cx + cy * cy + cz * cz
            if run > 0.0:
                at = min(max(-(ax * cx + ay * cy + az * cz) / run, 0.0), 1.0)
                ax, ay, az = ax + at * cx, ay + at * cy, az + at * cz
                square = ax * ax + ay * ay + az * az
                if square < least:
                    least, nearest = square, k - 1
            ax, ay, az = bx, by, bz
        # The nearest chord and its neighbours.
        begin = first + max(nearest - 1, 0) * step
        last = first + min(nearest + 2, chords) * step
        first = begin
    return least


@inlined
def slab_of(table, m, v):
    """Return the slab that holds v."""
    n = table.member[m, N_SLABS]
    return table.member[m, FIRST_SLAB] + min(max(np.int64(v * n), 0), n - 1)


@inlined
def tile_of(table, m, u, v, du, dv):
    """Return what the map knows of a point and the rectangle about it."""
    n = table.member[m, N_TILES]
    if du * n > 0.5 or dv * n > 0.5:
        return CROSSED
    return state_of_tile(table, m, u, v)


@inlined
def state_of_tile(table, m, u, v):
    """Return what the map knows of the points within half a tile of a point."""
    n = table.member[m, N_TILES]
    a, b = min(max(np.int64(u * n), 0), n - 1), min(max(np.int64(v * n), 0), n - 1)
    return np.int64(table.tile[table.member[m, FIRST_TILE] + a * n + b])


@inner
def classify(table, m, u, v, du, dv):
    """Tell on which side of the loops of member m a point of the unit square is.

    ``du``, ``dv``: half sides of a rectangle about it; what rounding makes of the curves is added.
    Returns ``is_inside``: whether parity is odd.
    ``may_be_near``: whether a curve may enter the rectangle, see `is_entered`; if not, the side is certain.
    """
    u, v = min(max(u, WITHIN), 1.0 - WITHIN), min(max(v, WITHIN), 1.0 - WITHIN)
    du += table.error[m]
    dv += table.error[m]
    state = tile_of(table, m, u, v, du, dv)
    if state != CROSSED:
        return state == INSIDE, False
    parity = may_be_near = False
    slab = slab_of(table, m, v)
    for k in range(table.slab[slab], table.slab[slab + 1]):
        crosses, is_near = side_of_piece(table, np.int64(table.listed[k]), u, v, du, dv)
        parity ^= crosses
        may_be_near |= is_near
    # Pieces are listed in slabs half of one beyond their ends.
    return parity, may_be_near or 2.0 * dv * table.member[m, N_SLABS] > 1.0


@inner
def gap_to_loops(table, m, u, v, du, dv, px, py, pz, qx, qy, qz):
    """Return the distance of a point from the loops in space: inf where no curve is in the box.

    A step of 1 in u is the vector p there, one in v is q.
    """
    u, v = min(max(u, WITHIN), 1.0 - WITHIN), min(max(v, WITHIN), 1.0 - WITHIN)
    du += table.error[m]
    dv += table.error[m]
    least = np.inf
    for slab in range(slab_of(table, m, v - dv), slab_of(table, m, v + dv) + 1):
        for k in range(table.slab[slab], table.slab[slab + 1]):
            p = np.int64(table.listed[k])
            least = min(least, gap_to_piece(table, p, u, v, du, dv, px, py, pz, qx, qy, qz))
    return np.sqrt(least)


@inner
def is_entered(table, m, u, v, du, dv):
    """Tell whether a curve enters a rectangle, or passes it within rounding.

    What `classify` says of that is true of the boxes of curves alone: those of the quadrants of a circle meet at
    its centre.
    """
    return gap_to_loops(table, m, u, v, du, dv, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0) < np.inf


@inner
def widest_reach(table, m, u, v, du, dv, px, py, pz, qx, qy, qz, reach):
    """Return the largest reach of the curves that are within theirs of a point; 0: of none.

    A curve's is its part of ``reach``; as far in space lead du in u and dv in v. See `gap_to_loops`.
    """
    u, v = min(max(u, WITHIN), 1.0 - WITHIN), min(max(v, WITHIN), 1.0 - WITHIN)
    error, widest = table.error[m], 0.0
    for slab in range(slab_of(table, m, v - dv - error), slab_of(table, m, v + dv + error) + 1):
        for k in range(table.slab[slab], table.slab[slab + 1]):
            p = np.int64(table.listed[k])
            share = table.piece[p, GAP_SHARE]
            own = share * reach
            if own > widest:
                eu, ev = share * du + error, share * dv + error
                if gap_to_piece(table, p, u, v, eu, ev, px, py, pz, qx, qy, qz) <= own * own:
                    widest = own
    return widest


@kernel
def points_of_arc(net, s, out):
    """Fill points (k, 2) of the arc of a net (n + 1, 3) at s (k,)."""
    for i in range(s.shape[0]):
        out[i, 0], out[i, 1] = point_of_arc(net, 0, net.shape[0] - 1, s[i])


@kernel
def classify_points(table, m, u, v, inside, in_band):
    """Fill ``inside`` and ``in_band`` (n,) bool for points (n,)."""
    for i in range(u.shape[0]):
        is_inside, may_be_near = classify(table, m, u[i], v[i], 0.0, 0.0)
        inside[i] = is_inside
        in_band[i] = may_be_near and is_entered(table, m, u[i], v[i], 0.0, 0.0)


@kernel
def mark_tiles(table, m, p, counts_u, counts_v, tile):
    """Mark the tiles that piece p comes nearer to than half a tile as CROSSED.

    A piece along the border of the square marks none unless ``counts_u`` (or v): where u begins anew
    there, or where what is near a loop has a flag. Elsewhere there is no surface beyond.
    """
    x, y = table.piece[p, X_LOW], table.piece[p, Y_LOW]
    if not counts_u and x == table.piece[p, X_HIGH] and x in (0.0, 1.0):
        return
    if not counts_v and y == table.piece[p, Y_HIGH] and y in (0.0, 1.0):
        return
    n = table.member[m, N_TILES]
    a, b = table.piece[p, S_LOW], table.piece[p, S_HIGH]
    side_x, side_y = abs(table.piece[p, X_HIGH] - x), table.piece[p, Y_HIGH] - y
    parts = max(1, min(4 * n, np.int64(2.0 * n * (side_x + side_y)) + 1))
    grown = 0.5 / n + 2.0 * table.error[m]
    for k in range(1, parts + 1):
        xk, yk = point_of_piece(table, p, a + (b - a) * (k / parts))
        if k == parts:
            xk, yk = table.piece[p, X_HIGH], table.piece[p, Y_HIGH]
        i0, i1 = (min(x, xk) - grown) * n, (max(x, xk) + grown) * n
        j0, j1 = (min(y, yk) - grown) * n, (max(y, yk) + grown) * n
        if i1 >= 0.0 and j1 >= 0.0 and i0 < n and j0 < n:
            for i in range(int(max(i0, 0.0)), int(min(i1, n - 1.0)) + 1):
                for j in range(int(max(j0, 0.0)), int(min(j1, n - 1.0)) + 1):
                    tile[i * n + j] = CROSSED
        x, y = xk, yk


@kernel
def fill_tiles(table, m, tile):
    """Classify the tiles that no piece comes near."""
    n = table.member[m, N_TILES]
    for i in range(n):
        for j in range(n):
            if tile[i * n + j] != CROSSED:
                u, v = (i + 0.5) / n, (j + 0.5) / n
                parity = False
                slab = slab_of(table, m, v)
                for k in range(table.slab[slab], table.slab[slab + 1]):
                    parity ^= side_of_piece(table, np.int64(table.listed[k]), u, v, 0.0, 0.0)[0]
                tile[i * n + j] = INSIDE if parity else OUTSIDE


@kernel
def classify_boxes(table, m, boxes, state):
    """Tell of boxes (k, 4) u0, u1, v0, v1 whether they are wholly on one side: OUTSIDE, INSIDE."""
    for i in range(boxes.shape[0]):
        u, v = 0.5 * (boxes[i, 0] + boxes[i, 1]), 0.5 * (boxes[i, 2] + boxes[i, 3])
        # A part in a million more: roots may lie beside the box that offers them.
        du, dv = 0.5000005 * (boxes[i, 1] - boxes[i, 0]), 0.5000005 * (boxes[i, 3] - boxes[i, 2])
        is_inside, may_be_near = classify(table, m, u, v, du, dv)
        if may_be_near and is_entered(table, m, u, v, du, dv):
            state[i] = CROSSED
        else:
            state[i] = INSIDE if is_inside else OUTSIDE
