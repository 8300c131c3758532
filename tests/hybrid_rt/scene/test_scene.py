import numpy as np
import pytest
import trimesh

from hybrid_rt.lights import (
    GradientSky,
    ImageEnvironment,
    PointLight,
    RectangleLight,
    SphereLight,
)
from hybrid_rt.materials import Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Plane, Sphere, TriangleMesh
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.compiled import NOTHING, compile_scene
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.shading.kernels.environment import sky_direction, sky_on_rays
from hybrid_rt.textures import CheckerTexture, ImageTexture
from meshing.kernels.jit import kernel

CAMERA = Camera((0, -5, 0), (0, 0, 0), (0, 0, 1))
BALL = Sphere((0, 0, 0), 1.0)
LAMP = RectangleLight((0, 0, 5), (0, 1, 0), (1, 0, 0), 2.0)


def test_tables_list_objects_first_and_visible_lights_after_them():
    matt = Lambertian(0.5)
    objects = [Object(BALL, matt), Object(BALL, Mirror()), Object(BALL, matt)]
    compiled = compile_scene(Scene(CAMERA, objects, [PointLight((0, 0, 9), 1), LAMP]))
    assert len(compiled.surfaces) == 4
    assert compiled.material_of.tolist() == [0, 1, 0, NOTHING]
    assert compiled.light_of.tolist() == [NOTHING, NOTHING, NOTHING, 1]
    assert compiled.surface_of_light.tolist() == [NOTHING, 3]
    assert compiled.lobes.kind.size == 2  # the matt material is stored once


@pytest.mark.parametrize("surface", [Sphere((0, 0, 0), 1e300), Sphere((0, 0, 0), 6e59)])
def test_objects_too_large_to_shine_are_named(surface):
    with pytest.raises(ValueError, match=r"object 'lamp' shines and is .* across: lamps may be"):
        compile_scene(Scene(CAMERA, [Object(surface, Emissive(1.0), "lamp")]))


def test_objects_are_called_by_their_name():
    assert Object(BALL, Mirror(), "ball").name == "ball"
    with pytest.raises(TypeError, match=r"object 'ball' has the material 'red'"):
        Object(BALL, "red", "ball")
    with pytest.raises(TypeError, match=r"pass a Sphere, .*; of a mesh: TriangleMesh\(MESH\)"):
        Object(trimesh.creation.box(), Lambertian(0.5))
    with pytest.raises(TypeError, match=r"; of a mesh file: TriangleMesh\.read\(FILE"):
        Object("part.stl", Lambertian(0.5))
    with pytest.raises(TypeError, match=r"; of a trimesh.Scene: TriangleMesh\(SCENE.to_mesh\(\)\)"):
        Object(trimesh.Scene([trimesh.creation.box()]), Lambertian(0.5))
    with pytest.raises(TypeError, match=r"object 'pot' is made of 'teapot': pass a Sphere"):
        Object("teapot", Mirror(), "pot")


def test_objects_without_a_name_are_called_by_their_place():
    matt = Object(BALL, Lambertian(0.5))
    compiled = compile_scene(Scene(CAMERA, [Object(BALL, Mirror(), "ball"), matt]))
    assert compiled.names == ["ball", "objects[1] (a Sphere)"]
    assert compiled.called == ["object 'ball'", "objects[1] (a Sphere)"]
    with pytest.raises(TypeError, match=r"^object \(a Sphere\) has the material 'red'"):
        Object(BALL, "red")
    huge = Object(Sphere((0, 0, 0), 1e300), Emissive(1.0))
    with pytest.raises(ValueError, match=r"^objects\[1\] \(a Sphere\) shines and is"):
        compile_scene(Scene(CAMERA, [matt, huge]))
    sky = Object(Plane((0, 0, 0), (0, 0, 1)), Emissive(1.0))
    with pytest.raises(ValueError, match=r"^objects\[1\] \(a Plane\) is a plane that shines"):
        render(Scene(CAMERA, [matt, sky]), "ppm", 1)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: RectangleLight((0, 0, 0), (1, 0, 0), (2, 0, 0), 1), "no area"),
        # Parallel but for rounding.
        (lambda: RectangleLight((0, 0, 0), (1, 2, 3), (1.1, 2.2, 3.3), 1), "no area.*PointLight"),
        (lambda: RectangleLight((0, 0, np.inf), (1, 0, 0), (0, 1, 0), 1), "corner"),
        (lambda: PointLight((0, 0, 0), np.nan), "intensity"),
        (lambda: GradientSky(1, 1, (0, 0, 0)), "up"),
        (lambda: SphereLight((0, 0, 0), 0, 1), "radius"),
        (lambda: ImageEnvironment(np.full((2, 4, 3), np.nan)), "ImageEnvironment .* non-finite"),
    ],
)
def test_impossible_lights_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


