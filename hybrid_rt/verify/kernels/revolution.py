"""Rays against surfaces of revolution by bisection in the half-plane, ending in double-double.

In the half-plane of axial position and radius the ray is a branch of a hyperbola, (z(t), rho(t))
with rho convex, and the surface is its profile (Z(s), R(s)). Pieces are pairs of an interval of s
and one of t. A pair is rejected when the two arcs keep apart, along the axes or across the chord of
the profile, by more than the band; it holds at most one root when no tangent of the one is parallel
to one of the other. Otherwise it is halved as patches are, and ends as they do (`patch.py`).
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
)
from meshing.kernels.jit import inner, kernel

STACK = 130
MAX_NODES = 400_000
STEP = 1e-17
MAX_STEPS = 24
RIM = 1e-20


@kernel
def trace_revolution(
    profile, starts, origin, axis, radial, binormal, centre, size, object_id, o, d, t_min, found,
    stack, box, work, ray, out,
):  # fmt: skip
    """Lower ``found`` (n, COLUMNS) by the segments of one surface.

    ``stack`` (STACK + 1, 2, n), ``box`` (STACK + 1, 4), ``work`` (2, 32), ``ray`` (6, 2) and
    ``out`` (2, 4) are scratch.
    """
    for i in range(o.shape[0]):
        length = np.sqrt(d[i, 0] ** 2 + d[i, 1] ** 2 + d[i, 2] ** 2)
        away = np.sqrt(
            (o[i, 0] - centre[0]) ** 2 + (o[i, 1] - centre[1]) ** 2 + (o[i, 2] - centre[2]) ** 2
        )
        band = BAND * max(away, size)
        # Distance along the ray to the place nearest to the centre, and there the frame.
        middle = (
            (centre[0] - o[i, 0]) * d[i, 0]
            + (centre[1] - o[i, 1]) * d[i, 1]
            + (centre[2] - o[i, 2]) * d[i, 2]
        ) / (length * length)
        gap = 0.0
        for c in range(3):
            gap += (o[i, c] + middle * d[i, c] - centre[c]) ** 2
        if np.sqrt(gap) > 0.5 * size + 2.0 * band:
            continue
        wxh, wxl = dd.two_sum(o[i, 0], -origin[0])
        wyh, wyl = dd.two_sum(o[i, 1], -origin[1])
        wzh, wzl = dd.two_sum(o[i, 2], -origin[2])
        _component(ray, 0, wxh, wxl, wyh, wyl, wzh, wzl, d, i, axis)
        _component(ray, 1, wxh, wxl, wyh, wyl, wzh, wzl, d, i, radial)
        _component(ray, 2, wxh, wxl, wyh, wyl, wzh, wzl, d, i, binormal)
        # In units of length from the middle: z = z0 + zd x, (p + q x) across.
        z0 = ray[0, 0] + middle * ray[3, 0]
        p1, p2 = ray[1, 0] + middle * ray[4, 0], ray[2, 0] + middle * ray[5, 0]
        zd, q1, q2 = ray[3, 0] / length, ray[4, 0] / length, ray[5, 0] / length
        for g in range(starts.shape[0] - 1):
            n = starts[g + 1] - starts[g] - 1
            for k in range(n + 1):
                stack[0, 0, k] = profile[starts[g] + k, 0]
                stack[0, 1, k] = profile[starts[g] + k, 1]
            box[0, 0], box[0, 1] = 0.0, 1.0
            box[0, 2], box[0, 3] = -0.5 * size - 4.0 * band, 0.5 * size + 4.0 * band
            _search(
                profile, starts[g], n, g, object_id, size, band, length, middle, z0, zd, p1, p2,
                q1, q2, i, t_min[i], found, stack, box, work, ray, out,
            )  # fmt: skip


@inner
def _component(ray, row, wxh, wxl, wyh, wyl, wzh, wzl, d, i, vector):
    x, y, z = vector[0], vector[1], vector[2]
    ray[row, 0], ray[row, 1] = dd.dot(wxh, wxl, wyh, wyl, wzh, wzl, x, 0.0, y, 0.0, z, 0.0)
    ray[row + 3, 0], ray[row + 3, 1] = dd.dot(
        d[i, 0], 0.0, d[i, 1], 0.0, d[i, 2], 0.0, x, 0.0, y, 0.0, z, 0.0
    )


@inner
def _radius(p1, p2, q1, q2, x):
    return np.sqrt((p1 + q1 * x) ** 2 + (p2 + q2 * x) ** 2)


@inner
def _slope(p1, p2, q1, q2, x):
    """Return the slope of the radius; at the axis itself any value between both sides will do."""
    rho = _radius(p1, p2, q1, q2, x)
    if rho == 0.0:
        return 0.0
    return ((p1 + q1 * x) * q1 + (p2 + q2 * x) * q2) / rho


@inner
def _search(
    profile, start, n, segment, object_id, size, band, length, middle, z0, zd, p1, p2, q1, q2, i,
    t_min, found, stack, box, work, ray, out,
):  # fmt: skip
    qq = q1 * q1 + q2 * q2
    pq = p1 * q1 + p2 * q2
    top = 0
    nodes = 0
    while top >= 0:
        nodes += 1
        x0, x1 = box[top, 2], box[top, 3]
        if nodes > MAX_NODES:
            found[i, UNRESOLVED] += 1
            note_fold(found, i, max(middle + x0 / length, np.nextafter(t_min, np.inf)), t_min)
            break
        if (
            middle + x0 / length > found[i, T] + 2.0 * band / length
            or middle + x1 / length < t_min - 2.0 * band / length
        ):
            top -= 1
            continue
        # --- the box of the arc of the ray and that of the profile
        ra, rb = _radius(p1, p2, q1, q2, x0), _radius(p1, p2, q1, q2, x1)
        low, high = min(ra, rb), max(ra, rb)
        if qq > 0.0 and x0 * qq < -pq < x1 * qq:
            low = abs(p1 * q2 - p2 * q1) / np.sqrt(qq)
        za, zb = z0 + zd * x0, z0 + zd * x1
        f0 = f1 = stack[top, 0, 0]
        g0 = g1 = stack[top, 1, 0]
        for k in range(1, n + 1):
            f0, f1 = min(f0, stack[top, 0, k]), max(f1, stack[top, 0, k])
            g0, g1 = min(g0, stack[top, 1, k]), max(g1, stack[top, 1, k])
        if (
            f0 > max(za, zb) + band or f1 < min(za, zb) - band
            or g0 > high + band or g1 < low - band
        ):  # fmt: skip
            top -= 1
            continue
        # --- across the chord of the profile, or of the ray where the profile's is shorter
        cz, cr = stack[top, 0, n] - stack[top, 0, 0], stack[top, 1, n] - stack[top, 1, 0]
        if cz * cz + cr * cr < (zb - za) ** 2 + (rb - ra) ** 2:
            cz, cr = zb - za, rb - ra
        norm = np.sqrt(cz * cz + cr * cr)
        cz, cr = (cz / norm, cr / norm) if norm > 0.0 else (1.0, 0.0)
        w0, w1 = np.inf, -np.inf
        for k in range(n + 1):
            w = cz * stack[top, 1, k] - cr * stack[top, 0, k]
            w0, w1 = min(w0, w), max(w1, w)
        ha, hb = cz * ra - cr * za, cz * rb - cr * zb
        h0, h1 = min(ha, hb), max(ha, hb)
        # cz rho(x) - cr z(x) is convex or concave: its extremum inside, where rho' = cr zd / cz.
        if cz != 0.0 and qq > 0.0:
            steep = cr * zd / cz
            if steep * steep < qq:
                c = abs(p1 * q2 - p2 * q1) / np.sqrt(qq)
                x = -pq / qq + steep * c / (np.sqrt(qq) * np.sqrt(qq - steep * steep))
                if x0 < x < x1:
                    h = cz * _radius(p1, p2, q1, q2, x) - cr * (z0 + zd * x)
                    h0, h1 = min(h0, h), max(h1, h)
        if w0 > h1 + band or w1 < h0 - band:
            top -= 1
            continue
        # --- at most one root: find it
        s0, s1 = _slope(p1, p2, q1, q2, x0), _slope(p1, p2, q1, q2, x1)
        if _is_single(stack, top, n, zd, min(s0, s1), max(s0, s1), band / 16.0) and _solve(
            profile, start, n, segment, object_id, size, band, length, middle, i, t_min, found,
            box, top, work, ray, out,
        ):  # fmt: skip
            top -= 1
            continue
        # --- too thin to halve on
        if (w1 - w0) + (h1 - h0) <= 0.25 * band or top + 1 == STACK:
            t = middle + 0.5 * (x0 + x1) / length
            if box[top, 0] == 0.0 or box[top, 1] == 1.0:
                s = 0.5 * (box[top, 0] + box[top, 1])
                note_edge(found, i, t, band, object_id, segment, np.nan, s, t_min)
            else:
                t = max(middle + x0 / length, np.nextafter(t_min, np.inf))
                note_fold(found, i, t, t_min)
            top -= 1
            continue
        # --- halve the longer of the two
        total = 0.0
        for k in range(n):
            total += abs(stack[top, 0, k + 1] - stack[top, 0, k])
            total += abs(stack[top, 1, k + 1] - stack[top, 1, k])
        box[top + 1, 0], box[top + 1, 1] = box[top, 0], box[top, 1]
        box[top + 1, 2], box[top + 1, 3] = x0, x1
        if total > x1 - x0:
            _halve(stack, top, n)
            half = 0.5 * (box[top, 0] + box[top, 1])
            box[top, 1] = half
            box[top + 1, 0] = half
        else:
            for k in range(n + 1):
                stack[top + 1, 0, k] = stack[top, 0, k]
                stack[top + 1, 1, k] = stack[top, 1, k]
            half = 0.5 * (x0 + x1)
            # Nearer half on top.
            box[top, 2] = half
            box[top + 1, 3] = half
        top += 1
    found[i, NODES] += nodes


@inner
def _halve(stack, top, n):
    for c in range(2):
        stack[top + 1, c, n] = stack[top, c, n]
        for r in range(1, n + 1):
            for k in range(n, r - 1, -1):
                stack[top, c, k] = 0.5 * (stack[top, c, k - 1] + stack[top, c, k])
            stack[top + 1, c, n - r] = stack[top, c, n]


@inner
def _is_single(stack, top, n, zd, s0, s1, slop):
    """Whether no tangent of the profile is parallel to one of the ray: at most one root."""
    a0 = b0 = np.inf
    a1 = b1 = -np.inf
    for k in range(n):
        a, b = stack[top, 0, k + 1] - stack[top, 0, k], stack[top, 1, k + 1] - stack[top, 1, k]
        a0, a1 = min(a0, n * a), max(a1, n * a)
        b0, b1 = min(b0, n * b), max(b1, n * b)
    a0, a1, b0, b1 = a0 - slop, a1 + slop, b0 - slop, b1 + slop
    # The slope of the ray is of order one and good to a few roundings.
    s0, s1 = s0 - 4e-15, s1 + 4e-15
    p0 = min(a0 * s0, a0 * s1, a1 * s0, a1 * s1)
    p1 = max(a0 * s0, a0 * s1, a1 * s0, a1 * s1)
    q0, q1 = min(b0 * zd, b1 * zd), max(b0 * zd, b1 * zd)
    return p0 > q1 or p1 < q0


@inner
def _profile_point(profile, start, n, sh, sl, work, out):
    """Make ``out[c]`` high, low, first and second derivative of coordinate c of a segment."""
    for c in range(2):
        for k in range(n + 1):
            work[0, k] = profile[start + k, c]
            work[1, k] = 0.0
        out[c, 3] = 0.0
        for level in range(n, 0, -1):
            if level == 2:
                out[c, 3] = n * (n - 1) * ((work[0, 2] - work[0, 1]) - (work[0, 1] - work[0, 0]))
            if level == 1:
                out[c, 2] = n * ((work[0, 1] - work[0, 0]) + (work[1, 1] - work[1, 0]))
            for k in range(level):
                dh, dl = dd.subtract(work[0, k + 1], work[1, k + 1], work[0, k], work[1, k])
                dh, dl = dd.multiply(dh, dl, sh, sl)
                work[0, k], work[1, k] = dd.add(work[0, k], work[1, k], dh, dl)
        out[c, 0], out[c, 1] = work[0, 0], work[1, 0]


@inner
def _solve(
    profile, start, n, segment, object_id, size, band, length, middle, i, t_min, found, box, top,
    work, ray, out,
):  # fmt: skip
    """Newton from a pair of intervals; offer the root; whether the root settles the pair."""
    s0, s1 = box[top, 0], box[top, 1]
    x0, x1 = box[top, 2], box[top, 3]
    sh, sl = 0.5 * (s0 + s1), 0.0
    th, tl = middle + 0.5 * (x0 + x1) / length, 0.0
    zdh, q1h, q2h = ray[3, 0], ray[4, 0], ray[5, 0]
    for _ in range(MAX_STEPS):
        _profile_point(profile, start, n, sh, sl, work, out)
        zh, zl = dd.multiply(ray[3, 0], ray[3, 1], th, tl)
        zh, zl = dd.add(zh, zl, ray[0, 0], ray[0, 1])
        ah, al = dd.multiply(ray[4, 0], ray[4, 1], th, tl)
        ah, al = dd.add(ah, al, ray[1, 0], ray[1, 1])
        bh, bl = dd.multiply(ray[5, 0], ray[5, 1], th, tl)
        bh, bl = dd.add(bh, bl, ray[2, 0], ray[2, 1])
        fh, _ = dd.subtract(out[0, 0], out[0, 1], zh, zl)
        gh, gl = dd.multiply(out[1, 0], out[1, 1], out[1, 0], out[1, 1])
        ph, pl = dd.multiply(ah, al, ah, al)
        gh, gl = dd.subtract(gh, gl, ph, pl)
        ph, pl = dd.multiply(bh, bl, bh, bl)
        gh, gl = dd.subtract(gh, gl, ph, pl)
        js, jt = out[0, 2], -zdh
        ks, kt = 2.0 * out[1, 0] * out[1, 2], -2.0 * (ah * q1h + bh * q2h)
        det = js * kt - jt * ks
        if det == 0.0:
            return False
        ds, dt = (jt * gh - kt * fh) / det, (ks * fh - js * gh) / det
        sh, sl = dd.add(sh, sl, ds, 0.0)
        th, tl = dd.add(th, tl, dt, 0.0)
        x = (th - middle) * length
        if not (2.0 * s0 - s1 <= sh <= 2.0 * s1 - s0 and 2.0 * x0 - x1 <= x <= 2.0 * x1 - x0):
            return False
        if abs(ds) <= STEP and abs(dt) * length <= STEP * size:
            break
    else:
        return False
    t = th + tl
    rho = np.sqrt(ah * ah + bh * bh)
    if out[1, 0] < 0.0 or rho == 0.0:
        return False
    slope = (ah * q1h + bh * q2h) / (rho * length)
    zd = zdh / length
    norm = np.sqrt(out[0, 2] ** 2 + out[1, 2] ** 2)
    cos = abs(out[0, 2] * slope - out[1, 2] * zd) / norm
    turn = np.arctan2(bh, ah) / (2.0 * np.pi)
    if turn < 0.0:
        turn += 1.0
    # Gaps are distances between ray and rim, as the ray sees them: the rim runs around the axis.
    around = (ah * q2h - bh * q1h) / (rho * length)
    seen = norm * cos / np.sqrt(max(1.0 - around * around, 1e-30))
    out_s = max((-sh) - sl, (sh - 1.0) + sl)
    if abs(out_s) * seen <= 2.0 * band:
        note_edge(found, i, t, band, object_id, segment, turn, sh, t_min)
    if out_s <= RIM:
        offer(found, i, t, object_id, segment, turn, sh, cos, band / (cos * length), t_min)
        if cos < 1e-4:
            # Distance of the arcs along the ray, to second order.
            bend = (q1h * q1h + q2h * q2h) / (length * length) - slope * slope
            curvature = out[0, 2] / norm * bend / rho
            curvature -= (
                (out[0, 2] * out[1, 3] - out[1, 2] * out[0, 3])
                / norm**3
                * (zd * zd + slope * slope)
            )
            margin = min(cos * cos / (2.0 * abs(curvature) + 1e-300), cos**1.5 * size / 3.0)
            if margin <= band:
                note_fold(found, i, t, t_min)
    off_s = max(s0 - sh, sh - s1)
    off_x = max(x0 - x, x - x1)
    return off_s * seen <= 0.5 * band and off_x * cos <= 0.5 * band
