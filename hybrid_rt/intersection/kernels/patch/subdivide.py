"""The slow, complete solve: all of a cell searched for the first root by bisection.

The net of the cell is written in ray coordinates: two across the ray, one along it. A root is a
point where both coordinates across vanish, so a piece whose hull keeps away from that is dropped,
and a piece whose tangents hardly turn is settled by the Krawczyk test (Krawczyk 1969; Moore,
Kearfott, Cloud 2009, chapter 8). Coordinates of rational patches are times W, which is positive:
the zeros are the same. Hulls are those of the quotients. Everything else is halved along the side that is longer across
the ray, since that is what halves the number of pieces that the ray can meet. (Along a straight
line of the surface, which the ray nearly runs along, the other side would leave both halves in the
ray.) A piece that is thinner than rounding is halved along its longer side in space. Pieces are
taken nearest first.

At a silhouette pieces become thin across the fold before they become short. A piece thinner than
rounding holds no decision to be made: if it is as short as such a piece of a curved surface is, it
is taken as a root, to be probed; if it is long, a flat piece lies edge-on in the ray, and the ray
passes it by with its doubt noted. So does a ray that passes any piece within the band. The first doubt
is all that counts: behind it no piece is asked that cannot hold a root, so a ray along a surface, for
which all pieces are doubtful, costs little more than one that touches it.

Pieces with a collapsed edge are treated apart, in `patch.poles`: all their parts meet all rays
through the point that the edge is, so halving would go on until they are points.
"""

import numpy as np

