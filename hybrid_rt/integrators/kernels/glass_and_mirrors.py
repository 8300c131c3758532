"""Camera paths and the ways to lamps by glass and mirrors: what is asked, and what they have found."""

import math

from hybrid_rt.integrators.kernels.compaction import choose_light
from hybrid_rt.integrators.kernels.through_boxes import (
    ask_through_boxes,
    box_around,
    face_of,
    pdf_by_box,
)
from hybrid_rt.integrators.kernels.through_spheres import ask_through_spheres, pdf_by_ball
from hybrid_rt.integrators.kernels.vertex_points import TO_BOX, TO_SPHERE, draw_later
from hybrid_rt.integrators.kernels.ways import (
    ANCHORED,
    ASKED,
    BEFORE,
    BOX_CROSSED,
    BOX_ENTERED,
    BOX_LEFT,
    CROSSED,
    ENTERED,
    INSIDE,
    NOTHING_ASKED,
    OTHER,
    PDF,
    REFLECTED,
    WITHIN,
    is_asked,
    only_medium,
    pdf_of_end,
    which_are_asked,
)
from hybrid_rt.shading.kernels.emitter import power_weight
from hybrid_rt.shading.kernels.medium_stack import NONE
from meshing.kernels.jit import inlined, inner


@inlined
def ask_by_ways(world, rules, paths, vertex, vertices, depth, rays, n):
    """Reach for a lamp or the sky by way of a ball, and by way of a box.

    Parameters
    ----------
    world : World
    rules : Rules
    paths : Paths of one row
        Its anchor is set.
    vertex : Vertex
        It spreads light.
    vertices : Vertices of one row
        The same as BSDFs read it.
    depth : int
        Vertices before this one.
    rays : ShadowRays
        Rows are written from row n on.
    n : int

    Returns
    -------
    is_anchored : bool
        Whether something is asked.
    n : int
        The number of rows then.
    """
    asked = which_are_asked(rules, paths, depth)
    if asked == NOTHING_ASKED:
        return False, n
    anchor, at = paths.anchor, vertex.hit.position
    anchor[0, ASKED], anchor[0, INSIDE] = asked, -1.0
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
    if world.balls.radius.size and not is_inside:
        s, t = draw_later(rules, depth, TO_SPHERE, pixel, sample)
        light, s = choose_light(world.before, world.lights.chance, s)
        if is_asked(world, asked, light):
            n = ask_through_spheres(
                world, rules, paths, vertex, vertices, depth, light, s, t, rays, n
            )
    if world.boxes.lobe.size:
        s, t = draw_later(rules, depth, TO_BOX, pixel, sample)
        light, s = choose_light(world.before, world.lights.chance, s)
        if is_asked(world, asked, light):
            n = ask_through_boxes(
                world, rules, paths, vertex, vertices, depth, light, s, t, rays, n
            )
    return True, n


@inlined
def weight_of_emission(world, paths, hit, light):
    """Return the weight of light that a path has run into against `ask_by_ways`."""
    met = paths.chain[0]
    if met in (OTHER, ANCHORED, ENTERED) or BOX_ENTERED <= met < BOX_LEFT:
        return 1.0
    return _weight_of_way(world, paths, hit, light)


@inner
def _weight_of_way(world, paths, hit, light):
    met = paths.chain[0]
    asked_there = int(paths.anchor[0, ASKED])
    if not is_asked(world, asked_there, light):
        return 1.0
    source, t = paths.source_id[0], hit.t[0]
    if met < BOX_ENTERED:
        by_chance, asked = pdf_by_ball(
            world, paths, world.balls.of_surface[source], t, met == CROSSED
        )
    else:
        by_chance, asked = pdf_by_box(
            world, paths, world.boxes.of_surface[source], met % 8, t, met < BOX_CROSSED
        )
    if asked == 0.0:
        return 1.0
    if t < math.inf:
        cosine = 0.0
        for k in range(3):
            cosine += hit.normal[0, k] * paths.directions[0, k]
        by_chance *= abs(cosine)
    asked *= pdf_of_end(world, light, paths)
    return power_weight(by_chance, asked) if by_chance > 0.0 else 0.0


@inlined
def note_step(world, paths, vertex, is_anchored, normal):
    """Note what a path has met, before it leaves a vertex in the direction ``vertex.onward``.

    ``is_anchored`` tells whether lamps were asked there.
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
    # --- a ball
    if world.balls.of_surface[hit.object_id[0]] >= 0:
        if met == ANCHORED and inside < 0:
            chain[0] = ENTERED if is_through else REFLECTED
        elif met == ENTERED and is_through and is_same:
            chain[0] = CROSSED
        return
    # --- a box
    box = world.boxes.of_surface[hit.object_id[0]]
    if box < 0 or not is_through:
        return
    face = face_of(world.boxes, box, normal, hit.position)
    if not world.boxes.is_open[box, face]:
        return
    if met == ANCHORED and inside == box:
        chain[0] = BOX_LEFT + face
        paths.anchor[0, WITHIN] = hit.t[0]
    elif met == ANCHORED and inside < 0:
        chain[0] = BOX_ENTERED + face
        paths.anchor[0, BEFORE] = hit.t[0]
    elif met == BOX_ENTERED + (face ^ 1) and is_same:
        chain[0] = BOX_CROSSED + face
        paths.anchor[0, WITHIN] = hit.t[0]
