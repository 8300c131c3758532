"""Roots on trimmed surfaces: whether one is inside the loops, and what could change that.

A root counts if its (u, v) is inside (`meshing.kernels.trims`). Whether moving the ray by the band
would change that is asked in space: the distance from the root to the curve S(u(s), v(s)), as seen
along the ray, to first order, S_u and S_v being those at the root. In the same way, but measured in
the tangent plane, the gap of each curve of a model's edge is asked for.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND
from meshing.kernels.jit import inlined, inner
from meshing.kernels.trims import (
    CROSSED,
    INSIDE,
    classify,
    gap_to_loops,
    is_entered,
    state_of_tile,
    widest_reach,
)

# Rays that meet an edge more flatly than this have the gap of a ray that meets it so.
FLATTEST_EDGE = 1e-3
# Tiles, of which there are 512 a side at most, know what is within half of them: a tile's state is taken as it
# is for roots that the band, or the gap, moves by less than a quarter.
NEARBY = 2.0**-11


class Trim(NamedTuple):
    """The loops of a kind's surfaces; one row for each patch or segment, or each surface."""

    loops: Any  # `meshing.kernels.trims.TrimTable`
    member: Any  # (k,) int64: row of its loops
    span: Any  # (k, 4) float64: u0, width in u, v0, width in v on the sheet
    gap: Any  # (k,) float64, lengths of the frame: that of the widest curve
    # (k, 4) float64. Of patches: middle of the object from where rays are counted, and its diameter.
    # Of turned surfaces: where u begins and the share of a turn. Of others: zeros, not read.
    scale: Any


@inlined
def side_of_tile(trim, k, u, v):
    """Return OUTSIDE or INSIDE for points farther from every curve than half a tile, else CROSSED.

    ``u`` and ``v`` may be off by as much.
    """
    span, m = trim.span, trim.member[k]
    return state_of_tile(trim.loops, m, span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3])


@inlined
def is_steady(trim, k, per_u, per_v, band, room):
    """Tell whether band and gap move a root by less than tiles know of.

    They move it by one over the cosine in the tangent plane, a way of 1 there by the root of ``per_u`` in u;
    ``room`` is the square of the cosine.
    """
    span, gap = trim.span, trim.gap[k]
    reach, most = band * band + gap * gap, NEARBY * NEARBY * room
    return (
        reach * per_u * span[k, 1] * span[k, 1] <= most
        and reach * per_v * span[k, 3] * span[k, 3] <= most
    )


@inlined
def sure_side(trim, k, u, v, per_u, per_v, band, room):
    """Return the side of a root that is far from every curve, see `is_steady`; CROSSED: perhaps either.

    Without loops (None) all is INSIDE.
    """
    if trim is None:
        return INSIDE
    return side_of_tile(trim, k, u, v) if is_steady(trim, k, per_u, per_v, band, room) else CROSSED


@inlined
def has_gap(trim, k):
    """Tell whether hits of row k may be EDGE; asked first, since calls with tables take long."""
    if trim is None:
        return False
    return trim.gap[k] > 0.0


@inlined
def across_rows(trim, k, v):
    """Return the v on the whole surface of a v of row k; without loops (None) the same."""
    if trim is None:
        return v
    return trim.span[k, 2] + v * trim.span[k, 3]


@inlined
def band_of_ray(trim, k, ox, oy, oz):
    """Return 64 eps x scale for a ray from o, as rays of row k are counted; 0 without loops."""
    if trim is None:
        return 0.0
    ax, ay, az = ox - trim.scale[k, 0], oy - trim.scale[k, 1], oz - trim.scale[k, 2]
    return TANGENT_BAND * max(np.sqrt(ax * ax + ay * ay + az * az), trim.scale[k, 3])


@inlined
def _box(reach, square_u, square_v, area):
    """Return how far a way of ``reach`` in the plane of S_u and S_v leads in u and v, at most 1."""
    if area <= 0.0:
        return 1.0, 1.0
    return (
        min(reach * np.sqrt(square_v) / area, 1.0),
        min(reach * np.sqrt(square_u) / area, 1.0),
    )


