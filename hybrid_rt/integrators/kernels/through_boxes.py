"""Next-event estimation through boxes of glass: panes, cubes, and from within them.

A way enters by one face and leaves by the opposite one, or it begins inside and leaves by one face
(`hybrid_rt.integrators.kernels.plate_optics`). On its way to the sky it may be reflected totally at the
sides. There it goes on in the mirror image of the box as if there were no face; each pair of sides
gives back the direction, or its mirror image, so the direction in which a way begins is one of four.
Ways by two faces that are not opposite, those that are reflected in part, and those to lamps that are
reflected, are left to chance. The estimator is that of `hybrid_rt.integrators.kernels.ways`.
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
    MIRRORED,
    PDF,
    WITHIN,
    WITHIN_BOX,
    add_last_segment,
    add_segment,
    brought,
    chance_of_body,
    choose_body,
    end_of_way,
    factor_of_taken,
    left_by,
    reflectance_of,
    take_way,
)
from hybrid_rt.shading.kernels.medium_stack import IOR
from meshing.kernels.jit import inlined, inner

# Total reflections of a way.
MOST_MIRRORED = 3
# Rays of one way: before the box, behind it, and one more inside than reflections.
MOST_RAYS = MOST_MIRRORED + 3
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
    is_right: Any  # (n,) bool, the edges are at right angles
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
def _coordinate_step(boxes, box, axis, v):
    """Return by how much a vector changes the coordinate along an edge of a box."""
    row = boxes.along
    return row[box, axis, 0] * v[0] + row[box, axis, 1] * v[1] + row[box, axis, 2] * v[2]


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
    """Return the pdfs of a path through a box: by BSDF sampling, and by this technique.

    The pdfs are those of `hybrid_rt.integrators.kernels.ways`, the second without the lamp's; both
    are zero where the box is not sampled.

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
    if anchor[0, MIRRORED] > 0.0 and t < math.inf:
        return 0.0, 0.0
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
        chance = chance_of_body(boxes, box, WITHIN_BOX, x, y, z)
    return anchor[0, PDF] * part, section * chance


@inlined
def is_mirrored_inside(world, box, cosine):
    """Tell whether a box with right angles reflects a ray totally, by the cosine to the normal inside."""
    ior = world.lobes.number[world.boxes.lobe[box], IOR]
    return world.boxes.is_right[box] and ior * ior * (1.0 - cosine * cosine) >= 1.0


@inlined
def _reflections(boxes, box, axis, start, step):
    """Return how often a way is reflected at the faces across an axis; -1: at one that is not open.

    It goes from coordinate ``start`` on by ``step``, as if there were no faces.
    """
    end = math.floor(start + step)
    first = 2 * axis + (1 if end > 0.0 else 0)
    if end != 0.0 and not boxes.is_open[box, first]:
        return -1
    if abs(end) > 1.0 and not boxes.is_open[box, first ^ 1]:
        return -1
    return int(min(abs(end), MOST_MIRRORED + 1.0))


@inlined
def _folded(c):
    """Return the coordinate in [0, 1] of which c is a mirror image."""
    c -= 2.0 * math.floor(0.5 * c)
    return c if c <= 1.0 else 2.0 - c


@inlined
def _where(boxes, box, axis, a, b, c):
    """Return the point of a box with coordinate a along an axis, and b and c along the next ones."""
    j, k = (axis + 1) % 3, (axis + 2) % 3
    n, corner = boxes.across, boxes.corner
    a *= boxes.thickness[box, axis]
    b *= boxes.thickness[box, j]
    c *= boxes.thickness[box, k]
    return (
        corner[box, 0] + a * n[box, axis, 0] + b * n[box, j, 0] + c * n[box, k, 0],
        corner[box, 1] + a * n[box, axis, 1] + b * n[box, j, 1] + c * n[box, k, 1],
        corner[box, 2] + a * n[box, axis, 2] + b * n[box, j, 2] + c * n[box, k, 2],
    )


@inlined
def _normal(boxes, box, face):
    """Return the outward normal of a face."""
    sign = 1.0 if face & 1 == 1 else -1.0
    n, axis = boxes.across, face // 2
    return sign * n[box, axis, 0], sign * n[box, axis, 1], sign * n[box, axis, 2]


