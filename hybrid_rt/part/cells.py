"""Cells of faces and of their borders, with what holds for every point of them.

A cell is a box in the (u, v) of a patch, or an arc of a trim curve. Its points are within ``eps`` of the
hull of four corners: by linear interpolation, |S - bilinear| <= (du^2 |S_uu| + dv^2 |S_vv|) / 8. Its unit
normals are within ``spread`` of the three directions of ``frame``. Both hold for what is inside the loops
and for the rest of a cell, so that loops need no more than to be told which cells they miss.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.part.kernels.bounds import BEGINS, CELL_WIDTH, WIDTHS
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from meshing.curve2 import Curve2
from meshing.kernels.trims import INSIDE, OUTSIDE
from meshing.spans import across, within_patch

Ints = NDArray[np.int64]
TURN = 2.0 * np.pi
FLAT, TURNED, BALL, FREE = range(4)
FACE, BORDER, CREASE = range(3)
# First cells of what is turned are at most so wide, in radians.
WIDEST = 0.25 * TURN
# Steps aside from a trim curve by which its inner side is found, over the unit square.
ASIDE = 1e-6
# Trim curves no longer than this part of their surface are points.
POINT = 1e-7
# Arcs leave their patch by no more than rounding, over the unit square.
LEAVES = 1e-9
# Normals of cells of re-entrant edges differ by no more, radians.
FAN = 0.27
# Points on each trim curve by which its neighbour is found.
ALONG = 17
# Edges at which normals turn by less are smooth, in radians.
SMOOTH = 0.02
# Apexes of cones that are farther off, over their size, are no use.
FARTHEST_APEX = 100.0


class Slopes(NamedTuple):
    """Bounds on |S_u|, |S_v|, |S_uu|, |S_uv|, |S_vv|."""

    u: float
    v: float
    uu: float
    uv: float
    vv: float


def slopes_of_nets(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Bound the partials of rational Bezier patches with control points (k, n + 1, m + 1, d), as (k, 5) `Slopes`.

    With A = w S about the mean of the points: w S_u = A_u - w_u S, w S_uu = A_uu - 2 w_u S_u - w_uu S.
    """
    b = points - points.mean(axis=(1, 2), keepdims=True)
    w = weights / weights.min(axis=(1, 2), keepdims=True)
    rows = np.concatenate([b * w[..., None], w[..., None]], axis=3)

    def most(i: int, j: int) -> tuple[FloatArray, FloatArray]:
        n, m = np.array(rows.shape[1:3]) - 1
        if i > n or j > m:
            return np.zeros(len(rows)), np.zeros(len(rows))
        d = np.diff(np.diff(rows, i, axis=1), j, axis=2)
        factor = float(np.prod(n - np.arange(i)) * np.prod(m - np.arange(j)))
        return (
            factor * np.linalg.norm(d[..., :-1], axis=3).max(axis=(1, 2)),
            factor * np.abs(d[..., -1]).max(axis=(1, 2)),
        )

    far = np.linalg.norm(b, axis=3).max(axis=(1, 2))
    (a_u, w_u), (a_v, w_v) = most(1, 0), most(0, 1)
    (a_uu, w_uu), (a_uv, w_uv), (a_vv, w_vv) = most(2, 0), most(1, 1), most(0, 2)
    u, v = a_u + w_u * far, a_v + w_v * far
    return np.stack([
        u, v, a_uu + 2.0 * w_u * u + w_uu * far,
        a_uv + w_u * v + w_v * u + w_uv * far, a_vv + 2.0 * w_v * v + w_vv * far,
    ], axis=1)  # fmt: skip


def slopes_of_net(points: FloatArray, weights: FloatArray | None) -> Slopes:
    """Bound the partials of one patch (n + 1, m + 1, d)."""
    w = np.ones(points.shape[:2]) if weights is None else weights
    return Slopes(*slopes_of_nets(points[None], w[None])[0].tolist())


