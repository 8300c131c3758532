"""Hard cases of geometry that closed forms, identities and refusals decide, by id."""

import multiprocessing

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Rectangle, Sphere, TriangleMesh
from hybrid_rt.core.records import Flag, Status
from hybrid_rt.demo import teapot
from hybrid_rt.verify.cases.rays import chords
from hybrid_rt.verify.judges.oracle import first_hits
from meshing import BezierPatches, SurfaceOfRevolution

AXIS = (0, 0, 1)
ORIGIN = (0, 0, 0)
BOTH = pytest.mark.parametrize("coarse", ["embree", "none"])


def square(z=0.0, low=-1.0, high=1.0, degree=3):
    """Return the net of a flat square patch."""
    line = np.linspace(low, high, degree + 1)
    x, y = np.meshgrid(line, line, indexing="ij")
    return np.stack([x, y, np.full_like(x, z)], axis=-1)


class TestPatches:
    @pytest.mark.parametrize("shape", [(1, 1, 4, 3), (1, 4, 1, 3)])
    def test_a07_a_curve_is_no_surface(self, shape):
        with pytest.raises(ValueError, match=r"degree 0 in .*would make it a curve"):
            BezierPatches(np.random.default_rng(1).random(shape))

    @pytest.mark.parametrize("net", [np.ones((4, 4, 3)), square()[:, :1].repeat(4, axis=1)])
    def test_a09_patches_without_area_are_refused(self, net):
        with pytest.raises(ValueError, match="patch 1 has no area"):
            BezierPatches([square(), net])

    @BOTH
    def test_a14_no_crack_at_a_t_junction(self, coarse):
        """One patch, its neighbour in two halves: rays at and beside the point where they meet."""
        whole = square()
        upper, lower = square(), square()
        upper[..., 0], lower[..., 0] = 2 + square()[..., 0], 2 + square()[..., 0]
        upper[..., 1] = 0.5 + 0.5 * square()[..., 1]
        lower[..., 1] = -0.5 + 0.5 * square()[..., 1]
        tracer = Intersector([BezierPatches([whole, upper, lower])], coarse=coarse)
        rng = np.random.default_rng(2)
        y = np.concatenate([np.zeros(500), rng.uniform(-0.99, 0.99, 2500)])
        x = 1 + np.concatenate([np.zeros(1500), rng.normal(0, 1e-15, 1500)])
        targets = np.column_stack([x, y, np.zeros(3000)])
        directions = rng.normal(size=(3000, 3)) - (0, 0, 3)
        hits = tracer.intersect(targets - directions, directions)
        assert hits.hit.all()
        assert np.abs(hits.t - 1).max() < 1e-14

    @BOTH
    def test_a24_origins_within_boxes_of_pieces(self, coarse):
        """A steep sheet z = 4 x y fills its box; rays start inside, on either side of it."""
        x, y = np.meshgrid([-1.0, 1.0], [-1.0, 1.0], indexing="ij")
        saddle = BezierPatches([np.stack([x, y, 4 * x * y], axis=-1)])
        rng = np.random.default_rng(3)
        origins = rng.uniform((-0.9, -0.9, -3), (0.9, 0.9, 3), (2000, 3))
        hits = Intersector([saddle], coarse=coarse).intersect(origins, (0, 0, 1))
        above = 4 * origins[:, 0] * origins[:, 1] - origins[:, 2]
        clear = np.abs(above) > 1e-12
        assert np.array_equal(hits.hit[clear], above[clear] > 0)
        np.testing.assert_allclose(hits.t[hits.hit], above[hits.hit], atol=1e-14)

    @BOTH
    @pytest.mark.parametrize("factor", [1 - 1e-12, 1 - 4e-16, 1.0, 1 + 4e-16, 1 + 1e-12])
    def test_a26_a_hit_lies_strictly_within_the_range(self, coarse, factor):
        tracer = Intersector([BezierPatches([square()])], coarse=coarse)
        ray = (0.1, 0.2, 3.0), (0, 0, -1)
        assert tracer.occluded(*ray, 3.0 * factor)[0] == (factor > 1)
        assert tracer.intersect(*ray, t_max=3.0 * factor).hit[0] == (factor > 1)
        assert tracer.intersect(*ray, t_min=3.0 * factor).hit[0] == (factor < 1)

    def test_a29_thousands_of_patches_in_one_place(self):
        """Squares at heights 1e-3 apart, all over each other; the topmost is met first."""
        heights = np.random.default_rng(4).permutation(5000) * 1e-3
        nets = np.stack([square(z) for z in heights])
        tracer = Intersector([BezierPatches(nets)], coarse="none")
        origins = np.random.default_rng(5).uniform((-0.9, -0.9, 6), (0.9, 0.9, 7), (500, 3))
        hits = tracer.intersect(origins, (0.0, 0.0, -1.0))
        assert (hits.patch_id == heights.argmax()).all()
        np.testing.assert_allclose(hits.t, origins[:, 2] - heights.max(), rtol=1e-15)
        # Front to back, nothing behind the first one is solved.
        assert tracer.counters["newton_solves"] < 3 * 500

    @pytest.mark.parametrize("shape", [(4, 4, 3), (4, 3), (1, 4, 4, 2), (1, 4, 4, 4)])
    def test_a32_nets_of_other_shapes_are_refused(self, shape):
        with pytest.raises(ValueError, match=r"control has shape"):
            BezierPatches(np.zeros(shape))

    @pytest.mark.parametrize("dtype", [np.float32, np.int64])
    def test_a32_other_types_become_float64(self, dtype):
        net = np.round(4 * square()).astype(dtype)
        surface = BezierPatches([net, square(2.0, degree=2)])
        assert surface.control.dtype == np.float64
        assert np.array_equal(surface.patches[0], net)


