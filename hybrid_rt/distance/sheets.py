"""Surfaces of all kinds as the sheets, curves and triangles that closest-point queries take."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.distance.kernels.table import (
    BEZIER,
    CIRCLE,
    DEGREE_U,
    DEGREE_V,
    ERROR,
    FRAME,
    IS_TURNED,
    PROFILE,
    SAG,
    SHEET_NUMBERS,
    SPAN,
    TURN,
)
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from meshing.bezier import RationalPatches
from meshing.checks import shown
from meshing.kernels.trims import TrimTable, points_of_arc
from meshing.profiles import homogeneous
from meshing.sheet import PatchSheet
from meshing.surface import Surface

ROUNDOFF = 2.0**-53
# Roundings of a point of degree n, in units of its largest control point, are these times n, and so many more.
PER_DEGREE, BESIDES = 8.0, 40.0
# Of curves in (u, v) that are within this of the border of a surface the border is looked at, too.
NEAR_BORDER = 1e-9
HALVINGS = 60
# Of turned sheets |S_u| + |S_v| is below this, where that of patches is below the sum of the degrees.
TURNS_STEEP = 8.0
# Sheets whose normals agree so well at so many points of a common border have no crease there.
SMOOTH, SAMPLED = 1e-9, 40

Ints: TypeAlias = NDArray[np.int64]


@dataclass
class Frame:
    """Where the lengths of a group are counted from, and their unit, a power of two."""

    centre: FloatArray
    unit: float

    @classmethod
    def about(cls, bounds: FloatArray) -> Frame:
        """Return the frame of a box: all of it is within 1/2."""
        size = float((bounds[1] - bounds[0]).max())
        exponent = math.frexp(size)[1] if size > 0.0 else -1000
        return cls(0.5 * bounds[0] + 0.5 * bounds[1], math.ldexp(1.0, exponent))

    def place(self, points: FloatArray, left: FloatArray | float = 0.0) -> FloatArray:
        """Return points in the frame; ``left`` is what rounding left of them."""
        placed: FloatArray = ((points - self.centre) + left) / self.unit
        return placed


@dataclass
class Sheets:
    """What is gathered of surfaces: see `hybrid_rt.distance.kernels.table`."""

    number: list[FloatArray] = field(default_factory=list)
    whole: list[list[int]] = field(default_factory=list)
    nets: list[FloatArray] = field(default_factory=list)
    group: list[int] = field(default_factory=list)
    edge: list[tuple[float, float]] = field(default_factory=list)
    edge_id: list[tuple[int, int, int, int]] = field(default_factory=list)
    triangles: list[tuple[int, FloatArray]] = field(default_factory=list)  # first sheet, (n, 3, 3)
    trimmed: list[tuple[TrimmedSurface, int]] = field(
        default_factory=list
    )  # with their first sheets
    rows: int = 0

    def add_net(self, net: FloatArray) -> int:
        """Add rows (t, 4), and return the first one's number."""
        self.nets.append(net)
        self.rows += len(net)
        return self.rows - len(net)

    def add(self, number: FloatArray, whole: Sequence[int], group: int) -> int:
        """Add a sheet, and return its number."""
        self.number.append(number)
        self.whole.append(list(whole))
        self.group.append(group)
        return len(self.whole) - 1


@dataclass
class Owner:
    """Of what surface sheets are added: its frame and group, its object, the patch before its first, its loops."""

    frame: Frame
    group: int
    object_id: int
    first_patch: int = 0
    loops: int = -1
    spans: FloatArray | None = None

    def numbers(self, patch: int, error: float) -> FloatArray:
        """Return the numbers of a sheet, with its rectangle and error."""
        number = np.zeros(SHEET_NUMBERS)
        number[SPAN : SPAN + 4] = (0, 1, 0, 1) if self.spans is None else self.spans[patch]
        number[ERROR] = error
        return number


def error_of(surface: Surface, owner: Owner, degree: int) -> float:
    """Bound the error of points of a surface in its frame: roundings, and what it was moved by."""
    # Within the frame coordinates are at most 1/2, and control points rarely much more.
    return (PER_DEGREE * degree + BESIDES) * ROUNDOFF + 2.0 * surface.moved / owner.frame.unit


