"""Next-event estimation by way of flat mirrors; see `hybrid_rt.integrators.kernels.ways`.

The way from a surface to a point of a lamp by a flat mirror is the straight one from the mirror image
of the surface. Its narrow pencil of rays spreads as that of the straight one: its cross-section over
its solid angle is the squared length.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.ways import (
    BEFORE,
    PDF,
    add_last_segment,
    add_segment,
    brought,
    end_of_way,
    take_way,
)
from meshing.kernels.jit import inlined, inner

# Shadow rays of one way.
MOST_RAYS = 2


class Mirrors(NamedTuple):
    """Flat mirrors, also as one lobe of several; n rows."""

    corner: Any  # (n, 3) float64
    along: Any  # (n, 2, 3) float64: by these, a point minus the corner gives (u, v)
    normal: Any  # (n, 3) float64
    surface: Any  # (n,) int32
    color: Any  # (n, 3) float64, reflectance
    # (n,) float64, about the probability that a path which comes goes on by the mirror. It is only a
    # weight, the same on both sides.
    chance: Any
    of_surface: Any  # (surfaces,) int32, row of each; -1: none


@inlined
def _height(mirrors, k, x, y, z):
    """Return the distance of a point above mirror k, with a sign."""
    return (
        mirrors.normal[k, 0] * (x - mirrors.corner[k, 0])
        + mirrors.normal[k, 1] * (y - mirrors.corner[k, 1])
        + mirrors.normal[k, 2] * (z - mirrors.corner[k, 2])
    )


@inlined
def _is_on(mirrors, k, x, y, z):
    """Tell whether a point of the plane of mirror k lies on the mirror."""
    x, y, z = x - mirrors.corner[k, 0], y - mirrors.corner[k, 1], z - mirrors.corner[k, 2]
    for side in range(2):
        place = (
            mirrors.along[k, side, 0] * x
            + mirrors.along[k, side, 1] * y
            + mirrors.along[k, side, 2] * z
        )
        if not 0.0 < place < 1.0:
            return False
    return True


@inner
def sample_by_mirrors(world, paths, vertex, vertices, light, s, t, which, rays, n):
    """Sample a point of a lamp, and reach for it by one way by a flat mirror; ``light`` is no sky.

    Parameters and what is returned are those of
    `hybrid_rt.integrators.kernels.through_spheres.sample_through_spheres`.
    """
    mirrors, at, here = world.mirrors, vertex.hit.position, vertex.hit.object_id[0]
    end = end_of_way(world, vertex, light, s, t)
    qx, qy, qz, lx, ly, lz, pdf, er, eg, eb = end
    if pdf == 0.0 or max(er, eg, eb) <= 0.0:
        return n
    px, py, pz = at[0, 0], at[0, 1], at[0, 2]
    total, taken = 0.0, -1
    place = value = (0.0, 0.0, 0.0)
    for k in range(mirrors.chance.size):
        if mirrors.surface[k] == here:
            continue
        below, above = _height(mirrors, k, px, py, pz), _height(mirrors, k, qx, qy, qz)
        if not below * above > 0.0:
            continue
        # --- the straight way from the mirror image
        nx, ny, nz = mirrors.normal[k, 0], mirrors.normal[k, 1], mirrors.normal[k, 2]
        ix, iy, iz = px - 2.0 * below * nx, py - 2.0 * below * ny, pz - 2.0 * below * nz
        x, y, z = qx - ix, qy - iy, qz - iz
        part = below / (below + above)
        mx, my, mz = ix + part * x, iy + part * y, iz + part * z
        if not _is_on(mirrors, k, mx, my, mz):
            continue
        square = x * x + y * y + z * z
        length = math.sqrt(square)
        cos_lamp = -(lx * x + ly * y + lz * z) / length
        if cos_lamp <= 0.0:
            continue
        # --- it leaves the surface in the mirrored direction
        across = 2.0 * (nx * x + ny * y + nz * z)
        chance = mirrors.chance[k]
        r, g, b = brought(
            world, paths, vertices, (x - across * nx) / length, (y - across * ny) / length,
            (z - across * nz) / length, end, cos_lamp, chance, square,
        )  # fmt: skip
        r = r * mirrors.color[k, 0] / chance
        g = g * mirrors.color[k, 1] / chance
        b = b * mirrors.color[k, 2] / chance
        most = max(r, g, b)
        if most <= 0.0:
            continue
        total += most
        is_taken, which = take_way(total, most, which)
        if is_taken:
            taken, place, value = k, (mx, my, mz), (r, g, b)
    if taken < 0:
        return n
    r, g, b = value
    factor = total / max(r, g, b)
    mx, my, mz = place
    surface = mirrors.surface[taken]
    add_segment(paths, rays, n, here, px, py, pz, surface, mx, my, mz, False)
    r, g, b = factor * r, factor * g, factor * b
    add_last_segment(world, paths, rays, n + 1, surface, mx, my, mz, light, end, r, g, b)
    return n + 2


@inlined
def pdf_by_mirror(world, paths, k, after):
    """Return the pdfs of a path by way of mirror k: by BSDF sampling, and by this technique.

    The first is per area, but for the cosine at the lamp; the second is what the pdf of `end_of_way` is
    multiplied by. ``after`` is the length of the way behind the mirror.
    """
    length = paths.anchor[0, BEFORE] + after
    return paths.anchor[0, PDF] * world.mirrors.chance[k] / (length * length), 1.0
