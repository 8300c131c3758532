"""Any surface that shines, cut into cells: points sampled by about the solid angle of the cells.

A binary tree over the cells, as in Conty Estevez and Kulla, "Importance sampling of many lights with
adaptive tree splitting", HPG 2018. Seen from a point, the tree is cut: a node that is small for its
distance stays whole, any other one is opened, down to single cells. So the chances of what is near
are as good as those of what is far, and no error multiplies from level to level. A node is chosen
from the cut by area, tilt and distance, a near cell by its solid angle. Below a far node the choice
goes on down the tree by the same measure; a near cell is halved, its halves chosen by solid angle,
until a part of it is small for its distance. Within that, points are even in the cell's parameters.

Solid angles are those of the corners: of a flat cell they are exact. A bent cell is taken for the
biquadratic patch through nine of its points, and seen from between a part of it and that part's
corners it is given a solid angle as if seen from either side, so that no visible part gets probability
zero. The density is exact in either case.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel

# A node, or part of a cell, is small if its radius is at most this part of its distance, squared.
SMALL = 0.25
# Of a node's area, what counts as seen at least, and what does where its sides face all ways.
LEAST_SEEN, ALL_WAYS = 0.01, 0.25
# What a bent cell counts at least, of its area over its distance squared.
LEAST_BENT = 0.05
# Nodes of a cut at most: what remains then stays whole.
MOST_NODES = 2048
# Levels of a tree at most, and halvings of a cell: one of 1e12 times its distance needs 90.
MOST_LEVELS, MOST_HALVINGS = 64, 120
# The largest number below 1.
BELOW_ONE = 1.0 - 2.0**-53


class CellTree(NamedTuple):
    """Cells and the tree over them: the children of node k are 2 k and 2 k + 1; the last half are the cells."""

    # (cells, 4, 3) float64, at (0, 0), (1, 0), (1, 1), (0, 1) of their parameters; of bent cells
    # (cells, 9, 3), at s = 0, 1/2, 1 and for each of them t = 0, 1/2, 1
    corner: Any
    is_triangle: Any  # bool: cells are triangles, see `place_in_cell`
    is_bent: Any  # bool: cells need not be flat
    middle: Any  # (nodes, 3) float64
    square: Any  # (nodes,) float64, squared radius
    area: Any  # (nodes,) float64; of a lamp that shines unevenly times its brightness there
    glow: Any  # (cells,) float64, that brightness over the mean
    lean: Any  # (nodes, 3) float64, mean of the unit normals


@inner
def place_in_cell(tree, cell, s, t):
    """Return the point (s, t) of a cell, about.

    Of a triangle a, b, c it is a + sqrt(s) ((1 - t) (b - a) + t (c - a)): even in area.
    """
    if tree.is_bent:
        x, y, z = 0.0, 0.0, 0.0
        for i in range(3):
            along = _quadratic(i, s)
            for j in range(3):
                share = along * _quadratic(j, t)
                x += share * tree.corner[cell, 3 * i + j, 0]
                y += share * tree.corner[cell, 3 * i + j, 1]
                z += share * tree.corner[cell, 3 * i + j, 2]
        return x, y, z
    if tree.is_triangle:
        s = math.sqrt(s)
    a, b, c, d = (1.0 - s) * (1.0 - t), s * (1.0 - t), s * t, (1.0 - s) * t
    q = tree.corner
    return (
        a * q[cell, 0, 0] + b * q[cell, 1, 0] + c * q[cell, 2, 0] + d * q[cell, 3, 0],
        a * q[cell, 0, 1] + b * q[cell, 1, 1] + c * q[cell, 2, 1] + d * q[cell, 3, 1],
        a * q[cell, 0, 2] + b * q[cell, 1, 2] + c * q[cell, 2, 2] + d * q[cell, 3, 2],
    )


@inner
def _quadratic(i, s):
    """Return Lagrange's polynomial of degree 2 that is 1 at i / 2 and 0 at the other two points."""
    if i == 0:
        return (1.0 - s) * (1.0 - 2.0 * s)
    return 4.0 * s * (1.0 - s) if i == 1 else s * (2.0 * s - 1.0)


@inner
def _triangle(a, b, c):
    """Return half the solid angle of a triangle seen from 0 (Van Oosterom, Strackee 1983); behind: negative."""
    la = math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
    lb = math.sqrt(b[0] * b[0] + b[1] * b[1] + b[2] * b[2])
    lc = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
    ab = a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    bc = b[0] * c[0] + b[1] * c[1] + b[2] * c[2]
    ca = c[0] * a[0] + c[1] * a[1] + c[2] * a[2]
    volume = (
        a[0] * (b[1] * c[2] - b[2] * c[1])
        + a[1] * (b[2] * c[0] - b[0] * c[2])
        + a[2] * (b[0] * c[1] - b[1] * c[0])
    )
    return -math.atan2(volume, la * lb * lc + ab * lc + bc * la + ca * lb)


