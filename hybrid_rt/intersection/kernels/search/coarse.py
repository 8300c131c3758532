"""Rays as Embree takes them, float32 in the frame of its triangles; and what its hits mean."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.kernels.compensated import advance
from hybrid_rt.intersection.kernels.search.frame import enter_frame
from hybrid_rt.intersection.kernels.search.nearest import CLEAR, is_unseen, offer
from meshing.kernels.jit import inlined, kernel

# Embree's own "no limit", and far beyond the frame.
NO_LIMIT = 1e30


class CoarseHits(NamedTuple):
    """What Embree finds: a triangle, and about where; n rows."""

    face: Any  # (n,) int32, -1: none
    t: Any  # (n,) float64
    u: Any  # (n,) float64, weight of the second corner,
    v: Any  # (n,) float64, and of the third


class CoarseFrame(NamedTuple):
    """The frame of Embree's triangles: their box is about its origin, and within 1 of it."""

    middle: Any  # (3,) float64, world
    to_frame: Any  # float, a power of two
    half: Any  # (3,) float64, half the sides of the box, and a little more


class CoarseTriangles(NamedTuple):
    """The triangles in Embree, and which part of which surface each stands for."""

    vertex: Any  # (vertices, 3) float64, world frame
    face: Any  # (triangles, 3) int64
    object_id: Any  # (triangles,) int32
    piece: Any  # (triangles,) int32, patch, segment of a profile, or face of a mesh
    corner_uv: Any  # (triangles, 3, 2) float64, parameters of the surface


@inlined
def parameters_at(triangles, f, u, v):
    """Return the surface's parameters where corners 1 and 2 of triangle f have weights u and v."""
    uv = triangles.corner_uv
    w = 1.0 - u - v
    return (
        w * uv[f, 0, 0] + u * uv[f, 1, 0] + v * uv[f, 2, 0],
        w * uv[f, 0, 1] + u * uv[f, 1, 1] + v * uv[f, 2, 1],
    )


@inlined
def _misses_box(x, y, z, dx, dy, dz, end, half):
    """Tell whether the ray from (x, y, z) up to t = ``end`` misses the box |x| <= half_x, ..."""
    hx, hy, hz = half[0], half[1], half[2]
    ex, ey, ez = x + end * dx, y + end * dy, z + end * dz
    ax, ay, az = abs(dx), abs(dy), abs(dz)
    return (
        (min(x, ex) > hx)
        | (max(x, ex) < -hx)
        | (min(y, ey) > hy)
        | (max(y, ey) < -hy)
        | (min(z, ez) > hz)
        | (max(z, ez) < -hz)
        | (abs(y * dz - z * dy) > hy * az + hz * ay)
        | (abs(z * dx - x * dz) > hz * ax + hx * az)
        | (abs(x * dy - y * dx) > hx * ay + hy * ax)
    )


