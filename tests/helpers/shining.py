"""Points sampled on surfaces that shine."""

import math

import numpy as np
from scipy import stats

from hybrid_rt.core.records import HitRecord
from hybrid_rt.lights.surface import shining_surface

# How often a right mean is refused by chance.
ALARM = 1e-5


def assert_mean(value, truth, spread, rounding=1e-6):
    """Compare the mean of independent values with the truth, and their spread with what is bearable."""
    limit = stats.t.isf(ALARM / 2, value.size - 1) * value.std(ddof=1) / math.sqrt(value.size)
    assert abs(value.mean() - truth) <= limit + rounding * truth
    assert value.std() <= spread * truth


def chosen(surface, place, n=4096, seed=3, up=(0.0, 0.0, 1.0)):
    """Return sampled points, and what each adds to the irradiance on ``place`` facing ``up``."""
    light = shining_surface(surface)
    seen_from = np.tile(np.array(place, float), (n, 1))
    points = light.seen_points(seen_from, np.random.default_rng(seed).random((n, 2)))
    way = points.position - seen_from
    distance = np.linalg.norm(way, axis=1)
    facing = np.maximum(-np.einsum("ij,ij->i", way, points.normal), 0.0)
    below = points.pdf_area * distance**4
    value = np.divide(
        facing * np.maximum(way @ np.array(up), 0.0), below, out=np.zeros(n), where=below > 0.0
    )
    return light, seen_from, points, value


def met(surface, points, rows):
    """Return points as hits; the patch is the one that has the point there."""
    u, v, place = points.u[rows], points.v[rows], points.position[rows]
    patches = np.repeat(np.arange(len(surface)), u.size)
    every = surface.point(np.tile(u, len(surface)), np.tile(v, len(surface)), patches)
    patch = np.linalg.norm(every.reshape(-1, u.size, 3) - place, axis=-1).argmin(axis=0)
    n, none = u.size, np.zeros(u.size)
    return HitRecord(
        t=none, object_id=none.astype(np.int32), patch_id=patch.astype(np.int32), u=u, v=v,
        position=place, normal=points.normal[rows], front_face=np.ones(n, np.bool_),
        status=none.astype(np.uint8), flags=none.astype(np.uint8), t_bound=none, residual=none,
        instance_id=none.astype(np.int32) - 1,
    )  # fmt: skip
