"""Every kind of singular set, on surfaces that have it; and the placements of these surfaces."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import teapot, vase
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.verify.cases.campaign import ellipsoid, torus
from hybrid_rt.verify.cases.catalogue import (
    cuspidal_edge,
    cylinder,
    loop_sheet,
    ring,
    saddle,
    square,
    uneven_patch,
    wavy_patch,
)
from hybrid_rt.verify.cases.rational_surfaces import (
    half_pipe,
    octants,
    torn_nurbs,
    weighted_petal,
)
from hybrid_rt.verify.cases.singular_rays import (
    Aimed,
    Finder,
    Random,
    Targets,
    at_parameters,
    beside,
    circles,
    collapsed,
    edges,
    interior,
    parallel,
    poles,
    seam,
    within,
)
from meshing import BezierPatches, SurfaceOfRevolution

KINDS = ("turned", "patches", "rational", "closed", "mesh")
DISTANCES = tuple(10.0**-k for k in range(1, 17))
Aim = Callable[[Targets, float, Random], Aimed]
Z = (0.0, 0.0, 1.0)
ZERO = (0.0, 0.0, 0.0)
# Quarter circles as cubics.
ARC = 0.5522847498307936


@dataclass(frozen=True)
class SingularSet:
    """One kind of singular set.

    Attributes
    ----------
    kind : str
        One of `KINDS`.
    surfaces : callable without arguments
        All except the first are occluders.
    find : Finder
    aim : Aim
    leaving : str
        "" for rays that arrive; "beside" for rays that leave hits of such rays any way; "grazing"
        for rays that leave them at a cosine of the distance.
    """

    kind: str
    surfaces: Callable[[], list[Any]]
    find: Finder
    aim: Aim = beside
    leaving: str = ""


@dataclass(frozen=True)
class Placement:
    """A placement of a scene: rotation, then scale, then translation in units of its size."""

    turned: bool
    scale: float
    offset: float

    def matrix(self, size: float) -> FloatArray:
        """Return the similarity (4, 4) for a scene of a size."""
        matrix = np.eye(4)
        if self.turned:
            rng = np.random.default_rng(31)
            turn, _ = np.linalg.qr(rng.normal(size=(3, 3)))
            matrix[:3, :3] = turn * np.sign(np.linalg.det(turn))
        matrix[:3, :3] *= self.scale
        matrix[:3, 3] = self.scale * size * self.offset * np.array([0.6, -0.48, 0.64])
        return matrix


PLACEMENTS = {
    "home": Placement(False, 1.0, 0.0),
    "turned": Placement(True, 1.0, 0.3),
    "far": Placement(True, 1.0, 1e6),
    "small": Placement(True, 1e-9, 2.0),
    "large": Placement(False, 1e9, 0.0),
}


def _lathe(*segments: Any) -> Callable[[], list[Any]]:
    return lambda: [SurfaceOfRevolution(list(segments), ZERO, Z)]


def _ball() -> list[Any]:
    """Return two quarter circles, nearly a sphere of radius 1."""
    low = [(-1.0, 0.0), (-1.0, ARC), (-ARC, 1.0), (0.0, 1.0)]
    high = [(-z, r) for z, r in reversed(low)]
    return [SurfaceOfRevolution([low, high], ZERO, Z)]


def rational_torus(u_range: tuple[float, float] = (0.0, 1.0)) -> SurfaceOfRevolution:
    """Return a torus turned from four quarter circles, rational quadratics."""
    ring = [
        (0, 1.4),
        (0.4, 1.4),
        (0.4, 1),
        (0.4, 0.6),
        (0, 0.6),
        (-0.4, 0.6),
        (-0.4, 1),
        (-0.4, 1.4),
    ]
    ring.append(ring[0])
    arcs = [ring[k : k + 3] for k in range(0, 8, 2)]
    weights = [(1.0, math.sqrt(0.5), 1.0)] * 4
    return SurfaceOfRevolution(
        arcs, (0.2, -0.1, 0.3), (0.3, -0.2, 1.0), weights=weights, u_range=u_range
    )


def rational_ball() -> SurfaceOfRevolution:
    """Return a ball of radius 1 turned from two quarter circles."""
    arcs = [[(-1, 0), (-1, 1), (0, 1)], [(0, 1), (1, 1), (1, 0)]]
    return SurfaceOfRevolution(arcs, ZERO, Z, weights=[(1.0, math.sqrt(0.5), 1.0)] * 2)


def uneven_profile() -> SurfaceOfRevolution:
    """Return a part of a rational cubic whose weights differ by a factor of 1000."""
    return SurfaceOfRevolution(
        [(-1, 0.8), (-0.5, 2.5), (0.6, 0.1), (1, 1.2)], ZERO, (1.0, 2.0, 2.0),
        weights=[1.0, 0.02, 20.0, 3.0], u_range=(0.1, 0.85),
    )  # fmt: skip


def lid() -> BezierPatches:
    """Return the lid of the teapot: eight patches, four of them with an edge at the apex."""
    nets = teapot().patches
    return BezierPatches(
        [net for net in nets if net[..., 2].min() >= 2.39 and np.abs(net[..., :2]).max() < 1.31]
    )


def petal() -> BezierPatches:
    """Return a bicubic patch one edge of which is a point, curved there."""
    rng = np.random.default_rng(8)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([u, 0.7 * u * v, 0.4 * u * u], axis=-1) + 0.05 * rng.normal(size=(4, 4, 3))
    net[0] = net[0, 0]
    return BezierPatches([net])


def lune() -> BezierPatches:
    """Return a biquadratic patch two opposite edges of which are points."""
    net = np.zeros((3, 3, 3))
    net[:, 0], net[:, 2] = (0.0, 0.0, 0.0), (2.0, 0.0, 0.0)
    net[:, 1] = [(1.0, -1.0, 0.0), (1.0, 0.2, 1.2), (1.0, 1.0, 1.0)]
    return BezierPatches([net])


def uneven_lune() -> BezierPatches:
    """Return a patch of degrees 1 and 2 with two such edges."""
    return BezierPatches([[[(0, 0, 0), (1, -1, 0), (2, 0, 0)], [(0, 0, 0), (1, 1, 1), (2, 0, 0)]]])


def pinched_corner() -> BezierPatches:
    """Return a bicubic patch with parallel tangents in a corner: S_u x S_v vanishes there."""
    rng = np.random.default_rng(9)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    net = np.stack([u, v, 0.5 * u * v], axis=-1) + 0.05 * rng.normal(size=(4, 4, 3))
    net[0, 0], net[1, 0], net[0, 1] = (0, 0, 0), (0.3, 0.3, 0.1), (0.2, 0.2, 0.1 * 2 / 3)
    return BezierPatches([net])


def roof() -> BezierPatches:
    """Return two curved patches that meet in a sharp edge."""
    line = np.linspace(-1.0, 1.0, 4)
    nets = []
    for side in (-1.0, 1.0):
        x, y = np.meshgrid(side * np.linspace(0.0, 1.0, 4), line, indexing="ij")
        nets.append(np.stack([x, y, -0.8 * np.abs(x) - 0.2 * x * x + 0.1 * y * y], axis=-1))
    return BezierPatches(nets)


def cube() -> BezierPatches:
    """Return the six faces of a cube as bilinear patches, normals outward."""
    box = Box((-1, -1, -1), (1, 1, 1))
    nets = []
    for face in range(6):
        corners = [box.point(u, v, face)[0] for u in (0, 1) for v in (0, 1)]
        nets.append(np.array(corners).reshape(2, 2, 3))
    return BezierPatches(nets)


def bent_sheet() -> BezierPatches:
    """Return two bicubic patches of one smooth sheet, with an edge in common."""
    rng = np.random.default_rng(10)
    x, y = np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([x, y, 0.5 * x * x], axis=-1) + 0.1 * rng.normal(size=(7, 4, 3))
    net[3] = 0.5 * (net[2] + net[4])
    return BezierPatches([net[:4], net[3:]])


def tilted_flat() -> BezierPatches:
    """Return a bicubic patch in a skew plane, unevenly drawn: flat only up to rounding."""
    rng = np.random.default_rng(11)
    u, v = np.meshgrid(np.linspace(0, 1, 4), np.linspace(0, 1, 4), indexing="ij")
    u, v = u + 0.08 * rng.normal(size=u.shape), v + 0.08 * rng.normal(size=v.shape)
    p, q = np.array([1.7, 0.3, -0.4]), np.array([-0.2, 1.1, 0.9])
    return BezierPatches([u[..., None] * p + v[..., None] * q])


def skew_box() -> Box:
    """Return a box that is turned and skewed."""
    matrix = ((0.8, -0.6, 0.2, -1.3), (0.6, 0.8, 0.0, 0.4), (0.1, 0.0, 1.0, -0.7), (0, 0, 0, 1))
    return Box((-0.5, -0.25, -0.5), (0.5, 0.75, 0.25)).transformed(matrix)


def closed_torus() -> Torus:
    """Return a torus in closed form, about an oblique axis."""
    return Torus((0.2, -0.1, 0.3), (0.3, -0.2, 1.0), 1.0, 0.4)


def asphere() -> Asphere:
    """Return an asphere that bends both ways, about an oblique axis."""
    return Asphere(4.0, -0.7, [-0.2, 0.08, -0.01], 4.0, (0.2, -0.1, 0.3), (0.3, -0.2, 1.0))


def fan() -> TriangleMesh:
    """Return an open cap of triangles about a vertex, and a needle."""
    import trimesh

    turn = np.arange(7) / 7 * 2 * np.pi
    rim = np.stack([np.cos(turn), np.sin(turn), -0.4 + 0.1 * np.cos(3 * turn)], axis=1)
    vertices = np.concatenate([[(0, 0, 0)], rim, [(3, 0, 0.1), (0.5, 2e-4, 0.2), (0.5, 0, 0.2)]])
    faces = [(0, 1 + k, 1 + (k + 1) % 7) for k in range(7)] + [(8, 9, 10)]
    return TriangleMesh(trimesh.Trimesh(vertices, faces, process=False))


def _turned(name: str, *segments: Any, **more: Any) -> dict[str, SingularSet]:
    return {name: SingularSet("turned", _lathe(*segments), **{"find": poles, **more})}


def part(profile: Any, begin: float, end: float) -> SurfaceOfRevolution:
    """Return a part of a turned surface."""
    return SurfaceOfRevolution(profile, ZERO, Z, u_range=(begin, end))


CYLINDER = [(-1.0, 1.0), (1.0, 1.0)]
CONE = [(0.0, 0.0), (2.0, 1.0)]
PARABOLOID = [(0.0, 0.0), (0.0, 0.5), (1.0, 1.0)]
EGG = [(-1.0, 0.0), (-1.0, 0.9), (1.2, 1.3), (1.2, 0.0)]
LENS = [(-0.5, 0.0), (0.0, 1.2), (0.5, 0.0)]
SPINDLE = [(0.0, 0.0), (1.0, 0.0), (2.0, 1.0)]
DIAMOND = ([(-1.0, 0.3), (0.0, 1.0)], [(0.0, 1.0), (1.5, 0.2)])

SETS: dict[str, SingularSet] = {
    # --- turned surfaces
    **_turned("cone tip", CONE),
    **_turned("flat cone tip", [(0.0, 0.0), (0.02, 1.0)]),
    **_turned("needle tip", [(0.0, 0.0), (2.0, 0.01)]),
    **_turned("lens tips", LENS),
    **_turned("paraboloid pole", PARABOLOID),
    **_turned("egg poles", EGG),
    "ball poles": SingularSet("turned", _ball, poles),
    **_turned("spindle", SPINDLE),
    **_turned("sharp spindle", [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 1.0)]),
    **_turned("disc middle", [(0.0, 0.0), (0.0, 1.0)]),
    **_turned("joint, sharp", *DIAMOND, find=circles(True)),
    "joint, smooth": SingularSet("turned", lambda: [vase(0, 0, 5)], circles(True)),
    **_turned("rim", *DIAMOND, find=circles(False)),
    **_turned("seam", EGG, find=seam),
    "cylinder, along rulings": SingularSet("turned", lambda: [cylinder()], interior, within),
    "cylinder, beside rulings": SingularSet("turned", lambda: [cylinder()], interior, parallel),
    **_turned("cone, along rulings", CONE, find=interior, aim=within),
    **_turned("cone, beside rulings", CONE, find=interior, aim=parallel),
    "ring, nearly within": SingularSet("turned", lambda: [ring()], interior, within),
    "ring, parallel": SingularSet("turned", lambda: [ring()], interior, parallel),
    "torus, tangents": SingularSet("turned", lambda: [torus()], interior, parallel),
    "torus, flat circle": SingularSet("turned", lambda: [torus()], circles(True), parallel),
    "torus, leaving": SingularSet("turned", lambda: [torus()], interior, leaving="grazing"),
    **_turned("cone tip, leaving", CONE, leaving="beside"),
    **_turned("paraboloid pole, leaving", PARABOLOID, leaving="beside"),
    **_turned("joint, leaving", *DIAMOND, find=circles(True), leaving="beside"),
    "rational torus, tangents": SingularSet(
        "turned", lambda: [rational_torus()], interior, parallel
    ),
    "rational torus, flat circle": SingularSet(
        "turned", lambda: [rational_torus()], circles(True), parallel
    ),
    "rational torus, joints": SingularSet("turned", lambda: [rational_torus()], circles(True)),
    "rational torus, leaving": SingularSet(
        "turned", lambda: [rational_torus()], interior, leaving="grazing"
    ),
    "rational ball, poles": SingularSet("turned", lambda: [rational_ball()], poles),
    "part of a cylinder, ends": SingularSet("turned", lambda: [part(CYLINDER, 0.1, 0.6)], edges),
    "part of a cylinder, within": SingularSet(
        "turned", lambda: [part(CYLINDER, 0.0, 0.25)], edges, within
    ),
    "part of a cone, tip": SingularSet("turned", lambda: [part(CONE, -0.1, 0.7)], poles),
    "part of a torus, ends": SingularSet(
        "turned", lambda: [rational_torus((0.3, 0.65))], at_parameters([(0, None), (1, None)], False)
    ),
    "part of a torus, tangents": SingularSet(
        "turned", lambda: [rational_torus((0.3, 1.2))], interior, parallel
    ),
    "part, leaving": SingularSet(
        "turned", lambda: [rational_torus((0.3, 0.65))], edges, leaving="beside"
    ),
    "uneven weights": SingularSet("turned", lambda: [uneven_profile()], interior, parallel),
    "uneven weights, ends": SingularSet("turned", lambda: [uneven_profile()], edges),
    # --- patches
    "apex of the lid": SingularSet("patches", lambda: [lid()], collapsed),
    "collapsed edge": SingularSet("patches", lambda: [petal()], collapsed),
    "lune": SingularSet("patches", lambda: [lune()], collapsed),
    "uneven lune": SingularSet("patches", lambda: [uneven_lune()], collapsed),
    "pinched corner": SingularSet(
        "patches", lambda: [pinched_corner()], at_parameters([(0.0, 0.0)], True)
    ),
    "patch corners": SingularSet(
        "patches",
        lambda: [petal()],
        at_parameters([(a, b) for a in (0.0, 1.0) for b in (0.0, 1.0)], True),
    ),
    "shared edge, smooth": SingularSet(
        "patches", lambda: [bent_sheet()], at_parameters([(0.0, None), (1.0, None)], False)
    ),
    "shared edge, sharp": SingularSet(
        "patches", lambda: [roof()], at_parameters([(0.0, None)], False)
    ),
    "edges of the lid": SingularSet("patches", lambda: [lid()], edges),
    "edges of a cube of patches": SingularSet("patches", lambda: [cube()], edges),
    "open border": SingularSet("patches", lambda: [saddle()], edges),
    "cuspidal edge": SingularSet(
        "patches", lambda: [cuspidal_edge()], at_parameters([(0.5, None)], False)
    ),
    "self-crossing": SingularSet("patches", lambda: [loop_sheet()], edges),
    "flat patch, nearly within": SingularSet("patches", lambda: [square()], interior, within),
    "flat patch, parallel": SingularSet("patches", lambda: [square()], interior, parallel),
    "flat bicubic, nearly within": SingularSet(
        "patches", lambda: [tilted_flat()], interior, within
    ),
    "flat bicubic, parallel": SingularSet("patches", lambda: [tilted_flat()], interior, parallel),
    "rulings, nearly within": SingularSet("patches", lambda: [saddle()], interior, within),
    "rulings, parallel": SingularSet("patches", lambda: [saddle()], interior, parallel),
    "uneven patch corner": SingularSet(
        "patches", lambda: [uneven_patch()], at_parameters([(0.0, 0.0)], True)
    ),
    "wavy patch, tangents": SingularSet("patches", lambda: [wavy_patch()], interior, parallel),
    "patch tangents": SingularSet("patches", lambda: [bent_sheet()], interior, parallel),
    "patches, leaving": SingularSet(
        "patches", lambda: [bent_sheet()], interior, leaving="grazing"
    ),
    "apex, leaving": SingularSet("patches", lambda: [lid()], collapsed, leaving="beside"),
    "shared edge, leaving": SingularSet(
        "patches", lambda: [roof()], at_parameters([(0.0, None)], False), leaving="beside"
    ),
    # --- rational patches
    "rational poles": SingularSet("rational", lambda: [octants()], collapsed),
    "rational seams": SingularSet("rational", lambda: [octants()], edges),
    "rational tangents": SingularSet("rational", lambda: [octants()], interior, parallel),
    "rational, leaving": SingularSet(
        "rational", lambda: [octants()], interior, leaving="grazing"
    ),
    "rational rulings": SingularSet("rational", lambda: [half_pipe()], interior, within),
    "rational collapsed edges": SingularSet("rational", lambda: [weighted_petal()], collapsed),
    "breaks and creases of NURBS": SingularSet("rational", lambda: [torn_nurbs()], edges),
    # --- closed forms
    "sphere, tangents": SingularSet(
        "closed", lambda: [Sphere((0.3, 0.2, 0.1), 0.37)], interior, parallel
    ),
    "sphere, leaving": SingularSet(
        "closed", lambda: [Sphere((0.3, 0.2, 0.1), 0.37)], interior, leaving="grazing"
    ),
    "sphere on 0, leaving": SingularSet(
        "closed", lambda: [Sphere((0.0, 1.0, 0.0), 1.0)], interior, leaving="beside"
    ),
    "ground, leaving": SingularSet(
        "closed", lambda: [Sphere((0.0, -1000.0, 0.0), 1000.0)], interior, leaving="beside"
    ),
    "rectangle rim": SingularSet(
        "closed", lambda: [Rectangle((-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2))], edges
    ),
    "rectangle, nearly within": SingularSet(
        "closed", lambda: [Rectangle((-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2))], interior, within
    ),
    "rectangle, parallel": SingularSet(
        "closed", lambda: [Rectangle((-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2))], interior, parallel
    ),
    "plane, nearly within": SingularSet(
        "closed", lambda: [Plane((0, 0, -1.3), (0.1, 0.2, 1))], interior, within
    ),
    "box edges and corners": SingularSet(
        "closed", lambda: [Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7))], edges),
    "box faces, nearly within": SingularSet(
        "closed", lambda: [Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7))], interior, within),
    "box faces, parallel": SingularSet(
        "closed", lambda: [Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7))], interior, parallel),
    "box, leaving": SingularSet(
        "closed", lambda: [Box((-2, -0.5, -0.5), (-1.2, 0.5, 0.7))], interior, leaving="grazing"),
    "skew box, edges and corners": SingularSet("closed", lambda: [skew_box()], edges),
    "skew box, nearly within": SingularSet("closed", lambda: [skew_box()], interior, within),
    "skew box, leaving": SingularSet("closed", lambda: [skew_box()], interior, leaving="grazing"),
    "closed torus, tangents": SingularSet("closed", lambda: [closed_torus()], interior, parallel),
    "closed torus, flat circle": SingularSet(
        "closed", lambda: [closed_torus()], at_parameters([(None, 0.25), (None, 0.75)], True), parallel
    ),
    "closed torus, equators": SingularSet(
        "closed", lambda: [closed_torus()], at_parameters([(None, 0.0), (None, 0.5)], True)
    ),
    "closed torus, leaving": SingularSet(
        "closed", lambda: [closed_torus()], interior, leaving="grazing"
    ),
    "asphere, rim": SingularSet(
        "closed", lambda: [asphere()], at_parameters([(None, 1.0)], True)
    ),
    "asphere, vertex": SingularSet(
        "closed", lambda: [asphere()], at_parameters([(0.0, 0.0)], False)
    ),
    "asphere, tangents": SingularSet("closed", lambda: [asphere()], interior, parallel),
    "asphere, leaving": SingularSet("closed", lambda: [asphere()], interior, leaving="grazing"),
    # --- meshes
    "mesh edges and vertices": SingularSet("mesh", lambda: [ellipsoid()], edges),
    "open mesh, edges": SingularSet("mesh", lambda: [fan()], edges),
    "open mesh, nearly within": SingularSet("mesh", lambda: [fan()], interior, within),
    "open mesh, parallel": SingularSet("mesh", lambda: [fan()], interior, parallel),
    "mesh, leaving": SingularSet("mesh", lambda: [ellipsoid()], interior, leaving="grazing"),
}  # fmt: skip
