"""The part of a disc that surfaces cover: nets, wires and fringes leave most of it empty.

Density estimation divides the power of photons by the area of the whole disc. Where surfaces cover a
part of it only, the estimate is too dark by that part, and discs of half the area may lose as much, so
that no estimate of blur sees it. There it is divided by the part that is covered, as is common at borders:
Jensen, "Realistic image synthesis using photon mapping", 2001, section 7.2.

A short segment across the disc, at a random point, meets a surface that photons of the disc may lie on,
or none. The number of segments up to the first success has the mean 1 / coverage: an unbiased factor.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.density_estimate import (
    LARGEST_HEIGHT,
    LEAST_COSINE,
    segments_to_photons,
)
from hybrid_rt.integrators.media.contacts import Contacts
from hybrid_rt.integrators.photons.density_estimation import Places, Points
from hybrid_rt.shading.kernels.lobes.register import WIDE

# Segments are sent until so many have met a surface. The variance of the factor, relative to its square, is
# (1 - coverage) over that: at a coverage of a quarter about that of a sum over 24 photons.
SUCCESSES = 4
# Segments from each point at most; of a coverage below 1 / 64 no more is made good.
MOST_SEGMENTS = 64 * SUCCESSES
# Surfaces that a segment passes at most.
MOST_LAYERS = 4
# Squared share of a segment that it ends off the surface at least, where anything may lie in between: more
# than the thousandth that it ends off a plane.
LEAST_LIFT = 4e-6
# Light differs by layer and by direction, and every disc that spans a net of round wires mixes them. So much
# of the share that lies off the plane, and that is turned, counts as blur: from wires before a white ceiling.
OFF_PLANE, TURNED = 0.25, 0.25
# Discs that are covered by less than this are wider than what they lie on: at a straight edge it is half.
THIN, SEGMENTS = 0.4, 32
# So are those around which, within so many radii, most have gaps. Few segments show some of them.
AROUND, MOST, SOME = 3.0, 0.5, 0.12
# Thin things may lie between places of the pilot set: each stands for what is as near as this neighbour.
NEAREST_PLACES = 8

Draw = Callable[[NDArray[np.intp], int, int], FloatArray]
"""Takes rows, the number of a draw and how many draws; returns points (draws, rows, 2) in [0, 1)."""


class ThinPlaces(Places):
    """Where discs are wider than what they lie on, by a pilot set of points.

    At a straight edge half of a disc is empty, and beside it discs are full: there light is only blurred.
    Thin are places where less than `THIN` is covered, and those around which most discs have gaps.
    Points within their reach have a thin place beside them.
    """

    @classmethod
    def of(
        cls,
        context: RenderContext,
        contacts: Contacts | None,
        points: Points,
        radius: FloatArray,
        draw: Draw,
    ) -> ThinPlaces | None:
        """Measure at these points; return None if there are none."""
        from scipy.spatial import cKDTree

        n_met, every = np.zeros(radius.size), cKDTree(points.position)

        def look(rows: NDArray[np.intp], first: int, stop: int) -> FloatArray:
            """Send segments from these rows; return the share of discs around them that have gaps."""
            xi = draw(rows, first, stop - first)
            weight, _ = _covering(
                context, contacts, points, radius, LARGEST_HEIGHT * radius, rows, xi
            )
            n_met[rows] += (weight > 0.0).sum(axis=0)
            gaps = cKDTree(points.position[rows[n_met[rows] < stop]])
            ball = points.position[rows], AROUND * radius[rows]
            n_gaps, n = (tree.query_ball_point(*ball, return_length=True) for tree in (gaps, every))
            return n_gaps / n

        rows = np.arange(radius.size)
        # Most discs are full, and so are those around them, as few segments tell.
        rows = rows[(look(rows, 0, SUCCESSES) > SOME) | (n_met < SUCCESSES - 1)]
        if rows.size:
            share = look(rows, SUCCESSES, SEGMENTS)
            rows = rows[(n_met[rows] < THIN * SEGMENTS) | (share > MOST)]
        if not rows.size:
            return None
        found, _ = every.query(points.position[rows], [min(NEAREST_PLACES, radius.size)])
        distance = np.asarray(found, dtype=np.float64)[:, 0]
        return cls(points.position[rows], np.maximum(distance, radius[rows]))


def one_over_coverage(
    context: RenderContext,
    contacts: Contacts | None,
    points: Points,
    radius: FloatArray,
    height: FloatArray,
    draw: Draw,
) -> tuple[FloatArray, FloatArray]:
    """Return, for each disc, an unbiased estimate of its area over that covered by surfaces.

    ``contacts``: finds the surfaces that glass lies on.
    ``radius``, ``height`` (n,): of the disc, and how far from its plane photons may lie.
    Returns ``factor``, ``mixed`` (n,): the factor is exactly 1 where no segment fails, on a plane.
    ``mixed`` is the share of the light that other layers and other directions of the surface may
    have made different.
    """
    n = radius.size
    n_sent, n_found, total, mixed = np.zeros((4, n))
    first = 0
    while first < MOST_SEGMENTS:
        rows = np.flatnonzero(n_found < SUCCESSES)
        if not rows.size:
            break
        # As many again as before: few rounds of many segments.
        xi = draw(rows, first, max(first, SUCCESSES))
        first += len(xi)
        weight, off = _covering(context, contacts, points, radius, height, rows, xi)
        is_met = weight > 0.0
        counts = n_found[rows] + np.cumsum(is_met, axis=0) - is_met < SUCCESSES
        n_sent[rows] += counts.sum(axis=0)
        n_found[rows] += (counts & is_met).sum(axis=0)
        total[rows] += np.where(counts, weight, 0.0).sum(axis=0)
        mixed[rows] += np.where(counts, off, 0.0).sum(axis=0)
    # Where none has met a surface, nothing is known.
    is_met = n_found > 0.0
    total = np.where(is_met, total, 1.0)
    return np.where(is_met, n_sent, 1.0) / total, mixed / total


def _covering(
    context: RenderContext,
    contacts: Contacts | None,
    points: Points,
    radius: FloatArray,
    height: FloatArray,
    rows: NDArray[np.intp],
    xi: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return what segments across the discs of some rows find, and what of it is mixed light.

    They count what photons are gathered on, by the same rules: not too far from the tangent plane, not turned
    too far, not behind walls. A surface turned by an angle a has 1 / cos a of the area of its projection, and
    of even light (1 + cos a) / 2 comes from above the tangent plane, whence alone photons count.

    ``xi`` (draws, rows, 2) in [0, 1).
    Returns ``weight``, ``off`` (draws, rows): the weight is 0 where there is no surface, and 1 for
    a plane.
    """
    shape = xi.shape[:2]
    rows = np.tile(rows, shape[0])
    x, angle = xi[..., 0].ravel(), 2.0 * math.pi * xi[..., 1].ravel()
    normal = (points.geometric if points.geometric.size else points.normal)[rows]
    is_under = np.einsum("ij,ij->i", normal, points.direction[rows]) > 0.0
    up = np.where(is_under[:, None], -normal, normal)
    # Duff et al., "Building an orthonormal basis, revisited", JCGT 6(1), 2017.
    sign = np.copysign(1.0, up[:, 2])
    a = -1.0 / (sign + up[:, 2])
    b = up[:, 0] * up[:, 1] * a
    e1 = np.stack([1.0 + sign * up[:, 0] ** 2 * a, sign * b, -sign * up[:, 0]], axis=1)
    e2 = np.stack([b, sign + up[:, 1] ** 2 * a, -up[:, 1]], axis=1)
    # Epanechnikov's kernel is a density 2 (1 - s) of the squared distance s, in radii.
    square = 1.0 - np.sqrt(1.0 - x)
    away = radius[rows] * np.sqrt(square)
    centre = points.position[rows]
    origin = centre + (away * np.cos(angle))[:, None] * e1 + (away * np.sin(angle))[:, None] * e2
    origin += height[rows][:, None] * up
    scene = context.scene
    stores = scene.materials_with(WIDE)[scene.material_of]
    weight, off = np.zeros((2, rows.size))
    left, length, source = np.arange(rows.size), 2.0 * height[rows], None
    for _ in range(MOST_LAYERS):
        context.ledger.rays["across discs"] += left.size
        hits = context.tracer.intersect(origin, -up[left], t_max=length, source=source)
        if contacts is not None:
            contacts.at(hits, origin, -up[left], source)
        met = np.flatnonzero(hits.hit)
        if not met.size:
            break
        hits, left, length = hits[met], left[met], length[met] - hits.t[met]
        origin, source = hits.position, NamedPoints(hits.object_id, hits.position)
        offset = origin - centre[left]
        ratio = np.einsum("ij,ij->i", offset, offset) / radius[rows[left]] ** 2
        cosine = np.einsum("ij,ij->i", hits.normal, up[left])
        may = stores[hits.object_id] & (np.abs(cosine) >= LEAST_COSINE) & (ratio < 1.0)
        good = np.flatnonzero(may)
        facing = hits.normal[good] * np.copysign(1.0, cosine[good])[:, None]
        named = NamedPoints(hits.object_id[good], origin[good])
        good = good[_are_seen(context, points, rows[left[good]], named, facing)]
        on, cosine = left[good], np.abs(cosine[good])
        found = (1.0 - ratio[good]) / (1.0 - square[on]) * 0.5 * (1.0 + 1.0 / cosine)
        steps = np.abs(np.einsum("ij,ij->i", offset[good], up[on])) / height[rows[on]]
        weight[on] += found
        off[on] += found * (TURNED * (1.0 - cosine) + OFF_PLANE * steps)
    return weight.reshape(shape), off.reshape(shape)


