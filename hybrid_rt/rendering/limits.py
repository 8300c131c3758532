"""Stopping criteria: a number of passes, a time budget, a target error; the first reached stops."""

import math
import time
from typing import Any

from hybrid_rt.core.progress import CompileWatch
from hybrid_rt.sensor.passes import RUN

DEFAULT_PASSES = DEFAULT_DEPTH = 16
# Passes from here on have numbers that find out what a scene needs.
MOST_PASSES = 2**32 - 2
_TRIMMED = "target_error_trimmed"
# What a limit knows of errors.
_NOTED = ("n_of_error", "noise", "ahead", "blur", "power", "blur_stays", "is_contradicted")


def times_the_passes(ratio: float, power: float) -> float:
    """Return how many times the passes divide a squared error, which falls as passes ** -power, by a ratio."""
    try:
        return math.pow(ratio, 1.0 / power)
    except OverflowError:
        return math.inf


class Clock:
    """Wall seconds since construction, without kernel compilation; ``earlier`` are those of earlier calls."""

    def __init__(self, compilation: CompileWatch) -> None:
        self._began = time.perf_counter()
        self._compilation = compilation
        self.earlier, self.earlier_compilation = 0.0, 0.0

    @property
    def seconds(self) -> float:
        """Seconds that count against a time budget."""
        return time.perf_counter() - self._began - self._compilation.seconds

    @property
    def compile_seconds(self) -> float:
        """Seconds spent on compiling kernels."""
        return self._compilation.seconds