@singledispatch
def add_sheets(surface: Surface, sheets: Sheets, owner: Owner) -> None:
    """Add the sheets of a surface; each class registers its function."""
    del sheets, owner
    raise TypeError(
        f"ClosestPoint surface is {shown(surface)}: there are no distances to such surfaces"
    )


@add_sheets.register(Rectangle)
@add_sheets.register(Box)
def _add_flat(surface: Surface, sheets: Sheets, owner: Owner) -> None:
    for patch in range(len(surface)):
        u, v = np.array([0.0, 0.0, 1.0, 1.0]), np.array([0.0, 1.0, 0.0, 1.0])
        corners = owner.frame.place(surface.point(u, v, patch))
        net = np.column_stack([corners, np.ones(4)])
        _add_patch(sheets, owner, net, (1, 1), patch, error_of(surface, owner, 2))


@add_sheets.register(BezierPatches)
@add_sheets.register(PatchSheet)
def _add_patches(surface: BezierPatches | PatchSheet, sheets: Sheets, owner: Owner) -> None:
    if owner.spans is None:
        owner.spans = surface.spans
    pieces = surface.pieces
    for patch, (net, left) in enumerate(zip(pieces.patches, pieces.remainders, strict=True)):
        m, n = net.shape[0] - 1, net.shape[1] - 1
        placed = owner.frame.place(net, left).reshape(-1, 3)
        w = np.ones(len(placed))
        if isinstance(pieces, RationalPatches):
            w = pieces.weights[patch].ravel()
            w = w * math.ldexp(1.0, -math.frexp(float(w.max()))[1])
        largest = max(float(np.abs(placed).max()), 1.0)
        error = error_of(pieces, owner, m + n) * largest
        weighted = np.column_stack([placed * w[:, None], w])
        _add_patch(sheets, owner, weighted, (m, n), patch, error)


def _add_patch(
    sheets: Sheets, owner: Owner, net: FloatArray, degrees: tuple[int, int], patch: int, error: float
) -> None:  # fmt: skip
    start = sheets.add_net(net)
    is_rational = int(np.ptp(net[:, 3]) > 0.0 or net[0, 3] != 1.0)
    whole = BEZIER, start, *degrees, is_rational, owner.loops, owner.object_id
    sheets.add(owner.numbers(patch, error), [*whole, owner.first_patch + patch, 0], owner.group)


def _add_turned(
    surface: Surface, sheets: Sheets, owner: Owner, patch: int, form: int, start: int, degree: int, frame: Any,
    profile: Sequence[float] = (), turn: tuple[float, float] = (0.0, 1.0),
) -> None:  # fmt: skip
    number = owner.numbers(patch, error_of(surface, owner, degree))
    origin, radial, binormal, axis = frame
    number[FRAME : FRAME + 12] = np.concatenate([owner.frame.place(origin), radial, binormal, axis])
    number[TURN : TURN + 2] = 2.0 * math.pi * turn[0], 2.0 * math.pi * turn[1]
    number[PROFILE : PROFILE + len(profile)] = profile
    whole = [form, start, 0, degree, 1, owner.loops, owner.object_id, owner.first_patch + patch, 1]
    sheets.add(number, whole, owner.group)


@add_sheets.register(SurfaceOfRevolution)
def _add_revolution(surface: SurfaceOfRevolution, sheets: Sheets, owner: Owner) -> None:
    unit = owner.frame.unit
    origin, axis = surface.origin, surface.axis
    for patch, (points, w) in enumerate(zip(surface.segments, surface.weights, strict=True)):
        net = homogeneous(points / unit, w)
        net = np.column_stack([net[:, :2], np.zeros(len(net)), net[:, 2]])
        frame = origin, surface.radial, surface.binormal, axis
        _add_turned(
            surface, sheets, owner, patch, BEZIER, sheets.add_net(net), len(net) - 1, frame,
            turn=surface.u_range,
        )  # fmt: skip
        reach = float(np.abs(points).sum(axis=1).max()) / unit
        away = float(np.abs(surface.remainder).sum()) * (1.0 / unit + reach)
        far = max(reach, float(np.abs(owner.frame.place(origin)).max()), 1.0)
        sheets.number[-1][ERROR] = sheets.number[-1][ERROR] * far + away


@add_sheets.register(Sphere)
def _add_sphere(surface: Sphere, sheets: Sheets, owner: Owner) -> None:
    frame = surface.center, *surface.frame
    circle = 0.0, 0.0, surface.radius / owner.frame.unit, -0.5 * math.pi, 0.5 * math.pi
    _add_turned(surface, sheets, owner, 0, CIRCLE, 0, 2, frame, circle)