@inner
def _part(tree, cell, s0, s1, t0, t1, px, py, pz):
    """See a part of a cell from p: its solid angle, distance and radius squared, is s its longer way."""
    x, y, z = place_in_cell(tree, cell, s0, t0)
    a = (x - px, y - py, z - pz)
    x, y, z = place_in_cell(tree, cell, s1, t0)
    b = (x - px, y - py, z - pz)
    x, y, z = place_in_cell(tree, cell, s1, t1)
    c = (x - px, y - py, z - pz)
    x, y, z = place_in_cell(tree, cell, s0, t1)
    d = (x - px, y - py, z - pz)
    first, second = _triangle(a, b, c), _triangle(a, c, d)
    x, y, z = (
        0.25 * (a[0] + b[0] + c[0] + d[0]),
        0.25 * (a[1] + b[1] + c[1] + d[1]),
        0.25 * (a[2] + b[2] + c[2] + d[2]),
    )
    distance = x * x + y * y + z * z
    along_s = _apart(a, b) + _apart(d, c)
    along_t = _apart(a, d) + _apart(b, c)
    radius = 0.25 * max(_apart(a, c), _apart(b, d))
    angle = 2.0 * (max(first, 0.0) + max(second, 0.0))
    if tree.is_bent:
        if angle == 0.0:
            # Seen from behind by its corners: is its middle as well?
            mx, my, mz = place_in_cell(tree, cell, 0.5 * (s0 + s1), 0.5 * (t0 + t1))
            if _is_before(a, b, c, d, (mx - px, my - py, mz - pz)):
                angle = -2.0 * (first + second)
        angle += LEAST_BENT * math.sqrt(along_s * along_t) / (distance + radius)
    return angle, distance, radius, along_s >= along_t


