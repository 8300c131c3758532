"""A batch of camera paths, advanced by one vertex: all that lies between two intersections.

Surfaces that go to Embree or into a tree want rays in batches.
"""

from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.path_vertex import arrive, depart
from hybrid_rt.integrators.kernels.vertex_points import RUN_ACROSS, draw_across
from hybrid_rt.integrators.kernels.ways import N_COLUMNS, OTHER
from hybrid_rt.shading.kernels.scatter import SCATTERED
from meshing.kernels.jit import hot_kernel, inlined


class Arrival(NamedTuple):
    """Where the rays of a batch arrive; n rows."""

    hits: Any  # Record
    normal: Any  # (n, 3) float64, shading normals, or (0, 3): those of the hits
    second: Any  # (n,) int32, or (0,), see `hybrid_rt.shading.kernels.medium_stack`
    # (n, lobes of a material at most, 3) float64 if colours vary over surfaces; else (0, 0, 0). Texels
    # are far apart in memory: a loop that does nothing else waits for several of them at once.
    colors: Any
    light_points: Any  # LightPoints chosen by each; none where no light is of kind `SURFACE`
    pdf_area: Any  # (n,) float64, densities of points met on such lights; or (0,)


@inlined
def _copy_path(source, i, target, j):
    target.camera_ray[j] = source.camera_ray[i]
    target.pixel[j] = source.pixel[i]
    target.sample[j] = source.sample[i]
    target.pdf[j] = source.pdf[i]
    target.first[j] = source.first[i]
    if source.rival.size:
        target.rival[j] = source.rival[i]
        target.joined[j] = source.joined[i]
    if source.chain.size:
        target.chain[j] = source.chain[i]
        if source.chain[i] != OTHER:
            for k in range(N_COLUMNS):
                target.anchor[j, k] = source.anchor[i, k]
    target.source_id[j] = source.source_id[i]
    for k in range(3):
        target.origins[j, k] = source.origins[i, k]
        target.directions[j, k] = source.directions[i, k]
        target.throughput[j, k] = source.throughput[i, k]
    for k in range(source.media.shape[1]):
        target.media[j, k] = source.media[i, k]


@inlined
def _copy_arrival(arrival, i, vertex):
    hits, normal, second, colors, light_points, _ = arrival
    hit = vertex.hit
    hit.t[0], hit.u[0], hit.v[0] = hits.t[i], hits.u[i], hits.v[i]
    hit.object_id[0], hit.front_face[0] = hits.object_id[i], hits.front_face[i]
    for k in range(3):
        hit.position[0, k] = hits.position[i, k]
        hit.normal[0, k] = normal[i, k] if normal.shape[0] else hits.normal[i, k]
        if normal.shape[0]:
            vertex.geometric[0, k] = hits.normal[i, k]
    if second.size:
        vertex.second[0] = second[i]
    for j in range(colors.shape[1]):
        for k in range(3):
            vertex.colors[0, j, k] = colors[i, j, k]
    point = vertex.light_point
    if light_points.pdf_area.size:
        point.pdf_area[0] = light_points.pdf_area[i]
        point.u[0], point.v[0] = light_points.u[i], light_points.v[i]
        for k in range(3):
            point.position[0, k] = light_points.position[i, k]
            point.normal[0, k] = light_points.normal[i, k]


@hot_kernel
def advance_paths(
    world, rules, depth, block, paths, arrival, path, vertex, points, radiance, rays, out, tally
):
    """Advance each path of a batch by one vertex.

    Parameters
    ----------
    world : World
    rules : Rules
    depth : int
        Vertices before this one.
    block : Block
    paths : Paths of n rows
        The rays that were traced.
    arrival : Arrival of n rows
    path : Paths of one row, scratch
    vertex : Vertex, scratch
    points : RunPoints of RUN_ACROSS vertices, scratch
    radiance : (camera rays, 3) float64, changed
    rays : ShadowRays of `FEW_SHADOW_RAYS` or `MOST_SHADOW_RAYS` n rows, written
        What they bring is not added yet.
    out : Paths of n rows, written
    tally : Tally, changed

    Returns
    -------
    n_rays, n_out : int, rows written
    """
    n_rays = n_out = 0
    for i in range(paths.camera_ray.size):
        column = i % RUN_ACROSS
        if column == 0:
            draw_across(rules, depth, paths.pixel, paths.sample, i, points)
        _copy_path(paths, i, path, 0)
        _copy_arrival(arrival, i, vertex)
        pdf_area = arrival.pdf_area[i] if arrival.pdf_area.size else 0.0
        if not arrive(world, rules, path, vertex, depth, pdf_area, radiance, tally):
            continue
        fate, n_rays = depart(
            world, rules, path, vertex, depth, block, points, column, rays, n_rays, tally
        )
        if fate >= SCATTERED:
            _copy_path(path, 0, out, n_out)
            n_out += 1
    return n_rays, n_out
