"""Nets of control points: restricted to a rectangle of parameters, halved, evaluated at the middle.

All by de Casteljau's averages of neighbours. Points have three columns; those of rational patches
four, the coordinates times the weight and the weight, and then ``rational`` is true.
"""

from meshing.kernels.jit import inlined


@inlined
def columns_of(rational):
    """Return the number of columns that count; where ``rational`` is None the compiler knows it."""
    if rational is None or not rational:
        return 3
    return 4


@inlined
def projected(net, degree_u, degree_v, room, rational):
    """Return the points of a rational net, in ``room``; of a polynomial one the net itself."""
    if rational is None or not rational:
        return net
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            for c in range(3):
                room[i, j, c] = net[i, j, c] / net[i, j, 3]
    return room


@inlined
def restrict_columns(net, degree_u, degree_v, a, b, rational):
    """Restrict a net (degree_u + 1, degree_v + 1, ..) in place to u in [a, b] (also beyond 0, 1)."""
    # de Casteljau at b keeps [0, b]; then at a / b from the other end keeps [a, b].
    x = b
    for level in range(1, degree_u + 1):
        for i in range(degree_u, level - 1, -1):
            for j in range(degree_v + 1):
                for c in range(columns_of(rational)):
                    net[i, j, c] = (1.0 - x) * net[i - 1, j, c] + x * net[i, j, c]
    x = a / b
    for level in range(1, degree_u + 1):
        for i in range(degree_u - level + 1):
            for j in range(degree_v + 1):
                for c in range(columns_of(rational)):
                    net[i, j, c] = (1.0 - x) * net[i, j, c] + x * net[i + 1, j, c]


@inlined
def restrict_rows(net, degree_u, degree_v, a, b, rational):
    """As `restrict_columns`, to v in [a, b]."""
    x = b
    for level in range(1, degree_v + 1):
        for j in range(degree_v, level - 1, -1):
            for i in range(degree_u + 1):
                for c in range(columns_of(rational)):
                    net[i, j, c] = (1.0 - x) * net[i, j - 1, c] + x * net[i, j, c]
    x = a / b
    for level in range(1, degree_v + 1):
        for j in range(degree_v - level + 1):
            for i in range(degree_u + 1):
                for c in range(columns_of(rational)):
                    net[i, j, c] = (1.0 - x) * net[i, j, c] + x * net[i, j + 1, c]


@inlined
def restrict(net, degree_u, degree_v, u0, u1, v0, v1, rational):
    """Restrict a net in place to a rectangle of parameters with u1, v1 > 0."""
    if u0 != 0.0 or u1 != 1.0:
        restrict_columns(net, degree_u, degree_v, u0, u1, rational)
    if v0 != 0.0 or v1 != 1.0:
        restrict_rows(net, degree_u, degree_v, v0, v1, rational)


@inlined
def halve(first, second, degree_u, degree_v, along_u, rational):
    """Split ``first`` at the middle: its lower half stays, ``second`` receives the upper."""
    outer = degree_u if along_u else degree_v
    other = degree_v if along_u else degree_u
    for k in range(other + 1):
        for c in range(columns_of(rational)):
            if along_u:
                second[outer, k, c] = first[outer, k, c]
            else:
                second[k, outer, c] = first[k, outer, c]
            for level in range(1, outer + 1):
                if along_u:
                    for i in range(outer, level - 1, -1):
                        first[i, k, c] = 0.5 * (first[i - 1, k, c] + first[i, k, c])
                    second[outer - level, k, c] = first[outer, k, c]
                else:
                    for i in range(outer, level - 1, -1):
                        first[k, i, c] = 0.5 * (first[k, i - 1, c] + first[k, i, c])
                    second[k, outer - level, c] = first[k, outer, c]


@inlined
def depth_range(net, degree_u, degree_v, rational):
    """Return the range of the coordinate along the ray."""
    lo = hi = depth_of(net, 0, 0, rational)
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            depth = depth_of(net, i, j, rational)
            lo = min(lo, depth)
            hi = max(hi, depth)
    return lo, hi


@inlined
def depth_of(net, i, j, rational):
    """Return one point's coordinate along the ray."""
    if rational is None or not rational:
        return net[i, j, 2]
    return net[i, j, 2] / net[i, j, 3]


@inlined
def weights_of(net, degree_u, degree_v, rational):
    """Bound the weights of a piece and how they turn: over half a piece, and part of the smallest.

    Returns ``most`` largest weight.
    ``turn`` how far W changes from the middle of the piece to a border, over the smallest weight.
    """
    if rational is None or not rational:
        return 1.0, 0.0
    least = most = net[0, 0, 3]
    along_u = along_v = 0.0
    for i in range(degree_u + 1):
        for j in range(degree_v + 1):
            w = net[i, j, 3]
            least, most = min(least, w), max(most, w)
            if i < degree_u:
                along_u = max(along_u, abs(net[i + 1, j, 3] - w))
            if j < degree_v:
                along_v = max(along_v, abs(net[i, j + 1, 3] - w))
    return most, 0.5 * (degree_u * along_u + degree_v * along_v) / least


@inlined
def middle_of(scratch, net, degree_u, degree_v):
    """Evaluate the two coordinates across the ray at the middle of the piece."""
    for c in range(2):
        for r in range(degree_u + 1):
            for k in range(degree_v + 1):
                scratch[r, k, c] = net[r, k, c]
            for level in range(degree_v, 0, -1):
                for k in range(level):
                    scratch[r, k, c] = 0.5 * (scratch[r, k, c] + scratch[r, k + 1, c])
        for level in range(degree_u, 0, -1):
            for r in range(level):
                scratch[r, 0, c] = 0.5 * (scratch[r, 0, c] + scratch[r + 1, 0, c])
    return scratch[0, 0, 0], scratch[0, 0, 1]
