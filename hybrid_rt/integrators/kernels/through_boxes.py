"""Next-event estimation through boxes of glass: panes, cubes, and from within them.

A way enters by one face and leaves by the opposite one, or it begins inside and leaves by one face
(`hybrid_rt.integrators.kernels.plate_optics`). Ways by two faces that are not opposite, and those that
are reflected, are left to chance. The estimator is that of `hybrid_rt.integrators.kernels.ways`.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.plate_optics import (
    section_through,
    start_factor,
    tangent_through,
)
from hybrid_rt.integrators.kernels.ways import (
    BEFORE,
    INSIDE,
    PDF,
    SMALL,
    WITHIN,
    add_last_segment,
    add_segment,
    brought,
    end_of_way,
    left_by,
    reflectance_of,
)
from hybrid_rt.shading.kernels.medium_stack import IOR
from meshing.kernels.jit import inlined, inner

# Ways through one box: by up to three faces that the light is seen from; each has up to three rays.
MOST_RAYS = 3 * 3
# How far outside of a box, over its width, a point on its faces may lie by rounding.
ROUNDING = 1e-9


class Boxes(NamedTuple):
    """Boxes of clear glass, of a colour that is the same everywhere; faces -x, +x, -y, ... of each."""

    corner: Any  # (n, 3) float64
    # (n, 3, 3) float64, rows: what a vector from the corner is multiplied by for its coordinates
    # along the edges, in [0, 1] inside
    along: Any
    across: Any  # (n, 3, 3) float64, rows: unit normals of the upper faces, outward
    thickness: Any  # (n, 3) float64, between opposite faces
    center: Any  # (n, 3) float64
    square: Any  # (n,) float64, square of the radius of the sphere about the box
    surface: Any  # (n,) int32, index of the surface
    lobe: Any  # (n,) int32
    tint: Any  # (n, 3) float64, of one passage through the surface
    is_open: Any  # (n, 6) bool, no other surface may touch the face
    of_surface: Any  # (surfaces,) int32, row; -1: another surface


@inlined
def _coordinate(boxes, box, axis, x, y, z):
    """Return the coordinate of a point along an edge of a box."""
    row, corner = boxes.along, boxes.corner
    return (
        row[box, axis, 0] * (x - corner[box, 0])
        + row[box, axis, 1] * (y - corner[box, 1])
        + row[box, axis, 2] * (z - corner[box, 2])
    )


@inlined
def box_around(boxes, lobe, x, y, z):
    """Return the box of this lobe that a point lies in; -1: none."""
    for box in range(boxes.lobe.size):
        if boxes.lobe[box] != lobe:
            continue
        is_within = True
        for axis in range(3):
            c = _coordinate(boxes, box, axis, x, y, z)
            is_within &= -ROUNDING <= c <= 1.0 + ROUNDING
        if is_within:
            return box
    return -1


@inlined
def face_of(boxes, box, normal, position):
    """Return the face of a box that a hit lies on."""
    axis, most = 0, 0.0
    for k in range(3):
        n = boxes.across
        cosine = abs(
            n[box, k, 0] * normal[0, 0] + n[box, k, 1] * normal[0, 1] + n[box, k, 2] * normal[0, 2]
        )
        if cosine > most:
            axis, most = k, cosine
    c = _coordinate(boxes, box, axis, position[0, 0], position[0, 1], position[0, 2])
    return 2 * axis + (1 if c > 0.5 else 0)


@inlined
def _square_seen(boxes, box, x, y, z):
    """Return (radius / distance of the centre)^2 of the sphere about a box, at most 1."""
    dx, dy, dz = x - boxes.center[box, 0], y - boxes.center[box, 1], z - boxes.center[box, 2]
    return boxes.square[box] / max(dx * dx + dy * dy + dz * dz, boxes.square[box])


@inlined
def _sum_of_squares(boxes, x, y, z):
    """Return what `_square_seen` is divided by: a box's chance of being asked from outside."""
    total = 0.0
    for box in range(boxes.lobe.size):
        total += _square_seen(boxes, box, x, y, z)
    return max(total, SMALL)


