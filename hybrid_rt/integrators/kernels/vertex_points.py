"""Low-discrepancy points for the vertices of camera paths, drawn for many vertices at once.

One point alone takes 30 ns. In a loop over a run of them, which compiles to vector instructions, it
takes 4.
"""

import numpy as np

from hybrid_rt.sampling.kernels.sobol import key_of_pixel, reverse_bits, sobol_point
from meshing.kernels.jit import inlined

# What the points of one vertex are for, and how many dimensions a vertex has.
TO_LIGHT, DIRECTION, CHOICE, CONNECT, PER_STEP = 0, 1, 2, 3, 4
# Connections of a diffuse vertex, and the distance of their dimensions.
N_JOINS, JOIN_DIMENSIONS = 3, 2**44
# Slots of a vertex: one for each use, and as many as there are connections; the last is for lamps that
# are reached by way of spheres.
TO_SPHERE = CONNECT + N_JOINS
N_SLOTS = TO_SPHERE + 1
# Vertices in a run: of one path, and of as many paths.
RUN_ALONG, RUN_ACROSS = 8, 128
_MASK = np.uint64(0xFFFFFFFF)


@inlined
def draw_along(rules, depth, pixel, sample, points):
    """Draw the points of `RUN_ALONG` successive vertices of one path, from ``depth`` on.

    Parameters
    ----------
    rules : Rules
    depth : int
    pixel, sample : uint64
    points : (2, N_SLOTS, RUN_ALONG) float64, written
        In [0, 1), both numbers of each slot; slots that the rules do not use are left alone.
    """
    key, turned = key_of_pixel(rules.seed, pixel), reverse_bits(sample & _MASK)
    for slot in range(N_SLOTS):
        if _is_used(rules, slot):
            first = _dimension(rules, depth, slot)
            for k in range(points.shape[2]):
                points[0, slot, k], points[1, slot, k] = sobol_point(
                    key, turned, first + np.uint64(k) * np.uint64(PER_STEP)
                )


@inlined
def draw_across(rules, depth, pixel, sample, begin, points):
    """Draw the points of one vertex of each of `RUN_ACROSS` paths, from row ``begin`` on.

    Parameters
    ----------
    rules : Rules
    depth : int
    pixel, sample : (n,) uint64
    begin : int
    points : (2, N_SLOTS, RUN_ACROSS) float64, written
        See `draw_along`.
    """
    # Slices, since indices that might be negative keep a loop from being compiled to vectors.
    pixel, sample = pixel[begin : begin + RUN_ACROSS], sample[begin : begin + RUN_ACROSS]
    for slot in range(N_SLOTS):
        if _is_used(rules, slot):
            dimension = _dimension(rules, depth, slot)
            for k in range(pixel.size):
                points[0, slot, k], points[1, slot, k] = sobol_point(
                    key_of_pixel(rules.seed, pixel[k]),
                    reverse_bits(sample[k] & _MASK),
                    dimension,
                )


@inlined
def _is_used(rules, slot):
    if slot == TO_LIGHT:
        return rules.asks_lights
    if slot < CONNECT:
        return True
    if slot == TO_SPHERE:
        return rules.has_balls
    return rules.has_light_paths and (slot == CONNECT or rules.near < np.inf)


@inlined
def _dimension(rules, depth, slot):
    dimension = rules.first_dimension + np.uint64(depth) * np.uint64(PER_STEP)
    if slot < CONNECT:
        return dimension + np.uint64(slot)
    joins = np.uint64(slot - CONNECT) * np.uint64(JOIN_DIMENSIONS)
    return dimension + np.uint64(CONNECT) + joins
