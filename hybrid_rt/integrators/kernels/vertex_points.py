"""Low-discrepancy points for the vertices of camera paths, drawn for many vertices at once.

One point alone takes 20 ns. In a loop over a run of them, which compiles to vector instructions, it
takes 6 to 8.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.sampling.kernels.sobol import key_of_pixel, reverse_bits, sobol_point
from meshing.kernels.jit import inlined

# What the points of one vertex are for, and how many dimensions a vertex has.
TO_LIGHT, DIRECTION, CHOICE, CONNECT, PER_STEP = 0, 1, 2, 3, 4
# Those that came later have dimensions of their own, far from the others.
FAR, TO_SPHERE, TO_BOX, WHICH_WAY, TO_MIRROR, WHICH_MIRROR, LATER = 4, 5, 6, 7, 8, 9, 2**44
# Slots of a run. Few vertices ask for points of the others, which are drawn alone.
N_SLOTS = 5
# Vertices in a run: of one path, and of as many paths.
RUN_ALONG, RUN_ACROSS = 8, 128
_WORD = np.uint64(32)


class RunPoints(NamedTuple):
    """Scratch memory: the points of a run of vertices."""

    xi: Any  # (2, N_SLOTS, run) float64 in [0, 1), both numbers of each slot
    key: Any  # (run,) uint32, of the pixels
    turned: Any  # (run,) uint32, bit-reversed sample numbers


def new_run_points(run: int) -> RunPoints:
    """Allocate the points of a run, `RUN_ALONG` or `RUN_ACROSS` vertices."""
    words = (np.empty(run, dtype=np.uint32) for _ in range(2))
    return RunPoints(np.empty((2, N_SLOTS, run)), *words)


@inlined
def draw_along(rules, depth, pixel, sample, points):
    """Draw the points of `RUN_ALONG` successive vertices of one path, from ``depth`` on.

    Parameters
    ----------
    rules : Rules
    depth : int
    pixel, sample : uint64
    points : RunPoints, written
        Slots that the rules do not use are left alone.
    """
    key, turned = key_of_pixel(rules.seed, pixel), reverse_bits(np.uint32(sample))
    xi = points.xi
    for slot in range(N_SLOTS):
        if _is_used(rules, slot):
            low, high = _dimension(rules, depth, slot)
            for k in range(xi.shape[2]):
                xi[0, slot, k], xi[1, slot, k] = sobol_point(
                    key, turned, np.uint32(low + np.uint32(k * PER_STEP)), high
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
    points : RunPoints, written
        See `draw_along`.
    """
    # Slices, since indices that might be negative keep a loop from being compiled to vectors.
    pixel, sample = pixel[begin : begin + RUN_ACROSS], sample[begin : begin + RUN_ACROSS]
    xi, key, turned = points.xi, points.key[: pixel.size], points.turned[: pixel.size]
    for k in range(pixel.size):
        key[k] = key_of_pixel(rules.seed, pixel[k])
        turned[k] = reverse_bits(np.uint32(sample[k]))
    for slot in range(N_SLOTS):
        if _is_used(rules, slot):
            low, high = _dimension(rules, depth, slot)
            for k in range(key.size):
                xi[0, slot, k], xi[1, slot, k] = sobol_point(key[k], turned[k], low, high)


@inlined
def draw_later(rules, depth, slot, pixel, sample):
    """Draw one point of one vertex, of a slot above those of a run."""
    low, high = _dimension(rules, depth, slot)
    turned = reverse_bits(np.uint32(sample))
    return sobol_point(key_of_pixel(rules.seed, pixel), turned, low, high)


@inlined
def _is_used(rules, slot):
    if slot == TO_LIGHT:
        return rules.samples_lights
    if slot == CONNECT:
        return rules.has_light_paths
    return slot != FAR or (rules.has_light_paths and rules.min_distance < np.inf)


@inlined
def _dimension(rules, depth, slot):
    """Return the two words of the dimension of a slot."""
    dimension = rules.first_dimension + np.uint64(depth) * np.uint64(PER_STEP)
    if slot <= CONNECT:
        dimension += np.uint64(slot)
    else:
        dimension += np.uint64(CONNECT) + np.uint64(slot - CONNECT) * np.uint64(LATER)
    return np.uint32(dimension), np.uint32(dimension >> _WORD)
