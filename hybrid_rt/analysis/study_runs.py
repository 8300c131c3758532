"""The renders of a picture study: all methods in turn, with more and more passes."""

import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import count

from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.reference import GROWTH, Image, noise_of_mean, run_method, stated_error
from hybrid_rt.analysis.units import seconds as in_seconds
from hybrid_rt.core.interrupts import held_back
from hybrid_rt.core.progress import Say
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.rendering.units import passes_in_words
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import picture_errors

# A render that takes so much of the seconds asked for is the last; so is one before less than so many times its passes.
NEARLY, BARELY_MORE = 0.9, 1.15


@dataclass
class Runs:
    """What the runs of one method gave: figures by passes, pictures at its dearest setting."""

    rows: dict[int, list[dict[str, float]]] = field(default_factory=dict)
    images: list[Image] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)
    unfound: list[float] = field(
        default_factory=list
    )  # radiance that photons find and it does not, by run

    def add_dearest(self, result: RenderResult) -> None:
        """Keep what the render of the dearest setting tells."""
        self.images.append(result.image)
        self.left_out = result.report.light_not_found
        measured = result.report.light_not_found_measured
        if measured is not None and measured.mean is not None:
            self.unfound.append(measured.mean)


def next_passes(spent: Mapping[int, float], seconds: float) -> int | None:
    """Return how many passes a method is measured with next, so that a render takes about ``seconds``.

    Four times as many as before, or those that fill the seconds; None if they are filled. ``spent`` are the
    seconds of the renders made, by their passes.
    """
    if not spent:
        return 1
    (fewer, before), (n, took) = sorted([(0, 0.0), *spent.items()])[-2:]
    if took >= NEARLY * seconds:
        return None
    each = (took - before) / (n - fewer)
    # More passes that took no longer tell nothing of what one costs.
    last = n + math.ceil((seconds - took) / each) if each > 0.0 else math.inf
    if last < BARELY_MORE * n:
        return None
    return int(last) if last <= 2 * GROWTH * n else GROWTH * n


def _setting(runs: Runs | None, k: int, passes: Sequence[int], seconds: float | None) -> int | None:
    """Return the passes of a method's render number k of a run; None if there is no such render.

    By seconds, the first run finds out, and later runs repeat it.
    """
    rows = {} if runs is None else runs.rows
    if seconds is not None and k == len(rows):
        return next_passes({n: of_runs[0]["seconds"] for n, of_runs in rows.items()}, seconds)
    settings = passes if seconds is None else list(rows)
    return settings[k] if k < len(settings) else None


def add_pictures(
    found: dict[str, Runs],
    scene: Scene,
    methods: Sequence[Method],
    passes: Sequence[int],
    seconds: float | None,
    runs: int,
    truth: Image,
    threads: int | None,
    say: Say,
) -> None:
    """Run all methods in turn; add by method what its runs gave."""
    say(f"{len(methods)} methods: {'; '.join(method.name for method in methods)}")
    if seconds is not None:
        # The renders before the last of a method take a quarter, a sixteenth ... of its time.
        all_together = runs * len(methods) * seconds * GROWTH / (GROWTH - 1)
        say(f"each up to about {in_seconds(seconds)}, together about {in_seconds(all_together)}")
    spent, of_passes = 0.0, 0
    for run in range(runs):
        latest: dict[str, RenderResult] = {}
        try:
            for k in count():
                now = [(m, _setting(found.get(m.name), k, passes, seconds)) for m in methods]
                numbers = [n for _, n in now if n is not None]
                if not numbers:
                    break
                is_known = of_passes > 0 and seconds is None
                about = (
                    f", about {in_seconds(spent / of_passes * sum(numbers))}" if is_known else ""
                )
                say(f"run {run + 1} of {runs}: {_in_words(numbers)}{about}")
                began = time.perf_counter()
                for method, n in now:
                    if n is not None:
                        result = run_method(scene, method, n, run + 1, threads)
                        latest[method.name] = result
                        row = _row(result, truth)  # first, as Ctrl-C may come meanwhile
                        with held_back():
                            rows = found.setdefault(method.name, Runs()).rows
                            rows.setdefault(n, []).append(row)
                spent, of_passes = spent + time.perf_counter() - began, of_passes + sum(numbers)
        finally:
            # Ctrl-C may have come before the figures of the last one were noted.
            for name in latest.keys() & found.keys():
                found[name].add_dearest(latest[name])


def _in_words(numbers: Sequence[int]) -> str:
    """Name the passes of the next renders."""
    if len(set(numbers)) == 1:
        return f"{passes_in_words(numbers[0])} of each"
    return f"{min(numbers):,} to {passes_in_words(max(numbers))}"


def _row(result: RenderResult, truth: Image) -> dict[str, float]:
    """Return the figures of one run."""
    errors, report = picture_errors(result.image, truth), result.report
    stages = report.seconds
    return {
        # The audit of uncertified hits is not part of making the picture.
        "seconds": stages["total"] - stages.get("audit", 0.0),
        "error_of_all": errors.relative_rmse,
        "error_of_most": errors.relative_rmse_of_most,
        "mean_error": errors.relative_mean_error,
        "half_interval": result.mean_half_interval,
        "noise_of_mean": noise_of_mean(report),
        "stated_error": stated_error(report),
        "stated_error_of_most": stated_error(report, "both_trimmed"),
        "build_seconds": stages.get("build", 0.0),
        "rays": float(sum(report.rays.values())),
    }
