"""Error statistics of first hits against the oracle."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord
from hybrid_rt.core.wrong_hits import WrongHits, wrong_hits
from proof.judges.oracle import Truth


@dataclass(frozen=True)
class HitErrors:
    """Errors of first hits against the oracle; rows with several right answers are left out.

    Attributes
    ----------
    wrong_hits : WrongHits
    mean_dt, worst_dt : float
        |t - exact t| in scene units, over the right hits.
    worst_residual : float
        Largest distance of a right hit's point on the surface from its point on the ray, scene
        units.
    mean_angle, worst_angle : float
        Between the normals of right hits on curved surfaces and the true ones, degrees.
    """

    wrong_hits: WrongHits
    mean_dt: float
    worst_dt: float
    worst_residual: float
    mean_angle: float
    worst_angle: float


def hit_errors(found: HitRecord, truth: Truth) -> HitErrors:
    """Measure first hits against the truth about the same rays.

    Raises
    ------
    ValueError
        If the two differ in length.
    """
    if len(found) != len(truth):
        raise ValueError(f"{len(found)} hits but truth for {len(truth)} rays: pass the same rays")
    judged = ~truth.ambiguous & ~truth.undecided
    elsewhere = _nearer_to_another(found, truth)
    wrong = wrong_hits(truth.object_id, found.object_id, elsewhere, judged)
    right = np.flatnonzero(wrong.right)
    dt = np.abs(found.t[right] - truth.t[right]) * truth.length[right]
    residual, angle = found.residual[right], _angles(found, truth, right)
    return HitErrors(
        wrong_hits=wrong,
        mean_dt=float(dt.mean()) if len(dt) else 0.0,
        worst_dt=float(dt.max(initial=0.0)),
        worst_residual=float(residual.max(initial=0.0)),
        mean_angle=float(angle.mean()) if len(angle) else 0.0,
        worst_angle=float(angle.max(initial=0.0)),
    )


def _nearer_to_another(found: HitRecord, truth: Truth) -> BoolArray:
    """Tell for which rays a later root is nearer to the hit than the first one is."""
    roots = truth.roots
    with np.errstate(invalid="ignore"):
        gap = np.abs(found.t[roots.ray] - roots.t)
        of_first = np.abs(found.t - truth.t)[roots.ray]
        nearer = gap < of_first
    another: BoolArray = np.bincount(roots.ray[nearer], minlength=len(found)) > 0
    return another


def _angles(found: HitRecord, truth: Truth, rows: NDArray[np.intp]) -> FloatArray:
    """Return the angles between normals, degrees, of those rows that lie on curved surfaces."""
    angles = [np.empty(0)]
    for number, surface in enumerate(truth.surfaces):
        if not surface.is_freeform:
            continue
        mine = rows[truth.object_id[rows] == number]
        true = surface.normal(truth.u[mine], truth.v[mine], truth.patch_id[mine])
        across = np.linalg.norm(np.cross(found.normal[mine], true), axis=1)
        along = np.einsum("ij,ij->i", found.normal[mine], true)
        angles.append(np.degrees(np.arctan2(across, along)))
    return np.concatenate(angles)
