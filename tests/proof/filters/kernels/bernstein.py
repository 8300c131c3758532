"""All roots in [0, 1] of a polynomial in Bernstein form whose coefficients are balls.

A piece whose coefficients all have one certain sign holds no root; one whose coefficients change
sign once holds exactly one (Descartes' rule). Others are halved, by de Casteljau in double-double.
A single root is refined by Newton's iteration, and enclosed: if |F'| >= m on x +- w and
|F(x)| <= m w, a root is there. All coefficients of a piece share one radius. What is not settled at
the smallest width is returned as unsure.
"""

from meshing.kernels.jit import inner
from proof.filters.kernels.balls import GROW, ROUNDING
from proof.judges.kernels.double_double import add, interpolate

# Highest degree of polynomials: twice that of profiles.
MOST_DEGREE = 60
# Halvings, pieces of one polynomial, roots and unsure pieces of it.
DEPTH, MOST_PIECES, ROOM = 56, 400, 64
STEPS = 12
# Coefficients below so many radii are lost.
LOST = 64.0
NONE, ONE, OPEN = 0, 1, 2


@inner
def value_at(high, low, radius, n, s, slope, work):
    """Return the ball of a net's values at a ball s; slope bounds the derivative.

    The work has two rows.
    """
    most_of = 0.0
    for k in range(n + 1):
        most_of = max(most_of, abs(high[k]))
        work[0, k], work[1, k] = high[k], low[k]
    for level in range(n):
        for k in range(n - level):
            work[0, k], work[1, k] = interpolate(
                work[0, k], work[1, k], work[0, k + 1], work[1, k + 1], s[0], s[1]
            )
    error = radius + (4.0 * n + 1.0) * ROUNDING * most_of + slope * s[2]
    return work[0, 0], work[1, 0], error * GROW


@inner
def steepest(high, radius, n):
    """Return a bound on the derivative of a net in [0, 1]."""
    change, scale = 0.0, abs(high[0])
    for k in range(n):
        change = max(change, abs(high[k + 1] - high[k]))
        scale = max(scale, abs(high[k + 1]))
    return n * (change + 2.0 * radius + 2.0**-50 * scale) * GROW


@inner
def least_slope(high, radius, n, x, error, work):
    """Return the derivative of a net at x, and a lower bound of its size on x +- error."""
    scale, bend = 0.0, 0.0
    for k in range(n + 1):
        scale = max(scale, abs(high[k]))
    for k in range(n - 1):
        bend = max(bend, abs(high[k + 2] - 2.0 * high[k + 1] + high[k]))
    bend = n * (n - 1) * (bend + 4.0 * radius + 2.0**-48 * scale)
    _, slope = _rough(high, n, x, work)
    slack = n * (2.0 * radius + (n + 4.0) * 2.0**-50 * scale)
    return slope, (abs(slope) - slack - bend * (error + 2.0**-52)) / GROW


@inner
def _signs(high, radius, n):
    """Return NONE, ONE or OPEN: how many roots the signs of the coefficients allow."""
    limit = radius * GROW
    first, changes, unknown = 0, 0, 0
    last = 0
    for k in range(n + 1):
        c = high[k]
        now = 1 if c > limit else (-1 if c < -limit else 0)
        if k == 0:
            first = now
        if now == 0:
            unknown += 1
            continue
        changes += int(now * last < 0)
        last = now
    if unknown == 0 and changes == 0:
        return NONE
    ends = first * last
    is_end = high[n] > limit or high[n] < -limit
    if changes == 1 and ends == -1 and is_end:
        if unknown == 0:
            return ONE
        if unknown == 1:
            # Between different signs one unknown changes nothing; between equal ones it may.
            for k in range(1, n):
                if abs(high[k]) <= limit:
                    return ONE if high[k - 1] * high[k + 1] < 0.0 else OPEN
    return OPEN


@inner
def _is_lost(high, radius, n):
    """Whether all coefficients are within a few radii, so that halving cannot help."""
    largest = 0.0
    for k in range(n + 1):
        largest = max(largest, abs(high[k]))
    return largest <= LOST * radius


@inner
def halve(high, low, other_high, other_low, n, radius):
    """Halve a net: the left half into the other, the right one in place; return the radius."""
    scale = 0.0
    for k in range(n + 1):
        scale = max(scale, abs(high[k]))
    for level in range(n):
        other_high[level], other_low[level] = high[0], low[0]
        for k in range(n - level):
            h, e = add(high[k], low[k], high[k + 1], low[k + 1])
            high[k], low[k] = 0.5 * h, 0.5 * e
    other_high[n], other_low[n] = high[0], low[0]
    return (radius + n * ROUNDING * scale) * GROW


