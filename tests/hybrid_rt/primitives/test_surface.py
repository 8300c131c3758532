"""Every class of surfaces keeps the one interface, and stands in both registries."""

import numpy as np
import pytest
import trimesh

from hybrid_rt import (
    Asphere,
    Box,
    ClosestPoint,
    Intersector,
    Plane,
    Rectangle,
    Sphere,
    Torus,
    TriangleMesh,
    demo,
)
from hybrid_rt.intersection.kinds.registry import ENTRIES
from hybrid_rt.primitives.box import TurnedBox
from hybrid_rt.primitives.instances import Instances
from meshing import (
    BezierPatches,
    Cone,
    Cylinder,
    Extrusion,
    SurfaceOfRevolution,
    TrimmedSurface,
    tessellate,
)
from meshing.bezier import RationalPatches
from meshing.sheet import PatchSheet
from meshing.surface import Surface
from proof.cases.rational_surfaces import octants, torn_nurbs
from proof.cases.trimmed_surfaces import (
    cut_lens,
    drilled_part,
    drilled_plate,
    trimmed_nurbs,
    trimmed_sheet,
    windowed_ball,
    windowed_torus,
)
from proof.surface import all_judged, judged_of

TURN = np.array([[0, 0, 2, 1], [2, 0, 0, -3], [0, 2, 0, 5], [0, 0, 0, 1]], float)
SKEW = np.array([[-1, 0.6, 0.2, 1], [0, 1, -0.4, 0], [0.3, 0, 1, 2], [0, 0, 0, 1]])
SURFACES = {
    Asphere: Asphere(3, -0.7, [0.02, -0.01, 1e-3], 4, (1, 2, 3), (1, -1, 2), (0, 0, 1)),
    Box: Box((-1, -2, 0), (1, 3, 4)),
    TurnedBox: Box((-1, -2, 0), (1, 3, 4)).transformed(SKEW),
    Plane: Plane((1, 2, 3), (0.1, -2, 0.3)),
    Rectangle: Rectangle((0, 1, 0), (1, 0, 1), (0, 2, 1)),
    Sphere: Sphere((1, 2, 3), 2, pole=(1, 1, 0), meridian=(0, 0, 1)),
    Torus: Torus((1, 2, 3), (1, -1, 2), 2, 0.5, (0, 0, 1)),
    TriangleMesh: TriangleMesh(trimesh.creation.icosphere(1)),
    BezierPatches: demo.teapot(),
    RationalPatches: octants(),
    SurfaceOfRevolution: demo.vase(0.0, 0.0, 5.0),
    Instances: Instances(
        [Torus((1, 2, 3), (1, -1, 2), 2, 0.5), demo.teapot()], [TURN, np.diag([-1.0, 1, 1, 1])]
    ),
}
NAMES = [surface_type.__name__ for surface_type in SURFACES]
each = pytest.mark.parametrize("surface", SURFACES.values(), ids=NAMES)
TRIMMED = (
    cut_lens, drilled_part, drilled_plate, trimmed_nurbs, trimmed_sheet, windowed_ball,
    windowed_torus,
)  # fmt: skip
MADE = {
    "Cone": Cone((0, 0, 0), (0, 0, 1), 1.0, 2.0),
    "Cylinder": Cylinder((0, 0, 0), (0, 0, 1), 1.0, 2.0),
    "Extrusion": Extrusion([(0, 0, 0), (1, 0, 0), (1, 1, 0)], (0, 0, 1)),
    "NurbsSurface": torn_nurbs(),
    **{make.__name__: make() for make in TRIMMED},
}


def some_parameters(surface, n=200):
    rng = np.random.default_rng(3)
    u, v = rng.uniform(0.05, 0.45, (2, n))  # within triangles too
    return u, v, rng.integers(len(surface), size=n)


def test_every_class_that_rays_meet_is_judged_and_tested_here():
    met = {entry.surface for entry in ENTRIES}
    # A sheet is met as the patches that it consists of, a trimmed surface as what it trims; both are
    # judged by themselves.
    assert set(all_judged()) <= met | {PatchSheet, TrimmedSurface}
    assert all(set(surface_type.__mro__) & set(all_judged()) for surface_type in met)
    assert met == set(SURFACES)
    assert all(issubclass(surface_type, Surface) for surface_type in met)


