"""Warps: from angles about an axis to directions."""

import math

from meshing.kernels.jit import inlined


@inlined
def onto_axis(ax, ay, az, cos_theta, sin_theta, phi):
    """Turn angles from a unit axis and around it into a direction (Duff et al., JCGT 6(1), 2017)."""
    sign = math.copysign(1.0, az)
    p = -1.0 / (sign + az)
    q = ax * ay * p
    x, y = sin_theta * math.cos(phi), sin_theta * math.sin(phi)
    return (
        x * (1.0 + sign * ax * ax * p) + y * q + cos_theta * ax,
        x * sign * q + y * (sign + ay * ay * p) + cos_theta * ay,
        -x * sign * ax - y * ay + cos_theta * az,
    )