class TestRevolutions:
    def test_b06_a_ray_that_is_the_axis(self):
        """Both poles of a lens, met from outside, from inside, and upside down."""
        lens = SurfaceOfRevolution(
            [[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (2, 1), (2, 0)]], ORIGIN, AXIS
        )
        hits = Intersector([lens]).intersect(
            [(0, 0, -5), (0, 0, 0), (0, 0, 7)], [(0, 0, 1), (0, 0, 2), (0, 0, -1)]
        )
        assert hits.t.tolist() == [4.0, 1.0, 5.0]
        assert hits.normal.tolist() == [[0, 0, -1], [0, 0, 1], [0, 0, 1]]

    def test_b07_the_tip_of_a_cone_is_flagged(self):
        cone = SurfaceOfRevolution([(0, 1), (2, 0)], ORIGIN, AXIS)
        hits = Intersector([cone]).intersect([(0, 0, 9)], [(0, 0, -1)])
        assert hits.t[0] == 7.0
        assert np.isfinite(hits.normal).all()
        assert hits.flags[0] & Flag.NORMAL_DEGENERATE

    @pytest.mark.parametrize("profile", [[(0, -1), (2, 1)], [(0, -1), (2, -1)]])
    def test_b08_negative_radii_are_refused(self, profile):
        with pytest.raises(ValueError, match=r"reaches radius -1: cut it where it meets the axis"):
            SurfaceOfRevolution(profile, ORIGIN, AXIS)

    def test_b09_a_part_on_the_axis_is_nothing(self):
        cones = [[(0, 1), (1, 0)], [(2, 0), (3, 1)]]
        with_line = SurfaceOfRevolution([cones[0], [(1, 0), (2, 0)], cones[1]], ORIGIN, AXIS)
        without = [SurfaceOfRevolution([cone], ORIGIN, AXIS) for cone in cones]
        rng = np.random.default_rng(6)
        targets = rng.uniform((-1, -1, 0), (1, 1, 3), (5000, 3))
        targets[:1000, :2] = 0.0  # at the axis
        origins = rng.normal(size=(5000, 3)) * 4
        a = Intersector([with_line]).intersect(origins, targets - origins)
        b = Intersector(without).intersect(origins, targets - origins)
        assert np.array_equal(a.hit, b.hit)
        np.testing.assert_allclose(a.t[a.hit], b.t[b.hit], rtol=1e-13)
        assert not Intersector([with_line]).intersect((0, 5, 1.5), (0, -1, 0)).hit[0]

    def test_b11_an_open_profile_is_a_sheet(self):
        """Through the mouth of a cup onto the inside of its wall."""
        cup = SurfaceOfRevolution([(0, 1), (3, 1)], ORIGIN, AXIS)
        hits = Intersector([cup]).intersect([(0, 0, 5)], [(0.5, 0, -2)])
        assert hits.t[0] == pytest.approx(2.0, rel=1e-15)
        assert not hits.front_face[0]

    def test_b12_a_closed_profile_is_left_as_often_as_entered(self):
        k = 0.5522847498307936
        circle = [(0, 1), (k, 1), (1, k), (1, 0), (1, -k), (k, -1), (0, -1), (-k, -1), (-1, -k),
                  (-1, 0), (-1, k), (-k, 1), (0, 1)]  # fmt: skip
        arcs = [[(z, 2 + r) for z, r in circle[j : j + 4]] for j in (0, 3, 6, 9)]
        torus = SurfaceOfRevolution(arcs, ORIGIN, (0.2, 0.1, 1))
        rays = chords([torus], 3000, seed=7)
        away = 20.0 * rays.directions
        found = Intersector([torus]).intersect_all(rays.origins - away, rays.directions)
        touched = np.unique(found.ray[found.hits.status == Status.TANGENT])
        odd = np.flatnonzero(found.count % 2)
        assert np.isin(odd, touched).all()

    def test_b15_the_seam_keeps_u_below_one(self):
        vase = SurfaceOfRevolution([(0, 1), (1, 2), (2, 1)], ORIGIN, AXIS, reference=(1, 0, 0))
        angle = np.concatenate([[0.0, -0.0], *[[e, -e] for e in (1e-300, 1e-17, 1e-9)]])
        directions = np.column_stack([-np.cos(angle), -np.sin(angle), np.zeros(len(angle))])
        hits = Intersector([vase]).intersect(-5 * directions + (0, 0, 1), directions)
        assert hits.hit.all()
        assert ((hits.u >= 0) & (hits.u < 1)).all()
        turned = np.abs(hits.u - np.round(hits.u)) * 2 * np.pi
        np.testing.assert_allclose(turned, np.abs(angle), atol=1e-15)

    def test_b17_a_profile_of_degree_30_is_that_of_degree_3(self):
        def elevated(points, degree):
            points = np.asarray(points, float)
            while len(points) <= degree:
                n = len(points)
                share = np.arange(n + 1)[:, None] / n
                ends = np.vstack([points, points[-1:]]), np.vstack([points[:1], points])
                points = (1 - share) * ends[0] + share * ends[1]
            return points

        profile = [(0, 1), (1, 2.5), (2, -0.4), (3, 0.8)]
        low = SurfaceOfRevolution(profile, ORIGIN, AXIS)
        high = SurfaceOfRevolution(elevated(profile, 30), ORIGIN, AXIS)
        rays = chords([low], 3000, seed=8)
        a = Intersector([low]).intersect(rays.origins, rays.directions)
        b = Intersector([high]).intersect(rays.origins, rays.directions)
        clear = (a.status != Status.TANGENT) & (b.status != Status.TANGENT)
        assert np.array_equal(a.hit[clear], b.hit[clear])
        both = clear & a.hit & b.hit
        cosine = np.abs(np.einsum("ij,ij->i", a.normal, rays.directions))[both]
        # The raised points are rounded some 30 times: 1e-14 across the ray.
        assert (np.abs(a.t[both] - b.t[both]) * cosine).max() < 1e-13

    def test_b19_axes_of_any_length_but_zero(self):
        with pytest.raises(ValueError, match="axis is the zero vector"):
            SurfaceOfRevolution([(0, 1), (1, 1)], ORIGIN, (0, 0, 0))
        for length in (1e-200, 1.0, 1e200):
            tube = SurfaceOfRevolution([(0, 1), (1, 1)], ORIGIN, (0, 0, length))
            assert Intersector([tube]).intersect((5, 0, 0.5), (-1, 0, 0)).t[0] == 4.0


