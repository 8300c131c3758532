"""A set of rays, each with the name of its generator."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray


class RaySet(NamedTuple):
    """Rays of one or several generators."""

    origins: FloatArray  # (n, 3)
    directions: FloatArray  # (n, 3)
    names: NDArray[np.str_]  # (n,), the generator of each
