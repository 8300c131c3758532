"""What a surface sends on of the light that reaches it: the lobes that spread it.

Mirror and glass send light on along single directions and are not evaluated here.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel

DIFFUSE, PHONG, MIRROR, DIELECTRIC = 0, 1, 2, 3


class LobeTable(NamedTuple):
    """The lobes of all materials; material m owns rows first[m] up to first[m + 1]."""

    kind: Any  # (n,) int32
    texture: Any  # (n,) int32, row of the texture that colours the lobe
    number: Any  # (n, 5) float64; phong: exponent; glass: ior, whether Schlick, absorption
    first: Any  # (materials + 1,) int32


@inner
def phong_value(exponent, cos_alpha):
    """Return the normalised lobe about the mirror direction, per steradian, for colour one.

    Its albedo never exceeds one. Lafortune and Willems, "Using the modified Phong reflectance
    model for physically based rendering", 1994.
    """
    if cos_alpha <= 0.0:
        return 0.0
    return (exponent + 2.0) / (2.0 * math.pi) * cos_alpha**exponent


@kernel
def eval_lobes(lobes, material, colors, normal, direction, wi, value):
    """Fill ``value`` (n, 3) with f cos, for arriving rays and unit directions to the light.

    Opaque surfaces shine on both sides; light from behind the surface gives zero.
    """
    kind, number, first = lobes.kind, lobes.number, lobes.first
    for i in range(material.size):
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        wx, wy, wz = wi[i, 0], wi[i, 1], wi[i, 2]
        n_dot_d = nx * dx + ny * dy + nz * dz
        cosine = nx * wx + ny * wy + nz * wz
        if n_dot_d > 0.0:
            cosine = -cosine
        r = g = b = 0.0
        if cosine > 0.0:
            # Cosine between wi and the mirror direction d - 2 (n.d) n, whichever way n points.
            cos_alpha = dx * wx + dy * wy + dz * wz + 2.0 * abs(n_dot_d) * cosine
            start = first[material[i]]
            for j in range(first[material[i] + 1] - start):
                f = 0.0
                if kind[start + j] == DIFFUSE:
                    f = 1.0 / math.pi
                elif kind[start + j] == PHONG:
                    f = phong_value(number[start + j, 0], cos_alpha)
                r += f * colors[i, j, 0]
                g += f * colors[i, j, 1]
                b += f * colors[i, j, 2]
            r, g, b = r * cosine, g * cosine, b * cosine
        value[i, 0], value[i, 1], value[i, 2] = r, g, b
