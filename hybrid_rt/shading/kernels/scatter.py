"""One bounce of a camera path: BSDF sampling, media, Russian roulette."""

from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.bsdf import leaves_through_face, pick_lobe, scattered
from hybrid_rt.shading.kernels.lobes.register import (
    EVERY,
    TRANSMITS,
    delta_direction,
    spread_direction,
    spreads_here,
)
from hybrid_rt.shading.kernels.medium_stack import filling_medium, ior_of, pass_surface
from meshing.kernels.jit import inlined, kernel

# How a ray ends at a surface, or goes on.
LEFT, STOPPED, ABSORBED, SCATTERED, SPECULAR = 0, 1, 2, 3, 4


class ConnectionPdf(NamedTuple):
    """What paths from the camera are weighed against light subpaths by; n rows."""

    t: Any  # (n,) float64, length of the incoming ray
    # (n,) float64, pdf per solid angle of its direction, times the expected number of light vertices that a
    # light subpath adds to the choice (of the camera: over the number of light subpaths); 0: none is joined
    arrival: Any
    is_smooth: Any  # (objects,) bool, objects with interpolated shading normals
    object_id: Any  # (n,) int32
    # (n,) float64, density of the last non-delta vertex and of the direction sampled there, see
    # `hybrid_rt.integrators.kernels.light_paths`; (0,): not needed
    density: Any


@inlined
def choose_way(
    lobes, material, colors, i, normal, dx, dy, dz, ratio, xi, choice, stack, second, keeps_power
):
    """Sample a lobe of hit i, and a direction by it; see `scatter`, and for ``ratio`` `scattered`.

    ``keeps_power``: transport power, which refraction leaves unscaled, instead of radiance, which it scales
    by the index squared. Returns the row of the lobe (-1: absorbed), the direction, factors on throughput,
    the pdf per solid angle (0 for a delta lobe), and whether the direction crosses a dielectric surface.
    """
    chosen, chance, rest = pick_lobe(lobes, material, colors, i, choice[i, 0], EVERY)
    if chance == 0.0:
        return -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False
    row = lobes.first[material] + chosen
    nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
    is_front = nx * dx + ny * dy + nz * dz < 0.0
    if not is_front:
        nx, ny, nz = -nx, -ny, -nz
    if spreads_here(lobes, row, ratio):
        x, y, z, is_through = spread_direction(
            lobes, row, ratio, nx, ny, nz, dx, dy, dz, xi[i, 0], xi[i, 1], rest
        )
        r, g, b, density = scattered(
            lobes, material, colors, i, nx, ny, nz, dx, dy, dz, x, y, z, ratio, EVERY
        )
        if density <= 0.0 or (nx * x + ny * y + nz * z < 0.0) != is_through:
            return -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, False
        r, g, b = r / density, g / density, b / density
        if is_through:
            pass_surface(row, stack, i, is_front, second)
            if keeps_power:
                r, g, b = r * ratio * ratio, g * ratio * ratio, b * ratio * ratio
        return row, x, y, z, r, g, b, density, is_through
    # Brought back to the share of all light that this lobe takes.
    r, g, b = colors[i, chosen, 0], colors[i, chosen, 1], colors[i, chosen, 2]
    x, y, z, factor, is_colored = delta_direction(
        lobes, row, stack, i, nx, ny, nz, dx, dy, dz, is_front, second, rest
    )
    if lobes.traits[row] & TRANSMITS == 0:
        return row, x, y, z, r / chance, g / chance, b / chance, 0.0, False
    if keeps_power:
        factor = 1.0
    factor *= lobes.weight[row] / chance
    if not is_colored:
        r = g = b = 1.0
    is_refracted = nx * x + ny * y + nz * z < 0.0
    return row, x, y, z, factor * r, factor * g, factor * b, 0.0, is_refracted


@inlined
def density_of_turn(normal, geometric, i, dx, dy, dz, x, y, z, density):
    """Convert a pdf per solid angle, d in and (x, y, z) out, to area and projected solid angle."""
    g = geometric if geometric.shape[0] else normal
    arriving = abs(g[i, 0] * dx + g[i, 1] * dy + g[i, 2] * dz)
    leaving = abs(g[i, 0] * x + g[i, 1] * y + g[i, 2] * z)
    return density * arriving / leaving if leaving > 0.0 else 0.0


