"""Light subpaths, and their connections to camera subpaths: bidirectional path tracing for caustics.

A camera path finds a caustic only if a BSDF sample leads by way of a mirror or a lens to a light:
rarely, and then with a large value. A light subpath finds it often. The techniques are combined by the
power heuristic (Veach, "Robust Monte Carlo methods for light transport simulation", 1997, chapters 9
and 10). Of all connections of bidirectional path tracing one family is used.

A surface is narrow if all its non-delta lobes are (satin metal, frosted glass), else it is wide. A
light subpath goes on from delta lobes and from narrow surfaces; of two wide surfaces in a row it ends at
the second. Each wide surface before is a light vertex: camera paths are connected to it, and so is the
camera itself, by a splat.

Every path has one connection at most. Its vertex next to the light is the wide surface at which the light
subpath comes to its end; its other one is the camera, or a wide surface, or a narrow one by which the
camera sees it by way of narrow and delta lobes alone. (Behind a wide surface that is seen so, the light
subpath goes on from the narrow one to that.) A narrow surface that the camera sees straight is splatted
as well, unless it got the light straight from the light, or from a wide surface that is connected to it.

So there are two techniques for each such path: the camera's alone, and one connection. If the first
surface behind the light is narrow, next-event estimation there is a third.

Only the choice of the lobe has a probability at a delta lobe, the same in both directions, and
n^2 dA cos dw is invariant. So the ratio of the two pdfs depends only on the light and on non-delta
vertices: from the light, P(light) pdf_area / pi over the index squared there; from the camera, the
pdf per area of the connected point, times the pdf per projected solid angle of the direction
sampled there, over the index squared there; and at vertices between, the pdfs of the two directions
per projected solid angle, each over the index squared of its medium (two media meet at rough
glass).

All other light between diffuse surfaces can be found by connections alone (Keller, "Instant
radiosity", SIGGRAPH 1997): one light subpath in `FOLLOWED_FAR` is followed from surface to surface,
and its vertices are kept too. A camera path is connected to one of them at its first diffuse vertex,
and does not go on from the next one. As a connection has a variance without bound where its ends are
close, nearer than a set distance the path goes on instead: either way finds what the other leaves,
without weights (Kollig and Keller, "Illumination in the presence of weak singularities", MCQMC
2004).
"""

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.shading.kernels.bsdf import (
    lobe_chance,
    pick_lobe,
    scattered,
    sides_differ,
)
from hybrid_rt.shading.kernels.light_kinds import (
    SURFACE,
    chosen_strength,
    leaving_direction,
    leaving_point,
    pdf_of_light,
)
from hybrid_rt.shading.kernels.lobes.register import (
    EVERY,
    SPREADS,
    TRANSMITS,
    delta_direction,
    spread_direction,
    spreads_here,
)
from hybrid_rt.shading.kernels.medium_stack import (
    filling_medium,
    ior_of,
    pass_surface,
)
from hybrid_rt.shading.kernels.scatter import density_of_turn
from meshing.kernels.jit import inlined, kernel

# One light subpath in so many is followed from surface to surface.
FOLLOWED_FAR = 8


class LightPaths(NamedTuple):
    """Active light subpaths, in the order of their indices."""

    sample: Any  # (n,) uint64, pass
    number: Any  # (n,) uint64, within the pass; both name the path's random numbers
    origins: Any  # (n, 3) float64
    directions: Any  # (n, 3) float64, unit
    flux: Any  # (n, 3) float64, of one pass: the paths of a pass carry what the lights send out
    # (n,) float64, over that of the same path from the camera behind the joined point; per area and
    # projected solid angle times index^2
    density: Any
    is_direct: Any  # (n,) bool, no delta lobe or narrow surface since the lamp or surface that sent the light
    # (n,) bool, camera paths are connected to the last wide surface on the way: from a narrow one that came
    # next
    is_left: Any
    media: Any  # (n, STACK) int32, or (n, 0)
    source_id: Any  # (n,) int32, object that the ray leaves from
    begins_late: Any  # (n,) bool, a mirror or lens came first
    light_id: Any  # (n,) int32
    cosine: Any  # (n,) float64, of the direction in which it left the light


