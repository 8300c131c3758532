"""Points and spheres in double-double: the power of a point, and projection onto a sphere."""

from hybrid_rt.core.kernels.compensated import product, two_difference
from meshing.kernels.jit import inlined, kernel


@inlined
def add(high, low, a, b):
    """(high + low) + (a + b), normalised."""
    s = high + a
    z = s - high
    low = low + b + ((high - (s - z)) + (a - z))
    r = s + low
    return r, low - (r - s)


@inlined
def power_of_point(fx, fy, fz, gx, gy, gz, r):
    """|f + g|^2 - r^2 to within 2**-100 r^2; f is o - c rounded, g its rounding error."""
    high, low = product(fx, fx)
    p, q = product(fy, fy)
    high, low = add(high, low, p, q)
    p, q = product(fz, fz)
    high, low = add(high, low, p, q)
    p, q = product(r, r)
    high, low = add(high, low, -p, -q)
    return high + (low + 2.0 * (fx * gx + fy * gy + fz * gz))


@inlined
def onto_sphere(px, py, pz, cx, cy, cz, r):
    """Project a point near a sphere onto it, along the radius.

    c + r x rounds relative to |c| + r, and o + t d relative to t: more than the point's own
    coordinates where these are small. Then a ray that leaves the point would hit the sphere again.
    Here |p - c|^2 - r^2 is computed in double-double, so only the rounding of the three coordinates
    is left, as `hybrid_rt.intersection.ray_batch` assumes. For |p - c| = (1 + e) r one step leaves
    e^2 / 2, the square of a rounding error.
    """
    fx, gx = two_difference(px, cx)
    fy, gy = two_difference(py, cy)
    fz, gz = two_difference(pz, cz)
    part = power_of_point(fx, fy, fz, gx, gy, gz, r) / (fx * fx + fy * fy + fz * fz + r * r)
    return px - part * fx, py - part * fy, pz - part * fz


@kernel(allocates=True)
def settle_on_sphere(points, cx, cy, cz, radius):
    """Project points (n, 3) near a sphere onto it, in place."""
    for i in range(points.shape[0]):
        points[i, 0], points[i, 1], points[i, 2] = onto_sphere(
            points[i, 0], points[i, 1], points[i, 2], cx, cy, cz, radius
        )
