"""Roots of rays on spheres, flat faces, planes and boxes: closed forms in double-double."""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel
from proof.judges.kernels.double_double import (
    add,
    advance,
    divide,
    dot,
    multiply,
    root,
    subtract,
    two_sum,
)
from proof.judges.kernels.events import AROUND, BAND, DOUBTFUL, ROOT, SHIFT, note
from proof.judges.kernels.patch_bisection import normal_frame

# A ray is in the plane of a face up to so many bands, and on the face up to so many beside its edges.
IN_PLANE, BESIDE = 8.0, 4.0


@inner
def _length(d):
    return math.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])


@inner
def _distance(o, p):
    return math.sqrt((o[0] - p[0]) ** 2 + (o[1] - p[1]) ** 2 + (o[2] - p[2]) ** 2)


@kernel
def sphere_events(center, radius, object_id, first_ray, origins, directions, events):
    """Note the roots of rays on one sphere."""
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = _length(d)
        band = BAND * max(_distance(o, center), 2.0 * radius)
        # From the point of the ray next to the centre.
        shift = 0.0
        for k in range(3):
            shift += (center[k] - o[k]) * d[k]
        shift /= length * length
        ah, al = advance(o[0], shift, d[0])
        bh, bl = advance(o[1], shift, d[1])
        ch, cl = advance(o[2], shift, d[2])
        ah, al = subtract(ah, al, center[0], 0.0)
        bh, bl = subtract(bh, bl, center[1], 0.0)
        ch, cl = subtract(ch, cl, center[2], 0.0)
        gh, gl = dot(ah, al, bh, bl, ch, cl, d[0], 0.0, d[1], 0.0, d[2], 0.0)
        sh, sl = dot(d[0], 0.0, d[1], 0.0, d[2], 0.0, d[0], 0.0, d[1], 0.0, d[2], 0.0)
        qh, ql = dot(ah, al, bh, bl, ch, cl, ah, al, bh, bl, ch, cl)
        rh, rl = multiply(radius, 0.0, radius, 0.0)
        # Foot distance squared: q - g^2 / s.
        fh, fl = multiply(gh, gl, gh, gl)
        fh, fl = divide(fh, fl, sh, sl)
        fh, fl = subtract(qh, ql, fh, fl)
        eh, el = subtract(rh, rl, fh, fl)
        foot = math.sqrt(max(fh, 0.0))
        margin = eh / (radius + foot)
        if margin < -band:
            continue
        gh, gl = divide(-gh, -gl, sh, sl)
        kind = ROOT if margin > band else DOUBTFUL
        wh, wl = divide(eh, el, sh, sl)
        wh, wl = root(wh, wl)
        cosine = math.sqrt(max(eh, 0.0)) / radius
        if margin <= 0.0:
            note(
                events, first_ray + i, shift + gh, object_id, 0, 0.0, 0.0,
                math.sqrt(2.0 * band / radius), band, kind, 0,
            )  # fmt: skip
            continue
        for sign in (-1.0, 1.0):
            th, tl = add(gh, gl, sign * wh, sign * wl)
            th, tl = add(th, tl, shift, 0.0)
            note(
                events, first_ray + i, th, object_id, 0, 0.0, 0.0,
                max(cosine, math.sqrt(2.0 * band / radius) if kind == DOUBTFUL else 0.0),
                band, kind, 0,
            )  # fmt: skip


