"""Patches of raised degree against those from before; scenes of mixed degrees are in test_hits."""

import numpy as np
import pytest

from hybrid_rt import Intersector
from meshing import BezierPatches
from proof.stability.measure import apart
from proof.stability.patch_nets import bumpy_chords, bumpy_net, elevated


@pytest.mark.parametrize("times", [1, 12, 27])
def test_elevated_patch_gives_the_same_hits(times):
    """Row A06 with more rays: a bicubic patch at degree up to 30 x 30."""
    net = bumpy_net()
    surface, rays = BezierPatches([net]), bumpy_chords(4000, np.random.default_rng(2))
    low, high = (
        Intersector([patch], coarse="none").intersect(*rays)
        for patch in (surface, BezierPatches([elevated(net, times)]))
    )
    assert low.hit.sum() > 300
    assert not apart(surface, low, high, *rays).any()