@inlined
def _across_face(world, box, face, at, end, is_sky, is_inside):
    """Find the way by a face to the light, as if the box had no sides.

    Returns its lengths across the face, outside and inside of the box; the cosine to the normal
    outside, 0 if there is no way; and the sine there, as a vector along the face.
    """
    boxes, axis, is_upper = world.boxes, face // 2, face & 1 == 1
    nx, ny, nz = _normal(boxes, box, face)
    thickness = boxes.thickness[box, axis]
    # Over the thickness, from the face inward.
    here = _coordinate(boxes, box, axis, at[0, 0], at[0, 1], at[0, 2])
    here = 1.0 - here if is_upper else here
    before, inside = (here - 1.0) * thickness, thickness
    if is_inside:
        before, inside = 0.0, max(here, 0.0) * thickness
    if before < 0.0 or inside == 0.0:
        return 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)
    if is_sky:
        cos_o = end[0] * nx + end[1] * ny + end[2] * nz
        sine = (end[0] - cos_o * nx, end[1] - cos_o * ny, end[2] - cos_o * nz)
        return before, inside, cos_o, sine
    gap = _coordinate(boxes, box, axis, end[0], end[1], end[2])
    gap = (gap - 1.0 if is_upper else -gap) * thickness
    if gap <= 0.0:
        return 0.0, 0.0, 0.0, (0.0, 0.0, 0.0)
    x, y, z = end[0] - at[0, 0], end[1] - at[0, 1], end[2] - at[0, 2]
    up = x * nx + y * ny + z * nz
    x, y, z = x - up * nx, y - up * ny, z - up * nz
    across = math.sqrt(x * x + y * y + z * z)
    ior = world.lobes.number[boxes.lobe[box], IOR]
    tangent = tangent_through(before + gap, inside, across, ior)
    cos_o = 1.0 / math.sqrt(1.0 + tangent * tangent)
    factor = tangent * cos_o / across if across > 0.0 else 0.0
    return before, inside, cos_o, (factor * x, factor * y, factor * z)


@inlined
def _along(boxes, box, axis, v):
    """Return the component of a vector along a normal."""
    n = boxes.across
    return n[box, axis, 0] * v[0] + n[box, axis, 1] * v[1] + n[box, axis, 2] * v[2]


@inlined
def _mirrored(boxes, box, axis, v):
    """Return a vector mirrored across an axis."""
    n, twice = boxes.across, 2.0 * _along(boxes, box, axis, v)
    return (
        v[0] - twice * n[box, axis, 0], v[1] - twice * n[box, axis, 1], v[2] - twice * n[box, axis, 2],
    )  # fmt: skip


@inlined
def _side_counts(world, box, face, image, start, step, is_inside):
    """Return how often a way is reflected across both axes along a face; -1, -1: there is no such way.

    Parameters
    ----------
    image : int
        Mirror image in which it ends: 1 across the first of these axes, 2 across the second, 3 both.
    start : tuple
        Where its part inside begins.
    step : tuple
        What that part adds, as if the box had no sides.
    """
    boxes, axis = world.boxes, face // 2
    counts = (0, 0)
    for side in range(2):
        k = (axis + 1 + side) % 3
        c = _coordinate(boxes, box, k, start[0], start[1], start[2])
        if not is_inside and not 0.0 < c < 1.0:
            return -1, -1
        n = _reflections(boxes, box, k, c, _coordinate_step(boxes, box, k, step))
        if n < 0 or n & 1 != (image >> side) & 1:
            return -1, -1
        counts = (n, counts[1]) if side == 0 else (counts[0], n)
    return counts


