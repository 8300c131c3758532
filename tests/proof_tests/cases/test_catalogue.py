"""Hard cases that no row of `proof.stability` asks for; and that rows ask for all others."""

import inspect
import sys

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Sphere, TriangleMesh
from meshing import BezierPatches
from proof.cases.catalogue import CATALOGUE
from proof.stability.row import all_rows


def test_every_case_is_run_by_a_row():
    modules = {row.run.__module__ for row in all_rows().values()}
    text = "".join(inspect.getsource(sys.modules[name]) for name in modules)
    for case in CATALOGUE:
        assert f'catalogue("{case.id}", effort)' in text or f'("{case.id}", ' in text


def test_a_part_of_a_case_has_fewer_rays_and_the_same_for_the_same_seed():
    for case in CATALOGUE:
        surfaces = case.surfaces()
        whole = case.rays(surfaces, 1.0, 0)
        part, again, other = (case.rays(surfaces, 0.1, seed) for seed in (0, 0, 1))
        assert len(part[0]) == len(part[1]) <= len(whole[0])
        assert len(case.rays(surfaces, 3.0, 0)[0]) in {len(whole[0]), 3 * len(whole[0])}
        assert all(np.array_equal(a, b) for a, b in zip(part, again, strict=True))
        # Rays that are given one by one are the same for any seed.
        drawn = len(whole[0]) > 4
        assert drawn != all(np.array_equal(a, b) for a, b in zip(part, other, strict=True))


@pytest.mark.parametrize("coarse", ["embree", "none"])
@pytest.mark.parametrize("size", [1e-58, 1e-30, 1e30, 1e58])
def test_sizes_at_the_ends_of_the_range(coarse, size):
    line = np.linspace(-1.0, 1.0, 4)
    x, y = np.meshgrid(line, line, indexing="ij")
    patch = BezierPatches([size * np.stack([x, y, np.zeros_like(x)], axis=-1)])
    ball = trimesh.creation.icosphere(2)
    mesh = TriangleMesh(trimesh.Trimesh(size * ball.vertices, ball.faces, process=False))
    ray = (np.array([0.1, 0.2, 9.0]) * size, (0, 0, -1))
    assert Intersector([patch], coarse=coarse).intersect(*ray).t[0] == pytest.approx(9 * size)
    assert Intersector([Sphere((0, 0, 0), size)]).intersect(*ray).hit[0]
    assert Intersector([mesh]).intersect(*ray).hit[0]