@inner
def _meet_face(point, d, length, corner, edge_u, edge_v, is_triangle):
    """Meet c + u e + v f: t from ``point``, u, v, |cos|, distance of the ray inside the rim.

    ``point`` (3, 2): double-double.
    """
    ah, al = subtract(point[0, 0], point[0, 1], corner[0], 0.0)
    bh, bl = subtract(point[1, 0], point[1, 1], corner[1], 0.0)
    ch, cl = subtract(point[2, 0], point[2, 1], corner[2], 0.0)
    e0, e1, e2 = edge_u[0], edge_u[1], edge_u[2]
    f0, f1, f2 = edge_v[0], edge_v[1], edge_v[2]
    xh, xl = _minor(e1, 0.0, f2, 0.0, e2, 0.0, f1, 0.0)
    yh, yl = _minor(e2, 0.0, f0, 0.0, e0, 0.0, f2, 0.0)
    zh, zl = _minor(e0, 0.0, f1, 0.0, e1, 0.0, f0, 0.0)
    sh, sl = dot(xh, xl, yh, yl, zh, zl, d[0], 0.0, d[1], 0.0, d[2], 0.0)
    rh, rl = dot(xh, xl, yh, yl, zh, zl, ah, al, bh, bl, ch, cl)
    size = math.sqrt(xh * xh + yh * yh + zh * zh)
    if size == 0.0 or sh == 0.0:
        return 0.0, 0.0, 0.0, 0.0, -np.inf
    th, tl = divide(-rh, -rl, sh, sl)
    # The point, relative to the corner; then its coordinates along the edges.
    ph, pl = multiply(th, tl, d[0], 0.0)
    ah, al = add(ah, al, ph, pl)
    ph, pl = multiply(th, tl, d[1], 0.0)
    bh, bl = add(bh, bl, ph, pl)
    ph, pl = multiply(th, tl, d[2], 0.0)
    ch, cl = add(ch, cl, ph, pl)
    nh, nl = dot(xh, xl, yh, yl, zh, zl, xh, xl, yh, yl, zh, zl)
    ih, il = _minor(bh, bl, f2, 0.0, ch, cl, f1, 0.0)
    jh, jl = _minor(ch, cl, f0, 0.0, ah, al, f2, 0.0)
    kh, kl = _minor(ah, al, f1, 0.0, bh, bl, f0, 0.0)
    uh, ul = dot(ih, il, jh, jl, kh, kl, xh, xl, yh, yl, zh, zl)
    uh, ul = divide(uh, ul, nh, nl)
    ih, il = _minor(e1, 0.0, ch, cl, e2, 0.0, bh, bl)
    jh, jl = _minor(e2, 0.0, ah, al, e0, 0.0, ch, cl)
    kh, kl = _minor(e0, 0.0, bh, bl, e1, 0.0, ah, al)
    vh, vl = dot(ih, il, jh, jl, kh, kl, xh, xl, yh, yl, zh, zl)
    vh, vl = divide(vh, vl, nh, nl)
    across = abs(sh) / length
    per_u = across / max(_side(f0, f1, f2, d, length), 1e-300)
    per_v = across / max(_side(e0, e1, e2, d, length), 1e-300)
    if is_triangle:
        wh, _ = add(uh, ul, vh, vl)
        wh, _ = subtract(1.0, 0.0, wh, _)
        per_w = across / max(_side(f0 - e0, f1 - e1, f2 - e2, d, length), 1e-300)
        inside = min(uh * per_u, vh * per_v, wh * per_w)
    else:
        inside = min(min(uh, 1.0 - uh) * per_u, min(vh, 1.0 - vh) * per_v)
    return th, uh, vh, across / size, inside


@inner
def _stretch(point, d, corner, edge_u, edge_v, is_triangle, band):
    """Return between which t from ``point`` a ray in the plane of a face is on it, up to the band.

    The second is less than the first if there are none, or if the ray is off the plane.
    """
    x, y, z = point[0, 0] - corner[0], point[1, 0] - corner[1], point[2, 0] - corner[2]
    e0, e1, e2 = edge_u[0], edge_u[1], edge_u[2]
    f0, f1, f2 = edge_v[0], edge_v[1], edge_v[2]
    nx, ny, nz = e1 * f2 - e2 * f1, e2 * f0 - e0 * f2, e0 * f1 - e1 * f0
    square = nx * nx + ny * ny + nz * nz
    norm = math.sqrt(square)
    if norm == 0.0 or abs(x * nx + y * ny + z * nz) > IN_PLANE * band * norm:
        return 0.0, -1.0
    # Rows that give the coordinates along the edges.
    ux, uy, uz = f1 * nz - f2 * ny, f2 * nx - f0 * nz, f0 * ny - f1 * nx
    vx, vy, vz = ny * e2 - nz * e1, nz * e0 - nx * e2, nx * e1 - ny * e0
    u = (x * ux + y * uy + z * uz) / square
    v = (x * vx + y * vy + z * vz) / square
    du = (d[0] * ux + d[1] * uy + d[2] * uz) / square
    dv = (d[0] * vx + d[1] * vy + d[2] * vz) / square
    # What a step of the band across an edge makes of them.
    per_u = math.sqrt(f0 * f0 + f1 * f1 + f2 * f2) / norm * BESIDE * band
    per_v = math.sqrt(e0 * e0 + e1 * e1 + e2 * e2) / norm * BESIDE * band
    begin, end = _clip(-np.inf, np.inf, u + per_u, du)
    begin, end = _clip(begin, end, v + per_v, dv)
    if is_triangle:
        a, b, c = f0 - e0, f1 - e1, f2 - e2
        per_w = math.sqrt(a * a + b * b + c * c) / norm * BESIDE * band
        return _clip(begin, end, 1.0 - u - v + per_w, -du - dv)
    begin, end = _clip(begin, end, 1.0 - u + per_u, -du)
    return _clip(begin, end, 1.0 - v + per_v, -dv)


