"""The oracle against rational arithmetic, and the judge against answers made wrong on purpose."""

import dataclasses

import mpmath
import numpy as np
import pytest

from hybrid_rt import Intersector, Sphere
from hybrid_rt.verify.cases.campaign import SCENES
from hybrid_rt.verify.cases.rays import hard_rays
from hybrid_rt.verify.judges import exact
from hybrid_rt.verify.judges.judge import compare
from hybrid_rt.verify.judges.oracle import first_hits


@pytest.mark.parametrize("check", [exact.check_patches, exact.check_lathes])
def test_all_roots_are_found_and_right_to_the_last_bits(check):
    result = check(1000, seed=11)
    assert not result.lost
    assert not result.invented
    # Newton ends in double-double; t itself is a float64, and one sum with it rounds.
    assert result.worst <= 4.0
    # Rays half of which meet something: the comparison was about something.
    assert result.roots > 500


def test_sphere_roots_agree_with_sixty_digits():
    rng = np.random.default_rng(5)
    center, radius = np.array([0.3, -0.2, 0.1]), 0.7
    origins = rng.normal(size=(300, 3)) * 10.0 ** rng.uniform(0, 6, (300, 1))
    directions = center + 0.71 * rng.normal(size=(300, 3)) / np.sqrt(3) - origins
    truth = first_hits([Sphere(center, radius)], origins, directions)
    with mpmath.workdps(60):
        for i in range(300):
            o = [
                mpmath.mpf(float(x)) - mpmath.mpf(float(c))
                for x, c in zip(origins[i], center, strict=True)
            ]
            d = [mpmath.mpf(float(x)) for x in directions[i]]
            a = mpmath.fsum(x * x for x in d)
            b = mpmath.fsum(x * y for x, y in zip(o, d, strict=True))
            c = mpmath.fsum(x * x for x in o) - mpmath.mpf(radius) ** 2
            rest = b * b - a * c
            if truth.ambiguous[i]:
                continue
            if rest < 0:
                assert truth.object_id[i] < 0
                continue
            t = (-b - mpmath.sqrt(rest)) / a
            assert abs(float(t - mpmath.mpf(float(truth.t[i])))) <= np.spacing(truth.t[i])


@pytest.fixture(scope="module")
def judged():
    surfaces = SCENES["vase"]()
    rays = hard_rays(surfaces, 2000, seed=4)
    hits = Intersector(surfaces).intersect(rays.origins, rays.directions)
    return hits, first_hits(surfaces, rays.origins, rays.directions)


def test_the_judge_finds_what_was_made_wrong(judged):
    hits, truth = judged
    assert compare(hits, truth).n_wrong == 0
    sure = np.flatnonzero(~truth.ambiguous & truth.exact & (truth.cosine > 0.1))[:30]
    t, ids = hits.t.copy(), hits.object_id.copy()
    status = hits.status.copy()
    t[sure[:10]] = np.inf  # lost
    ids[sure[:10]], status[sure[:10]] = -1, 0
    t[sure[10:20]] += 1e-6  # behind the surface
    t[sure[20:30]] -= 1e-6  # in front of it
    wrong = dataclasses.replace(hits, t=t, object_id=ids, status=status)
    verdict = compare(wrong, truth)
    assert set(verdict.rows["missed"]) == set(sure[:10])
    assert set(verdict.rows["farther"]) == set(sure[10:20])
    assert set(verdict.rows["nearer"]) == set(sure[20:30])


def test_the_judge_finds_phantoms(judged):
    hits, truth = judged
    empty = np.flatnonzero(~hits.hit & (truth.object_id < 0) & ~truth.ambiguous)[:10]
    some = np.flatnonzero(hits.hit)[0]
    columns = {}
    for item in dataclasses.fields(hits):
        column = getattr(hits, item.name).copy()
        column[empty] = column[some]
        columns[item.name] = column
    verdict = compare(dataclasses.replace(hits, **columns), truth)
    assert set(verdict.rows["phantom"]) == set(empty)
