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
def _minor(a, b, c, e):
    """Form a b - c e exactly but for 2**-104."""
    ph, pl = dd.two_product(a, b)
    qh, ql = dd.two_product(c, e)
    return dd.subtract(ph, pl, qh, ql)


@inner
def _triple(wxh, wxl, wyh, wyl, wzh, wzl, ax, ay, az, bx, by, bz):
    """Form w . (a x b) in pairs, and |a x b|."""
    ch, cl = _minor(ay, bz, az, by)
    eh, el = _minor(az, bx, ax, bz)
    gh, gl = _minor(ax, by, ay, bx)
    xh, xl = dd.multiply(wxh, wxl, ch, cl)
    yh, yl = dd.multiply(wyh, wyl, eh, el)
    zh, zl = dd.multiply(wzh, wzl, gh, gl)
    xh, xl = dd.add(xh, xl, yh, yl)
    xh, xl = dd.add(xh, xl, zh, zl)
    return xh, xl, np.sqrt(ch * ch + eh * eh + gh * gh)


@kernel
def trace_flat(faces, ids, kind, centre, size, object_id, o, d, t_min, found):
    """Lower ``found`` by flat faces (k, 3, 3): corner and two edges; point and normal of a plane."""
    for i in range(o.shape[0]):
        dx, dy, dz = d[i, 0], d[i, 1], d[i, 2]
        length = np.sqrt(dx * dx + dy * dy + dz * dz)
        away = np.sqrt(
            (o[i, 0] - centre[0]) ** 2 + (o[i, 1] - centre[1]) ** 2 + (o[i, 2] - centre[2]) ** 2
        )
        band = BAND * max(away, size)
        for f in range(faces.shape[0]):
            xh, xl = dd.two_sum(o[i, 0], -faces[f, 0, 0])
            yh, yl = dd.two_sum(o[i, 1], -faces[f, 0, 1])
            zh, zl = dd.two_sum(o[i, 2], -faces[f, 0, 2])
            ax, ay, az = faces[f, 1, 0], faces[f, 1, 1], faces[f, 1, 2]
            bx, by, bz = faces[f, 2, 0], faces[f, 2, 1], faces[f, 2, 2]
            if kind == PLANE:
                nh, nl = dd.dot(xh, xl, yh, yl, zh, zl, ax, 0.0, ay, 0.0, az, 0.0)
                ch, cl = dd.dot(dx, 0.0, dy, 0.0, dz, 0.0, ax, 0.0, ay, 0.0, az, 0.0)
                cos = abs(ch) / length
                if ch != 0.0:
                    th, tl = dd.divide(-nh, -nl, ch, cl)
                    offer(
                        found, i, th + tl, object_id, 0, np.nan, np.nan, cos,
                        band / (cos * length), t_min[i],
                    )  # fmt: skip
                if cos <= BAND:
                    note_fold(found, i, np.nextafter(t_min[i], np.inf), t_min[i])
                continue
            # A sphere about the face keeps most away.
            mx, my, mz = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)
            reach = np.sqrt(ax * ax + ay * ay + az * az) + np.sqrt(bx * bx + by * by + bz * bz)
            gx, gy, gz = xh - mx, yh - my, zh - mz
            near = -(gx * dx + gy * dy + gz * dz) / (length * length)
            gx, gy, gz = gx + near * dx, gy + near * dy, gz + near * dz
            if np.sqrt(gx * gx + gy * gy + gz * gz) > reach + band:
                continue
            if near - (reach + band) / length > found[i, T]:
                continue
            ch, cl, area = _triple(dx, 0.0, dy, 0.0, dz, 0.0, ax, ay, az, bx, by, bz)
            cos = abs(ch) / (area * length)
            nh, nl, _ = _triple(xh, xl, yh, yl, zh, zl, ax, ay, az, bx, by, bz)
            if cos * reach <= band and abs(nh) / area <= 2.0 * band + cos * (reach + away):
                first = np.nextafter(t_min[i], np.inf)
                note_fold(found, i, max(near - reach / length, first), t_min[i])
            if ch == 0.0:
                continue
            uh, ul, across_u = _triple(xh, xl, yh, yl, zh, zl, bx, by, bz, dx, dy, dz)
            vh, vl, across_v = _triple(xh, xl, yh, yl, zh, zl, dx, dy, dz, ax, ay, az)
            gap_u, gap_v = abs(uh) / across_u, abs(vh) / across_v
            th, tl = dd.divide(-nh, -nl, ch, cl)
            uh, ul = dd.divide(uh, ul, ch, cl)
            vh, vl = dd.divide(vh, vl, ch, cl)
            t = th + tl
            if kind == TRIANGLE:
                sh, sl = dd.add(uh, ul, vh, vl)
                sh, sl = dd.subtract(1.0, 0.0, sh, sl)
                is_in = uh >= 0.0 and vh >= 0.0 and sh >= 0.0
                ex, ey, ez = bx - ax, by - ay, bz - az
                px, py, pz = ey * dz - ez * dy, ez * dx - ex * dz, ex * dy - ey * dx
                far = abs(sh * ch) / (np.sqrt(px * px + py * py + pz * pz) + 1e-300)
            else:
                is_in = (
                    uh >= 0.0 and vh >= 0.0 and (uh - 1.0) + ul <= 0.0 and (vh - 1.0) + vl <= 0.0
                )
                far = min(
                    abs(((uh - 1.0) + ul) * ch) / across_u, abs(((vh - 1.0) + vl) * ch) / across_v
                )
            if min(min(gap_u, gap_v), far) <= band:
                note_edge(found, i, t, band, object_id, ids[f], uh, vh, t_min[i])
            if is_in:
                offer(found, i, t, object_id, ids[f], uh, vh, cos, band / (cos * length), t_min[i])
