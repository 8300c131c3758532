"""The initial state of camera paths."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.integrators.direct_light import NO_RIVAL
from hybrid_rt.integrators.integrator import CameraBlock
from hybrid_rt.integrators.kernels.compaction import Paths
from hybrid_rt.integrators.kernels.ways import N_COLUMNS, OTHER
from hybrid_rt.scene.compiled import NOTHING


def leaving_camera(
    block: CameraBlock, media: IntArray, has_rivals: bool = False, asks_ways: bool = False
) -> Paths:
    """Return the paths that begin with a block's rays.

    Parameters
    ----------
    block : CameraBlock
    media : (STACK,) int32, or (0,)
        Medium stack of the camera.
    has_rivals : bool
        Whether the paths are weighted against light subpaths.
    asks_ways : bool
        Whether lamps are reached by way of balls or boxes.
    """
    n = block.pixel.size
    return Paths(
        camera_ray=np.arange(n),
        pixel=block.pixel,
        sample=block.sample,
        origins=block.origins,
        directions=block.directions,
        throughput=np.ones((n, 3)),
        pdf=np.zeros(n),
        first=np.zeros(n),
        rival=np.zeros(n) if has_rivals else NO_RIVAL,
        media=np.repeat(media[None], n, axis=0),
        source_id=np.full(n, NOTHING, dtype=np.int32),
        joined=np.zeros(n if has_rivals else 0, dtype=np.bool_),
        chain=np.full(n if asks_ways else 0, OTHER, dtype=np.int8),
        anchor=np.empty((n if asks_ways else 0, N_COLUMNS)),
    )
