"""Hash-scrambled Sobol points: a pure function of (seed, pixel, dimension, sample number).

Each (pixel, dimension) has one two-dimensional Sobol sequence; they differ only in the hash that
shuffles the order and scrambles the digits. After scrambling every aligned run of 2**k points is
still a (0, k, 2)-net, so any number of passes is well distributed.

Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020; the digit permutation is the one of
Laine and Karras, "Stratified sampling for stochastic transparency", EGSR 2011, with the constants
of Pharr, Jakob and Humphreys, "Physically based rendering", 4th edition, 2023.
"""

import numpy as np

from meshing.kernels.jit import inlined, inner, kernel

# 32-bit arithmetic in 64-bit words: a product of two 32-bit numbers cannot overflow, so compiled
# and interpreted runs give the same bits. Numba would turn uint64 with int64 into float64: every
# constant is a uint64.
_MASK = np.uint64(0xFFFFFFFF)
_GOLDEN = np.uint64(0x9E3779B9)
_ZERO, _ONE = np.uint64(0), np.uint64(1)
_S1, _S2, _S4, _S8 = np.uint64(1), np.uint64(2), np.uint64(4), np.uint64(8)
_S15, _S16, _S24 = np.uint64(15), np.uint64(16), np.uint64(24)
_S32 = np.uint64(32)
_BYTE = np.uint64(0xFF)
_BITS1, _BITS2 = np.uint64(0x55555555), np.uint64(0x33333333)
_BITS4, _BITS8 = np.uint64(0x0F0F0F0F), np.uint64(0x00FF00FF)
_HASH_A, _HASH_B = np.uint64(0x7FEB352D), np.uint64(0x846CA68B)
_OWEN_A, _OWEN_B, _OWEN_C = np.uint64(0x3D20ADEA), np.uint64(0x05526C56), np.uint64(0x53A22864)
_TO_UNIT = 2.0**-32


@inner
def mix(state, word):
    """Mix one 32-bit word into a 32-bit hash (the "lowbias32" finaliser of C. Wellons)."""
    x = ((state + _GOLDEN) & _MASK) ^ word
    x ^= x >> _S16
    x = (x * _HASH_A) & _MASK
    x ^= x >> _S15
    x = (x * _HASH_B) & _MASK
    return x ^ (x >> _S16)


@inner
def reverse_bits(x):
    """Reverse the bits of a 32-bit word."""
    x = ((x >> _S1) & _BITS1) | ((x & _BITS1) << _S1)
    x = ((x >> _S2) & _BITS2) | ((x & _BITS2) << _S2)
    x = ((x >> _S4) & _BITS4) | ((x & _BITS4) << _S4)
    x = ((x >> _S8) & _BITS8) | ((x & _BITS8) << _S8)
    return ((x >> _S16) | (x << _S16)) & _MASK


@inner
def permute(x, key):
    """Permute binary digits, the lowest first: each flip depends on the digits before it."""
    x ^= (x * _OWEN_A) & _MASK
    x = (x + key) & _MASK
    x = (x * ((key >> _S16) | _ONE)) & _MASK
    x ^= (x * _OWEN_B) & _MASK
    return x ^ ((x * _OWEN_C) & _MASK)


@inner
def sobol_second(turned):
    """Return the second Sobol coordinate of a bit-reversed index, as a 32-bit word.

    The first coordinate is the bit-reversed index itself.
    """
    # The generator matrix is Pascal's triangle modulo 2, five times over the Kronecker product of
    # ((1, 1), (0, 1)) with itself: each factor is one line.
    x = turned ^ ((turned << _S16) & _MASK)
    x ^= (x & _BITS8) << _S8
    x ^= (x & _BITS4) << _S4
    x ^= (x & _BITS2) << _S2
    return x ^ ((x & _BITS1) << _S1)


@inlined
def key_of_pixel(seed, pixel):
    """Return the hash of a seed and a pixel, both uint64."""
    seed_key = mix(mix(_ZERO, seed & _MASK), seed >> _S32)
    return mix(mix(seed_key, pixel & _MASK), pixel >> _S32)


@inlined
def sobol_point(pixel_key, turned_sample, dimension):
    """Return the point of one dimension (uint64), two numbers in [0, 1).

    ``turned_sample`` is the bit-reversed sample number. Scrambling permutes the digits from the
    highest on, so words are bit-reversed before and after it; where two reversals meet, both are
    left out.
    """
    key = mix(mix(pixel_key, dimension & _MASK), dimension >> _S32)
    turned = permute(turned_sample, key)
    first = permute(reverse_bits(turned), mix(key, _ONE))
    second = permute(reverse_bits(sobol_second(turned)), mix(key, _S2))
    return reverse_bits(first) * _TO_UNIT, reverse_bits(second) * _TO_UNIT


@kernel
def sobol_points(seed, sample, pixel, dimension, begin, points):
    """Fill n rows of ``points`` (m, rows, 2) from ``begin`` on, for n triples, all uint64.

    The first axis holds the m dimensions from ``dimension`` on.
    """
    for i in range(pixel.size):
        pixel_key = key_of_pixel(seed, pixel[i])
        turned_sample = reverse_bits(sample[i] & _MASK)
        for d in range(points.shape[0]):
            points[d, begin + i, 0], points[d, begin + i, 1] = sobol_point(
                pixel_key, turned_sample, dimension[i] + np.uint64(d)
            )


@kernel
def joint_points(seed, sample, pixel, dimension, tables, points):
    """Fill ``points`` (n, m) with points of one m-dimensional Sobol sequence.

    Each coordinate is scrambled independently; the order is not shuffled, as the points are paired
    with no others.

    Parameters
    ----------
    seed, dimension : uint64
    pixel : (n,) uint64
        Key of the sequence, with ``seed`` and ``dimension``.
    sample : (n,) uint64 below 2**32
        Index in the sequence.
    tables : (at least m, 4, 256) uint64
        Bit-reversed contribution of each byte of an index, for each coordinate.
    """
    seed_key = mix(mix(_ZERO, seed & _MASK), seed >> _S32)
    for i in range(sample.size):
        key = mix(mix(seed_key, pixel[i] & _MASK), pixel[i] >> _S32)
        key = mix(mix(key, dimension & _MASK), dimension >> _S32)
        index = sample[i]
        for d in range(points.shape[1]):
            turned = (
                tables[d, 0, index & _BYTE]
                ^ tables[d, 1, (index >> _S8) & _BYTE]
                ^ tables[d, 2, (index >> _S16) & _BYTE]
                ^ tables[d, 3, (index >> _S24) & _BYTE]
            )
            points[i, d] = reverse_bits(permute(turned, mix(key, np.uint64(d)))) * _TO_UNIT
