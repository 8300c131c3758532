"""Dense caustics are shown to the camera photon by photon.

Where a disc as wide as a pixel holds many photons, it only blurs what they show. There each photon
that mirrors and glass have led from a lamp adds its light to the pixel that sees it, without any
blur: the light tracing of Arvo, "Backward ray tracing", SIGGRAPH 1986 course notes. Discs leave
these photons out where the camera looks straight at a surface, and count them like all others
where it looks through mirrors and glass, so nothing counts twice and nothing is missed.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, NamedPoints
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.direct_light import Shading
from hybrid_rt.integrators.kernels.density_estimate import splat_photons
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR, Flight, Photons
from hybrid_rt.integrators.photons.density_estimation import NEAREST, PIXELS
from hybrid_rt.sensor.camera import Camera

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


# Of the photons of caustics, as many at least must fall where these are dense to ask where that is.
LEAST_SHARE = 0.02


class Splats(NamedTuple):
    """What photons add to the picture; n rows."""

    pixel: NDArray[np.int64]
    value: FloatArray  # (n, 3), radiance


class DensePlaces:
    """Where caustics are dense, by the first photons of all.

    Parameters
    ----------
    position : (n, 3) float64
        Places of first photons that have met nothing but mirrors and glass.
    reach : (n,) float64
        How far around each of them caustics are dense; 0: they are not.
    """

    def __init__(self, position: FloatArray, reach: FloatArray) -> None:
        from scipy.spatial import cKDTree

        self._tree: cKDTree = cKDTree(position)
        self._reach = reach

    @classmethod
    def of(cls, photons: Photons, share: float, camera: Camera, threads: int) -> DensePlaces | None:
        """Return where a disc as wide as a pixel holds enough of such photons; None: nowhere.

        ``share`` is the number of first photons over that of a pass.
        """
        position = photons.position[photons.history == MET_SPECULAR]
        wanted = max(round(NEAREST * share), 3)
        if len(position) <= wanted:
            return None
        from scipy.spatial import cKDTree

        found, _ = cKDTree(position).query(position, [wanted + 1], workers=threads)
        radius = np.asarray(found)[:, 0] * math.sqrt(NEAREST * share / wanted)
        pixel = PIXELS * camera.pixel_size * np.linalg.norm(position - camera.look_from, axis=1)
        is_dense = radius < pixel
        if is_dense.mean() < LEAST_SHARE:
            return None
        return cls(position, np.where(is_dense, pixel, 0.0))

    def hold(self, position: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie where caustics are dense."""
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
    """Return what photons that have arrived add to the picture, for those that the camera sees.

    Parameters
    ----------
    context : RenderContext
    flight : Flight of n rows
    shading : Shading of n rows
        Where they have arrived.
    rows : (k,) int64
        The photons to show.
    lens : (k, 2) float64 in [0, 1), or None
        Places on the lens, if it has any size.
    """
    hits, geometric = shading.hits, shading.geometric
    position = hits.position[rows]
    way, pixel, pdf = context.scene.camera.sees(position, lens)
    value = np.empty((rows.size, 3))
    splat_photons(
        context.scene.lobes, shading.material[rows], shading.colors[rows], hits.normal[rows],
        geometric[rows] if geometric.size else geometric, flight.direction[rows],
        flight.power[rows], way, pdf, value,
    )  # fmt: skip
    seen = np.flatnonzero(value.any(axis=1))
    named = NamedPoints(hits.object_id[rows[seen]], position[seen])
    context.ledger.rays["photons to camera"] += seen.size
    blocked = context.tracer.occluded(named.position, -way[seen], 1.0, source=named)
    seen = seen[~blocked]
    return Splats(pixel[seen], value[seen])