@inner
def _is_before(a, b, c, d, place):
    """Tell whether 0 lies before the plane through a place that is parallel to a quadrangle."""
    ux, uy, uz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    vx, vy, vz = d[0] - b[0], d[1] - b[1], d[2] - b[2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return nx * place[0] + ny * place[1] + nz * place[2] < 0.0


@inner
def _apart(a, b):
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@inner
def _seen(tree, node, px, py, pz):
    """Return about the solid angle of a far node, and whether it is small for its distance."""
    x = tree.middle[node, 0] - px
    y = tree.middle[node, 1] - py
    z = tree.middle[node, 2] - pz
    square = x * x + y * y + z * z
    nx, ny, nz = tree.lean[node, 0], tree.lean[node, 1], tree.lean[node, 2]
    facing = max(-(nx * x + ny * y + nz * z), 0.0) / math.sqrt(max(square, 1e-300))
    spread = 1.0 - math.sqrt(nx * nx + ny * ny + nz * nz)
    seen = tree.area[node] * (facing + ALL_WAYS * max(spread, 0.0) + LEAST_SEEN)
    return seen / max(square, tree.square[node]), tree.square[node] <= SMALL * square


@inner
def _cut(tree, px, py, pz, stack, nodes, weights):
    """Cut the tree as seen from p; return the number of nodes and the sum of their weights."""
    first_leaf = tree.area.size // 2
    n, total, height = 0, 0.0, 1
    stack[0] = 1
    while height > 0:
        height -= 1
        node = stack[height]
        if tree.area[node] <= 0.0:
            continue
        weight, is_small = _seen(tree, node, px, py, pz)
        if not is_small:
            if node >= first_leaf:
                cell = node - first_leaf
                weight = tree.glow[cell] * _part(tree, cell, 0.0, 1.0, 0.0, 1.0, px, py, pz)[0]
            elif n + height + 2 < nodes.size and height + 2 <= stack.size:
                stack[height], stack[height + 1] = 2 * node + 1, 2 * node
                height += 2
                continue
        if weight > 0.0:
            nodes[n], weights[n] = node, weight
            n += 1
            total += weight
    return n, total


@inner
def _halved(tree, cell, px, py, pz, s, t, is_given):
    """Choose a point of a cell seen from p by (s, t), or follow a given one; return (s, t), and its density."""
    s0, s1, t0, t1, density = 0.0, 1.0, 0.0, 1.0, 1.0
    for _ in range(MOST_HALVINGS):
        _, square, radius, is_s = _part(tree, cell, s0, s1, t0, t1, px, py, pz)
        if radius <= SMALL * square:
            break
        if is_s:
            middle = 0.5 * (s0 + s1)
            first = _part(tree, cell, s0, middle, t0, t1, px, py, pz)[0]
            second = _part(tree, cell, middle, s1, t0, t1, px, py, pz)[0]
        else:
            middle = 0.5 * (t0 + t1)
            first = _part(tree, cell, s0, s1, t0, middle, px, py, pz)[0]
            second = _part(tree, cell, s0, s1, middle, t1, px, py, pz)[0]
        share = 0.5 if first + second <= 0.0 else first / (first + second)
        number = s if is_s else t
        is_first = number < (middle if is_given else share)
        if not is_given:
            number = number / share if is_first else (number - share) / (1.0 - share)
            number = min(number, BELOW_ONE)
        density *= 2.0 * (share if is_first else 1.0 - share)
        if is_s:
            s = number
            s0, s1 = (s0, middle) if is_first else (middle, s1)
        else:
            t = number
            t0, t1 = (t0, middle) if is_first else (middle, t1)
    if is_given:
        return s, t, density
    return s0 + (s1 - s0) * s, t0 + (t1 - t0) * t, density


@kernel(allocates=True)
def sample_cells(tree, seen_from, xi, stack, nodes, weights, cell, place, density):
    """Sample points by ``xi`` (n, 2), as seen from others (n, 3).

    ``stack`` has `MOST_LEVELS` places, ``nodes`` and ``weights`` have `MOST_NODES`. Written are the
    ``cell`` (n,), the ``place`` (n, 2) in its unit square, see `place_in_cell`, and the ``density`` (n,) of
    both; 0: nothing is seen.
    """
    first_leaf = tree.area.size // 2
    for i in range(cell.size):
        px, py, pz = seen_from[i, 0], seen_from[i, 1], seen_from[i, 2]
        n, total = _cut(tree, px, py, pz, stack, nodes, weights)
        cell[i], density[i] = 0, 0.0
        place[i, 0] = place[i, 1] = 0.0
        if n == 0:
            continue
        rest, k = xi[i, 0] * total, 0
        while k < n - 1 and rest >= weights[k]:
            rest -= weights[k]
            k += 1
        node, chance, s = nodes[k], weights[k] / total, min(rest / weights[k], BELOW_ONE)
        is_small = _seen(tree, node, px, py, pz)[1]
        while node < first_leaf:
            share = _share_of_first(tree, node, px, py, pz)
            if s < share:
                node, s, chance = 2 * node, s / share, chance * share
            else:
                node, s, chance = 2 * node + 1, (s - share) / (1.0 - share), chance * (1.0 - share)
            s = min(s, BELOW_ONE)
        t = xi[i, 1]
        if not is_small:
            s, t, within = _halved(tree, node - first_leaf, px, py, pz, s, t, False)
            chance *= within
        cell[i], place[i, 0], place[i, 1], density[i] = node - first_leaf, s, t, chance


@inner
def _share_of_first(tree, node, px, py, pz):
    """Return the chance of the first child of a node in the descent below the cut."""
    if tree.area[2 * node + 1] <= 0.0:
        return 1.0
    if tree.area[2 * node] <= 0.0:
        return 0.0
    first = _seen(tree, 2 * node, px, py, pz)[0]
    return first / (first + _seen(tree, 2 * node + 1, px, py, pz)[0])


@kernel(allocates=True)
def density_of_cells(tree, seen_from, cell, place, stack, nodes, weights, density):
    """Compute the density with which `sample_cells` chooses given places; see there."""
    first_leaf = tree.area.size // 2
    for i in range(cell.size):
        px, py, pz = seen_from[i, 0], seen_from[i, 1], seen_from[i, 2]
        n, total = _cut(tree, px, py, pz, stack, nodes, weights)
        density[i] = 0.0
        leaf = first_leaf + cell[i]
        for k in range(n):
            top, depth = leaf, 0
            while top > nodes[k]:
                top, depth = top // 2, depth + 1
            if top != nodes[k]:
                continue
            chance = weights[k] / total
            is_small = _seen(tree, top, px, py, pz)[1]
            for level in range(depth - 1, -1, -1):
                node = leaf >> level
                share = _share_of_first(tree, node // 2, px, py, pz)
                chance *= share if node % 2 == 0 else 1.0 - share
            if not is_small:
                chance *= _halved(
                    tree, cell[i], px, py, pz, place[i, 0], place[i, 1], True
                )[2]  # fmt: skip
            density[i] = chance
            break
