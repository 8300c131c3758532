"""Next-event estimation by way of a mirror ball or a glass ball.

A surface that the camera sees in a mirror, lit by what a mirror or lens throws onto it, is beyond
light subpaths, as neither of its ends can be connected. Camera paths find such light by chance:
rarely, and then with a large value. Manifold next-event estimation (Hanika, Droske and Fascione,
2015) computes the way from the surface to a sampled point of a lamp instead. On spheres nothing is
left to chance in it: all ways are found (`hybrid_rt.integrators.kernels.ball_optics`).

Each such way is also found by BSDF sampling, and the two are combined by the power heuristic. The
densities are per area of the lamp. What converts them is the cross-section of a narrow pencil of
rays at its end over its solid angle. Where that is zero, on a caustic, the weight of this technique is
zero, so its variance stays bounded.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.ball_optics import (
    crossing_between,
    least_turn,
    place_of_reflection,
    section_of_crossed,
    section_of_reflected,
    turn,
)
from hybrid_rt.integrators.kernels.compaction import choose_light
from hybrid_rt.shading.kernels.bsdf import scattered, sides_differ
from hybrid_rt.shading.kernels.emitter import power_weight
from hybrid_rt.shading.kernels.fresnel import fresnel, schlick
from hybrid_rt.shading.kernels.light_kinds import (
    RECTANGLE,
    SPHERE,
    chosen_strength,
    leaving_point,
    pdf_of_area,
)
from hybrid_rt.shading.kernels.lobes.register import EVERY
from hybrid_rt.shading.kernels.medium_stack import ABSORPTION, IOR, NONE, SCHLICK, filling_medium
from meshing.kernels.jit import inlined

# What a camera path has met since its last non-delta vertex: nothing yet, the outside of a sphere, a
# way into it, both ways through it; or something else (no weight then).
OTHER, ANCHORED, REFLECTED, ENTERED, CROSSED = 0, 1, 2, 3, 4
# Balls are asked in proportion to the sum of their (radius / distance)^2, up to this sum always.
SMALL = 0.15
# Ways by one ball: reflected once, or refracted twice with up to three solutions; and their rays. One
# ball is asked at a vertex: two have 0.97 of the squared error on the Cornell box, for 1.06 of the time.
MOST_RAYS = 2 + 3 * 3


class Balls(NamedTuple):
    """Spheres of one delta lobe, and of a colour that is the same everywhere."""

    center: Any  # (n, 3) float64
    radius: Any  # (n,) float64
    surface: Any  # (n,) int32, index of the surface
    lobe: Any  # (n,) int32
    is_glass: Any  # (n,) bool
    color: Any  # (n, 3) float64, of a reflection; of glass: tint of one passage through the surface
    of_surface: Any  # (surfaces,) int32, row; -1: another surface


@inlined
def _square_seen(balls, ball, x, y, z):
    """Return (radius / distance of the centre)^2 of a ball, seen from outside; 0 from inside."""
    dx, dy, dz = x - balls.center[ball, 0], y - balls.center[ball, 1], z - balls.center[ball, 2]
    square = balls.radius[ball] * balls.radius[ball]
    distance = dx * dx + dy * dy + dz * dz
    return square / distance if distance > square else 0.0


@inlined
def _sum_of_squares(balls, x, y, z):
    """Return what `_square_seen` is divided by: a ball's chance of being asked from a point."""
    total = 0.0
    for ball in range(balls.radius.size):
        total += _square_seen(balls, ball, x, y, z)
    return max(total, SMALL)


@inlined
def _choose_ball(balls, x, y, z, s):
    """Choose a ball by s; return it, its chance, and s made even again; -1: none."""
    total = _sum_of_squares(balls, x, y, z)
    left = s * total
    for ball in range(balls.radius.size):
        square = _square_seen(balls, ball, x, y, z)
        if left < square:
            return ball, square / total, min(left / square, 1.0 - 2.0**-53)
        left -= square
    return -1, 0.0, 0.0


@inlined
def _passed_on(world, ball, cos_i, is_crossed):
    """Return the part of radiance that a sphere passes on, without colour, and the inner cosine."""
    if not world.balls.is_glass[ball]:
        return 1.0, 0.0
    lobe = world.balls.lobe[ball]
    ior = world.lobes.number[lobe, IOR]
    if world.lobes.number[lobe, SCHLICK] != 0.0:
        reflectance, cos_t = schlick(cos_i, ior)
    else:
        reflectance, cos_t = fresnel(cos_i, ior)
    if is_crossed:
        return (1.0 - reflectance) ** 2, cos_t
    return reflectance, cos_t


