"""Subdivision of patches until the bound on the deviation of their triangles meets the tolerance.

Every triangle whose corners lie on S above an hu x hv rectangle stays within
(hu^2 Muu + 2 hu hv Muv + hv^2 Mvv) / 8 of S, point by point in (u, v), where the M bound the second
partials there (Filip, Magedson and Markot, Computer Aided Geometric Design 3, 1986). They prove it
for right triangles; for any triangle with weights l_i it follows from Taylor's formula at the
point, since sum l_i (u_i - u)^2 <= hu^2 / 4 and likewise for the other two sums. So vertices that
a neighbour needs may be added on a leaf's edges, and the bound still holds. The M come from the
second differences of the leaf's own control net, whose parameters run over [0, 1].

A rational leaf S = X / W has W S_uu = X_uu - 2 S_u W_u - S W_uu and so on, which the differences of X
and W bound (`rational_second_differences`).
"""

import math

import numpy as np

from meshing.kernels.bernstein import length_of
from meshing.kernels.jit import inner, kernel
from meshing.kernels.subdivision import coordinate, halve

# Parameters of leaves count in units of 2**-MAX_DEPTH.
MAX_DEPTH = 18
# Work per net point and halving, in roundings; see `net_rounding`.
HALF_ULP = 2.0**-53
# Total depth at which a piece is small enough to tell how many leaves it will need. Weights that
# differ widely squeeze much of a patch into few parameters: there it is deeper.
FORECAST_DEPTH = 6


@inner
def second_differences(stack, slot, m, n):
    """Bound Muu, Muv and Mvv of the net in a slot."""
    uu, uv, vv = 0.0, 0.0, 0.0
    stride = n + 1
    for i in range(m + 1):
        for j in range(n + 1):
            k = i * stride + j
            if i + 2 <= m:
                uu = max(uu, _size(stack, slot, k, k + stride, k + stride, k + 2 * stride))
            if i < m and j < n:
                uv = max(uv, _size(stack, slot, k, k + 1, k + stride, k + stride + 1))
            if j + 2 <= n:
                vv = max(vv, _size(stack, slot, k, k + 1, k + 1, k + 2))
    return m * (m - 1) * uu, m * n * uv, n * (n - 1) * vv


