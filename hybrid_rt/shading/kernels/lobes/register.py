"""The register of lobes: the kinds, their traits, and dispatch to their kernels.

Code selects lobes by traits (a bit mask), never by kind: `lobes.traits[row] & SPREADS` is nonzero
for each lobe with one of the bits in `SPREADS`.

A new kind takes a line in `TRAITS` and a branch in the functions below, since numba cannot look a
function up in a table. A non-delta lobe has eval, pdf and sample; a delta lobe has a sample with a
factor.
"""

from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.lobes.dielectric import at_glass
from hybrid_rt.shading.kernels.lobes.diffuse import diffuse_direction, diffuse_value
from hybrid_rt.shading.kernels.lobes.metal import metal_direction, metal_value
from hybrid_rt.shading.kernels.lobes.phong import phong_direction, phong_value
from hybrid_rt.shading.kernels.lobes.rough_conductor import (
    rough_conductor_direction,
    rough_conductor_value,
)
from hybrid_rt.shading.kernels.lobes.rough_dielectric import (
    rough_dielectric_direction,
    rough_dielectric_value,
)
from meshing.kernels.jit import inlined

# How widely a lobe spreads light; each has one of these three.
# Wide: photons are gathered there, and Whitted's method lights it by shadow rays.
WIDE = 1
# Narrow: it has a density per solid angle, so lights are sampled through it; but what it reflects
# is found by following one sampled direction. A gather of photons would find few within the lobe.
NARROW = 2
# A delta distribution: mirror and smooth glass. Nothing but the lobe itself chooses its directions.
DELTA = 4
# Light passes to the other side: this is the surface of a clear body. Rays keep count of the body,
# its numbers begin as `hybrid_rt.shading.kernels.medium_stack` says, and its colour is a tint of
# what passes, not of what is reflected. Such a lobe is followed (DELTA or NARROW): photons of one
# side of a face are not gathered on the other.
TRANSMITS = 8

SPREADS = WIDE | NARROW
FOLLOWED = NARROW | DELTA
EVERY = WIDE | NARROW | DELTA

DIFFUSE, PHONG, METAL, MIRROR, DIELECTRIC, ROUGH_CONDUCTOR, ROUGH_DIELECTRIC = range(7)

TRAITS = {
    DIFFUSE: WIDE,
    PHONG: 0,  # wide or narrow by its exponent
    METAL: NARROW,
    MIRROR: DELTA,
    DIELECTRIC: DELTA | TRANSMITS,
    ROUGH_CONDUCTOR: 0,  # wide or narrow by its roughness
    ROUGH_DIELECTRIC: NARROW | TRANSMITS,
}


@inlined
def spreads_here(lobes, row, ratio):
    """Tell whether a lobe is non-delta at a hit; ``ratio`` is that of `scattered`.

    Rough glass is a delta lobe where it is hidden in a body of higher priority or borders on the
    same index: rays pass it there as they pass smooth glass.
    """
    traits = lobes.traits[row]
    return traits & SPREADS != 0 and (traits & TRANSMITS == 0 or ratio != 0.0)


@inlined
def spread_value(lobes, row, ratio, nx, ny, nz, dx, dy, dz, wx, wy, wz, cos_in, cos_out):
    """Return f cos of a non-delta lobe over its colour, three channels, and the pdf per solid angle.

    n has either sign, d is that of the incoming ray, w is evaluated. The cosines are those of -d and w to
    the normal on the side from which d came: the second is negative only for transmission. ``ratio`` is the
    index beyond the surface over that before it. Transmitted light is radiance: it scales by the index
    squared.
    """
    kind = lobes.kind[row]
    # Cosine between w and the mirror direction d - 2 (n.d) n, whichever way n points.
    cos_alpha = dx * wx + dy * wy + dz * wz + 2.0 * cos_in * cos_out
    if kind == DIFFUSE:
        f, pdf = diffuse_value(cos_out)
    elif kind == PHONG:
        f, pdf = phong_value(lobes.number[row, 0], cos_out, cos_alpha)
    elif kind == ROUGH_CONDUCTOR:
        return rough_conductor_value(
            lobes.number, row, nx, ny, nz, dx, dy, dz, wx, wy, wz, cos_in, cos_out
        )
    elif kind == ROUGH_DIELECTRIC:
        f, pdf = rough_dielectric_value(
            lobes.number, row, ratio, nx, ny, nz, dx, dy, dz, wx, wy, wz, cos_in, cos_out
        )
    else:  # METAL
        f, pdf = metal_value(lobes.number[row, 0], cos_in, cos_out, cos_alpha)
    return f, f, f, pdf


@inlined
def spread_direction(lobes, row, ratio, nx, ny, nz, dx, dy, dz, xi, eta, branch):
    """Sample a direction by a non-delta lobe; n is on the side from which d came.

    ``branch`` is a random number for the side. Returns the direction, and whether transmission was sampled:
    if the direction lies on the wrong side, the light is lost between facets.
    """
    kind = lobes.kind[row]
    is_through = False
    if kind == DIFFUSE:
        x, y, z = diffuse_direction(nx, ny, nz, xi, eta)
    elif kind == PHONG:
        x, y, z = phong_direction(lobes.number[row, 0], nx, ny, nz, dx, dy, dz, xi, eta)
    elif kind == ROUGH_CONDUCTOR:
        x, y, z = rough_conductor_direction(lobes.number, row, nx, ny, nz, dx, dy, dz, xi, eta)
    elif kind == ROUGH_DIELECTRIC:
        x, y, z, is_through = rough_dielectric_direction(
            lobes.number, row, ratio, nx, ny, nz, dx, dy, dz, xi, eta, branch
        )
    else:  # METAL
        x, y, z = metal_direction(lobes.number[row, 0], nx, ny, nz, dx, dy, dz, xi, eta)
    return x, y, z, is_through


@inlined
def delta_direction(lobes, row, stack, i, nx, ny, nz, dx, dy, dz, is_front, second, xi):
    """Sample a direction by a delta lobe; n is on the side from which d came; ``stack[i]`` is updated.

    Returns it, the factor on radiance without the colour, and whether that applies (not to reflection by
    glass).
    """
    if lobes.traits[row] & TRANSMITS:
        return at_glass(lobes, row, stack, i, nx, ny, nz, dx, dy, dz, is_front, second, xi)
    x, y, z = mirrored(dx, dy, dz, nx, ny, nz)
    return x, y, z, 1.0, True
