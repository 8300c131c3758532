"""One ray against one Bezier patch: Newton iteration, and what a root is worth.

The patch's net is kept relative to the patch's own centre, so the rounding of a root scales with
the patch and its distance to the ray's origin, not with where the scene stands. Newton iterates on
the three unknowns (u, v, t) of S(u, v) = o + t d (Toth 1985, "On ray tracing parametric
surfaces"); its step needs only cross products.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.evaluate import evaluate_any
from hybrid_rt.intersection.kernels.search.nearest import (
    CLEAR,
    begins_at,
    doubt,
    is_passed,
    note_departure,
    offer,
)
from hybrid_rt.intersection.kernels.search.tolerances import MAX_STEPS, TANGENT_BAND, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.trims import (
    band_of_ray,
    decide,
    is_steady,
    may_be_kept,
    side_of_tile,
)
from meshing.kernels.jit import inlined, inner
from meshing.kernels.trims import CROSSED, INSIDE, OUTSIDE

CONVERGED, FAILED = 1, 0
# After a step this small (relative to the cell) the next would be below rounding.
LAST_STEP = 1e-8
# The equation holds to rounding where it is off by no more than this part of the bound.
ROOT = 0.5
# After so many steps what is left across the tangent plane is no longer followed where it is rounding:
# of a ray nearly in that plane it would throw u, v and t about for ever.
STEPS_IN_SPACE = 4
# Steps to the point of a border that is next to a ray which passes just beyond it.
BORDER_APPROACHES = 3
# A border farther away in parameters than this many bands is farther away in space than one.
NEAR = 4.0
# A ray that passes a border by no more than this many roundings of a root meets it: one for the
# root, one for the point of the border, one for what Newton's iteration leaves.
BORDER = 3.0
# Parameters further outside [0, 1] are of no use to anybody.
REACH = 1.0


class Patch(NamedTuple):
    """One patch: a row of a `PatchTable`."""

    control: Any  # the nets of all patches, relative to their centres
    start: Any  # its first control point
    degree_u: Any
    degree_v: Any
    basis: Any  # scratch of `evaluate_any`
    rational: Any  # as in `PatchTable`
    size: Any  # largest distance of a control point from its centre
    object_id: Any
    row: Any
    trim: Any  # as in `PatchTable`


class PatchRay(NamedTuple):
    """A ray from the centre of a patch: o + t d, where the caller's t is (t + shift) to_world."""

    ox: Any
    oy: Any
    oz: Any
    dx: Any
    dy: Any
    dz: Any
    shift: Any
    to_world: Any


@inlined
def patch_of(table, k, basis):
    """Return one row of a table as a `Patch`."""
    m, n = 3, 3  # known to the compiler where all patches are bicubic
    if basis is not None:
        m, n = table.degree[k, 0], table.degree[k, 1]
    return Patch(
        table.control, table.start[k], m, n, basis, table.rational, table.size[k],
        table.object_id[k], k, table.trim,
    )  # fmt: skip


@inlined
def from_centre(table, k, ray):
    """Return a `FrameRay` as seen from the centre of a patch."""
    ox, oy, oz = (
        (ray.x - table.centre[k, 0]) + ray.lx,
        (ray.y - table.centre[k, 1]) + ray.ly,
        (ray.z - table.centre[k, 2]) + ray.lz,
    )
    return PatchRay(ox, oy, oz, ray.dx, ray.dy, ray.dz, ray.shift, ray.to_world)


@inlined
def rounding_of_root(degree_u, degree_v, rational, size, ox, oy, oz, dx, dy, dz, t):
    """Bound the rounding of S(u, v) - o - t d, for parameters within the patch.

    The sum is that of ``docs/rounding_patches.md``, lines E1 to E5, with one unit more in each term.
    """
    distance = np.sqrt(ox * ox + oy * oy + oz * oz)
    along = abs(t) * np.sqrt(dx * dx + dy * dy + dz * dz)
    sums = 4.0 if rational is None or not rational else 8.0
    return UNIT_ROUNDOFF * (
        (sums * (degree_u + degree_v) + 2.0) * size + 3.0 * distance + 2.0 * along
    )


