"""Light tracing of dense caustics: photons are splatted to the pixels that see them.

Where a disc as wide as a pixel would hold many photons, density estimation adds only blur. There
each caustic photon is splatted to the pixel that sees it (Arvo, "Backward ray tracing", SIGGRAPH
1986 course notes). Density estimation leaves these photons out where the camera sees the surface
directly, and counts them where it sees the surface through mirrors and glass. So each photon counts
once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.density_estimate import splat_photons
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR, Flight, Photons
from hybrid_rt.integrators.photons.density_estimation import NEAREST, PIXELS
from hybrid_rt.integrators.shading import NO_RATIO, Shading
from hybrid_rt.sensor.projection import Projection
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.lobes.register import NARROW, WIDE

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


# Light tracing pays where at least this share of the pilot pass's caustic photons lies in dense places,
# and of these is seen by the camera, judged by so many of them at most.
LEAST_SHARE, MOST_JUDGED = 0.02, 1024
# A segment to a photon ends this much of its length before it.
BEFORE_END = 1e-6


class Splats(NamedTuple):
    """Contributions of photons to pixels; n rows."""

    pixel: NDArray[np.int64]
    value: FloatArray  # (n, 3), radiance


class DensePlaces:
    """Where caustics are dense, judged by a first set of photons.

    ``position`` (n, 3): positions of its caustic photons.
    ``reach`` (n,): radius around each in which caustics are dense; 0: they are not.
    """

    def __init__(self, position: FloatArray, reach: FloatArray) -> None:
        from scipy.spatial import cKDTree

        self._tree: cKDTree = cKDTree(position)
        self._position, self._reach = position, reach

    @classmethod
    def of(
        cls, photons: Photons, share: float, camera: Projection, threads: int
    ) -> DensePlaces | None:
        """Return where a disc as wide as a pixel holds enough caustic photons; None: nowhere.

        ``share`` is the number of these photons over that of a pass.
        """
        position = photons.position[photons.history == MET_SPECULAR]
        wanted = max(round(NEAREST * share), 3)
        if len(position) <= wanted:
            return None
        from scipy.spatial import cKDTree

        found, _ = cKDTree(position).query(position, [wanted + 1], workers=threads)
        radius = np.asarray(found)[:, 0] * math.sqrt(NEAREST * share / wanted)
        pixel = PIXELS * camera.pixel_widths(position)
        is_dense = radius < pixel
        if is_dense.mean() < LEAST_SHARE:
            return None
        return cls(position, np.where(is_dense, pixel, 0.0))

    def are_seen(self, context: RenderContext) -> bool:
        """Tell whether the camera sees enough of the dense caustics directly, not through glass."""
        dense = self._position[self._reach > 0.0]
        judged = dense[:: max(len(dense) // MOST_JUDGED, 1)]
        camera = context.scene.camera
        way, _, pdf = camera.sees(judged)
        tracer = context.tracer.with_own_counters()
        is_hidden = tracer.occluded(judged - way, way, 1.0 - BEFORE_END)
        return bool(np.mean((pdf > 0.0) & ~is_hidden) >= LEAST_SHARE)

    def hold(self, position: FloatArray) -> BoolArray:
        """Tell at which points (n, 3) caustics are dense."""
        found, number = self._tree.query(position, distance_upper_bound=self._reach.max())
        distance, nearest = np.asarray(found, dtype=np.float64), np.asarray(number)
        is_near = np.isfinite(distance)
        is_near[is_near] = distance[is_near] < self._reach[nearest[is_near]]
        return is_near


def show(
    context: RenderContext,
    flight: Flight,
    shading: Shading,
    rows: NDArray[np.intp],
    lens: FloatArray | None,
) -> Splats:
    """Splat photons: return the contributions of those that the camera sees; see `shown_rows`."""
    return shown_rows(context, flight, shading, rows, lens)[1]


def shown_rows(
    context: RenderContext,
    flight: Flight,
    shading: Shading,
    rows: NDArray[np.intp],
    lens: FloatArray | None,
    softened: LobeTable | None = None,
) -> tuple[NDArray[np.intp], Splats]:
    """Splat photons; return the rows of those that the camera sees, and their contributions.

    ``flight``, Flight of n rows.
    ``shading``, Shading of n rows: their hits.
    ``rows`` (k,) int64: the photons to splat.
    ``lens`` (k, 2) in [0, 1), or None: points on the lens; None for a pinhole.
    ``softened``: narrow lobes to see the photons by, on both sides of rough glass. Default: the
    scene's wide lobes.
    """
    hits, geometric = shading.hits, shading.geometric
    lobes, asked = context.scene.lobes, WIDE
    ratio = NO_RATIO
    if softened is not None:
        lobes, asked = softened, NARROW
        ratio = shading.ratio[rows] if shading.ratio.size else NO_RATIO
    position = hits.position[rows]
    way, pixel, pdf = context.scene.camera.sees(position, lens)
    value = np.empty((rows.size, 3))
    splat_photons(
        lobes, asked, shading.material[rows], shading.colors[rows], hits.normal[rows],
        geometric[rows] if geometric.size else geometric, ratio, flight.direction[rows],
        flight.power[rows], way, pdf, value,
    )  # fmt: skip
    seen = np.flatnonzero(value.any(axis=1))
    named = NamedPoints(hits.object_id[rows[seen]], position[seen])
    context.ledger.rays["photons to camera"] += seen.size
    blocked = context.tracer.occluded(named.position, -way[seen], 1.0, source=named)
    seen = seen[~blocked]
    return rows[seen], Splats(pixel[seen], value[seen])
