"""Low-discrepancy numbers that hang on nothing but their names.

A number is named by the seed, the pixel, the dimension (what it is used for) and the pass. So
blocks, threads, order and machines do not matter, and a pass can be computed again at any time.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from hybrid_rt import checks
from hybrid_rt.intersection.pool import Pool
from hybrid_rt.kernels.sampler import sobol_points
from hybrid_rt.records import FloatArray

UIntArray = NDArray[np.uint64]


class Sampler:
    """Owen-scrambled Sobol points; the pass number is the sample number.

    Parameters
    ----------
    seed : int
        From 0 to 2**64 - 1.
    pool : Pool, optional
        Threads that share long batches; they change no bit.

    Raises
    ------
    ValueError
        If the seed is out of that range.
    """

    def __init__(self, seed: int, pool: Pool | None = None) -> None:
        seed = checks.whole(seed, "seed", at_least=0, up_to=2**64 - 1)
        self._seed = np.uint64(seed)
        self._pool = Pool(1) if pool is None else pool

    def points(
        self, pixel: UIntArray, dimension: UIntArray | int, pass_number: UIntArray | int
    ) -> FloatArray:
        """Return one point of the unit square for each pixel.

        Parameters
        ----------
        pixel : (n,) uint64
            Number of the pixel in the whole image.
        dimension : (n,) uint64, or one number for all
            What the point is for; different uses need different numbers.
        pass_number : (n,) uint64, or one number for all
            From 0; the passes of one (pixel, dimension) fill the square evenly.

        Returns
        -------
        (n, 2) float64 in [0, 1)
        """
        point: FloatArray = self.several(pixel, dimension, pass_number, 1)[0]
        return point

    def several(
        self,
        pixel: UIntArray,
        dimension: UIntArray | int,
        pass_number: UIntArray | int,
        n_dimensions: int,
    ) -> FloatArray:
        """Return the points of dimensions that follow each other, (n_dimensions, n, 2).

        Parameters are those of `points`; ``dimension`` is the first.
        """
        points = np.empty((n_dimensions, pixel.size, 2))
        dimensions, samples = _for_all(dimension, pixel.size), _for_all(pass_number, pixel.size)

        def fill(i: int, j: int) -> None:
            sobol_points(self._seed, samples[i:j], pixel[i:j], dimensions[i:j], i, points)

        self._pool.run(fill, pixel.size)
        return points


def _for_all(number: UIntArray | int, n: int) -> UIntArray:
    return np.ascontiguousarray(np.broadcast_to(np.asarray(number, dtype=np.uint64), (n,)))
