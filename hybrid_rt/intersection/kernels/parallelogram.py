"""The weights of a point on a parallelogram, also where its edges are nearly parallel."""

from meshing.kernels.jit import inner

# Each step multiplies what is left by about eps over the angle of the edges, which is 1e-12 or more.
MAX_REFINEMENTS = 6
# After a step this small the next is below rounding, unless the angle is small.
LAST_REFINEMENT = 2.0**-45


@inner
def weights_of_point(x, y, z, e, f, px, py, pz, qx, qy, qz):
    """Return u, v of the point u e + v f that is next to (x, y, z), which lies near their plane.

    p and q are the dual basis of the edges e and f. Where these enclose a small angle, p and q are
    long, and rounding moves u and v by eps over the angle, each by its own: the point that they name
    would stray along the edges. So what is left is taken out again. Its rounding moves u and v
    together, and the point hardly.
    """
    u = v = 0.0
    for _ in range(MAX_REFINEMENTS):
        rx, ry, rz = (
            x - (u * e[0] + v * f[0]),
            y - (u * e[1] + v * f[1]),
            z - (u * e[2] + v * f[2]),
        )
        du, dv = px * rx + py * ry + pz * rz, qx * rx + qy * ry + qz * rz
        u, v = u + du, v + dv
        if abs(du) + abs(dv) <= LAST_REFINEMENT:
            break
    return u, v


@inner
def onto_parallelogram(u, v, x, y, z, e, f):
    """Move weights into [0, 1] so that u e + v f is next to (x, y, z), a point near the parallelogram.

    With u alone moved it would go along the edges, which is far where they enclose a small angle.
    """
    if not 0.0 <= u <= 1.0:
        u = min(max(u, 0.0), 1.0)
        v = _along(x - u * e[0], y - u * e[1], z - u * e[2], f)
    elif not 0.0 <= v <= 1.0:
        v = min(max(v, 0.0), 1.0)
        u = _along(x - v * f[0], y - v * f[1], z - v * f[2], e)
    return min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)


@inner
def _along(x, y, z, edge):
    """Return which part of an edge leads beside a point."""
    square = edge[0] * edge[0] + edge[1] * edge[1] + edge[2] * edge[2]
    return (x * edge[0] + y * edge[1] + z * edge[2]) / square
