"""Rows B01 to B07 and B09 to B19: surfaces of revolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, Status
from hybrid_rt.intersection import Intersector
from meshing import SurfaceOfRevolution
from proof.cases.catalogue import cone, cylinder
from proof.cases.rays import chords
from proof.cases.scenes import torus
from proof.cases.singular_rays import size_of
from proof.exact.truth import ExactScene
from proof.stability.measure import apart, by_times, traced
from proof.stability.measure_exact import by_exact, catalogue, exact_errors
from proof.stability.row import Effort, Outcome, Plot, refusal, row

ORIGIN, AXIS = (0, 0, 0), (0, 0, 1)
# Angles with the axis, or with what is perpendicular to it.
TILTS = (1e-1, 1e-2, 1e-3, 1e-4, 1e-6, 1e-8, 1e-10, 1e-12, 1e-14, 1e-16)
WAVE = [(0.0, 1.0), (1.0, 2.5), (2.0, -0.4), (3.0, 0.8)]


def _inside(surface: SurfaceOfRevolution, n: int, rng: np.random.Generator) -> FloatArray:
    """Return points of a surface: rays through them have a hit."""
    points: FloatArray = surface.point(
        rng.random(n), rng.random(n), rng.integers(len(surface), size=n)
    )
    return points


def _tilted(effort: Effort, along: bool, exactly: bool = False) -> Outcome:
    """Judge rays at small angles to the axis, or to the plane across it, by exact crossings."""
    total, curves = Outcome(), []
    words = "the axis" if along else "the plane across the axis"
    for label, surface in (("torus", torus()), ("cone", cone())):
        size, n = size_of(surface), effort.count(100, 6)
        plot = Plot(f"angle with {words}, radians", label)
        tracer, scene = Intersector([surface], coarse="none"), ExactScene([surface])
        for k in (0.0,) if exactly else TILTS:
            rng = effort.rng(int(k > 0) * round(-np.log10(k or 1.0)))
            turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None]
            across = np.cos(turn) * surface.radial + np.sin(turn) * surface.binormal
            directions = (
                surface.axis + k * across if along else across + k * surface.axis
            ) * rng.choice([-1.0, 1.0], (n, 1))
            origins = _inside(surface, n, rng) - 1.5 * size * directions
            total += by_exact([surface], origins, directions)
            tracer.counters["most_pieces"] = 0
            hits = tracer.intersect(origins, directions)
            error, expected = exact_errors(scene, hits, origins, directions)
            if k:
                total += plot.add(k, error / size, expected / size, tracer.counters["most_pieces"])
        curves.append(plot)
    return replace(total, curves=() if exactly else tuple(curves))


@row("B01", "ray parallel to the axis", "exact arithmetic")
def parallel(effort: Effort) -> Outcome:
    """The axis as it is rounded, and coordinate axes exactly."""
    straight = SurfaceOfRevolution(WAVE[:2], ORIGIN, AXIS)
    n, rng = effort.count(200, 10), effort.rng(1)
    origins = _inside(straight, n, rng) - (0.0, 0.0, 5.0)
    exact = by_exact([straight], origins, np.tile((0.0, 0.0, 1.0), (n, 1)))
    return catalogue("B01", effort) + _tilted(effort, True, exactly=True) + exact


@row("B02", "ray nearly parallel to the axis", "exact arithmetic")
def nearly_parallel(effort: Effort) -> Outcome:
    """Angles of 1e-1 to 1e-16."""
    return catalogue("B02-B04", effort) + _tilted(effort, True)


@row("B03", "ray perpendicular to the axis", "exact arithmetic; closed form")
def perpendicular(effort: Effort) -> Outcome:
    """Two hits per root of the height: the circle of a cylinder is met twice."""
    n, rng = effort.count(5000, 50), effort.rng(3)
    y, z = rng.uniform(-0.99, 0.99, (2, n))
    origins = np.stack([np.full(n, -3.0), y, z], axis=1)
    directions = np.tile((1.0, 0.0, 0.0), (n, 1))
    found = by_times([cylinder()], origins, directions, 3.0 - np.sqrt((1.0 - y) * (1.0 + y)))
    counts = Intersector([cylinder()]).intersect_all(origins, directions).count
    exact = _tilted(effort, False, exactly=True)
    return exact + found + Outcome(wrong=int((counts != 2).sum()))


@row("B04", "ray nearly perpendicular to the axis", "exact arithmetic")
def nearly_perpendicular(effort: Effort) -> Outcome:
    """Angles of 1e-1 to 1e-16 with the plane across."""
    return catalogue("B02-B04 vase", effort) + _tilted(effort, False)


@row("B05", "ray through the axis", "closed form; exact crossings")
def through_the_axis(effort: Effort) -> Outcome:
    """Both sides of cone and torus."""
    total, n, rng = catalogue("B05", effort), effort.count(150, 8), effort.rng()
    for surface in (cone(), torus()):
        at = surface.origin + rng.uniform(0.05, 0.95, (n, 1)) * surface.axis
        turn = rng.uniform(0.0, 2.0 * np.pi, (n, 1))
        across = np.cos(turn) * surface.radial + np.sin(turn) * surface.binormal
        directions = across + rng.uniform(-0.5, 0.5, (n, 1)) * surface.axis
        total += by_exact([surface], at - 3.0 * directions, directions)
    z = rng.uniform(0.1, 0.9, 20 * n)
    origins = np.stack([np.full_like(z, -2.0), np.zeros_like(z), z], axis=1)
    found = Intersector([cone()]).intersect_all(origins, (1.0, 0.0, 0.0))
    sides = np.sort(np.concatenate([2.0 - z, 2.0 + z]))
    same = len(found.hits) == 2 * len(z) and np.abs(np.sort(found.hits.t) - sides).max() < 1e-14
    return total + Outcome(rays=len(z)).checked(bool(same), "not both sides of a cone")


@row("B15", "seam of the angle", "closed form")
def seam(effort: Effort) -> Outcome:
    """U stays in [0, 1) and is the angle, to 1e-15 at the seam."""
    vase = SurfaceOfRevolution([(0, 1), (1, 2), (2, 1)], ORIGIN, AXIS, reference=(1, 0, 0))
    angle = np.concatenate(
        [
            [0.0, -0.0], *[[e, -e] for e in (1e-300, 1e-17, 1e-9)],
            effort.rng().uniform(-np.pi, np.pi, effort.count(5000, 50)),
        ]
    )  # fmt: skip
    directions = np.column_stack([-np.cos(angle), -np.sin(angle), np.zeros(len(angle))])
    hits, found = traced([vase], -5 * directions + (0, 0, 1), directions)
    in_range = (hits.u >= 0) & (hits.u < 1)
    turned = np.abs(hits.u - np.round(hits.u)) * 2 * np.pi
    off = np.abs(turned - np.abs(angle)) > np.where(np.abs(angle) < 1e-8, 1e-15, 4e-15)
    return found + Outcome(wrong=int((~hits.hit | ~in_range | off).sum()))


def _elevated(points: Sequence[Any], degree: int) -> list[tuple[float, float]]:
    """Raise the degree of a profile: exactly, then rounded once."""
    exact = [[Fraction(float(x)) for x in p] for p in points]
    while len(exact) <= degree:
        n = len(exact)
        ends = [exact[0], *exact], [*exact, exact[-1]]
        exact = [
            [Fraction(k, n) * x + (1 - Fraction(k, n)) * y for x, y in zip(a, b, strict=True)]
            for k, (a, b) in enumerate(zip(*ends, strict=True))
        ]
    return [(float(z), float(r)) for z, r in exact]


@row("B17", "profiles of degree 1 to 30", "exact crossings of the same profile at low degree")
def degrees(effort: Effort) -> Outcome:
    """A cone and a cubic wave with degrees raised: the polynomial has degree 60 then."""
    total, curves, n = Outcome(), [], effort.count(200, 10)
    for label, profile in (("cone", [(0.0, 0.5), (2.0, 1.5)]), ("cubic wave", WAVE)):
        own = len(profile) - 1
        low = SurfaceOfRevolution(profile, ORIGIN, AXIS)
        scene, size = ExactScene([low]), size_of(low)
        rays = chords([low], n, seed=effort.seed + 8)
        o, d = rays.origins, rays.directions
        a = Intersector([low], coarse="none").intersect(o, d)
        plot = Plot("degree", f"{label}, degree raised")
        for degree in (k for k in (1, 2, 3, 5, 8, 12, 17, 23, 30) if k >= own):
            tracer = Intersector(
                [SurfaceOfRevolution(_elevated(profile, degree), ORIGIN, AXIS)], coarse="none"
            )
            b = tracer.intersect(o, d)
            work = tracer.counters["most_pieces"]
            total += Outcome(
                rays=n, wrong=int(apart(low, a, b, o, d).sum()), work=work,
                undecided=int((b.status == Status.TANGENT).sum()),
            )  # fmt: skip
            error, expected = exact_errors(scene, b, o, d)
            total += plot.add(degree, error / size, expected / size, work)
        curves.append(plot)
    return replace(total, curves=tuple(curves))


@row("B18", "profile shrunk to a point; a wire of radius 1e-9", "refusal; closed form")
def thin(effort: Effort) -> Outcome:
    """A point is refused, a thin wire found."""
    total = catalogue("B18", effort)
    total += refusal(lambda: SurfaceOfRevolution([(1.0, 0.5), (1.0, 0.5)], ORIGIN, AXIS), "profile")
    radius, n = 1e-9, effort.count(5000, 50)
    y = radius * np.concatenate([effort.rng().uniform(-0.99, 0.99, n), [1.5, -2.0, 30.0]])
    origins = np.stack([np.full_like(y, -1.0), y, np.full_like(y, 0.5)], axis=1)
    inside = np.maximum((radius - y) * (radius + y), 0.0)
    t = np.where(np.abs(y) < radius, 1.0 - np.sqrt(inside), np.inf)
    return total + by_times([cylinder(radius)], origins, np.tile((1.0, 0.0, 0.0), (len(y), 1)), t)
