"""What integrators declare of the light they find is what they find."""

import re
from functools import cache
from itertools import product

import pytest

from hybrid_rt.integrators import (
    INTEGRATORS,
    PathOptions,
    PhotonMapOptions,
    PPMOptions,
)
from hybrid_rt.integrators.light_found import ALL_PATHS, _paths, left_out, paths_of
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Metal, Mirror, Mix
from hybrid_rt.primitives import Plane, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

# Looks at the middle of the floor from the left; the wall stands on the right, out of the picture,
# and the lamp hangs between. Metal throws what comes from the wall and the lamp to the camera.
VIEW = Camera((-1.2, 0, 1.2), (0, 0, 0), (0, 0, 1), vertical_fov=12, width=8, height=6)
LIGHTS = {
    "P": PointLight((0.3, 0.0, 1.0), 1.0),
    "L": RectangleLight((0.1, -0.2, 1.0), (0, 0.4, 0), (0.4, 0, 0), 6.0),
}
MATERIALS = {"D": Lambertian(0.8), "G": Metal(0.8, 0.9), "S": Mirror()}
WALL = Rectangle((0.8, -1, 0.02), (0, 0, 2), (0, 2, 0))
FLOOR = Rectangle((-0.7, -0.7, 0), (1.4, 0, 0), (0, 1.4, 0))
WAYS = {
    "path": ("path", None),
    "path, lights": ("path", PathOptions(strategy="lights")),
    "path, directions": ("path", PathOptions(strategy="directions")),
    "whitted": ("whitted", None),
    "ppm": ("ppm", PPMOptions(4000)),
    "photon_map": ("photon_map", PhotonMapOptions(4000)),
}


@cache
def mean_of(way, light, wall, floor):
    """Return the mean of a picture; a wall of "" is not there."""
    integrator, options = WAYS[way]
    objects = [Object(FLOOR, MATERIALS[floor], "floor")]
    objects += [Object(WALL, MATERIALS[wall], "wall")] if wall else []
    scene = Scene(VIEW, objects, [LIGHTS[light]])
    return render(scene, integrator, 16, options=options, threads=2).image.mean(dtype=float)


@pytest.mark.slow
@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("word", ["PD", "PG", "LD", "LG", "PSD", "PSG", "LSD", "LSG", "PDD", "LDD"])
def test_light_is_found_as_declared(way, word):
    """The wall brightens the floor where light by way of it is found, and only there."""
    light, *wall, floor = word
    dark = 0.0
    if wall:
        dark = mean_of(way, light, "", floor)
    found = mean_of(way, light, "".join(wall), floor)
    integrator, options = WAYS[way]
    declared = INTEGRATORS[integrator].finds(options or INTEGRATORS[integrator].options())
    if re.fullmatch(declared, word + "E"):
        assert found > 1.02 * dark
    else:
        assert found == pytest.approx(dark, rel=1e-6)


def compiled(surfaces, lights=(), environment=None):
    objects = [Object(surface, material) for surface, material in surfaces]
    return compile_scene(Scene(VIEW, objects, lights, environment))


POINT, LAMP, SKY = LIGHTS["P"], LIGHTS["L"], GradientSky(0.5, 1.0)
BALL, MATT, GLASS = Sphere((0, 0, 0.3), 0.2), Lambertian(0.5), Dielectric(1.5)
SHINING_PLANE = (Plane((0, 0, 3), (0, 0, -1)), Emissive(1.0))


@pytest.mark.parametrize(
    ("scene", "lights", "surfaces", "longest"),
    [
        (compiled([(FLOOR, MATT)], [POINT]), "P", "D", 3),
        (compiled([(BALL, MATT)], [POINT]), "P", "D", 6),
        (compiled([(FLOOR, MATT), (BALL, GLASS)], [POINT, LAMP], SKY), "LPK", "DS", 6),
        (compiled([(BALL, Mix([(0.5, MATT), (0.5, Metal(0.5, 0.2))]))], [LAMP]), "L", "DG", 6),
        (compiled([(BALL, Emissive(2.0)), (FLOOR, Metal(0.5, 0.2))]), "L", "G", 6),
        (compiled([SHINING_PLANE, (FLOOR, MATT)]), "U", "D", 6),
        (compiled([(FLOOR, MATT)], [PointLight((0, 0, 1), 0.0)]), "", "", 0),
    ],
)
def test_letters_of_scenes(scene, lights, surfaces, longest):
    paths = paths_of(scene)
    assert {path[0] for path in paths} == set(lights)
    assert set("".join(path[1:-1] for path in paths)) == set(surfaces)
    assert max(map(len, paths), default=0) == longest
    assert not any(re.fullmatch("PS*E", path) for path in paths)


