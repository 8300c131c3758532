"""Rows B01 to B07 and B09 to B19: surfaces of revolution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

from hybrid_rt.core.records import Flag, FloatArray, Status
from hybrid_rt.intersection import Intersector
from meshing import SurfaceOfRevolution
from proof.cases.catalogue import cone, cylinder, ring
from proof.cases.rays import chords, secondary
from proof.cases.scenes import torus
from proof.cases.singular_rays import size_of
from proof.exact.truth import ExactScene
from proof.stability.measure import EPS, apart, by_times, catalogue, traced
from proof.stability.measure_exact import by_exact, by_set, exact_errors
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


@row("B06", "ray equal to the axis", "closed form")
def the_axis_itself(effort: Effort) -> Outcome:
    """Both poles of a lens, met from outside, from inside, and upside down."""
    del effort
    lens = SurfaceOfRevolution([[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (2, 1), (2, 0)]], ORIGIN, AXIS)
    origins = np.array([(0, 0, -5), (0, 0, 0), (0, 0, 7)], dtype=np.float64)
    directions = np.array([(0, 0, 1), (0, 0, 2), (0, 0, -1)], dtype=np.float64)
    hits, found = traced([lens], origins, directions)
    wrong = (hits.t != [4.0, 1.0, 5.0]) | (hits.normal != [(0, 0, -1), (0, 0, 1), (0, 0, 1)]).any(1)
    return found + Outcome(wrong=int(wrong.sum()))


@row("B07", "tips of cones", "closed form")
def tips(effort: Effort) -> Outcome:
    """Met along the axis: flagged, with a normal along the axis."""
    total = catalogue("B07", effort)
    for profile, t in (([(0, 1), (2, 0)], 7.0), ([(0, 0), (1, 1)], 9.0)):
        surface = SurfaceOfRevolution(profile, ORIGIN, AXIS)
        hits = Intersector([surface]).intersect([(0, 0, 9)], [(0, 0, -1)])
        ok = hits.t[0] == t and np.array_equal(np.abs(hits.normal[0]), (0, 0, 1))
        total += Outcome(rays=1, wrong=int(not ok)).checked(
            bool(hits.flags[0] & Flag.NORMAL_DEGENERATE), "the tip's normal is not flagged"
        )
    return total


@row("B09", "profile on the axis over an interval", "identity: the surface without it")
def on_the_axis(effort: Effort) -> Outcome:
    """That part has no area."""
    cones = [[(0, 1), (1, 0)], [(2, 0), (3, 1)]]
    with_line = SurfaceOfRevolution([cones[0], [(1, 0), (2, 0)], cones[1]], ORIGIN, AXIS)
    without = [SurfaceOfRevolution([part], ORIGIN, AXIS) for part in cones]
    n, rng = effort.count(50_000, 500), effort.rng()
    targets = rng.uniform((-1, -1, 0), (1, 1, 3), (n, 3))
    targets[: n // 5, :2] = 0.0  # at the axis
    origins = rng.normal(size=(n, 3)) * 4
    a, found = traced([with_line], origins, targets - origins)
    b = Intersector(without).intersect(origins, targets - origins)
    # Scales differ: what is within the band of one may be clear of the other's.
    sure = (a.status != Status.TANGENT) & (b.status != Status.TANGENT)
    both = sure & a.hit & b.hit
    slack = a.t_bound[both] + b.t_bound[both] + np.spacing(b.t[both])
    error = (np.abs(a.t[both] - b.t[both]) / slack).max(initial=0.0)
    across = Intersector([with_line]).intersect((0, 5, 1.5), (0, -1, 0))
    return found + Outcome(
        wrong=int((sure & (a.hit != b.hit)).sum()) + int(across.hit[0]), error=float(error)
    )


@row("B10", "profile with a loop", "exact arithmetic")
def loops(effort: Effort) -> Outcome:
    """The nearest sheet."""
    surface = SurfaceOfRevolution([(0.0, 0.6), (2.0, 1.6), (-1.0, 1.6), (1.0, 0.6)], ORIGIN, AXIS)
    rays = chords([surface], effort.count(200, 10), seed=effort.seed + 5)
    return catalogue("B10", effort) + by_exact([surface], rays.origins, rays.directions)


@row("B11", "open profile", "closed form")
def open_profiles(effort: Effort) -> Outcome:
    """Through the mouth of a cup onto the inside of its wall."""
    cup = SurfaceOfRevolution([(0, 1), (3, 1)], ORIGIN, AXIS)
    n, rng = effort.count(5000, 50), effort.rng()
    turn, drop = rng.uniform(0, 2 * np.pi, n), rng.uniform(1.01, 2.49, n)
    # From height 5 on the axis to height 5 - 2 drop on the wall.
    directions = np.stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), -drop], axis=1)
    origins = np.tile((0.0, 0.0, 5.0), (n, 1))
    hits, found = traced([cup], origins, directions)
    # cos^2 + sin^2 is 1 up to rounding.
    wrong = ~hits.hit | (np.abs(hits.t - 2.0) > 8 * EPS) | hits.front_face
    return found + Outcome(wrong=int(wrong.sum()))


@row("B12", "closed profile", "parity; exact crossings")
def closed_profiles(effort: Effort) -> Outcome:
    """A torus is left as often as it is entered; all its crossings are the exact ones."""
    surface = torus()
    rays = chords([surface], effort.count(30_000, 300), seed=effort.seed + 7)
    origins = rays.origins - 20.0 * rays.directions
    found = Intersector([surface]).intersect_all(origins, rays.directions)
    touched = np.unique(found.ray[found.hits.status == Status.TANGENT])
    odd = np.setdiff1d(np.flatnonzero(found.count % 2), touched)
    scene, wrong = ExactScene([surface]), len(odd)
    some = effort.count(200, 10)
    for i in np.setdiff1d(np.arange(some), touched):
        exact = scene.crossings(origins[i], rays.directions[i])
        same = len(exact) == found.count[i]
        # Where the ray begins far away, joints count once in both.
        wrong += int(not same and len({round(one.t, 9) for one in exact}) != found.count[i])
    return Outcome(rays=len(origins), wrong=wrong, undecided=len(touched))


@row("B13", "discs and cylinders", "closed form; exact crossings")
def discs_and_cylinders(effort: Effort) -> Outcome:
    """Profiles along and across the axis."""
    total, n = catalogue("B13", effort), effort.count(200, 10)
    for surface in (ring(), cylinder(), ring(0.0, 0.0, 1.0)):
        rays = chords([surface], n, seed=effort.seed + 9)
        total += by_exact([surface], rays.origins, rays.directions)
        rays = secondary([surface], n, seed=effort.seed + 10)
        total += by_exact([surface], rays.origins + 0.1 * rays.directions, rays.directions)
    return total


@row("B14", "joints of a profile", "exact arithmetic; counts")
def joints(effort: Effort) -> Outcome:
    """Aimed at the joint circle of a cylinder of two parts: one crossing each, no gap."""
    tube = SurfaceOfRevolution([[(-1, 1), (0, 1)], [(0, 1), (1, 1)]], ORIGIN, AXIS)
    bent = SurfaceOfRevolution([[(-1, 0.5), (0, 1)], [(0, 1), (1, 0.5)]], ORIGIN, AXIS)
    total, n, rng = catalogue("B14", effort), effort.count(10_000, 200), effort.rng()
    turn = rng.uniform(0, 2 * np.pi, n)
    around = np.stack([np.cos(turn), np.sin(turn), np.zeros(n)], axis=1)
    start = rng.uniform(-0.3, 0.3, (n, 3))
    for surface in (tube, bent):
        all_hits = Intersector([surface]).intersect_all(start, around - start)
        off = np.abs(all_hits.hits.t - 1.0) > 1e-14
        total += Outcome(
            rays=n, wrong=int((all_hits.count != 1).sum() + off.sum()),
            undecided=int((all_hits.hits.status == Status.TANGENT).sum()),
        )  # fmt: skip
    return total


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


@row("B16", "grazing the equators", "exact arithmetic")
def equators(effort: Effort) -> Outcome:
    """A torus, 1e-1 to 1e-14 of its size from tangency."""
    return catalogue("B16", effort) + by_set(
        "torus, tangents", effort, 100, against="distance from tangency / size"
    )


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


@row("B19", "axes of any length but zero", "refusal; closed form")
def axes(effort: Effort) -> Outcome:
    """Scaled to length one."""
    del effort
    profile = [(0, 1), (1, 1)]
    total = refusal(
        lambda: SurfaceOfRevolution(profile, ORIGIN, (0, 0, 0)), "axis is the zero vector"
    )
    for length in (1e-200, 1e-9, 1.0, 1e9, 1e200):
        tube = SurfaceOfRevolution(profile, ORIGIN, (0, 0, length))
        t = Intersector([tube]).intersect((5, 0, 0.5), (-1, 0, 0)).t[0]
        total += Outcome(rays=1, wrong=int(t != 4.0))
    return total
