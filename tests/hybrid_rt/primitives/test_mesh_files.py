"""Mesh files are read as they are meant."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, TriangleMesh
from hybrid_rt.primitives.mesh_files import with_absolute_indices

CLOUD = """ply
format ascii 1.0
element vertex 1
property float x
property float y
property float z
end_header
0 0 0
"""
SQUARE = "v 0 0 {0}\nv 1 0 {0}\nv 1 1 {0}\nv 0 1 {0}\nf -4 -3 -2 -1\n"


def test_relative_indices_count_from_where_they_stand(tmp_path):
    """Two squares, at z = 0 and 5: a ray down the middle crosses both."""
    file = tmp_path / "a.obj"
    file.write_text(SQUARE.format(0) + SQUARE.format(5))
    mesh = TriangleMesh.read(file)
    assert mesh.bounds.tolist() == [[0, 0, 0], [1, 1, 5]]
    assert len(mesh) == 4
    crossings = Intersector(mesh, threads=1).intersect_all([(0.3, 0.2, 9)], [(0, 0, -1)])
    assert crossings.count.tolist() == [2]
    assert crossings.hits.t.ravel().tolist() == [4.0, 9.0]


def obj(rng, n_parts, is_relative):
    """Return an OBJ file of quads and triangles with texture coordinates and normals, part by part."""
    lines, counts = [], np.zeros(3, int)
    for part in range(n_parts):
        n = int(rng.integers(4, 8))
        lines.append(f"o part{part}")
        lines += [f"v {x:.6f} {y:.6f} {z:.6f}" for x, y, z in rng.random((n, 3))]
        lines += [f"  vt {x:.6f} {y:.6f}" for x, y in rng.random((n, 2))]
        lines += [f"vn {x:.6f} {y:.6f} {z:.6f}" for x, y, z in rng.random((2, 3))]
        counts += (n, n, 2)
        for size in (3, 4, 3):
            corners = rng.permutation(counts[0])[:size] if part else rng.permutation(n)[:size]
            normal = int(rng.integers(counts[2]))
            # Any of those before, from 1 on, or backwards.
            shift = counts if is_relative else np.zeros(3, int)
            back = 0 if is_relative else 1
            words = [
                f"{c + back - shift[0]}/{c + back - shift[1]}/{normal + back - shift[2]}"
                for c in corners
            ]
            first = " ".join(words[:2])
            lines.append(f"f {first} \\\n {' '.join(words[2:])}")
    return "\n".join(lines)


@pytest.mark.parametrize("seed", range(2))
def test_files_that_count_either_way_are_one_mesh(tmp_path, seed):
    absolute, relative = (
        obj(np.random.default_rng(seed), 5, is_relative) for is_relative in (False, True)
    )
    (tmp_path / "a.obj").write_text(absolute)
    (tmp_path / "b.obj").write_text(relative)
    one, other = (TriangleMesh.read(tmp_path / name) for name in ("a.obj", "b.obj"))
    assert len(one) == 5 * 4
    np.testing.assert_array_equal(one.vertices, other.vertices)
    np.testing.assert_array_equal(one.faces, other.faces)
    np.testing.assert_array_equal(one.texture_coordinates, other.texture_coordinates)


def test_other_files_are_read_as_trimesh_does(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=1)
    for ending in ("stl", "ply", "obj", "glb"):
        ball.export(tmp_path / f"a.{ending}")
        mesh = TriangleMesh.read(str(tmp_path / f"a.{ending}"))
        expected = trimesh.load_mesh(tmp_path / f"a.{ending}")
        np.testing.assert_array_equal(mesh.vertices[mesh.faces], expected.triangles)


def test_a_file_without_relative_indices_stays_as_it_is():
    content = b"v 0 0 -1\nv 1 0 -1\nv 0 1 -1\n# f -1\nf 1 2 3\n"
    assert with_absolute_indices(content) == content


@pytest.mark.parametrize(
    ("name", "content", "error", "words"),
    [
        ("none.stl", None, FileNotFoundError, r"none\.stl': there is no such file"),
        ("a.foo", "x", ValueError, r"a\.foo' has an ending that trimesh does not read: pass an STL"),
        (
            "a.obj", "v 0 0 0\nf -1 -2 -1\n", ValueError,
            r"a\.obj' cannot be read \(line 2 counts back 2 of 1 v\): pass a complete \.obj file",
        ),
        ("b.stl", "solid", ValueError, r"b\.stl' holds no triangles: pass a mesh"),
        (
            "long.stl", "\0" * 80 + "\1\0\0\0" + "\0" * 54, ValueError,
            r"long\.stl' holds no triangles .*announces 1, which take 134 bytes, and it has 138",
        ),
        (
            "cloud.ply",
            CLOUD,
            ValueError, r"cloud\.ply' holds no triangles, but a cloud of points",
        ),
        (
            "free.obj", "v 0 0 0\nv 1 0 0\ncstype bezier\ndeg 1 1\nsurf 0 1 0 1 1 2 1 2\nend\n", ValueError,
            r"free\.obj' holds no triangles, but free-form curves or surfaces",
        ),
        ("part.STEP", "x", ValueError, r"is a CAD file.*read_cad"),
    ],
)  # fmt: skip
def test_what_cannot_be_read_is_named(tmp_path, name, content, error, words):
    if content is not None:
        (tmp_path / name).write_text(content)
    with pytest.raises(error, match=words):
        TriangleMesh.read(tmp_path / name)


def test_a_path_is_wanted():
    with pytest.raises(TypeError, match="TriangleMesh file is 5: pass a path"):
        TriangleMesh.read(5)
