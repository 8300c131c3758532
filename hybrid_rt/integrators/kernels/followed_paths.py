"""The loop that drives camera paths: from a hit to the next, until nothing is left of a path.

The first hits of a batch are found together, unless no kind of surface is called (see `SingleRayTracer`). From there each path is
followed to its end, ray by ray, before the next begins. Where rays cannot be traced one by one, all paths of a
batch are advanced by one vertex, and what they send is traced together.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.integrators.kernels.branches import MOST_SPLITS
from hybrid_rt.integrators.kernels.compaction import copy_path
from hybrid_rt.integrators.kernels.light_sampling import NOTHING
from hybrid_rt.integrators.kernels.path_vertex import arrive, depart
from hybrid_rt.integrators.kernels.vertex_points import (
    RUN_ACROSS,
    RUN_ALONG,
    draw_across,
    draw_along,
)
from hybrid_rt.integrators.kernels.ways import OTHER
from hybrid_rt.intersection.kernels.search.nearest import SUSPECT
from hybrid_rt.intersection.kernels.single_rays import first_hit, is_occluded
from hybrid_rt.shading.kernels.mesh_points import shading_normal, texture_point
from hybrid_rt.shading.kernels.scatter import SCATTERED
from meshing.kernels.jit import inlined, kernel


class Arrival(NamedTuple):
    """Where the rays of a batch arrive; n rows."""

    hits: Any  # Record
    second: Any  # (n,) int32, or (0,), see `hybrid_rt.shading.kernels.medium_stack`
    light_points: Any  # LightPoints chosen by each; none where no light is of kind `SURFACE`
    pdf_area: Any  # (n,) float64, densities of points met on such lights; or (0,)


class Scratch(NamedTuple):
    """What one path at a time is followed with."""

    ray: Any  # OneRay
    path: Any  # Paths of one row
    branch: Any  # Paths of one row
    waiting: Any  # Paths of `MOST_SPLITS` rows
    depth_of_waiting: Any  # (MOST_SPLITS,) int64
    vertex: Any  # Vertex; its ``hit`` is ``ray.record``
    points: Any  # RunPoints of `RUN_ALONG` vertices, or of `RUN_ACROSS` if paths advance together


class Doubtful(NamedTuple):
    """Rays whose status displaced rays have to tell, see `hybrid_rt.intersection.margins`; m rows."""

    n: Any  # (1,) int64, rows that are filled
    origin: Any  # (m, 3) float64
    direction: Any  # (m, 3) float64
    source_id: Any  # (m,) int32


@kernel
def follow_paths(
    world, rules, depth, block, paths, begin, arrival, single, scratch, radiance, rays, out,
    doubtful, tally,
):  # fmt: skip
    """Follow each path of a batch to its end, or to its next vertex.

    ``depth``: vertices before those of ``arrival``, which has no rows if first hits are yet to be found.
    ``paths``, Paths of n rows: what was traced, if paths advance together; else those of ``block`` are followed,
    from row ``begin`` on.
    ``radiance`` (camera rays, 3), ``doubtful``, ``tally``: changed.
    ``rays``, ShadowRays of `MOST_SHADOW_RAYS` rows, scratch. If paths advance together: of as many for each path,
    or `FEW_SHADOW_RAYS`, written; their contributions are not added yet.
    ``out``: then also written, 2 n rows; n, if no path is divided.
    Returns the rows written of ``rays`` and ``out``, and how many paths were followed: all, or those before
    ``doubtful`` had no room for what one may add.
    """
    ray, path, branch, waiting, depth_of_waiting, vertex, points = scratch
    # A literal 0 has a type of its own, for which `depart` would be compiled again.
    n_rays = n_out = np.int64(0)
    room = doubtful.source_id.size - (rules.max_depth + 2) * (depth_of_waiting.size + 1)
    end = block.pixel.size if rules.follows else paths.camera_ray.size
    for i in range(begin, end):
        column = i % RUN_ACROSS
        if rules.follows:
            if doubtful.n[0] > room:
                return n_rays, n_out, i
            _leave_camera(block, i, path)
        else:
            if column == 0:
                draw_across(rules, depth, paths.pixel, paths.sample, i, points)
            copy_path(paths, i, path, 0)
        has_arrived = arrival.hits.t.size > 0
        if has_arrived:
            _copy_arrival(arrival, i, vertex)
        pdf_area = arrival.pdf_area[i] if arrival.pdf_area.size else 0.0
        at, n_waiting, is_new = depth, 0, True
        while True:
            # --- where the ray arrives
            if not has_arrived:
                for k in range(3):
                    ray.rays.origin[0, k] = path.origins[0, k]
                first_hit(single, path.source_id[0], path.directions, ray)
                _count(ray, path, at, doubtful, tally)
            has_arrived = False
            _interpolate(world.meshes, path, vertex)
            # --- what the way there absorbed; light it ran into
            goes_on = arrive(world, rules, path, vertex, at, pdf_area, radiance, tally)
            if goes_on:
                if rules.follows:
                    column = at % RUN_ALONG
                    if column == 0 or is_new:
                        draw_along(rules, at - column, path.pixel[0], path.sample[0], points)
                        is_new = False
                # --- direct light; where it goes next, and whether it stops
                fate, n_rays, has_branch = depart(
                    world, rules, path, vertex, at, block, points, column, branch, rays, n_rays,
                    tally,
                )  # fmt: skip
                goes_on = fate >= SCATTERED
                at += 1
                if rules.follows:
                    _add_unblocked(single, rays, n_rays, ray, radiance, tally)
                    n_rays = np.int64(0)
                    if has_branch:
                        copy_path(branch, 0, waiting, n_waiting)
                        depth_of_waiting[n_waiting] = at
                        n_waiting += 1
                else:
                    if goes_on:
                        copy_path(path, 0, out, n_out)
                        n_out += 1
                    if has_branch:
                        copy_path(branch, 0, out, n_out)
                        n_out += 1
            if not rules.follows:
                break
            # --- where a branch has ended: the next one
            if not goes_on:
                if n_waiting == 0:
                    break
                n_waiting -= 1
                copy_path(waiting, n_waiting, path, 0)
                at, is_new = depth_of_waiting[n_waiting], True
    return n_rays, n_out, end


@inlined
def _leave_camera(block, i, path):
    path.camera_ray[0] = i
    path.pixel[0], path.sample[0] = block.pixel[i], block.sample[i]
    path.pdf[0] = path.carried[0] = 0.0
    path.splits[0] = MOST_SPLITS
    if path.connection_pdf.size:
        path.connection_pdf[0] = 0.0
        path.joined[0] = path.has_met_wide[0] = False
    if path.chain.size:
        path.chain[0] = OTHER
    path.source_id[0] = NOTHING
    for k in range(3):
        path.origins[0, k] = block.origins[i, k]
        path.directions[0, k] = block.directions[i, k]
        path.throughput[0, k] = 1.0
    for k in range(block.media.size):
        path.media[0, k] = block.media[k]


@inlined
def _copy_arrival(arrival, i, vertex):
    hits, second, light_points, _ = arrival
    hit = vertex.hit
    hit.t[0], hit.u[0], hit.v[0] = hits.t[i], hits.u[i], hits.v[i]
    hit.object_id[0], hit.front_face[0] = hits.object_id[i], hits.front_face[i]
    hit.patch_id[0] = hits.patch_id[i]
    for k in range(3):
        hit.position[0, k], hit.normal[0, k] = hits.position[i, k], hits.normal[i, k]
    if second.size:
        vertex.second[0] = second[i]
    point = vertex.light_point
    if light_points.pdf_area.size:
        point.pdf_area[0] = light_points.pdf_area[i]
        point.u[0], point.v[0] = light_points.u[i], light_points.v[i]
        for k in range(3):
            point.position[0, k] = light_points.position[i, k]
            point.normal[0, k] = light_points.normal[i, k]


@inlined
def _interpolate(meshes, path, vertex):
    """Shade by vertex normals; turn (u, v) into where textures are looked up: nothing else reads it."""
    hit = vertex.hit
    object_id, patch_id, u, v = hit.object_id[0], hit.patch_id[0], hit.u[0], hit.v[0]
    if vertex.geometric.shape[0]:
        for k in range(3):
            vertex.geometric[0, k] = hit.normal[0, k]
        hit.normal[0, 0], hit.normal[0, 1], hit.normal[0, 2] = shading_normal(
            meshes, object_id, patch_id, u, v, path.directions[0], vertex.geometric[0]
        )
    hit.u[0], hit.v[0] = texture_point(meshes, object_id, patch_id, u, v)


@inlined
def _add_unblocked(single, rays, n, ray, radiance, tally):
    """Trace n shadow rays; add the values of those that nothing blocks."""
    is_blocked = False
    for k in range(n):
        if not (rays.follows[k] and is_blocked):
            is_blocked = is_occluded(single, rays, k, ray)
            tally.shadow[0] += 1
        if not is_blocked:
            for c in range(3):
                radiance[rays.camera_ray[k], c] += rays.value[k, c]


@inlined
def _count(ray, path, depth, doubtful, tally):
    """Count a first hit, or keep its ray to be counted later."""
    hit = ray.record
    if ray.best.tangent[0] != SUSPECT:
        tally.status[hit.status[0]] += 1
        if hit.object_id[0] >= 0:
            tally.hits[0] += 1
            if depth == 0:
                tally.hits[1] += 1
                if hit.t_bound[0] < np.inf:
                    tally.bound[0] = max(tally.bound[0], hit.t_bound[0])
                else:
                    tally.hits[2] += 1
        return
    n = doubtful.n[0]
    doubtful.n[0] = n + 1
    doubtful.source_id[n] = path.source_id[0]
    for k in range(3):
        doubtful.origin[n, k] = path.origins[0, k]
        doubtful.direction[n, k] = path.directions[0, k]
