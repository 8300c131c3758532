"""Next-event estimation by way of glass or a mirror: what all shapes have in common.

Light that glass or a mirror throws onto a surface is found by chance when a BSDF sample goes that way
to a lamp. Manifold next-event estimation (Hanika, Droske and Fascione, 2015) computes the way from
the surface to a sampled point of a lamp, or to a sampled direction of the sky, instead. On spheres
and flat faces nothing is left to chance in it, as all ways are found:
`hybrid_rt.integrators.kernels.through_spheres`, `hybrid_rt.integrators.kernels.through_boxes` and
`hybrid_rt.integrators.kernels.by_mirrors`.

Each such way is also found by BSDF sampling, and the two are combined by the power heuristic. The
densities are per area of the lamp, or per solid angle of the sky. The generalized geometry term dA/dw
converts them, called section here: the cross-section of a narrow pencil of rays at its end over its
solid angle; for the sky, the solid angle of the pencil that leaves over that. Where it is zero, on a
caustic, the weight of this technique is zero, so its variance stays bounded.
"""

import math

from hybrid_rt.integrators.kernels.light_sampling import write_ray
from hybrid_rt.shading.kernels.bsdf import scattered, sides_differ
from hybrid_rt.shading.kernels.emitter import power_weight
from hybrid_rt.shading.kernels.environment import sky_direction, sky_pdf, sky_radiance
from hybrid_rt.shading.kernels.light_kinds import (
    RECTANGLE,
    SPHERE,
    chosen_strength,
    leaving_point,
    pdf_of_area,
)
from hybrid_rt.shading.kernels.lobes.dielectric import reflectance_by
from hybrid_rt.shading.kernels.lobes.register import EVERY
from hybrid_rt.shading.kernels.medium_stack import ABSORPTION, IOR, NONE, STACK
from meshing.kernels.jit import inlined

# The specular chain of a camera path since its last non-delta vertex, which decides what BSDF sampling is
# weighted against:
#   OTHER           anything else: no technique of this kind, weight 1
#   ANCHORED        none yet
#   REFLECTED       outside of a sphere          ENTERED, CROSSED     into a sphere, and out of it
#   CORE_ENTERED, CORE_LEFT, CORE_CROSSED        into its core, out of that, out of the sphere
#   BOX_ENTERED, BOX_CROSSED                     into a box, and out of it
#   BOX_LEFT        out of the box of the vertex MIRRORED_FLAT        a flat mirror
OTHER, ANCHORED, REFLECTED, ENTERED, CROSSED = 0, 1, 2, 3, 4
CORE_ENTERED, CORE_LEFT, CORE_CROSSED = 5, 6, 7
# Of these, the number of the face is added.
BOX_ENTERED, BOX_LEFT, BOX_CROSSED = 8, 16, 24
MIRRORED_FLAT = 32
# Lights that this technique samples at a vertex.
NO_LIGHTS, SKY_ALONE, ALL_LIGHTS = 0, 1, 2
# Columns of `Paths.anchor`: place of the vertex, pdf of the direction sampled there, which lights are
# sampled there, the box that it lies in (-1: none), the lengths of the way before a box or flat mirror and
# inside a box, and how often it was reflected there.
PDF, SAMPLED, INSIDE, BEFORE, WITHIN, MIRRORED, N_COLUMNS = 3, 4, 5, 6, 7, 8, 9
# Bodies are sampled in proportion to their (radius / distance)^2, or to this from within; where their sum
# is at least `SMALL`, one is.
WITHIN_BALL, WITHIN_BOX, SMALL = 0.0, 1.0, 1.0
SMALLEST = 1e-300


@inlined
def sampled_lights(rules, paths, depth):
    """Return which lights are sampled at a vertex that spreads light.

    Light subpaths find what lamps send to surfaces that the camera sees straight, and to those seen
    from another one (see `hybrid_rt.integrators.kernels.light_paths`). Nothing else finds the sky, nor
    the lamps where no light subpath is useful.
    """
    if depth + 1 >= rules.max_depth:
        return NO_LIGHTS
    if (
        rules.has_light_paths
        and depth > 0
        and paths.pdf[0] == 0.0
        and paths.connection_pdf[0] == 0.0
    ):
        return ALL_LIGHTS
    return rules.specular_lights