@inlined
def _are_total(world, box, face, counts, sine, ior):
    """Tell whether the reflections at the sides are total, by the sine outside, along the face."""
    for side in range(2):
        along = _along(world.boxes, box, (face // 2 + 1 + side) % 3, sine)
        if counts[side] > 0 and not is_mirrored_inside(world, box, along / ior):
            return False
    return True


@inlined
def _folded_point(boxes, box, face, point):
    """Return the point of a face of which another one, in its plane, is a mirror image."""
    axis, (x, y, z) = face // 2, point
    return _where(
        boxes, box, axis, 1.0 if face & 1 == 1 else 0.0,
        _folded(_coordinate(boxes, box, (axis + 1) % 3, x, y, z)),
        _folded(_coordinate(boxes, box, (axis + 2) % 3, x, y, z)),
    )  # fmt: skip


@inlined
def _value(
    world, paths, vertices, box, face, is_sky, end, stop, sine, lengths, cosines, part, is_inside
):
    """Return the contribution of one way.

    Parameters
    ----------
    box, face : int
        By which it leaves.
    is_sky : bool
    end : tuple
        See `brought`.
    stop, sine : tuple
        Where it leaves, and the sine outside, along the face, as it begins.
    lengths, cosines : tuple of 2 float
        Of the ray before the box and of that inside; to the normal, outside and inside.
    part : float
        See `_passed_on`.
    is_inside : bool
        Whether it begins inside.
    """
    boxes, (cos_o, cos_i), (before, chord) = world.boxes, cosines, lengths
    lobe = boxes.lobe[box]
    ior = world.lobes.number[lobe, IOR]
    x, y, z, length, cos_lamp = end[0], end[1], end[2], math.inf, 1.0
    if not is_sky:
        x, y, z = x - stop[0], y - stop[1], z - stop[2]
        length = math.sqrt(x * x + y * y + z * z)
        cos_lamp = -(end[3] * x + end[4] * y + end[5] * z) / length
        if cos_lamp <= 0.0:
            return 0.0, 0.0, 0.0
    section = _section(length + before, chord, cos_o, cos_i, ior, is_inside)
    cosine, ratio, scale, passages = cos_o, 1.0, 1.0, 2
    if is_inside:
        # Radiance grows with the square of the index on the way in.
        cosine, ratio, scale, passages = cos_i, 1.0 / ior, ior * ior, 1
    nx, ny, nz = _normal(boxes, box, face)
    r, g, b = brought(
        world, paths, vertices,
        cosine * nx + ratio * sine[0], cosine * ny + ratio * sine[1], cosine * nz + ratio * sine[2],
        end, cos_lamp, part, section,
    )  # fmt: skip
    tr, tg, tb = left_by(world.lobes, lobe, chord)
    return (
        r * scale * tr * boxes.tint[box, 0] ** passages,
        g * scale * tg * boxes.tint[box, 1] ** passages,
        b * scale * tb * boxes.tint[box, 2] ** passages,
    )


@inner
def _add_inner_segments(boxes, paths, box, face, source, start, stop, step, counts, rays, n):
    """Write the rays of a way inside a box; return the number of rows then.

    Parameters
    ----------
    source : int
        The surface that it begins on; rows that begin on the box follow another one.
    start, stop, step : tuple
        Its ends, and what it adds along the face, as if the box had no sides.
    counts : tuple of 2 int
        Reflections across both axes along the face.
    """
    surface, axis = boxes.surface[box], face // 2
    j, k = (axis + 1) % 3, (axis + 2) % 3
    at_face = 1.0 if face & 1 == 1 else 0.0
    a, b, c = (
        _coordinate(boxes, box, axis, start[0], start[1], start[2]),
        _coordinate(boxes, box, j, start[0], start[1], start[2]),
        _coordinate(boxes, box, k, start[0], start[1], start[2]),
    )
    add_b, add_c = (
        _coordinate_step(boxes, box, j, step),
        _coordinate_step(boxes, box, k, step),
    )
    px, py, pz = start
    done_b = done_c = 0
    while done_b + done_c < counts[0] + counts[1]:
        # Parts of the way up to the next face across either axis.
        to_b = to_c = math.inf
        if done_b < counts[0]:
            to_b = ((done_b + 1.0 if add_b > 0.0 else -1.0 * done_b) - b) / add_b
        if done_c < counts[1]:
            to_c = ((done_c + 1.0 if add_c > 0.0 else -1.0 * done_c) - c) / add_c
        to = min(to_b, to_c)
        at_b, at_c = _folded(b + to * add_b), _folded(c + to * add_c)
        if to_b <= to_c:
            done_b += 1
            at_b = 1.0 if at_b > 0.5 else 0.0
        else:
            done_c += 1
            at_c = 1.0 if at_c > 0.5 else 0.0
        qx, qy, qz = _where(boxes, box, axis, a + to * (at_face - a), at_b, at_c)
        add_segment(paths, rays, n, source, px, py, pz, surface, qx, qy, qz, source == surface)
        source, px, py, pz = surface, qx, qy, qz
        n += 1
    qx, qy, qz = stop
    add_segment(paths, rays, n, source, px, py, pz, surface, qx, qy, qz, source == surface)
    return n + 1


@inner
def sample_through_boxes(world, rules, paths, vertex, vertices, depth, light, s, t, which, rays, n):
    """Sample a point of a lamp, or a direction of the sky, and one way there through a box.

    Parameters are those of `sample_through_spheres`.
    """
    boxes, at = world.boxes, vertex.hit.position
    box, chance, passages = int(paths.anchor[0, INSIDE]), 1.0, 1
    is_inside = box >= 0
    if not is_inside:
        passages = 2
        box, chance, s = choose_body(boxes, WITHIN_BOX, at[0, 0], at[0, 1], at[0, 2], s)
        if box < 0 or depth + passages >= rules.max_depth:
            return n
    x, y, z, lx, ly, lz, pdf, er, eg, eb = end_of_way(world, vertex, light, s, t)
    if pdf == 0.0 or max(er, eg, eb) <= 0.0:
        return n
    end = (x, y, z, lx, ly, lz, pdf * chance, er, eg, eb)
    is_sky = light == world.lights.kind.size
    ior = world.lobes.number[boxes.lobe[box], IOR]
    may_mirror = is_sky and boxes.is_right[box]
    nowhere = (0.0, 0.0, 0.0)
    taken, counts, start, stop, step, value = 0, (0, 0), nowhere, nowhere, nowhere, nowhere
    total = 0.0
    for face in range(6):
        # --- does the light leave by this face, and enter by the opposite one, if any?
        if not boxes.is_open[box, face] or not (is_inside or boxes.is_open[box, face ^ 1]):
            continue
        before, inside, cos_o, direct = _across_face(world, box, face, at, end, is_sky, is_inside)
        if cos_o <= 0.0:
            continue
        part, cos_i = _passed_on(world, box, cos_o, is_inside)
        if cos_i <= 0.0:
            continue
        nx, ny, nz = _normal(boxes, box, face)
        ahead, within = before / cos_o, inside / (ior * cos_i)
        for image in range(4 if may_mirror else 1):
            sine = direct
            for side in range(2):
                if (image >> side) & 1:
                    sine = _mirrored(boxes, box, (face // 2 + 1 + side) % 3, sine)
            m = (
                at[0, 0] + before * nx + ahead * sine[0],
                at[0, 1] + before * ny + ahead * sine[1],
                at[0, 2] + before * nz + ahead * sine[2],
            )
            add = (within * sine[0], within * sine[1], within * sine[2])
            # In a skew box a step across the face moves along the others as well.
            whole = (inside * nx + add[0], inside * ny + add[1], inside * nz + add[2])
            found = _side_counts(world, box, face, image, m, whole, is_inside)
            mirrored = found[0] + found[1]
            if found[0] < 0 or (mirrored > 0 and not may_mirror) or mirrored > MOST_MIRRORED:
                continue
            if depth + passages + mirrored >= rules.max_depth:
                continue
            if not _are_total(world, box, face, found, sine, ior):
                continue
            o = (m[0] + whole[0], m[1] + whole[1], m[2] + whole[2])
            if mirrored > 0:
                o = _folded_point(boxes, box, face, o)
            r, g, b = _value(
                world, paths, vertices, box, face, is_sky, end, o, sine,
                (ahead, inside / cos_i), (cos_o, cos_i), part, is_inside,
            )  # fmt: skip
            most = max(r, g, b)
            if most <= 0.0:
                continue
            total += most
            is_taken, which = take_way(total, most, which)
            if is_taken:
                taken, counts, start, stop, step, value = face, found, m, o, add, (r, g, b)
    if total == 0.0:
        return n
    r, g, b = value
    factor = factor_of_taken(rules, paths, is_sky, total, max(r, g, b), which)
    if factor == 0.0:
        return n
    # --- nothing may stand in the way
    surface, here = boxes.surface[box], vertex.hit.object_id[0]
    mx, my, mz = start
    if not is_inside:
        add_segment(paths, rays, n, here, at[0, 0], at[0, 1], at[0, 2], surface, mx, my, mz, False)
        n, here = n + 1, surface
    n = _add_inner_segments(boxes, paths, box, taken, here, start, stop, step, counts, rays, n)
    ox, oy, oz = stop
    add_last_segment(
        world, paths, rays, n, surface, ox, oy, oz, light, end, factor * r, factor * g, factor * b
    )
    return n + 1
