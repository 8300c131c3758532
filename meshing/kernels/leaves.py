"""Subdivision of patches until the bound on the deviation of their triangles meets the tolerance.

Every triangle whose corners lie on S above an hu x hv rectangle stays within
(hu^2 Muu + 2 hu hv Muv + hv^2 Mvv) / 8 of S, point by point in (u, v), where the M bound the second
partials there (Filip, Magedson and Markot, Computer Aided Geometric Design 3, 1986). They prove it
for right triangles; for any triangle with weights l_i it follows from Taylor's formula at the
point, since sum l_i (u_i - u)^2 <= hu^2 / 4 and likewise for the other two sums. So vertices that
a neighbour needs may be added on a leaf's edges, and the bound still holds. The M come from the
second differences of the leaf's own control net, whose parameters run over [0, 1].

A rational leaf S = X / W, seen from a control point, has W S_uu = X_uu - 2 S_u W_u - S W_uu and
W S_u = X_u - S W_u, and likewise for the others: bounds of X, W and their differences bound S_u
and S_v, and these bound the second partials.
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
    """Bound Muu, Muv and Mvv of a rational net in a slot; and tell the ratio of its weights."""
    stride = n + 1
    middle = (m + 1) // 2 * stride + (n + 1) // 2
    w = stack[slot, middle, 3]
    cx, cy, cz = stack[slot, middle, 0] / w, stack[slot, middle, 1] / w, stack[slot, middle, 2] / w
    least = most = w
    radius = u = v = uu = uv = vv = wu = wv = wuu = wuv = wvv = 0.0
    for i in range(m + 1):
        for j in range(n + 1):
            k = i * stride + j
            w = stack[slot, k, 3]
            least, most = min(least, w), max(most, w)
            radius = max(
                radius,
                length_of(
                    stack[slot, k, 0] / w - cx, stack[slot, k, 1] / w - cy,
                    stack[slot, k, 2] / w - cz,
                ),
            )  # fmt: skip
            if i < m:
                x, y = _change(stack, slot, k, k, k, k + stride, cx, cy, cz)
                u, wu = max(u, x), max(wu, y)
            if j < n:
                x, y = _change(stack, slot, k, k, k, k + 1, cx, cy, cz)
                v, wv = max(v, x), max(wv, y)
            if i + 2 <= m:
                x, y = _change(
                    stack, slot, k + stride, k, k + stride, k + 2 * stride, cx, cy, cz
                )  # fmt: skip
                uu, wuu = max(uu, x), max(wuu, y)
            if i < m and j < n:
                x, y = _change(stack, slot, k + 1, k, k + stride, k + stride + 1, cx, cy, cz)
                uv, wuv = max(uv, x), max(wuv, y)
            if j + 2 <= n:
                x, y = _change(stack, slot, k + 1, k, k + 1, k + 2, cx, cy, cz)
                vv, wvv = max(vv, x), max(wvv, y)
    wu, wv = m * wu, n * wv
    u, v = (m * u + radius * wu) / least, (n * v + radius * wv) / least
    uu = m * (m - 1) * (uu + radius * wuu) + 2.0 * u * wu
    uv = m * n * (uv + radius * wuv) + u * wv + v * wu
    vv = n * (n - 1) * (vv + radius * wvv) + 2.0 * v * wv
    return uu / least, uv / least, vv / least, most / least


@inner
def _change(stack, slot, b, a, c, d, cx, cy, cz):
    """Return the lengths of (d - c) - (b - a) for X about a point, and for W."""
    w = (stack[slot, d, 3] - stack[slot, c, 3]) - (stack[slot, b, 3] - stack[slot, a, 3])
    x = (stack[slot, d, 0] - stack[slot, c, 0]) - (stack[slot, b, 0] - stack[slot, a, 0])
    y = (stack[slot, d, 1] - stack[slot, c, 1]) - (stack[slot, b, 1] - stack[slot, a, 1])
    z = (stack[slot, d, 2] - stack[slot, c, 2]) - (stack[slot, b, 2] - stack[slot, a, 2])
    return length_of(x - w * cx, y - w * cy, z - w * cz), abs(w)


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


@kernel
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
