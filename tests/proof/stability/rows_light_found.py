"""Rows F09, F11, L12, L14: what each integrator finds, says that it does not find, and needs for it."""

from __future__ import annotations

import math
import re
from functools import partial

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import INTEGRATORS as DECLARED
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.light import Light
from hybrid_rt.materials import Dielectric, Lambertian, Mirror
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    FEW_PASSES,
    INTEGRATORS,
    PHOTON_INTEGRATORS,
    WHITE_SKY,
    eye,
    finite,
    floor,
    judged,
    measured,
    mirrors,
    off_by_passes,
    off_by_pixels,
    picture,
    same,
)
from proof.stability.row import Effort, Outcome, row

FLOOR = floor(Lambertian(0.5))
# MiB beyond what there was before, of pictures of a few pixels.
LITTLE_MEMORY = 400.0


def lit_room(height: float, angle: float) -> Scene:
    """Return a lamp of side 1/2 above a black floor, and a grey ceiling at 1 seen from below."""
    c, s = math.cos(angle), math.sin(angle)
    turn = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    u, v = turn @ (0.5, 0, 0), turn @ (0, 0.5, 0)
    wide = turn @ (4, 0, 0), turn @ (0, 4, 0)
    objects = [
        Object(Plane((0, 0, 0), turn @ (0, 0, 1)), Lambertian(0.0), "floor"),
        Object(Rectangle(turn @ (-2, -2, 1), *wide), Lambertian(0.5), "ceiling"),
    ]
    lamp = RectangleLight(turn @ (-0.25, -0.25, height), u, v, 1.0)
    camera = Camera(turn @ (0, 0, 0.5), turn @ (0, 0, 1), turn @ (0, 1, 0), 1e-6, 12, 12)
    return Scene(camera, objects, [lamp])


def above_the_lamp(height: float) -> float:
    """Return the ceiling's radiance above the lamp's middle: its albedo times the form factor."""
    x = 0.25 / (1.0 - height)
    root = math.sqrt(1.0 + x * x)
    return 0.5 * 4.0 / math.pi * x / root * math.atan(x / root)


@row("F09", "lamp in a matt plane, or touching it", "closed form: form factor of a rectangle")
def lamp_in_a_plane(effort: Effort) -> Outcome:
    """Count a lamp in the plane as above it, and say so; one below it by 1e-12 is dark."""
    outcome = Outcome()
    for height in effort.some((0.0, 1e-16, -1e-16, 1e-12, -1e-12, 1e-6, -1e-6, 1e-3)):
        for angle in (0.0, 0.3):
            truth = 0.0 if height < -1e-15 else above_the_lamp(height)
            for integrator in INTEGRATORS:
                result = picture(
                    effort, lit_room(height, angle), integrator, effort.count(4), n_photons=500
                )  # fmt: skip
                name = f"{integrator}, lamp at {height:g}, turned by {angle:g}"
                outcome += judged(name, result, off_by_pixels(result, truth))
                notes = result.report["lamps_in_surfaces"]
                said = len(notes) == (abs(height) < 1e-15)
                outcome = outcome.checked(said, f"{name}: {len(notes)} notes")
                lifted = all(0.0 < note["lifted_by"] < 1e-9 for note in notes)
                outcome = outcome.checked(lifted, f"{name}: lifted too far")
    return outcome


@row(
    "F11", "point light by way of a mirror or glass", "closed form of the image; named as left out"
)
def point_light_by_way_of_a_mirror(effort: Effort) -> Outcome:
    """Add the light of the lamp's image: photons find it, others say that they do not."""
    outcome = Outcome()
    lamp = PointLight((0, 0, 1), 3.0)
    wall = Object(Rectangle((1.5, -8, 0), (0, 16, 0), (0, 0, 16)), Mirror(0.8), "mirror")
    ball = Object(Sphere((0, -6, 2), 0.5), Dielectric(1.5), "glass")
    place = np.array([0.8, 0.3, 0.0])
    direct = _by_point_light(place, (0, 0, 1), 3.0)
    by_mirror = 0.8 * _by_point_light(place, (3, 0, 1), 3.0)
    camera = eye(place + np.array([0, -0.5, 1.5]), place, 6, (0, 0, 1))
    for objects, mirrored in (([FLOOR, wall], by_mirror), ([FLOOR, wall, ball], by_mirror)):
        scene = Scene(camera, objects, [lamp])
        for integrator in INTEGRATORS:
            result = picture(
                effort, scene, integrator, FEW_PASSES, max_depth=1,
                n_photons=effort.count(20_000, 4000),
            )  # fmt: skip
            name = f"{integrator}, {len(objects)} objects"
            finds = integrator in PHOTON_INTEGRATORS
            truth = direct + (mirrored if finds else 0.0)
            outcome += judged(name, result, off_by_passes(result, truth, 0.02 if finds else 1e-5))
            left_out = result.report.light_not_found
            named = any("without area that mirrors or glass throw" in text for text in left_out)
            fault = f"{name}: {'named as left out, though found' if finds else 'not named'}"
            outcome = outcome.checked(named is not finds, fault)
    return outcome