@inlined
def band_of(around, k, ray):
    """Return 64 eps x scale for a patch and a `FrameRay`, in lengths of the frame.

    The scale is that of its object: ``around[k]`` holds the object's middle and size.
    """
    ax, ay, az = (
        ray.x - ray.shift * ray.dx - around[k, 0],
        ray.y - ray.shift * ray.dy - around[k, 1],
        ray.z - ray.shift * ray.dz - around[k, 2],
    )
    return TANGENT_BAND * max(np.sqrt(ax * ax + ay * ay + az * az), around[k, 3])


@inner(outlined=True)
def newton(patch, ray, u, v, t, side_u, side_v):
    """Solve S(u, v) = o + t d from a start, to the last digits that rounding leaves.

    It has converged when a step is small beside the sides of the cell, so that the next would be
    below rounding, or when the equation holds to rounding already. It gives up where the
    parameters are far outside the patch, or the tangents and the ray lie in one plane, or
    `MAX_STEPS` do not suffice.

    Returns status, u, v, t, steps.
    ``n_dot_d`` |n.d| with n unit.
    ``gain_u``, ``gain_v`` how far u and v move when the equation is off by a length of one.
    """
    control, start, degree_u, degree_v, basis, rational, size, _, _, _ = patch
    ox, oy, oz, dx, dy, dz, _, _ = ray
    n_dot_d = gain_u = gain_v = 0.0
    error = rounding_of_root(degree_u, degree_v, rational, size, ox, oy, oz, dx, dy, dz, t)
    for step in range(1, MAX_STEPS + 1):
        x, y, z, xu, yu, zu, xv, yv, zv = evaluate_any(
            control, start, degree_u, degree_v, u, v, basis, rational
        )
        rx, ry, rz = ox + t * dx - x, oy + t * dy - y, oz + t * dz - z
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        det = nx * dx + ny * dy + nz * dz
        if det == 0.0:
            return FAILED, u, v, t, step, n_dot_d, gain_u, gain_v
        ax, ay, az = yv * dz - zv * dy, zv * dx - xv * dz, xv * dy - yv * dx
        bx, by, bz = dy * zu - dz * yu, dz * xu - dx * zu, dx * yu - dy * xu
        inv = 1.0 / det
        du = (rx * ax + ry * ay + rz * az) * inv
        dv = (rx * bx + ry * by + rz * bz) * inv
        rr = rx * rx + ry * ry + rz * rz
        # Nearly in the tangent plane rounding becomes a long step, which would leave the surface.
        is_root = rr <= (ROOT * error) ** 2
        if not is_root and step > STEPS_IN_SPACE:
            rn, nn = rx * nx + ry * ny + rz * nz, nx * nx + ny * ny + nz * nz
            if rn * rn <= (ROOT * error) ** 2 * nn:
                rx, ry, rz = rx - rn / nn * nx, ry - rn / nn * ny, rz - rn / nn * nz
                du = (rx * ax + ry * ay + rz * az) * inv
                dv = (rx * bx + ry * by + rz * bz) * inv
        if not is_root:
            u += du
            v += dv
            t -= (rx * nx + ry * ny + rz * nz) * inv
        if is_root or (abs(du) <= LAST_STEP * side_u and abs(dv) <= LAST_STEP * side_v):
            n_dot_d = abs(det) / np.sqrt(nx * nx + ny * ny + nz * nz)
            # Such a step leaves eps |r| / |n.d| beside the ray: below rounding, or one more step.
            if is_root or rr <= (size * n_dot_d) ** 2:
                gain_u = np.sqrt(ax * ax + ay * ay + az * az) * abs(inv)
                gain_v = np.sqrt(bx * bx + by * by + bz * bz) * abs(inv)
                return CONVERGED, u, v, t, step, n_dot_d, gain_u, gain_v
        if not (-REACH <= u <= 1.0 + REACH and -REACH <= v <= 1.0 + REACH):
            return FAILED, u, v, t, step, n_dot_d, gain_u, gain_v
    return FAILED, u, v, t, MAX_STEPS, n_dot_d, gain_u, gain_v