class TestSpheres:
    @pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
    def test_c04_c05_c06_radii_must_be_lengths(self, radius):
        with pytest.raises(ValueError, match=r"radius is .*pass a finite number above 0"):
            Sphere(ORIGIN, radius)

    def test_c07_c08_rays_from_the_sphere_and_from_inside(self):
        rng = np.random.default_rng(9)
        sphere = Sphere((0.3, -0.2, 0.5), 0.7)
        tracer = Intersector([sphere])
        start = tracer.intersect(rng.normal(size=(20_000, 3)) * 3, sphere.center - 0.0)
        start = start[start.hit]
        directions = rng.normal(size=(len(start), 3))
        hits = tracer.intersect(start.position, directions, source=start)
        away = start.position - sphere.center
        other = -2 * np.einsum("ij,ij->i", away, directions) / (directions**2).sum(axis=1)
        clear = np.abs(other) > 1e-12
        assert np.array_equal(hits.hit[clear], other[clear] > 0)
        np.testing.assert_allclose(hits.t[hits.hit], other[hits.hit], atol=1e-12)
        inside = tracer.intersect(np.tile(sphere.center, (3, 1)), np.eye(3))
        np.testing.assert_allclose(inside.t, 0.7, rtol=1e-15)
        assert not inside.front_face.any()

    @pytest.mark.parametrize("beside", [0.0, 1e-16, -1e-16, 1e-9, -1e-9])
    def test_c09_a_tangent_ray_is_hit_or_miss_but_never_nan(self, beside):
        hits = Intersector([Sphere(ORIGIN, 1)]).intersect((1 + beside, 0, -5), (0, 0, 1))
        if abs(beside) > 1e-12:
            assert hits.hit[0] == (beside < 0)
            assert hits.status[0] != Status.TANGENT
        else:
            assert hits.status[0] == Status.TANGENT
            assert np.isinf(hits.t[0]) or abs(hits.t[0] - 5) < 1e-7
            assert not np.isnan(hits.t[0])

    def test_c11_of_coincident_spheres_the_first_is_hit(self):
        spheres = [Sphere(ORIGIN, 1), Sphere(ORIGIN, 1), Sphere(ORIGIN, 1)]
        d = np.random.default_rng(10).normal(size=(5000, 3))
        hits = Intersector(spheres).intersect(-5 * d, d)
        assert (hits.object_id == 0).all()

    def test_c13_ten_thousand_spheres_cost_little_more_than_ten(self):
        """By counts of work, not by the clock: each ray asks a few nodes of a tree."""
        rng = np.random.default_rng(11)
        tracer = Intersector([Sphere(c, 0.003) for c in rng.random((10_000, 3))])
        tracer.intersect(rng.random((1000, 3)) * 3 - 1, rng.normal(size=(1000, 3)))
        assert tracer.counters["nodes"] < 60 * 1000


