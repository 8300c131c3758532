"""The interface of what watches a render while it runs, a live page say."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

from hybrid_rt.core import checks

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.photons.figures import LightNotFound
    from hybrid_rt.integrators.workers import Workers
    from hybrid_rt.rendering.limits import Clock, Limit
    from hybrid_rt.rendering.report import PictureSettings, Report
    from hybrid_rt.scene.scene import Scene
    from hybrid_rt.sensor.film import Film

# What ``report["stopped_by"]`` says of a render that its watcher stopped.
STOPPED = "watcher"


class StopAsked(Exception):
    """The watcher wants the render to end with the passes that are complete."""


@dataclass(frozen=True)
class Beginning:
    """What is known of a render before its first pass.

    Attributes
    ----------
    scene : Scene
    context : RenderContext
    settings : PictureSettings
    threads : int
    clock : Clock
    film : Film
        Read it only while you hold the watcher's lock.
    left_out : list of str
        Light that the integrator does not find.
    unfound : LightNotFound, optional
        How much light that is, if it was measured.
    """

    scene: Scene
    context: RenderContext
    settings: PictureSettings
    threads: int
    clock: Clock
    film: Film
    left_out: list[str]
    unfound: LightNotFound | None


class Watcher(Protocol):
    """Follows a render and may stop it; changes no bit of the picture.

    All methods are called in the thread that renders.

    Attributes
    ----------
    film_lock : context manager
        Held while a pass is added to the film. A thread that holds it may read the film.
    stop_asked : bool
        Read after each block of camera rays. If it is true, the render ends as soon as a pass is
        complete.
    """

    @property
    def film_lock(self) -> AbstractContextManager[Any]:
        """See above."""

    @property
    def stop_asked(self) -> bool:
        """See above."""

    def begin(self, beginning: Beginning) -> None:
        """Receive, once, what is rendered."""

    def note_rays(self, done: int, total: int) -> None:
        """Receive how many camera rays are done, and how many are expected in all."""

    def note(self, film: Film, workers: Workers, limit: Limit, clock: Clock) -> None:
        """Receive the film when more passes are complete; no other thread changes it meanwhile."""

    def end(self, report: Report) -> None:
        """Receive, once, the report of the finished picture."""


def check_watcher(watch: Watcher) -> Watcher:
    """Return a watcher; raise TypeError if it lacks what a render asks of one."""
    missing = [name for name in ("film_lock", "stop_asked") if not checks.has(watch, name)]
    missing += [
        name
        for name in ("begin", "note_rays", "note", "end")
        if not checks.has(watch, name) or not callable(getattr(watch, name))
    ]
    if missing:
        raise TypeError(
            f"watch is {checks.shown(watch)}, without {missing[0]!r}: pass a LivePage, another Watcher, or None"
        )
    return watch
