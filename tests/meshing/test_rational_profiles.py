"""Rational profiles and parts of a turn: points, derivatives, boxes, and triangles within their bound."""

import numpy as np
import pytest

from meshing import Cone, Cylinder, SurfaceOfRevolution, circular_arc, tessellate

AXIS = (1.0, 2.0, -0.5)


def ring(**options):
    arcs, weights = circular_arc((0, 2), 0.5, 0.0, 1.0)
    return SurfaceOfRevolution(arcs, (1, 2, 3), AXIS, weights=weights, **options).flipped()


SURFACES = {
    "torus": ring(),
    "part of a torus": ring(u_range=(-0.3, 0.6)),
    "cylinder": Cylinder((1, 2, 3), AXIS, 1, 2, u_range=(0.2, 0.3)),
    "cone": Cone((0, 0, 0), AXIS, 1, 2, u_range=(0.1, 1.1)),
    "uneven": SurfaceOfRevolution(
        [(-1, 0), (-1, 2), (1, 0)], (0, 0, 0), AXIS, weights=[1, 0.001, 1], u_range=(0, 0.7)
    ),
}
each = pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES)


def grid(surface, n=40):
    side = np.linspace(0, 1, n)
    u, v = (x.ravel() for x in np.meshgrid(side, side))
    patch = np.repeat(np.arange(len(surface)), n * n)
    return np.tile(u, len(surface)), np.tile(v, len(surface)), patch


def test_arcs_are_circles():
    u, v, patch = grid(SURFACES["torus"])
    away = SURFACES["torus"].point(u, v, patch) - (1, 2, 3)
    height = away @ SURFACES["torus"].axis
    rho = np.linalg.norm(away - height[:, None] * SURFACES["torus"].axis, axis=1)
    np.testing.assert_allclose(np.hypot(rho - 2, height), 0.5, atol=2e-15)


@each
def test_derivatives_are_those_of_the_points(surface):
    rng = np.random.default_rng(1)
    u, v = rng.uniform(0.05, 0.95, (2, 100))
    patch, h = rng.integers(len(surface), size=100), 1e-6
    su, sv = surface.partials(u, v, patch)
    suu, suv, svv = surface.second_partials(u, v, patch)
    size = np.linalg.norm(svv, axis=1).max() + 10
    for found, (du, dv), of in (
        (su, (h, 0), surface.point), (sv, (0, h), surface.point),
        (suu, (h, 0), lambda *a: surface.partials(*a)[0]),
        (suv, (0, h), lambda *a: surface.partials(*a)[0]),
        (svv, (0, h), lambda *a: surface.partials(*a)[1]),
    ):  # fmt: skip
        quotient = (of(u + du, v + dv, patch) - of(u - du, v - dv, patch)) / (2 * h)
        np.testing.assert_allclose(found, quotient, atol=1e-6 * size)
    product = np.cross(su, sv)
    product /= np.linalg.norm(product, axis=1, keepdims=True)
    np.testing.assert_allclose(surface.normal(u, v, patch), product, atol=1e-10)


@each
def test_boxes_hold_the_points(surface):
    points = surface.point(*grid(surface, 60))
    low, high = surface.bounds
    assert (points >= low).all()
    assert (points <= high).all()
    assert np.abs(points.min(axis=0) - low).max() < 0.01
    assert np.abs(points.max(axis=0) - high).max() < 0.01


@each
@pytest.mark.parametrize("tolerance", [0.1, 0.003])
def test_triangles_stay_within_their_bound(surface, tolerance):
    result = tessellate(surface, tolerance)
    # Middles of faces and of their edges.
    worst = 0.0
    for weights in ([1 / 3, 1 / 3, 1 / 3], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]):
        at = np.einsum("k,fkc->fc", weights, result.uv)
        there = np.einsum("k,fkc->fc", weights, result.mesh.triangles)
        points = surface.point(at[:, 0], at[:, 1], result.patch_id)
        worst = max(worst, np.linalg.norm(points - there, axis=1).max())
    assert worst <= result.deviation_bound <= tolerance
    assert result.deviation_bound < 2.5 * worst
    whole_and_closed = surface is SURFACES["torus"]
    assert result.mesh.is_watertight == whole_and_closed


@pytest.mark.parametrize(("begin", "end", "outward"), [(1.0, 0.0, 1.0), (0.0, 1.0, -1.0)])
def test_a_ring_has_outward_normals_if_its_circle_begins_at_the_larger_angle(begin, end, outward):
    arcs, weights = circular_arc((0, 2), 0.5, begin, end)
    ring = SurfaceOfRevolution(arcs, (0, 0, 0), (0, 0, 1), weights=weights)
    number = np.arange(len(ring))
    point, normal = ring.point(0.1, 0.5, number), ring.normal(0.1, 0.5, number)
    spine = point * [1, 1, 0]
    spine *= 2.0 / np.linalg.norm(spine, axis=1, keepdims=True)
    np.testing.assert_allclose(np.sum((point - spine) * normal, axis=1), 0.5 * outward, rtol=1e-12)
