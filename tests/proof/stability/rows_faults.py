"""Rows F01 to F08: faults of geometry that were met once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import silhouettes, unit
from hybrid_rt.core.records import FloatArray, HitRecord, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives import Sphere
from meshing import SurfaceOfRevolution
from proof.cases.rays import chords, edges
from proof.cases.singular_rays import size_of
from proof.cases.singular_surfaces import (
    CONE,
    EGG,
    LENS,
    PARABOLOID,
    SPINDLE,
    tilted_flat,
    uneven_lune,
)
from proof.exact.judge import ExactJudge
from proof.stability.measure import (
    DISTANCES,
    EPS,
    both_tracers,
    differences,
    traced,
    verdict_outcome,
)
from proof.stability.measure_exact import (
    by_exact,
    by_set,
    exact_errors,
    exact_verdict,
)
from proof.stability.row import Effort, Outcome, Plot, row

ORIGIN, AXIS = (0.0, 0.0, 0.0), (0.0, 0.0, 1.0)
OGIVE = [[(0.0, 0.0), (0.5, 0.9), (2.0, 1.0)], [(2.0, 1.0), (2.0, 0.0)]]
SPHERES = [
    ((0.0, 1.0, 0.0), 1.0),
    ((0.3, 0.2, 0.1), 0.37),
    ((0.0, -1000.0, 0.0), 1000.0),
    ((1e5, 0.0, 0.0), 99999.0),
]


def _beside(
    effort: Effort,
    label: str,
    surface: SurfaceOfRevolution,
    at: FloatArray,
    what: str,
    rays: int = 60,
    marks: bool = True,
) -> Outcome:
    """Judge rays beside a point, from as near as they pass and from far; a curve for each."""
    size, total, curves = size_of(surface), Outcome(), []
    judge, tracers = ExactJudge([surface]), both_tracers([surface])
    for name, is_near in (("from near", True), ("from far", False)):
        plot = Plot(f"distance from {what} / size", f"{label}, {name}")
        n = effort.count(rays, 2)
        for k in DISTANCES:
            rng = effort.rng(100 * round(-np.log10(k)) + is_near)
            directions = unit(rng.normal(size=(n, 3)))
            targets = at + k * size * unit(rng.normal(size=(n, 3)))
            back = size * (k if is_near else 1.0) * rng.uniform(0.5, 1.5, (n, 1))
            origins = targets - back * directions
            hits, found = traced([surface], origins, directions, tracers=tracers)
            verdict = verdict_outcome(
                exact_verdict(judge, hits, origins, directions, k * size), marks
            )
            if not verdict.holds:
                where = f"{label} {name}, {k:.0e}, seed {effort.seed}, {n} rays"
                verdict = replace(verdict, notes=(*verdict.notes, where))
            total += found + replace(verdict, rays=0, undecided=0)
            error, expected = exact_errors(judge.scene, hits, origins, directions)
            total += plot.add(k, error / size, expected / size, found.work)
        curves.append(plot)
    return replace(total, curves=tuple(curves))


def _turned(*segments: Any) -> SurfaceOfRevolution:
    return SurfaceOfRevolution(list(segments), ORIGIN, AXIS)


@row("F01", "beside the tip of a turned surface", "exact crossings")
def tips(effort: Effort) -> Outcome:
    """Cone, lens and ogive, 1e-1 to 1e-14 beside; every aim at tips of other slopes."""
    total = Outcome()
    for label, surface, z in (
        ("cone", _turned(CONE), 0.0), ("lens", _turned(LENS), -0.5), ("ogive", _turned(*OGIVE), 0.0)
    ):  # fmt: skip
        total += _beside(effort, label, surface, np.array([0.0, 0.0, z]), "a tip")
    for name in ("flat cone tip", "needle tip", "cone tip, leaving"):
        # A needle lies between the rays that are moved around its tip.
        marks = name != "needle tip"
        total += by_set(name, effort, 40, against="distance from a tip / size", marks=marks)
    return total


@row("F02", "beside a rounded pole", "exact crossings")
def poles(effort: Effort) -> Outcome:
    """Paraboloid, egg and ball; rays that leave beside a pole."""
    total = Outcome()
    for label, surface, z in (
        ("paraboloid", _turned(PARABOLOID), 0.0), ("egg", _turned(EGG), -1.0)
    ):  # fmt: skip
        total += _beside(effort, label, surface, np.array([0.0, 0.0, z]), "a rounded pole")
    for name in ("ball poles", "paraboloid pole, leaving"):
        total += by_set(name, effort, 40, against="distance from a rounded pole / size")
    return total


@row("F03", "beside a spindle; an axis far from the origin", "exact crossings")
def spindles(effort: Effort) -> Outcome:
    """Profiles tangent to the axis; cone and egg about an axis 2e6 away."""
    total = _beside(effort, "spindle", _turned(SPINDLE), np.zeros(3), "a spindle", marks=False)
    total += by_set(
        "sharp spindle", effort, 40, against="distance from a spindle / size", marks=False
    )
    far = (1e6, -2e6, 5e5)
    for label, profile in (("far cone", CONE), ("far egg", EGG)):
        surface = SurfaceOfRevolution(profile, far, (0.3, -0.2, 1.0))
        at = surface.origin + profile[0][0] * surface.axis
        total += _beside(effort, label, surface, at, "a tip or pole, axis 2e6 away", 20)
    return total


@row("F04", "patch with two poles and unequal degrees", "closed form; exact crossings")
def lunes(effort: Effort) -> Outcome:
    """Hit in its middle, wherever it stands; judged beside its poles."""
    total = Outcome()
    for turn in (False, True):
        surface, move = uneven_lune(), np.eye(4)
        if turn:
            move[:3] = [[0, -2, 0, 5], [2, 0, 0, 6], [0, 0, 2, -7]]
        surface = surface.transformed(move)
        origins = np.array([(1, 0, 5.0), (1, 0, -5.0)]) @ move[:3, :3].T + move[:3, 3]
        target = move[:3, :3] @ (1, 0, 0.25) + move[:3, 3]
        hits, found = traced([surface], origins, target - origins)
        off = np.abs(np.stack([hits.t - 1.0, hits.u - 0.5, hits.v - 0.5])) > 8 * EPS
        wrong = off.any(axis=0) | (hits.status != Status.HIT)
        total += found + Outcome(wrong=int(wrong.sum()))
    rays = chords([uneven_lune()], effort.count(200, 10), seed=effort.seed + 3)
    total += by_exact([uneven_lune()], rays.origins, rays.directions)
    # Seen along its tangent plane a pole lies between the rays that are moved around it.
    return total + by_set(
        "uneven lune", effort, 20, against="distance from a lune's pole / size", marks=False
    )


def _directions_from(normal: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return directions: half of them even over all, half grazing, cos from 1e-1 to 1e-6."""
    n = len(normal)
    aside = unit(np.cross(normal, unit(rng.normal(size=(n, 3)))))
    cosine = 10.0 ** rng.uniform(-6, -1, (n, 1)) * rng.choice([-1.0, 1.0], (n, 1))
    even = rng.random((n, 1)) < 0.5
    return np.where(even, unit(rng.normal(size=(n, 3))), aside + cosine * normal)


