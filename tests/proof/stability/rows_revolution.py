"""Rows B01 to B04, B15 and B17: surfaces of revolution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import SurfaceOfRevolution
from proof.cases.catalogue import cone
from proof.cases.rays import chords
from proof.cases.scenes import torus
from proof.cases.singular_rays import size_of
from proof.stability.measure import traced
from proof.stability.measure_exact import by_degrees, by_exact, catalogue, plotted
from proof.stability.patch_nets import elevated
from proof.stability.row import Effort, Outcome, Plot, row

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
        n, plot = effort.count(100, 6), Plot(f"angle with {words}, radians", label)
        for k in (0.0,) if exactly else TILTS:
            rng = effort.rng(int(k > 0) * round(-np.log10(k or 1.0)))
            turn = rng.uniform(0.0, 2.0 * np.pi, n)[:, None]
            across = np.cos(turn) * surface.radial + np.sin(turn) * surface.binormal
            directions = (
                surface.axis + k * across if along else across + k * surface.axis
            ) * rng.choice([-1.0, 1.0], (n, 1))
            origins = _inside(surface, n, rng) - 1.5 * size_of(surface) * directions
            total += plotted(plot, k, surface, origins, directions)
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
    """The plane across the axis as it is rounded, and that of a cylinder about z exactly."""
    return catalogue("B03", effort) + _tilted(effort, False, exactly=True)


@row("B04", "ray nearly perpendicular to the axis", "exact arithmetic")
def nearly_perpendicular(effort: Effort) -> Outcome:
    """Angles of 1e-1 to 1e-16 with the plane across."""
    return catalogue("B02-B04 vase", effort) + _tilted(effort, False)


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


@row("B17", "profiles of degree 1 to 30", "exact crossings of the same profile at low degree")
def degrees(effort: Effort) -> Outcome:
    """A cone and a cubic wave with degrees raised: the polynomial has degree 60 then."""
    total = Outcome()
    for label, profile in (("cone", [(0.0, 0.5), (2.0, 1.5)]), ("cubic wave", WAVE)):
        points = np.array(profile)
        rays = chords(
            [SurfaceOfRevolution(points, ORIGIN, AXIS)], effort.count(200, 10), effort.seed + 8
        )

        def raised(times: int, points: FloatArray = points) -> SurfaceOfRevolution:
            return SurfaceOfRevolution(elevated(points, times), ORIGIN, AXIS)

        total += by_degrees(label, len(points) - 1, raised, rays.origins, rays.directions)
    return total
