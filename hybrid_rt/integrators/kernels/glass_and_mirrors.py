"""Next-event estimation by way of balls, boxes and flat mirrors, and its MIS weights on camera paths."""

import math

from hybrid_rt.integrators.kernels.by_mirrors import pdf_by_mirror, sample_by_mirrors
from hybrid_rt.integrators.kernels.light_sampling import choose_light
from hybrid_rt.integrators.kernels.through_boxes import (
    MOST_MIRRORED,
    box_around,
    face_of,
    is_mirrored_inside,
    pdf_by_box,
    sample_through_boxes,
)
from hybrid_rt.integrators.kernels.through_spheres import pdf_by_ball, sample_through_spheres
from hybrid_rt.integrators.kernels.vertex_points import (
    TO_BOX,
    TO_MIRROR,
    TO_SPHERE,
    WHICH_MIRROR,
    WHICH_WAY,
    draw_later,
)
from hybrid_rt.integrators.kernels.ways import (
    ALL_LIGHTS,
    ANCHORED,
    BEFORE,
    BOX_CROSSED,
    BOX_ENTERED,
    BOX_LEFT,
    CORE_CROSSED,
    CORE_ENTERED,
    CORE_LEFT,
    CROSSED,
    ENTERED,
    INSIDE,
    MIRRORED,
    MIRRORED_FLAT,
    NO_LIGHTS,
    OTHER,
    PDF,
    REFLECTED,
    SAMPLED,
    WITHIN,
    is_sampled,
    only_medium,
    pdf_of_end,
    sampled_lights,
)
from hybrid_rt.shading.kernels.emitter import power_weight
from hybrid_rt.shading.kernels.medium_stack import NONE
from meshing.kernels.jit import inlined, inner


@inlined(cached=True)
def sample_specular(world, rules, paths, vertex, vertices, depth, rays, n):
    """Next-event estimation by way of a ball and by way of a box; for lamps by a flat mirror as well.

    Rows of ``rays`` are written from row n on, and the anchor of ``paths`` is set. Returns whether there is
    such a technique at this vertex, and the number of rows then.
    """
    sampled = sampled_lights(rules, paths, depth)
    if sampled == NO_LIGHTS:
        return False, n
    anchor, at = paths.anchor, vertex.hit.position
    anchor[0, SAMPLED], anchor[0, INSIDE] = sampled, -1.0
    anchor[0, WITHIN] = anchor[0, MIRRORED] = 0.0
    is_inside = False
    if paths.media.shape[1] > 0:
        medium = only_medium(paths.media, 0)
        if medium < NONE or world.glass_of[vertex.material[0]] >= 0:
            return False, n
        if medium != NONE:
            box = box_around(world.boxes, medium, at[0, 0], at[0, 1], at[0, 2])
            if box < 0:
                return False, n
            anchor[0, INSIDE], is_inside = box, True
    for k in range(3):
        anchor[0, k] = at[0, k]
    pixel, sample = paths.pixel[0], paths.sample[0]
    which_of_ball, which_of_box = draw_later(rules, depth, WHICH_WAY, pixel, sample)
    if world.balls.radius.size and not is_inside:
        s, t = draw_later(rules, depth, TO_SPHERE, pixel, sample)
        light, s = choose_light(world.light_cdf, world.lights.chance, s)
        if is_sampled(world, sampled, light):
            n = sample_through_spheres(
                world, rules, paths, vertex, vertices, depth, light, s, t, which_of_ball, rays, n
            )
    if world.boxes.lobe.size:
        s, t = draw_later(rules, depth, TO_BOX, pixel, sample)
        light, s = choose_light(world.light_cdf, world.lights.chance, s)
        if is_sampled(world, sampled, light):
            n = sample_through_boxes(
                world, rules, paths, vertex, vertices, depth, light, s, t, which_of_box, rays, n
            )
    if world.mirrors.chance.size and sampled == ALL_LIGHTS and not is_inside:
        s, t = draw_later(rules, depth, TO_MIRROR, pixel, sample)
        light, s = choose_light(world.light_cdf, world.lights.chance, s)
        which_of_mirror, _ = draw_later(rules, depth, WHICH_MIRROR, pixel, sample)
        if light < world.lights.kind.size and is_sampled(world, sampled, light):
            n = sample_by_mirrors(
                world, paths, vertex, vertices, light, s, t, which_of_mirror, rays, n
            )
    return True, n


@inlined
def weight_of_emission(world, paths, t, normal, light):
    """Return the weight of light that a path has run into against `sample_specular`.

    It was met at distance t, on a face of that normal.
    """
    met = paths.chain[0]
    if met in (REFLECTED, CROSSED, CORE_CROSSED) or met >= BOX_LEFT:
        return _weight_of_way(world, paths, t, normal, light)
    return 1.0


