"""Parallelograms sampled evenly by solid angle, as seen from a point.

As Urena, Fajardo and King, "An area-preserving parametrization for spherical rectangles", EGSR
2013: one random number chooses a line across the lamp, another a point of that line, by a map that
is continuous and keeps ratios of solid angles, so points of low discrepancy stay so. The formulas
are other ones: they hold for edges at any angle, and lose no digits where the solid angle is small.

The frame: x along the longer edge, y across it, h the distance to the plane; the longer edge is one.
Between its two long sides, at y0 and y1, a line parallel to the short edges meets the sides at a and
b. The part of the strip beyond it, to x = infinity, is a spherical triangle with the corners a, b and
the direction x. Let E be its solid angle (Van Oosterom and Strackee, "The solid angle of a plane
triangle", 1983)::

    cot(E / 2) = (k + m) / (h (y1 - y0)),  k = (|a| + a_x) (|b| + b_x),  m = h^2 + y0 y1

So E, linear in the first random number, gives k, and k gives the line by a quadratic equation. On a
line at distance d the solid angle is linear in the sine z / sqrt(d^2 + z^2).
"""

import math

from meshing.kernels.jit import inlined

# A lamp over which distance^2 stays within this part of that of its middle is sampled by area, in a
# sixth of the time. The two densities differ by 1 / distance^3 only: a standard deviation of half the
# mean where the part is reached, and mostly far less. On the Cornell box and in teapot_room paths take
# 0.88 and 0.93 of the time of 0.125 for 1.006 and 1.010 of the squared error; 1.5 saves 0.03 more, but
# a lamp might then come as near as one likes. Others extend over a fifth of their distance or more, so
# differences of coordinates keep their digits.
EVEN = 0.5

# Nearer to its plane than this, in longer edges, a lamp is seen as from there: squares of squares of
# distances do not underflow. What it sends changes by as much at most.
NEAREST = 1e-30


@inlined
def is_even(x, y, z, ax, ay, az, bx, by, bz):
    """Tell whether a parallelogram with corner (x, y, z), seen from 0, is to be sampled by area."""
    cx, cy, cz = x + 0.5 * (ax + bx), y + 0.5 * (ay + by), z + 0.5 * (az + bz)
    # Distance^2 at a corner is that of the middle, plus or minus c . a, c . b and half of a . b.
    change = abs(cx * ax + cy * ay + cz * az) + abs(cx * bx + cy * by + cz * bz)
    size = ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz
    change += 0.25 * size + 0.5 * abs(ax * bx + ay * by + az * bz)
    return change <= EVEN * (cx * cx + cy * cy + cz * cz)


@inlined
def solid_angle(x, y, z, ax, ay, az, bx, by, bz):
    """Return the solid angle of a parallelogram of corner (x, y, z), edges a and b; 0 from its back."""
    _, _, _, _, _, x0, y0, width, slant, h, _ = _frame(x, y, z, ax, ay, az, bx, by, bz)
    return 2.0 * _between(x0, y0, width, slant, h)[0] if h > 0.0 else 0.0


@inlined
def even_point(x, y, z, ax, ay, az, bx, by, bz, s, t):
    """Sample a point of a parallelogram evenly by solid angle, by (s, t) in [0, 1)^2; seen from 0.

    Returns the point, its coordinates along a and b in [0, 1], and the solid angle; from the back zeros.
    """
    side, along, across, length, sign, x0, y0, width, slant, h, normal = _frame(
        x, y, z, ax, ay, az, bx, by, bz
    )
    if h <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if side < 0.0:
        s, t = t, s
    half, last, low, high = _between(x0, y0, width, slant, h)
    beyond = half * (1.0 - s if sign > 0.0 else s)
    x = min(max(_line_beyond(beyond, last, low, high, y0, width, slant, h), x0), x0 + 1.0)
    v = _along_line(x, y0, width, slant, h, t)
    u = x - x0 if sign > 0.0 else x0 + 1.0 - x
    i, j, k = length * (x + v * slant), length * (y0 + v * width), -length * h
    if side < 0.0:
        u, v = v, u
    return (
        i * along[0] + j * across[0] + k * normal[0],
        i * along[1] + j * across[1] + k * normal[1],
        i * along[2] + j * across[2] + k * normal[2],
        u, v, 2.0 * half,
    )  # fmt: skip


