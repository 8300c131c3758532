"""Photon mapping with a fixed number of nearest photons per estimate.

Jensen, "Global illumination using photon maps", EGWR 1996. Two maps are kept: photons that have met
only mirrors, metals and glass make the caustic map, all others the global map. Each estimate takes
the nearest photons of both. That is fast and smooth, but the discs do not shrink: more passes
reduce noise, not blur.
"""

from typing import Any

import numpy as np

from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import MET_SPREADING, Photons
from hybrid_rt.integrators.options import PhotonMapOptions
from hybrid_rt.integrators.photons.density_estimation import Field, Nearest
from hybrid_rt.integrators.photons.photon_groups import size_for_discs
from hybrid_rt.integrators.photons.photon_tracer import chosen
from hybrid_rt.integrators.photons.photon_workers import PhotonWorkers

# Photons farther than this share of `size_for_discs` make no light at a point: around a caustic
# there is darkness, and the nearest photons lie anywhere.
FARTHEST = 0.05

BLUR = (
    "light is blurred by discs about the nearest photons; more passes do not lessen it; "
    "blur_root_mean_square estimates it where it is above the estimate's noise"
)


class PhotonMapWorkers(PhotonWorkers):
    """See the module; `PhotonWorkers` for what it offers.

    ``threads``: each has an `EyePass` of its own.
    """

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads)
        self._options: PhotonMapOptions = context.options or PhotonMapOptions()
        self._n_caustic = 0
        self._size = size_for_discs(context)
        if context.plan["photons"]:
            self._find_thin_places(lambda points: np.minimum(FARTHEST * self._size, points.widest))

    @property
    def _per_pass(self) -> int:
        return self._options.photons_per_pass

    def _fields(self, photons: Photons, pass_number: int) -> tuple[Field, ...]:
        del pass_number
        nearest, lobes = self._options.nearest, self.context.scene.lobes
        limit = FARTHEST * self._size
        is_soft = (photons.history & MET_SPREADING) != 0
        fields = [Nearest(chosen(photons, is_soft), lobes, nearest, limit)]
        if self.context.plan["caustic map"]:
            self._n_caustic += int(np.count_nonzero(~is_soft))
            fields.append(Nearest(chosen(photons, ~is_soft), lobes, nearest, limit))
        return tuple(fields)

    def _own_counts(self) -> dict[str, Any]:
        return {**super()._own_counts(), "n_caustic": self._n_caustic}

    def _carry_own(self, counts: dict[str, Any]) -> None:
        super()._carry_own(counts)
        self._n_caustic += counts["n_caustic"]

    def _forget_own(self) -> None:
        super()._forget_own()
        self._n_caustic = 0

    def _about(self) -> dict[str, Any]:
        return {
            "per_pass": self._options.photons_per_pass,
            "nearest": self._options.nearest,
            "stored_in_caustic_map": self._n_caustic,
            "blur": BLUR,
        }
