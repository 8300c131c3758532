"""First hits at the singular places of patches and meshes: borders, creases, poles, corners, cusps.

Truths are closed forms; tests/proof_tests/cases/test_campaign.py holds the rest to exact arithmetic.
"""

import math
from fractions import Fraction

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Sphere, Status, TriangleMesh
from hybrid_rt.analysis.ray_sets import at_box
from hybrid_rt.demo import teapot
from hybrid_rt.intersection.kernels.patch.evaluate import evaluate
from hybrid_rt.intersection.kernels.patch.nets import restrict
from hybrid_rt.intersection.kernels.patch.solve import rounding_of_root
from hybrid_rt.intersection.kernels.patch.subdivide import normals_of, rounding_of_net
from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from meshing import BezierPatches, tessellate
from proof.cases.campaign import placed_surfaces, trace_cell

EPS = 2.0**-52
LUNE = [[[0, 0, 0], [1, -1, 0], [2, 0, 0]], [[0, 0, 0], [1, 1, 1], [2, 0, 0]]]


def quad(a, b, c, d):
    """Return the net of a flat piece with corners a, b, c, d around it; c = d is a pole."""
    return np.array([[a, d], [b, c]], float)


BORDER = [quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))]
SEAM = [*BORDER, quad((2, 0, 0), (4, 0, 0), (4, 1, 0), (2, 1, 0))]


def mesh_of(nets):
    vertices = np.concatenate([net.reshape(4, 3) for net in nets])
    faces = [[4 * k + i for i in (0, *side)] for k in range(len(nets)) for side in ((2, 3), (3, 1))]
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def test_a_seam_that_goes_on_is_not_tangent():
    """Through the interior of a shared edge only which patch it is is a tie."""
    for make in (BezierPatches, mesh_of):
        rng = np.random.default_rng(5)
        y = rng.uniform(0.05, 0.95, 2000)
        targets = np.stack([np.full(2000, 2.0), y, np.zeros(2000)], axis=1)
        directions = rng.normal(size=(2000, 3)) - (0, 0, 3)
        hits = Intersector([make(SEAM)]).intersect(targets - directions, directions)
        assert (hits.status == Status.HIT).all()
        assert np.abs(hits.t - 1).max() < 1e-13


@pytest.mark.parametrize("offset", [0.0, 30 * EPS, 300 * EPS])
@pytest.mark.parametrize("make", [BezierPatches, mesh_of], ids=["patches", "mesh"])
def test_a_miss_beside_a_border_says_so_with_t_of_infinity(make, offset):
    """The square's scale is sqrt(5): 64 eps x scale are 143 eps."""
    tracer = Intersector([make(BORDER)])
    hits = tracer.intersect((1.0, 1.0 + max(offset, EPS), 1.0), (0, 0, -1))
    assert hits.status[0] == (Status.TANGENT if offset < 143 * EPS else Status.MISS)
    if offset:
        assert math.isinf(hits.t[0])


def test_what_lies_behind_a_border_is_tangent_too():
    """A sphere is hit, but an edge passes in front of it within the band."""
    tracer = Intersector([BezierPatches(BORDER), Sphere((1, 1, -3), 1)])
    hits = tracer.intersect([(1, 1 + 60 * EPS, 1), (1, 1 + 900 * EPS, 1)], (0, 0, -1))
    assert hits.object_id.tolist() == [1, 1]
    assert hits.status.tolist() == [Status.TANGENT, Status.HIT]


def cylinder():
    """z = -x^2 over |x| <= 1, 0 <= y <= 1."""
    return BezierPatches(
        [[[(x, y, z) for y in (0.0, 1.0)] for x, z in ((-1, -1), (0, 1), (1, -1))]]
    )


@pytest.mark.parametrize("depth", [-400, -100, -20, 20, 100, 400])
def test_beside_a_fold_and_under_it(depth):
    """Rays along x at z = -depth eps: the top of the cylinder is z = 0, its scale 3: 192 eps."""
    tracer = Intersector([cylinder()], coarse="none")
    y = np.random.default_rng(6).uniform(0.1, 0.9, 200)
    origins = np.stack([np.full(200, -2.0), y, np.full(200, -depth * EPS)], axis=1)
    hits = tracer.intersect(origins, (1.0, 0.0, 0.0))
    if abs(depth) < 192:
        assert (hits.status == Status.TANGENT).all()
    else:
        assert (hits.status == (Status.HIT if depth > 0 else Status.MISS)).all()
    if depth == 400:
        # x^2 = depth: the root is off by the rounding over twice its distance from the top.
        assert np.abs(hits.t - (2 - math.sqrt(depth * EPS))).max() < 64 * EPS / 1e-7
        assert (np.abs(hits.t - (2 - math.sqrt(depth * EPS))) <= hits.t_bound).all()


