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


@inner
def scattered(lobes, material, colors, i, nx, ny, nz, dx, dy, dz, wx, wy, wz):
    """Return f cos per channel of hit i: ray direction d arriving, unit wi to the light.

    Opaque surfaces shine on both sides; light from behind the surface gives zero.
    """
    n_dot_d = nx * dx + ny * dy + nz * dz
    cosine = nx * wx + ny * wy + nz * wz
    if n_dot_d > 0.0:
        cosine = -cosine
    r = g = b = 0.0
    if cosine <= 0.0:
        return r, g, b
    # Cosine between wi and the mirror direction d - 2 (n.d) n, whichever way n points.
    cos_alpha = dx * wx + dy * wy + dz * wz + 2.0 * abs(n_dot_d) * cosine
    start = lobes.first[material]
    for j in range(lobes.first[material + 1] - start):
        f = 0.0
        if lobes.kind[start + j] == DIFFUSE:
            f = cosine / math.pi
        elif lobes.kind[start + j] == PHONG:
            f = cosine * phong_value(lobes.number[start + j, 0], cos_alpha)
        r += f * colors[i, j, 0]
        g += f * colors[i, j, 1]
        b += f * colors[i, j, 2]
    return r, g, b


@inner
def onto_axis(ax, ay, az, cos_theta, phi):
    """Turn an angle from a unit axis and one around it into a direction.

    Frame: Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    """
    sign = math.copysign(1.0, az)
    p = -1.0 / (sign + az)
    q = ax * ay * p
    sin_theta = math.sqrt(max(1.0 - cos_theta * cos_theta, 0.0))
    x, y = sin_theta * math.cos(phi), sin_theta * math.sin(phi)
    return (
        x * (1.0 + sign * ax * ax * p) + y * q + cos_theta * ax,
        x * sign * q + y * (sign + ay * ay * p) + cos_theta * ay,
        -x * sign * ax - y * ay + cos_theta * az,
    )


@inner
def _lobe_weight(kind, colors, i, j):
    """Return how often a lobe is chosen: its brightest channel, zero unless it spreads light."""
    if kind not in (DIFFUSE, PHONG):
        return 0.0
    return max(colors[i, j, 0], colors[i, j, 1], colors[i, j, 2])


@kernel
def sample_lobes(lobes, material, colors, normal, direction, xi, wi, value):
    """Choose a direction by the spreading lobes of each hit; value = f cos / pdf.

    The pdf is that of all lobes together, so a sharp lobe beside a wide one gives no rare large
    values. Rows without such a lobe, and directions into the surface, get zero.
    """
    kind, number, first = lobes.kind, lobes.number, lobes.first
    for i in range(material.size):
        wi[i, 0] = wi[i, 1] = wi[i, 2] = 0.0
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        if material[i] < 0:
            continue
        start = first[material[i]]
        stop = first[material[i] + 1]
        total = 0.0
        for j in range(stop - start):
            total += _lobe_weight(kind[start + j], colors, i, j)
        if total == 0.0:
            continue
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        n_dot_d = nx * dx + ny * dy + nz * dz
        if n_dot_d > 0.0:
            nx, ny, nz, n_dot_d = -nx, -ny, -nz, -n_dot_d
        rx, ry, rz = dx - 2.0 * n_dot_d * nx, dy - 2.0 * n_dot_d * ny, dz - 2.0 * n_dot_d * nz
        # --- choose a lobe; what is left of xi_0 is again even in [0, 1)
        rest = xi[i, 0] * total
        chosen, weight = 0, 1.0
        for j in range(stop - start):
            part = _lobe_weight(kind[start + j], colors, i, j)
            if part > 0.0:
                chosen, weight = start + j, part
                if rest < part:
                    break
                rest -= part
        share = min(rest / weight, 1.0)
        phi = 2.0 * math.pi * xi[i, 1]
        if kind[chosen] == DIFFUSE:
            x, y, z = onto_axis(nx, ny, nz, math.sqrt(1.0 - share), phi)
        else:
            cos_alpha = (1.0 - share) ** (1.0 / (number[chosen, 0] + 1.0))
            x, y, z = onto_axis(rx, ry, rz, cos_alpha, phi)
        cosine = nx * x + ny * y + nz * z
        if cosine <= 0.0:
            continue
        # --- the pdf of all of them
        cos_alpha = max(rx * x + ry * y + rz * z, 0.0)
        pdf = 0.0
        for j in range(stop - start):
            part = _lobe_weight(kind[start + j], colors, i, j) / total
            if kind[start + j] == DIFFUSE:
                pdf += part * cosine / math.pi
            elif part > 0.0:
                exponent = number[start + j, 0]
                pdf += part * (exponent + 1.0) / (2.0 * math.pi) * cos_alpha**exponent
        r, g, b = scattered(lobes, material[i], colors, i, nx, ny, nz, dx, dy, dz, x, y, z)
        wi[i, 0], wi[i, 1], wi[i, 2] = x, y, z
        value[i, 0], value[i, 1], value[i, 2] = r / pdf, g / pdf, b / pdf
