"""Light tracing from a square area light through glass to a diffuse floor, with code of its own.

Nothing here is shared with the renderer: intersections are textbook formulas in the world frame,
Fresnel's equations are written out, random numbers come from SplitMix64 (Steele, Lea and Flood,
"Fast splittable pseudorandom number generators", OOPSLA 2014). Every photon has the same power and
ends by chance, at the lamp, outside, or after 1000 steps. So a cell of the floor counts photons.
"""

import math

import numpy as np

from meshing.kernels.jit import inner, kernel

NOTHING, FLOOR, LAMP, SPHERE, SLAB = 0, 1, 2, 3, 4
# Where a ray leaves a surface, hits nearer than this belong to it. The scenes are about 1 large.
NEAR = 1e-9
MOST_STEPS = 1000

_GAMMA = np.uint64(0x9E3779B97F4A7C15)
_A, _B = np.uint64(0xBF58476D1CE4E5B9), np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S11 = np.uint64(30), np.uint64(27), np.uint64(31), np.uint64(11)


@inner
def _next(state):
    """Step a generator; return its state and a number in [0, 1)."""
    state = state + _GAMMA
    z = (state ^ (state >> _S30)) * _A
    z = (z ^ (z >> _S27)) * _B
    z = z ^ (z >> _S31)
    return state, (z >> _S11) * 2.0**-53


@inner
def _slab(lo, hi, o, d):
    """Return where a line enters and leaves a slab along one axis."""
    if d == 0.0:
        return (-math.inf, math.inf) if lo < o < hi else (math.inf, -math.inf)
    a, b = (lo - o) / d, (hi - o) / d
    return min(a, b), max(a, b)


@inner
def _first(lamp, half, spheres, slabs, x, y, z, a, b, c):
    """Return distance, kind, number and outward normal of the first surface along a ray."""
    best, kind, number, nx, ny, nz = math.inf, NOTHING, 0, 0.0, 0.0, 1.0
    if c != 0.0:
        t = -z / c
        if NEAR < t < best and abs(x + t * a) <= half and abs(y + t * b) <= half:
            best, kind, nx, ny, nz = t, FLOOR, 0.0, 0.0, 1.0
        t = (lamp[2] - z) / c
        side = 0.5 * lamp[3]
        if (
            NEAR < t < best
            and abs(x + t * a - lamp[0]) <= side
            and abs(y + t * b - lamp[1]) <= side
        ):
            best, kind, nx, ny, nz = t, LAMP, 0.0, 0.0, -1.0
    for i in range(spheres.shape[0]):
        px, py, pz = x - spheres[i, 0], y - spheres[i, 1], z - spheres[i, 2]
        half_b = px * a + py * b + pz * c
        root = half_b * half_b - (px * px + py * py + pz * pz - spheres[i, 3] ** 2)
        if root <= 0.0:
            continue
        root = math.sqrt(root)
        t = -half_b - root
        if t <= NEAR:
            t = -half_b + root
        if NEAR < t < best:
            best, kind, number = t, SPHERE, i
            nx = (px + t * a) / spheres[i, 3]
            ny = (py + t * b) / spheres[i, 3]
            nz = (pz + t * c) / spheres[i, 3]
    for i in range(slabs.shape[0]):
        x0, x1 = _slab(slabs[i, 0], slabs[i, 3], x, a)
        y0, y1 = _slab(slabs[i, 1], slabs[i, 4], y, b)
        z0, z1 = _slab(slabs[i, 2], slabs[i, 5], z, c)
        enter, leave = max(x0, y0, z0), min(x1, y1, z1)
        if enter >= leave:
            continue
        t = enter
        if t <= NEAR:
            t = leave
        if NEAR < t < best:
            best, kind, number = t, SLAB, i
            nx = ny = nz = 0.0
            if t in (x0, x1):
                nx = math.copysign(1.0, a if t == x1 else -a)
            elif t in (y0, y1):
                ny = math.copysign(1.0, b if t == y1 else -b)
            else:
                nz = math.copysign(1.0, c if t == z1 else -c)
    return best, kind, number, nx, ny, nz


