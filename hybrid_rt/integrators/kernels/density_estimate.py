"""Density estimation kernels: the reflected radiance of the photons near a point."""

import math
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.integrators.kernels.photon_steps import IS_SHOWN
from hybrid_rt.shading.kernels.bsdf import scattered
from hybrid_rt.shading.kernels.lobes.register import WIDE
from meshing.kernels.jit import inlined, kernel


class Sums(NamedTuple):
    """Density estimates at n points."""

    value: Any  # (n, 3) float64, reflected radiance
    blur: Any  # (n, 3) float64, `value` minus the estimate by discs of half the area
    near: Any  # (n,) int64, number of photons in each sum
    chosen: Any  # (n,) int64, one of them, sampled by its contribution; -1 if there is none


# Photons of a surface turned farther than this from that of the point belong to another wall.
LEAST_COSINE = 0.5
# Nor do those farther than this from the point's tangent plane, in radii: a sphere of radius R
# leaves its plane by r / 4 at a distance r = R / 2.
LARGEST_HEIGHT = 0.25

# Three large odd numbers spread neighbouring cells over a table.
_X, _Y, _Z = 73856093, 19349663, 83492791


@inlined
def _slot(i, j, k, mask):
    return ((i * _X) ^ (j * _Y) ^ (k * _Z)) & mask


@kernel(allocates=True)
def count_in_cells(position, width, table):
    """Count positions (n, 3) by cells of a hashed grid; ``table`` has a power of two of slots.

    Cells may share a slot, so counts are upper bounds.
    """
    mask = table.size - 1
    for i in range(position.shape[0]):
        a = math.floor(position[i, 0] / width)
        b = math.floor(position[i, 1] / width)
        c = math.floor(position[i, 2] / width)
        table[_slot(a, b, c, mask)] += 1


@kernel(allocates=True)
def most_neighbours(position, radius, width, table, most):
    """Bound from above the number of counted positions within a radius of each given position.

    The cells' ``width`` is at least two radii, so the eight cells nearest a point cover its ball.
    """
    mask = table.size - 1
    for i in range(position.shape[0]):
        a = math.floor((position[i, 0] - radius) / width)
        b = math.floor((position[i, 1] - radius) / width)
        c = math.floor((position[i, 2] - radius) / width)
        la = math.floor((position[i, 0] + radius) / width)
        lb = math.floor((position[i, 1] + radius) / width)
        lc = math.floor((position[i, 2] + radius) / width)
        total = 0
        for p in range(a, la + 1):
            for q in range(b, lb + 1):
                for r in range(c, lc + 1):
                    total += table[_slot(p, q, r, mask)]
        most[i] = total


@kernel(allocates=True)
def add_photons(row, photon, distance, radius, lobes, points, is_direct, photons, xi, sums):
    """Add the contribution of each photon to the points near it.

    Parameters
    ----------
    row, photon, distance : (pairs,)
        A point, a photon near it, and their distance.
    radius : (n,) float64
        Of the disc of each point.
    points : Vertices
        Only wide lobes count.
    is_direct : (n,) bool
        Points that the camera sees directly: photons that were splatted do not count there.
    photons : Photons
    xi : (n,) float64 in [0, 1), changed
        Samples one photon for each point, by its contribution.
    sums : Sums, changed
    """
    material, colors, position, normal, direction, geometric, _ = points
    photon_position, photon_direction, photon_normal, photon_power, history = photons
    value, blur, near, chosen = sums
    for p in range(row.size):
        i, j = row[p], photon[p]
        ratio = (distance[p] / radius[i]) ** 2
        if ratio >= 1.0 or (is_direct[i] and history[j] & IS_SHOWN):
            continue
        # Epanechnikov's kernel: its integral over the disc is one, its mean squared error least.
        weight = 2.0 * (1.0 - ratio) / (math.pi * radius[i] * radius[i])
        if geometric.shape[0]:
            gx, gy, gz = geometric[i, 0], geometric[i, 1], geometric[i, 2]
        else:
            gx, gy, gz = normal[i, 0], normal[i, 1], normal[i, 2]
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        if gx * dx + gy * dy + gz * dz > 0.0:
            gx, gy, gz = -gx, -gy, -gz
        wx, wy, wz = (
            -np.float64(photon_direction[j, 0]),
            -np.float64(photon_direction[j, 1]),
            -np.float64(photon_direction[j, 2]),
        )
        cosine = gx * wx + gy * wy + gz * wz
        if cosine <= 0.0:
            continue
        turned = gx * photon_normal[j, 0] + gy * photon_normal[j, 1] + gz * photon_normal[j, 2]
        if turned < LEAST_COSINE:
            continue
        height = (
            gx * (photon_position[j, 0] - position[i, 0])
            + gy * (photon_position[j, 1] - position[i, 1])
            + gz * (photon_position[j, 2] - position[i, 2])
        )
        if abs(height) > LARGEST_HEIGHT * radius[i]:
            continue
        r, g, b, _ = scattered(
            lobes, material[i], colors, i, normal[i, 0], normal[i, 1], normal[i, 2],
            dx, dy, dz, wx, wy, wz, 0.0, WIDE,
        )  # fmt: skip
        weight /= cosine
        r *= weight * photon_power[j, 0]
        g *= weight * photon_power[j, 1]
        b *= weight * photon_power[j, 2]
        value[i, 0] += r
        value[i, 1] += g
        value[i, 2] += b
        less = 1.0 - max(2.0 * (1.0 - 2.0 * ratio) / (1.0 - ratio), 0.0)
        blur[i, 0] += less * r
        blur[i, 1] += less * g
        blur[i, 2] += less * b
        near[i] += 1
        # Weighted reservoir sampling: a photon replaces the one kept with the probability that is
        # its share of the sum so far; the random number is rescaled to [0, 1) for the next choice.
        total = value[i, 0] + value[i, 1] + value[i, 2]
        share = (r + g + b) / total if total > 0.0 else 0.0
        if xi[i] < share:
            chosen[i] = j
            xi[i] /= share
        else:
            xi[i] = (xi[i] - share) / (1.0 - share) if share < 1.0 else 0.0


