"""Rays against Bezier patches by plain bisection, ending in double-double.

The net of a piece is projected along the ray. A piece is rejected when the ray (the origin of the
projection) lies outside its box by more than the band, and halved along its longer side otherwise.
It ends in one of three ways: it holds at most one root (no two differences of its net, one in u
and one in v, are parallel in projection) and Newton finds that root; or it has become thinner than
the band without a root, away from the rim of the patch (a fold of the silhouette); or so on the
rim (an edge, a pole).
"""

import numpy as np

from hybrid_rt.verify.kernels import double_double as dd
from hybrid_rt.verify.kernels.found import (
    BAND,
    NODES,
    UNRESOLVED,
    T,
    note_edge,
    note_fold,
    offer,
    slab,
)
from meshing.kernels.jit import inner, kernel

# Halving both parameters down to one rounding takes 53 steps each.
STACK = 120
# Nodes for one ray and patch before it is given up as unresolved; ordinary rays need 100.
MAX_NODES = 400_000
# A root moved by less than this in (u, v) by a step of Newton is exact to far below rounding.
STEP = 1e-17
MAX_STEPS = 24
# A root of the exact shared edge of two patches must count in at least one of them.
RIM = 1e-20


@kernel
def trace_patches(
    control, starts, degrees, boxes, centre, size, object_id, o, d, t_min, found, stack, box, work,
    out,
):  # fmt: skip
    """Lower ``found`` (n, COLUMNS) by the patches of one object.

    ``stack`` (STACK, 3, m + 1, n + 1) for the largest degrees, ``box`` (STACK, 4), ``work`` (5, 32) and
    ``out`` (3, 4) are scratch.
    """
    for i in range(o.shape[0]):
        length = np.sqrt(d[i, 0] ** 2 + d[i, 1] ** 2 + d[i, 2] ** 2)
        away = np.sqrt(
            (o[i, 0] - centre[0]) ** 2 + (o[i, 1] - centre[1]) ** 2 + (o[i, 2] - centre[2]) ** 2
        )
        band = BAND * max(away, size)
        ex, ey, ez = d[i, 0] / length, d[i, 1] / length, d[i, 2] / length
        # Any two unit normals of the ray: cross with the axis least along it.
        if abs(ex) <= abs(ey) and abs(ex) <= abs(ez):
            ax, ay, az = 0.0, ez, -ey
        elif abs(ey) <= abs(ez):
            ax, ay, az = -ez, 0.0, ex
        else:
            ax, ay, az = ey, -ex, 0.0
        norm = np.sqrt(ax * ax + ay * ay + az * az)
        ax, ay, az = ax / norm, ay / norm, az / norm
        bx, by, bz = ey * az - ez * ay, ez * ax - ex * az, ex * ay - ey * ax
        for p in range(degrees.shape[0]):
            enter = slab(boxes, p, o, i, d, 2.0 * band)
            if enter > found[i, T] + 2.0 * band / length:
                continue
            m, n = degrees[p, 0], degrees[p, 1]
            for j in range(m + 1):
                for k in range(n + 1):
                    row = starts[p] + j * (n + 1) + k
                    x = control[row, 0] - o[i, 0]
                    y = control[row, 1] - o[i, 1]
                    z = control[row, 2] - o[i, 2]
                    stack[0, 0, j, k] = x * ax + y * ay + z * az
                    stack[0, 1, j, k] = x * bx + y * by + z * bz
                    stack[0, 2, j, k] = x * ex + y * ey + z * ez
            box[0, 0], box[0, 1], box[0, 2], box[0, 3] = 0.0, 1.0, 0.0, 1.0
            _search(
                control, starts[p], m, n, object_id, p, size, band, length, o, d, i, t_min[i],
                found, stack, box, work, out,
            )  # fmt: skip


