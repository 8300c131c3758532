"""Bad surfaces are refused before any work, naming the object, the value and the remedy."""

from types import SimpleNamespace

import numpy as np
import pytest

from hybrid_rt import Box, Plane, Rectangle, Sphere, Torus, TriangleMesh
from meshing import BezierPatches, SurfaceOfRevolution

NAN, INF = np.nan, np.inf
CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
SQUARE = np.array([[[0, 0, 0], [0, 1, 0]], [[1, 0, 0], [1, 1, 0]]], float)


def mesh(vertices, faces):
    return TriangleMesh(SimpleNamespace(vertices=vertices, faces=faces))


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Sphere((0, 0, 0), 0), "Sphere"),
        (lambda: Sphere((0, 0, 0), -1), "Sphere"),
        (lambda: Sphere((0, 0, 0), NAN), "Sphere"),
        (lambda: Sphere((0, 0, INF), 1), "Sphere"),
        (lambda: Rectangle((0, 0, 0), (1, 0, 0), (2, 0, 0)), "Rectangle"),
        (lambda: Rectangle((0, 0, NAN), (1, 0, 0), (0, 1, 0)), "Rectangle"),
        (lambda: Plane((0, 0, 0), (0, 0, 0)), "Plane"),
        (lambda: Box((0, 0, 0), (1, 0, 1)), "Box"),
        (lambda: Box((0, 0, 0), (1, -1, 1)), "Box"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 1, 0), r"Torus minor_radius .*\.flipped"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 1, 1), "a tube that reaches the axis meets itself"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 1, 2), "pass a smaller minor_radius"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), INF, 2), "Torus major_radius"),
        (lambda: Torus((0, 0, 0), (0, 0, 0), 2, 1), "Torus axis is the zero vector"),
        (lambda: Torus((0, NAN, 0), (0, 0, 1), 2, 1), "Torus origin"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 2, 1, (0, 0, -3)), "parallel to the axis"),
        (
            lambda: Torus((0, 0, 0), (0, 0, 1), 2, 1).transformed(np.diag([1, 2, 1, 1])),
            "similarity",
        ),
        (lambda: mesh(CORNERS, [[0, 1, 3]]), r"faces\[0\] is \[0, 1, 3\]"),
        (lambda: mesh(CORNERS, [[0, 1, 2], [0, 1, -1]]), r"faces\[1\] is \[0, 1, -1\]"),
        (lambda: mesh([[0, 0, NAN], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), r"vertices\[0\]"),
        (lambda: mesh(CORNERS, np.empty((0, 3), int)), "TriangleMesh"),
        (lambda: BezierPatches([SQUARE[:1]]), "degree"),
        (lambda: BezierPatches([np.zeros((32, 2, 3))]), "degree"),
        (lambda: BezierPatches([SQUARE[..., :2]]), "shape"),
        (lambda: BezierPatches([np.zeros((2, 2, 3))]), "patch"),
        (lambda: BezierPatches([SQUARE, SQUARE[:, :1].repeat(2, axis=1)]), "patch 1 has no area"),
        (lambda: BezierPatches([SQUARE, np.where(SQUARE == 1, INF, SQUARE)]), "finite"),
        (lambda: SurfaceOfRevolution([(0, 1), (NAN, 2)], (0, 0, 0), (0, 0, 1)), "finite"),
        (lambda: SurfaceOfRevolution([(0, 1), (1, 1)], (0, 0, 0), (0, 0, 0)), "axis"),
        (lambda: SurfaceOfRevolution([(0, 0), (1, 0)], (0, 0, 0), (0, 0, 1)), "profile|axis"),
        (lambda: SurfaceOfRevolution([(0, -1), (1, 1)], (0, 0, 0), (0, 0, 1)), "radius|radii|R"),
        (
            lambda: Sphere((0, 0, 0), 1).transformed(np.diag([1, 2, 1, 1])),
            "Sphere matrix is no similarity .*for other maps use a NurbsSurface",
        ),
        (
            lambda: SurfaceOfRevolution([(0, 1), (1, 1)], (0, 0, 0), (0, 0, 1)).transformed(
                np.diag([1, 2, 1, 1])
            ),
            "SurfaceOfRevolution matrix .*scale the profile .*NurbsSurface of revolution",
        ),
    ],
)
def test_refused_with_a_name(build, names):
    with pytest.raises((ValueError, TypeError), match=names):
        build()


def test_faces_are_whole_numbers():
    with pytest.raises(TypeError, match="whole numbers"):
        mesh(CORNERS, [[0, 1, 1.7]])


def test_parameters_of_a_sphere():
    """The u is azimuth from the meridian, v runs from the south pole to the pole."""
    sphere = Sphere((1, 2, 3), 2, pole=(0, 0, 1), meridian=(1, 0, 0))
    points = sphere.point(np.array([0.0, 0.25, 0.3, 0.3]), np.array([0.5, 0.5, 0.0, 1.0]))
    expected = np.array([[3, 2, 3], [1, 4, 3], [1, 2, 1], [1, 2, 5]], float)
    assert np.allclose(points, expected, atol=1e-15)


@pytest.mark.parametrize(
    "surface",
    [
        Sphere((1, 2, 3), 2),
        Rectangle((0, 0, 0), (1, 0, 0), (0, 2, 1)),
        Box((0, 0, 0), (1, 2, 3)),
        BezierPatches([SQUARE]),
        SurfaceOfRevolution([(-1, 0.5), (0, 1.5), (1, 0.5)], (0, 0, 0), (0, 0, 1)),
    ],
    ids=lambda surface: type(surface).__name__,
)
def test_normals_lie_along_the_product_of_the_partials(surface):
    u, v, step = np.array([0.3, 0.6]), np.array([0.4, 0.7]), 1e-6
    along_u = surface.point(u + step, v, 0) - surface.point(u - step, v, 0)
    along_v = surface.point(u, v + step, 0) - surface.point(u, v - step, 0)
    product = np.cross(along_u, along_v)
    product /= np.linalg.norm(product, axis=1, keepdims=True)
    # Central differences are good to step^2.
    assert np.allclose(surface.normal(u, v, 0), product, atol=1e-8)
    assert np.allclose(surface.flipped().flipped().normal(u, v, 0), product, atol=1e-8)