@inlined
def connection_pdf_after(lobes, vertices, i, connection, x, y, z, density, is_through, stack):
    """Return `ConnectionPdf.density` of a path that leaves a non-delta vertex in the direction (x, y, z).

    ``density`` is its pdf per solid angle, ``stack`` those of the rays that leave, or (n, 0).
    """
    material, colors, _, normal, direction, geometric, ratio = vertices
    dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
    turn = density_of_turn(normal, geometric, i, dx, dy, dz, x, y, z, density)
    arrival, so_far = connection.arrival[i], connection.density[i]
    if arrival > 0.0:
        connection_pdf = turn * arrival / (connection.t[i] * connection.t[i])
        if stack.shape[1] > 0:
            connection_pdf /= ior_of(lobes, filling_medium(stack, i, lobes)) ** 2
        return connection_pdf
    if so_far == 0.0:
        return 0.0
    at = ratio[i] if ratio.size else 0.0
    if is_through:
        # Densities are over the index squared of where either direction runs.
        turn /= at * at
        at = 1.0 / at
    _, _, _, back = scattered(
        lobes, material[i], colors, i, normal[i, 0], normal[i, 1], normal[i, 2],
        -x, -y, -z, -dx, -dy, -dz, at, EVERY,
    )  # fmt: skip
    return so_far * turn / back if back > 0.0 else 0.0


@inlined(cached=True)
def scatter_one(
    lobes, vertices, i, xi, choice, stack, second, may_spread, may_mirror, roulette, reference,
    connection, onward, throughput, pdf,
):  # fmt: skip
    """Scatter ray i in one direction and return its fate; see `scatter`.

    Roulette compares throughput with the ``reference``; 0: it takes no notice of it.
    """
    material, colors, _, normal, direction, geometric, ratio = vertices
    connection_pdf = connection.density
    pdf[i] = 0.0
    if material[i] < 0:
        return LEFT
    dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
    at = ratio[i] if ratio.size else 0.0
    row, x, y, z, r, g, b, density, is_refracted = choose_way(
        lobes, material[i], colors, i, normal, dx, dy, dz, at, xi, choice, stack, second, False
    )
    if row < 0:
        return ABSORBED
    pdf[i] = density
    if density > 0.0:
        fate = SCATTERED if may_spread else STOPPED
        if connection_pdf.size:
            connection_pdf[i] = connection_pdf_after(
                lobes, vertices, i, connection, x, y, z, density, is_refracted, stack
            )
    else:
        fate = SPECULAR if may_mirror else STOPPED
        if connection_pdf.size and connection.is_smooth[connection.object_id[i]]:
            connection_pdf[i] = 0.0
    # Only light that goes through a clear body's surface may pass to the other side.
    if geometric.shape[0] and leaves_through_face(geometric, i, direction, x, y, z) != is_refracted:
        return ABSORBED
    r, g, b = throughput[i, 0] * r, throughput[i, 1] * g, throughput[i, 2] * b
    carried = max(r, g, b)
    if carried == 0.0:
        return ABSORBED
    if stack.shape[1] > 0:
        # Within glass radiance counts by its index squared, given back on the way out.
        carried *= ior_of(lobes, filling_medium(stack, i, lobes)) ** 2
    if roulette > 0.0 and fate != STOPPED:
        survival = min(carried / reference, roulette) if reference > 0.0 else roulette
        if choice[i, 1] >= survival:
            return ABSORBED
        r, g, b = r / survival, g / survival, b / survival
    throughput[i, 0], throughput[i, 1], throughput[i, 2] = r, g, b
    onward[i, 0], onward[i, 1], onward[i, 2] = x, y, z
    return fate


@kernel(allocates=True)
def scatter(
    lobes, vertices, xi, choice, stack, second, may_spread, may_mirror, roulette, connection, onward,
    throughput, pdf, fate,
):  # fmt: skip
    """Scatter each ray in one direction: BSDF sampling and Russian roulette.

    ``xi`` (n, 2) samples the direction, ``choice`` (n, 2) the lobe and roulette. ``stack`` (n, STACK)
    changes; (n, 0) if the scene has no dielectric; ``second`` is as in
    `hybrid_rt.shading.kernels.medium_stack`. ``may_spread`` and ``may_mirror``: non-delta and delta lobes
    are followed; False at the depth limit. ``roulette``, above zero: upper limit of the survival
    probability, which follows throughput. Of ``connection`` the density changes. Written are ``onward``,
    ``throughput`` (n, 3), ``pdf`` (n,), 0 for a delta lobe, and the ``fate`` (n,): `LEFT` (no material),
    `STOPPED` (with what was lost in ``throughput``), `ABSORBED`, `SCATTERED`, `SPECULAR`.
    """
    for i in range(fate.size):
        fate[i] = scatter_one(
            lobes, vertices, i, xi, choice, stack, second, may_spread, may_mirror, roulette, 1.0,
            connection, onward, throughput, pdf,
        )  # fmt: skip
