"""First hits at the singular places of patches and meshes: borders, creases, poles, corners, cusps.

Truth is plane geometry in 80 bits, whose roundings are 2**-11 of ours: does the answer change when
the ray moves by 64 eps x scale? Curved surfaces have closed forms.
"""

import math
from fractions import Fraction
from functools import cache

import numpy as np
import pytest
import trimesh

from hybrid_rt import Intersector, Sphere, Status, TriangleMesh
from hybrid_rt.analysis.ray_sets import at_box, unit
from hybrid_rt.demo import teapot
from hybrid_rt.intersection.kernels.patch.evaluate import evaluate
from hybrid_rt.intersection.kernels.patch.nets import restrict
from hybrid_rt.intersection.kernels.patch.solve import rounding_of_root
from hybrid_rt.intersection.kernels.patch.subdivide import normals_of, rounding_of_net
from hybrid_rt.intersection.kernels.search.tolerances import UNIT_ROUNDOFF
from meshing import BezierPatches, tessellate
from proof.cases.campaign import placed_surfaces, trace_cell
from proof.cases.singular_rays import interior
from proof.stability.rows_poles import work_of

Wide = np.longdouble
EPS = 2.0**-52
BAND = 64 * EPS
LUNE = [[[0, 0, 0], [1, -1, 0], [2, 0, 0]], [[0, 0, 0], [1, 1, 1], [2, 0, 0]]]


def quad(a, b, c, d):
    """Return the net of a flat piece with corners a, b, c, d around it; c = d is a pole."""
    return np.array([[a, d], [b, c]], float)


def cube():
    v = [(x, y, z) for x in (0, 1) for y in (0, 1) for z in (0, 1)]
    around = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return [quad(*(v[k] for k in face)) for face in around]


def pyramid(height):
    base, tip = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0)], (1, 1, height)
    return [quad(base[k], base[(k + 1) % 4], tip, tip) for k in range(4)]


FLAT = {
    "border": [quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0))],
    "seam": [
        quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)),
        quad((2, 0, 0), (4, 0, 0), (4, 1, 0), (2, 1, 0)),
    ],
    "crease": [
        quad((0, 0, 0), (2, 0, 0), (2, 1, 1.5), (0, 1, 1.5)),
        quad((0, 1, 1.5), (2, 1, 1.5), (2, 3, 0), (0, 3, 0)),
    ],
    "t-junction": [
        quad((0, 0, 0), (2, 0, 0), (2, 1, 0), (0, 1, 0)),
        quad((0, 1, 0), (1, 1, 0), (1, 2, 0.5), (0, 2, 0.5)),
        quad((1, 1, 0), (2, 1, 0), (2, 2, 0.5), (1, 2, 0.5)),
    ],
    "pole": pyramid(2),
    "spike": pyramid(16),
    "cube": cube(),
}


def polygons(nets):
    """Return the corners of each flat piece, each once, in 80 bits."""
    rings = []
    for net in nets:
        ring = []
        for corner in (net[0][0], net[1][0], net[1][1], net[0][1]):
            if not any(np.array_equal(corner, other) for other in ring):
                ring.append(corner)
        rings.append(np.array(ring, Wide))
    return rings


def mesh_of(nets):
    vertices, faces = [], []
    for ring in polygons(nets):
        n = len(vertices)
        vertices += list(ring.astype(float))
        faces += [[n, n + k, n + k + 1] for k in range(1, len(ring) - 1)]
    return TriangleMesh(trimesh.Trimesh(np.array(vertices), np.array(faces), process=False))


def norm(vectors):
    return np.sqrt((vectors * vectors).sum(axis=1))