@each
def test_partials_are_derivatives_and_the_normal_lies_along_their_product(surface):
    u, v, patch = some_parameters(surface)
    along_u, along_v = surface.partials(u, v, patch)
    step = 1e-6
    for partial, (du, dv) in ((along_u, (step, 0)), (along_v, (0, step))):
        ends = (surface.point(u + s * du, v + s * dv, patch) for s in (1, -1))
        quotient = np.subtract(*ends) / (2 * step)
        # Central differences: step^2 S_uuu, and 1e-15 of the size over the step.
        np.testing.assert_allclose(partial, quotient, atol=1e-7 * max(surface.size, 1))
    product = np.cross(along_u, along_v)
    product /= np.linalg.norm(product, axis=1, keepdims=True)
    normal = surface.normal(u, v, patch)
    if surface.is_bounded:
        np.testing.assert_allclose(normal, product, atol=1e-9)
    else:  # (u, v) of a plane are coordinates, to either side of which the normal may point
        np.testing.assert_allclose(np.abs(np.einsum("ij,ij->i", normal, product)), 1, atol=1e-9)
    np.testing.assert_allclose(surface.flipped().flipped().normal(u, v, patch), normal, atol=1e-15)


@pytest.mark.parametrize("surface", [*SURFACES.values(), *MADE.values()], ids=[*NAMES, *MADE])
def test_results_have_the_shape_of_the_parameters_and_an_axis_of_three(surface):
    def all_of(u, v, patch):
        return [
            surface.point(u, v, patch),
            surface.normal(u, v, patch),
            *surface.partials(u, v, patch),
        ]

    rng = np.random.default_rng(7)
    u, v = rng.uniform(0.05, 0.45, (2, 2, 3))
    last = len(surface) - 1
    patch = np.array([0, last, last])
    grid, flat = all_of(u, v, patch), all_of(u.ravel(), v.ravel(), np.tile(patch, 2))
    for several, one in zip(grid, flat, strict=True):
        assert several.shape == (2, 3, 3)
        np.testing.assert_array_equal(several.reshape(-1, 3), one)
    for shape, of in (
        ((), (u[1, 2], v[1, 2], last)),
        ((), (0, 0.25, np.int32(last))),
        ((1,), ([0.25], 0.25, 0)),
        ((3,), (0.25, 0.25, patch)),
        ((2, 1), (u[:, :1], 0.25, 0)),
        ((2, 3), (u[:, :1], v[0], patch)),
        ((0,), ([], 0.25, 0)),
        ((2, 0), (np.zeros((2, 0)), 0.25, 0)),
    ):
        assert {x.shape for x in all_of(*of)} == {(*shape, 3)}
    # Products with matrices may round by how many rows there are.
    scale = 1.0 if not surface.is_bounded else surface.reach
    for x, there in zip(all_of(u[1, 2], v[1, 2], last), grid, strict=True):
        np.testing.assert_allclose(x, there[1, 2], rtol=1e-14, atol=1e-14 * max(scale, 1.0))


@pytest.mark.parametrize("surface", [*SURFACES.values(), *MADE.values()], ids=[*NAMES, *MADE])
def test_closest_points_of_its_points_are_these(surface):
    rng = np.random.default_rng(5)
    u, v = rng.uniform(0.05, 0.45, (2, 200))
    patch = rng.integers(0, len(surface), 200)
    if surface.spans is not None:
        a, b, c, d = surface.spans[patch].T
        u, v = a + u * (b - a), c + v * (d - c)
    if isinstance(surface, TrimmedSurface):
        inside = surface.contains(u, v)[0]
        u, v, patch = u[inside], v[inside], patch[inside]
    points = surface.point(u, v, patch)
    found = ClosestPoint(surface).query(points)
    assert (np.abs(found.distance) <= found.bound).all()
    np.testing.assert_allclose(found.position, points, rtol=0, atol=1e-12)
    at = surface.point(found.u, found.v, found.patch_id)
    if surface.is_bounded:
        np.testing.assert_allclose(at, points, rtol=0, atol=1e-12)
    # A little beside it on the side of the normal it is as far, or nearer to another part.
    off = 1e-3 * max(surface.size, 1.0)
    beside = ClosestPoint(surface).query(points + off * surface.normal(u, v, patch))
    assert (np.abs(beside.distance) <= off + beside.bound).all()
    is_own = np.linalg.norm(beside.position - points, axis=1) < 1e-9
    np.testing.assert_allclose(np.abs(beside.distance[is_own]), off, rtol=1e-9)
    assert is_own.mean() > 0.5
    normal = surface.normal(u, v, patch)
    np.testing.assert_allclose(beside.normal[is_own], normal[is_own], atol=1e-7)
    if surface.is_closed and not isinstance(surface, Instances):
        assert (beside.side[is_own] == 1).all()
        inner = ClosestPoint(surface).query(points - off * normal)
        assert (inner.side == -1).all()
        assert (ClosestPoint(surface.flipped()).query(points - off * normal).side == 1).all()


