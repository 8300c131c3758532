"""Lower bounds of chords between two cells, and whether there may be any; see `hybrid_rt.part.pairs`."""

import numpy as np

from meshing.kernels.jit import inner, kernel

# Of each cell: numbers of doubles, and where they begin.
WIDTHS = {
    "box": 4, "corners": 12, "eps": 1, "core": 12, "core_eps": 1, "rho": 1, "frame": 9, "spread": 3, "middle": 3,
    "radius": 1, "way": 3, "way_eps": 1, "is_round": 1, "is_support": 1, "lean": 1,
    "centre": 3, "ring": 1,
}  # fmt: skip
BEGINS = dict(zip(WIDTHS, np.cumsum([0, *WIDTHS.values()]).tolist(), strict=False))
CELL_WIDTH = sum(WIDTHS.values())
_CORNERS, _EPS, _CORE, _CORE_EPS = (BEGINS[name] for name in ("corners", "eps", "core", "core_eps"))
_RHO, _FRAME, _SPREAD, _MIDDLE = (BEGINS[name] for name in ("rho", "frame", "spread", "middle"))
_WAY, _WAY_EPS, _IS_ROUND = BEGINS["way"], BEGINS["way_eps"], BEGINS["is_round"]
_IS_SUPPORT, _LEAN = BEGINS["is_support"], BEGINS["lean"]
_CENTRE, _RING = BEGINS["centre"], BEGINS["ring"]
# Kinds of pairs.
BOTH, FIRST, TOUCHING, ANY = range(4)
# Normals, and angles, are rounded.
TILTED = 1e-9


@inner
def _along(cell, row, column, x, y, z):
    """Return the least and the most of four points along a direction."""
    least, most = np.inf, -np.inf
    for k in range(column, column + 12, 3):
        at = cell[row, k] * x + cell[row, k + 1] * y + cell[row, k + 2] * z
        least, most = min(least, at), max(most, at)
    return least, most


@inner
def _eps_along(cell, row, x, y, z):
    """Return how far points of a cell are from its hull along a unit direction."""
    slope = abs(cell[row, _WAY] * x + cell[row, _WAY + 1] * y + cell[row, _WAY + 2] * z)
    across = np.sqrt(max(1.0 - slope * slope, 0.0))
    eps = cell[row, _EPS]
    return min(eps, eps * across + cell[row, _WAY_EPS] * slope)


@inner
def _width(cell, row):
    """Return the angle by which normals may be off that of the middle."""
    square = 0.0
    for i in range(3):
        square += (cell[row, _SPREAD + i] + TILTED) ** 2
    return 2.0 * np.arcsin(min(0.5 * np.sqrt(square), 1.0))


@inner
def _aside(cell, row, column, second):
    """Return how far four points of a cell are at most from the axis, or the point, that is another's core."""
    wx, wy, wz = cell[second, _WAY], cell[second, _WAY + 1], cell[second, _WAY + 2]
    most = 0.0
    for k in range(0, 12, 3):
        x = cell[row, column + k] - cell[second, _CORE]
        y = cell[row, column + k + 1] - cell[second, _CORE + 1]
        z = cell[row, column + k + 2] - cell[second, _CORE + 2]
        slide = x * wx + y * wy + z * wz
        x, y, z = x - slide * wx, y - slide * wy, z - slide * wz
        most = max(most, np.sqrt(x * x + y * y + z * z))
    return most


@inner
def _from_ring(cell, first, second):
    """Return how far points of a circle, or a centre, are at most from another circle; inf: these are no cores."""
    one, other = cell[first, _RING], cell[second, _RING]
    if one < 0.0 or other < 0.0:
        return np.inf
    wx, wy, wz = cell[second, _WAY], cell[second, _WAY + 1], cell[second, _WAY + 2]
    vx, vy, vz = cell[first, _WAY], cell[first, _WAY + 1], cell[first, _WAY + 2]
    x = cell[first, _CENTRE] - cell[second, _CENTRE]
    y = cell[first, _CENTRE + 1] - cell[second, _CENTRE + 1]
    z = cell[first, _CENTRE + 2] - cell[second, _CENTRE + 2]
    slide = x * wx + y * wy + z * wz
    x, y, z = x - slide * wx, y - slide * wy, z - slide * wz
    off = np.sqrt(x * x + y * y + z * z)
    x, y, z = vy * wz - vz * wy, vz * wx - vx * wz, vx * wy - vy * wx
    tilt = np.sqrt(x * x + y * y + z * z)
    return np.sqrt((one - other) ** 2 + slide * slide) + off + one * tilt


