"""Meshes with texture coordinates show pictures as surfaces of one patch do, by every integrator."""

import base64
import json
import pickle
import re

import numpy as np
import pytest
import trimesh
from trimesh.visual import TextureVisuals

from hybrid_rt import (
    Camera,
    CheckerTexture,
    Emissive,
    ImageTexture,
    Lambertian,
    Metal,
    Mirror,
    Object,
    PhotonMapOptions,
    PointLight,
    PPMOptions,
    Rectangle,
    Scene,
    TriangleMesh,
    render,
)
from hybrid_rt.trimesh_adapter import RayMeshIntersector

INTEGRATORS = ["whitted", "path", "ppm", "photon_map"]
SIZE = 64
# Red is u and green is v, exactly, between the centres of the outermost pixels.
ACROSS, UP = np.meshgrid(
    (np.arange(SIZE) + 0.5) / SIZE, 1 - (np.arange(SIZE) + 0.5) / SIZE, indexing="xy"
)
RAMP = ImageTexture(np.stack([ACROSS, UP, np.zeros_like(UP)], axis=-1))
PICTURE = np.random.default_rng(3).random((5, 7, 3))
TEXTURES = {
    "picture": ImageTexture(PICTURE),
    "checker": CheckerTexture((0.9, 0.1, 0.2), (0.1, 0.3, 0.8), 3, "uv"),
}
# Corner and edges of the wall that all of the meshes below cover.
CORNER, ALONG, UPWARD = np.array([-1.0, 0, 0]), np.array([2.0, 0, 0]), np.array([0, 0.3, 1.4])
WALL = Rectangle(CORNER, ALONG, UPWARD)
# One that no two edges of the grid below share.
EYE = (0.13, -3.1, 1.07)


def grid(n, m):
    """Parameters (k, 2) and faces of a wall cut into n x m squares of two triangles each."""
    u, v = np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m, indexing="ij")
    k = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).ravel()
    right = k + m + 1
    faces = np.concatenate(
        [np.stack([k, right, right + 1], -1), np.stack([k, right + 1, k + 1], -1)]
    )
    return np.stack([u.ravel(), v.ravel()], axis=-1), faces


def on_wall(uv, faces, coordinates):
    points = CORNER + uv[:, :1] * ALONG + uv[:, 1:] * UPWARD
    return trimesh.Trimesh(
        points, faces, process=False, visual=TextureVisuals(uv=np.array(coordinates))
    )


def quad():
    return TriangleMesh(on_wall(*grid(1, 1), grid(1, 1)[0]))


def with_seams():
    """Return triangles without common vertices; whole numbers are added to the coordinates of each."""
    uv, faces = grid(3, 2)
    loose = uv[faces].reshape(-1, 2)
    tile = np.random.default_rng(5).integers(-3, 4, (len(faces), 1, 2))
    tile = np.broadcast_to(2 * tile, (len(faces), 3, 2)).reshape(-1, 2)
    return TriangleMesh(on_wall(loose, np.arange(len(loose)).reshape(-1, 3), loose + tile))


def turned():
    """Return the wall turned over and moved back, with its normals flipped twice."""
    there = trimesh.transformations.rotation_matrix(2.0, (1, 2, 3), (0, 1, 0))
    back = np.linalg.inv(there)
    return quad().transformed(there).flipped().transformed(back).flipped()


MESHES = {"quad": quad, "seams": with_seams, "turned": turned}


def room(wall, material, eye=EYE):
    """Return a scene with a wall that a floor with a picture, a mirror and a lamp stand before."""
    floor = Rectangle((-2, -3, -0.1), (4, 0, 0), (0, 4, 0))
    side = Rectangle((1.2, -2, 0), (0, 2.4, 0), (0, 0, 1.5))
    objects = [
        Object(floor, Lambertian(TEXTURES["picture"])),
        Object(wall, material, "wall"),
        Object(side, Metal(0.8, 0.3)),
    ]
    camera = Camera(eye, (0, 0, 0.6), (0, 0, 1), 45, 24, 16)
    return Scene(camera, objects, [PointLight((0.4, -1.7, 1.9), 20)])


