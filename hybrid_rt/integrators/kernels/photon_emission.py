"""Photon emission: origin, direction and power of each photon.

The photons of a light come in two kinds. Some follow its emission profile; others are aimed, by the
projection map, at balls around whatever throws caustics. Each carries the light's radiance over the
density of both kinds together (the balance heuristic of Veach and Guibas, "Optimally combining
sampling techniques for Monte Carlo rendering", SIGGRAPH 1995): aiming changes where photons are
many, never the light that they carry.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.core.kernels.sphere_points import onto_sphere
from hybrid_rt.shading.kernels.emitter import POINT, RECTANGLE, SPHERE, light_strength
from hybrid_rt.shading.kernels.environment import sky_direction, sky_pdf, sky_radiance
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined, kernel

WHOLE_SPHERE = 4.0 * math.pi


class Targets(NamedTuple):
    """Balls around surfaces that throw caustics; n rows."""

    center: Any  # (n, 3) float64
    radius: Any  # (n,) float64


class Launch(NamedTuple):
    """Photons on leaving; n rows."""

    origin: Any  # (n, 3) float64
    direction: Any  # (n, 3) float64, unit
    power: Any  # (n, 3) float64, W


@inlined
def _place(lights, row, points, i, s, t):
    """Return a point of a light, its normal, and one over the density per area.

    A point light has no normal; its "area" is one.
    """
    kind = lights.kind[row]
    x, y, z = lights.origin[row, 0], lights.origin[row, 1], lights.origin[row, 2]
    if kind == POINT:
        return x, y, z, 0.0, 0.0, 0.0, 1.0
    if kind == RECTANGLE:
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        area = math.sqrt(nx * nx + ny * ny + nz * nz)
        return (
            x + s * ax + t * bx, y + s * ay + t * by, z + s * az + t * bz,
            nx / area, ny / area, nz / area, area,
        )  # fmt: skip
    if kind == SPHERE:
        radius = lights.edge_u[row, 0]
        nz = 1.0 - 2.0 * s
        ring = math.sqrt(max(1.0 - nz * nz, 0.0))
        nx, ny = ring * math.cos(2.0 * math.pi * t), ring * math.sin(2.0 * math.pi * t)
        area = WHOLE_SPHERE * radius * radius
        px, py, pz = onto_sphere(x + radius * nx, y + radius * ny, z + radius * nz, x, y, z, radius)
        return px, py, pz, nx, ny, nz, area
    density = points.pdf_area[i]
    area = 1.0 / density if density > 0.0 else 0.0
    return (
        points.position[i, 0], points.position[i, 1], points.position[i, 2],
        points.normal[i, 0], points.normal[i, 1], points.normal[i, 2], area,
    )  # fmt: skip


@inlined
def _cone(targets, k, px, py, pz):
    """See a target from p: unit axis, 1 - cos of half its angle (2: p is within the ball)."""
    x, y, z = targets.center[k, 0] - px, targets.center[k, 1] - py, targets.center[k, 2] - pz
    square = x * x + y * y + z * z
    radius = targets.radius[k]
    if square <= radius * radius:
        return 0.0, 0.0, 1.0, 2.0
    distance = math.sqrt(square)
    ratio = radius * radius / square
    return x / distance, y / distance, z / distance, ratio / (1.0 + math.sqrt(1.0 - ratio))


@inlined
def _cone_chance(ax, ay, az, cone, nx, ny, nz):
    """Return how often a target is aimed at before others: about what the light sends there.

    That is its solid angle times the largest cosine to the light's normal; none for a target
    wholly behind the light. With normal zero there is no preference.
    """
    if cone >= 1.0 or nx * nx + ny * ny + nz * nz == 0.0:
        return cone
    cosine = ax * nx + ay * ny + az * nz
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    edge = math.sqrt(cone * (2.0 - cone))
    if cosine >= 1.0 - cone:
        return cone
    return cone * max(cosine * (1.0 - cone) + sine * edge, 0.0)


@inlined
def _aimed_pdf(targets, px, py, pz, nx, ny, nz, dx, dy, dz):
    """Return the density per steradian with which `_aim` chooses direction d."""
    total = found = 0.0
    for k in range(targets.radius.size):
        ax, ay, az, cone = _cone(targets, k, px, py, pz)
        chance = _cone_chance(ax, ay, az, cone, nx, ny, nz)
        if chance == 0.0:
            continue
        total += chance
        # |d - a|^2 / 2 is 1 - cos without its cancellation.
        x, y, z = dx - ax, dy - ay, dz - az
        if 0.5 * (x * x + y * y + z * z) <= cone:
            found += chance / (2.0 * math.pi * cone)
    return found / total if total > 0.0 else 0.0


@inlined
def _aim(targets, px, py, pz, nx, ny, nz, choice, s, t):
    """Choose a direction from p toward one of the targets; zero where all lie behind the light."""
    total = 0.0
    for k in range(targets.radius.size):
        ax, ay, az, cone = _cone(targets, k, px, py, pz)
        total += _cone_chance(ax, ay, az, cone, nx, ny, nz)
    if total == 0.0:
        return 0.0, 0.0, 0.0
    rest = choice * total
    bx = by = bz = least = 0.0
    for k in range(targets.radius.size):
        ax, ay, az, cone = _cone(targets, k, px, py, pz)
        chance = _cone_chance(ax, ay, az, cone, nx, ny, nz)
        if chance == 0.0:
            continue
        bx, by, bz, least = ax, ay, az, cone
        if rest < chance:
            break
        rest -= chance
    less = s * least
    return onto_axis(
        bx, by, bz, 1.0 - less, math.sqrt(max(less * (2.0 - less), 0.0)), 2.0 * math.pi * t
    )


@kernel
def launch_from_light(
    lights, textures, points, row, targets, n_spread, n_aimed, is_aimed, place, way, choice, out
):
    """Let photons leave one light.

    Parameters
    ----------
    points : LightPoints of n rows
        Read for a light of kind `SURFACE` only; else it may be empty.
    row : int
        Of the light.
    targets : Targets
    n_spread, n_aimed : int
        Photons of both kinds that leave this light in one pass.
    is_aimed : bool
        Which kind these are.
    place, way : (n, 2) float64 in [0, 1)
        Choose the point, and the direction.
    choice : (n,) float64 in [0, 1)
        Chooses the target.
    out : Launch of n rows, written
        Power zero: nothing is sent that way.
    """
    for i in range(place.shape[0]):
        s, t = place[i, 0], place[i, 1]
        px, py, pz, nx, ny, nz, area = _place(lights, row, points, i, s, t)
        is_point = lights.kind[row] == POINT
        # Half of a ball faces away from any target. An aimed photon that would leave inward leaves
        # from the opposite point instead; so targets are chosen whichever way the normal is.
        is_ball = lights.kind[row] == SPHERE
        facing = 0.0 if is_ball else 1.0
        if is_aimed:
            dx, dy, dz = _aim(
                targets, px, py, pz, facing * nx, facing * ny, facing * nz, choice[i], way[i, 0],
                way[i, 1],
            )  # fmt: skip
            if is_ball and nx * dx + ny * dy + nz * dz < 0.0:
                across = 2.0 * lights.edge_u[row, 0]
                px, py, pz = onto_sphere(
                    px - across * nx, py - across * ny, pz - across * nz,
                    lights.origin[row, 0], lights.origin[row, 1], lights.origin[row, 2],
                    lights.edge_u[row, 0],
                )  # fmt: skip
                nx, ny, nz = -nx, -ny, -nz
        elif is_point:
            dz = 1.0 - 2.0 * way[i, 0]
            ring = math.sqrt(max(1.0 - dz * dz, 0.0))
            dx = ring * math.cos(2.0 * math.pi * way[i, 1])
            dy = ring * math.sin(2.0 * math.pi * way[i, 1])
        else:
            dx, dy, dz = onto_axis(
                nx, ny, nz, math.sqrt(1.0 - way[i, 0]), math.sqrt(way[i, 0]),
                2.0 * math.pi * way[i, 1],
            )  # fmt: skip
        out.origin[i, 0], out.origin[i, 1], out.origin[i, 2] = px, py, pz
        out.direction[i, 0], out.direction[i, 1], out.direction[i, 2] = dx, dy, dz
        cosine = 1.0 if is_point else nx * dx + ny * dy + nz * dz
        factor = 0.0
        if cosine > 0.0 and dx * dx + dy * dy + dz * dz > 0.0:
            density = n_spread * (1.0 / WHOLE_SPHERE if is_point else cosine / math.pi)
            if n_aimed > 0:
                aimed = _aimed_pdf(
                    targets, px, py, pz, facing * nx, facing * ny, facing * nz, dx, dy, dz
                )  # fmt: skip
                if is_ball:
                    across = 2.0 * lights.edge_u[row, 0]
                    x, y, z = px - across * nx, py - across * ny, pz - across * nz
                    aimed += _aimed_pdf(targets, x, y, z, 0.0, 0.0, 0.0, dx, dy, dz)
                density += n_aimed * aimed
            factor = cosine * area / density
        u, v = s, t
        if points.u.size:
            u, v = points.u[i], points.v[i]
        r, g, b = light_strength(lights, textures, row, u, v, px, py, pz)
        out.power[i, 0], out.power[i, 1], out.power[i, 2] = factor * r, factor * g, factor * b


@inlined
def _targets_met(targets, px, py, pz, dx, dy, dz):
    """Return how many targets the line through p along d meets."""
    n = 0
    for k in range(targets.radius.size):
        x, y, z = targets.center[k, 0] - px, targets.center[k, 1] - py, targets.center[k, 2] - pz
        along = x * dx + y * dy + z * dz
        x, y, z = x - along * dx, y - along * dy, z - along * dz
        if x * x + y * y + z * z <= targets.radius[k] * targets.radius[k]:
            n += 1
    return n


@kernel
def launch_from_sky(sky, world, targets, n_spread, n_aimed, is_aimed, place, way, choice, out):
    """Let photons come in from the sky, along directions chosen by its brightness.

    Parameters
    ----------
    world : (4,) float64
        Centre and radius of a ball around all surfaces: photons start on a disc of this radius
        before it, those that are aimed before the targets' part of it.
    place, way, choice, n_spread, n_aimed, is_aimed, targets, out
        See `launch_from_light`.
    """
    squares = 0.0
    for k in range(targets.radius.size):
        squares += targets.radius[k] * targets.radius[k]
    radius = world[3]
    for i in range(place.shape[0]):
        x, y, z = sky_direction(sky, way[i, 0], way[i, 1])
        cx, cy, cz, size = world[0], world[1], world[2], radius
        if is_aimed:
            rest = choice[i] * squares
            for k in range(targets.radius.size):
                cx, cy, cz = targets.center[k, 0], targets.center[k, 1], targets.center[k, 2]
                size = targets.radius[k]
                if rest < size * size:
                    break
                rest -= size * size
        ring, turn = size * math.sqrt(place[i, 0]), 2.0 * math.pi * place[i, 1]
        # The direction as axis: a disc about the centre, then back out of the ball.
        ex, ey, ez = onto_axis(x, y, z, 0.0, 1.0, turn)
        px, py, pz = cx + ring * ex, cy + ring * ey, cz + ring * ez
        ahead = (world[0] - px) * x + (world[1] - py) * y + (world[2] - pz) * z + 1.001 * radius
        out.origin[i, 0] = px + ahead * x
        out.origin[i, 1] = py + ahead * y
        out.origin[i, 2] = pz + ahead * z
        out.direction[i, 0], out.direction[i, 1], out.direction[i, 2] = -x, -y, -z
        density = 0.0
        wx, wy, wz = px - world[0], py - world[1], pz - world[2]
        along = wx * x + wy * y + wz * z
        if wx * wx + wy * wy + wz * wz - along * along <= radius * radius:
            density = n_spread / (math.pi * radius * radius)
        if n_aimed > 0:
            met = _targets_met(targets, px, py, pz, x, y, z)
            density += n_aimed * met / (math.pi * squares)
        density *= sky_pdf(sky, x, y, z)
        factor = 1.0 / density if density > 0.0 else 0.0
        r, g, b = sky_radiance(sky, x, y, z)
        out.power[i, 0], out.power[i, 1], out.power[i, 2] = factor * r, factor * g, factor * b