@inner
def _core_bound(cell, first, second, cosine, kind, sign, rounding):
    """Return (core_p - core_q) n_p + rho_p - rho_q n_q n_p at least; -n_q n_p is from ``cosine`` to 1."""
    core, eps = _CORE, cell[second, _CORE_EPS]
    if cell[second, _IS_SUPPORT] > 0.0 and kind != BOTH:
        # What is across n_q is across n_p only if they are antiparallel.
        core, eps = _CORNERS, cell[second, _EPS]
    eps += cell[first, _CORE_EPS] + rounding
    least = 0.0
    for i in range(3):
        f = _FRAME + 3 * i
        x, y, z = cell[first, f], cell[first, f + 1], cell[first, f + 2]
        if i == 0:
            x, y, z = sign * x, sign * y, sign * z
        low, high = _along(cell, first, _CORE, x, y, z)
        other_low, other_high = _along(cell, second, core, x, y, z)
        low, high = low - other_high - eps, high - other_low + eps
        spread = cell[first, _SPREAD + i] + TILTED
        if i == 0:
            share = 1.0 - spread
            least = min(low, low * share, high * share)
        else:
            least -= max(abs(low), abs(high)) * spread
    if cell[first, _IS_SUPPORT] > 0.0:
        # Normals of a cone lean by one angle all about its axis.
        x, y, z = cell[first, _WAY], cell[first, _WAY + 1], cell[first, _WAY + 2]
        low, high = _along(cell, first, _CORE, x, y, z)
        other_low, other_high = _along(cell, second, core, x, y, z)
        low, high = low - other_high - eps, high - other_low + eps
        lean = sign * cell[first, _LEAN]
        aside = _aside(cell, second, core, first) + eps
        across = np.sqrt(max(1.0 - lean * lean, 0.0))
        far = max(abs(low), abs(high)) + aside
        least = max(least, min(low * lean, high * lean) - aside * across - TILTED * far)
    one, other = sign * cell[first, _RHO], sign * cell[second, _RHO]
    return least + one + min(other, other * cosine)


@inner
def _round_bound(cell, first, second, cosine, kind, sign, rounding):
    """Return a bound by the core of a second cell that is a convex cylinder, sphere or torus; 0: there is none.

    A chord goes past its core: t - rho_p = |q - core_p|, and q is rho_q from its axis, centre or circle. The centre of
    a ball that touches it is rho_q - r from that, and |rho_p - r| from the core of p.
    """
    one, other = sign * cell[first, _RHO], sign * cell[second, _RHO]
    if not (cell[second, _IS_ROUND] > 0.0 and other > 0.0):
        return 0.0
    if cell[second, _RING] > 0.0:
        aside = _from_ring(cell, first, second) + rounding
    elif cell[first, _IS_SUPPORT] > 0.0:
        aside = _aside(cell, first, _CORNERS, second) + cell[first, _EPS] + rounding
    else:
        aside = _aside(cell, first, _CORE, second) + cell[first, _CORE_EPS] + rounding
    limit = other - max(one, 0.0) if kind == TOUCHING else other * cosine
    return one + other - aside if aside < limit else 0.0