@inner(outlined=True)
def approach(patch, ray, u, v, u0, u1, v0, v1, steps):
    """Move (u, v) within a rectangle so that S(u, v) lies beside the ray; return u, v, t, gap, |n.d|.

    At a silhouette both tangents point the same way as seen along the ray: one of them, the longer,
    can cancel what separates the two along it; across it they are no further apart than rounding.
    """
    control, start, degree_u, degree_v, basis, rational, _, _, _, _ = patch
    ox, oy, oz, dx, dy, dz, _, _ = ray
    dd = dx * dx + dy * dy + dz * dz
    for step in range(steps + 1):
        x, y, z, xu, yu, zu, xv, yv, zv = evaluate_any(
            control, start, degree_u, degree_v, u, v, basis, rational
        )
        rx, ry, rz = x - ox, y - oy, z - oz
        t = (rx * dx + ry * dy + rz * dz) / dd
        rx, ry, rz = t * dx - rx, t * dy - ry, t * dz - rz
        if step == steps:
            break
        along = (xu * dx + yu * dy + zu * dz) / dd
        xu, yu, zu = xu - along * dx, yu - along * dy, zu - along * dz
        along = (xv * dx + yv * dy + zv * dz) / dd
        xv, yv, zv = xv - along * dx, yv - along * dy, zv - along * dz
        uu, vv = xu * xu + yu * yu + zu * zu, xv * xv + yv * yv + zv * zv
        if uu == 0.0 and vv == 0.0:
            continue
        to_u = u + (rx * xu + ry * yu + rz * zu) / uu if uu > 0.0 else u0 - 1.0
        to_v = v + (rx * xv + ry * yv + rz * zv) / vv if vv > 0.0 else v0 - 1.0
        # Along the longer tangent, unless a border is in the way and not in the other's; where
        # borders are in both ways, as far as they allow.
        in_u, in_v = u0 <= to_u <= u1, v0 <= to_v <= v1
        if in_u and (uu >= vv or not in_v):
            u = to_u
        elif in_v:
            v = to_v
        else:
            u, v = min(max(to_u, u0), u1), min(max(to_v, v0), v1)
    nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    n_dot_d = abs(nx * dx + ny * dy + nz * dz) / length if length > 0.0 else np.inf
    return u, v, t, np.sqrt(rx * rx + ry * ry + rz * rz), n_dot_d


@inner
def is_inside_loops(i, u, v, t, trim, patch, ray, rays, best):
    """Tell whether a root on a trimmed patch is a hit; note a doubt if the band decides it is none.

    Returns ``is_kept``.
    ``edge``: what the gap of an edge adds to the bound of t, as the caller counts it.
    """
    if (
        trim is None or not trim.member.shape[0]
    ):  # an argument of its own: numba leaves the rest out
        return True, 0.0
    k = patch.row
    side = side_of_tile(trim, k, u, v)
    if side == OUTSIDE and trim.gap[k] == 0.0:
        return False, 0.0
    if side == INSIDE and trim.gap[k] == 0.0:
        return True, 0.0
    ox, oy, oz, dx, dy, dz, shift, to_world = ray
    _, _, _, xu, yu, zu, xv, yv, zv = evaluate_any(
        patch.control, patch.start, patch.degree_u, patch.degree_v, u, v, patch.basis,
        patch.rational,
    )  # fmt: skip
    if side != CROSSED:
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        room = (nx * dx + ny * dy + nz * dz) ** 2 / (dx * dx + dy * dy + dz * dz)
        per_u, per_v = xv * xv + yv * yv + zv * zv, xu * xu + yu * yu + zu * zu
        if is_steady(trim, k, per_u, per_v, 0.0, room):
            return side == INSIDE, 0.0
    band = band_of_ray(trim, k, ox - shift * dx, oy - shift * dy, oz - shift * dz)
    is_hit, is_within, edge = decide(trim, k, u, v, xu, yu, zu, xv, yv, zv, dx, dy, dz, band)
    if is_within and not is_hit:
        doubt(i, (t + shift) * to_world, band * to_world, rays.t_min, rays.known, best)
    return is_hit, edge * to_world / np.sqrt(dx * dx + dy * dy + dz * dz)


