"""Error against run time: work-precision diagrams of methods that render the same picture.

Every method runs at several settings, all of them in turn, so that changes of machine speed affect
all alike; errors are against a long render. Kernels are compiled beforehand; surfaces are built
within each run and that time is reported. `hybrid_rt.analysis.hit_study` does the same for first
hits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.analysis.curves import Curve, Point, spread
from hybrid_rt.analysis.methods import (
    Method,
    curved_surfaces,
    default_methods,
    finds_all_light,
    uncertified_methods,
)
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.core import checks
from hybrid_rt.core.progress import Say
from hybrid_rt.core.timing import timed
from hybrid_rt.integrators import DEFAULT, INTEGRATORS
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.renderer import RenderResult, render
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_metrics import DARK, picture_errors, relative_mse

Image = NDArray[np.float32]

REFERENCE_SEED, CHECK_SEED = 20_000, 30_000
# Integrators that references are made by, and checked by.
REFERENCES = tuple(name for name, declared in INTEGRATORS.items() if declared.finds_light_of_lamps)
# The picture that checks a reference has so many passes less.
FEWER_TO_CHECK = 4


@dataclass(frozen=True)
class Reference:
    """The reference of a picture study.

    Attributes
    ----------
    made_by : str
    own_error : float
        Its own relative RMSE, estimated; nan if unknown.
    mean, mean_error : float
        Mean radiance, and the standard error of it; nan if unknown.
    seconds : float
    check : dict or None
        A different method: ``made_by``, ``gap`` of the means, ``gap_error`` its standard error,
        ``difference`` of the pictures (relative RMSE) and ``by_noise``, ``by_blur``, what their
        noise and the blur of photons explain.
    """

    made_by: str
    own_error: float
    mean: float
    mean_error: float
    seconds: float
    check: dict[str, Any] | None


@dataclass(frozen=True)
class PictureStudy:
    """Curves of pictures of one scene.

    Attributes
    ----------
    size : (width, height)
    compile_seconds : float
    reference : Reference
    curves : list of Curve
    meshes : list of dict
        By method on uncertified hits: ``accuracy``, ``tolerance``, ``triangles``,
        ``build_seconds``, and the ``error`` of its pictures that passes do not remove, with the
        upper 95 % limit ``error_at_most``.
    images : dict of (height, width, 3) float32
        By method, the first run at its dearest setting; "reference" the reference.
    """

    size: tuple[int, int]
    compile_seconds: float
    reference: Reference
    curves: list[Curve]
    meshes: list[dict[str, Any]]
    images: dict[str, Image]


def study_picture(
    scene: Scene,
    passes: Sequence[int],
    *,
    runs: int = 3,
    reference_passes: int = 1024,
    reference: Picture | None = None,
    reference_by: str | None = None,
    methods: Sequence[Method] | None = None,
    threads: int | None = None,
    say: Say = lambda _: None,
) -> PictureStudy:
    """Measure error against seconds of all methods on one scene.

    Parameters
    ----------
    scene : Scene
    passes : sequence of int
        Increasing; the settings of each method.
    runs : int
        Number of runs per setting, each with its own seed.
    reference_passes : int
        Passes of the reference, unless one is given.
    reference : Picture, optional
        Must have the camera's resolution.
    reference_by : one of `REFERENCES`, optional
        Method of the reference; it is checked by another one. Default: of the methods that find all
        light the one with the smaller estimated error.
    methods : sequence of Method, optional
        Default: `default_methods`.
    threads : int, optional
    say : callable, optional
        Called with progress messages.

    Raises
    ------
    ValueError, TypeError
        If passes are not increasing, a setting is out of range, or the integrator of the reference
        does not find all light of the scene.
    """
    _check_picture_study(scene, passes, runs, reference, reference_by)
    chosen = default_methods(scene) if methods is None else list(methods)
    camera = scene.camera
    small = scene.with_camera(camera.resized(16, 12))
    say("compiling kernels")
    compile_seconds = sum(
        _run(small, method, 1, 0, threads).report["kernel_compilation_seconds"] for method in chosen
    )
    if reference is None:
        found, truth = _make_reference(scene, reference_by, reference_passes, threads, say)
    else:
        found, truth = _given_reference(reference), reference.image
    rows, images = _pictures(scene, chosen, passes, runs, truth, threads, say)
    meshes = []
    if any(method.integrator == DEFAULT for method in chosen):
        meshes = _meshes(scene, passes[-1], threads, say)
    biases = {row["method"]: row["error"] for row in meshes}
    curves = [
        Curve(
            method.name,
            method.flags,
            [_point(n, rows[method.name][n]) for n in passes],
            biases.get(method.name, 0.0),
            method.power,
        )
        for method in chosen
    ]
    return PictureStudy(
        (camera.width, camera.height), compile_seconds, found, curves, meshes, images
    )


def _check_picture_study(
    scene: Scene,
    passes: Sequence[int],
    runs: int,
    reference: Picture | None,
    reference_by: str | None,
) -> None:
    for n in passes:
        checks.whole(n, "passes", at_least=1)
    if list(passes) != sorted(set(passes)) or not passes:
        raise ValueError(f"passes are {list(passes)}: pass one or more, each above the one before")
    checks.whole(runs, "runs", at_least=1)
    if reference is not None and reference.image.shape[:2] != (
        scene.camera.height,
        scene.camera.width,
    ):
        raise ValueError(
            f"reference {reference.name} has {reference.image.shape[1]} x "
            f"{reference.image.shape[0]} pixels, the camera {scene.camera.width} x "
            f"{scene.camera.height}: pass a picture of that size"
        )
    if reference_by is not None and (
        reference_by not in REFERENCES or not finds_all_light(scene, reference_by)
    ):
        raise ValueError(
            f"reference_by is {reference_by!r}, which does not find all light of this scene: pass "
            + (" or ".join(n for n in REFERENCES if finds_all_light(scene, n)) or "a reference")
        )


def _pictures(
    scene: Scene,
    methods: Sequence[Method],
    passes: Sequence[int],
    runs: int,
    truth: Image,
    threads: int | None,
    say: Say,
) -> tuple[dict[str, dict[int, list[dict[str, float]]]], dict[str, Image]]:
    """Run all methods in turn; return figures by method and passes, and pictures by method."""
    rows: dict[str, dict[int, list[dict[str, float]]]] = {
        method.name: {n: [] for n in passes} for method in methods
    }
    images = {"reference": truth}
    for run in range(runs):
        for n in passes:
            say(f"run {run + 1} of {runs}: {n} passes of {len(methods)} methods")
            for method in methods:
                result = _run(scene, method, n, run + 1, threads)
                rows[method.name][n].append(_row(result, truth))
                if run == 0 and n == passes[-1]:
                    images[method.name] = result.image
    return rows, images


def _run(
    scene: Scene, method: Method, passes: int, seed: int, threads: int | None, *outputs: str
) -> RenderResult:
    return render(
        scene,
        method.integrator,
        passes,
        seed=seed,
        threads=threads,
        accuracy=method.accuracy,
        tolerance=method.tolerance,
        options=method.options,
        outputs=outputs,
    )


def _make_reference(
    scene: Scene, maker: str | None, passes: int, threads: int | None, say: Say
) -> tuple[Reference, Image]:
    """Render long by one integrator; and by another that shares no light transport, to check that.

    Photons check paths and paths photons, where both find all light; unless one was asked for, the
    one that states the smaller error is the reference. Where only one finds all light it is checked
    by itself, if it has another way to find the same (`Declaration.other_way`).
    """
    is_free = maker is None
    complete = [name for name in REFERENCES if finds_all_light(scene, name)]
    if maker is None:
        maker = complete[0] if complete else DEFAULT
    say(f"reference of {passes} passes by {maker}")
    main = _run(scene, Method(maker, maker), passes, REFERENCE_SEED, threads, "standard_error")
    check, n_main, name = None, passes, maker
    others = [Method(name, name) for name in complete if name != maker]
    way = INTEGRATORS[maker].other_way
    if complete == [maker] and way is not None and finds_all_light(scene, maker, way.options):
        others = [Method(f"{maker}, {way.name}", maker, options=way.options)]
    if others and maker in complete:
        n = max(passes // FEWER_TO_CHECK, min(passes, 2))
        say(f"the same by {others[0].name}, {n} passes")
        other = _run(scene, others[0], n, CHECK_SEED, threads, "standard_error")
        # Of light that paths find by rare chance alone photons are the better judges.
        is_free &= others[0].integrator != maker
        if is_free and stated_error(other.report) < stated_error(main.report):
            main, other, n_main, n = other, main, n, passes
            name, others = others[0].name, [Method(maker, maker)]
        check = _checked(main, other, f"{others[0].name}, {n} passes")
    noise = main.report["noise"] or {}
    return (
        Reference(
            f"{name}, certified, {n_main} passes",
            stated_error(main.report),
            float(main.image.mean(dtype=np.float64)),
            noise.get("standard_error_of_image_mean", math.nan),
            main.report["seconds"]["total"],
            check,
        ),
        main.image,
    )


def _checked(main: RenderResult, other: RenderResult, made_by: str) -> dict[str, Any]:
    """Return how far a picture is from one by another method, and what explains that."""
    noises = [result.report["noise"] or {} for result in (main, other)]
    errors = [noise.get("standard_error_of_image_mean", math.nan) for noise in noises]
    weight = main.image.astype(np.float64) ** 2 + DARK
    variance = sum(
        float((result.channels["standard_error"].astype(np.float64) ** 2 / weight).mean())
        for result in (main, other)
    )
    means = [float(result.image.mean(dtype=np.float64)) for result in (main, other)]
    return {
        "made_by": made_by,
        "gap": means[1] - means[0],
        "gap_error": math.hypot(*errors),
        "difference": math.sqrt(relative_mse(other.image, main.image)),
        "by_noise": math.sqrt(variance),
        "by_blur": math.hypot(*(stated_error(result.report, "blur") for result in (main, other))),
    }


def stated_error(report: dict[str, Any], part: str = "both") -> float:
    """Return the relative RMSE estimated in a report: "noise", "blur" or both; nan if unknown.

    If only an upper limit of the blur is known, that is used.
    """
    error = report.get("relative_error") or {}
    stated = error.get(part)
    if stated is None and part == "blur":
        stated = error.get("blur_at_most")
    return math.nan if stated is None else float(stated)


def _given_reference(picture: Picture) -> Reference:
    report = picture.report or {}
    noise = report.get("noise") or {}
    return Reference(
        f"the file {picture.name}",
        stated_error(report),
        float(picture.image.mean(dtype=np.float64)),
        noise.get("standard_error_of_image_mean", math.nan),
        report.get("seconds", {}).get("total", math.nan),
        None,
    )


def _row(result: RenderResult, truth: Image) -> dict[str, float]:
    """Return the figures of one run."""
    errors, report = picture_errors(result.image, truth), result.report
    stages = report["seconds"]
    return {
        # The audit of uncertified hits is not part of making the picture.
        "seconds": stages["total"] - stages.get("audit", 0.0),
        "error": errors.relative_rmse,
        "error_of_most": errors.relative_rmse_of_most,
        "mean_error": errors.relative_mean_error,
        "stated_error": stated_error(report),
        "build_seconds": stages.get("build", 0.0),
        "rays": float(sum(report["rays"].values())),
    }


def _point(setting: float, rows: Sequence[dict[str, float]]) -> Point:
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    seconds, error = columns.pop("seconds"), columns.pop("error")
    more = {name: float(np.median(values)) for name, values in columns.items()}
    return Point(setting, spread(seconds), spread(error), more)


def _meshes(scene: Scene, passes: int, threads: int | None, say: Say) -> list[dict[str, Any]]:
    """Measure what meshes, and hits that are not certified, do to a picture.

    The differences between such pictures and certified ones, made with the same random numbers,
    still hold noise; but that of one seed is independent of that of another, so the mean of the
    product of two differences is the square of what stays.
    """
    methods = uncertified_methods(scene)
    if not methods:
        return []
    surfaces = curved_surfaces(scene)
    say("pictures of meshes, each twice, with the random numbers of certified ones")
    certified = Method(DEFAULT, DEFAULT)
    exact = [_run(scene, certified, passes, seed, threads).image for seed in (1, 2)]
    weight = np.mean(exact, axis=0, dtype=np.float64) ** 2 + DARK
    rows = []
    for method in methods:
        one, other = (
            _run(scene, method, passes, seed, threads).image.astype(np.float64) - exact[seed - 1]
            for seed in (1, 2)
        )
        # Channels of a pixel share their noise; pixels are independent.
        products = (one * other / weight).mean(axis=2)
        square = max(float(products.mean()), 0.0)
        of_square = float(products.std(ddof=1)) / math.sqrt(products.size)
        tracer, seconds = timed(
            partial(Intersector, surfaces, method.accuracy, tolerance=method.tolerance, threads=1)
        )
        rows.append(
            {
                "method": method.name,
                "accuracy": method.accuracy,
                "tolerance": method.tolerance,
                "triangles": float(tracer.n_triangles),
                "build_seconds": seconds,
                "error": math.sqrt(square),
                "error_at_most": math.sqrt(square + 1.96 * of_square),
            }
        )
    return rows
