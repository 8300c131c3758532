"""The main loop of a render: trace passes, add them to the film, stop at a limit."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing, nullcontext
from typing import TYPE_CHECKING, Protocol

from hybrid_rt.core.interrupts import held_back, stop_point
from hybrid_rt.core.ledger import Ledger, twelve_digits
from hybrid_rt.core.progress import Progress
from hybrid_rt.integrators import Options
from hybrid_rt.integrators.workers import Made, Run, Workers
from hybrid_rt.rendering.limits import Clock, Limit
from hybrid_rt.rendering.unmet_light import interval_of_noise, missing_light
from hybrid_rt.rendering.watcher import STOPPED, StopAsked, Watcher
from hybrid_rt.sensor.film import Film

if TYPE_CHECKING:
    from hybrid_rt.integrators.probes.cross_check import CrossCheck
    from hybrid_rt.rendering.keeper import Keeper


class ClusterLost(OSError):
    """Nobody makes passes any more; the message says of which cluster, and why."""


class PassSource(Protocol):
    """What makes passes."""

    def at_once(self) -> int:
        """Return how many passes to ask for at a time, if there is time."""

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Generator[Made, None, None]:
        """Yield at least the passes asked for, in their order; a whole run may end beyond them."""


def run_passes(
    film: Film,
    workers: Workers,
    limit: Limit,
    clock: Clock,
    progress: Progress | None = None,
    keeper: Keeper | None = None,
    source: PassSource | None = None,
    watch: Watcher | None = None,
    check: CrossCheck | None = None,
) -> str:
    """Add passes in the order of their numbers until a limit is reached; say which.

    The film may hold passes already. ``source`` makes them, by default the workers; where it is lost, the
    film holds what it made. Targets are held against ``check``, an independent estimate of the mean.
    """
    camera = workers.context.scene.camera
    n_pixels = camera.width * camera.height
    source = workers if source is None else source
    show_error = getattr(progress, "note_error", None)
    show_out_of_reach = getattr(progress, "note_out_of_reach", None)
    watches_error = show_error is not None or bool(limit.targets)
    adding = nullcontext() if watch is None else watch.film_lock
    pace = _Pace(limit, clock, film.n_passes)
    n_first = film.n_passes
    n_noted = 0  # passes that the error shown last is of
    while n_together := limit.begins(film.n_passes, clock.seconds, source.at_once()):
        n_before = n_pixels * film.n_passes
        n_then = film.n_passes + n_together

        def on_rays(n_done: int, n_before: int = n_before, at_least: int = n_then) -> None:
            stop_point()
            in_time = pace.passes_in_time((n_before + n_done) / n_pixels)
            total = n_pixels * max(limit.expected_passes(film.n_passes, in_time), at_least)
            if progress is not None:
                progress("Rendering", n_before + n_done, total)
            if watch is not None:
                watch.note_rays(n_before + n_done, total)
                if watch.stop_asked and film.n_passes > 0:
                    raise StopAsked

        passes = range(film.n_passes, film.n_passes + n_together)
        # Closed here, so that no thread is still at work when an interrupt goes on from here.
        try:
            if film.n_passes == n_first:
                on_rays(0)  # the clock of who watches begins with the first ray, and not after it
            with closing(source.render_passes(passes, on_rays)) as made:
                for one in made:
                    with held_back(), adding, workers.context.ledger.stage("film"):
                        film.is_whole = False
                        if isinstance(one, Run):
                            film.add_run(one.total, one.means)
                        else:
                            film.add(one.radiance)
                        workers.keep(one)
                        film.is_whole = True
        except StopAsked:
            return STOPPED
        if watches_error and film.n_passes >= limit.next_estimate():
            blur_is_unknown = _note_errors(film, workers, limit, check)
            if show_error is not None:
                show_error(limit.error, limit.error_trimmed, blur_is_unknown)
                n_noted = film.n_passes
            if show_out_of_reach is not None and limit.blur_out_of_reach is not None:
                show_out_of_reach(limit.blur_out_of_reach)
        if keeper is not None and keeper.is_due():
            with held_back(), workers.context.ledger.stage("store"):
                keeper.save()
        if watch is not None:
            with workers.context.ledger.stage("watch"):
                watch.note(film, workers, limit, clock)
            if watch.stop_asked:
                return STOPPED
    reached = limit.reached(film.n_passes, clock.seconds) or "passes"
    is_old = 0 < n_noted < film.n_passes
    if is_old and show_error is not None:
        blur_is_unknown = _note_errors(film, workers, limit, check)
        show_error(limit.error, limit.error_trimmed, blur_is_unknown)
    if progress is not None and (is_old or reached == "time_budget"):
        # The error of all passes is shown, as in the report. A budget ends a render before it is used
        # up: no pass is begun that would end too late.
        progress("Rendering", n_pixels * film.n_passes, n_pixels * film.n_passes)
    return reached


class _Pace:
    """How many passes a time budget allows, at the speed since construction."""

    def __init__(self, limit: Limit, clock: Clock, n_passes: int) -> None:
        self._budget, self._clock = limit.time_budget, clock
        self._n_began, self._began = n_passes, clock.seconds

    def passes_in_time(self, n_done: float) -> float | None:
        """Return the passes at the budget's end, after so many; None: no budget, or no speed yet."""
        now = self._clock.seconds
        n_made, spent = n_done - self._n_began, now - self._began
        if self._budget is None or n_made <= 0.0 or spent <= 0.0:
            return None
        return n_done + max(self._budget - now, 0.0) * n_made / spent


def _note_errors(film: Film, workers: Workers, limit: Limit, check: CrossCheck | None) -> bool:
    """Estimate noise and blur of the picture so far; tell whether the blur is unknown."""
    with workers.context.ledger.stage("noise"):
        noise, blur = film.relative_errors(), workers.blur(film.image)
        is_contradicted = False
        if check is not None and limit.targets:
            of_mean = film.noise_of_mean()
            lost = twelve_digits(Ledger.from_dict(workers.counts().ledger).lost_share())
            half = interval_of_noise(of_mean)
            is_contradicted = missing_light(check, film, of_mean, half, lost).is_contradicted
    # A limit to the blur falls with more passes whatever the blur does.
    own: Options = workers.context.options
    stays = own.blur_stays and blur.relative is not None
    limit.note_error(
        film.n_passes,
        noise.whole,
        blur.counted,
        trimmed=noise.trimmed,
        ahead=noise.ahead,
        power=own.error_power,
        blur_stays=stays,
        is_contradicted=is_contradicted,
    )
    return blur.relative is None
