"""Row L15: trimmed surfaces that shine."""

from __future__ import annotations

import math

from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Rectangle
from hybrid_rt.scene.scene import Object, Scene
from meshing import TrimmedSurface, circle
from proof.stability.light_run import (
    INTEGRATORS,
    eye,
    floor,
    judged,
    off_by_pixels,
    picture,
    shown,
)
from proof.stability.row import Curve, Effort, Outcome, row

FLOOR = floor(Lambertian(0.5))
RADII = (1e-3, 1.0, 100.0)
# Of the outer radius. Narrower rings are sampled with much noise, which would hide any error.
WIDTHS = (1.0, 0.5, 0.1, 1e-2, 1e-3)


def ring_above(height: float, radius: float, width: float) -> Object:
    """Return a level ring that shines down, cut out of a square; a disc if it is as wide as it may be."""
    square = Rectangle((-2 * radius, -2 * radius, height), (0, 4 * radius, 0), (4 * radius, 0, 0))
    loops = [circle((0.5, 0.5), 0.25)]
    if width < 1.0:
        loops.append(circle((0.5, 0.5), 0.25 * (1.0 - width)))
    return Object(TrimmedSurface(square, loops), Emissive(1.0), "ring")


def below_a_ring(height: float, radius: float, width: float) -> float:
    """Return the irradiance on the axis of a ring of radiance one: pi (sin^2 b - sin^2 a)."""
    inner = (1.0 - width) * radius
    # The difference of x^2 / (x^2 + h^2), without cancellation.
    area = width * (2.0 - width) * radius**2
    return math.pi * area * height**2 / ((radius**2 + height**2) * (inner**2 + height**2))


@row("L15", "rings cut out of lamps, of all widths and sizes", "closed form of the irradiance")
def rings(effort: Effort) -> Outcome:
    """The floor on the axis of rings, from near and far."""
    outcome, curves = Outcome(), []
    # One ring for all integrators: where on it to begin is found once.
    radii, widths = effort.some(RADII), effort.some(WIDTHS)
    lamps = {
        (radius, width): ring_above(1.0, radius, width) for radius in radii for width in widths
    }
    for integrator in INTEGRATORS:
        for radius in radii:
            errors, allowed = [], []
            for width in widths:
                # One sample in a hundred falls beside the ring; the mean needs many of those.
                camera = eye((0, -0.5, 0.5), (0, 0, 0), 32, (0, 0, 1))
                scene = Scene(camera, [FLOOR, lamps[radius, width]])
                result = picture(
                    effort, scene, integrator, effort.count(32, 4), max_depth=0, n_photons=200
                )
                truth = 0.5 / math.pi * below_a_ring(1.0, radius, width)
                off = off_by_pixels(result, truth, 1e-5)
                outcome += judged(f"{integrator}, radius {radius:g}, width {width:g}", result, off)
                errors.append(off[0] / truth)
                allowed.append(off[1] / truth)
            curves.append(
                Curve("width of the ring / its radius", f"{integrator}, radius {radius:g}",
                      list(widths), shown(errors), allowed, unit="of the radiance")
            )  # fmt: skip
    return outcome + Outcome(curves=tuple(curves))