@kernel(allocates=True)
def splat_photons(
    lobes, asked, material, colors, normal, geometric, ratio, photon_direction, photon_power, way,
    pdf, value,
):  # fmt: skip
    """Compute the radiance that photons scatter toward the camera.

    Parameters
    ----------
    asked : int
        Traits of the lobes that count, see `hybrid_rt.shading.kernels.bsdf.scattered`.
    material, colors, normal, geometric, ratio : (n, ...)
        Of the photons' hits; ``geometric`` and ``ratio`` as in `hybrid_rt.shading.kernels.bsdf.Vertices`.
        With a ``ratio`` photons are also seen through the surface.
    photon_direction, photon_power : (n, 3) float64
    way : (n, 3) float64
        Vector from the camera to each photon.
    pdf : (n,) float64
        pdf per solid angle of the camera's directions within the pixel; 0 outside the picture.
    value : (n, 3) float64, written
        Radiance added to the pixel if the segment is unoccluded.
    """
    for i in range(pdf.size):
        value[i, 0] = value[i, 1] = value[i, 2] = 0.0
        if pdf[i] <= 0.0:
            continue
        square = way[i, 0] ** 2 + way[i, 1] ** 2 + way[i, 2] ** 2
        distance = math.sqrt(square)
        dx, dy, dz = way[i, 0] / distance, way[i, 1] / distance, way[i, 2] / distance
        if geometric.shape[0]:
            gx, gy, gz = geometric[i, 0], geometric[i, 1], geometric[i, 2]
        else:
            gx, gy, gz = normal[i, 0], normal[i, 1], normal[i, 2]
        wx, wy, wz = -photon_direction[i, 0], -photon_direction[i, 1], -photon_direction[i, 2]
        toward = -(gx * dx + gy * dy + gz * dz)
        cosine = gx * wx + gy * wy + gz * wz
        if toward == 0.0 or cosine == 0.0:
            continue
        # The camera's ray crosses from the other side than the photon if it sees it through the surface.
        across = ratio[i] if ratio.size else 0.0
        if toward * cosine < 0.0:
            if across == 0.0:
                continue
            across = 1.0 / across
        r, g, b, _ = scattered(
            lobes, material[i], colors, i, normal[i, 0], normal[i, 1], normal[i, 2],
            dx, dy, dz, wx, wy, wz, across, asked,
        )  # fmt: skip
        factor = abs(pdf[i] / square * toward / cosine)
        value[i, 0] = factor * r * photon_power[i, 0]
        value[i, 1] = factor * g * photon_power[i, 1]
        value[i, 2] = factor * b * photon_power[i, 2]


@kernel(allocates=True)
def segments_to_photons(
    row, position, normal, direction, chosen, photon_position, photon_normal, origin, way
):
    """Write the shadow segments from points to the photons sampled for them.

    Both ends are offset along the normals: by enough to clear a surface whose curvature is that of
    the photon's height above the tangent plane, plus a thousandth of the segment for a flat one.

    Parameters
    ----------
    row : (k,)
        Points that have a sampled photon.
    origin, way : (k, 3) float64, written
        Start of each segment, and the vector to its end.
    """
    for k in range(row.size):
        i, j = row[k], chosen[row[k]]
        height = square = facing = 0.0
        for c in range(3):
            step = photon_position[j, c] - position[i, c]
            square += step * step
            height += normal[i, c] * step
            facing += normal[i, c] * direction[i, c]
        lift = 0.5 * abs(height) + 1e-3 * math.sqrt(square)
        side = -lift if facing > 0.0 else lift
        for c in range(3):
            origin[k, c] = position[i, c] + side * normal[i, c]
            end = photon_position[j, c] + lift * photon_normal[j, c]
            way[k, c] = end - origin[k, c]
