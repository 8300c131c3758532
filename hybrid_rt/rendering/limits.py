"""When a render ends: by passes, by seconds, by the error asked for; the first reached stops it."""

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
    """Wall seconds since it was made, those of kernel compilation left out."""

    def __init__(self, compilation: CompileWatch) -> None:
        self._began = time.perf_counter()
        self._compilation = compilation

    @property
    def seconds(self) -> float:
        """Seconds that count toward a time budget."""
        return time.perf_counter() - self._began - self._compilation.seconds

    @property
    def compile_seconds(self) -> float:
        """Seconds spent on compiling kernels."""
        return self._compilation.seconds


class Limit:
    """Decides before each pass whether it starts.

    Parameters
    ----------
    passes : int or None
        At least 1.
    time_budget : float or None
        Seconds, above 0.
    target_error : float or None
        Estimated relative error of the picture, noise and blur, above 0. With no limit given: 16
        passes.
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
        """Return how many passes start, ``n_done`` being complete after ``seconds``.

        Up to ``at_most`` run together where no limit will be reached on the way, and no error is
        to be estimated.
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
        """Return after how many passes the error is to be estimated next.

        Each time there are twice as many. With a target sooner: noise falls as 1 / sqrt(n), so the
        target is expected after n (error / target)^2 passes, and the next look is after
        n (error / target), before that. It comes after whole runs of passes. Only the errors so far
        decide, no clock, so a render to a target ends with the same pass on every machine.
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
        """Hear the estimates of the picture's relative error after ``n_done`` passes.

        ``power`` is that of a `hybrid_rt.integrators.workers.Workers`. The blur may be a limit to it, inf
        where nothing is known; ``blur_stays`` where it is the same after any number of passes.
        """
        self._n_of_error, self._noise, self._blur = n_done, noise, blur
        self._power, self._blur_stays = power, blur_stays

    @property
    def error(self) -> float:
        """The latest estimate of the picture's relative error; inf where there is none."""
        return math.hypot(self._noise, self._blur)

    @property
    def blur_out_of_reach(self) -> float | None:
        """The blur, where it stays and is above the target for sure: twice the noise as well."""
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
        """Return how many passes there will be, as far as one can tell after ``n_done``."""
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