def first(rings, origins, directions, slack):
    """Return t and |cos| of the first piece met; pieces count ``slack`` (n,) beyond their sides."""
    t = np.full(len(origins), np.inf, Wide)
    cosine = np.ones(len(origins), Wide)
    for ring in rings:
        normal = np.cross(ring[1] - ring[0], ring[2] - ring[0])
        slope = directions @ normal
        with np.errstate(divide="ignore", invalid="ignore"):
            here = ((ring[0] - origins) @ normal) / slope
        left, right = np.ones(len(origins), bool), np.ones(len(origins), bool)
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            volume = (np.cross(a - origins, b - origins) * directions).sum(axis=1)
            room = slack * np.sqrt(((b - a) ** 2).sum())
            left &= volume >= -room
            right &= volume <= room
        met = (left | right) & (slope != 0) & (here > 0) & (here < t)
        t = np.where(met, here, t)
        cosine = np.where(met, np.abs(slope) / np.sqrt((normal**2).sum()), cosine)
    return t, cosine


def passing(rings, origins, directions, reach, before):
    """Tell which rays pass a side of a piece within ``reach`` at a t below ``before``."""
    found = np.zeros(len(origins), bool)
    for ring in rings:
        for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True):
            side, w = b - a, a - origins
            along, at = directions @ side, (w * directions).sum(axis=1)
            flat, bent = side - along[:, None] * directions, w - at[:, None] * directions
            square = (flat * flat).sum(axis=1)
            with np.errstate(divide="ignore", invalid="ignore"):
                s = np.where(square > 0, -(flat * bent).sum(axis=1) / square, 0)
            for place in (np.clip(s, 0, 1), np.zeros_like(s), np.ones_like(s)):
                gap = norm(bent + place[:, None] * flat)
                t = at + place * along
                found |= (gap <= reach) & (t > 0) & (t < before)
    return found


def changes(rings, origins, directions, scale):
    """Tell where the answer changes within 0.9 bands, and where not within 4; and the answer."""
    o, d = origins.astype(Wide), directions.astype(Wide)
    middle = np.concatenate(rings).mean(axis=0)
    # From nearby, so that 80 bits suffice for far origins.
    begin = np.maximum(((middle - o) * d).sum(axis=1) - 40, 0)
    o = o + begin[:, None] * d
    band = BAND * scale.astype(Wide)
    t, cosine = first(rings, o, d, 1e-5 * band)
    e = np.cross(d, np.eye(3)[np.abs(directions).argmin(axis=1)])
    e = e / norm(e)[:, None]
    f = np.cross(d, e)
    sums = []
    for bands in (0.9, 2.0, 4.0):
        moved = passing(rings, o, d, bands * band, t - 8 * bands * band / cosine)
        for turn in np.arange(32) * (np.pi / 16):
            aside = (bands * band)[:, None] * (np.cos(turn) * e + np.sin(turn) * f)
            s, other = first(rings, o + aside, d, 0.01 * band)
            with np.errstate(invalid="ignore"):
                same = np.abs(s - t) <= 2 * bands * band * (1 / cosine + 1 / other)
            moved |= ~(same | (np.isinf(s) & np.isinf(t)))
        sums.append(moved)
    return t + begin, cosine, sums[0], ~(sums[0] | sums[1] | sums[2])


def aimed(rings, n, seed, is_far):
    """Rays at sides and corners, on them and up to 1e-11 of the scale beside."""
    rng = np.random.default_rng(seed)
    points = np.concatenate(rings).astype(float)
    size = np.linalg.norm(np.ptp(points, axis=0))
    ends = [
        (a, b)
        for ring in rings
        for a, b in zip(ring.astype(float), np.roll(ring, -1, axis=0).astype(float), strict=True)
    ]
    ends = np.array(ends)[rng.integers(len(ends), size=n)]
    s = np.where(rng.random(n) < 0.6, rng.random(n), rng.integers(2, size=n))[:, None]
    target = ends[:, 0] + s * (ends[:, 1] - ends[:, 0])
    directions = rng.normal(size=(n, 3))
    directions /= norm(directions)[:, None]
    across = np.cross(directions, rng.normal(size=(n, 3)))
    square = np.cross(directions, ends[:, 1] - ends[:, 0])
    across = np.where((rng.random(n) < 0.5)[:, None], square, across)
    across /= norm(across)[:, None]
    back = size * 10.0 ** (rng.uniform(1, 5, n) if is_far else rng.uniform(-0.5, 1, n))
    offset = np.where(rng.random(n) < 0.2, 0.0, 10.0 ** rng.uniform(-17, -11, n))
    offset *= np.maximum(back, size) * rng.choice([-1.0, 1.0], n)
    origins = target - back[:, None] * directions + offset[:, None] * across
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return origins, directions, np.maximum(norm(origins - middle), size)


