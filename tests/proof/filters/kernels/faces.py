"""Certain crossings of rays with flat faces: Cramer's rule in double-double balls.

A face is a parallelogram, the half of it that is a triangle, or a plane without end, from a corner
and two edges: w + t d = u e + v f, for w from the corner to the ray.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel
from proof.filters.kernels.balls import (
    GROW,
    ROUNDING,
    dot3,
    minus,
    over,
    plus,
    sign,
    times,
)
from proof.filters.kernels.first import (
    exact,
    finish,
    note,
    nothing,
    start,
)
from proof.kernels.double_double import add

PARALLELOGRAM, TRIANGLE, PLANE = 0, 1, 2


class Faces(NamedTuple):
    """All faces of one surface."""

    corners: Any  # (k, 3, 2) float64: double-double, from the origin
    edges: Any  # (k, 2, 3, 2) float64: double-double
    normals: Any  # (k, 3, 3) float64: balls
    balls: Any  # (k, 4) float64: centre from the origin and radius; inf for a plane
    shape: int  # one of the three
    origin: Any  # (3,) float64
    radius: float  # of a ball around all; inf for a plane
    middle: Any  # (3,) float64
    size: float  # -1 for a plane


@inner
def _is_outside(part, slope):
    """Whether part / slope is certainly outside [0, 1]."""
    p, s = abs(part[0]), abs(slope[0])
    if p / GROW - part[2] > (s + slope[2]) * GROW:
        return True
    side = sign(part) * sign(slope)
    return side < 0 or (side > 0 and sign(minus(part, slope)) == sign(slope))


@inner
def _is_inside(part, slope):
    """Whether part / slope is certainly between 0 and 1."""
    same = sign(part) * sign(slope)
    if same <= 0:
        return False
    rest = minus(slope, part)
    return sign(rest) == sign(slope)


@inner
def _face(surface, k, away, d, length, scratch, count):
    """Note the crossing with one face; return their number, and from where there may be another."""
    x, y, z = exact(d[0]), exact(d[1]), exact(d[2])
    normal, corner, edges = surface.normals[k], surface.corners[k], surface.edges[k]
    n0 = normal[0, 0], normal[0, 1], normal[0, 2]
    n1 = normal[1, 0], normal[1, 1], normal[1, 2]
    n2 = normal[2, 0], normal[2, 1], normal[2, 2]
    slope = dot3(n0, n1, n2, x, y, z)
    w0 = _from(away, corner, 0)
    w1 = _from(away, corner, 1)
    w2 = _from(away, corner, 2)
    is_open = False
    if surface.shape != PLANE:
        c0 = minus(times(w1, z), times(w2, y))
        c1 = minus(times(w2, x), times(w0, z))
        c2 = minus(times(w0, y), times(w1, x))
        e, f = edges[0], edges[1]
        u = dot3(c0, c1, c2, _pair(f, 0), _pair(f, 1), _pair(f, 2))
        u = -u[0], -u[1], u[2]
        if _is_outside(u, slope):
            return count, math.inf
        v = dot3(c0, c1, c2, _pair(e, 0), _pair(e, 1), _pair(e, 2))
        if _is_outside(v, slope):
            return count, math.inf
        if surface.shape == TRIANGLE and _is_outside(plus(u, v), slope):
            return count, math.inf
        is_open = not (_is_inside(u, slope) and _is_inside(v, slope))
        is_open |= surface.shape == TRIANGLE and not _is_inside(plus(u, v), slope)
    height = dot3(n0, n1, n2, w0, w1, w2)
    if surface.shape == PLANE and slope[0] == 0.0 and _is_zero(d, normal) and sign(height) != 0:
        return count, math.inf  # parallel, and apart
    t = over((-height[0], -height[1], height[2]), slope)
    if is_open or not t[2] < math.inf:
        return count, t[0] - (t[2] + abs(t[1])) * GROW if t[2] < math.inf else -math.inf
    size = math.sqrt(normal[0, 0] ** 2 + normal[1, 0] ** 2 + normal[2, 0] ** 2)
    return note(scratch.crossings, count, t, abs(slope[0]) / (size * length)), math.inf


@inner
def _is_zero(d, normal):
    """Whether n.d is 0 because each product is."""
    return d[0] * normal[0, 0] == 0.0 and d[1] * normal[1, 0] == 0.0 and d[2] * normal[2, 0] == 0.0


@inner
def _pair(edge, k):
    return edge[k, 0], edge[k, 1], 0.0


@inner
def _from(away, corner, k):
    """Return the ray's point from the corner of a face."""
    h, e = add(away[k, 0], away[k, 1], -corner[k, 0], -corner[k, 1])
    return h, e, (away[k, 2] + ROUNDING * abs(h)) * GROW


@inner
def _ray(surface, o, d, leaves, hit_t, scratch, out):
    away = scratch.away
    shift, length, reach = start(o, d, surface.origin, surface.origin, surface.radius, leaves, away)
    if reach < 0.0:
        nothing(out)
        return
    count, from_t = 0, math.inf
    for k in range(surface.corners.shape[0]):
        radius = surface.balls[k, 3]
        if radius < math.inf:
            wx = away[0, 0] - surface.balls[k, 0]
            wy = away[1, 0] - surface.balls[k, 1]
            wz = away[2, 0] - surface.balls[k, 2]
            cx, cy, cz = wy * d[2] - wz * d[1], wz * d[0] - wx * d[2], wx * d[1] - wy * d[0]
            limit = (radius * 1.000001 + 1e-12 * surface.radius) * length
            if cx * cx + cy * cy + cz * cz > limit * limit:
                continue
        count, begins = _face(surface, k, away, d, length, scratch, count)
        from_t = min(from_t, begins)
    from_t = shift + from_t - 2.0**-50 * abs(shift)
    finish(
        scratch.crossings, count, shift, o, length, surface.middle, surface.size, leaves, hit_t,
        from_t, out,
    )  # fmt: skip


@kernel
def first_on_faces(surface, origins, directions, leaves, hit_t, scratch, out):
    """Say of each ray what is certain of its first crossing; see `turned.first_on_turned`."""
    for i in range(origins.shape[0]):
        _ray(surface, origins[i], directions[i], leaves[i], hit_t[i], scratch, out[i])
