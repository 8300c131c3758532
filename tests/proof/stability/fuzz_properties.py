"""What must be true of a random case, and what of it is not.

Hits: the same bits without Embree, in any order and along longer directions; right by exact arithmetic;
bounds kept, points on their rays, work bounded. Scenes: rendered, or refused with a message that names
what is wrong.
"""

from __future__ import annotations

import json
import logging
import warnings
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.rendering.renderer import render
from proof.judge import Judge
from proof.stability.fuzz_cases import Case, build
from proof.stability.measure import WAYS, both_tracers, differences, traced

# Errors that may be raised, with a message.
REFUSALS = (ValueError, TypeError, OSError)
# What directions are multiplied by: no bit of a hit changes.
LONGER = 2.0**40


@contextmanager
def _unheard() -> Iterator[None]:
    """Keep the product's log silent."""
    log = logging.getLogger("hybrid_rt")
    as_before = log.level
    log.setLevel(logging.CRITICAL)
    try:
        yield
    finally:
        log.setLevel(as_before)


def faults_of(case: Case) -> tuple[str, ...]:
    """Return what does not hold for a case, in words; nothing where all does."""
    try:
        with ExitStack() as around:
            around.enter_context(warnings.catch_warnings())
            warnings.simplefilter("error")
            # What the product itself has to say to its user is no fault.
            warnings.simplefilter("ignore", UserWarning)
            around.enter_context(_unheard())
            if case["kind"] == "rays":
                return tuple(_faults_of_rays(case))
            return tuple(_faults_of_scene(case))
    except Exception as error:  # noqa: BLE001 (any other error is what is looked for)
        import traceback

        where = traceback.extract_tb(error.__traceback__)[-1]
        return (f"{type(error).__name__} in {Path(where.filename).name}: {error}",)


def _refused(error: Exception, names: list[str]) -> list[str]:
    """Return a fault where a refusal does not say what it is about."""
    text = str(error)
    named = any(name.lower() in text.lower() for name in names)
    return [] if named else [f"{type(error).__name__} that names none of {names}: {text!r}"]


# --- rays -----------------------------------------------------------------------------------------


def _faults_of_rays(case: Case) -> list[str]:
    surfaces = []
    for item in case["surfaces"]:
        try:
            surfaces.append(build(item))
        except (ValueError, TypeError) as error:
            return _refused(error, [item["class"]])
    origins = np.array(case["origins"], dtype=np.float64).reshape(-1, 3)
    directions = np.array(case["directions"], dtype=np.float64).reshape(-1, 3)
    if not len(origins):
        return []
    tracers = both_tracers(surfaces)
    hits, found = traced(surfaces, origins, directions, may_give_up=True, tracers=tracers)
    faults = [*found.faults, *_not_finite(hits)]
    for name, tracer in zip(WAYS, tracers, strict=True):
        given_up = tracer.counters["given_up"]
        if given_up and not tracer.counters["tangent"]:
            faults.append(f"coarse {name}: {given_up} searches given up, no row marked")
    tracer = tracers[1]
    order = np.random.default_rng(0).permutation(len(origins))
    again = tracer.intersect(origins[order], directions[order])
    faults += _differences("in another order", hits[order], again)
    longer = tracer.intersect(origins, directions * LONGER)
    longer = replace(longer, t=longer.t * LONGER, t_bound=longer.t_bound * LONGER)
    faults += _differences("along longer directions", hits, longer)
    faults += _judged(surfaces, origins, directions, hits)
    source = hits[hits.hit]
    if len(source):
        ways = directions[hits.hit][::-1]
        out, other = (tracer.intersect(source.position, ways, source=source) for tracer in tracers)
        faults += [*_differences("leaving, without Embree", out, other), *_not_finite(out)]
    return faults


def _differences(name: str, a: HitRecord, b: HitRecord) -> list[str]:
    columns = [
        item.name for item in fields(HitRecord) if isinstance(getattr(a, item.name), np.ndarray)
    ]
    return [f"{name}: {column} differs" for column in differences(a, b, columns)]


def _not_finite(hits: HitRecord) -> list[str]:
    return [
        f"{name} of a hit is no number"
        for name in ("t", "t_bound", "position", "normal")
        if not np.isfinite(getattr(hits, name)[hits.hit]).all()
    ]


def _judged(
    surfaces: list[Any], origins: FloatArray, directions: FloatArray, hits: HitRecord
) -> list[str]:
    """Judge hits by screen and exact arithmetic."""
    verdict = Judge(surfaces).judge(hits, origins, directions)
    return [
        f"{number} {words} in exact arithmetic, {verdict.examples}"
        for words, number in (
            ("wrong", verdict.n_wrong),
            ("bounds broken", verdict.bounds_broken),
            ("points beside the ray", verdict.off_ray),
            ("points of rows TANGENT beside the ray", verdict.off_ray_tangent),
        )
        if number
    ]


# --- scenes -----------------------------------------------------------------------------

CLASSES = [
    "Camera", "Sphere", "Box", "Rectangle", "Torus", "Plane", "SurfaceOfRevolution", "BezierPatches",
    "Light", "Sky", "Lambertian", "Mirror", "Metal", "Phong", "Dielectric", "Conductor", "Emissive",
    "Mix", "Texture", "Scene", "Object", "body", "lights[",
]  # fmt: skip


def _faults_of_scene(case: Case) -> list[str]:
    names: dict[str, Any] = {}
    exec(compile(case["script"], "scene.py", "exec"), names)  # noqa: S102 (a script of our own)
    options = {"ppm": PPMOptions(200), "photon_map": PhotonMapOptions(200)}
    try:
        scene = names["scene"]()
        result = render(
            scene, case["integrator"], 2, seed=case["seed"], threads=1, max_depth=8,
            options=options.get(case["integrator"]),
        )  # fmt: skip
    except REFUSALS as error:
        return _refused(error, CLASSES)
    faults = []
    if not np.isfinite(result.image).all():
        faults.append(f"{result.report.pixels_not_finite} pixels are no numbers")
    elif float(result.image.min()) < 0.0:
        faults.append("a pixel is below 0")
    work = result.report.intersection
    if work["given_up"] and not work["tangent"]:
        faults.append("searches given up, no row marked")
    json.dumps(result.report)
    return faults
