"""Roots of rays on a parallelepiped, by its three pairs of planes in double-double."""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel
from proof.judges.kernels.double_double import (
    divide,
    dot,
    multiply,
    subtract,
    two_sum,
)
from proof.judges.kernels.events import BAND, DOUBTFUL, ROOT, note


@inner
def _cross(a, b, out):
    """Fill out (3, 2) with a x b, to 2**-100 of its products."""
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        ph, pl = multiply(a[i], 0.0, b[j], 0.0)
        qh, ql = multiply(a[j], 0.0, b[i], 0.0)
        out[k, 0], out[k, 1] = subtract(ph, pl, qh, ql)


@inner
def _times(m, x, xl, y, yl, z, zl):
    return dot(m[0, 0], m[0, 1], m[1, 0], m[1, 1], m[2, 0], m[2, 1], x, xl, y, yl, z, zl)


@kernel
def turned_box_events(corner, edges, object_id, first_ray, origins, directions, events):
    """Note the roots of rays on one box: where it enters its last slab, leaves its first."""
    across, depth = np.empty((3, 3, 2)), np.empty((3, 2))
    unit = np.empty((3, 3))
    middle, size = corner.copy(), 0.0
    for c in range(3):
        _cross(edges[(c + 1) % 3], edges[(c + 2) % 3], across[c])
        x, y, z = edges[c]
        depth[c, 0], depth[c, 1] = _times(across[c], x, 0.0, y, 0.0, z, 0.0)
        size += math.sqrt(x * x + y * y + z * z)
        length = math.sqrt((across[c, :, 0] ** 2).sum())
        for k in range(3):
            middle[k] += 0.5 * edges[c, k]
            unit[c, k] = across[c, k, 0] / length
    near, far, slope = np.empty((3, 2)), np.empty((3, 2)), np.empty(3)
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        away = math.sqrt(((o - middle) ** 2).sum())
        band = BAND * max(away, size)
        xh, xl = two_sum(o[0], -corner[0])
        yh, yl = two_sum(o[1], -corner[1])
        zh, zl = two_sum(o[2], -corner[2])
        margin = np.inf
        for c in range(3):
            slope[c] = unit[c, 0] * d[0] + unit[c, 1] * d[1] + unit[c, 2] * d[2]
            sh, sl = _times(across[c], d[0], 0.0, d[1], 0.0, d[2], 0.0)
            hh, hl = _times(across[c], xh, xl, yh, yl, zh, zl)
            if sh == 0.0:
                # All within the slab, or all outside.
                inside = hh / depth[c, 0]
                wide = abs(depth[c, 0]) / math.sqrt((across[c, :, 0] ** 2).sum())
                margin = min(margin, inside * wide, (1.0 - inside) * wide)
                near[c, 0], near[c, 1], far[c, 0], far[c, 1] = -np.inf, 0.0, np.inf, 0.0
                continue
            ah, al = divide(-hh, -hl, sh, sl)
            bh, bl = subtract(depth[c, 0], depth[c, 1], hh, hl)
            bh, bl = divide(bh, bl, sh, sl)
            if ah > bh:
                ah, al, bh, bl = bh, bl, ah, al
            near[c, 0], near[c, 1], far[c, 0], far[c, 1] = ah, al, bh, bl
        # How far the ray passes from the edge of slabs j and k, measured across that edge.
        for j in range(3):
            for k in range(3):
                if j == k or not (near[j, 0] > -np.inf and far[k, 0] < np.inf):
                    continue
                gap, _ = subtract(far[k, 0], far[k, 1], near[j, 0], near[j, 1])
                cosine = (unit[j] * unit[k]).sum()
                square = slope[j] ** 2 + slope[k] ** 2 - 2.0 * slope[j] * slope[k] * cosine
                if square > 0.0:
                    arm = math.sqrt(square)
                    margin = min(margin, gap * abs(slope[j]) * (abs(slope[k]) / arm))
        if margin < -band:
            continue
        kind = ROOT if margin > band else DOUBTFUL
        j, k = 0, 0
        for c in range(1, 3):
            if near[c, 0] > near[j, 0]:
                j = c
            if far[c, 0] < far[k, 0]:
                k = c
        handed = 1.0 if depth[0, 0] > 0.0 else -1.0
        entry = 2 * j + (0 if slope[j] * handed > 0.0 else 1)
        leave = 2 * k + (1 if slope[k] * handed > 0.0 else 0)
        cosine = abs(slope[j]) / length
        note(events, first_ray + i, near[j, 0], object_id, entry, 0.0, 0.0, cosine, band, kind, 0)
        cosine = abs(slope[k]) / length
        note(events, first_ray + i, far[k, 0], object_id, leave, 0.0, 0.0, cosine, band, kind, 0)