# What is compared is the same in each photon: few are enough.
FEW = {"ppm": PPMOptions(5000), "photon_map": PhotonMapOptions(5000)}


def look(scene, integrator, **settings):
    settings |= {"passes": 2, "seed": 1, "threads": 1, "max_depth": 4}
    return render(scene, integrator, options=FEW.get(integrator), **settings)


@pytest.mark.parametrize("texture", TEXTURES)
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_picture_on_a_mesh_is_that_on_a_rectangle(integrator, texture):
    outputs = ["albedo"]
    material = Lambertian(TEXTURES[texture])
    expected = look(room(WALL, material), integrator, outputs=outputs)
    for name, mesh in MESHES.items():
        found = look(room(mesh(), material), integrator, outputs=outputs)
        # Points of both differ by roundings; pictures are float32.
        np.testing.assert_allclose(found.image, expected.image, rtol=2e-6, err_msg=name)
        albedo = found.channels["albedo"], expected.channels["albedo"]
        np.testing.assert_allclose(*albedo, rtol=2e-6, err_msg=name)
        assert found.report["pictures_on_meshes"] == []


def test_parameters_of_hits_stay_barycentric():
    mesh = quad()
    bare = TriangleMesh(trimesh.Trimesh(mesh.vertices, mesh.faces, process=False))
    with_them, without = (
        render(room(m, Lambertian(RAMP)), passes=1, outputs=["uv"]).channels["uv"]
        for m in (mesh, bare)
    )
    np.testing.assert_array_equal(with_them, without)


@pytest.mark.parametrize("accuracy", ["certified", "refined", "mesh"])
def test_the_picture_does_not_depend_on_the_accuracy(accuracy):
    found, expected = (
        look(room(wall, Lambertian(RAMP)), "whitted", accuracy=accuracy).image
        for wall in (with_seams(), WALL)
    )
    np.testing.assert_allclose(found, expected, rtol=2e-6)


# --- lamps: every way to find their light looks the picture up


def lit_by(triangle, picture):
    lamp = Object(triangle, Emissive(picture, base=Lambertian(picture)))
    floor = Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), Lambertian(0.7))
    side = Object(Rectangle((-1.5, -1.5, 0), (0, 3, 0), (0, 0, 2)), Mirror())
    camera = Camera((0.2, -4, 1), (0, 0, 0.6), (0, 0, 1), 50, 16, 12)
    return Scene(camera, [floor, lamp, side])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_lamp_shines_by_its_texture_coordinates(integrator):
    # Down and toward the camera; seen by it, by the floor and by the mirror.
    shape = trimesh.Trimesh(
        [[-1, 0, 1.5], [-0.8, 0.6, 1.0], [1, 0.4, 1.6]], [[0, 1, 2]], process=False
    )
    # Those of barycentric weights of the face, swapped; the picture is mirrored likewise.
    swapped = TriangleMesh(shape, texture_coordinates=[[0, 0], [0, 1], [1, 0]])
    mirrored = ImageTexture(PICTURE[::-1, ::-1].transpose(1, 0, 2))
    expected = look(lit_by(TriangleMesh(shape), TEXTURES["picture"]), integrator).image
    found = look(lit_by(swapped, mirrored), integrator).image
    np.testing.assert_allclose(found, expected, rtol=2e-6, atol=1e-12)
    other = look(lit_by(swapped, TEXTURES["picture"]), integrator).image
    assert np.abs(other - expected).max() > 1e-2


# --- files


def write_obj(path):
    path.write_text(
        "v -1 0 0\nv 1 0 0\nv 1 0.3 1.4\nv -1 0.3 1.4\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n"
        # Two faces that share places, not texture coordinates: the second shows the picture turned.
        "f 1/1 2/2 3/3\nf 1/3 3/1 4/2\n"
    )


