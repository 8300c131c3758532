"""Rows L04, L05, L11: lamps of all sizes, lamps in contact with surfaces, narrow spots."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from hybrid_rt.lights import PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.light import Light
from hybrid_rt.lights.spot import SpotLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    INTEGRATORS,
    PHOTON_INTEGRATORS,
    balanced,
    eye,
    floor,
    judged,
    off_by_pixels,
    picture,
    shown,
    slab,
)
from proof.stability.row import Curve, Effort, Outcome, refusal, row

FLOOR = floor(Lambertian(0.5))
SIZES = tuple(10.0**k for k in range(-6, 7))


def below_a_square(side: float, height: float) -> float:
    """Return the irradiance below the middle of a square of radiance one (four corners, C-11)."""
    p = math.hypot(side / 2, height)
    return 4.0 * (side / 2) / p * math.atan((side / 2) / p)


def square(side: float, height: float, radiance: float = 1.0) -> RectangleLight:
    """Return a level square that shines down."""
    corner = (-side / 2, -side / 2, height)
    return RectangleLight(corner, (0, side, 0), (side, 0, 0), radiance)


@row("L04", "lamps of 1e-6 to 1e6 of the scene", "closed forms of the irradiance")
def lamps_of_all_sizes(effort: Effort) -> Outcome:
    """Squares and balls one above the floor: lamps, and objects that shine."""
    outcome, curves = Outcome(), []
    camera = eye((0, -0.5, 0.5), (0, 0, 0), 16, (0, 0, 1))
    for integrator in INTEGRATORS:
        for kind in ("square", "ball", "shining ball"):
            errors, allowed = [], []
            for size in effort.some(SIZES):
                lights: list[Light] = []
                objects = [FLOOR]
                if kind == "square":
                    lights, light = [square(size, 1.0)], below_a_square(size, 1.0)
                else:
                    # Wholly above the floor: pi (r / d)^2.
                    light = math.pi * (size / (1.0 + size)) ** 2
                    middle = (0, 0, 1.0 + size)
                    if kind == "ball":
                        lights = [SphereLight(middle, size, 1.0)]
                    else:
                        objects = [FLOOR, Object(Sphere(middle, size), Emissive(1.0), "lamp")]
                scene = Scene(camera, objects, lights)
                result = picture(
                    effort, scene, integrator, effort.count(4), max_depth=0, n_photons=200
                )
                truth = 0.5 / math.pi * light
                # The camera sees the floor 1e-8 beside the point: nothing that counts.
                off = off_by_pixels(result, truth, 1e-5)
                outcome += judged(f"{integrator}, {kind} of {size:g}", result, off)
                errors.append(off[0] / truth)
                allowed.append(off[1] / truth)
            curves.append(
                Curve("size of the lamp / height", f"{integrator}, {kind}", list(effort.some(SIZES)),
                      shown(errors), allowed, unit="of the radiance")
            )  # fmt: skip
    return outcome + Outcome(curves=tuple(curves))


@row("L05", "lamps that touch surfaces, or nearly", "closed forms of the irradiance")
def lamps_in_contact(effort: Effort) -> Outcome:
    """Lower a square from 1 to 1e-12 above the floor; balls touch it and reach into it."""
    outcome, curves = Outcome(), []
    gaps = [10.0**k for k in range(-12, 1)]
    for integrator in INTEGRATORS:
        errors, allowed = [], []
        for gap in gaps:
            # From between the two: straight down on the floor below the middle.
            camera = Camera((0, 0, gap / 2), (0, 0, 0), (0, 1, 0), 1e-6, 12, 12)
            scene = Scene(camera, [FLOOR], [square(0.5, gap)])
            truth = 0.5 / math.pi * below_a_square(0.5, gap)
            result = picture(effort, scene, integrator, effort.count(4), max_depth=0, n_photons=200)
            off = off_by_pixels(result, truth, 1e-5)
            outcome += judged(f"{integrator}, square {gap:g} above the floor", result, off)
            errors.append(off[0] / truth)
            allowed.append(off[1] / truth)
        curves.append(
            Curve("distance of the lamp from the floor", integrator, gaps, shown(errors), allowed,
                  unit="of the radiance")
        )  # fmt: skip
        camera = eye((0.5, -0.5, 0.05), (0.3, 0, 0), 12, (0, 0, 1))
        for gap in (0.0, 1e-15, 1e-12, -1e-12, 1e-6, 1e-3):
            height = 0.2 + gap
            square_of_distance = 0.3**2 + height**2
            light = math.pi * 0.2**2 / square_of_distance * height / math.sqrt(square_of_distance)
            for kind in ("ball", "shining ball"):
                lamp = Object(Sphere((0, 0, height), 0.2), Emissive(1.0), "lamp")
                scene = Scene(
                    camera,
                    [FLOOR] if kind == "ball" else [FLOOR, lamp],
                    [SphereLight((0, 0, height), 0.2, 1.0)] if kind == "ball" else [],
                )
                result = picture(
                    effort, scene, integrator, effort.count(4), max_depth=0, n_photons=200
                )
                off = off_by_pixels(result, 0.5 / math.pi * light, 1e-5)
                outcome += judged(f"{integrator}, {kind} {gap:g} above the floor", result, off)
        # Held to a pane of glass: head-on, (1 - R) / (1 + R) of it comes through.
        for gap in (1e-12, 1e-6):
            pane = slab(0, 1, Dielectric(1.5))
            lamp_below = RectangleLight((-50, -50, -gap), (100, 0, 0), (0, 100, 0), 1.0)
            scene = Scene(eye((0, 0, 5), (0, 0, 0), 24), [pane], [lamp_below])
            result = picture(
                effort, scene, integrator, effort.count(8), max_depth=60, n_photons=200
            )
            # The lamp is black: what the pane sends back to it is lost.
            lost = result.report.ended_branches.lost_weight_per_camera_ray
            off = off_by_pixels(result, 0.96 / 1.04, 1e-5, lost)
            outcome += judged(f"{integrator}, lamp {gap:g} below glass", result, off)
    return outcome + Outcome(curves=tuple(curves))


@row("L11", "spots of 0.001 to 180 degrees", "closed forms: on the axis, and all that is sent out")
def narrow_spots(effort: Effort) -> Outcome:
    """Full intensity on the axis; photons carry pi (2 - cos a - cos b) together."""
    outcome, curves = Outcome(), []
    cones = (1e-3, 1e-2, 0.1, 1.0, 10.0, 30.0, 90.0, 180.0)
    camera = eye((0.0, -0.5, 0.5), (0, 0, 0), 8, (0, 0, 1))
    glass = Object(Sphere((5, 5, 1), 0.5), Dielectric(1.5), "glass")
    for integrator in INTEGRATORS:
        errors = []
        for cone in cones:
            for edge in (0.0, cone / 2):
                lamp = SpotLight((0, 0, 2), (0, 0, -1), 3.0, cone, edge)
                scene = Scene(camera, [FLOOR, glass], [lamp])
                result = picture(effort, scene, integrator, 1, n_photons=effort.count(20_000, 4000))
                name = f"{integrator}, cone of {cone:g} degrees, edge {edge:g}"
                # Light by way of the floor and the ball comes to less than this.
                truth = 0.5 / math.pi * 3.0 / 4.0
                off = off_by_pixels(result, truth, 1e-5 if cone < 10.0 else 0.02)
                outcome += judged(name, result, off)
                if integrator in PHOTON_INTEGRATORS:
                    # 1 - cos x, without cancellation.
                    less = [2 * math.sin(math.radians(x) / 2) ** 2 for x in (cone, cone - edge)]
                    outcome += balanced(name, result, 3.0 * math.pi * sum(less), 5e-3)
            errors.append(off[0] / truth)
        curves.append(
            Curve("cone, degrees", integrator, list(cones), shown(errors),
                  [1e-5 if cone < 10.0 else 0.02 for cone in cones], unit="of the radiance")
        )  # fmt: skip
        # Just outside of the cone it is dark; pixels reach 1e-8 to the side.
        for cone in cones[:-2]:
            aside = 2.0 * math.tan(math.radians(cone)) * (1 + 1e-3)
            view = eye((aside, -0.5, 0.5), (aside, 0, 0), 4, (0, 0, 1))
            lamp = SpotLight((0, 0, 2), (0, 0, -1), 3.0, cone, 0.0)
            result = picture(
                effort, Scene(view, [FLOOR], [lamp]), integrator, max_depth=0, n_photons=200
            )
            dark = not np.any(result.image)
            outcome = outcome.checked(dark, f"{integrator}: light beside the cone of {cone:g}")
    for bad in (0.0, 9.99e-4, -1.0, 180.1, math.nan):
        outcome += refusal(
            partial(SpotLight, (0, 0, 1), (0, 0, -1), 1.0, bad, 0.0), "SpotLight cone_angle"
        )
    for bad in (-1e-9, 30.1, math.nan):
        outcome += refusal(
            partial(SpotLight, (0, 0, 1), (0, 0, -1), 1.0, 30.0, bad), "SpotLight edge_angle"
        )
    outcome += refusal(lambda: SpotLight((0, 0, 1), (0, 0, 0), 1.0), "SpotLight direction")
    return outcome + refusal(lambda: PointLight((0, 0, 1), math.inf), "PointLight intensity")