@inlined
def is_sampled(world, sampled, light):
    """Return whether a light is among those that are sampled at a vertex."""
    lights = world.lights
    if light >= lights.kind.size:
        return lights.chance[light] > 0.0 and sampled != NO_LIGHTS
    if sampled != ALL_LIGHTS or lights.chance[light] == 0.0:
        return False
    return lights.kind[light] == RECTANGLE or lights.kind[light] == SPHERE


@inlined
def only_medium(stack, i):
    """Return the lobe that a ray is within, `NONE`, or -2 if there are several."""
    found = NONE
    for k in range(STACK):
        if stack[i, k] != NONE:
            if found != NONE:
                return -2
            found = stack[i, k]
    return found


@inlined(cached=True)
def end_of_way(world, vertex, light, s, t):
    """Sample a point of a light, or a direction of the sky, by (s, t).

    Returns the point or direction, the normal there (of the sky: the opposite direction), the pdf
    per area or solid angle, with the chance of the light, and the radiance.
    """
    lights = world.lights
    if light == lights.kind.size:
        x, y, z = sky_direction(world.sky, s, t)
        r, g, b = sky_radiance(world.sky, x, y, z)
        pdf = sky_pdf(world.sky, x, y, z) * lights.chance[light]
        return x, y, z, -x, -y, -z, pdf, r, g, b
    x, y, z, nx, ny, nz, _, pdf = leaving_point(lights, vertex.light_point, 0, light, s, t)
    r, g, b = chosen_strength(lights, world.textures, vertex.light_point, 0, light, s, t, x, y, z)
    return x, y, z, nx, ny, nz, pdf * lights.chance[light], r, g, b


@inlined
def pdf_of_end(world, light, paths):
    """Return the pdf of `end_of_way` for what a path has run into."""
    chance = world.lights.chance[light]
    if light == world.lights.kind.size:
        d = paths.directions
        return chance * sky_pdf(world.sky, d[0, 0], d[0, 1], d[0, 2])
    return chance * pdf_of_area(world.lights, light, 0.0)


@inlined
def reflectance_of(lobes, lobe, cos_i):
    """Return the reflectance of a dielectric from outside, and the cosine inside."""
    return reflectance_by(lobes, lobe, cos_i, lobes.number[lobe, IOR])


@inlined
def left_by(lobes, lobe, length):
    """Return what clear glass leaves of light after a distance."""
    number = lobes.number
    return (
        math.exp(-number[lobe, ABSORPTION] * length),
        math.exp(-number[lobe, ABSORPTION + 1] * length),
        math.exp(-number[lobe, ABSORPTION + 2] * length),
    )


@inlined
def brought(world, paths, vertices, x, y, z, end, cos_lamp, part, section):
    """Return the contribution of a way that leaves a vertex in the unit direction (x, y, z); or zero.

    Parameters
    ----------
    end : tuple
        What `end_of_way` returns, its pdf times the chance of the body.
    cos_lamp : float
        Of the way to the normal of the lamp.
    part : float
        What the surfaces on the way pass on, and the probability that a path does not leave it.
    section : float
        See the module.
    """
    material, colors, _, normal, direction, geometric, ratio = vertices
    if section <= 0.0 or part <= 0.0 or sides_differ(geometric, normal, 0, direction, x, y, z):
        return 0.0, 0.0, 0.0
    fr, fg, fb, pdf = scattered(
        world.lobes, material[0], colors, 0, normal[0, 0], normal[0, 1], normal[0, 2],
        direction[0, 0], direction[0, 1], direction[0, 2], x, y, z,
        ratio[0] if ratio.size else 0.0, EVERY,
    )  # fmt: skip
    if pdf <= 0.0:
        return 0.0, 0.0, 0.0
    _, _, _, _, _, _, density, r, g, b = end
    factor = part * cos_lamp / (section * density)
    factor *= power_weight(density * section, pdf * part * cos_lamp)
    return (
        factor * fr * r * paths.throughput[0, 0],
        factor * fg * g * paths.throughput[0, 1],
        factor * fb * b * paths.throughput[0, 2],
    )


