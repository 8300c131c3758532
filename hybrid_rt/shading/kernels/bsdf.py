"""The BSDF of a material: the sum of its lobes.

`scattered` is `eval` (f cos) and `pdf` in one, `sample_lobes` is `sample`. Single lobes are in
`hybrid_rt.shading.kernels.lobes`. Mirror and glass are delta distributions: they take part in the
choice of a lobe here, and are followed in `hybrid_rt.shading.kernels.scatter`.
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


class Vertices(NamedTuple):
    """Points of surfaces and the rays that found them, as BSDFs need them; n rows."""

    material: Any  # (n,) int32; negative: none
    colors: Any  # (n, lobes of a material at most, 3) float64
    position: Any  # (n, 3) float64
    normal: Any  # (n, 3) float64, for shading
    direction: Any  # (n, 3) float64, of the ray, unit
    geometric: Any  # (n, 3) float64, geometric normals if they differ from `normal`; else (0, 3)
    ratio: Any  # (n,) float64, as in `scattered`; (0,) without rough glass


@inlined
def lobe_chance(lobes, row, colors, i, j, asked):
    """Return the unnormalised probability of a lobe: its largest channel; 0 without a trait of ``asked``."""
    traits = lobes.traits[row]
    if traits & asked == 0:
        return 0.0
    if traits & TRANSMITS:  # its colour tints transmission only
        return lobes.weight[row]
    return max(colors[i, j, 0], colors[i, j, 1], colors[i, j, 2])


@inlined
def scattered(lobes, material, colors, i, nx, ny, nz, dx, dy, dz, wx, wy, wz, ratio, asked):
    """Return f cos per channel and the pdf at hit i, for a ray along d and a unit direction w.

    Reflection is two-sided; w and -d on opposite sides give zero, except at rough glass. The pdf is
    that of sampling one of the lobes with a trait in ``asked``: `EVERY` for paths, `WIDE` where
    only wide lobes are lit. ``ratio`` is the index beyond the surface over that before it where
    rough glass scatters, 0 elsewhere.
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
def is_behind(normal, direction, i, x, y, z):
    """Tell whether a direction is transmitted, by a normal."""
    before = (
        normal[i, 0] * direction[i, 0]
        + normal[i, 1] * direction[i, 1]
        + normal[i, 2] * direction[i, 2]
    )
    return before * (normal[i, 0] * x + normal[i, 1] * y + normal[i, 2] * z) >= 0.0


@inlined
def leaves_through_face(geometric, i, direction, x, y, z):
    """Tell whether a direction is transmitted, by the geometric normal; False if there is none, (0, 3)."""
    return geometric.shape[0] > 0 and is_behind(geometric, direction, i, x, y, z)


@inlined
def sides_differ(geometric, normal, i, direction, x, y, z):
    """Tell whether geometric and shading normal disagree on whether a direction is transmitted.

    Such directions carry no light: it would leak, or refract without crossing the surface.
    """
    if geometric.shape[0] == 0:
        return False
    through = is_behind(geometric, direction, i, x, y, z)
    return through != is_behind(normal, direction, i, x, y, z)


@inlined
def pick_lobe(lobes, material, colors, i, xi, asked):
    """Sample a lobe: its index in the material, its probability (0: none), and xi rescaled for reuse."""
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


@kernel(allocates=True)
def sample_lobes(
    lobes, material, colors, normal, direction, ratio, xi, branch, asked, wi, value, pdf
):
    """Sample a direction by the non-delta lobes of each hit; value = f cos / pdf.

    The pdf is that of all lobes together, so a sharp lobe beside a wide one causes no fireflies. Rows
    without such a lobe, directions into the surface, and rows that sampled a delta lobe (if ``asked``
    includes these) get zero. ``ratio`` is as in `scattered`, empty without rough glass, at which ``branch``
    (n,) samples reflection or transmission. ``wi``, ``value`` (n, 3) and ``pdf`` (n,) are written.
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