class TestLune:
    """Two poles and unequal degrees: S = (2 v, w (2 u - 1), w u) with w = 2 v (1 - v)."""

    @pytest.mark.parametrize(
        ("accuracy", "coarse"),
        [("certified", "embree"), ("certified", "none"), ("refined", "embree"), ("mesh", "embree")],
    )
    @pytest.mark.parametrize("turn", [False, True])
    def test_is_hit_in_its_middle(self, accuracy, coarse, turn):
        surface, move = BezierPatches([LUNE]), np.eye(4)
        if turn:
            move[:3] = [[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, -7]]
        surface = surface.transformed(move)
        origins = np.array([(1, 0, 5.0), (1, 0, -5.0)]) @ move[:3, :3].T + move[:3, 3]
        target = move[:3, :3] @ (1, 0, 0.25) + move[:3, 3]
        hits = Intersector([surface], accuracy, coarse).intersect(origins, target - origins)
        assert (hits.status == Status.HIT).all()
        tolerance = 2e-3 if accuracy == "mesh" else 8 * EPS
        np.testing.assert_allclose(hits.t, 1.0, atol=tolerance)
        np.testing.assert_allclose(hits.u, 0.5, atol=tolerance)
        np.testing.assert_allclose(hits.v, 0.5, atol=tolerance)

    def test_is_tessellated_within_its_tolerance(self):
        mesh = tessellate(BezierPatches([LUNE]), 1e-3)
        assert mesh.deviation_bound <= 1e-3
        x, y, z = mesh.vertices.T
        assert np.abs(2 * z - y - x * (1 - x / 2)).max() < 1e-15

    @pytest.mark.parametrize("end", [0, 2])
    def test_its_poles_are_tips(self, end):
        hits = Intersector([BezierPatches([LUNE])]).intersect((end, -1, 3), (0, 1, -3))
        assert hits.status[0] == Status.TANGENT


def test_tangent_is_rare():
    rays = at_box([teapot()], 50_000, 4)
    hits = Intersector([teapot()], coarse="none").intersect(rays.origins, rays.directions)
    assert (hits.status == Status.TANGENT).mean() < 1e-3


