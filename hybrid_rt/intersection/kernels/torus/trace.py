"""Rays against tori, each first hit proven to be the first.

A point at distance rho from the axis and height z is D = |(rho - R, z)| away from the circle in
the middle of the tube, so its distance from the torus is f = D - r. That says for every t how far
the ray would have to be moved to touch the torus there: what is decided within rounding shows by
itself. No quartic is formed, whose coefficients would cancel (Hanrahan, "Ray tracing
algebraic surfaces", SIGGRAPH 1983, forms it).

Along a ray with unit direction, q = D^2 = |x|^2 + R^2 - 2 R rho is a parabola less 2 R times a
hyperbola:

    q' / 2 = s + x0.d - R rho',   q'' / 2 = 1 - R rho'',   rho'' = E / rho^3

with E = (x dy - y dx)^2, taken across the axis. So q is concave where rho^3 < R E, in one interval
around the point nearest the axis, and convex before and behind it: at most two minima with a
maximum between them. Tangents at two points bound a convex q from below (a
concave one from above): where that bound keeps away from r^2, nothing is met. Where it does not,
Newton's iteration on q' goes on to the extremum itself, whose f tells hit, miss or TANGENT. Between
two extrema f runs one way and has one root, found by Newton's iteration in a bracket; f a little
before and behind it, beyond its rounding, proves how far off it can be.

Rounding, with everything within 1 of the frame's origin (u = 2^-53). The point of the ray nearest
the torus' origin is found in two parts and then rounded (u), turned into the torus' frame, whose
rows are unit and at right angles to 4 u, by dot products of three terms (3 u a coordinate), and so is
the direction; s times it is added (2 u). All this moves points of the ray by less than 14 u (|x0| +
|s|). Then rho, rho - R, D and f round by 3 u rho + 3 u D + u (R + r). With |x0|, |s| <= 1 and R + r <=
1 the sum stays below 40 u at the surface: `ROUNDING` bounds the error of f there. Shifts of the ray
that are the same for all s do not change the shape of q; what is left of the error of q' is
proportional to |s|, |x0.d| and |R rho'|.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.axial_trims import (
    LONG,
    TURN,
    side_about_axis,
    touches_kept,
)
from hybrid_rt.intersection.kernels.search.counters import NODES
from hybrid_rt.intersection.kernels.search.frame import (
    MARGIN,
    clearly_passes,
    cut_to_slab,
    cylinder_roots,
    enter_turned_frame,
    share_of_turn,
    turned,
    turned_point,
)
from hybrid_rt.intersection.kernels.search.members import finish_each, offer_each, offer_near
from hybrid_rt.intersection.kernels.search.nearest import doubt, is_left_behind, not_zero, offer
from hybrid_rt.intersection.kernels.search.rays import EDGE
from hybrid_rt.intersection.kernels.search.tolerances import NEAR_BEGIN, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.trims import has_gap
from hybrid_rt.intersection.kernels.torus.solve import (
    INSIDE,
    NEAR_INSIDE,
    NEAR_OUTSIDE,
    OUTSIDE,
    ROUNDING,
    Line,
    bound_of_root,
    find_extremum,
    find_root,
    guess_root,
    look,
)
from meshing.kernels.jit import inlined, inner, kernel

# The origin of s is moved to the point nearest the axis unless that is farther away than this.
NEAR_AXIS = 2.5


class TorusTable(NamedTuple):
    """Tori, each with a frame in which R + r is from 1/2 to 1; row k is object ``object_id[k]``."""

    origin: Any  # (k, 4) world; and, in the frame, `meshing.surface.Surface.moved`
    size: Any  # (k,) world: R + r; more, if rounding has moved an image
    frame: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    to_frame: Any  # (k,) powers of two
    major: Any  # (k,) in the frame
    minor: Any  # (k,)
    orientation: Any  # (k,): 1 normals outward, -1 inward
    object_id: Any  # (k,) int32
    trim: Any  # None: they are whole; else `search.trims.Trim`


def torus_table(tori, object_id, trim=None):
    """Return the table of a list of tori, and of the loops that trim all of them."""
    size = np.array([torus.major_radius + torus.minor_radius for torus in tori])
    to_frame = 2.0 ** -np.ceil(np.log2(size))
    moved = np.array([torus.moved for torus in tori])
    return TorusTable(
        origin=np.column_stack([[torus.origin for torus in tori], moved * to_frame]),
        size=size + 2.0 * moved,
        frame=np.array([np.stack([t.radial, t.binormal, t.axis]) for t in tori]),
        to_frame=to_frame,
        major=np.array([torus.major_radius for torus in tori]) * to_frame,
        minor=np.array([torus.minor_radius for torus in tori]) * to_frame,
        orientation=np.array([float(torus.orientation) for torus in tori]),
        object_id=object_id,
        trim=None if trim is None else trim._replace(gap=trim.gap * to_frame),
    )


@inlined
def side_of_root(trim, k, line, s, orientation, band):
    """Decide about a root at s on torus k, see `side_about_axis`; return its u and v as well."""
    if trim is None:
        return True, False, 0.0, 0.0, 0.0
    x, y, z = line.x + s * line.vx, line.y + s * line.vy, line.z + s * line.vz
    beside = np.sqrt(x * x + y * y) - line.major
    u, v, turn = share_of_turn(y, x), share_of_turn(orientation * z, beside), TURN * orientation
    is_hit, is_within, edge = side_about_axis(
        trim, k, x, y, u, v, -turn * z, turn * beside, line.vx, line.vy, line.vz, band
    )
    return is_hit, is_within, edge, u, v


@inner
def grazes_kept(trim, k, line, s, orientation, band):
    """Tell whether the torus where a ray grazes it, around s, may be inside the loops."""
    if trim is None:
        return True
    x, y, z = line.x + s * line.vx, line.y + s * line.vy, line.z + s * line.vz
    v = share_of_turn(orientation * z, np.sqrt(x * x + y * y) - line.major)
    reach = LONG * np.sqrt(band)
    return touches_kept(trim, k, x, y, v, TURN * line.minor, reach)


@inlined
def offer_torus(i, k, table, rays, best):
    """Offer the roots of ray i with torus k, one after the other, until one is taken."""
    to_frame, major, minor = table.to_frame[k], table.major[k], table.minor[k]
    moved = table.origin[k, 3]
    ray = enter_turned_frame(
        i, rays, best, table.origin[k], table.frame[k], to_frame, major + minor + moved
    )
    if ray.half <= 0.0:
        return
    x, y, z, vx, vy, vz, half, length, t_of_zero, band = ray
    per_t, to_world, band = 1.0 / length, 1.0 / to_frame, band + moved
    # --- within the slab of the tube; f is positive at both ends
    thick = minor + 2.0 * band + MARGIN
    lo, hi = cut_to_slab(-half, half, z, vz, -thick, thick)
    if lo >= hi:
        return
    # --- from the point nearest the axis, unless the ray runs along that
    across, turn, area = vx * vx + vy * vy, x * vx + y * vy, x * vy - y * vx
    along, spread = turn + z * vz, area * area
    if abs(turn) <= NEAR_AXIS * across and across > 0.0:
        step = -turn / across
        x, y, z = x + step * vx, y + step * vy, z + step * vz
        lo, hi, t_of_zero = lo - step, hi - step, t_of_zero + step * per_t
        turn, along, spread = 0.0, z * vz, across * (x * x + y * y)
    line = Line(x, y, z, vx, vy, vz, across, turn, along, spread, major, minor)
    # --- where q is concave; where rho is less than half of R - r there is nothing to meet
    bends, hollow = np.cbrt(major * spread), 0.5 * (major - minor)
    ring = max(bends, hollow)
    square = across * ring * ring - spread
    first = second = hi
    if square > 0.0:
        root = np.sqrt(square)
        beside = x * x + y * y - ring * ring
        first, second = cylinder_roots(across, turn, beside, root)
        first, second = min(max(first, lo), hi), min(max(second, lo), hi)
    is_hollow = bends < hollow and first < second
    _, slope_lo, _, _ = look(line, lo)
    _, slope_first, _, _ = look(line, first)
    _, slope_second, _, _ = look(line, second)
    _, slope_hi, _, _ = look(line, hi)
    if slope_first < 0.0 <= slope_second and not is_hollow:
        # Flat to rounding between both: as good as convex everywhere.
        first, second, slope_first, slope_second = hi, hi, slope_hi, slope_hi
    # --- from extremum to extremum: where f changes its sign there is a root between
    before, was_inside, was_near = lo, False, False
    for place in range(4):
        known, s = OUTSIDE, hi
        if place == 0:
            if not slope_lo < 0.0 <= slope_first:
                continue
            known, s = find_extremum(line, lo, first, 1.0, band)
        elif place == 1:
            if is_hollow:
                known = OUTSIDE if hollow > band + ROUNDING else NEAR_OUTSIDE
                s = 0.5 * (first + second)
            elif slope_first >= 0.0 > slope_second:
                known, s = find_extremum(line, first, second, -1.0, band)
            else:
                continue
        elif place == 2:
            if not slope_second < 0.0 <= slope_hi or second == hi:
                continue
            known, s = find_extremum(line, second, hi, 1.0, band)
        is_inside, is_near = known in (INSIDE, NEAR_INSIDE), known in (NEAR_OUTSIDE, NEAR_INSIDE)
        if is_inside == was_inside:
            t = (t_of_zero + s * per_t) * to_world
            if (
                is_near
                # The torus that was meant may be met on both sides of it; its contacts are of order 4.
                and t + 2.0 * np.sqrt(np.sqrt(moved)) * per_t * to_world > rays.t_min[i]
                and grazes_kept(table.trim, k, line, s, table.orientation[k], band)
            ):
                best.doubt[i] = min(best.doubt[i], t)
        else:
            start = guess_root(line, s, -1.0) if is_inside else guess_root(line, before, 1.0)
            s_root = find_root(line, before, s, 1.0 if is_inside else -1.0, start)
            t = not_zero((t_of_zero + s_root * per_t) * to_world, moved)
            if t > best.t[i]:
                return
            near = is_near or was_near
            reach = NEAR_BEGIN * per_t * to_world
            if near or moved > 0.0 or not is_left_behind(i, t, reach, rays.t_min, rays.known):
                is_kept, is_within, edge, u, v = side_of_root(
                    table.trim, k, line, s_root, table.orientation[k], band
                )
                if is_kept:
                    bound = bound_of_root(line, s_root, near, moved) * per_t
                    bound += 4.0 * UNIT_ROUNDOFF * (abs(t_of_zero) + abs(s_root * per_t))
                    bound += edge * per_t
                    _, slope, away, _ = look(line, s_root)
                    if offer(
                        i, t, bound * to_world, abs(slope) / away * length, near or is_within,
                        table.object_id[k], 0, u, v, rays.t_min, rays.known, best,
                    ):  # fmt: skip
                        return
                elif is_within or (
                    near and grazes_kept(table.trim, k, line, s_root, table.orientation[k], band)
                ):
                    doubt(i, t, band * to_world, rays.t_min, rays.known, best)
        before, was_inside, was_near = s, is_inside, is_near


@inlined
def _offer_if_near(i, k, table, rays, best):
    # Most rays clearly pass the ball around a torus: there is nothing to solve.
    if not clearly_passes(i, rays, table.origin[k], table.size[k]):
        offer_torus(i, k, table, rays, best)


@kernel
def trace_tori(table, end, rays, best, any_hit):
    """Lower ``best`` to the nearest roots on the tori up to row ``end``."""
    for i in range(rays.origin.shape[0]):
        offer_each(i, _offer_if_near, end, table, rays, best, any_hit)


@kernel
def trace_torus_tree(table, members, rays, best, any_hit, stack, counters):
    """As `trace_tori`, for the tori in a tree."""
    for i in range(rays.origin.shape[0]):
        counters[NODES] += offer_near(i, _offer_if_near, table, members, rays, best, any_hit, stack)


@inner
def is_edge(i, k, x, y, z, trim, table, rays):
    """Tell whether a hit at (x, y, z) in the frame of torus k is within the gap of an edge."""
    if trim is None:
        return False
    d = rays.direction[i]
    vx, vy, vz = turned(table.frame[k], d[0], d[1], d[2])
    line = Line(x, y, z, vx, vy, vz, 0.0, 0.0, 0.0, 0.0, table.major[k], table.minor[k])
    return side_of_root(trim, k, line, 0.0, table.orientation[k], 0.0)[2] > 0.0


@inlined
def _finish_torus(table, k, rays, best, i, out):
    """Describe the hit of ray i on torus k."""
    c, e = table.origin[k], table.frame[k]
    to_frame, major, minor = table.to_frame[k], table.major[k], table.minor[k]
    x, y, z = turned_point(i, rays, best.t[i], c, e, to_frame)
    rho = np.sqrt(x * x + y * y)
    beside = rho - major
    away = np.sqrt(beside * beside + z * z)
    if has_gap(table.trim, k) and is_edge(i, k, x, y, z, table.trim, table, rays):
        out.flags[i] |= EDGE
    # Along the ring's radius, and the normal: along that and along the axis.
    x, y = x / rho, y / rho
    n, m = beside / away, z / away
    s = table.orientation[k]
    ring = (major + minor * n) / to_frame
    lift = minor * m / to_frame
    for j in range(3):
        radius = x * e[0, j] + y * e[1, j]
        out.position[i, j] = c[j] + (ring * radius + lift * e[2, j])
        out.normal[i, j] = s * (n * radius + m * e[2, j])
    if table.trim is None:
        out.u[i], out.v[i] = share_of_turn(y, x), share_of_turn(s * m, n)
    else:
        out.u[i], out.v[i] = best.a[i], best.b[i]
    out.patch_id[i] = 0
    out.residual[i] = abs(away - minor) / to_frame


@kernel
def finish_tori(table, rays, best, row_of, out):
    """Describe the hits on tori; ``row_of`` (objects,) is the object's row here or -1."""
    finish_each(_finish_torus, table, rays, best, row_of, out)
