"""Certified tessellation: its bound, its seams, and how it says no."""

from importlib import resources

import numpy as np
import pytest

from hybrid_rt.demo import vase
from meshing import BezierPatches, SurfaceOfRevolution, bounds, tessellate


@pytest.fixture(scope="module")
def teapot():
    with resources.as_file(resources.files("hybrid_rt") / "data" / "teapot.bpt") as file:
        return BezierPatches.read(file)


def gaps(surface, mesh, n, seed):
    """Distance between points of faces and the surface at the same weights of the corners."""
    rng = np.random.default_rng(seed)
    face = rng.integers(len(mesh.faces), size=n)
    weight = rng.dirichlet((1.0, 1.0, 1.0), n)
    flat = np.einsum("ij,ijk->ik", weight, mesh.vertices[mesh.faces[face]])
    uv = np.einsum("ij,ijk->ik", weight, mesh.uv[face])
    return np.linalg.norm(flat - surface.point(uv[:, 0], uv[:, 1], mesh.patch_id[face]), axis=1)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-2, 1e-3])
def test_bound_holds_and_is_not_loose(teapot, tolerance):
    for surface in (teapot, vase(0.0, 0.0, 5.0)):
        mesh = tessellate(surface, tolerance)
        measured = gaps(surface, mesh, 200_000, seed=1).max()
        assert measured <= mesh.deviation_bound <= tolerance
        assert mesh.deviation_bound <= 4.0 * measured


def test_faces_lie_along_the_normal(teapot):
    mesh = tessellate(teapot, 1e-3)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    across = np.cross(b - a, c - a)
    middle = mesh.uv.mean(axis=1)
    normal = teapot.normal(middle[:, 0], middle[:, 1], mesh.patch_id)
    assert (np.einsum("ij,ij->i", across, normal) > 0).mean() > 0.999


def test_closed_bodies_are_watertight():
    torus = SurfaceOfRevolution(
        [[(0, 3), (1.4, 3), (1.4, 1), (0, 1)], [(0, 1), (-1.4, 1), (-1.4, 3), (0, 3)]],
        (1, 2, 3),
        (1, 1, 0),
    )
    for surface in (torus, vase(0.0, 0.0, 5.0)):
        assert tessellate(surface, 1e-2).mesh.is_watertight


def test_no_open_edge_where_patches_join(teapot):
    mesh = tessellate(teapot, 1e-2).mesh
    edges, count = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    # Newell's teapot is open along the rims of body, lid, spout and handle, and nowhere else:
    # every edge on one face lies on one of the circles or rings where parts meet without joining.
    assert count.max() <= 2
    assert (count == 1).sum() < 0.1 * len(edges)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan])
def test_tolerance_must_be_positive(teapot, tolerance):
    with pytest.raises(ValueError, match="tolerance"):
        tessellate(teapot, tolerance)


def test_too_many_triangles_are_refused_before_they_are_made(teapot):
    with pytest.raises(ValueError, match="triangles"):
        tessellate(teapot, 1e-12)


def test_a_profile_is_cut_alike_wherever_it_is_turned():
    """It is cut once for all of them."""
    segments = [[(-1.0, 0.0), (-0.5, 1.2), (0.6, 0.9), (1.0, 0.0)]]
    tolerance = 1e-3
    first = tessellate(SurfaceOfRevolution(segments, (0, 0, 0), (0, 0, 1)), tolerance)
    searched = bounds._fewest_cells.cache_info().misses
    for origin, axis in (((3, 0, 0), (0, 0, 1)), ((-200, 7, 50), (0.6, 0, 0.8))):
        mesh = tessellate(SurfaceOfRevolution(segments, origin, axis), tolerance)
        # Which diagonal of a cell is the shorter one, rounding may decide.
        assert (len(mesh), len(mesh.vertices)) == (len(first), len(first.vertices))
        assert mesh.deviation_bound <= tolerance
    assert bounds._fewest_cells.cache_info().misses == searched
    finer = tessellate(SurfaceOfRevolution(segments, (0, 0, 0), (0, 0, 1)), tolerance / 4)
    assert len(finer) > len(first)


