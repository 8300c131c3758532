"""First hits of one tracer against those of another on the same rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hybrid_rt.core.ray_set import RaySet
from hybrid_rt.core.records import FloatArray, HitRecord, Status


@dataclass(frozen=True)
class Errors:
    """First hits of one accuracy against certified ones.

    Attributes
    ----------
    rays : int
        Rays that hit something by either method.
    wrong : float
        Fraction of wrong ones.
    missed, phantom, farther : int
        False misses; false hits; hits on a farther sheet or on another object.
    mean, worst : float
        |t - exact t| over the correct hits, scene units.
    """

    rays: int
    wrong: float
    missed: int
    phantom: int
    farther: int
    mean: float
    worst: float


def compare(exact: HitRecord, next_t: FloatArray, found: HitRecord, rays: RaySet) -> Errors:
    """Compare first hits with certified ones, except where rounding decides (status TANGENT).

    ``next_t`` (n,) is the t of the ray's second hit (inf: none). A hit nearer to that than to the
    first is on a farther sheet.
    """
    sure = exact.status != Status.TANGENT
    missed = sure & exact.hit & ~found.hit
    phantom = sure & ~exact.hit & found.hit
    both = np.flatnonzero(sure & exact.hit & found.hit)
    length = np.linalg.norm(rays.directions[both], axis=1)
    error = np.abs(found.t[both] - exact.t[both]) * length
    to_next = np.abs(found.t[both] - next_t[both]) * length
    other = found.object_id[both] != exact.object_id[both]
    farther = other | (to_next < error)
    right = error[~farther]
    n_rays = int(missed.sum() + phantom.sum() + len(both))
    n_wrong = int(missed.sum() + phantom.sum() + farther.sum())
    return Errors(
        n_rays,
        n_wrong / max(n_rays, 1),
        int(missed.sum()),
        int(phantom.sum()),
        int(farther.sum()),
        float(right.mean()) if len(right) else 0.0,
        float(right.max(initial=0.0)),
    )