@inlined
def _choose_box(boxes, x, y, z, s):
    """Choose a box by s; return it, its chance, and s made even again; -1: none."""
    total = _sum_of_squares(boxes, x, y, z)
    left = s * total
    for box in range(boxes.lobe.size):
        square = _square_seen(boxes, box, x, y, z)
        if left < square:
            return box, square / total, min(left / square, 1.0 - 2.0**-53)
        left -= square
    return -1, 0.0, 0.0


@inlined
def _passed_on(world, box, cos_o, is_inside):
    """Return the part of light that the faces let through, without colour, and the inner cosine."""
    reflectance, cos_i = reflectance_of(world.lobes, world.boxes.lobe[box], cos_o)
    part = 1.0 - reflectance
    return (part if is_inside else part * part), cos_i


@inlined
def _section(outside, inside, cos_o, cos_i, ior, is_inside):
    """Return what converts densities: see `hybrid_rt.integrators.kernels.ways`."""
    if outside < math.inf:
        return section_through(outside, inside, cos_o, cos_i, ior, is_inside)
    return start_factor(cos_o, cos_i, ior, is_inside) / cos_o


@inlined
def pdf_by_box(world, paths, box, face, t, is_inside):
    """Return the densities of a way through a box that a path has found: by BSDF sampling, if asked.

    The pdfs are those of `hybrid_rt.integrators.kernels.ways`, the second without the lamp's; both
    are zero where the box is not asked.

    Parameters
    ----------
    world : World
    paths : Paths of one row
        The ray that has met the light.
    box, face : int
        By which it has left.
    t : float
        Distance of the light; inf: the sky.
    is_inside : bool
        Whether the way began in the box.
    """
    boxes, anchor, axis = world.boxes, paths.anchor, face // 2
    cos_o = 0.0
    for k in range(3):
        cos_o += boxes.across[box, axis, k] * paths.directions[0, k]
    cos_o = min(abs(cos_o), 1.0)
    part, cos_i = _passed_on(world, box, cos_o, is_inside)
    if cos_o == 0.0 or cos_i == 0.0:
        return 0.0, 0.0
    ior = world.lobes.number[boxes.lobe[box], IOR]
    outside = t if is_inside else t + anchor[0, BEFORE]
    section = _section(outside, anchor[0, WITHIN], cos_o, cos_i, ior, is_inside)
    chance = 1.0
    if not is_inside:
        x, y, z = anchor[0, 0], anchor[0, 1], anchor[0, 2]
        chance = _square_seen(boxes, box, x, y, z) / _sum_of_squares(boxes, x, y, z)
    return anchor[0, PDF] * part, section * chance


@inlined
def _is_on_face(boxes, box, axis, x, y, z):
    """Tell whether a point in the plane of a face lies on it."""
    for k in range(1, 3):
        c = _coordinate(boxes, box, (axis + k) % 3, x, y, z)
        if not 0.0 < c < 1.0:
            return False
    return True


