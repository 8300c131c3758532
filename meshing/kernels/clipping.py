"""The part of a rectangle of (u, v) inside loops: their chords in it, what these enclose, its triangles.

Chords end where a piece of a curve crosses a side of the rectangle. Both neighbours compute that end in
the same way, so they have the same vertices on their common side.
"""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel
from meshing.kernels.trims import (
    S_HIGH,
    S_LOW,
    X_HIGH,
    X_LOW,
    Y_HIGH,
    Y_LOW,
    first_beyond,
    point_of_piece,
)

# Ends of chords this near to each other in (u, v) become one: many roundings, and far less than any leaf.
NEAR = 2.0**-46
TINY = 1e-300


@inner
def _later(s, x, y, is_first, other, ox, oy, forward, x_line, y_line):
    """Return the later (or the earlier) of two places on a piece; both at once are a corner."""
    if other == s:
        return s, x_line, y_line
    if ((other - s) * forward > 0.0) == is_first:
        return other, ox, oy
    return s, x, y


@inner
def _moved_in(table, p, end, other, lines, is_beyond, is_first, grows, forward):
    """Return an end (s, u, v) of a piece where it crosses the lines of u and v that it is beyond.

    ``other`` is the other end. Of both lines the later one counts, or at the last end the earlier one.
    """
    s, x, y = end
    b, xb, yb = other
    if is_beyond[0]:
        s, x, y = b, lines[0], yb
        if xb != lines[0]:
            s = first_beyond(table, p, lines[0], True, grows)
            y = point_of_piece(table, p, s)[1]
    if is_beyond[1]:
        c, cx = b, xb
        if yb != lines[1]:
            c = first_beyond(table, p, lines[1], False, True)
            cx = point_of_piece(table, p, c)[0]
        if not is_beyond[0]:
            return c, cx, lines[1]
        s, x, y = _later(s, x, y, is_first, c, cx, lines[1], forward, lines[0], lines[1])
    return s, x, y


@kernel
def chords_in_box(table, box, cuts, first_cut, chords):
    """Write chords of the pieces in a box as rows u, v, u, v, piece, s, s; return how many there are.

    Pieces are cut at ``cuts[first_cut[p]:first_cut[p + 1]]``, ascending. A piece that only touches the
    box has a chord of no length. What has no room in ``chords`` is counted all the same.
    """
    u0, u1, v0, v1 = box[0], box[1], box[2], box[3]
    count = 0
    for p in range(table.piece.shape[0]):
        a, xa, ya = table.piece[p, S_LOW], table.piece[p, X_LOW], table.piece[p, Y_LOW]
        b, xb, yb = table.piece[p, S_HIGH], table.piece[p, X_HIGH], table.piece[p, Y_HIGH]
        if ya > v1 or yb < v0 or min(xa, xb) > u1 or max(xa, xb) < u0:
            continue
        forward, grows = 1.0 if b >= a else -1.0, xb >= xa
        near, far = (u0, u1) if grows else (u1, u0)
        enters_u, enters_v = (xa < near) if grows else (xa > near), ya < v0
        leaves_u, leaves_v = (xb > far) if grows else (xb < far), yb > v1
        begin, end = (a, xa, ya), (b, xb, yb)
        s, x, y = _moved_in(
            table, p, begin, end, (near, v0), (enters_u, enters_v), True, grows, forward
        )
        t, z, w = _moved_in(
            table, p, end, begin, (far, v1), (leaves_u, leaves_v), False, grows, forward
        )
        if (t - s) * forward < 0.0:
            continue
        x, z = min(max(x, u0), u1), min(max(z, u0), u1)
        y, w = min(max(y, v0), v1), min(max(w, v0), v1)
        if s == t and (enters_u or enters_v) and (leaves_u or leaves_v):
            # Through a corner.
            x = u0 if x - u0 < u1 - x else u1
            y = v0 if y - v0 < v1 - y else v1
            z, w = x, y
        n = first_cut[p + 1] - first_cut[p]
        for k in range(n + 1):
            c, cx, cy = t, z, w
            if k < n:
                c = cuts[first_cut[p] + k] if forward > 0.0 else cuts[first_cut[p + 1] - 1 - k]
                if not ((c - s) * forward > 0.0 and (t - c) * forward > 0.0):
                    continue
                cx, cy = point_of_piece(table, p, c)
                cx, cy = min(max(cx, u0), u1), min(max(cy, v0), v1)
            if count < chords.shape[0]:
                chords[count, 0], chords[count, 1], chords[count, 2], chords[count, 3] = (
                    x,
                    y,
                    cx,
                    cy,
                )
                chords[count, 4], chords[count, 5], chords[count, 6] = p, s, c
            count += 1
            s, x, y = c, cx, cy
    return count


@inner
def _turn(ax, ay, bx, by, cx, cy):
    return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)


