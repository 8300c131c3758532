"""Which coaxial surfaces of revolution may share a ring: a ring of glass on glass is passed at once."""

import numpy as np
import pytest

from hybrid_rt import Camera, Dielectric, Object, PointLight, Scene, render
from hybrid_rt.cli.scene_file import load_scene
from hybrid_rt.scene import touching
from hybrid_rt.scene.coaxial import may_share_ring
from meshing import SurfaceOfRevolution

PLACE, UP = (0.3, -0.2, 0.1), (0.0, 0.6, 0.8)
TUBE = ((0.0, 1.0), (2.0, 1.0))
# A cubic bulge, and the halves that de Casteljau cuts it into.
BULGE = ((0.0, 1.0), (0.5, 2.0), (1.5, 2.0), (2.0, 1.0))
HALF = ((0.0, 1.0), (0.25, 1.5), (0.625, 1.75), (1.0, 1.75))


def turned(profile, place=PLACE, axis=UP):
    return SurfaceOfRevolution(profile, place, axis)


@pytest.mark.parametrize(
    ("one", "other", "shares"),
    [
        (TUBE, TUBE, True),
        (BULGE, BULGE, True),
        (BULGE, HALF, True),
        (BULGE, tuple(reversed(HALF)), True),
        (TUBE, ((1.0, 1.0), (3.0, 1.0)), True),  # half of it
        (TUBE, ((0.0, 1.001), (2.0, 1.001)), False),  # a thin wall
        (TUBE, ((0.0, 0.5), (2.0, 1.5)), False),  # they cross
        (TUBE, ((1.0, 0.0), (1.0, 2.0)), False),  # a disc across
        (TUBE, ((1.0, 1.0), (1.0, 2.0)), False),  # its edge on the tube
        (TUBE, ((2.0, 1.0), (3.0, 1.0)), True),  # it goes on: one point, but the same direction
        (BULGE, ((0.0, 1.75), (2.0, 1.75)), True),  # it touches the bulge's top: not known
        (BULGE, ((0.0, 1.75 + 1e-12), (2.0, 1.75 + 1e-12)), True),  # nearer than is known
        (BULGE, ((0.0, 1.751), (2.0, 1.751)), False),
    ],
)
def test_profiles_share_an_arc_or_do_not(one, other, shares):
    assert may_share_ring(turned(one), turned(other), 1e-14) is shares
    assert may_share_ring(turned(other), turned(one), 1e-14) is shares


def test_the_other_may_be_drawn_from_another_point_of_the_axis_or_the_other_way():
    along = np.array(UP) / np.linalg.norm(UP)
    moved = turned([(z - 0.7, r) for z, r in BULGE], np.array(PLACE) + 0.7 * along)
    turned_round = turned([(-z, r) for z, r in BULGE], PLACE, -along)
    for other in (moved, turned_round):
        assert may_share_ring(turned(BULGE), other, 1e-14)
        assert not may_share_ring(turned([(z, r + 0.01) for z, r in BULGE]), other, 1e-14)


def test_of_other_axes_nothing_is_known():
    assert may_share_ring(turned(TUBE), turned(TUBE, axis=(0.0, 0.0, 1.0)), 1e-14)
    assert may_share_ring(turned(TUBE), turned(TUBE, place=(0.4, -0.2, 0.1)), 1e-14)


@pytest.mark.slow
def test_wine_in_its_glass_has_the_bits_that_looking_for_contacts_gives(monkeypatch):
    scene = load_scene("scenes/wine_glass.py")
    scene = scene.with_camera(scene.camera.resized(24, 24))
    found = render(scene, "path", 2, threads=1)
    assert "contacts" in found.report["plan"]["light"]["left_out"]
    monkeypatch.setattr(touching, "may_share_ring", lambda *_: True)
    looked = render(scene, "path", 2, threads=1)
    assert "contacts" in looked.report["plan"]["light"]["used"]
    assert np.array_equal(found.image, looked.image)


def test_glass_that_shares_a_ring_with_glass_is_still_looked_at():
    camera = Camera((0.0, -6.0, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), width=8, height=8)
    lamp = PointLight((0.0, -5.0, 5.0), 10.0)
    inner = Object(turned(TUBE), Dielectric(1.3), "inner")
    for outer, found in ((TUBE, "used"), (((0.0, 1.1), (2.0, 1.1)), "left_out")):
        both = [inner, Object(turned(outer).flipped(), Dielectric(1.5), "outer")]
        result = render(Scene(camera=camera, objects=both, lights=[lamp]), "whitted", 1)
        assert "contacts" in result.report["plan"]["light"][found]