@inner
def _rough(high, n, x, work):
    """Return the value and the derivative at x, in float64."""
    for k in range(n + 1):
        work[k] = high[k]
    for level in range(n - 1):
        for k in range(n - level):
            work[k] += x * (work[k + 1] - work[k])
    slope = work[1] - work[0]
    return work[0] + x * slope, n * slope


@inner
def _refine(high, low, n, radius, work):
    """Enclose the single root of a piece: x as a pair, its radius, least |F'|; radius < 0: failed."""
    a, b = 0.0, 1.0
    rising = high[n] > 0.0
    x = high[0] / (high[0] - high[n])
    for _ in range(STEPS):
        f, slope = _rough(high, n, x, work[0])
        if (f > 0.0) == rising:
            b = x
        else:
            a = x
        before = x
        x = x - f / slope if slope != 0.0 else 0.5 * (a + b)
        if not a <= x <= b:
            x = 0.5 * (a + b)
        if abs(x - before) <= 2.0**-40 * abs(x):
            break
    xl, w, least = 0.0, -1.0, 0.0
    for _ in range(3):
        slope, least = least_slope(high, radius, n, x, 0.0, work[0])
        least *= 0.5
        if not least > 0.0:
            return 0.0, 0.0, -1.0, 0.0
        f, _, error = value_at(high, low, radius, n, (x, xl, 0.0), 0.0, work)
        w = (abs(f) + error) / least * GROW + 2.0**-104
        if abs(f) <= 2.0 * error or w <= 2.0**-102:
            break
        x, xl = add(x, xl, -f / slope, 0.0)
    _, bound = least_slope(high, radius, n, x, w, work[0])
    if not (bound >= least and w < x and x + w < 1.0 - 2.0**-50):
        return 0.0, 0.0, -1.0, 0.0
    return x, xl, w, least


@inner
def solve(nets, n, radius, roots, unsure, smallest, radii, spans):
    """Find all roots of the net in ``nets[0]``; return their number and that of unsure pieces.

    Parameters
    ----------
    nets : (DEPTH + 3, 2, n + 1 or more) float64
        High and low parts; changed. The last two entries are working memory.
    n : int
    radius : float
        Of all coefficients.
    roots : (ROOM, 6) float64
        Written: s as a pair, its radius, a lower bound of |F'| near it, and begin and width of a
        piece that holds this root only.
    unsure : (ROOM, 2) float64
        Written: begin and width of pieces that are left.
    smallest : float
        Width below which pieces are left.
    radii : (DEPTH + 1,) float64
        Working memory.
    spans : (DEPTH + 1, 2) float64
        Working memory.
    """
    spans[0, 0], spans[0, 1] = 0.0, 1.0
    radii[0] = radius
    top, n_roots, n_unsure, n_pieces = 0, 0, 0, 0
    work = nets[nets.shape[0] - 1]
    while top >= 0:
        n_pieces += 1
        high, low = nets[top, 0], nets[top, 1]
        begin, width = spans[top, 0], spans[top, 1]
        count = _signs(high, radii[top], n)
        is_lost = count == OPEN and _is_lost(high, radii[top], n)
        if count == NONE:
            top -= 1
            continue
        if count == ONE:
            x, xl, w, least = _refine(high, low, n, radii[top], work)
            if w >= 0.0 and n_roots < ROOM:
                h, e = add(x * width, xl * width, begin, 0.0)
                roots[n_roots, 0], roots[n_roots, 1] = h, e
                roots[n_roots, 2] = (w * width + 2.0 * ROUNDING) * GROW
                roots[n_roots, 3] = least / width
                roots[n_roots, 4], roots[n_roots, 5] = begin, width
                n_roots += 1
                top -= 1
                continue
        if is_lost or width <= smallest or n_pieces >= MOST_PIECES or top + 1 >= spans.shape[0]:
            if n_unsure >= ROOM:
                return n_roots, -1
            unsure[n_unsure, 0], unsure[n_unsure, 1] = begin, width
            n_unsure += 1
            top -= 1
            continue
        # The right half stays at this level, the left one is looked at first.
        radii[top] = halve(high, low, nets[top + 1, 0], nets[top + 1, 1], n, radii[top])
        radii[top + 1] = radii[top]
        spans[top, 0], spans[top, 1] = begin + 0.5 * width, 0.5 * width
        spans[top + 1, 0], spans[top + 1, 1] = begin, 0.5 * width
        top += 1
    return n_roots, n_unsure
