"""Rows D08, D19, D21, D33, D34, L01 to L05, L07, L08, L12: light at its extremes."""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from scipy import stats

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.lights import GradientSky, PointLight, RectangleLight, SphereLight
from hybrid_rt.lights.light import Light
from hybrid_rt.materials import Dielectric, Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Box, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    ALARM,
    FEW_PASSES,
    FLOAT32,
    INTEGRATORS,
    PHOTON_INTEGRATORS,
    PLAIN_PATHS,
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
    slab,
)
from proof.stability.row import Effort, Outcome, refusal, row

VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
FLOOR = floor(Lambertian(0.5))
GLASS = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5), "glass")
LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 2.0)
BLACK = np.zeros((12, 12, 3))


# --- little to see


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
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for lights in ([], [PointLight((0, 0, 5), 1.0)]):
            for environment, expected in ((None, 0.0), (GradientSky(0.25, 0.25), 0.25)):
                result = picture(effort, Scene(VIEW, [], lights, environment), integrator)
                outcome += finite(integrator, result)
                outcome += same(integrator, result.image, np.full((12, 12, 3), expected))
    return outcome


@row("D19", "lights of no area, without power, none at all", "black; refusals")
def lights_without_light(effort: Effort) -> Outcome:
    """Add lamps that are dark: they bring nothing and disturb nothing."""
    outcome = Outcome()
    shining = [FLOOR, Object(Sphere((0, 0, 3), 0.5), Emissive(0.0), "dark")]
    dark = {
        "rectangle": Scene(VIEW, [FLOOR, GLASS], [RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 0.0)]),
        "two": Scene(VIEW, [FLOOR, GLASS], [SphereLight((0, 0, 3), 0.5, 0.0), PointLight((0, 0, 5), 0.0)]),
        "none": Scene(VIEW, [FLOOR, GLASS]),
        "object": Scene(VIEW, shining),
        "sky": Scene(VIEW, [FLOOR, GLASS], environment=GradientSky(0, 0)),
    }  # fmt: skip
    for integrator in INTEGRATORS:
        for name, scene in dark.items():
            image = picture(effort, scene, integrator, 2).image
            outcome += same(f"{integrator}, dark {name}", image, BLACK)
        # Whitted's method asks every light, with random numbers for each: a point needs none.
        bright = PointLight((0, 0, 3), 2.0) if integrator == "whitted" else LAMP
        one, two = (
            picture(effort, Scene(VIEW, [FLOOR], lights), integrator, 2, max_depth=0).image
            for lights in ([bright], [bright, SphereLight((8, 8, 3), 0.5, 0.0)])
        )
        outcome += same(f"{integrator}, a dark lamp beside a bright one", one, two)
    for e, f in (((1, 0, 0), (2, 0, 0)), ((0, 0, 0), (0, 1, 0)), ((1e-200, 0, 0), (0, 1e-200, 0))):
        outcome += refusal(partial(RectangleLight, (0, 0, 1), e, f, 1.0), "RectangleLight edge")
    for radius in (0.0, -1.0, math.nan):
        outcome += refusal(partial(SphereLight, (0, 0, 1), radius, 1.0), "SphereLight radius")
    return outcome + refusal(lambda: PointLight((0, 0, 1), -1.0), "PointLight intensity")


# --- strengths


def _busy(strength: float) -> Scene:
    lamp = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), strength)
    sky = GradientSky(strength, 0.5 * strength)
    return Scene(VIEW, [FLOOR, GLASS], [lamp, PointLight((2, -2, 3), strength)], sky)


@row("D33", "radiance 2^99, 2^-99, 1e30 and 1e-30", "identity: light is linear")
@row("L08", "radiance from 1e-30 to 1e30", "identity: light is linear")
def radiance_over_sixty_decades(effort: Effort) -> Outcome:
    """Scale all light: the picture is scaled, to roundings of float32, and the report finite."""
    factors = effort.some((1e-30, 2.0**-99, 1e-10, 2.0**10, 1e20, 2.0**99, 1e30))
    outcome = Outcome()
    for integrator in INTEGRATORS:
        plain = picture(effort, _busy(1.0), integrator, 3, n_photons=1000).image.astype(np.float64)
        for factor in factors:
            result = picture(effort, _busy(factor), integrator, 3, n_photons=1000)
            name = f"{integrator}, radiance {factor:g}"
            outcome += finite(name, result) + same(name, result.image, plain * factor, 1e-6)
            numbers = [v for v in result.report["noise"].values() if isinstance(v, float)]
            fault = f"{name}: the report has numbers that are infinite or none"
            outcome = outcome.checked(all(map(math.isfinite, numbers)), fault)
    return outcome


