"""What is known of hits on Bezier patches: refined without proof, counted, and described."""

import numpy as np

from hybrid_rt.intersection.kernels.patch.solve import (
    CONVERGED,
    GRAZING,
    NORMAL_DEGENERATE,
    TANGENT_BAND,
    evaluate_any,
    newton,
    offer_root,
    rounding_of_root,
)
from hybrid_rt.intersection.kernels.patch.subdivide import CHANGED
from hybrid_rt.intersection.kernels.search.coarse import parameters_at
from hybrid_rt.intersection.kernels.search.frame import enter_frame
from meshing.kernels.bernstein import second_partials, unit_normal
from meshing.kernels.jit import hot_kernel

# Squares of tangents (over the size) and of sines below this leave the normal to `unit_normal`.
CLEAR_TANGENT = 1e-16


@hot_kernel
def count_changed(t_guess, t_before, best, counters):
    """Count the rays that a hit nearer than what their guess refined to was found for."""
    changed = 0
    for i in range(t_guess.shape[0]):
        # Two Newton iterations agree to their bounds, which roughly are the same.
        if best.t[i] < t_before[i] and best.t[i] + 4.0 * best.t_bound[i] < t_guess[i]:
            changed += 1
    counters[CHANGED] += changed


@hot_kernel
def refine_patches(table, hits, triangles, first_patch, rows, rays, best, basis, accepted):
    """Newton from coarse hits, with no proof of anything (accuracy "refined")."""
    degree = table.degree
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        if first_patch[triangles.object_id[f]] < 0:
            continue
        k = first_patch[triangles.object_id[f]] + triangles.piece[f]
        o, middle = rays.origin[i], table.middle
        a, b = parameters_at(triangles, f, hits.u[j], hits.v[j])
        d = rays.direction[i]
        hx, hy, hz, lx, ly, lz, shift = enter_frame(
            o[0], o[1], o[2], d[0], d[1], d[2], middle[0], middle[1], middle[2], table.to_frame
        )
        c = table.centre[k]
        ox, oy, oz = hx - c[0] + lx, hy - c[1] + ly, hz - c[2] + lz
        m, n = degree[k, 0], degree[k, 1]
        status, a, b, s, _, n_dot_d, gain_u, gain_v = newton(
            table.control, table.start[k], m, n, basis, table.size[k], ox, oy, oz, d[0], d[1], d[2],
            a, b, hits.t[j] * table.to_frame - shift, 1.0, 1.0,
        )  # fmt: skip
        if status == CONVERGED and offer_root(
            i, a, b, s, n_dot_d, gain_u, gain_v, table.control, table.start[k], basis, m, n,
            table.size[k], ox, oy, oz, d[0], d[1], d[2], table.open_edges[k], shift,
            1.0 / table.to_frame, table.object_id[k], k, rays.t_min, rays.known, best,
        ):  # fmt: skip
            accepted[j] = True


@hot_kernel
def finish_patches(table, rays, best, kind_of, kind, basis, out):
    """Fill what a hit record says of the rays whose nearest root is on a patch.

    ``kind_of`` (objects,) names the kind of each object; rows of other kinds are left alone.
    """
    middle, to_world = table.middle, 1.0 / table.to_frame
    control, start, degree, centre, size = (
        table.control, table.start, table.degree, table.centre, table.size,
    )  # fmt: skip
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
        x, y, z, ux, uy, uz, vx, vy, vz = evaluate_any(control, start[k], m, n, u, v, basis)
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        guu, guv = ux * ux + uy * uy + uz * uz, ux * vx + uy * vy + uz * vz
        gvv = vx * vx + vy * vy + vz * vz
        smallest = CLEAR_TANGENT * size[k] * size[k]
        is_degenerate = False
        if guu > smallest and gvv > smallest and length * length > CLEAR_TANGENT * guu * gvv:
            nx, ny, nz = nx / length, ny / length, nz / length
        else:
            nx, ny, nz, is_degenerate = unit_normal(control, start[k], m, n, u, v)
        out.patch_id[i] = table.patch_id[k]
        out.u[i], out.v[i] = u, v
        out.position[i, 0] = middle[0] + (centre[k, 0] + x) * to_world
        out.position[i, 1] = middle[1] + (centre[k, 1] + y) * to_world
        out.position[i, 2] = middle[2] + (centre[k, 2] + z) * to_world
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = nx, ny, nz
        if is_degenerate:
            out.flags[i] = NORMAL_DEGENERATE
        t = best.t[i] * table.to_frame - shift
        rx, ry, rz = ox + t * dx - x, oy + t * dy - y, oz + t * dz - z
        residual = np.sqrt(rx * rx + ry * ry + rz * rz)
        out.residual[i] = residual * to_world
        # --- grazing: how deep does the ray run under the silhouette?
        dd = dx * dx + dy * dy + dz * dz
        slope = nx * dx + ny * dy + nz * dz
        if slope * slope > GRAZING * GRAZING * dd or is_degenerate:
            continue
        # d = p S_u + q S_v along the surface; the normal curvature along it bends the surface
        # away from the ray, which therefore lies slope^2 / (2 bend) deep.
        a0, a1, a2, b0, b1, b2, c0, c1, c2 = second_partials(control, start[k], m, n, u, v)
        du, dv = ux * dx + uy * dy + uz * dz, vx * dx + vy * dy + vz * dz
        det = guu * gvv - guv * guv
        if not det > 0.0:
            continue
        p, q = (gvv * du - guv * dv) / det, (guu * dv - guv * du) / det
        bend = abs(
            nx * (p * p * a0 + 2.0 * p * q * b0 + q * q * c0)
            + ny * (p * p * a1 + 2.0 * p * q * b1 + q * q * c1)
            + nz * (p * p * a2 + 2.0 * p * q * b2 + q * q * c2)
        )
        _, scale = rounding_of_root(m, n, size[k], ox, oy, oz, dx, dy, dz, t)
        if slope * slope < 2.0 * bend * TANGENT_BAND * scale:
            best.tangent[i] = 1
