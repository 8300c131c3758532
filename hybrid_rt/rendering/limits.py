"""Stopping criteria: a number of passes, a time budget, a target error; the first reached stops."""

from __future__ import annotations

import math
import time

from hybrid_rt.core import checks
from hybrid_rt.core.progress import CompileWatch
from hybrid_rt.sensor.passes import RUN

DEFAULT_PASSES = 16
# Passes from here on have numbers that find out what a scene needs.
MOST_PASSES = 2**32 - 2


class Clock:
    """Wall seconds since construction, without kernel compilation."""

    def __init__(self, compilation: CompileWatch) -> None:
        self._began = time.perf_counter()
        self._compilation = compilation

    @property
    def seconds(self) -> float:
        """Seconds that count against a time budget."""
        return time.perf_counter() - self._began - self._compilation.seconds

    @property
    def compile_seconds(self) -> float:
        """Seconds spent on compiling kernels."""
        return self._compilation.seconds


class Limit:
    """Decides before each pass whether it is to start.

    Parameters
    ----------
    passes : int or None
        At least 1.
    time_budget : float or None
        Seconds, above 0.
    target_error : float or None
        Estimated relative error of the picture (noise and blur), above 0. If no limit is given, 16
        passes are made.
    """

    def __init__(
        self,
        passes: int | None,
        time_budget: float | None,
        target_error: float | None = None,
    ) -> None:
        if passes is not None:
            checks.whole(passes, "passes", at_least=1, up_to=MOST_PASSES)
        if time_budget is not None:
            checks.number(time_budget, "time_budget", above=0.0)
        if target_error is not None:
            checks.number(target_error, "target_error", above=0.0)
        if passes is None and time_budget is None and target_error is None:
            passes = DEFAULT_PASSES
        self.passes = passes
        self.time_budget = time_budget
        self.target_error = target_error
        self._longest = 0.0
        self._pass_began = 0.0
        self._n_began = 0
        self._noise, self._blur = math.inf, 0.0
        self._power, self._blur_stays = 1.0, False
        self._n_of_error = 0

    def begins(self, n_done: int, seconds: float, at_most: int = 1) -> int:
        """Return how many passes to start when ``n_done`` are complete after ``seconds``.

        It is more than one, at most ``at_most``, only if no limit will be reached and no error has
        to be estimated before they end.
        """
        if n_done > self._n_began:
            spent = (seconds - self._pass_began) / (n_done - self._n_began)
            self._longest = max(self._longest, spent)
        self._pass_began, self._n_began = seconds, n_done
        if self.reached(n_done, seconds) is not None:
            return 0
        if self.passes is not None:
            at_most = min(at_most, self.passes - n_done)
        if self.target_error is not None:
            at_most = min(at_most, self.next_estimate() - n_done)
        if self.time_budget is not None:
            # The first pass alone tells how long one takes.
            left = (self.time_budget - seconds) / self._longest if self._longest > 0.0 else 1.0
            at_most = min(at_most, int(left))
        return max(at_most, 1)

    def next_estimate(self) -> int:
        """Return the number of passes at which the error is estimated next.

        The number doubles each time, or grows by less with a target: noise falls as 1 / sqrt(n), so
        the target is expected at n (error / target)^2 passes, and the next estimate is made before,
        at n (error / target). It is rounded to whole runs of passes. It depends on errors only, not
        on time, so a render to a target ends at the same pass on every machine.
        """
        n = self._n_of_error
        if n == 0:
            return 2 if self.target_error is None else RUN
        share = 2.0
        if self.target_error is not None and math.isfinite(self.error):
            share = min(self.error / self.target_error, share)
        return max(int(n * share) // RUN * RUN, n + RUN)

    def note_error(
        self,
        n_done: int,
        noise: float,
        blur: float = 0.0,
        *,
        power: float = 1.0,
        blur_stays: bool = False,
    ) -> None:
        """Record the estimated relative error of the picture after ``n_done`` passes.

        ``power`` is the ``error_power`` of `hybrid_rt.integrators.Options`. The blur may be an
        upper limit, or inf if unknown. ``blur_stays``: more passes do not reduce it.
        """
        self._n_of_error, self._noise, self._blur = n_done, noise, blur
        self._power, self._blur_stays = power, blur_stays

    @property
    def error(self) -> float:
        """The latest estimate of the picture's relative error; inf if there is none."""
        return math.hypot(self._noise, self._blur)

    @property
    def blur_out_of_reach(self) -> float | None:
        """The blur, if it stays and is above the target and above twice the noise; else None."""
        if self.target_error is None or not self._blur_stays:
            return None
        return self._blur if self._blur > max(self.target_error, 2.0 * self._noise) else None

    def reached(self, n_done: int, seconds: float) -> str | None:
        """Return which limit allows no further pass, or None."""
        if self.target_error is not None and self.error <= self.target_error:
            return "target_error"
        is_noise_known = math.isfinite(self._noise) and not math.isnan(self._blur)
        if self.target_error is not None and self._n_of_error and not is_noise_known:
            return "not_finite"  # and never will be: what is in the sums stays
        # Passes would be added for ever, to no avail.
        is_alone = self.passes is None and self.time_budget is None
        if is_alone and (self.blur_out_of_reach is not None or math.isinf(self._blur)):
            return "blur"
        if self.passes is not None and n_done >= self.passes:
            return "passes"
        if self.time_budget is None or n_done == 0:
            return None
        return "time_budget" if seconds + self._longest > self.time_budget else None

    def expected_passes(self, n_done: int) -> int:
        """Return the expected total number of passes, as estimated after ``n_done``."""
        expected = [] if self.passes is None else [self.passes]
        if self.time_budget is not None and self._longest > 0.0:
            expected.append(n_done + int((self.time_budget - self._pass_began) / self._longest))
        if self.target_error is not None and math.isfinite(self.error):
            stays = self._blur if self._blur_stays else 0.0
            left = self.target_error**2 - stays**2
            if left > 0.0:
                more = (self.error**2 - stays**2) / left
                expected.append(math.ceil(self._n_of_error * more ** (1.0 / self._power)))
        return max(min(expected, default=0), n_done + 1)
