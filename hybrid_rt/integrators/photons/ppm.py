"""Progressive photon mapping by independent passes.

Hachisuka, Ogaki and Jensen, "Progressive photon mapping", ToG 27(5), 2008; in the form of Knaus and
Zwicker, "Progressive photon mapping: a probabilistic approach", ToG 30(3), 2011. Passes are
independent: each traces photons of its own and one or more camera paths per pixel. The radius shrinks from
pass to pass (`radius_factor`), so in the mean of the passes both noise and blur vanish.
"""

import math
from typing import Any

import numpy as np

from hybrid_rt.core.threads import result_of
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import Photons
from hybrid_rt.integrators.options import PPMOptions
from hybrid_rt.integrators.photons.density_estimation import (
    NARROWEST,
    WIDEST_ASKED,
    DensePlaces,
    Discs,
    Field,
    Radii,
)
from hybrid_rt.integrators.photons.emission import size_for_discs
from hybrid_rt.integrators.photons.photon_tracer import PILOT_DIMENSION, Balance, Splats
from hybrid_rt.integrators.photons.photon_workers import PhotonWorkers
from hybrid_rt.integrators.photons.pilot import measure_work
from hybrid_rt.integrators.rows import rows_of

# The first photons, which find radii, dense caustics and the number of shadow rays; at most.
PILOT_PHOTONS = 100_000
# Numbers of rays are chosen for the discs of so many passes.
TYPICAL_PASSES = 16

BLUR = (
    "light is blurred by discs that shrink from pass to pass; the blur of the mean falls as "
    "passes ** (alpha - 1); blur_root_mean_square estimates it where it is above the estimate's noise"
)


class ProgressiveWorkers(PhotonWorkers):
    """See the module; `PhotonWorkers` for what it offers.

    ``threads``: each has an `EyePass` of its own.
    """

    options = PPMOptions

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads)
        # Now, as part of the set-up: a time budget judges by the seconds of passes alone.
        self._radii: Radii | None = None
        if context.plan["photons"]:
            radii = self._radii = self._pilot()
            self._find_thin_places(lambda points: radii.around(points.position, points.widest)[0])
            self.may_miss = (
                self._radii.is_given or self._radii.is_sparse or self._radii.are_cut(context.scene)
            )

    def _fields(self, photons: Photons, pass_number: int) -> tuple[Field, ...]:
        assert self._radii is not None
        shrink = radius_factor(pass_number, self._options.alpha)
        return (Discs(photons, self.context.scene.lobes, self._radii, shrink),)

    def _pilot(self) -> Radii:
        """Shoot the first photons; return initial radii, and set what else follows from them."""
        extent = size_for_discs(self.context)
        asked = self._asked_radii(extent)
        n = min(PILOT_PHOTONS, self._options.photons_per_pass)
        share = n / self._options.photons_per_pass
        camera, lobes = self.context.scene.camera, self.context.scene.lobes

        def finish(
            photons: Photons, _splats: list[Splats], _balance: Balance
        ) -> tuple[Radii, DensePlaces | None, tuple[Discs, Discs]]:
            dense, radii = None, asked
            if radii is None:
                dense = DensePlaces.of(photons, share, camera, self._threads)
                radii = Radii.of(photons, share, camera, extent, self._threads)
            is_even = np.arange(len(photons.history)) % 2 == 0
            even, odd = rows_of(photons, is_even), rows_of(photons, ~is_even)
            return radii, dense, (Discs(even, lobes, radii, 1.0), Discs(odd, lobes, radii, 1.0))

        with self._at_work() as submit:
            started = self._shoot(n, 0, PILOT_DIMENSION, submit, finish)
            found: tuple[Radii, DensePlaces | None, tuple[Discs, Discs]] = result_of(started)
        radii, dense, halves = found
        if dense is not None and not dense.are_seen(self.context):
            dense = None
        ledgers = [eye_pass.context.ledger for eye_pass in self._eye_passes]
        photon_rays = sum(
            ledger.rays[name] for ledger in ledgers for name in ("photon", "photons to camera")
        )
        # Photons in smaller discs have more variance, in proportion to 1 / radius^2.
        shrinks = (radius_factor(i, self._options.alpha) for i in range(TYPICAL_PASSES))
        of_pass = share * sum(shrink**-2 for shrink in shrinks) / TYPICAL_PASSES
        work = measure_work(self.context, halves, of_pass, photon_rays / share)
        numbers = (1, 1) if work is None else work.best_numbers
        for eye_pass in self._eye_passes:
            eye_pass.photon_tracer.dense = dense if eye_pass.is_in_the_open else None
            eye_pass.n_camera_rays, eye_pass.n_shadow_rays = numbers
        return radii

    def _asked_radii(self, extent: float) -> Radii | None:
        radius = self._options.initial_radius
        if radius is None:
            return None
        low, high = NARROWEST * extent, WIDEST_ASKED * extent
        if not low <= radius <= high:
            raise ValueError(
                f"PPMOptions initial_radius is {radius:g}, the scene, or what is seen "
                f"of it, is {extent:.3g} across: pass {low:.3g} to {high:.3g}, or None"
            )
        return Radii.fixed(radius, is_given=True)

    def _about(self) -> dict[str, Any]:
        first = [] if self._radii is None else self._radii.classes.tolist()
        last = radius_factor(max(self.n_kept - 1, 0), self._options.alpha)
        return {
            "alpha": self._options.alpha,
            "first_radii": first,
            "last_radii": [last * radius for radius in first],
            "camera_rays_per_pixel": self._eye_passes[0].n_camera_rays,
            "shadow_rays_per_point": self._eye_passes[0].n_shadow_rays,
            "blur": BLUR,
        }


def radius_factor(pass_number: int, alpha: float) -> float:
    """Return the radius of a pass over the initial radius.

    Knaus and Zwicker, "Progressive photon mapping: a probabilistic approach", ToG 30(3), 2011:
    r_i^2 = r_1^2 Gamma(i + alpha) / (Gamma(1 + alpha) Gamma(i + 1)), with i = 1 in the first pass.
    """
    i = pass_number + 1.0
    log_square = math.lgamma(i + alpha) - math.lgamma(1.0 + alpha) - math.lgamma(i + 1.0)
    return math.exp(0.5 * log_square)
