"""Meshes whose every triangle shows the whole texture are named; others are not."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Box,
    Camera,
    CheckerTexture,
    Emissive,
    GradientSky,
    ImageTexture,
    Lambertian,
    Mirror,
    Mix,
    Object,
    Phong,
    Rectangle,
    Scene,
    TriangleMesh,
    render,
)
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.lint.faults import pictures_on_meshes

CAMERA = Camera((0, -6, 2), (0, 0, 0), (0, 0, 1), width=8, height=6)
MESH = TriangleMesh(trimesh.creation.box((1, 1, 1)))
FACE = TriangleMesh(trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 0, 1]], [[0, 1, 2]]))
# The same faces, with texture coordinates.
UNWRAPPED = TriangleMesh(MESH, texture_coordinates=MESH.vertices[:, :2])
FLOOR = Rectangle((-2, -2, -1), (4, 0, 0), (0, 4, 0))
PICTURE = ImageTexture(np.random.default_rng(1).random((4, 4, 3)))
IN_UV, IN_WORLD = (CheckerTexture(0.8, 0.2, 4, space) for space in ("uv", "world"))


def named(*objects):
    # An object with a texture of its own comes first: rows of the tables must be found.
    floor = Object(FLOOR, Lambertian(PICTURE), "floor")
    return pictures_on_meshes(compile_scene(Scene(CAMERA, [floor, *objects])))


@pytest.mark.parametrize(
    "material",
    [
        Lambertian(PICTURE),
        Lambertian(IN_UV),
        Phong(0.2, IN_UV, 20),
        Mix([(0.5, Mirror()), (0.5, Lambertian(PICTURE))]),
        Emissive(PICTURE),
        Emissive(3, base=Lambertian(IN_UV)),
    ],
    ids=repr,
)
def test_a_mesh_coloured_by_u_and_v_is_named(material):
    assert named(Object(MESH, material, "part")) == ["object 'part'"]
    assert named(Object(MESH, material)) == ["objects[1] (a TriangleMesh)"]


@pytest.mark.parametrize(
    ("surface", "material"),
    [
        (MESH, Lambertian(0.5)),
        (MESH, Lambertian(IN_WORLD)),
        (MESH, Emissive(IN_WORLD, base=Lambertian(0.5))),
        (FACE, Lambertian(PICTURE)),  # once, on the only face
        (UNWRAPPED, Lambertian(PICTURE)),
        (UNWRAPPED, Emissive(PICTURE, base=Lambertian(IN_UV))),
        (Box((0, 0, 0), (1, 1, 1)), Lambertian(PICTURE)),
    ],
    ids=repr,
)
def test_other_textures_and_surfaces_are_not(surface, material):
    assert named(Object(surface, material, "part")) == []


def test_the_render_warns_and_the_report_holds_the_names(caplog):
    objects = [Object(MESH, Lambertian(IN_UV), "part")]
    report = render(Scene(CAMERA, objects, [], GradientSky(1, 1)), passes=2, threads=1).report
    assert report["pictures_on_meshes"] == ["object 'part'"]
    words = "object 'part' is a TriangleMesh with a texture over (u, v), which repeats on every"
    assert f"WARNING   {words}" in in_words(report)
    assert "pass TriangleMesh(mesh, texture_coordinates=...)" in in_words(report)
    assert [record.name for record in caplog.records] == ["hybrid_rt.report.scene"]
    assert caplog.messages[0].startswith(words)
