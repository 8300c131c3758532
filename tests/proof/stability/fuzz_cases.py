"""Random cases as plain numbers: surfaces and rays; `fuzz_scenes` has scene scripts.

A case is a dict that JSON holds without loss, so it can be kept, cut down and run again; one of rays
may have ``exact``: true, and is then judged in exact arithmetic from the start. What is
drawn comes through `Draws` from hypothesis, which then shrinks it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from hypothesis import strategies as st

from hybrid_rt.analysis.ray_sets import unit
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution
from proof.cases.placed import placed
from proof.cases.rays import GENERATORS

T = TypeVar("T")
Case = dict[str, Any]


@dataclass(frozen=True)
class Draws:
    """Random choices, from hypothesis."""

    draw: st.DrawFn

    def whole(self, low: int, high: int) -> int:
        """Return a whole number, both ends included."""
        return self.draw(st.integers(low, high))

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

    Raises ValueError, TypeError as the surface's own class does.
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
            surface = placed(surface, np.array(case[key]))
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
