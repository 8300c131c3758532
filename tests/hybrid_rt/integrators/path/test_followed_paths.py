"""Paths that are followed by single rays, against the same paths that advance together.

Both find the same hits, so that pictures and counts are the same; the second way asks `Intersector.intersect`
for every ray.
"""

import numpy as np
import pytest
import trimesh
from rational_surfaces import sphere as rational_sphere
from trimmed_surfaces import bumpy, plate, sheet, turned_part, windowed_ball, windowed_torus

from hybrid_rt import (
    Asphere,
    Camera,
    Dielectric,
    GradientSky,
    Instances,
    Intersector,
    Lambertian,
    Mirror,
    Object,
    Rectangle,
    RectangleLight,
    RoughConductor,
    Scene,
    Sphere,
    SphereLight,
    Torus,
    TriangleMesh,
    render,
)
from hybrid_rt.demo import teapot
from hybrid_rt.primitives.box import Box
from meshing import SurfaceOfRevolution

UP = (0, 0, 1)
VASE = SurfaceOfRevolution([(0, 0), (0, 0.5), (0.5, 0.2), (1.0, 0.4)], (0, 0, 0), UP)
STRAIGHT = np.eye(3)
TURN = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]


def moved(surface, k, scale=1.0, turn=STRAIGHT):
    """Return a surface brought near place k of a grid, its box at most one wide."""
    matrix = np.eye(4)
    low, high = np.array(surface.bounds)
    size = scale / np.linalg.norm(high - low)
    matrix[:3, :3] = size * turn
    matrix[:3, 3] = (k % 5 - 2.0, k // 5 - 1.5, 0.7) - size * turn @ (0.5 * (low + high))
    return surface.transformed(matrix)


def mesh(k):
    ball = trimesh.creation.icosphere(2, 0.4)
    ball.apply_translation((k % 5 - 2.0, k // 5 - 1.5, 0.7))
    return TriangleMesh(ball)


def places(n):
    matrices = np.tile(np.eye(4), (n, 1, 1))
    matrices[:, :3, :3] = 0.6 * TURN
    matrices[:, :3, 3] = [(k % 5 - 2.0, k // 5 - 1.5, 0.6) for k in range(n)]
    return matrices


LENS = Asphere(0.8, -0.5, (0.1,), 0.4, (0, 0, 0), UP)
SURFACES = {
    "turned": [moved(VASE, 2)],
    "turned, in a tree": [moved(VASE, k) for k in range(20)],
    "patches": [moved(teapot(), 2, 2.0)],
    "rational patches": [moved(rational_sphere(), k) for k in range(3)],
    "tori": [moved(Torus((0, 0, 0), UP, 0.4, 0.1), k, 1.0, TURN) for k in range(18)],
    "aspheres": [moved(LENS, k) for k in range(2)],
    "turned boxes": [moved(Box((0, 0, 0), (1, 1, 1)), k, 1.0, TURN) for k in range(10)],
    "spheres in a tree": [Sphere((k % 10 - 5, k // 10 - 5, 0.5), 0.3) for k in range(100)],
    "meshes": [mesh(k) for k in range(4)],
    "trimmed": [
        moved(surface, k)
        for k, surface in enumerate(
            (plate(), bumpy(), sheet(), turned_part(), windowed_ball(), windowed_torus())
        )
    ],
    "instances": [Instances([VASE, Torus((0, 0, 0.4), UP, 0.6, 0.1)], places(12))],
    "all together": [
        moved(VASE, 0), moved(teapot(), 1), moved(rational_sphere(), 2), moved(LENS, 3), mesh(4),
        moved(Torus((0, 0, 0), UP, 0.4, 0.1), 5), moved(windowed_ball(), 6),
        Instances([VASE], places(20)[7:]), Box((-2.4, -2, 0.1), (-1.9, -1.8, 0.6)),
    ],
}  # fmt: skip


def scene(surfaces, material):
    floor = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.6), "floor")
    return Scene(
        Camera((0.3, -5, 3), (0, 0, 0.6), UP, 45, 32, 24),
        [floor, *(Object(surface, material) for surface in surfaces)],
        [SphereLight((3, -4, 6), 0.5, 40)],
        GradientSky((0.3, 0.3, 0.3), (0.5, 0.6, 0.9), UP),
    )


def both_ways(monkeypatch, shown, **settings):
    """Return results by single rays, and with paths that advance together."""
    settings = {"passes": 2, "seed": 5, "threads": 1, "max_depth": 5} | settings
    followed = render(shown, "path", **settings)
    monkeypatch.setattr(Intersector, "single_rays", lambda _: None)
    together = render(shown, "path", **settings)
    assert followed.report["intersection"]["single_rays"] > 0
    assert together.report["intersection"]["single_rays"] == 0
    return followed, together


def assert_same(followed, together):
    np.testing.assert_array_equal(followed.image, together.image)
    counted = "rays", "hits", "ended_branches"
    for name in counted:
        assert followed.report[name] == together.report[name]
    for name in ("rays", "shadow_rays", "hits", "tangent", "misses", "given_up"):
        assert followed.report["intersection"][name] == together.report["intersection"][name]


@pytest.mark.parametrize("name", SURFACES)
def test_hits_on_every_kind_are_those_of_batches(monkeypatch, name):
    material = RoughConductor((0.2, 0.9, 1.4), (3.6, 2.6, 1.9), 0.3)
    assert_same(*both_ways(monkeypatch, scene(SURFACES[name], material)))


@pytest.mark.parametrize("name", ["turned", "patches", "meshes"])
def test_branches_at_glass_are_those_of_batches(monkeypatch, name):
    assert_same(*both_ways(monkeypatch, scene(SURFACES[name], Dielectric(1.5))))


def test_no_bit_depends_on_threads():
    shown = scene(SURFACES["all together"], Mirror(0.8))
    one, three = (render(shown, "path", 2, seed=5, threads=n) for n in (1, 3))
    np.testing.assert_array_equal(one.image, three.image)
    assert one.report["hits"] == three.report["hits"]


@pytest.mark.parametrize(("beyond", "is_tangent"), [(0.0, True), (0.1, False)])
def test_rays_to_a_border_are_tangent(monkeypatch, beyond, is_tangent):
    """By way of a mirror, all rays go to the border of a triangle, or to a place within it."""
    corners = [(-1, 2 - beyond, 2 + beyond), (1, 2 - beyond, 2 + beyond), (0, 3, 1)]
    face = TriangleMesh(trimesh.Trimesh(corners, [(0, 1, 2)], process=False))
    shown = Scene(
        # So narrow that pixels differ by less than the band.
        Camera((0, -2, 2), (0, 0, 0), (0, 1, 1), 1e-13, 8, 8),
        [
            Object(Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)), Mirror(0.9), "mirror"),
            Object(face, Lambertian(0.5), "face"),
        ],
        [RectangleLight((-1, 0, 9), (0, 1, 0), (1, 0, 0), 3)],
    )
    followed, together = both_ways(monkeypatch, shown, passes=1)
    assert followed.report["hits"] == together.report["hits"]
    assert (followed.report["hits"]["tangent"] > 0) == is_tangent


@pytest.mark.parametrize("accuracy", ["refined", "mesh"])
def test_what_is_not_certified_comes_from_embree(accuracy):
    shown = scene(SURFACES["turned"], Mirror(0.8))
    report = render(shown, "path", 1, accuracy=accuracy, max_depth=3).report
    assert report["intersection"]["single_rays"] == 0
    assert report["plan"]["light"]["left_out"]["single rays"] == (
        f'accuracy="{accuracy}" takes hits from triangles, by batches'
    )