@inlined
def weight_of_emission(world, paths, hit, light):
    """Return the weight of light that a path has run into against `ask_through_spheres`."""
    kind = paths.chain[0]
    if kind not in (REFLECTED, CROSSED):
        return 1.0
    lights, balls = world.lights, world.balls
    if light >= lights.kind.size or lights.chance[light] == 0.0:
        return 1.0
    if lights.kind[light] != RECTANGLE and lights.kind[light] != SPHERE:
        return 1.0
    ball = balls.of_surface[paths.source_id[0]]
    radius = balls.radius[ball]
    cos_i = away = before = cos_lamp = 0.0
    for k in range(3):
        outward = (paths.origins[0, k] - balls.center[ball, k]) / radius
        cos_i += outward * paths.directions[0, k]
        away += ((paths.anchor[0, k] - balls.center[ball, k]) / radius) ** 2
        before += ((paths.anchor[0, k] - paths.origins[0, k]) / radius) ** 2
        cos_lamp -= hit.normal[0, k] * paths.directions[0, k]
    # The inside of a mirror ball is not asked.
    if away <= 1.0 or cos_i <= 0.0:
        return 1.0
    cos_i = min(cos_i, 1.0)
    part, cos_t = _passed_on(world, ball, cos_i, kind == CROSSED)
    if kind == CROSSED:
        before = math.sqrt(max(away - (1.0 - cos_i * cos_i), 0.0)) - cos_i
        ior = world.lobes.number[balls.lobe[ball], IOR]
        section = section_of_crossed(before, hit.t[0] / radius, cos_i, cos_t, ior)
    else:
        section = section_of_reflected(math.sqrt(before), hit.t[0] / radius, cos_i)
    section *= radius * radius
    met = paths.anchor[0, 3] * part * abs(cos_lamp)
    x, y, z = paths.anchor[0, 0], paths.anchor[0, 1], paths.anchor[0, 2]
    chance = _square_seen(balls, ball, x, y, z) / _sum_of_squares(balls, x, y, z)
    asked = lights.chance[light] * pdf_of_area(lights, light, 0.0) * section * chance
    return power_weight(met, asked) if met > 0.0 else 0.0


@inlined
def is_asked_through_spheres(world, rules, paths, vertex, depth):
    """Tell whether spheres are asked at a vertex that spreads light.

    Not where light subpaths find the same light: at surfaces that the camera sees straight, and at
    those seen from another one (see `hybrid_rt.integrators.kernels.light_paths`).
    """
    if not rules.has_balls or not rules.has_light_paths or depth + 1 >= rules.max_depth:
        return False
    if depth == 0 or paths.pdf[0] != 0.0 or paths.rival[0] != 0.0:
        return False
    if paths.media.shape[1] > 0:
        return (
            world.glass_of[vertex.material[0]] < 0
            and filling_medium(paths.media, 0, world.lobes) == NONE
        )
    return True


@inlined
def note_step(world, paths, vertex, is_anchored, normal):
    """Note what a path has met, before it leaves a vertex in the direction ``vertex.onward``.

    ``is_anchored`` tells whether spheres were asked there.
    """
    hit, chain = vertex.hit, paths.chain
    if paths.pdf[0] > 0.0:
        chain[0] = OTHER
        if is_anchored:
            chain[0] = ANCHORED
            for k in range(3):
                paths.anchor[0, k] = hit.position[0, k]
            paths.anchor[0, 3] = paths.pdf[0]
        return
    if chain[0] == OTHER:
        return
    ball = world.balls.of_surface[hit.object_id[0]]
    if ball < 0:
        chain[0] = OTHER
        return
    before = after = 0.0
    for k in range(3):
        before += normal[0, k] * paths.directions[0, k]
        after += normal[0, k] * vertex.onward[0, k]
    is_through = before * after > 0.0
    if chain[0] == ANCHORED:
        chain[0] = ENTERED if is_through else REFLECTED
    elif chain[0] == ENTERED and is_through and paths.source_id[0] == hit.object_id[0]:
        chain[0] = CROSSED
    else:
        chain[0] = OTHER


@inlined
def _add_segment(paths, rays, n, source, px, py, pz, target, qx, qy, qz, follows):
    """Write row n of the shadow rays, from p to q, with value 0."""
    rays.camera_ray[n] = paths.camera_ray[0]
    rays.source_id[n], rays.target_id[n], rays.t_max[n] = source, target, 1.0
    rays.follows[n] = follows
    rays.origin[n, 0], rays.origin[n, 1], rays.origin[n, 2] = px, py, pz
    rays.end[n, 0], rays.end[n, 1], rays.end[n, 2] = qx, qy, qz
    rays.way[n, 0], rays.way[n, 1], rays.way[n, 2] = qx - px, qy - py, qz - pz
    rays.value[n, 0] = rays.value[n, 1] = rays.value[n, 2] = 0.0