@inner
def _clip(begin, end, side, slope):
    """Keep of a stretch the part where side + t slope is not negative."""
    if slope > 0.0:
        return max(begin, -side / slope), end
    if slope < 0.0:
        return begin, min(end, -side / slope)
    return (begin, end) if side >= 0.0 else (begin, -np.inf)


@inner
def _minor(ah, al, bh, bl, ch, cl, dh, dl):
    """Return a b - c d."""
    ph, pl = multiply(ah, al, bh, bl)
    qh, ql = multiply(ch, cl, dh, dl)
    return subtract(ph, pl, qh, ql)


@inner
def _side(x, y, z, d, length):
    """Length of the part of a vector at right angles to the ray."""
    a = y * d[2] - z * d[1]
    b = z * d[0] - x * d[2]
    c = x * d[1] - y * d[0]
    return math.sqrt(a * a + b * b + c * c) / length


@inner
def _off_face(o, d, length, center, radius, reach):
    """Whether a ray clearly misses the ball around a face."""
    x, y, z = center[0] - o[0], center[1] - o[1], center[2] - o[2]
    return _side(x, y, z, d, length) > radius + reach


@kernel
def face_events(
    corners, edges_u, edges_v, is_triangle, middle, size, object_id, first_ray,
    origins, directions, events,
):  # fmt: skip
    """Note the roots of rays on the faces of one object (a rectangle, a triangle mesh).

    A root at a rim is certain if eight rays around this one meet the object there too.
    """
    n = len(corners)
    centers = np.empty((n, 3))
    radii = np.empty(n)
    for f in range(n):
        for k in range(3):
            centers[f, k] = corners[f, k] + 0.5 * (edges_u[f, k] + edges_v[f, k])
        radii[f] = 0.5 * (_length(edges_u[f]) + _length(edges_v[f]))
    point, frame = np.zeros((3, 2)), np.empty((3, 3))
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = _length(d)
        band = BAND * max(_distance(o, middle), size)
        for f in range(n):
            reach = 4.0 * band + 1e-9 * size
            if _off_face(o, d, length, centers[f], radii[f], reach):
                continue
            along = 0.0
            for k in range(3):
                along += (centers[f, k] - o[k]) * d[k]
            shift = along / (length * length)
            for k in range(3):
                point[k, 0], point[k, 1] = advance(o[k], shift, d[k])
            t, u, v, cosine, inside = _meet_face(
                point, d, length, corners[f], edges_u[f], edges_v[f], is_triangle
            )
            t += shift
            if cosine * size <= 4.0 * band:
                # Within its plane: where it meets the face is undecided, if it does.
                begin, end = _stretch(
                    point, d, corners[f], edges_u[f], edges_v[f], is_triangle, band
                )
                if begin <= end:
                    wide = band / max((end - begin) * length, band)
                    for t in (begin, end):
                        note(
                            events, first_ray + i, shift + t, object_id, f, 0.5, 0.5, wide, band,
                            DOUBTFUL, 0,
                        )  # fmt: skip
                continue
            if inside < -SHIFT * band:
                continue
            if inside > SHIFT * band:
                note(events, first_ray + i, t, object_id, f, u, v, cosine, band, ROOT, 0)
                continue
            normal_frame(d[0] / length, d[1] / length, d[2] / length, frame)
            window = 8.0 * band / cosine + 64.0 * band
            is_covered = True
            least, most = np.inf, -np.inf
            for c, s in AROUND:
                for k in range(3):
                    h, e = advance(o[k], t, d[k])
                    h, g = two_sum(h, (c * frame[0, k] + s * frame[1, k]) * (SHIFT * band))
                    point[k, 0], point[k, 1] = two_sum(h, e + g)
                is_met = False
                for g in range(n):
                    x, y, z = point[0, 0], point[1, 0], point[2, 0]
                    x, y, z = x - centers[g, 0], y - centers[g, 1], z - centers[g, 2]
                    if math.sqrt(x * x + y * y + z * z) > radii[g] + window:
                        continue
                    there, _, _, _, inner_side = _meet_face(
                        point, d, length, corners[g], edges_u[g], edges_v[g], is_triangle
                    )
                    # A shared edge is one edge: within its own rounding.
                    if inner_side >= -band / 64.0 and abs(there) * length <= window:
                        is_met = True
                        least, most = min(least, there), max(most, there)
                        break
                if not is_met:
                    is_covered = False
                    break
            kind = ROOT if is_covered else DOUBTFUL
            if is_covered:
                # Which face is met is open, and so is t, as far as the faces around go.
                steep = (most - least) * length / band
                cosine = min(cosine, 1.0 / math.sqrt(1.0 + steep * steep))
            note(events, first_ray + i, t, object_id, f, u, v, cosine, band, kind, 1)


