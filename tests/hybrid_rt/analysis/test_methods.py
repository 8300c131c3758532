"""Methods by name, the commands that choose them, and which of them find all light."""

import numpy as np
import pytest

from hybrid_rt.analysis.methods import Method, default_methods, finds_all_light, uncertified_methods
from hybrid_rt.cli import program as cli
from hybrid_rt.cli.options import settings_of
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.lights import GradientSky, PointLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.primitives import Plane, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from meshing import SurfaceOfRevolution

VIEW = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
SKY = GradientSky(0.3, 1.0, up=(0, 0, 1))
TUBE = Object(SurfaceOfRevolution([[-1, 1], [1, 1]], (0, 0, 0), (0, 0, 1)), Lambertian(0.5))
BALL = Object(Sphere((0, 0, 0), 1), Lambertian(0.5))
MIRROR = Object(Sphere((3, 0, 0), 1), Mirror())
GROUND = Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5), "ground")


def names(*arguments):
    return [method.name for method in default_methods(*arguments)]


def test_all_integrators_and_what_is_not_certified():
    curved = Scene(VIEW, [TUBE], environment=SKY)
    assert names(curved) == ["path", "whitted", "ppm", "photon_map"]
    photons = Method("ppm, few", "ppm", options=PPMOptions(900))
    refined, *meshes = uncertified_methods(curved, photons)
    assert refined.flags == "--integrator ppm --accuracy refined --photons 900"
    assert [mesh.accuracy for mesh in meshes] == ["mesh"] * 3
    assert uncertified_methods(Scene(VIEW, [BALL], environment=SKY), photons) == []


def test_integrators_that_refuse_a_scene_are_left_out_unless_asked_for():
    scene = Scene(VIEW, [GROUND], environment=SKY)
    assert names(scene) == ["path", "whitted"]
    with pytest.raises(ValueError, match="'ground' is a plane, to which the sky sends photons"):
        default_methods(scene, ["path", "ppm"])
    with pytest.raises(ValueError, match="integrator is 'magic': pass one of path, whitted"):
        default_methods(scene, ["magic"])


def test_settings_of_photons_are_combined_and_named():
    scene = Scene(VIEW, [BALL], environment=SKY)
    methods = default_methods(
        scene, ["whitted", "ppm", "photon_map"], {"photons": [500, 900], "alpha": [0.5]}
    )
    assert [method.name for method in methods] == [
        "whitted", "ppm, 500 photons, alpha 0.5", "ppm, 900 photons, alpha 0.5",
        "photon_map, 500 photons", "photon_map, 900 photons",
    ]  # fmt: skip
    assert methods[2].options == PPMOptions(900, 0.5)
    assert methods[4].options == PhotonMapOptions(900)
    with pytest.raises(ValueError, match="alpha"):
        default_methods(scene, ["ppm"], {"photons": [500], "alpha": [1.5]})


@pytest.mark.parametrize(
    ("method", "flags"),
    [
        (Method("m", "path", "mesh", 0.0123), "--accuracy mesh --tolerance 0.0123"),
        (Method("m", "ppm"), ""),
        (Method("m", "ppm", options=PPMOptions(700)), "--photons 700"),
        (Method("m", "ppm", options=PPMOptions(700, 0.6)), "--photons 700 --alpha 0.6"),
        (Method("m", "photon_map", options=PhotonMapOptions(700)), "--photons 700"),
    ],
)
def test_flags_are_understood_by_the_command_line(method, flags):
    assert method.flags == f"--integrator {method.integrator} {flags}".rstrip()
    parsed = cli._parser().parse_args(["render", "scene.py", *method.flags.split()])
    found = settings_of(parsed.integrator, parsed)
    assert found == method.options
    assert (parsed.accuracy, parsed.tolerance) == (method.accuracy, method.tolerance)


def test_power_of_the_error():
    """Noise falls as n^-alpha and blur squared as n^(2 alpha - 2): the slower one stays."""
    found = [Method("m", "ppm", options=PPMOptions(10, a)).power for a in (0.5, 2 / 3, 0.9)]
    np.testing.assert_allclose(found, [0.5, 2 / 3, 0.2])
    assert Method("m", "ppm").power == pytest.approx(2 / 3)
    assert Method("m", "path").power == 1.0


def test_who_finds_all_light():
    point = [PointLight((0, -3, 3), 5.0)]
    cases = {
        "matt": (Scene(VIEW, [BALL], point), True, True, False),
        "mirror under a point light": (Scene(VIEW, [BALL, MIRROR], point), False, True, False),
        "plane under the sky": (Scene(VIEW, [GROUND], environment=SKY), True, False, True),
    }
    for scene, by_paths, by_photons, by_whitted in cases.values():
        assert finds_all_light(scene, "path") is by_paths
        assert finds_all_light(scene, "ppm") is by_photons
        assert finds_all_light(scene, "whitted") is by_whitted
        assert not finds_all_light(scene, "photon_map")