@inner
def _search(
    control, start, m, n, object_id, p, size, band, length, o, d, i, t_min, found, stack, box, work,
    out,
):  # fmt: skip
    top = 0
    nodes = 0
    while top >= 0:
        nodes += 1
        if nodes > MAX_NODES:
            found[i, UNRESOLVED] += 1
            note_fold(
                found, i, max(stack[top, 2, 0, 0] / length, np.nextafter(t_min, np.inf)), t_min
            )
            break
        # --- the box of the piece
        z0 = z1 = stack[top, 2, 0, 0]
        x0 = x1 = stack[top, 0, 0, 0]
        y0 = y1 = stack[top, 1, 0, 0]
        for j in range(m + 1):
            for k in range(n + 1):
                x, y, z = stack[top, 0, j, k], stack[top, 1, j, k], stack[top, 2, j, k]
                x0, x1 = min(x0, x), max(x1, x)
                y0, y1 = min(y0, y), max(y1, y)
                z0, z1 = min(z0, z), max(z1, z)
        if (
            x0 > band or x1 < -band or y0 > band or y1 < -band
            or z0 > (found[i, T] * length) + 2.0 * band or z1 < t_min * length - 2.0 * band
        ):  # fmt: skip
            top -= 1
            continue
        # --- the box along the longer of the two mean tangents
        ux, uy = _mean_u(stack, top, 0, m, n), _mean_u(stack, top, 1, m, n)
        vx, vy = _mean_v(stack, top, 0, m, n), _mean_v(stack, top, 1, m, n)
        cx, cy = (ux, uy) if ux * ux + uy * uy >= vx * vx + vy * vy else (vx, vy)
        norm = np.sqrt(cx * cx + cy * cy)
        if norm > 0.0:
            cx, cy = cx / norm, cy / norm
        else:
            cx, cy = 1.0, 0.0
        l0, l1, w0, w1 = np.inf, -np.inf, np.inf, -np.inf
        for j in range(m + 1):
            for k in range(n + 1):
                x, y = stack[top, 0, j, k], stack[top, 1, j, k]
                along, across = cx * x + cy * y, cx * y - cy * x
                l0, l1 = min(l0, along), max(l1, along)
                w0, w1 = min(w0, across), max(w1, across)
        if l0 > band or l1 < -band or w0 > band or w1 < -band:
            top -= 1
            continue
        # --- at most one root: find it
        fx, fy = _middle(stack, top, 0, m, n), _middle(stack, top, 1, m, n)
        det = ux * vy - uy * vx
        if det != 0.0 and _is_single(stack, top, m, n, cx, cy, band / 16.0):
            du, dv = (vx * fy - vy * fx) / det, (uy * fx - ux * fy) / det
            if (
                abs(du) <= 0.8
                and abs(dv) <= 0.8
                and _solve(
                    control, start, m, n, object_id, p, size, band, length, o, d, i, t_min, found,
                    box, top, du, dv, work, out,
                )
            ):  # fmt: skip
                top -= 1
                continue
        # --- too thin to halve on
        if w1 - w0 <= 0.25 * band or top + 1 == STACK:
            u, v = 0.5 * (box[top, 0] + box[top, 1]), 0.5 * (box[top, 2] + box[top, 3])
            if box[top, 0] == 0.0 or box[top, 1] == 1.0 or box[top, 2] == 0.0 or box[top, 3] == 1.0:
                t = _middle(stack, top, 2, m, n) / length
                note_edge(found, i, t, band, object_id, p, u, v, t_min)
            else:
                note_fold(found, i, max(z0 / length, np.nextafter(t_min, np.inf)), t_min)
            top -= 1
            continue
        # --- halve the longer side
        if _length_u(stack, top, m, n) >= _length_v(stack, top, m, n):
            _halve_u(stack, top, m, n)
            middle = 0.5 * (box[top, 0] + box[top, 1])
            box[top + 1, 0], box[top + 1, 1] = middle, box[top, 1]
            box[top + 1, 2], box[top + 1, 3] = box[top, 2], box[top, 3]
            box[top, 1] = middle
        else:
            _halve_v(stack, top, m, n)
            middle = 0.5 * (box[top, 2] + box[top, 3])
            box[top + 1, 2], box[top + 1, 3] = middle, box[top, 3]
            box[top + 1, 0], box[top + 1, 1] = box[top, 0], box[top, 1]
            box[top, 3] = middle
        top += 1
    found[i, NODES] += nodes


