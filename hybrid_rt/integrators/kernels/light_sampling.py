"""Next-event estimation: one light, one point on it, and the shadow ray that reaches for it.

`sample_light` is called for a vertex of a path (`hybrid_rt.integrators.kernels.path_vertex`), and for all
hits of a batch by `sample_lights`; connections to light subpaths share its `cast`.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.connection_weights import weight_against_light_paths
from hybrid_rt.shading.kernels.bsdf import is_behind
from hybrid_rt.shading.kernels.emitter import light_on_hit
from hybrid_rt.shading.kernels.medium_stack import transmittance
from meshing.kernels.jit import inlined, kernel

NOTHING = -1


class ShadowRays(NamedTuple):
    """Shadow rays, and the contribution of each if it is unoccluded."""

    camera_ray: Any  # (n,) int64
    origin: Any  # (n, 3) float64
    way: Any  # (n, 3) float64; ends at t_max
    t_max: Any  # (n,) float64
    end: Any  # (n, 3) float64, point of the light
    source_id: Any  # (n,) int32, object that the ray leaves from
    target_id: Any  # (n,) int32, object that is the light; negative: none
    value: Any  # (n, 3) float64
    # (n,) bool, the ray goes on from where the one in the row above ends: what blocks that blocks this
    follows: Any


class Lamps(NamedTuple):
    """What a scene sends light by; `hybrid_rt.integrators.kernels.path_vertex.World` has the same columns."""

    lights: Any  # LightTable
    sky: Any  # EnvironmentTable
    textures: Any  # TextureTable
    surface_of_light: Any  # (lights,) int32
    lobes: Any  # LobeTable


class Receivers(NamedTuple):
    """Paths at the vertices that light is sampled for; n rows, beside `Vertices`."""

    camera_ray: Any  # (n,) int64, see `ShadowRays`
    object_id: Any  # (n,) int32
    throughput: Any  # (n, 3) float64
    media: Any  # (n, STACK) int32, or (n, 0), medium stacks of the paths
    beyond: Any  # (n, STACK) int32, or (0, 0): those beyond rough glass
    light_point: Any  # LightPoints; without rows where no light is of kind `SURFACE`


@inlined
def choose_light(before, chance, xi):
    """Sample a light by a number in [0, 1); return its row, and the number rescaled for reuse.

    ``before`` (lights + 1,) is the cumulative distribution of the lights.
    """
    row, last = 0, before.size - 1
    while row < last:
        middle = (row + last) // 2
        if xi < before[middle]:
            last = middle
        else:
            row = middle + 1
    while chance[row] == 0.0:  # rounding may leave the sums just below one
        row -= 1
    rest = (xi - (before[row] - chance[row])) / chance[row]
    return row, min(max(rest, 0.0), 1.0 - 2.0**-53)


@kernel(allocates=True)
def choose_lights(before, chance, xi, light_id):
    """Sample a light per row by the first column of ``xi`` (n, 2); see `choose_light`."""
    for i in range(light_id.size):
        light_id[i], xi[i, 0] = choose_light(before, chance, xi[i, 0])


@inlined
def write_ray(rays, n, camera_ray, source, target, origin, way, end, t_max, value, follows):
    """Write row n of the shadow rays."""
    rays.camera_ray[n], rays.t_max[n], rays.follows[n] = camera_ray, t_max, follows
    rays.source_id[n], rays.target_id[n] = source, target
    rays.origin[n, 0], rays.origin[n, 1], rays.origin[n, 2] = origin
    rays.way[n, 0], rays.way[n, 1], rays.way[n, 2] = way
    rays.end[n, 0], rays.end[n, 1], rays.end[n, 2] = end
    rays.value[n, 0], rays.value[n, 1], rays.value[n, 2] = value


@inlined
def cast(lobes, vertices, lit, i, way, length, value, target, end, rays, n):
    """Attenuate what comes to vertex i along a segment, and write row n of the shadow rays.

    Parameters
    ----------
    lobes : LobeTable
    vertices : Vertices
    lit : Receivers
    i : int
    way, end : tuple of three float
        Vector of the segment, and where it ends.
    length : float
        Of the segment; inf: to the sky.
    value : tuple of three float
        Scattered radiance if nothing is in the way.
    target : int
        Object at the end; negative: none.

    Returns
    -------
    bool
        Whether anything is left.
    """
    r, g, b = value
    position, stack = vertices.position, lit.media
    if lit.media.shape[1] > 0:
        if lit.beyond.size and is_behind(
            vertices.normal, vertices.direction, i, way[0], way[1], way[2]
        ):
            stack = lit.beyond
        p, q, k = transmittance(stack, i, lobes, length)
        r, g, b = r * p, g * q, b * k
    through = lit.throughput
    r, g, b = through[i, 0] * r, through[i, 1] * g, through[i, 2] * b
    if max(r, g, b) <= 0.0:
        return False
    origin = position[i, 0], position[i, 1], position[i, 2]
    t_max = length if length == math.inf else 1.0
    write_ray(
        rays, n, lit.camera_ray[i], lit.object_id[i], target, origin, way, end, t_max, (r, g, b), False
    )  # fmt: skip
    return True


@inlined(cached=True)
def sample_light(
    world, strategy, asked, vertices, lit, i, light, s, t, factor, connection, is_found, rays, n
):
    """Next-event estimation: sample a point of a light or the sky by (s, t); write row n of the shadow rays.

    Parameters
    ----------
    world : World or Lamps
    strategy, asked : int
        MIS weights and traits of the lobes, see `hybrid_rt.shading.kernels.emitter`.
    vertices : Vertices
    lit : Receivers
    i : int
        Row of the vertex.
    light : int
        The number of lights: the sky.
    factor : float
        On the radiance.
    connection : ConnectionPdf
        Read if light subpaths find this light as well: ``is_found``.

    Returns
    -------
    bool
        Whether there is such a shadow ray.
    """
    x, y, z, r, g, b, density, pdf = light_on_hit(
        world.lights, world.sky, world.textures, lit.light_point, light, world.lobes, vertices, i, s, t,
        strategy, asked,
    )  # fmt: skip
    length, target = math.sqrt(x * x + y * y + z * z), NOTHING
    if light == world.surface_of_light.size:
        length = math.inf
    else:
        target = world.surface_of_light[light]
    if is_found and density > 0.0:
        factor *= weight_against_light_paths(
            world, vertices, lit, connection, i, light, x / length, y / length, z / length, density, pdf
        )  # fmt: skip
    position = vertices.position
    end = position[i, 0] + x, position[i, 1] + y, position[i, 2] + z
    value = factor * r, factor * g, factor * b
    return cast(world.lobes, vertices, lit, i, (x, y, z), length, value, target, end, rays, n)


@kernel(allocates=True)
def sample_lights(world, strategy, asked, vertices, lit, light_id, factor, connection, xi, rays, n):
    """Sample a point of one light per hit, see `sample_light`; return the number of rows of ``rays``.

    ``light_id`` (n,) int32; ``factor`` (n,) float64, or (0,): 1; ``xi`` (n, 2) in [0, 1). Hits without a
    material, which is negative, are left out; ``rays`` are written from row n on.
    """
    for i in range(light_id.size):
        if vertices.material[i] >= 0:
            n += sample_light(
                world, strategy, asked, vertices, lit, i, light_id[i], xi[i, 0], xi[i, 1],
                factor[i] if factor.size else 1.0, connection, False, rays, n,
            )  # fmt: skip
    return n


@kernel(allocates=True)
def cast_to_sky(lobes, vertices, lit, way, value, rays, n):
    """Write shadow rays to the sky along ``way`` (n, 3), see `cast`; return the number of rows."""
    for i in range(way.shape[0]):
        x, y, z = way[i, 0], way[i, 1], way[i, 2]
        at = vertices.position
        end = at[i, 0] + x, at[i, 1] + y, at[i, 2] + z
        found = value[i, 0], value[i, 1], value[i, 2]
        n += cast(lobes, vertices, lit, i, (x, y, z), math.inf, found, NOTHING, end, rays, n)
    return n
