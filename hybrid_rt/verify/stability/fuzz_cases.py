"""Random cases as plain numbers: surfaces, rays, small scene scripts, damaged files.

A case is a dict that JSON holds without loss, so it can be kept, cut down and run again; one of rays
may have ``exact``: true, and is then judged in exact arithmetic from the start. What is
drawn comes through `Draws`, from a generator of numpy's or from hypothesis, which then shrinks it.
"""

from __future__ import annotations

import base64
import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import Any, Protocol, TypeVar

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.verify.cases.rays import GENERATORS, unit
from meshing import BezierPatches, SurfaceOfRevolution

T = TypeVar("T")
Case = dict[str, Any]


class Draws(Protocol):
    """Where random choices come from."""

    def whole(self, low: int, high: int) -> int:
        """Return a whole number, both ends included."""

    def one_of(self, choices: Sequence[T]) -> T:
        """Return one of several."""


class NumpyDraws:
    """Choices of a numpy generator.

    Parameters
    ----------
    rng : numpy.random.Generator
    """

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def whole(self, low: int, high: int) -> int:
        """Return a whole number, both ends included."""
        return int(self._rng.integers(low, high + 1))

    def one_of(self, choices: Sequence[T]) -> T:
        """Return one of several."""
        return choices[self.whole(0, len(choices) - 1)]


def _rng(draws: Draws) -> np.random.Generator:
    """Return a generator of a drawn seed: for numbers that need not shrink one by one."""
    return np.random.default_rng(draws.whole(0, 2**31 - 1))


# --- surfaces -------------------------------------------------------------------------------------

NETS = ("even", "wavy", "lattice", "wild", "collapsed edge", "pinched", "flat", "creased", "uneven")


def _net(draws: Draws) -> FloatArray:
    rng, kind = _rng(draws), draws.one_of(NETS)
    m, n = draws.whole(1, 6), draws.whole(1, 6)
    x, y = np.meshgrid(np.linspace(-1, 1, m + 1), np.linspace(-1, 1, n + 1), indexing="ij")
    net = np.stack([x, y, np.zeros_like(x)], axis=-1)
    if kind == "even":
        net[..., 2] += rng.normal(0, 0.3, x.shape)
    elif kind == "wavy":
        net[..., 2] += rng.choice([-2.0, 2.0], x.shape)
    elif kind == "lattice":
        net = rng.integers(-2, 3, (*x.shape, 3)).astype(float)
    elif kind == "wild":
        net = rng.normal(0, 1, (*x.shape, 3))
    elif kind == "collapsed edge":
        net[..., 2] += rng.normal(0, 0.3, x.shape)
        net[:, 0] = net[0, 0]
    elif kind == "pinched":
        net[..., 2] += rng.normal(0, 0.3, x.shape)
        net[0, 0] = net[0, 1] = net[1, 0]
    elif kind == "creased":
        net[..., 2] = np.abs(x) + 0.1 * rng.normal(0, 1, x.shape)
        net[-1] = net[0]
    elif kind == "uneven":
        net[..., :2] = np.sign(net[..., :2]) * np.abs(net[..., :2]) ** 8
        net[..., 2] += rng.normal(0, 0.2, x.shape)
    if draws.whole(0, 2) == 0:
        turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        net = net @ turn
    return net


def _patches(draws: Draws) -> Case:
    nets = [_net(draws) for _ in range(draws.whole(1, 3))]
    if draws.whole(0, 7) == 0:
        nets.append(nets[0])
    return {"class": "BezierPatches", "nets": [net.tolist() for net in nets]}


PROFILES = ("away", "cone", "pole", "spindle", "ball", "lattice", "disc", "wavy")


def _turned(draws: Draws) -> Case:
    rng, kind = _rng(draws), draws.one_of(PROFILES)
    n = draws.whole(1, 5)
    z = np.linspace(-1, 1, n + 1)
    r = rng.uniform(0.2, 1, n + 1)
    if kind == "cone":
        r[0] = 0.0
    elif kind == "pole" and n > 1:
        r[0], z[1] = 0.0, z[0]
    elif kind == "spindle":
        r[0] = r[min(1, n)] = 0.0
    elif kind == "ball":
        r[0] = r[-1] = 0.0
    elif kind == "lattice":
        z, r = rng.integers(-2, 3, n + 1).astype(float), rng.integers(0, 3, n + 1).astype(float)
    elif kind == "disc":
        z = np.zeros(n + 1)
        r = np.linspace(0.0 if draws.whole(0, 1) else 0.3, 1, n + 1)
    elif kind == "wavy":
        r = rng.choice([0.0, 2.0], n + 1)
    segments = [np.column_stack([z, r])]
    if draws.whole(0, 2) == 0:
        end = segments[0][-1]
        more = np.column_stack([end[0] + np.linspace(0, 1, 3), rng.uniform(0, 1, 3)])
        more[0] = end
        segments.append(more)
    axis = draws.one_of(((0.0, 0.0, 1.0), (0.3, -0.2, 1.0), (1.0, 1.0, 0.0)))
    return {
        "class": "SurfaceOfRevolution",
        "segments": [segment.tolist() for segment in segments],
        "origin": rng.integers(-1, 2, 3).astype(float).tolist(),
        "axis": list(axis),
    }


