"""Turned surfaces of straight segments against their quadric, in extended precision."""

import numpy as np
import pytest

from hybrid_rt import Intersector, Status
from meshing import Cone, Cylinder

# Rays this deep below a cone (in radii) are followed on both sides of the point between the roots.
DEEP = 1e-5

CONES = {
    "cone": Cone((0, 0, 0), (0, 0, 1), 1.0, 2.0),
    "frustum": Cone((0, 0, 0), (0, 0, 1), 1.0, 2.0, 0.4),
    "funnel": Cone((0, 0, 0), (0, 0, 1), 0.3, 0.5, 1.0),
    "steep": Cone((0, 0, 0), (0, 0, 1), 1.0, 50.0, 0.9),
    "flat": Cone((0, 0, 0), (0, 0, 1), 1.0, 0.02, 0.1),
    "cylinder": Cylinder((0, 0, 0), (0, 0, 1), 1.0, 2.0),
}


def ends_of(cone):
    (z0, r0), (z1, r1) = cone.segments[0]
    return z0, z1, r0, r1


def crossings(cone, origins, directions):
    """Return t (n, 2) of the roots on the segment, inf for none; how far rounding moves them, at most;
    and whether one is next to an end.
    """
    o, d = origins.astype(np.longdouble), directions.astype(np.longdouble)
    z0, z1, r0, r1 = (np.longdouble(x) for x in ends_of(cone))
    per_height = (r1 - r0) / (z1 - z0)
    r, rate = r0 + per_height * (o[:, 2] - z0), per_height * d[:, 2]
    a = d[:, 0] ** 2 + d[:, 1] ** 2 - rate**2
    b = o[:, 0] * d[:, 0] + o[:, 1] * d[:, 1] - r * rate
    c = o[:, 0] ** 2 + o[:, 1] ** 2 - r**2
    with np.errstate(invalid="ignore", divide="ignore"):
        root = np.sqrt(b * b - a * c)
        q = -(b + np.copysign(root, b))
        t = np.stack([q / a, c / q], axis=1)
        z = o[:, 2:] + t * d[:, 2:]
        is_there = (t > 0) & (z >= z0) & (z <= z1) & (r[:, None] + t * rate[:, None] >= 0)
        at_end = np.minimum(np.abs(z - z0), np.abs(z - z1)).min(axis=1) < 1e-9
        rounding = 2.0**-60 * ((o * o).sum(axis=1) + r * r) / root
    return np.sort(np.where(is_there, t, np.inf), axis=1), rounding, at_end


def hard_rays(cone, n, seed):
    """Rays that pass a point of the surface at depths from 1e-14 to 1, at any angle to its rulings."""
    rng = np.random.default_rng(seed)
    u, v = rng.random(n), rng.random(n)
    point, normal = cone.point(u, v), cone.normal(u, v)
    along_u, along_v = cone.partials(u, v)
    along_u /= np.linalg.norm(along_u, axis=1, keepdims=True)
    along_v /= np.linalg.norm(along_v, axis=1, keepdims=True)
    # From across the rulings, where a ray may touch, to almost along them.
    turn = 0.5 * np.pi * (1.0 - 10.0 ** rng.uniform(-6, 0, n))
    way = np.cos(turn)[:, None] * along_u + np.sin(turn)[:, None] * along_v
    way += (
        normal
        * (rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-8, 0, n) * (rng.random(n) < 0.5))[:, None]
    )
    depth = rng.choice([-1, 1], n) * 10.0 ** rng.uniform(-14, 0, n)
    # A third of them about as deep as the rule changes.
    rule = rng.random(n) < 0.3
    depth[rule] = -np.sign(depth[rule]) * DEEP * rng.uniform(0.5, 2.0, rule.sum())
    target = point + normal * depth[:, None]
    return target - way * rng.uniform(0.5, 3.0, n)[:, None], way


@pytest.mark.parametrize("name", CONES)
def test_first_hits_are_those_of_the_quadric(name):
    cone = CONES[name]
    tracer = Intersector(cone, coarse="none")
    for origins, directions in (
        hard_rays(cone, 20_000, 3),
        uniform_rays(cone, 20_000, 4),
        rays_beside_the_axis(20_000, 5),
    ):
        hits = tracer.intersect(origins, directions)
        t, rounding, at_end = crossings(cone, origins, directions)
        sure = (hits.status != Status.TANGENT) & ~at_end
        np.testing.assert_array_equal(hits.hit[sure], np.isfinite(t[sure, 0]))
        both = sure & hits.hit
        assert both.sum() > 1000
        off = np.abs(hits.t[both] - t[both, 0])
        assert (off <= hits.t_bound[both] + rounding[both]).all()


def uniform_rays(cone, n, seed):
    rng = np.random.default_rng(seed)
    z0, z1, r0, r1 = ends_of(cone)
    low, high = np.array([-1.2, -1.2, z0 - 0.1]), np.array([1.2, 1.2, z1 + 0.1])
    origins = 4.0 * max(z1 - z0, r0, r1) * rng.normal(size=(n, 3))
    return origins, rng.uniform(low, high, (n, 3)) - origins


def rays_beside_the_axis(n, seed):
    """Rays that pass the axis at 1e-8 to 1 of the size."""
    rng = np.random.default_rng(seed)
    target = rng.uniform((0, 0, 0.0), (0, 0, 2.0), (n, 3))
    angle, height = rng.uniform(0, 2 * np.pi, n), rng.uniform(-1, 1, n)
    way = np.stack([np.cos(angle), np.sin(angle), height], axis=1)
    aside = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
    aside *= 10.0 ** rng.uniform(-8, 0, (n, 1))
    return target + aside - 5.0 * way, way