@cache
def judged(name, is_far):
    """Return rays at the edges of a flat surface, and what `changes` says of them."""
    rings = polygons(FLAT[name])
    origins, directions, scale = aimed(rings, 500, 3, is_far)
    return origins, directions, changes(rings, origins, directions, scale)


@pytest.mark.parametrize("is_far", [False, True], ids=["near", "far"])
@pytest.mark.parametrize("make", [BezierPatches, mesh_of], ids=["patches", "mesh"])
@pytest.mark.parametrize("name", FLAT)
def test_tangent_is_said_within_the_band_and_only_there(name, make, is_far):
    origins, directions, (t, cosine, within, clear) = judged(name, is_far)
    assert within.sum() > 100
    assert clear.sum() > 100
    hits = Intersector([make(FLAT[name])], coarse="none").intersect(origins, directions)
    tangent = hits.status == Status.TANGENT
    # The circle has 32 directions, and a ray that begins within the band of a piece is a matter of
    # t_min: a ray in a hundred may differ.
    assert (within & ~tangent).sum() <= 5
    assert (clear & tangent & (cosine > 1e-6)).sum() <= 5
    sure = clear & ~tangent
    assert np.array_equal(hits.hit[sure], np.isfinite(t[sure].astype(float)))
    both = sure & hits.hit
    error = np.abs(hits.t[both] - t[both]).astype(float)
    assert (error <= hits.t_bound[both] + 0.5 * np.spacing(hits.t[both])).all()


def test_a_seam_that_goes_on_is_not_tangent():
    """Through the interior of a shared edge only which patch it is is a tie."""
    for make in (BezierPatches, mesh_of):
        rng = np.random.default_rng(5)
        y = rng.uniform(0.05, 0.95, 2000)
        targets = np.stack([np.full(2000, 2.0), y, np.zeros(2000)], axis=1)
        directions = rng.normal(size=(2000, 3)) - (0, 0, 3)
        hits = Intersector([make(FLAT["seam"])]).intersect(targets - directions, directions)
        assert (hits.status == Status.HIT).all()
        assert np.abs(hits.t - 1).max() < 1e-13


@pytest.mark.parametrize("coarse", ["embree", "none"])
def test_embree_changes_no_status(coarse):
    rings = polygons(FLAT["pole"])
    origins, directions, _ = aimed(rings, 2000, 8, False)
    surface = BezierPatches(FLAT["pole"])
    a = Intersector([surface], coarse="none").intersect(origins, directions)
    b = Intersector([surface], coarse=coarse, threads=2).intersect(origins, directions)
    for name in ("t", "u", "v", "patch_id", "status", "t_bound"):
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=name in "uv"), name


@pytest.mark.parametrize("offset", [0.0, 30 * EPS, 300 * EPS])
@pytest.mark.parametrize("make", [BezierPatches, mesh_of], ids=["patches", "mesh"])
def test_a_miss_beside_a_border_says_so_with_t_of_infinity(make, offset):
    """The square's scale is sqrt(5): 64 eps x scale are 143 eps."""
    tracer = Intersector([make(FLAT["border"])])
    hits = tracer.intersect((1.0, 1.0 + max(offset, EPS), 1.0), (0, 0, -1))
    assert hits.status[0] == (Status.TANGENT if offset < 143 * EPS else Status.MISS)
    if offset:
        assert math.isinf(hits.t[0])