@pytest.mark.parametrize("make", [ImageEnvironment, ImageTexture])
def test_picture_files_are_refused_in_the_name_of_their_class(make, tmp_path):
    file, name = tmp_path / "sky.hdr", make.__name__
    with pytest.raises(FileNotFoundError, match=rf"^{name} image is .*sky.hdr': there is no such"):
        make(file)
    file.write_bytes(b"no picture")
    words = rf"^{name} image is .*sky.hdr': pass a picture file, it cannot be read as one \(it does not begin"
    with pytest.raises(ValueError, match=words):
        make(file)


def test_sky_is_linear_in_height_along_any_up():
    sky = GradientSky((0, 0, 0), (2, 4, 6), up=(0, 0, 1e-200))
    directions = np.array([[0, 0, -1.0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(sky.radiance(directions), [[0, 0, 0], [1, 2, 3], [2, 4, 6]])


@pytest.mark.parametrize("top", [1e-200, 1e-30, 1e30])
def test_faint_skies_are_chosen_from_as_bright_ones_are(top):
    xi = np.random.default_rng(2).random((256, 2))
    found = [np.empty((256, 3)) for _ in range(2)]
    for scale, direction in zip((1.0, top), found, strict=True):
        sky_directions(GradientSky(0.2 * scale, scale).table, xi, direction)
    np.testing.assert_allclose(found[1], found[0], atol=1e-12)


def test_shining_objects_are_lights_after_the_others():
    shining = Object(BALL, Emissive(3.0, Lambertian(0.5)), "sun")
    compiled = compile_scene(Scene(CAMERA, [Object(BALL, Mirror()), shining], [LAMP]))
    assert compiled.light_of.tolist() == [NOTHING, 1, 0]
    assert compiled.surface_of_light.tolist() == [2, 1]
    assert compiled.lights.chance.sum() == pytest.approx(1.0)


def test_lamps_with_a_texture_count_by_its_mean():
    """Not by its brightest texel: of two lamps that send the same, photons come from both alike."""
    dots = np.zeros((100, 100, 3), dtype=np.float32)
    dots[40, 60] = 1e4
    squares = CheckerTexture(0.5, 1.5, 4, "uv")
    shining = [Object(BALL, Emissive(color)) for color in (1.0, ImageTexture(dots), squares)]
    even, dotted, checkered = compile_scene(Scene(CAMERA, shining)).power
    assert dotted == pytest.approx(even)
    assert checkered == pytest.approx(even)


def test_shining_surfaces_without_area_are_refused_by_name():
    flat = TriangleMesh(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]]))
    with pytest.raises(ValueError, match="object 'sliver' has area 0: leave it out"):
        compile_scene(Scene(CAMERA, [Object(flat, Emissive(1.0), "sliver")]))


@kernel(allocates=True)
def sky_directions(sky, xi, direction):
    """Fill unit directions (n, 3) chosen by brightness from numbers (n, 2) in [0, 1)."""
    for i in range(xi.shape[0]):
        direction[i, 0], direction[i, 1], direction[i, 2] = sky_direction(sky, xi[i, 0], xi[i, 1])


