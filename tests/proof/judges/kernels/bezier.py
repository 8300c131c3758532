"""De Casteljau's algorithm: halves of nets in float64, points in double-double."""

from meshing.kernels.jit import inner, kernel
from proof.judges.kernels.double_double import divide, interpolate, two_product


@inner
def halve(net, other, first, stride, count):
    """Halve one line of a net: ``net`` keeps the second half, ``other`` gets the first."""
    for level in range(count):
        other[first + level * stride] = net[first]
        for i in range(count - 1 - level):
            k = first + i * stride
            net[k] = 0.5 * (net[k] + net[k + stride])


@inner
def load(points, rest, start, degree, axis, high, low):
    """Copy one coordinate of a curve's control points to ``high`` and ``low``."""
    for i in range(degree + 1):
        high[i] = points[start + i, axis]
        low[i] = rest[start + i, axis]


@inner
def curve_point(degree, uh, ul, high, low):
    """Coordinate of a curve in double-double; first and second derivative in float64.

    ``high``, ``low`` (degree + 1,): its control values, which are overwritten.
    """
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
def _of_rows(rows, column, m, uh, ul, high, low):
    """Return the point and the derivative of a curve whose control values are a column of rows."""
    for i in range(m + 1):
        high[i], low[i] = rows[i, column], 0.0
    value, _, slope, _ = curve_point(m, uh, ul, high, low)
    return value, slope


@inner
def patch_point(points, rest, start, m, n, uh, ul, vh, vl, rows, high, low, out):
    """Write the point (double-double) and S_u, S_v, S_uu, S_uv, S_vv (float64) to ``out``.

    Parameters
    ----------
    points, rest : (total, 3), or (total, 4) with weights
        Control points, their sum; with weights (w P, w).
    rows : (m + 1, 4), scratch
    out : (4, 7)
        Per coordinate high, low, S_u, S_v, S_uu, S_uv, S_vv; the last row is scratch.
    """
    for axis in range(points.shape[1]):
        for i in range(m + 1):
            load(points, rest, start + i * (n + 1), n, axis, high, low)
            rows[i, 0], rows[i, 1], rows[i, 2], rows[i, 3] = curve_point(n, vh, vl, high, low)
        # The v-derivatives of the rows, as curves in u.
        dvv, _ = _of_rows(rows, 3, m, uh, ul, high, low)
        dv, duv = _of_rows(rows, 2, m, uh, ul, high, low)
        for i in range(m + 1):
            high[i], low[i] = rows[i, 0], rows[i, 1]
        out[axis, 0], out[axis, 1], du, duu = curve_point(m, uh, ul, high, low)
        out[axis, 2], out[axis, 3] = du, dv
        out[axis, 4], out[axis, 5], out[axis, 6] = duu, duv, dvv
    if points.shape[1] == 4:
        _divide_by_weight(out)


@inner
def _divide_by_weight(out):
    """Turn w S and its derivatives into S and its derivatives, by those of w in the last row."""
    w, wu, wv, wuu, wuv, wvv = out[3, 0], out[3, 2], out[3, 3], out[3, 4], out[3, 5], out[3, 6]
    for axis in range(3):
        s, e = divide(out[axis, 0], out[axis, 1], out[3, 0], out[3, 1])
        su, sv = (out[axis, 2] - wu * s) / w, (out[axis, 3] - wv * s) / w
        out[axis, 0], out[axis, 1], out[axis, 2], out[axis, 3] = s, e, su, sv
        out[axis, 4] = (out[axis, 4] - 2.0 * wu * su - wuu * s) / w
        out[axis, 5] = (out[axis, 5] - wu * sv - wv * su - wuv * s) / w
        out[axis, 6] = (out[axis, 6] - 2.0 * wv * sv - wvv * s) / w


@inner
def divide_by_weights(net, count, coordinates, plain):
    """Write the control points of a net of (w P, w) to ``plain``, coordinate by coordinate."""
    for axis in range(coordinates):
        for k in range(count):
            plain[axis * count + k] = net[axis * count + k] / net[coordinates * count + k]


@kernel
def weighted(control, weight, points, rest):
    """Write (w P, w) as an exact sum ``points`` + ``rest``, each (total, coordinates + 1)."""
    for k in range(len(weight)):
        for axis in range(control.shape[1]):
            points[k, axis], rest[k, axis] = two_product(weight[k], control[k, axis])
        points[k, control.shape[1]], rest[k, control.shape[1]] = weight[k], 0.0
