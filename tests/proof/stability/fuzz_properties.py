"""What must be true of a random case, and what of it is not.

Hits: the same bits without Embree, in any order and along longer directions; right by exact arithmetic, and
by exact arithmetic where it objects; bounds kept, points on their rays, work bounded. Scenes and
files: done, or refused with a message that names what is wrong.
"""

from __future__ import annotations

import base64
import json
import logging
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.renderer import render
from hybrid_rt.textures import ImageTexture
from meshing import BezierPatches
from proof.judge import Judge
from proof.stability.fuzz_cases import Case, build

# Errors that may be raised, with a message.
REFUSALS = (ValueError, TypeError, OSError)
# What reads files of which ending.
Readers = Mapping[str, Callable[[Path], object]]
READERS: Readers = {"bpt": BezierPatches.read, "png": ImageTexture, "bmp": ImageTexture}
# Pieces that one search may look at: far above those of any row of the catalogue.
MOST_WORK = 5000


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


def faults_of(case: Case, readers: Readers = READERS) -> tuple[str, ...]:
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
            if case["kind"] == "scene":
                return tuple(_faults_of_scene(case))
            return tuple(_faults_of_file(case, readers))
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
    tracer, plain = (
        Intersector(surfaces, coarse=coarse, threads=1) for coarse in ("embree", "none")
    )
    hits = tracer.intersect(origins, directions)
    faults = _differences("without Embree", hits, plain.intersect(origins, directions))
    order = np.random.default_rng(0).permutation(len(origins))
    again = tracer.intersect(origins[order], directions[order])
    faults += _differences("in another order", hits[order], again)
    longer = tracer.intersect(origins, directions * 2.0**40)
    faults += _differences("along longer directions", hits, longer, times=2.0**40)
    faults += _not_finite(hits)
    faults += _judged("first hits", surfaces, origins, directions, hits)
    source = hits[hits.hit]
    if len(source):
        leaving = directions[hits.hit][::-1]
        outward = tracer.intersect(source.position, leaving, source=source)
        faults += _differences(
            "leaving, without Embree",
            outward,
            plain.intersect(source.position, leaving, source=source),
        )
        faults += _not_finite(outward)
    for name, counters in (("embree", tracer.counters), ("none", plain.counters)):
        if counters["given_up"] and not counters["tangent"]:
            faults.append(f"coarse {name}: {counters['given_up']} searches given up, no row marked")
        if counters["most_pieces"] > MOST_WORK:
            faults.append(f"coarse {name}: {counters['most_pieces']} pieces")
    return faults


def _differences(name: str, a: HitRecord, b: HitRecord, times: float = 1.0) -> list[str]:
    found = []
    for item in fields(HitRecord):
        one, two = getattr(a, item.name), getattr(b, item.name)
        if not isinstance(one, np.ndarray):
            continue
        if item.name in ("t", "t_bound") and times != 1.0:
            two = two * times
        same = one == two
        if one.dtype.kind == "f":
            same |= np.isnan(one) & np.isnan(two)
        if not same.all():
            rows = np.flatnonzero(~same.reshape(len(same), -1).all(axis=1))
            found.append(f"{name}: {item.name} of rays {rows[:5].tolist()} differ")
    return found


def _not_finite(hits: HitRecord) -> list[str]:
    hit = hits.hit
    faults = []
    for name in ("t", "t_bound", "position", "normal"):
        if not np.isfinite(getattr(hits, name)[hit]).all():
            faults.append(f"{name} of a hit is no number")
    lengths = np.linalg.norm(hits.normal[hit], axis=1)
    if (np.abs(lengths - 1.0) > 1e-12).any():
        faults.append("a normal is not of length one")
    return faults


def _judged(
    name: str, surfaces: list[Any], origins: FloatArray, directions: FloatArray, hits: HitRecord
) -> list[str]:
    """Judge hits by screen and exact arithmetic."""
    verdict = Judge(surfaces).judge(hits, origins, directions)
    return [
        f"{name}: {number} {words} in exact arithmetic, {verdict.examples}"
        for words, number in (
            ("wrong", verdict.n_wrong),
            ("bounds broken", verdict.bounds_broken),
            ("points beside the ray", verdict.off_ray),
            ("points of rows TANGENT beside the ray", verdict.off_ray_tangent),
        )
        if number
    ]


# --- scenes and files -----------------------------------------------------------------------------

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


def _faults_of_file(case: Case, readers: Readers) -> list[str]:
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / f"damaged.{case['ending']}"
        file.write_bytes(base64.b64decode(case["data"]))
        try:
            readers[case["ending"]](file)
        except REFUSALS as error:
            # What is in the file may be named instead, once it was read.
            return _refused(error, [file.name, "BezierPatches patch"])
    return []
