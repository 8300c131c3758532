"""Edges of CAD parts: how far apart the two faces of each are, measured."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from meshing.checks import FloatArray

# Between samples the distance may be larger than at them, by about this factor.
BETWEEN = 1.25


class Edges(NamedTuple):
    """Edges that two uses share."""

    gap: FloatArray  # (n,) largest distance of both curves from each other
    face: NDArray[np.int64]  # (n, 2)
    declared: FloatArray  # (n,) tolerance of the file
    of_use: FloatArray  # (k,) largest gap of each use
    n_free: NDArray[
        np.int64
    ]  # (faces,) edges of each face with an odd number of uses: of closed bodies none


def measured(uses: NDArray[Any], xyz: FloatArray, n_faces: int) -> Edges:
    """Measure the gaps of edges.

    Samples of both uses are at the same parameters of the edge. Along the edge these may differ without
    being apart, so what counts is the distance across it, and the sagitta of what is left along it.

    Parameters
    ----------
    uses : (k,) structured, see `hybrid_rt.cad.records.USE`
    xyz : (k, samples, 3)
        Points of each use on its own face.
    n_faces : int
    """
    real = np.flatnonzero(~uses["degenerated"])
    order = real[np.argsort(uses["edge"][real], kind="stable")]
    edge = uses["edge"][order]
    begins = np.flatnonzero(np.concatenate([[True], edge[1:] != edge[:-1]])) if len(edge) else edge
    count = np.diff(np.concatenate([begins, [len(edge)]]))
    free = order[begins[count % 2 == 1]]
    n_free = np.bincount(uses["face"][free], minlength=n_faces)
    # Every use after the first is compared with the first.
    first = np.repeat(order[begins], count - 1)
    others = np.ones(len(edge), np.bool_)
    others[begins] = False
    second = order[others]
    gap = np.maximum(_apart(xyz[first], xyz[second]), _apart(xyz[second], xyz[first]))
    face = np.stack([uses["face"][first], uses["face"][second]], axis=1).astype(np.int64)
    declared = np.maximum(uses["tolerance"][first], uses["tolerance"][second])
    of_use = np.zeros(len(uses))
    for side in (first, second):
        np.maximum.at(of_use, side, gap)
    return Edges(gap, face, declared, of_use, n_free)


def _apart(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return the largest distance of points of curves b from curves a, (n,)."""
    if not len(a):
        return np.empty(0)
    way = b - a
    tangent = np.gradient(a, axis=1)
    step = np.linalg.norm(tangent, axis=2)
    unit = tangent / np.maximum(step, 1e-300)[..., None]
    along = np.abs((way * unit).sum(axis=2))
    across = np.linalg.norm(way - (way * unit).sum(axis=2)[..., None] * unit, axis=2)
    bend = np.linalg.norm(np.gradient(unit, axis=1), axis=2) / np.maximum(step, 1e-300)
    near = across + 0.5 * bend * along**2
    # So far along that the tangent says little: both stay where they are.
    whole = np.linalg.norm(way, axis=2)
    distance: FloatArray = np.where(along > step, whole, np.minimum(near, whole)).max(axis=1)
    return distance


def gaps_of_faces(edges: Edges, n_faces: int) -> tuple[FloatArray, FloatArray]:
    """Return the largest gap of the edges of each face, measured and as the file declares it."""
    measured_gap, declared = np.zeros(n_faces), np.zeros(n_faces)
    for side in (0, 1):
        np.maximum.at(measured_gap, edges.face[:, side], edges.gap)
        np.maximum.at(declared, edges.face[:, side], edges.declared)
    return measured_gap, declared