def _ball(draws: Draws) -> Case:
    rng = _rng(draws)
    radius = draws.one_of((1.0, 0.5, 0.1, 1e-3, 100.0, 1e5))
    center = rng.integers(-2, 3, 3) + draws.one_of((0.0, 0.1)) * rng.normal(size=3)
    if radius > 10.0:
        center = center + np.array([0.0, 0.0, -radius])
    return {"class": "Sphere", "center": center.tolist(), "radius": radius}


def _torus(draws: Draws) -> Case:
    minor = draws.one_of((0.5, 0.1, 1e-3, 0.999, 1.0, 1.5))
    axis = draws.one_of(((0.0, 0.0, 1.0), (0.2, 1.0, -0.4)))
    return {"class": "Torus", "origin": [0.1, 0.0, 0.0], "axis": list(axis), "radii": [1.0, minor]}


def _box(draws: Draws) -> Case:
    rng = _rng(draws)
    lo = rng.integers(-2, 1, 3).astype(float)
    hi = lo + rng.choice([1.0, 2.0, 1e-3, 0.0], 3, p=[0.5, 0.38, 0.1, 0.02])
    case: Case = {"class": "Box", "lo": lo.tolist(), "hi": hi.tolist()}
    if draws.whole(0, 1):
        case["matrix"] = _affine(draws).tolist()
    return case


def _rectangle(draws: Draws) -> Case:
    rng = _rng(draws)
    edges = rng.integers(-2, 3, (2, 3)) + draws.one_of((0.0, 0.3)) * rng.normal(size=(2, 3))
    corner = rng.integers(-2, 2, 3).astype(float)
    return {"class": "Rectangle", "corner": corner.tolist(), "edges": edges.tolist()}


def _mesh(draws: Draws) -> Case:
    rng = _rng(draws)
    n = draws.whole(3, 8)
    vertices = rng.integers(-2, 3, (n, 3)) + draws.one_of((0.0, 0.4)) * rng.normal(size=(n, 3))
    faces = [rng.permutation(n)[:3].tolist() for _ in range(draws.whole(1, 10))]
    return {"class": "TriangleMesh", "vertices": vertices.tolist(), "faces": faces}


def _affine(draws: Draws) -> FloatArray:
    rng = _rng(draws)
    kind = draws.one_of(("turn", "shear", "stretch", "mirror"))
    linear = np.eye(3)
    if kind == "turn":
        linear, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    elif kind == "shear":
        linear += rng.normal(0, 0.5, (3, 3))
    elif kind == "stretch":
        linear = np.diag(10.0 ** rng.integers(-3, 3, 3))
    else:
        linear[0, 0] = -1.0
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = linear, rng.integers(-1, 2, 3)
    return matrix


SURFACES = (_patches, _turned, _ball, _box, _torus, _rectangle, _mesh)
# Whole scenes smaller, larger, and far from 0 (in sizes).
SCALES = (1.0, 1.0, 1.0, 2.0**-30, 2.0**30, 1e-9, 1e9)
OFFSETS = (0.0, 0.0, 0.0, 2.0**10, 1e6)


def surface_case(draws: Draws, mixed: bool) -> list[Case]:
    """Draw one to four surfaces: all of one class, or a mixture."""
    make = draws.one_of(SURFACES)
    found = []
    for _ in range(draws.whole(1, 4 if mixed else 2)):
        found.append((draws.one_of(SURFACES) if mixed else make)(draws))
    scale, offset = draws.one_of(SCALES), draws.one_of(OFFSETS)
    if scale != 1.0 or offset:
        matrix = np.diag([scale, scale, scale, 1.0])
        matrix[:3, 3] = scale * offset * np.array([1.0, -0.5, 0.25])
        for case in found:
            case["scale"] = matrix.tolist()
    return found


