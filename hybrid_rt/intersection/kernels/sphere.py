"""Rays against spheres, safe at every radius and distance.

The discriminant is taken from the foot of the perpendicular (Haines, Guenther, Akenine-Moeller
2019, "Precision improvements for ray/sphere intersection"), so a sphere far away keeps its edge.
The nearer root is the product of the roots over the farther one, with that product, |o - c|^2 -
r^2, in double-double (Dekker 1971): a wall that is a huge sphere is hit to the last digits by a
camera beside it.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.arctangent import angle_of
from hybrid_rt.core.kernels.compensated import product, two_difference
from hybrid_rt.core.kernels.sphere_points import onto_sphere, power_of_point
from hybrid_rt.intersection.kernels.reach import (
    ALL,
    BLOCK,
    FEW,
    FIRST_BIT,
    LANES,
    NEXT,
    sphere_columns,
    spheres_in_reach,
)
from hybrid_rt.intersection.kernels.search.axial_trims import (
    LONG,
    rough_share,
    side_about_axis,
    touches_kept,
)
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.frame import share_of_turn, turned
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import doubt, not_zero, offer
from hybrid_rt.intersection.kernels.search.rays import EDGE
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.trims import has_gap, is_steady, side_of_tile
from meshing.kernels.jit import inlined, inner, kernel
from meshing.kernels.trims import CROSSED, INSIDE, OUTSIDE

# An origin is beside a sphere where |o - c|^2 - r^2 is below this part of r^2.
BESIDE = 1e-2
# The u and v of a root whose side of the loops is certain without: found when its hit is described.
LATER = -1.0
PI_SQUARE = np.pi**2


class SphereTable(NamedTuple):
    """Spheres; row k is object ``object_id[k]``."""

    center: Any  # (k, 4): and `meshing.surface.Surface.moved`
    radius: Any  # (k,)
    frame: Any  # (k, 3, 3): rows along azimuth 0, a quarter turn, the pole
    orientation: Any  # (k,): 1 normals outward, -1 inward
    object_id: Any  # (k,) int32
    reach: Any  # (4, more) float64, see `spheres_in_reach`
    trim: Any  # None: they are whole; else `search.trims.Trim`


def sphere_table(spheres, object_id, trim=None):
    """Return the table of a list of spheres, and of the loops that trim all of them."""
    center = np.array([(*s.center, s.moved) for s in spheres]).reshape(-1, 4)
    radius = np.array([s.radius for s in spheres])
    return SphereTable(
        center=center,
        radius=radius,
        frame=np.array([s.frame for s in spheres]).reshape(-1, 3, 3),
        orientation=np.array([float(s.orientation) for s in spheres]),
        object_id=object_id,
        reach=sphere_columns(center[:, :3], radius + 2.0 * center[:, 3]),
        trim=trim,
    )


@inner
def _along(fx, fy, fz, gx, gy, gz, dx, dy, dz):
    """Return (f + g) . d with exact products."""
    p, e = product(fx, dx)
    q, f = product(fy, dy)
    r, g = product(fz, dz)
    low = (e + f + g) + (gx * dx + gy * dy + gz * dz)
    s = p + q
    z = s - p
    low += (p - (s - z)) + (q - z)
    t = s + r
    z = t - s
    return t + (low + ((s - (t - z)) + (r - z)))


@inlined
def _look(i, k, t, table, rays):
    """Return the point of ray i at t from the centre of sphere k, along its frame, and its v."""
    o, d, c = rays.origin[i], rays.direction[i], table.center[k]
    fx, gx = two_difference(o[0], c[0])
    fy, gy = two_difference(o[1], c[1])
    fz, gz = two_difference(o[2], c[2])
    x, y, z = turned(
        table.frame[k], fx + t * d[0] + gx, fy + t * d[1] + gy, fz + t * d[2] + gz
    )  # fmt: skip
    v = angle_of(np.sqrt(x * x + y * y), -z) / np.pi
    return x, y, z, min(max(v, 0.0), 1.0)


@inlined
def _side_of_root(i, k, t, band, trim, table, rays):
    """Decide about a root on trimmed sphere k, see `side_about_axis`; return its u and v as well."""
    d = rays.direction[i]
    x, y, z, v = _look(i, k, t, table, rays)
    dx, dy, dz = turned(table.frame[k], d[0], d[1], d[2])
    up = np.pi * np.sqrt(x * x + y * y)
    u = share_of_turn(y, x)
    is_hit, is_within, edge = side_about_axis(trim, k, x, y, u, v, -np.pi * z, up, dx, dy, dz, band)
    return is_hit, is_within, edge, u, v


@inlined
def _sure_side(i, k, t, n_dot_d, band, trim, table, rays):
    """Return the side of a root that is clear of the loops by far, else CROSSED."""
    if trim is None:
        return INSIDE
    o, d, c, r = rays.origin[i], rays.direction[i], table.center[k], table.radius[k]
    x, y, z = turned(
        table.frame[k], o[0] - c[0] + t * d[0], o[1] - c[1] + t * d[1], o[2] - c[2] + t * d[2]
    )
    square = x * x + y * y
    room = n_dot_d * n_dot_d / (d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
    per_u, per_v = 0.25 / (PI_SQUARE * max(square, 1e-300)), 1.0 / (PI_SQUARE * r * r)
    if not is_steady(trim, k, per_u, per_v, band, room):
        return CROSSED
    return side_of_tile(trim, k, rough_share(y, x), 2.0 * rough_share(np.sqrt(square), -z))


@inner
def _grazes_kept(i, k, t, band, trim, table, rays):
    """Tell whether the sphere where a ray grazes it, around t, may be inside the loops."""
    if trim is None:
        return True
    x, y, _, v = _look(i, k, t, table, rays)
    r = table.radius[k]
    return touches_kept(trim, k, x, y, v, np.pi * r, LONG * (np.sqrt(band * r) + band))


@inlined
def _offer_inside(i, k, t, error, n_dot_d, tangent, band, trim, table, rays, best):
    """Offer a root on trimmed sphere k if it is inside the loops."""
    if not t + error > rays.t_min[i] or t > best.t[i]:
        return
    if not tangent:
        side = _sure_side(i, k, t, n_dot_d, band, trim, table, rays)
        if side == OUTSIDE:
            return
        if side == INSIDE:
            offer(
                i, t, error, n_dot_d, False, table.object_id[k], 0, LATER, LATER,
                rays.t_min, rays.known, best,
            )  # fmt: skip
            return
    is_kept, is_within, edge, u, v = _side_of_root(i, k, t, band, trim, table, rays)
    if is_kept:
        d = rays.direction[i]
        error += edge / np.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        offer(
            i, t, error, n_dot_d, tangent or is_within, table.object_id[k], 0, u, v,
            rays.t_min, rays.known, best,
        )  # fmt: skip
    elif is_within or (tangent and _grazes_kept(i, k, t, band, trim, table, rays)):
        doubt(i, t, band, rays.t_min, rays.known, best)


@inlined
def offer_sphere(i, k, table, rays, best):
    """Offer both roots of ray i with sphere k."""
    center, object_id, t_min, known = table.center, table.object_id, rays.t_min, rays.known
    o, d = rays.origin[i], rays.direction[i]
    ox, oy, oz, dx, dy, dz = o[0], o[1], o[2], d[0], d[1], d[2]
    r, moved = table.radius[k], center[k, 3]
    fx, gx = two_difference(ox, center[k, 0])
    fy, gy = two_difference(oy, center[k, 1])
    fz, gz = two_difference(oz, center[k, 2])
    dd = dx * dx + dy * dy + dz * dz
    middle = -((fx * dx + fy * dy + fz * dz) + (gx * dx + gy * dy + gz * dz)) / dd
    lx, ly, lz = fx + middle * dx + gx, fy + middle * dy + gy, fz + middle * dz + gz
    foot = np.sqrt(lx * lx + ly * ly + lz * lz)
    away = np.sqrt(fx * fx + fy * fy + fz * fz)
    band = TANGENT_BAND * max(away, 2.0 * r) + moved
    depth = r - foot
    if depth <= 0.0:
        if (
            depth > -band
            # The sphere that was meant may be met on both sides of it.
            and middle + 2.0 * np.sqrt((2.0 * r + moved) * moved) > t_min[i]
            and _grazes_kept(i, k, middle, band, table.trim, table, rays)
        ):
            best.doubt[i] = min(best.doubt[i], middle)
        return
    half = np.sqrt(depth * (r + foot) / dd)
    far = middle + half if middle >= 0.0 else middle - half
    power = power_of_point(fx, fy, fz, gx, gy, gz, r)
    near = power / (dd * far)
    # The foot is off by 8 u |f| (a dot product, a product, a sum), r - foot by 2 u r more, and
    # half changes by that over its slope; `near` inherits the relative error of `far`.
    u = UNIT_ROUNDOFF
    error_half = (foot * 8.0 * u * away + 4.0 * u * r * r) / (half * dd)
    if abs(power) < BESIDE * r * r:
        # Beside a large sphere the quadratic's own discriminant is of small numbers.
        b = _along(fx, fy, fz, gx, gy, gz, dx, dy, dz)
        rest = b * b - dd * power
        if rest > 0.0:
            half = np.sqrt(rest) / dd
            middle = -b / dd
            far = middle + half if middle >= 0.0 else middle - half
            near = power / (dd * far)
            wide = 32.0 * u * u * (r * r + away * away)
            error_half = 8.0 * u * (b * b + dd * abs(power)) + dd * wide
            error_half += 48.0 * u * u * abs(b) * away * np.sqrt(dd)
            error_half /= 2.0 * half * dd * dd
    error_far = 8.0 * u * abs(middle) + 4.0 * u * half + error_half
    error_near = abs(near) * (error_far / abs(far) + 8.0 * u)
    error_near += 32.0 * u * u * (r * r + away * away) / (dd * abs(far))
    # An image is moved: `middle` by that over |d|, which is 1/2 or more, and half^2 by this times 2 half.
    off = moved * (2.0 + (2.0 * r + moved) / (half * dd))
    error_near, error_far = error_near + off, error_far + off
    near, far = not_zero(near, moved), not_zero(far, moved)
    n_dot_d = half * dd / r
    tangent = depth < band
    if table.trim is not None:
        for root in range(2):  # one place: the code behind it is compiled into it
            t, error = (near, error_near) if root == 0 else (far, error_far)
            _offer_inside(i, k, t, error, n_dot_d, tangent, band, table.trim, table, rays, best)
        return
    offer(i, near, error_near, n_dot_d, tangent, object_id[k], 0, 0.0, 0.0, t_min, known, best)
    offer(i, far, error_far, n_dot_d, tangent, object_id[k], 0, 0.0, 0.0, t_min, known, best)


@inlined
def offer_spheres(i, first, end, table, rays, best, any_hit):
    """Offer the roots of ray i with the spheres of some rows; ``any_hit``: until there is a hit."""
    o, d, t_min = rays.origin[i], rays.direction[i], rays.t_min[i]
    ox, oy, oz, dx, dy, dz = o[0], o[1], o[2], d[0], d[1], d[2]
    for begin in range(first, end, BLOCK):
        if any_hit and best.object_id[i] >= 0:
            return
        # Whole vector registers; bits from ``end`` on are not read.
        stop = min(begin + BLOCK, (end + LANES - 1) // LANES * LANES)
        t_best = best.t[i]
        mask = ALL
        if end > FEW:
            mask = spheres_in_reach(table.reach, begin, stop, ox, oy, oz, dx, dy, dz, t_min, t_best)
        for k in range(begin, min(begin + BLOCK, end)):
            # What was in reach may lie beyond a root that has been found since.
            if mask & FIRST_BIT and (
                best.t[i] == t_best
                or spheres_in_reach(table.reach, k, k + 1, ox, oy, oz, dx, dy, dz, t_min, best.t[i])
            ):
                offer_sphere(i, k, table, rays, best)
                if any_hit and best.object_id[i] >= 0:
                    return
            mask >>= NEXT


@kernel
def trace_spheres(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the spheres up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_spheres(i, 0, end, table, rays, best, any_hit)


@inlined
def _offer_if_near(i, k, table, rays, best):
    o, d = rays.origin[i], rays.direction[i]
    if spheres_in_reach(
        table.reach, k, k + 1, o[0], o[1], o[2], d[0], d[1], d[2], rays.t_min[i], best.t[i]
    ):
        offer_sphere(i, k, table, rays, best)


@kernel
def trace_sphere_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_spheres`, for the spheres in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(i, _offer_if_near, table, members, rays, best, any_hit, stack)


@inlined
def finish_sphere(table, k, rays, best, i, out):
    """Describe the hit of ray i on sphere k."""
    r, c, t = table.radius[k], table.center[k], best.t[i]
    o, d = rays.origin[i], rays.direction[i]
    fx, gx = two_difference(o[0], c[0])
    fy, gy = two_difference(o[1], c[1])
    fz, gz = two_difference(o[2], c[2])
    x, y, z = fx + t * d[0] + gx, fy + t * d[1] + gy, fz + t * d[2] + gz
    length = np.sqrt(x * x + y * y + z * z)
    if length == 0.0:  # from so far that the radius is lost: the side that faces the ray
        x, y, z = -d[0], -d[1], -d[2]
        length = np.sqrt(x * x + y * y + z * z)
    x, y, z = x / length, y / length, z / length
    # The shorter of the two ways to the point rounds less.
    if r * r <= t * t * (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]):
        px, py, pz = c[0] + r * x, c[1] + r * y, c[2] + r * z
    else:
        px, py, pz = o[0] + t * d[0], o[1] + t * d[1], o[2] + t * d[2]
    out.position[i, 0], out.position[i, 1], out.position[i, 2] = onto_sphere(
        px, py, pz, c[0], c[1], c[2], r
    )
    s = table.orientation[k]
    out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = s * x, s * y, s * z
    e = table.frame[k]
    a, b, h = turned(e, x, y, z)
    if table.trim is None or best.a[i] == LATER:
        out.u[i] = share_of_turn(b, a)
        out.v[i] = min(max(angle_of(np.sqrt(a * a + b * b), -h) / np.pi, 0.0), 1.0)
    else:
        out.u[i], out.v[i] = best.a[i], best.b[i]
    out.patch_id[i] = 0
    out.residual[i] = abs(length - r)
    if has_gap(table.trim, k) and is_edge(i, k, t, table.trim, table, rays):
        out.flags[i] |= EDGE


@inner
def is_edge(i, k, t, trim, table, rays):
    """Tell whether a hit on sphere k is within the gap of an edge."""
    if trim is None:
        return False
    return _side_of_root(i, k, t, 0.0, trim, table, rays)[2] > 0.0


@kernel
def finish_spheres(table, rays, best, row_of, out):
    """Describe the hits on spheres; ``row_of`` (objects,) is the object's row here or -1."""
    finish_each(finish_sphere, table, rays, best, row_of, out)
