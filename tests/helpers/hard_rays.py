"""Hard rays at surfaces of one closed form, and what their first hits must be.

``samples(surface, n, rng)`` returns points, normals, and two unit tangents: about the axis, and over.
"""

import numpy as np

from hybrid_rt import Intersector, Status
from proof.cases.rays import hard_rays
from proof.cases.singular_rays import interior, parallel
from proof.exact.judge import ExactJudge
from proof.exact.truth import ExactScene
from proof.judge import Judge

# Distances from tangency, rim or vertex, over the size; inside is negative.
OFFSETS = np.array([0.0, *(s * 10.0**-k for k in range(1, 15) for s in (1, -1))])


def unit(vectors):
    return vectors / np.linalg.norm(vectors, axis=1, keepdims=True)


def offsets(surface, n, rng):
    return surface.size * rng.choice(OFFSETS, n)[:, None]


def at_set(find, aim):
    """Rays at a singular set of a surface, at all distances."""

    def rays(surface, n, rng):
        each = [
            aim(find([surface], n // 10, rng), 10.0 ** -rng.uniform(1, 15), rng) for _ in range(10)
        ]
        return np.concatenate([r.origins for r in each]), np.concatenate(
            [r.directions for r in each]
        )

    return rays


def mixed(surface, n, rng):
    """Silhouettes, rims, from far away, along the axis, from the surface and within it."""
    rays = hard_rays([surface], 3 * n, int(rng.integers(1 << 30)))
    return rays.origins, rays.directions


# What rays at any surface there are.
ANY_SURFACE = {"mixed": mixed, "tangents": at_set(interior, parallel)}


def assert_decided_exactly(surface, origins, directions):
    """Check first hits by exact roots."""
    hits = Intersector([surface]).intersect(origins, directions)
    verdict = ExactJudge([surface]).judge(hits, origins, directions)
    assert verdict.n_wrong == verdict.wrong_tangent == 0
    assert verdict.left_open == 0
    assert verdict.worst_bound <= 1.0
    assert verdict.worst_gap <= 1.0
    # Where moving the ray by the band changes the answer TANGENT is said, and only there; the edge
    # of the band itself is known to the rounding of the implicit form.
    assert verdict.unmarked == 0
    assert verdict.tangent_needlessly <= 1


def share_met_on_the_way(surface, samples, distance, rng):
    """Check rays that leave the surface, and return how many shadow rays to their hits are blocked."""
    tracer = Intersector([surface])
    points, normals, about, over = samples(surface, 400, rng)
    seen = tracer.intersect(points + distance * surface.size * normals, -normals)
    about, over, seen = about[seen.hit], over[seen.hit], seen[seen.hit]
    n = len(seen)
    assert n > 300
    tilt = 10.0 ** rng.uniform(-5, 0, (n, 1)) * rng.choice([-1, 1], (n, 1))
    ways = tilt * seen.normal + unit(rng.normal(size=(n, 1)) * over + about)
    hits = tracer.intersect(seen.position, ways, source=seen)
    assert Judge([surface]).judge(hits, seen.position, ways, seen.object_id).n_wrong == 0
    assert (hits.t[hits.hit] > 0).all()
    # Shadow rays agree, to infinity and to the hit itself.
    assert np.array_equal(tracer.occluded(seen.position, ways, source=seen), hits.hit)
    rows = np.flatnonzero(hits.hit & (hits.status == Status.HIT))
    return tracer.occluded(
        seen.position[rows], ways[rows], 1.001 * hits.t[rows], source=seen[rows], target=hits[rows]
    ).mean()


def assert_crossings_are_exact(surface, origins, directions, counts):
    """Check all crossings by the roots of the polynomial; return them."""
    found = Intersector([surface]).intersect_all(origins, directions)
    scene = ExactScene([surface])
    roots = [
        [x.t for x in scene.crossings(o, d) if x.t > 0.0]
        for o, d in zip(origins, directions, strict=True)
    ]
    assert found.count.tolist() == [len(of_ray) for of_ray in roots]
    assert set(found.count) >= counts
    t = np.concatenate(roots)
    assert (np.abs(found.hits.t - t) <= found.hits.t_bound + np.spacing(t)).all()
    return found
