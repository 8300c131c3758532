"""One ray against one Bezier patch: Newton iteration, and what a root is worth.

The patch's net is kept relative to the patch's own centre, so the rounding of a root scales with
the patch and its distance to the ray's origin, not with where the scene stands. Newton iterates on
the three unknowns (u, v, t) of S(u, v) = o + t d (Toth 1985, "On ray tracing parametric
surfaces"); its step needs only cross products.
"""

import numpy as np

from hybrid_rt.intersection.kernels.patch.evaluate import evaluate_any
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, doubt, is_known, offer
from hybrid_rt.intersection.kernels.search.tolerances import MAX_STEPS, TANGENT_BAND, UNIT_ROUNDOFF
from meshing.kernels.jit import inlined, inner

CONVERGED, FAILED = 1, 0
# After a step this small (relative to the cell) the next would be below rounding.
LAST_STEP = 1e-8
# The equation holds to rounding where it is off by no more than this part of the bound.
ROOT = 0.5
# Steps to the point of a border that is next to a ray which passes just beyond it.
BORDER_APPROACHES = 3
# A border farther away in parameters than this many bands is farther away in space than one.
NEAR = 4.0
# A ray that passes a border by no more than this many roundings of a root meets it: one for the
# root, one for the point of the border, one for what Newton's iteration leaves.
BORDER = 3.0
# Parameters further outside [0, 1] are of no use to anybody.
REACH = 1.0


@inlined
def rounding_of_root(degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, t):
    """Bound the rounding of S(u, v) - o - t d, for parameters within the patch.

    The sum is that of ``docs/rounding_patches.md``, lines E1 to E5, with one unit more in each term.
    """
    distance = np.sqrt(ox * ox + oy * oy + oz * oz)
    along = abs(t) * np.sqrt(dx * dx + dy * dy + dz * dz)
    return UNIT_ROUNDOFF * (
        (4.0 * (degree_u + degree_v) + 2.0) * size + 3.0 * distance + 2.0 * along
    )


@inlined
def band_of(around, k, x, y, z, dx, dy, dz, shift):
    """Return 64 eps x scale for a patch, in lengths of the frame.

    The scale is that of its object: ``around[k]`` holds the object's middle and size. The ray's
    origin has been advanced by ``shift`` d to (x, y, z).
    """
    ax, ay, az = (
        x - shift * dx - around[k, 0],
        y - shift * dy - around[k, 1],
        z - shift * dz - around[k, 2],
    )
    return TANGENT_BAND * max(np.sqrt(ax * ax + ay * ay + az * az), around[k, 3])


@inner
def newton(
    control, start, degree_u, degree_v, basis, size, ox, oy, oz, dx, dy, dz, u, v, t, side_u, side_v
):
    """Solve S(u, v) = o + t d from a start, to the last digits that rounding leaves.

    It has converged when a step is small beside the sides of the cell, so that the next would be
    below rounding, or when the equation holds to rounding already. It gives up where the
    parameters are far outside the patch, or the tangents and the ray lie in one plane, or
    `MAX_STEPS` do not suffice.

    Returns
    -------
    status, u, v, t, steps
    n_dot_d : |n.d| with n unit
    gain_u, gain_v : how far u and v move when the equation is off by a length of one
    """
    n_dot_d = gain_u = gain_v = 0.0
    error = rounding_of_root(degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, t)
    for step in range(1, MAX_STEPS + 1):
        x, y, z, xu, yu, zu, xv, yv, zv = evaluate_any(
            control, start, degree_u, degree_v, u, v, basis
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


@inner
def approach(
    control, start, degree_u, degree_v, basis, ox, oy, oz, dx, dy, dz, u, v, u0, u1, v0, v1, steps
):
    """Move (u, v) within a rectangle so that S(u, v) lies beside the ray; return u, v, t, gap, |n.d|.

    At a silhouette both tangents point the same way as seen along the ray: one of them, the longer,
    can cancel what separates the two along it; across it they are no further apart than rounding.
    """
    dd = dx * dx + dy * dy + dz * dz
    for step in range(steps + 1):
        x, y, z, xu, yu, zu, xv, yv, zv = evaluate_any(
            control, start, degree_u, degree_v, u, v, basis
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
def offer_root(
    i, u, v, t, n_dot_d, degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, shift, to_world,
    object_id, patch, t_min, known, best,
):  # fmt: skip
    """Offer a root within the patch as a hit; tell whether it may be one."""
    error = rounding_of_root(degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, t)
    t_world = (t + shift) * to_world
    t_bound = (2.0 * error / n_dot_d + 2.0 * UNIT_ROUNDOFF * abs(t + shift)) * to_world
    if not t_world > t_min[i] or is_known(i, t_world, t_bound, n_dot_d, known):
        return False
    offer(i, t_world, t_bound, n_dot_d, CLEAR, object_id, patch, u, v, t_min, known, best)
    return True


@inner
def offer_border(
    i, u, v, t, n_dot_d, gain_u, gain_v,
    control, start, basis, degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, band, is_owner,
    shift, to_world, object_id, patch, t_min, known, best,
):  # fmt: skip
    """Offer the point of the border next to a root beyond it; tell whether it may be a hit.

    It is one if the ray passes it by no more than rounding, so a ray through an edge that two
    patches share meets at least one of them; and a doubt within the band. (With a band of nothing no
    doubts are noted.) ``is_owner`` tells whether the point is this cell's to offer.
    """
    error = rounding_of_root(degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, t)
    accepted = BORDER * error if band == 0.0 else min(BORDER * error, band)
    reach = NEAR * max(band, accepted)
    if not (
        -reach * gain_u <= u <= 1.0 + reach * gain_u
        and -reach * gain_v <= v <= 1.0 + reach * gain_v
    ):
        return False
    u, v, t, gap, _ = approach(
        control, start, degree_u, degree_v, basis, ox, oy, oz, dx, dy, dz,
        min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0), 0.0, 1.0, 0.0, 1.0, BORDER_APPROACHES,
    )  # fmt: skip
    if gap <= accepted:
        return is_owner and offer_root(
            i, u, v, t, n_dot_d, degree_u, degree_v, size, ox, oy, oz, dx, dy, dz, shift, to_world,
            object_id, patch, t_min, known, best,
        )  # fmt: skip
    if gap <= band:
        doubt(i, (t + shift) * to_world, band * to_world, t_min, known, best)
    return False


# For the one place that runs for every candidate; elsewhere a call costs less than compiling it.
newton_inlined = inlined(getattr(newton, "py_func", newton))
offer_root_inlined = inlined(getattr(offer_root, "py_func", offer_root))
