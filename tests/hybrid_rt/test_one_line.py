"""What objects say of themselves: one line each."""

import numpy as np
import pytest

import hybrid_rt as rt
from hybrid_rt import demo
from hybrid_rt.core.one_line import WIDEST
from hybrid_rt.core.records import HitRecord

UP = (0.0, 0.0, 1.0)
LONG = (1.0 / 3.0, -2000.0 / 7.0, 1e-5 / 3.0)
CAMERA = rt.Camera((1, -12, 5.4), (0.4, 0.3, 1.5), UP, vertical_fov=34, width=64, height=48)
IMAGE = np.full((4, 6, 3), 0.25)
BALL = rt.Sphere((0, 0, 0), 1)

DESCRIBED = [
    (rt.Lambertian((0.1, 0.2, 1 / 3)), "Lambertian((0.1, 0.2, 0.333333))"),
    (rt.Lambertian(rt.ImageTexture(IMAGE)), "Lambertian(ImageTexture(6 x 4, wrap='repeat'))"),
    (rt.CheckerTexture(0, (1, 0.5, 0), (2, 3), "uv"),
     "CheckerTexture(0, (1, 0.5, 0), scale=(2, 3), space='uv')"),
    (rt.Metal(0.8, 0.3), "Metal(0.8, fuzz=0.3)"),
    (rt.Phong(0.5, (0.2, 0.3, 0.4), 60), "Phong(0.5, (0.2, 0.3, 0.4), exponent=60)"),
    (rt.Dielectric(1.3, (0.1, 0, 0.2), 0.9, schlick=True, priority=2),
     "Dielectric(1.3, absorption=(0.1, 0, 0.2), tint=0.9, priority=2, schlick=True)"),
    (rt.Emissive(2, rt.Mirror(0.5)), "Emissive(2, base=Mirror(0.5))"),
    (rt.Mix([(0.7, rt.Lambertian(0.5)), (0.3, rt.Mirror())]),
     "Mix(((0.7, Lambertian(0.5)), (0.3, Mirror(1))))"),
    (rt.SpotLight((1, 2, 3), (0, 0, -2), (1, 2, 3), 30, 5),
     "SpotLight((1, 2, 3), (0, 0, -1), intensity=(1, 2, 3), cone_angle=30, edge_angle=5)"),
    (CAMERA, "Camera((1, -12, 5.4), (0.4, 0.3, 1.5), (0, 0, 1), vertical_fov=34, width=64, height=48)"),
    (rt.Object(BALL, rt.Mirror(), "ball"),
     "Object(Sphere(center=[0.0, 0.0, 0.0], radius=1.0), Mirror(1), name='ball')"),
    (demo.scene(), "Scene(5 objects, 2 lights, GradientSky, camera 640 x 480)"),
]  # fmt: skip


@pytest.mark.parametrize(("thing", "line"), DESCRIBED, ids=lambda x: str(x)[:30])
def test_values_that_matter_are_shown(thing, line):
    assert repr(thing) == line
    assert len(line) <= WIDEST


@pytest.mark.parametrize(
    "thing",
    [
        rt.Camera(LONG, (7, 8, 9), LONG, 100 / 3, 10_000, 10_000, aperture=1 / 3),
        rt.SpotLight(LONG, LONG, (1 / 3, 1e20 / 3, 1 / 7), 100 / 3, 1 / 3),
        rt.RectangleLight(LONG, LONG, (1, 2, 3), LONG[0]),
        rt.Mix([(0.01, rt.Phong((1 / 3, 1 / 7, 1 / 9), (1 / 3, 1 / 7, 1 / 9), 60))] * 9),
        rt.Object(rt.Rectangle(LONG, LONG, (1, 2, 3)), rt.Lambertian(0.5), "a\nb" * 90),
        *demo.scene().objects,
    ],
    ids=lambda thing: type(thing).__name__,
)
def test_a_line_is_a_line(thing):
    """However long the names and the figures are."""
    line = repr(thing)
    assert len(line) <= WIDEST
    assert "\n" not in line
    assert line.startswith(f"{type(thing).__name__}(")
    assert line.endswith(")")


def test_an_intersector_says_what_it_holds():
    tracer = rt.Intersector([demo.teapot(), BALL, BALL], threads=1)
    assert repr(tracer) == (
        "Intersector(spheres: 2, Bezier patches: 1; certified; "
        f"Embree with {tracer.n_triangles:,} triangles)"
    )
    alone = rt.Intersector(demo.teapot(), coarse="none", threads=1)
    words = 'Intersector(Bezier patches: 1; certified; without Embree: coarse="none")'
    assert repr(alone) == words
    for surfaces in ([BALL], []):
        line = repr(rt.Intersector(surfaces, threads=1))
        assert line.endswith(
            "certified; without Embree: nothing to tessellate and no triangle mesh)"
        )


class TestHitRecord:
    def test_counts_and_ranges(self):
        tracer = rt.Intersector(BALL, threads=1)
        # Through the centre, past it, and along the tangent plane at (1, 0, 0).
        hits = tracer.intersect([(0, -3, 0), (5, -3, 0), (1, -3, 0)], (0, 1, 0))
        n_hit = int(hits.hit.sum())
        bound = hits.t_bound[hits.hit].max()
        assert repr(hits) == (
            f"HitRecord(3 rays, {n_hit} hit: 1 MISS, 1 HIT, 1 TANGENT; t 2 to "
            f"{hits.t[hits.hit].max():.4g}, t_bound up to {bound:.2g})"
        )
        crossings = tracer.intersect_all([(0, -3, 0), (5, -3, 0)], (0, 1, 0))
        assert repr(crossings) == "Crossings(2 of 2 rays, at most 2 of one)"

    def test_without_hits_and_without_rays(self):
        tracer = rt.Intersector(BALL, threads=1)
        misses = tracer.intersect((5, -3, 0), (0, 1, 0))
        assert repr(misses) == "HitRecord(1 ray, 0 hit: 1 MISS)"
        assert repr(misses[[]]) == "HitRecord(0 rays, 0 hit)"

    def test_millions_fit(self):
        n = 12_345_678
        one = rt.Intersector(BALL, threads=1).intersect((0, -3e9, 0), (0, 1, 0))
        columns = [np.broadcast_to(getattr(one, k), (n, *getattr(one, k).shape[1:]))
                   for k in HitRecord.__dataclass_fields__]  # fmt: skip
        assert len(repr(HitRecord(*columns))) <= WIDEST