def test_what_lies_behind_a_border_is_tangent_too():
    """A sphere is hit, but an edge passes in front of it within the band."""
    tracer = Intersector([BezierPatches(FLAT["border"]), Sphere((1, 1, -3), 1)])
    hits = tracer.intersect([(1, 1 + 60 * EPS, 1), (1, 1 + 900 * EPS, 1)], (0, 0, -1))
    assert hits.object_id.tolist() == [1, 1]
    assert hits.status.tolist() == [Status.TANGENT, Status.HIT]


def cylinder():
    """z = -x^2 over |x| <= 1, 0 <= y <= 1."""
    return BezierPatches(
        [[[(x, y, z) for y in (0.0, 1.0)] for x, z in ((-1, -1), (0, 1), (1, -1))]]
    )


def cusp():
    """Return the curve (s^2, s^3), |s| <= 1, drawn along y."""
    bends = ((1, -1), (-1 / 3, 1), (-1 / 3, -1), (1, 1))
    return BezierPatches([[[(a, y, b) for y in (0.0, 1.0)] for a, b in bends]])


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


@pytest.mark.parametrize("offset", [-1000, -60, 60, 1000])
def test_a_cusp_inside_a_patch(offset):
    """Rays along z at x = offset eps meet (s^2, s^3) at s = +-sqrt(x); its scale is sqrt(6)."""
    tracer = Intersector([cusp()], coarse="none")
    x = offset * EPS
    hits = tracer.intersect((x, 0.5, 2.0), (0.0, 0.0, -1.0))
    if abs(offset) < 100:
        assert hits.status[0] == Status.TANGENT
        return
    assert hits.status[0] == (Status.HIT if offset > 0 else Status.MISS)
    if offset > 0:
        assert abs(hits.t[0] - (2 - x * math.sqrt(x))) <= hits.t_bound[0]


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

    def test_roots_are_those_of_a_quadratic(self):
        rng = np.random.default_rng(7)
        u, v = rng.uniform(0.1, 0.9, (2, 2000))
        w = 2 * v * (1 - v)
        target = np.stack([2 * v, w * (2 * u - 1), w * u], axis=1)
        directions = rng.normal(size=(2000, 3))
        origins = target - 3 * directions
        # 2 z - y = w and v = x / 2: both are polynomials in t.
        x0, dx = origins[:, 0] / 2, directions[:, 0] / 2
        g0 = 2 * origins[:, 2] - origins[:, 1] - 2 * x0 * (1 - x0)
        g1 = 2 * directions[:, 2] - directions[:, 1] - 2 * dx * (1 - 2 * x0)
        root = np.sqrt(np.maximum(g1 * g1 - 8 * dx * dx * g0, 0.0))
        # 2 dx^2 t^2 + g1 t + g0 = 0, without a difference of equal numbers.
        q = -0.5 * (g1 + np.copysign(root, g1))
        both = np.stack([q / (2 * dx * dx), g0 / q], axis=1)
        points = origins[:, None] + both[:, :, None] * directions[:, None]
        s = points[:, :, 0] / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            r = points[:, :, 2] / (2 * s * (1 - s))
        met = (both > 0) & (s >= 0) & (s <= 1) & (r >= 0) & (r <= 1)
        expected = np.where(met, both, np.inf).min(axis=1)
        hits = Intersector([BezierPatches([LUNE])]).intersect(origins, directions)
        # The closed form loses half the digits where both roots are close.
        clear = (hits.status == Status.HIT) & (root > 1e-3)
        assert clear.sum() > 1800
        np.testing.assert_allclose(hits.t[clear], expected[clear], rtol=1e-9)

    def test_is_tessellated_within_its_tolerance(self):
        mesh = tessellate(BezierPatches([LUNE]), 1e-3)
        assert mesh.deviation_bound <= 1e-3
        x, y, z = mesh.vertices.T
        assert np.abs(2 * z - y - x * (1 - x / 2)).max() < 1e-15

    @pytest.mark.parametrize("end", [0, 2])
    def test_its_poles_are_tips(self, end):
        hits = Intersector([BezierPatches([LUNE])]).intersect((end, -1, 3), (0, 1, -3))
        assert hits.status[0] == Status.TANGENT


