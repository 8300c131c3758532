"""Rows H01 and H02: flat faces that meet at small angles, and such that are skew or flat."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import trimesh
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray, NamedPoints, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Box, Rectangle, TriangleMesh
from proof.exact.crossings import bits, rational
from proof.exact.truth import ExactScene
from proof.stability.measure import EPS, Plot
from proof.stability.measure_exact import by_exact, exact_errors
from proof.stability.row import Effort, Outcome, row

ANGLES = 10.0 ** -np.arange(1.0, 9.0)


def _mesh(vertices: ArrayLike, faces: list[tuple[int, int, int]]) -> TriangleMesh:
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def _wedges(angle: float, turn: FloatArray) -> dict[str, tuple[list[Any], int]]:
    """Return surfaces with a sharp edge from 0 along the first column, and the patch of their face z = 0."""
    x, y, z = turn.T
    other = 0.7 * y + angle * z
    matrix = np.eye(4)
    matrix[:3, :3] = np.column_stack([x, y, other])
    vertices = np.stack([0 * x, x, y, other])
    return {
        "box": ([Box((0, 0, 0), (1, 1, 1)).transformed(matrix)], 4),
        "rectangles": ([Rectangle(0 * x, x, y), Rectangle(0 * x, other, x)], 0),
        "mesh": ([_mesh(vertices, [(0, 1, 2), (0, 3, 1)])], 0),
    }


@row("H01", "leaving a face beside a sharp edge", "exact crossings")
def beside_sharp_edges(effort: Effort) -> Outcome:
    """Angles of 1e-1 to 1e-8, 1e-1 to 1e-17 from the edge: the other face is met, or the row says TANGENT."""
    total, n = Outcome(), effort.count(400, 6)
    for k, angle in enumerate(ANGLES):
        rng = effort.rng(k)
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        for surfaces, left in _wedges(angle, turn).values():
            beside, place = 10.0 ** rng.uniform(-17, -1, n), rng.uniform(0.2, 0.6, n)
            origins = np.stack([place, beside, 0 * place], axis=1) @ turn.T
            directions = rng.normal(size=(n, 3))
            directions[:, 2] = np.abs(directions[:, 2]) + 0.2
            directions = directions @ turn.T
            source = NamedPoints(np.zeros(n, np.int32), origins)
            hits = Intersector(surfaces).intersect(origins, directions, source=source)
            scene, wrong, broken = ExactScene(surfaces), 0, 0
            for i in np.flatnonzero(hits.status != Status.TANGENT):
                first = next(
                    (
                        one
                        for one in scene.crossings(origins[i], directions[i])
                        if one.t > 0.0 and (one.object_id, one.crossing.patch_id) != (0, left)
                    ),
                    None,
                )
                wrong += (first is not None) != bool(hits.hit[i])
                if first is not None and hits.hit[i]:
                    with bits(512):
                        gap = abs(first.crossing.t - rational(hits.t[i]))
                        broken += float(gap.lower()) > hits.t_bound[i]
            marked = hits.status == Status.TANGENT
            total += Outcome(rays=n, wrong=wrong, broken=broken, undecided=int(marked.sum()))
            # The rounding of origin and faces reaches no farther than the band.
            is_clear = beside * angle > 64 * EPS * 3.0
            total = total.checked(not (marked & is_clear).any(), f"needless TANGENT at {angle:.0e}")
    return total


def _flattened(angle: float) -> Box:
    matrix = np.array([[1, 0, 0, 0], [0, 1, 0.5, 0], [0, 0, angle, 0], [0, 0, 0, 1]])
    return Box((-1, -0.5, -0.25), (1, 0.75, 1.5)).transformed(matrix)


SKEW: dict[str, Callable[[float], Any]] = {
    "rectangle": lambda a: Rectangle(
        (0.1, 0.2, 0.3), (1, 0.3, 0.2), (1 + 0.3 * a, 0.3 - a, 0.2 + 0.7 * a)
    ),
    "box": _flattened,
    "triangle": lambda a: _mesh(
        [(0.1, 0.2, 0.3), (1, 0.3, 0.2), (1, 0.3 + a, 0.2 - a)], [(0, 1, 2)]
    ),
}


@row("H02", "skew and flattened faces", "exact crossings")
def skew_faces(effort: Effort) -> Outcome:
    """Edges at angles of 1e-1 to 1e-8, boxes as flat: points on their rays, bounds of a band over cos."""
    total, curves, n = Outcome(), [], effort.count(400, 6)
    for name, make in SKEW.items():
        plot = Plot("angle between the edges", name)
        for k, angle in enumerate(ANGLES):
            surface, rng = make(angle), effort.rng(k)
            inside = rng.uniform(0.05, 0.45, (2, n))
            if isinstance(surface, Box):
                targets = surface.lo + rng.random((n, 3)) @ surface.edges
            else:
                targets = surface.point(*inside, 0)
            directions = rng.normal(size=(n, 3))
            origins = targets - directions
            total += by_exact([surface], origins, directions)
            hits, scene = (
                Intersector([surface]).intersect(origins, directions),
                ExactScene([surface]),
            )
            error, expected = exact_errors(scene, hits, origins, directions)
            size = surface.size
            total += plot.add(angle, error / size, expected / size)
            length = np.linalg.norm(directions, axis=1)
            bound = (hits.t_bound * length)[hits.status == Status.HIT]
            wide = len(bound) == len(expected) and bool((bound > 2.0 * expected).any())
            total = total.checked(
                not wide, f"bounds of t above two bands / cos, {name}, {angle:.0e}"
            )
        curves.append(plot.curve)
    return replace(total, curves=tuple(curves))
