import numpy as np
import pytest

from hybrid_rt.camera import Camera
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene import NOTHING, Object, Scene, compile_scene

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


def test_objects_are_called_by_their_name():
    assert Object(BALL, Mirror()).name == "Sphere"
    with pytest.raises(TypeError, match=r"object 'ball': .* is no material"):
        Object(BALL, "red", "ball")
    with pytest.raises(TypeError, match=r"object 'pot': .* is no surface"):
        Object("teapot", Mirror(), "pot")


@pytest.mark.parametrize(
    ("parts", "words"),
    [
        ({"camera": None}, "camera"),
        ({"objects": [BALL]}, r"objects\[0\]"),
        ({"lights": [BALL]}, r"lights\[0\]"),
        ({"environment": (1, 1, 1)}, "environment"),
    ],
)
def test_parts_of_another_type_are_refused(parts, words):
    with pytest.raises(TypeError, match=words):
        Scene(**{"camera": CAMERA, **parts})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: RectangleLight((0, 0, 0), (1, 0, 0), (2, 0, 0), 1), "no area"),
        (lambda: RectangleLight((0, 0, 0), (1, 0, 0), (0, 0, 0), 1), "no area"),
        (lambda: RectangleLight((0, 0, 0), (1, 0, 0), (0, 1, 0), -1), "radiance"),
        (lambda: RectangleLight((0, 0, np.inf), (1, 0, 0), (0, 1, 0), 1), "corner"),
        (lambda: PointLight((0, 0), 1), "position"),
        (lambda: PointLight((0, 0, 0), np.nan), "intensity"),
        (lambda: GradientSky(1, 1, (0, 0, 0)), "up"),
        (lambda: GradientSky(-1, 1), "bottom"),
    ],
)
def test_impossible_lights_are_refused(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_sky_is_linear_in_height_along_any_up():
    sky = GradientSky((0, 0, 0), (2, 4, 6), up=(0, 0, 1e-200))
    directions = np.array([[0, 0, -1.0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(sky.radiance(directions), [[0, 0, 0], [1, 2, 3], [2, 4, 6]])
