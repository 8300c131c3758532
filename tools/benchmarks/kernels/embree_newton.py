"""Uncertified Newton iteration from coarse hits on bicubic patches: the baseline of speed."""

import numpy as np

from hybrid_rt.intersection.kernels.patch.bicubic import evaluate_bicubic
from meshing.kernels.jit import kernel

STEPS = 6


@kernel
def refine(control, cells, face, u, v, t, origin, direction, out_t, out_patch, out_u, out_v):
    """Solve S(u, v) = o + t d from each coarse hit; inf where there is none, or it fails.

    Face f of a grid of ``cells`` x ``cells`` squares per patch: two triangles a square.
    """
    per_patch = 2 * cells * cells
    side = 1.0 / cells
    for i in range(face.shape[0]):
        out_t[i], out_patch[i] = np.inf, -1
        f = face[i]
        if f < 0:
            continue
        patch, rest = f // per_patch, f % per_patch
        square, upper = rest // 2, rest % 2
        x, y = u[i], v[i]
        if upper == 1:  # corners (1, 1), (0, 1), (1, 0)
            x, y = 1.0 - u[i], 1.0 - v[i]
        a = (square // cells + x) * side
        b = (square % cells + y) * side
        ox, oy, oz = origin[i, 0], origin[i, 1], origin[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        s = t[i] * 1.0
        for _ in range(STEPS):
            px, py, pz, ux, uy, uz, vx, vy, vz = evaluate_bicubic(control, 16 * patch, a, b)
            rx, ry, rz = ox + s * dx - px, oy + s * dy - py, oz + s * dz - pz
            nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
            det = nx * dx + ny * dy + nz * dz
            if det == 0.0:
                break
            inv = 1.0 / det
            da = (
                rx * (vy * dz - vz * dy) + ry * (vz * dx - vx * dz) + rz * (vx * dy - vy * dx)
            ) * inv
            db = (
                rx * (dy * uz - dz * uy) + ry * (dz * ux - dx * uz) + rz * (dx * uy - dy * ux)
            ) * inv
            a += da
            b += db
            s -= (rx * nx + ry * ny + rz * nz) * inv
            if abs(da) + abs(db) < 1e-8:
                if -1e-9 <= a <= 1.0 + 1e-9 and -1e-9 <= b <= 1.0 + 1e-9 and s > 0.0:
                    out_t[i], out_patch[i], out_u[i], out_v[i] = s, patch, a, b
                break
            if not (-0.5 < a < 1.5 and -0.5 < b < 1.5):
                break


@kernel
def evaluate_many(control, patch, u, v, out):
    """Fill S, S_u, S_v (n, 9) of bicubic patches, one (u, v) each."""
    for i in range(u.shape[0]):
        x, y, z, a, b, c, d, e, f = evaluate_bicubic(control, 16 * patch[i], u[i], v[i])
        out[i, 0], out[i, 1], out[i, 2] = x, y, z
        out[i, 3], out[i, 4], out[i, 5] = a, b, c
        out[i, 6], out[i, 7], out[i, 8] = d, e, f