@inner
def _mean_u(stack, top, c, m, n):
    return 0.5 * (
        (stack[top, c, m, 0] - stack[top, c, 0, 0]) + (stack[top, c, m, n] - stack[top, c, 0, n])
    )


@inner
def _mean_v(stack, top, c, m, n):
    return 0.5 * (
        (stack[top, c, 0, n] - stack[top, c, 0, 0]) + (stack[top, c, m, n] - stack[top, c, m, 0])
    )


@inner
def _middle(stack, top, c, m, n):
    return 0.25 * (
        (stack[top, c, 0, 0] + stack[top, c, m, n]) + (stack[top, c, m, 0] + stack[top, c, 0, n])
    )


@inner
def _length_u(stack, top, m, n):
    longest = 0.0
    for k in range(n + 1):
        total = 0.0
        for j in range(m):
            for c in range(3):
                total += abs(stack[top, c, j + 1, k] - stack[top, c, j, k])
        longest = max(longest, total)
    return longest


@inner
def _length_v(stack, top, m, n):
    longest = 0.0
    for j in range(m + 1):
        total = 0.0
        for k in range(n):
            for c in range(3):
                total += abs(stack[top, c, j, k + 1] - stack[top, c, j, k])
        longest = max(longest, total)
    return longest


@inner
def _halve_u(stack, top, m, n):
    for c in range(3):
        for k in range(n + 1):
            stack[top + 1, c, m, k] = stack[top, c, m, k]
            for r in range(1, m + 1):
                for j in range(m, r - 1, -1):
                    stack[top, c, j, k] = 0.5 * (stack[top, c, j - 1, k] + stack[top, c, j, k])
                stack[top + 1, c, m - r, k] = stack[top, c, m, k]


@inner
def _halve_v(stack, top, m, n):
    for c in range(3):
        for j in range(m + 1):
            stack[top + 1, c, j, n] = stack[top, c, j, n]
            for r in range(1, n + 1):
                for k in range(n, r - 1, -1):
                    stack[top, c, j, k] = 0.5 * (stack[top, c, j, k - 1] + stack[top, c, j, k])
                stack[top + 1, c, j, n - r] = stack[top, c, j, n]


@inner
def _is_single(stack, top, m, n, cx, cy, slop):
    """Whether no u-difference and v-difference are parallel, by intervals: at most one root.

    F(p) - F(q) = du A + dv B with A and B in the hulls of the differences.
    """
    a0 = b0 = e0 = f0 = np.inf
    a1 = b1 = e1 = f1 = -np.inf
    for j in range(m):
        for k in range(n + 1):
            x = stack[top, 0, j + 1, k] - stack[top, 0, j, k]
            y = stack[top, 1, j + 1, k] - stack[top, 1, j, k]
            along, across = m * (cx * x + cy * y), m * (cx * y - cy * x)
            a0, a1 = min(a0, along), max(a1, along)
            b0, b1 = min(b0, across), max(b1, across)
    for j in range(m + 1):
        for k in range(n):
            x = stack[top, 0, j, k + 1] - stack[top, 0, j, k]
            y = stack[top, 1, j, k + 1] - stack[top, 1, j, k]
            along, across = n * (cx * x + cy * y), n * (cx * y - cy * x)
            e0, e1 = min(e0, along), max(e1, along)
            f0, f1 = min(f0, across), max(f1, across)
    a0, a1, b0, b1 = a0 - slop, a1 + slop, b0 - slop, b1 + slop
    e0, e1, f0, f1 = e0 - slop, e1 + slop, f0 - slop, f1 + slop
    p0 = min(a0 * f0, a0 * f1, a1 * f0, a1 * f1)
    p1 = max(a0 * f0, a0 * f1, a1 * f0, a1 * f1)
    q0 = min(b0 * e0, b0 * e1, b1 * e0, b1 * e1)
    q1 = max(b0 * e0, b0 * e1, b1 * e0, b1 * e1)
    return p0 > q1 or p1 < q0