@inner
def _touches(ax, ay, bx, by, cx, cy):
    """Tell whether c is on the way from a to b, up to NEAR, and at neither."""
    along = (cx - ax) * (bx - ax) + (cy - ay) * (by - ay)
    square = (bx - ax) * (bx - ax) + (by - ay) * (by - ay)
    return (
        0.0 < along < square
        and abs(_turn(ax, ay, bx, by, cx, cy)) <= NEAR * math.sqrt(square)
        and not _is_near(ax, ay, cx, cy)
        and not _is_near(bx, by, cx, cy)
    )


@inner
def _is_near(ax, ay, bx, by):
    return max(abs(ax - bx), abs(ay - by)) <= NEAR


@inner
def _move(chords, count, box, ax, ay, bx, by):
    """Move the end at a of all chords to b, or the other way round if only a is on a side of the box."""
    if ax in (box[0], box[1]) or ay in (box[2], box[3]):
        ax, ay, bx, by = bx, by, ax, ay
    if ax in (box[0], box[1]) or ay in (box[2], box[3]):
        return False
    for k in range(count):
        for end in (0, 2):
            if chords[k, end] == ax and chords[k, end + 1] == ay:
                chords[k, end], chords[k, end + 1] = bx, by
    return True


@kernel
def split_at_crossings(chords, count, box):
    """Split chords (room, 4) in a box where they cross or touch each other; return how many they are.

    Ends nearer than NEAR to each other become one, and those as near to a chord split it. So no
    chords are left whose sides rounding could confuse. -1: they are more than there is room for.
    """
    i = 0
    while i < count:
        j = 0
        while j < i:
            if count + 2 > chords.shape[0]:
                return -1
            ax, ay, bx, by = chords[i, 0], chords[i, 1], chords[i, 2], chords[i, 3]
            cx, cy, dx, dy = chords[j, 0], chords[j, 1], chords[j, 2], chords[j, 3]
            j += 1
            if max(ax, bx) < min(cx, dx) - NEAR or max(cx, dx) < min(ax, bx) - NEAR:
                continue
            if max(ay, by) < min(cy, dy) - NEAR or max(cy, dy) < min(ay, by) - NEAR:
                continue
            has_moved = False
            for k in range(4):
                px, py = (ax, ay) if k < 2 else (bx, by)
                qx, qy = (cx, cy) if k % 2 == 0 else (dx, dy)
                if (px != qx or py != qy) and _is_near(px, py, qx, qy) and not has_moved:
                    has_moved = _move(chords, count, box, px, py, qx, qy)
            if has_moved:
                i, j = 0, 0
                continue
            x, y = cx, cy
            splits_i = splits_j = False
            if _touches(ax, ay, bx, by, cx, cy):
                splits_i = True
            elif _touches(ax, ay, bx, by, dx, dy):
                splits_i, x, y = True, dx, dy
            elif _touches(cx, cy, dx, dy, ax, ay):
                splits_j, x, y = True, ax, ay
            elif _touches(cx, cy, dx, dy, bx, by):
                splits_j, x, y = True, bx, by
            else:
                a, b = _turn(cx, cy, dx, dy, ax, ay), _turn(cx, cy, dx, dy, bx, by)
                c, d = _turn(ax, ay, bx, by, cx, cy), _turn(ax, ay, bx, by, dx, dy)
                if a * b < 0.0 and c * d < 0.0:
                    part = a / (a - b)
                    x, y = ax + part * (bx - ax), ay + part * (by - ay)
                    splits_i = not _is_near(x, y, ax, ay) and not _is_near(x, y, bx, by)
                    splits_j = not _is_near(x, y, cx, cy) and not _is_near(x, y, dx, dy)
            if splits_i:
                chords[count, 0], chords[count, 1], chords[count, 2], chords[count, 3] = (
                    x,
                    y,
                    bx,
                    by,
                )
                chords[i, 2], chords[i, 3] = x, y
                count += 1
            if splits_j:
                chords[count, 0], chords[count, 1], chords[count, 2], chords[count, 3] = (
                    x,
                    y,
                    dx,
                    dy,
                )
                chords[j - 1, 2], chords[j - 1, 3] = x, y
                count += 1
            if splits_i or splits_j:
                j = 0
        i += 1
    return count


@kernel
def turn_inside_left(chords, at_left, at_bottom, base, turned):
    """Tell which chords (k, 4) have what is inside at their right.

    A line from the middle of a chord to the left side crosses chords; so does the way from there down to
    the corner. From chords that are rather flat it goes down, and then to the left.

    ``at_left``, ``at_bottom``, v and u of chords' ends on these sides of the rectangle: one at the
    bottom left corner is among those on the left.
    ``base``: whether it is inside just above the bottom side, beside that corner.
    """
    n = chords.shape[0]
    for i in range(n):
        is_flat = abs(chords[i, 2] - chords[i, 0]) > abs(chords[i, 3] - chords[i, 1])
        x, y = (1, 0) if is_flat else (0, 1)
        ax, ay, bx, by = chords[i, x], chords[i, y], chords[i, 2 + x], chords[i, 2 + y]
        middle = 0.5 * (ay + by)
        at = ax + (middle - ay) / (by - ay) * (bx - ax)
        is_inside = base
        side = at_bottom if is_flat else at_left
        for k in range(side.shape[0]):
            is_inside ^= side[k] <= middle
        for j in range(n):
            cx, cy, dx, dy = chords[j, x], chords[j, y], chords[j, 2 + x], chords[j, 2 + y]
            if cy > dy:
                cx, cy, dx, dy = dx, dy, cx, cy
            if j != i and cy <= middle < dy:
                is_inside ^= _turn(cx, cy, dx, dy, at, middle) < 0.0
        # What was found is at the left of a chord that goes up, and below one that goes to the right.
        turned[i] = ((ay > by) == is_inside) != is_flat


