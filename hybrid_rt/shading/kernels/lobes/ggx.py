"""Microfacets: the GGX distribution, Smith's shadowing-masking, sampling of visible normals.

Walter, Marschner, Li and Torrance, "Microfacet models for refraction through rough surfaces", EGSR
2007; Heitz, "Understanding the masking-shadowing function in microfacet-based BRDFs", JCGT 3(2),
2014, and "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018.

Half of the facets, by area, are tilted by less than atan(alpha). Interreflection between facets is
lost: of light at normal incidence on perfect mirrors a hundredth at alpha 0.1, a twelfth at 0.25, a
third at 0.5, two thirds at 1.
"""

import math

from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inner

# An argument of Euler's beta function from which on its leading term is as good.
LARGE = 1e7


@inner
def facet_area(alpha, cosine, sine2):
    """Return the normal distribution D: facet area per solid angle of normals and surface area.

    The squared sine is passed, too, because 1 - cosine^2 is mostly rounding for small alpha.
    """
    spread = alpha * alpha * cosine * cosine + sine2
    return alpha * alpha / (math.pi * spread * spread)


@inner
def stretched(alpha, cosine):
    """Return the length of a unit direction after the stretch that brings alpha to 1.

    Smith's Lambda is (stretched / cosine - 1) / 2, and the masking function
    G1 = 2 cosine / (cosine + stretched).
    """
    return math.sqrt(cosine * cosine + alpha * alpha * (1.0 - cosine) * (1.0 + cosine))


@inner
def seen_and_lit(alpha, cos_in, cos_out):
    """Return the height-correlated G2 = 1 / (1 + Lambda + Lambda') of two directions on the same side."""
    a, b = stretched(alpha, cos_in), stretched(alpha, cos_out)
    return 2.0 * cos_in * cos_out / (a * cos_out + b * cos_in)


@inner
def seen_through(alpha, cos_in, cos_out):
    """Return the height-correlated G2 of two directions on opposite sides, by |cosine|.

    A facet that is high on one side is deep on the other: G2 is the integral over c from 0 to 1 of
    c^Lambda (1 - c)^Lambda', Euler's beta function of 1 + Lambda and 1 + Lambda'.
    """
    a = 0.5 * (1.0 + stretched(alpha, cos_in) / cos_in)
    b = 0.5 * (1.0 + stretched(alpha, cos_out) / cos_out)
    more, less = max(a, b), min(a, b)
    if more > LARGE:
        # The difference of two large logarithms would be rounding.
        return math.exp(math.lgamma(less) - less * math.log(more))
    return math.exp(math.lgamma(a) + math.lgamma(b) - math.lgamma(a + b))


@inner
def visible_normal(alpha, nx, ny, nz, dx, dy, dz, xi, eta):
    """Sample a visible facet normal m for a ray of direction d; n is on the side of -d.

    The pdf is G1 (-d . m) D / (-d . n). After the stretch that brings alpha to 1 the facets are
    those of a hemisphere; a point on its projected disc is sampled (Heitz 2018).
    """
    cosine = -(nx * dx + ny * dy + nz * dz)
    # The direction to where the ray came from, stretched; its tangent is -d - cosine n.
    vx, vy, vz = (
        cosine * nx - alpha * (dx + cosine * nx),
        cosine * ny - alpha * (dy + cosine * ny),
        cosine * nz - alpha * (dz + cosine * nz),
    )
    length = math.sqrt(vx * vx + vy * vy + vz * vz)
    vx, vy, vz = vx / length, vy / length, vz / length
    # Two directions across it, the first along the surface.
    px, py, pz = ny * vz - nz * vy, nz * vx - nx * vz, nx * vy - ny * vx
    length = math.sqrt(px * px + py * py + pz * pz)
    if length > 1e-10:
        px, py, pz = px / length, py / length, pz / length
    else:
        px, py, pz = onto_axis(nx, ny, nz, 0.0, 1.0, 0.0)
    qx, qy, qz = vy * pz - vz * py, vz * px - vx * pz, vx * py - vy * px
    radius, phi = math.sqrt(xi), 2.0 * math.pi * eta
    along, across = radius * math.cos(phi), radius * math.sin(phi)
    share = 0.5 * (1.0 + vx * nx + vy * ny + vz * nz)
    across = (1.0 - share) * math.sqrt(max(1.0 - along * along, 0.0)) + share * across
    up = math.sqrt(max(1.0 - along * along - across * across, 0.0))
    mx, my, mz = (
        along * px + across * qx + up * vx,
        along * py + across * qy + up * vy,
        along * pz + across * qz + up * vz,
    )
    # Stretched back.
    height = mx * nx + my * ny + mz * nz
    mx, my, mz = alpha * (mx - height * nx), alpha * (my - height * ny), alpha * (mz - height * nz)
    height = max(height, 0.0)
    mx, my, mz = mx + height * nx, my + height * ny, mz + height * nz
    length = math.sqrt(mx * mx + my * my + mz * mz)
    return mx / length, my / length, mz / length
