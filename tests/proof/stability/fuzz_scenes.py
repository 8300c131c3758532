"""Random scene scripts."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from proof.stability.fuzz_cases import Case, Draws

NUMBERS = (
    0.0,
    -0.0,
    1.0,
    -1.0,
    0.5,
    2.0,
    1e-3,
    1e3,
    1e-12,
    1e12,
    1e-300,
    1e300,
    0.999,
    1.001,
    90.0,
)
BAD = (math.nan, math.inf, -math.inf, "'word'", "None", "(1, 2)", "True", "[]")


def _number(draws: Draws, sound: Sequence[float]) -> str:
    """Return a number as a script has it: mostly a sound one, now and then any at all."""
    pick = draws.whole(0, 39)
    if pick == 0:
        bad = draws.one_of(BAD)
        return bad if isinstance(bad, str) else f"float('{bad}')"
    if pick <= 2:
        return repr(draws.one_of(NUMBERS))
    return repr(draws.one_of(sound))


PLACES = (0.0, 0.5, 1.0, -1.0, 2.0, -0.3)
SIZES = (1.0, 0.5, 0.1, 2.0, 1e-3)
ALBEDOS = (0.0, 0.2, 0.5, 0.8, 1.0)
LIGHT = (0.0, 1.0, 10.0, 1e-6, 1e6)


def scene_case(draws: Draws) -> Case:
    """Draw the text of a small scene script."""

    def vector(sound: Sequence[float] = PLACES) -> str:
        return f"({', '.join(_number(draws, sound) for _ in range(3))})"

    def one(sound: Sequence[float]) -> str:
        return _number(draws, sound)

    def material(depth: int = 0) -> str:
        kinds = (
            "Lambertian({a})", "Lambertian({a})", "Mirror({a})", "Metal({a}, {a})",
            "Phong({s}, {s}, {n})", "Dielectric({i}, {a})", "Dielectric({i}, priority={a})",
            "RoughConductor({i}, {n}, {r})", "RoughDielectric({i}, {r})", "Emissive({l})",
            "Lambertian(CheckerTexture({a}, {a}, {n}))", "Emissive({l}, {m})",
            "Mix([({s}, {m}), ({s}, {m})])",
        )  # fmt: skip
        text = draws.one_of(kinds if depth == 0 else kinds[:10])
        while "{" in text:
            at = text.index("{")
            letter = text[at + 1]
            values: dict[str, Callable[[], str]] = {
                "a": lambda: one(ALBEDOS), "s": lambda: one((0.0, 0.1, 0.5)),
                "n": lambda: one((1.0, 3.0, 20.0, 500.0)), "r": lambda: one((0.01, 0.1, 0.5, 1.0)),
                "i": lambda: one((1.0, 1.5, 0.7, 2.4, 1000.0, 1.0 + 1e-12)),
                "l": lambda: one(LIGHT), "m": lambda: material(depth + 1),
            }  # fmt: skip
            text = text[:at] + values[letter]() + text[at + 3 :]
        return text

    def surface() -> str:
        makers: tuple[Callable[[], str], ...] = (
            lambda: f"Sphere({vector()}, {one(SIZES)})",
            lambda: f"Box({vector((-1.0, -0.5, 0.0))}, {vector((0.5, 1.0, 2.0))})",
            lambda: f"Rectangle({vector()}, {vector()}, {vector()})",
            lambda: f"Rectangle((-4, -4, 0), (8, 0, 0), (0, 8, {one((0.0, 0.1))}))",
            lambda: f"Torus({vector()}, {vector()}, {one((1.0, 2.0))}, {one((0.1, 0.5))})",
            lambda: f"Plane({vector()}, {vector()})",
            lambda: (
                f"SurfaceOfRevolution([(-1, {one((0.0, 0.5))}), (0, {one(SIZES)}), (1, 0.5)], "
                f"{vector()}, {vector((0.0, 1.0))})"
            ),
            lambda: f"BezierPatches([[[{vector()}, {vector()}], [{vector()}, {vector()}]]])",
        )
        return draws.one_of(makers)()

    def light() -> str:
        makers: tuple[Callable[[], str], ...] = (
            lambda: f"PointLight({vector()}, {one(LIGHT)})",
            lambda: f"SphereLight({vector((0.0, 3.0))}, {one(SIZES)}, {one(LIGHT)})",
            lambda: f"RectangleLight({vector((0.0, 3.0))}, {vector()}, {vector()}, {one(LIGHT)})",
            lambda: (
                f"SpotLight({vector((0.0, 3.0))}, {vector()}, {one(LIGHT)}, {one((30.0, 0.01))}, 0.0)"
            ),
        )
        return draws.one_of(makers)()

    objects = [f"Object({surface()}, {material()}, 'body {k}')" for k in range(draws.whole(0, 4))]
    lights = [light() for _ in range(draws.whole(0, 2))]
    sky = draws.one_of(("None", "None", f"GradientSky({one(LIGHT)}, {one(LIGHT)})"))
    size = draws.one_of(("6, 6", "1, 1", "5, 3"))
    camera = (
        f"Camera({vector((3.0, -4.0, 0.5))}, {vector((0.0, 0.1))}, {vector((0.0, 1.0))}, "
        f"{one((40.0, 90.0, 1e-6))}, {size}, {one((0.0, 0.0, 0.1))})"
    )
    lines = ["    return Scene(", f"        {camera},", "        ["]
    lines += [f"            {item}," for item in objects] + ["        ],", "        ["]
    lines += [f"            {item}," for item in lights] + [
        "        ],",
        f"        {sky},",
        "    )",
    ]
    head = "from hybrid_rt import *\nfrom meshing import BezierPatches, SurfaceOfRevolution\n"
    return {
        "kind": "scene",
        "script": f"{head}\n\ndef scene():\n" + "\n".join(lines) + "\n",
        "integrator": draws.one_of(("path", "whitted", "ppm", "photon_map")),
        "seed": draws.whole(0, 99),
    }
