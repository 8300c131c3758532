"""What is known of hits on Bezier patches: refined without proof, counted, and described."""

import numpy as np

from hybrid_rt.intersection.kernels.patch.evaluate import evaluate_any
from hybrid_rt.intersection.kernels.patch.solve import (
    CONVERGED,
    band_of,
    from_centre,
    newton,
    offer_border,
    offer_root,
    patch_of,
)
from hybrid_rt.intersection.kernels.search.coarse import parameters_at
from hybrid_rt.intersection.kernels.search.counters import CHANGED
from hybrid_rt.intersection.kernels.search.frame import FrameRay, any_normal, enter_frame
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, SUSPECT, WITHIN_BAND, is_unseen
from hybrid_rt.intersection.kernels.search.rays import EDGE, NORMAL_DEGENERATE
from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND
from hybrid_rt.intersection.kernels.search.trims import band_of_ray, decide, sure_side
from meshing.kernels.bernstein import unit_normal
from meshing.kernels.jit import inlined, kernel
from meshing.kernels.trims import CROSSED

# Squares of sines below this leave the normal to `unit_normal`; so do squares of partials below this
# part of the patch's largest, since what is summed here is right to roundings of the patch's size.
CLEAR_SINE, CLEAR_TANGENT = 1e-16, 2.0**-10
# Of `PatchTable.bend`: where its closed poles begin, and the columns of one (`kinds.closed_poles`).
POLES, POLE_COLUMNS = 5, 8
# ``steep`` times the tangent of a ray's angle with the axis of a pole up to which it is known to be
# closed as the ray sees it.
ASLANT = 0.25
# Points of its disc that the ray passes within r are within r times (1 + steep) times this over the
# cosine; along the ray with steep cos + sin instead of 1 + steep.
WIDENED = 4.0
# Next to the point the roundings of a ray move it to another meridian.
NEXT_TO_POINT = 16.0
# A root stays in the patch, alone, when the ray moves by one band if twice the way that this takes
# in parameters leads over no border, and second differences add less than this along that way.
STEADY = 0.25
# A bound of twice the rounding over |n.d| has room for a residual of this part of it.
LEFT = 0.25


@kernel
def count_changed(t_guess, t_before, best, counters):
    """Count the rays that a hit nearer than what their guess refined to was found for."""
    changed = 0
    for i in range(t_guess.shape[0]):
        # Two Newton iterations agree to their bounds, which roughly are the same.
        if best.t[i] < t_before[i] and best.t[i] + 4.0 * best.t_bound[i] < t_guess[i]:
            changed += 1
    counters[CHANGED] += changed


@kernel
def refine_patches(table, hits, triangles, first_patch, rows, rays, aside, best, basis, accepted):
    """Newton from coarse hits, with no proof of anything (accuracy "refined", and displaced rays).

    ``aside``, (n, 3) or (0, 3), moves each ray, in lengths of the frame. The rest is as in
    `CurvedKind.refine`.
    """
    to_world = 1.0 / table.to_frame
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        if first_patch[triangles.object_id[f]] < 0:
            continue
        if is_unseen(i, triangles.object_id[f], rays.known):
            continue
        k = first_patch[triangles.object_id[f]] + triangles.piece[f]
        o, middle = rays.origin[i], table.middle
        a, b = parameters_at(triangles, f, hits.u[j], hits.v[j])
        d = rays.direction[i]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], table.to_frame
        )
        if aside.shape[0] > 0:
            hx, hy, hz = hx + aside[i, 0], hy + aside[i, 1], hz + aside[i, 2]
        ray = FrameRay(hx, hy, hz, lx, ly, lz, d[0], d[1], d[2], shift, to_world)
        patch, line = patch_of(table, k, basis), from_centre(table, k, ray)
        status, a, b, s, _, n_dot_d, gain_u, gain_v = newton(
            patch, line, a, b, hits.t[j] * table.to_frame - shift, 1.0, 1.0
        )
        if status != CONVERGED:
            continue
        if 0.0 <= a <= 1.0 and 0.0 <= b <= 1.0:
            is_offered = offer_root(i, a, b, s, n_dot_d, patch, line, rays, best)
        else:
            is_offered = offer_border(
                i, a, b, s, n_dot_d, gain_u, gain_v, patch, line, 0.0, True, rays, best
            )
        if is_offered:
            accepted[j] = True


@inlined
def _steps(ux, uy, uz, vx, vy, vz, dx, dy, dz, det, band, bend, k):
    """Return how far u and v go when the ray moves by the band, and whether that is all there is.

    To first order the root moves by up to (du, dv). Where the tangents turn little enough over
    twice that for Krawczyk's test, it stays alone within twice (du, dv).
    """
    ax, ay, az = vy * dz - vz * dy, vz * dx - vx * dz, vx * dy - vy * dx
    bx, by, bz = uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx
    gain = band / det
    du = gain * np.sqrt(ax * ax + ay * ay + az * az)
    dv = gain * np.sqrt(bx * bx + by * by + bz * bz)
    turn = du * du * bend[k, 0] + 2.0 * du * dv * bend[k, 1] + dv * dv * bend[k, 2]
    return 2.0 * du, 2.0 * dv, turn <= STEADY * band


