"""Progressive photon mapping by independent passes.

Hachisuka, Ogaki and Jensen, "Progressive photon mapping", ToG 27(5), 2008; in the form of Knaus and
Zwicker, "Progressive photon mapping: a probabilistic approach", ToG 30(3), 2011, in which passes
share nothing: each shoots photons of its own and looks at them with one ray per pixel, the discs
of later passes are smaller, and the mean of the passes loses both noise and blur.
"""

from __future__ import annotations

from typing import Any

from hybrid_rt.integrators.gathering import Discs, Field, Radii, shrunk
from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.integrators.options import PPMOptions
from hybrid_rt.integrators.photon_crew import PhotonCrew
from hybrid_rt.integrators.shooting import PHOTON_DIMENSION, PILOT_DIMENSION

# The photons that radii are found by, at most.
PILOT_PHOTONS = 100_000

BLUR = (
    "light is blurred by discs that shrink from pass to pass; the blur of the mean falls as "
    "passes ** (alpha - 1), and blur_root_mean_square estimates it"
)


class ProgressiveCrew(PhotonCrew):
    """See the module; `PhotonCrew` for what it offers."""

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads)
        self._options: PPMOptions = context.options or PPMOptions()
        self.error_power = self._options.error_power
        self.blur_stays = self._options.alpha == 1.0
        self._last = 1.0
        # Now, as part of the set-up: a time budget judges by the seconds of passes alone.
        self._radii: Radii | None = None
        if context.plan["photons"]:
            self._radii = self._first_radii()

    def _fields(self, pass_number: int) -> tuple[Field, ...]:
        assert self._radii is not None
        photons = self._shot(self._options.photons_per_pass, pass_number, PHOTON_DIMENSION)
        self._last = shrunk(pass_number, self._options.alpha)
        with self.context.ledger.stage("photon tree"):
            return (Discs(photons, self.context.scene.lobes, self._radii, self._last),)

    def _first_radii(self) -> Radii:
        options = self._options
        if options.initial_radius is not None:
            return Radii.fixed(options.initial_radius)
        n = min(PILOT_PHOTONS, options.photons_per_pass)
        photons = self._shot(n, 0, PILOT_DIMENSION)
        self._forget_balance()
        with self.context.ledger.stage("photon tree"):
            extent = 2.0 * float(self._lookers[0].shooter.world[3])
            share = n / options.photons_per_pass
            camera = self.context.scene.camera
            return Radii.of(photons, share, camera, extent, self._threads)

    def _about(self) -> dict[str, Any]:
        first = [] if self._radii is None else self._radii.classes.tolist()
        return {
            "per_pass": self._options.photons_per_pass,
            "alpha": self._options.alpha,
            "first_radii": first,
            "last_radii": [self._last * radius for radius in first],
            "blur": BLUR,
        }
