"""Rows D16, D18, D19, D33, L02, L03, L08: paths that hardly end, lamps that are dark or bright."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

import numpy as np

from hybrid_rt.lights import GradientSky, PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.light import Light
from hybrid_rt.materials import Dielectric, Emissive, Lambertian
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    FEW_PASSES,
    INTEGRATORS,
    PHOTON_INTEGRATORS,
    PLAIN_PATHS,
    eye,
    finite,
    floor,
    judged,
    mirrors,
    off_by_passes,
    off_by_pixels,
    picture,
    same,
    shown,
)
from proof.stability.row import Curve, Effort, Outcome, refusal, row

VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
FLOOR = floor(Lambertian(0.5))
GLASS = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5), "glass")
WITHIN = Camera((0, 0, 0), (1, 0, 0), (0, 0, 1), 90, 8, 8)
ALBEDOS = (0.0, 0.5, 0.8, 0.9, 0.99, 0.999)


def shining_room(albedo: float) -> Scene:
    """Return a closed ball seen from within; its wall has radiance one and sends on its albedo."""
    wall = Sphere((0, 0, 0), 1).flipped()
    return Scene(WITHIN, [Object(wall, Emissive(1.0, Lambertian(albedo)), "room")])


def _furnace_of_paths(effort: Effort, albedo: float, max_depth: int) -> tuple[Outcome, float]:
    """Radiance and what is said to be lost make 1 / (1 - albedo) together."""
    result = picture(
        effort, shining_room(albedo), "path", max_depth=max_depth, options=PLAIN_PATHS
    )  # fmt: skip
    ended = result.report["ended_branches"]
    lost = ended["lost_weight_per_camera_ray"]
    n = max_depth + 2
    truth = float(n) if albedo == 1.0 else (1.0 - albedo**n) / (1.0 - albedo)
    name = f"path, albedo {albedo:g}, {max_depth} directions"
    outcome = judged(name, result, off_by_pixels(result, truth, 1e-5))
    outcome += same(f"{name}: what is lost", [lost], [albedo ** (max_depth + 1)], 1e-9)
    if albedo < 1.0:
        whole = float(result.image.mean(dtype=float)) + lost * albedo / (1.0 - albedo)
        outcome += same(f"{name}: with what is lost", [whole], [1.0 / (1.0 - albedo)], 1e-5)
    return outcome, abs(float(result.image.mean(dtype=float)) / truth - 1.0)


@row("D16", "closed white room", "white furnace: a geometric series, and what is lost is said")
def closed_white_room(effort: Effort) -> Outcome:
    """Albedo one: after n directions n + 2 terms are seen, and the rest is in the report."""
    outcome = Outcome()
    for max_depth in (0, 1, 9, 100):
        outcome += _furnace_of_paths(effort, 1.0, max_depth)[0]
    for integrator in INTEGRATORS:
        result = picture(effort, shining_room(1.0), integrator, 2, n_photons=2000)
        outcome += finite(f"{integrator}, albedo 1", result)
        ended = result.report.ended_branches.lost_weight_per_camera_ray
        photons = result.report.get("photons")
        lost = sum(photons["power_of_all_passes"]["lost"]) if photons else ended
        said = lost > 0.0 or bool(result.report.light_not_found)
        outcome = outcome.checked(said, f"{integrator}, albedo 1: ends without a word")
    return outcome


def _between_mirrors(
    effort: Effort, integrator: str, color: float, max_depth: int
) -> tuple[Outcome, float]:
    """Look straight down between shining mirrors: the sum of color^k, less what is lost.

    Photon maps end eye paths by roulette: there the whole series is the mean of many.
    """
    by_chance = integrator in PHOTON_INTEGRATORS
    scene = Scene(eye((0, 0, 1), (0, 0, -9), 16 if by_chance else 4), mirrors(color, 1.0))
    result = picture(
        effort, scene, integrator, max_depth=10**6 if by_chance else max_depth, n_photons=500,
        options=PLAIN_PATHS if integrator == "path" else None,
    )  # fmt: skip
    truth = 1.0 / (1.0 - color)
    name = f"{integrator}, mirrors of {color:g}, {max_depth} directions"
    if by_chance:
        # No photons are needed, so pixels are independent of each other.
        off = off_by_pixels(result, truth)
        return judged(name, result, off), off[0]
    # What is lost is the weight of the first term that is not there.
    lost = result.report.ended_branches.lost_weight_per_camera_ray
    found = float(result.image.mean(dtype=float))
    rest = lost * truth
    outcome = finite(name, result) + same(name, [found + rest], [truth], 1e-5)
    return outcome, abs(found + rest - truth)


@row("D18", "two parallel mirrors", "geometric series; what is lost is said")
def parallel_mirrors(effort: Effort) -> Outcome:
    """Nothing ends such a path but its length, and the report says what it still carried."""
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for max_depth, color in ((5, 0.9), (12, 0.7), (16, 1.0)):
            scene = Scene(
                eye((0, 0, 1), (0, 0, -9)), mirrors(color), [PointLight((5, 5, 1), 1.0)]
            )  # fmt: skip
            result = picture(
                effort, scene, integrator, max_depth=max_depth, n_photons=500,
                options=PLAIN_PATHS if integrator == "path" else None,
            )  # fmt: skip
            name = f"{integrator}, dark mirrors of {color:g}"
            ended = result.report["ended_branches"]
            n_rays = result.report.rays["camera"]
            outcome += same(name, result.image, np.zeros(result.image.shape))
            # As many factors as directions asked for: the last is not taken any more.
            lost, expected = ended["lost_weight_per_camera_ray"], color ** (max_depth + 1)
            if integrator in PHOTON_INTEGRATORS and color < 1.0:
                # Roulette: of n rays a binomial number arrives, each with a weight of one at most.
                spread = 4.5 / math.sqrt(n_rays * expected) + 12.0 / (n_rays * expected)
                outcome += same(f"{name}, lost", [lost], [expected], spread)
            else:
                outcome += same(f"{name}, ended", [ended["at max_depth"]], [n_rays])
                outcome += same(f"{name}, lost", [lost], [expected], 1e-11)
            if color < 1.0:
                outcome += _between_mirrors(effort, integrator, color, max_depth)[0]
    return outcome


@row("D19", "lights of no area, without power, none at all", "black; refusals")
def lights_without_light(effort: Effort) -> Outcome:
    """Add lamps that are dark: they bring nothing and disturb nothing."""
    outcome = Outcome()
    dark: tuple[list[Light], ...] = (
        [RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 0.0)],
        [SphereLight((0, 0, 3), 0.5, 0.0), PointLight((0, 0, 5), 0.0)],
        [],
    )
    lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 2.0)
    for integrator in INTEGRATORS:
        for lights in dark:
            result = picture(effort, Scene(VIEW, [FLOOR, GLASS], lights), integrator, 2)
            outcome += same(
                f"{integrator}, {len(lights)} dark", result.image, np.zeros((12, 12, 3))
            )
        shining = [FLOOR, Object(Sphere((0, 0, 3), 0.5), Emissive(0.0), "dark")]
        result = picture(effort, Scene(VIEW, shining), integrator, 2)
        outcome += same(f"{integrator}, dark object", result.image, np.zeros((12, 12, 3)))
        result = picture(
            effort, Scene(VIEW, [FLOOR, GLASS], environment=GradientSky(0, 0)), integrator
        )
        outcome += same(f"{integrator}, dark sky", result.image, np.zeros((12, 12, 3)))
        # Whitted's method asks every light, with random numbers for each: a point needs none.
        bright = PointLight((0, 0, 3), 2.0) if integrator == "whitted" else lamp
        pictures = [
            picture(effort, Scene(VIEW, [FLOOR], lights), integrator, 2, max_depth=0).image
            for lights in ([bright], [bright, SphereLight((8, 8, 3), 0.5, 0.0)])
        ]
        outcome += same(f"{integrator}, a dark lamp beside a bright one", pictures[0], pictures[1])
    for edges in (((1, 0, 0), (2, 0, 0)), ((0, 0, 0), (0, 1, 0)), ((1e-200, 0, 0), (0, 1e-200, 0))):
        outcome += refusal(
            partial(RectangleLight, (0, 0, 1), edges[0], edges[1], 1.0), "RectangleLight edge"
        )
    for radius in (0.0, -1.0, math.nan):
        outcome += refusal(partial(SphereLight, (0, 0, 1), radius, 1.0), "SphereLight radius")
    return outcome + refusal(lambda: PointLight((0, 0, 1), -1.0), "PointLight intensity")


def _busy(strength: float) -> Scene:
    lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), strength)
    sky = GradientSky(strength, 0.5 * strength)
    return Scene(VIEW, [FLOOR, GLASS], [lamp, PointLight((2, -2, 3), strength)], sky)


def _scaled(effort: Effort, factors: Sequence[float], relative: float) -> tuple[Outcome, Curve]:
    outcome, errors = Outcome(), [0.0] * len(factors)
    for integrator in INTEGRATORS:
        plain = picture(effort, _busy(1.0), integrator, 3, n_photons=1000)
        for k, factor in enumerate(factors):
            result = picture(effort, _busy(factor), integrator, 3, n_photons=1000)
            name = f"{integrator}, radiance {factor:g}"
            expected = plain.image.astype(np.float64) * factor
            outcome += finite(name, result) + same(name, result.image, expected, relative)
            gap = np.abs(result.image / expected - 1.0).max()
            errors[k] = max(errors[k], float(gap))
            numbers = [v for v in result.report["noise"].values() if isinstance(v, float)]
            fault = f"{name}: the report has numbers that are infinite or none"
            outcome = outcome.checked(all(map(math.isfinite, numbers)), fault)
    curve = Curve(
        "radiance", "picture over that of radiance one, less one", list(factors), shown(errors),
        [relative] * len(factors), unit="of the value",
    )  # fmt: skip
    return outcome, curve


@row("D33", "radiance 2^99, 2^-99, 1e30 and 1e-30", "identity: light is linear")
def very_bright_and_very_dark(effort: Effort) -> Outcome:
    """Scale all light: the picture is scaled, to roundings of float32, and the report finite."""
    return _scaled(effort, effort.some((2.0**99, 2.0**-99, 1e30, 1e-30)), 1e-6)[0]


@row("L02", "albedo up to 0.999", "white furnace: 1 / (1 - albedo)")
def albedo_near_one(effort: Effort) -> Outcome:
    """Paths to roundings, with what is cut off; photons to their noise and blur."""
    outcome, errors = Outcome(), []
    for albedo in ALBEDOS:
        more, error = _furnace_of_paths(effort, albedo, effort.count(2000, 200))
        outcome += more
        errors.append(error)
        if albedo <= 0.9:
            # The same with roulette as it is by default.
            result = picture(effort, shining_room(albedo), "path", effort.count(32), max_depth=200)
            off = off_by_pixels(result, 1.0 / (1.0 - albedo), 1e-5)
            outcome += judged(f"path with roulette, albedo {albedo:g}", result, off)
    path = Curve(
        "1 / (1 - albedo)", "path", [1 / (1 - a) for a in ALBEDOS], shown(errors),
        [1e-5] * len(ALBEDOS), unit="of the radiance",
    )  # fmt: skip
    curves = [path]
    for integrator in PHOTON_INTEGRATORS:
        gaps, allowed, some = [], [], ALBEDOS[:4]
        for albedo in some:
            result = picture(
                effort, shining_room(albedo), integrator, FEW_PASSES, max_depth=1000,
                n_photons=effort.count(4000, 1000),
            )  # fmt: skip
            truth = 1.0 / (1.0 - albedo)
            # Discs on a curved wall cover a little less of it than their area, and the nearest
            # photons reach farther: measured, not derived.
            off = off_by_passes(result, truth, 0.03)
            outcome += judged(f"{integrator}, albedo {albedo:g}", result, off)
            gaps.append(off[0] / truth)
            allowed.append(off[1] / truth)
        curves.append(
            Curve("1 / (1 - albedo)", integrator, [1 / (1 - a) for a in some], shown(gaps), allowed,
                  unit="of the radiance")
        )  # fmt: skip
    result = picture(effort, shining_room(0.5), "whitted")
    found = "light that goes from surface to surface" in " ".join(result.report.light_not_found)
    outcome += finite("whitted", result).checked(found, "whitted: does not say what it leaves out")
    return outcome + Outcome(curves=tuple(curves))


@row("L03", "parallel mirrors of reflectance up to 0.999", "geometric series with what is lost")
def mirrors_near_one(effort: Effort) -> Outcome:
    """Radiance and the rest of the series that was cut off make the whole of it."""
    outcome, curves = Outcome(), []
    colors = (0.5, 0.9, 0.99, 0.999)
    for integrator in INTEGRATORS:
        gaps = []
        # Eye passes of photons have no end but chance: the longest are for full runs.
        some = colors[:3] if effort.is_small and integrator in PHOTON_INTEGRATORS else colors
        for color in some:
            more, gap = _between_mirrors(effort, integrator, color, effort.count(400, 50))
            outcome += more
            gaps.append(gap * (1.0 - color))
        curves.append(
            Curve("1 / (1 - reflectance)", integrator, [1 / (1 - c) for c in some], shown(gaps),
                  [1e-2] * len(some), unit="of the radiance")
        )  # fmt: skip
    return outcome + Outcome(curves=tuple(curves))


@row("L08", "radiance from 1e-30 to 1e30", "identity: light is linear")
def radiance_over_sixty_decades(effort: Effort) -> Outcome:
    """Powers of two and of ten: the picture scaled, in all integrators."""
    factors = (1e-30, 1e-20, 1e-10, 1e-3, 2.0**-10, 1.0, 2.0**10, 1e3, 1e10, 1e20, 1e30)
    outcome, curve = _scaled(effort, effort.some(factors), 1e-6)
    return outcome + Outcome(curves=(curve,))