@add_sheets.register(Torus)
def _add_torus(surface: Torus, sheets: Sheets, owner: Owner) -> None:
    unit = owner.frame.unit
    frame = surface.origin, surface.radial, surface.binormal, surface.axis
    circle = (
        0.0, surface.major_radius / unit, surface.minor_radius / unit,
        0.0, 2.0 * math.pi * surface.orientation,
    )  # fmt: skip
    _add_turned(surface, sheets, owner, 0, CIRCLE, 0, 2, frame, circle)


@add_sheets.register(Asphere)
def _add_asphere(surface: Asphere, sheets: Sheets, owner: Owner) -> None:
    sag = surface.sag.scaled(-round(math.log2(owner.frame.unit)))
    centre, coefficients = sag.expansion
    net = np.zeros((len(coefficients), 4))
    net[:, 0], net[:, 3] = coefficients, 1.0
    frame = surface.origin, surface.radial, surface.binormal, surface.axis
    half = 0.5 * surface.aperture / owner.frame.unit
    profile = half, sag.curvature, sag.under_root, centre, float(surface.orientation)
    start = sheets.add_net(net)
    _add_turned(surface, sheets, owner, 0, SAG, start, len(net) - 1, frame, profile)
    noise = surface.local_zones.noise.max() * ROUNDOFF * math.ldexp(1.0, surface.local_exponent)
    sheets.number[-1][ERROR] += 2.0 * noise / owner.frame.unit


@add_sheets.register(TriangleMesh)
def _add_triangles(surface: TriangleMesh, sheets: Sheets, owner: Owner) -> None:
    corners = owner.frame.place(surface.vertices)[surface.faces]
    number = owner.numbers(0, error_of(surface, owner, 1))
    whole = [BEZIER, 0, 1, 1, 0, -1, owner.object_id, owner.first_patch, 0]
    sheets.triangles.append((sheets.add(number, whole, owner.group), corners))


@add_sheets.register(TrimmedSurface)
def _add_trimmed(surface: TrimmedSurface, sheets: Sheets, owner: Owner) -> None:
    first = len(sheets.whole)
    owner.loops, owner.spans = len(sheets.trimmed), surface.spans
    add_sheets(surface.surface, sheets, owner)
    sheets.trimmed.append((surface, first))


def add_edges(sheets: Sheets, trims: TrimTable) -> None:
    """Add the curves that end trimmed surfaces; ``trims`` is the table of their loops, in order."""
    begin = 0
    members = zip(trims.member.tolist(), trims.error.tolist(), strict=True)
    for (surface, first), ((*_, count), error) in zip(sheets.trimmed, members, strict=True):
        spans = np.array(sheets.number[first : first + len(surface)])[:, SPAN : SPAN + 4]
        for number, whole in zip(
            sheets.number[first:], sheets.whole[first : first + len(surface)], strict=False
        ):
            # What rounding of a curve in (u, v), half of that number, is in space: |S_u| + |S_v| is below this.
            steep = TURNS_STEEP if whole[IS_TURNED] else whole[DEGREE_U] + whole[DEGREE_V]
            number[ERROR] += 0.5 * error * steep
        part, starts = slice(begin, begin + count), dict[int, int]()
        begin += count
        seams = _seams(surface)
        for (at, degree), row in zip(
            trims.arc[part].tolist(), trims.piece[part].tolist(), strict=True
        ):
            net = trims.net[at : at + degree + 1]
            if degree == 1 and _as_line(net[:, :2] / net[:, 2:]) in seams:
                continue
            if at not in starts:
                starts[at] = _add_arc(sheets, net)
            _add_edge(sheets, spans, first, net, starts[at], sorted((row[:3], row[3:])), 0)
        for axis, value, low, high in _lines(surface, spans):
            net = np.array([[value, value, 1.0], [value, value, 1.0]])
            net[:, 1 - axis] = low, high
            ends = [[0.0, *net[0, :2]], [1.0, *net[1, :2]]]
            _add_edge(sheets, spans, first, net, _add_arc(sheets, net), ends, 1)


