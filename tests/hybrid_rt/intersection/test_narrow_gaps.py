"""Beside narrow gaps the map of tiles answers as the curves themselves do."""

from dataclasses import fields

import numpy as np
import pytest

from hybrid_rt import Flag, Intersector, Rectangle
from hybrid_rt.intersection import trims
from meshing import Cone, TrimmedSurface, circle, polygon
from meshing.kernels.trims import CROSSED
from meshing.trims import make_table

OUTLINE = polygon([(0.02, 0.02), (0.98, 0.02), (0.98, 0.98), (0.02, 0.98)])
HOLE = circle((0.4, 0.5), (0.2, 0.1))
WHOLE = {
    "plate": Rectangle((0, 0, 0), (4, 0, 0), (1, 3, 0)),
    "cone": Cone((0, 0, -1), (0, 0.2, 1), 2.0, 3.0, 1.0, u_range=(0.1, 0.8)),
}


@pytest.mark.parametrize("name", list(WHOLE))
@pytest.mark.parametrize("gap", [1e-9, 1e-7])
def test_hits_have_the_same_bits(monkeypatch, name, gap):
    whole = WHOLE[name]
    surface = TrimmedSurface(whole, [OUTLINE, HOLE], gap)
    rng = np.random.default_rng(12)
    n = 4000
    u, v = rng.random((2, n))
    # Half of them at the rim of the hole, and beside it by about the gap.
    angle, beside = 2 * np.pi * rng.random(n // 2), 1.0 + 1e-8 * rng.normal(size=n // 2)
    u[::2], v[::2] = 0.4 + 0.2 * beside * np.cos(angle), 0.5 + 0.1 * beside * np.sin(angle)
    ways = rng.normal(size=(n, 3))
    ways[: n // 4] += 20 * whole.partials(u[: n // 4], v[: n // 4])[0]  # flat ones
    origins = whole.point(u, v) - 3 * ways
    hits = Intersector(surface, coarse="none").intersect(origins, ways)

    # So that every root is asked for at the curves.
    def undecided(surfaces):
        table = make_table(surfaces)
        return table._replace(tile=np.full_like(table.tile, CROSSED))

    monkeypatch.setattr(trims, "make_table", undecided)
    others = Intersector(surface, coarse="none").intersect(origins, ways)
    for field in fields(hits):
        np.testing.assert_array_equal(getattr(hits, field.name), getattr(others, field.name))
    assert 0.0 < ((hits.flags & Flag.EDGE) != 0).mean() < 0.9