@inlined
def _square_seen(bodies, body, within, x, y, z):
    """Return (radius / distance of the centre)^2 of the sphere about a body; ``within``, seen from inside."""
    center = bodies.center
    dx, dy, dz = x - center[body, 0], y - center[body, 1], z - center[body, 2]
    square, distance = bodies.square[body], dx * dx + dy * dy + dz * dz
    return square / distance if distance > square else within


@inlined
def _sum_of_squares(bodies, within, x, y, z):
    total = 0.0
    for body in range(bodies.square.size):
        total += _square_seen(bodies, body, within, x, y, z)
    return max(total, SMALL)


@inlined
def chance_of_body(bodies, body, within, x, y, z):
    """Return the probability with which `choose_body` takes a body."""
    return _square_seen(bodies, body, within, x, y, z) / _sum_of_squares(bodies, within, x, y, z)


@inlined
def choose_body(bodies, within, x, y, z, s):
    """Choose a ball or box by s; return it, its chance, and s rescaled to [0, 1) for reuse; -1: none."""
    total = _sum_of_squares(bodies, within, x, y, z)
    left = s * total
    for body in range(bodies.square.size):
        square = _square_seen(bodies, body, within, x, y, z)
        if left < square:
            return body, square / total, min(left / square, 1.0 - 2.0**-53)
        left -= square
    return -1, 0.0, 0.0


@inlined
def take_way(total, value, s):
    """Choose among ways one by one: tell whether this one replaces those before it.

    Parameters
    ----------
    total : float
        Sum of the values of this way and of those before.
    value : float
        Above zero.
    s : float
        In [0, 1).

    Returns
    -------
    is_taken : bool
        With a probability of value / total.
    s : float
        Rescaled to [0, 1) for reuse.
    """
    chance = value / total
    if s < chance:
        return True, s / chance
    return False, (s - chance) / (1.0 - chance)


@inlined
def factor_of_taken(rules, paths, is_sky, total, value, s):
    """Return what the value of the taken way is multiplied by; 0: it is left out.

    It stands for all ways, with their total. Ways to the sky that contribute little together are left out
    by Russian roulette, as their rays cost as much as others.
    """
    keep = 1.0
    if is_sky:
        carried = max(paths.throughput[0, 0], paths.throughput[0, 1], paths.throughput[0, 2])
        keep = min(total / max(rules.rr_radiance * carried, SMALLEST), 1.0)
    return total / (keep * value) if s < keep else 0.0


@inlined
def add_segment(paths, rays, n, source, px, py, pz, target, qx, qy, qz, follows):
    """Write row n of the shadow rays, from p to q, with value 0."""
    write_ray(
        rays, n, paths.camera_ray[0], source, target, (px, py, pz), (qx - px, qy - py, qz - pz),
        (qx, qy, qz), 1.0, (0.0, 0.0, 0.0), follows,
    )  # fmt: skip


@inlined
def add_last_segment(world, paths, rays, n, source, px, py, pz, light, end, r, g, b):
    """Write row n of the shadow rays, from p to a lamp or the sky, with its value."""
    x, y, z = end[0], end[1], end[2]
    target, way, t_max = NONE, (x, y, z), math.inf
    if light == world.lights.kind.size:
        x, y, z = px + x, py + y, pz + z
    else:
        target, way, t_max = world.surface_of_light[light], (x - px, y - py, z - pz), 1.0
    write_ray(
        rays, n, paths.camera_ray[0], source, target, (px, py, pz), way, (x, y, z), t_max, (r, g, b), True
    )  # fmt: skip
