"""The BSDF: what the lobes of a material together send on of the light that reaches a surface.

One interface for all of them: `scattered` is `eval` (f cos) and `pdf` together, `sample_lobes` is
`sample`. Single lobes stand in `hybrid_rt.shading.kernels.lobes`. Mirror and glass are delta
distributions: they are chosen here as often as the others, and followed in
`hybrid_rt.shading.kernels.scatter`.
"""

from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.lobes.register import (
    TRANSMITS,
    spread_direction,
    spread_value,
    spreads_here,
)
from meshing.kernels.jit import inlined, kernel


class LobeTable(NamedTuple):
    """The lobes of all materials; material m owns rows first[m] up to first[m + 1]."""

    kind: Any  # (n,) int32, see `hybrid_rt.shading.kernels.lobes.register`
    traits: Any  # (n,) int32, bits, see there
    texture: Any  # (n,) int32, row of the texture that colours the lobe
    number: Any  # (n, numbers of a lobe at most) float64; what they are, its kernel knows
    weight: Any  # (n,) float64, share of the lobe in a mixture; colours have it in them already
    first: Any  # (materials + 1,) int32


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
def scattered(lobes, material, colors, i, nx, ny, nz, dx, dy, dz, wx, wy, wz, ratio, asked):
    """Return f cos per channel and pdf of hit i: ray direction d arriving, unit w leaving.

    Opaque surfaces shine on both sides; light from behind gives zero, but through rough glass. A
    direction is chosen among the lobes that have one of the traits ``asked``, and the pdf is that
    of all of them together: `EVERY` for paths, `WIDE` where only wide lobes are lit. ``ratio`` is
    the index beyond the surface over that before it where rough glass spreads light, 0 elsewhere.
    """
    n_dot_d = nx * dx + ny * dy + nz * dz
    cosine = nx * wx + ny * wy + nz * wz
    if n_dot_d > 0.0:
        cosine = -cosine
    r = g = b = pdf = 0.0
    if cosine == 0.0 or (cosine < 0.0 and ratio == 0.0):
        return r, g, b, pdf
    total = 0.0
    start = lobes.first[material]
    for j in range(lobes.first[material + 1] - start):
        row = start + j
        chance = lobe_chance(lobes, row, colors, i, j, asked)
        if chance == 0.0:
            continue
        total += chance
        passes = lobes.traits[row] & TRANSMITS != 0
        if not spreads_here(lobes, row, ratio) or (cosine < 0.0 and not passes):
            continue
        p, q, s, density = spread_value(
            lobes, row, ratio, nx, ny, nz, dx, dy, dz, wx, wy, wz, abs(n_dot_d), cosine
        )
        if passes:
            # Glass has its share of the mixture beside its tint, others have it in the colour.
            p, q, s = p * lobes.weight[row], q * lobes.weight[row], s * lobes.weight[row]
        if cosine < 0.0 or not passes:
            p, q, s = p * colors[i, j, 0], q * colors[i, j, 1], s * colors[i, j, 2]
        r += p
        g += q
        b += s
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
def is_behind(normal, direction, i, x, y, z):
    """Tell whether a direction leaves on the other side of the normal than d came from."""
    before = (
        normal[i, 0] * direction[i, 0]
        + normal[i, 1] * direction[i, 1]
        + normal[i, 2] * direction[i, 2]
    )
    return before * (normal[i, 0] * x + normal[i, 1] * y + normal[i, 2] * z) >= 0.0


@inlined
def sides_differ(geometric, normal, i, direction, x, y, z):
    """Tell whether a direction leaves on one side of the surface itself, and another of the normal.

    No light goes that way: it would leak through an opaque surface, or be bent without passing.
    """
    if geometric.shape[0] == 0:
        return False
    through = leaves_through_face(geometric, i, direction, x, y, z)
    return through != is_behind(normal, direction, i, x, y, z)


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


@kernel
def sample_lobes(
    lobes, material, colors, normal, direction, ratio, xi, branch, asked, wi, value, pdf
):
    """Choose a direction by the spreading lobes of each hit; value = f cos / pdf.

    The pdf is that of all lobes together, so a sharp lobe beside a wide one gives no rare large
    values. Rows without such a lobe, directions into the surface, and those given to a mirror or
    to smooth glass (where these are ``asked``) get zero.

    Parameters
    ----------
    lobes : LobeTable
    material : (n,) int32
    colors : (n, lobes of a material at most, 3) float64
    normal, direction : (n, 3) float64
        Of the hit and of the ray that found it.
    ratio : (n,) float64, or (0,)
        As in `scattered`; (0,): no glass is rough.
    xi : (n, 2) float64 in [0, 1)
    branch : (n,) float64 in [0, 1), or (0,)
        Chooses the side at rough glass.
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
        at = ratio[i] if ratio.size else 0.0
        if chance == 0.0 or not spreads_here(lobes, row, at):
            continue
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        if nx * dx + ny * dy + nz * dz > 0.0:
            nx, ny, nz = -nx, -ny, -nz
        side = branch[i] if branch.size else 0.0
        x, y, z, is_through = spread_direction(
            lobes, row, at, nx, ny, nz, dx, dy, dz, rest, xi[i, 1], side
        )
        r, g, b, density = scattered(
            lobes, material[i], colors, i, nx, ny, nz, dx, dy, dz, x, y, z, at, asked
        )
        if density <= 0.0 or (nx * x + ny * y + nz * z < 0.0) != is_through:
            continue
        wi[i, 0], wi[i, 1], wi[i, 2] = x, y, z
        value[i, 0], value[i, 1], value[i, 2] = r / density, g / density, b / density
        pdf[i] = density
