import math

import numpy as np
import pytest

from hybrid_rt.analysis.mesh_comparison import MESH_TOLERANCE, compare_with_mesh, in_words
from hybrid_rt.materials import Mirror
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import BezierPatches

CAMERA = Camera((0.1, 0.2, 6), (0, 0, 0), (0, 1, 0), width=60, height=40)


def dome():
    """A bicubic patch, highest over its middle."""
    side = np.linspace(-2, 2, 4)
    x, y = np.meshgrid(side, side, indexing="ij")
    z = np.zeros((4, 4))
    z[1:3, 1:3] = 2.0
    return BezierPatches(np.stack([x, y, z], axis=-1)[None])


@pytest.fixture(scope="module")
def comparison():
    return compare_with_mesh(Scene(CAMERA, [Object(dome(), Mirror(), "dome")]))


def test_errors_lie_between_zero_and_what_the_tolerance_allows(comparison):
    tolerance = MESH_TOLERANCE * math.sqrt(4**2 + 4**2 + 2**2)
    assert 0 < comparison["mesh_deviation_bound"] <= tolerance
    assert 0 < comparison["mean_hit_error"] <= comparison["worst_hit_error"]
    # The dome is seen from above: no ray meets it at less than 30 degrees.
    assert comparison["worst_hit_error"] <= 2 * comparison["mesh_deviation_bound"]


def test_counts(comparison):
    assert comparison["rays"] == 60 * 40
    assert 500 < comparison["rays_on_curved_surfaces"] < 60 * 40
    # Only rays along the outline can be told wrong.
    assert comparison["wrong_first_hits"] <= 100
    per_unit = comparison["mesh_triangles"] * comparison["mesh_deviation_bound"]
    assert comparison["triangles_for_1e-6"] == pytest.approx(per_unit / 1e-6, rel=1e-6)


def test_words_hold_the_figures(comparison):
    text = in_words(comparison)
    assert f"{comparison['mesh_triangles']:,} triangles" in text
    assert f"{comparison['wrong_first_hits']:,} of" in text


def test_nothing_curved_nothing_to_compare():
    assert compare_with_mesh(Scene(CAMERA, [Object(Sphere((0, 0, 0), 1), Mirror())])) == {}
    assert "nothing to compare" in in_words({})
