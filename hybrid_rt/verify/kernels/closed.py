"""Rays against spheres and flat faces, in double-double."""

import numpy as np

from hybrid_rt.verify.kernels import double_double as dd
from hybrid_rt.verify.kernels.found import BAND, T, note_edge, note_fold, offer
from meshing.kernels.jit import inner, kernel

PARALLELOGRAM, TRIANGLE, PLANE = 0, 1, 2


@kernel
def trace_sphere(centre, radius, object_id, o, d, t_min, found):
    """Lower ``found`` by one sphere."""
    for i in range(o.shape[0]):
        xh, xl = dd.two_sum(o[i, 0], -centre[0])
        yh, yl = dd.two_sum(o[i, 1], -centre[1])
        zh, zl = dd.two_sum(o[i, 2], -centre[2])
        dx, dy, dz = d[i, 0], d[i, 1], d[i, 2]
        ah, al = dd.dot(dx, 0.0, dy, 0.0, dz, 0.0, dx, 0.0, dy, 0.0, dz, 0.0)
        bh, bl = dd.dot(xh, xl, yh, yl, zh, zl, dx, 0.0, dy, 0.0, dz, 0.0)
        ch, cl = _square(xh, xl, yh, yl, zh, zl)
        rh, rl = dd.two_product(radius, radius)
        ch, cl = dd.subtract(ch, cl, rh, rl)
        ph, pl = dd.multiply(bh, bl, bh, bl)
        qh, ql = dd.multiply(ah, al, ch, cl)
        disc, low = dd.subtract(ph, pl, qh, ql)
        length = np.sqrt(ah)
        # The size of a sphere is the diagonal of its box.
        band = BAND * max(np.sqrt(xh * xh + yh * yh + zh * zh), 2.0 * np.sqrt(3.0) * radius)
        # disc / a = radius^2 - gap^2.
        gap = np.sqrt(max(radius * radius - disc / ah, 0.0))
        if abs(disc / ah) <= band * (gap + radius):
            # Both sides of the contact lie within the root of the band.
            reach = np.sqrt(abs(disc)) / ah
            note_fold(found, i, -bh / ah - reach, t_min[i])
            note_fold(found, i, -bh / ah + reach, t_min[i])
        if disc <= 0.0:
            continue
        sh, sl = dd.root(disc, low)
        cos = np.sqrt(disc / ah) / radius
        for sign in range(2):
            nh, nl = (dd.subtract(-bh, -bl, sh, sl)) if sign == 0 else (dd.add(-bh, -bl, sh, sl))
            th, tl = dd.divide(nh, nl, ah, al)
            offer(
                found,
                i,
                th + tl,
                object_id,
                0,
                np.nan,
                np.nan,
                cos,
                band / (cos * length),
                t_min[i],
            )


@inner
def _square(xh, xl, yh, yl, zh, zl):
    ah, al = dd.multiply(xh, xl, xh, xl)
    bh, bl = dd.multiply(yh, yl, yh, yl)
    ch, cl = dd.multiply(zh, zl, zh, zl)
    ah, al = dd.add(ah, al, bh, bl)
    return dd.add(ah, al, ch, cl)


@inner
def _cross(a, b, out):
    """Cross product of two vectors of pairs, each (3, 2)."""
    for c in range(3):
        j, k = (c + 1) % 3, (c + 2) % 3
        ph, pl = dd.multiply(a[j, 0], a[j, 1], b[k, 0], b[k, 1])
        qh, ql = dd.multiply(a[k, 0], a[k, 1], b[j, 0], b[j, 1])
        out[c, 0], out[c, 1] = dd.subtract(ph, pl, qh, ql)


@inner
def _dot(a, b):
    return dd.dot(
        a[0, 0], a[0, 1], a[1, 0], a[1, 1], a[2, 0], a[2, 1],
        b[0, 0], b[0, 1], b[1, 0], b[1, 1], b[2, 0], b[2, 1],
    )  # fmt: skip


@inner
def _length(a):
    return np.sqrt(a[0, 0] ** 2 + a[1, 0] ** 2 + a[2, 0] ** 2)


@inner
def _plane(i, x, y, z, nx, ny, nz, object_id, o, d, length, t_min, found):
    """Offer the root of the plane through (x, y, z) with normal (nx, ny, nz)."""
    xh, xl = dd.two_sum(o[i, 0], -x)
    yh, yl = dd.two_sum(o[i, 1], -y)
    zh, zl = dd.two_sum(o[i, 2], -z)
    nh, nl = dd.dot(xh, xl, yh, yl, zh, zl, nx, 0.0, ny, 0.0, nz, 0.0)
    ch, cl = dd.dot(d[i, 0], 0.0, d[i, 1], 0.0, d[i, 2], 0.0, nx, 0.0, ny, 0.0, nz, 0.0)
    cos = abs(ch) / length
    if ch != 0.0:
        th, tl = dd.divide(-nh, -nl, ch, cl)
        band = BAND * np.sqrt(xh * xh + yh * yh + zh * zh)
        doubt = band / (cos * length)
        offer(found, i, th + tl, object_id, 0, np.nan, np.nan, cos, doubt, t_min[i])
    if cos <= BAND:
        note_fold(found, i, np.nextafter(t_min[i], np.inf), t_min[i])


