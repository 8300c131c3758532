"""Row A35: the work of rays at singular sets of patches."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.demo import teapot
from hybrid_rt.intersection import Intersector
from meshing import BezierPatches
from proof.cases.campaign import placed_surfaces, trace_cell
from proof.cases.rational_surfaces import nurbs_sphere, octants
from proof.cases.singular_rays import interior
from proof.cases.singular_sets import SETS
from proof.stability.patch_nets import elevated
from proof.stability.row import Effort, Outcome, row

DISTANCES = (0.0, *(10.0**-k for k in range(16, 2, -1)))
# Distances from all singular sets, parts of the size.
NEARBY = tuple(10.0**-k for k in (3, *range(5, 17)))
# A piece is as much work as ten boxes, and so is what each ray needs before it meets the first.
PIECE = 10.0
MOST = 100.0
# Of rays that leave a patch along itself each is a touch; 99 to 101 times by seeds 0 to 3.
MORE = {"patches, leaving": 110.0}
# Ordinary rays of each surface.
FEW = 600
SINGULAR = tuple(name for name, entry in SETS.items() if entry.kind in ("patches", "rational"))


def _raised_lid() -> BezierPatches:
    return BezierPatches([elevated(net, 2) for net in teapot().patches[20:28]])


POLES: tuple[tuple[str, Callable[[], Any], tuple[float, float, float]], ...] = (
    ("NURBS sphere", nurbs_sphere, (0.0, 0.0, 1.0)),
    ("octants of a sphere", octants, (0.0, 0.0, 1.0)),
    ("lid of the teapot", teapot, (0.0, 0.0, 3.15)),
    ("lid, degree 5", _raised_lid, (0.0, 0.0, 3.15)),
)


def _beside(distance: float, n: int, rng: np.random.Generator) -> FloatArray:
    """Return vectors of a length across the z axis."""
    aside = rng.normal(size=(n, 3)) * (1.0, 1.0, 0.0)
    return distance * unit(aside)


@row("A35", "rays at singular sets of patches", "counted work, over that of ordinary rays")
def work_at_singular_sets(effort: Effort) -> Outcome:
    """Boxes and pieces, with those of displaced rays: at closed poles, and beside every kind of set."""
    total, n = Outcome(), effort.count(200, 12)
    for number, (name, make, pole) in enumerate(POLES):
        tracer, rng = Intersector([make()], coarse="none"), effort.rng(330 + number)
        above = np.array(pole) + np.array([0.0, 0.0, 3.0])
        ordinary = work_of(tracer, above + _beside(0.13, n, rng))
        for distance in DISTANCES:
            times = work_of(tracer, above + _beside(distance, n, rng)) / ordinary
            total = total.checked(
                times <= MOST, f"{name}: {times:.0f} times as much work at {distance:.0e}"
            )
            total += Outcome(rays=n)
    for number, name in enumerate(SINGULAR):
        surfaces, rng = placed_surfaces(name, "home"), effort.rng(380 + number)
        # Of fewer rays the mean work varies by a tenth.
        tracer, n = Intersector(surfaces, coarse="none"), effort.count(60, 40)
        targets, directions = interior(surfaces, FEW, rng), unit(rng.normal(size=(FEW, 3)))
        ordinary = work_of(tracer, targets.points - 3.0 * targets.size * directions, directions)
        for distance in NEARBY:
            cell = trace_cell(tracer, name, distance, "home", n, effort.seed)
            times = work_of(tracer, cell.origins, cell.directions, cell.source) / ordinary
            total = total.checked(
                times <= MORE.get(name, MOST),
                f"{name}: {times:.0f} times as much work at {distance:.0e}",
            )
            total += Outcome(rays=len(cell.hits))
    return total


def work_of(
    tracer: Intersector,
    origins: FloatArray,
    directions: FloatArray | tuple[float, float, float] = (0.0, 0.0, -1.0),
    source: HitRecord | None = None,
) -> float:
    """Return the work of a ray, in boxes that it meets."""
    tracer.forget_counters()
    tracer.intersect(origins, directions, source=source)
    count = tracer.counters
    boxes = count["nodes"] + count["cells"] + PIECE * count["slow_pieces"]
    return PIECE + float(boxes) / len(origins)
