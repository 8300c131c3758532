"""Settings at the ends of float64 give what is right, or are refused by name."""

import re
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid_rt import (
    Box,
    Camera,
    Emissive,
    GradientSky,
    Intersector,
    Lambertian,
    Metal,
    Object,
    Rectangle,
    RectangleLight,
    Scene,
    Sphere,
    TriangleMesh,
    render,
)

TINY = [5e-324, 1e-200, 1e-61]
LARGE = [1e61, 1e308]
CAMERA = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=8, height=6)


@pytest.mark.parametrize("fuzz", [5e-324, 1e-160, 9e-7])
def test_fuzz_below_what_cosines_resolve_is_refused(fuzz):
    with pytest.raises(
        ValueError, match=f"Metal fuzz is {fuzz:g}: pass 0 .a mirror., or a number from"
    ):
        Metal(0.8, fuzz)


def test_the_least_fuzz_looks_like_a_mirror():
    """A white ball under an even sky is invisible; what a lobe loses to rounding would show."""
    scene = Scene(
        CAMERA, [Object(Sphere((0, 0, 0), 1), Metal(1.0, 1e-6))], environment=GradientSky(1, 1)
    )
    image = render(scene, "whitted", passes=4, threads=1).image
    # A cosine rounds by 1.1e-16, and 1 - cos reaches 5e-13: 2e-4 of the lobe, of a few lobes at most.
    np.testing.assert_allclose(image, 1.0, atol=2e-3)


@pytest.mark.parametrize("size", [*TINY, *LARGE])
@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda s: Rectangle((0, 0, 0), (s, 0, 0), (0, 1, 0)), "Rectangle edge_u"),
        (lambda s: Rectangle((0, 0, 0), (0, 1, 0), (0, s / 2, s)), "Rectangle edge_v"),
        (lambda s: RectangleLight((0, 0, 0), (s, 0, 0), (0, 1, 0), 1), "RectangleLight edge_u"),
        (lambda s: Box((0, 0, 0), (1, s, 1)), "Box (edge along y|hi)"),
    ],
)
def test_edges_that_have_no_square_are_refused(make, name, size):
    with pytest.raises(ValueError, match=rf"{name} is \[.*: scale the scene"):
        make(size)


@pytest.mark.parametrize("size", [1e-60, 1e-30, 1e-10])
@pytest.mark.parametrize(
    "make",
    [
        lambda s: Rectangle((0, 0, 0), (s, 0, 0), (0, 1, 0)),
        lambda s: Box((0, 0, 0), (s, 1, s)),
    ],
)
def test_the_shortest_edges_are_hit_where_they_are(make, size):
    """From above, in the middle: the ray meets the top at z = 0 or z = size."""
    surface = make(size)
    top = surface.bounds[1][2]
    hits = Intersector([surface], threads=1).intersect((size / 2, 0.25, 2), (0, 0, -1))
    assert hits.hit.all()
    # Two units away, t rounds by an ulp or two.
    np.testing.assert_allclose(
        hits.position, [[size / 2, 0.25, top]], rtol=1e-15, atol=8 * 2.0**-52
    )
    # Top and bottom of the box are one to float64, so either is met first.
    np.testing.assert_array_equal(np.abs(hits.normal), [[0, 0, 1]])


@pytest.mark.parametrize("height", [1e-310, 1e-160])
def test_slivers_of_a_mesh_have_unit_normals(height):
    """Its squares underflow. The normal is along z, by construction."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, height, 0], [1, 1, 1]], float)
    mesh = TriangleMesh(SimpleNamespace(vertices=vertices, faces=np.array([[0, 1, 2], [1, 3, 2]])))
    np.testing.assert_array_equal(mesh.normal(0.3, 0.3, 0), [0, 0, 1])
    floor = Object(Rectangle((-5, -5, -1), (10, 0, 0), (0, 10, 0)), Lambertian(0.5), "floor")
    scene = Scene(CAMERA, [floor, Object(mesh, Emissive(3), "lamp")])
    assert np.isfinite(render(scene, passes=2, threads=1).image).all()


@pytest.mark.parametrize("watch", [5, type, SimpleNamespace(stop_asked=False)])
def test_what_is_no_watcher_is_refused_before_any_work(watch):
    scene = Scene(CAMERA)
    with pytest.raises(
        TypeError, match=r"watch is .*, without '\w+': pass a LivePage, another Watcher"
    ):
        render(scene, passes=1, watch=watch)


def test_a_watcher_that_cannot_be_called_is_refused():
    names = ("film_lock", "stop_asked", "begin", "note_rays", "note", "end")
    with pytest.raises(TypeError, match="without 'begin'"):
        render(Scene(CAMERA), passes=1, watch=SimpleNamespace(**dict.fromkeys(names, 1)))


LENSED = Camera((0, -4, 1), (0, 0, 0), (0, 0, 1), width=8, height=6, aperture=0.1)
BAD_CALLS = {
    "row of another length": (lambda: CAMERA.rays([1.0, 2.0], [1.0]), "Camera.rays row has shape (1,): pass (2,)"),
    "a word": (lambda: CAMERA.rays("a", [1.0]), "Camera.rays column is 'a': pass real numbers"),
    "nan": (lambda: CAMERA.rays([np.nan], [1.0]), "Camera.rays column holds nan: pass finite"),
    "lens out of range": (
        lambda: LENSED.rays([1.0], [1.0], [[0.5, -0.1]]), "Camera.rays lens holds -0.1 to 0.5: pass",
    ),
    "lens of another shape": (
        lambda: LENSED.rays([1.0], [1.0], [0.5, 0.5]), "Camera.rays lens has shape (2,): pass (1, 2)",
    ),
    "a point": (lambda: CAMERA.sees((0, 0, 0)), "Camera.sees points has shape (3,): pass (n, 3)"),
    }  # fmt: skip


@pytest.mark.parametrize(("call", "words"), BAD_CALLS.values(), ids=BAD_CALLS)
def test_a_camera_is_asked_for_what_it_can_answer(call, words):
    with pytest.raises((ValueError, TypeError), match=re.escape(words)):
        call()


def test_lists_and_integers_are_taken():
    origins, directions = CAMERA.rays([4, 1], [3, 2])
    assert origins.shape == directions.shape == (2, 3)
    expected = CAMERA.rays(np.array([4.0, 1.0]), np.array([3.0, 2.0]))[1]
    np.testing.assert_array_equal(directions, expected)
    assert CAMERA.sees([[0, 0, 0]])[1].tolist() == [3 * 8 + 4]
