"""What a page is told of a render: progress, errors, counts; as JSON types."""

import math
import time
from typing import Any

from hybrid_rt.core.memory import peak_memory_mib
from hybrid_rt.core.plain_records import as_plain
from hybrid_rt.integrators.workers import Workers
from hybrid_rt.rendering.limits import Clock, Limit
from hybrid_rt.rendering.report import Report
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.rendering.watcher import Beginning
from hybrid_rt.sensor.film import Film

# Errors that nobody else asks for are estimated when the passes have grown by this factor, if all
# such estimates together take no more than this share of the processor time, that of threads which
# wait meanwhile included. The first is expected to take so many seconds per pixel (measured: 0.27e-6
# alone, 0.5e-6 on a busy machine).
GROWTH, SHARE, PER_PIXEL = 1.25, 0.0075, 5e-7
# Seconds between two counts of rays: they are cheap, but passes of small pictures are short.
COUNT_AFTER = 0.25


class RenderState:
    """Collects in the thread that renders; read from any thread."""

    def __init__(self, title: str) -> None:
        self._phase = "preparing"
        self._about: dict[str, Any] = {"title": title}
        self._noted: dict[str, Any] = {"passes": 0, "seconds": 0.0, "counts": None}
        self._errors: list[dict[str, float | None]] = []
        self._began, self._set_up = time.perf_counter(), 0.0
        self._rays = (0, 0)
        self._first_rays: tuple[int, float] | None = None
        self._n_pixels = 1
        self._is_total_known = False
        self._n_estimated = 0
        self._estimating, self._n_own = 0.0, 0
        self._worked, self._threads = 0.0, 1
        self._counted_at = -math.inf
        self._end: dict[str, Any] = {}

    @property
    def about(self) -> dict[str, Any]:
        """What does not change while passes are made."""
        return self._about

    def begin(self, beginning: Beginning) -> None:
        """Take what is known before the first pass."""
        context, camera = beginning.context, beginning.context.scene.camera
        settings = beginning.settings
        plan = {"light": context.plan.as_dict(), "intersection": context.tracer.plan}
        self._about = {
            **self._about,
            "settings": as_plain(settings, finite=True),
            "threads": beginning.threads,
            "width": camera.width,
            "height": camera.height,
            "error_power": context.options.error_power,
            "blur_stays": context.options.blur_stays,
            "has_photons": context.options.n_photons > 0,
            "left_out": beginning.left_out,
            "unfound": as_plain(beginning.unfound, finite=True),
            "plan": as_plain(plan, finite=True),
        }
        self._n_pixels = camera.width * camera.height
        self._noted["passes"] = beginning.film.n_passes
        # Without a number of passes the total is a guess, and none before there is an estimate.
        self._is_total_known = settings.passes is not None or not any(
            (settings.time_budget, *settings.targets.values())
        )
        self._began, self._set_up = time.perf_counter(), beginning.clock.seconds
        self._worked, self._threads = time.process_time(), beginning.threads
        self._phase = "rendering"

    def note_rays(self, done: int, total: int) -> None:
        """Take the number of camera rays done, and expected."""
        if self._first_rays is None:
            self._first_rays = (self._noted["passes"] * self._n_pixels, time.perf_counter())
        self._rays = (done, total)

    def note(self, film: Film, workers: Workers, limit: Limit, clock: Clock) -> None:
        """Take the counts of the passes so far, and now and then their error."""
        n, seconds = film.n_passes, clock.earlier + clock.seconds
        self._noted = {**self._noted, "passes": n, "seconds": seconds}
        expected = limit.expected_passes(n)
        self._is_total_known = self._is_total_known or expected > n + 1
        if time.perf_counter() >= self._counted_at + COUNT_AFTER or n <= 1:
            self._counted_at = time.perf_counter()
            found, accuracy = workers.counts(), workers.context.tracer.accuracy
            rays, hits = found.ledger["rays"], found.ledger["hits"]
            self._noted["counts"] = _counts(rays, hits, found.work, accuracy, seconds)
        self._note_error(film, workers, limit, seconds)

    def _note_error(self, film: Film, workers: Workers, limit: Limit, seconds: float) -> None:
        n = film.n_passes
        if limit.n_of_error == n:
            if n > self._n_estimated:
                self._add_error(n, seconds, limit.error, limit.error_trimmed, limit.blur)
            return
        cost = self._estimating / self._n_own if self._n_own else PER_PIXEL * self._n_pixels
        is_due = n >= max(2.0, GROWTH * self._n_estimated)
        allowed = SHARE * (time.process_time() - self._worked)
        if not is_due or self._threads * (self._estimating + cost) > allowed:
            return
        began = time.thread_time()
        noise, blur = film.relative_errors(), workers.blur(film.image).counted
        whole, trimmed = math.hypot(noise.whole, blur), math.hypot(noise.trimmed, blur)
        self._add_error(n, seconds, whole, trimmed, blur)
        self._estimating += time.thread_time() - began
        self._n_own += 1

    def _add_error(
        self, n: int, seconds: float, whole: float | None, trimmed: float | None, blur: float | None
    ) -> None:
        self._n_estimated = n
        point = {"passes": n, "whole": whole, "trimmed": trimmed, "blur": blur}
        # Passes lessen the error, what comes before them does not.
        point["seconds"] = seconds - self._set_up
        self._errors = [*self._errors, as_plain(point, finite=True)]

    def end(self, report: Report) -> None:
        """Take the report of a picture that is done."""
        errors, passes = report.relative_error, report.passes
        seconds, work = report.total_seconds, report.intersection
        counts = _counts(report.rays, report.hits, work, report.geometry.accuracy, seconds)
        self._noted = {"passes": passes, "seconds": seconds, "counts": counts}
        if errors is not None and passes > self._n_estimated:
            blur = errors.blur if errors.blur is not None else errors.blur_at_most
            self._add_error(passes, seconds, errors.both, errors.both_trimmed, blur)
        self._end = {"stopped_by": report.stopped_by, "report": in_words(report)}
        self._phase = "done"

    def finish(self, phase: str, words: str) -> None:
        """Say that nothing more comes: "ended" or "failed", and why."""
        self._end = {**self._end, "words": words}
        self._phase = phase

    def now(self) -> dict[str, Any]:
        """Return what changes: phase, progress, errors, counts."""
        phase, errors, noted = self._phase, self._errors, self._noted
        state = {"phase": phase, "errors": errors, **noted, **self._end}
        state |= {"fraction": None, "seconds_left": None}
        if phase != "rendering":
            return state
        now = time.perf_counter()
        # While a pass is made its seconds go on.
        (done, total), first = self._rays, self._first_rays
        state["elapsed"] = now - self._began
        if first is not None and total > 0 and self._is_total_known:
            state["fraction"] = done / total
            if done > first[0]:
                left = (now - first[1]) * (total - done) / (done - first[0])
                state["seconds_left"] = left
        return state


def _counts(
    rays: dict[str, int], hits: dict[str, int], work: dict[str, int], accuracy: str, seconds: float
) -> dict[str, Any]:
    n_traced = work["rays"] + work["shadow_rays"]
    return {
        "rays": dict(rays),
        "hits": dict(hits),
        "traced": n_traced,
        "certified": n_traced - work["given_up"] if accuracy == "certified" else 0,
        "given_up": work["given_up"],
        "changed": work["changed_by_certificate"],
        "rays_per_second": n_traced / seconds if seconds > 0.0 else None,
        "peak_memory_mib": peak_memory_mib(),
    }