@inlined
def _frame(x, y, z, ax, ay, az, bx, by, bz):
    """Return the frame of a parallelogram, in lengths of its longer edge.

    side: 1 if the longer edge is a, else -1. along, across: unit, x and y; x points to the side where most
    of the lamp lies: E is small there. length: of the longer edge; sign: -1 if x points against it. x0, y0:
    the corner with the least x of the side with the least y. width: y1 - y0. slant: by how much the other
    side is ahead in x. h: height above the front, at least `NEAREST`; negative or 0: not before it. normal:
    of the front.
    """
    side = 1.0
    if ax * ax + ay * ay + az * az < bx * bx + by * by + bz * bz:
        side, ax, ay, az, bx, by, bz = -1.0, bx, by, bz, ax, ay, az
    square = ax * ax + ay * ay + az * az
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    length, area = math.sqrt(square), math.sqrt(nx * nx + ny * ny + nz * nz)
    # One division for all: they and the roots take most of the time.
    by_both = 1.0 / (length * area)
    one, by_area = by_both * area, by_both * length
    width, slant = area * one * one, (ax * bx + ay * by + az * bz) * one * one
    ax, ay, az = one * ax, one * ay, one * az
    nx, ny, nz = by_area * nx, by_area * ny, by_area * nz
    x, y, z = one * x, one * y, one * z
    cx, cy, cz = ny * az - nz * ay, nz * ax - nx * az, nx * ay - ny * ax
    x0, y0 = ax * x + ay * y + az * z, cx * x + cy * y + cz * z
    h = -side * (nx * x + ny * y + nz * z)
    if h > 0.0:
        h = max(h, NEAREST)
    sign = 1.0
    if x0 + 0.5 + 0.5 * slant < 0.0:
        sign, x0, slant = -1.0, -(x0 + 1.0), -slant
    along, across = (sign * ax, sign * ay, sign * az), (cx, cy, cz)
    normal = (side * nx, side * ny, side * nz)
    return side, along, across, length, sign, x0, y0, width, slant, h, normal


@inlined
def _between(x0, y0, width, slant, h):
    """Return half the solid angle between the ends, k + m of the last, and k of the first and last."""
    y1 = y0 + width
    r0, r1 = math.sqrt(y0 * y0 + h * h), math.sqrt(y1 * y1 + h * h)
    low, first = _cut(x0, slant, y0, y1, r0, r1, h)
    high, last = _cut(x0 + 1.0, slant, y0, y1, r0, r1, h)
    across = h * width
    half = math.atan2(across * (high - low), first * last + across * across)
    return half, last, low, high


@inlined
def _cut(x, slant, y0, y1, r0, r1, h):
    """Return k and k + m of the line from x, of which neither has lost its digits."""
    a, b = _with_distance(x, r0), _with_distance(x + slant, r1)
    k, m = a * b, h * h + y0 * y1
    total = k + m
    if abs(total) < 1e-3 * k:
        # Above an end of the lamp, m is nearly -r0 r1, and r0^2 r1^2 - m^2 is h^2 (y1 - y0)^2.
        across = h * (y1 - y0)
        total = a * _beyond(x + slant, r1) + r1 * _beyond(x, r0) + across * across / (r0 * r1 - m)
    return k, total


@inlined
def _with_distance(x, r):
    """Return x + sqrt(x^2 + r^2) without cancellation."""
    distance = math.sqrt(x * x + r * r)
    return x + distance if x >= 0.0 else r * r / (distance - x)


@inlined
def _beyond(x, r):
    """Return x + sqrt(x^2 + r^2) - r without cancellation."""
    size, distance = abs(x), math.sqrt(x * x + r * r)
    more = size * (1.0 + size / (distance + r))
    return more if x >= 0.0 else -more * r / (size + distance)


@inlined
def _line_beyond(half, last, low, high, y0, width, slant, h):
    """Return the x where the line starts that has ``half`` of E between itself and the last one."""
    across, y1 = h * width, y0 + width
    # Of the sums of angles, last and half, by their cotangent and tangent.
    tangent = math.tan(half)
    k = across * (last - across * tangent) / (across + last * tangent) - (h * h + y0 * y1)
    k = min(max(k, low), high)
    # With a = |a| + a_x: (k + r1^2) a^2 + 2 slant k a = k (k + r0^2).
    square = y0 * y0 + h * h
    p, q = k + square, k + y1 * y1 + h * h
    root = math.sqrt(slant * slant + p * q / k) + abs(slant)
    above, below = (p, root) if slant >= 0.0 else (k * root, q)
    return 0.5 * (above * above - square * below * below) / (above * below)


@inlined
def _along_line(x, y0, width, slant, h, t):
    """Choose a point of the line from x by t; return which part of the line lies before it."""
    length = math.sqrt(slant * slant + width * width)
    one = 1.0 / length
    z0, foot = one * (x * slant + y0 * width), one * (x * width - y0 * slant)
    square = foot * foot + h * h
    less0, more0 = _beside_one(z0, square)
    less1, more1 = _beside_one(z0 + length, square)
    less, more = (1.0 - t) * less0 + t * less1, (1.0 - t) * more0 + t * more1
    z = 0.5 * (more - less) * math.sqrt(square / (less * more))
    return min(max(one * (z - z0), 0.0), 1.0)


@inlined
def _beside_one(z, square):
    """Return 1 - s and 1 + s of the sine s = z / sqrt(square + z^2), both to the last digits."""
    distance, size = math.sqrt(square + z * z), abs(z)
    one = 1.0 / (distance * (distance + size))
    small, large = one * square, 1.0 + one * size * (distance + size)
    return (small, large) if z >= 0.0 else (large, small)
