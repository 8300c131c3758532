"""Next-event estimation, emission that rays hit, and their multiple importance sampling weights.

Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo rendering", SIGGRAPH
1995.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.bsdf import scattered, sides_differ
from hybrid_rt.shading.kernels.environment import sky_direction, sky_pdf, sky_radiance
from hybrid_rt.shading.kernels.light_kinds import (
    has_area,
    light_point,
    light_strength,
    pdf_of_area,
    pdf_of_light,
)
from hybrid_rt.shading.kernels.medium_stack import filling_medium, ior_of
from meshing.kernels.jit import inlined, kernel

# How the two ways of finding a light are combined: both weighted by the power heuristic, or only
# one of them. Without weights each way counts whole: for integrators that use one only.
BOTH, LIGHT_ONLY, DIRECTION_ONLY, UNWEIGHTED = 0, 1, 2, 3


class Met(NamedTuple):
    """Hits on lights; n rows."""

    t: Any  # (n,) float64
    u: Any  # (n,) float64
    v: Any  # (n,) float64
    position: Any  # (n, 3) float64
    normal: Any  # (n, 3) float64


@inlined
def power_weight(pdf, other):
    """Return the power-heuristic weight of a technique with density ``pdf`` against another."""
    if other <= 0.0:
        return 1.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@inlined
def light_on_hit(lights, sky, textures, points, row, lobes, vertices, i, s, t, strategy, asked):
    """Sample a point of light ``row`` by (s, t), as seen from hit i, times f cos of non-delta lobes.

    Returns the vector to that point (to the environment: a unit direction), the radiance scattered if it is
    unoccluded, the pdf per solid angle (0 where BSDF sampling has no weight), and that of BSDF sampling.
    """
    material, colors, position, normal, direction, geometric, ratio = vertices
    px, py, pz = position[i, 0], position[i, 1], position[i, 2]
    is_sky = row == lights.kind.size
    if is_sky:
        x, y, z = sky_direction(sky, s, t)
        distance, u, v = 1.0, 0.0, 0.0
        density = sky_pdf(sky, x, y, z)
        factor = 1.0 / density if density > 0.0 else 0.0
    else:
        x, y, z, distance, factor, u, v = light_point(lights, points, i, row, px, py, pz, s, t)
    if factor == 0.0 or sides_differ(geometric, normal, i, direction, x, y, z):
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    r, g, b, pdf = scattered(
        lobes, material[i], colors, i,
        normal[i, 0], normal[i, 1], normal[i, 2],
        direction[i, 0], direction[i, 1], direction[i, 2],
        x / distance, y / distance, z / distance, ratio[i] if ratio.size else 0.0, asked,
    )  # fmt: skip
    if pdf == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    density = 0.0
    if is_sky:
        p, q, k = sky_radiance(sky, x, y, z)
    else:
        p, q, k = light_strength(lights, textures, row, u, v, px + x, py + y, pz + z)
    if strategy != UNWEIGHTED:
        factor /= lights.chance[row]
        if strategy == BOTH and (is_sky or has_area(lights, row)):
            density = 1.0 / factor
            factor *= power_weight(density, pdf)
    return x, y, z, factor * p * r, factor * q * g, factor * k * b, density, pdf


@inlined
def light_on_ray(
    lights, sky, textures, row, i, met, origin, direction, pdf, pdf_area, connection_pdf, media, lobes,
    strategy,
):  # fmt: skip
    """Return the radiance that ray i hits on light ``row``, MIS-weighted: see `light_on_rays`."""
    t, u, v, position, normal = met
    x, y, z = direction[i, 0], direction[i, 1], direction[i, 2]
    is_sky = row == lights.kind.size
    by_light_paths = 0.0
    if strategy == BOTH and connection_pdf > 0.0 and not is_sky:
        by_light_paths = (
            density_of_light_path(lights, row, pdf_area, media, i, lobes) / connection_pdf
        )
    weight = 1.0
    if strategy < DIRECTION_ONLY and pdf > 0.0 and lights.chance[row] > 0.0:
        if is_sky:
            density = sky_pdf(sky, x, y, z)
        else:
            cosine = -(x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2])
            density = pdf_of_light(
                lights, row, origin[i, 0], origin[i, 1], origin[i, 2], t[i], cosine, pdf_area
            )
        density *= lights.chance[row]
        if strategy == BOTH:
            weight = power_weight(pdf, math.hypot(density, by_light_paths * pdf))
        elif density > 0.0:
            weight = 0.0
    else:
        weight = power_weight(1.0, by_light_paths)
    if weight == 0.0:
        return 0.0, 0.0, 0.0
    if is_sky:
        r, g, b = sky_radiance(sky, x, y, z)
    else:
        r, g, b = light_strength(
            lights, textures, row, u[i], v[i], position[i, 0], position[i, 1], position[i, 2]
        )
    return weight * r, weight * g, weight * b


@inlined
def density_of_light_path(lights, row, pdf_area, media, i, lobes):
    """Return the density with which light subpaths leave a point of a light in one direction.

    Per area and projected solid angle, over the index squared there: ``media[i]`` is the medium stack.
    """
    density = lights.emit[row] / math.pi * pdf_of_area(lights, row, pdf_area)
    if media.shape[1] > 0:
        density /= ior_of(lobes, filling_medium(media, i, lobes)) ** 2
    return density


@kernel(allocates=True)
def light_on_rays(
    lights, sky, textures, light_id, met, origin, direction, pdf, pdf_area, connection_pdf, media, lobes,
    strategy, radiance,
):  # fmt: skip
    """Compute the emitted ``radiance`` (n, 3) that rays hit, MIS-weighted.

    ``light_id`` (n,) is the light whose emissive side was hit, the number of lights for the environment
    (for which ``met`` is not read), negative for none. ``pdf`` (n,), of the direction, is 0 for camera rays
    and after delta lobes: no other technique finds the light. ``pdf_area`` (n,) is that of sampling the
    point of a `SURFACE`, or empty; ``connection_pdf`` (n,), for paths by way of delta lobes or narrow
    surfaces, the density to weigh against light subpaths (see `hybrid_rt.integrators.kernels.light_paths`),
    else 0; ``media`` are medium stacks, or (n, 0).
    """
    for i in range(light_id.size):
        r = g = b = 0.0
        if light_id[i] >= 0:
            r, g, b = light_on_ray(
                lights, sky, textures, light_id[i], i, met, origin, direction, pdf[i],
                pdf_area[i] if pdf_area.size else 0.0, connection_pdf[i], media, lobes, strategy,
            )  # fmt: skip
        radiance[i, 0], radiance[i, 1], radiance[i, 2] = r, g, b