@inlined
def _is_closed_around(bend, k, ox, oy, oz, dx, dy, dz, x, y, z, band, error):
    """Tell whether a root is beside a closed pole that no ray moved by the band would miss.

    Returns is_closed.
    ``open_by`` how far along the ray rounding leaves it open which meridian it meets.
    """
    dd = dx * dx + dy * dy + dz * dz
    for side in range(4):
        c = POLES + side * POLE_COLUMNS
        rim = bend[k, c + 7]
        if rim == 0.0:
            continue
        px, py, pz = bend[k, c] - ox, bend[k, c + 1] - oy, bend[k, c + 2] - oz
        t = (px * dx + py * dy + pz * dz) / dd
        px, py, pz = px - t * dx, py - t * dy, pz - t * dz
        passing = np.sqrt(px * px + py * py + pz * pz)
        along = abs(bend[k, c + 3] * dx + bend[k, c + 4] * dy + bend[k, c + 5] * dz)
        cosine, steep = along / np.sqrt(dd), bend[k, c + 6]
        sine = np.sqrt(max(1.0 - cosine * cosine, 0.0))
        if steep * sine > ASLANT * cosine:
            continue
        if passing + 2.0 * band > rim * cosine:
            continue
        widened = WIDENED / cosine
        px, py, pz = x - bend[k, c], y - bend[k, c + 1], z - bend[k, c + 2]
        if np.sqrt(px * px + py * py + pz * pz) > widened * (1.0 + steep) * (passing + 2.0 * band):
            continue
        if passing > NEXT_TO_POINT * error:
            return True, 0.0
        return True, widened * (steep * cosine + sine) * (passing + error)
    return False, 0.0