def test_a12_c11_of_coincident_patches_the_lower_object_is_hit():
    flat = [
        BezierPatches([square()]),
        BezierPatches([square()]),
        Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0)),
    ]
    targets = np.random.default_rng(12).uniform((-0.9, -0.9, 0), (0.9, 0.9, 0), (500, 3))
    up = np.array([0.0, 0.0, 3.0])
    for order in ((0, 1, 2), (2, 1, 0)):
        hits = Intersector([flat[k] for k in order]).intersect(targets + up, (0, 0, -1))
        assert hits.t.tolist() == [3.0] * 500
        assert (hits.object_id == 0).all()


def _hits_in_a_child(queue):
    rays = chords([teapot()], 2000, seed=13)
    hits = Intersector([teapot()], threads=2).intersect(rays.origins, rays.directions)
    queue.put((hits.t, hits.u))


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_e05_processes_and_threads_change_no_bit(method):
    rays = chords([teapot()], 2000, seed=13)
    expected = Intersector([teapot()], threads=1).intersect(rays.origins, rays.directions)
    context = multiprocessing.get_context(method)
    queue = context.Queue()
    child = context.Process(target=_hits_in_a_child, args=(queue,))
    child.start()
    t, u = queue.get(timeout=120)
    child.join(timeout=60)
    assert child.exitcode == 0
    assert np.array_equal(t, expected.t)
    assert np.array_equal(u, expected.u, equal_nan=True)


def test_a30_one_patch_by_the_oracle():
    net = square()
    net[1:3, 1:3, 2] = 1.0
    surface = BezierPatches([net])
    rays = chords([surface], 1000, seed=14)
    hits = Intersector([surface], coarse="none").intersect(rays.origins, rays.directions)
    truth = first_hits([surface], rays.origins, rays.directions)
    clear = ~truth.ambiguous & ~truth.undecided
    assert np.array_equal(hits.hit[clear], np.isfinite(truth.t[clear]))


@pytest.mark.parametrize(
    "surface",
    [Sphere(ORIGIN, 1e61), Sphere(ORIGIN, 1e-61), Sphere((1e61, 0, 0), 1.0)],
)
def test_sizes_whose_squares_are_no_numbers_are_refused(surface):
    with pytest.raises(ValueError, match=r"surfaces\[1\] reaches .* scale the scene"):
        Intersector([Sphere(ORIGIN, 1), surface])


@BOTH
@pytest.mark.parametrize("size", [1e-58, 1e-30, 1e30, 1e58])
def test_sizes_at_the_ends_of_the_range(coarse, size):
    patch = BezierPatches([size * square()])
    ball = trimesh.creation.icosphere(2)
    mesh = TriangleMesh(trimesh.Trimesh(size * ball.vertices, ball.faces, process=False))
    ray = (np.array([0.1, 0.2, 9.0]) * size, (0, 0, -1))
    assert Intersector([patch], coarse=coarse).intersect(*ray).t[0] == pytest.approx(9 * size)
    assert Intersector([Sphere(ORIGIN, size)]).intersect(*ray).hit[0]
    assert Intersector([mesh]).intersect(*ray).hit[0]