# --- paths that hardly end


def _shining_room(albedo: float) -> Scene:
    """Return a closed ball seen from within; its wall has radiance one and sends on its albedo."""
    wall = Object(Sphere((0, 0, 0), 1).flipped(), Emissive(1.0, Lambertian(albedo)), "room")
    return Scene(Camera((0, 0, 0), (1, 0, 0), (0, 0, 1), 90, 8, 8), [wall])


@row("L02", "albedo up to 0.999", "white furnace: 1 / (1 - albedo)")
def albedo_near_one(effort: Effort) -> Outcome:
    """Paths to roundings, with what is cut off; photons to their noise and blur."""
    outcome, max_depth = Outcome(), effort.count(2000, 200)
    for albedo in (0.0, 0.5, 0.8, 0.9, 0.99, 0.999):
        room, whole = _shining_room(albedo), 1.0 / (1.0 - albedo)
        result = picture(effort, room, "path", max_depth=max_depth, options=PLAIN_PATHS)
        lost = result.report.ended_branches.lost_weight_per_camera_ray
        truth = whole * (1.0 - albedo ** (max_depth + 2))
        name = f"path, albedo {albedo:g}"
        outcome += judged(name, result, off_by_pixels(result, truth, 1e-5))
        outcome += same(f"{name}: what is lost", [lost], [albedo ** (max_depth + 1)], 1e-9)
        if albedo <= 0.9:
            # The same with roulette as it is by default.
            result = picture(effort, room, "path", effort.count(32), max_depth=200)
            outcome += judged(f"{name}, roulette", result, off_by_pixels(result, whole, 1e-5))
            for integrator in PHOTON_INTEGRATORS:
                result = picture(
                    effort, room, integrator, FEW_PASSES, max_depth=1000,
                    n_photons=effort.count(4000, 1000),
                )  # fmt: skip
                # Discs on a curved wall cover a little less of it than their area, and the nearest
                # photons reach farther: measured, not derived.
                off = off_by_passes(result, whole, 0.03)
                outcome += judged(f"{integrator}, albedo {albedo:g}", result, off)
    return outcome


@row("L03", "parallel mirrors of reflectance up to 0.999", "geometric series with what is lost")
def mirrors_near_one(effort: Effort) -> Outcome:
    """Radiance and the rest of the series that was cut off make the whole of it.

    Photon maps end eye paths by roulette: there the whole series is the mean of many.
    """
    outcome, colors = Outcome(), (0.5, 0.9, 0.99, 0.999)
    for integrator in INTEGRATORS:
        by_chance = integrator in PHOTON_INTEGRATORS
        # Eye passes of photons have no end but chance: the longest are for full runs.
        for color in colors[:3] if effort.is_small and by_chance else colors:
            scene = Scene(eye((0, 0, 1), (0, 0, -9), 16 if by_chance else 4), mirrors(color, 1.0))
            max_depth = 10**6 if by_chance else effort.count(400, 50)
            result = picture(
                effort, scene, integrator, max_depth=max_depth, n_photons=500,
                options=PLAIN_PATHS if integrator == "path" else None,
            )  # fmt: skip
            truth, name = 1.0 / (1.0 - color), f"{integrator}, mirrors of {color:g}"
            if by_chance:
                # No photons are needed, so pixels are independent of each other.
                outcome += judged(name, result, off_by_pixels(result, truth))
                continue
            # What is lost is the weight of the first term that is not there.
            lost = result.report.ended_branches.lost_weight_per_camera_ray
            found = float(result.image.mean(dtype=float)) + lost * truth
            outcome += finite(name, result) + same(name, [found], [truth], 1e-5)
    return outcome


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
    outcome, most = Outcome(), 0.0
    for title, scene in scenes.items():
        for integrator in INTEGRATORS:
            result, mib = measured(
                partial(picture, effort, scene, integrator, 2, n_photons=effort.count(2000, 200))
            )
            name, most = f"{integrator}, {title}", max(most, mib)
            outcome += finite(name, result) + Outcome(rays=sum(result.report.rays.values()))
            # Beyond what there was before, of pictures of a few pixels.
            outcome = outcome.checked(mib < 400.0, f"{name}: {mib:.0f} MiB")
            given_up = result.report.geometry.given_up
            outcome = outcome.checked(not given_up, f"{name}: {given_up} rays given up")
            power = (result.report.get("photons") or {}).get("power_of_all_passes")
            if power and any(power["emitted"]):
                parts = np.sum([power[k] for k in ("escaped", "absorbed", "lost")], axis=0)
                outcome += same(f"{name}, accounts", parts, power["emitted"], 1e-9)
    return outcome + Outcome(notes=(f"at most {most:.0f} MiB each",))


