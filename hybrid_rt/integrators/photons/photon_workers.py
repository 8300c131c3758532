"""Worker threads of photon mapping: they trace the photons of a pass together, then its eye pass.

While some threads still work on the eye pass of one pass, others trace the photons of the next: no
thread waits in between, and at most two photon maps exist at a time.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Generator
from threading import Lock
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.interrupts import held_back
from hybrid_rt.core.ledger import twelve_digits
from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR, Photons
from hybrid_rt.integrators.photons.density_estimation import Field
from hybrid_rt.integrators.photons.eye_pass import EyePass
from hybrid_rt.integrators.photons.light_tracing import Splats
from hybrid_rt.integrators.photons.photon_tracer import (
    PHOTON_DIMENSION,
    Balance,
    blocks_of,
    joined,
)
from hybrid_rt.integrators.workers import NO_BLUR, UNKNOWN_BLUR, Blur, Submit, Workers
from hybrid_rt.sensor.film import OVERFLOWS
from hybrid_rt.sensor.image_metrics import DARK

# Camera rays that one thread follows and gathers for at a time: many, as trees of many points are
# compared faster, but a sixteenth of a pass at most, for the threads to share. The order of the
# sums over photons depends on this number, so it is the same for any number of threads.
FEWEST_RAYS, MOST_RAYS, SHARE_OF_RAYS = 2**12, 2**15, 16

# The noise of the estimated blur is read from how much it differs between tiles of the picture: so
# many tiles a side, wider than
# most discs and so nearly independent. Student's t for their degrees of freedom, one-sided 95 %.
TILES, STUDENT = 4, 1.753
# The true blur is up to so many times its estimate: 1.3 times at borders, as the estimate takes light
# for smooth; as a relative figure 1.8 times beside them, where blurred light brightens what it is
# divided by. docs/error_vs_time.md has the figures.
AT_BORDERS = 2.0
# From this share of points without photons on, light is missing rather than dark places common.
NEARLY_ALL = 0.99

T = TypeVar("T")
# The photons of a pass, ready to be looked at, and the picture of those shown to the camera.
Ready = tuple[tuple[Field, ...], FloatArray | None]


class PhotonWorkers(Workers):
    """See the module; `Workers` for what it offers.

    Parameters
    ----------
    context : RenderContext
    threads : int

    Attributes
    ----------
    is_radius_asked : bool
        Whether the initial radius was given, so that discs may be too small to hold photons.
    """

    is_radius_asked = False

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads, EyePass)
        self._threads = threads
        self._n_passes = self._n_splats = 0
        self._balance = Balance()
        # Sums over passes of how much less discs of half the area give, and of the squares.
        self._blur = np.zeros_like(self._eye_passes[0].blur)
        self._blur_squares = np.zeros_like(self._blur)

    @property
    def _eye_passes(self) -> list[EyePass]:
        return cast(list[EyePass], self._integrators)

    @property
    @abstractmethod
    def _per_pass(self) -> int:
        """Photons that leave all lights together in a pass."""

    @abstractmethod
    def _fields(self, photons: Photons, pass_number: int) -> tuple[Field, ...]:
        """Make the photons of a pass ready to be looked at."""

    @abstractmethod
    def _about(self) -> dict[str, Any]:
        """Return the settings and radii for the report, and what is to be known of the blur."""

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Generator[FloatArray, None, None]:
        """Yield the radiance of each pass: one sample per pixel and one photon map."""
        camera = self.context.scene.camera
        blur = np.zeros_like(self._blur)
        with self._at_work() as submit:
            shot = self._begin(passes[0], submit)
            for k, number in enumerate(passes):
                fields, picture = shot()
                # While threads look at this pass they shoot the next one already.
                shot = self._begin(number + 1, submit) if number + 1 in passes else _nothing
                for eye_pass in self._eye_passes:
                    eye_pass.fields, eye_pass.blur = fields, blur
                done = k * camera.height * camera.width

                def heard(n: int, done: int = done) -> None:
                    if on_rays is not None:
                        on_rays(done + n)

                for radiance in super().render_passes(range(number, number + 1), heard):
                    # First, so that no picture holds a pass of which the blur is not known.
                    with held_back():
                        self._add_blur(blur)
                    yield radiance if picture is None else radiance + picture

    @OVERFLOWS
    def _add_blur(self, blur: FloatArray) -> None:
        self._blur += blur
        self._blur_squares += blur * blur
        self._n_passes += 1

    def _block_size(self, n: int) -> int:
        return min(max(-(-n // SHARE_OF_RAYS), FEWEST_RAYS), MOST_RAYS)

    def _begin(self, pass_number: int, submit: Submit) -> Callable[[], Ready]:
        """Start the tracing of a pass's photons in threads; return a function that waits for it."""
        if not self.context.plan["photons"]:
            return _nothing

        def ready(eye_pass: EyePass, photons: Photons, shown: list[Splats]) -> Ready:
            with eye_pass.context.ledger.stage("photon tree"):
                return self._fields(photons, pass_number), self._picture(shown)

        return self._shot(self._per_pass, pass_number, PHOTON_DIMENSION, submit, ready)

    def _shot(
        self,
        n: int,
        pass_number: int,
        dimension: int,
        submit: Submit,
        ready: Callable[[EyePass, Photons, list[Splats]], T],
    ) -> Callable[[], T]:
        """Trace photons in threads, the last of which calls ``ready``; return a waiting function.

        The order of photons, and of sums over them, is the same for any number of threads.
        """
        blocks = blocks_of(self._eye_passes[0].photon_tracer.groups(n))
        if not blocks:
            # All that shines sends out nothing: a black sky.
            return lambda: ready(self._eye_passes[0], joined([]), [])
        parts: list[tuple[Photons, list[Splats], Balance] | None] = [None] * len(blocks)
        lock = Lock()

        def work(eye_pass: EyePass, i: int) -> tuple[T] | None:
            group, first, stop = blocks[i]
            eye_pass.photon_tracer.balance = Balance()
            photons, shown = eye_pass.photon_tracer.shoot(
                group, pass_number, first, stop, dimension, MET_SPECULAR
            )
            with lock:
                parts[i] = photons, shown, eye_pass.photon_tracer.balance
                done = [part for part in parts if part is not None]
            if len(done) < len(parts):
                return None
            for _, _, balance in done:
                self._balance.add(balance)
            all_shown = [one for _, several, _ in done for one in several]
            return (ready(eye_pass, joined([photons for photons, _, _ in done]), all_shown),)

        futures = [submit(work, i) for i in range(len(blocks))]

        def waited() -> T:
            found: list[tuple[T] | None] = [future.result() for future in futures]
            return next(result for result in found if result is not None)[0]

        return waited

    def _picture(self, shown: list[Splats]) -> FloatArray | None:
        """Return the splats of a pass, (height, width, 3)."""
        if not shown:
            return None
        camera = self.context.scene.camera
        picture = np.zeros((camera.height, camera.width, 3))
        for pixel, value in shown:
            np.add.at(picture.reshape(-1, 3), pixel, value)
            self._n_splats += pixel.size
        return picture

    def gather(self) -> None:
        """Add up the counters of all threads."""
        first, *others = self._eye_passes
        for other in others:
            first.n_points += other.n_points
            first.n_gathered += other.n_gathered
            first.n_without += other.n_without
        super().gather()

    def report(self, blur: Blur) -> dict[str, Any]:
        """Return the photon statistics of the report, in plain types."""
        first = self._eye_passes[0]
        balance = self._balance
        names = ("emitted", "escaped", "absorbed", "lost")
        photons = {
            **self._about(),
            "emitted": balance.n_emitted,
            "stored": balance.n_stored,
            "shown_to_camera": self._n_splats,
            "gather_points": first.n_points,
            "gathered_per_point": first.n_gathered / max(first.n_points, 1),
            "points_without_photons": first.n_without,
            "blur_root_mean_square": blur.absolute,
            "blur_root_mean_square_at_most": blur.absolute_at_most,
            "blur_relative_rmse": blur.relative,
            "blur_relative_rmse_at_most": blur.relative_at_most,
            "power_of_all_passes": {
                name: [twelve_digits(x) for x in power]
                for name, power in zip(names, balance.power.tolist(), strict=True)
            },
        }
        missed = first.n_without if self._balance.n_stored else 0
        if missed < NEARLY_ALL * first.n_points:
            missed = 0
        return {"photons": photons, "points_missed_by_photons": missed}

    @OVERFLOWS
    def blur(self, image: NDArray[np.float32]) -> Blur:
        """Estimate the blur (bias) of the mean of all passes so far.

        To first order blur is proportional to the area of the disc, so it is twice the change from
        halving the area. The mean product of that change in different passes is its square, without
        the noise that the square of one pass has; at least two passes are needed.
        """
        n = self._n_passes
        if self._blur.size == 0:
            return NO_BLUR
        is_asked = any(eye_pass.n_points for eye_pass in self._eye_passes)
        is_met = any(eye_pass.n_gathered for eye_pass in self._eye_passes)
        is_missed = is_asked and self._balance.n_stored > 0 and not is_met
        if n < 2 or (is_missed and self.is_radius_asked):
            return UNKNOWN_BLUR
        squares = 4.0 * (self._blur * self._blur - self._blur_squares) / (n * (n - 1))
        # What the squares of the mean change have beyond these products.
        noise = 4.0 * (self._blur / n) ** 2 - squares
        if not np.isfinite(squares).all():
            return UNKNOWN_BLUR
        weight = image.reshape(-1, 3).astype(np.float64) ** 2 + DARK
        return Blur(
            *self._root_mean(squares, noise), *self._root_mean(squares / weight, noise / weight)
        )

    def _root_mean(
        self, squares: FloatArray, noise: FloatArray
    ) -> tuple[float | None, float | None]:
        """Return the root of the mean of estimated squares (pixels, 3), and a limit to the true one.

        Estimates of small squares are often negative; one below its own noise says nothing but the
        limit. ``noise`` is the variance that each square is free of.
        """
        camera = self.context.scene.camera
        mean = float(squares.mean())
        if min(camera.height, camera.width) < TILES:
            # As if all pixels had one noise in common, the most that they can.
            error = math.sqrt(2.0) * float(noise.mean())
            least = STUDENT * error
        else:
            rows, columns = (np.arange(TILES) * n // TILES for n in (camera.height, camera.width))
            of_pixels = squares.reshape(camera.height, camera.width, 3).sum(axis=2)
            tiles = np.add.reduceat(np.add.reduceat(of_pixels, rows, axis=0), columns, axis=1)
            error = TILES * float(tiles.std(ddof=1)) / squares.size
            # Tiles differ by blur as well, if few have it: then it is above the pixels' noise.
            least = min(STUDENT * error, float(noise.mean()))
        at_most = AT_BORDERS * math.sqrt(max(mean, 0.0) + STUDENT * error)
        is_known = mean > least or error == 0.0
        return math.sqrt(max(mean, 0.0)) if is_known else None, at_most


def _nothing() -> Ready:
    return (), None
