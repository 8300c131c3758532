from types import SimpleNamespace

import numpy as np
import pytest

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.rendering.limits import Limit
from hybrid_rt.rendering.run import run_passes
from hybrid_rt.sensor.film import Film

WIDTH, HEIGHT = 4, 2
N_PIXELS = WIDTH * HEIGHT


class Passes:
    """A clock, and passes that take the seconds given, each made of two blocks."""

    def __init__(self, first, further):
        self.seconds, self.first, self.further = 0.0, first, further

    def at_once(self):
        return 16

    def render_passes(self, passes, on_rays):
        for k, n in enumerate(passes):
            for half in (0.5, 1.0):
                self.seconds += (self.first if n == 0 else self.further) / 2
                on_rays(int(N_PIXELS * (k + half)))
            yield SimpleNamespace(radiance=np.ones((HEIGHT, WIDTH, 3)))


def shares_heard(passes, limit):
    """Run passes to a limit; return the shares that progress heard, and the number of passes."""
    heard = []
    camera = SimpleNamespace(width=WIDTH, height=HEIGHT)
    context = SimpleNamespace(
        scene=SimpleNamespace(camera=camera), ledger=Ledger(lambda: passes.seconds)
    )
    workers = SimpleNamespace(context=context, keep=lambda _: None)
    film = Film(HEIGHT, WIDTH)

    def hear(_, done, total):
        heard.append(done / total)

    ended = run_passes(film, workers, limit, passes, hear, source=passes)
    return heard, film.n_passes, ended


@pytest.mark.parametrize(("first", "n_passes"), [(0.01, 99), (0.1, 81), (0.6, 1), (2.0, 1)])
def test_progress_of_a_time_budget_is_that_of_time(first, n_passes):
    """A budget of 1 s; many passes are begun together, and the first may be much slower."""
    heard, n_made, ended = shares_heard(Passes(first, 0.01), Limit(None, 1.0))
    assert ended == "time_budget"
    assert n_made == pytest.approx(n_passes, abs=1)
    assert heard[-1] == 1.0
    # The number expected is whole, so a share may fall by a little as that grows by one.
    assert np.diff(heard).min() > -0.01
    assert all(share < 0.8 for share in heard[: n_made // 2])


def test_other_limits_are_heard_beside_a_time_budget():
    heard, n_made, ended = shares_heard(Passes(0.01, 0.01), Limit(20, 1.0))
    assert (n_made, ended) == (20, "passes")
    assert heard[0] == 0.0
    assert heard[10] == pytest.approx(0.25)  # five passes of 20, two blocks each
    assert heard[-1] == 1.0
