"""The lobe of metal with fuzz: the mirror direction plus fuzz times a point of the unit ball.

Shirley, "Ray Tracing in One Weekend"; here with its pdf in closed form, and made reciprocal.
"""

import math

from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined


@inlined
def metal_pdf(fuzz, cos_alpha):
    """Return the pdf of directions r + fuzz x, x uniform in the unit ball, r the mirror direction.

    A line from the origin at angle alpha to r crosses the ball between t1 and t2, so the pdf per
    solid angle is the integral of t^2 there over the volume: (t2^3 - t1^3) / (4 pi fuzz^3), with
    t = cos alpha -+ sqrt(fuzz^2 - sin^2 alpha).
    """
    square = fuzz * fuzz - (1.0 - cos_alpha) * (1.0 + cos_alpha)
    if cos_alpha <= 0.0 or square <= 0.0:
        return 0.0
    half = math.sqrt(square)
    return half * (3.0 * cos_alpha * cos_alpha + square) / (2.0 * math.pi * fuzz**3)


@inlined
def metal_value(fuzz, cos_in, cos_out, cos_alpha):
    """Return f cos and the pdf."""
    # The larger cosine makes it reciprocal and keeps it below one (Neumann, Neumann and
    # Szirmay-Kalos, "Compact metallic reflectance models", 1999).
    pdf = metal_pdf(fuzz, cos_alpha)
    return pdf * cos_out / max(cos_in, cos_out), pdf


@inlined
def metal_direction(fuzz, nx, ny, nz, dx, dy, dz, xi, eta):
    """Sample a direction by `metal_pdf`; it may lead into the surface.

    With c = cos alpha and h = sqrt(fuzz^2 - sin^2 alpha), the probability of an angle above alpha
    is h^3 c / fuzz^3; its derivative in c is proportional to h (3 c^2 + h^2), the pdf. It is
    inverted by bracketed Newton iteration.
    """
    rx, ry, rz = mirrored(dx, dy, dz, nx, ny, nz)
    floor = 1.0 - fuzz * fuzz
    aim = xi * fuzz**3
    low, high = 0.0, fuzz
    h = fuzz * xi ** (1.0 / 3.0)
    for _ in range(40):
        c = math.sqrt(floor + h * h)
        gap = h * h * h * c - aim
        if gap > 0.0:
            high = h
        else:
            low = h
        slope = 3.0 * h * h * c + (h**4 / c if c > 0.0 else 0.0)
        step = gap / slope if slope > 0.0 else 0.0
        h_next = h - step
        if not low <= h_next <= high:
            h_next = 0.5 * (low + high)
        if abs(h_next - h) <= 1e-15 * fuzz:
            break
        h = h_next
    cosine = min(math.sqrt(max(floor + h * h, 0.0)), 1.0)
    # sin^2 alpha = f^2 - h^2 without the cancellation in 1 - c^2.
    sine = math.sqrt(max((fuzz - h) * (fuzz + h), 0.0))
    return onto_axis(rx, ry, rz, cosine, sine, 2.0 * math.pi * eta)