@inner(outlined=True)
def decide(trim, k, u, v, ux, uy, uz, vx, vy, vz, dx, dy, dz, band):
    """Decide about a root of row k; without loops (None) it is a hit.

    ``u``, ``v``: of the root; ux ... vz: S_u and S_v there; dx, dy, dz: the ray, of any length.
    ``band``: 64 eps x scale.
    Returns ``is_hit``: it is inside the loops, or outside within the gap.
    ``is_within``: moving the ray by the band, or rounding, may change that.
    ``edge``: what the gap adds to the bound of t, in lengths of the frame; 0: the root is no EDGE.
    """
    if trim is None:
        return True, False, 0.0
    span, loops, m = trim.span, trim.loops, trim.member[k]
    u, v = span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3]
    wide, high = 1.0 / span[k, 1], 1.0 / span[k, 3]
    ux, uy, uz, vx, vy, vz = ux * wide, uy * wide, uz * wide, vx * high, vy * high, vz * high
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    dd = dx * dx + dy * dy + dz * dz
    seen = abs(nx * dx + ny * dy + nz * dz) / np.sqrt(dd)
    # As seen along the ray: what is left of S_u and S_v across it.
    a, b = (ux * dx + uy * dy + uz * dz) / dd, (vx * dx + vy * dy + vz * dz) / dd
    px, py, pz, qx, qy, qz = (
        ux - a * dx, uy - a * dy, uz - a * dz, vx - b * dx, vy - b * dy, vz - b * dz
    )  # fmt: skip
    du, dv = _box(band, px * px + py * py + pz * pz, qx * qx + qy * qy + qz * qz, seen)
    # --- mostly all curves are too far away for the band and for the gap
    reach = gap_u = gap_v = 0.0
    if trim.gap[k] > 0.0:
        area = np.sqrt(nx * nx + ny * ny + nz * nz)
        reach = trim.gap[k] / max(seen / max(area, 1e-300), FLATTEST_EDGE)
        gap_u, gap_v = _box(reach, ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, area)
    is_inside, may_be_near = classify(loops, m, u, v, max(du, gap_u), max(dv, gap_v))
    if not may_be_near:
        return is_inside, False, 0.0
    if reach > 0.0:
        edge = widest_reach(loops, m, u, v, gap_u, gap_v, ux, uy, uz, vx, vy, vz, reach)
        if edge > 0.0:
            # The edge of what counts is farther out than the curves are.
            return True, False, edge
    # --- a curve within the band, or within rounding
    gap = gap_to_loops(loops, m, u, v, du, dv, px, py, pz, qx, qy, qz)
    is_within = gap <= band or (
        gap < np.inf and gap_to_loops(loops, m, u, v, 0.0, 0.0, px, py, pz, qx, qy, qz) < np.inf
    )
    return is_inside, is_within, 0.0


@inner(outlined=True)
def may_be_kept(trim, k, u, v, hu, hv):
    """Tell whether any point of row k within hu and hv of (u, v) may be inside the loops."""
    if trim is None:
        return True
    span, m = trim.span, trim.member[k]
    at_u, at_v = span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3]
    hu, hv = hu * span[k, 1], hv * span[k, 3]
    is_inside, may_be_near = classify(trim.loops, m, at_u, at_v, hu, hv)
    return is_inside or (may_be_near and is_entered(trim.loops, m, at_u, at_v, hu, hv))


@inner(outlined=True)
def meets_pole(trim, k, u, v, rho, speed, slope, band):
    """Tell whether a curve enters a pole, or passes it, so near that the band may take a root there.

    Around a pole u turns by any angle within a short way: there a distance to first order says
    nothing. The root is at ``rho`` from the axis, |S_v| is ``speed``, ``slope`` is |n.d| / |d|.
    """
    if trim is None:
        return False
    if rho * slope >= 2.0 * band:
        return False
    span, m = trim.span, trim.member[k]
    at_u, at_v = span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3]
    hv = min((rho + band / max(slope, 1e-300)) / max(speed, 1e-300), 1.0) * span[k, 3]
    _, may_be_near = classify(trim.loops, m, at_u, at_v, 1.0, hv)
    return may_be_near and is_entered(trim.loops, m, at_u, at_v, 1.0, hv)
