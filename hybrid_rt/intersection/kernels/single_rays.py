"""First hits and shadows of one ray at a time.

A path that is followed to its end asks for one ray, then for the next. Spheres, rectangles, planes and boxes
that are asked by all rays are asked here; the kernels of other kinds are called, if the ray comes near them.
Hits have the same bits as those of `hybrid_rt.intersection.intersector.Intersector`.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.box import finish_box, offer_box
from hybrid_rt.intersection.kernels.plane import finish_plane, offer_plane
from hybrid_rt.intersection.kernels.rectangle import finish_rectangle, offer_parallelograms
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
# What the calls of another kind are for.
FIRST, ANY, DESCRIBE = 0, 1, 2
# A kind is asked where the ray comes this near to its box, of the way there; the band is far narrower.
NEAR = 2.0**-38
# Less of a direction counts as so much.
STEEPEST = 1e-30


class SingleRays(NamedTuple):
    """All surfaces of a scene; a table may have no rows."""

    spheres: Any  # SphereTable
    rectangles: Any  # RectangleTable
    planes: Any  # PlaneTable
    boxes: Any  # BoxTable
    # (objects,) int64: one of the constants above; from 4 on those of other kinds
    kind_of: Any
    row_of: Any  # (objects,) int64, row in the table of its kind
    call: Any  # (n,) int64, see `hybrid_rt.intersection.single_rays`
    first_call: Any  # (others, 4) int64: where those for each purpose begin
    box: Any  # (others, 2, 3) float64, what surrounds each kind by some distance
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


@inlined
def _comes_near(box, rays, t_best):
    """Tell whether the ray comes near a box before ``t_best``; plain sums will do for that."""
    o, d, near, far = rays.origin[0], rays.direction[0], 0.0, t_best
    margin = NEAR * max(abs(o[0]), abs(o[1]), abs(o[2]))
    for k in range(3):
        step = d[k] if abs(d[k]) > STEEPEST else STEEPEST
        first, last = (box[0, k] - margin - o[k]) / step, (box[1, k] + margin - o[k]) / step
        near, far = max(near, min(first, last)), min(far, max(first, last))
    return near <= far


@inlined
def _call(single, k, purpose):
    """Call the kernels of kind k among the others."""
    for c in range(single.first_call[k, purpose], single.first_call[k, purpose + 1]):
        call_stored(single.call[c])


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
    for k in range(single.first_call.shape[0]):
        if _comes_near(single.box[k], rays, best.t[0]):
            _call(single, k, FIRST)
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
            _call(single, kind - BOX - 1, DESCRIBE)
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
    for k in range(single.first_call.shape[0]):
        if _comes_near(single.box[k], rays, best.t[0]):
            _call(single, k, ANY)
            if best.object_id[0] >= 0:
                return True
    return False
