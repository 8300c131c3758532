"""Camera paths, each followed to its end, where all surfaces are closed forms.

Against batches this saves what passes through memory between kernels; docs/light.md says how much
time that is.
"""

import numpy as np

from hybrid_rt.integrators.kernels.branches import MOST_SPLITS, copy_path
from hybrid_rt.integrators.kernels.path_vertex import NOTHING, arrive, depart
from hybrid_rt.integrators.kernels.vertex_points import RUN_ALONG, draw_along
from hybrid_rt.integrators.kernels.ways import OTHER
from hybrid_rt.intersection.kernels.closed_forms import first_hit, is_occluded
from hybrid_rt.shading.kernels.scatter import SCATTERED
from meshing.kernels.jit import inlined, kernel


@kernel
def follow_paths(
    world, rules, block, media, forms, ray, path, branch, waiting, depth_of_waiting, vertex,
    points, rays, radiance, tally,
):  # fmt: skip
    """Follow the path of each camera ray to its end; all surfaces are closed forms.

    Parameters
    ----------
    world : World
    rules : Rules
    block : Block of n rows
    media : (STACK,) int32, or (0,)
        Medium stack of the camera.
    forms : ClosedForms
    ray : OneRay, scratch
    path, branch : Paths of one row, scratch
    waiting : Paths of MOST_SPLITS rows, scratch
    depth_of_waiting : (MOST_SPLITS,) int64, scratch
    vertex : Vertex, scratch
        Its ``hit`` is ``ray.record``.
    points : RunPoints of RUN_ALONG vertices, scratch
    rays : ShadowRays, scratch
    radiance : (n, 3) float64, changed
    tally : Tally, changed
    """
    for i in range(block.pixel.size):
        _leave_camera(block, i, media, path)
        depth, n_waiting, is_new = 0, 0, True
        while True:
            # --- where the last branch ended: the next one
            if depth > rules.max_depth + 1:
                if n_waiting == 0:
                    break
                n_waiting -= 1
                copy_path(waiting, n_waiting, path, 0)
                depth, is_new = depth_of_waiting[n_waiting], True
            # --- where the ray arrives
            for k in range(3):
                ray.rays.origin[0, k] = path.origins[0, k]
            first_hit(forms, path.source_id[0], path.directions, ray)
            _count(vertex.hit, depth, tally)
            # --- what the way there absorbed; light it ran into
            if not arrive(world, rules, path, vertex, depth, 0.0, radiance, tally):
                depth = rules.max_depth + 2
                continue
            # --- direct light; where it goes next, and whether it stops
            column = depth % RUN_ALONG
            if column == 0 or is_new:
                draw_along(rules, depth - column, path.pixel[0], path.sample[0], points)
                is_new = False
            # A literal 0 has a type of its own, for which all parts would be compiled again.
            n_rays = np.int64(0)
            fate, n, has_branch = depart(
                world, rules, path, vertex, depth, block, points, column, branch, rays, n_rays,
                tally,
            )  # fmt: skip
            is_blocked = False
            for k in range(n):
                if not (rays.follows[k] and is_blocked):
                    is_blocked = is_occluded(forms, rays, k, ray)
                    tally.shadow[0] += 1
                if not is_blocked:
                    for c in range(3):
                        radiance[i, c] += rays.value[k, c]
            if has_branch:
                copy_path(branch, 0, waiting, n_waiting)
                depth_of_waiting[n_waiting] = depth + 1
                n_waiting += 1
            depth = depth + 1 if fate >= SCATTERED else rules.max_depth + 2


@inlined
def _leave_camera(block, i, media, path):
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
    for k in range(media.size):
        path.media[0, k] = media[k]


@inlined
def _count(hit, depth, tally):
    tally.status[hit.status[0]] += 1
    if hit.object_id[0] < 0:
        return
    tally.hits[0] += 1
    if depth == 0:
        tally.hits[1] += 1
        if hit.t_bound[0] < np.inf:
            tally.bound[0] = max(tally.bound[0], hit.t_bound[0])
        else:
            tally.hits[2] += 1
