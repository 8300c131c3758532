"""Every kind of singular set, on surfaces that have it; and the placements of these surfaces."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import vase
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from proof.cases.catalogue import (
    cuspidal_edge,
    cylinder,
    loop_sheet,
    ring,
    saddle,
    square,
    uneven_patch,
    wavy_patch,
)
from proof.cases.rational_surfaces import (
    half_pipe,
    octants,
    torn_nurbs,
    weighted_petal,
)
from proof.cases.scenes import ellipsoid, torus
from proof.cases.singular_rays import (
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
from proof.cases.singular_surfaces import (
    CONE,
    CYLINDER,
    DIAMOND,
    EGG,
    LENS,
    PARABOLOID,
    SPINDLE,
    asphere,
    ball,
    bent_sheet,
    closed_torus,
    cube,
    fan,
    lathe,
    lid,
    lune,
    part,
    petal,
    pinched_corner,
    rational_ball,
    rational_torus,
    roof,
    skew_box,
    tilted_flat,
    uneven_lune,
    uneven_profile,
)
from proof.cases.trimmed_surfaces import (
    cut_lens,
    drilled_part,
    drilled_plate,
    trim_edges,
    trimmed_nurbs,
    trimmed_patch,
    windowed_ball,
    windowed_cylinder,
    windowed_torus,
)

KINDS = ("turned", "patches", "rational", "closed", "mesh")
DISTANCES = tuple(10.0**-k for k in range(1, 17))
Aim = Callable[[Targets, float, Random], Aimed]


@dataclass(frozen=True)
class SingularSet:
    """One kind of singular set.

    ``kind``: one of `KINDS`.
    ``surfaces``: all except the first are occluders.
    ``leaving``: "" for rays that arrive; "beside" for rays that leave hits of such rays any way; "grazing"
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


def _turned(name: str, *segments: Any, **more: Any) -> dict[str, SingularSet]:
    return {name: SingularSet("turned", lathe(*segments), **{"find": poles, **more})}


SETS: dict[str, SingularSet] = {
    # --- turned surfaces
    **_turned("cone tip", CONE),
    **_turned("flat cone tip", [(0.0, 0.0), (0.02, 1.0)]),
    **_turned("needle tip", [(0.0, 0.0), (2.0, 0.01)]),
    **_turned("lens tips", LENS),
    **_turned("paraboloid pole", PARABOLOID),
    **_turned("egg poles", EGG),
    "ball poles": SingularSet("turned", ball, poles),
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
    "windows of a cylinder": SingularSet("turned", lambda: [windowed_cylinder()], trim_edges),
    "windows, leaving": SingularSet(
        "turned", lambda: [windowed_cylinder()], trim_edges, leaving="beside"
    ),
    "drilled part, edges": SingularSet("turned", lambda: [drilled_part()], trim_edges),
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
    "trimmed patch, edges": SingularSet("patches", lambda: [trimmed_patch()], trim_edges),
    "trimmed patch, leaving": SingularSet(
        "patches", lambda: [trimmed_patch()], trim_edges, leaving="beside"
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
    "holes of NURBS": SingularSet("rational", lambda: [trimmed_nurbs()], trim_edges),
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
    "drilled plate, edges": SingularSet("closed", lambda: [drilled_plate()], trim_edges),
    "drilled plate, nearly within": SingularSet(
        "closed", lambda: [drilled_plate()], trim_edges, within
    ),
    "windows of a ball": SingularSet("closed", lambda: [windowed_ball()], trim_edges),
    "windows of a ball, leaving": SingularSet(
        "closed", lambda: [windowed_ball()], trim_edges, leaving="beside"
    ),
    "windows of a torus": SingularSet("closed", lambda: [windowed_torus()], trim_edges),
    "cut lens, edges": SingularSet("closed", lambda: [cut_lens()], trim_edges),
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
