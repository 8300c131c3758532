"""The sampler: low-discrepancy numbers as a pure function of their key.

The key is (seed, pixel, dimension, pass); each use of random numbers has a dimension of its own. So
results do not depend on blocks, threads, order or machine, and any pass can be computed again.
"""

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.sampling.kernels.sobol import joint_points, sobol_points

UIntArray = NDArray[np.uint64]

# Coefficients of primitive polynomials modulo 2, without the first and last, and initial numbers, of
# Sobol's coordinates from the second on: Joe and Kuo, "Constructing Sobol sequences with better
# two-dimensional projections", SIAM J. Sci. Comput. 30(5), 2008.
_JOE_KUO = (((), (1,)), ((1,), (1, 3)), ((0, 1), (1, 3, 1)), ((1, 0), (1, 1, 1)))
MOST_JOINT = len(_JOE_KUO) + 1


class Sampler:
    """Owen-scrambled Sobol points; the pass number is the sample number.

    Threads of the pool, for long batches, change no result.
    """

    def __init__(self, seed: int, pool: Pool | None = None) -> None:
        seed = checks.whole(seed, "seed", at_least=0, up_to=2**64 - 1)
        self._seed = np.uint64(seed)
        self._pool = Pool(1) if pool is None else pool

    @property
    def seed(self) -> np.uint64:
        """The seed."""
        return self._seed

    def points(
        self, pixel: UIntArray, dimension: UIntArray | int, pass_number: UIntArray | int
    ) -> FloatArray:
        """Return one point of the unit square for each pixel of the whole image, (n, 2).

        Different uses need different dimensions. Passes are numbered from 0 to 2**32 - 1, after which they repeat;
        those of one (pixel, dimension) are well distributed in the square.
        """
        return self.several(pixel, dimension, pass_number, 1)[0]

    def joint(self, pixel: UIntArray, dimension: int, number: UIntArray, width: int) -> FloatArray:
        """Return points ``number`` of Sobol sequences in up to `MOST_JOINT` dimensions, (n, width).

        If the integrand depends on all coordinates together, this beats several 2D `points`, which
        are padded: well distributed in each square, but combined at random. The first are distributed best.
        """
        points = np.empty((number.size, width))
        joint_points(self._seed, number, pixel, np.uint64(dimension), _TABLES, points)
        return points

    def several(
        self,
        pixel: UIntArray,
        dimension: UIntArray | int,
        pass_number: UIntArray | int,
        n_dimensions: int,
    ) -> FloatArray:
        """Return the `points` of consecutive dimensions from ``dimension`` on, (n_dimensions, n, 2)."""
        points = np.empty((n_dimensions, pixel.size, 2))
        dimensions, samples = _for_all(dimension, pixel.size), _for_all(pass_number, pixel.size)

        def fill(i: int, j: int) -> None:
            sobol_points(self._seed, samples[i:j], pixel[i:j], dimensions[i:j], i, points)

        self._pool.run(fill, pixel.size)
        return points


def _for_all(number: UIntArray | int, n: int) -> UIntArray:
    return np.ascontiguousarray(np.broadcast_to(np.asarray(number, dtype=np.uint64), (n,)))


def _byte_tables() -> UIntArray:
    """Return what each byte of an index contributes to Sobol's coordinates, the lowest bit for one half."""
    tables = np.zeros((MOST_JOINT, 4, 256), dtype=np.uint64)
    for row, table in enumerate(tables):
        # Each number has its digits after the point: the k-th one k of them.
        numbers = [1] * 32
        if row:
            coefficients, first = _JOE_KUO[row - 1]
            degree = len(first)
            numbers[:degree] = first
            for k in range(degree, 32):
                new = numbers[k - degree] ^ (numbers[k - degree] << degree)
                for j, coefficient in enumerate(coefficients, start=1):
                    new ^= coefficient * (numbers[k - j] << j)
                numbers[k] = new
        for bit, digits in enumerate(numbers):
            turned = int(f"{digits << (31 - bit):032b}"[::-1], 2)
            has_bit = np.arange(256) >> (bit % 8) & 1
            table[bit // 8] ^= np.uint64(turned) * has_bit.astype(np.uint64)
    return tables


_TABLES = _byte_tables()