def test_what_is_left_out_is_named_once_with_the_shortest_paths():
    room = compiled([(FLOOR, MATT), (BALL, GLASS)], [POINT, LAMP])
    thrown = "light of lamps without area that mirrors or glass throw onto surfaces (PSDE, ...)"
    assert INTEGRATORS["path"].left_out_light(room) == [thrown]
    assert INTEGRATORS["ppm"].left_out_light(room) == []
    assert INTEGRATORS["whitted"].left_out_light(room) == [
        "light that goes from surface to surface (LDDE, PDDE, ...)",
        "light that mirrors or glass throw onto surfaces (LSDE, ...)",
        thrown,
    ]
    blind = INTEGRATORS["path"].left_out_light(room, PathOptions(strategy="directions"))
    assert "light straight from lamps without area (PDE, ...)" in blind
    assert INTEGRATORS["whitted"].left_out_light(compiled([(FLOOR, MATT)], [POINT, LAMP])) == []


def test_every_path_has_a_name():
    assert left_out("", ALL_PATHS) == left_out("nothing", ALL_PATHS)
    assert len(left_out("", ALL_PATHS)) == 8


def test_lamps_that_the_camera_sees_are_not_called_light_between_surfaces():
    assert left_out("LD[DGS]*E|LS[DGS]*E", ["LE", "LDE", "LSE", "LDDE"]) == [
        "light that the camera sees directly (LE)"
    ]


SEEN, STRAIGHT = "light that the camera sees", "light straight from lamps or the sky"
GOES, THROWN = "that goes from surface to surface", "that mirrors or glass throw onto"
POINTLIKE = "light of lamps without area"
IN_ALL = "that the camera sees, also in mirrors, metal and glass"


@pytest.mark.parametrize(
    ("found", "lights", "surfaces", "named"),
    [
        ("LDE|L[GS]*E|LDDD*E", "L", "DG", [
            f"{STRAIGHT}, on surfaces seen in metal and rough glass (LDGE, ...)",
            f"part of the light {GOES} (LGDE, ...)",
        ]),
        ("LDE", "LK", "D", [
            f"light {IN_ALL} (LE, KE)",
            "light straight from the sky (KDE)",
            f"light {GOES} (LDDE, KDDE, ...)",
        ]),
        ("L[GS]+E|L.*D.*", "L", "DGS", [f"{SEEN} directly (LE)"]),
        ("L[DG]{0,2}E|K.*", "LK", "D", [
            f"part of the light of lamps with area {GOES} (LDDDE, ...)"
        ]),
        ("PS+G[GS]*E|P[DG].*", "P", "DGS", [
            f"{POINTLIKE} {THROWN} matt or glossy surfaces (PSDE, ...)"
        ]),
        ],
)  # fmt: skip
def test_names_tell_what_is_missing_from_what_is_found(found, lights, surfaces, named):
    assert left_out(found, _paths(lights, surfaces)) == named


def test_no_name_covers_what_is_found():
    """Of two paths that share a name, if one is found, the other is not called by that name alone."""
    for found, path in product(ALL_PATHS[:100], repeat=2):
        together = [sentence.split(" (")[0] for sentence in left_out("", [path, found])]
        if path != found and len(together) == 1:
            assert left_out(found, [path, found]) != [f"{together[0]} ({path})"]


def test_references_are_made_by_those_that_find_the_light_of_lamps():
    found = [name for name, declared in INTEGRATORS.items() if declared.finds_light_of_lamps]
    assert found == ["path", "ppm"]
