"""Pictures on their way to a page: half-precision radiances, sent no oftener than they are worth.

The page shows radiances, not screen colours, so that its exposure needs nothing from here. Half
precision has 11 bits where a screen has 8. Compression would cost more than it saves on the way
to the same machine.
"""

import math
import threading
import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.sensor.film import Film

# Of the processor time of this process, what pictures for the page may take.
SHARE = 0.0075
# Seconds between two pictures, where the share would allow more.
SHORTEST = 1.0


@dataclass(frozen=True)
class HalfPicture:
    """A picture in half precision: radiances are its numbers times two to the ``exponent``."""

    passes: int
    width: int
    height: int
    exponent: int
    data: memoryview  # (height, width, 3) float16, little-endian, row 0 at the top


def halved(image: NDArray[np.floating], passes: int = 0) -> HalfPicture:
    """Encode a linear picture (height, width, 3), scaled so that its mean is about one."""
    height, width, _ = image.shape
    half = np.empty(image.shape, "<f2")
    # Row by row: fresh memory for whole pictures takes longer than the arithmetic.
    with np.errstate(over="ignore", invalid="ignore"):
        mean = float(image.mean(dtype=np.float64))
        exponent = round(math.log2(mean)) if 0.0 < mean < math.inf else 0
        for row in range(height):  # beyond 65 504 times the mean it is white anyway
            half[row] = np.ldexp(image[row], -exponent)
    return HalfPicture(passes, width, height, exponent, half.data.cast("B"))


class Pictures:
    """The latest picture of a film, renewed at intervals that its cost decides."""

    def __init__(self, film: Film, film_lock: threading.Lock) -> None:
        self._film, self._film_lock = film, film_lock
        self._own = threading.Lock()
        self._latest: HalfPicture | None = None
        self._cost = 0.0  # of the latest picture, processor seconds
        self._made_at = (0.0, 0.0)
        self.is_final = False

    def newer_than(self, passes: int) -> HalfPicture | None:
        """Return a picture of more than so many passes; None if there is none, or not yet."""
        with self._own:
            if self._film.n_passes > (self._latest.passes if self._latest else 0) and (
                self.is_final or self._is_due()
            ):
                self._renew()
            latest = self._latest
        return latest if latest is not None and latest.passes > passes else None

    def add_cost(self, seconds: float) -> None:
        """Count processor seconds of sending a picture; the next one comes the later."""
        self._cost += seconds

    def _is_due(self) -> bool:
        made_at, worked = self._made_at
        is_late = time.perf_counter() >= made_at + SHORTEST
        return self._latest is None or (
            is_late and SHARE * (time.process_time() - worked) >= self._cost
        )

    def _renew(self) -> None:
        began = time.thread_time()
        with self._film_lock:
            passes, image = self._film.n_passes, self._film.image
        self._latest = halved(image, passes)
        self._cost = time.thread_time() - began
        self._made_at = (time.perf_counter(), time.process_time())