class LightVertices(NamedTuple):
    """Light vertices: points with a non-delta lobe that light subpaths reach, see the module."""

    position: Any  # (n, 3) float64
    normal: Any  # (n, 3) float64, to shade by
    geometric: Any  # (n, 3) float64, of the surface itself
    direction: Any  # (n, 3) float64, unit, of the light as it arrives
    material: Any  # (n,) int32
    colors: Any  # (n, lobes of a material at most, 3) float64
    flux: Any  # (n, 3) float64
    density: Any  # (n,) float64, see `LightPaths`; 0: of all other light, see the module
    strength: Any  # (n,) float64, about the largest channel of flux times albedo
    square: Any  # (n,) float64, index squared of where the light comes from
    # (n,) float64, index beyond the surface over that, where rough glass spreads light; else 0
    ratio: Any
    object_id: Any  # (n,) int32
    # (n,) int64, directions taken at surfaces on the way; one more if the first was by a mirror or
    # lens, which must not be the last that a camera path takes
    steps: Any


@kernel(allocates=True)
def leave_lights(
    lights, textures, points, emit, light_id, place, turn, scale, origin, direction, flux, density,
    cosine,
):  # fmt: skip
    """Begin a light subpath at the light of each row.

    Parameters
    ----------
    points : LightPoints
        For rows that begin on a `SURFACE`; may be empty if there are none.
    emit : (lights + 1,) float64
        Probability of each light.
    place, turn : (n, 2) float64 in [0, 1)
        Sample the point and the direction.
    scale : float
        One over the number of paths that share the lights' power.
    origin, direction, flux : (n, 3) float64, written
    density : (n,) float64, written
        pdf per area and projected solid angle, in vacuum.
    cosine : (n,) float64, written
        Of the direction to the light's normal.
    """
    for i in range(light_id.size):
        row = light_id[i]
        s, t = place[i, 0], place[i, 1]
        x, y, z, nx, ny, nz, _, pdf_area = leaving_point(lights, points, i, row, s, t)
        origin[i, 0], origin[i, 1], origin[i, 2] = x, y, z
        r, g, b = chosen_strength(lights, textures, points, i, row, s, t, x, y, z)
        # The cosine of the direction's density is that of the light it carries.
        factor = 0.0
        density[i] = 0.0
        if pdf_area > 0.0:
            factor = math.pi * scale / (pdf_area * emit[row])
            density[i] = emit[row] * pdf_area / math.pi
        flux[i, 0], flux[i, 1], flux[i, 2] = factor * r, factor * g, factor * b
        dx, dy, dz = leaving_direction(lights, row, nx, ny, nz, turn[i, 0], turn[i, 1])
        direction[i, 0], direction[i, 1], direction[i, 2] = dx, dy, dz
        cosine[i] = nx * dx + ny * dy + nz * dz


@inlined
def is_followed_far(paths, i):
    """Tell whether a light subpath goes on where other light is scattered; see the module."""
    return paths.number[i] % np.uint64(FOLLOWED_FAR) == np.uint64(0)


@inlined
def is_treated_as_specular(paths, i, lights, narrow, material, steps):
    """Return whether a light subpath treats narrow surface ``material`` as specular.

    Not from one that a light of kind `SURFACE` shines on: its points are chosen otherwise by next-event
    estimation than they are left by.
    """
    if not narrow[material] or paths.density[i] == 0.0:
        return False
    return steps > 0 or lights.kind[paths.light_id[i]] != SURFACE


