"""The catalogue of hard cases, by id, through the public interface."""

import subprocess
import sys

import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere, TriangleMesh
from hybrid_rt.demo import teapot
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.verify.cases.campaign import torus
from hybrid_rt.verify.cases.catalogue import CATALOGUE
from hybrid_rt.verify.cases.rays import chords
from hybrid_rt.verify.judges.judge import compare
from hybrid_rt.verify.judges.oracle import first_hits
from meshing import BezierPatches, SurfaceOfRevolution, tessellate

EPS = 2.0**-52


def extent(surface):
    return np.linalg.norm(surface.bounds[1] - surface.bounds[0])


@pytest.mark.parametrize("coarse", ["embree", "none"])
@pytest.mark.parametrize("case", CATALOGUE, ids=lambda case: case.id)
def test_first_hits(case, coarse):
    surfaces = case.surfaces()
    origins, directions = case.rays(surfaces)
    tracer = Intersector(surfaces, coarse=coarse)
    hits = tracer.intersect(origins, directions)
    assert tracer.counters["most_pieces"] <= case.most_pieces
    assert np.isfinite(hits.normal[hits.hit]).all()
    assert np.allclose(np.linalg.norm(hits.normal[hits.hit], axis=1), 1.0, rtol=1e-14)
    if case.t is None:
        verdict = compare(hits, first_hits(surfaces, origins, directions))
        assert verdict.n_wrong == 0, verdict.rows
        assert tracer.counters["given_up"] == 0
        return
    exact = case.t(origins, directions)
    largest = np.abs(directions).max(axis=1)  # squares of 1e300 overflow
    length = largest * np.linalg.norm(directions / largest[:, None], axis=1)
    sizes = np.array([extent(s) for s in surfaces])
    scale = np.maximum(np.linalg.norm(origins, axis=1), sizes[hits.object_id])
    # Only decisions clear of the band are asked for: TANGENT rows may go either way.
    sure = hits.status != 2
    assert np.array_equal(np.isfinite(exact)[sure], hits.hit[sure])
    both = hits.hit & np.isfinite(exact) & sure
    unit = directions[both] / length[both, None]
    cosine = np.abs(np.einsum("ij,ij->i", hits.normal[both], unit))
    error = np.abs(hits.t[both] - exact[both]) * length[both]
    assert (error <= 64 * EPS * scale[both] / cosine).all()
    if case.most_error is not None:
        way = np.maximum(exact[both] * length[both], 1.0)
        assert (error * cosine <= case.most_error * way).all()
    assert tracer.counters["given_up"] == 0
    assert (hits.status == 2).mean() < 0.2


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a16_control_points_must_be_finite(value):
    net = np.array(teapot().patches[3])
    net[1, 2, 0] = value
    with pytest.raises(ValueError, match=r"finite|nan|inf"):
        BezierPatches([teapot().patches[0], net])
    with pytest.raises(ValueError, match=r"finite|nan|inf"):
        SurfaceOfRevolution([(0.0, 1.0), (value, 2.0)], (0, 0, 0), (0, 0, 1))


@pytest.mark.parametrize("exponent", [-30, 30])
@pytest.mark.parametrize("make", [teapot, torus])
def test_a17_a18_scale(make, exponent):
    surface, factor = make(), 2.0**exponent
    rays = chords([surface], 2000, seed=4)
    scaled = surface.transformed(np.diag([factor, factor, factor, 1.0]))
    a = Intersector([surface]).intersect(rays.origins, rays.directions)
    b = Intersector([scaled]).intersect(rays.origins * factor, rays.directions * factor)
    for name in ("t", "u", "v", "object_id", "patch_id", "status"):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=name in "uv")


@pytest.mark.parametrize("offset", [2.0**20, 2.0**23])
@pytest.mark.parametrize("make", [teapot, torus])
def test_a19_offset(make, offset):
    """A translation by a power of two loses only what the rounding of input loses."""
    surface = make()
    # Figures on a grid that the translation keeps exactly.
    grain = 2.0**-20
    rays = chords([surface], 4000, seed=5)
    origins = np.round(rays.origins / grain) * grain
    move = np.eye(4)
    move[:3, 3] = offset
    moved = surface.transformed(move)
    a = Intersector([surface]).intersect(origins, rays.directions)
    b = Intersector([moved]).intersect(origins + offset, rays.directions)
    assert np.array_equal(a.hit, b.hit)
    rows = a.hit
    cosine = np.abs(np.einsum("ij,ij->i", a.normal[rows], rays.directions[rows]))
    # Control points are rounded at the offset: that far the surface itself has moved.
    length = np.linalg.norm(rays.directions[rows], axis=1)
    moved_by = np.abs(a.t[rows] - b.t[rows]) * cosine
    assert (moved_by <= 4 * EPS * (offset + length)).all()


@pytest.mark.parametrize(
    ("direction", "words"),
    [((0, 0, 0), "length zero"), ((0, np.nan, 1), "finite"), ((np.inf, 0, 0), "finite")],
)
def test_d01_directions_that_are_none_are_refused(direction, words):
    tracer = Intersector([torus()])
    directions = np.tile([0.0, 0.0, 1.0], (9, 1))
    directions[4] = direction
    for ask in (tracer.intersect, tracer.occluded, tracer.intersect_all):
        with pytest.raises(ValueError, match=rf"directions\[4\].*{words}"):
            ask(np.zeros((9, 3)), directions)