@inner
def _weight_of_way(world, paths, t, normal, light):
    met = paths.chain[0]
    sampled_there = int(paths.anchor[0, SAMPLED])
    if not is_sampled(world, sampled_there, light):
        return 1.0
    source = paths.source_id[0]
    if met == MIRRORED_FLAT:
        if light == world.lights.kind.size:
            return 1.0
        by_bsdf, by_light = pdf_by_mirror(world, paths, world.mirrors.of_surface[source], t)
    elif met < BOX_ENTERED:
        by_bsdf, by_light = pdf_by_ball(world, paths, world.balls.of_surface[source], t, met)
    else:
        by_bsdf, by_light = pdf_by_box(
            world, paths, world.boxes.of_surface[source], met % 8, t, met < BOX_CROSSED
        )
    if by_light == 0.0:
        return 1.0
    if t < math.inf:
        cosine = 0.0
        for k in range(3):
            cosine += normal[0, k] * paths.directions[0, k]
        by_bsdf *= abs(cosine)
    by_light *= pdf_of_end(world, light, paths)
    return power_weight(by_bsdf, by_light) if by_bsdf > 0.0 else 0.0


@inlined
def note_step(world, paths, vertex, is_anchored, normal):
    """Note what a path has met, before it leaves a vertex in the direction ``vertex.onward``.

    ``is_anchored``: `sample_specular` is a technique there.
    """
    chain = paths.chain
    if paths.pdf[0] > 0.0:
        chain[0] = OTHER
        if is_anchored:
            chain[0] = ANCHORED
            paths.anchor[0, PDF] = paths.pdf[0]
        return
    if chain[0] != OTHER:
        _note_delta(world, paths, vertex, normal)


@inner
def _note_delta(world, paths, vertex, normal):
    """Note what a path has met that goes on by a delta lobe."""
    hit, chain = vertex.hit, paths.chain
    met = chain[0]
    chain[0] = OTHER
    before = after = 0.0
    for k in range(3):
        before += normal[0, k] * paths.directions[0, k]
        after += normal[0, k] * vertex.onward[0, k]
    is_through = before * after > 0.0
    is_same = paths.source_id[0] == hit.object_id[0]
    inside = int(paths.anchor[0, INSIDE])
    # --- a flat mirror
    if world.mirrors.of_surface[hit.object_id[0]] >= 0:
        if met == ANCHORED and inside < 0:
            chain[0] = MIRRORED_FLAT
            paths.anchor[0, BEFORE] = hit.t[0]
        return
    # --- a ball, or what lies within one
    balls = world.balls
    ball, of_core = balls.of_surface[hit.object_id[0]], balls.of_core[hit.object_id[0]]
    came_from = NONE
    if paths.source_id[0] >= 0:
        came_from = balls.of_core[paths.source_id[0]]
    if ball >= 0:
        if met == ANCHORED and inside < 0:
            chain[0] = ENTERED if is_through else REFLECTED
        elif met == ENTERED and is_through and is_same:
            chain[0] = CROSSED
        elif met == CORE_LEFT and is_through and came_from == ball:
            chain[0] = CORE_CROSSED
        return
    if of_core >= 0:
        if met == ENTERED and is_through and paths.source_id[0] == balls.surface[of_core]:
            chain[0] = CORE_ENTERED
        elif met == CORE_ENTERED and is_through and came_from == of_core:
            chain[0] = CORE_LEFT
        return
    # --- a box
    box = world.boxes.of_surface[hit.object_id[0]]
    if box < 0:
        return
    face = face_of(world.boxes, box, normal, hit.position)
    if not world.boxes.is_open[box, face]:
        return
    anchor = paths.anchor
    is_around = met == ANCHORED and inside == box
    has_entered = BOX_ENTERED <= met < BOX_LEFT and is_same
    if is_around or has_entered:
        anchor[0, WITHIN] += hit.t[0]
    if not is_through:
        # Reflected at a side, between the face that it entered by and the opposite one.
        is_side = is_around or (has_entered and (met - BOX_ENTERED) // 2 != face // 2)
        if (
            is_side
            and anchor[0, MIRRORED] < MOST_MIRRORED
            and is_mirrored_inside(world, box, abs(before))
        ):
            chain[0] = met
            anchor[0, MIRRORED] += 1.0
    elif is_around:
        chain[0] = BOX_LEFT + face
    elif has_entered and met == BOX_ENTERED + (face ^ 1):
        chain[0] = BOX_CROSSED + face
    elif met == ANCHORED and inside < 0:
        chain[0] = BOX_ENTERED + face
        anchor[0, BEFORE] = hit.t[0]
