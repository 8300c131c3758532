"""Many surfaces of a kind in a tree: hits keep every bit that they have when each is asked."""

import numpy as np
import pytest

from hybrid_rt import Asphere, Box, Intersector, Rectangle, Sphere, Status, Torus
from hybrid_rt.intersection.kinds import registry
from meshing import SurfaceOfRevolution, TrimmedSurface, circle

NEVER = 10**9
COLUMNS = ("t", "t_bound", "u", "v", "object_id", "patch_id", "flags", "normal")


def turned(rng, size, at):
    matrix = np.eye(4)
    matrix[:3, :3] = size * np.linalg.qr(rng.normal(size=(3, 3)))[0]
    matrix[:3, 3] = at
    return Box((-0.5, -0.4, -0.3), (0.5, 0.4, 0.3)).transformed(matrix)


def aligned(rng, size, at):
    half = size * rng.uniform(0.2, 0.5, 3)
    return Box(at - half, at + half)


def rectangle(rng, size, at):
    edge_u, edge_v = size * rng.normal(size=(2, 3))
    return Rectangle(at - 0.5 * edge_u - 0.5 * edge_v, edge_u, edge_v)


def part(rng, size, at):
    """A turned part: a vase, a half of one, a cylinder, a cone, or a ring of two circular arcs."""
    axis = rng.normal(size=3)
    vase = [
        (-0.5 * size, 0.2 * size),
        (0.0, 0.6 * size),
        (0.2 * size, 0.0),
        (0.5 * size, 0.3 * size),
    ]
    which = rng.integers(5)
    if which == 0:
        return SurfaceOfRevolution(vase, at, axis)
    if which == 1:
        return SurfaceOfRevolution(vase, at, axis, u_range=(0.1, 0.6))
    ends = [(-0.4 * size, 0.3 * size), (0.4 * size, 0.3 * size if which == 2 else 0.0)]
    if which < 4:
        return SurfaceOfRevolution(ends, at, axis)
    net = size * np.array([(-0.2, 0.4), (0.0, 0.7), (0.2, 0.4)])
    return SurfaceOfRevolution([net], at, axis, weights=[[1.0, 0.5, 1.0]])


MAKE = {
    "surfaces of revolution": part,
    "spheres": lambda _rng, size, at: Sphere(at, 0.5 * size),
    "rectangles": rectangle,
    "boxes": aligned,
    "turned boxes": turned,
    "tori": lambda rng, size, at: Torus(at, rng.normal(size=3), 0.4 * size, 0.15 * size),
    "aspheres": lambda rng, size, at: Asphere(
        size, -0.6, [0.1 / size], 0.4 * size, at, rng.normal(size=3)
    ),
}


def surfaces_of(kind, rng, n=60):
    """Surfaces of sizes from 0.05 to 0.3 in the unit cube; one is large, one tiny, two are equal."""
    sizes = rng.uniform(0.05, 0.3, n)
    sizes[3], sizes[5] = 2e5, 1e-9
    at = rng.random((n, 3))
    found = [MAKE[kind](rng, size, place) for size, place in zip(sizes, at, strict=True)]
    return [*found, found[10]]


def corners_of(surface):
    if isinstance(surface, Rectangle):
        return surface.corner + np.array([0.0 * surface.edge_u, surface.edge_u, surface.edge_v])
    if type(surface).__name__ == "TurnedBox":
        return surface.lo + np.concatenate([[np.zeros(3)], surface.edges])
    low, high = surface.bounds
    return np.where(np.indices((2, 2, 2)).reshape(3, 8).T == 1, high, low)


def kind_of(tracer):
    (only,) = (*tracer._direct, *tracer._curved)
    return only


def both(surfaces, monkeypatch, coarse="none"):
    """Intersectors with and without trees."""
    found = []
    for many in (1, NEVER):
        for surface in registry.MANY:
            monkeypatch.setitem(registry.MANY, surface, many)
        found.append(Intersector(surfaces, coarse=coarse, threads=1))
    tree, row = found
    assert kind_of(tree)._in_trees
    assert not kind_of(row)._in_trees
    return tree, row


def assert_same(tree, row, origins, directions, **limits):
    """Compare all columns; return the hits, and the rows that are TANGENT without the tree alone.

    Rays nearly within a plane have doubts where no surface is: those behind the hit go with the tree.
    """
    a = tree.intersect(origins, directions, **limits)
    b = row.intersect(origins, directions, **limits)
    for name in COLUMNS:
        assert np.array_equal(getattr(a, name), getattr(b, name), equal_nan=True), name
    doubted = (a.status == Status.HIT) & (b.status == Status.TANGENT)
    assert np.array_equal(a.status[~doubted], b.status[~doubted])
    return a, np.flatnonzero(doubted)