@kernel(allocates=True)
def store_light_vertices(paths, lobes, narrow, vertices, object_id, steps, keeps_all, out, row):
    """Store the light vertices of the paths that hit a non-delta surface; return how many.

    Parameters
    ----------
    paths : LightPaths of n rows
    lobes : LobeTable
    narrow : (materials + 1,) bool
    vertices : Vertices of n rows
        The hits of the paths' rays.
    object_id : (n,) int32
    steps : int
        Number of bounces so far.
    keeps_all : bool
        Whether vertices of all light are stored; else those of light by way of delta lobes and narrow
        surfaces.
    out : LightVertices of n rows or more, written
    row : (n,) int32, written
        Rows of the stored paths.
    """
    material, colors, position, normal, direction, geometric, ratio = vertices
    n = 0
    for i in range(material.size):
        if material[i] < 0:
            continue
        # Of light by way of delta lobes there is a vertex of each path, of other light one in a few.
        is_other = paths.is_direct[i] or paths.density[i] == 0.0
        if is_other and not (keeps_all and is_followed_far(paths, i)):
            continue
        # Narrow surfaces send it on, or to the camera, but camera paths are not connected to them.
        if narrow[material[i]] and (is_other or paths.is_left[i]):
            continue
        factor = FOLLOWED_FAR if is_other and paths.density[i] > 0.0 else 1.0
        start = lobes.first[material[i]]
        spreads = 0.0
        at = ratio[i] if ratio.size else 0.0
        for j in range(lobes.first[material[i] + 1] - start):
            if spreads_here(lobes, start + j, at):
                spreads += lobe_chance(lobes, start + j, colors, i, j, SPREADS)
        strength = spreads * factor * max(paths.flux[i, 0], paths.flux[i, 1], paths.flux[i, 2])
        if strength <= 0.0:
            continue
        square = 1.0
        if paths.media.shape[1] > 0:
            square = ior_of(lobes, filling_medium(paths.media, i, lobes)) ** 2
        for k in range(3):
            out.position[n, k] = position[i, k]
            out.normal[n, k] = normal[i, k]
            out.geometric[n, k] = geometric[i, k] if geometric.shape[0] else normal[i, k]
            out.direction[n, k] = direction[i, k]
            out.flux[n, k] = factor * paths.flux[i, k]
            for j in range(colors.shape[1]):
                out.colors[n, j, k] = colors[i, j, k]
        row[n] = i
        out.material[n] = material[i]
        out.density[n] = 0.0 if is_other else paths.density[i]
        out.strength[n] = strength
        out.square[n] = square
        out.ratio[n] = at
        out.object_id[n] = object_id[i]
        out.steps[n] = steps + paths.begins_late[i]
        n += 1
    return n


@inlined
def leave_surface(lobes, vertices, i, row, ratio, nx, ny, nz, xi, eta, branch):
    """Continue light subpath i at a non-delta surface.

    Returns the direction, whether it is transmitted, the factors on flux, the factor on the ratio of
    the pdf from the light to that from the camera, and the pdf per solid angle with which a camera path
    would leave toward the light; all zero if the path ends.
    """
    material, colors, _, normal, direction, geometric, _ = vertices
    dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
    x, y, z, is_through = spread_direction(
        lobes, row, ratio, nx, ny, nz, dx, dy, dz, xi, eta, branch
    )
    _, _, _, pdf = scattered(
        lobes, material[i], colors, i, nx, ny, nz, dx, dy, dz, x, y, z, ratio, EVERY
    )
    # Seen from the other end of the direction.
    reverse = 1.0 / ratio if is_through else ratio
    r, g, b, back = scattered(
        lobes, material[i], colors, i, nx, ny, nz, -x, -y, -z, -dx, -dy, -dz, reverse, EVERY
    )
    if (
        pdf <= 0.0
        or back <= 0.0
        or (nx * x + ny * y + nz * z < 0.0) != is_through
        or sides_differ(geometric, normal, i, direction, x, y, z)
    ):
        return x, y, z, is_through, 0.0, 0.0, 0.0, 0.0, 0.0
    # The cosine in f cos is the shading normal's, that of the flux is the surface's own.
    turn = density_of_turn(normal, geometric, i, x, y, z, dx, dy, dz, 1.0)
    factor = turn / pdf
    # Over the projected solid angle of either direction, and the index squared of where it runs.
    denser = pdf / (back * turn) if turn > 0.0 else 0.0
    if is_through:
        denser /= ratio * ratio
    return x, y, z, is_through, factor * r, factor * g, factor * b, denser, back


@inlined
def weight_against_next_event(paths, i, lights, position, back):
    """Return 1 / sqrt(1 + (p_nee / p_bsdf)^2) at the first surface, which is narrow.

    Light subpaths are weighted against two techniques there: the root of the sum of the squares of both
    pdfs, by next-event estimation and by BSDF sampling (``back``, per solid angle), takes their place.
    """
    row = paths.light_id[i]
    px, py, pz = position[i, 0], position[i, 1], position[i, 2]
    x, y, z = px - paths.origins[i, 0], py - paths.origins[i, 1], pz - paths.origins[i, 2]
    t = math.sqrt(x * x + y * y + z * z)
    if paths.cosine[i] <= 0.0:
        return 1.0
    by_light = lights.chance[row] * pdf_of_light(lights, row, px, py, pz, t, paths.cosine[i], 0.0)
    return 1.0 / math.hypot(1.0, by_light / back)