@inner
def bound_of_pair(cell, a, b, kind, most, angle, sign, rounding):
    """Return a lower bound of the chords of a pair of cells; inf: there is none, or none below ``most``."""
    x, y = cell[a, _MIDDLE] - cell[b, _MIDDLE], cell[a, _MIDDLE + 1] - cell[b, _MIDDLE + 1]
    z = cell[a, _MIDDLE + 2] - cell[b, _MIDDLE + 2]
    length = max(np.sqrt(x * x + y * y + z * z), 1e-300)
    x, y, z = x / length, y / length, z / length
    lower = _along(cell, a, _CORNERS, x, y, z)[0] - _along(cell, b, _CORNERS, x, y, z)[1]
    lower -= _eps_along(cell, a, x, y, z) + _eps_along(cell, b, x, y, z) + rounding
    turn = 0.0
    for i in range(3):
        turn -= cell[a, _FRAME + i] * cell[b, _FRAME + i]
    between, widths = np.arccos(min(max(turn, -1.0), 1.0)), _width(cell, a) + _width(cell, b)
    # --- walls are opposite
    if kind in (FIRST, TOUCHING) and between - widths > angle:
        return np.inf
    cosine = 1.0 if kind == BOTH else np.cos(min(between + widths, angle + TILTED))
    for own in range(2):
        p, q = (a, b) if own == 0 else (b, a)
        is_normal = kind == BOTH or (kind == FIRST and own == 0)
        square = 0.0
        for i in range(3):
            f, turned_by = _FRAME + 3 * i, sign if i == 0 else 1.0
            x, y, z = turned_by * cell[p, f], turned_by * cell[p, f + 1], turned_by * cell[p, f + 2]
            eps = _eps_along(cell, a, x, y, z) + _eps_along(cell, b, x, y, z) + rounding
            low, high = _along(cell, p, _CORNERS, x, y, z)
            other_low, other_high = _along(cell, q, _CORNERS, x, y, z)
            low, high = low - other_high - eps, high - other_low + eps
            square += max(low, -high, 0.0) ** 2
            turned = reach = 0.0
            for j in range(3):
                g = _FRAME + 3 * j
                product = x * cell[q, g] + y * cell[q, g + 1] + z * cell[q, g + 2]
                turned = -sign * product if j == 0 else turned
                reach += abs(product) * (cell[q, _SPREAD + j] + TILTED)
            spread = cell[p, _SPREAD + i] + TILTED
            if i == 0:
                # The chord is along the own normal, or touches a ball there.
                if is_normal and not (high > 0.0 or spread >= 1.0):
                    return np.inf
                if kind == TOUCHING and not high > 0.0:
                    return np.inf
                if kind == BOTH and turned + reach < 1.0 - spread:
                    return np.inf
                continue
            lateral = most * spread
            if is_normal and not (low <= lateral and high >= -lateral):
                return np.inf
            if kind == BOTH and abs(turned) > spread + reach:
                return np.inf
            if kind == TOUCHING:  # p - q = r (n_p - n_q)
                left = min(0.5 * most * (turned - spread - reach), 0.0)
                right = max(0.5 * most * (turned + spread + reach), 0.0)
                if not (low <= right and high >= left):
                    return np.inf
        lower = max(lower, np.sqrt(square))
        if is_normal:
            lower = max(lower, _core_bound(cell, p, q, cosine, kind, sign, rounding))
        elif kind == TOUCHING:
            # 2 r (1 + c) / 2 = (core_p - core_q) n_p + rho_p + rho_q c, monotone in c = -n_p n_q.
            wide = _core_bound(cell, p, q, cosine, kind, sign, rounding)
            straight = _core_bound(cell, p, q, 1.0, kind, sign, rounding)
            lower = max(lower, min(2.0 * wide / (1.0 + cosine), straight))
        if is_normal or kind == TOUCHING:
            lower = max(lower, _round_bound(cell, p, q, cosine, kind, sign, rounding))
    return lower if lower < most else np.inf


@kernel
def bounds_of_pairs(cell, a, b, kind, most, angle, sign, rounding, lower):
    """Fill lower bounds of pairs (n,); inf: they have no chord below ``most``."""
    for k in range(a.shape[0]):
        lower[k] = bound_of_pair(cell, a[k], b[k], kind[k], most, angle, sign, rounding)
