"""Samples of lights: a point of the light and what it sends to a point of the scene."""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import kernel

POINT, RECTANGLE = 0, 1


class LightTable(NamedTuple):
    """All lights of a scene; n rows."""

    kind: Any  # (n,) int32
    origin: Any  # (n, 3) float64, place of a point light, corner of a rectangle
    edge_u: Any  # (n, 3) float64
    edge_v: Any  # (n, 3) float64
    strength: Any  # (n, 3) float64, intensity (W/sr) or radiance (W/sr/m^2)


@kernel
def sample_lights(lights, light_id, position, xi, point, irradiance):
    """Choose a point of each ray's light and weigh what arrives from there.

    Parameters
    ----------
    light_id : (n,) int32
        The light that each row asks.
    position, xi : (n, 3) and (n, 2) float64
        Where the light arrives; two numbers in [0, 1).
    point, irradiance : (n, 3) float64, written
        The point of the light; irradiance through a plane facing it (for a rectangle the estimate
        L cos_light area / distance^2, whose mean over xi is exact). Zero behind the light.
    """
    for i in range(light_id.size):
        row = light_id[i]
        is_area = lights.kind[row] == RECTANGLE
        px, py, pz = lights.origin[row, 0], lights.origin[row, 1], lights.origin[row, 2]
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        if is_area:
            s, t = xi[i, 0], xi[i, 1]
            px, py, pz = px + s * ax + t * bx, py + s * ay + t * by, pz + s * az + t * bz
        x, y, z = px - position[i, 0], py - position[i, 1], pz - position[i, 2]
        square = x * x + y * y + z * z
        weight = 0.0
        if square > 0.0:
            weight = 1.0 / square
            if is_area:
                # Edge_u x edge_v is the normal times the area.
                nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
                weight *= max(-(nx * x + ny * y + nz * z), 0.0) / math.sqrt(square)
        point[i, 0], point[i, 1], point[i, 2] = px, py, pz
        for k in range(3):
            irradiance[i, k] = weight * lights.strength[row, k]


@kernel
def sample_hemisphere(normal, direction, xi, wi):
    """Choose directions by the cosine law on the side from which each ray arrived.

    The square is mapped to the disc by angles (r = sqrt(xi_0)); the frame about the normal is the
    one of Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    """
    for i in range(normal.shape[0]):
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        if nx * direction[i, 0] + ny * direction[i, 1] + nz * direction[i, 2] > 0.0:
            nx, ny, nz = -nx, -ny, -nz
        sign = math.copysign(1.0, nz)
        a = -1.0 / (sign + nz)
        b = nx * ny * a
        radius, angle = math.sqrt(xi[i, 0]), 2.0 * math.pi * xi[i, 1]
        x, y, z = radius * math.cos(angle), radius * math.sin(angle), math.sqrt(1.0 - xi[i, 0])
        wi[i, 0] = x * (1.0 + sign * nx * nx * a) + y * b + z * nx
        wi[i, 1] = x * sign * b + y * (sign + ny * ny * a) + z * ny
        wi[i, 2] = -x * sign * nx - y * ny + z * nz
