"""Light that reaches hits directly: a point of the light, and what the surface makes of it."""

import math
from typing import Any, NamedTuple

from hybrid_rt.kernels.lobes import scattered
from meshing.kernels.jit import inner, kernel

POINT, RECTANGLE = 0, 1


class LightTable(NamedTuple):
    """All lights of a scene; n rows."""

    kind: Any  # (n,) int32
    origin: Any  # (n, 3) float64, place of a point light, corner of a rectangle
    edge_u: Any  # (n, 3) float64
    edge_v: Any  # (n, 3) float64
    strength: Any  # (n, 3) float64, intensity (W/sr) or radiance (W/sr/m^2)


@inner
def light_point(lights, row, px, py, pz, s, t):
    """Choose a point of a light by (s, t) in [0, 1)^2 and weigh what arrives from there.

    Returns the vector from p to the point, its length, and the factor on the light's strength
    that gives the irradiance through a plane facing it: 1 / distance^2 for a point, and for a
    rectangle cos_light area / distance^2, whose mean over (s, t) is exact. Zero behind the light.
    """
    ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
    bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
    x = lights.origin[row, 0] + s * ax + t * bx - px
    y = lights.origin[row, 1] + s * ay + t * by - py
    z = lights.origin[row, 2] + s * az + t * bz - pz
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


@kernel
def light_on_hits(
    lights, light_id, lobes, material, colors, position, normal, direction, xi, to_light, value
):
    """Ask one light per hit what it sends through the hit's spreading lobes.

    Parameters
    ----------
    light_id, material : (n,) int32
        The light that each row asks; the hit's material, negative for none.
    colors : (n, lobes of a material at most, 3) float64
    position, normal, direction : (n, 3) float64
        Of the hit and of the ray that found it.
    xi : (n, 2) float64
        Two numbers in [0, 1) that choose the point of the light.
    to_light, value : (n, 3) float64, written
        The way to that point, and the radiance sent on if nothing stands in it.
    """
    for i in range(light_id.size):
        to_light[i, 0] = to_light[i, 1] = to_light[i, 2] = 0.0
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        if material[i] < 0:
            continue
        row = light_id[i]
        x, y, z, distance, factor = light_point(
            lights, row, position[i, 0], position[i, 1], position[i, 2], xi[i, 0], xi[i, 1]
        )
        if factor == 0.0:
            continue
        r, g, b = scattered(
            lobes,
            material[i],
            colors,
            i,
            normal[i, 0],
            normal[i, 1],
            normal[i, 2],
            direction[i, 0],
            direction[i, 1],
            direction[i, 2],
            x / distance,
            y / distance,
            z / distance,
        )
        to_light[i, 0], to_light[i, 1], to_light[i, 2] = x, y, z
        value[i, 0] = factor * lights.strength[row, 0] * r
        value[i, 1] = factor * lights.strength[row, 1] * g
        value[i, 2] = factor * lights.strength[row, 2] * b
