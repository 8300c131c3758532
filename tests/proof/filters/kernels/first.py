"""From all crossings of a ray with one surface to the first one, and what is certain of it."""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner
from proof.filters.kernels.balls import (
    GROW,
    ROUNDING,
    TINY,
    minus,
    plus,
    product,
    sign,
)
from proof.kernels.bands import BAND, LEAST_COSINE
from proof.kernels.double_double import add, two_product, two_sum

# Columns of what is said of a ray and a surface.
FOUND, T, T_ERROR, APART, APART_ERROR, UNSURE_FROM, N_COLUMNS = 0, 1, 2, 3, 4, 5, 6
# Columns of crossings: t as a ball, the cosine (-1: unknown), and 0 for those at the departure.
CROSSING = 5
MOST_CROSSINGS = 96
# A crossing at t = 0 up to half the allowed rounding is left out; of a ray that leaves the surface,
# one between half and twice makes the ray unsure. Of other rays it counts.
NEARLY, BEYOND = 0.5, 2.0
# A point of departure lies so many eps of its coordinates beside its surface.
ROUNDED = 8.0 * 2.0**-52


class Scratch(NamedTuple):
    """Working memory of one thread."""

    away: Any  # (3, 3) float64
    crossings: Any  # (MOST_CROSSINGS, CROSSING) float64


@inner
def start(o, d, centre, origin, radius, leaves, away):
    """Write o + t d - origin, t at the foot of a centre, as balls.

    Sums have a relative rounding of the result only, also far from 0.

    Returns
    -------
    t : float
    length : float
        |d|.
    reach : float
        How far from t the ray is within a radius of the centre; below 0 where it passes by, or has done
        so before its origin and does not leave the surface.
    """
    dot, square = 0.0, 0.0
    for k in range(3):
        dot += (centre[k] - o[k]) * d[k]
        square += d[k] * d[k]
    t, length = dot / square, math.sqrt(square)
    along, total = 0.0, 0.0
    for k in range(3):
        ah, al = two_sum(o[k], -origin[k])
        bh, bl = two_product(t, d[k])
        h, e = add(ah, al, bh, bl)
        away[k, 0], away[k, 1], away[k, 2] = h, e, ROUNDING * abs(h) + TINY
        gap = h - (centre[k] - origin[k])
        along += gap * d[k] / length
        total += gap * gap
    reach = (abs(along) + 1.02 * radius) / length
    if math.sqrt(max(total - along * along, 0.0)) > radius * (1.0 + 1e-6):
        reach = -1.0
    return t, length, reach if t + reach >= 0.0 or leaves else -1.0


@inner
def unsure(out):
    """Say that nothing is certain."""
    out[FOUND], out[UNSURE_FROM] = 0.0, -math.inf


@inner
def nothing(out):
    """Say that there is no crossing."""
    out[FOUND], out[UNSURE_FROM] = 0.0, math.inf


@inner
def note(crossings, count, t, cosine):
    """Add a crossing; return the number of crossings."""
    if count < crossings.shape[0]:
        crossings[count, 0], crossings[count, 1], crossings[count, 2] = t
        crossings[count, 3] = cosine
    return count + 1