@kernel(allocates=True)
def extend_light_paths(
    paths, lobes, lights, narrow, vertices, object_id, is_smooth, second, choice, xi, steps,
    keeps_all, out,
):  # fmt: skip
    """Extend light subpaths by one bounce, and drop those that end; return how many are left.

    At a wide surface that is lit directly only delta lobes are followed: light that non-delta lobes
    scatter there is found from the camera.

    Parameters
    ----------
    lights : LightTable
    narrow : (materials + 1,) bool
    vertices, object_id
        As in `store_light_vertices`.
    is_smooth : (objects,) bool
        Objects with interpolated shading normals: n^2 dA cos dw is not invariant at their delta
        lobes, so light subpaths end there.
    second : (n,) int32, or (0,)
        Faces that coincide with the hits: see `hybrid_rt.shading.kernels.medium_stack`.
    choice : (n, 2) float64 in [0, 1)
        The first column samples the lobe, the second is for Russian roulette.
    xi : (n, 2) float64 in [0, 1)
        Samples the direction.
    steps, keeps_all : int, bool
        As in `store_light_vertices`.
    out : LightPaths, written
    """
    material, colors, position, normal, direction, _, ratio = vertices
    n = 0
    for i in range(material.size):
        if material[i] < 0:
            continue
        chosen, chance, rest = pick_lobe(lobes, material[i], colors, i, choice[i, 0], EVERY)
        row = lobes.first[material[i]] + chosen
        if chance == 0.0:
            continue
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        is_front = nx * dx + ny * dy + nz * dz < 0.0
        if not is_front:
            nx, ny, nz = -nx, -ny, -nz
        at = ratio[i] if ratio.size else 0.0
        spreads = spreads_here(lobes, row, at)
        denser = 1.0
        passes = spreads and is_treated_as_specular(paths, i, lights, narrow, material[i], steps)
        is_other = paths.density[i] == 0.0 or (paths.is_direct[i] and not passes)
        if spreads:
            if is_other and not (keeps_all and is_followed_far(paths, i)):
                continue
            x, y, z, is_through, r, g, b, denser, back = leave_surface(
                lobes, vertices, i, row, at, nx, ny, nz, xi[i, 0], xi[i, 1], rest
            )
            if passes and steps == 0 and back > 0.0:
                denser *= weight_against_next_event(paths, i, lights, position, back)
            if is_through:
                pass_surface(row, paths.media, i, is_front, second)
        else:
            if is_smooth[object_id[i]]:
                continue
            # Power passes glass whole; it is radiance that changes by the index squared.
            x, y, z, _, is_colored = delta_direction(
                lobes, row, paths.media, i, nx, ny, nz, dx, dy, dz, is_front, second, rest
            )
            r = g = b = lobes.weight[row] / chance
            if is_colored:
                # Glass has its share of the mixture beside its tint, mirrors have it in the colour.
                share = r if lobes.traits[row] & TRANSMITS else 1.0 / chance
                r, g, b = (
                    share * colors[i, chosen, 0],
                    share * colors[i, chosen, 1],
                    share * colors[i, chosen, 2],
                )
        r, g, b = r * paths.flux[i, 0], g * paths.flux[i, 1], b * paths.flux[i, 2]
        carried = max(r, g, b)
        if carried <= 0.0:
            continue
        if spreads and is_other:
            if paths.density[i] > 0.0:
                r, g, b = FOLLOWED_FAR * r, FOLLOWED_FAR * g, FOLLOWED_FAR * b
            denser = 0.0
            # Roulette that leaves survivors the power that arrived.
            arrived = max(paths.flux[i, 0], paths.flux[i, 1], paths.flux[i, 2])
            survival = carried / arrived
            if survival < 1.0:
                if choice[i, 1] >= survival:
                    continue
                r, g, b = r / survival, g / survival, b / survival
        out.sample[n] = paths.sample[i]
        out.number[n] = paths.number[i]
        out.directions[n, 0], out.directions[n, 1], out.directions[n, 2] = x, y, z
        out.flux[n, 0], out.flux[n, 1], out.flux[n, 2] = r, g, b
        out.density[n] = paths.density[i] * denser
        out.is_direct[n] = spreads and not passes
        is_left = paths.is_left[i]
        if spreads:
            is_left = passes and (is_left or (paths.is_direct[i] and steps > 0))
        out.is_left[n] = is_left
        out.light_id[n], out.cosine[n] = paths.light_id[i], paths.cosine[i]
        out.begins_late[n] = paths.begins_late[i] or (steps == 0 and not spreads)
        out.source_id[n] = object_id[i]
        for k in range(3):
            out.origins[n, k] = position[i, k]
        for k in range(paths.media.shape[1]):
            out.media[n, k] = paths.media[i, k]
        n += 1
    return n