@kernel
def rays_to_float32(origin, direction, t_min, t_max, frame, near, away, reach, shift, rows):
    """Write the rays that meet the triangles' box as Embree takes them; return how many there are.

    ``origin``, ``direction`` (n, 3); ``t_min``, ``t_max`` (n,).
    ``near``, ``away`` (n, 3) float32, written: origins, advanced to t_min, and directions.
    ``reach`` (n,) float32, written: largest t.
    ``shift`` (n,), written: by how much t was advanced, in frame units.
    ``rows`` (n,) int64, written: which ray each is.
    """
    mx, my, mz = frame.middle[0], frame.middle[1], frame.middle[2]
    n = 0
    for i in range(origin.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        x, y, z, lx, ly, lz, s = enter_frame(
            origin[i, 0], origin[i, 1], origin[i, 2], dx, dy, dz, mx, my, mz, frame.to_frame
        )
        # Embree starts at 0: begin at t_min, but never before the frame's ball.
        begin = t_min[i] * frame.to_frame - s
        if begin > 0.0:
            x, lx = advance(x, lx, begin, dx)
            y, ly = advance(y, ly, begin, dy)
            z, lz = advance(z, lz, begin, dz)
            s += begin
        end = min(max(t_max[i] * frame.to_frame - s, 0.0), NO_LIMIT)
        if _misses_box(x, y, z, dx, dy, dz, end, frame.half):
            continue
        near[n, 0], near[n, 1], near[n, 2] = x, y, z
        away[n, 0], away[n, 1], away[n, 2] = dx, dy, dz
        reach[n], shift[n], rows[n] = end, s, i
        n += 1
    return n


@kernel
def hits_of_rows(face, t, u, v, shift, rows, to_frame, hits):
    """Write what Embree found for some rows of ``hits``; all others have no hit."""
    for i in range(hits.face.shape[0]):
        hits.face[i], hits.t[i], hits.u[i], hits.v[i] = -1, np.inf, 0.0, 0.0
    for k in range(rows.shape[0]):
        i = rows[k]
        hits.face[i], hits.u[i], hits.v[i] = face[k], u[k], v[k]
        hits.t[i] = (t[k] + shift[k]) / to_frame


@kernel
def guess_cells(hits, triangles, first_patch, grid, first_cell, place, guess):
    """Turn coarse hits into the cell that holds them (-1: no hit, or not a patch)."""
    for i in range(hits.face.shape[0]):
        f = hits.face[i]
        if f < 0 or first_patch[triangles.object_id[f]] < 0:
            guess[i] = -1
            continue
        k = first_patch[triangles.object_id[f]] + triangles.piece[f]
        a, b = parameters_at(triangles, f, hits.u[i], hits.v[i])
        nu, nv = grid[k, 0], grid[k, 1]
        ca = min(max(int(np.floor(a * nu)), 0), nu - 1)
        cb = min(max(int(np.floor(b * nv)), 0), nv - 1)
        guess[i] = place[first_cell[k] + ca * nv + cb]


@kernel
def offer_faces(hits, triangles, rows, rays, t_start, best, accepted):
    """Offer coarse triangles as they are, their plane met in float64 (accuracy "mesh")."""
    vertices, faces = triangles.vertex, triangles.face
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        o, d = rays.origin[i], rays.direction[i]
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        det = nx * d[0] + ny * d[1] + nz * d[2]
        if det == 0.0:
            continue
        wx, wy, wz = a[0] - o[0], a[1] - o[1], a[2] - o[2]
        t = (nx * wx + ny * wy + nz * wz) / det
        # p = o + t d - a in the basis of the two edges.
        px, py, pz = t * d[0] - wx, t * d[1] - wy, t * d[2] - wz
        bb, bc = bx * bx + by * by + bz * bz, bx * cx + by * cy + bz * cz
        cc = cx * cx + cy * cy + cz * cz
        pb, pc = px * bx + py * by + pz * bz, px * cx + py * cy + pz * cz
        gram = bb * cc - bc * bc
        if gram == 0.0 or not t > t_start[i]:
            continue
        if is_unseen(i, triangles.object_id[f], rays.known):
            continue
        v, w = (cc * pb - bc * pc) / gram, (bb * pc - bc * pb) / gram
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        # Nothing is known of the true surface: no bound.
        if offer(
            i, t, np.inf, abs(det) / length, False, triangles.object_id[f], f, v, w,
            rays.t_min, rays.known[:0], best,
        ):  # fmt: skip
            best.tangent[i] = CLEAR
            accepted[j] = True


@kernel
def finish_mesh(triangles, rays, best, kind_of, kind, out):
    """Describe hits on coarse triangles."""
    vertices, faces = triangles.vertex, triangles.face
    for i in range(best.t.shape[0]):
        if best.object_id[i] < 0 or kind_of[best.object_id[i]] != kind:
            continue
        f = best.primitive[i]
        v, w = best.a[i], best.b[i]
        u = 1.0 - v - w
        a, b, c = vertices[faces[f, 0]], vertices[faces[f, 1]], vertices[faces[f, 2]]
        bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
        length = np.sqrt(nx * nx + ny * ny + nz * nz)
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = (
            nx / length, ny / length, nz / length,
        )  # fmt: skip
        gap = 0.0
        for k in range(3):
            p = u * a[k] + v * b[k] + w * c[k]
            out.position[i, k] = p
            gap += (p - (rays.origin[i, k] + best.t[i] * rays.direction[i, k])) ** 2
        out.u[i], out.v[i] = parameters_at(triangles, f, v, w)
        out.patch_id[i] = triangles.piece[f]
        out.residual[i] = np.sqrt(gap)
