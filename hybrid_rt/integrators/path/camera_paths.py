"""The initial state of camera paths, and where they are divided."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.integrators.direct_light import NO_CONNECTION
from hybrid_rt.integrators.integrator import CameraBlock
from hybrid_rt.integrators.kernels.branches import MOST_SPLITS
from hybrid_rt.integrators.kernels.compaction import Paths
from hybrid_rt.integrators.kernels.ways import N_COLUMNS, OTHER
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.lobes.register import DELTA, TRANSMITS


def leaving_camera(
    block: CameraBlock,
    media: IntArray,
    has_light_paths: bool = False,
    samples_specular: bool = False,
) -> Paths:
    """Return the paths that begin with a block's rays.

    Parameters
    ----------
    block : CameraBlock
    media : (STACK,) int32, or (0,)
        Medium stack of the camera.
    has_light_paths : bool
        Whether the paths are weighted against light subpaths.
    samples_specular : bool
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
        carried=np.zeros(n),
        splits=np.full(n, MOST_SPLITS, dtype=np.int8),
        connection_pdf=np.zeros(n) if has_light_paths else NO_CONNECTION,
        media=np.repeat(media[None], n, axis=0),
        source_id=np.full(n, NOTHING, dtype=np.int32),
        joined=np.zeros(n if has_light_paths else 0, dtype=np.bool_),
        has_met_wide=np.zeros(n if has_light_paths else 0, dtype=np.bool_),
        chain=np.full(n if samples_specular else 0, OTHER, dtype=np.int8),
        anchor=np.empty((n if samples_specular else 0, N_COLUMNS)),
    )


def glass_alone(scene: CompiledScene) -> IntArray:
    """Return the lobe of each material that is smooth glass and nothing else, (materials,) int32.

    It is `NOTHING` for others.
    """
    lobes = scene.lobes
    first = lobes.first[:-1]
    lobe = np.full(max(first.size, 1), NOTHING, dtype=np.int32)
    is_alone = np.diff(lobes.first) == 1
    rows = np.flatnonzero(is_alone)
    # A part of a mixture is a share of it, even if it is the only one.
    rows = rows[lobes.weight[first[rows]] == 1.0]
    traits = lobes.traits[first[rows]]
    rows = rows[(traits & DELTA != 0) & (traits & TRANSMITS != 0)]
    lobe[rows] = first[rows]
    return lobe
