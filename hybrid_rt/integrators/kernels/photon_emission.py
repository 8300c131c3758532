"""Photon emission: origin, direction and power of each photon.

Each light has two kinds of photons. Some follow its emission profile; others are aimed, by the
projection map, at bounding spheres of objects that cast caustics. A photon's power is the light's
radiance over the combined pdf of both kinds (the balance heuristic of Veach and Guibas, "Optimally
combining sampling techniques for Monte Carlo rendering", SIGGRAPH 1995), so aiming introduces no
bias.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.environment import sky_direction, sky_pdf, sky_radiance
from hybrid_rt.shading.kernels.light_kinds import (
    chosen_strength,
    distance_through,
    largest_share,
    leaving_direction,
    leaving_point,
    opposite_point,
    share_of_direction,
    shares_together,
)
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined, kernel


class Targets(NamedTuple):
    """Bounding spheres of surfaces that cast caustics; n rows."""

    center: Any  # (n, 3) float64
    radius: Any  # (n,) float64


class Launch(NamedTuple):
    """Photons at emission; n rows."""

    origin: Any  # (n, 3) float64
    direction: Any  # (n, 3) float64, unit
    power: Any  # (n, 3) float64, W


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
def _cone_chance(lights, row, nx, ny, nz, ax, ay, az, cone):
    """Return how often a target is aimed at before others: about what the light sends there."""
    return cone * largest_share(lights, row, nx, ny, nz, ax, ay, az, cone)


@inlined
def _see_targets(lights, row, targets, px, py, pz, nx, ny, nz, cones):
    """See all targets from p: write axis, 1 - cos and chance of each; return the sum of chances."""
    total = 0.0
    for k in range(targets.radius.size):
        ax, ay, az, cone = _cone(targets, k, px, py, pz)
        chance = _cone_chance(lights, row, nx, ny, nz, ax, ay, az, cone)
        cones[k, 0], cones[k, 1], cones[k, 2], cones[k, 3], cones[k, 4] = ax, ay, az, cone, chance
        total += chance
    return total


@inlined
def _aimed_pdf(cones, total, dx, dy, dz):
    """Return the density per steradian with which `_aim` chooses direction d."""
    found = 0.0
    for k in range(cones.shape[0]):
        cone, chance = cones[k, 3], cones[k, 4]
        if chance == 0.0:
            continue
        # |d - a|^2 / 2 is 1 - cos without its cancellation.
        x, y, z = dx - cones[k, 0], dy - cones[k, 1], dz - cones[k, 2]
        if 0.5 * (x * x + y * y + z * z) <= cone:
            found += chance / (2.0 * math.pi * cone)
    return found / total if total > 0.0 else 0.0


@inlined
def _aim(cones, total, choice, s, t):
    """Choose a direction toward one of the targets; zero where the light sends nothing."""
    if total == 0.0:
        return 0.0, 0.0, 0.0
    rest = choice * total
    bx = by = bz = least = 0.0
    for k in range(cones.shape[0]):
        chance = cones[k, 4]
        if chance == 0.0:
            continue
        bx, by, bz, least = cones[k, 0], cones[k, 1], cones[k, 2], cones[k, 3]
        if rest < chance:
            break
        rest -= chance
    less = s * least
    return onto_axis(
        bx, by, bz, 1.0 - less, math.sqrt(max(less * (2.0 - less), 0.0)), 2.0 * math.pi * t
    )


@kernel(allocates=True)
def launch_from_lights(
    lights, textures, points, light, targets, n_spread, n_aimed, is_aimed, place, way, choice, cones,
    out,
):  # fmt: skip
    """Emit photons from lights.

    Parameters
    ----------
    points : LightPoints of n rows
        Only for lights of kind `SURFACE`; without them it may be empty.
    light : (n,) int64
        Rows of the lights. The arrays below may have more rows.
    targets : Targets
    n_spread, n_aimed : (n,) int64
        Photons per pass of either kind from this light.
    is_aimed : (n,) int64
        The kind to emit.
    place, way : (n, 2) float64 in [0, 1)
        Sample the point and the direction.
    choice : (n,) float64 in [0, 1)
        Samples the target.
    cones : (targets, 5) float64, written
        Scratch memory: the targets as seen from one point.
    out : Launch of n rows, written
        Power is zero where the light emits nothing in that direction.
    """
    for i in range(light.size):
        row, s, t = light[i], place[i, 0], place[i, 1]
        through = distance_through(lights, row)
        px, py, pz, nx, ny, nz, area, _ = leaving_point(lights, points, i, row, s, t)
        total = 0.0
        if n_aimed[i] > 0:
            total = _see_targets(lights, row, targets, px, py, pz, nx, ny, nz, cones)
        # Of light that may leave through the far side, the targets are seen from there as well.
        sx, sy, sz, mx, my, mz = px, py, pz, nx, ny, nz
        if is_aimed[i]:
            dx, dy, dz = _aim(cones, total, choice[i], way[i, 0], way[i, 1])
            if through > 0.0 and nx * dx + ny * dy + nz * dz < 0.0:
                px, py, pz = opposite_point(lights, row, px, py, pz, nx, ny, nz)
                nx, ny, nz = -nx, -ny, -nz
        else:
            dx, dy, dz = leaving_direction(lights, row, nx, ny, nz, way[i, 0], way[i, 1])
        out.origin[i, 0], out.origin[i, 1], out.origin[i, 2] = px, py, pz
        out.direction[i, 0], out.direction[i, 1], out.direction[i, 2] = dx, dy, dz
        share = share_of_direction(lights, row, nx, ny, nz, dx, dy, dz)
        factor = 0.0
        if share > 0.0 and dx * dx + dy * dy + dz * dz > 0.0:
            density = n_spread[i] * (share / shares_together(lights, row))
            if n_aimed[i] > 0:
                aimed = _aimed_pdf(cones, total, dx, dy, dz)
                if through > 0.0:
                    x, y, z = sx - through * mx, sy - through * my, sz - through * mz
                    total = _see_targets(lights, row, targets, x, y, z, -mx, -my, -mz, cones)
                    aimed += _aimed_pdf(cones, total, dx, dy, dz)
                density += n_aimed[i] * aimed
            factor = share * area / density
        r, g, b = chosen_strength(lights, textures, points, i, row, s, t, px, py, pz)
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


@kernel(allocates=True)
def launch_from_sky(sky, world, targets, n_spread, n_aimed, is_aimed, place, way, choice, out):
    """Emit photons from the environment, along directions importance-sampled by its radiance.

    Parameters
    ----------
    world : (4,) float64
        Centre and radius of the scene's bounding sphere. Photons start on a disc of this radius in
        front of it; aimed photons start on the part in front of their target.
    place, way, choice, n_spread, n_aimed, is_aimed, targets, out
        See `launch_from_lights`.
    """
    squares = 0.0
    for k in range(targets.radius.size):
        squares += targets.radius[k] * targets.radius[k]
    radius = world[3]
    for i in range(place.shape[0]):
        x, y, z = sky_direction(sky, way[i, 0], way[i, 1])
        cx, cy, cz, size = world[0], world[1], world[2], radius
        if is_aimed[i]:
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
            density = n_spread[i] / (math.pi * radius * radius)
        if n_aimed[i] > 0:
            met = _targets_met(targets, px, py, pz, x, y, z)
            density += n_aimed[i] * met / (math.pi * squares)
        density *= sky_pdf(sky, x, y, z)
        factor = 1.0 / density if density > 0.0 else 0.0
        r, g, b = sky_radiance(sky, x, y, z)
        out.power[i, 0], out.power[i, 1], out.power[i, 2] = factor * r, factor * g, factor * b
