"""t_bound and TANGENT hold for the exact image of a closed form or mesh, however rounding moved it.

The judge takes a ray back by the given matrices, in fractions, and meets the surface as it was given.
"""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest

from hybrid_rt import Box, Intersector, Plane, Rectangle, Sphere, Status, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from proof.exact.crossings import POINT, bits, rational, rationals
from proof.surface import judged_of
from proof.surfaces.instances import Place

VERTICES = np.array([(0, 0, 0), (1, 0.1, 0.2), (0.3, 1.1, -0.3), (0.2, 0.4, 1.3)])
FACES = np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (2, 0, 3)])
SHAPES = {
    "sphere": Sphere((0.1, 0.7, -0.3), 0.9),
    "torus": Torus((0.1, 0.7, -0.3), (0, 0, 1), 0.8, 0.3),
    "asphere": Asphere(1.7, -1.0, (0.0, -0.06), 1.6, (0.1, 0.7, -0.3), (0, 0, 1)),
    "plane": Plane((0.1, 0.7, -0.3), (1, -2, 3.3)),
    "rectangle": Rectangle((0.1, 0.7, -0.3), (1.1, 0.2, 0), (0.3, -0.4, 0.9)),
    "box": Box((0.1, 0.7, -0.3), (0.6, 1.9, 0.4)),
    "mesh": TriangleMesh(SimpleNamespace(vertices=VERTICES, faces=FACES)),
}
ROUND = (Sphere, Torus, Asphere)
SIZES = (1e-3, 1.0, 1e3)
QUARTER = np.eye(4)[[1, 2, 0, 3]]


def shift(*by):
    matrix = np.eye(4)
    matrix[:3, 3] = by
    return matrix


def similarity(rng, scale, far):
    """Return a rotation of rounded entries, perhaps a reflection, a scale and a shift."""
    matrix = np.eye(4)
    matrix[:3, :3] = scale * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix[:3, 3] = far * rng.uniform(-1, 1, 3)
    return matrix


def affine(rng, scale, far):
    """Return such a matrix, sheared."""
    matrix = similarity(rng, scale, far)
    matrix[:3, :3] = matrix[:3, :3] @ (np.eye(3) + 0.3 * rng.uniform(-1, 1, (3, 3)))
    return matrix


def upright(rng, scale, far):
    """Return scales and a shift, which leave boxes along the axes."""
    matrix = np.diag([*(scale * rng.uniform(0.5, 2.0, 3) * (1, -1, 1)), 1.0])
    matrix[:3, 3] = far * rng.uniform(-1, 1, 3)
    return matrix


def matrices_for(given, rng, scale, far):
    """Return two maps, to be applied one after the other, and one that is upright if the surface takes it."""
    make = similarity if isinstance(given, ROUND) else affine
    several = [[make(rng, scale, 0.3 * far / scale), make(rng, 1.0, far)]]
    return several if isinstance(given, ROUND) else [*several, [upright(rng, scale, far)]]


def rays_at(image, size, rng, n):
    """Return rays of four sorts in turn: chords, and rays that graze; each from afar, and from the surface.

    The latter two pass the surface, or its borders, by more and by less than rounding.
    """
    u, v = rng.uniform(0, 1, (2, n))
    ids = rng.integers(len(image), size=n)
    border = (rng.random(n) < 0.4) & (np.arange(n) % 4 > 0)
    v = v * (1.0 - u) if image.is_triangular else v
    ends = rng.integers(2, size=n) * (1.0 - v if image.is_triangular else 1.0)
    u = np.where(border, ends, u)
    if isinstance(image, Plane):
        u, v = (x + image.origin[axis] for x, axis in zip((u, v), image.axes, strict=True))
    point, normal = image.point(u, v, ids), image.normal(u, v, ids)
    d = rng.normal(size=(n, 3))
    grazing = np.arange(n) % 4 >= 2
    along = d - np.einsum("ij,ij->i", d, normal)[:, None] * normal
    d = np.where((grazing & ~border)[:, None], along, d)
    aside = np.where(border[:, None], rng.normal(size=(n, 3)), normal)
    by = rng.choice([-1.0, 1.0], n) * 10.0 ** rng.uniform(-3, 2, n) * (image.moved + 1e-14 * size)
    point = point + (grazing * by)[:, None] * aside
    d /= np.linalg.norm(d, axis=1)[:, None]
    back = np.where(np.arange(n) % 2 == 0, 10.0 ** rng.uniform(-1, 1, n) * size, 0.0)
    return point - back[:, None] * d, d * rng.choice([0.3, 1.0, 40.0], n)[:, None]


