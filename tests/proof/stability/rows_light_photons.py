"""Rows D21, D24, L06, L07, L13: photons and the discs they are gathered on."""

from __future__ import annotations

import math
from functools import partial

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import PathOptions, PhotonMapOptions, PPMOptions
from hybrid_rt.lights import RectangleLight, SphereLight
from hybrid_rt.lights.spot import SpotLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Box, Rectangle
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.light.light_tracer import BALL, BEHIND_PANE
from proof.stability.light_run import (
    FEW_PASSES,
    PHOTON_INTEGRATORS,
    balanced,
    eye,
    finite,
    floor,
    judged,
    measured,
    off_by_passes,
    own_options,
    picture,
    same,
    shown,
)
from proof.stability.row import Curve, Effort, Outcome, refusal, row

# The lamp, the pane and the floor of `evenly_lit`: half of a side, and how high the lamp hangs.
HALF, HEIGHT = 4.0, 0.5
# Diagonal of the box around them, and what share of it a first disc may be.
ACROSS = math.sqrt(2 * (2 * HALF) ** 2 + HEIGHT**2)
NARROWEST, WIDEST = 1e-6, 0.25
ALPHA = 2.0 / 3.0
# Radii over that diagonal.
SHARES = (1e-12, 1e-9, 1e-7, 1.01e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.249, 0.5, 1.0)


def evenly_lit(camera: Camera) -> Scene:
    """Return a floor under a lamp as large, behind a pane of index one.

    The pane bends nothing, but it is glass: only photons find the light behind it.
    """
    side = 2 * HALF
    pane = Box((-HALF, -HALF, 0.4 * HEIGHT), (HALF, HALF, 0.6 * HEIGHT))
    lamp = RectangleLight((-HALF, -HALF, HEIGHT), (0, side, 0), (side, 0, 0), 1.0)
    objects = [floor(Lambertian(0.5), HALF), Object(pane, Dielectric(1.0), "pane")]
    return Scene(camera, objects, [lamp])


def irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the irradiance of that floor (Siegel and Howell, configuration C-11)."""

    def corner(a: FloatArray, b: FloatArray) -> FloatArray:
        p, q = np.hypot(a, HEIGHT), np.hypot(b, HEIGHT)
        found: FloatArray = 0.5 * (a / p * np.arctan(b / p) + b / q * np.arctan(a / q))
        return found

    return (
        corner(HALF - x, HALF - y) - corner(-HALF - x, HALF - y)
        - corner(HALF - x, -HALF - y) + corner(-HALF - x, -HALF - y)
    )  # fmt: skip


def blurred(radius: float) -> float:
    """Return the radiance in the middle of the floor as a disc shows it, (1 - d^2 / r^2) its weight."""
    share = (np.arange(200) + 0.5) / 200
    turn = (np.arange(64) + 0.5) / 64 * 2 * math.pi
    # Even in the weight's integral: 2 s - s^2 with s = d^2 / r^2.
    away = radius * np.sqrt(1 - np.sqrt(1 - share))[:, None]
    return 0.5 / math.pi * float(irradiance(away * np.cos(turn), away * np.sin(turn)).mean())


def radius_of_pass(i: int, alpha: float) -> float:
    """Return the radius of pass i over that of the first: r^2 times (k + alpha) / (k + 1) each."""
    return math.sqrt(math.prod((k + alpha) / (k + 1) for k in range(1, i + 1)))


BELOW_PANE = eye((0, -0.25, 0.15), (0, 0, 0), 4, (0, 0, 1))


@row("D21", "points that no photon reaches", "0, and counted")
def points_without_photons(effort: Effort) -> Outcome:
    """Discs without photons are black, finite, and named in the report."""
    outcome = Outcome()
    options = PPMOptions(100, initial_radius=1.01 * NARROWEST * ACROSS)
    result = picture(effort, evenly_lit(BELOW_PANE), "ppm", 3, options=options)
    outcome += finite("ppm, least discs", result)
    outcome += same("ppm, least discs", result.image, np.zeros(result.image.shape))
    n_points = result.report["photons"]["gather_points"]
    missed = result.report.points_missed_by_photons
    outcome = outcome.checked(missed == n_points > 0, f"{missed} of {n_points} points are said")
    # A closed box in the way: photons are stored on it, none below.
    cover = Object(Box((-0.1, -0.1, -0.1), (0.1, 0.1, 0.1)).flipped(), Lambertian(0.5), "cover")
    scene = evenly_lit(Camera((0, 0, 0.05), (0, 0, -0.1), (0, 1, 0), 40, 6, 6))
    scene = Scene(scene.camera, [*scene.objects[1:], cover, floor(Lambertian(0.5), HALF, -0.2)],
                  scene.lights)  # fmt: skip
    for integrator in PHOTON_INTEGRATORS:
        result = picture(effort, scene, integrator, 2)
        outcome += finite(f"{integrator}, in a closed box", result)
        outcome += same(f"{integrator}, in a closed box", result.image, np.zeros((6, 6, 3)))
    return outcome


def _by_radius(effort: Effort, radius: float) -> tuple[Outcome, tuple[float, float] | None, float]:
    """Compare the middle of the floor with the mean over discs of the radii of all passes."""
    n_photons = effort.count(20_000, 2000)
    options = PPMOptions(n_photons, ALPHA, radius)
    result, mib, _ = measured(
        lambda: picture(effort, evenly_lit(BELOW_PANE), "ppm", FEW_PASSES, options=options)
    )
    radii = [radius * radius_of_pass(i, ALPHA) for i in range(FEW_PASSES)]
    name = f"ppm, discs of {radius:.3g}"
    expected = sum(n_photons * math.pi * r * r / (2 * HALF) ** 2 for r in radii)
    if expected < 100.0:
        # Too few photons for a mean: what is asked is that pictures are numbers.
        return finite(name, result) + Outcome(rays=n_photons), None, mib
    truth = float(np.mean([blurred(r) for r in radii]))
    off = off_by_passes(result, truth, 1e-3)
    return judged(name, result, off), (off[0] / truth, off[1] / truth), mib


@row("D24", "gathering across a thin wall", "the dark side is exactly black")
def gathering_across_walls(effort: Effort) -> Outcome:
    """Photons of the lit room stay there: through a wall without thickness, and round a corner."""
    outcome = Outcome()
    lamp = SphereLight((1, 0, 1), 0.2, 10.0)
    grey = Lambertian(0.8)
    room = Object(Box((-2, -2, 0), (2, 2, 2)).flipped(), grey, "room")
    wall = Object(Rectangle((0, -2, 0), (0, 0, 2), (0, 4, 0)), grey, "wall")
    beside = Object(Rectangle((-1e-9, -2, 0), (0, 0, 2), (0, 4, 0)), grey, "wall beside it")
    far = Object(Box((-2, -2, 0), (-1e-6, 2, 2)).flipped(), grey, "dark room")
    near = Object(Box((0, -2, 0), (2, 2, 2)).flipped(), grey, "lit room")
    views = (
        Camera((-1.5, 0, 1), (0, 0, 1), (0, 0, 1), 90, 12, 12),
        # Into the edge between wall and floor, to half a disc from the light.
        Camera((-0.3, 0, 0.3), (0, 0, 0), (0, 0, 1), 30, 12, 12),
    )
    for name, objects in (
        ("one wall", [room, wall]),
        ("two walls 1e-9 apart", [room, wall, beside]),
        ("two rooms 1e-6 apart", [far, near]),
    ):
        for view in views:
            scene = Scene(view, objects, [lamp])
            for integrator, options in (
                ("ppm", PPMOptions(effort.count(20_000, 2000), initial_radius=0.5)),
                ("ppm", None),
                ("photon_map", PhotonMapOptions(effort.count(20_000, 2000))),
            ):
                image = picture(effort, scene, integrator, 2, options=options).image
                outcome += same(f"{integrator}, {name}", image, np.zeros(image.shape))
    return outcome


@row("L06", "a million photons into a spot of 1e-3", "what a cone sends out; memory as when spread")
def photons_into_a_spot(effort: Effort) -> Outcome:
    """Send all photons through a pane into a narrow spot, in a whole render."""
    outcome, figures = Outcome(), []
    n = effort.count(1_000_000, 10_000)
    pane = Object(Box((-4, -4, 1), (4, 4, 1.1)), Dielectric(1.0), "pane")
    camera = Camera((0, -0.5, 0.5), (0, 0, 0), (0, 0, 1), 1.0, 8, 8)
    most: dict[str, float] = {}
    for integrator in PHOTON_INTEGRATORS:
        for cone in (60.0, 0.01):
            lamp = SpotLight((0, 0, 3), (0, 0, -1), 1.0, cone, 0.0)
            scene = Scene(camera, [floor(Lambertian(0.5)), pane], [lamp])
            result, mib, seconds = measured(
                partial(picture, effort, scene, integrator, options=own_options(integrator, n))
            )
            name = f"{integrator}, cone of {cone:g} degrees"
            outcome += finite(name, result) + Outcome(rays=n)
            half = math.sin(math.radians(cone) / 2)
            outcome += balanced(name, result, 4.0 * math.pi * half * half, 5e-3)
            figures.append(f"{name}: {mib:.0f} MiB, {seconds:.1f} s")
            most[f"{integrator} {cone:g}"] = mib
        spread, spot = most[f"{integrator} 60"], most[f"{integrator} 0.01"]
        fault = f"{integrator}: {spot:.0f} MiB where {spread:.0f} MiB do when spread"
        outcome = outcome.checked(spot < 2.0 * spread + 400.0, fault)
    return outcome + Outcome(notes=tuple(figures))


@row("L07", "gather radii from 1e-12 of the scene to the scene", "closed form: mean over a disc")
def gather_radii(effort: Effort) -> Outcome:
    """Radii that are taken give the mean of the light over their discs; others are refused."""
    outcome, x, errors, allowed = Outcome(), [], [], []
    scene = evenly_lit(BELOW_PANE)
    for share in effort.some(SHARES):
        radius = share * ACROSS
        if not NARROWEST <= share <= WIDEST:
            options = PPMOptions(100, initial_radius=radius)
            outcome += refusal(
                partial(picture, effort, scene, "ppm", options=options),
                "initial_radius", "across",
            )  # fmt: skip
            continue
        more, off, _ = _by_radius(effort, radius)
        outcome += more
        if off is not None:
            x.append(share)
            errors.append(off[0])
            allowed.append(off[1])
    curve = Curve("radius / scene", "ppm", x, shown(errors), allowed, unit="of the radiance")
    for nearest in effort.some((2, 10, 60, 1000)):
        own = PhotonMapOptions(effort.count(20_000, 4000), nearest)
        result = picture(effort, scene, "photon_map", FEW_PASSES, options=own)
        # The disc ends at the farthest of so many photons: the mean is off by one in so many.
        off = off_by_passes(result, blurred(1e-6), 1.5 / nearest + 2e-2)
        outcome += judged(f"photon_map, {nearest} nearest", result, off)
    return outcome + Outcome(curves=(curve,))


@row("L13", "light under a ball of glass, and behind a pane", "a light tracer that shares no code")
def light_under_a_ball(effort: Effort) -> Outcome:
    """Compare the mean of pictures of the caustic, by photons, and by paths under the ball."""
    outcome = Outcome()
    n = effort.count(4_000_000, 200_000)
    views = {
        "whole floor": Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 16, 16),
        "caustic": Camera((0, -2.5, 0.6), (0, 0, 0), (0, 0, 1), 8, 16, 16),
    }
    for bench, title in ((BALL, "ball"), (BEHIND_PANE, "behind a pane")):
        counts = bench.floor_light(n, 256, seed=effort.seed, threads=1)
        for view, camera in views.items():
            truth = bench.picture(counts, n, camera)
            mean = float(truth.mean())
            # The caustic's light in a picture is at least that of a few cells: their noise.
            lit = counts[np.abs(np.arange(256) - 127.5) < 16][:, 112:144]
            noise = 4.5 / math.sqrt(max(int(lit.sum()), 1)) if view == "caustic" else 4.5e-3
            # Light that glass throws on what is seen through glass is found by paths by chance, so
            # rarely that few passes may lack it without a sign of that in their noise.
            paths = ("path",) if bench is BALL else ()
            for integrator in (*paths, *PHOTON_INTEGRATORS):
                scene = bench.scene(camera)
                result: RenderResult = picture(
                    effort, scene, integrator, FEW_PASSES, n_photons=effort.count(20_000, 5000),
                    options=PathOptions(light_paths=16.0) if integrator == "path" else None,
                )  # fmt: skip
                # Discs blur over borders of the picture.
                blur = 0.0 if integrator == "path" else 0.05
                off = off_by_passes(result, mean, noise + blur)
                outcome += judged(f"{integrator}, {title}, {view}", result, off)
    return outcome