@inner
def rational_second_differences(stack, slot, m, n):
    """Bound Muu, Muv and Mvv of a rational net in a slot; and tell the ratio of its weights.

    With a point c, mean tangents p and q, and w, w_1 and w_2 the means of W, W_u and W_v,

        W S_uu = (X_uu - c W_uu - 2 p w_1) - 2 p (W_u - w_1) - 2 (S_u - p) W_u - (S - c) W_uu,
        W S_uv = (X_uv - c W_uv - p w_2 - q w_1) - p (W_v - w_2) - q (W_u - w_1)
                 - (S_u - p) W_v - (S_v - q) W_u - (S - c) W_uv,
        W (S_u - p) = (X_u - c W_u - p w) - p (W - w) - (S - c) W_u:

    all that is not in the first brackets falls faster than the leaf shrinks.
    """
    stride = n + 1
    middle = (m + 1) // 2 * stride + (n + 1) // 2
    w = stack[slot, middle, 3]
    cx, cy, cz = stack[slot, middle, 0] / w, stack[slot, middle, 1] / w, stack[slot, middle, 2] / w
    least = most = w
    radius = mean_u = mean_v = px = py = pz = qx = qy = qz = 0.0
    for i in range(m + 1):
        for j in range(n + 1):
            k = i * stride + j
            w = stack[slot, k, 3]
            least, most = min(least, w), max(most, w)
            x, y, z = stack[slot, k, 0] / w, stack[slot, k, 1] / w, stack[slot, k, 2] / w
            radius = max(radius, length_of(x - cx, y - cy, z - cz))
            if i < m:
                x, y, z, w = _change(stack, slot, k, k, k, k + stride, cx, cy, cz)
                px, py, pz, mean_u = px + x, py + y, pz + z, mean_u + w
            if j < n:
                x, y, z, w = _change(stack, slot, k, k, k, k + 1, cx, cy, cz)
                qx, qy, qz, mean_v = qx + x, qy + y, qz + z, mean_v + w
    mean = 0.5 * (least + most)
    # Sums of m (n + 1) differences, times m.
    mean_u, mean_v = mean_u / (n + 1), mean_v / (m + 1)
    px, py, pz = px / (n + 1) / mean, py / (n + 1) / mean, pz / (n + 1) / mean
    qx, qy, qz = qx / (m + 1) / mean, qy / (m + 1) / mean, qz / (m + 1) / mean
    p, q = length_of(px, py, pz), length_of(qx, qy, qz)
    u = v = uv = wuu = wuv = wvv = off_u = off_v = 0.0
    uu = 2.0 * p * abs(mean_u) if m < 2 else 0.0
    vv = 2.0 * q * abs(mean_v) if n < 2 else 0.0
    for i in range(m + 1):
        for j in range(n + 1):
            k = i * stride + j
            if i < m:
                x, y, z, w = _change(stack, slot, k, k, k, k + stride, cx, cy, cz)
                u = max(u, length_of(m * x - mean * px, m * y - mean * py, m * z - mean * pz))
                off_u = max(off_u, abs(m * w - mean_u))
            if j < n:
                x, y, z, w = _change(stack, slot, k, k, k, k + 1, cx, cy, cz)
                v = max(v, length_of(n * x - mean * qx, n * y - mean * qy, n * z - mean * qz))
                off_v = max(off_v, abs(n * w - mean_v))
            if i + 2 <= m:
                x, y, z, w = _change(
                    stack, slot, k + stride, k, k + stride, k + 2 * stride, cx, cy, cz
                )  # fmt: skip
                f, g = m * (m - 1.0), 2.0 * mean_u
                uu = max(uu, length_of(f * x - g * px, f * y - g * py, f * z - g * pz))
                wuu = max(wuu, f * abs(w))
            if i < m and j < n:
                x, y, z, w = _change(
                    stack, slot, k + 1, k, k + stride, k + stride + 1, cx, cy, cz
                )  # fmt: skip
                f = m * float(n)
                x = f * x - mean_v * px - mean_u * qx
                y = f * y - mean_v * py - mean_u * qy
                z = f * z - mean_v * pz - mean_u * qz
                uv = max(uv, length_of(x, y, z))
                wuv = max(wuv, f * abs(w))
            if j + 2 <= n:
                x, y, z, w = _change(stack, slot, k + 1, k, k + 1, k + 2, cx, cy, cz)
                f, g = n * (n - 1.0), 2.0 * mean_v
                vv = max(vv, length_of(f * x - g * qx, f * y - g * qy, f * z - g * qz))
                wvv = max(wvv, f * abs(w))
    along_u, along_v, half = abs(mean_u) + off_u, abs(mean_v) + off_v, 0.5 * (most - least)
    u = (u + p * half + radius * along_u) / least
    v = (v + q * half + radius * along_v) / least
    uu += 2.0 * p * off_u + 2.0 * u * along_u + radius * wuu
    uv += p * off_v + q * off_u + u * along_v + v * along_u + radius * wuv
    vv += 2.0 * q * off_v + 2.0 * v * along_v + radius * wvv
    return uu / least, uv / least, vv / least, most / least


@inner
def _change(stack, slot, b, a, c, d, cx, cy, cz):
    """Return (d - c) - (b - a) of X about a point, and of W."""
    w = (stack[slot, d, 3] - stack[slot, c, 3]) - (stack[slot, b, 3] - stack[slot, a, 3])
    x = (stack[slot, d, 0] - stack[slot, c, 0]) - (stack[slot, b, 0] - stack[slot, a, 0])
    y = (stack[slot, d, 1] - stack[slot, c, 1]) - (stack[slot, b, 1] - stack[slot, a, 1])
    z = (stack[slot, d, 2] - stack[slot, c, 2]) - (stack[slot, b, 2] - stack[slot, a, 2])
    return x - w * cx, y - w * cy, z - w * cz, w


@inner
def _size(stack, slot, a, b, c, d):
    total = 0.0
    for axis in range(3):
        x = (stack[slot, a, axis] - stack[slot, b, axis]) - (
            stack[slot, c, axis] - stack[slot, d, axis]
        )
        total += x * x
    return math.sqrt(total)


@inner
def net_rounding(m, n, depth, largest):
    """Bound the effect that rounding of subdivided nets has on the deviation bound.

    A halving moves a point by at most ``degree`` half ulps, a difference of four points by four
    times that, and the differences themselves round by a few ulps.
    """
    weights = m * (m - 1) + 2 * m * n + n * (n - 1)
    return 0.5 * weights * (max(m, n) * depth + 4) * HALF_ULP * largest


@inner
def _side(stack, slot, a, b, rational):
    return length_of(
        coordinate(stack, slot, b, 0, rational) - coordinate(stack, slot, a, 0, rational),
        coordinate(stack, slot, b, 1, rational) - coordinate(stack, slot, a, 1, rational),
        coordinate(stack, slot, b, 2, rational) - coordinate(stack, slot, a, 2, rational),
    )


@inner
def _bend(stack, slot, m, n, rational):
    """Bound Muu, Muv and Mvv, and what roundings count for beside those of a polynomial net."""
    if rational is None:
        uu, uv, vv = second_differences(stack, slot, m, n)
        return uu, uv, vv, 1.0
    uu, uv, vv, ratio = rational_second_differences(stack, slot, m, n)
    # Those of X and W are relative to W, in three products; they pass through two quotients.
    return uu, uv, vv, 8.0 * ratio * ratio


