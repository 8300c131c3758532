"""Faces of CAD files as surfaces: one constructor for each kind of face, all keeping its own (u, v).

So a face's curves are used as they are, and its normal is along S_u x S_v as the file has it. A frame
that is left-handed has its axis turned round; where that turns v round, too, the face is flipped.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any, TypeAlias

import numpy as np

from hybrid_rt.cad.loops import (
    Arc,
    Axis,
    RefusedFaceError,
    as_curves,
    closed_loops,
    even_axis,
    extent,
    gathered,
    halved,
)
from hybrid_rt.cad.records import ELLIPSE, SPLINE
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.primitives.torus import Torus
from meshing import NurbsSurface, SurfaceOfRevolution, TrimmedSurface
from meshing.checks import FloatArray
from meshing.double_double import pair_of
from meshing.knots import combined, lengthened, split
from meshing.surface import Surface

TURN = 2.0 * math.pi
# Surfaces reach beyond their loops by this part of them, and by some gaps, so that edges are inside.
BEYOND, GAPS = 1e-6, 4.0
# Nearer to a whole turn than this no part of one is cut out.
NEARLY_WHOLE = 0.98
# A profile is in one plane with its axis, and borders of a spline meet, up to this of its size.
IN_PLANE, MEETING = 1e-10, 1e-12
# Radii up to this part of a profile are on its axis.
NEARLY_ZERO = 1e-7
# Splines go on beyond their ends by at most this part of the last span: as polynomials soon run away.
LONGEST_REACH = 0.02
# Points along u and v by which the box of a face is found.
GRID = 33
# Arcs of conics are at most so long, in radians (or in the hyperbolic angle).
LONGEST_ARC = 0.5 * math.pi


@dataclass(frozen=True)
class Raw:
    """A face as the child process hands it over."""

    kind: str
    is_reversed: bool
    size: list[int]
    numbers: FloatArray
    wires: list[list[Arc]]
    gap: float  # the largest of its edges

    @property
    def frame(self) -> FloatArray:
        """(4, 3): location, x, y, z of an elementary surface."""
        return self.numbers[:12].reshape(4, 3)


Loops: TypeAlias = list[list[Arc]]
Axes: TypeAlias = tuple[Axis, Axis]
# Origin, axis, and the direction from which azimuths count.
Frame: TypeAlias = tuple[FloatArray, FloatArray, FloatArray]


@dataclass(frozen=True)
class Part:
    """A surface that a face, or a part of it, lies on, and how its (u, v) follow from the face's own."""

    surface: Surface
    axes: Axes
    loops: Loops
    is_turned: bool = False  # whether S_u x S_v is opposite to that of the face
    moved: tuple[float, float] = (1.0, 0.0)  # by what the face's v was multiplied, and shifted
    periods: Sequence[float] = (TURN, 0.0)

    def trimmed(self, face: Raw) -> TrimmedSurface:
        """Return the part of the surface inside the loops."""
        surface, loops, axes = self.surface, self.loops, self.axes
        if face.is_reversed != self.is_turned:
            # As `TrimmedSurface.flipped` does, at once.
            loops, axes = _flipped(surface.flip_of_uv, loops, axes)
            surface = surface.flipped()
        gap = max(arc.gap for loop in loops for arc in loop)
        return TrimmedSurface(surface, as_curves(loops, axes, gap), gap)

    def extremes(self) -> FloatArray:
        """Return points whose box holds the part of the surface that loops reach, nearly."""
        if isinstance(self.surface, SurfaceOfRevolution):
            return self.surface.bounds
        if self.surface.is_flat:
            return np.empty((0, 3))  # edges do
        ends = extent(self.loops)
        at = (
            axis.to_unit(np.linspace(ends[0, k], ends[1, k], GRID))
            for k, axis in enumerate(self.axes)
        )
        closes = self.surface.closes
        u, v = np.meshgrid(
            *(x % 1.0 if c else np.clip(x, 0, 1) for c, x in zip(closes, at, strict=True))
        )
        return self.point(u.ravel(), v.ravel())

    def jump(self) -> float:
        """Return how far lines that close loops go in space, at most, beyond what the file allows."""
        farthest, along = 0.0, np.linspace(0.0, 1.0, 5)[:, None]
        for arc in (arc for loop in self.loops for arc in loop if arc.ends is None):
            begin, way = arc.points[0], arc.points[1] - arc.points[0]
            if np.abs(way).max() > NEARLY_ZERO:
                at = self.point(*np.clip(self.unit(begin + along * way, moved=True), 0.0, 1.0))
                far = float(np.linalg.norm(at - at[0], axis=1).max())
                farthest = max(farthest, far - 2 * arc.reach)
        return farthest

    def unit(self, uv: FloatArray, *, moved: bool = False) -> tuple[FloatArray, FloatArray]:
        """Return the surface's u and v of points in the face's own, (n, 2), or as its loops have them."""
        sign, shift = (1.0, 0.0) if moved else self.moved
        native = [uv[:, 0], sign * uv[:, 1] + shift]
        for k, (period, axis) in enumerate(zip(self.periods, self.axes, strict=True)):
            if period:
                lowest = axis.native[0] - NEARLY_ZERO
                native[k] = lowest + (native[k] - lowest) % period
        return self.axes[0].to_unit(native[0]), self.axes[1].to_unit(native[1])

    def point(self, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return points of the surface; v goes on from segment to segment of a profile."""
        breaks = self.surface.v_breaks
        if breaks is None or len(breaks) == 2:
            return self.surface.point(u, v)
        k = np.clip(np.searchsorted(breaks, v, side="right") - 1, 0, len(breaks) - 2)
        return self.surface.point(u, (v - breaks[k]) / (breaks[k + 1] - breaks[k]), k)


def _flipped(way: str, loops: Loops, axes: Axes) -> tuple[Loops, Axes]:
    """Return loops and axes of a flipped surface, by its `Surface.flip_of_uv`."""
    u, v = axes
    if way == "swapped":
        return [[replace(arc, points=arc.points[:, ::-1]) for arc in loop] for loop in loops], (
            v,
            u,
        )
    is_u = way == "u reversed"
    scale = (-1.0, 1.0) if is_u else (1.0, -1.0)
    loops = [[arc.moved(scale, (0, 0)) for arc in loop] for loop in loops]
    return loops, (u.reversed(), v) if is_u else (u, v.reversed())


@dataclass(frozen=True)
class Segment:
    """A Bezier piece of a profile between two of its parameters, and how it is bent; see `Axis`."""

    begin: float
    end: float
    points: FloatArray  # (n + 1, 3) in space, or (n + 1, 2): position along an axis, and radius
    weights: FloatArray | None = None
    bend: tuple[int, float] = (SPLINE, 0.0)


def parts_of(face: Raw) -> list[Part]:
    """Return the parts of a face, most often one.

    Raises
    ------
    RefusedFaceError
        It has no exact form here, or its loops are open.
    ValueError
        What the constructors of surfaces and curves refuse.
    """
    return BUILDERS[face.kind](face)


def _loops(
    face: Raw, *periods: float, moved: tuple[float, float] = (1.0, 0.0), lowest: float = 0.0
) -> Loops:
    """Return closed loops, v multiplied and shifted, in the first period of u and of v from ``lowest`` on."""
    loops = closed_loops(face.wires, periods)
    if not loops:
        raise RefusedFaceError("it has no loop of edges")
    scale, shift = (1.0, moved[0]), (0.0, moved[1])
    loops = [[arc.moved(scale, shift) for arc in loop] for loop in loops]
    return gathered(loops, periods, (0.0, lowest))


def _padded(low: float, high: float, gap: float) -> tuple[float, float]:
    """Return a range that reaches beyond the loops; ``gap`` in its units."""
    pad = max(BEYOND * (high - low), GAPS * gap)
    return low - pad, high + pad


def _plane(face: Raw) -> list[Part]:
    origin, x, y, _ = face.frame
    loops = _loops(face, 0.0, 0.0)
    (u, v), (far_u, far_v) = extent(loops)
    (u, far_u), (v, far_v) = _padded(u, far_u, face.gap), _padded(v, far_v, face.gap)
    surface = Rectangle(origin + u * x + v * y, (far_u - u) * x, (far_v - v) * y)
    return [Part(surface, (even_axis(u, far_u), even_axis(v, far_v)), loops, periods=(0.0, 0.0))]


def _straight(face: Raw) -> list[Part]:
    """Return the parts of a cylinder or cone: one on each side of its apex."""
    radius, angle = face.numbers[12:14]
    sine, cosine = (math.sin(angle), math.cos(angle)) if face.kind == "cone" else (0.0, 1.0)
    loops = _loops(face, TURN, 0.0)
    (_, low), (_, high) = extent(loops)
    tip, rounding = -radius / sine if sine else np.inf, IN_PLANE * (high - low)
    # What ends at the apex does not go on beyond it.
    is_below, is_above = tip >= high - rounding, tip <= low + rounding
    low, high = _padded(low, high, face.gap)
    low, high = (max(low, tip) if is_above else low), (min(high, tip) if is_below else high)
    points = [[v * cosine, 0.0 if v == tip else radius + v * sine] for v in (low, high)]
    segments = [Segment(low, high, np.array(points))]
    frame, sign = _axis_of(face.frame)
    return _turned(face, loops, frame, segments, sign)


def _axis_of(frame: FloatArray) -> tuple[Frame, float]:
    """Return a frame, right-handed, and the sign of positions along its axis."""
    origin, x, y, z = frame
    sign = 1.0 if np.cross(x, y) @ z > 0.0 else -1.0
    return (origin, sign * z, x), sign


def _round(face: Raw) -> list[Part]:
    frame, sign = _axis_of(face.frame)
    major, minor = face.numbers[12:14].tolist()
    return _ring(face, frame, major, minor, (sign, 0.0))


def _ring(
    face: Raw, frame: Frame, major: float, minor: float, moved: tuple[float, float]
) -> list[Part]:
    """Return a torus; of major radius 0 a sphere. Its angle about the tube is v times a sign, shifted."""
    origin, axis, x = frame
    is_turned, is_ball = moved[0] < 0.0, major == 0.0
    loops = _loops(face, TURN, TURN, moved=moved, lowest=-0.5 * TURN if is_ball else 0.0)
    if minor >= major and not is_ball:  # its profile crosses the axis
        circle = np.array([[0.0, major], [0.0, 1.0], [1.0, 0.0]])
        (_, low), (_, high) = extent(loops)
        segments = conic_arcs(circle, (minor, minor), low, high, ELLIPSE)
        return _turned(face, loops, frame, segments, 1.0, is_turned, moved, TURN)
    ends = (-0.25 * TURN, 0.25 * TURN) if is_ball else (0.0, TURN)
    axes = even_axis(0.0, TURN), even_axis(*ends)
    surface = Sphere(origin, minor, axis, x) if is_ball else Torus(origin, axis, major, minor, x)
    return [Part(surface, axes, loops, is_turned, moved, (TURN, TURN))]


def conic_arcs(
    frame: FloatArray, radii: tuple[float, float], low: float, high: float, form: int
) -> list[Segment]:
    """Return rational arcs of a conic, given by its centre and two axes."""
    center, x, y = frame[0], radii[0] * frame[1], radii[1] * frame[2]
    cosine, sine = (math.cos, math.sin) if form == ELLIPSE else (math.cosh, math.sinh)

    def place(angle: float, over: float = 1.0) -> FloatArray:
        point: FloatArray = center + (cosine(angle) * x + sine(angle) * y) / over
        return point

    found = []
    n = max(math.ceil((high - low) / LONGEST_ARC - 1e-9), 1)
    for a, b in pairwise(np.linspace(low, high, n + 1).tolist()):
        middle = 0.5 * (a + b)
        w = cosine(0.5 * (b - a))
        points = np.stack([place(a), place(middle, w), place(b)])
        found.append(Segment(a, b, points, np.array([1.0, w, 1.0]), (form, middle)))
    return found


def _profile(face: Raw, begin: int, *, pads: bool = False) -> tuple[list[Segment], Any]:
    """Return the Bezier pieces of a profile in space; of a spline also degree, points, weights, knots."""
    form, numbers = face.size[0], face.numbers[begin:]
    first, last = numbers[:2].tolist()
    if form != SPLINE:
        frame, radii = numbers[2:14].reshape(4, 3), (float(numbers[14]), float(numbers[15]))
        if pads and (form != ELLIPSE or last - first < NEARLY_WHOLE * TURN):
            first, last = _padded(first, last, face.gap / min(radii))
        return conic_arcs(frame[:3], radii, first, last, form), None
    degree, n, is_rational = face.size[1:4]
    points, rest = numbers[2 : 2 + 3 * n].reshape(n, 3), numbers[2 + 3 * n :]
    weights = rest[:n] if is_rational else None
    knots = rest[n if is_rational else 0 :][: n + degree + 1]
    pieces = split(np.array(knots), degree)
    net = points if weights is None else np.column_stack([points * weights[:, None], weights])
    fine = combined(pieces.rows, pair_of(net))[0]
    low, width = knots[degree], knots[n] - knots[degree]
    found = []
    for k, (a, b) in zip(pieces.first_row, pieces.spans, strict=True):
        rows = fine[k : k + degree + 1]
        w = None if weights is None else rows[:, 3]
        begins, ends = float(low + a * width), float(low + b * width)
        if ends > first and begins < last:
            found.append(Segment(begins, ends, rows[:, :3] / (1.0 if w is None else w[:, None]), w))
    return found, (degree, points, weights, knots)


def _revolution(face: Raw) -> list[Part]:
    origin, axis = face.numbers[:3], face.numbers[3:6]
    segments, _ = _profile(face, 6)
    points = np.concatenate([s.points for s in segments]) - origin
    across = points - (points @ axis)[:, None] * axis
    distance = np.linalg.norm(across, axis=1)
    size = float(np.abs(points).max())
    if not distance.max() > IN_PLANE * size:
        raise RefusedFaceError("its profile lies on the axis")
    x = across[int(distance.argmax())] / distance.max()
    if np.abs(across @ np.cross(axis, x)).max() > IN_PLANE * size:
        raise RefusedFaceError("its profile is not in one plane with its axis")
    if face.size[0] == ELLIPSE and np.ptp(face.numbers[20:22]) == 0.0:
        return _turned_circle(face, origin, axis, x)
    flat = [
        Segment(s.begin, s.end, np.column_stack([p @ axis, p @ x]), s.weights, s.bend)
        for s, p in ((s, s.points - origin) for s in segments)
    ]
    return _turned(face, _loops(face, TURN, 0.0), (origin, axis, x), flat)


def _turned_circle(face: Raw, origin: FloatArray, axis: FloatArray, x: FloatArray) -> list[Part]:
    """Return a circle turned about an axis in its plane: a torus or a sphere."""
    center, to_begin, to_quarter = face.numbers[8:20].reshape(4, 3)[:3]
    radius, height = float(face.numbers[20]), float((center - origin) @ axis)
    major = float((center - origin) @ x)
    turn = (to_begin @ x) * (to_quarter @ axis) - (to_begin @ axis) * (to_quarter @ x)
    moved = 1.0 if turn > 0.0 else -1.0, math.atan2(to_begin @ axis, to_begin @ x)
    major = 0.0 if abs(major) <= IN_PLANE * radius else major
    return _ring(face, (origin + height * axis, axis, x), major, radius, moved)


def _turned(
    face: Raw, loops: Loops, frame: Frame, segments: list[Segment], sign: float = 1.0, is_turned: bool = False, moved: tuple[float, float] = (1.0, 0.0),
    period: float = 0.0,
) -> list[Part]:  # fmt: skip
    """Return the surfaces of a turned profile: one for each run of radii of one sign."""
    origin, axis, x = frame
    size = max(float(np.abs(s.points).max()) for s in segments)
    low, high = extent(loops)[:, 1].tolist()
    for k in (0, -1):
        s = segments[k]
        speed = float(_lengths(s.points)) / (s.end - s.begin)
        longer = _reaching(s, _padded(low, high, face.gap / speed)[k])
        # What ends at the axis does not go on beyond it.
        if s.points[k, 1] * longer.points[k, 1] > (NEARLY_ZERO * size) ** 2:
            segments[k] = longer
    runs: list[tuple[int, list[Segment]]] = []
    for s in [piece for whole in segments for piece in _cut_at_axis(whole)]:
        radii = np.where(np.abs(s.points[:, 1]) <= IN_PLANE * size, 0.0, s.points[:, 1])
        side = 1 if radii.max() >= -radii.min() else -1
        points = np.column_stack([sign * s.points[:, 0], side * radii])
        if not runs or runs[-1][0] != side:
            runs.append((side, []))
        runs[-1][1].append(Segment(s.begin, s.end, points, s.weights, s.bend))
    found = []
    for side, run in runs:
        largest = max(float(s.points[:, 1].max()) for s in run)
        if largest <= NEARLY_ZERO * size:
            continue  # where a profile that ends at the axis goes beyond it
        u, part = _turn(loops, face.gap / largest)
        weights = [s.weights for s in run]
        # A negative radius is a positive one on the other side.
        surface = SurfaceOfRevolution(
            [s.points for s in run], origin, axis, side * x,
            weights if any(w is not None for w in weights) else None, part,
        )  # fmt: skip
        breaks = np.array([run[0].begin, *(s.end for s in run)])
        is_even = len(run) == 1 and run[0].bend[0] == SPLINE
        v = Axis(breaks, surface.v_breaks, () if is_even else tuple(s.bend for s in run))
        found.append(Part(surface, (u, v), loops, is_turned, moved, (TURN, period)))
    return found


def _reaching(s: Segment, v: float) -> Segment:
    """Return a piece of a profile that goes on to v, where it ends before."""
    reach = LONGEST_REACH * (s.end - s.begin)
    v = min(max(v, s.begin - reach), s.end + reach)
    if s.begin <= v <= s.end:
        return s
    form, middle = s.bend
    ends = [s.begin, s.end, v]
    if form != SPLINE:
        of = math.tan if form == ELLIPSE else math.tanh
        ends = [of(0.5 * (x - middle)) for x in ends]
    at, is_beyond = (ends[2] - ends[0]) / (ends[1] - ends[0]), v > s.end
    net = halved(_homogeneous(s), at)[0 if is_beyond else 1]
    points, w = net[:, :2] / net[:, 2:], None if s.weights is None else net[:, 2]
    return Segment(min(v, s.begin), max(v, s.end), points, w, s.bend)


def _homogeneous(s: Segment) -> FloatArray:
    w = np.ones(len(s.points)) if s.weights is None else s.weights
    return np.column_stack([s.points * w[:, None], w])


def _cut_at_axis(s: Segment) -> list[Segment]:
    """Return the parts of a piece of a profile on either side of the axis that it crosses."""
    radii = s.points[:, 1]
    if not radii[0] * radii[-1] < 0.0:
        return [s]
    if min(abs(radii[0]), abs(radii[-1])) <= NEARLY_ZERO * np.abs(radii).max():
        points = s.points.copy()  # it was meant to end there
        points[0 if abs(radii[0]) < abs(radii[-1]) else -1, 1] = 0.0
        return [replace(s, points=points)]
    net = _homogeneous(s)
    low, high = 0.0, 1.0
    for _ in range(60):
        at = 0.5 * (low + high)
        one, other = halved(net, at)
        low, high = (at, high) if one[-1, 1] * radii[0] > 0.0 else (low, at)
    one[-1, 1] = other[0, 1] = 0.0
    v = s.begin + at * (s.end - s.begin)
    form, middle = s.bend
    if form != SPLINE:
        of, back = (math.tan, math.atan) if form == ELLIPSE else (math.tanh, math.atanh)
        ends = of(0.5 * (s.begin - middle)), of(0.5 * (s.end - middle))
        v = middle + 2.0 * back(ends[0] + at * (ends[1] - ends[0]))
    return [
        Segment(a, b, part[:, :2] / part[:, 2:], None if s.weights is None else part[:, 2], s.bend)
        for a, b, part in ((s.begin, v, one), (v, s.end, other))
    ]


def _turn(loops: Loops, gap: float) -> tuple[Axis, tuple[float, float]]:
    """Return the axis of an azimuth, and the part of a turn that loops need."""
    (low, _), (high, _) = extent(loops)
    low, high = (x / TURN for x in _padded(low, high, gap))
    if high - low >= NEARLY_WHOLE or low < -1.0 or high > 2.0:
        return even_axis(0.0, TURN), (0.0, 1.0)
    return even_axis(low * TURN, high * TURN), (low, high)


def _extrusion(face: Raw) -> list[Part]:
    direction, (low, high) = face.numbers[:3], face.numbers[3:5].tolist()
    low, high = _padded(low, high, face.gap)
    segments, spline = _profile(face, 5, pads=True)
    if spline is not None:
        degree, points, weights, knots = spline
    else:
        degree = 2
        points = np.concatenate([segments[0].points[:1], *(s.points[1:] for s in segments)])
        weights = np.concatenate(
            [[1.0], *(s.weights[1:] for s in segments if s.weights is not None)]
        )
        breaks = np.array([segments[0].begin, *(s.end for s in segments)])
        knots = np.concatenate([breaks[:1], np.repeat(breaks, 2), breaks[-1:]])
    net = np.stack([points + low * direction, points + high * direction], axis=1)
    heavy = None if weights is None else np.column_stack([weights, weights])
    whole = [knots, np.array([low, low, high, high])]
    if spline is not None:
        return _sheet(face, net, heavy, whole, (degree, 1))
    # Between breaks the parameter of the arcs is not the angle.
    periods = TURN if face.size[0] == ELLIPSE else 0.0, 0.0
    begin = 0.5 * (breaks[0] + breaks[-1]) - 0.5 * TURN, 0.0
    loops = gathered(closed_loops(face.wires, periods), periods, begin)
    share = (breaks - breaks[0]) / (breaks[-1] - breaks[0])
    axes = Axis(breaks, share, tuple(s.bend for s in segments)), even_axis(low, high)
    return [
        Part(NurbsSurface(net, whole[0], whole[1], (2, 1), heavy), axes, loops, periods=periods)
    ]


def _spline(face: Raw) -> list[Part]:
    du, dv, n, m, is_rational = face.size[:5]
    net, rest = face.numbers[: 3 * n * m].reshape(n, m, 3), face.numbers[3 * n * m :]
    weights = rest[: n * m].reshape(n, m) if is_rational else None
    rest = rest[n * m if is_rational else 0 :]
    knots = [rest[: n + du + 1], rest[n + du + 1 :][: m + dv + 1]]
    return _sheet(face, net, weights, knots, (du, dv))


def _sheet(
    face: Raw, net: FloatArray, weights: FloatArray | None, knots: list[FloatArray], degrees: tuple[int, int]
) -> list[Part]:  # fmt: skip
    """Return a B-spline surface, of which only the spans that loops reach are kept."""
    net, weights, closes = _closed(net, weights)
    begin, end = zip(*map(_domain, knots, degrees), strict=True)
    periods = [b - a if c else 0.0 for a, b, c in zip(begin, end, closes, strict=True)]
    loops = gathered(closed_loops(face.wires, periods), periods, begin)
    if not loops:
        raise RefusedFaceError("it has no loop of edges")
    homogeneous = net if weights is None else np.dstack([net * weights[..., None], weights])
    for axis, degree in enumerate(degrees):
        low, high = extent(loops)[:, axis]
        if not periods[axis] or (low >= begin[axis] and high <= end[axis]):
            speed = float(_lengths(net, axis).mean()) / (end[axis] - begin[axis])
            rows, knots[axis] = _within_reach(
                homogeneous.swapaxes(0, axis), knots[axis], degree,
                *_padded(low, high, face.gap / max(speed, 1e-300)), bool(periods[axis]),
            )  # fmt: skip
            homogeneous = rows.swapaxes(0, axis)
    if weights is not None:
        weights = homogeneous[..., 3]
        net = homogeneous[..., :3] / weights[..., None]
    else:
        net = homogeneous
    u, v = (even_axis(*_domain(k, d)) for k, d in zip(knots, degrees, strict=True))
    return [
        Part(
            NurbsSurface(net, knots[0], knots[1], degrees, weights), (u, v), loops, periods=periods
        )
    ]


def _domain(knots: FloatArray, degree: int) -> tuple[float, float]:
    return knots[degree], knots[len(knots) - degree - 1]


def _closed(
    net: FloatArray, weights: FloatArray | None
) -> tuple[FloatArray, FloatArray | None, list[bool]]:
    """Return control points whose borders are equal to the bit where they meet, and along what they do."""
    net, closes = net.copy(), []
    size = float(np.ptp(net.reshape(-1, 3), axis=0).max())
    weights = None if weights is None else weights.copy()
    for axis in (0, 1):
        ends = net.swapaxes(0, axis)  # views
        heavy = None if weights is None else weights.swapaxes(0, axis)
        meets = np.abs(ends[0] - ends[-1]).max() <= MEETING * size
        meets &= heavy is None or np.abs(heavy[0] / heavy[-1] - 1.0).max() <= MEETING
        # A border shrunk to a point meets nothing.
        meets &= bool(np.ptp(ends, axis=0).max() > MEETING * size)
        if meets:
            ends[-1] = ends[0]
            if heavy is not None:
                heavy[-1] = heavy[0]
        closes.append(bool(meets))
    return net, weights, closes


def _lengths(net: FloatArray, axis: int = 0) -> FloatArray:
    """Return the lengths of the polygons of control points along an axis."""
    lengths: FloatArray = np.linalg.norm(np.diff(net, axis=axis), axis=-1).sum(axis=axis)
    return lengths


def _within_reach(
    net: FloatArray, knots: FloatArray, degree: int, low: float, high: float, closes: bool
) -> tuple[FloatArray, FloatArray]:
    """Return a spline without the spans outside of a range; to its ends the first and the last of the others go on.

    But not beyond a point, nor a seam.
    """
    n = len(net)
    spans = [k for k in range(degree, n) if knots[k + 1] > max(knots[k], low) and knots[k] < high]
    if not spans:
        return net, knots
    first, last = spans[0], spans[-1]
    if closes and knots[first] == knots[degree] and knots[last + 1] == knots[n]:
        return net, knots
    net, knots = net[first - degree : last + 1], knots[first - degree : last + degree + 2]
    ends = knots[[degree, degree + 1, -degree - 2, -degree - 1]]
    points = net[..., :3] / net[..., 3:] if net.shape[-1] > 3 else net
    size = np.ptp(points.reshape(-1, 3), axis=0).max()
    is_point = [np.ptp(points[k], axis=0).max() <= MEETING * size for k in (0, -1)]
    low = ends[0] if is_point[0] else max(low, ends[0] - LONGEST_REACH * (ends[1] - ends[0]))
    high = ends[3] if is_point[1] else min(high, ends[3] + LONGEST_REACH * (ends[3] - ends[2]))
    longer, reaching = lengthened(net, knots, degree, low, high)
    has_weights = net.shape[-1] == 3 or bool((longer[..., 3] > 0.0).all())
    return (longer, reaching) if has_weights else (net, knots)


BUILDERS = {
    "plane": _plane, "cylinder": _straight, "cone": _straight, "sphere": _round, "torus": _round,
    "revolution": _revolution, "extrusion": _extrusion, "bezier": _spline, "bspline": _spline,
    "offset": _spline,
}  # fmt: skip
