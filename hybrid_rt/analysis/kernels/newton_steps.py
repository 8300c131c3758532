"""A fixed number of Newton steps from coarse hits, uncertified."""

import math
from typing import NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.patch.evaluate import evaluate_any
from hybrid_rt.intersection.kernels.revolution.profile import profile
from meshing.kernels.jit import inner, kernel

# Parameters are inside up to this, or up to the last step where that was longer.
INSIDE = 1e-9


class Pieces(NamedTuple):
    """Patches and segments of profiles, k of them, relative to the middle of all."""

    # (c, 4): points of nets, row by row; of profiles (axial position, radius). The last column is
    # zero.
    control: np.ndarray
    start: np.ndarray  # (k,) int64
    degree: np.ndarray  # (k, 2) int64: the first is -1 for a profile
    frame: np.ndarray  # (k, 12): of a profile: origin, axis, radial, binormal


class Triangles(NamedTuple):
    """The triangles of the coarse stage."""

    corner_uv: np.ndarray  # (f, 3, 2): parameters of each one's corners
    piece: np.ndarray  # (f,) int64: the piece that each one approximates


class Stepped(NamedTuple):
    """Where the steps led: a row for each ray; rays that no step left inside keep theirs."""

    t: np.ndarray
    piece: np.ndarray
    u: np.ndarray
    v: np.ndarray
    normal: np.ndarray
    residual: np.ndarray


@inner
def _tangents(pieces, k, u, v, basis):
    """Return S, S_u, S_v (nine numbers)."""
    start, m, n = pieces.start[k], pieces.degree[k, 0], pieces.degree[k, 1]
    if m >= 0:
        return evaluate_any(pieces.control, start, m, n, u, v, basis, None)
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


@inner
def _steps_on(pieces, k, a, b, s, ox, oy, oz, dx, dy, dz, steps, basis):
    """Take steps on one piece; return u, v, t, the last change of u or v, and whether all is lost."""
    last = 0.0
    for _ in range(steps):
        x, y, z, xu, yu, zu, xv, yv, zv = _tangents(pieces, k, a, b, basis)
        rx, ry, rz = ox + s * dx - x, oy + s * dy - y, oz + s * dz - z
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        det = nx * dx + ny * dy + nz * dz
        if det == 0.0:
            return a, b, s, last, True
        inv = 1.0 / det
        da = inv * (rx * (yv * dz - zv * dy) + ry * (zv * dx - xv * dz) + rz * (xv * dy - yv * dx))
        db = inv * (rx * (dy * zu - dz * yu) + ry * (dz * xu - dx * zu) + rz * (dx * yu - dy * xu))
        a += da
        b += db
        s -= inv * (rx * nx + ry * ny + rz * nz)
        last = max(abs(da), abs(db))
        if not (-1.0 <= a <= 2.0 and -1.0 <= b <= 2.0):
            return a, b, s, last, True
    return a, b, s, last, False


@inner
def _goes_on(pieces, k, other):
    """Return whether two neighbours in the list are segments of one profile that join."""
    if not 0 <= other < pieces.start.shape[0]:
        return False
    if pieces.degree[k, 0] >= 0 or pieces.degree[other, 0] >= 0:
        return False
    for c in range(12):
        if pieces.frame[k, c] != pieces.frame[other, c]:
            return False
    first, then = (k, other) if other > k else (other, k)
    p, q = pieces.start[first] + pieces.degree[first, 1], pieces.start[then]
    return (
        pieces.control[p, 0] == pieces.control[q, 0]
        and pieces.control[p, 1] == pieces.control[q, 1]
    )


@kernel
def take_steps(
    pieces, middle, steps, hits, triangles, rows, origin, direction, out, basis, accepted
):  # fmt: skip
    """Take ``steps`` steps from coarse hits j of the rays ``rows[j]``; write those that end inside.

    A step solves the linear part of S(u, v) = o + t d. Nothing else is checked but t > 0. Where the
    steps leave a profile's segment by an end, as many are taken on the next one. ``basis`` is
    scratch of shape (4, > degree).
    """
    t, u, v, corner_uv = hits.t, hits.u, hits.v, triangles.corner_uv
    for j in range(hits.face.shape[0]):
        i, f = rows[j], hits.face[j]
        k = triangles.piece[f]
        w = 1.0 - u[j] - v[j]
        begin = w * corner_uv[f, 0, 0] + u[j] * corner_uv[f, 1, 0] + v[j] * corner_uv[f, 2, 0]
        b = w * corner_uv[f, 0, 1] + u[j] * corner_uv[f, 1, 1] + v[j] * corner_uv[f, 2, 1]
        ox, oy, oz = origin[i, 0] - middle[0], origin[i, 1] - middle[1], origin[i, 2] - middle[2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        is_round = pieces.degree[k, 0] < 0
        way = 0
        while True:
            a, b, s, last, is_lost = _steps_on(
                pieces, k, begin, b, t[j], ox, oy, oz, dx, dy, dz, steps, basis
            )
            slack = max(last, INSIDE)
            step = 1 if b > 1.0 + slack else (-1 if b < -slack else 0)
            if is_lost:
                step = 1 if b > 1.0 else (-1 if b < 0.0 else 0)
            if step in (0, -way) or not _goes_on(pieces, k, k + step):
                break
            way, k, b = step, k + step, 0.0 if step > 0 else 1.0
        if is_lost or not (-slack <= b <= 1.0 + slack and s > 0.0):
            continue
        if not (is_round or -slack <= a <= 1.0 + slack):
            continue
        x, y, z, xu, yu, zu, xv, yv, zv = _tangents(pieces, k, a, b, basis)
        rx, ry, rz = ox + s * dx - x, oy + s * dy - y, oz + s * dz - z
        nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
        length = math.sqrt(nx * nx + ny * ny + nz * nz)
        scale = 1.0 / length if length > 0.0 else 0.0
        out.t[i], out.piece[i], out.u[i], out.v[i] = s, k, a, b
        out.normal[i, 0], out.normal[i, 1], out.normal[i, 2] = nx * scale, ny * scale, nz * scale
        out.residual[i] = math.sqrt(rx * rx + ry * ry + rz * rz)
        accepted[j] = True