def test_scaling_by_a_power_of_two_keeps_the_faces(teapot):
    a = tessellate(teapot, 1e-2)
    b = tessellate(teapot.transformed(np.diag([1024.0, 1024.0, 1024.0, 1.0])), 10.24)
    np.testing.assert_array_equal(a.faces, b.faces)
    np.testing.assert_array_equal(a.vertices * 1024.0, b.vertices)


def test_bpt_round_trip_keeps_every_bit(teapot, tmp_path):
    teapot.write(tmp_path / "copy.bpt")
    copy = BezierPatches.read(tmp_path / "copy.bpt")
    for a, b in zip(teapot.patches, copy.patches, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_byte_order_mark_is_no_part_of_a_bpt(teapot, tmp_path):
    path = tmp_path / "marked.bpt"
    teapot.write(path)
    path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert len(BezierPatches.read(path)) == len(teapot)


@pytest.mark.parametrize(("text", "line"), [("{}\n1 1\n", 1), ("\n1\n3 {}\n", 3)])
def test_counts_of_many_digits_are_refused_with_file_and_line(tmp_path, text, line):
    path = tmp_path / "many.bpt"
    path.write_text(text.format(5000 * "9"))
    with pytest.raises(ValueError, match=rf"many\.bpt, line {line}: .* expected, found"):
        BezierPatches.read(path)


def test_broken_bpt_names_file_and_line(tmp_path):
    path = tmp_path / "broken.bpt"
    path.write_text("1\n1 1\n0 0 0\n0 1 0\n1 0 zero\n1 1 0\n")
    with pytest.raises(ValueError, match=r"broken\.bpt.*5"):
        BezierPatches.read(path)


def test_flipping_reverses_normals(teapot):
    lathe = vase(0.0, 0.0, 5.0)
    rng = np.random.default_rng(2)
    u, v = rng.uniform(0.1, 0.9, (2, 50))
    np.testing.assert_allclose(
        teapot.flipped().normal(v, u, 3), -teapot.normal(u, v, 3), atol=1e-12
    )
    last = len(lathe) - 1
    np.testing.assert_allclose(
        lathe.flipped().normal(u, 1 - v, last - 2), -lathe.normal(u, v, 2), atol=1e-12
    )


@pytest.mark.parametrize(
    ("control", "message"),
    [
        (np.full((1, 4, 4, 3), np.nan), "nan"),
        (np.zeros((1, 1, 4, 3)), "degree"),
        (np.zeros((1, 4, 4, 2)), "shape"),
        (np.zeros((1, 4, 4, 3)), "0"),
    ],
)
def test_bad_nets_are_refused(control, message):
    with pytest.raises(ValueError, match=message):
        BezierPatches(control)


@pytest.mark.parametrize(
    ("profile", "tolerance"),
    [([(0, 0), (5, 0.1), (10, 0)], 0.2), ([(0, 0), (0, 1), (2, 1), (2, 0)], 5.0)],
    ids=["spindle", "bowl"],
)
def test_a_body_between_two_poles_has_triangles_at_any_tolerance(profile, tolerance):
    """Leaves from pole to pole have only two corners in space."""
    body = SurfaceOfRevolution([profile], (0, 0, 0), (0, 0, 1))
    mesh = tessellate(body, tolerance)
    assert mesh.mesh.is_watertight
    assert np.ptp(mesh.vertices[mesh.faces], axis=(0, 1))[2] == profile[-1][0]
    u, v = np.random.default_rng(3).random((2, 2000))
    away = np.linalg.norm(body.point(u, v)[:, None] - mesh.vertices[np.unique(mesh.faces)], axis=2)
    assert away.min(axis=1).max() <= mesh.deviation_bound + profile[-1][0] / 2
