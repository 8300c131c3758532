"""Threads that shoot the photons of a pass together and then look at them together."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from queue import SimpleQueue
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.film import Film
from hybrid_rt.integrators.crew import Crew
from hybrid_rt.integrators.gathering import Field
from hybrid_rt.integrators.integrator import RenderContext
from hybrid_rt.integrators.looking import Looker
from hybrid_rt.integrators.shooting import Balance, Group, Shooter, blocks_of, joined
from hybrid_rt.kernels.photons import MET_SPECULAR, Photons
from hybrid_rt.measures import DARK
from hybrid_rt.records import FloatArray

# Camera rays that one thread follows and gathers for at a time: many, as trees of many points are
# compared faster, but a sixteenth of a pass at most, for the threads to share. The order of the
# sums over photons hangs on this number, so it is the same for any number of threads.
FEWEST_RAYS, MOST_RAYS, SHARE_OF_RAYS = 2**12, 2**15, 16


class PhotonCrew(Crew):
    """See the module; `Crew` for what it offers.

    Parameters
    ----------
    context : RenderContext
    threads : int
    """

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads, Looker)
        self._threads = threads
        self._n_passes = 0
        # Sums over passes of how much less discs of half the area give, and of the squares.
        self._blur = np.zeros_like(self._lookers[0].blur)
        self._blur_squares = np.zeros_like(self._blur)

    @property
    def _lookers(self) -> list[Looker]:
        return cast(list[Looker], self._integrators)

    @abstractmethod
    def _fields(self, pass_number: int) -> tuple[Field, ...]:
        """Shoot the photons of a pass and make them ready to be looked at."""

    @abstractmethod
    def _about(self) -> dict[str, Any]:
        """Return the settings and radii for the report, and what is to be known of the blur."""

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Iterator[FloatArray]:
        """Yield the radiance of one sample per pixel and one set of photons, for each pass."""
        camera = self.context.scene.camera
        blur = np.zeros_like(self._blur)
        for k, number in enumerate(passes):
            if self.context.plan["photons"]:
                fields = self._fields(number)
                for looker in self._lookers:
                    looker.fields, looker.blur = fields, blur
            done = k * camera.height * camera.width

            def heard(n: int, done: int = done) -> None:
                if on_rays is not None:
                    on_rays(done + n)

            yield from super().render_passes(range(number, number + 1), heard)
            self._blur += blur
            self._blur_squares += blur * blur
            self._n_passes += 1

    def _block_size(self, n: int) -> int:
        return min(max(-(-n // SHARE_OF_RAYS), FEWEST_RAYS), MOST_RAYS)

    def _shot(self, n: int, pass_number: int, dimension: int) -> Photons:
        """Shoot the photons of a pass, in one order whatever the number of threads."""
        idle: SimpleQueue[Shooter] = SimpleQueue()
        for looker in self._lookers:
            idle.put(looker.shooter)

        def work(block: tuple[Group, int, int]) -> Photons:
            free, (group, first, stop) = idle.get(), block
            try:
                return free.shoot(group, pass_number, first, stop, dimension, MET_SPECULAR)
            finally:
                idle.put(free)

        blocks = blocks_of(self._lookers[0].shooter.groups(n))
        if self._threads == 1:
            return joined([work(block) for block in blocks])
        with ThreadPoolExecutor(self._threads, thread_name_prefix="hybrid_rt") as executor:
            return joined(list(executor.map(work, blocks)))

    def _forget_balance(self) -> None:
        """Count no photons so far: their light is in no picture."""
        for looker in self._lookers:
            looker.shooter.balance = Balance()

    def gather(self) -> None:
        """Add up the counters of all threads."""
        first, *others = self._lookers
        for other in others:
            first.shooter.balance.add(other.shooter.balance)
            first.n_points += other.n_points
            first.n_gathered += other.n_gathered
            first.n_without += other.n_without
        super().gather()

    def relative_blur(self, film: Film) -> float:
        """Return the estimated relative blur of a picture, nan after a single pass."""
        _, relative = self._blur_of_pixels(film.image)
        return math.nan if relative is None else relative

    def report(self, image: NDArray[np.float32]) -> dict[str, Any]:
        """Return what the photons did, in plain types."""
        first = self._lookers[0]
        balance = first.shooter.balance
        blur, relative = self._blur_of_pixels(image)
        names = ("emitted", "escaped", "absorbed", "lost")
        photons = {
            **self._about(),
            "emitted": balance.n_emitted,
            "stored": balance.n_stored,
            "gather_points": first.n_points,
            "gathered_per_point": first.n_gathered / max(first.n_points, 1),
            "points_without_photons": first.n_without,
            "blur_root_mean_square": blur,
            "blur_relative_rmse": relative,
            "power_of_all_passes": dict(zip(names, balance.power.tolist(), strict=True)),
        }
        return {"photons": photons}

    def _blur_of_pixels(
        self, image: NDArray[np.float32]
    ) -> tuple[float, float] | tuple[None, None]:
        """Estimate the root mean square, over pixels and channels, of how far off blur puts them.

        The second figure is relative as that of noise is (see `hybrid_rt.film.Film`): each square
        is divided by x^2 + 0.01.

        Blur grows as the area of a disc, to first order, so it is twice what halving the area
        changes. Products of different passes have the square of that change as their mean, free of
        the noise that the square of one pass would have; a single pass tells nothing: None.
        """
        n = self._n_passes
        if n < 2 or self._blur.size == 0:
            return (None, None) if self._blur.size else (0.0, 0.0)
        products = (self._blur * self._blur - self._blur_squares) / (n * (n - 1))
        weight = image.reshape(-1, 3).astype(np.float64) ** 2 + DARK
        absolute, relative = (
            2.0 * math.sqrt(max(float(square.mean()), 0.0))
            for square in (products, products / weight)
        )
        return absolute, relative