@each
def test_images_keep_their_points_and_parameters(surface):
    u, v, patch = some_parameters(surface)
    image, there = surface.transformed(TURN), surface.point(u, v, patch)
    there = there @ TURN[:3, :3].T + TURN[:3, 3]
    if surface.is_bounded:
        np.testing.assert_allclose(image.point(u, v, patch), there, atol=1e-14 * image.reach)
        low, high = image.bounds
        assert (there >= low - 1e-14).all()
        assert (there <= high + 1e-14).all()
        assert image.size == pytest.approx(2 * surface.size, rel=0.01)  # boxes of patches have air
        assert np.abs(there).max() <= image.reach
    else:
        assert np.abs((there - image.middle) @ image.unit_normal).max() < 1e-14
        assert image.size == 0


@each
def test_points_chosen_by_area_have_the_density_that_is_said(surface):
    sampler = surface.area_sampler()
    if not surface.is_bounded:
        assert sampler is None
        return
    xi = np.random.default_rng(5).random((20_000, 2))
    patch, u, v = sampler.choose(xi)
    density = sampler.pdf_area(patch, u, v)
    # The mean of 1 / density is the area, whatever the density; and every cell is within a few %.
    assert (1 / density).mean() == pytest.approx(sampler.area, rel=0.01)
    assert np.median(density) * sampler.area == pytest.approx(1, rel=0.1)


def test_areas():
    assert SURFACES[Box].area_sampler().area == 2 * (2 * 5 + 2 * 4 + 5 * 4)
    assert SURFACES[Sphere].area_sampler().area == pytest.approx(16 * np.pi, rel=1e-15)
    assert SURFACES[Rectangle].area_sampler().area == pytest.approx(np.sqrt(4 + 1 + 4), rel=1e-15)
    cylinder = SurfaceOfRevolution([(0, 2), (3, 2)], (0, 0, 0), (0, 0, 1))
    assert cylinder.area_sampler().area == pytest.approx(12 * np.pi, rel=1e-12)


@each
def test_free_forms_meshes_and_those_of_known_bend_become_triangles(surface):
    if surface.is_triangular:
        mesh = surface.triangles()
        assert mesh.faces.max() < len(mesh.vertices)
        assert mesh.deviation_bound == 0.0
    else:
        with pytest.raises(TypeError, match=f"{type(surface).__name__} is not made of triangles"):
            surface.triangles()
    if surface.is_freeform or surface.bend is not None:
        mesh = tessellate(surface, 0.01 * surface.size)
        assert mesh.faces.max() < len(mesh.vertices)
        assert mesh.deviation_bound <= 0.01 * surface.size
    else:
        with pytest.raises(TypeError, match="pass BezierPatches, "):
            tessellate(surface, 0.1)


class Ghost(Surface):
    """A surface that nobody has registered."""

    _points = _partials = _normals = transformed = flipped = None
    bounds = np.zeros((2, 3))


def test_what_is_in_no_registry_is_refused():
    with pytest.raises(TypeError, match=r"surfaces\[0\] is of type Ghost: pass surfaces such as"):
        Intersector([Ghost()])
    with pytest.raises(TypeError, match="surface is a Ghost"):
        judged_of(Ghost())


class Moon(Sphere):
    """A class derived from one that is registered is met and judged as that one."""


def test_derived_classes_are_what_they_derive_from():
    hits = Intersector([Moon((0, 0, 0), 1)]).intersect((0, 0, 3), (0, 0, -1))
    assert hits.t[0] == 2.0
    assert judged_of(Moon((0, 0, 0), 1)).surface.radius == 1.0