def restrictions(degree: int, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return matrices (k, n + 1, n + 1) from Bezier points to those of the part from ``low`` to ``high`` (k,)."""
    parts = []
    for i in range(degree + 1):
        # The polar form at n - i times low and i times high.
        rows = np.repeat(np.eye(degree + 1)[None], len(low), axis=0)
        for step in range(degree):
            at = (low if step >= i else high)[:, None, None]
            rows = (1.0 - at) * rows[:, :-1] + at * rows[:, 1:]
        parts.append(rows[:, 0])
    return np.stack(parts, axis=1)


class Patch(NamedTuple):
    """What bounds need to know of a patch of a face."""

    form: int
    slopes: Slopes
    turn: float  # radians per u
    origin: FloatArray
    axis: FloatArray
    core: int  # 0: the points themselves; else points are ``radius`` along the normal from
    radius: float  # a point (3), the axis (1), a circle about it (2); or tangent planes pass through the origin (4)


@dataclass(frozen=True)
class Side:
    """A trim curve of a face: on which side the face is, and what face is beyond it."""

    curve: Curve2
    bend: float  # bound on its second derivative, along u and along v
    is_left: bool
    points: FloatArray  # (ALONG, 3)
    into: FloatArray  # (ALONG, 3): unit, along the face and away from the curve
    normals: FloatArray  # (ALONG, 3)


class Solid:
    """The trimmed faces of a closed body, as their cells need them."""

    def __init__(self, surfaces: list[TrimmedSurface]) -> None:
        self.surfaces = surfaces
        self.bases = [surface.surface.pieces for surface in surfaces]
        counts = [len(surface) for surface in surfaces]
        self.first = np.cumsum([0, *counts])
        self.patches = [p for surface in surfaces for p in _patches(surface.surface)]
        self.gap = max(surface.gap for surface in surfaces)
        table = self.patches
        self.form = np.array([p.form for p in table])
        self.slopes = np.array([p.slopes for p in table])
        self.turn = np.array([p.turn for p in table])
        self.origin = np.array([p.origin for p in table])
        self.axis = np.array([p.axis for p in table])
        self.core = np.array([p.core for p in table])
        self.radius = np.array([p.radius for p in table])

    @cached_property
    def box(self) -> FloatArray:
        """Corners (2, 3) of a box about points of its trim curves; without any, about its whole surfaces."""
        points = [side.points.reshape(-1, 3) for sides in self.sides for side in sides]
        corners = np.concatenate(points or [surface.bounds for surface in self.surfaces])
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    @cached_property
    def size(self) -> float:
        """Diagonal of its box, scene units."""
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    def local(self, face: int, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, Ints]:
        """Return (u, v) on patches, and these patches, of points in the (u, v) of loops."""
        surface = self.surfaces[face]
        u, v = _wrapped(surface, np.stack([u, v], axis=-1))
        patch = np.broadcast_to(np.asarray(surface._patch_at(u, v), np.int64), u.shape)
        if surface.spans is not None:
            u, v = within_patch(surface.spans, u, v, patch)
        return u, v, patch

    def in_loops(
        self, face: int, u: FloatArray, v: FloatArray, patch: Ints
    ) -> tuple[FloatArray, FloatArray]:
        """Return the (u, v) of loops of points on patches."""
        spans = self.surfaces[face].spans
        return (u, v) if spans is None else across(spans, u, v, patch)

    def at(self, face: int, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return points and unit normals at the (u, v) of loops."""
        place = self.local(face, u, v)
        return self.bases[face]._points(*place), self.bases[face]._normals(*place)

    def slopes_in(self, face: int, patch: Ints, box: FloatArray) -> FloatArray:
        """Return `Slopes` (n, 5) that hold in boxes u0, u1, v0, v1 of patches of a face."""
        own = self.slopes[self.first[face] + patch].copy()
        base = self.bases[face]
        if not isinstance(base, BezierPatches):
            return own
        wide = np.maximum(box[:, 1::2] - box[:, ::2], 1e-12)
        for k in np.unique(patch).tolist():
            mine = patch == k
            net = base.patches[k]
            w = np.ones(net.shape[:2]) if base.weights is None else base.weights[k]
            rows = np.concatenate([net * w[..., None], w[..., None]], axis=2)
            r_u, r_v = (
                restrictions(n - 1, box[mine, 2 * axis], box[mine, 2 * axis] + wide[mine, axis])
                for axis, n in enumerate(net.shape[:2])
            )
            part = np.einsum("kia,kjb,abd->kijd", r_u, r_v, rows)
            found = slopes_of_nets(part[..., :3] / part[..., 3:], part[..., 3])
            power = np.array([[1, 0], [0, 1], [2, 0], [1, 1], [0, 2]])
            own[mine] = np.minimum(own[mine], found / np.prod(wide[mine][:, None] ** power, axis=2))
        return own

    @cached_property
    def sides(self) -> list[list[Side]]:
        """The trim curves of each face."""
        return [self._sides(k) for k in range(len(self.surfaces))]

    def _sides(self, face: int) -> list[Side]:
        surface = self.surfaces[face]
        curves = [curve for loop in surface.loops for curve in loop]
        s = np.linspace(0.0, 1.0, ALONG)
        uv = np.stack([curve.point(s) for curve in curves])
        step = np.gradient(uv, axis=1)
        left = np.stack([-step[..., 1], step[..., 0]], axis=2)
        left /= np.maximum(np.linalg.norm(left, axis=2), 1e-300)[..., None]
        in_left, in_right = (
            surface.contains(*_wrapped(surface, (uv + way * ASIDE * left)[:, 1:-1]))[0]
            for way in (1, -1)
        )
        sign = np.where(in_left.sum(axis=1) > in_right.sum(axis=1), 1.0, -1.0)
        beside = np.clip(uv + sign[:, None, None] * 100 * ASIDE * left, *_range_of(surface))
        every = np.concatenate([uv.reshape(-1, 2), beside.reshape(-1, 2)])
        points, normals = (x.reshape(2, *uv.shape[:2], 3) for x in self.at(face, *every.T))
        (points, inner), normals = points, normals[0]
        along = np.gradient(points, axis=1)
        along /= np.maximum(np.linalg.norm(along, axis=2), 1e-300)[..., None]
        into = np.cross(normals, along)
        into *= np.where(((inner - points) * into).sum(axis=2) < 0.0, -1.0, 1.0)[..., None]
        # Seams, and what is outside the unit square or shrunk to a point, are no borders.
        size = float(np.linalg.norm(np.ptp(surface.bounds, axis=0)))
        is_side = (in_left != in_right).any(axis=1)
        is_side &= np.ptp(points, axis=1).max(axis=1) > max(POINT * size, 4.0 * surface.gap)
        return [
            Side(curves[k], _bend_of(curves[k]), bool(sign[k] > 0), points[k], into[k], normals[k])
            for k in np.flatnonzero(is_side).tolist()
        ]

    def arcs(self, face: int, curve: Curve2) -> list[tuple[float, float]]:
        """Return the parameters of the arcs of a trim curve, each on one patch."""
        surface = self.surfaces[face]
        ends = [0.0, 1.0]
        if surface.spans is not None and len(surface) > 1:
            s = np.linspace(0.0, 1.0, 4 * ALONG)
            uv = curve.point(s)
            for axis in range(2):
                lines = np.unique(surface.spans[:, 2 * axis : 2 * axis + 2])
                for line in (lines[:, None] + np.array([-1.0, 0.0, 1.0])).ravel().tolist():
                    is_below = uv[:, axis] < line
                    for i in np.flatnonzero(is_below[:-1] != is_below[1:]).tolist():
                        ends.append(_crossing(curve, axis, line, s[i], s[i + 1]))
        return list(pairwise(sorted(set(ends))))


def _crossing(curve: Curve2, axis: int, line: float, low: float, high: float) -> float:
    """Return where a curve crosses a line, between two parameters on either side of it."""
    is_below = curve.point(low)[0, axis] < line
    for _ in range(60):
        middle = 0.5 * (low + high)
        if (curve.point(middle)[0, axis] < line) == is_below:
            low = middle
        else:
            high = middle
    return high


def _bend_of(curve: Curve2) -> float:
    """Bound the second derivative of a curve."""
    if curve.degree == 1:
        return 0.0
    weights = None if curve.weights is None else curve.weights[:, None]
    return slopes_of_net(curve.control[:, None], weights).uu


def _wrapped(surface: TrimmedSurface, uv: FloatArray) -> list[FloatArray]:
    """Return u and v of places (..., 2) in the unit square, whole turns away where the surface closes."""
    return [
        x % 1.0 if closes else np.clip(x, 0.0, 1.0)
        for x, closes in zip(np.moveaxis(uv, -1, 0), surface.closes, strict=True)
    ]


def _range_of(surface: TrimmedSurface) -> tuple[list[float], list[float]]:
    ends = [(-1.0, 2.0) if c else (0.0, 1.0) for c in surface.closes]
    return [e[0] for e in ends], [e[1] for e in ends]


def _patches(surface: Any) -> list[Patch]:
    """Return what bounds need of each patch of an untrimmed surface."""
    zero, up = np.zeros(3), np.array([0.0, 0.0, 1.0])
    if isinstance(surface, Rectangle):
        u, v = (float(np.linalg.norm(e)) for e in (surface.edge_u, surface.edge_v))
        return [Patch(FLAT, Slopes(u, v, 0, 0, 0), 0.0, zero, up, 0, 0.0)]
    if isinstance(surface, Sphere):
        u, v = TURN * surface.radius, 0.5 * TURN * surface.radius
        rho = surface.orientation * surface.radius
        slopes = Slopes(u, v, *surface.bend)
        return [Patch(BALL, slopes, TURN, surface.center, surface.pole, 3, rho)]
    if isinstance(surface, Torus):
        r = surface.minor_radius
        slopes = Slopes(TURN * (surface.major_radius + r), TURN * r, *surface.bend)
        rho = surface.orientation * r
        return [Patch(TURNED, slopes, TURN, surface.origin, surface.axis, 2, rho)]
    if isinstance(surface, SurfaceOfRevolution):
        turn = TURN * (surface.u_range[1] - surface.u_range[0])
        return [
            _turned(surface, turn, net, w)
            for net, w in zip(surface.segments, surface.weights, strict=True)
        ]
    if isinstance(surface.pieces, BezierPatches):
        pieces = surface.pieces
        weights = pieces.weights or [None] * len(pieces)
        return [
            Patch(FREE, slopes_of_net(net, w), 0.0, zero, up, 0, 0.0)
            for net, w in zip(pieces.patches, weights, strict=True)
        ]
    raise TypeError(
        f"{type(surface).__name__} has no cells: a part report takes faces of CAD files"
    )


def _turned(
    surface: SurfaceOfRevolution, turn: float, net: FloatArray, w: FloatArray | None
) -> Patch:
    """Return what bounds need of a turned segment: a cylinder's axis is its core."""
    along = slopes_of_net(net[:, None], None if w is None else w[:, None])
    radius = float(net[:, 1].max())
    speed = slopes_of_net(net[:, None, 1:], None if w is None else w[:, None]).u
    slopes = Slopes(turn * radius, along.u, turn**2 * radius, turn * speed, along.uu)
    is_cylinder = len(net) == 2 and net[0, 1] == net[1, 1]
    origin, core = surface.origin, (0, 0.0)
    if is_cylinder:
        core = (1, radius * float(np.sign(net[1, 0] - net[0, 0])))
    elif len(net) == 2:
        apex = net[0, 0] - net[0, 1] * (net[1, 0] - net[0, 0]) / (net[1, 1] - net[0, 1])
        if abs(apex - net[0, 0]) < FARTHEST_APEX * (radius + abs(net[1, 0] - net[0, 0])):
            origin, core = origin + apex * surface.axis, (4, 0.0)
    return Patch(TURNED, slopes, turn, origin, surface.axis, *core)


class Cells:
    """Cells that are halved when asked; a structure of arrays that grows."""

    def __init__(self, solids: list[Solid]) -> None:
        self.solids = solids
        self.n, self.room = 0, 1024
        self.number = np.empty((self.room, CELL_WIDTH))
        # solid, face, patch (of all), kind, side (of borders), is inside, is middle inside
        self.ints = np.empty((self.room, 7), np.int64)
        self.children = np.full((self.room, 2), -2, np.int64)
        self.creases: list[tuple[FloatArray, FloatArray]] = []  # frame and spread of crease k

    def __getattr__(self, name: str) -> Any:
        """Return the column of a name."""
        if name in WIDTHS:
            return self.number[: self.n, BEGINS[name] : BEGINS[name] + WIDTHS[name]]
        raise AttributeError(name)

    def eps_along(self, cells: Ints, directions: FloatArray) -> FloatArray:
        """Return how far points of cells (n,) are from their hulls along unit directions (n, k, 3)."""
        slope = np.abs(np.einsum("nij,nj->ni", directions, self.way[cells]))
        across = np.sqrt(np.maximum(1.0 - slope**2, 0.0))
        return np.minimum(self.eps[cells], self.eps[cells] * across + self.way_eps[cells] * slope)

    def roots(self, number: int) -> Ints:
        """Add the first cells of all faces of a solid and of their borders; return those that loops leave."""
        solid, made = self.solids[number], []
        for face, surface in enumerate(solid.surfaces):
            for p in range(len(surface)):
                patch = solid.patches[solid.first[face] + p]
                n = max(int(np.ceil(patch.turn / WIDEST - 1e-9)), 1)
                m = {BALL: 2, TURNED: 4 if patch.core == 2 else 1}.get(patch.form, 1)
                u, v = np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1)
                grid = [(a, b, c, d) for a, b in pairwise(u) for c, d in pairwise(v)]
                made.append(self._faces(number, face, np.full(len(grid), p), np.array(grid)))
            arcs = [
                (k, *ends)
                for k, side in enumerate(solid.sides[face])
                for ends in solid.arcs(face, side.curve)
            ]
            if arcs:
                table = np.array(arcs)
                sides = table[:, 0].astype(np.int64)
                made.append(self._borders(number, face, sides, table[:, 1:], BORDER, -1))
        every = np.concatenate(made)
        return every[every >= 0]

    def add_crease(
        self, number: int, face: int, side: int, own: FloatArray, other: FloatArray
    ) -> Ints:
        """Add a re-entrant edge: a border whose normals reach from those of its face to those of the one beyond.

        Both are given at even steps of its parameter, (n, 3). There are several cells for each arc, each with a part
        of these normals.
        """
        solid = self.solids[number]
        turn = float(np.arccos(np.clip((own * other).sum(axis=1).min(), -1.0, 1.0)))
        n = max(int(np.ceil(turn / FAN)), 1)
        shares = np.linspace(0.0, 1.0, n + 1)[:, None, None]
        fans = (1.0 - shares) * own + shares * other
        fans /= np.maximum(np.linalg.norm(fans, axis=2), 1e-300)[..., None]
        ends = np.array(solid.arcs(face, solid.sides[face][side].curve))
        made = []
        for one, two in pairwise(fans):
            self.creases.append((one, two))
            sides = np.full(len(ends), side)
            made.append(self._borders(number, face, sides, ends, CREASE, len(self.creases) - 1))
        return np.concatenate(made)

    def halved(self, cells: Ints) -> None:
        """Make the children of cells that have none yet; -1 where a half is outside the loops."""
        cells = np.unique(cells[self.children[cells, 0] == -2])
        ints = self.ints[cells]
        for key in np.unique(ints[:, 0] * 3 + ints[:, 3]).tolist():
            number, kind = divmod(key, 3)
            mine = cells[(ints[:, 0] == number) & (ints[:, 3] == kind)]
            order = mine[np.argsort(self.ints[mine, 1], kind="stable")]
            faces, begin = np.unique(self.ints[order, 1], return_index=True)
            for face, some in zip(faces.tolist(), np.split(order, begin[1:]), strict=True):
                self.children[some] = self._halve(number, face, kind, some)

    def cut(self, cells: Ints, axis: Ints) -> Ints:
        """Return halves of cells of faces, along u or v as asked, but for those outside the loops."""
        made = [np.empty(0, np.int64)]
        kinds = self.ints[cells]
        for number, face in np.unique(kinds[:, :2], axis=0).tolist():
            mine = (kinds[:, :2] == (number, face)).all(axis=1)
            made.append(self._halve(number, face, FACE, cells[mine], axis[mine]).ravel())
        every = np.concatenate(made)
        return every[every >= 0]

    def _halve(
        self, number: int, face: int, kind: int, some: Ints, along: Ints | None = None
    ) -> Ints:
        box = self.box[some]
        halves = np.repeat(box[:, None], 2, axis=1)
        if along is not None:
            axis = along
        elif kind == FACE:
            corners = self.corners[some].reshape(-1, 4, 3)
            # By how long, and how bent, it is along each parameter.
            bent = 0.125 * self.solids[number].slopes[self.ints[some, 2]][:, 2::2]
            bent *= (box[:, 1::2] - box[:, ::2]) ** 2
            long = np.linalg.norm(corners[:, 1:3] - corners[:, :1], axis=2) + bent
            axis = (long[:, 0] < long[:, 1]).astype(np.int64)
        else:
            axis = np.zeros(len(some), np.int64)
        rows = np.arange(len(some))
        half = 0.5 * (box[rows, 2 * axis] + box[rows, 2 * axis + 1])
        halves[rows, 0, 2 * axis + 1] = half
        halves[rows, 1, 2 * axis] = half
        halves = halves.reshape(-1, 4)
        if kind == FACE:
            patch = np.repeat(self.ints[some, 2], 2) - self.solids[number].first[face]
            known = np.repeat(self.ints[some, 5] == 1, 2)
            new = self._faces(number, face, patch, halves, known)
        else:
            sides = np.repeat(self.ints[some, 4], 2)
            creases = np.repeat(self.ints[some, 6], 2)
            new = self._borders(number, face, sides, halves[:, :2], kind, creases)
        return new.reshape(-1, 2)

    def _grow(self, n: int) -> slice:
        while self.n + n > self.room:
            self.room *= 2
            self.number = np.resize(self.number, (self.room, CELL_WIDTH))
            self.ints = np.resize(self.ints, (self.room, 7))
            more = np.full((self.room, 2), -2, np.int64)
            more[: self.n] = self.children[: self.n]
            self.children = more
        rows = slice(self.n, self.n + n)
        self.n += n
        return rows

    def _faces(
        self, number: int, face: int, patch: Ints, box: FloatArray, inside: BoolArray | None = None
    ) -> Ints:
        """Add cells of a face; -1 for those outside its loops."""
        solid = self.solids[number]
        surface = solid.surfaces[face]
        inside = np.zeros(len(box), np.bool_) if inside is None else inside.copy()
        keeps = np.ones(len(box), np.bool_)
        asked = np.flatnonzero(~inside)
        if len(asked):
            low = solid.in_loops(face, box[asked, 0], box[asked, 2], patch[asked])
            high = solid.in_loops(face, box[asked, 1], box[asked, 3], patch[asked])
            state = surface.sides(np.stack([low[0], high[0], low[1], high[1]], axis=1))
            keeps[asked], inside[asked] = state != OUTSIDE, state == INSIDE
        out = np.full(len(box), -1, np.int64)
        box, patch, inside = box[keeps], patch[keeps], inside[keeps]
        if not len(box):
            return out
        n = len(box)
        rows = self._grow(n)
        out[keeps] = np.arange(rows.start, rows.stop)
        u0, u1, v0, v1 = box.T
        mu, mv = 0.5 * (u0 + u1), 0.5 * (v0 + v1)
        u, v = np.concatenate([u0, u1, u0, u1, mu]), np.concatenate([v0, v0, v1, v1, mv])
        base, number_of = solid.bases[face], solid.first[face] + patch
        at = base._points(u, v, np.tile(patch, 5)).reshape(5, n, 3)
        normal = base._normals(mu, mv, patch)
        slopes = solid.slopes_in(face, patch, box)
        _, _, s_uu, _, s_vv = slopes.T
        du, dv = u1 - u0, v1 - v0
        eps = 0.125 * (s_uu * du**2 + s_vv * dv**2)
        middle = (mu, mv, patch)
        self._fill(
            rows, solid, number_of, at, eps, normal, 0.5 * du, 0.5 * dv, base, middle, slopes
        )
        is_in = inside | surface.contains(*solid.in_loops(face, mu, mv, patch))[0]
        self.box[rows] = box
        self._tell(rows, number, face, number_of, FACE, -1, inside, is_in)
        return out

    def _tell(self, rows: slice, *columns: Any) -> None:
        for k, column in enumerate(columns):
            self.ints[rows, k] = column

    def _borders(
        self, number: int, face: int, sides: Ints, ends: FloatArray, kind: int, crease: Any
    ) -> Ints:
        """Add arcs of trim curves of a face."""
        solid = self.solids[number]
        n = len(sides)
        rows = self._grow(n)
        uv, bend = np.empty((3, n, 2)), np.empty(n)
        for k in np.unique(sides).tolist():
            mine, side = sides == k, solid.sides[face][k]
            for j, s in enumerate((ends[mine, 0], ends[mine, 1])):
                uv[j, mine] = side.curve.point(s)
            bend[mine] = side.bend
        uv[2] = 0.5 * (uv[0] + uv[1])
        off = 0.125 * bend * (ends[:, 1] - ends[:, 0]) ** 2
        surface, base = solid.surfaces[face], solid.bases[face]
        # All three points on the patch of the middle, which an arc hardly leaves.
        _, _, own = solid.local(face, *uv[2].T)
        turn = np.where(surface.closes, np.floor(uv[2]), 0.0)
        u, v = np.moveaxis(uv - turn, 2, 0)
        patch = np.tile(own, 3)
        if surface.spans is not None:
            u, v = within_patch(surface.spans, u.ravel(), v.ravel(), patch)
        u, v = u.reshape(3, n), v.reshape(3, n)
        crosses = (np.maximum(np.abs(u - 0.5), np.abs(v - 0.5)) > 0.5 + LEAVES).any(axis=0) & (
            len(surface) > 1
        )
        at = base._points(u.ravel(), v.ravel(), patch).reshape(3, n, 3)
        # From here on in the (u, v) of patches.
        wide = np.ones((n, 2))
        if surface.spans is not None:
            wide = (surface.spans[:, 1::2] - surface.spans[:, ::2])[own]
        off_u, off_v = (off[:, None] / wide).T
        reach = [
            np.stack([np.minimum(x[0], x[1]) - o, np.maximum(x[0], x[1]) + o])
            for x, o in ((u, off_u), (v, off_v))
        ]
        slopes = solid.slopes_in(face, own, np.concatenate(reach).T)
        if crosses.any():
            every = solid.slopes[solid.first[face] : solid.first[face + 1]]
            slopes[crosses] = every.max(axis=0)
        s_u, s_v, s_uu, s_uv, s_vv = slopes.T
        du, dv = np.abs(u[1] - u[0]), np.abs(v[1] - v[0])
        eps = 0.125 * (s_uu * du**2 + 2 * s_uv * du * dv + s_vv * dv**2) + s_u * off_u + s_v * off_v
        # Where two patches meet the surface may have a crease.
        eps += np.where(crosses, s_u * (du + off_u) + s_v * (dv + off_v), 0.0)
        middle = (u[2], v[2], own)
        normal = base._normals(*middle)
        hu, hv = 0.5 * du + off_u, 0.5 * dv + off_v
        corners = at[[0, 1, 0, 1, 2]]
        self._fill(
            rows, solid, solid.first[face] + own, corners, eps, normal, hu, hv, base, middle, slopes
        )
        self.spread[rows][crosses] = (2.0, 1.0, 1.0)
        # The middle of the chord is on the surface, that of the arc on the border.
        at_middle = 0.5 * (ends[:, 0] + ends[:, 1])
        on_curve = np.empty((n, 2))
        for k in np.unique(sides).tolist():
            mine = sides == k
            on_curve[mine] = solid.sides[face][k].curve.point(at_middle[mine])
        real, _ = solid.at(face, *on_curve.T)
        self.radius[rows, 0] += np.linalg.norm(real - self.middle[rows], axis=1)
        self.middle[rows] = real
        slides = solid.core[solid.first[face] + own] == 1
        self.core_eps[rows, 0][slides] = (s_v * off_v)[slides]
        self.box[rows, :2], self.box[rows, 2:] = ends, 0.0
        self.way_eps[rows, 0] += s_v * off_v * (solid.form[solid.first[face] + own] == TURNED)
        crease = np.broadcast_to(crease, n)
        if kind == CREASE:  # normals are not those of the face
            self.core[rows], self.rho[rows] = self.corners[rows], 0.0
            self.core_eps[rows] = eps[:, None]
            self.is_round[rows], self.is_support[rows], self.ring[rows] = 0.0, 0.0, -1.0
            for i in range(n):
                self._widen(rows.start + i, self.creases[crease[i]], ends[i])
        self._tell(rows, number, face, solid.first[face] + own, kind, sides, 1, crease)
        return np.arange(rows.start, rows.stop)

    def _widen(self, row: int, normals: tuple[FloatArray, FloatArray], ends: FloatArray) -> None:
        """Let the normals of an arc of a re-entrant edge reach from one face to the other."""
        n = len(normals[0]) - 1
        inner = np.arange(int(np.floor(ends[0] * n)) + 1, int(np.ceil(ends[1] * n)))
        at = np.concatenate([[ends[0]], inner / n, [ends[1]]]) * n
        low = np.minimum(at.astype(np.int64), n - 1)
        share = (at - low)[:, None]
        one, two = ((1.0 - share) * x[low] + share * x[low + 1] for x in normals)
        both = np.concatenate([one, two])
        # Between samples normals are off a straight line by an eighth of the second difference.
        bent = max(float(np.linalg.norm(np.diff(x, 2, axis=0), axis=1).max()) for x in normals)
        middle = (one + two).sum(axis=0)
        middle /= max(float(np.linalg.norm(middle)), 1e-300)
        way = (one - two).sum(axis=0)
        way -= (way @ middle) * middle
        way /= max(float(np.linalg.norm(way)), 1e-300)
        frame = np.stack([middle, way, np.cross(middle, way)])
        reach = np.abs(both @ frame.T)
        slack = 0.25 * bent
        self.frame[row] = frame.ravel()
        least = float((both @ middle).min())
        self.spread[row] = np.array([1.0 - least, reach[:, 1].max(), reach[:, 2].max()]) + slack

    def _fill(
        self, rows: slice, solid: Solid, patch: Ints, at: FloatArray, eps: FloatArray, normal: FloatArray,
        hu: FloatArray, hv: FloatArray, base: Any, middle: tuple[FloatArray, FloatArray, Ints],
        slopes: FloatArray,
    ) -> None:  # fmt: skip
        """Set points and normals of new cells; (hu, hv) half as wide as they, in (u, v)."""
        n = len(patch)
        corners = at[:4]
        away = np.linalg.norm(corners - at[4], axis=2).max(axis=0) + eps
        form, axis = solid.form[patch], solid.axis[patch]
        s_u, s_v, s_uu, s_uv, s_vv = slopes.T
        t_u, t_v, spread = np.empty((n, 3)), np.empty((n, 3)), np.zeros((n, 3))
        around = np.cross(axis, at[4] - solid.origin[patch])
        long = np.linalg.norm(around, axis=1)
        is_round = (form == TURNED) & (long > 1e-9 * np.maximum(away, 1e-300))
        t_u[is_round] = (around / np.maximum(long, 1e-300)[:, None])[is_round]
        other = ~is_round
        least = np.eye(3)[np.abs(normal[other]).argmin(axis=1)]
        t_u[other] = np.cross(normal[other], least)
        t_u /= np.linalg.norm(t_u, axis=1)[:, None]
        t_v[:] = np.cross(normal, t_u)
        if (form == BALL).any():
            k = form == BALL
            most = np.minimum(away / np.abs(solid.radius[patch]), 2.0)[k]
            spread[k] = np.stack([0.5 * most**2, most, most], axis=1)
        if (form == TURNED).any():
            k = form == TURNED
            turn = np.minimum(solid.turn[patch] * hu, np.pi)
            tilt = np.where(solid.core[patch] == 2, TURN * hv, np.nan)
            if np.isnan(tilt[k]).any():
                speed = np.linalg.norm(base._partials(*middle)[1], axis=1)
                bent = s_vv * hv / np.maximum(speed, 1e-300)
                tilt = np.where(np.isnan(tilt), np.arcsin(np.clip(bent, 0.0, 1.0)), tilt)
            tilt = np.minimum(tilt, 0.5 * np.pi)
            leans = np.abs((normal * axis).sum(axis=1))
            flat = 1.0 - np.cos(turn)
            wide = np.minimum(np.sqrt(np.maximum(1.0 - leans**2, 0.0)) + tilt, 1.0)
            across = np.sin(np.minimum(turn, 0.5 * np.pi)) * wide
            own = np.stack([1.0 - np.cos(tilt) + flat, across, np.sin(tilt) + flat * leans], axis=1)
            spread[k] = np.minimum(own[k], (2.0, 1.0, 1.0))
            spread[k & ~is_round] = (2.0, 1.0, 1.0)
        if (form == FREE).any():
            k = form == FREE
            cross = np.linalg.norm(np.cross(*base._partials(*middle)), axis=1)
            off = hu * (s_uu * s_v + s_u * s_uv) + hv * (s_uv * s_v + s_u * s_vv)
            sine = np.clip(off / np.maximum(cross, 1e-300), 0.0, 1.0)
            own = np.stack([1.0 - np.sqrt(1.0 - sine**2), sine, sine], axis=1)
            spread[k] = np.where((sine < 1.0)[:, None], own, (2.0, 1.0, 1.0))[k]
        kinds = solid.core[patch]
        core, core_eps, rho = corners.copy(), eps.copy(), solid.radius[patch] * (kinds > 0)
        self.is_round[rows, 0] = (kinds >= 1) & (kinds <= 3)
        major = np.where(
            kinds == 2, solid.slopes[patch, 0] / TURN - np.abs(solid.radius[patch]), 0.0
        )
        self.centre[rows] = solid.origin[patch]
        self.ring[rows, 0] = np.where(kinds == 2, major, np.where(kinds == 3, 0.0, -1.0))
        self.is_support[rows, 0], self.lean[rows, 0] = kinds == 4, (normal * axis).sum(axis=1)
        if kinds.any():
            origin = solid.origin[patch]
            core[:, kinds >= 3] = origin[kinds >= 3]
            along = ((corners - origin) * axis).sum(axis=2)[..., None] * axis
            core[:, kinds == 1] = (origin + along)[:, kinds == 1]
            core_eps[kinds != 0] = 0.0
            if (kinds == 2).any():
                k = kinds == 2
                out = corners - origin - along
                out /= np.maximum(np.linalg.norm(out, axis=2), 1e-300)[..., None]
                core[:, k] = (origin + major[:, None] * out)[:, k]
                core_eps[k] = (major * (1.0 - np.cos(np.minimum(TURN * hu, np.pi))))[k]
        self.corners[rows] = corners.transpose(1, 0, 2).reshape(n, 12)
        self.core[rows] = core.transpose(1, 0, 2).reshape(n, 12)
        # Along a plane's normal, or an axis, points are nearer to the hull.
        self.way[rows] = np.where((form == FLAT)[:, None], normal, axis * (form == TURNED)[:, None])
        self.way_eps[rows, 0] = 0.5 * s_vv * hv**2 * (form == TURNED)
        self.eps[rows, 0], self.core_eps[rows, 0], self.rho[rows, 0] = eps, core_eps, rho
        self.frame[rows] = np.stack([normal, t_u, t_v], axis=1).reshape(n, 9)
        self.spread[rows], self.middle[rows], self.radius[rows, 0] = spread, at[4], away