class Limit:
    """Decides before each pass whether it is to start, by the settings of these names."""

    def __init__(
        self,
        passes: int | None,
        time_budget: float | None,
        target_error: float | None = None,
        target_error_trimmed: float | None = None,
    ) -> None:
        targets = {"target_error": target_error, _TRIMMED: target_error_trimmed}
        self.targets = {name: target for name, target in targets.items() if target is not None}
        if passes is None and time_budget is None and not self.targets:
            passes = DEFAULT_PASSES
        self.passes = passes
        self.time_budget = time_budget
        self._longest = 0.0
        self._pass_began = 0.0
        # None: no pass has begun in this call, which may go on with the passes of earlier ones.
        self._n_began: int | None = None
        self._n_first: int | None = None
        # The noise that each target is about, and the number of passes of the latest estimate.
        self.noise, self.n_of_error = dict.fromkeys(targets, math.inf), 0
        self.ahead = math.inf  # what it will be after twice the passes, without the worst pixels
        self.blur, self.blur_stays, self.power = 0.0, False, 1.0
        self.is_contradicted = False

    def state(self) -> dict[str, Any]:
        """Return what was noted of errors, from which `restore` goes on."""
        return {name: getattr(self, name) for name in _NOTED}

    def restore(self, state: dict[str, Any]) -> None:
        """Take over what another limit noted of the same render."""
        for name in _NOTED:
            setattr(self, name, state[name])

    def begins(self, n_done: int, seconds: float, at_most: int = 1) -> int:
        """Return how many passes to start when ``n_done`` are complete after ``seconds``.

        It is more than one, at most ``at_most``, only if no limit will be reached and no error has
        to be estimated before they end.
        """
        if self._n_began is not None and n_done > self._n_began:
            spent = (seconds - self._pass_began) / (n_done - self._n_began)
            self._longest = max(self._longest, spent)
        self._pass_began, self._n_began = seconds, n_done
        if self._n_first is None:
            self._n_first = n_done
        if self.reached(n_done, seconds) is not None:
            return 0
        if self.passes is not None:
            at_most = min(at_most, self.passes - n_done)
        if self.targets:
            at_most = min(at_most, self.next_estimate() - n_done)
        if self.time_budget is not None:
            # The first pass alone tells how long one takes.
            left = (self.time_budget - seconds) / self._longest if self._longest > 0.0 else 1.0
            at_most = int(min(left, at_most))
        return max(at_most, 1)

    def next_estimate(self) -> int:
        """Return the number of passes at which the error is estimated next.

        The number doubles each time, or grows by less with a target: noise falls as 1 / sqrt(n), so
        the target is expected at n (error / target)^2 passes, and the next estimate is made before,
        at n (error / target). It is rounded to whole runs of passes. It depends on errors only, not
        on time, so a render to a target ends at the same pass on every machine.
        """
        n = self.n_of_error
        if n == 0:
            return RUN if self.targets else 2
        ratios = [self._judged(name) / target for name, target in self.targets.items()]
        if self.is_contradicted:
            ratios = []
        share = min([2.0, *(ratio for ratio in ratios if math.isfinite(ratio))])
        return max(int(n * share) // RUN * RUN, n + RUN)

    def note_error(
        self,
        n_done: int,
        noise: float,
        blur: float = 0.0,
        *,
        trimmed: float | None = None,
        ahead: float = 0.0,
        power: float = 1.0,
        blur_stays: bool = False,
        is_contradicted: bool = False,
    ) -> None:
        """Record the estimated relative error of the picture after ``n_done`` passes.

        ``trimmed`` is the noise without the worst pixels; by default ``noise``. ``ahead`` is
        what that will be after more passes if the worst pixels are dots, see
        `hybrid_rt.sensor.film.RelativeErrors`: a target is reached that will stay so. ``power`` is
        the ``error_power`` of `hybrid_rt.integrators.Options`. The blur may be an upper limit, or inf
        if unknown. ``blur_stays``: more passes do not reduce it. ``is_contradicted``: an independent
        estimate says that light is missing, so no target counts as reached.
        """
        self.n_of_error, self.ahead = n_done, ahead
        self.noise = {"target_error": noise, _TRIMMED: noise if trimmed is None else trimmed}
        self.blur, self.blur_stays, self.power = blur, blur_stays, power
        self.is_contradicted = is_contradicted

    @property
    def error(self) -> float:
        """The latest estimate of the picture's relative error; inf if there is none."""
        return self._error("target_error")

    @property
    def error_trimmed(self) -> float:
        """The same without the worst pixels, with the blur of all."""
        return self._error("target_error_trimmed")

    def _error(self, name: str) -> float:
        return math.hypot(self.noise[name], self.blur)

    def _judged(self, name: str) -> float:
        """Return the error that a target is held against: the trimmed one has to stay below it."""
        error = self._error(name)
        return max(error, math.hypot(self.ahead, self.blur)) if name == _TRIMMED else error

    @property
    def blur_out_of_reach(self) -> float | None:
        """The blur, if it stays and keeps every target out of reach, above twice the noise; else None."""
        if not self.targets or not self.blur_stays:
            return None
        highest = max(max(target, 2.0 * self.noise[name]) for name, target in self.targets.items())
        return self.blur if self.blur > highest else None

    def reached(self, n_done: int, seconds: float) -> str | None:
        """Return which limit allows no further pass, or None."""
        is_alone = self.passes is None and self.time_budget is None
        for name, target in self.targets.items():
            if self._judged(name) <= target:
                if not self.is_contradicted:
                    return name
                if is_alone:
                    return "contradicted"
        is_noise_known = math.isfinite(self.noise["target_error"]) and not math.isnan(self.blur)
        if self.targets and self.n_of_error and not is_noise_known:
            return "not_finite"  # and never will be: what is in the sums stays
        # Passes would be added for ever, to no avail.
        if is_alone and (self.blur_out_of_reach is not None or math.isinf(self.blur)):
            return "blur"
        if self.passes is not None and n_done >= self.passes:
            return "passes"
        # At least one pass of each call runs.
        if self.time_budget is None or n_done == self._n_first:
            return None
        return "time_budget" if seconds + self._longest > self.time_budget else None

    def expected_passes(self, n_done: int, in_time: float | None = None) -> int:
        """Return the expected total number of passes, as estimated after ``n_done``.

        ``in_time`` is how many the time budget allows; by default judged by the slowest pass, as their start is.
        """
        expected = [] if self.passes is None else [self.passes]
        if self.time_budget is not None:
            if in_time is None and self._longest > 0.0:
                in_time = n_done + (self.time_budget - self._pass_began) / self._longest
            if in_time is not None:
                expected.append(int(min(in_time, MOST_PASSES)))
        stays = self.blur if self.blur_stays else 0.0
        for name, target in self.targets.items():
            error = self._judged(name)
            left = target**2 - stays**2
            if left > 0.0 and math.isfinite(error):
                times = times_the_passes((error**2 - stays**2) / left, self.power)
                expected.append(math.ceil(min(self.n_of_error * times, MOST_PASSES)))
        return max(min(expected, default=0), n_done + 1)