def _by_point_light(place: FloatArray, lamp: tuple[float, ...], intensity: float) -> float:
    """Return the radiance of a level matt floor of albedo 1/2 under a point light."""
    way = np.array(lamp) - place
    distance = float(np.linalg.norm(way))
    return 0.5 / math.pi * intensity * float(way[2]) / distance**3


@row("L12", "work and memory where nothing ends a path", "bounds; what is lost is said")
def bounded_work(effort: Effort) -> Outcome:
    """Render closed white rooms, mirrors and nested shells with the default max_depth."""
    shells = [
        Object(Sphere((0, 0, 0), 3.0 - 0.3 * k), Dielectric(1.2 + 0.1 * k), f"shell {k}")
        for k in range(8)
    ]
    white = Object(Box((-4, -4, -4), (4, 4, 4)).flipped(), Lambertian(1.0), "room")
    lamp = SphereLight((3, 3, 3), 0.2, 10.0)
    camera = Camera((0, -3.8, 0), (0, 1, 0), (0, 0, 1), 40, 8, 8)
    inside = [*mirrors(1.0), Object(Sphere((0, 0, 1), 0.5), Mirror(1.0), "ball")]
    scenes = {
        "white room": Scene(camera, [white], [lamp]),
        "shells in a white room": Scene(camera, [white, *shells], [lamp]),
        "mirrors": Scene(Camera((0, -3, 1), (0, 0, 1), (0, 0, 1), 40, 8, 8), inside, [lamp]),
        "shells": Scene(camera, shells, [], WHITE_SKY),
    }
    outcome, most, longest = Outcome(), 0.0, 0.0
    for title, scene in scenes.items():
        for integrator in INTEGRATORS:
            result, mib, seconds = measured(
                partial(picture, effort, scene, integrator, 2, n_photons=effort.count(2000, 200))
            )
            name = f"{integrator}, {title}"
            most, longest = max(most, mib), max(longest, seconds)
            outcome += finite(name, result) + Outcome(rays=sum(result.report.rays.values()))
            outcome = outcome.checked(mib < LITTLE_MEMORY, f"{name}: {mib:.0f} MiB")
            given_up = result.report.geometry.given_up
            outcome = outcome.checked(not given_up, f"{name}: {given_up} rays given up")
            power = (result.report.get("photons") or {}).get("power_of_all_passes")
            if power and any(power["emitted"]):
                parts = np.sum([power[k] for k in ("escaped", "absorbed", "lost")], axis=0)
                outcome += same(f"{name}, accounts", parts, power["emitted"], 1e-9)
    note = f"at most {most:.0f} MiB and {longest:.1f} s each, with the kernels compiled"
    return outcome + Outcome(notes=(note,))


@row("L14", "what each integrator declares to find", "closed forms of direct light")
def direct_light_in_all_integrators(effort: Effort) -> Outcome:
    """Every lamp straight above a floor, in every integrator that declares to find it."""
    outcome = Outcome()
    square = 0.5**2 + 1.5**2
    sphere = math.pi * 2.0 * 0.6**2 / square * 1.5 / math.sqrt(square)
    corner = 0.5 * 2 * (1 / math.hypot(1, 1)) * math.atan(1 / math.hypot(1, 1))
    lights: dict[str, tuple[str, list[Light], GradientSky | None, float]] = {
        "point": ("P", [PointLight((0, 0, 2), 4.0)], None, 1.0),
        "sphere": ("L", [SphereLight((0.5, 0, 1.5), 0.6, 2.0)], None, sphere),
        "rectangle": ("L", [RectangleLight((0, 0, 1), (0, 1, 0), (1, 0, 0), 1.0)], None, corner),
        "sky": ("K", [], WHITE_SKY, math.pi),
        "gradient": ("K", [], GradientSky(0.0, 1.0, (0, 0, 1)), math.pi * 5 / 6),
    }
    camera = eye((0, -1, 0.02), (0, 0, 0), 16, (0, 0, 1))
    for name, (letter, lamps, sky, irradiance) in lights.items():
        for integrator in INTEGRATORS:
            declared = DECLARED[integrator]
            if not re.fullmatch(declared.finds(declared.options()), f"{letter}DE"):
                outcome = outcome.checked(False, f"{integrator} declares not to find {name}")
                continue
            result = picture(
                effort, Scene(camera, [FLOOR], lamps, sky), integrator, effort.count(8),
                n_photons=500,
            )  # fmt: skip
            off = off_by_pixels(result, 0.5 / math.pi * irradiance, 1e-5)
            outcome += judged(f"{integrator}, {name}", result, off)
    return outcome
