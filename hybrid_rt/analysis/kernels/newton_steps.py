"""A fixed number of Newton steps from coarse hits, uncertified."""

import math
from typing import NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.solve import evaluate_any
from hybrid_rt.intersection.kernels.revolution import profile
from meshing.kernels.jit import hot_kernel, inner

# Parameters are inside up to this, or up to the last step where that was longer.
INSIDE = 1e-9


class Pieces(NamedTuple):
    """Patches and segments of profiles, k of them, relative to the middle of all.

    Attributes
    ----------
    control : (c, 4) float64
        Points of nets, row by row; of profiles (axial position, radius). The last column is zero.
    start : (k,) int64
    degree : (k, 2) int64
        The first is -1 for a profile.
    frame : (k, 12) float64
        Of a profile: origin, axis, radial, binormal.
    """

    control: np.ndarray
    start: np.ndarray
    degree: np.ndarray
    frame: np.ndarray


@inner
def _tangents(pieces, k, u, v, basis):
    """Return S, S_u, S_v (nine numbers)."""
    start, m, n = pieces.start[k], pieces.degree[k, 0], pieces.degree[k, 1]
    if m >= 0:
        return evaluate_any(pieces.control, start, m, n, u, v, basis)
    z, r, dz, dr, _, _ = profile(pieces.control, start, n, v)
    turn = 2.0 * math.pi
    c, s = math.cos(turn * u), math.sin(turn * u)
    f = pieces.frame[k]
    ax, ay, az = f[3], f[4], f[5]
    ox, oy, oz = c * f[6] + s * f[9], c * f[7] + s * f[10], c * f[8] + s * f[11]
    tx, ty, tz = c * f[9] - s * f[6], c * f[10] - s * f[7], c * f[11] - s * f[8]
    return (
        f[0] + z * ax + r * ox, f[1] + z * ay + r * oy, f[2] + z * az + r * oz,
        turn * r * tx, turn * r * ty, turn * r * tz,
        dz * ax + dr * ox, dz * ay + dr * oy, dz * az + dr * oz,
    )  # fmt: skip


@hot_kernel
def take_steps(
    pieces, middle, steps, face, t, u, v, corner_uv, piece_of, rows, origin, direction,
    out_t, out_piece, out_u, out_v, out_normal, out_residual, basis, accepted,
):  # fmt: skip
    """Take ``steps`` steps from coarse hits j of the rays ``rows[j]``; write those that end inside.

    A step solves the linear part of S(u, v) = o + t d. Nothing else is checked but t > 0. ``basis``
    is scratch of shape (4, > degree).
    """
    for j in range(face.shape[0]):
        i, f = rows[j], face[j]
        k = piece_of[f]
        w = 1.0 - u[j] - v[j]
        a = w * corner_uv[f, 0, 0] + u[j] * corner_uv[f, 1, 0] + v[j] * corner_uv[f, 2, 0]
        b = w * corner_uv[f, 0, 1] + u[j] * corner_uv[f, 1, 1] + v[j] * corner_uv[f, 2, 1]
        ox, oy, oz = origin[i, 0] - middle[0], origin[i, 1] - middle[1], origin[i, 2] - middle[2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        s = t[j]
        last = 0.0
        is_lost = False
        for _ in range(steps):
            x, y, z, xu, yu, zu, xv, yv, zv = _tangents(pieces, k, a, b, basis)
            rx, ry, rz = ox + s * dx - x, oy + s * dy - y, oz + s * dz - z
            nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
            det = nx * dx + ny * dy + nz * dz
            if det == 0.0:
                is_lost = True
                break
            inv = 1.0 / det
            da = inv * (
                rx * (yv * dz - zv * dy) + ry * (zv * dx - xv * dz) + rz * (xv * dy - yv * dx)
            )
            db = inv * (
                rx * (dy * zu - dz * yu) + ry * (dz * xu - dx * zu) + rz * (dx * yu - dy * xu)
            )
            a += da
            b += db
            s -= inv * (rx * nx + ry * ny + rz * nz)
            last = max(abs(da), abs(db))
            if not (-1.0 <= a <= 2.0 and -1.0 <= b <= 2.0):
                is_lost = True
                break
        slack = max(last, INSIDE)
        is_round = pieces.degree[k, 0] < 0
        if is_lost or not (-slack <= b <= 1.0 + slack and s > 0.0):
            continue
        if not (is_round or -slack <= a <= 1.0 + slack):
            continue
        x, y, z, xu, yu, zu, xv, yv, zv = _tangents(pieces, k, a, b, basis)
        rx, ry, rz = ox + s * dx - x, oy + s * dy - y, oz + s * dz - z
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        scale = 1.0 / length if length > 0.0 else 0.0
        out_t[i], out_piece[i], out_u[i], out_v[i] = s, k, a, b
        out_normal[i, 0], out_normal[i, 1], out_normal[i, 2] = nx * scale, ny * scale, nz * scale
        out_residual[i] = math.sqrt(rx * rx + ry * ry + rz * rz)
        accepted[j] = True
