"""Light that reaches hits directly: a point of the light, and what the surface makes of it.

Also light that a ray runs into by chance, and the weights that let both ways of finding the same
light be added up: Veach and Guibas, "Optimally combining sampling techniques for Monte Carlo
rendering", SIGGRAPH 1995.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.intersection.kernels.search.frame import two_difference
from hybrid_rt.intersection.kernels.sphere import power_of_point
from hybrid_rt.shading.kernels.bsdf import scattered, sides_differ
from hybrid_rt.shading.kernels.environment import sky_direction, sky_pdf, sky_radiance
from hybrid_rt.shading.kernels.medium_stack import filling_medium, ior_of
from hybrid_rt.shading.kernels.texture import texture_color
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined, kernel

POINT, RECTANGLE, SPHERE, SURFACE = 0, 1, 2, 3

# How the two ways of finding a light are combined: both weighted by the power heuristic, or only
# one of them. Without weights each way counts whole: for integrators that use one only.
BOTH, LIGHT_ONLY, DIRECTION_ONLY, UNWEIGHTED = 0, 1, 2, 3


class LightTable(NamedTuple):
    """All lights of a scene but the sky; n rows."""

    kind: Any  # (n,) int32
    origin: Any  # (n, 3) float64, place of a point light, corner of a rectangle, centre of a sphere
    edge_u: Any  # (n, 3) float64; of a sphere: (radius, 0, 0)
    edge_v: Any  # (n, 3) float64
    strength: Any  # (n, 3) float64, intensity (W/sr) or radiance (W/sr/m^2)
    texture: Any  # (n,) int32, row of a texture that takes the place of strength; -1: none
    # (n + 1,) float64, probability of each light to be asked where one is; the last is the sky's.
    chance: Any
    # (n + 1,) float64, probability of each light to begin a light path; the last, the sky's, is 0.
    emit: Any


class LightPoints(NamedTuple):
    """Points on surfaces that shine, chosen elsewhere; rows of other lights are not read."""

    position: Any  # (n, 3) float64
    normal: Any  # (n, 3) float64, unit
    pdf_area: Any  # (n,) float64
    u: Any  # (n,) float64
    v: Any  # (n,) float64


@inlined
def power_weight(pdf, other):
    """Return the weight of a way of density ``pdf`` beside another (power heuristic)."""
    if other <= 0.0:
        return 1.0
    ratio = other / pdf
    return 1.0 / (1.0 + ratio * ratio)


@inlined
def sphere_seen(lights, row, px, py, pz):
    """See a sphere from a point: |p - c|^2, |p - c|^2 - r^2 and 1 - cos of half its angle.

    The second, in double-double, tells how near the point is: rounding may be all of it.
    """
    radius = lights.edge_u[row, 0]
    fx, gx = two_difference(px, lights.origin[row, 0])
    fy, gy = two_difference(py, lights.origin[row, 1])
    fz, gz = two_difference(pz, lights.origin[row, 2])
    square = fx * fx + fy * fy + fz * fz
    power = power_of_point(fx, fy, fz, gx, gy, gz, radius)
    if power <= 0.0:
        return square, 0.0, 0.0
    return square, power, radius * radius / (square * (1.0 + math.sqrt(power / square)))


@inlined
def light_point(lights, row, px, py, pz, s, t):
    """Choose a point of a light by (s, t) in [0, 1)^2 and weigh what arrives from there.

    Returns the vector from p to the point, its length, and the factor on the light's strength
    that gives the irradiance through a plane facing it: 1 / distance^2 for a point; for a
    rectangle cos_light area / distance^2 and for a sphere the solid angle, one over the density of
    the direction, so that the mean over (s, t) is exact. Zero behind the light and inside spheres.
    """
    ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
    bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
    x, y, z = lights.origin[row, 0] - px, lights.origin[row, 1] - py, lights.origin[row, 2] - pz
    if lights.kind[row] == SPHERE:
        return _sphere_point(lights, row, px, py, pz, s, t)
    x, y, z = x + s * ax + t * bx, y + s * ay + t * by, z + s * az + t * bz
    square = x * x + y * y + z * z
    distance = math.sqrt(square)
    if square == 0.0:
        return x, y, z, distance, 0.0
    factor = 1.0 / square
    if lights.kind[row] == RECTANGLE:
        # Edge_u x edge_v is the normal times the area.
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        factor *= max(-(nx * x + ny * y + nz * z), 0.0) / distance
    return x, y, z, distance, factor


@inlined
def _sphere_point(lights, row, px, py, pz, s, t):
    """Choose a direction evenly in the cone that a sphere fills; see `light_point`."""
    radius = lights.edge_u[row, 0]
    x, y, z = lights.origin[row, 0] - px, lights.origin[row, 1] - py, lights.origin[row, 2] - pz
    square, power, cone = sphere_seen(lights, row, px, py, pz)
    if power == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    distance = math.sqrt(square)
    less = s * cone  # 1 - cos of the angle from the axis
    sine2 = less * (2.0 - less)
    wx, wy, wz = onto_axis(
        x / distance, y / distance, z / distance,
        1.0 - less, math.sqrt(max(sine2, 0.0)), 2.0 * math.pi * t,
    )  # fmt: skip
    # The near root is the product of both over the far one, as where rays meet spheres: shadow
    # rays end at that root to the last digits, even just beside the sphere.
    foot = x * wx + y * wy + z * wz
    far = foot + math.sqrt(max(radius * radius - square * sine2, 0.0))
    along = power / far
    return along * wx, along * wy, along * wz, along, 2.0 * math.pi * cone


@inlined
def _surface_point(points, i, px, py, pz):
    """Return what `light_point` does for a point chosen elsewhere."""
    x, y, z = (
        points.position[i, 0] - px,
        points.position[i, 1] - py,
        points.position[i, 2] - pz,
    )
    square = x * x + y * y + z * z
    distance = math.sqrt(square)
    facing = -(points.normal[i, 0] * x + points.normal[i, 1] * y + points.normal[i, 2] * z)
    if facing <= 0.0 or points.pdf_area[i] <= 0.0:
        return x, y, z, distance, 0.0
    return x, y, z, distance, facing / (distance * square * points.pdf_area[i])


@inlined
def light_strength(lights, textures, row, u, v, x, y, z):
    """Return the radiance (intensity of a point) of a light at one of its points."""
    if lights.texture[row] < 0:
        return lights.strength[row, 0], lights.strength[row, 1], lights.strength[row, 2]
    return texture_color(textures, lights.texture[row], u, v, x, y, z)


@kernel
def light_on_hits(
    lights, sky, textures, points, light_id, lobes, material, colors, position, normal, direction,
    geometric, ratio, xi, strategy, asked, to_light, value,
):  # fmt: skip
    """Ask one light per hit what it sends through the hit's spreading lobes.

    Parameters
    ----------
    points : LightPoints of n rows
        For rows that ask a `SURFACE`; may be empty where there is none.
    light_id, material : (n,) int32
        The light that each row asks, the number of lights for the sky; the hit's material,
        negative for none.
    colors : (n, lobes of a material at most, 3) float64
    position, normal, direction : (n, 3) float64
        Of the hit and of the ray that found it.
    geometric : (n, 3) float64
        Normal of the surface itself, where ``normal`` is another; else (0, 3).
    ratio : (n,) float64, or (0,)
        As in `scattered`; (0,): no glass is rough.
    xi : (n, 2) float64
        Two numbers in [0, 1) that choose the point of the light.
    strategy : int
        `UNWEIGHTED`: every light was asked. Otherwise one was, by its chance, and it may be found
        by scattered rays as well.
    asked : int
        See `scattered`.
    to_light, value : (n, 3) float64, written
        The way to that point (to the sky: a unit direction), and the radiance sent on if nothing
        stands in it.
    """
    for i in range(light_id.size):
        to_light[i, 0] = to_light[i, 1] = to_light[i, 2] = 0.0
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        if material[i] < 0:
            continue
        row = light_id[i]
        px, py, pz = position[i, 0], position[i, 1], position[i, 2]
        is_sky = row == lights.kind.size
        if is_sky:
            x, y, z = sky_direction(sky, xi[i, 0], xi[i, 1])
            distance = 1.0
            density = sky_pdf(sky, x, y, z)
            factor = 1.0 / density if density > 0.0 else 0.0
        elif lights.kind[row] == SURFACE:
            x, y, z, distance, factor = _surface_point(points, i, px, py, pz)
        else:
            x, y, z, distance, factor = light_point(lights, row, px, py, pz, xi[i, 0], xi[i, 1])
        if factor == 0.0 or sides_differ(geometric, normal, i, direction, x, y, z):
            continue
        r, g, b, pdf = scattered(
            lobes, material[i], colors, i,
            normal[i, 0], normal[i, 1], normal[i, 2],
            direction[i, 0], direction[i, 1], direction[i, 2],
            x / distance, y / distance, z / distance, ratio[i] if ratio.size else 0.0, asked,
        )  # fmt: skip
        if pdf == 0.0:
            continue
        if is_sky:
            p, q, s = sky_radiance(sky, x, y, z)
        elif lights.kind[row] == SURFACE:
            p, q, s = light_strength(
                lights, textures, row, points.u[i], points.v[i], px + x, py + y, pz + z
            )
        else:
            p, q, s = light_strength(
                lights, textures, row, xi[i, 0], xi[i, 1], px + x, py + y, pz + z
            )
        if strategy != UNWEIGHTED:
            chance = lights.chance[row]
            factor /= chance
            if strategy == BOTH and (is_sky or lights.kind[row] != POINT):
                factor *= power_weight(1.0 / factor, pdf)
        to_light[i, 0], to_light[i, 1], to_light[i, 2] = x, y, z
        value[i, 0] = factor * p * r
        value[i, 1] = factor * q * g
        value[i, 2] = factor * s * b


@inlined
def _pdf_of_light(lights, row, ox, oy, oz, t, cosine, pdf_area):
    """Return the density per steradian with which a point of a light, met at t, is chosen."""
    if lights.kind[row] == SPHERE:
        _, power, cone = sphere_seen(lights, row, ox, oy, oz)
        return 1.0 / (2.0 * math.pi * cone) if power > 0.0 else 0.0
    return _pdf_of_area(lights, row, pdf_area) * t * t / cosine


@inlined
def _pdf_of_area(lights, row, pdf_area):
    """Return the density per area with which points are chosen; that of a `SURFACE` is given."""
    if lights.kind[row] == SPHERE:
        return 1.0 / (4.0 * math.pi * lights.edge_u[row, 0] ** 2)
    if lights.kind[row] == RECTANGLE:
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        return 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return pdf_area


@kernel
def light_on_rays(
    lights, sky, textures, light_id, t, u, v, position, normal, origin, direction, pdf, pdf_area,
    rival, media, lobes, strategy, radiance,
):  # fmt: skip
    """Find the radiance that rays run into, weighted for how else it is found.

    Parameters
    ----------
    light_id : (n,) int32
        The light whose shining side was met, the number of lights for the sky; negative: none.
    t, u, v, position, normal : (n, ...) float64
        Of the hit; not read for the sky.
    origin, direction : (n, 3) float64
        Of the ray; unit directions.
    pdf : (n,) float64
        Density with which the direction was chosen; 0 where it had no choice: there only this way
        leads to the light.
    pdf_area : (n,) float64
        Density per area with which the point of a `SURFACE` is chosen; may be empty where there
        is none.
    rival : (n,) float64
        Of paths that mirrors and glass have led here from a surface that spreads light: the density
        to set against that of light paths (see `hybrid_rt.integrators.kernels.light_paths`); else 0.
    media : (n, STACK) int32, or (n, 0)
        Dielectrics that the ray is in.
    radiance : (n, 3) float64, written
    """
    for i in range(light_id.size):
        radiance[i, 0] = radiance[i, 1] = radiance[i, 2] = 0.0
        row = light_id[i]
        if row < 0:
            continue
        x, y, z = direction[i, 0], direction[i, 1], direction[i, 2]
        is_sky = row == lights.kind.size
        weight = 1.0
        if strategy < DIRECTION_ONLY and pdf[i] > 0.0 and lights.chance[row] > 0.0:
            if is_sky:
                density = sky_pdf(sky, x, y, z)
            else:
                cosine = -(x * normal[i, 0] + y * normal[i, 1] + z * normal[i, 2])
                by_area = pdf_area[i] if lights.kind[row] == SURFACE else 0.0
                density = _pdf_of_light(
                    lights, row, origin[i, 0], origin[i, 1], origin[i, 2], t[i], cosine, by_area
                )
            density *= lights.chance[row]
            if strategy == BOTH:
                weight = power_weight(pdf[i], density)
            elif density > 0.0:
                weight = 0.0
        elif strategy == BOTH and rival[i] > 0.0 and lights.emit[row] > 0.0:
            by_area = pdf_area[i] if lights.kind[row] == SURFACE else 0.0
            density = lights.emit[row] / math.pi * _pdf_of_area(lights, row, by_area)
            if media.shape[1] > 0:
                density /= ior_of(lobes, filling_medium(media, i, lobes)) ** 2
            weight = power_weight(rival[i], density)
        if weight == 0.0:
            continue
        if is_sky:
            r, g, b = sky_radiance(sky, x, y, z)
        else:
            r, g, b = light_strength(
                lights, textures, row, u[i], v[i], position[i, 0], position[i, 1], position[i, 2]
            )
        radiance[i, 0], radiance[i, 1], radiance[i, 2] = weight * r, weight * g, weight * b