def write_gltf(path):
    """Write the same in glTF, whose second texture coordinate runs downward."""
    points = np.array(
        [[-1, 0, 0], [1, 0, 0], [1, 0.3, 1.4], [-1, 0, 0], [1, 0.3, 1.4], [-1, 0.3, 1.4]], "<f4"
    )
    coordinates = np.array([[0, 1], [1, 1], [1, 0], [1, 0], [0, 1], [1, 1]], "<f4")
    numbers = np.arange(6, dtype="<u2")
    parts = [points.tobytes(), coordinates.tobytes(), numbers.tobytes()]
    starts = np.cumsum([0, *map(len, parts)]).tolist()
    accessor = [
        {"bufferView": 0, "componentType": 5126, "count": 6, "type": "VEC3",
         "min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()},
        {"bufferView": 1, "componentType": 5126, "count": 6, "type": "VEC2"},
        {"bufferView": 2, "componentType": 5123, "count": 6, "type": "SCALAR"},
    ]  # fmt: skip
    inline = "data:application/octet-stream;base64," + base64.b64encode(b"".join(parts)).decode()
    content = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [
            {
                "primitives": [
                    {"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 2, "material": 0}
                ]
            }
        ],
        "materials": [{}],
        "accessors": accessor,
        "bufferViews": [
            {"buffer": 0, "byteOffset": start, "byteLength": len(part)}
            for start, part in zip(starts, parts, strict=False)
        ],
        "buffers": [{"byteLength": starts[-1], "uri": inline}],
    }
    path.write_text(json.dumps(content))


def write_ply(path):
    rows = [
        (-1, 0, 0, 0, 0), (1, 0, 0, 1, 0), (1, 0.3, 1.4, 1, 1), (-1, 0, 0, 1, 1),
        (1, 0.3, 1.4, 0, 0), (-1, 0.3, 1.4, 1, 0),
    ]  # fmt: skip
    names = "".join(f"property float {name}\n" for name in "xyzst")
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex 6\n{names}element face 2\n"
        "property list uchar int vertex_indices\nend_header\n"
        + "".join(" ".join(map(str, row)) + "\n" for row in rows)
        + "3 0 1 2\n3 3 4 5\n"
    )


@pytest.mark.parametrize(
    ("write", "ending"), [(write_obj, "obj"), (write_gltf, "gltf"), (write_ply, "ply")]
)
def test_coordinates_of_files_are_kept(write, ending, tmp_path):
    path = tmp_path / f"wall.{ending}"
    write(path)
    mesh = TriangleMesh(trimesh.load_mesh(path, process=True))
    # Below the diagonal (s, t) of the wall, above it 1 - s and 1 - t.
    for s, t, expected in [(0.7, 0.2, (0.7, 0.2)), (0.2, 0.7, (0.8, 0.3))]:
        point = CORNER + s * ALONG + t * UPWARD
        camera = Camera(point + np.array([0, -3, 0.2]), point, (0, 0, 1), 1e-6, 1, 1)
        scene = Scene(camera, [Object(mesh, Emissive(RAMP))])
        image = render(scene, passes=1, threads=1).image
        # Texture coordinates of two files are float32; the pixel is 1e-7 wide.
        np.testing.assert_allclose(image[0, 0], (*expected, 0), atol=1e-6)


def test_a_picture_in_a_file_goes_with_its_coordinates(tmp_path):
    from PIL import Image

    picture = np.random.default_rng(8).integers(0, 256, (6, 9, 3), dtype=np.uint8)
    mesh = on_wall(*grid(2, 2), grid(2, 2)[0])
    mesh.visual = TextureVisuals(uv=mesh.visual.uv, image=Image.fromarray(picture))
    expected = look(room(WALL, Lambertian(ImageTexture(picture))), "whitted").image
    for ending, name in [("glb", "baseColorTexture"), ("obj", "image")]:
        mesh.export(tmp_path / f"wall.{ending}")
        read = trimesh.load_mesh(tmp_path / f"wall.{ending}")
        texture = ImageTexture(np.asarray(getattr(read.visual.material, name).convert("RGB")))
        found = look(room(TriangleMesh(read), Lambertian(texture)), "whitted").image
        # Points in the files have 24 or about 27 bits, a texel is about 20 grey levels from the next.
        np.testing.assert_allclose(found, expected, rtol=1e-4)


# --- the class