def build(case: Case) -> Any:
    """Make the surface that a case describes.

    Raises
    ------
    ValueError, TypeError
        As the surface's own class does.
    """
    name = case["class"]
    surface: Any
    if name == "BezierPatches":
        surface = BezierPatches([np.array(net) for net in case["nets"]])
    elif name == "SurfaceOfRevolution":
        segments = [np.array(segment) for segment in case["segments"]]
        surface = SurfaceOfRevolution(segments, case["origin"], case["axis"])
    elif name == "Sphere":
        surface = Sphere(case["center"], case["radius"])
    elif name == "Torus":
        surface = Torus(case["origin"], case["axis"], *case["radii"])
    elif name == "Box":
        surface = Box(case["lo"], case["hi"])
    elif name == "Rectangle":
        surface = Rectangle(case["corner"], *case["edges"])
    else:
        mesh: Any = SimpleNamespace(
            vertices=np.array(case["vertices"]), faces=np.array(case["faces"])
        )
        surface = TriangleMesh(mesh)
    for key in ("matrix", "scale"):
        if key in case:
            surface = surface.transformed(np.array(case[key]))
    return surface


# --- rays -----------------------------------------------------------------------------------------


def ray_case(draws: Draws, surfaces: Sequence[Any], n: int) -> Case:
    """Draw rays at what was built: hard ones, axis-parallel ones, and from points of the surfaces."""
    seed = draws.whole(0, 2**31 - 1)
    origins, directions = [], []
    generators = list(GENERATORS)
    per = max(n // 4, 4)
    for k in range(4):
        generate = draws.one_of(generators)
        with np.errstate(all="ignore"):
            # At degenerate places normals are no numbers: those rays are left out below.
            rays = generate(surfaces, per, seed + k)
        origins.append(rays.origins)
        directions.append(rays.directions)
    rng = np.random.default_rng(seed)
    middle, size = surfaces[0].middle, surfaces[0].size
    # On lattice points and along the axes and diagonals, where many things happen at once.
    lattice = rng.integers(-2, 3, (per, 3)) * 0.5 * size
    origins.append(middle + lattice - 4.0 * size * np.array([1.0, 0.0, 0.0]))
    directions.append(np.tile([1.0, 0.0, -0.0], (per, 1)))
    origins.append(middle + lattice)
    # 1e-100: no direction is zero, and no slab's limits overflow.
    directions.append(unit(rng.integers(-1, 2, (per, 3)) + np.array([0.0, 0.0, 1e-100])))
    # Components of very different sizes.
    origins.append(middle + size * rng.normal(size=(per, 3)))
    directions.append(rng.normal(size=(per, 3)) * 10.0 ** rng.integers(-18, 1, (per, 3)))
    o, d = np.concatenate(origins), np.concatenate(directions)
    good = np.isfinite(o).all(axis=1) & np.isfinite(d).all(axis=1) & (np.abs(d).max(axis=1) > 1e-30)
    return {"origins": o[good].tolist(), "directions": d[good].tolist()}


# --- scene scripts --------------------------------------------------------------------------------

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


# --- files ----------------------------------------------------------------------------------------


def sound_file(ending: str) -> bytes:
    """Return the bytes of a small sound file."""
    import io

    import imageio.v3 as imageio

    ramp = np.linspace(0, 1, 4 * 5 * 3).reshape(4, 5, 3)
    if ending == "bpt":
        rows = [f"{x} {y} {0.1 * x * y}" for x in range(3) for y in range(2)]
        return ("1\n2 1\n" + "\n".join(rows) + "\n").encode()
    stream = io.BytesIO()
    if ending == "npz":
        np.savez(stream, image=ramp.astype(np.float32))
    else:
        imageio.imwrite(stream, np.uint8(255 * ramp), extension=f".{ending}")
    return stream.getvalue()


def file_case(draws: Draws, endings: Sequence[str]) -> Case:
    """Draw a file of which some bytes were changed, cut off, doubled or left out."""
    ending = draws.one_of(endings)
    data = bytearray(sound_file(ending))
    for _ in range(draws.whole(1, 4)):
        if not data:
            break
        at = draws.whole(0, len(data) - 1)
        way = draws.whole(0, 5)
        if way <= 2:
            data[at] = draws.whole(0, 255)
        elif way == 3:
            del data[at:]
        elif way == 4:
            data[at:at] = data[at : at + draws.whole(1, 20)]
        else:
            del data[at : at + draws.whole(1, 20)]
    return {"kind": "file", "ending": ending, "data": base64.b64encode(bytes(data)).decode()}