# --- glass and lamps


@row("L01", "indices from 1 + 1e-12 to 1000 and to 1e-3", "closed form: light through a plate")
def light_through_plates(effort: Effort) -> Outcome:
    """Look through plates: (1 - R) / (1 + R) of the lamp, all reflections together."""
    lamp = RectangleLight((-50, -50, -2), (100, 0, 0), (0, 100, 0), 1.0)
    above = [10.0**k for k in (-12, -9, -6, -3, -2, -1)] + [0.5, 1.4, 9.0, 99.0, 999.0]
    outcome = Outcome()
    for is_path in (True, False):
        for ior in [1.0 + x for x in above] + [1.0 / (1.0 + x) for x in above]:
            reflected = ((ior - 1.0) / (ior + 1.0)) ** 2
            truth = (1.0 - reflected) / (1.0 + reflected)
            scene = Scene(eye((0, 0, 5), (0, 0, -9)), [slab(-1, 0, Dielectric(ior))], [lamp])
            result = picture(
                effort, scene, "path" if is_path else "whitted", effort.count(4) if is_path else 1,
                max_depth=4000 if is_path else 300, options=PLAIN_PATHS if is_path else None,
            )  # fmt: skip
            # Faint branches of Whitted's method are not followed, and it says what they carry.
            lost = result.report.ended_branches.lost_weight_per_camera_ray
            off = off_by_pixels(result, truth, level=lost)
            if is_path:
                # Each path brings all or nothing, and one of the two may be rare.
                n = result.report.rays["camera"]
                chance = stats.binom(n, truth)
                low, high = chance.ppf(ALARM / 2) / n, chance.isf(ALARM / 2) / n
                off = off[0], float(max(high - truth, truth - low)) + FLOAT32
            outcome += judged(f"{'path' if is_path else 'whitted'}, index {ior:.12g}", result, off)
    return outcome


def _below_a_square(side: float, height: float) -> float:
    """Return the irradiance below the middle of a square of radiance one (four corners, C-11)."""
    p = math.hypot(side / 2, height)
    return 4.0 * (side / 2) / p * math.atan((side / 2) / p)


def _square(side: float, height: float) -> RectangleLight:
    """Return a level square of radiance one that shines down."""
    return RectangleLight((-side / 2, -side / 2, height), (0, side, 0), (side, 0, 0), 1.0)


def _lit(
    effort: Effort, name: str, camera: Camera, lamp: Light | Object, irradiance: float
) -> Outcome:
    """Compare the floor's radiance below a lamp, or an object that shines, in all integrators."""
    scene = (
        Scene(camera, [FLOOR, lamp]) if isinstance(lamp, Object) else Scene(camera, [FLOOR], [lamp])
    )
    outcome = Outcome()
    for integrator in INTEGRATORS:
        result = picture(effort, scene, integrator, effort.count(4), max_depth=0, n_photons=200)
        # The camera sees the floor 1e-8 beside the point: nothing that counts.
        off = off_by_pixels(result, 0.5 / math.pi * irradiance, 1e-5)
        outcome += judged(f"{integrator}, {name}", result, off)
    return outcome