@inner
def distance(a, b):
    """Return the distance of two points."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@inner
def finish(crossings, count, shift, o, length, middle, size, leaves, hit_t, from_t, out):
    """Choose the first crossing with t > 0 that is not the departure, and hold a hit against it.

    Parameters
    ----------
    crossings : (MOST_CROSSINGS, CROSSING) float64
        t less the shift, as balls, and the cosines.
    count : int
    shift : float
    o : (3,) float64
    length : float
        Of the direction.
    middle : (3,) float64
    size : float
        Diameter; negative for a plane, which is as large as the way to it.
    leaves : bool
        Whether the ray leaves this surface.
    hit_t : float
        t of the hit, or nan.
    from_t : float
        From here on there may be more crossings.
    out : (N_COLUMNS,) float64
        Written.
    """
    nothing(out)
    if count > crossings.shape[0]:
        unsure(out)
        return
    out[UNSURE_FROM] = from_t
    n_dropped, n_open = 0, 0
    away = distance(middle, o)
    rounded = ROUNDED * max(abs(o[0]), abs(o[1]), abs(o[2])) if leaves else 0.0
    for k in range(count):
        t = abs(shift + crossings[k, 0])
        radius = (abs(crossings[k, 1]) + crossings[k, 2]) * GROW
        extent = size if size >= 0.0 else t * length
        allowed = BAND * max(away, extent) + rounded
        cosine = crossings[k, 3]
        is_known = cosine >= 0.0
        slope = length * (max(cosine, 0.0 if leaves else LEAST_COSINE) if is_known else 1.0)
        crossings[k, 4] = 1.0
        if (t + radius) * slope <= NEARLY * allowed:
            n_dropped += 1
            crossings[k, 4] = 0.0
        elif not is_known or not (t - radius) * slope > BEYOND * allowed:
            n_open += 1
    if leaves and (n_open > 0 or from_t <= 0.0):
        unsure(out)
        return
    # Any of several may be the departure, so that each of the others is a right answer; so is,
    # where nothing is left, a crossing on either side of t = 0 within rounding.
    has_choice = n_dropped > (1 if leaves else 0) and not math.isnan(hit_t)
    first, found = math.inf, False
    for k in range(count):
        if crossings[k, 4] == 0.0:
            continue
        t = plus((shift, 0.0, 0.0), (crossings[k, 0], crossings[k, 1], crossings[k, 2]))
        side = sign(t)
        if side < 0:
            continue
        if side == 0:
            unsure(out)
            return
        if t[0] < first:
            first, found = t[0], True
            out[T] = t[0]
            out[T_ERROR] = (t[2] + abs(t[1])) * GROW
    if found:
        out[FOUND] = 1.0
        _hold(crossings, count, shift, hit_t, out)
    if has_choice:
        for k in range(count):
            if crossings[k, 4] != 0.0:
                continue
            t = plus((shift, 0.0, 0.0), (crossings[k, 0], crossings[k, 1], crossings[k, 2]))
            if sign(t) > 0 and (out[FOUND] != 1.0 or abs(hit_t - t[0]) < abs(out[APART])):
                apart = minus((hit_t, 0.0, 0.0), t)
                out[FOUND], out[T] = 1.0, t[0]
                out[T_ERROR] = (t[2] + abs(t[1])) * GROW
                out[APART], out[APART_ERROR] = apart[0], (apart[2] + abs(apart[1])) * GROW


@inner
def _hold(crossings, count, shift, hit_t, out):
    """Compare with the first crossing and with those that cannot be told apart from it."""
    low, high = math.inf, -math.inf
    last = out[T] + out[T_ERROR]
    for k in range(count):
        if crossings[k, 4] == 0.0:
            continue
        t = plus((shift, 0.0, 0.0), (crossings[k, 0], crossings[k, 1], crossings[k, 2]))
        if sign(t) < 0 or t[0] - (t[2] + abs(t[1])) * GROW > last:
            continue
        out[T_ERROR] = max(out[T_ERROR], (abs(t[0] - out[T]) + t[2] + abs(t[1])) * GROW)
        apart = minus((hit_t, 0.0, 0.0), t)
        low = min(low, apart[0] - (apart[2] + abs(apart[1])) * GROW)
        high = max(high, apart[0] + (apart[2] + abs(apart[1])) * GROW)
    out[APART] = 0.5 * (low + high)
    out[APART_ERROR] = 0.5 * (high - low) * GROW + 2.0**-52 * abs(out[APART])


@inner
def exact(x):
    """Return a float64 as a ball."""
    return x, 0.0, 0.0


@inner
def square_of(d):
    """Return |d|^2 as a ball."""
    return plus(plus(product(d[0], d[0]), product(d[1], d[1])), product(d[2], d[2]))