def judge(given, matrices, rng, n, others=()):
    """Trace rays at the image under one matrix after the other; return hits, wrong rows, and broken bounds.

    Wrong are rows that hit or miss, without TANGENT, where the exact ray does not. ``others`` are
    surfaces that these rays do not meet, far away.
    """
    image = given
    for matrix in matrices:
        image = image.transformed(matrix)
    scale = float(np.prod([abs(np.linalg.det(m[:3, :3])) for m in matrices]) ** (1 / 3))
    o, d = rays_at(image, image.size or scale, rng, n)
    hits = Intersector([*others, image], coarse="none", threads=1).intersect(o, d)
    places = [Place.of(matrix[:3]) for matrix in reversed(matrices)]
    crosser, wrong, broken = judged_of(given).crosser(), [], []
    for i in range(n):
        start, way = rationals(o[i]), rationals(d[i])
        for place in places:
            start, way = place.point(start), place.vector(way)
        everywhere = [one.t for one in crosser(start, way) if one.kind == POINT]
        ahead = sorted((t for t in everywhere if t > 0), key=lambda t: float(t.mid()))
        t, bound = rational(hits.t[i] if hits.hit[i] else 0.0), float(hits.t_bound[i])
        with bits(512):
            gap = float(abs(ahead[0] - t).upper()) if ahead else 0.0
            nearest = min((float(abs(x - t).upper()) for x in everywhere), default=0.0)
        if hits.status[i] == Status.TANGENT:
            # The exact ray meets these in the same place, or not at all.
            if hits.hit[i] and isinstance(given, Sphere | Plane) and nearest > bound:
                broken.append(i)
        elif bool(ahead) != bool(hits.hit[i]):
            wrong.append(i)
        elif gap > bound:
            broken.append(i)
    return hits, wrong, broken


@pytest.mark.parametrize("far", [0.0, 1.0, 1e3, 1e7])
@pytest.mark.parametrize("name", SHAPES)
def test_rows_hold_for_the_exact_image(name, far):
    rng = np.random.default_rng(41)
    for size in SIZES:
        for matrices in matrices_for(SHAPES[name], rng, size, far):
            hits, wrong, broken = judge(SHAPES[name], matrices, rng, 32)
            assert wrong == broken == []
            # Chords, from afar, are decided.
            assert (hits.status[::4] == Status.HIT).mean() >= 0.75


@pytest.mark.parametrize("name", ["sphere", "torus", "asphere", "rectangle", "box"])
def test_rows_hold_for_images_in_a_tree(name):
    rng = np.random.default_rng(43)
    # A row of others a million sizes away, which the rays cannot meet in front of the image.
    others = [SHAPES[name].transformed(shift(3.0 * k, 1e9, 0.0)) for k in range(220)]
    matrices = [similarity(rng, 1e-2, 0.0), shift(0.1, 1e7, 3e5)]
    _, wrong, broken = judge(SHAPES[name], matrices, rng, 12, others)
    assert wrong == broken == []


@pytest.mark.parametrize("name", SHAPES)
def test_what_rounds_nothing_moves_nothing(name):
    given = SHAPES[name].transformed(shift(-0.1, -0.7, 0.3))  # to 0, where ulps are small
    matrices = [np.eye(4), np.diag([-1.0, 1, 1, 1]), np.diag([0.25, 0.25, 0.25, 1]), QUARTER]
    for matrix in matrices[:3] if name == "box" else matrices:  # edges of a turned box are rounded
        image = given.transformed(matrix)
        scale = abs(np.linalg.det(matrix)) ** (1 / 3)
        assert image.moved == pytest.approx(scale * given.moved, rel=1e-9, abs=0.0)
    assert SHAPES[name].moved == 0.0
    whole = Sphere((1, 2, 3), 0.7).transformed(shift(5, -7, 1e6))
    assert whole.moved == 0.0


def test_how_far_rounding_has_moved_an_image():
    # 0.1 + 1e7 is rounded to a multiple of 2^-29: by 0.1 - 0.10000000149 there.
    ball = Sphere((0.1, 0, 0), 1.0).transformed(shift(1e7, 0, 0))
    assert ball.moved == pytest.approx(abs((1e7 + 0.1) - 1e7 - 0.1), rel=1e-6)
    # Images of images, mirrored, pickled and flipped ones keep it, times the scale.
    image = ball.transformed(np.diag([2.0, -2, 2, 1]))
    assert image.moved == pytest.approx(2.0 * ball.moved, rel=1e-9)
    assert pickle.loads(pickle.dumps(image)).flipped().flipped().moved == image.moved
    for given in SHAPES.values():
        image = given.transformed(shift(1e7, 1e7, 1e7))
        assert 1e-10 < image.moved < 4e-9
        assert image.flipped().moved == image.moved


def test_a_plane_is_tilted_by_the_rounding_of_its_normal():
    a = 0.7
    turn = np.array([[np.cos(a), -np.sin(a), 0, 0], [np.sin(a), np.cos(a), 0, 0],
                     [0, 0, 1, 0], [0, 0, 0, 1.0]])  # fmt: skip
    image = Plane((0, 0, 0), (1, 2, 3)).transformed(turn)
    assert 0.0 < image.tilt < 2.0**-52
    assert image.flipped().tilt == image.tilt
    # Along the plane, at a height of one: whether the exact image is met, and where, is open.
    u = np.cross(image.exact_normal, (1.0, 0, 0))
    hits = Intersector([image], coarse="none").intersect(image.unit_normal, u)
    assert hits.status[0] == Status.TANGENT


def test_a_ray_that_begins_in_an_image_as_rounded_is_in_doubt():
    """Exactly at t = 0 by rounding: the exact image may be ahead."""
    away = shift(1e7 / 3, 1e7 / 7, 1e7 / 9)
    box = Box((0.1, 0.1, 0.1), (1, 1, 1))
    for given in (box, box.transformed(shift(1e6, 0, 0.3))):
        image = given.transformed(away)
        o = image.point(0.5, 0.5, 1)
        hits = Intersector([image], coarse="none").intersect(o, (1.0, 0, 0))
        assert hits.status[0] == Status.TANGENT
        # Without rounding there is none.
        o = box.point(0.5, 0.5, 1)
        assert Intersector([box], coarse="none").intersect(o, (1.0, 0, 0)).status[0] == Status.MISS