@inner
def _at_glass(ior, a, b, c, nx, ny, nz, xi):
    """Reflect or refract a direction by chance, as Fresnel's equations say."""
    cos_i = -(a * nx + b * ny + c * nz)
    n1, n2 = 1.0, ior
    if cos_i < 0.0:
        cos_i, nx, ny, nz, n1, n2 = -cos_i, -nx, -ny, -nz, ior, 1.0
    sine = n1 / n2 * math.sqrt(max(1.0 - cos_i * cos_i, 0.0))
    reflectance, cos_t = 1.0, 0.0
    if sine < 1.0:
        cos_t = math.sqrt(1.0 - sine * sine)
        across = (n1 * cos_i - n2 * cos_t) / (n1 * cos_i + n2 * cos_t)
        along = (n1 * cos_t - n2 * cos_i) / (n1 * cos_t + n2 * cos_i)
        reflectance = 0.5 * (across * across + along * along)
    if xi < reflectance:
        k = 2.0 * cos_i
        a, b, c = a + k * nx, b + k * ny, c + k * nz
    else:
        ratio = n1 / n2
        k = ratio * cos_i - cos_t
        a, b, c = ratio * a + k * nx, ratio * b + k * ny, ratio * c + k * nz
    length = math.sqrt(a * a + b * b + c * c)
    return a / length, b / length, c / length


@inner
def _cosine_way(s, t):
    ring = math.sqrt(s)
    return ring * math.cos(2 * math.pi * t), ring * math.sin(2 * math.pi * t), math.sqrt(1.0 - s)


@kernel(allocates=True)
def count_on_floor(lamp, half, albedo, spheres, slabs, ior, seed, first, stop, counts):
    """Trace the photons ``first`` to ``stop`` and count their hits on the floor.

    Parameters
    ----------
    lamp : (4,) float64
        Centre and side of a square that shines straight down.
    half, albedo : float
        The floor is the square of this half side about the origin at z = 0.
    spheres, slabs : (n, 4), (n, 6) float64
        Clear bodies: centre and radius; lower and upper corner.
    seed : uint64
    counts : (n, n) int64, changed
        Arrivals from above by cells of the floor, first along x.
    """
    n = counts.shape[0]
    for number in range(first, stop):
        state = (seed * _A + np.uint64(number)) * _B
        state, s = _next(state)
        state, t = _next(state)
        x, y, z = lamp[0] + (s - 0.5) * lamp[3], lamp[1] + (t - 0.5) * lamp[3], lamp[2]
        state, s = _next(state)
        state, t = _next(state)
        a, b, c = _cosine_way(s, t)
        c = -c
        for _ in range(MOST_STEPS):
            distance, kind, _, nx, ny, nz = _first(lamp, half, spheres, slabs, x, y, z, a, b, c)
            if kind in (NOTHING, LAMP):
                break
            x, y, z = x + distance * a, y + distance * b, z + distance * c
            if kind != FLOOR:
                state, xi = _next(state)
                a, b, c = _at_glass(ior, a, b, c, nx, ny, nz, xi)
                continue
            if c < 0.0:
                i = min(max(int((x + half) / (2 * half) * n), 0), n - 1)
                j = min(max(int((y + half) / (2 * half) * n), 0), n - 1)
                counts[i, j] += 1
            state, xi = _next(state)
            if xi >= albedo:
                break
            state, s = _next(state)
            state, t = _next(state)
            a, b, c_new = _cosine_way(s, t)
            c = c_new if c < 0.0 else -c_new


@kernel(allocates=True)
def look_at_floor(lamp, half, spheres, slabs, ior, seed, first, origin, direction, place):
    """Trace camera rays through dielectrics, with random branches, to the upper side of the floor.

    ``place`` (n, 2) receives their end points on the floor, nan for rays that end elsewhere;
    ``first`` is the index of the first ray for its random numbers.
    """
    for i in range(origin.shape[0]):
        state = (seed * _B + np.uint64(first + i)) * _A
        x, y, z = origin[i, 0], origin[i, 1], origin[i, 2]
        a, b, c = direction[i, 0], direction[i, 1], direction[i, 2]
        place[i, 0] = place[i, 1] = math.nan
        for _ in range(MOST_STEPS):
            distance, kind, _, nx, ny, nz = _first(lamp, half, spheres, slabs, x, y, z, a, b, c)
            x, y, z = x + distance * a, y + distance * b, z + distance * c
            if kind == FLOOR and c < 0.0:
                place[i, 0], place[i, 1] = x, y
            if kind in (NOTHING, LAMP, FLOOR):
                break
            state, xi = _next(state)
            a, b, c = _at_glass(ior, a, b, c, nx, ny, nz, xi)