def _are_seen(
    context: RenderContext,
    points: Points,
    rows: NDArray[np.intp],
    named: NamedPoints,
    normal: FloatArray,
) -> BoolArray:
    """Tell whether photons may lie there, on the side of the normal, and not hidden from points."""
    origin, way = np.empty((rows.size, 3)), np.empty((rows.size, 3))
    own = points.geometric if points.geometric.size else points.normal
    number = np.arange(rows.size)
    segments_to_photons(
        number, points.position[rows], own[rows], points.direction[rows], number, named.position,
        normal.astype(np.float32), origin, way,
    )  # fmt: skip
    seen = np.ones(rows.size, dtype=np.bool_)
    apart = np.flatnonzero(way.any(axis=1))
    context.ledger.rays["across discs"] += apart.size
    seen[apart] = ~context.tracer.occluded(origin[apart], way[apart], 1.0)
    # The segment ends off the surface: from the inner side of a thin body it may end outside.
    lift = origin + way - named.position
    is_off = np.einsum("ij,ij->i", lift, lift) > LEAST_LIFT * np.einsum("ij,ij->i", way, way)
    apart = apart[seen[apart] & is_off[apart]]
    lift = lift[apart]
    context.ledger.rays["across discs"] += apart.size
    source = NamedPoints(named.object_id[apart], named.position[apart])
    seen[apart] = ~context.tracer.occluded(source.position, lift, 1.0, source=source)
    return seen
