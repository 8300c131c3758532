"""The diffuse (Lambertian) lobe: f = 1 / pi."""

import math

from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined


@inlined
def diffuse_value(cos_out):
    """Return f cos and the pdf."""
    return cos_out / math.pi, cos_out / math.pi


@inlined
def diffuse_direction(nx, ny, nz, xi, eta):
    """Sample a cosine-weighted direction about n."""
    return onto_axis(nx, ny, nz, math.sqrt(1.0 - xi), math.sqrt(xi), 2.0 * math.pi * eta)