def met_before(surfaces, origin, direction, t):
    """The surfaces whose bounds a ray comes near before t."""
    low, high = np.array([surface.bounds for surface in surfaces]).transpose(1, 0, 2)
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.array([low - 1e-6 - origin, high + 1e-6 - origin]) / direction
    enter, leave = ends.min(axis=0).max(axis=1), ends.max(axis=0).min(axis=1)
    is_met = np.maximum(enter, 0.0) <= np.minimum(leave, t * (1 + 1e-9))
    return [surfaces[k] for k in np.flatnonzero(is_met)]


@pytest.mark.parametrize("kind", MAKE)
def test_same_bits_as_each_by_itself(kind, monkeypatch):
    rng = np.random.default_rng(31)
    surfaces = surfaces_of(kind, rng)
    tree, row = both(surfaces, monkeypatch)
    targets = rng.random((10_000, 3))
    origins = 0.5 + rng.normal(size=targets.shape)
    hits, _ = assert_same(tree, row, origins, targets - origins)
    assert hits.hit.mean() > 0.3
    # --- rays that leave surfaces, on the way to a point that they aim at from both sides
    on = hits[hits.hit]
    ways = rng.random((len(on), 3)) - on.position
    again, _ = assert_same(tree, row, on.position, ways, source=on)
    assert again.hit.any()
    blocked = tree.occluded(on.position, ways, 1.0, source=on)
    assert np.array_equal(blocked, row.occluded(on.position, ways, 1.0, source=on))
    assert blocked.any()
    assert not blocked.all()
    # --- from so far away that bands are wider than the margin of the tree's boxes
    far = targets + 1e11 * (origins - targets) + 0.02 * rng.normal(size=targets.shape)
    assert_same(tree, row, far[:500], (targets - far)[:500])


@pytest.mark.parametrize("kind", MAKE)
def test_same_bits_beside_the_outline(kind, monkeypatch):
    """Rays graze surfaces, run along axes and through corners, and stop or begin at the hit."""
    rng = np.random.default_rng(7)
    surfaces = surfaces_of(kind, rng)
    tree, row = both(surfaces, monkeypatch)
    corners = np.concatenate([corners_of(surface) for surface in surfaces])
    n = 6000
    targets = corners[rng.integers(len(corners), size=n)]
    along = rng.integers(3, size=n)
    ways = rng.normal(size=(n, 3))
    ways[: n // 2] = np.eye(3)[along[: n // 2]] * rng.choice([-1.0, 1.0], (n // 2, 1))
    aside = rng.normal(size=(n, 3)) * 10.0 ** rng.uniform(-18, -1, (n, 1))
    origins = targets + aside - ways * 2.0 ** rng.integers(-3, 4, (n, 1))
    first, _ = assert_same(tree, row, origins, ways)
    # --- grazing: along the surface at a hit, beside it by little
    on = first[first.hit]
    normal = on.normal
    level = np.cross(normal, rng.normal(size=normal.shape))
    lift = (
        normal * 10.0 ** rng.uniform(-18, -1, (len(on), 1)) * rng.choice([-1.0, 1.0], (len(on), 1))
    )
    start = on.position + lift - level
    grazing, doubted = assert_same(tree, row, start, level)
    assert (grazing.status == Status.TANGENT).any()
    # --- nothing that may be met before the hit asks for the mark that the tree spares
    assert kind in ("rectangles", "turned boxes") or doubted.size == 0
    for i in doubted[:20]:
        few = met_before(surfaces, start[i], level[i], grazing.t[i])
        hit = Intersector(few, threads=1).intersect(start[i], level[i])
        assert (hit.t, hit.status) == (grazing.t[i], Status.HIT)
    assert_same(tree, row, origins[first.hit], ways[first.hit], t_min=on.t)
    assert_same(tree, row, origins[first.hit], ways[first.hit], t_max=on.t)


def test_turned_ones_with_guesses(monkeypatch):
    rng = np.random.default_rng(5)
    tree, row = both(surfaces_of("surfaces of revolution", rng), monkeypatch, coarse="embree")
    targets = rng.random((5_000, 3))
    origins = 0.5 + rng.normal(size=targets.shape)
    hits, _ = assert_same(tree, row, origins, targets - origins)
    assert hits.hit.any()
    blocked = tree.occluded(origins, targets - origins, 1.0)
    assert np.array_equal(blocked, row.occluded(origins, targets - origins, 1.0))


def test_trimmed_ones(monkeypatch):
    rng = np.random.default_rng(3)
    spheres = [
        TrimmedSurface(whole, [circle((0.5, 0.5), 0.1 + 0.3 * rng.random())])
        for whole in surfaces_of("spheres", rng, 40)
    ]
    tree, row = both(spheres, monkeypatch)
    targets = rng.random((5_000, 3))
    origins = 0.5 + rng.normal(size=targets.shape)
    hits, _ = assert_same(tree, row, origins, targets - origins)
    assert hits.hit.any()