@inlined
def _send(world, paths, vertex, vertices, ball, light, lamp, place, is_crossed, rays, n):
    """Write the rays of one way, if any light goes it; return the number of rows then.

    Parameters
    ----------
    ball, light : int
    lamp : tuple
        Point, normal, pdf per area (with the chance of asking the ball), and radiance of the lamp.
    place : tuple
        Two unit vectors of the plane, the first toward the vertex; distance of the vertex from the
        centre over the radius; where the way meets the sphere, by angle; if it crosses, where it
        leaves.
    is_crossed : bool
    rays : ShadowRays
    n : int
    """
    balls = world.balls
    material, colors, position, normal, direction, geometric, ratio = vertices
    yx, yy, yz, lx, ly, lz, pdf_area, er, eg, eb = lamp
    ax, ay, az, bx, by, bz, enter, leave = place
    radius, surface = balls.radius[ball], balls.surface[ball]
    cx, cy, cz = balls.center[ball, 0], balls.center[ball, 1], balls.center[ball, 2]
    px, py, pz = position[0, 0], position[0, 1], position[0, 2]
    c, s = radius * math.cos(enter), radius * math.sin(enter)
    mx, my, mz = cx + c * ax + s * bx, cy + c * ay + s * by, cz + c * az + s * bz
    c, s = radius * math.cos(leave), radius * math.sin(leave)
    ox, oy, oz = cx + c * ax + s * bx, cy + c * ay + s * by, cz + c * az + s * bz
    # --- the first and the last part of the way
    x, y, z = mx - px, my - py, mz - pz
    before = math.sqrt(x * x + y * y + z * z)
    tx, ty, tz = yx - ox, yy - oy, yz - oz
    after = math.sqrt(tx * tx + ty * ty + tz * tz)
    if before == 0.0 or after == 0.0 or sides_differ(geometric, normal, 0, direction, x, y, z):
        return n
    cos_lamp = -(lx * tx + ly * ty + lz * tz) / after
    cos_i = ((ox - cx) * tx + (oy - cy) * ty + (oz - cz) * tz) / (after * radius)
    if cos_lamp <= 0.0 or cos_i <= 0.0:
        return n
    cos_i = min(cos_i, 1.0)
    fr, fg, fb, pdf = scattered(
        world.lobes, material[0], colors, 0,
        normal[0, 0], normal[0, 1], normal[0, 2],
        direction[0, 0], direction[0, 1], direction[0, 2],
        x / before, y / before, z / before, ratio[0] if ratio.size else 0.0, EVERY,
    )  # fmt: skip
    if pdf <= 0.0:
        return n
    # --- what the sphere passes on
    part, cos_t = _passed_on(world, ball, cos_i, is_crossed)
    r = g = b = 1.0
    lobe = balls.lobe[ball]
    if is_crossed:
        section = section_of_crossed(
            before / radius, after / radius, cos_i, cos_t, world.lobes.number[lobe, IOR]
        )
        chord = 2.0 * radius * cos_t
        number = world.lobes.number
        r = balls.color[ball, 0] ** 2 * math.exp(-number[lobe, ABSORPTION] * chord)
        g = balls.color[ball, 1] ** 2 * math.exp(-number[lobe, ABSORPTION + 1] * chord)
        b = balls.color[ball, 2] ** 2 * math.exp(-number[lobe, ABSORPTION + 2] * chord)
    else:
        section = section_of_reflected(before / radius, after / radius, cos_i)
        if not balls.is_glass[ball]:
            r, g, b = balls.color[ball, 0], balls.color[ball, 1], balls.color[ball, 2]
    section *= radius * radius
    if section <= 0.0 or part <= 0.0:
        return n
    density = pdf_area
    factor = part * cos_lamp / (section * density)
    factor *= power_weight(density * section, pdf * part * cos_lamp)
    r *= factor * fr * er * paths.throughput[0, 0]
    g *= factor * fg * eg * paths.throughput[0, 1]
    b *= factor * fb * eb * paths.throughput[0, 2]
    if max(r, g, b) <= 0.0:
        return n
    # --- nothing may stand in the way
    lamp_surface = world.surface_of_light[light]
    here = vertex.hit.object_id[0]
    _add_segment(paths, rays, n, here, px, py, pz, surface, mx, my, mz, False)
    if is_crossed:
        n += 1
        _add_segment(paths, rays, n, surface, mx, my, mz, surface, ox, oy, oz, True)
    n += 1
    _add_segment(paths, rays, n, surface, ox, oy, oz, lamp_surface, yx, yy, yz, True)
    rays.value[n, 0], rays.value[n, 1], rays.value[n, 2] = r, g, b
    return n + 1


