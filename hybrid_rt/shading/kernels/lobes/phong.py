"""The energy-conserving Phong lobe: f = (n + 2) / (2 pi) cos^n alpha.

Alpha is the angle to the mirror direction. Lafortune and Willems, "Using the modified Phong
reflectance model for physically based rendering", 1994.
"""

import math

from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined


@inlined
def phong_value(exponent, cos_out, cos_alpha):
    """Return f cos and the pdf."""
    if cos_alpha <= 0.0:
        return 0.0, 0.0
    power = cos_alpha**exponent / (2.0 * math.pi)
    return (exponent + 2.0) * power * cos_out, (exponent + 1.0) * power


@inlined
def phong_direction(exponent, nx, ny, nz, dx, dy, dz, xi, eta):
    """Sample a direction about the mirror direction of d; it may lead into the surface."""
    rx, ry, rz = mirrored(dx, dy, dz, nx, ny, nz)
    cosine = (1.0 - xi) ** (1.0 / (exponent + 1.0))
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return onto_axis(rx, ry, rz, cosine, sine, 2.0 * math.pi * eta)
