"""The interface of what watches a render while it runs, a live page say."""

from __future__ import annotations

from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.photons.unfound_light import UnfoundLight
    from hybrid_rt.integrators.workers import Workers
    from hybrid_rt.rendering.limits import Clock, Limit
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
    settings : dict
        Those of the report.
    threads : int
    clock : Clock
    film : Film
        To be read under the watcher's lock only.
    left_out : list of str
        Light that the integrator does not find.
    unfound : UnfoundLight, optional
        Its size, if it was measured.
    """

    scene: Scene
    context: RenderContext
    settings: dict[str, Any]
    threads: int
    clock: Clock
    film: Film
    left_out: list[str]
    unfound: UnfoundLight | None


class Watcher(Protocol):
    """Hears of a render's progress, and may ask it to stop; it changes no bit of the picture.

    All methods are called in the thread that renders.

    Attributes
    ----------
    film_lock : context manager
        Held while a pass is added to the film: who holds it in another thread may read the film.
    stop_asked : bool
        Asked for after each block of camera rays: the render ends as soon as a pass is complete.
    """

    @property
    def film_lock(self) -> AbstractContextManager[Any]:
        """See above."""

    @property
    def stop_asked(self) -> bool:
        """See above."""

    def begin(self, beginning: Beginning) -> None:
        """Hear, once, what is rendered."""

    def note_rays(self, done: int, total: int) -> None:
        """Hear how many camera rays are done, and how many are expected in all."""

    def note(self, film: Film, workers: Workers, limit: Limit, clock: Clock) -> None:
        """Hear that more passes are complete; no other thread is at work on them meanwhile."""

    def end(self, report: dict[str, Any]) -> None:
        """Hear, once, the report of a picture that is done."""