@inner
def ask_through_boxes(world, rules, paths, vertex, vertices, depth, light, s, t, rays, n):
    """Sample a point of a lamp, or a direction of the sky, and reach for it through a box.

    Parameters are those of `ask_through_spheres`.
    """
    boxes = world.boxes
    at = vertex.hit.position
    px, py, pz = at[0, 0], at[0, 1], at[0, 2]
    box, chance = int(paths.anchor[0, INSIDE]), 1.0
    is_inside = box >= 0
    if not is_inside:
        box, chance, s = _choose_box(boxes, px, py, pz, s)
        if box < 0 or depth + 2 >= rules.max_depth:
            return n
    ex, ey, ez, lx, ly, lz, pdf, er, eg, eb = end_of_way(world, vertex, light, s, t)
    if pdf == 0.0 or max(er, eg, eb) <= 0.0:
        return n
    end = (ex, ey, ez, lx, ly, lz, pdf * chance, er, eg, eb)
    is_sky = light == world.lights.kind.size
    surface, lobe = boxes.surface[box], boxes.lobe[box]
    ior = world.lobes.number[lobe, IOR]
    for face in range(6):
        # --- does the light leave by this face, and enter by the opposite one, if any?
        axis, opposite = face // 2, face ^ 1
        if not boxes.is_open[box, face] or not (is_inside or boxes.is_open[box, opposite]):
            continue
        sign, thickness = (1.0 if face > opposite else -1.0), boxes.thickness[box, axis]
        nx, ny, nz = (
            sign * boxes.across[box, axis, 0],
            sign * boxes.across[box, axis, 1],
            sign * boxes.across[box, axis, 2],
        )
        depth_here = _coordinate(boxes, box, axis, px, py, pz)
        # Over the thickness, from the face inward.
        depth_here = 1.0 - depth_here if face > opposite else depth_here
        before = 0.0
        if is_inside:
            inside = max(depth_here, 0.0) * thickness
        else:
            inside, before = thickness, (depth_here - 1.0) * thickness
        if before < 0.0 or (is_inside and inside == 0.0):
            continue
        # --- the sine outside, as a vector along the face
        if is_sky:
            cos_o = ex * nx + ey * ny + ez * nz
            sx, sy, sz = ex - cos_o * nx, ey - cos_o * ny, ez - cos_o * nz
        else:
            gap = _coordinate(boxes, box, axis, ex, ey, ez)
            gap = (gap - 1.0 if face > opposite else -gap) * thickness
            if gap <= 0.0:
                continue
            x, y, z = ex - px, ey - py, ez - pz
            up = x * nx + y * ny + z * nz
            x, y, z = x - up * nx, y - up * ny, z - up * nz
            across = math.sqrt(x * x + y * y + z * z)
            tangent = tangent_through(before + gap, inside, across, ior)
            cos_o = 1.0 / math.sqrt(1.0 + tangent * tangent)
            factor = tangent * cos_o / across if across > 0.0 else 0.0
            sx, sy, sz = factor * x, factor * y, factor * z
        if cos_o <= 0.0:
            continue
        part, cos_i = _passed_on(world, box, cos_o, is_inside)
        if cos_i <= 0.0:
            continue
        # --- where the way meets the faces
        a, b = before / cos_o, inside / (ior * cos_i)
        mx, my, mz = px + before * nx + a * sx, py + before * ny + a * sy, pz + before * nz + a * sz
        ox, oy, oz = mx + inside * nx + b * sx, my + inside * ny + b * sy, mz + inside * nz + b * sz
        if not _is_on_face(boxes, box, axis, ox, oy, oz):
            continue
        if not is_inside and not _is_on_face(boxes, box, axis, mx, my, mz):
            continue
        # --- what it brings
        fx, fy, fz, length, cos_lamp = ex, ey, ez, math.inf, 1.0
        if not is_sky:
            fx, fy, fz = ex - ox, ey - oy, ez - oz
            length = math.sqrt(fx * fx + fy * fy + fz * fz)
            cos_lamp = -(lx * fx + ly * fy + lz * fz) / length
            if cos_lamp <= 0.0:
                continue
        chord = inside / cos_i
        section = _section(length + a, chord, cos_o, cos_i, ior, is_inside)
        cosine, ratio, scale, passages = cos_o, 1.0, 1.0, 2
        if is_inside:
            # Radiance grows with the square of the index on the way in.
            cosine, ratio, scale, passages = cos_i, 1.0 / ior, ior * ior, 1
        r, g, b = brought(
            world, paths, vertices,
            cosine * nx + ratio * sx, cosine * ny + ratio * sy, cosine * nz + ratio * sz,
            end, cos_lamp, part, section,
        )  # fmt: skip
        tr, tg, tb = left_by(world.lobes, lobe, chord)
        r *= scale * tr * boxes.tint[box, 0] ** passages
        g *= scale * tg * boxes.tint[box, 1] ** passages
        b *= scale * tb * boxes.tint[box, 2] ** passages
        if max(r, g, b) <= 0.0:
            continue
        # --- nothing may stand in the way
        here = vertex.hit.object_id[0]
        if is_inside:
            add_segment(paths, rays, n, here, px, py, pz, surface, ox, oy, oz, False)
        else:
            add_segment(paths, rays, n, here, px, py, pz, surface, mx, my, mz, False)
            n += 1
            add_segment(paths, rays, n, surface, mx, my, mz, surface, ox, oy, oz, True)
        add_last_segment(world, paths, rays, n + 1, surface, ox, oy, oz, light, end, r, g, b)
        n += 2
    return n
