"""Roots on trimmed surfaces: whether one is inside the loops, and what could change that.

A root counts if its (u, v) is inside (`meshing.kernels.trims`). Whether moving the ray by the band
would change that is asked in space: the distance from the root to the curve S(u(s), v(s)), as seen
along the ray, to first order, S_u and S_v being those at the root. In the same way, but measured in
the tangent plane, the gap of a model's edge is asked for.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.intersection.kernels.search.tolerances import TANGENT_BAND
from meshing.kernels.jit import inlined, inner
from meshing.kernels.trims import CROSSED, INSIDE, classify, gap_to_loops, state_of_tile, tile_of

# Rays that meet an edge more flatly than this have the gap of a ray that meets it so.
FLATTEST_EDGE = 1e-3
# A tile's state is taken as it is for roots that rounding, or the band, moves by less than this.
NEARBY = 2.0**-20


class Trim(NamedTuple):
    """The loops of a kind's surfaces; one row for each patch or segment, or each surface."""

    loops: Any  # `meshing.kernels.trims.TrimTable`
    member: Any  # (k,) int64: row of its loops
    span: Any  # (k, 4) float64: u0, width in u, v0, width in v on the sheet
    gap: Any  # (k,) float64, lengths of the frame
    is_wide: Any  # (k,) bool: hits within the gap of an edge may be outside the tiles that a curve comes near
    # (k, 4) float64. Of patches: middle of the object from where rays are counted, and its diameter.
    # Of turned surfaces: where u begins and the share of a turn. Of others: zeros, not read.
    scale: Any


@inlined
def quick_side(trim, k, u, v):
    """Return OUTSIDE or INSIDE for points far from every curve, and every gap, else CROSSED."""
    if trim.is_wide[k]:
        return CROSSED
    span, m = trim.span, trim.member[k]
    at_u, at_v = span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3]
    return tile_of(trim.loops, m, at_u, at_v, NEARBY, NEARBY)


@inlined
def side_of_tile(trim, k, u, v):
    """Do as `quick_side` for surfaces of one piece, and u and v known to half a tile."""
    if trim.is_wide[k]:
        return CROSSED
    return state_of_tile(trim.loops, trim.member[k], u, v)


@inlined
def sure_side(trim, k, u, v, far_u, far_v, room):
    """Return the side of a root that the band moves by sqrt(far_u / room) in u; CROSSED: perhaps either.

    Without loops (None) all is INSIDE.
    """
    if trim is None:
        return INSIDE
    span, most = trim.span, NEARBY * NEARBY * room
    if far_u * span[k, 1] * span[k, 1] <= most and far_v * span[k, 3] * span[k, 3] <= most:
        return quick_side(trim, k, u, v)
    return CROSSED


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


@inner
def _distance(trim, k, u, v, px, py, pz, qx, qy, qz, area, reach):
    """Return the side of a point of row k, and its distance from the curves: inf beyond ``reach``.

    A step of 1 in u of the row is the vector p, one in v is q; ``area`` is |p x q|.
    """
    span, m = trim.span, trim.member[k]
    at_u, at_v = span[k, 0] + u * span[k, 1], span[k, 2] + v * span[k, 3]
    wide, high = 1.0 / span[k, 1], 1.0 / span[k, 3]
    px, py, pz, qx, qy, qz = px * wide, py * wide, pz * wide, qx * high, qy * high, qz * high
    area *= wide * high
    du = dv = 1.0
    if area > 0.0:
        du = min(reach * np.sqrt(qx * qx + qy * qy + qz * qz) / area, 1.0)
        dv = min(reach * np.sqrt(px * px + py * py + pz * pz) / area, 1.0)
    is_inside, may_be_near = classify(trim.loops, m, at_u, at_v, du, dv)
    if not may_be_near:
        return is_inside, np.inf
    gap = gap_to_loops(trim.loops, m, at_u, at_v, du, dv, px, py, pz, qx, qy, qz)
    if reach < gap < np.inf and (
        gap_to_loops(trim.loops, m, at_u, at_v, 0.0, 0.0, px, py, pz, qx, qy, qz) == np.inf
    ):
        return is_inside, np.inf
    return is_inside, gap


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
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    dd = dx * dx + dy * dy + dz * dz
    seen = abs(nx * dx + ny * dy + nz * dz) / np.sqrt(dd)
    # As seen along the ray: what is left of S_u and S_v across it.
    a, b = (ux * dx + uy * dy + uz * dz) / dd, (vx * dx + vy * dy + vz * dz) / dd
    is_inside, gap = _distance(
        trim, k, u, v, ux - a * dx, uy - a * dy, uz - a * dz, vx - b * dx, vy - b * dy,
        vz - b * dz, seen, band,
    )  # fmt: skip
    is_within = gap < np.inf
    if trim.gap[k] == 0.0:
        return is_inside, is_within, 0.0
    area = np.sqrt(nx * nx + ny * ny + nz * nz)
    reach = trim.gap[k] / max(seen / max(area, 1e-300), FLATTEST_EDGE)
    _, gap = _distance(trim, k, u, v, ux, uy, uz, vx, vy, vz, area, reach)
    if gap <= reach:
        # The edge of what counts is farther out than the curves are.
        return True, False, reach
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
    return is_inside or (
        may_be_near
        and gap_to_loops(trim.loops, m, at_u, at_v, hu, hv, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0) < np.inf
    )


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
    return (
        may_be_near
        and gap_to_loops(trim.loops, m, at_u, at_v, 1.0, hv, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0) < np.inf
    )
