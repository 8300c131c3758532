"""Wrong first hits against seconds per ray: every accuracy, and Newton iteration without proof.

All tracers run in turn, so that changes of machine speed affect all alike; errors are against the
oracle. Build times are measured separately.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.analysis.curves import Curve, Point, Spread
from hybrid_rt.analysis.methods import TOLERANCES, size_of
from hybrid_rt.analysis.newton_steps import SteppedHits
from hybrid_rt.core.progress import Say
from hybrid_rt.core.ray_set import RaySet
from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.core.timing import Timing, in_turn, timed
from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.scene import Scene
from hybrid_rt.verify.judges.hit_errors import HitErrors, hit_errors
from hybrid_rt.verify.judges.oracle import first_hits, workers_of
from meshing import TrimmedSurface

# Steps of Newton's method that are tried: after six nothing changes but on the coarsest meshes.
NEWTON_STEPS = (0, 1, 2, 3, 4, 6)
# No wrong hit among n rays: at 95 % the share is below 3 / n (1 - (1 - 3 / n)^n = 0.95).
RULE_OF_THREE = 3.0


@dataclass(frozen=True)
class HitStudy:
    """Curves of first hits on one list of surfaces.

    Attributes
    ----------
    rays, judged : int
        Rays traced; those of them that the oracle decides and that hit something.
    size : float
        Diagonal of the surfaces.
    curves : list of Curve
        Their settings are tolerances, errors shares of wrong first hits; ``more`` holds
        ``triangles``, ``build_seconds``, ``mean_dt``, ``worst_dt``, ``worst_residual``,
        ``mean_angle``, ``missed``, ``phantom``, ``farther``.
    newton : list of Curve
        Newton's method without proof by a fixed number of steps, one curve for each tolerance; the
        settings are those numbers. None where a surface needs no steps, is trimmed or rational, or
        is a part of a turn.
    oracle_seconds : float
    """

    rays: int
    judged: int
    size: float
    curves: list[Curve]
    newton: list[Curve]
    oracle_seconds: float


def study_hits(
    surfaces: Sequence[Any],
    rays: RaySet,
    *,
    tolerances: Sequence[float] = TOLERANCES,
    runs: int = 5,
    threads: int | None = None,
    say: Say = lambda _: None,
) -> HitStudy:
    """Measure wrong first hits and seconds per ray of all accuracies, against the oracle.

    Parameters
    ----------
    surfaces : sequence of surfaces
    rays : RaySet
    tolerances : sequence of float
        Of the coarse meshes, relative to the diagonal of the surfaces.
    runs : int
        Of each, in turn.
    threads : int, optional
    say : callable, optional

    Raises
    ------
    TypeError
        For surfaces that the oracle does not know, by name.
    """
    workers_of(surfaces)
    n, size = len(rays.origins), size_of(surfaces)
    say(f"the oracle on {n} rays")
    truth, oracle_seconds = timed(
        lambda: first_hits(surfaces, rays.origins, rays.directions, threads=threads)
    )
    finders = _finders(surfaces, tolerances, size, threads)
    steppers = _steppers(surfaces, tolerances, size, threads)
    say(f"{len(finders) + len(steppers)} tracers, {runs} runs each")
    both = {**finders, **steppers}
    timings = in_turn(
        {key: partial(f.find, rays.origins, rays.directions) for key, f in both.items()}, runs
    )
    points: dict[str, list[Point]] = {}
    judged = 0
    for (name, setting), finder in both.items():
        errors = hit_errors(finder.find(rays.origins, rays.directions), truth)
        judged = max(judged, errors.wrong_hits.rays)
        point = _hit_point(setting, finder, errors, timings[name, setting], n)
        points.setdefault(name, []).append(point)
    names = {name for name, _ in finders}
    curves = [Curve(name, "", found) for name, found in points.items() if name in names]
    newton = [Curve(name, "", found) for name, found in points.items() if name not in names]
    return HitStudy(n, judged, size, curves, newton, oracle_seconds)


def camera_rays(scene: Scene, n: int) -> RaySet:
    """Return about n rays of a scene's camera through pixel centres."""
    camera = scene.camera
    share = math.sqrt(n / (camera.width * camera.height))
    width = max(round(camera.width * share), 1)
    small = camera.resized(width)
    row, column = np.divmod(np.arange(small.width * small.height), small.width)
    origins, directions = small.rays(column + 0.5, row + 0.5)
    return RaySet(origins, directions, np.full(len(origins), "camera"))


@dataclass(frozen=True)
class _Finder:
    """One way to find first hits: from origins and directions."""

    find: Callable[[FloatArray, FloatArray], HitRecord]
    n_triangles: int
    build_seconds: float


_Finders = dict[tuple[str, float], _Finder]
"""By name and setting."""


def _finders(
    surfaces: Sequence[Any], tolerances: Sequence[float], size: float, threads: int | None
) -> _Finders:
    """Build tracers of all accuracies, by tolerance."""
    finders: _Finders = {}
    build = partial(Intersector, surfaces, threads=threads)
    for share in sorted(tolerances, reverse=True):
        for accuracy in ("mesh", "refined", "certified"):
            tracer, seconds = timed(partial(build, accuracy, tolerance=share * size))
            finders[accuracy, share * size] = _Finder(tracer.intersect, tracer.n_triangles, seconds)
    bare, seconds = timed(partial(build, coarse="none"))
    finders["certified, no Embree", math.inf] = _Finder(bare.intersect, 0, seconds)
    return finders


def _steppers(
    surfaces: Sequence[Any], tolerances: Sequence[float], size: float, threads: int | None
) -> _Finders:
    """Build Newton's method by fixed numbers of steps; none where it is not defined for a surface."""
    steppers: _Finders = {}
    # Closed forms need no steps. Of trimmed surfaces steps alone do not say which roots count.
    if any(not s.is_freeform or isinstance(s, TrimmedSurface) for s in surfaces):
        return steppers
    for share in sorted(tolerances, reverse=True):
        try:
            stepped, seconds = timed(partial(SteppedHits, surfaces, share * size, threads))
        except TypeError:  # steps are counted on polynomial patches and whole turns
            return steppers
        for steps in NEWTON_STEPS:
            find = partial(stepped.intersect, steps=steps)
            name = f"Newton, {stepped.n_triangles} triangles"
            steppers[name, float(steps)] = _Finder(find, stepped.n_triangles, seconds)
    return steppers


def _hit_point(setting: float, finder: _Finder, errors: HitErrors, timing: Timing, n: int) -> Point:
    """Return what one tracer found of n rays."""
    wrong = errors.wrong_hits
    share = wrong.wrong / max(wrong.rays, 1)
    more = {
        "triangles": float(finder.n_triangles),
        "build_seconds": finder.build_seconds,
        "mean_dt": errors.mean_dt,
        "worst_dt": errors.worst_dt,
        "worst_residual": errors.worst_residual,
        "mean_angle": errors.mean_angle,
        **{kind: float(count) for kind, count in wrong.counts.items()},
    }
    seconds = Spread(timing.median / n, timing.least / n, timing.most / n)
    return Point(setting, seconds, Spread(share, share, share), more)