def _leave(
    hits: HitRecord, center: FloatArray, radius: float, tracer: Intersector, rng: Any
) -> tuple[HitRecord, Outcome]:
    """Trace one generation; return what it meets, held against the other root, 2 r cos away."""
    direction = _directions_from(hits.normal, rng)
    met = tracer.intersect(hits.position, direction, source=hits)
    length = np.linalg.norm(direction, axis=1)
    slope = np.einsum("ij,ij->i", hits.position - center, direction) / (radius * length)
    inward = slope < 0.0
    wrong = (met.hit & ~inward) | (~met.hit & inward)
    # The point lies off the sphere by an ulp of its coordinates, which moves the chord by that
    # over cos; the cosine above has the rounding of a sum.
    size = np.abs(hits.position).max(axis=1)
    slack = 4 * EPS * (size / np.abs(slope) + 4.0 * radius)
    both = inward & met.hit
    gap = np.abs(met.t * length + 2.0 * radius * slope)[both]
    error = gap / (slack + met.t_bound * length)[both]
    outcome = Outcome(
        rays=len(hits), wrong=int(wrong.sum()), error=float(error.max(initial=0.0)),
        undecided=int((met.status == Status.TANGENT).sum()),
    )  # fmt: skip
    return met[met.hit], outcome


@row("F05", "rays that leave a sphere which passes near 0", "closed form")
def departures(effort: Effort) -> Outcome:
    """Three generations from four spheres: no departure met again, nothing else lost."""
    total, n = Outcome(), effort.count(1_000_000, 2000)
    for number, (at, radius) in enumerate(SPHERES):
        center, rng = np.asarray(at), effort.rng(number)
        toward_0 = -center / np.linalg.norm(center)
        spread = 10.0 ** rng.uniform(-12, 0, (n, 1)) * unit(rng.normal(size=(n, 3)))
        outward = np.where(rng.random((n, 1)) < 0.5, unit(toward_0 + spread), unit(spread))
        tracer = Intersector([Sphere(at, radius)])
        hits = tracer.intersect(center + 2.0 * radius * outward, -outward)
        total = total.checked(bool(hits.hit.all()), f"a ray misses sphere {number}")
        for _ in range(3):
            hits, found = _leave(hits, center, radius, tracer, rng)
            total += found
    return total


