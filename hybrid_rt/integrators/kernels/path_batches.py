"""A batch of camera paths, advanced by one vertex: all that lies between two intersections.

Surfaces that go to Embree or into a tree want rays in batches.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.integrators.kernels.branches import copy_path
from hybrid_rt.integrators.kernels.path_vertex import arrive, depart
from hybrid_rt.integrators.kernels.vertex_points import RUN_ACROSS, draw_across
from hybrid_rt.shading.kernels.scatter import SCATTERED
from meshing.kernels.jit import inlined, kernel


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


@kernel
def advance_paths(
    world,
    rules,
    depth,
    block,
    paths,
    arrival,
    path,
    branch,
    vertex,
    points,
    radiance,
    rays,
    out,
    tally,
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
    path, branch : Paths of one row, scratch
    vertex : Vertex, scratch
    points : RunPoints of RUN_ACROSS vertices, scratch
    radiance : (camera rays, 3) float64, changed
    rays : ShadowRays of `FEW_SHADOW_RAYS` or `MOST_SHADOW_RAYS` n rows, written
        Their contributions are not added yet.
    out : Paths of 2 n rows, written; of n rows, if no path is divided
    tally : Tally, changed

    Returns
    -------
    n_rays, n_out : int, rows written
    """
    # A literal 0 has a type of its own, for which `depart` would be compiled again.
    n_rays = n_out = np.int64(0)
    for i in range(paths.camera_ray.size):
        column = i % RUN_ACROSS
        if column == 0:
            draw_across(rules, depth, paths.pixel, paths.sample, i, points)
        copy_path(paths, i, path, 0)
        _copy_arrival(arrival, i, vertex)
        pdf_area = arrival.pdf_area[i] if arrival.pdf_area.size else 0.0
        if not arrive(world, rules, path, vertex, depth, pdf_area, radiance, tally):
            continue
        fate, n_rays, has_branch = depart(
            world, rules, path, vertex, depth, block, points, column, branch, rays, n_rays, tally
        )
        if fate >= SCATTERED:
            copy_path(path, 0, out, n_out)
            n_out += 1
        if has_branch:
            copy_path(branch, 0, out, n_out)
            n_out += 1
    return n_rays, n_out
