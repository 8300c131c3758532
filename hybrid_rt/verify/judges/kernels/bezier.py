"""De Casteljau's algorithm: halves of nets in float64, points in double-double."""

from hybrid_rt.verify.judges.kernels.double_double import interpolate
from meshing.kernels.jit import inner


@inner
def halve(net, other, first, stride, count):
    """Halve one line of a net: ``net`` keeps the second half, ``other`` gets the first."""
    for level in range(count):
        other[first + level * stride] = net[first]
        for i in range(count - 1 - level):
            k = first + i * stride
            net[k] = 0.5 * (net[k] + net[k + stride])


@inner
def curve_point(points, start, degree, axis, uh, ul, high, low):
    """Coordinate of a curve in double-double; first and second derivative in float64.

    ``points`` (total, coordinates); ``high``, ``low``: scratch of degree + 1 each.
    """
    for i in range(degree + 1):
        high[i] = points[start + i, axis]
        low[i] = 0.0
    first, second = 0.0, 0.0
    for level in range(degree, 0, -1):
        if level == 2:
            second = degree * (degree - 1) * ((high[2] - high[1]) - (high[1] - high[0]))
        if level == 1:
            first = degree * ((high[1] - high[0]) + (low[1] - low[0]))
        for i in range(level):
            high[i], low[i] = interpolate(high[i], low[i], high[i + 1], low[i + 1], uh, ul)
    return high[0], low[0], first, second


@inner
def patch_point(control, start, m, n, uh, ul, vh, vl, rows, high, low, out):
    """Write the point (double-double) and S_u, S_v, S_uu, S_uv, S_vv (float64) to ``out``.

    ``out`` (3, 7): per coordinate high, low, S_u, S_v, S_uu, S_uv, S_vv; ``rows`` (m + 1, 4):
    scratch.
    """
    for axis in range(3):
        for i in range(m + 1):
            a, b, c, d = curve_point(control, start + i * (n + 1), n, axis, vh, vl, high, low)
            rows[i, 0] = a
            rows[i, 1] = b
            rows[i, 2] = c
            rows[i, 3] = d
        # The v-derivatives of the rows, as curves in u.
        dvv, _, _, _ = curve_point(rows, 0, m, 3, uh, ul, high, low)
        dv, _, duv, _ = curve_point(rows, 0, m, 2, uh, ul, high, low)
        for i in range(m + 1):
            high[i] = rows[i, 0]
            low[i] = rows[i, 1]
        du, duu = 0.0, 0.0
        for level in range(m, 0, -1):
            if level == 2:
                duu = m * (m - 1) * ((high[2] - high[1]) - (high[1] - high[0]))
            if level == 1:
                du = m * ((high[1] - high[0]) + (low[1] - low[0]))
            for i in range(level):
                high[i], low[i] = interpolate(high[i], low[i], high[i + 1], low[i + 1], uh, ul)
        out[axis, 0] = high[0]
        out[axis, 1] = low[0]
        out[axis, 2] = du
        out[axis, 3] = dv
        out[axis, 4] = duu
        out[axis, 5] = duv
        out[axis, 6] = dvv