def _random_profile(rng: np.random.Generator) -> list[list[tuple[float, float]]]:
    """Return one to three segments of degrees 1 to 5, some of which end on the axis."""
    segments: list[list[tuple[float, float]]] = []
    z, r = 0.0, float(rng.uniform(0.1, 1.0)) * float(rng.random() < 0.6)
    n_segments = int(rng.integers(1, 4))
    for k in range(n_segments):
        degree = int(rng.integers(1, 6))
        net = [(z, r)]
        for _ in range(degree):
            net.append((z + float(rng.uniform(-0.5, 1.5)), float(rng.uniform(0.1, 1.5))))
        # A line from the axis to the axis would lie on it.
        if k == n_segments - 1 and rng.random() < 0.4 and (degree > 1 or r > 0.0):
            net[-1] = (net[-1][0], 0.0)
        segments.append(net)
        z, r = net[-1]
    return segments


@row("F06", "by way of Embree and without, random turned surfaces", "identity")
def both_ways(effort: Effort) -> Outcome:
    """1000 rays on each of many random profiles, a third of them grazing: the same bits."""
    total, n = Outcome(), 1000
    makers: tuple[tuple[Callable[..., Any], int], ...] = (
        (chords, n // 3), (silhouettes, n // 3), (edges, n - 2 * (n // 3))
    )  # fmt: skip
    for k in range(effort.count(1000, 5)):
        rng = effort.rng(k)
        surface = SurfaceOfRevolution(_random_profile(rng), rng.normal(size=3), rng.normal(size=3))
        sets = [make([surface], m, seed=effort.seed + k) for make, m in makers]
        o = np.concatenate([rays.origins for rays in sets])
        d = np.concatenate([rays.directions for rays in sets])
        a, b = (Intersector([surface], coarse=way).intersect(o, d) for way in ("none", "embree"))
        names = differences(a, b)
        total += Outcome(rays=n, undecided=int((a.status == Status.TANGENT).sum())).checked(
            not names, f"profile {k} of seed {effort.seed}: {', '.join(names)} differ"
        )
    return total


@row("F07", "ray almost within a flat patch", "exact crossings; fractions")
def almost_within(effort: Effort) -> Outcome:
    """Cosines of 1e-3 to 1e-16: the point lies within the band of the ray, or TANGENT."""
    total = Outcome()
    cosines = tuple(10.0**-k for k in range(3, 17))
    for name in ("flat patch, nearly within", "flat bicubic, nearly within"):
        total += by_set(
            name, effort, 30, against="cosine between ray and normal", distances=cosines,
            marks=False,
        )  # fmt: skip
    surface = tilted_flat()
    judge, size, n = ExactJudge([surface]), size_of(surface), effort.count(60, 2)
    tracers = both_tracers([surface])
    plot = Plot(
        "cosine between ray and normal", "flat bicubic", unit="bands, of the point beside the ray"
    )
    for k in cosines:
        rng = effort.rng(round(-np.log10(k)))
        u, v = rng.uniform(0.05, 0.95, (2, n))
        points = surface.point(u, v, np.zeros(n, int))
        normals = surface.normal(u, v, np.zeros(n, int))
        along = unit(np.cross(normals, unit(rng.normal(size=(n, 3)))))
        directions = unit(along + k * rng.choice([-1.0, 1.0], (n, 1)) * normals)
        origins = points - size * rng.uniform(0.1, 2.0, (n, 1)) * directions
        hits, found = traced([surface], origins, directions, tracers=tracers)
        verdict = judge.judge(hits, origins, directions)  # marks do not matter here
        gap = np.array([verdict.worst_gap])
        total += found.checked(verdict.off_ray == 0, f"{verdict.off_ray} points off at {k:.0e}")
        if gap[0] > 0.0:
            total += plot.add(k, gap, np.ones(1), found.work)
    return replace(total, curves=(*total.curves, plot))


@row("F08", "decisions within rounding", "exact crossings of moved rays")
def decisions(effort: Effort) -> Outcome:
    """Aimed at tips, poles, collapsed edges, creases and rims, a band or less beside: TANGENT.

    The mark must stand where moving the ray by an eighth of the band of the surface's size changes
    the first hit, and must not where moving it by four bands of the ray does not.
    """
    total = Outcome()
    for name in (
        "cone tip", "paraboloid pole", "apex of the lid", "collapsed edge", "joint, sharp", "rim",
        "shared edge, sharp", "open border", "box edges and corners", "open mesh, edges",
    ):  # fmt: skip
        found = by_set(
            name, effort, 40, against="distance from a singular set / size",
            distances=(1e-12, 1e-13, 3e-14, 1e-14, 3e-15, 1e-15, 1e-16), from_afar=True,
        )  # fmt: skip
        total += replace(found, curves=())
    return total
