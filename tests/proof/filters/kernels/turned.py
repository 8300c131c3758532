"""Certain crossings of rays with a surface of revolution: the polynomial in the profile's parameter.

In coordinates (a, x, y) along axis and radii the surface is a = Z(s), x^2 + y^2 = R(s)^2 and the
ray a line. Where a changes along the ray, t = (Z(s) - a0) / a1 and s is a root of

    F(s) = (a1 x0 + (Z(s) - a0) x1)^2 + (a1 y0 + (Z(s) - a0) y1)^2 - a1^2 R(s)^2,

of degree 2n, in Bernstein form. Nearly across the axis that is badly conditioned: some of these rays are
left to exact arithmetic.
"""

import math

from meshing.kernels.jit import inner, kernel
from proof.filters.kernels.balls import GROW, over, sign
from proof.filters.kernels.bernstein import least_slope, solve, steepest, value_at
from proof.filters.kernels.first import finish, note, nothing, start, unsure
from proof.filters.kernels.profiles import build, enter, is_clear, load, row

# Pieces of profiles that are narrower are left.
SMALLEST = 2.0**-44
# Radii of t above this part of the ball's are loose.
LOOSE = 2.0**-58
# How often F is built again, and the narrowest piece for which it is.
MOST_BUILDS, NARROWEST = 5, 2.0**-51


@inner
def _cosine(line, local, n, x, t, length, work):
    """Return |n.d| / |d| at a crossing, in float64."""
    px, py = line[1, 0] + t * line[4, 0], line[2, 0] + t * line[5, 0]
    rho = math.sqrt(px * px + py * py)
    dz, _ = least_slope(local[0], 0.0, n, x, 0.0, work[0])
    dr, _ = least_slope(local[2], 0.0, n, x, 0.0, work[0])
    speed = math.sqrt(dz * dz + dr * dr)
    if speed == 0.0 or rho == 0.0:
        return -1.0
    slope = dz * (px * line[4, 0] + py * line[5, 0]) / rho - dr * line[3, 0]
    return abs(slope) / (speed * length)


@inner
def _piece_around(root, s):
    """Return begin and width of a small dyadic piece that holds one root, with room around it."""
    begin, width, room = root[4], root[5], 16.0 * s[2]
    while width > room:
        half = 0.5 * width
        if s[0] + room < begin + half:
            width = half
        elif s[0] - room > begin + half:
            begin, width = begin + half, half
        else:
            break
    return begin, width


@inner
def _by_height(surface, p, n, behind, reach, scratch, count, length):
    """Solve F(s) = 0; return the number of crossings, and from where on there may be more.

    Where rounding leaves pieces open or t loose, F is built again from these pieces of the profile,
    whose coefficients are smaller. Pieces all of whose t are below ``behind`` are of no interest.
    """
    line, local, pieces = scratch.line, scratch.local, scratch.pieces
    work = scratch.nets[scratch.nets.shape[0] - 2]
    a1, loose = row(line, 3), LOOSE * reach
    if sign(a1) == 0:
        return count, -math.inf
    from_t = math.inf
    pieces[0, 0], pieces[0, 1], pieces[0, 2] = 0.0, 1.0, 0.0
    n_pieces, next_piece = 1, 0
    while next_piece < n_pieces:
        begin, width, age = pieces[next_piece, 0], pieces[next_piece, 1], pieces[next_piece, 2]
        next_piece += 1
        radii = load(surface, p, n, begin, width, scratch)
        steep = steepest(local[0], radii[0], n)
        radius = build(n, p, radii[0], radii[1], surface, scratch)
        n_roots, n_unsure = solve(
            scratch.nets, 2 * n, radius, scratch.roots, scratch.unsure, SMALLEST, scratch.radii,
            scratch.spans,
        )  # fmt: skip
        if n_unsure < 0:
            return count, -math.inf
        for k in range(n_roots):
            s = scratch.roots[k, 0], scratch.roots[k, 1], scratch.roots[k, 2]
            t = over(value_at(local[0], local[1], radii[0], n, s, steep, work), a1)
            if t[2] > loose and age < MOST_BUILDS and n_pieces < pieces.shape[0]:
                x, wide = _piece_around(scratch.roots[k], s)
                if wide <= 0.25 and width * wide >= NARROWEST:
                    pieces[n_pieces, 0], pieces[n_pieces, 1] = begin + width * x, width * wide
                    pieces[n_pieces, 2] = age + 1.0
                    n_pieces += 1
                    continue
            cosine = _cosine(line, local, n, s[0], t[0], length, work)
            count = note(scratch.crossings, count, t, cosine)
        for k in range(n_unsure):
            wide = scratch.unsure[k, 1]
            x = scratch.unsure[k, 0] + 0.5 * wide
            t = over(
                value_at(local[0], local[1], radii[0], n, (x, 0.0, 0.5 * wide), steep, work), a1
            )
            ends = (t[2] + abs(t[1])) * GROW
            if t[0] + ends < behind:
                continue
            is_smaller = wide <= 0.25 and width * wide >= NARROWEST
            if is_smaller and age < MOST_BUILDS and n_pieces < pieces.shape[0]:
                pieces[n_pieces, 0] = begin + width * scratch.unsure[k, 0]
                pieces[n_pieces, 1], pieces[n_pieces, 2] = width * wide, age + 1.0
                n_pieces += 1
            else:
                from_t = min(from_t, t[0] - ends)
    return count, from_t


@inner
def _ray(surface, o, d, leaves, hit_t, scratch, out):
    # |t - shift| of all crossings is below the reach.
    shift, length, reach = start(
        o, d, surface.centre, surface.origin, surface.radius, leaves, scratch.away
    )
    if reach < 0.0:
        nothing(out)
        return
    enter(surface, d, scratch)
    count, from_t = 0, math.inf
    behind = -math.inf if leaves else -shift - 2.0**-50 * abs(shift)
    for p in range(surface.starts.size - 1):
        begin = surface.starts[p]
        n = surface.starts[p + 1] - begin - 1
        if is_clear(surface, begin, n, reach, scratch):
            continue
        count, begins = _by_height(surface, p, n, behind, reach, scratch, count, length)
        from_t = min(from_t, begins)
    from_t = shift + from_t - 2.0**-50 * abs(shift)
    if math.isnan(from_t):
        unsure(out)
        return
    finish(
        scratch.crossings, count, shift, o, length, surface.middle, surface.size, leaves, hit_t,
        from_t, out,
    )  # fmt: skip


@kernel
def first_on_turned(surface, origins, directions, leaves, hit_t, scratch, out):
    """Say of each ray what is certain of its first crossing.

    Parameters
    ----------
    surface : Turned
    origins, directions : (n, 3) float64
    leaves : (n,) bool
    hit_t : (n,) float64
        t of hits on this surface; nan for others.
    scratch : TurnedScratch
    out : (n, N_COLUMNS) float64
        Written.
    """
    for i in range(origins.shape[0]):
        _ray(surface, origins[i], directions[i], leaves[i], hit_t[i], scratch, out[i])
