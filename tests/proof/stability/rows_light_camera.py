"""Rows D06, D08, D34: where the camera stands, small pictures and empty scenes."""

from __future__ import annotations

from functools import partial

import numpy as np

from hybrid_rt.lights import GradientSky, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    BRANCHES_CUT,
    INTEGRATORS,
    PLAIN_PATHS,
    WHITE_SKY,
    finite,
    floor,
    judged,
    off_by_pixels,
    picture,
    same,
    slab,
)
from proof.stability.row import Effort, Outcome, refusal, row

VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 2.0)


@row("D06", "camera in glass or on its surface", "closed form: radiance n^2 in even light")
def camera_in_glass(effort: Effort) -> Outcome:
    """Standing in clear glass under a sky of radiance one shows n^2, from its face as from within."""
    outcome = Outcome()
    for ior in (1.5, 0.7):
        plate = slab(0, 1, Dielectric(ior))
        ball = Object(Sphere((0, 0, 0), 1), Dielectric(ior), "ball")
        # The shape, where the camera stands, where it looks, and the index there.
        for body, place, at, index in (
            (plate, (0, 0, 1), (0, 0, -9), ior),
            (plate, (0, 0, 0.5), (0, 0.1, -9), ior),
            (plate, (0, 0, 1), (0, 0, 9), 1.0),
            (ball, (0, 0, 1), (0.1, 0, -9), ior),
            (ball, (0.2, 0.1, 0), (0.1, 0, -9), ior),
            (ball, (0, 0, 1), (0.3, 0, 9), 1.0),
        ):
            for integrator in INTEGRATORS:
                # Whitted's method follows both branches of each hit.
                camera = Camera(place, at, (0, 1, 0), 1e-6, 8, 8)
                result = picture(
                    effort, Scene(camera, [body], environment=WHITE_SKY), integrator,
                    max_depth=100, options=PLAIN_PATHS if integrator == "path" else None,
                )  # fmt: skip
                name = f"{integrator}, {body.name}, index {ior:g}, from {place} to {at}"
                cut = 4.0 * BRANCHES_CUT if integrator != "path" else 0.0
                outcome += judged(name, result, off_by_pixels(result, index**2, 1e-5 + cut))
    return outcome


@row("D08", "pictures of one pixel, of one row, of none", "closed form; refusals")
def smallest_pictures(effort: Effort) -> Outcome:
    """In even light every pixel shows it, bit for bit."""
    shining, sky = floor(Emissive(0.5)), GradientSky(0.5, 0.5)
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for width, height in ((1, 1), (40, 1), (1, 7)):
            scene = Scene(VIEW.resized(width, height), [shining], environment=sky)
            image = picture(effort, scene, integrator, 2).image
            name = f"{integrator}, {width} x {height}"
            outcome += same(name, image, np.full((height, width, 3), 0.5))
    for width, height, word in ((0, 4, "width"), (4, 0, "height"), (-3, 4, "width")):
        outcome += refusal(partial(VIEW.resized, width, height), word)
    return outcome


@row("D34", "scenes with nothing in them", "the background")
def nothing_to_see(effort: Effort) -> Outcome:
    """Black, or the sky; lights alone change nothing, and lobes of nothing are no error."""
    sky = GradientSky(0.25, 0.25)
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for lights, environment, expected in (
            ([], None, 0.0),
            ([], sky, 0.25),
            ([PointLight((0, 0, 5), 1.0)], None, 0.0),
            ([PointLight((0, 0, 5), 1.0)], sky, 0.25),
        ):
            result = picture(effort, Scene(VIEW, [], lights, environment), integrator)
            outcome += finite(integrator, result)
            outcome += same(integrator, result.image, np.full((12, 12, 3), expected))
    return outcome
