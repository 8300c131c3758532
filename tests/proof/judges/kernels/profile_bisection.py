"""Bisection of a profile's control points and a ray about each other, down to pairs that may meet.

`proof.judges.kernels.profile_roots` has the method.
"""

import math

import numpy as np

from meshing.kernels.jit import inner
from proof.judges.kernels.bezier import divide_by_weights, halve
from proof.judges.kernels.patch_bisection import MOST_PIECES


@inner
def _height(line, t):
    return line[0] + t * line[3]


@inner
def _distance(line, t):
    """Distance rho from the axis, and its slope (0 at the axis, where any is one)."""
    x, y = line[1] + t * line[4], line[2] + t * line[5]
    rho = math.sqrt(x * x + y * y)
    if rho == 0.0:
        return 0.0, 0.0
    return rho, (x * line[4] + y * line[5]) / rho


@inner
def _convex_minimum(fa, fb, da, db, width):
    """Find a lower bound of a convex function from its values and slopes at both ends."""
    if da >= 0.0:
        return fa
    if db <= 0.0:
        return fb
    # Where the two tangents cross.
    x = (fb - fa - db * width) / (da - db)
    return min(fa + da * min(max(x, 0.0), width), fa, fb)


@inner
def _misses(net, n, line, ta, tb, slop):
    """Whether a piece of profile and a piece of ray stay apart."""
    z0, z1, r0, r1 = net[0], net[0], net[n + 1], net[n + 1]
    for k in range(1, n + 1):
        z0, z1 = min(z0, net[k]), max(z1, net[k])
        r0, r1 = min(r0, net[n + 1 + k]), max(r1, net[n + 1 + k])
    za, zb = _height(line, ta), _height(line, tb)
    if z0 > max(za, zb) + slop or z1 < min(za, zb) - slop:
        return True
    width = tb - ta
    ra, da = _distance(line, ta)
    rb, db = _distance(line, tb)
    if r0 > max(ra, rb) + slop or r1 < _convex_minimum(ra, rb, da, db, width) - slop:
        return True
    # Across the longer chord.
    cz, cr = net[n] - net[0], net[2 * n + 1] - net[n + 1]
    if cz * cz + cr * cr < (zb - za) ** 2 + (rb - ra) ** 2:
        cz, cr = zb - za, rb - ra
    length = math.sqrt(cz * cz + cr * cr)
    if length == 0.0:
        return False
    p, q = -cr / length, cz / length
    if q < 0.0:  # p z + q rho is convex along the ray
        p, q = -p, -q
    least, most = np.inf, -np.inf
    for k in range(n + 1):
        across = p * (net[k] - za) + q * net[n + 1 + k]
        least, most = min(least, across), max(most, across)
    fa, fb = q * ra, p * (zb - za) + q * rb
    low = _convex_minimum(fa, fb, p * line[3] + q * da, p * line[3] + q * db, width)
    return least > max(fa, fb) + slop or most < low - slop


@inner
def bisect_profile(nets, plain, spans, n, line, begin, end, slop, smallest, leaves):
    """Halve the net in ``nets[0]`` and the stretch (begin, end) of the ray; as for patches."""
    is_rational = plain.size > 0
    spans[0, 0], spans[0, 1], spans[0, 2], spans[0, 3] = 0.0, 1.0, begin, end
    top, n_leaves, n_pieces = 0, 0, 0
    while top >= 0:
        n_pieces += 1
        if n_pieces > MOST_PIECES:
            return -1
        net = seen = nets[top]
        if is_rational:
            divide_by_weights(net, n + 1, 2, plain)
            seen = plain
        s0, s1, t0, t1 = spans[top, 0], spans[top, 1], spans[top, 2], spans[top, 3]
        if _misses(seen, n, line, t0, t1, slop):
            top -= 1
            continue
        extent = 0.0
        for k in range(n):
            extent = max(extent, abs(seen[k + 1] - seen[k]), abs(seen[n + 2 + k] - seen[n + 1 + k]))
        extent *= n
        if max(extent, t1 - t0) <= smallest or top + 1 >= nets.shape[0]:
            if n_leaves >= leaves.shape[0]:
                return -1
            leaves[n_leaves, 0], leaves[n_leaves, 1] = 0.5 * (s0 + s1), 0.5 * (t0 + t1)
            leaves[n_leaves, 2], leaves[n_leaves, 3] = 0.5 * (s1 - s0), 0.5 * (t1 - t0)
            n_leaves += 1
            top -= 1
            if leaves.shape[0] == 1:
                return 1
            continue
        other = nets[top + 1]
        if extent >= t1 - t0:
            for axis in range(3 if is_rational else 2):
                halve(net, other, axis * (n + 1), 1, n + 1)
            middle = 0.5 * (s0 + s1)
            spans[top, 0] = middle
            spans[top + 1, 0], spans[top + 1, 1] = s0, middle
            spans[top + 1, 2], spans[top + 1, 3] = t0, t1
        else:
            for k in range(3 * n + 3):
                other[k] = net[k]
            middle = 0.5 * (t0 + t1)
            spans[top, 2] = middle
            spans[top + 1, 0], spans[top + 1, 1] = s0, s1
            spans[top + 1, 2], spans[top + 1, 3] = t0, middle
        top += 1
    return n_leaves