@inner
def _solve(
    control, start, m, n, object_id, p, size, band, length, o, d, i, t_min, found, box, top, du, dv,
    work, out,
):  # fmt: skip
    """Newton from a piece; offer the root; whether the root settles the piece."""
    u0, u1, v0, v1 = box[top, 0], box[top, 1], box[top, 2], box[top, 3]
    hu, hv = u1 - u0, v1 - v0
    uh, ul, vh, vl = 0.5 * (u0 + u1) + du * hu, 0.0, 0.5 * (v0 + v1) + dv * hv, 0.0
    k = 0
    if abs(d[i, 1]) > abs(d[i, k]):
        k = 1
    if abs(d[i, 2]) > abs(d[i, k]):
        k = 2
    a, b = (k + 1) % 3, (k + 2) % 3
    for _ in range(MAX_STEPS):
        _evaluate(control, start, m, n, uh, ul, vh, vl, work, out)
        # Two planes through the ray, with normals whose products with d vanish exactly.
        ah, al = dd.subtract(out[a, 0], out[a, 1], o[i, a], 0.0)
        bh, bl = dd.subtract(out[b, 0], out[b, 1], o[i, b], 0.0)
        kh, kl = dd.subtract(out[k, 0], out[k, 1], o[i, k], 0.0)
        ph, pl = dd.multiply(ah, al, d[i, k], 0.0)
        qh, ql = dd.multiply(kh, kl, d[i, a], 0.0)
        fh, _ = dd.subtract(ph, pl, qh, ql)
        ph, pl = dd.multiply(bh, bl, d[i, k], 0.0)
        qh, ql = dd.multiply(kh, kl, d[i, b], 0.0)
        gh, _ = dd.subtract(ph, pl, qh, ql)
        fu, fv = (
            d[i, k] * out[a, 2] - d[i, a] * out[k, 2],
            d[i, k] * out[a, 3] - d[i, a] * out[k, 3],
        )
        gu, gv = (
            d[i, k] * out[b, 2] - d[i, b] * out[k, 2],
            d[i, k] * out[b, 3] - d[i, b] * out[k, 3],
        )
        det = fu * gv - fv * gu
        if det == 0.0:
            return False
        su, sv = (fv * gh - gv * fh) / det, (gu * fh - fu * gh) / det
        uh, ul = dd.add(uh, ul, su, 0.0)
        vh, vl = dd.add(vh, vl, sv, 0.0)
        if not (u0 - hu <= uh <= u1 + hu and v0 - hv <= vh <= v1 + hv):
            return False
        if abs(su) <= STEP and abs(sv) <= STEP:
            break
    else:
        return False
    th, tl = dd.divide(kh, kl, d[i, k], 0.0)
    t = th + tl
    nx = out[1, 2] * out[2, 3] - out[2, 2] * out[1, 3]
    ny = out[2, 2] * out[0, 3] - out[0, 2] * out[2, 3]
    nz = out[0, 2] * out[1, 3] - out[1, 2] * out[0, 3]
    norm = np.sqrt(nx * nx + ny * ny + nz * nz)
    cos = abs(nx * d[i, 0] + ny * d[i, 1] + nz * d[i, 2]) / (norm * length)
    # Outside is positive; the gaps are distances between ray and rim, as the ray sees them.
    out_u = max((-uh) - ul, (uh - 1.0) + ul)
    out_v = max((-vh) - vl, (vh - 1.0) + vl)
    ex, ey, ez = d[i, 0] / length, d[i, 1] / length, d[i, 2] / length
    seen_u = cos * norm / (_across(out, 3, ex, ey, ez) + 1e-300)
    seen_v = cos * norm / (_across(out, 2, ex, ey, ez) + 1e-300)
    if abs(out_u) * seen_u <= 2.0 * band or abs(out_v) * seen_v <= 2.0 * band:
        note_edge(found, i, t, band, object_id, p, uh, vh, t_min)
    if out_u <= RIM and out_v <= RIM:
        offer(found, i, t, object_id, p, uh, vh, cos, band / (cos * length), t_min)
        if cos < 1e-4 and _fold_margin(
            control, start, m, n, uh, vh, cos, size, out, work, d, i, length, nx / norm, ny / norm,
            nz / norm,
        ) <= band:  # fmt: skip
            note_fold(found, i, t, t_min)
    off_u = max(u0 - uh, uh - u1)
    off_v = max(v0 - vh, vh - v1)
    return off_u * seen_u <= 0.5 * band and off_v * seen_v <= 0.5 * band


