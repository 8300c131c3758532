"""What a surface sends on of the light that reaches it: the lobes that spread it.

One interface for all of them: `scattered` is `eval` (f cos) and `pdf` together, `sample_lobes` and
`lobe_direction` are `sample`. Mirror and glass send light on along single directions: they are
chosen here as often as the others, and followed in `hybrid_rt.shading.kernels.scatter`.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.lobes.register import DIFFUSE, PHONG, SPREADS, TRANSMITS
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined, kernel


class LobeTable(NamedTuple):
    """The lobes of all materials; material m owns rows first[m] up to first[m + 1]."""

    kind: Any  # (n,) int32, see `hybrid_rt.shading.kernels.lobes.register`
    traits: Any  # (n,) int32, bits, see there
    texture: Any  # (n,) int32, row of the texture that colours the lobe
    # (n, 6) float64; phong: exponent; metal: fuzz; glass: ior, whether Schlick, absorption (3),
    # priority
    number: Any
    weight: Any  # (n,) float64, share of the lobe in a mixture; colours have it in them already
    first: Any  # (materials + 1,) int32


@inlined
def metal_pdf(fuzz, cos_alpha):
    """Return the density of directions r + fuzz x, x even in the unit ball, r the mirror direction.

    Along an angle alpha from r the ball is met between t1 and t2, so the density per steradian is
    the integral of t^2 there over its volume: (t2^3 - t1^3) / (4 pi fuzz^3), with
    t = cos alpha -+ sqrt(fuzz^2 - sin^2 alpha).
    """
    square = fuzz * fuzz - (1.0 - cos_alpha) * (1.0 + cos_alpha)
    if cos_alpha <= 0.0 or square <= 0.0:
        return 0.0
    half = math.sqrt(square)
    return half * (3.0 * cos_alpha * cos_alpha + square) / (2.0 * math.pi * fuzz**3)


@inlined
def lobe_value(kind, number, cos_in, cos_out, cos_alpha):
    """Return f cos for colour one, and the density with which the lobe chooses the direction.

    ``cos_in`` is the cosine of the ray that arrived, ``cos_out`` that of the direction asked for,
    both positive; ``cos_alpha`` lies between the latter and the mirror direction.
    """
    if kind == DIFFUSE:
        return cos_out / math.pi, cos_out / math.pi
    if cos_alpha <= 0.0:
        return 0.0, 0.0
    if kind == PHONG:
        power = cos_alpha**number / (2.0 * math.pi)
        return (number + 2.0) * power * cos_out, (number + 1.0) * power
    # The larger cosine makes it reciprocal and keeps it below one (Neumann, Neumann and
    # Szirmay-Kalos, "Compact metallic reflectance models", 1999).
    pdf = metal_pdf(number, cos_alpha)
    return pdf * cos_out / max(cos_in, cos_out), pdf


@inlined
def lobe_chance(lobes, row, colors, i, j, asked):
    """Return how often a lobe is chosen before the others: its brightest channel.

    Lobes without any of the traits ``asked`` are not chosen at all. Glass counts with its share, as
    it sends on everything but its tint.
    """
    traits = lobes.traits[row]
    if traits & asked == 0:
        return 0.0
    if traits & TRANSMITS:
        return lobes.weight[row]
    return max(colors[i, j, 0], colors[i, j, 1], colors[i, j, 2])


@inlined
def scattered(lobes, material, colors, i, nx, ny, nz, dx, dy, dz, wx, wy, wz, asked):
    """Return f cos per channel and pdf of hit i: ray direction d arriving, unit w leaving.

    Opaque surfaces shine on both sides; light from behind the surface gives zero. A direction is
    chosen among the lobes that have one of the traits ``asked``, and the pdf is that of all of them
    together: `EVERY` for paths, `WIDE` where only wide lobes are lit.
    """
    n_dot_d = nx * dx + ny * dy + nz * dz
    cosine = nx * wx + ny * wy + nz * wz
    if n_dot_d > 0.0:
        cosine = -cosine
    r = g = b = pdf = 0.0
    if cosine <= 0.0:
        return r, g, b, pdf
    # Cosine between w and the mirror direction d - 2 (n.d) n, whichever way n points.
    cos_alpha = dx * wx + dy * wy + dz * wz + 2.0 * abs(n_dot_d) * cosine
    total = 0.0
    start = lobes.first[material]
    for j in range(lobes.first[material + 1] - start):
        row = start + j
        chance = lobe_chance(lobes, row, colors, i, j, asked)
        if chance == 0.0:
            continue
        total += chance
        if lobes.traits[row] & SPREADS == 0:
            continue
        f, density = lobe_value(
            lobes.kind[row], lobes.number[row, 0], abs(n_dot_d), cosine, cos_alpha
        )
        r += f * colors[i, j, 0]
        g += f * colors[i, j, 1]
        b += f * colors[i, j, 2]
        pdf += chance * density
    if total > 0.0:
        pdf /= total
    return r, g, b, pdf


@inlined
def leaves_through_face(geometric, i, direction, x, y, z):
    """Tell whether a direction leaves on the other side of the surface itself than d came from.

    ``geometric`` is (0, 3) where shading uses the surface's own normals: then it never does.
    """
    if geometric.shape[0] == 0:
        return False
    before = (
        geometric[i, 0] * direction[i, 0]
        + geometric[i, 1] * direction[i, 1]
        + geometric[i, 2] * direction[i, 2]
    )
    return before * (geometric[i, 0] * x + geometric[i, 1] * y + geometric[i, 2] * z) >= 0.0


@inlined
def pick_lobe(lobes, material, colors, i, xi, asked):
    """Choose a lobe by a number in [0, 1).

    Returns its place among the material's, its probability (zero: there is none to choose) and
    what is left of the number, even in [0, 1) again.
    """
    start = lobes.first[material]
    n = lobes.first[material + 1] - start
    total = 0.0
    for j in range(n):
        total += lobe_chance(lobes, start + j, colors, i, j, asked)
    if total == 0.0:
        return 0, 0.0, xi
    rest = xi * total
    chosen, chance = 0, 1.0
    for j in range(n):
        part = lobe_chance(lobes, start + j, colors, i, j, asked)
        if part > 0.0:
            chosen, chance = j, part
            if rest < part:
                break
            rest -= part
    return chosen, chance / total, min(rest / chance, 1.0)


@inlined
def lobe_direction(kind, number, nx, ny, nz, dx, dy, dz, xi, eta):
    """Choose a direction by one spreading lobe; n is on the side from which d came."""
    phi = 2.0 * math.pi * eta
    if kind == DIFFUSE:
        return onto_axis(nx, ny, nz, math.sqrt(1.0 - xi), math.sqrt(xi), phi)
    rx, ry, rz = mirrored(dx, dy, dz, nx, ny, nz)
    if kind == PHONG:
        cosine = (1.0 - xi) ** (1.0 / (number + 1.0))
        return onto_axis(rx, ry, rz, cosine, math.sqrt(max(1.0 - cosine * cosine, 0.0)), phi)
    return metal_direction(number, rx, ry, rz, xi, phi)


@inlined
def metal_direction(fuzz, rx, ry, rz, xi, phi):
    """Choose a direction by `metal_pdf`.

    With c = cos alpha and h = sqrt(fuzz^2 - sin^2 alpha), the share of directions farther from r
    than alpha is h^3 c / fuzz^3: its derivative in c is h (3 c^2 + h^2), the density. Newton's
    method inside brackets inverts it.
    """
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
    return onto_axis(rx, ry, rz, cosine, sine, phi)


@kernel
def sample_lobes(lobes, material, colors, normal, direction, xi, asked, wi, value, pdf):
    """Choose a direction by the spreading lobes of each hit; value = f cos / pdf.

    The pdf is that of all lobes together, so a sharp lobe beside a wide one gives no rare large
    values. Rows without such a lobe, directions into the surface, and those given to a mirror or
    to glass (where these are ``asked``) get zero.

    Parameters
    ----------
    lobes : LobeTable
    material : (n,) int32
    colors : (n, lobes of a material at most, 3) float64
    normal, direction : (n, 3) float64
        Of the hit and of the ray that found it.
    xi : (n, 2) float64 in [0, 1)
    asked : int
        As in `scattered`.
    wi, value : (n, 3) float64, written
    pdf : (n,) float64, written
        Per solid angle.
    """
    for i in range(material.size):
        wi[i, 0] = wi[i, 1] = wi[i, 2] = 0.0
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        pdf[i] = 0.0
        if material[i] < 0:
            continue
        chosen, chance, rest = pick_lobe(lobes, material[i], colors, i, xi[i, 0], asked)
        row = lobes.first[material[i]] + chosen
        if chance == 0.0 or lobes.traits[row] & SPREADS == 0:
            continue
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        if nx * dx + ny * dy + nz * dz > 0.0:
            nx, ny, nz = -nx, -ny, -nz
        x, y, z = lobe_direction(
            lobes.kind[row], lobes.number[row, 0], nx, ny, nz, dx, dy, dz, rest, xi[i, 1]
        )
        r, g, b, density = scattered(
            lobes, material[i], colors, i, nx, ny, nz, dx, dy, dz, x, y, z, asked
        )
        if density <= 0.0:
            continue
        wi[i, 0], wi[i, 1], wi[i, 2] = x, y, z
        value[i, 0], value[i, 1], value[i, 2] = r / density, g / density, b / density
        pdf[i] = density
