"""Stream compaction of ray batches: selecting rows of many arrays at once, and sums per pixel.

Each kernel makes one pass over memory; NumPy would make a dozen, each with a temporary array.
"""

from typing import Any, NamedTuple

from meshing.kernels.jit import inlined, kernel


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


class Paths(NamedTuple):
    """Active paths, in the order of their camera rays."""

    camera_ray: Any  # (n,) int64, row in the block of camera rays
    pixel: Any  # (n,) uint64; with the sample it names the path's random numbers
    sample: Any  # (n,) uint64
    origins: Any  # (n, 3) float64
    directions: Any  # (n, 3) float64, unit
    throughput: Any  # (n, 3) float64, what one unit of radiance on this ray adds to its pixel
    pdf: Any  # (n,) float64, density of the direction; 0 where it had no choice
    # (n,) float64, largest channel of the throughput behind the vertex before; 0: all surfaces so far
    # were mirrors or glass
    carried: Any
    splits: Any  # (n,) int8, how often it may still be divided, see `hybrid_rt.integrators.kernels.branches`
    # (n,) float64, see `hybrid_rt.integrators.kernels.light_paths`; (0,) where nothing is compared with it
    connection_pdf: Any
    media: Any  # (n, STACK) int32, dielectrics that the ray is in; (n, 0): there are none
    source_id: Any  # (n,) int32, object that the ray leaves from; -1 at the camera
    # (n,) bool, the light that diffuse surfaces send along the ray is found by connections; (0,): none
    joined: Any
    # (n,) bool, a surface that is not narrow has spread it, see `hybrid_rt.integrators.kernels.light_paths`;
    # (0,): as above
    has_met_wide: Any
    # See `hybrid_rt.integrators.kernels.ways`; (0,) and (0, 9) without its technique:
    chain: Any  # (n,) int8, what was met since the last non-delta vertex
    anchor: Any  # (n, 9) float64, where that vertex is, and what was sampled there


@kernel(allocates=True)
def add_products(camera_ray, throughput, value, radiance):
    """Add throughput x value, both (n, 3), to the rows ``camera_ray`` of ``radiance``."""
    for i in range(camera_ray.size):
        for k in range(3):
            radiance[camera_ray[i], k] += throughput[i, k] * value[i, k]


@kernel(allocates=True)
def pack_shadow_rays(
    camera_ray, throughput, object_id, position, light_id, surface_of_light, to_light, value, out
):
    """Pick the rows whose value is not zero as `ShadowRays`; return how many there are.

    Parameters
    ----------
    camera_ray : (n,) int64
    throughput, position : (n, 3) float64
    object_id, light_id : (n,) int32
        The lit object, and the light; the number of lights stands for the environment.
    surface_of_light : (lights,) int32
    to_light : (n, 3) float64
        Vector to the sampled point; for the environment, a direction.
    value : (n, 3) float64
        Contribution at throughput one.
    out : ShadowRays of n rows or more, written
    """
    n = 0
    for i in range(camera_ray.size):
        if max(value[i, 0], value[i, 1], value[i, 2]) <= 0.0:
            continue
        out.camera_ray[n] = camera_ray[i]
        out.source_id[n] = object_id[i]
        out.follows[n] = False
        if light_id[i] == surface_of_light.size:
            out.t_max[n], out.target_id[n] = float("inf"), -1
        else:
            out.t_max[n], out.target_id[n] = 1.0, surface_of_light[light_id[i]]
        for k in range(3):
            out.origin[n, k] = position[i, k]
            out.way[n, k] = to_light[i, k]
            out.end[n, k] = position[i, k] + to_light[i, k]
            out.value[n, k] = throughput[i, k] * value[i, k]
        n += 1
    return n


@kernel(allocates=True)
def add_unblocked(camera_ray, follows, blocked, value, radiance):
    """Add the values (n, 3) of unoccluded rays to the rows ``camera_ray`` of ``radiance``.

    ``follows`` (n,) is as in `ShadowRays`; ``blocked`` (n,) bool.
    """
    is_blocked = False
    for i in range(camera_ray.size):
        is_blocked = blocked[i] or (follows[i] and is_blocked)
        if not is_blocked:
            for k in range(3):
                radiance[camera_ray[i], k] += value[i, k]


@kernel(allocates=True)
def pack_paths(paths, fate, least, position, object_id, onward, pdf, out):
    """Pick the paths that go on (fate at least ``least``), set their new rays; return how many.

    Parameters
    ----------
    paths : Paths of n rows
    fate : (n,) uint8
        See `hybrid_rt.shading.kernels.scatter`.
    least : int
    position : (n, 3) float64
        Origins of the new rays.
    object_id : (n,) int32
        Objects that they leave.
    onward : (n, 3) float64
        Their directions.
    pdf : (n,) float64
        pdf of these directions per solid angle.
    out : Paths of n rows or more, written
    """
    n = 0
    for i in range(fate.size):
        if fate[i] < least:
            continue
        out.camera_ray[n] = paths.camera_ray[i]
        out.pixel[n] = paths.pixel[i]
        out.sample[n] = paths.sample[i]
        out.pdf[n], out.carried[n], out.splits[n] = pdf[i], paths.carried[i], paths.splits[i]
        if paths.connection_pdf.size:
            out.connection_pdf[n] = paths.connection_pdf[i]
        out.source_id[n] = object_id[i]
        for k in range(3):
            out.origins[n, k] = position[i, k]
            out.directions[n, k] = onward[i, k]
            out.throughput[n, k] = paths.throughput[i, k]
        for k in range(paths.media.shape[1]):
            out.media[n, k] = paths.media[i, k]
        n += 1
    return n


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


@kernel(allocates=True)
def add_to_pixels(pixel, radiance, image):
    """Add rows of ``radiance`` (n, 3) to the rows ``pixel`` of ``image``, in order.

    Rows with a negative pixel are left out.
    """
    for i in range(pixel.size):
        if pixel[i] < 0:
            continue
        for k in range(3):
            image[pixel[i], k] += radiance[i, k]