@inner
def _across(out, column, ex, ey, ez):
    """Length of a partial as the ray sees it: |S_x x e|."""
    x, y, z = out[0, column], out[1, column], out[2, column]
    a, b, c = y * ez - z * ey, z * ex - x * ez, x * ey - y * ex
    return np.sqrt(a * a + b * b + c * c)


@inner
def _fold_margin(control, start, m, n, u, v, cos, size, out, work, d, i, length, nx, ny, nz):
    """How far beyond a grazing root the surface turns away from the ray."""
    # The ray in the tangent plane: d = a S_u + b S_v.
    uu = out[0, 2] ** 2 + out[1, 2] ** 2 + out[2, 2] ** 2
    vv = out[0, 3] ** 2 + out[1, 3] ** 2 + out[2, 3] ** 2
    uv = out[0, 2] * out[0, 3] + out[1, 2] * out[1, 3] + out[2, 2] * out[2, 3]
    ru = (out[0, 2] * d[i, 0] + out[1, 2] * d[i, 1] + out[2, 2] * d[i, 2]) / length
    rv = (out[0, 3] * d[i, 0] + out[1, 3] * d[i, 1] + out[2, 3] * d[i, 2]) / length
    det = uu * vv - uv * uv
    if det <= 0.0:
        return 0.0
    a, b = (ru * vv - rv * uv) / det, (rv * uu - ru * uv) / det
    # Deviation from the tangent plane a little further along the ray, both ways; h is where the
    # truncation (h) and the rounding (2**-104 / h**2, the points are pairs) are both small.
    h = 1e-6 * size
    height = 0.0
    x, xl = out[0, 0], out[0, 1]
    y, yl = out[1, 0], out[1, 1]
    z, zl = out[2, 0], out[2, 1]
    for side in range(2):
        step = h if side == 0 else -h
        _evaluate(control, start, m, n, u + step * a, 0.0, v + step * b, 0.0, work, out)
        dx = (out[0, 0] - x) + (out[0, 1] - xl)
        dy = (out[1, 0] - y) + (out[1, 1] - yl)
        dz = (out[2, 0] - z) + (out[2, 1] - zl)
        height += nx * dx + ny * dy + nz * dz
    curvature = abs(height) / (h * h)
    # The second term is for inflections, where the third derivative bends the surface.
    return min(cos * cos / (2.0 * curvature + 1e-300), cos**1.5 * size / 3.0)


@inner
def _evaluate(control, start, m, n, uh, ul, vh, vl, work, out):
    """Point of a patch in pairs, first partials in float64 (de Casteljau).

    ``out[c]`` becomes high, low, S_u and S_v of coordinate c.
    """
    for c in range(3):
        for i in range(m + 1):
            row = start + i * (n + 1)
            for j in range(n + 1):
                work[0, j] = control[row + j, c]
                work[1, j] = 0.0
            for level in range(n, 0, -1):
                if level == 1:
                    work[4, i] = n * ((work[0, 1] - work[0, 0]) + (work[1, 1] - work[1, 0]))
                for j in range(level):
                    work[0, j], work[1, j] = dd.interpolate(
                        work[0, j], work[1, j], work[0, j + 1], work[1, j + 1], vh, vl
                    )
            work[2, i] = work[0, 0]
            work[3, i] = work[1, 0]
        for level in range(m, 0, -1):
            if level == 1:
                out[c, 2] = m * ((work[2, 1] - work[2, 0]) + (work[3, 1] - work[3, 0]))
            for i in range(level):
                work[2, i], work[3, i] = dd.interpolate(
                    work[2, i], work[3, i], work[2, i + 1], work[3, i + 1], uh, ul
                )
                work[4, i] += uh * (work[4, i + 1] - work[4, i])
        out[c, 0] = work[2, 0]
        out[c, 1] = work[3, 0]
        out[c, 3] = work[4, 0]
