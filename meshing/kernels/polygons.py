"""Triangulation of leaves whose edges carry the vertices of their neighbours.

A leaf is a rectangle in (u, v); its polygon goes around it counterclockwise through every vertex
on its sides. Vertices are numbered twice: along lines of constant u, and along lines of constant v.
"""

import numpy as np

from meshing.kernels.jit import inner, kernel


@inner
def _distance2(points, a, b):
    x = points[a, 0] - points[b, 0]
    y = points[a, 1] - points[b, 1]
    z = points[a, 2] - points[b, 2]
    return x * x + y * y + z * z


@inner
def _on_side(sides, a, b, c):
    # Each vertex has one bit per side of the rectangle that it lies on.
    return (sides[a] & sides[b] & sides[c]) != 0


@inner
def _would_flatten(around, sides, count, tip):
    common = 15
    for k in range(count):
        if k != tip:
            common &= sides[around[k]]
    return common != 0


@inner
def _best_ear(around, ring, sides, points, weld, count):
    best = -1
    best_size = np.inf
    for k in range(count):
        a, b, c = around[(k + count - 1) % count], around[k], around[(k + 1) % count]
        if _on_side(sides, a, b, c):
            continue
        size = _distance2(points, weld[ring[a]], weld[ring[c]])
        if size < best_size and not (count > 3 and _would_flatten(around, sides, count, k)):
            best = k
            best_size = size
    return best


@kernel(allocates=True)
def triangulate(
    leaves, left, right, bottom, top, by_v, weld, points, vertex_u, vertex_v, faces, uv, patch_id
):
    """Write the triangles of all leaves; return their number.

    ``left`` and ``right`` (n, 2) are ranges of vertices in order of (patch, u, v) on the two sides
    of constant u; ``bottom`` and ``top`` ranges in ``by_v``, which lists vertices in order of
    (patch, v, u). ``weld`` gives each vertex its row of ``points``. Ear clipping at the shortest
    diagonal. Triangles with two equal corners, at collapsed edges, are left out.
    """
    longest = 0
    for i in range(leaves.shape[0]):
        around_it = left[i, 1] - left[i, 0] + right[i, 1] - right[i, 0]
        around_it += bottom[i, 1] - bottom[i, 0] + top[i, 1] - top[i, 0]
        longest = max(longest, around_it)
    ring = np.empty(longest, np.int64)
    sides = np.empty(longest, np.int64)
    around = np.empty(longest, np.int64)
    n_faces = 0
    for i in range(leaves.shape[0]):
        count = 0
        # Each side gives all of its vertices but the last, which begins the next side.
        for k in range(bottom[i, 0], bottom[i, 1] - 1):
            ring[count] = by_v[k]
            sides[count] = 1 if k > bottom[i, 0] else 9
            count += 1
        for k in range(right[i, 0], right[i, 1] - 1):
            ring[count] = k
            sides[count] = 2 if k > right[i, 0] else 3
            count += 1
        for k in range(top[i, 1] - 1, top[i, 0], -1):
            ring[count] = by_v[k]
            sides[count] = 4 if k < top[i, 1] - 1 else 6
            count += 1
        for k in range(left[i, 1] - 1, left[i, 0], -1):
            ring[count] = k
            sides[count] = 8 if k < left[i, 1] - 1 else 12
            count += 1
        for k in range(count):
            around[k] = k
        while count >= 3:
            tip = _best_ear(around, ring, sides, points, weld, count)
            if tip < 0:
                break
            a = ring[around[(tip + count - 1) % count]]
            b = ring[around[tip]]
            c = ring[around[(tip + 1) % count]]
            x, y, z = weld[a], weld[b], weld[c]
            if y not in (x, z) and z != x:
                faces[n_faces, 0], faces[n_faces, 1], faces[n_faces, 2] = x, y, z
                uv[n_faces, 0, 0], uv[n_faces, 0, 1] = vertex_u[a], vertex_v[a]
                uv[n_faces, 1, 0], uv[n_faces, 1, 1] = vertex_u[b], vertex_v[b]
                uv[n_faces, 2, 0], uv[n_faces, 2, 1] = vertex_u[c], vertex_v[c]
                patch_id[n_faces] = leaves[i, 0]
                n_faces += 1
            count -= 1
            for k in range(tip, count):
                around[k] = around[k + 1]
    return n_faces
