"""Rows D09, D10, D14, D15, L01, L09, L10: clear bodies and rough surfaces."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import partial

from scipy import stats

from hybrid_rt.lights import GradientSky, RectangleLight
from hybrid_rt.materials import Dielectric
from hybrid_rt.materials.material import Material
from hybrid_rt.materials.rough_conductor import RoughConductor
from hybrid_rt.materials.rough_dielectric import RoughDielectric
from hybrid_rt.primitives import Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.light_run import (
    ALARM,
    FLOAT32,
    INTEGRATORS,
    PLAIN_PATHS,
    WHITE_SKY,
    eye,
    finite,
    judged,
    off_by_pixels,
    picture,
    same,
    shown,
    slab,
)
from proof.stability.row import Curve, Effort, Outcome, refusal, row

SKY = GradientSky((0.1, 0.2, 0.3), (0.9, 0.5, 0.1))
# Directions that a path may take in a plate: as good as no end.
NO_END = 400


def through_layers(indices: Sequence[float], depths: Sequence[float]) -> float:
    """Return the radiance that layers show head-on in the midst of radiance one.

    Incoherent sums of all reflections, layer by layer (the adding method); ``depths`` are the
    optical depths of the inner layers.
    """
    through, back_front, back_rear = 1.0, 0.0, 0.0
    for k in range(len(indices) - 1):
        r = ((indices[k] - indices[k + 1]) / (indices[k] + indices[k + 1])) ** 2
        t = 1.0 - r
        ring = 1.0 / (1.0 - back_rear * r)
        back_front, back_rear = (
            back_front + through**2 * r * ring,
            r + t * t * back_rear * ring,
        )
        through = through * t * ring
        if k < len(depths):
            a = math.exp(-depths[k])
            through, back_rear = through * a, back_rear * a * a
    return back_front + through


def _head_on(effort: Effort, scene: Scene, integrator: str, truth: float, name: str) -> Outcome:
    """Compare what an integrator sees of plates, straight from above."""
    is_path = integrator == "path"
    result = picture(
        effort, scene, integrator, effort.count(8) if is_path else 1, max_depth=NO_END,
        options=PLAIN_PATHS if is_path else None,
    )  # fmt: skip
    # Faint branches are not followed, and what they carry is said: light of radiance one, here.
    lost = result.report.ended_branches.lost_weight_per_camera_ray
    return judged(f"{integrator}, {name}", result, off_by_pixels(result, truth, level=lost))


@row("D09", "index 1 and 1 + 1e-12", "identity: the picture without the body")
def index_one(effort: Effort) -> Outcome:
    """See through bodies of the index around them, smooth and rough, with every integrator."""
    camera = Camera((0, 0, 4), (0, 0, 0), (0, 1, 0), 40, 16, 16)
    outcome = Outcome()
    for integrator in INTEGRATORS:
        without = picture(effort, Scene(camera, environment=SKY), integrator, 2).image
        for offset in (0.0, 1e-15, -1e-15, 1e-12, -1e-12):
            for body in (Dielectric(1.0 + offset), RoughDielectric(1.0 + offset, 0.3)):
                ball = Object(Sphere((0, 0, 0), 1), body)
                image = picture(effort, Scene(camera, [ball], environment=SKY), integrator, 2).image
                name = f"{integrator}, {type(body).__name__} of index 1 {offset:+g}"
                outcome += same(name, image, without, 1e-5)
        # Schlick's approximation is (1 - cos)^5 there: nothing head-on, and never 0/0.
        ball = Object(Sphere((0, 0, 0), 1), Dielectric(1.0, schlick=True))
        outcome += finite(
            f"{integrator}, Schlick",
            picture(effort, Scene(camera, [ball], environment=SKY), integrator, 2),
        )
        head_on = Scene(eye((0, 0, 4), (0, 0, 0), 4), [ball], environment=SKY)
        plain = Scene(head_on.camera, environment=SKY)
        pictures = [picture(effort, scene, integrator).image for scene in (head_on, plain)]
        outcome += same(f"{integrator}, Schlick head-on", pictures[0], pictures[1], 1e-5)
    note = "Schlick's approximation, on request, reflects (1 - cos)^5 also where the index is 1"
    return outcome + Outcome(notes=(note,))


@row("D10", "indices 1000 and 1e-3", "closed forms: plates, even light; never above the light")
def extreme_indices(effort: Effort) -> Outcome:
    """Look at a clear ball in even light: only what max_depth cuts off is missing, and it is said."""
    outcome = Outcome()
    camera = Camera((0, -4, 0), (0, 0, 0), (0, 0, 1), 40, 16, 12)
    for ior in (1000.0, 1e-3, 1e6, 1e-6):
        ball = Object(Sphere((0, 0, 0), 1.0), Dielectric(ior))
        for integrator in INTEGRATORS:
            options = PLAIN_PATHS if integrator == "path" else None
            result = picture(
                effort, Scene(camera, [ball], environment=WHITE_SKY), integrator,
                effort.count(4), max_depth=200, options=options,
            )  # fmt: skip
            name = f"{integrator}, index {ior:g}"
            outcome += finite(name, result)
            lost = result.report.ended_branches.lost_weight_per_camera_ray
            # Within an index of a million radiance is its square: what is lost there counts so.
            missing = 1.0 - float(result.image.mean())
            # Roulette strengthens paths that go on: then noise goes both ways.
            over = 1e-5 if integrator in ("path", "whitted") else 1e-3
            ok = -over <= missing <= 3e-3 + lost * max(ior, 1.0) ** 2
            fault = f"{name}: {missing:.3g} of the light is missing, {lost:.3g} is said to be"
            outcome += Outcome(rays=result.image.size).checked(ok, fault)
            fault = f"{name}: brighter than the light there is, {result.image.max():.8g}"
            outcome = outcome.checked(
                integrator != "whitted" or float(result.image.max()) <= 1 + 1e-5, fault
            )
    return outcome


@row("D14", "bodies within bodies, overlapping bodies", "closed form: stacks of plates")
def bodies_within_bodies(effort: Effort) -> Outcome:
    """Where bodies overlap the one of higher priority counts, in whatever order they stand."""
    stacks: tuple[tuple[list[Object], list[float], list[float]], ...] = (
        (
            [slab(0, 3, Dielectric(1.5, 0.1)), slab(1, 2, Dielectric(2.4, 0.4))],
            [1, 1.5, 2.4, 1.5, 1],
            [0.1, 0.4, 0.1],
        ),
        (
            [slab(1, 2, Dielectric(1.8, 0.2, priority=2)),
             slab(0, 1.5, Dielectric(1.3, 0.5, priority=1))],
            [1, 1.8, 1.3, 1],
            [0.2, 0.5],
        ),
        (  # Seven within each other, each thinner by a tenth on both sides.
            [slab(0.1 * k, 2 - 0.1 * k, Dielectric(1.1 + 0.1 * k)) for k in range(7)],
            [1, *(1.1 + 0.1 * k for k in range(7)), *(1.6 - 0.1 * k for k in range(6)), 1],
            [],
        ),
    )  # fmt: skip
    outcome = Outcome()
    for bodies, indices, depths in stacks:
        truth = through_layers(indices, depths)
        for integrator in INTEGRATORS:
            for order in (1, -1):
                scene = Scene(eye((0, 0, 5), (0, 0, -9)), bodies[::order], environment=WHITE_SKY)
                name = f"{len(bodies)} bodies, order {order:+d}"
                outcome += _head_on(effort, scene, integrator, truth, name)
    return outcome


@row("D15", "clear bodies that touch", "closed form: stacks of plates without air between")
def touching_bodies(effort: Effort) -> Outcome:
    """Pass shared faces from one body into the other."""
    glass, water = Dielectric(1.5, 0.1), Dielectric(1.33, 0.3)
    stacks = (
        ([slab(0, 1, glass), slab(1, 3, glass)], [1, 1.5, 1], [0.3]),
        ([slab(0, 1, glass), slab(1, 3, Dielectric(1.5, 0.1))], [1, 1.5, 1], [0.3]),
        (
            [slab(0, 1, glass), slab(1, 3, water), slab(3, 4, Dielectric(1.5, 0.1))],
            [1, 1.5, 1.33, 1.5, 1],
            [0.1, 0.6, 0.1],
        ),
        (  # Two faces a rounding apart overlap or leave a gap of air; it is no thicker than that.
            [slab(0, 1.0 + 1e-13, glass), slab(1, 3, glass)],
            [1, 1.5, 1],
            [0.3],
        ),
    )
    outcome = Outcome()
    for k, (bodies, indices, depths) in enumerate(stacks):
        truth = through_layers(indices, depths)
        for integrator in INTEGRATORS:
            for order in (1, -1):
                scene = Scene(eye((0, 0, 5), (0, 0, -9)), bodies[::order], environment=WHITE_SKY)
                outcome += _head_on(
                    effort, scene, integrator, truth, f"stack {k}, order {order:+d}"
                )
    return outcome


@row("L01", "indices from 1 + 1e-12 to 1000 and to 1e-3", "closed form: light through a plate")
def light_through_plates(effort: Effort) -> Outcome:
    """Look through plates: (1 - R) / (1 + R) of the lamp, all reflections together."""
    lamp = RectangleLight((-50, -50, -2), (100, 0, 0), (0, 100, 0), 1.0)
    outcome, curves = Outcome(), []
    above = [10.0**k for k in (-12, -9, -6, -3, -2, -1)] + [0.5, 1.4, 9.0, 99.0, 999.0]
    ratios = {
        "denser": [1.0 + x for x in above],
        "thinner": [1.0 / (1.0 + x) for x in above],
    }
    for integrator in ("path", "whitted"):
        for label, indices in ratios.items():
            errors, allowed = [], []
            for ior in indices:
                reflected = ((ior - 1.0) / (ior + 1.0)) ** 2
                truth = (1.0 - reflected) / (1.0 + reflected)
                scene = Scene(eye((0, 0, 5), (0, 0, -9)), [slab(-1, 0, Dielectric(ior))], [lamp])
                result = picture(
                    effort, scene, integrator, effort.count(4) if integrator == "path" else 1,
                    max_depth=4000 if integrator == "path" else 300,
                    options=PLAIN_PATHS if integrator == "path" else None,
                )  # fmt: skip
                # Faint branches of Whitted's method are not followed, and it says what they carry.
                lost = result.report.ended_branches.lost_weight_per_camera_ray
                off = off_by_pixels(result, truth, level=lost)
                if integrator == "path":
                    # Each path brings all or nothing, and one of the two may be rare.
                    n = result.report.rays["camera"]
                    chance = stats.binom(n, truth)
                    low, high = chance.ppf(ALARM / 2) / n, chance.isf(ALARM / 2) / n
                    off = off[0], float(max(high - truth, truth - low)) + FLOAT32
                outcome += judged(f"{integrator}, index {ior:.12g}", result, off)
                errors.append(off[0])
                allowed.append(off[1])
            title = f"{integrator}, {label}"
            curves.append(
                Curve("index ratio - 1", title, above, shown(errors), allowed, unit="radiance")
            )
    return outcome + Outcome(curves=tuple(curves))


def _furnace(
    effort: Effort, name: str, make: object, roughness: Sequence[float]
) -> tuple[Outcome, list[Curve]]:
    """Look at a ball in even light: never brighter than that, finite, darker the rougher it is."""
    assert callable(make)
    outcome, curves = Outcome(), []
    ball = Sphere((0, 0, 0), 1)
    camera = Camera((0, -4, 0), (0, 0, 0), (0, 0, 1), 20, 10, 10)
    for integrator in INTEGRATORS:
        missing = []
        for value in roughness:
            material: Material = make(value)
            result = picture(
                effort, Scene(camera, [Object(ball, material)], environment=WHITE_SKY),
                integrator, effort.count(8, 2), max_depth=100,
                options=PLAIN_PATHS if integrator == "path" else None,
            )  # fmt: skip
            what = f"{integrator}, {name} of roughness {value:g}"
            outcome += finite(what, result)
            above, allowed = off_by_pixels(result, 1.0)
            mean = float(result.image.mean(dtype=float))
            units = above / allowed if mean > 1.0 else 0.0
            fault = (
                f"{what}: furnace shows {mean:.6g}, {above:.3g} off where {allowed:.3g} is chance"
            )
            outcome += Outcome(rays=result.report.rays["camera"], error=units).checked(
                units <= 1.0, fault
            )
            outcome = outcome.checked(mean > 0.0, f"{what}: black")
            missing.append(max(1.0 - mean, 0.0))
        curves.append(
            Curve("roughness", f"{name}, {integrator}: light that is missing", list(roughness),
                  shown(missing), [1.0] * len(missing), unit="radiance")
        )  # fmt: skip
    return outcome, curves


ROUGHNESS = (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6, 0.615, 0.8, 1.0)


@row("L09", "rough metal, roughness 1e-6 to 1", "white furnace at most one; refused below 0.01")
def rough_metal(effort: Effort) -> Outcome:
    """Metal that absorbs nothing: what is missing went from facet to facet."""
    outcome, curves = _furnace(
        effort, "metal", lambda value: RoughConductor(1.0, 1e3, value), ROUGHNESS
    )
    for bad in (0.0, 1e-6, 0.00999, 1.0001, -0.1, math.nan):
        outcome += refusal(partial(RoughConductor, 1.0, 1e3, bad), "RoughConductor roughness")
    return outcome + Outcome(curves=tuple(curves))


@row("L10", "rough glass, roughness 1e-6 to 1", "white furnace at most one; refused below 0.01")
def rough_glass(effort: Effort) -> Outcome:
    """Clear glass: what is missing went from facet to facet, or is cut off at max_depth."""
    outcome = Outcome()
    for ior in (1.5, 1.0001, 2.4):
        more, curves = _furnace(
            effort, f"glass of index {ior:g}",
            lambda value, ior=ior: RoughDielectric(ior, value),
            ROUGHNESS if ior == 1.5 else (0.01, 0.2, 1.0),
        )  # fmt: skip
        outcome += more + Outcome(curves=tuple(curves))
    for bad in (0.0, 1e-6, 0.00999, 1.0001, -0.1, math.nan):
        outcome += refusal(partial(RoughDielectric, 1.5, bad), "RoughDielectric roughness")
    return outcome