class TestImageEnvironment:
    PICTURE = np.random.default_rng(6).random((6, 12, 3)) ** 3
    UP = (1.0, 2.0, 3.0)

    def test_texel_centres_keep_their_colors(self):
        """And the border rows go on to the poles."""
        sky = ImageEnvironment(self.PICTURE, self.UP)
        for i, j, polar in ((2, 7, 2.5 / 6), (5, 0, 5.5 / 6), (0, 3, 1e-6), (5, 11, 1 - 1e-6)):
            ring, height = np.sin(np.pi * polar), np.cos(np.pi * polar)
            azimuth = 2 * np.pi * (j + 0.5) / 12
            local = [ring * np.cos(azimuth), ring * np.sin(azimuth), height]
            found = sky.radiance(np.array([local @ sky.table.frame]))[0]
            # Texels are float32.
            np.testing.assert_allclose(found, self.PICTURE[i, j], rtol=1e-6)

    @pytest.mark.parametrize(
        ("up", "ahead", "place"),
        [
            ((0, 1, 0), (1, 0, 0), 0.0),
            ((0, 1, 0), (0, 0, 1), 0.25),
            ((0, 1, 0), (-1, 0, 0), 0.5),
            ((0, 1, 0), (0, 0, -1), 0.75),
            ((0, 0, 1), (1, 0, 0), 0.0),
            ((0, 0, 1), (0, -1, 0), 0.25),
            ((0, 0, -1), (0, 1, 0), 0.25),
        ],
    )
    def test_cameras_see_the_picture_the_right_way_round(self, up, ahead, place):
        """Left is left and above is above, and the middle is what the convention says."""
        u, v = np.meshgrid((np.arange(256) + 0.5) / 256, (np.arange(128) + 0.5) / 128)
        # Red grows to the right and green downward from the place looked at.
        aside = (u - place + 0.5) % 1.0
        sky = ImageEnvironment(np.stack([aside, v, np.zeros_like(u)], axis=2), up)
        camera = Camera((0, 0, 0), ahead, up, vertical_fov=60, width=33, height=33)
        image = render(Scene(camera, environment=sky), passes=1).image
        assert (np.diff(image[:, :, 0], axis=1) > 0).all()
        assert (np.diff(image[:, :, 1], axis=0) > 0).all()
        # A pixel is 2 degrees wide, so within 0.003 of the circle and 0.006 of the half one.
        np.testing.assert_allclose(image[16, 16, :2], 0.5, atol=0.008)

    @pytest.mark.statistical
    @pytest.mark.parametrize("kind", ["picture", "gradient"])
    def test_directions_are_chosen_as_the_pdf_says(self, kind):
        if kind == "picture":
            sky = ImageEnvironment(self.PICTURE, self.UP)
        else:
            sky = GradientSky(0.2, (1.0, 2.0, 3.0), self.UP)
        n = 2**16
        xi = np.random.default_rng(1).random((n, 2))
        w, radiance, pdf = np.empty((n, 3)), np.empty((n, 3)), np.empty(n)
        sky_directions(sky.table, xi, w)
        sky_on_rays(sky.table, w, radiance, pdf)
        np.testing.assert_allclose(np.linalg.norm(w, axis=1), 1.0)
        # The mean of 1 / pdf over a part of the sphere is its solid angle; of 1, its share.
        even = np.random.default_rng(2).normal(size=(n, 3))
        even /= np.linalg.norm(even, axis=1)[:, None]
        density = np.empty(n)
        sky_on_rays(sky.table, even, radiance, density)
        assert density.mean() * 4 * np.pi == pytest.approx(1.0, abs=0.02)
        for axis in range(3):
            for side in (-0.5, 0.5):
                inside, there = w[:, axis] > side, even[:, axis] > side
                expected = 4 * np.pi * (density * there).mean()
                error = np.sqrt(0.25 / n + (4 * np.pi * density * there).var() / n)
                # Five standard errors: a false alarm in 1e5 runs of these twelve.
                assert abs(inside.mean() - expected) < 5 * error


@pytest.mark.parametrize("sky", [GradientSky(0.0, 0.0), ImageEnvironment(np.zeros((4, 8, 3)))])
@pytest.mark.parametrize("integrator", ["path", "whitted"])
def test_a_black_sky_is_none(sky, integrator):
    """It would take as many light samples as the lamp."""
    objects = [Object(BALL, Lambertian(0.5))]
    camera = CAMERA.resized(8, 6)
    one, other = (
        render(Scene(camera, objects, [LAMP], environment), integrator, passes=3)
        for environment in (None, sky)
    )
    assert (one.image == other.image).all()
    assert one.report["rays"] == other.report["rays"]
