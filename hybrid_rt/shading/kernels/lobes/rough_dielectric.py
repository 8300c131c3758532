"""The lobe of rough glass: GGX microfacets that reflect and refract as smooth glass does.

Walter, Marschner, Li and Torrance, "Microfacet models for refraction through rough surfaces", EGSR
2007. Transmitted radiance scales by the index squared. Interreflection between facets is lost.
"""

import math

from hybrid_rt.shading.kernels.fresnel import fresnel, mirrored, refract
from hybrid_rt.shading.kernels.lobes.ggx import (
    facet_area,
    seen_and_lit,
    seen_through,
    stretched,
    visible_normal,
)
from meshing.kernels.jit import inner

# Column of `LobeTable.number`, after those of every dielectric.
ALPHA = 6


@inner
def rough_dielectric_value(number, row, ratio, nx, ny, nz, dx, dy, dz, wx, wy, wz, cos_in, cos_out):
    """Return f cos and the pdf of a direction on either side."""
    alpha = number[row, ALPHA]
    # The facet that sends d to w: its normal lies along w - d, or ratio w - d through the surface.
    is_through = cos_out < 0.0
    scale = ratio if is_through else 1.0
    hx, hy, hz = scale * wx - dx, scale * wy - dy, scale * wz - dz
    square = hx * hx + hy * hy + hz * hz
    if square == 0.0 or cos_in <= 0.0:
        return 0.0, 0.0
    length = math.sqrt(square)
    along = hx * nx + hy * ny + hz * nz
    tx, ty, tz = hx - along * nx, hy - along * ny, hz - along * nz
    area = facet_area(alpha, abs(along) / length, (tx * tx + ty * ty + tz * tz) / square)
    # Facets face the side from which d came.
    sign = math.copysign(1.0, cos_in + scale * cos_out) / length
    facing = -(hx * dx + hy * dy + hz * dz) * sign
    leaving = (hx * wx + hy * wy + hz * wz) * sign
    seen = 2.0 / (cos_in + stretched(alpha, cos_in))  # G1 / cos_in
    if not is_through:
        reflectance, _ = fresnel(min(facing, 1.0), ratio)
        f = reflectance * area * seen_and_lit(alpha, cos_in, cos_out) / (4.0 * cos_in)
        return f, 0.25 * reflectance * area * seen
    if facing <= 0.0 or leaving >= 0.0:
        return 0.0, 0.0
    reflectance, _ = fresnel(min(facing, 1.0), ratio)
    # |ratio w - d| is facing + ratio leaving, but for its sign.
    part = (1.0 - reflectance) * area * facing * -leaving / square
    f = part * seen_through(alpha, cos_in, -cos_out) / cos_in
    return f, part * seen * ratio * ratio


@inner
def rough_dielectric_direction(number, row, ratio, nx, ny, nz, dx, dy, dz, xi, eta, branch):
    """Sample a visible facet, and reflection or refraction: direction, and whether through."""
    alpha = number[row, ALPHA]
    mx, my, mz = visible_normal(alpha, nx, ny, nz, dx, dy, dz, xi, eta)
    facing = min(-(mx * dx + my * dy + mz * dz), 1.0)
    reflectance, cos_t = fresnel(facing, ratio)
    if branch < reflectance:
        x, y, z = mirrored(dx, dy, dz, mx, my, mz)
        return x, y, z, False
    x, y, z = refract(dx, dy, dz, mx, my, mz, facing, cos_t, ratio)
    return x, y, z, True