@kernel
def trace_flat(faces, ids, kind, centre, size, object_id, o, d, t_min, found, work):
    """Lower ``found`` by flat faces.

    ``faces`` (k, 5, 3): corner, two edges, and what is missing from the edges to be exact; of a
    plane, a point and the normal. ``work`` (7, 3, 2) is scratch.
    """
    w, ray, a, b, normal, cross, third = (
        work[0], work[1], work[2], work[3], work[4], work[5], work[6],
    )  # fmt: skip
    for i in range(o.shape[0]):
        length, away = 0.0, 0.0
        for c in range(3):
            ray[c, 0], ray[c, 1] = d[i, c], 0.0
            length += d[i, c] ** 2
            away += (o[i, c] - centre[c]) ** 2
        length, away = np.sqrt(length), np.sqrt(away)
        band = BAND * max(away, size)
        for f in range(faces.shape[0]):
            if kind == PLANE:
                _plane(
                    i, faces[f, 0, 0], faces[f, 0, 1], faces[f, 0, 2], faces[f, 1, 0],
                    faces[f, 1, 1], faces[f, 1, 2], object_id, o, d, length, t_min, found,
                )  # fmt: skip
                continue
            for c in range(3):
                w[c, 0], w[c, 1] = dd.two_sum(o[i, c], -faces[f, 0, c])
                a[c, 0], a[c, 1] = faces[f, 1, c], faces[f, 3, c]
                b[c, 0], b[c, 1] = faces[f, 2, c], faces[f, 4, c]
            # A sphere about the face keeps most away.
            reach = _length(a) + _length(b)
            near = 0.0
            for c in range(3):
                near -= (w[c, 0] - 0.5 * (a[c, 0] + b[c, 0])) * d[i, c]
            near /= length * length
            gap = 0.0
            for c in range(3):
                gap += (w[c, 0] - 0.5 * (a[c, 0] + b[c, 0]) + near * d[i, c]) ** 2
            if np.sqrt(gap) > reach + band or near - (reach + band) / length > found[i, T]:
                continue
            _cross(a, b, normal)
            area = _length(normal)
            if area == 0.0:
                continue
            # w + t d = u a + v b by Cramer's rule.
            ch, cl = _dot(ray, normal)
            nh, nl = _dot(w, normal)
            cos = abs(ch) / (area * length)
            if cos * reach <= band and abs(nh) / area <= 2.0 * band + cos * (reach + away):
                first = np.nextafter(t_min[i], np.inf)
                note_fold(found, i, max(near - reach / length, first), t_min[i])
            if ch == 0.0:
                continue
            th, tl = dd.divide(-nh, -nl, ch, cl)
            t = th + tl
            _cross(b, ray, cross)
            uh, ul = _dot(w, cross)
            across_u = _length(cross) + 1e-300
            _cross(ray, a, cross)
            vh, vl = _dot(w, cross)
            across_v = _length(cross) + 1e-300
            gap = min(abs(uh) / across_u, abs(vh) / across_v)
            uh, ul = dd.divide(uh, ul, ch, cl)
            vh, vl = dd.divide(vh, vl, ch, cl)
            if kind == TRIANGLE:
                sh, sl = dd.add(uh, ul, vh, vl)
                rest = (1.0 - sh) - sl
                for c in range(3):
                    third[c, 0], third[c, 1] = dd.subtract(b[c, 0], b[c, 1], a[c, 0], a[c, 1])
                _cross(third, ray, cross)
                gap = min(gap, abs(rest * ch) / (_length(cross) + 1e-300))
                is_in = uh >= 0.0 and vh >= 0.0 and rest >= 0.0
            else:
                rest_u, rest_v = (1.0 - uh) - ul, (1.0 - vh) - vl
                gap = min(gap, abs(rest_u * ch) / across_u, abs(rest_v * ch) / across_v)
                is_in = uh >= 0.0 and vh >= 0.0 and rest_u >= 0.0 and rest_v >= 0.0
            if gap <= band:
                note_edge(found, i, t, band, object_id, ids[f], uh, vh, t_min[i])
            if is_in:
                doubt = band / (cos * length)
                offer(found, i, t, object_id, ids[f], uh, vh, cos, doubt, t_min[i])