@pytest.mark.parametrize("make", [teapot, torus, lambda: Sphere((0.1, 0, 0), 0.7)])
def test_d03_t_counts_lengths_of_the_given_direction(make):
    surface = make()
    rays = chords([surface], 2000, seed=11)
    tracer = Intersector([surface])
    lengths = 2.0 ** np.random.default_rng(2).integers(-40, 40, len(rays.origins))
    a = tracer.intersect(rays.origins, rays.directions)
    b = tracer.intersect(rays.origins, rays.directions * lengths[:, None])
    # Powers of two are exact: so is everything but the unit of t.
    np.testing.assert_array_equal(b.t * lengths, a.t)
    np.testing.assert_array_equal(b.position, a.position)
    limited = tracer.intersect(
        rays.origins, rays.directions * lengths[:, None], t_max=0.5 * np.where(a.hit, b.t, 1.0)
    )
    assert not (limited.hit & (limited.t >= b.t)).any()


def test_d04_batches_of_any_size():
    surfaces = [torus(), Sphere((0, 0, 0), 0.3)]
    rays = chords(surfaces, 40_000, seed=12)
    tracer = Intersector(surfaces, threads=2)
    whole = tracer.intersect(rays.origins, rays.directions)
    nothing = tracer.intersect(np.zeros((0, 3)), np.zeros((0, 3)))
    assert len(nothing) == 0
    assert tracer.occluded(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)
    for size in (1, 999, 16_385):
        cuts = range(0, 3 * size, size)
        for first in cuts:
            rows = slice(first, first + size)
            part = tracer.intersect(rays.origins[rows], rays.directions[rows])
            np.testing.assert_array_equal(part.t, whole.t[rows])
            np.testing.assert_array_equal(part.object_id, whole.object_id[rows])


@pytest.mark.parametrize("lie", ["nothing", "anything"])
def test_e01_e02_the_coarse_stage_only_proposes(lie, monkeypatch):
    surfaces = [teapot(), torus().transformed(np.diag([1.0, 1.0, 1.0, 1.0]))]
    rays = chords(surfaces, 5000, seed=6)
    honest, liar = Intersector(surfaces), Intersector(surfaces)
    rng = np.random.default_rng(7)

    def false(origin, *_):
        n = len(origin)
        if lie == "nothing":
            face = np.full(n, -1, np.int32)
        else:
            face = rng.integers(liar._coarse.n_triangles, size=n).astype(np.int32)
        return CoarseHits(face, 100 * rng.random(n), rng.random(n) / 2, rng.random(n) / 2)

    monkeypatch.setattr(liar._coarse.scene, "first", false)
    a = honest.intersect(rays.origins, rays.directions)
    b = liar.intersect(rays.origins, rays.directions)
    for name in ("t", "u", "v", "object_id", "patch_id", "status"):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=name in "uv")


def test_e03_two_calls_give_the_same():
    tracer = Intersector([teapot()])
    rays = chords([teapot()], 3000, seed=8)
    t_max = np.full(3000, 20.0)
    a = tracer.intersect(rays.origins, rays.directions, t_max=t_max)
    assert (t_max == 20.0).all()
    b = tracer.intersect(rays.origins, rays.directions, t_max=t_max)
    assert np.array_equal(a.t, b.t)


def test_e04_closed_forms_need_neither_embree_nor_trimesh_nor_scipy():
    script = (
        "import sys\n"
        "for name in ('embreex', 'trimesh', 'scipy'): sys.modules[name] = None\n"
        "from hybrid_rt import Intersector, Sphere, Rectangle, Box, Plane\n"
        "tracer = Intersector([Sphere((0, 0, 0), 1), Plane((0, 0, -2), (0, 0, 1))])\n"
        "assert tracer.intersect((0, 0, 5), (0, 0, -1)).t[0] == 4.0\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True, timeout=120)


def test_e06_order_of_rays_changes_nothing():
    tracer = Intersector([torus(), Sphere((0, 0, 0), 0.3)])
    rays = chords(tracer.surfaces, 5000, seed=9)
    order = np.random.default_rng(1).permutation(5000)
    a = tracer.intersect(rays.origins, rays.directions)[order]
    b = tracer.intersect(rays.origins[order], rays.directions[order])
    assert np.array_equal(a.t, b.t)
    assert np.array_equal(a.object_id, b.object_id)


@pytest.mark.parametrize("tolerance", [0.0, -1.0, np.nan])
def test_e07_tolerance_must_be_positive(tolerance):
    with pytest.raises(ValueError, match="tolerance"):
        tessellate(torus(), tolerance)


def test_e08_triangles_are_counted_before_memory_is_used():
    with pytest.raises((ValueError, MemoryError), match=r"triangles|memory"):
        tessellate(teapot(), 1e-14)


def test_e09_arrays_of_any_layout():
    tracer = Intersector([torus()])
    rays = chords([torus()], 500, seed=3)
    fortran = np.asfortranarray(rays.origins), np.asfortranarray(rays.directions)
    strided = np.repeat(rays.origins, 2, axis=0)[::2], np.repeat(rays.directions, 2, axis=0)[::2]
    frozen = rays.origins.copy(), rays.directions.copy()
    for array in frozen:
        array.flags.writeable = False
    expected = tracer.intersect(rays.origins, rays.directions).t
    for origins, directions in (fortran, strided, frozen):
        assert np.array_equal(tracer.intersect(origins, directions).t, expected)


def test_meshes_have_an_object_of_their_own():
    mesh = TriangleMesh(tessellate(torus(), 1e-2).mesh)
    assert Intersector([mesh]).intersect((0, 0, 5), (0, 0, -1)).object_id.shape == (1,)
