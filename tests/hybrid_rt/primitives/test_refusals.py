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
        (lambda: Sphere((0, 0, 0), NAN), "Sphere"),
        (lambda: Rectangle((0, 0, 0), (1, 0, 0), (2, 0, 0)), "Rectangle"),
        (lambda: Plane((0, 0, 0), (0, 0, 0)), "Plane"),
        (lambda: Box((0, 0, 0), (1, 0, 1)), "Box"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 1, 0), r"Torus minor_radius .*\.flipped"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 1, 1), "a tube that reaches the axis meets itself"),
        (lambda: Torus((0, 0, 0), (0, 0, 1), 2, 1, (0, 0, -3)), "parallel to the axis"),
        (
            lambda: Torus((0, 0, 0), (0, 0, 1), 2, 1).transformed(np.diag([1, 2, 1, 1])),
            "similarity",
        ),
        (lambda: mesh(CORNERS, [[0, 1, 3]]), r"faces\[0\] is \[0, 1, 3\]"),
        (lambda: mesh([[0, 0, NAN], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), r"vertices\[0\]"),
        (lambda: mesh(CORNERS, np.empty((0, 3), int)), "TriangleMesh"),
        (lambda: BezierPatches([np.zeros((32, 2, 3))]), "degree"),
        (lambda: BezierPatches([np.zeros((2, 2, 3))]), "patch"),
        (lambda: BezierPatches([SQUARE, SQUARE[:, :1].repeat(2, axis=1)]), "patch 1 has no area"),
        (lambda: BezierPatches([SQUARE, np.where(SQUARE == 1, INF, SQUARE)]), "finite"),
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