from hybrid_rt.intersection.kernels.patch.evaluate import evaluate_any
from hybrid_rt.intersection.kernels.patch.nets import (
    columns_of,
    depth_range,
    halve,
    middle_of,
    projected,
    restrict,
    weights_of,
)
from hybrid_rt.intersection.kernels.patch.poles import (
    BESIDE,
    EMPTY,
    NEAR_POINT,
    NO_POLE,
    POINT,
    SINGLE,
    UNKNOWN,
    WIDE,
    collapsed_side,
    meet_pole,
)
from hybrid_rt.intersection.kernels.patch.solve import (
    CONVERGED,
    approach,
    doubt_piece,
    is_inside_loops,
    newton,
    offer_border,
    offer_root,
    rounding_of_root,
)
from hybrid_rt.intersection.kernels.search.counters import (
    GIVEN_UP,
    MOST_PIECES,
    NEWTONS,
    PIECES,
    SLOW,
    STEPS,
)
from hybrid_rt.intersection.kernels.search.nearest import SUSPECT, is_passed, offer
from hybrid_rt.intersection.kernels.search.tolerances import (
    APPROACHES,
    BORDER_SLACK,
    CLEAR_CROSSING,
    DEPTH,
    FLATTEST,
    MAX_PIECES,
    OWNED,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner

# Part of the band that roundings are taken to amount to at most.
MOST_SLOP = 0.5
# Newton from a piece whose Jacobian turns by less than this contracts: 2 q / (1 - q) < 1.
NEWTON_TURN = 0.25
# So many half pieces from its middle Newton may end in a root that is that of the piece.
NEARBY = 4.0
# A piece of which q < 1 holds one root at most, though Newton may fail to find it. One that is no
# thicker than this many slops, and longer than a surface with a radius of curvature of the patch's
# size stays so thin, is asked all the same: its halves would be thinner than rounding.
LAST_CHANCE = 256.0
# How far beside a point the normal is looked at where S_u x S_v may vanish.
NUDGE = 2.0**-20
# A piece beside the ray and thinner than this part of the band is seen to be within it or not.
THIN_BESIDE = 0.25
# A cone is narrowed while the piece is no longer than this in widths.
WIDER = 8.0
# Flat pieces in the ray are halved to this part of the patch, so that it is known where they begin.
LONG = 2.0**-6
# Where tangents are parallel as the ray sees them, a piece of this many slops is as good as a point: very
# many would be left.
SHORT = 64.0
# A rectangle is narrowed to this part of itself where it may hold roots.
NARROWED = 2.0**-5
# What its points may be farther from the ray than its hull.
FARTHER = 1.0 + 2.0 * THIN_BESIDE
# What the Krawczyk test says of a piece.
TURNING, HOLDS_NONE, HOLDS_ONE, CONTRACTS = 0, 1, 2, 3


@inlined
def normals_of(dx, dy, dz):
    """Return two unit normals of a direction and of each other, to 3 u: six numbers.

    The first has two components of d itself, exchanged: it is normal before it is divided.
    """
    if abs(dx) >= abs(dy) and abs(dx) >= abs(dz):
        px, py, pz = -dy, dx, 0.0
    elif abs(dy) >= abs(dz):
        px, py, pz = 0.0, -dz, dy
    else:
        px, py, pz = dz, 0.0, -dx
    qx, qy, qz = dy * pz - dz * py, dz * px - dx * pz, dx * py - dy * px
    p, q = np.sqrt(px * px + py * py + pz * pz), np.sqrt(qx * qx + qy * qy + qz * qz)
    return px / p, py / p, pz / p, qx / q, qy / q, qz / q


@inlined
def rounding_of_net(degree_u, degree_v, rational, size, farthest, across):
    """Bound the rounding of a net's coordinates across the ray, whole, restricted or halved.

    The sum is that of ``docs/rounding_patches.md``, lines N1 to N6. ``farthest`` is the distance of
    a control point from the origin, ``across`` the largest of those coordinates. For a rational net
    (lines Q1 to Q4) it is that of the numerators over their weights.
    """
    sums = 7.0 * (degree_u + degree_v) * across
    if rational is not None and rational:
        return UNIT_ROUNDOFF * (10.0 * farthest + 7.0 * size + sums)
    return UNIT_ROUNDOFF * (9.0 * farthest + 4.0 * size + sums)


@inner
def _steepness(patch, u, v, dx, dy, dz):
    """|n.d| beside a point where S_u x S_v may vanish: a little toward the patch's middle."""
    u += (0.5 - u) * NUDGE
    v += (0.5 - v) * NUDGE
    _, _, _, xu, yu, zu, xv, yv, zv = evaluate_any(
        patch.control, patch.start, patch.degree_u, patch.degree_v, u, v, patch.basis,
        patch.rational,
    )  # fmt: skip
    nx, ny, nz = yu * zv - zu * yv, zu * xv - xu * zv, xu * yv - yu * xv
    length = np.sqrt(nx * nx + ny * ny + nz * nz)
    if length == 0.0:
        return 0.0
    return abs(nx * dx + ny * dy + nz * dz) / length


@inlined
def _from_origin(control, k, ox, oy, oz, rational):
    """Return a control point as seen from the origin, times its weight, and the weight."""
    if rational is None or not rational:
        return control[k, 0] - ox, control[k, 1] - oy, control[k, 2] - oz, 1.0
    w = control[k, 3]
    return control[k, 0] - w * ox, control[k, 1] - w * oy, control[k, 2] - w * oz, w


@inlined
def _write_net(patch, ray, ex, ey, ez, net):
    """Write a patch's net in ray coordinates, the last along e.

    Returns the square of the largest distance from the origin, and the largest coordinate across.
    """
    px, py, pz, qx, qy, qz = normals_of(ray.dx, ray.dy, ray.dz)
    farthest = across = 0.0
    for r in range(patch.degree_u + 1):
        for c in range(patch.degree_v + 1):
            k = patch.start + r * (patch.degree_v + 1) + c
            x, y, z, w = _from_origin(patch.control, k, ray.ox, ray.oy, ray.oz, patch.rational)
            farthest = max(farthest, (x * x + y * y + z * z) / (w * w))
            net[r, c, 0] = px * x + py * y + pz * z
            net[r, c, 1] = qx * x + qy * y + qz * z
            net[r, c, 2] = ex * x + ey * y + ez * z
            across = max(across, abs(net[r, c, 0]) / w, abs(net[r, c, 1]) / w)
            if patch.rational is not None and patch.rational:
                net[r, c, 3] = w
    return farthest, across


@inlined
def _bounds_of(seen, degree_u, degree_v):
    """Return the least and the largest of each coordinate of a net."""
    f0 = g0 = h0 = np.inf
    f1 = g1 = h1 = -np.inf
    for r in range(degree_u + 1):
        for c in range(degree_v + 1):
            f, g, h = seen[r, c, 0], seen[r, c, 1], seen[r, c, 2]
            f0, f1 = min(f0, f), max(f1, f)
            g0, g1 = min(g0, g), max(g1, g)
            h0, h1 = min(h0, h), max(h1, h)
    return f0, f1, g0, g1, h0, h1


@inlined
def _mean_tangents(net, seen, degree_u, degree_v):
    """Return the mean tangents along u and v across the ray, for a step of half the piece.

    And how long the piece is along u and v, across the ray and along it.
    """
    au = av = bu = bv = side_u = side_v = deep_u = deep_v = 0.0
    for r in range(degree_u):
        for c in range(degree_v + 1):
            au += net[r + 1, c, 0] - net[r, c, 0]
            av += net[r + 1, c, 1] - net[r, c, 1]
            f = seen[r + 1, c, 0] - seen[r, c, 0]
            g = seen[r + 1, c, 1] - seen[r, c, 1]
            side_u += abs(f) + abs(g)
            deep_u += abs(seen[r + 1, c, 2] - seen[r, c, 2])
    for r in range(degree_u + 1):
        for c in range(degree_v):
            bu += net[r, c + 1, 0] - net[r, c, 0]
            bv += net[r, c + 1, 1] - net[r, c, 1]
            f = seen[r, c + 1, 0] - seen[r, c, 0]
            g = seen[r, c + 1, 1] - seen[r, c, 1]
            side_v += abs(f) + abs(g)
            deep_v += abs(seen[r, c + 1, 2] - seen[r, c, 2])
    by_u, by_v = 0.5 / (degree_v + 1), 0.5 / (degree_u + 1)
    tangents = (au * by_u, av * by_u, bu * by_v, bv * by_v)
    return tangents, side_u * by_u, side_v * by_v, deep_u * by_u, deep_v * by_v


@inlined
def _bounds_along_tangents(seen, degree_u, degree_v, tangents, slop, reach):
    """Tell whether boxes along both tangents meet the ray: narrow together where they are nearly parallel.

    Returns ``is_met``, ``is_beside``: within the reach of the ray; beyond the slop of it.
    ``long``, ``thin``: sides of the box along the longer tangent, and across it.
    """
    au, av, bu, bv = tangents
    is_beside = False
    x0 = x1 = y0 = y1 = 0.0
    for turn in range(2):
        tx, ty = bu, bv
        if (au * au + av * av >= bu * bu + bv * bv) == (turn == 1):
            tx, ty = au, av
        norm = np.sqrt(tx * tx + ty * ty)
        if norm > 0.0:
            tx /= norm
            ty /= norm
        else:
            tx, ty = 1.0, 0.0
        x0 = y0 = np.inf
        x1 = y1 = -np.inf
        for r in range(degree_u + 1):
            for c in range(degree_v + 1):
                x = seen[r, c, 0] * tx + seen[r, c, 1] * ty
                y = seen[r, c, 1] * tx - seen[r, c, 0] * ty
                x0, x1 = min(x0, x), max(x1, x)
                y0, y1 = min(y0, y), max(y1, y)
        if x0 > reach or x1 < -reach or y0 > reach or y1 < -reach:
            return False, True, 0.0, 0.0
        is_beside = is_beside or x0 > slop or x1 < -slop or y0 > slop or y1 < -slop
    return True, is_beside, x1 - x0, y1 - y0


@inlined
def _height_at(patch, ray, ex, ey, ez, u, v):
    """Return how far along the ray the point at (u, v) is from the origin."""
    x, y, z, _, _, _, _, _, _ = evaluate_any(
        patch.control, patch.start, patch.degree_u, patch.degree_v, u, v, patch.basis,
        patch.rational,
    )  # fmt: skip
    return (x - ray.ox) * ex + (y - ray.oy) * ey + (z - ray.oz) * ez


@inlined
def _offer_touch(i, near, t, thick, n_dot_d, slop, length, patch, ray, rays, best):
    """Offer a piece as short as rounding as a root, to be probed.

    ``near`` is what `approach` returns, ``thick`` how far the piece, around t, extends along the ray.

    Returns ``passes``, ``is_hit``: loops leave it out; it was offered, and is ahead.
    """
    u, v, t_near, gap, there = near
    # Ray and surface are apart by less than the piece is thick, for a length of that thickness over
    # the slope: t is no surer.
    slope = max(n_dot_d, FLATTEST)
    slope = max(min(slope, there / length), FLATTEST)
    t_bound = 0.5 * thick + (4.0 * slop + 2.0 * gap) / slope
    t_bound += abs(t_near - t) * length
    t_world = (t_near + ray.shift) * ray.to_world
    # Far away the rounding of t counts.
    t_bound = t_bound / length * ray.to_world + 2.0 * UNIT_ROUNDOFF * abs(t_world)
    slope *= length
    is_ahead = t_world + t_bound > rays.t_min[i]
    if not is_ahead or is_passed(i, t_world, t_bound, slope, patch.object_id, rays.known):
        return False, False
    is_kept, edge = is_inside_loops(i, u, v, t_near, patch.trim, patch, ray, rays, best)
    if not is_kept:
        # Where along a fold the root is, is open by as much as the piece is long.
        return True, False
    t_bound += edge
    offer(
        i, t_world, t_bound, slope, SUSPECT, patch.object_id, patch.row, u, v,
        rays.t_min, rays.known, best,
    )  # fmt: skip
    return False, t_world > rays.t_min[i]


@inlined
def _test_piece(net, spare, degree_u, degree_v, rational, tangents, slop, reach):
    """Look by the Krawczyk test how far the tangents of a piece turn, through the inverse of their mean.

    Returns ``outcome``: `TURNING`; `HOLDS_NONE`; `HOLDS_ONE` at most; `CONTRACTS`: Newton from the
    piece does.
    ``start_u``, ``start_v``: where Newton begins, half sides of the piece from its middle.
    """
    au, av, bu, bv = tangents
    det = au * bv - av * bu
    if det == 0.0:
        return TURNING, 0.0, 0.0
    y00, y01, y10, y11 = bv / det, -bu / det, -av / det, au / det
    turn_u0 = turn_u1 = turn_v0 = turn_v1 = 0.0
    half = 0.5 * degree_u
    for r in range(degree_u):
        for c in range(degree_v + 1):
            f = half * (net[r + 1, c, 0] - net[r, c, 0])
            g = half * (net[r + 1, c, 1] - net[r, c, 1])
            turn_u0 = max(turn_u0, abs(y00 * f + y01 * g - 1.0))
            turn_u1 = max(turn_u1, abs(y10 * f + y11 * g))
    half = 0.5 * degree_v
    for r in range(degree_u + 1):
        for c in range(degree_v):
            f = half * (net[r, c + 1, 0] - net[r, c, 0])
            g = half * (net[r, c + 1, 1] - net[r, c, 1])
            turn_v0 = max(turn_v0, abs(y00 * f + y01 * g))
            turn_v1 = max(turn_v1, abs(y10 * f + y11 * g - 1.0))
    gain = max(abs(y00) + abs(y01), abs(y10) + abs(y11))
    most, turn_w = weights_of(net, degree_u, degree_v, rational)
    gain *= most
    rounding = gain * slop
    q = max(turn_u0 + turn_v0, turn_u1 + turn_v1) + (degree_u + degree_v) * rounding
    if not q < 1.0:
        return TURNING, 0.0, 0.0
    f, g = middle_of(spare, net, degree_u, degree_v)
    cu, cv = -(y00 * f + y01 * g), -(y10 * f + y11 * g)
    if max(abs(cu), abs(cv)) > 1.0 + q + gain * reach:
        return HOLDS_NONE, 0.0, 0.0
    # Newton's iteration is that of the quotient: a turn of W counts twice.
    outcome = CONTRACTS if q + 2.0 * turn_w < NEWTON_TURN else HOLDS_ONE
    return outcome, min(max(cu, -1.0), 1.0), min(max(cv, -1.0), 1.0)


@inlined
def _refine_from(i, u, v, t, place, contracts, patch, ray, band, rays, best, counters):
    """Start Newton at (u, v, t) in a piece, and offer the root if it is the piece's own.

    Returns ``t``: where the iteration ended.
    ``has_converged``, ``is_settled``, ``is_hit``: it did; nothing is left to be found in the piece;
    its root is the nearest so far.
    """
    um, vm, hu, hv = place
    counters[NEWTONS] += 1
    status, u, v, t, steps, n_dot_d, gain_u, gain_v = newton(patch, ray, u, v, t, hu, hv)
    counters[STEPS] += steps
    is_owner = is_hit = False
    if status == CONVERGED:
        slack = OWNED * rounding_of_root(
            patch.degree_u, patch.degree_v, patch.rational, patch.size,
            ray.ox, ray.oy, ray.oz, ray.dx, ray.dy, ray.dz, t,
        )  # fmt: skip
        slack_u = BORDER_SLACK * hu + slack * gain_u
        slack_v = BORDER_SLACK * hv + slack * gain_v
        in_u, in_v = min(max(u, 0.0), 1.0), min(max(v, 0.0), 1.0)
        is_owner = abs(in_u - um) <= hu + slack_u and abs(in_v - vm) <= hv + slack_v
        if (u != in_u or v != in_v) and (contracts or is_owner):
            offer_border(
                i, u, v, t, n_dot_d, gain_u, gain_v, patch, ray, band, is_owner, rays, best
            )
        elif is_owner:
            is_hit = offer_root(i, u, v, t, n_dot_d, patch, ray, rays, best)
    # The piece's root, if it has one, lies within (1 + q) / (1 - q) half pieces of its middle; any
    # that lies far away is another, and says nothing of the piece.
    is_near = abs(u - um) <= NEARBY * hu and abs(v - vm) <= NEARBY * hv
    is_settled = is_owner or (contracts and status == CONVERGED and is_near)
    return t, status == CONVERGED, is_settled, is_hit


@inlined
def _halve_piece(nets, boxes, top, along_u, degree_u, degree_v, rational):
    """Halve the piece at ``top``; the nearer half comes on top of the other."""
    net, other = nets[top], nets[top + 1]
    halve(net, other, degree_u, degree_v, along_u, rational)
    for c in range(4):
        boxes[top + 1, c] = boxes[top, c]
    first = 0 if along_u else 2
    middle = 0.5 * (boxes[top, first] + boxes[top, first + 1])
    boxes[top, first + 1] = boxes[top + 1, first] = middle
    near_first, _ = depth_range(net, degree_u, degree_v, rational)
    near_second, _ = depth_range(other, degree_u, degree_v, rational)
    if near_first < near_second:
        for r in range(degree_u + 1):
            for c in range(degree_v + 1):
                for k in range(columns_of(rational)):
                    net[r, c, k], other[r, c, k] = other[r, c, k], net[r, c, k]
        for k in range(4):
            boxes[top, k], boxes[top + 1, k] = boxes[top + 1, k], boxes[top, k]


@inlined
def slow_solve(
    i, patch, ray, rectangle, t_lo, t_cut, band, is_moved, offers, rays, best, scratch, counters
):  # fmt: skip
    """Find the first root of ray i in a rectangle (u0, u1, v0, v1) of a patch and offer it.

    t in [t_lo, t_cut] counts lengths of d from o. Pieces without a root, but within ``band`` of the
    ray, are noted as doubts; of rays that are moved nobody asks for these. What is offered depends on
    ray and rectangle only, not on `best`. Without ``offers`` no root is looked for: returned are the ends
    of a rectangle around all pieces that may hold one.
    """
    degree_u, degree_v, rational, size = patch.degree_u, patch.degree_v, patch.rational, patch.size
    shift, to_world, t_min = ray.shift, ray.to_world, rays.t_min
    u0, u1, v0, v1 = rectangle
    nets, boxes = scratch.nets, scratch.boxes
    counters[SLOW] += 1
    # Doubts of other searches leave out nothing here: which of them come first may differ.
    doubt_before = best.doubt[i]
    held_u0, held_u1, held_v0, held_v1 = np.inf, -np.inf, np.inf, -np.inf
    best.doubt[i] = -np.inf if is_moved else np.inf
    dx, dy, dz = ray.dx, ray.dy, ray.dz
    length = np.sqrt(dx * dx + dy * dy + dz * dz)
    ex, ey, ez = dx / length, dy / length, dz / length
    farthest, across = _write_net(patch, ray, ex, ey, ez, nets[0])
    restrict(nets[0], degree_u, degree_v, u0, u1, v0, v1, rational)
    slop = rounding_of_net(degree_u, degree_v, rational, size, np.sqrt(farthest), across)
    # Beyond that the sum of all roundings says nothing; they hardly ever add up.
    slop = min(slop, MOST_SLOP * band)
    # A piece of radius of curvature r is thinner than 2 slop while shorter than 4 sqrt(slop r).
    fold = 4.0 * np.sqrt(slop * max(size, slop))
    reach = max(slop, band)
    boxes[0, 0], boxes[0, 1], boxes[0, 2], boxes[0, 3] = u0, u1, v0, v1
    h_lo = t_lo * length - slop
    h_cut = t_cut * length + slop
    top = 1
    pieces = 0
    while top > 0:
        # --- does the hull come near the ray, within the range of t?
        top -= 1
        net = nets[top]
        seen = projected(net, degree_u, degree_v, scratch.room, rational)
        pieces += 1
        f0, f1, g0, g1, h0, h1 = _bounds_of(seen, degree_u, degree_v)
        if f0 > reach or f1 < -reach or g0 > reach or g1 < -reach or h1 < h_lo or h0 > h_cut:
            continue
        tangents, side_u, side_v, deep_u, deep_v = _mean_tangents(net, seen, degree_u, degree_v)
        is_met, is_beside, long, thin = _bounds_along_tangents(
            seen, degree_u, degree_v, tangents, slop, reach
        )
        if not is_met:
            continue
        is_beside = is_beside or f0 > slop or f1 < -slop or g0 > slop or g1 < -slop
        # Of places beside the ray the first one counts, and of roots before t_min that there is one.
        t_first = ((h0 - slop) / length + shift) * to_world
        is_behind = ((h1 + slop) / length + shift) * to_world <= t_min[i]
        is_late = t_first >= best.doubt[i]
        if (is_beside and (is_behind or is_late)) or (is_behind and best.doubt[i] <= t_min[i]):
            continue
        um, vm = 0.5 * (boxes[top, 0] + boxes[top, 1]), 0.5 * (boxes[top, 2] + boxes[top, 3])
        hu, hv = 0.5 * (boxes[top, 1] - boxes[top, 0]), 0.5 * (boxes[top, 3] - boxes[top, 2])
        is_point = max(f1 - f0, g1 - g0, h1 - h0) <= 4.0 * slop
        is_long = h1 - h0 > LONG * size
        # --- without a root, but perhaps within the band; or too small to be told from a point, or too
        # thin to hold a decision
        may_pass = is_beside and (is_point or (thin < THIN_BESIDE * reach and not is_long))
        is_thin = not may_pass and (is_point or (thin < 2.0 * slop and not is_beside))
        is_root = passes = False
        n_dot_d, t = 0.0, 0.5 * (h0 + h1) / length
        # --- beside a collapsed edge, of which all of u, say, is one point
        start_u = start_v = 0.0
        known_of = UNKNOWN
        side = NO_POLE if is_point else collapsed_side(seen, degree_u, degree_v, slop)
        if side != NO_POLE:
            known_of, along, away = meet_pole(
                net, degree_u, degree_v, rational, side, slop, reach, nets[top + 1]
            )
            if known_of == EMPTY:
                continue
            away = 1.0 - 2.0 * away if side % 2 else 2.0 * away - 1.0
            along = 2.0 * along - 1.0
            start_u, start_v = (along, away) if side >= 2 else (away, along)
            if known_of in (POINT, BESIDE):
                um, vm, hu, hv = um + hu * start_u, vm + hv * start_v, 0.0, 0.0
                is_root, passes = known_of == POINT, known_of == BESIDE
                may_pass = is_thin = False
                h0 = h1 = _height_at(patch, ray, ex, ey, ez, um, vm)
                t = h0 / length
                n_dot_d = _steepness(patch, um, vm, ex, ey, ez)
        if is_thin:
            n_dot_d = _steepness(patch, um, vm, ex, ey, ez)
            is_flat = n_dot_d < CLEAR_CROSSING
            short = fold if is_flat else SHORT * slop
            is_root = is_point or (long < short and h1 - h0 < short)
            passes = is_flat and not is_root and not is_long
            if is_flat and is_long and is_late:
                continue
        # --- a root or a doubt that is not to be divided
        if may_pass or (is_root and offers):
            near = approach(patch, ray, um, vm, um - hu, um + hu, vm - hv, vm + hv, APPROACHES)
            if may_pass:
                passes = near[3] <= FARTHER * reach
            else:
                is_left_out, is_hit = _offer_touch(
                    i, near, t, h1 - h0, n_dot_d, slop, length, patch, ray, rays, best
                )
                passes |= is_left_out
                if is_hit:
                    h_cut = min(h_cut, h0)
            t = near[2]
        if passes:
            doubt_piece(i, t, reach, um, vm, hu, hv, patch, ray, rays, best)
        if passes or (is_root and offers) or (may_pass and is_point):
            continue
        # --- does it hold one root at most?
        outcome = TURNING
        is_single = known_of in (SINGLE, NEAR_POINT)
        if not is_single and not is_root:
            outcome, begin_u, begin_v = _test_piece(
                net, nets[top + 1], degree_u, degree_v, rational, tangents, slop, reach
            )
            if outcome == HOLDS_NONE:
                continue
            if outcome != TURNING:
                start_u, start_v = begin_u, begin_v
        is_last = outcome != TURNING and thin < LAST_CHANCE * slop and long**2 > 16.0 * thin * size
        may_hold = outcome == CONTRACTS or is_last or is_single
        is_wide = may_hold and not offers and 2.0 * hu > NARROWED * (u1 - u0)
        is_tall = may_hold and not offers and 2.0 * hv > NARROWED * (v1 - v0)
        if not offers and (may_hold or is_root) and not (is_wide or is_tall):
            held_u0, held_u1 = min(held_u0, boxes[top, 0]), max(held_u1, boxes[top, 1])
            held_v0, held_v1 = min(held_v0, boxes[top, 2]), max(held_v1, boxes[top, 3])
            continue
        if may_hold and offers:
            # What is left along the ray has to be small: nearly in the tangent plane its
            # rounding alone would move u by more than the piece.
            u, v = um + hu * start_u, vm + hv * start_v
            t, has_converged, is_settled, is_hit = _refine_from(
                i, u, v, _height_at(patch, ray, ex, ey, ez, u, v) / length, (um, vm, hu, hv),
                outcome == CONTRACTS, patch, ray, band, rays, best, counters,
            )  # fmt: skip
            if is_hit:
                h_cut = min(h_cut, t * length)
            if is_settled:
                continue
            # So near the point the ray's root is that of a neighbour.
            if known_of == NEAR_POINT and has_converged:
                doubt_piece(i, t, reach, um, vm, hu, hv, patch, ray, rays, best)
                continue
        # --- halve the longer side
        if top + 2 > DEPTH - 1 or pieces >= MAX_PIECES:
            if not offers:
                held_u0, held_u1, held_v0, held_v1 = u0, u1, v0, v1
                break
            counters[GIVEN_UP] += 1
            # None of the pieces that wait has been looked at: any may be nearer than this one.
            for k in range(top):
                near_depth, _ = depth_range(nets[k], degree_u, degree_v, rational)
                h0 = min(h0, near_depth)
            best.doubt[i] = min(best.doubt[i], (h0 / length + shift) * to_world)
            break
        if thin < 2.0 * slop or (is_beside and (is_long or thin < THIN_BESIDE * reach)):
            side_u += deep_u
            side_v += deep_v
        # A wide cone is narrowed along its edge.
        along_u = is_wide or (side_u >= side_v and not is_tall)
        if known_of == WIDE and side >= 2:
            along_u = WIDER * side_u >= side_v
        elif known_of == WIDE:
            along_u = side_u > WIDER * side_v
        _halve_piece(nets, boxes, top, along_u, degree_u, degree_v, rational)
        top += 2
    best.doubt[i] = min(best.doubt[i], doubt_before)
    counters[PIECES] += pieces
    counters[MOST_PIECES] = max(counters[MOST_PIECES], pieces)
    return held_u0, held_u1, held_v0, held_v1
