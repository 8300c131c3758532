"""What is of another type or range is refused, naming object, value and remedy."""

from fractions import Fraction
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Box,
    Camera,
    Dielectric,
    Emissive,
    GradientSky,
    ImageTexture,
    Intersector,
    Lambertian,
    Metal,
    Mirror,
    Mix,
    Object,
    Phong,
    Plane,
    PointLight,
    Scene,
    Sphere,
    TriangleMesh,
    render,
)
from hybrid_rt.cli.scene_file import load_scene
from hybrid_rt.sensor.image_files import save_image
from meshing import SurfaceOfRevolution, tessellate

BALL = Sphere((0, 0, 0), 1)
CAMERA = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=4, height=3)
ITEM = Object(BALL, Mirror())
UP = (0, 0, 1)
MASKED = np.ma.masked_array([0.0, 0.5, 0.0], mask=[False, True, False])


def mesh(vertices, faces):
    return TriangleMesh(SimpleNamespace(vertices=vertices, faces=faces))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere((1j, 0, 0), 1), r"Sphere center is \(1j, 0, 0\): pass real numbers"),
        (lambda: Sphere((0, 0, 0), [1, 2]), r"Sphere radius is \[1, 2\]: pass one number"),
        (lambda: Lambertian("a.png"), r"color is 'a.png': .* texture; .*ImageTexture\('a.png'\)"),
        (
            lambda: Emissive("white"),
            r"radiance is 'white': pass three numbers, linear; of this colour \(1, 1, 1\)",
        ),
        (lambda: Dielectric("BK7"), "ior is 'BK7': pass real numbers .*no catalogue of glasses"),
        (lambda: TriangleMesh(None), "TriangleMesh mesh is None: pass a trimesh"),
        (lambda: TriangleMesh("a.obj"), r"of a file, take TriangleMesh\.read\(.a\.obj.\)"),
        (
            lambda: TriangleMesh(trimesh.Scene([trimesh.creation.box()])),
            r"of a scene: SCENE.to_mesh\(\), or one mesh for each part of SCENE.dump\(\)",
        ),
        (lambda: load_scene(None), "scene script is None: pass a path"),
        (lambda: Box((0, 0, 0), (1, 1, 1)).point(0, 0, 0.5), "patch_id has type float64: pass"),
        (
            lambda: tessellate(Box((0, 0, 0), (1, 1, 1)), 0.1),
            "tessellate surface is Box.*: pass Bez",
        ),
        (lambda: Intersector([BALL], threads=1.5), "threads is 1.5: pass an integer"),
        (lambda: Object(BALL, Mirror), "has the material <class .*: pass one of"),
        (lambda: Object(BALL, Mirror(), 3), "Object name is 3: pass a word"),
        (lambda: Object(BALL, Mirror(), smooth="no"), "smooth is 'no': pass True or False"),
        (lambda: Scene(CAMERA, ITEM), r"Scene objects is Object\(.*: pass a list"),
        (
            lambda: Scene(CAMERA, [PointLight(UP, 1)]),
            r"objects\[0\] is PointLight\(.*: lights go into lights=",
        ),
        (
            lambda: Scene(CAMERA, [ITEM], [Object(BALL, Emissive(5))]),
            r"lights\[0\] is Object\(.*: an Object goes into objects=, also one with Emissive",
        ),
        (
            lambda: Scene(CAMERA, [ITEM], [GradientSky(1, 1)]),
            r"lights\[0\] is Grad.*: a sky goes into environment=",
        ),
        (lambda: Scene(CAMERA, [ITEM], [BALL]), r"lights\[0\] is Sphere\(.*: pass a light"),
    ],
)
def test_other_types_are_refused(make, words):
    with pytest.raises(TypeError, match=words):
        make()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Sphere((0, 0), 1), r"Sphere center has shape \(2,\): pass three numbers"),
        (lambda: Sphere((0, 0, 10**400), 1), "Sphere center is .*: pass numbers within 1e308"),
        (lambda: Intersector([BALL], threads=10**9), "threads is .*: pass an integer from 1 to"),
        (lambda: BALL.point([0, 1], [0, 1, 2]), r"shapes \(2,\), \(3,\) and \(\): pass one number"),
        (lambda: BALL.point(0, 0, 1), "patch_id is 1: pass 0 to 0"),
        (lambda: save_image("a.png", np.zeros((1, 1, 3)), {}, exposure=1e6), "exposure is 1e\\+06"),
        (lambda: Mix([]), "Mix parts is empty: pass"),
        (lambda: Metal(0.5, 7), "Metal fuzz is 7: pass a finite number at least 0 and at most 1"),
        (lambda: Phong(0.5, 0.5, 1e308), "Phong exponent is 1e\\+308: .*beyond it use Mirror"),
        (lambda: Emissive(ImageTexture(np.full((1, 1, 3), 1e31))), "some above 1e\\+30"),
        (lambda: Emissive(1e300), "Emissive radiance is 1e\\+300: pass numbers from 0 to 1e\\+30"),
        (lambda: PointLight((0, 0, 1e200), 1), "PointLight position is .*: scale the scene"),
        (lambda: ImageTexture([[1], [1, 2]]), "ImageTexture image is .*: pass rows of equal"),
        (lambda: Sphere(MASKED, 1), "Sphere center has masked elements: leave them out, or fill"),
        (lambda: BALL.point(0.5, 0.5, MASKED), "patch_id has masked elements"),
    ],
)
def test_values_that_cannot_work_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_arrays_without_a_masked_element_are_arrays():
    assert Sphere(np.ma.masked_array([1.0, 2.0, 3.0]), 1).center.tolist() == [1, 2, 3]


class Unspeakable:
    """What cannot be shown."""

    def __repr__(self):
        raise RuntimeError


def test_what_raises_when_it_is_shown_is_called_by_its_kind():
    with pytest.raises(TypeError, match="Sphere radius is a Unspeakable: pass real numbers"):
        Sphere((0, 0, 0), Unspeakable())
    with pytest.raises(ValueError, match="threads is a very large int: pass an integer from 1"):
        Intersector([BALL], threads=10**5000)


@pytest.mark.parametrize("scale", [1e200, 1e-200, 1e307])
def test_scaling_beyond_all_scenes_is_refused_for_its_size(scale):
    matrix = np.diag([scale, scale, scale, 1.0])
    cone = SurfaceOfRevolution([(0, 0), (1, 1)], (0, 0, 0), UP)
    for surface in (BALL, cone, Box((0, 0, 0), (1, 1, 1))):
        with pytest.raises(ValueError, match=r"(reaches|Box .* is) .*: scale the scene"):
            Intersector([surface.transformed(matrix)])
    np.testing.assert_array_equal(Plane((0, 0, 0), UP).transformed(matrix).unit_normal, UP)


def test_lists_that_can_be_read_only_once_are_kept():
    assert len(Scene(CAMERA, (item for item in [ITEM])).objects) == 1
    assert len(Intersector(surface for surface in [BALL]).surfaces) == 1
    result = render(Scene(CAMERA, [ITEM]), passes=1, outputs=(name for name in ["depth"]))
    assert list(result.channels) == ["depth"]


def test_fractions_are_numbers():
    ball = Sphere((Fraction(1, 2), 0, 0), Fraction(1, 4))
    assert (ball.center[0], ball.radius) == (0.5, 0.25)
    assert Lambertian(Fraction(1, 2)).lobes[0].color.brightest[0] == 0.5
