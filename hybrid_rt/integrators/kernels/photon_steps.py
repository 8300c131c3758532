"""One bounce of a photon: what a surface stores of its power, absorbs, and scatters.

Power crosses an interface unscaled, whereas radiance changes by the square of the index. So this is
the adjoint of `scatter` for camera rays, not the same kernel.
"""

from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.bsdf import leaves_through_face
from hybrid_rt.shading.kernels.lobes.register import WIDE
from hybrid_rt.shading.kernels.scatter import (
    ABSORBED,
    LEFT,
    SCATTERED,
    SPECULAR,
    STOPPED,
    choose_way,
)
from meshing.kernels.jit import inlined, kernel

# Rows of a tally of power.
EMITTED, ESCAPED, TAKEN, LOST = 0, 1, 2, 3

# What a photon has met on its way, one bit each; and of one that is stored, whether its light is in
# the picture already wherever the camera looks straight at it.
MET_SPECULAR, MET_SPREADING, IS_SHOWN = 1, 2, 4


class Flight(NamedTuple):
    """Photons in flight; n rows."""

    number: Any  # (n,) uint64, names the random numbers within the group
    origin: Any  # (n, 3) float64
    direction: Any  # (n, 3) float64, unit
    power: Any  # (n, 3) float64, W
    media: Any  # (n, STACK) int32; (n, 0): there are none
    source_id: Any  # (n,) int32, object that the photon leaves from
    history: Any  # (n,) uint8


class Photons(NamedTuple):
    """Stored photons, at surfaces where density is estimated; n rows."""

    position: Any  # (n, 3) float64
    direction: Any  # (n, 3) float32, in which it flew
    normal: Any  # (n, 3) float32, of the surface on the side that was met
    power: Any  # (n, 3) float32, W
    history: Any  # (n,) uint8


@inlined
def _adjoint(geometric, i, normal, dx, dy, dz, x, y, z):
    """Return what keeps light in balance where the shading normal is not the surface's own.

    Veach, "Robust Monte Carlo methods for light transport simulation", 1997, section 5.3.
    """
    if geometric.shape[0] == 0:
        return 1.0
    nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
    gx, gy, gz = geometric[i, 0], geometric[i, 1], geometric[i, 2]
    above = abs(nx * dx + ny * dy + nz * dz) * abs(gx * x + gy * y + gz * z)
    below = abs(gx * dx + gy * dy + gz * dz) * abs(nx * x + ny * y + nz * z)
    return above / below if below > 0.0 else 0.0


@kernel(allocates=True)
def add_power(power, factor, total):
    """Add ``factor`` times the power (n, 3) of all photons to ``total`` (3,)."""
    r = g = b = 0.0
    for i in range(power.shape[0]):
        r += power[i, 0]
        g += power[i, 1]
        b += power[i, 2]
    total[0] += factor * r
    total[1] += factor * g
    total[2] += factor * b


@kernel(allocates=True)
def store_photons(flight, material, gathers, least_history, position, normal, out):
    """Store photons that hit surfaces where density is estimated; return how many.

    Photons with a ``history`` below ``least_history`` are not stored: 1 leaves out direct light.
    """
    n = 0
    for i in range(material.size):
        if material[i] < 0 or not gathers[material[i]] or flight.history[i] < least_history:
            continue
        facing = 0.0
        for k in range(3):
            facing -= normal[i, k] * flight.direction[i, k]
        for k in range(3):
            out.position[n, k] = position[i, k]
            out.direction[n, k] = flight.direction[i, k]
            out.normal[n, k] = normal[i, k] if facing >= 0.0 else -normal[i, k]
            out.power[n, k] = flight.power[i, k]
        out.history[n] = flight.history[i]
        n += 1
    return n


@kernel(allocates=True)
def scatter_photons(
    lobes, material, colors, normal, geometric, ratio, position, object_id, xi, choice, second,
    goes_on, flight, fate, tally,
):  # fmt: skip
    """Scatter each photon in one direction, or end it by Russian roulette.

    The survival probability is the ratio of the largest channels of power after and before, so
    survivors keep their largest channel.

    Parameters
    ----------
    material : (n,) int32
        Negative: the photon ends.
    colors : (n, lobes of a material at most, 3) float64
    normal, geometric, ratio, position, object_id
        Of the hits; ``geometric`` and ``ratio`` as in `hybrid_rt.shading.kernels.scatter.scatter`.
    xi, choice : (n, 2) float64 in [0, 1)
        Sample the direction; the lobe and survival.
    second : (n,) int32, or (0,)
        Faces that coincide with the hits: see `hybrid_rt.shading.kernels.medium_stack`.
    goes_on : bool
        Whether a further bounce is allowed; if not, the power counts as lost.
    flight : Flight of n rows, changed
    fate : (n,) uint8, written
    tally : (4, 3) float64, changed
        Power that escaped, was absorbed, or was lost at the depth limit is added to rows
        `ESCAPED`, `TAKEN`, `LOST`.
    """
    for i in range(material.size):
        fate[i] = LEFT
        ends_in = ESCAPED if object_id[i] < 0 else TAKEN
        for k in range(3):
            tally[ends_in, k] += flight.power[i, k]
        if material[i] < 0:
            continue
        fate[i] = ABSORBED
        direction = flight.direction
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        row, x, y, z, r, g, b, _, is_refracted = choose_way(
            lobes, material[i], colors, i, normal, dx, dy, dz, ratio[i] if ratio.size else 0.0,
            xi, choice, flight.media, second, True,
        )  # fmt: skip
        if row < 0:
            continue
        if (
            geometric.shape[0]
            and leaves_through_face(geometric, i, direction, x, y, z) != is_refracted
        ):
            continue
        balance = _adjoint(geometric, i, normal, dx, dy, dz, x, y, z)
        power = flight.power
        before = max(power[i, 0], power[i, 1], power[i, 2])
        r, g, b = power[i, 0] * r * balance, power[i, 1] * g * balance, power[i, 2] * b * balance
        after = max(r, g, b)
        if after == 0.0:
            continue
        if not goes_on:
            fate[i] = STOPPED
        elif after < before:
            survival = after / before
            if choice[i, 1] >= survival:
                continue
            r, g, b = r / survival, g / survival, b / survival
        power[i, 0], power[i, 1], power[i, 2] = r, g, b
        for k in range(3):
            tally[TAKEN, k] -= power[i, k]
            if fate[i] == STOPPED:
                tally[LOST, k] += power[i, k]
        if fate[i] == STOPPED:
            continue
        is_spread = lobes.traits[row] & WIDE != 0
        fate[i] = SCATTERED if is_spread else SPECULAR
        for k in range(3):
            flight.origin[i, k] = position[i, k]
        direction[i, 0], direction[i, 1], direction[i, 2] = x, y, z
        flight.source_id[i] = object_id[i]
        flight.history[i] |= MET_SPREADING if is_spread else MET_SPECULAR
