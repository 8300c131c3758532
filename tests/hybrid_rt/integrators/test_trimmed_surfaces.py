"""Pictures with trimmed surfaces: those of the same shape made of whole ones."""

import numpy as np
import pytest

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Dielectric,
    Lambertian,
    Object,
    PhotonMapOptions,
    PointLight,
    PPMOptions,
    Rectangle,
    RectangleLight,
    Scene,
    render,
)
from meshing import TrimmedSurface, circle, polygon

CAMERA = Camera((0, -5, 3.0), (0, 0, 0.4), (0, 0, 1), vertical_fov=38.0, width=24, height=18)
FLOOR = Object(Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), Lambertian((0.6, 0.5, 0.4)), "floor")
GREY = Lambertian(0.5)
OUTLINE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])


def trimmed(material=GREY):
    """A plate over the floor, of side 2, with a square hole of side 1."""
    hole = polygon([(0.25, 0.25), (0.75, 0.25), (0.75, 0.75), (0.25, 0.75)])
    plate = Rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0))
    return [Object(TrimmedSurface(plate, [OUTLINE, hole]), material, "plate")]


def in_four(material=GREY):
    """The same plate, of four whole rectangles."""
    parts = [
        ((-1, -1, 1), (2, 0, 0), (0, 0.5, 0)),
        ((-1, 0.5, 1), (2, 0, 0), (0, 0.5, 0)),
        ((-1, -0.5, 1), (0.5, 0, 0), (0, 1, 0)),
        ((0.5, -0.5, 1), (0.5, 0, 0), (0, 1, 0)),
    ]
    return [Object(Rectangle(*part), material, f"part {i}") for i, part in enumerate(parts)]


@pytest.mark.parametrize("integrator", ["whitted", "path"])
def test_light_falls_through_the_hole_as_between_four_plates(integrator):
    lights = [PointLight((0.3, 0.2, 3.0), (9, 9, 9))]
    pictures = [
        render(Scene(CAMERA, [FLOOR, *plate], lights), integrator, passes=4).image
        for plate in (trimmed(), in_four())
    ]
    # The same paths: what differs is rounding, and where a path ends by chance on another side of it.
    np.testing.assert_allclose(pictures[0], pictures[1], rtol=1e-4, atol=1e-5)
    assert pictures[0].std() > 0.03


@pytest.mark.parametrize("integrator", ["photon_map", "ppm"])
def test_photons_fall_through_the_hole(integrator):
    lights = [RectangleLight((-0.2, -0.2, 3.0), (0, 0.4, 0), (0.4, 0, 0), (40, 40, 40))]
    options = {"ppm": PPMOptions(20_000), "photon_map": PhotonMapOptions(50_000)}[integrator]
    pictures = [
        render(Scene(CAMERA, [FLOOR, *plate], lights), integrator, passes=4, options=options).image
        for plate in (trimmed(), in_four())
    ]
    # Photons are aimed by objects, so these pictures differ by noise: 20 000 photons, 4 passes.
    means = [picture.mean() for picture in pictures]
    assert abs(means[0] / means[1] - 1) < 0.03
    assert np.isfinite(pictures[0]).all()


def test_textures_take_the_surface_s_uv():
    checker = Lambertian(CheckerTexture((0.9, 0.1, 0.1), (0.1, 0.1, 0.9), 8, "uv"))
    lights = [PointLight((0, -3, 4.0), (20, 20, 20))]
    whole = [Object(Rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0)), checker, "plate")]
    pictures = [
        render(Scene(CAMERA, [FLOOR, *plate], lights), "whitted", passes=1, outputs=("object_id",))
        for plate in (trimmed(checker), whole)
    ]
    same = np.abs(pictures[0].image - pictures[1].image).max(axis=2) < 1e-5
    assert 0.6 < same.mean() < 1.0  # all but the hole and the light through it


def test_glass_with_a_hole_is_an_open_body():
    lens = TrimmedSurface(
        Rectangle((-1, -1, 1), (2, 0, 0), (0, 2, 0)), [OUTLINE, circle((0.5, 0.5), 0.3)]
    )
    assert not lens.is_closed
    scene = Scene(
        CAMERA, [FLOOR, Object(lens, Dielectric(1.5), "pane")], [PointLight((0, 0, 4), (9, 9, 9))]
    )
    image = render(scene, "path", passes=2).image
    assert np.isfinite(image).all()
    assert image.max() > 0
