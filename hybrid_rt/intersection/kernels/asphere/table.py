"""The table of aspheres, with bounds of their sags over steps of w = r^2."""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from meshing.kernels.jit import inlined

# Rounding of the ray in the frame, as a distance: see docs/rounding_aspheres.md.
RAY_NOISE = 34.0 * UNIT_ROUNDOFF

# Columns of the table of bounds.
F0, F1, B0, B1, NOISE = range(5)


class AsphereTable(NamedTuple):
    """Aspheres, each in a frame about its vertex; row k is object ``object_id[k]``."""

    origin: Any  # (k, 4) world; and, in the frame, `meshing.surface.Surface.moved`
    size: Any  # (k,) world: radius of a ball about the vertex; more, if rounding has moved an image
    frame: Any  # (k, 3, 3): rows along u = 0, a quarter turn, the axis
    to_frame: Any  # (k,) powers of two: the ball's radius is 1/2 to 1
    curvature: Any  # (k,) in the frame, as all that follows
    under_root: Any  # (k,): (1 + conic) curvature^2
    coefficient: Any  # (k, n): c, b_0, b_1, ..., see `hybrid_rt.primitives.sag.Sag.expansion`
    rim: Any  # (k, 3): radius of the rim, its square, its height
    height: Any  # (k, 4): lowest and highest z; rounding of F; least band, see `_least_bands`
    noise: Any  # (k,): rounding anywhere, as a distance; with what has moved an image
    bend: Any  # (k,): largest |g''|
    # (k, levels, zones, 5): of F, F' and rounding over 2^level zones of w from each one on
    bounds: Any
    orientation: Any  # (k,): 1 as S_u x S_v of r growing with v, -1 flipped
    object_id: Any  # (k,) int32
    trim: Any  # None: they are whole; else `search.trims.Trim`


def asphere_table(aspheres, object_id, trim=None):
    """Return the table of a list of aspheres, and of the loops that trim all of them."""
    sags = [a.sag.scaled(-a.local_exponent) for a in aspheres]
    zones = [a.local_zones for a in aspheres]
    width = max(3, *(len(sag.coefficients) + 2 for sag in sags)) if sags else 3
    coefficient = np.zeros((len(sags), width))
    for row, sag in zip(coefficient, sags, strict=True):
        row[0], row[1 : len(sag.coefficients) + 2] = sag.expansion
    to_frame = np.array([2.0**-a.local_exponent for a in aspheres])
    rim = np.array([0.5 * a.aperture for a in aspheres]) * to_frame
    rim_height = [float(sag.at(np.array([r * r]))[0][0]) for sag, r in zip(sags, rim, strict=True)]
    steepest = np.array([np.abs(zone.slope).max() for zone in zones])
    bend = np.array([np.abs(zone.bend).max() for zone in zones])
    noise = UNIT_ROUNDOFF * np.array([zone.noise.max() for zone in zones])
    slope_noise = UNIT_ROUNDOFF * np.array([zone.slope_noise.max() for zone in zones])
    moved = np.array([a.moved for a in aspheres])
    off = moved * to_frame
    return AsphereTable(
        origin=np.column_stack([[a.origin for a in aspheres], off]),
        size=np.array([a.ball_radius for a in aspheres]) + 2.0 * moved,
        frame=np.array([np.stack([a.radial, a.binormal, a.axis]) for a in aspheres]),
        to_frame=to_frame,
        curvature=np.array([sag.curvature for sag in sags]),
        under_root=np.array([sag.under_root for sag in sags]),
        coefficient=coefficient,
        rim=np.stack([rim, rim * rim, np.array(rim_height)], axis=1),
        height=np.stack(
            [
                [zone.z[:, 0].min() for zone in zones],
                [zone.z[:, 1].max() for zone in zones],
                slope_noise,
                _least_bands(coefficient[:, 0], noise, slope_noise * rim * rim),
            ],
            axis=1,
        ),
        noise=RAY_NOISE + noise + off,
        bend=2.0 * steepest + 4.0 * rim * rim * bend,
        bounds=np.array([_levels(zone, o) for zone, o in zip(zones, off, strict=True)]),
        orientation=np.array([float(a.orientation) for a in aspheres]),
        object_id=object_id,
        trim=None if trim is None else trim._replace(gap=trim.gap * to_frame),
    )


def _least_bands(centre, noise, slope_noise):
    """Return the least band of each asphere: where terms cancel, decisions are open by their rounding.

    They do if the polynomial is about a ``centre`` other than 0. ``slope_noise`` is the rounding of F times
    the square of the rim.
    """
    return np.where(centre != 0.0, 2.0 * (noise + slope_noise), 0.0)


def _levels(zone, moved):
    """Return bounds (levels, zones, 5) over 1, 2, 4, ... zones from each one on."""
    noise = RAY_NOISE + UNIT_ROUNDOFF * zone.noise[:, None] + moved
    levels = [np.concatenate([zone.slope, zone.bend, noise], axis=1)]
    reach = 1
    while reach < len(zone.slope):
        last = levels[-1]
        other = np.concatenate([last[reach:], np.repeat(last[-1:], reach, axis=0)])
        joined = np.maximum(last, other)
        joined[:, (F0, B0)] = np.minimum(last, other)[:, (F0, B0)]
        levels.append(joined)
        reach *= 2
    return np.stack(levels)


@inlined
def noise_near(bounds, k, w):
    """Return what rounding moves a root at w, in zones, as a distance."""
    last = bounds.shape[2] - 1
    zone = min(max(int(w), 0), last)
    before, behind = max(zone - 1, 0), min(zone + 1, last)
    return max(bounds[k, 0, before, NOISE], bounds[k, 0, zone, NOISE], bounds[k, 0, behind, NOISE])


@inlined
def bounds_between(bounds, k, low, high):
    """Return bounds of F and F' over the w in [low, high], in zones."""
    last = bounds.shape[2] - 1
    first = min(max(int(low), 0), last)
    end = min(max(int(high), first), last)
    level, reach = 0, 1
    while 2 * reach <= end - first + 1:
        level, reach = level + 1, 2 * reach
    other = end + 1 - reach
    return (
        min(bounds[k, level, first, F0], bounds[k, level, other, F0]),
        max(bounds[k, level, first, F1], bounds[k, level, other, F1]),
        min(bounds[k, level, first, B0], bounds[k, level, other, B0]),
        max(bounds[k, level, first, B1], bounds[k, level, other, B1]),
        first == end,
    )