@inner
def _obstacle(points, front, count, likely, a, b, c):
    """Return an edge of the front that begins in a triangle or crosses its sides, -1 if there is none.

    The one numbered ``likely`` is tried first.
    """
    ax, ay, bx, by, cx, cy = (
        points[a, 0], points[a, 1], points[b, 0], points[b, 1], points[c, 0], points[c, 1],
    )  # fmt: skip
    for i in range(-1, count):
        k = i if i >= 0 else likely
        p, q = front[k, 0], front[k, 1]
        px, py, qx, qy = points[p, 0], points[p, 1], points[q, 0], points[q, 1]
        of_bc = _turn(bx, by, cx, cy, px, py)
        of_ca = _turn(cx, cy, ax, ay, px, py)
        of_ab = _turn(ax, ay, bx, by, px, py)
        if p not in (a, b, c) and min(of_bc, of_ca, of_ab) >= 0.0:
            return k
        if of_bc * _turn(bx, by, cx, cy, qx, qy) < 0.0 and (
            _turn(px, py, qx, qy, bx, by) * _turn(px, py, qx, qy, cx, cy) < 0.0
        ):
            return k
        if of_ca * _turn(cx, cy, ax, ay, qx, qy) < 0.0 and (
            _turn(px, py, qx, qy, cx, cy) * _turn(px, py, qx, qy, ax, ay) < 0.0
        ):
            return k
    return -1


@inner
def _close(front, count, a, b):
    """Take the edge from a to b off the front, or else put the one from b to a on it."""
    for k in range(count):
        if front[k, 0] == a and front[k, 1] == b:
            front[k, 0], front[k, 1] = front[count - 1, 0], front[count - 1, 1]
            return count - 1
    front[count, 0], front[count, 1] = b, a
    return count + 1


@inner
def _cotangent(places, a, b, c):
    """Return the cotangent of the angle at c."""
    px, py, pz = (
        places[a, 0] - places[c, 0], places[a, 1] - places[c, 1], places[a, 2] - places[c, 2],
    )  # fmt: skip
    qx, qy, qz = (
        places[b, 0] - places[c, 0], places[b, 1] - places[c, 1], places[b, 2] - places[c, 2],
    )  # fmt: skip
    dot = px * qx + py * qy + pz * qz
    x, y, z = py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx
    return dot / max(math.sqrt(x * x + y * y + z * z), TINY)


@kernel
def fill(points, places, front, count, faces):
    """Triangulate what is at the left of the edges ``front[:count]``; return the number of triangles.

    On each edge of the front stands the triangle with the largest angle among those that are free
    (a constrained Delaunay triangulation). Where rounding leaves none, the next edge closes one. What is
    free is seen in (u, v), ``points``, angles in space, ``places``: a collapsed side spoils no triangle.
    """
    n_faces = 0
    while count > 0 and n_faces < faces.shape[0]:
        count -= 1
        a, b = front[count, 0], front[count, 1]
        best, least, likely = -1, np.inf, 0
        ax, ay, bx, by = points[a, 0], points[a, 1], points[b, 0], points[b, 1]
        for k in range(count):
            c = front[k, 0]
            cx, cy = points[c, 0], points[c, 1]
            area = _turn(ax, ay, bx, by, cx, cy)
            if area > 0.0:
                cot = _cotangent(places, a, b, c)
                if cot < least:
                    obstacle = _obstacle(points, front, count, likely, a, b, c)
                    if obstacle < 0:
                        best, least = c, cot
                    else:
                        likely = obstacle
        if best < 0:
            for k in range(count):
                if front[k, 0] == b and front[k, 1] != a:
                    best = front[k, 1]
        if best < 0:
            # An edge there and back.
            for k in range(count):
                if front[k, 0] == b and front[k, 1] == a:
                    count -= 1
                    front[k, 0], front[k, 1] = front[count, 0], front[count, 1]
                    break
            continue
        faces[n_faces, 0], faces[n_faces, 1], faces[n_faces, 2] = a, b, best
        n_faces += 1
        count = _close(front, count, b, best)
        count = _close(front, count, best, a)
    return n_faces


@kernel
def points_of_pieces(table, piece, s, out):
    """Fill points (k, 2) of pieces (k,) at s (k,)."""
    for i in range(s.shape[0]):
        out[i, 0], out[i, 1] = point_of_piece(table, piece[i], s[i])