def _as_line(ends: FloatArray) -> tuple[tuple[float, ...], ...]:
    """Return both ends of a line in an order that does not depend on its sense."""
    return tuple(sorted(map(tuple, ends.tolist())))


def _seams(surface: TrimmedSurface) -> set[tuple[tuple[float, ...], ...]]:
    """Return the lines of the loops that are there on both sides of where the surface closes: no ends of it."""
    lines = {
        _as_line(curve.control) for loop in surface.loops for curve in loop if curve.degree == 1
    }
    seams = set()
    for axis, closes in enumerate(surface.closes):
        for line in lines:
            ends = np.array(line)
            other = ends.copy()
            other[:, axis] = 1.0
            if closes and (ends[:, axis] == 0.0).all() and _as_line(other) in lines:
                seams |= {line, _as_line(other)}
    return seams


def _lines(surface: TrimmedSurface, spans: FloatArray) -> Iterator[tuple[int, float, float, float]]:
    """Yield lines that may end a trimmed surface, or fold it, inside its loops: axis, value, and from where to where.

    The border, where loops go beyond it and it does not close; and borders of sheets with a crease.
    """
    points = np.concatenate([curve.control for loop in surface.loops for curve in loop])
    for axis, closes in enumerate(surface.closes):
        for end, far in ((0.0, points[:, axis].min()), (1.0, 1.0 - points[:, axis].max())):
            if not closes and far <= NEAR_BORDER:
                yield axis, end, 0.0, 1.0
        near, other = 2 * axis, 2 - 2 * axis
        for k, span in enumerate(spans):
            value, low, high = span[near + 1], span[other], span[other + 1]
            beyond = 0.0 if value == 1.0 and closes else value
            found = np.flatnonzero((spans[:, near] == beyond) & (spans[:, other] == low))
            if (len(found) and found[0] != k) or (value == 1.0 and closes):
                along = low + (high - low) * np.linspace(0.01, 0.99, SAMPLED)
                sides = []
                for at, patch in ((value, k), (beyond, found[0])):
                    u, v = (np.full(SAMPLED, at), along)[:: 1 if axis == 0 else -1]
                    sides.append(surface.normal(u, v, patch))
                if np.abs(sides[0] - sides[1]).max() > SMOOTH:
                    yield axis, value, low, high


def _add_arc(sheets: Sheets, net: FloatArray) -> int:
    return sheets.add_net(np.column_stack([net[:, :2], np.zeros(len(net)), net[:, 2]]))


def _add_edge(
    sheets: Sheets, spans: FloatArray, first: int, net: FloatArray, start: int, ends: list[Any], checked: int
) -> None:  # fmt: skip
    """Add what a curve, u and v of which are monotone, has in the unit square, cut where it changes sheets."""
    (s0, *low), (s1, *high) = ends
    cuts = [s0, s1]
    if len(spans) > 1 or min(*low, *high) < 0.0 or max(*low, *high) > 1.0:
        for axis in (0, 1):
            a, b = low[axis], high[axis]
            cuts += [
                _where(net, axis, value, s0, s1, b > a)
                for value in np.unique(spans[:, 2 * axis : 2 * axis + 2]).tolist()
                if min(a, b) < value < max(a, b)
            ]
    elif s1 > s0:
        sheets.edge.append((s0, s1))
        sheets.edge_id.append((first, start, len(net) - 1, checked))
        return
    for a, b in pairwise(sorted(cuts)):
        if b > a:
            u, v = _point(net, 0.5 * (a + b))
            is_in = (
                (spans[:, 0] <= u) & (u <= spans[:, 1]) & (spans[:, 2] <= v) & (v <= spans[:, 3])
            )
            if is_in.any():
                sheets.edge.append((a, b))
                sheets.edge_id.append((first + int(is_in.argmax()), start, len(net) - 1, checked))


def _point(net: FloatArray, s: float) -> tuple[float, float]:
    out = np.empty((1, 2))
    points_of_arc(net, np.array([s]), out)
    return float(out[0, 0]), float(out[0, 1])


def _where(net: FloatArray, axis: int, value: float, a: float, b: float, rises: bool) -> float:
    """Return where a coordinate of a curve, monotone from a to b, has a value."""
    for _ in range(HALVINGS):
        m = 0.5 * (a + b)
        is_beyond = (_point(net, m)[axis] >= value) == rises
        a, b = (a, m) if is_beyond else (m, b)
    return 0.5 * (a + b)
