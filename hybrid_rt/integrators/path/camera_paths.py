"""The initial state of camera paths, and where they are divided."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.integrators.integrator import CameraBlock
from hybrid_rt.integrators.kernels.branches import MOST_SPLITS
from hybrid_rt.integrators.kernels.compaction import Paths
from hybrid_rt.integrators.kernels.ways import N_COLUMNS, OTHER
from hybrid_rt.integrators.rows import new_rows
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.lobes.register import DELTA, TRANSMITS


def new_paths(n: int, media_depth: int, has_light_paths: bool, samples_specular: bool) -> Paths:
    """Allocate n paths.

    ``media_depth``: `STACK`, or 0 without dielectrics. ``has_light_paths``: they are weighted against light
    subpaths. ``samples_specular``: lamps are reached by way of mirrors and glass.
    """
    media, anchor = f"({media_depth},)i4", f"({N_COLUMNS},)f8"
    form = f"i8, u8, u8, 3f8, 3f8, 3f8, f8, f8, i1, f8, {media}, i4, ?, ?, i1, {anchor}"
    paths = new_rows(Paths, n, form)
    own = slice(n if has_light_paths else 0), slice(n if samples_specular else 0)
    return paths._replace(
        connection_pdf=paths.connection_pdf[own[0]],
        joined=paths.joined[own[0]],
        has_met_wide=paths.has_met_wide[own[0]],
        chain=paths.chain[own[1]],
        anchor=paths.anchor[own[1]],
    )


def leaving_camera(
    block: CameraBlock,
    media: IntArray,
    has_light_paths: bool = False,
    samples_specular: bool = False,
) -> Paths:
    """Return the paths that begin with a block's rays.

    ``media`` (STACK,) int32, or (0,), is the medium stack of the camera; see `new_paths`.
    """
    paths = new_paths(block.pixel.size, media.size, has_light_paths, samples_specular)
    paths.camera_ray[:] = np.arange(block.pixel.size)
    paths.throughput[:] = 1.0
    paths.splits[:] = MOST_SPLITS
    paths.media[:] = media
    paths.source_id[:] = NOTHING
    paths.chain[:] = OTHER
    for zero in (
        paths.pdf, paths.carried, paths.connection_pdf, paths.joined, paths.has_met_wide,
    ):  # fmt: skip
        zero[:] = 0
    return paths._replace(
        pixel=block.pixel, sample=block.sample, origins=block.origins, directions=block.directions
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
