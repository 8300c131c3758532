"""Random rooms, in which integrators must agree.

Their light transport differs: camera paths, branches with direct light only, photons. Each states the
mean of its picture with an interval, and measures the light that it does not find. The sums of both
must agree. In half of the rooms only differences above 7 % of the mean tell.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid_rt.integrators import PPMOptions
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Scene
from proof.stability.fuzz_cases import Case, Draws

# Passes of each integrator, in so many renders: several seconds in all.
PASSES = {"path": 64, "whitted": 16, "ppm": 16}
RENDERS = 4
PHOTONS = 20_000
# Means may differ by the sum of both half intervals, and by so much of the mean, which discs of
# photons lose at edges. Intervals are of 95 %, so what differs is asked once more by other numbers.
BLUR = 0.02
# Light that no surface spreads widely is not measured. It is the same for all but this kind.
HIGHLIGHTS = "highlights of lamps without area"
# Where surfaces stand.
PLACES = ("-1.0, 0.6", "0.1, -0.1", "1.0, 0.8")
HEAD = """import trimesh
from hybrid_rt import *
from hybrid_rt.demo import teapot
from meshing import *
"""


def light_case(draws: Draws) -> Case:
    """Draw a room, or a floor under a sky, of which all is sound."""

    def number(*choices: float) -> str:
        return repr(draws.one_of(choices))

    def color() -> str:
        return f"({number(0.2, 0.5, 0.8)}, {number(0.3, 0.6)}, {number(0.2, 0.7)})"

    def matt() -> str:
        return draws.one_of(
            (
                f"Lambertian({color()})", f"Lambertian({color()})",
                f"Lambertian(CheckerTexture({color()}, {color()}, 3))",
                f"Phong((0.3, 0.2, 0.1), {number(0.1, 0.4)}, {number(5.0, 30.0, 200.0)})",
                f"Mix([(0.5, Lambertian({color()})), (0.4, Mirror())])",
            )
        )  # fmt: skip

    def opaque() -> str:
        return draws.one_of(
            (
                matt(), f"Mirror({color()})", f"Metal({color()}, {number(0.0, 0.1, 0.4)})",
                f"RoughConductor((0.2, 0.9, 1.2), (3.9, 2.5, 2.1), {number(0.05, 0.3)})",
                f"Emissive({color()}, {matt()})",
            )
        )  # fmt: skip

    def clear() -> str:
        return draws.one_of(
            (
                f"Dielectric({number(1.3, 1.5, 2.4)}, ({number(0.0, 3.0)}, 0.2, 0.1))",
                f"RoughDielectric(1.5, {number(0.1, 0.4)})",
            )
        )

    def body(place: str) -> str:
        size = draws.one_of((0.25, 0.4, 0.5))
        bottom = draws.one_of((1e-9, 0.05, 0.3))
        x, y = place.split(", ")
        at, foot = f"({place}, {size + bottom})", f"({place}, {bottom})"
        axis = f"({number(0.0, 0.5)}, {number(0.0, -0.3)}, 1)"
        upright = f"[[{size / 3}, 0, 0, {x}], [0, {size / 3}, 0, {y}], [0, 0, {size / 3}, {bottom}], [0, 0, 0, 1]]"
        holes = "[polygon([(0, 0), (1, 0), (1, 1), (0, 1)]), circle((0.4, 0.5), 0.2)]"
        cylinder = f"Cylinder({foot}, (0, 0, 1), {0.8 * size}, {2 * size})"
        closed = (
            f"Sphere({at}, {size})",
            f"Box({foot}, ({x} + {size}, {y} + {size}, {size + bottom}))",
            f"Torus({at}, {axis}, {0.7 * size}, {0.25 * size})",
            f"SurfaceOfRevolution([(-1, 0), (-0.5, 1.2), (0.3, 0.1), (1, 0)], {at}, (0, 0, {size}))",
            f"TriangleMesh(trimesh.creation.icosphere(2, {size}).apply_translation({at}))",
        )
        sheets = (
            f"teapot().transformed({upright})",
            cylinder,
            f"Cone({foot}, {axis}, {size}, {size}, {0.3 * size})",
            f"Asphere({1.5 * size}, -0.5, (), {0.9 * size}, {at}, {axis})",
            f"TrimmedSurface(Sphere({at}, {size}), {holes})",
            f"TrimmedSurface({cylinder}, {holes})",
        )
        surface = draws.one_of(closed + sheets)
        material = clear() if surface in closed and draws.whole(0, 1) else opaque()
        smooth = surface.startswith("TriangleMesh") and draws.whole(0, 1) == 1
        return f"Object({surface}, {material}, 'body', {smooth})"

    def lamp(x: float) -> str:
        at = f"({x}, {number(-0.8, 0.4)}, {number(1.9, 2.6)})"
        return draws.one_of(
            (
                f"PointLight({at}, {number(2.0, 5.0)})",
                f"SpotLight({at}, (0.1, 0.2, -1), {number(5.0, 20.0)}, {number(10.0, 60.0)}, 3.0)",
                f"SphereLight({at}, {number(0.02, 0.15)}, {number(20.0, 60.0)})",
                f"RectangleLight({at}, ({number(0.1, 0.6)}, 0, 0), (0, -0.4, 0), {number(5.0, 20.0)})",
            )
        )

    lines = [f"Object(Rectangle((-2, -2, 0), (4, 0, 0), (0, 4, 0)), {matt()}, 'floor')"]
    is_room = draws.whole(0, 2) > 0
    if is_room:
        walls = (
            "(-2, -2, 3), (4, 0, 0), (0, 4, 0)", "(-2, -2, 0), (0, 4, 0), (0, 0, 3)",
            "(2, -2, 0), (0, 4, 0), (0, 0, 3)", "(-2, 2, 0), (4, 0, 0), (0, 0, 3)",
            "(-2, -2, 0), (4, 0, 0), (0, 0, 3)",
        )  # fmt: skip
        lines += [
            f"Object(Rectangle({wall}), {draws.one_of((matt(), matt(), 'Mirror(0.8)'))}, 'wall')"
            for wall in walls
        ]
    lines += [body(place) for place in PLACES[: draws.whole(1, 3)]]
    lamps = [lamp(x) for x in (draws.one_of((-1.1, -0.5)), 0.9)[: draws.whole(1, 2)]]
    sky = (
        "None"
        if is_room
        else draws.one_of(("None", "GradientSky(0.2, (0.4, 0.5, 0.9), (0, 0, 1))"))
    )
    camera = "0.3, -1.9, 1.4" if is_room else "0.5, -4, 1.4"
    script = (
        f"{HEAD}\ndef scene():\n    return Scene(\n        Camera(({camera}), (0, 0.3, 0.5), (0, 0, 1), "
        f"{70 if is_room else 45}, 32, 24, {number(0.0, 0.0, 0.05)}),\n        [\n"
        + "".join(f"            {line},\n" for line in lines)
        + f"        ],\n        [{', '.join(lamps)}],\n        {sky},\n    )\n"
    )
    return {"kind": "light", "script": script, "seed": draws.whole(0, 99)}


def faults_of_light(case: Case) -> list[str]:
    """Return which integrators disagree, twice, by other random numbers; or whose bits differ."""
    names: dict[str, Any] = {}
    exec(compile(case["script"], "scene.py", "exec"), names)  # noqa: S102 (a script of our own)
    scene = names["scene"]()
    first = _disagreements(scene, case["seed"])
    again = _disagreements(scene, case["seed"] + 100 * RENDERS) if first else {}
    faults = [f"{text}; and {again[name]}" for name, text in first.items() if name in again]
    images = [
        render(scene, "path", 2, seed=case["seed"], threads=threads, coarse=coarse).image
        for threads, coarse in ((1, "embree"), (2, "embree"), (1, "none"))
    ]
    if not all(np.array_equal(image, images[0]) for image in images[1:]):
        faults.append("other bits with two threads, or without Embree")
    return faults


def _disagreements(scene: Scene, seed: int) -> dict[str, str]:
    """Return the integrators whose sums differ from those of paths, with how much."""
    sums = {name: _sum_of_light(scene, name, seed) for name in PASSES}
    of_paths = sums.pop("path")
    if of_paths is None:
        return {}
    mean, half = of_paths
    return {
        name: f"{name} has {its[0]:.5g} +- {its[1]:.2g} and path {mean:.5g} +- {half:.2g}"
        for name, its in sums.items()
        if its is not None and abs(its[0] - mean) > half + its[1] + BLUR * abs(mean)
    }


def _sum_of_light(scene: Scene, name: str, seed: int) -> tuple[float, float] | None:
    """Return the mean of found and missing light, and its half interval; None: some is not measured."""
    options = PPMOptions(PHOTONS) if name == "ppm" else None
    means, halves = [], []
    for k in range(RENDERS):
        report = render(scene, name, PASSES[name], seed=seed + k, threads=1, options=options).report
        noise, missing = report["noise"], report["light_not_found_measured"]
        if any(kind.startswith(HIGHLIGHTS) for kind in report["light_not_found"]):
            return None
        means.append(noise["image_mean"])
        halves.append(noise["half_interval_95_of_image_mean"])
        if missing is not None and missing["half_interval_95"] is None:
            return None
        if missing is not None:
            means[-1] += missing["mean"]
            halves[-1] = np.hypot(halves[-1], missing["half_interval_95"])
    return float(np.mean(means)), float(np.linalg.norm(halves)) / RENDERS