@inner
def _splits_u(stack, slot, m, n, uu, uv, vv, rational):
    # A pure twist shrinks alike both ways: then keep leaves about square.
    if max(uu, vv) < 0.5 * uv:
        last = m * (n + 1)
        along_u = max(
            _side(stack, slot, 0, last, rational), _side(stack, slot, n, last + n, rational)
        )
        along_v = max(
            _side(stack, slot, 0, n, rational), _side(stack, slot, last, last + n, rational)
        )
        return along_u >= along_v
    return uu >= vv


@kernel(allocates=True)
def find_leaves(
    control, starts, degrees, rational, least_depth, slack, tolerance, max_leaves, leaves
):  # fmt: skip
    """Halve patches into leaves.

    ``least_depth`` (k,) is the number of halvings in u and in v that every patch gets; ``slack`` is
    what later rounding may add to the bound. Leaves are written to ``leaves`` (n, 5) int32 as
    patch, u0, u1, v0, v1 while there is room; without rows they are only counted. Returns the
    count, the bound, and an estimate of the count, which exceeds ``max_leaves`` if the search was
    given up.
    """
    n_slots = 2 * MAX_DEPTH + 2
    largest_net = 0
    for p in range(degrees.shape[0]):
        largest_net = max(largest_net, starts[p + 1] - starts[p])
    stack = np.empty((n_slots, largest_net, control.shape[1]))
    box = np.empty((n_slots, 4), np.int32)
    depth = np.empty((n_slots, 2), np.int32)
    count = 0
    bound = 0.0
    forecast = 0.0
    for p in range(degrees.shape[0]):
        m, n = degrees[p, 0], degrees[p, 1]
        largest = 0.0
        for k in range(starts[p + 1] - starts[p]):
            for axis in range(3):
                if rational is None:
                    # About the first corner: roundings then follow the patch's size.
                    stack[0, k, axis] = control[starts[p] + k, axis] - control[starts[p], axis]
                else:
                    stack[0, k, axis] = control[starts[p] + k, axis]
                    stack[0, k, 3] = control[starts[p] + k, 3]
                largest = max(largest, abs(coordinate(stack, 0, k, axis, rational)))
        floor = net_rounding(m, n, 2 * MAX_DEPTH, largest)
        target = max(tolerance - floor - slack, floor)
        box[0, 0] = box[0, 2] = 0
        box[0, 1] = box[0, 3] = 1 << MAX_DEPTH
        depth[0, 0] = depth[0, 1] = 0
        _, _, _, times = _bend(stack, 0, m, n, rational)
        forecast_depth = FORECAST_DEPTH + int(math.log2(times))
        top = 0
        while top >= 0:
            uu, uv, vv, times = _bend(stack, top, m, n, rational)
            deviation = (uu + 2.0 * uv + vv) / 8.0
            total = depth[top, 0] + depth[top, 1]
            needs_u = depth[top, 0] < least_depth[p]
            needs_v = depth[top, 1] < least_depth[p]
            may_split = min(depth[top, 0], depth[top, 1]) < MAX_DEPTH
            if needs_u or needs_v:
                along_u = needs_u
            elif deviation > target and may_split:
                along_u = _splits_u(stack, top, m, n, uu, uv, vv, rational)
                if depth[top, 0] == MAX_DEPTH:
                    along_u = False
                elif depth[top, 1] == MAX_DEPTH:
                    along_u = True
                if total == forecast_depth:
                    forecast += max(1.0, math.sqrt(uu / (8.0 * target))) * max(
                        1.0, math.sqrt(vv / (8.0 * target))
                    )
                    if forecast > 4.0 * max_leaves:
                        return count, bound, forecast * degrees.shape[0] / (p + 1)
            else:
                if count >= max_leaves:
                    share = (p + 0.5) / degrees.shape[0]
                    return count, bound, max(forecast, count + 1.0, count / share)
                if count < leaves.shape[0]:
                    leaves[count, 0] = p
                    for side in range(4):
                        leaves[count, 1 + side] = box[top, side]
                count += 1
                bound = max(bound, deviation + times * net_rounding(m, n, total, largest))
                top -= 1
                continue
            halve(stack, top, top + 1, m, n, along_u)
            for side in range(4):
                box[top + 1, side] = box[top, side]
            first = 0 if along_u else 2
            middle = (box[top, first] + box[top, first + 1]) // 2
            box[top, first + 1] = middle
            box[top + 1, first] = middle
            depth[top, 0 if along_u else 1] += 1
            depth[top + 1, 0] = depth[top, 0]
            depth[top + 1, 1] = depth[top, 1]
            top += 1
    return count, bound, float(count)
