"""Instances in scenes: the same pictures as of copies."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Camera,
    Dielectric,
    Emissive,
    ImageTexture,
    Instances,
    Lambertian,
    Mirror,
    Object,
    PhotonMapOptions,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    Torus,
    TriangleMesh,
    render,
)

RING = Torus((0, 0, 0), (0, 0, 1), 0.34, 0.12)
CAMERA = Camera((0, -5, 2.5), (0, 0.5, 0.5), (0, 0, 1), 40, 24, 18)
FLOOR = Object(Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, 0)), Lambertian(0.7), "floor")
LAMP = RectangleLight((-1, -1, 4), (0, 2, 0), (2, 0, 0), 12)
PICTURE = ImageTexture(np.random.default_rng(1).random((8, 8, 3)))
SHEET = TriangleMesh(
    trimesh.Trimesh(
        [(-0.5, -0.5, 0), (0.5, -0.5, 0), (0.5, 0.5, 0), (-0.5, 0.5, 0)],
        [(0, 1, 2), (0, 2, 3)],
        process=False,
        visual=trimesh.visual.TextureVisuals(uv=[(0, 0), (1, 0), (1, 1), (0, 1)]),
    )
)


def places():
    rng = np.random.default_rng(5)
    matrices = np.tile(np.eye(4), (6, 1, 1))
    turn = np.linalg.qr(rng.normal(size=(6, 3, 3)))[0]
    # No reflections: their glass would be inside out.
    matrices[:, :3, :3] = turn * np.sign(np.linalg.det(turn))[:, None, None]
    matrices[:, :3, 3] = [(x, y, 0.6) for y in (0, 1.3) for x in (-1.2, 0, 1.2)]
    return matrices


def pictures(surface, material, integrator, lights=(LAMP,), passes=2, options=None):
    one = [Object(Instances(surface, places()), material)]
    many = [Object(surface.transformed(m), material) for m in places()]
    return [
        render(
            Scene(CAMERA, [FLOOR, *objects], lights), integrator, passes, seed=3, threads=1,
            max_depth=6, options=options, outputs=["instance_id", "object_id"],
        )
        for objects in (one, many)
    ]  # fmt: skip


@pytest.mark.parametrize("integrator", ["path", "whitted"])
@pytest.mark.parametrize(
    ("surface", "material"),
    [
        (RING, Lambertian(PICTURE)),
        (RING, Dielectric(1.5)),
        (RING, Mirror(0.9)),
        (SHEET, Lambertian(PICTURE)),
    ],
    ids=["matt", "glass", "mirror", "picture on a mesh"],
)
def test_pictures_are_those_of_copies(surface, material, integrator):
    one, many = pictures(surface, material, integrator)
    # Points differ by roundings, which move no texel and no random number; pixels are float32.
    np.testing.assert_allclose(one.image, many.image, rtol=1e-5, atol=1e-6)
    named = many.channels["object_id"]
    expected = np.where((named >= 1) & (named <= 6), named - 1, -1)
    np.testing.assert_array_equal(one.channels["instance_id"], expected)


@pytest.mark.parametrize(
    ("integrator", "options"),
    [("ppm", PPMOptions(20_000)), ("photon_map", PhotonMapOptions(40_000))],
)
def test_photons_find_as_much_light(integrator, options):
    """Six rings of glass: photons are aimed at their boxes, at those of the copies by their cells."""
    one, many = pictures(RING, Dielectric(1.5), integrator, options=options)
    # The noise of either mean is about 2 %.
    assert one.image.mean() == pytest.approx(many.image.mean(), rel=0.1)


def test_lamps_in_many_places_shine_as_copies_do():
    one, many = pictures(RING, Emissive(3.0), "path", lights=(), passes=32)
    # The noise of either mean is about 1 %.
    assert one.image.mean() == pytest.approx(many.image.mean(), rel=0.05)


def test_lamps_that_cannot_be_sampled_are_named():
    scene = Scene(CAMERA, [Object(Instances(SHEET, places()), Emissive(1.0), "signs")])
    with pytest.raises(
        ValueError, match=r"'signs' is Instances.* no meshes .* objects of their own"
    ):
        render(scene, "path", 1)
