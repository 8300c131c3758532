"""First hits and shadows of one ray at a time, on surfaces that are all closed forms.

A path that is followed to its end asks for one ray, then for the next. Where a surface has no coarse
stage and no tree this costs no more than a batch does, and nothing is passed through memory. Hits
have the same bits as those of `hybrid_rt.intersection.intersector.Intersector`.
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

SPHERE, RECTANGLE, PLANE, BOX = 0, 1, 2, 3


class ClosedForms(NamedTuple):
    """All surfaces of a scene, if they are of these kinds; a table may have no rows."""

    spheres: Any  # SphereTable
    rectangles: Any  # RectangleTable
    planes: Any  # PlaneTable
    boxes: Any  # BoxTable
    kind_of: Any  # (objects,) int64, one of the constants above
    row_of: Any  # (objects,) int64, row in the table of its kind
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
def first_hit(forms, source_id, direction, ray):
    """Find the first hit of the ray from ``ray.rays.origin[0]`` along ``direction[0]``.

    ``source_id`` is the object that it leaves from, -1: none. ``ray.record`` is written.
    """
    rays, best = ray.rays, ray.best
    unit = _start(direction, 0, np.inf, ray)
    if source_id >= 0:
        rays.known[0, 0], rays.known[0, 1] = name_point(
            rays.origin, rays.direction, 0, source_id, rays.origin, 0, forms.reach,
            forms.rounding, forms.most,
        )  # fmt: skip
    offer_spheres(0, 0, forms.spheres.object_id.size, forms.spheres, rays, best, False)
    offer_parallelograms(0, forms.rectangles.object_id.size, forms.rectangles, rays, best, False)
    for k in range(forms.planes.object_id.size):
        offer_plane(0, k, forms.planes, rays, best)
    for k in range(forms.boxes.object_id.size):
        offer_box(0, k, forms.boxes, rays, best)
    if best.object_id[0] >= 0:
        k, kind = forms.row_of[best.object_id[0]], forms.kind_of[best.object_id[0]]
        if kind == SPHERE:
            finish_sphere(forms.spheres, k, rays, best, 0, ray.out)
        elif kind == RECTANGLE:
            finish_rectangle(forms.rectangles, k, rays, best, 0, ray.out)
        elif kind == PLANE:
            finish_plane(forms.planes, k, rays, best, 0, ray.out)
        else:
            finish_box(forms.boxes, k, rays, best, 0, ray.out)
    complete_row(0, rays.direction, unit, best, ray.record)


@inlined(cached=True)
def is_occluded(forms, shadow, i, ray):
    """Tell whether anything lies on shadow ray i, a row of `ShadowRays`."""
    rays, best = ray.rays, ray.best
    for c in range(3):
        rays.origin[0, c] = shadow.origin[i, c]
    _start(shadow.way, i, shadow.t_max[i], ray)
    rays.known[0, 0], rays.known[0, 1] = name_point(
        rays.origin, rays.direction, 0, shadow.source_id[i], rays.origin, 0, forms.reach,
        forms.rounding, forms.most,
    )  # fmt: skip
    if shadow.target_id[i] >= 0:
        rays.known[0, 2], rays.known[0, 3] = name_point(
            rays.origin, rays.direction, 0, shadow.target_id[i], shadow.end, i, forms.reach,
            forms.rounding, forms.most,
        )  # fmt: skip
    offer_spheres(0, 0, forms.spheres.object_id.size, forms.spheres, rays, best, True)
    if best.object_id[0] >= 0:
        return True
    offer_parallelograms(0, forms.rectangles.object_id.size, forms.rectangles, rays, best, True)
    if best.object_id[0] >= 0:
        return True
    for k in range(forms.planes.object_id.size):
        offer_plane(0, k, forms.planes, rays, best)
        if best.object_id[0] >= 0:
            return True
    for k in range(forms.boxes.object_id.size):
        offer_box(0, k, forms.boxes, rays, best)
        if best.object_id[0] >= 0:
            return True
    return False