@row("L04", "lamps of 1e-6 to 1e6 of the scene", "closed forms of the irradiance")
def lamps_of_all_sizes(effort: Effort) -> Outcome:
    """Squares and balls one above the floor: lamps, and objects that shine."""
    outcome, camera = Outcome(), eye((0, -0.5, 0.5), (0, 0, 0), 16, (0, 0, 1))
    for size in effort.some(tuple(10.0**k for k in range(-6, 7))):
        outcome += _lit(effort, f"square of {size:g}", camera, _square(size, 1.0),
                        _below_a_square(size, 1.0))  # fmt: skip
        # Wholly above the floor: pi (r / d)^2.
        light, middle = math.pi * (size / (1.0 + size)) ** 2, (0, 0, 1.0 + size)
        for lamp in (SphereLight(middle, size, 1.0), Object(Sphere(middle, size), Emissive(1.0))):
            name = f"{type(lamp).__name__} of {size:g}"
            outcome += _lit(effort, name, camera, lamp, light)
    return outcome


@row("L05", "lamps that touch surfaces, or nearly", "closed forms of the irradiance")
def lamps_in_contact(effort: Effort) -> Outcome:
    """Lower a square from 1 to 1e-12 above the floor; balls touch it and reach into it."""
    outcome = Outcome()
    for gap in (10.0**k for k in range(-12, 1)):
        # From between the two: straight down on the floor below the middle.
        camera = Camera((0, 0, gap / 2), (0, 0, 0), (0, 1, 0), 1e-6, 12, 12)
        outcome += _lit(effort, f"square {gap:g} above the floor", camera, _square(0.5, gap),
                        _below_a_square(0.5, gap))  # fmt: skip
    camera = eye((0.5, -0.5, 0.05), (0.3, 0, 0), 12, (0, 0, 1))
    for gap in (0.0, 1e-15, 1e-12, -1e-12, 1e-6, 1e-3):
        height = 0.2 + gap
        light = math.pi * 0.2**2 * height / math.hypot(0.3, height) ** 3
        ball = Object(Sphere((0, 0, height), 0.2), Emissive(1.0), "lamp")
        for lamp in (SphereLight((0, 0, height), 0.2, 1.0), ball):
            name = f"{type(lamp).__name__} {gap:g} above the floor"
            outcome += _lit(effort, name, camera, lamp, light)
    # Held to a pane of glass: head-on, (1 - R) / (1 + R) of it comes through.
    pane = slab(0, 1, Dielectric(1.5))
    for integrator in INTEGRATORS:
        for gap in (1e-12, 1e-6):
            below = RectangleLight((-50, -50, -gap), (100, 0, 0), (0, 100, 0), 1.0)
            scene = Scene(eye((0, 0, 5), (0, 0, 0), 24), [pane], [below])
            result = picture(
                effort, scene, integrator, effort.count(8), max_depth=60, n_photons=200
            )
            # The lamp is black: what the pane sends back to it is lost.
            lost = result.report.ended_branches.lost_weight_per_camera_ray
            off = off_by_pixels(result, 0.96 / 1.04, 1e-5, lost)
            outcome += judged(f"{integrator}, lamp {gap:g} below glass", result, off)
    return outcome


# --- photons: half a side of the lamp, of the pane and of the floor, and how high the lamp hangs

HALF, HEIGHT = 4.0, 0.5
# Diagonal of the box around them, and what share of it a first disc may be.
ACROSS = math.sqrt(2 * (2 * HALF) ** 2 + HEIGHT**2)
NARROWEST, WIDEST = 1e-6, 0.25
# Radii over that diagonal.
SHARES = (1e-12, 1e-9, 1e-7, 1.01e-6, 1e-5, 1e-4, 1e-3, 3e-3, 1e-2, 3e-2, 0.1, 0.249, 0.5, 1.0)
BELOW_PANE = eye((0, -0.25, 0.15), (0, 0, 0), 4, (0, 0, 1))


