"""The search of a ray within the rim: pieces of which g is known to have at most two roots."""

import numpy as np

from hybrid_rt.intersection.kernels.asphere.solve import (
    bound_of_root,
    doubt_kept,
    find_extremum,
    find_root,
    gradient,
    is_grazing,
    look,
    side_of_root,
)
from hybrid_rt.intersection.kernels.asphere.table import bounds_between, noise_near
from hybrid_rt.intersection.kernels.search.nearest import doubt, is_left_behind, not_zero, offer
from hybrid_rt.intersection.kernels.search.tolerances import (
    MAX_PIECES,
    NEAR_BEGIN,
    UNIT_ROUNDOFF,
)
from meshing.kernels.jit import inlined, inner

# Halvings of the ray: shorter pieces than 2^-48 are points.
DEPTH = 48
# Rounding of g' and g'', over the sizes of their terms.
SLOPE_NOISE = 2.0**-44
# Rims this many bands from a hit, across the surface, do not concern it.
BESIDE_RIM = 8.0


@inner
def offer_sag_root(i, k, line, s, near, shift, per_t, rims, table, rays, best):
    """Offer the root at s; tell whether the search of this surface ends with it."""
    to_world = 1.0 / table.to_frame[k]
    moved = table.origin[k, 3]
    t = not_zero((shift + s * per_t) * to_world, moved)
    if t > best.t[i]:
        return True
    reach = NEAR_BEGIN * per_t * to_world
    if not (near or moved > 0.0) and is_left_behind(i, t, reach, rays.t_min, rays.known):
        return False
    first_rim, second_rim, band = rims
    coefficient, noise, bend = table.coefficient, table.noise[k], table.bend[k]
    _, slope, _, rate = look(line, coefficient, k, s)
    cosine = abs(slope) / gradient(line, s, rate)
    near = near or is_grazing(line, coefficient, k, s, band, bend)
    if not near:
        x, y = line.x + s * line.vx, line.y + s * line.vy
        zones = table.bounds.shape[2] / table.rim[k, 1]
        noise = noise_near(table.bounds, k, (x * x + y * y) * zones)
    bound = bound_of_root(line, coefficient, k, s, noise, bend, near) * per_t
    bound += 4.0 * UNIT_ROUNDOFF * (abs(shift) + abs(s * per_t))
    if not t + bound * to_world > rays.t_min[i]:
        return False
    from_rim = min(abs(s - first_rim), abs(s - second_rim))
    is_tangent = near or from_rim * cosine <= BESIDE_RIM * band
    is_kept, is_within, edge, u, v = side_of_root(table.trim, k, line, s, table, band)
    if not is_kept:
        if is_within:
            doubt(i, t, band * to_world, rays.t_min, rays.known, best)
        elif is_tangent:
            doubt_kept(i, k, line, s, t, band, table, rays, best)
        return False
    bound += edge * per_t
    is_tangent |= is_within
    return offer(
        i, t, bound * to_world, cosine / per_t, is_tangent, table.object_id[k], 0, u, v,
        rays.t_min, rays.known, best,
    )  # fmt: skip


