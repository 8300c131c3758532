"""Next-event estimation by way of a mirror ball or a glass ball.

All ways are found: `hybrid_rt.integrators.kernels.ball_optics`. The estimator is that of
`hybrid_rt.integrators.kernels.ways`.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.core.kernels.sphere_points import onto_sphere
from hybrid_rt.integrators.kernels.ball_optics import (
    crossing_between,
    least_turn,
    place_of_reflection,
    section_of_crossed,
    section_of_reflected,
    turn,
)
from hybrid_rt.integrators.kernels.ways import (
    PDF,
    SMALL,
    add_last_segment,
    add_segment,
    brought,
    end_of_way,
    left_by,
    reflectance_of,
)
from hybrid_rt.shading.kernels.medium_stack import IOR
from meshing.kernels.jit import inlined, inner

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
    reflectance, cos_t = reflectance_of(world.lobes, world.balls.lobe[ball], cos_i)
    if is_crossed:
        return (1.0 - reflectance) ** 2, cos_t
    return reflectance, cos_t


@inlined
def pdf_by_ball(world, paths, ball, t, is_crossed):
    """Return the densities of a way by a ball that a path has found: by BSDF sampling, and if asked.

    The pdfs are those of `hybrid_rt.integrators.kernels.ways`, the second without the lamp's; both
    are zero where the ball is not asked.

    Parameters
    ----------
    world : World
    paths : Paths of one row
        The ray that has met the light.
    ball : int
    t : float
        Distance of the light; inf: the sky.
    is_crossed : bool
        Whether the ray has crossed the ball, or was reflected by it.
    """
    balls, anchor = world.balls, paths.anchor
    radius = balls.radius[ball]
    cos_i = away = before = 0.0
    for k in range(3):
        outward = (paths.origins[0, k] - balls.center[ball, k]) / radius
        cos_i += outward * paths.directions[0, k]
        away += ((anchor[0, k] - balls.center[ball, k]) / radius) ** 2
        before += ((anchor[0, k] - paths.origins[0, k]) / radius) ** 2
    # The inside of a mirror ball is not asked.
    if away <= 1.0 or cos_i <= 0.0:
        return 0.0, 0.0
    cos_i = min(cos_i, 1.0)
    part, cos_t = _passed_on(world, ball, cos_i, is_crossed)
    if is_crossed:
        before = math.sqrt(max(away - (1.0 - cos_i * cos_i), 0.0)) - cos_i
        ior = world.lobes.number[balls.lobe[ball], IOR]
        section = section_of_crossed(before, t / radius, cos_i, cos_t, ior)
    else:
        section = section_of_reflected(math.sqrt(before), t / radius, cos_i)
    if t < math.inf:
        section *= radius * radius
    x, y, z = anchor[0, 0], anchor[0, 1], anchor[0, 2]
    chance = _square_seen(balls, ball, x, y, z) / _sum_of_squares(balls, x, y, z)
    return anchor[0, PDF] * part, section * chance


@inner
def _send(world, paths, vertex, vertices, ball, light, end, place, is_crossed, rays, n):
    """Write the rays of one way, if any light goes it; return the number of rows then.

    Parameters
    ----------
    ball, light : int
    end : tuple
        See `brought`.
    place : tuple
        Two unit vectors of the plane, the first toward the vertex; distance of the vertex from the
        centre over the radius; where the way meets the sphere, by angle; if it crosses, where it
        leaves.
    is_crossed : bool
    rays : ShadowRays
    n : int
    """
    balls = world.balls
    position = vertices.position
    ax, ay, az, bx, by, bz, enter, leave = place
    radius, surface, lobe = balls.radius[ball], balls.surface[ball], balls.lobe[ball]
    cx, cy, cz = balls.center[ball, 0], balls.center[ball, 1], balls.center[ball, 2]
    px, py, pz = position[0, 0], position[0, 1], position[0, 2]
    # As near to the sphere as rounding allows: shadow rays begin and end there.
    c, s = radius * math.cos(enter), radius * math.sin(enter)
    mx, my, mz = onto_sphere(
        cx + c * ax + s * bx, cy + c * ay + s * by, cz + c * az + s * bz, cx, cy, cz, radius
    )
    c, s = radius * math.cos(leave), radius * math.sin(leave)
    ox, oy, oz = onto_sphere(
        cx + c * ax + s * bx, cy + c * ay + s * by, cz + c * az + s * bz, cx, cy, cz, radius
    )
    # --- the first and the last part of the way
    x, y, z = mx - px, my - py, mz - pz
    before = math.sqrt(x * x + y * y + z * z)
    tx, ty, tz = end[0], end[1], end[2]
    length, after = 1.0, math.inf
    if light < world.lights.kind.size:
        tx, ty, tz = tx - ox, ty - oy, tz - oz
        length = after = math.sqrt(tx * tx + ty * ty + tz * tz)
    if before == 0.0 or after == 0.0:
        return n
    cos_lamp = -(end[3] * tx + end[4] * ty + end[5] * tz) / length
    cos_i = ((ox - cx) * tx + (oy - cy) * ty + (oz - cz) * tz) / (length * radius)
    if cos_lamp <= 0.0 or cos_i <= 0.0:
        return n
    cos_i = min(cos_i, 1.0)
    # --- what the sphere passes on
    part, cos_t = _passed_on(world, ball, cos_i, is_crossed)
    tr = tg = tb = 1.0
    if is_crossed:
        section = section_of_crossed(
            before / radius, after / radius, cos_i, cos_t, world.lobes.number[lobe, IOR]
        )
        tr, tg, tb = left_by(world.lobes, lobe, 2.0 * radius * cos_t)
        tr *= balls.color[ball, 0] ** 2
        tg *= balls.color[ball, 1] ** 2
        tb *= balls.color[ball, 2] ** 2
    else:
        section = section_of_reflected(before / radius, after / radius, cos_i)
        if not balls.is_glass[ball]:
            tr, tg, tb = balls.color[ball, 0], balls.color[ball, 1], balls.color[ball, 2]
    if after < math.inf:
        section *= radius * radius
    r, g, b = brought(
        world, paths, vertices, x / before, y / before, z / before, end, cos_lamp, part, section
    )
    r, g, b = tr * r, tg * g, tb * b
    if max(r, g, b) <= 0.0:
        return n
    # --- nothing may stand in the way
    here = vertex.hit.object_id[0]
    add_segment(paths, rays, n, here, px, py, pz, surface, mx, my, mz, False)
    if is_crossed:
        n += 1
        add_segment(paths, rays, n, surface, mx, my, mz, surface, ox, oy, oz, True)
    n += 1
    add_last_segment(world, paths, rays, n, surface, ox, oy, oz, light, end, r, g, b)
    return n + 1


@inner
def ask_through_spheres(world, rules, paths, vertex, vertices, depth, light, s, t, rays, n):
    """Sample a point of a lamp, or a direction of the sky, and reach for it by way of a ball.

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
    light : int
        Number of lights: the sky.
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
    balls = world.balls
    at = vertex.hit.position
    ball, chance, s = _choose_ball(balls, at[0, 0], at[0, 1], at[0, 2], s)
    if ball < 0:
        return n
    yx, yy, yz, lx, ly, lz, pdf, er, eg, eb = end_of_way(world, vertex, light, s, t)
    if pdf == 0.0 or max(er, eg, eb) <= 0.0:
        return n
    end = (yx, yy, yz, lx, ly, lz, pdf * chance, er, eg, eb)
    # --- the plane of the vertex, the centre and the end
    radius = balls.radius[ball]
    ax = (at[0, 0] - balls.center[ball, 0]) / radius
    ay = (at[0, 1] - balls.center[ball, 1]) / radius
    az = (at[0, 2] - balls.center[ball, 2]) / radius
    eye = math.sqrt(ax * ax + ay * ay + az * az)
    bx, by, bz, far = yx, yy, yz, math.inf
    if light < world.lights.kind.size:
        bx = (yx - balls.center[ball, 0]) / radius
        by = (yy - balls.center[ball, 1]) / radius
        bz = (yz - balls.center[ball, 2]) / radius
        far = math.sqrt(bx * bx + by * by + bz * bz)
        bx, by, bz = bx / far, by / far, bz / far
    if eye <= 1.0 or far <= 1.0:
        return n
    ax, ay, az = ax / eye, ay / eye, az / eye
    along = ax * bx + ay * by + az * bz
    bx, by, bz = bx - along * ax, by - along * ay, bz - along * az
    across = math.sqrt(bx * bx + by * by + bz * bz)
    if across == 0.0:
        return n  # drawn with probability zero
    bx, by, bz = bx / across, by / across, bz / across
    between = math.atan2(across, along)
    # --- reflected at the outside
    place = place_of_reflection(eye, far, between)
    if not math.isnan(place):
        n = _send(
            world, paths, vertex, vertices, ball, light, end,
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
                world, paths, vertex, vertices, ball, light, end,
                (ax, ay, az, bx, by, bz, enter, leave), True, rays, n,
            )  # fmt: skip
    return n
