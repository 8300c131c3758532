"""Every kind of singular set, on surfaces that have it; and the placements of these surfaces."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.demo import vase
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from proof.cases import catalogue, scenes
from proof.cases import rational_surfaces as rational
from proof.cases import singular_surfaces as made
from proof.cases import trimmed_surfaces as trimmed
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
from proof.cases.singular_surfaces import lathe
from proof.cases.trimmed_surfaces import trim_edges

KINDS = ("turned", "patches", "rational", "closed", "mesh")
DISTANCES = tuple(10.0**-k for k in range(1, 17))
Aim = Callable[[Targets, float, Random], Aimed]


@dataclass(frozen=True)
class SingularSet:
    """One kind of singular set.

    ``kind``: one of `KINDS`.
    ``make``: makes the surface.
    ``leaving``: "" for rays that arrive; "beside" for rays that leave hits of such rays any way; "grazing"
    for rays that leave them at a cosine of the distance.
    """

    kind: str
    make: Callable[[], Any]
    find: Finder
    aim: Aim = beside
    leaving: str = ""

    def surfaces(self) -> list[Any]:
        """Return the surface in a list."""
        return [self.make()]


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


SMALL_BALL = partial(Sphere, (0.3, 0.2, 0.1), 0.37)
LEVEL = partial(Rectangle, (-2, -2, -1.2), (4, 0.3, 0), (0, 4, 0.2))
PLANE = partial(Plane, (0, 0, -1.3), (0.1, 0.2, 1))
UPRIGHT = partial(Box, (-2, -0.5, -0.5), (-1.2, 0.5, 0.7))
RING_PART = partial(made.rational_torus, (0.3, 0.65))
AT_0, U_BORDERS = (
    at_parameters([(0.0, 0.0)], True),
    at_parameters([(0.0, None), (1.0, None)], False),
)
U_0, AT_RIM = at_parameters([(0.0, None)], False), at_parameters([(None, 1.0)], True)
# Of each kind: what makes the surface, where its singular set is, how rays are aimed, how they leave.
ENTRIES: dict[str, dict[str, Iterable[Any]]] = {
    "turned": {
        "cone tip": (lathe(made.CONE), poles),
        "flat cone tip": (lathe([(0.0, 0.0), (0.02, 1.0)]), poles),
        "needle tip": (lathe([(0.0, 0.0), (2.0, 0.01)]), poles),
        "lens tips": (lathe(made.LENS), poles),
        "paraboloid pole": (lathe(made.PARABOLOID), poles),
        "egg poles": (lathe(made.EGG), poles),
        "ball poles": (made.ball, poles),
        "spindle": (lathe(made.SPINDLE), poles),
        "sharp spindle": (lathe([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (3.0, 1.0)]), poles),
        "disc middle": (lathe([(0.0, 0.0), (0.0, 1.0)]), poles),
        "joint, sharp": (lathe(*made.DIAMOND), circles(True)),
        "joint, smooth": (partial(vase, 0, 0, 5), circles(True)),
        "rim": (lathe(*made.DIAMOND), circles(False)),
        "seam": (lathe(made.EGG), seam),
        "cylinder, along rulings": (catalogue.cylinder, interior, within),
        "cylinder, beside rulings": (catalogue.cylinder, interior, parallel),
        "cone, along rulings": (lathe(made.CONE), interior, within),
        "cone, beside rulings": (lathe(made.CONE), interior, parallel),
        "ring, nearly within": (catalogue.ring, interior, within),
        "ring, parallel": (catalogue.ring, interior, parallel),
        "torus, tangents": (scenes.torus, interior, parallel),
        "torus, flat circle": (scenes.torus, circles(True), parallel),
        "torus, leaving": (scenes.torus, interior, beside, "grazing"),
        "cone tip, leaving": (lathe(made.CONE), poles, beside, "beside"),
        "paraboloid pole, leaving": (lathe(made.PARABOLOID), poles, beside, "beside"),
        "joint, leaving": (lathe(*made.DIAMOND), circles(True), beside, "beside"),
        "rational torus, tangents": (made.rational_torus, interior, parallel),
        "rational torus, flat circle": (made.rational_torus, circles(True), parallel),
        "rational torus, joints": (made.rational_torus, circles(True)),
        "rational torus, leaving": (made.rational_torus, interior, beside, "grazing"),
        "rational ball, poles": (made.rational_ball, poles),
        "part of a cylinder, ends": (partial(made.part, made.CYLINDER, 0.1, 0.6), edges),
        "part of a cylinder, within": (partial(made.part, made.CYLINDER, 0.0, 0.25), edges, within),
        "part of a cone, tip": (partial(made.part, made.CONE, -0.1, 0.7), poles),
        "part of a torus, ends": (RING_PART, at_parameters([(0, None), (1, None)], False)),
        "part of a torus, tangents": (partial(made.rational_torus, (0.3, 1.2)), interior, parallel),
        "part, leaving": (RING_PART, edges, beside, "beside"),
        "uneven weights": (made.uneven_profile, interior, parallel),
        "uneven weights, ends": (made.uneven_profile, edges),
        "windows of a cylinder": (trimmed.windowed_cylinder, trim_edges),
        "windows, leaving": (trimmed.windowed_cylinder, trim_edges, beside, "beside"),
        "drilled part, edges": (trimmed.drilled_part, trim_edges),
    },
    "patches": {
        "apex of the lid": (made.lid, collapsed),
        "collapsed edge": (made.petal, collapsed),
        "lune": (made.lune, collapsed),
        "uneven lune": (made.uneven_lune, collapsed),
        "pinched corner": (made.pinched_corner, AT_0),
        "patch corners": (
            made.petal, at_parameters([(a, b) for a in (0.0, 1.0) for b in (0.0, 1.0)], True),
        ),
        "shared edge, smooth": (made.bent_sheet, U_BORDERS),
        "shared edge, sharp": (made.roof, U_0),
        "edges of the lid": (made.lid, edges),
        "edges of a cube of patches": (made.cube, edges),
        "open border": (catalogue.saddle, edges),
        "cuspidal edge": (catalogue.cuspidal_edge, at_parameters([(0.5, None)], False)),
        "self-crossing": (catalogue.loop_sheet, edges),
        "flat patch, nearly within": (catalogue.square, interior, within),
        "flat patch, parallel": (catalogue.square, interior, parallel),
        "flat bicubic, nearly within": (made.tilted_flat, interior, within),
        "flat bicubic, parallel": (made.tilted_flat, interior, parallel),
        "rulings, nearly within": (catalogue.saddle, interior, within),
        "rulings, parallel": (catalogue.saddle, interior, parallel),
        "uneven patch corner": (catalogue.uneven_patch, AT_0),
        "wavy patch, tangents": (catalogue.wavy_patch, interior, parallel),
        "patch tangents": (made.bent_sheet, interior, parallel),
        "patches, leaving": (made.bent_sheet, interior, beside, "grazing"),
        "apex, leaving": (made.lid, collapsed, beside, "beside"),
        "shared edge, leaving": (made.roof, U_0, beside, "beside"),
        "trimmed patch, edges": (trimmed.trimmed_patch, trim_edges),
        "trimmed patch, leaving": (trimmed.trimmed_patch, trim_edges, beside, "beside"),
    },
    "rational": {
        "rational poles": (rational.octants, collapsed),
        "rational seams": (rational.octants, edges),
        "rational tangents": (rational.octants, interior, parallel),
        "rational, leaving": (rational.octants, interior, beside, "grazing"),
        "rational rulings": (rational.half_pipe, interior, within),
        "rational collapsed edges": (rational.weighted_petal, collapsed),
        "breaks and creases of NURBS": (rational.torn_nurbs, edges),
        "holes of NURBS": (trimmed.trimmed_nurbs, trim_edges),
    },
    "closed": {
        "sphere, tangents": (SMALL_BALL, interior, parallel),
        "sphere, leaving": (SMALL_BALL, interior, beside, "grazing"),
        "sphere on 0, leaving": (partial(Sphere, (0.0, 1.0, 0.0), 1.0), interior, beside, "beside"),
        "ground, leaving": (partial(Sphere, (0.0, -1e3, 0.0), 1e3), interior, beside, "beside"),
        "rectangle rim": (LEVEL, edges),
        "rectangle, nearly within": (LEVEL, interior, within),
        "rectangle, parallel": (LEVEL, interior, parallel),
        "drilled plate, edges": (trimmed.drilled_plate, trim_edges),
        "drilled plate, nearly within": (trimmed.drilled_plate, trim_edges, within),
        "windows of a ball": (trimmed.windowed_ball, trim_edges),
        "windows of a ball, leaving": (trimmed.windowed_ball, trim_edges, beside, "beside"),
        "windows of a torus": (trimmed.windowed_torus, trim_edges),
        "cut lens, edges": (trimmed.cut_lens, trim_edges),
        "plane, nearly within": (PLANE, interior, within),
        "box edges and corners": (UPRIGHT, edges),
        "box faces, nearly within": (UPRIGHT, interior, within),
        "box faces, parallel": (UPRIGHT, interior, parallel),
        "box, leaving": (UPRIGHT, interior, beside, "grazing"),
        "skew box, edges and corners": (made.skew_box, edges),
        "skew box, nearly within": (made.skew_box, interior, within),
        "skew box, leaving": (made.skew_box, interior, beside, "grazing"),
        "closed torus, tangents": (made.closed_torus, interior, parallel),
        "closed torus, flat circle": (
            made.closed_torus, at_parameters([(None, 0.25), (None, 0.75)], True), parallel,
        ),
        "closed torus, equators": (
            made.closed_torus, at_parameters([(None, 0.0), (None, 0.5)], True),
        ),
        "closed torus, leaving": (made.closed_torus, interior, beside, "grazing"),
        "asphere, rim": (made.asphere, AT_RIM),
        "asphere, vertex": (made.asphere, at_parameters([(0.0, 0.0)], False)),
        "asphere, tangents": (made.asphere, interior, parallel),
        "asphere, leaving": (made.asphere, interior, beside, "grazing"),
    },
    "mesh": {
        "mesh edges and vertices": (scenes.ellipsoid, edges),
        "open mesh, edges": (made.fan, edges),
        "open mesh, nearly within": (made.fan, interior, within),
        "open mesh, parallel": (made.fan, interior, parallel),
        "mesh, leaving": (scenes.ellipsoid, interior, beside, "grazing"),
    },
}  # fmt: skip
SETS = {
    name: SingularSet(kind, *entry)
    for kind, entries in ENTRIES.items()
    for name, entry in entries.items()
}
