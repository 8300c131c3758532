"""Wrong first hits against seconds per ray: every accuracy, and Newton iteration without proof.

All tracers run in turn, so that changes of machine speed affect all alike. The truth are certified
hits, found without triangles and without Embree. Build times are measured separately.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.analysis.curves import Curve, Point, Spread
from hybrid_rt.analysis.methods import TOLERANCES, size_of
from hybrid_rt.analysis.newton_steps import SteppedHits
from hybrid_rt.analysis.ray_sets import RaySet
from hybrid_rt.core.progress import Say
from hybrid_rt.core.records import FloatArray, HitRecord, Status
from hybrid_rt.core.timing import Timing, in_turn, timed
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.hit_errors import Certified, certified_hits, compare
from hybrid_rt.scene.scene import Scene
from meshing import TrimmedSurface

# Steps of Newton's method that are tried: after six nothing changes but on the coarsest meshes.
NEWTON_STEPS = (0, 1, 2, 3, 4, 6)
# No wrong hit among n rays: at 95 % the share is below 3 / n (1 - (1 - 3 / n)^n = 0.95).
RULE_OF_THREE = 3.0


@dataclass(frozen=True)
class HitStudy:
    """Curves of first hits on one list of surfaces."""

    rays: int
    judged: int  # that hit something, and whose first hit is proven
    size: float  # diagonal of the surfaces
    curves: list[Curve]  # by tolerance; errors are shares of wrong first hits
    newton: list[Curve]  # by the number of steps, without proof, one for each mesh
    truth_bound: float  # mean proven bound of the true hits' error, scene units
    truth_seconds: float


def study_hits(
    surfaces: Sequence[Any],
    rays: RaySet,
    *,
    tolerances: Sequence[float] = TOLERANCES,
    runs: int = 5,
    threads: int | None = None,
    say: Say = lambda _: None,
) -> HitStudy:
    """Measure wrong first hits and seconds per ray of all accuracies, against certified hits.

    Accuracies differ on free-form surfaces alone: where there is none, certified hits are timed. Tolerances are
    relative to the diagonal of the surfaces.
    """
    n, size = len(rays.origins), size_of(surfaces)
    say(f"certified hits of {n} rays without Embree")
    bare, bare_seconds = timed(partial(Intersector, surfaces, coarse="none", threads=threads))
    truth, truth_seconds = timed(partial(certified_hits, bare, rays.origins, rays.directions))
    proven = truth.hits.hit & (truth.hits.status != Status.TANGENT)
    lengths = np.linalg.norm(rays.directions[proven], axis=1)
    truth_bound = float(np.mean(truth.hits.t_bound[proven] * lengths)) if proven.any() else 0.0
    finders = _finders(surfaces, tolerances, size, threads)
    finders["certified, no Embree", math.inf] = _Finder(bare.intersect, 0, bare_seconds)
    steppers = _steppers(surfaces, tolerances, size, threads)
    say(f"{len(finders) + len(steppers)} tracers, {runs} runs each")
    both = {**finders, **steppers}
    timings = in_turn(
        {key: partial(f.find, rays.origins, rays.directions) for key, f in both.items()}, runs
    )
    points: dict[str, list[Point]] = {}
    judged = 0
    for (name, setting), finder in both.items():
        found = finder.find(rays.origins, rays.directions)
        point, met = _hit_point(setting, finder, surfaces, truth, found, timings[name, setting])
        judged = max(judged, met)
        points.setdefault(name, []).append(point)
    names = {name for name, _ in finders}
    curves = [Curve(name, "", found) for name, found in points.items() if name in names]
    newton = [Curve(name, "", found) for name, found in points.items() if name not in names]
    return HitStudy(n, judged, size, curves, newton, truth_bound, truth_seconds)


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
    """Build tracers of all accuracies, by tolerance; none where nothing is tessellated."""
    finders: _Finders = {}
    if not any(s.is_freeform for s in surfaces):
        return finders
    build = partial(Intersector, surfaces, threads=threads)
    for share in sorted(tolerances, reverse=True):
        for accuracy in ("mesh", "refined", "certified"):
            tracer, seconds = timed(partial(build, accuracy, tolerance=share * size))
            finders[accuracy, share * size] = _Finder(tracer.intersect, tracer.n_triangles, seconds)
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


def _hit_point(
    setting: float, finder: _Finder, surfaces: Sequence[Any], truth: Certified, found: HitRecord,
    timing: Timing,
) -> tuple[Point, int]:  # fmt: skip
    """Return what one tracer found, and how many rays meet something by it or in truth."""
    n = len(found)
    errors = compare(truth, found.t, found.object_id)
    wrong = errors.wrong_hits
    share = errors.wrong
    angles = _angles(surfaces, truth.hits[wrong.right], found[wrong.right])
    more = {
        "triangles": float(finder.n_triangles),
        "build_seconds": finder.build_seconds,
        "mean_dt": errors.mean,
        "worst_dt": errors.worst,
        "worst_residual": float(found.residual[wrong.right].max(initial=0.0)),
        "mean_angle": float(angles.mean()) if len(angles) else 0.0,
        **{kind: float(count) for kind, count in wrong.counts.items()},
    }
    seconds = Spread(timing.median / n, timing.least / n, timing.most / n)
    return Point(setting, seconds, Spread(share, share, share), more), wrong.rays


def _angles(surfaces: Sequence[Any], true: HitRecord, found: HitRecord) -> FloatArray:
    """Return the angles between the normals of hits on free-form surfaces and true ones, degrees."""
    rows = np.array([s.is_freeform for s in surfaces])[true.object_id]
    across = np.linalg.norm(np.cross(found.normal[rows], true.normal[rows]), axis=1)
    along = np.einsum("ij,ij->i", found.normal[rows], true.normal[rows])
    return np.degrees(np.arctan2(across, along))