@kernel
def finish_patches(table, rays, best, kind_of, kind, basis, out):
    """Fill what a hit record says of the rays whose nearest root is on a patch.

    ``kind_of`` (objects,) names the kind of each object; rows of other kinds are left alone. Rows
    that may change when the ray moves by the band become `SUSPECT`.
    """
    middle, to_world = table.middle, 1.0 / table.to_frame
    control, start, degree, centre = table.control, table.start, table.degree, table.centre
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or kind_of[best.object_id[i]] != kind:
            continue
        k = best.primitive[i]
        u, v = best.a[i], best.b[i]
        m, n = degree[k, 0], degree[k, 1]
        o, d = rays.origin[i], rays.direction[i]
        dx, dy, dz = d[0], d[1], d[2]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], dx, dy, dz, middle[0], middle[1], middle[2], table.to_frame
        )
        ox, oy, oz = hx - centre[k, 0] + lx, hy - centre[k, 1] + ly, hz - centre[k, 2] + lz
        x, y, z, ux, uy, uz, vx, vy, vz = evaluate_any(
            control, start[k], m, n, u, v, basis, table.rational
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        guu, gvv = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
        least_u, least_v = CLEAR_TANGENT * table.bend[k, 3], CLEAR_TANGENT * table.bend[k, 4]
        is_degenerate = False
        if guu > least_u and gvv > least_v and length * length > CLEAR_SINE * guu * gvv:
            nx, ny, nz = nx / length, ny / length, nz / length
        elif table.rational:
            nx, ny, nz, is_degenerate = unit_normal(control, start[k], m, n, u, v, True)
        else:
            nx, ny, nz, is_degenerate = unit_normal(control, start[k], m, n, u, v, None)
        out.patch_id[i] = table.patch_id[k]
        out.u[i], out.v[i] = u, v
        # First the centre, without a rounding but that of its own coordinates, however large the frame is.
        out.position[i, 0] = (middle[0] + centre[k, 0] * to_world) + x * to_world
        out.position[i, 1] = (middle[1] + centre[k, 1] * to_world) + y * to_world
        out.position[i, 2] = (middle[2] + centre[k, 2] * to_world) + z * to_world
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = nx, ny, nz
        if is_degenerate:
            out.flags[i] |= NORMAL_DEGENERATE
        t = best.t[i] * table.to_frame - shift
        rx, ry, rz = ox + t * dx - x, oy + t * dy - y, oz + t * dz - z
        residual = np.sqrt(rx * rx + ry * ry + rz * rz)
        out.residual[i] = residual * to_world
        # --- what is left of the equation counts where it is more than was allowed for
        slope = abs(nx * dx + ny * dy + nz * dz)
        if residual > LEFT * best.t_bound[i] * table.to_frame * slope and slope > 0.0:
            best.t_bound[i] += 2.0 * residual / slope * to_world
        # --- may the root be lost when the ray moves by the band? Roughly first, without roots
        det, dd = length * slope, dx * dx + dy * dy + dz * dz
        # Objects' middles are within 1 of the frame's, their diameters within 2, |d| within 2.
        about = TANGENT_BAND * (abs(hx) + abs(hy) + abs(hz) + 2.0 * abs(shift) + 3.0)
        far_u, far_v, room = about * about * gvv * dd, about * about * guu * dd, det * det
        is_trimmed = table.trim.member.shape[0] > 0
        if (
            is_trimmed
            and sure_side(table.trim, k, u, v, gvv * dd, guu * dd, about, room) == CROSSED
        ):
            band = band_of_ray(table.trim, k, ox - shift * dx, oy - shift * dy, oz - shift * dz)
            _, is_within, edge = decide(
                table.trim, k, u, v, ux, uy, uz, vx, vy, vz, dx, dy, dz, band
            )
            if is_within:
                best.tangent[i] = WITHIN_BAND
            if edge > 0.0:
                out.flags[i] |= EDGE
        in_u, in_v = min(u, 1.0 - u), min(v, 1.0 - v)
        turn = far_u * (table.bend[k, 0] + table.bend[k, 1])
        turn += far_v * (table.bend[k, 2] + table.bend[k, 1])
        if (
            turn <= STEADY * about * room
            and 4.0 * far_u <= in_u * in_u * room
            and 4.0 * far_v <= in_v * in_v * room
            and residual <= TANGENT_BAND * table.around[k, 3]
            and best.tangent[i] == CLEAR
            and not is_degenerate
        ):
            continue
        ray = FrameRay(hx, hy, hz, lx, ly, lz, dx, dy, dz, shift, to_world)
        band = band_of(table.around, k, ray)
        du, dv, is_alone = _steps(ux, uy, uz, vx, vy, vz, dx, dy, dz, det, band, table.bend, k)
        if residual > band:
            best.tangent[i] = WITHIN_BAND
        elif best.tangent[i] != WITHIN_BAND and (
            is_degenerate or not (is_alone and du <= in_u and dv <= in_v)
        ):
            best.tangent[i] = SUSPECT
            if not is_trimmed:
                error = max(best.t_bound[i] * table.to_frame * slope, residual)
                is_closed, open_by = _is_closed_around(
                    table.bend, k, ox, oy, oz, dx, dy, dz, x, y, z, band, error
                )
                if is_closed:
                    length = np.sqrt(dd)
                    best.tangent[i] = CLEAR
                    best.t_bound[i] = max(best.t_bound[i], open_by / length * to_world)
                    # What passes beside the ray there goes on where it is met.
                    near = 2.0 * best.t_bound[i] + 8.0 * band / slope * to_world
                    if best.doubt[i] >= best.t[i] - near:
                        best.doubt[i] = np.inf


@kernel
def aim_at_patches(table, rays, best, out, rows, basis, bands, outward, is_edge):
    """Say where to move rays whose hits are `SUSPECT`.

    ``rows`` (k,) int64.
    ``table``, ``rays``, ``best``, ``out``: as for `finish_patches`, which has been here.
    ``bands`` (k,), written: 64 eps x scale, world units.
    ``outward`` (k, 3), written: a unit normal of the ray; at a border of the patch, straight across
    it and out.
    ``is_edge`` (k,) bool, written: whether it is one border that the root is near, and nothing
    else.
    """
    middle = table.middle
    for j in range(rows.shape[0]):
        i = rows[j]
        k = best.primitive[i]
        u, v = best.a[i], best.b[i]
        o, d = rays.origin[i], rays.direction[i]
        dx, dy, dz = d[0], d[1], d[2]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], dx, dy, dz, middle[0], middle[1], middle[2], table.to_frame
        )
        ray = FrameRay(hx, hy, hz, lx, ly, lz, dx, dy, dz, shift, 1.0 / table.to_frame)
        band = band_of(table.around, k, ray)
        bands[j] = band / table.to_frame
        _, _, _, ux, uy, uz, vx, vy, vz = evaluate_any(
            table.control,
            table.start[k],
            table.degree[k, 0],
            table.degree[k, 1],
            u,
            v,
            basis,
            table.rational,
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        det = nx * dx + ny * dy + nz * dz
        du, dv, is_alone = _steps(ux, uy, uz, vx, vy, vz, dx, dy, dz, abs(det), band, table.bend, k)
        near_u, near_v = not du <= u <= 1.0 - du, not dv <= v <= 1.0 - dv
        is_edge[j] = is_alone and near_u != near_v and not out.flags[i] & NORMAL_DEGENERATE
        # Across the tangent of the border, to the side where the other tangent does not point.
        ax, ay, az, bx, by, bz, side = ux, uy, uz, vx, vy, vz, u
        if near_v:
            ax, ay, az, bx, by, bz, side = vx, vy, vz, ux, uy, uz, v
        wx, wy, wz = by * dz - bz * dy, bz * dx - bx * dz, bx * dy - by * dx
        points_in = wx * ax + wy * ay + wz * az > 0.0
        length = np.sqrt(wx * wx + wy * wy + wz * wz)
        if length > 0.0:
            length = length if points_in == (side > 0.5) else -length
            wx, wy, wz = wx / length, wy / length, wz / length
        else:
            is_edge[j] = False
            wx, wy, wz = any_normal(dx, dy, dz)
        outward[j, 0], outward[j, 1], outward[j, 2] = wx, wy, wz