def _evenly_lit(camera: Camera) -> Scene:
    """Return a floor under a lamp as large, behind a pane of index one.

    The pane bends nothing, but it is glass: only photons find the light behind it.
    """
    pane = Box((-HALF, -HALF, 0.4 * HEIGHT), (HALF, HALF, 0.6 * HEIGHT))
    objects = [floor(Lambertian(0.5), HALF), Object(pane, Dielectric(1.0), "pane")]
    return Scene(camera, objects, [_square(2 * HALF, HEIGHT)])


def _irradiance(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the irradiance of that floor (Siegel and Howell, configuration C-11)."""

    def corner(a: FloatArray, b: FloatArray) -> FloatArray:
        p, q = np.hypot(a, HEIGHT), np.hypot(b, HEIGHT)
        found: FloatArray = 0.5 * (a / p * np.arctan(b / p) + b / q * np.arctan(a / q))
        return found

    return (
        corner(HALF - x, HALF - y) - corner(-HALF - x, HALF - y)
        - corner(HALF - x, -HALF - y) + corner(-HALF - x, -HALF - y)
    )  # fmt: skip


def _blurred(radius: float) -> float:
    """Return the radiance in the middle of the floor as a disc shows it, (1 - d^2 / r^2) its weight."""
    share = (np.arange(200) + 0.5) / 200
    turn = (np.arange(64) + 0.5) / 64 * 2 * math.pi
    # Even in the weight's integral: 2 s - s^2 with s = d^2 / r^2.
    away = radius * np.sqrt(1 - np.sqrt(1 - share))[:, None]
    return 0.5 / math.pi * float(_irradiance(away * np.cos(turn), away * np.sin(turn)).mean())


@row("D21", "points that no photon reaches", "0, and counted")
def points_without_photons(effort: Effort) -> Outcome:
    """Discs without photons are black, finite, and named in the report."""
    options = PPMOptions(100, initial_radius=1.01 * NARROWEST * ACROSS)
    result = picture(effort, _evenly_lit(BELOW_PANE), "ppm", 3, options=options)
    outcome = finite("ppm, least discs", result)
    outcome += same("ppm, least discs", result.image, np.zeros(result.image.shape))
    n_points = result.report["photons"]["gather_points"]
    missed = result.report.points_missed_by_photons
    return outcome.checked(missed == n_points > 0, f"{missed} of {n_points} points are said")


@row("L07", "gather radii from 1e-12 of the scene to the scene", "closed form: mean over a disc")
def gather_radii(effort: Effort) -> Outcome:
    """Radii that are taken give the mean of the light over their discs; others are refused."""
    outcome, scene, n_photons = Outcome(), _evenly_lit(BELOW_PANE), effort.count(20_000, 4000)
    # r^2 falls by (k + alpha) / (k + 1) each pass.
    factors = np.cumprod([1.0, *((k + 2.0 / 3.0) / (k + 1) for k in range(1, FEW_PASSES))])
    for share in effort.some(SHARES):
        radius = share * ACROSS
        options = PPMOptions(n_photons, 2.0 / 3.0, radius)
        render = partial(picture, effort, scene, "ppm", FEW_PASSES, options=options)
        if not NARROWEST <= share <= WIDEST:
            outcome += refusal(render, "initial_radius", "across")
            continue
        result, name, radii = render(), f"ppm, discs of {radius:.3g}", radius * np.sqrt(factors)
        outcome += finite(name, result) + Outcome(rays=n_photons)
        # Of fewer photons there is no mean: what is asked is that pictures are numbers.
        if n_photons * math.pi * (radii**2).sum() / (2 * HALF) ** 2 >= 100.0:
            truth = float(np.mean([_blurred(r) for r in radii]))
            outcome += judged(name, result, off_by_passes(result, truth, 1e-3))
    for nearest in effort.some((2, 10, 60, 1000)):
        own = PhotonMapOptions(n_photons, nearest)
        result = picture(effort, scene, "photon_map", FEW_PASSES, options=own)
        # The disc ends at the farthest of so many photons: the mean is off by one in so many.
        off = off_by_passes(result, _blurred(1e-6), 1.5 / nearest + 2e-2)
        outcome += judged(f"photon_map, {nearest} nearest", result, off)
    return outcome
