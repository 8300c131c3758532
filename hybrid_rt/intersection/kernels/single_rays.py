"""First hits and shadows of one ray at a time.

A path that is followed to its end asks for one ray, then for the next. Spheres, rectangles, planes and boxes
that are asked by all rays are asked here; what is in other tables and trees is found by calls of kernels, if the
ray comes near it.
Hits have the same bits as those of `hybrid_rt.intersection.intersector.Intersector`.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.box import finish_box, offer_box
from hybrid_rt.intersection.kernels.plane import finish_plane, offer_plane
from hybrid_rt.intersection.kernels.rectangle import finish_rectangle, offer_parallelograms
from hybrid_rt.intersection.kernels.search.bottoms import ask_each
from hybrid_rt.intersection.kernels.search.nearest import CLEAR
from hybrid_rt.intersection.kernels.search.rays import (
    complete_row,
    name_point,
    scale_ray,
    scaled_limit,
)
from hybrid_rt.intersection.kernels.sphere import finish_sphere, offer_spheres
from meshing.kernels.jit import inlined
from meshing.kernels.stored_calls import call_stored

SPHERE, RECTANGLE, PLANE, BOX = 0, 1, 2, 3


class SingleRays(NamedTuple):
    """All surfaces of a scene; a table may have no rows."""

    spheres: Any  # SphereTable
    rectangles: Any  # RectangleTable
    planes: Any  # PlaneTable
    boxes: Any  # BoxTable
    # (objects,) int64: one of the constants above; from 4 on those of other kinds
    kind_of: Any
    row_of: Any  # (objects,) int64, row in the table of its kind
    call: Any  # (n,) int64: calls that describe hits on the other kinds
    first_call: Any  # (others + 1,) int64: where those of each kind begin
    bottoms: Any  # Bottoms: calls that find hits on them
    reach: Any  # (objects,) float64, see `name_points`
    rounding: Any  # float, see `name_points`
    most: Any  # float, see `name_points`


class OneRay(NamedTuple):
    """Scratch memory of one ray, arrays of one row."""

    rays: Any  # Rays, with ``known`` (1, 6)
    best: Any  # Nearest
    record: Any  # Record
    out: Any  # Finished, arrays of the record


@inlined
def _start(direction, i, t_max, ray):
    """Take ray i's direction; return the factor on t. Nothing is known of it."""
    unit = scale_ray(direction, i, ray.rays.direction, 0)
    best = ray.best
    best.t[0] = scaled_limit(t_max, unit)
    best.t_bound[0] = 0.0
    best.object_id[0] = -1
    best.primitive[0] = 0
    best.a[0] = best.b[0] = 0.0
    best.tangent[0] = CLEAR
    best.doubt[0] = np.inf
    ray.rays.known[0, 0] = ray.rays.known[0, 2] = 0.0
    ray.rays.known[0, 1] = ray.rays.known[0, 3] = ray.rays.known[0, 4] = -1.0
    ray.rays.known[0, 5] = np.nan
    return unit


@inlined(cached=True)
def first_hit(single, source_id, direction, ray):
    """Find the first hit of the ray from ``ray.rays.origin[0]`` along ``direction[0]``.

    ``source_id`` is the object that it leaves from, -1: none. ``ray.record`` is written.
    """
    rays, best = ray.rays, ray.best
    unit = _start(direction, 0, np.inf, ray)
    ray.record.flags[0] = 0
    if source_id >= 0:
        rays.known[0, 0], rays.known[0, 1] = name_point(
            rays.origin, rays.direction, 0, source_id, rays.origin, 0, single.reach,
            single.rounding, single.most,
        )  # fmt: skip
    offer_spheres(0, 0, single.spheres.object_id.size, single.spheres, rays, best, False)
    offer_parallelograms(0, single.rectangles.object_id.size, single.rectangles, rays, best, False)
    for k in range(single.planes.object_id.size):
        offer_plane(0, k, single.planes, rays, best)
    for k in range(single.boxes.object_id.size):
        offer_box(0, k, single.boxes, rays, best)
    ask_each(single.bottoms, rays, best, False)
    if best.object_id[0] >= 0:
        k, kind = single.row_of[best.object_id[0]], single.kind_of[best.object_id[0]]
        if kind == SPHERE:
            finish_sphere(single.spheres, k, rays, best, 0, ray.out)
        elif kind == RECTANGLE:
            finish_rectangle(single.rectangles, k, rays, best, 0, ray.out)
        elif kind == PLANE:
            finish_plane(single.planes, k, rays, best, 0, ray.out)
        elif kind == BOX:
            finish_box(single.boxes, k, rays, best, 0, ray.out)
        else:
            for c in range(single.first_call[kind - BOX - 1], single.first_call[kind - BOX]):
                call_stored(single.call[c])
    complete_row(0, rays.direction, unit, best, ray.record)


@inlined(cached=True)
def is_occluded(single, shadow, i, ray):
    """Tell whether anything lies on shadow ray i, a row of `ShadowRays`."""
    rays, best = ray.rays, ray.best
    for c in range(3):
        rays.origin[0, c] = shadow.origin[i, c]
    _start(shadow.way, i, shadow.t_max[i], ray)
    rays.known[0, 0], rays.known[0, 1] = name_point(
        rays.origin, rays.direction, 0, shadow.source_id[i], rays.origin, 0, single.reach,
        single.rounding, single.most,
    )  # fmt: skip
    if shadow.target_id[i] >= 0:
        rays.known[0, 2], rays.known[0, 3] = name_point(
            rays.origin, rays.direction, 0, shadow.target_id[i], shadow.end, i, single.reach,
            single.rounding, single.most,
        )  # fmt: skip
    offer_spheres(0, 0, single.spheres.object_id.size, single.spheres, rays, best, True)
    if best.object_id[0] >= 0:
        return True
    offer_parallelograms(0, single.rectangles.object_id.size, single.rectangles, rays, best, True)
    if best.object_id[0] >= 0:
        return True
    for k in range(single.planes.object_id.size):
        offer_plane(0, k, single.planes, rays, best)
        if best.object_id[0] >= 0:
            return True
    for k in range(single.boxes.object_id.size):
        offer_box(0, k, single.boxes, rays, best)
        if best.object_id[0] >= 0:
            return True
    ask_each(single.bottoms, rays, best, True)
    return best.object_id[0] >= 0
