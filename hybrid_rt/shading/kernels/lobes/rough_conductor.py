"""The lobe of rough metal: GGX microfacets with the Fresnel reflectance of a conductor.

Walter, Marschner, Li and Torrance, "Microfacet models for refraction through rough surfaces", EGSR
2007. Interreflection between facets is lost.
"""

import math

from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.lobes.ggx import facet_area, seen_and_lit, stretched, visible_normal
from meshing.kernels.jit import inlined, inner

# Columns of `LobeTable.number`: eta and k of three channels, then
ALPHA = 6


@inner
def conductor_reflectance(cos_i, eta, k):
    """Return the reflectance of unpolarised light at an index eta + i k; ``cos_i`` in [0, 1].

    Fresnel's equations with a complex index. With a + i b = sqrt((eta + i k)^2 - sin^2) the part
    across is |cos - (a + i b)|^2 / |cos + (a + i b)|^2, and that along is it times
    |a + i b - sin^2 / cos|^2 / |a + i b + sin^2 / cos|^2.
    """
    cos2 = cos_i * cos_i
    sin2 = (1.0 - cos_i) * (1.0 + cos_i)
    real = (eta - k) * (eta + k) - sin2
    square = math.sqrt(real * real + 4.0 * eta * eta * k * k)  # a^2 + b^2
    a = (
        math.sqrt(0.5 * (square + real))
        if real > 0.0
        else eta * k / math.sqrt(0.5 * (square - real))
    )
    twice = 2.0 * a * cos_i
    across = (square + cos2 - twice) / (square + cos2 + twice)
    level = cos2 * square + sin2 * sin2
    return 0.5 * across * (1.0 + (level - twice * sin2) / (level + twice * sin2))


@inner
def normal_reflectance(eta, k):
    """Return the reflectance at normal incidence."""
    return ((eta - 1.0) ** 2 + k * k) / ((eta + 1.0) ** 2 + k * k)


@inlined
def rough_conductor_direction(number, row, nx, ny, nz, dx, dy, dz, xi, eta):
    """Sample a direction: d reflected at a visible facet; it may lead into the surface."""
    mx, my, mz = visible_normal(number[row, ALPHA], nx, ny, nz, dx, dy, dz, xi, eta)
    return mirrored(dx, dy, dz, mx, my, mz)


@inner
def rough_conductor_value(number, row, nx, ny, nz, dx, dy, dz, wx, wy, wz, cos_in, cos_out):
    """Return f cos of each channel over the reflectance at normal incidence, and the pdf."""
    alpha = number[row, ALPHA]
    hx, hy, hz = wx - dx, wy - dy, wz - dz
    square = hx * hx + hy * hy + hz * hz
    if square == 0.0 or cos_in <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    along = hx * nx + hy * ny + hz * nz
    tx, ty, tz = hx - along * nx, hy - along * ny, hz - along * nz
    sine2 = (tx * tx + ty * ty + tz * tz) / square
    area = facet_area(alpha, abs(along) / math.sqrt(square), sine2)
    f = 0.25 * area * seen_and_lit(alpha, cos_in, cos_out) / cos_in
    pdf = 0.5 * area / (cos_in + stretched(alpha, cos_in))
    # Of the angle at which facets are met: |w - d| is twice that cosine.
    cosine = min(0.5 * math.sqrt(square), 1.0)
    return (
        _tinted(f, number, row, 0, cosine),
        _tinted(f, number, row, 1, cosine),
        _tinted(f, number, row, 2, cosine),
        pdf,
    )


@inner
def _tinted(f, number, row, channel, cosine):
    """Return f times the reflectance of a channel over that at normal incidence."""
    eta, k = number[row, channel], number[row, 3 + channel]
    return f * conductor_reflectance(cosine, eta, k) / normal_reflectance(eta, k)