class TestRoundings:
    """The sums of docs/rounding_patches.md against rational arithmetic, line by line."""

    @pytest.mark.parametrize("degrees", [(1, 1), (2, 2), (3, 2), (7, 7), (30, 30)])
    def test_points_are_as_good_as_that(self, degrees):
        m, n = degrees
        rng = np.random.default_rng(m)
        count = 40 if m < 30 else 2
        for trial in range(count):
            net = np.zeros(((m + 1) * (n + 1), 4))
            net[:, :3] = rng.normal(size=(len(net), 3))
            if trial % 2:  # all alike: errors of the weights do not cancel
                net[:, :3] = rng.normal(size=3) * (1 + 1e-3 * rng.normal(size=(len(net), 3)))
            u, v = rng.random(2)
            basis = np.empty((4, max(m, n) + 1))
            found = evaluate(net, 0, m, n, u, v, basis)[:3]
            exact = _point(net, m, n, Fraction(u), Fraction(v))
            gap = math.hypot(*(float(Fraction(a) - b) for a, b in zip(found, exact, strict=True)))
            size = np.linalg.norm(net[:, :3], axis=1).max()
            bound = rounding_of_root(m, n, None, size, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
            assert gap <= bound

    def test_normals_of_the_ray_are_normal_to_three_units(self):
        rng = np.random.default_rng(9)
        directions = rng.normal(size=(300, 3)) * 10.0 ** rng.uniform(-8, 0, (300, 3))
        for direction in directions / np.abs(directions).max(axis=1, keepdims=True):
            length = math.hypot(*direction)
            basis = normals_of(*direction)
            for normal in (basis[:3], basis[3:]):
                dot = sum(Fraction(a) * Fraction(b) for a, b in zip(normal, direction, strict=True))
                assert abs(float(dot)) <= 3 * UNIT_ROUNDOFF * length

    @pytest.mark.parametrize("degrees", [(2, 2), (3, 3), (7, 7)])
    def test_restricted_nets_are_as_good_as_that(self, degrees):
        m, n = degrees
        rng = np.random.default_rng(n)
        for k in range(8):
            net = rng.normal(size=(m + 1, n + 1, 3))
            a, b = (Fraction(k, 8), Fraction(k + 1, 8))
            exact = _restricted([[[Fraction(c) for c in p] for p in row] for row in net], a, b)
            across = np.abs(net).max()
            restrict(net, m, n, float(a), float(b), 0.0, 1.0, None)
            gap = max(
                abs(float(Fraction(net[i, j, c]) - exact[i][j][c]))
                for i in range(m + 1) for j in range(n + 1) for c in range(3)
            )  # fmt: skip
            assert gap <= rounding_of_net(m, n, None, 0.0, 0.0, across)


def _point(net, m, n, u, v):
    total = [Fraction(0)] * 3
    for i in range(m + 1):
        for j in range(n + 1):
            weight = math.comb(m, i) * u**i * (1 - u) ** (m - i)
            weight *= math.comb(n, j) * v**j * (1 - v) ** (n - j)
            point = net[i * (n + 1) + j]
            total = [t + weight * Fraction(float(c)) for t, c in zip(total, point[:3], strict=True)]
    return total


def _restricted(net, a, b):
    """De Casteljau to [a, b] in u, in rational arithmetic."""
    m = len(net) - 1
    for x, order in ((b, 1), (a / b, -1)):
        for level in range(1, m + 1):
            rows = range(m, level - 1, -1) if order == 1 else range(m - level + 1)
            for i in rows:
                low, high = (i - 1, i) if order == 1 else (i, i + 1)
                net[i] = [
                    [(1 - x) * p + x * q for p, q in zip(one, two, strict=True)]
                    for one, two in zip(net[low], net[high], strict=True)
                ]
    return net


def test_a_search_that_is_given_up_says_so_of_all_that_it_leaves():
    """Along a cusp, 5e-8 askew: the nearer sheet was among the pieces that waited."""
    a, b = 1e9 / 3.0, 1e9
    net = [
        [(b, -b, z), (-a, b, z), (-a, -b, z), (b, b, z)] for z in (0.0, b)
    ]  # (t^2, t^3) times b, along z
    tracer = Intersector([BezierPatches([np.swapaxes(net, 0, 1)])], coarse="none", threads=1)
    origin = [float.fromhex(x) for x in (
        "0x1.90e4518f06421p+0", "-0x1.e22f325610e53p+0", "0x1.c6bae5cda85f1p+28",
    )]  # fmt: skip
    direction = [float.fromhex(x) for x in (
        "0x1.d912301432afdp-27", "0x1.b1ee69f0a980ap-25", "-0x1.ffffffffffff3p-1",
    )]  # fmt: skip
    hits = tracer.intersect(origin, direction)
    first = float.fromhex("0x1.1c73ebf648eccp+25")  # by exact arithmetic
    is_right = abs(hits.t[0] - first) <= hits.t_bound[0]
    assert hits.status[0] == Status.TANGENT or is_right


def test_a_ray_along_a_cusp_is_not_lost():
    """It crosses both sheets of a cusp 4e-10 askew; rays 1.3 bands aside cross them as well."""
    words = (
        "0x1.385c59da9900ap-2 -0x1.0975e6a94c4dap-1 0x1.de41209f00a5ep+0 "
        "0x1.3e6a2f209f00ep+0 -0x1.b7f07b89c7374p-1 0x1.eb44cc8b0b7e8p+0 "
        "0x1.8084ca7763365p-2 -0x1.5d295e7cd44a6p-1 -0x1.0ece6589f7ec1p-1 "
        "0x1.50744b47d18e4p+0 -0x1.05d1f9aea799fp+0 -0x1.e98e1b63c475ap-2 "
        "0x1.6a47e340cc058p-1 0x1.e2ccb63d23cb1p-2 0x1.12241fede3eecp+0 "
        "0x1.a5770a4a5ec37p+0 0x1.0baf18f85bf00p-3 0x1.1f27cbd9eec76p+0 "
        "-0x1.baea22f9bd410p-6 -0x1.ac02d022593ecp+0 0x1.12d737b083048p-2 "
        "0x1.d2cee03c23976p-1 -0x1.01a00d494b59cp+1 0x1.46e5e760ae670p-2"
    )
    net = np.array([float.fromhex(word) for word in words.split()]).reshape(4, 2, 3)
    origin = [float.fromhex(x) for x in (
        "0x1.108a463bff5bfp+3", "-0x1.a465d2da2daafp+1", "0x1.d0b665c412e0bp-1",
    )]  # fmt: skip
    direction = [float.fromhex(x) for x in (
        "-0x1.e0a631537fbe5p-1", "0x1.5cf529c2007fep-2", "-0x1.a0757dccc9f6fp-5",
    )]  # fmt: skip
    hits = Intersector([BezierPatches([net])], coarse="none", threads=1).intersect(
        origin, direction
    )
    # By exact arithmetic t is 8.166076916745762, and 8.166077994680448 on the other sheet.
    assert hits.hit[0]
    assert abs(hits.t[0] - 8.166076916745762) <= hits.t_bound[0] or hits.status[0] == Status.TANGENT


@pytest.mark.parametrize("name", ["rational rulings", "open border", "edges of the lid"])
@pytest.mark.parametrize("distance", [1e-9, 1e-13])
def test_bits_do_not_depend_on_which_cells_wait(name, distance):
    tracer = Intersector(placed_surfaces(name, "home"), coarse="none", threads=1)
    cell = trace_cell(tracer, name, distance, "home", 200, 1)
    found = np.flatnonzero(cell.hits.hit)
    origins, directions, hits = cell.origins[found], cell.directions[found], cell.hits[found]
    assert len(found) > 20
    assert not tracer.occluded(origins, directions, t_max=hits.t).any()
    sooner = tracer.intersect(origins, directions, t_max=hits.t * (1.0 + 1e-12))
    for column in ("t", "t_bound", "u", "v", "patch_id"):
        assert np.array_equal(getattr(sooner, column), getattr(hits, column)), column