@inlined
def search(i, k, line, lo, hi, shift, per_t, rims, table, rays, best):
    """Offer the roots of g in [lo, hi], one after the other, until one is taken."""
    coefficient, band = table.coefficient, rims[2]
    to_world = 1.0 / table.to_frame[k]
    per_zone = table.bounds.shape[2] / table.rim[k, 1]
    nearest = -line.turn / line.across if line.across > 0.0 else 0.0
    sx, sy = line.x + nearest * line.vx, line.y + nearest * line.vy
    least = sx * sx + sy * sy
    width, index, depth = hi - lo, 0, 0
    ga, slope_a, _, _ = look(line, coefficient, k, lo)
    for _ in range(MAX_PIECES):
        # --- the piece [a, b], and bounds over its w
        a, b = lo + index * width, lo + (index + 1) * width
        gb, slope_b, _, _ = look(line, coefficient, k, b)
        ax, ay = line.x + a * line.vx, line.y + a * line.vy
        bx, by = line.x + b * line.vx, line.y + b * line.vy
        wa, wb = ax * ax + ay * ay, bx * bx + by * by
        low, high = min(wa, wb), max(wa, wb)
        if a < nearest < b:
            low = least
        f0, f1, b0, b1, is_fine = bounds_between(table.bounds, k, low * per_zone, high * per_zone)
        if is_fine:
            # Within a zone F changes by no more than F' allows.
            rate = look(line, coefficient, k, a)[3]
            change = max(abs(b0), abs(b1)) * (high - low) + SLOPE_NOISE * abs(rate)
            change += table.height[k, 2]
            f0, f1 = max(f0, rate - change), min(f1, rate + change)
        p, q = 2.0 * (line.turn + line.across * a), 2.0 * (line.turn + line.across * b)
        steepest = max(abs(f0), abs(f1))
        most = max(abs(p), abs(q))
        wrong = SLOPE_NOISE * (1.0 + steepest * most)
        lowest = min(f0 * p, f0 * q, f1 * p, f1 * q) + wrong
        highest = max(f0 * p, f0 * q, f1 * p, f1 * q) - wrong
        is_inside, will_be = ga <= 0.0, gb <= 0.0
        # --- g has one root in [a, middle] or none, as its ends tell, and so in [middle, b]
        middle, g_middle = b, gb
        near = is_flat = touches = splits = False
        if not (line.vz > highest + 2.0 * wrong or line.vz < lowest - 2.0 * wrong):
            # --- it may not run one way
            square_high = most * most
            square_low = 0.0 if p * q <= 0.0 else min(p * p, q * q)
            twice = 2.0 * line.across
            least_bend = min(b0 * square_low, b0 * square_high) + twice * f0
            most_bend = max(b1 * square_low, b1 * square_high) + twice * f1
            largest = max(abs(least_bend), abs(most_bend))
            clear = (band + table.noise[k]) * np.sqrt(1.0 + 4.0 * high * steepest * steepest)
            long = b - a
            sagitta = 0.125 * largest * long * long
            least_g = min(abs(ga), abs(gb))
            slack = SLOPE_NOISE * largest
            if is_inside == will_be and least_g > sagitta + clear:
                pass
            elif least_bend > slack or most_bend < -slack:
                # --- it bends one way: two roots at most, on both sides of the extremum
                sign = -1.0 if least_bend > slack else 1.0
                if sign * slope_a <= 0.0 <= sign * slope_b:
                    middle = find_extremum(line, coefficient, k, a, b, sign, clear)
                    g_middle, _, _, rate = look(line, coefficient, k, middle)
                    near = abs(g_middle) < band * gradient(line, middle, rate)
                    touches = near and is_inside == (g_middle <= 0.0) == will_be
            elif depth >= DEPTH or (
                abs(gb - ga) + 2.0 * sagitta <= 0.125 * clear and least_g <= clear
            ):
                # --- along the surface, within the band
                near = is_flat = True
                touches = is_inside == will_be
            else:
                splits = True
        if splits:
            width, index, depth = 0.5 * width, 2 * index, depth + 1
            continue
        for part in range(2):
            if part == 0:
                begin, end, g_begin, g_end = a, middle, ga, g_middle
            else:
                begin, end, g_begin, g_end = middle, b, g_middle, gb
            if (g_begin <= 0.0) != (g_end <= 0.0):
                s = 0.5 * (a + b)
                if not is_flat:
                    s = find_root(line, coefficient, k, begin, end, g_begin, g_end)
                if offer_sag_root(i, k, line, s, near, shift, per_t, rims, table, rays, best):
                    return
        if touches:
            s = 0.5 * (a + b) if is_flat else middle
            t = (shift + s * per_t) * to_world
            doubt_kept(i, k, line, s, t, band, table, rays, best)
            # An image that was moved may be met on both sides of it; contacts are of order 4, mostly.
            reach = 2.0 * np.sqrt(np.sqrt(table.origin[k, 3])) * per_t * to_world
            if not t > rays.t_min[i] and t + reach > rays.t_min[i]:
                best.doubt[i] = min(best.doubt[i], rays.t_min[i])
        ga, slope_a = gb, slope_b
        index += 1
        while depth > 0 and index % 2 == 0:
            width, index, depth = 2.0 * width, index // 2, depth - 1
        if depth == 0:
            return
    # Given up: what is left of the ray is in doubt.
    t = (shift + (lo + index * width) * per_t) * to_world
    best.doubt[i] = min(best.doubt[i], max(t, rays.t_min[i]))