@pytest.mark.parametrize("degrees", [(1, 1), (1, 3), (3, 3)])
def test_rays_almost_within_a_flat_patch(degrees):
    """The point lies within the band of the ray, or the row says TANGENT; by rational arithmetic."""
    m, n = degrees
    x, y = np.meshgrid(np.linspace(0, 3, m + 1), np.linspace(0, 3, n + 1), indexing="ij")
    frame = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    surface = BezierPatches([np.stack([x, y, 0 * x], axis=-1) @ frame + (0.3, 0.1, 0.7)])
    rng = np.random.default_rng(2)
    k = 3000
    cosine = 10.0 ** rng.uniform(-16, -3, k) * rng.choice([-1, 1], k)
    turn = rng.uniform(0, 2 * np.pi, k)
    local = np.stack([np.cos(turn), np.sin(turn), cosine], axis=1)
    directions = local @ frame
    u, v = rng.random((2, k))
    size = np.linalg.norm(np.ptp(surface.bounds, axis=0))
    back = rng.uniform(0.1, 2, k) * size
    origins = surface.point(u, v, np.zeros(k, int)) - back[:, None] * directions
    hits = Intersector([surface], coarse="none").intersect(origins, directions)
    scale = np.maximum(norm(origins - surface.bounds.mean(axis=0)), size)
    sure = np.flatnonzero(hits.status == Status.HIT)
    assert len(sure) > 1000
    corners = [[Fraction(float(c)) for c in p] for p in surface.patches[0][[0, -1, 0], [0, 0, -1]]]
    for i in sure:
        # Degrees 1 and 3 of even spacing are linear: the point is corner + u side + v side.
        s, r, t = (Fraction(float(a[i])) for a in (hits.u, hits.v, hits.t))
        o, d = ([Fraction(float(c)) for c in a[i]] for a in (origins, directions))
        gap = [
            float(a + s * (b - a) + r * (c - a) - p - t * q)
            for a, b, c, p, q in zip(*corners, o, d, strict=True)
        ]
        # Spacing of thirds is rounded once: an ulp of 3.
        assert math.hypot(*gap) <= BAND * scale[i] + 4 * EPS


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


@pytest.mark.parametrize(
    ("name", "distance"),
    [
        ("apex of the lid", 1e-11),  # work was up to 290 times that of an ordinary ray
        ("rational poles", 1e-10),  # 370
        ("cuspidal edge", 1e-14),  # 1600
        ("flat bicubic, nearly within", 1e-10),  # 500
        ("patches, leaving", 1e-6),  # 1300
        ("rational, leaving", 1e-6),  # 1500
        ("rational rulings", 1e-13),  # 16 cells wait
        ("pinched corner", 1e-15),  # displaced rays were given up
    ],
)
def test_rays_at_singular_sets_take_at_most_the_work_of_100(name, distance):
    surfaces = placed_surfaces(name, "home")
    tracer, rng = Intersector(surfaces, coarse="none", threads=1), np.random.default_rng(5)
    targets, directions = interior(surfaces, 300, rng), unit(rng.normal(size=(300, 3)))
    ordinary = work_of(tracer, targets.points - 3.0 * targets.size * directions, directions)
    cell = trace_cell(tracer, name, distance, "home", 40, 1)
    assert work_of(tracer, cell.origins, cell.directions, cell.source) <= 100 * ordinary


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