@inlined
def ask_through_spheres(world, rules, paths, vertex, vertices, depth, s, t, rays, n):
    """Sample a point of a lamp by (s, t), and reach for it by way of a ball.

    Parameters
    ----------
    world : World
    rules : Rules
    paths : Paths of one row
    vertex : Vertex
    vertices : Vertices of one row
        The same as BSDFs read it.
    depth : int
        Vertices before this one.
    s, t : float
        In [0, 1).
    rays : ShadowRays
        Rows are written from row n on.
    n : int

    Returns
    -------
    int
        The number of rows then.
    """
    balls, lights = world.balls, world.lights
    light, s = choose_light(world.before, lights.chance, s)
    if light >= lights.kind.size:
        return n
    if lights.kind[light] != RECTANGLE and lights.kind[light] != SPHERE:
        return n
    at = vertex.hit.position
    ball, chance, s = _choose_ball(balls, at[0, 0], at[0, 1], at[0, 2], s)
    if ball < 0:
        return n
    yx, yy, yz, lx, ly, lz, _, pdf_area = leaving_point(lights, vertex.light_point, 0, light, s, t)
    er, eg, eb = chosen_strength(
        lights, world.textures, vertex.light_point, 0, light, s, t, yx, yy, yz
    )
    if pdf_area == 0.0 or max(er, eg, eb) <= 0.0:
        return n
    lamp = (yx, yy, yz, lx, ly, lz, lights.chance[light] * chance * pdf_area, er, eg, eb)
    # --- the plane of the vertex, the centre and the lamp's point
    radius = balls.radius[ball]
    ax = (at[0, 0] - balls.center[ball, 0]) / radius
    ay = (at[0, 1] - balls.center[ball, 1]) / radius
    az = (at[0, 2] - balls.center[ball, 2]) / radius
    bx = (yx - balls.center[ball, 0]) / radius
    by = (yy - balls.center[ball, 1]) / radius
    bz = (yz - balls.center[ball, 2]) / radius
    eye = math.sqrt(ax * ax + ay * ay + az * az)
    far = math.sqrt(bx * bx + by * by + bz * bz)
    if eye <= 1.0 or far <= 1.0:
        return n
    ax, ay, az = ax / eye, ay / eye, az / eye
    bx, by, bz = bx / far, by / far, bz / far
    along = ax * bx + ay * by + az * bz
    bx, by, bz = bx - along * ax, by - along * ay, bz - along * az
    across = math.sqrt(bx * bx + by * by + bz * bz)
    if across == 0.0:
        return n  # a point of the lamp that is drawn with probability zero
    bx, by, bz = bx / across, by / across, bz / across
    between = math.atan2(across, along)
    # --- reflected at the outside
    place = place_of_reflection(eye, far, between)
    if not math.isnan(place):
        n = _send(
            world, paths, vertex, vertices, ball, light, lamp,
            (ax, ay, az, bx, by, bz, place, place), False, rays, n,
        )  # fmt: skip
    # --- through the ball
    if not balls.is_glass[ball] or depth + 2 >= rules.max_depth:
        return n
    ior = world.lobes.number[balls.lobe[ball], IOR]
    asked = math.pi - between
    least = least_turn(ior, eye, far)
    at_least, at_one = turn(least, ior, eye, far), turn(1.0, ior, eye, far)
    for k in range(3):
        # Which side the ray enters on, seen from the lamp, and the parts on which the turn of its
        # way is monotonic.
        side = -1.0 if k == 2 else 1.0
        low, at_low = (0.0, 0.0) if k == 0 else (least, at_least)
        high, at_high = (least, at_least) if k == 0 else (1.0, at_one)
        b = crossing_between(low, high, at_low, at_high, -side * asked, ior, eye, far)
        if not math.isnan(b):
            enter = side * (math.asin(b) - math.asin(b / eye))
            leave = enter + side * (math.pi - 2.0 * math.asin(b / ior))
            n = _send(
                world, paths, vertex, vertices, ball, light, lamp,
                (ax, ay, az, bx, by, bz, enter, leave), True, rays, n,
            )  # fmt: skip
    return n