@inner(outlined=True)
def doubt_piece(i, t, reach, u, v, hu, hv, patch, ray, rays, best):
    """Note that the patch, within hu and hv of (u, v), passes the ray at t within ``reach``."""
    if _may_be_kept(patch.trim, patch.row, u, v, hu, hv):
        t, reach = (t + ray.shift) * ray.to_world, reach * ray.to_world
        doubt(i, t, reach, rays.t_min, rays.known, best)


@inlined
def _may_be_kept(trim, k, u, v, hu, hv):
    """Tell whether loops leave any of a piece."""
    if trim is None or not trim.member.shape[0]:
        return True
    return may_be_kept(trim, k, u, v, hu, hv)


@inner(outlined=True)
def offer_root(i, u, v, t, n_dot_d, patch, ray, rays, best):
    """Offer a root within the patch as a hit of ray i; tell whether it may be one."""
    ox, oy, oz, dx, dy, dz, shift, to_world = ray
    t_min, known = rays.t_min, rays.known
    error = rounding_of_root(
        patch.degree_u, patch.degree_v, patch.rational, patch.size, ox, oy, oz, dx, dy, dz, t
    )
    t_world = (t + shift) * to_world
    t_bound = (2.0 * error / n_dot_d + 2.0 * UNIT_ROUNDOFF * abs(t + shift)) * to_world
    if is_passed(i, t_world, t_bound, n_dot_d, patch.object_id, known):
        _, _, _, xu, yu, zu, xv, yv, zv = evaluate_any(
            patch.control, patch.start, patch.degree_u, patch.degree_v, u, v, patch.basis,
            patch.rational,
        )  # fmt: skip
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        if length > 0.0 and begins_at(i, t_world, t_bound, n_dot_d, known):
            nx, ny, nz = nx / length, ny / length, nz / length
            note_departure(i, nx, ny, nz, t_min, known, best)
        return False
    if not t_world + t_bound > t_min[i]:
        return False
    is_kept, edge = is_inside_loops(i, u, v, t, patch.trim, patch, ray, rays, best)
    if not is_kept:
        return False
    t_bound += edge
    offer(i, t_world, t_bound, n_dot_d, CLEAR, patch.object_id, patch.row, u, v, t_min, known, best)
    return t_world > t_min[i]


@inner(outlined=True)
def offer_border(
    i, u, v, t, n_dot_d, gain_u, gain_v, patch, ray, band, is_owner, rays, best
):  # fmt: skip
    """Offer the point of the border next to a root beyond it; tell whether it may be a hit.

    It is one if the ray passes it by no more than rounding, so a ray through an edge that two
    patches share meets at least one of them; and a doubt within the band. (With a band of nothing no
    doubts are noted.) ``is_owner`` tells whether the point is this cell's to offer.
    """
    ox, oy, oz, dx, dy, dz, _, _ = ray
    error = rounding_of_root(
        patch.degree_u, patch.degree_v, patch.rational, patch.size, ox, oy, oz, dx, dy, dz, t
    )
    accepted = BORDER * error if band == 0.0 else min(BORDER * error, band)
    reach = NEAR * max(band, accepted)
    if not (
        -reach * gain_u <= u <= 1.0 + reach * gain_u
        and -reach * gain_v <= v <= 1.0 + reach * gain_v
    ):
        return False
    u, v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
    u, v, t, gap, _ = approach(patch, ray, u, v, 0.0, 1.0, 0.0, 1.0, BORDER_APPROACHES)
    if gap <= accepted:
        return is_owner and offer_root(i, u, v, t, n_dot_d, patch, ray, rays, best)
    if gap <= band:
        doubt_piece(i, t, band, u, v, band * gain_u, band * gain_v, patch, ray, rays, best)
    return False


# For the one place that runs for every candidate; elsewhere a call costs less than compiling it.
newton_inlined = inlined(getattr(newton, "py_func", newton))
offer_root_inlined = inlined(getattr(offer_root, "py_func", offer_root))
