"""Points, partials and normals of tensor Bezier patches of any degree up to 30.

A patch is a run of rows in a flat control array (total, 3): row-major, (degree_u + 1) rows of
(degree_v + 1) points from ``start`` on. Curves are evaluated by Schumaker and Volk's form of the
Bernstein sum (Computer Aided Geometric Design 3, 1986): a Horner scheme in u / (1 - u), or in its
inverse beyond the middle. Its weights carry a relative error of about 3 degree eps each, as stable
as de Casteljau's algorithm and without its scratch memory; all of it holds a little outside
[0, 1] too. Partials are sums of differences of control points, so they do not lose digits where a
patch lies far from the origin, or where a row of differences vanishes.

Rational patches have rows (w (P - c), w), c a point of each patch's own: S - c is the quotient of
two such sums. Functions that take both kinds have an argument ``rational``: None for polynomials,
which the compiler knows, else True.
"""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel

MAX_DEGREE = 30

# Exact: the largest, C(30, 15), is below 2**28.
BINOMIAL = np.array(
    [[math.comb(n, i) for i in range(MAX_DEGREE + 1)] for n in range(MAX_DEGREE + 1)],
    dtype=np.float64,
)

# Weights of a difference of order 0, 1, 2.
DIFFERENCE = np.array([[1.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [1.0, -2.0, 1.0]])

# Beside a cusp the computed S_u x S_v is off by eps / d relative to its size and the limit by d,
# where d is the distance in parameters. Where S_u and S_v are nearly parallel all over a patch,
# the cross product is still good: a threshold well below sqrt(eps) keeps those out.
PARALLEL = 2.0**-32
# A partial below this part of the patch's largest is made of roundings.
VANISHING = 8.0 * 2.0**-52
# So is one below this part of the terms that it is the sum of.
VANISHING_SUM, VANISHING_QUOTIENT = 8.0 * 2.0**-52, 128.0 * 2.0**-52
# Points of a rational net are right to a few units of their coordinates about c.
SAME_POINT = 16.0 * 2.0**-52
# The derivative of S_u x S_v, in units of the largest partials, counts as zero below this.
FLAT_PRODUCT = 2.0**-26
# Where to look: at the point itself; if first order fails too, this far inside, near ones first.
NUDGES = (0.0, 2.0**-20, 2.0**-14, 2.0**-9, 2.0**-5, 2.0**-2)


@inner
def derivative(control, start, degree_u, degree_v, u, v, order_u, order_v):
    """Partial derivative of order (0..2, 0..2) of one patch, three numbers."""
    m = degree_u - order_u
    n = degree_v - order_v
    if m < 0 or n < 0:
        return 0.0, 0.0, 0.0
    stride = degree_v + 1
    # From the last row on for u <= 1/2, else from the first: the ratio stays within [-1, 1].
    low_u = u <= 0.5
    low_v = v <= 0.5
    base_u = 1.0 - u if low_u else u
    base_v = 1.0 - v if low_v else v
    ratio_u = (1.0 - base_u if not low_u else u) / base_u
    ratio_v = (1.0 - base_v if not low_v else v) / base_v
    x, y, z = 0.0, 0.0, 0.0
    for step_u in range(m + 1):
        i = m - step_u if low_u else step_u
        rx, ry, rz = 0.0, 0.0, 0.0
        for step_v in range(n + 1):
            j = n - step_v if low_v else step_v
            dx, dy, dz = 0.0, 0.0, 0.0
            for a in range(order_u + 1):
                for b in range(order_v + 1):
                    k = start + (i + a) * stride + j + b
                    sign = DIFFERENCE[order_u, a] * DIFFERENCE[order_v, b]
                    dx += sign * control[k, 0]
                    dy += sign * control[k, 1]
                    dz += sign * control[k, 2]
            weight = BINOMIAL[n, j]
            rx = rx * ratio_v + weight * dx
            ry = ry * ratio_v + weight * dy
            rz = rz * ratio_v + weight * dz
        weight = BINOMIAL[m, i]
        x = x * ratio_u + weight * rx
        y = y * ratio_u + weight * ry
        z = z * ratio_u + weight * rz
    scale = 1.0
    for _ in range(m):
        scale *= base_u
    for _ in range(n):
        scale *= base_v
    for a in range(order_u):
        scale *= degree_u - a
    for b in range(order_v):
        scale *= degree_v - b
    return scale * x, scale * y, scale * z


@inner
def _homogeneous(control, start, degree_u, degree_v, u, v, order_u, order_v, px, py, pz):
    """As `derivative`, of W (S - p) and of W of a rational patch: four numbers.

    Points that rounding cannot tell from p count as p.
    """
    m = degree_u - order_u
    n = degree_v - order_v
    if m < 0 or n < 0:
        return 0.0, 0.0, 0.0, 0.0
    stride = degree_v + 1
    low_u = u <= 0.5
    low_v = v <= 0.5
    base_u = 1.0 - u if low_u else u
    base_v = 1.0 - v if low_v else v
    ratio_u = (1.0 - base_u if not low_u else u) / base_u
    ratio_v = (1.0 - base_v if not low_v else v) / base_v
    largest = max(abs(px), abs(py), abs(pz))
    x, y, z, w = 0.0, 0.0, 0.0, 0.0
    for step_u in range(m + 1):
        i = m - step_u if low_u else step_u
        rx, ry, rz, rw = 0.0, 0.0, 0.0, 0.0
        for step_v in range(n + 1):
            j = n - step_v if low_v else step_v
            dx, dy, dz, dw = 0.0, 0.0, 0.0, 0.0
            for a in range(order_u + 1):
                for b in range(order_v + 1):
                    k = start + (i + a) * stride + j + b
                    sign = DIFFERENCE[order_u, a] * DIFFERENCE[order_v, b]
                    qx, qy, qz, qw = control[k, 0], control[k, 1], control[k, 2], control[k, 3]
                    ax, ay, az = qx - qw * px, qy - qw * py, qz - qw * pz
                    about = max(abs(qx), abs(qy), abs(qz)) + qw * largest
                    if max(abs(ax), abs(ay), abs(az)) > SAME_POINT * about:
                        dx += sign * ax
                        dy += sign * ay
                        dz += sign * az
                    dw += sign * qw
            weight = BINOMIAL[n, j]
            rx = rx * ratio_v + weight * dx
            ry = ry * ratio_v + weight * dy
            rz = rz * ratio_v + weight * dz
            rw = rw * ratio_v + weight * dw
        weight = BINOMIAL[m, i]
        x = x * ratio_u + weight * rx
        y = y * ratio_u + weight * ry
        z = z * ratio_u + weight * rz
        w = w * ratio_u + weight * rw
    scale = 1.0
    for _ in range(m):
        scale *= base_u
    for _ in range(n):
        scale *= base_v
    for a in range(order_u):
        scale *= degree_u - a
    for b in range(order_v):
        scale *= degree_v - b
    return scale * x, scale * y, scale * z, scale * w


@inner
def _quotient(control, start, degree_u, degree_v, u, v, order_u, order_v):
    """As `derivative`, of a rational patch about its point c; total order at most 2.

    Partials are those of S - p, p the nearest corner: beside a collapsed edge all their terms
    are as small as they are, so none of their digits cancel.
    """
    px = py = pz = 0.0
    if order_u + order_v > 0:
        corner = start + (degree_u * (degree_v + 1) if u > 0.5 else 0)
        corner += degree_v if v > 0.5 else 0
        weight = control[corner, 3]
        px = control[corner, 0] / weight
        py = control[corner, 1] / weight
        pz = control[corner, 2] / weight
    sx, sy, sz, weight = _homogeneous(
        control, start, degree_u, degree_v, u, v, 0, 0, px, py, pz
    )  # fmt: skip
    sx, sy, sz = sx / weight, sy / weight, sz / weight
    if order_u + order_v == 0:
        return sx, sy, sz
    # Leibniz's rule for W (S - p), solved for the derivative of highest order.
    x, y, z, w = _homogeneous(
        control, start, degree_u, degree_v, u, v, order_u, order_v, px, py, pz
    )  # fmt: skip
    x, y, z = x - w * sx, y - w * sy, z - w * sz
    if order_u + order_v == 2:
        one_u, one_v = min(order_u, 1), min(order_v, 1)
        if order_u == 2 or order_v == 2:
            ax, ay, az, aw = _homogeneous(
                control, start, degree_u, degree_v, u, v, one_u, one_v, px, py, pz
            )
            factor = 2.0 * aw / weight
            x -= factor * (ax - aw * sx)
            y -= factor * (ay - aw * sy)
            z -= factor * (az - aw * sz)
        else:
            ax, ay, az, aw = _homogeneous(
                control, start, degree_u, degree_v, u, v, 1, 0, px, py, pz
            )
            bx, by, bz, bw = _homogeneous(
                control, start, degree_u, degree_v, u, v, 0, 1, px, py, pz
            )
            x -= (aw * (bx - bw * sx) + bw * (ax - aw * sx)) / weight
            y -= (aw * (by - bw * sy) + bw * (ay - aw * sy)) / weight
            z -= (aw * (bz - bw * sz) + bw * (az - aw * sz)) / weight
    return x / weight, y / weight, z / weight


@inner
def partial(control, start, degree_u, degree_v, u, v, order_u, order_v, rational):
    """Partial derivative of total order 0 to 2, three numbers; rational patches: about their c."""
    if rational is None:
        return derivative(control, start, degree_u, degree_v, u, v, order_u, order_v)
    return _quotient(control, start, degree_u, degree_v, u, v, order_u, order_v)


@inner
def second_partials(control, start, degree_u, degree_v, u, v):
    """S_uu, S_uv and S_vv of one patch: nine numbers."""
    xuu, yuu, zuu = derivative(control, start, degree_u, degree_v, u, v, 2, 0)
    xuv, yuv, zuv = derivative(control, start, degree_u, degree_v, u, v, 1, 1)
    xvv, yvv, zvv = derivative(control, start, degree_u, degree_v, u, v, 0, 2)
    return xuu, yuu, zuu, xuv, yuv, zuv, xvv, yvv, zvv


@inner
def weighted_lengths(control, start, degree_u, degree_v, u, v, rational):
    """Sum |differences| with the weights of S_u and of S_v; find the largest difference of either.

    The two sums bound |S_u| and |S_v| of a polynomial patch: the partials if nothing cancelled.
    For a rational one they say the order of magnitude.
    """
    stride = degree_v + 1
    sum_u, sum_v, most_u, most_v = 0.0, 0.0, 0.0, 0.0
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            k = start + i * stride + j
            if i < degree_u:
                length = degree_u * _length_between(control, k, k + stride, rational)
                sum_u += length * _weight(degree_u - 1, i, u) * _weight(degree_v, j, v)
                most_u = max(most_u, length)
            if j < degree_v:
                length = degree_v * _length_between(control, k, k + 1, rational)
                sum_v += length * _weight(degree_u, i, u) * _weight(degree_v - 1, j, v)
                most_v = max(most_v, length)
    return sum_u, sum_v, most_u, most_v


@inner
def _length_between(control, k, other, rational):
    if rational is not None:
        p, q = control[k, 3], control[other, 3]
        return length_of(
            control[other, 0] / q - control[k, 0] / p,
            control[other, 1] / q - control[k, 1] / p,
            control[other, 2] / q - control[k, 2] / p,
        )
    x = control[other, 0] - control[k, 0]
    y = control[other, 1] - control[k, 1]
    z = control[other, 2] - control[k, 2]
    return length_of(x, y, z)


@inner
def length_of(x, y, z):
    """Length of a vector; squares of components neither overflow nor underflow."""
    largest = max(abs(x), abs(y), abs(z))
    if not 0.0 < largest < np.inf:
        return largest
    x /= largest
    y /= largest
    z /= largest
    return largest * math.sqrt(x * x + y * y + z * z)


@inner
def _weight(degree, i, x):
    weight = BINOMIAL[degree, i]
    for _ in range(i):
        weight *= x
    for _ in range(degree - i):
        weight *= 1.0 - x
    return abs(weight)


@inner
def unit_normal(control, start, degree_u, degree_v, u, v, rational):
    """Find the unit normal along S_u x S_v: three numbers, and whether that product vanishes.

    Where it vanishes the normal is the limit from inside the patch: from the derivative of
    S_u x S_v towards the middle; where that vanishes too, from a point a little further in.
    Always finite and of length one.
    """
    vanishing = VANISHING_SUM if rational is None else VANISHING_QUOTIENT
    a = 1.0 if u <= 0.5 else -1.0
    b = 1.0 if v <= 0.5 else -1.0
    for h in NUDGES:
        # Unequal steps: a diagonal may be a line of symmetry on which the product vanishes.
        p, q = u + a * h, v + 0.75 * b * h
        sum_u, sum_v, most_u, most_v = weighted_lengths(
            control, start, degree_u, degree_v, p, q, rational
        )
        if not (most_u > 0.0 and most_v > 0.0):
            break
        # Partials are divided by the patch's largest, so that products stay within range.
        xu, yu, zu = partial(control, start, degree_u, degree_v, p, q, 1, 0, rational)
        xv, yv, zv = partial(control, start, degree_u, degree_v, p, q, 0, 1, rational)
        xu, yu, zu = xu / most_u, yu / most_u, zu / most_u
        xv, yv, zv = xv / most_v, yv / most_v, zv / most_v
        length_u = length_of(xu, yu, zu)
        length_v = length_of(xv, yv, zv)
        nx = yu * zv - zu * yv
        ny = zu * xv - xu * zv
        nz = xu * yv - yu * xv
        length = length_of(nx, ny, nz)
        if (
            length > PARALLEL * (sum_u / most_u) * (sum_v / most_v)
            and length_u > max(VANISHING, vanishing * (sum_u / most_u))
            and length_v > max(VANISHING, vanishing * (sum_v / most_v))
        ):
            return nx / length, ny / length, nz / length, h > 0.0
        if h > 0.0:
            continue
        # Derivatives of S_u and of S_v in the direction (a, b), then of their product.
        xuv, yuv, zuv = partial(control, start, degree_u, degree_v, u, v, 1, 1, rational)
        xuu, yuu, zuu = partial(control, start, degree_u, degree_v, u, v, 2, 0, rational)
        xvv, yvv, zvv = partial(control, start, degree_u, degree_v, u, v, 0, 2, rational)
        px, py, pz = a * xuu + b * xuv, a * yuu + b * yuv, a * zuu + b * zuv
        qx, qy, qz = a * xuv + b * xvv, a * yuv + b * yvv, a * zuv + b * zvv
        px, py, pz = px / most_u, py / most_u, pz / most_u
        qx, qy, qz = qx / most_v, qy / most_v, qz / most_v
        nx = (py * zv - pz * yv) + (yu * qz - zu * qy)
        ny = (pz * xv - px * zv) + (zu * qx - xu * qz)
        nz = (px * yv - py * xv) + (xu * qy - yu * qx)
        length = length_of(nx, ny, nz)
        if length > FLAT_PRODUCT:
            return nx / length, ny / length, nz / length, True
    return 0.0, 0.0, 1.0, True


@kernel(allocates=True)
def evaluate_patches(control, starts, degrees, patch_id, u, v, order_u, order_v, rational, out):
    """Write one partial derivative per row into ``out`` (n, 3)."""
    for i in range(u.size):
        p = patch_id[i]
        x, y, z = partial(
            control, starts[p], degrees[p, 0], degrees[p, 1], u[i], v[i], order_u, order_v, rational
        )
        out[i, 0] = x
        out[i, 1] = y
        out[i, 2] = z


@kernel(allocates=True)
def normals_of_patches(control, starts, degrees, patch_id, u, v, rational, out, is_degenerate):
    """Write one unit normal per row into ``out`` (n, 3), and where S_u x S_v vanishes."""
    for i in range(u.size):
        p = patch_id[i]
        x, y, z, flag = unit_normal(
            control, starts[p], degrees[p, 0], degrees[p, 1], u[i], v[i], rational
        )
        out[i, 0] = x
        out[i, 1] = y
        out[i, 2] = z
        is_degenerate[i] = flag


@kernel(allocates=True)
def first_collapsed_patch(control, starts, degrees, reach, rational):
    """Index of the first patch without area, or -1; ``reach`` (k,): largest |coordinate| of each.

    S_u x S_v has degree (2 m - 1, 2 n - 1), times W^3 if rational at most (3 m - 1, 3 n - 1): if it
    vanishes on a grid of one point more each way, it vanishes everywhere. Nearly always the first point settles it.
    """
    for p in range(starts.size - 1):
        m, n = degrees[p, 0], degrees[p, 1]
        # Narrower than the roundings of its own coordinates: nothing is left to be hit.
        _, _, most_u, most_v = weighted_lengths(control, starts[p], m, n, 0.5, 0.5, rational)
        has_area = min(most_u, most_v) > 4.0 * 2.0**-52 * reach[p]
        rows, columns = (2 * m, 2 * n) if rational is None else (3 * m, 3 * n)
        count = rows * columns if has_area else 0
        for i in range(count):
            # Starts in the middle of the patch.
            a = (i // columns + rows // 2) % rows
            b = (i % columns + columns // 2) % columns
            u, v = (a + 0.5) / rows, (b + 0.5) / columns
            _, _, _, is_degenerate = unit_normal(control, starts[p], m, n, u, v, rational)
            has_area = not is_degenerate
            if has_area:
                break
        if not has_area:
            return p
    return -1