@kernel
def plane_events(at, normal, object_id, first_ray, origins, directions, events):
    """Note the roots of rays on one plane."""
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = _length(d)
        band = BAND * _distance(o, at)
        ah, al = two_sum(at[0], -o[0])
        bh, bl = two_sum(at[1], -o[1])
        ch, cl = two_sum(at[2], -o[2])
        x, y, z = normal[0], normal[1], normal[2]
        gh, gl = dot(ah, al, bh, bl, ch, cl, x, 0.0, y, 0.0, z, 0.0)
        sh, sl = dot(d[0], 0.0, d[1], 0.0, d[2], 0.0, x, 0.0, y, 0.0, z, 0.0)
        if sh == 0.0:
            continue
        t, _ = divide(gh, gl, sh, sl)
        cosine = abs(sh) / (length * _length(normal))
        # A plane has no size: its scale is how far away the ray meets it.
        band = max(band, BAND * abs(t) * length)
        kind = ROOT if cosine > BAND else DOUBTFUL
        note(events, first_ray + i, t, object_id, 0, 0.0, 0.0, cosine, band, kind, 0)


@kernel
def box_events(lo, hi, object_id, first_ray, origins, directions, events):
    """Note the roots of rays on one box: where it enters its last slab, leaves its first."""
    middle = 0.5 * (lo + hi)
    size = _distance(lo, hi)
    near, far = np.empty((3, 2)), np.empty((3, 2))
    for i in range(len(origins)):
        o, d = origins[i], directions[i]
        length = _length(d)
        band = BAND * max(_distance(o, middle), size)
        margin = np.inf
        for k in range(3):
            ah, al = two_sum(lo[k], -o[k])
            bh, bl = two_sum(hi[k], -o[k])
            if d[k] == 0.0:
                margin = min(margin, -ah, bh)
                near[k, 0], far[k, 0] = -np.inf, np.inf
                near[k, 1], far[k, 1] = 0.0, 0.0
                continue
            ah, al = divide(ah, al, d[k], 0.0)
            bh, bl = divide(bh, bl, d[k], 0.0)
            if d[k] < 0.0:
                ah, al, bh, bl = bh, bl, ah, al
            near[k, 0], near[k, 1], far[k, 0], far[k, 1] = ah, al, bh, bl
        # The ray passes the edge of slabs j and k at this distance, measured across that edge.
        for j in range(3):
            for k in range(3):
                if j != k and d[j] != 0.0 and d[k] != 0.0:
                    gap, _ = subtract(far[k, 0], far[k, 1], near[j, 0], near[j, 1])
                    arm = math.sqrt(d[j] * d[j] + d[k] * d[k])
                    margin = min(margin, gap * abs(d[j]) * (abs(d[k]) / arm))
        if margin < -band:
            continue
        kind = ROOT if margin > band else DOUBTFUL
        j, k = 0, 0
        for axis in range(1, 3):
            if near[axis, 0] > near[j, 0]:
                j = axis
            if far[axis, 0] < far[k, 0]:
                k = axis
        entry = 2 * j + (0 if d[j] > 0.0 else 1)
        leave = 2 * k + (1 if d[k] > 0.0 else 0)
        cosine = abs(d[j]) / length
        note(events, first_ray + i, near[j, 0], object_id, entry, 0.0, 0.0, cosine, band, kind, 0)
        cosine = abs(d[k]) / length
        note(events, first_ray + i, far[k, 0], object_id, leave, 0.0, 0.0, cosine, band, kind, 0)
