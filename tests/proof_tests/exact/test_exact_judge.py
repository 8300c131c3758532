"""The judge of exact crossings on answers about trimmed surfaces made wrong on purpose."""

import dataclasses

import numpy as np
import pytest
from trimmed_surfaces import OUTLINE

from hybrid_rt import Intersector, Rectangle
from hybrid_rt.core.records import Status
from meshing import Cylinder, TrimmedSurface, polygon
from proof.exact.judge import ExactJudge


@pytest.mark.parametrize(
    ("z", "must"), [(-1e-18, False), (1e-18, True), (-1e-16, False), (1e-16, True)]
)
def test_a_crossing_ahead_that_a_move_brings_inside_needs_the_mark(z, must):
    # The ray runs down through the plane at 1e-14 of its length, in a slot; its crossing is z / 1e-14
    # ahead, and the slot ends 1e-2 farther. Moved by the band it passes beyond that end, or before it
    # begins. Whether t is positive is no question of rounding, but the side of the curve is.
    slot = polygon([(0.4, 0.25), (0.5, 0.25), (0.5, 0.75), (0.4, 0.75)])
    surface = TrimmedSurface(Rectangle((0, 0, 0), (1, 0, 0), (0, 1, 0)), [OUTLINE, slot])
    origins, directions = np.array([(0.45, 0.5, z)]), np.array([(1.0, 0.0, -1e-14)])
    assert unmarked_as_a_miss(surface, origins, directions) == must


@pytest.mark.parametrize(("ahead", "must"), [(-1e-12, False), (1e-12, True), (1.0, True)])
def test_parts_of_a_turn_need_the_mark_for_what_is_ahead(ahead, must):
    # Half a cylinder of radius 1, from u = 0 on; rays cross where it begins, at a cosine of 1e-3, just
    # outside of it: by less than a tenth of an eighth of the band.
    surface = Cylinder((0, 0, 0), (0, 0, 1), 1.0, 1.0, reference=(1, 0, 0), u_range=(0, 0.5))
    direction = np.array([(-1e-3, 0.0, 1.0)])
    origins = np.array([(1.0, -1e-16, 0.5)]) - ahead * direction
    assert np.isclose(origins[0, 0], 1.0 + 1e-3 * ahead, rtol=0.0, atol=2e-16)
    assert unmarked_as_a_miss(surface, origins, direction) == must


def unmarked_as_a_miss(surface, origins, directions):
    """Return how many marks are missing if the tracer said that the ray misses, without a mark."""
    hits = Intersector(surface).intersect(origins, directions)
    miss = dataclasses.replace(
        hits,
        t=np.full(1, np.inf),
        object_id=np.full(1, -1, hits.object_id.dtype),
        status=np.full(1, Status.MISS, hits.status.dtype),
    )
    return ExactJudge([surface]).judge(miss, origins, directions).unmarked
