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

# All words have 32 bits, so that eight of them fill a vector register. Numba widens the result of
# every operation to 64 bits, which the conversions undo; what overflows is cut off, as it should be.
_word = np.uint32
_GOLDEN, _ONE, _TWO, _ZERO = _word(0x9E3779B9), _word(1), _word(2), _word(0)
_S1, _S2, _S4, _S8, _S15, _S16 = _word(1), _word(2), _word(4), _word(8), _word(15), _word(16)
_BITS1, _BITS2 = _word(0x55555555), _word(0x33333333)
_BITS4, _BITS8 = _word(0x0F0F0F0F), _word(0x00FF00FF)
_HASH_A, _HASH_B = _word(0x7FEB352D), _word(0x846CA68B)
_OWEN_A, _OWEN_B, _OWEN_C = _word(0x3D20ADEA), _word(0x05526C56), _word(0x53A22864)
_SIGN = _word(0x80000000)
_RUN = 128
_BYTE = np.uint64(0xFF)
_L8, _L16, _L24, _L32 = np.uint64(8), np.uint64(16), np.uint64(24), np.uint64(32)


@inner
def mix(state, word):
    """Mix one word into a hash (the "lowbias32" finaliser of C. Wellons)."""
    x = _word(_word(state + _GOLDEN) ^ word)
    x = _word(x ^ (x >> _S16))
    x = _word(x * _HASH_A)
    x = _word(x ^ (x >> _S15))
    x = _word(x * _HASH_B)
    return _word(x ^ (x >> _S16))


@inner
def reverse_bits(x):
    """Reverse the bits of a word."""
    x = _word(((x >> _S1) & _BITS1) | ((x & _BITS1) << _S1))
    x = _word(((x >> _S2) & _BITS2) | ((x & _BITS2) << _S2))
    x = _word(((x >> _S4) & _BITS4) | ((x & _BITS4) << _S4))
    x = _word(((x >> _S8) & _BITS8) | ((x & _BITS8) << _S8))
    return _word((x >> _S16) | (x << _S16))


@inner
def permute(x, key):
    """Permute binary digits, the lowest first: each flip depends on the digits before it."""
    x = _word(x ^ _word(x * _OWEN_A))
    x = _word(x + key)
    x = _word(x * _word((key >> _S16) | _ONE))
    x = _word(x ^ _word(x * _OWEN_B))
    return _word(x ^ _word(x * _OWEN_C))


@inner
def sobol_second(turned):
    """Return the second Sobol coordinate of a bit-reversed index; the first is that index itself."""
    # The generator matrix is Pascal's triangle modulo 2, five times over the Kronecker product of
    # ((1, 1), (0, 1)) with itself: each factor is one line.
    x = _word(turned ^ (turned << _S16))
    x = _word(x ^ ((x & _BITS8) << _S8))
    x = _word(x ^ ((x & _BITS4) << _S4))
    x = _word(x ^ ((x & _BITS2) << _S2))
    return _word(x ^ ((x & _BITS1) << _S1))


@inner
def to_unit(x):
    """Return a word over 2**32."""
    # Processors convert signed words faster. Both steps are exact.
    return (np.int32(x ^ _SIGN) + 2147483648.0) * 2.0**-32


@inlined
def key_of_pixel(seed, pixel):
    """Return the hash of a seed and a pixel, both uint64."""
    seed_key = mix(mix(_ZERO, _word(seed)), _word(seed >> _L32))
    return mix(mix(seed_key, _word(pixel)), _word(pixel >> _L32))


@inlined
def sobol_point(pixel_key, turned_sample, low, high):
    """Return the point of one dimension, two numbers in [0, 1).

    ``turned_sample`` is the bit-reversed sample number; ``low`` and ``high`` are the two words of the
    dimension. Scrambling permutes the digits from the highest on, so words are bit-reversed before
    and after it; where two reversals meet, both are left out.
    """
    key = mix(mix(pixel_key, low), high)
    turned = permute(turned_sample, key)
    first = permute(reverse_bits(turned), mix(key, _ONE))
    second = permute(reverse_bits(sobol_second(turned)), mix(key, _TWO))
    return to_unit(reverse_bits(first)), to_unit(reverse_bits(second))


@kernel(allocates=True)
def sobol_points(seed, sample, pixel, dimension, begin, points):
    """Fill n rows of ``points`` (m, rows, 2) from ``begin`` on, in m dimensions from ``dimension`` (n,) on."""
    # Loops over short runs, each of which compiles to vector instructions: 7 ns a point instead of 31.
    key, turned = np.empty(_RUN, np.uint32), np.empty(_RUN, np.uint32)
    low, high = np.empty(_RUN, np.uint32), np.empty(_RUN, np.uint32)
    xi = np.empty((2, _RUN))
    for start in range(0, pixel.size, _RUN):
        stop = min(start + _RUN, pixel.size)
        of_pixel, of_sample, of_point = pixel[start:stop], sample[start:stop], dimension[start:stop]
        for k in range(of_pixel.size):
            key[k] = key_of_pixel(seed, of_pixel[k])
            turned[k] = reverse_bits(_word(of_sample[k]))
        for d in range(points.shape[0]):
            for k in range(of_point.size):
                low[k] = _word(of_point[k] + np.uint64(d))
                high[k] = _word((of_point[k] + np.uint64(d)) >> _L32)
            for k in range(of_pixel.size):
                xi[0, k], xi[1, k] = sobol_point(key[k], turned[k], low[k], high[k])
            out = points[d, begin + start : begin + stop]
            for k in range(of_pixel.size):
                out[k, 0], out[k, 1] = xi[0, k], xi[1, k]


@kernel(allocates=True)
def joint_points(seed, sample, pixel, dimension, tables, points):
    """Fill ``points`` (n, m) with points of one m-dimensional Sobol sequence.

    Each coordinate is scrambled independently; the order is not shuffled, as the points are paired with no
    others. ``tables`` (m, 4, 256) are the bit-reversed contributions of each byte of an index to each
    coordinate.
    """
    for i in range(sample.size):
        key = key_of_pixel(seed, pixel[i])
        key = mix(mix(key, _word(dimension)), _word(dimension >> _L32))
        index = sample[i]
        for d in range(points.shape[1]):
            turned = (
                tables[d, 0, index & _BYTE]
                ^ tables[d, 1, (index >> _L8) & _BYTE]
                ^ tables[d, 2, (index >> _L16) & _BYTE]
                ^ tables[d, 3, (index >> _L24) & _BYTE]
            )
            points[i, d] = to_unit(reverse_bits(permute(_word(turned), mix(key, _word(d)))))
