"""The live page: it watches a render, and serves what it sees to browsers on this machine."""

import secrets
import threading
import time
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.workers import Workers
from hybrid_rt.live.picture import HalfPicture, Pictures, halved
from hybrid_rt.live.probe import Probe
from hybrid_rt.live.server import PageServer
from hybrid_rt.live.state import RenderState
from hybrid_rt.rendering.limits import Clock, Limit
from hybrid_rt.rendering.report import Report
from hybrid_rt.rendering.watcher import Beginning
from hybrid_rt.sensor.film import Film

# At the end pages are given this many seconds to fetch the last picture.
LINGER = 0.8


class LivePage:
    """A `hybrid_rt.rendering.watcher.Watcher` with a web page; a context manager that closes it.

    Parameters
    ----------
    port : int
        Port of 127.0.0.1; 0 picks a free one.
    title : str
        Name of the scene.

    Attributes
    ----------
    address : str
        Address of the page, with the token that every request must carry.
    film_lock : threading.Lock
    stop_asked : bool
        Whether the render was stopped from a page.

    Raises
    ------
    OSError
        If the port is taken or not allowed.
    """

    def __init__(self, port: int = 0, title: str = "") -> None:
        self.film_lock = threading.Lock()
        self.stop_asked = False
        self.state = RenderState(title)
        self._pictures: Pictures | None = None
        self._probe: Probe | None = None
        self._compared: HalfPicture | None = None
        self._compared_name = ""
        self._server = PageServer(port, secrets.token_urlsafe(24), self)
        self.address = self._server.address

    # --- what a render tells

    def begin(self, beginning: Beginning) -> None:
        """Hear what is rendered."""
        self._pictures = Pictures(beginning.film, self.film_lock)
        self._probe = Probe(beginning, self.film_lock)
        self.state.begin(beginning)

    def note_rays(self, done: int, total: int) -> None:
        """Hear how many camera rays are done."""
        self.state.note_rays(done, total)

    def note(self, film: Film, workers: Workers, limit: Limit, clock: Clock) -> None:
        """Hear that more passes are complete."""
        self.state.note(film, workers, limit, clock)

    def end(self, report: Report) -> None:
        """Hear the report of the picture."""
        if self._pictures is not None:
            self._pictures.is_final = True
        self.state.end(report)

    # --- what pages ask

    def ask_to_stop(self) -> None:
        """Let the render end with the passes that are complete."""
        self.stop_asked = True

    def now(self) -> dict[str, Any]:
        """Return the state of the render."""
        return {**self.state.now(), "stop_asked": self.stop_asked}

    def about(self) -> dict[str, Any]:
        """Return what does not change while passes are made."""
        return {**self.state.about, "compared": self._compared_name}

    def picture(self, after: int) -> HalfPicture | None:
        """Return a picture of more than ``after`` passes, or None if there is none, or not yet."""
        return None if self._pictures is None else self._pictures.newer_than(after)

    def compared(self) -> HalfPicture | None:
        """Return the picture to compare with."""
        return self._compared

    def probe(self, column: int, row: int) -> dict[str, Any] | None:
        """Return what is known of a pixel; None before the first pass begins."""
        return None if self._probe is None else self._probe.at(column, row)

    def note_sent(self, seconds: float) -> None:
        """Hear that a picture has been sent, in so many processor seconds."""
        if self._pictures is not None:
            self._pictures.add_cost(seconds)

    # --- how it begins and ends

    def compare_with(self, name: str, image: NDArray[np.floating]) -> None:
        """Offer pages a picture (height, width, 3), linear, to lay beside the growing one."""
        self._compared, self._compared_name = halved(image), name

    def __enter__(self) -> Self:
        """Answer from now on."""
        self._server.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Tell pages that it is over; close."""
        is_bad = kind is not None and not issubclass(kind, KeyboardInterrupt)
        if self.state.now()["phase"] not in ("ended", "failed"):
            self.finish("the terminal says why" if is_bad else "", is_bad)
        self._server.wake()
        # Pages hang up when they have the last picture; one that is late does without.
        until = time.perf_counter() + LINGER
        while self._server.n_listening and time.perf_counter() < until:
            time.sleep(0.01)
        self._server.stop()

    def finish(self, words: str, has_failed: bool = False) -> None:
        """Tell pages that nothing more comes."""
        self.state.finish("failed" if has_failed else "ended", words)
