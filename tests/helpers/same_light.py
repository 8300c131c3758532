"""Whether two ways of rendering a scene give the same light."""

import numpy as np
from scipy import stats

from hybrid_rt import render

# A test with this rate of false alarms, of dozens, is not seen to fail.
ALARM = 1e-4
SEEDS = 8


def assert_same_light(scene, without, n_without, n, **settings):
    """Check that the means of two sets of renders agree, by Welch's t-test; return the last of the second.

    What an image says of the error of its own mean is not used: where few paths carry much of the
    light, it is rough.

    Parameters
    ----------
    scene : Scene
    without : PathOptions
        Of the first set; the second is rendered by default.
    n_without, n : int
        Passes of all renders of a set together.
    settings
        Of both sets.
    """
    first = [
        render(scene, passes=n_without // SEEDS, seed=k, options=without, **settings)
        for k in range(SEEDS)
    ]
    second = [render(scene, passes=n // SEEDS, seed=k, **settings) for k in range(SEEDS, 2 * SEEDS)]
    one, other = (np.array([r.image.mean() for r in results]) for results in (first, second))
    test = stats.ttest_ind(one, other, equal_var=False)
    assert test.pvalue > ALARM, (one.mean(), other.mean(), test.statistic)
    return second[-1]