def test_coordinates_survive_what_is_done_to_a_mesh():
    mesh, given = quad(), grid(1, 1)[0]
    for other in (
        mesh,
        mesh.transformed(np.diag([1, 2, 3, 1])),
        mesh.flipped(),
        TriangleMesh(mesh),
        pickle.loads(pickle.dumps(mesh)),
        TriangleMesh(on_wall(*grid(1, 1), [[9, 9]] * 4), texture_coordinates=given.tolist()),
    ):
        np.testing.assert_array_equal(other.texture_coordinates, given)
        assert other.texture_coordinates.dtype == np.float64
        assert repr(other) == "TriangleMesh(4 vertices, 2 faces, texture coordinates)"
    # The coordinates belong to the vertices, whatever the order of these in a face.
    u, v, face = [0.2, 0.5], [0.3, 0.1], [0, 1]
    np.testing.assert_array_equal(
        mesh.texture_point(u, v, face), mesh.flipped().texture_point(v, u, face)
    )
    np.testing.assert_allclose(
        CORNER + mesh.texture_point(u, v, face) @ np.stack([ALONG, UPWARD]),
        mesh.point(u, v, face),
        atol=1e-15,
    )


def test_what_is_given_is_copied():
    given = grid(1, 1)[0].copy()
    mesh = TriangleMesh(on_wall(*grid(1, 1), given), texture_coordinates=given)
    given[:] = 7.0
    assert mesh.texture_coordinates.max() == 1.0
    with pytest.raises(ValueError, match="read-only"):
        mesh.texture_coordinates[0] = 0.0


def test_a_palette_is_looked_up_at_one_place():
    place = np.array([0.1, 0.7])
    mesh = TriangleMesh(on_wall(*grid(3, 3), [place] * 16))
    rng = np.random.default_rng(2)
    found = mesh.texture_point(rng.random(99), rng.random(99), rng.integers(0, 18, 99))
    assert (found == place).all()


def test_a_mesh_without_coordinates_is_as_before():
    box = trimesh.creation.box()
    no_uv = trimesh.creation.box()
    no_uv.visual = TextureVisuals()
    assert no_uv.visual.uv is None
    for given in (box, no_uv):
        mesh = TriangleMesh(given)
        assert mesh.texture_coordinates is None
        assert "texture_coordinates" not in vars(mesh)
        np.testing.assert_array_equal(mesh.texture_point([0.2], [0.3], [4]), [[0.2, 0.3]])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (
            np.zeros((3, 2)),
            "TriangleMesh texture_coordinates has shape (3, 2): pass (4, 2), a pair for each vertex",
        ),
        (
            [[0, 0], [1, 0], [np.nan, 1], [0, 1]],
            "TriangleMesh texture_coordinates[2] is [nan, 1.0]: pass finite numbers within 1e+09",
        ),
        ([[0, 0], [1, -2e9], [1, 1], [0, 1]], "texture_coordinates[1] is [1.0, -2000000000.0]"),
        ([[0], [1, 0], [1, 1], [0, 1]], "pass rows of equal length"),
    ],
)
def test_other_coordinates_are_refused(given, words):
    shape = trimesh.Trimesh(quad().vertices, quad().faces, process=False)
    with pytest.raises((ValueError, TypeError), match=re.escape(words)):
        TriangleMesh(shape, texture_coordinates=given)


@pytest.mark.parametrize(
    ("uv", "words"),
    [
        (
            np.full((4, 2), np.nan),
            "TriangleMesh mesh.visual.uv[0] is [nan, nan]: pass finite numbers within 1e+09",
        ),
    ],
)
def test_wrong_coordinates_of_a_file_are_refused_where_they_count(uv, words):
    uv_of_vertices, faces = grid(1, 1)
    shape = on_wall(uv_of_vertices, faces, uv_of_vertices)
    shape.visual.vertex_attributes["uv"] = uv
    words += ", or texture_coordinates of your own"
    with pytest.raises(ValueError, match=re.escape(words)):
        TriangleMesh(shape)
    own = TriangleMesh(shape, texture_coordinates=uv_of_vertices)
    np.testing.assert_array_equal(own.texture_coordinates, uv_of_vertices)
    assert RayMeshIntersector(shape).intersects_any([[0, -1, 0.5]], [[0, 1, 0]]).all()
