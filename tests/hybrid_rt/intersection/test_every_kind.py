"""What holds to the last bit for surfaces of every kind."""

import pickle

import numpy as np
import pytest

from hybrid_rt import Intersector
from proof.cases.placed import placed
from proof.cases.rays import hard_rays
from proof.cases.scenes import SCENES
from proof.stability.measure import differences

each = pytest.mark.parametrize("scene", SCENES)


@each
def test_slices_threads_order_and_pickling_change_no_bit(scene):
    surfaces = SCENES[scene]()
    rays = hard_rays(surfaces, 300, 31)
    o, d = rays.origins, rays.directions
    one, two = (Intersector(surfaces, threads=threads) for threads in (1, 2))
    hits = one.intersect(o, d)
    assert hits.hit.any()
    assert differences(hits, pickle.loads(pickle.dumps(two)).intersect(o, d)) == ()
    order = np.random.default_rng(1).permutation(300)
    for rows in (order[:1], order[1:40], order[40:]):
        assert differences(hits[rows], two.intersect(o[rows], d[rows])) == ()


@each
def test_powers_of_two_change_no_bit(scene):
    surfaces = SCENES[scene]()
    rays = hard_rays(surfaces, 300, 32)
    hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
    columns = ["t", "object_id", "patch_id", "normal", "status"]
    # Of a plane u and v are lengths.
    columns += ["u", "v"] if all(surface.is_bounded for surface in surfaces) else []
    for scale in (2.0**-40, 2.0**40):
        images = [placed(surface, np.diag([scale, scale, scale, 1.0])) for surface in surfaces]
        there = Intersector(images).intersect(scale * rays.origins, scale * rays.directions)
        assert differences(hits, there, columns) == ()
    for power in (-500, 500):
        longer = Intersector(surfaces).intersect(rays.origins, np.ldexp(rays.directions, power))
        assert differences(hits, longer, [c for c in columns if c != "t"]) == ()
        assert (np.ldexp(longer.t, power) == hits.t).all()


@each
def test_equal_surfaces_tie(scene):
    """The first of two in a list is the one that is met."""
    surface = SCENES[scene]()[0]
    rays = hard_rays([surface], 300, 33)
    hits = Intersector([surface, surface]).intersect(rays.origins, rays.directions)
    assert set(hits.object_id.tolist()) == {-1, 0}
