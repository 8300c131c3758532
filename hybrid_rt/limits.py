"""When a render ends: the number of passes, the seconds allowed, whichever comes first."""

from __future__ import annotations

import time

from hybrid_rt import checks
from hybrid_rt.progress import CompileWatch

DEFAULT_PASSES = 16


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
        Seconds, above 0. With neither limit given: 16 passes.
    """

    def __init__(self, passes: int | None, time_budget: float | None) -> None:
        if passes is not None:
            checks.whole(passes, "passes", at_least=1)
        if time_budget is not None:
            checks.number(time_budget, "time_budget", above=0.0)
        if passes is None and time_budget is None:
            passes = DEFAULT_PASSES
        self.passes = passes
        self.time_budget = time_budget
        self._longest = 0.0
        self._pass_began = 0.0
        self._n_began = 0

    def begins(self, n_done: int, seconds: float, at_most: int = 1) -> int:
        """Return how many passes start, ``n_done`` being complete after ``seconds``.

        Up to ``at_most`` run together where no limit will be reached on the way.
        """
        if n_done > self._n_began:
            spent = (seconds - self._pass_began) / (n_done - self._n_began)
            self._longest = max(self._longest, spent)
        self._pass_began, self._n_began = seconds, n_done
        if self.reached(n_done, seconds) is not None:
            return 0
        if self.passes is not None:
            at_most = min(at_most, self.passes - n_done)
        if self.time_budget is not None:
            # The first pass alone tells how long one takes.
            left = (self.time_budget - seconds) / self._longest if self._longest > 0.0 else 1.0
            at_most = min(at_most, int(left))
        return max(at_most, 1)

    def reached(self, n_done: int, seconds: float) -> str | None:
        """Return which limit allows no further pass, or None."""
        if self.passes is not None and n_done >= self.passes:
            return "passes"
        if self.time_budget is None or n_done == 0:
            return None
        return "time_budget" if seconds + self._longest > self.time_budget else None

    def expected_passes(self, n_done: int) -> int:
        """Return how many passes there will be, as far as one can tell after ``n_done``."""
        by_count = self.passes if self.passes is not None else 2**62
        if self.time_budget is None or self._longest == 0.0:
            return by_count if self.passes is not None else n_done + 1
        by_time = n_done + int((self.time_budget - self._pass_began) / self._longest)
        return max(min(by_count, by_time), n_done + 1)
