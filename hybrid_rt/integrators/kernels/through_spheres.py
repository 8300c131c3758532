"""Next-event estimation by way of a mirror ball or a glass ball, which may hold another one.

All ways are found: `hybrid_rt.integrators.kernels.ball_optics`. The estimator is that of
`hybrid_rt.integrators.kernels.ways`.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.core.kernels.sphere_points import onto_sphere
from hybrid_rt.integrators.kernels.ball_optics import (
    place_of_reflection,
    section_of_crossed,
    section_of_reflected,
    ways_across,
)
from hybrid_rt.integrators.kernels.ways import (
    CORE_CROSSED,
    PDF,
    REFLECTED,
    WITHIN_BALL,
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
from hybrid_rt.shading.kernels.fresnel import fresnel
from hybrid_rt.shading.kernels.medium_stack import IOR
from meshing.kernels.jit import inlined, inner

# Rays of one way, through a ball and its core. One ball is sampled at a vertex.
MOST_RAYS = 5
NO_CORE = (math.inf, math.inf)


class Balls(NamedTuple):
    """Spheres of one delta lobe, and of a colour that is the same everywhere.

    A ball of glass may have a core about the same centre, hollow or of other glass.
    """

    center: Any  # (n, 3) float64
    radius: Any  # (n,) float64
    square: Any  # (n,) float64, of the radius
    surface: Any  # (n,) int32, index of the surface
    lobe: Any  # (n,) int32
    is_glass: Any  # (n,) bool
    color: Any  # (n, 3) float64, of a reflection; of glass: tint of one passage through the surface
    of_surface: Any  # (surfaces,) int32, row; -1: another surface
    core: Any  # (n,) float64, radius of the core over that of the ball; 0: none
    core_ior: Any  # (n,) float64
    core_lobe: Any  # (n,) int32, dielectric that fills it; -1: nothing
    core_surface: Any  # (n,) int32, index of its surface, or of one of those that coincide
    of_core: Any  # (surfaces,) int32, row of the ball whose core has this surface; -1: none


@inlined
def _core_of(world, ball):
    """Return the core of a ball as `turn` takes it."""
    balls = world.balls
    ior, radius = world.lobes.number[balls.lobe[ball], IOR], balls.core[ball]
    return (ior * radius, balls.core_ior[ball] * radius) if radius > 0.0 else NO_CORE


@inlined
def _reflected_part(world, ball, cos_i):
    """Return the part of radiance that the outside of a sphere reflects, without colour."""
    if not world.balls.is_glass[ball]:
        return 1.0
    reflectance, _ = reflectance_of(world.lobes, world.balls.lobe[ball], cos_i)
    return reflectance


@inlined
def _crossed_part(world, ball, b, cos_i, core):
    """Return the part of radiance that passes all surfaces of a ball of glass, without tint."""
    reflectance, _ = reflectance_of(world.lobes, world.balls.lobe[ball], cos_i)
    part = (1.0 - reflectance) ** 2
    before, within = core
    if before < math.inf:
        sine = b / before
        reflectance, _ = fresnel(math.sqrt(max(1.0 - sine * sine, 0.0)), within / before)
        part *= (1.0 - reflectance) ** 2
    return part


@inlined
def pdf_by_ball(world, paths, ball, t, met):
    """Return the pdfs of a path by way of a ball: by BSDF sampling, and by this technique.

    The pdfs are those of `hybrid_rt.integrators.kernels.ways`, the second without the lamp's; both
    are zero where the ball is not sampled.

    Parameters
    ----------
    world : World
    paths : Paths of one row
        The ray that has met the light.
    ball : int
    t : float
        Distance of the light; inf: the sky.
    met : int
        How the ray has left the ball: `REFLECTED`, `CROSSED` or `CORE_CROSSED`.
    """
    balls, anchor, d = world.balls, paths.anchor, paths.directions
    radius = balls.radius[ball]
    x = (paths.origins[0, 0] - balls.center[ball, 0]) / radius
    y = (paths.origins[0, 1] - balls.center[ball, 1]) / radius
    z = (paths.origins[0, 2] - balls.center[ball, 2]) / radius
    cos_i = x * d[0, 0] + y * d[0, 1] + z * d[0, 2]
    away = before = 0.0
    for k in range(3):
        away += ((anchor[0, k] - balls.center[ball, k]) / radius) ** 2
        before += ((anchor[0, k] - paths.origins[0, k]) / radius) ** 2
    # The inside of a mirror ball is not sampled.
    if away <= 1.0 or cos_i <= 0.0:
        return 0.0, 0.0
    cos_i, after = min(cos_i, 1.0), t / radius
    if met == REFLECTED:
        part = _reflected_part(world, ball, cos_i)
        section = section_of_reflected(math.sqrt(before), after, cos_i)
    else:
        bx = y * d[0, 2] - z * d[0, 1]
        by = z * d[0, 0] - x * d[0, 2]
        bz = x * d[0, 1] - y * d[0, 0]
        b = min(math.sqrt(bx * bx + by * by + bz * bz), 1.0)
        core = _core_of(world, ball) if met == CORE_CROSSED else NO_CORE
        part = _crossed_part(world, ball, b, cos_i, core)
        ior, far = world.lobes.number[balls.lobe[ball], IOR], math.inf
        if after < math.inf:
            far = math.sqrt(1.0 + after * (2.0 * cos_i + after))
        section = section_of_crossed(b, ior, math.sqrt(away), far, core)
    if t < math.inf:
        section *= radius * radius
    x, y, z = anchor[0, 0], anchor[0, 1], anchor[0, 2]
    chance = chance_of_body(balls, ball, WITHIN_BALL, x, y, z)
    return anchor[0, PDF] * part, section * chance


@inlined
def _on_ball(balls, ball, plane, at, part):
    """Return the point at an angle on a sphere, or on its core if ``part`` is below 1."""
    ax, ay, az, bx, by, bz = plane
    cx, cy, cz = balls.center[ball, 0], balls.center[ball, 1], balls.center[ball, 2]
    radius = balls.radius[ball] * part
    c, s = radius * math.cos(at), radius * math.sin(at)
    # As near to the sphere as rounding allows: shadow rays begin and end there.
    return onto_sphere(
        cx + c * ax + s * bx, cy + c * ay + s * by, cz + c * az + s * bz, cx, cy, cz, radius
    )


@inlined
def _angles(world, ball, way):
    """Return the angles at which a way meets the sphere and its core, and leaves both."""
    enter, b, core = way
    if math.isnan(b):
        return enter, enter, enter, enter
    side = 1.0 if b > 0.0 else -1.0
    b = abs(b)
    bent = math.asin(b / world.lobes.number[world.balls.lobe[ball], IOR])
    if core[0] == math.inf:
        leave = enter + side * (math.pi - 2.0 * bent)
        return enter, leave, leave, leave
    step = side * (math.asin(b / core[0]) - bent)
    out = enter + step + side * (math.pi - 2.0 * math.asin(b / core[1]))
    return enter, enter + step, out, out + step


@inner
def _value(world, paths, vertices, ball, light, end, plane, way, eye, far):
    """Return the contribution of one way.

    Parameters
    ----------
    ball, light : int
    end : tuple
        See `brought`.
    plane : tuple
        Two unit vectors of the plane, the first toward the vertex.
    way : tuple
        Where it meets the sphere, by angle; b of `turn`, negative if it passes the centre on the far
        side, or nan if it is reflected; and the core that it crosses.
    eye, far : float
        Distances of both ends from the centre, over the radius.
    """
    balls, position = world.balls, vertices.position
    _, b, core = way
    b = abs(b)
    radius, lobe = balls.radius[ball], balls.lobe[ball]
    ior = world.lobes.number[lobe, IOR]
    enter, _, _, leave = _angles(world, ball, way)
    mx, my, mz = _on_ball(balls, ball, plane, enter, 1.0)
    ox, oy, oz = _on_ball(balls, ball, plane, leave, 1.0)
    # --- the first and the last part of the way
    x, y, z = mx - position[0, 0], my - position[0, 1], mz - position[0, 2]
    before = math.sqrt(x * x + y * y + z * z)
    tx, ty, tz = end[0], end[1], end[2]
    length, after = 1.0, math.inf
    if light < world.lights.kind.size:
        tx, ty, tz = tx - ox, ty - oy, tz - oz
        length = after = math.sqrt(tx * tx + ty * ty + tz * tz)
    if before == 0.0 or after == 0.0:
        return 0.0, 0.0, 0.0
    cos_lamp = -(end[3] * tx + end[4] * ty + end[5] * tz) / length
    cos_i = (ox - balls.center[ball, 0]) * tx + (oy - balls.center[ball, 1]) * ty
    cos_i = (cos_i + (oz - balls.center[ball, 2]) * tz) / (length * radius)
    if cos_lamp <= 0.0 or cos_i <= 0.0:
        return 0.0, 0.0, 0.0
    cos_i = min(cos_i, 1.0)
    # --- what the sphere passes on
    tr = tg = tb = 1.0
    if math.isnan(b):
        part = _reflected_part(world, ball, cos_i)
        section = section_of_reflected(before / radius, after / radius, cos_i)
        if not balls.is_glass[ball]:
            tr, tg, tb = balls.color[ball, 0], balls.color[ball, 1], balls.color[ball, 2]
    else:
        part = _crossed_part(world, ball, b, cos_i, core)
        section = section_of_crossed(b, ior, eye, far, core)
        square = (b / ior) ** 2
        chord = math.sqrt(max(1.0 - square, 0.0))
        if core[0] < math.inf:
            square_core = balls.core[ball] ** 2
            chord -= math.sqrt(max(square_core - square, 0.0))
            if balls.core_lobe[ball] >= 0:
                inside = math.sqrt(max(square_core - (b / balls.core_ior[ball]) ** 2, 0.0))
                tr, tg, tb = left_by(world.lobes, balls.core_lobe[ball], 2.0 * radius * inside)
        r, g, b = left_by(world.lobes, lobe, 2.0 * radius * chord)
        tr *= r * balls.color[ball, 0] ** 2
        tg *= g * balls.color[ball, 1] ** 2
        tb *= b * balls.color[ball, 2] ** 2
    if after < math.inf:
        section *= radius * radius
    r, g, b = brought(
        world, paths, vertices, x / before, y / before, z / before, end, cos_lamp, part, section
    )
    return tr * r, tg * g, tb * b


@inlined
def _add_way(world, paths, vertex, ball, light, end, plane, way, value, rays, n):
    """Write the rays of one way; return the number of rows then."""
    balls, at, here = world.balls, vertex.hit.position, vertex.hit.object_id[0]
    surface, within = balls.surface[ball], balls.core_surface[ball]
    enter, into, out, leave = _angles(world, ball, way)
    mx, my, mz = _on_ball(balls, ball, plane, enter, 1.0)
    ox, oy, oz = _on_ball(balls, ball, plane, leave, 1.0)
    add_segment(paths, rays, n, here, at[0, 0], at[0, 1], at[0, 2], surface, mx, my, mz, False)
    n += 1
    if way[2][0] < math.inf:
        sx, sy, sz = _on_ball(balls, ball, plane, into, balls.core[ball])
        ex, ey, ez = _on_ball(balls, ball, plane, out, balls.core[ball])
        add_segment(paths, rays, n, surface, mx, my, mz, within, sx, sy, sz, True)
        add_segment(paths, rays, n + 1, within, sx, sy, sz, within, ex, ey, ez, True)
        add_segment(paths, rays, n + 2, within, ex, ey, ez, surface, ox, oy, oz, True)
        n += 3
    elif not math.isnan(way[1]):
        add_segment(paths, rays, n, surface, mx, my, mz, surface, ox, oy, oz, True)
        n += 1
    r, g, b = value
    add_last_segment(world, paths, rays, n, surface, ox, oy, oz, light, end, r, g, b)
    return n + 1


@inner
def sample_through_spheres(
    world, rules, paths, vertex, vertices, depth, light, s, t, which, rays, n
):
    """Sample a point of a lamp, or a direction of the sky, and one way there by a ball.

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
    which : float
        In [0, 1): chooses the way.
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
    ball, chance, s = choose_body(balls, WITHIN_BALL, at[0, 0], at[0, 1], at[0, 2], s)
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
    plane = (ax, ay, az, bx, by, bz)
    taken, total, value = (0.0, math.nan, NO_CORE), 0.0, (0.0, 0.0, 0.0)
    # --- reflected at the outside
    place = place_of_reflection(eye, far, between)
    if not math.isnan(place):
        way = (place, math.nan, NO_CORE)
        r, g, b = _value(world, paths, vertices, ball, light, end, plane, way, eye, far)
        total, taken, value = max(r, g, b), way, (r, g, b)
    # --- through the ball, past its core and through it
    found, inner_core = vertex.found, _core_of(world, ball)
    for is_inside in range(2 if balls.is_glass[ball] else 0):
        core, first, last, surfaces = NO_CORE, 0.0, 1.0, 2
        if is_inside == 1:
            core, last, surfaces = inner_core, min(inner_core[0], inner_core[1], 1.0), 4
        elif balls.core[ball] > 0.0:
            first = inner_core[0]
        if last <= first or (is_inside == 1 and balls.core[ball] == 0.0):
            continue
        if depth + surfaces >= rules.max_depth:
            continue
        ior = world.lobes.number[balls.lobe[ball], IOR]
        n_ways = ways_across(first, last, math.pi - between, ior, eye, far, core, found)
        for k in range(n_ways):
            enter = math.asin(abs(found[k])) - math.asin(abs(found[k]) / eye)
            way = (enter if found[k] >= 0.0 else -enter, found[k], core)
            r, g, b = _value(world, paths, vertices, ball, light, end, plane, way, eye, far)
            most = max(r, g, b)
            if most > 0.0:
                total += most
                is_taken, which = take_way(total, most, which)
                if is_taken:
                    taken, value = way, (r, g, b)
    if total == 0.0:
        return n
    r, g, b = value
    is_sky = light == world.lights.kind.size
    factor = factor_of_taken(rules, paths, is_sky, total, max(r, g, b), which)
    if factor == 0.0:
        return n
    value = (factor * r, factor * g, factor * b)
    return _add_way(world, paths, vertex, ball, light, end, plane, taken, value, rays, n)
