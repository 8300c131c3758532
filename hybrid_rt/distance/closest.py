"""The closest points of surfaces of all kinds, certified."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.distance.kernels.build import boxes_of_cells, cells_of_edges, cells_of_sheets
from hybrid_rt.distance.kernels.search import SLACK, closest_points
from hybrid_rt.distance.kernels.table import (
    ALONG_U,
    ALONG_V,
    ARC,
    CELL_INTEGERS,
    CELL_NUMBERS,
    ERROR,
    KIND,
    MIDDLE,
    SHEET,
    SHEET_INTEGERS,
    SHEET_NUMBERS,
    SPAN,
    TRIANGLE,
    Answers,
    Groups,
    Shapes,
)
from hybrid_rt.distance.record import Closeness, ClosestRecord
from hybrid_rt.distance.sheets import Frame, Owner, Sheets, add_edges, add_sheets
from hybrid_rt.distance.sides import Sides, is_closed
from hybrid_rt.intersection.kernels.search.tree import CHILD, COUNT, ROWS, WIDTH, build_tree
from hybrid_rt.intersection.kinds.registry import check_surfaces
from hybrid_rt.intersection.ray_batch import LARGEST
from hybrid_rt.primitives import Plane
from hybrid_rt.primitives.instances import Instances
from meshing.checks import as_floats, shown
from meshing.surface import Surface, box_around
from meshing.trims import make_table

# Azimuths are rounded: points within this of a border, in (u, v), are on it.
AT_BORDER = 2.0**-48
# Cells in a leaf of the tree.
LEAF = 4
# What is left of a matrix times its inverse beside 1 counts this often.
MATRIX_SLACK = 4.0


class Group:
    """Surfaces, with their numbers, that share a frame; and their places, or None for one as they are."""

    def __init__(self, members: list[tuple[int, Surface]], instances: Instances | None) -> None:
        boxes = np.array([surface.bounds for _, surface in members])
        self.members, self.instances = members, instances
        self.frame = Frame.about(box_around(boxes))


class ClosestPoint:
    """Finds the closest points of surfaces: built once, asked by batches of points.

    The search is branch and bound over pieces of all surfaces, and over the curves that end them. Its answer is
    proven as a first hit is: nothing that was left out is nearer than ``|distance| - bound``, in exact
    arithmetic too.

    Parameters
    ----------
    surfaces : Surface or sequence of Surface
        As of an `Intersector`; trimmed ones and `Instances` as well. Of a `CadModel` its ``surfaces``. Of a
        `TrimmedSurface` what is inside the loops counts: its ``gap`` does not.
    closed : (surfaces,) bool array-like, optional
        Which of them bound closed bodies, alone or together: there distances are signed, negative on the side
        opposite to the normals. Of a `CadModel` its ``closed``. Default: those that are closed by
        themselves (`Sphere`, `Box`, `Torus`, a `TriangleMesh` each of whose edges has two faces that agree).
    threads : int, optional
        Default: as many as this process may use. They change no bit of the result.

    Raises
    ------
    TypeError, ValueError
        For what an `Intersector` refuses, no surface, and ``closed`` of another length.
    """

    def __init__(
        self,
        surfaces: Surface | Sequence[Surface],
        *,
        closed: ArrayLike | None = None,
        threads: int | None = None,
    ) -> None:
        several = (
            (surfaces,) if isinstance(surfaces, Surface) else checks.items(surfaces, "surfaces")
        )
        self.surfaces = check_surfaces(several)
        if not self.surfaces:
            raise ValueError("ClosestPoint surfaces is empty: pass at least one surface")
        self._pool = Pool(threads)
        self.closed = _as_closed(closed, self.surfaces)
        self._sides = Sides(self.surfaces, self.closed, threads)
        self._build()
        if not np.isfinite(self._found(np.zeros((1, 3))).distance[0]):
            raise ValueError("ClosestPoint surfaces have no point inside their loops: pass others")

    def __repr__(self) -> str:
        """Count surfaces and cells."""
        n = len(self.surfaces)
        return (
            f"ClosestPoint({n} surface{'s' * (n > 1)}, {int(self.closed.sum())} of closed bodies; "
            f"{len(self._shapes.cell):,} cells)"
        )

    def _build(self) -> None:
        sheets = Sheets()
        groups = self._groups_of_surfaces()
        for number, group in enumerate(groups):
            first = 0
            for i, surface in group.members:
                add_sheets(surface, sheets, Owner(group.frame, number, i, first))
                first += 0 if group.instances is None else len(surface)
        self._planes = np.array([
            (*s.origin, *s.unit_normal, i, s.moved + s.tilt + 2.0**-52)
            for i, s in enumerate(self.surfaces) if isinstance(s, Plane)
        ]).reshape(-1, 8)  # fmt: skip
        self._trims = make_table([surface for surface, _ in sheets.trimmed])
        add_edges(sheets, self._trims)
        self._shapes, group_of_cell = _cells(sheets, self._trims)
        lower, upper = np.empty((len(group_of_cell), 3)), np.empty((len(group_of_cell), 3))
        boxes_of_cells(self._shapes, self._shapes.cell, self._shapes.cell_id, lower, upper)
        error, of_sheet = self._shapes.sheet[:, ERROR], np.array(sheets.group, np.int64)
        trees, roots, n_nodes, n_cells, depth = [_no_tree()], [], 0, 0, 0
        boxes, moves, of_place, row_of = list[FloatArray](), [np.empty((0, 15))], [], []
        for number, group in enumerate(groups):
            rows = np.flatnonzero(group_of_cell == number)
            if not len(rows):
                continue
            nodes, links, order, waiting = build_tree(lower[rows], upper[rows], LEAF)
            begin = np.where(links[:, COUNT] > 0, n_cells, n_nodes).astype(np.int32)
            links[:, CHILD] += np.where(links[:, CHILD] >= 0, begin, 0)
            trees.append((nodes, links, rows[order].astype(np.int32)))
            roots.append(n_nodes)
            n_nodes, n_cells = n_nodes + len(nodes), n_cells + len(rows)
            depth = max(depth, waiting)
            box = np.stack([lower[rows].min(axis=0), upper[rows].max(axis=0)])
            for row, place in enumerate(
                _places(group, box, float(error[of_sheet == number].max()))
            ):
                moves.append(place[0][None])
                boxes.append(place[1])
                of_place.append(len(roots) - 1)
                row_of.append(-1 if group.instances is None else row)
        top, top_links, top_order, frame, waiting = _top_tree(np.array(boxes).reshape(-1, 2, 3))
        nodes, links, order = (np.concatenate(each) for each in zip(*trees, strict=True))
        self._groups = Groups(
            nodes, links, order, np.array(roots, np.int64), np.array(of_place, np.int64),
            np.concatenate(moves), top, top_links, top_order, frame, max(depth, waiting),
        )  # fmt: skip
        # Of each place its row; of each object how many patches a place has.
        self._row_of = np.array(row_of or [-1], np.int64)
        self._n_patches = np.array(
            [s.n_patches if isinstance(s, Instances) else 0 for s in self.surfaces], np.int64
        )

    def _groups_of_surfaces(self) -> list[Group]:
        """Return what has a frame, and a tree, of its own: all plain surfaces, and each `Instances`."""
        plain = [
            (i, s)
            for i, s in enumerate(self.surfaces)
            if s.is_bounded and not isinstance(s, Instances)
        ]
        groups = [Group(plain, None)] if plain else []
        return groups + [
            Group([(i, one) for one in s.surfaces], s)
            for i, s in enumerate(self.surfaces) if isinstance(s, Instances)
        ]  # fmt: skip

    def query(self, points: ArrayLike) -> ClosestRecord:
        """Find the closest point of each of n points.

        Parameters
        ----------
        points : (n, 3), (3,) or (h, w, 3) array-like
            Scene units, finite.

        Returns
        -------
        ClosestRecord of n rows
        """
        array = as_floats(points, "points")
        if array.ndim < 1 or array.shape[-1] != 3:
            raise ValueError(f"points has shape {array.shape}: pass (n, 3)")
        array = np.ascontiguousarray(array.reshape(-1, 3))
        for i in np.flatnonzero(~np.isfinite(array).all(axis=1))[:1]:
            raise ValueError(f"points[{i}] is {shown(array[i].tolist())}: pass finite numbers")
        for i in np.flatnonzero((np.abs(array) > LARGEST).any(axis=1))[:1]:
            raise ValueError(
                f"points[{i}] is {shown(array[i].tolist())}: pass numbers up to {LARGEST:g}"
            )
        return self._record(array, self._found(array))

    def _found(self, points: FloatArray) -> Answers:
        """Return what kernels find for points (n, 3)."""
        n = len(points)
        numbers, ids = np.empty((5, n)), np.empty((4, n), np.int64)
        several, on_edge = np.empty(n, np.bool_), np.empty(n, np.bool_)
        distance, least, error, u, v = numbers
        sheet, piece, place, thing = ids
        found = Answers(
            distance,
            least,
            error,
            several,
            u,
            v,
            np.empty((n, 3)),
            sheet,
            piece,
            place,
            thing,
            on_edge,
        )

        def work(begin: int, end: int) -> None:
            closest_points(
                self._shapes, self._trims, self._groups, self._planes, points[begin:end],
                Answers(*(column[begin:end] for column in found)),
            )  # fmt: skip

        self._pool.run(work, n)
        return found

    def _record(self, points: FloatArray, found: Answers) -> ClosestRecord:
        """Return what was found, with (u, v) across sheets, normals and sides."""
        # The last one is that of planes.
        spans = np.array([*self._shapes.sheet[:, SPAN : SPAN + 4], (0, 1, 0, 1)])[found.sheet]
        u, v = found.u.copy(), found.v.copy()
        on_sheet = found.sheet >= 0
        u = np.where(u == 1.0, spans[:, 1], spans[:, 0] + u * (spans[:, 1] - spans[:, 0]))
        v = np.where(v == 1.0, spans[:, 3], spans[:, 2] + v * (spans[:, 3] - spans[:, 2]))
        row = np.where(on_sheet, self._row_of[found.place], -1)
        patch = found.piece + np.maximum(row, 0) * self._n_patches[found.thing]
        normal = np.empty_like(points)
        on_edge = found.on_edge
        order = np.argsort(found.thing, kind="stable")
        ends = np.searchsorted(found.thing[order], np.arange(len(self.surfaces) + 1))
        for k in np.unique(found.thing).tolist():
            rows, surface = order[ends[k] : ends[k + 1]], self.surfaces[k]
            if isinstance(surface, Plane):
                at = found.position[rows][:, list(surface.axes)]
                u[rows], v[rows] = (at % 1.0).T
            normal[rows] = surface.normal(u[rows], v[rows], patch[rows])
            if surface.is_bounded:
                on_edge[rows] |= _at_border(surface, u[rows], v[rows])
        slack = SLACK * found.error
        loss = np.maximum(found.distance - found.least, 0.0)
        status = np.where(found.several, Closeness.SEVERAL, Closeness.UNIQUE)
        status = np.where(loss > SLACK * slack, Closeness.UNDECIDED, status).astype(np.uint8)
        bound = loss + found.error + 2.0**-52 * found.distance
        side = self._sides.of(
            points, found.position, normal, found.thing, found.distance, bound, on_edge
        )
        return ClosestRecord(
            np.where(side < 0, -found.distance, found.distance), bound, status, side,
            found.thing.astype(np.int32), patch.astype(np.int32), row.astype(np.int32), u, v,
            found.position, normal, on_edge,
        )  # fmt: skip


def closest_point(
    surfaces: Surface | Sequence[Surface],
    points: ArrayLike,
    *,
    closed: ArrayLike | None = None,
    threads: int | None = None,
) -> ClosestRecord:
    """Find the closest points of surfaces once; see `ClosestPoint`, which takes several batches."""
    return ClosestPoint(surfaces, closed=closed, threads=threads).query(points)


def _as_closed(closed: ArrayLike | None, surfaces: Sequence[Surface]) -> BoolArray:
    if closed is None:
        return np.array([is_closed(surface) for surface in surfaces], np.bool_)
    array = np.asarray(closed)
    if array.shape != (len(surfaces),) or array.dtype != np.bool_:
        raise ValueError(
            f"ClosestPoint closed is {shown(closed)}: pass True or False for each of {len(surfaces)} surfaces"
        )
    return array


def _at_border(surface: Surface, u: FloatArray, v: FloatArray) -> BoolArray:
    """Tell which points are on a border of the unit square that does not close."""
    closes_u, closes_v = surface.closes
    first, last = surface.poles
    at = np.zeros(len(u), np.bool_)
    if not closes_u:
        at |= (u <= AT_BORDER) | (u >= 1.0 - AT_BORDER)
    if not closes_v:
        at |= ((v <= AT_BORDER) & (not first)) | ((v >= 1.0 - AT_BORDER) & (not last))
    return at


def _cells(sheets: Sheets, trims: Any) -> tuple[Shapes, NDArray[np.int64]]:
    """Return all cells, and the group of each."""
    nets = np.concatenate([*sheets.nets, np.zeros((1, 4))])
    shapes = Shapes(
        np.empty((0, CELL_NUMBERS)), np.empty((0, CELL_INTEGERS), np.int64),
        np.array(sheets.number).reshape(-1, SHEET_NUMBERS),
        np.array(sheets.whole, np.int64).reshape(-1, SHEET_INTEGERS), nets,
    )  # fmt: skip
    cells = []
    edge = np.array(sheets.edge).reshape(-1, 2)
    edge_id = np.array(sheets.edge_id, np.int64).reshape(-1, 4)
    is_mesh = np.zeros(len(shapes.sheet), np.bool_)
    is_mesh[[first for first, _ in sheets.triangles]] = True
    of_sheets = partial(cells_of_sheets, shapes, trims, is_mesh)
    for make in (of_sheets, partial(cells_of_edges, shapes, edge, edge_id)):
        # Counted first.
        n = make(np.empty((0, CELL_NUMBERS)), np.empty((0, CELL_INTEGERS), np.int64))
        both = np.empty((n, CELL_NUMBERS)), np.empty((n, CELL_INTEGERS), np.int64)
        make(*both)
        cells.append(both)
    for sheet, corners in sheets.triangles:
        number = np.zeros((len(corners), CELL_NUMBERS))
        whole = np.zeros((len(corners), CELL_INTEGERS), np.int64)
        number[:, MIDDLE : MIDDLE + 3] = corners[:, 0]
        number[:, ALONG_U : ALONG_U + 3] = corners[:, 1] - corners[:, 0]
        number[:, ALONG_V : ALONG_V + 3] = corners[:, 2] - corners[:, 0]
        whole[:, KIND], whole[:, SHEET], whole[:, ARC] = TRIANGLE, sheet, np.arange(len(corners))
        whole[:, ARC] += shapes.sheet_id[sheet, 7]
        cells.append((number, whole))
    cell, cell_id = (np.concatenate(columns) for columns in zip(*cells, strict=True))
    return shapes._replace(cell=cell, cell_id=cell_id), np.array(sheets.group)[cell_id[:, SHEET]]


def _no_tree() -> tuple[NDArray[np.float32], NDArray[np.int32], NDArray[np.int32]]:
    none = np.empty((0, ROWS, WIDTH), np.float32)
    return none, none.view(np.int32), np.empty(0, np.int32)


def _places(group: Group, box: FloatArray, error: float) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield a row of `Groups.place` and a box in the world for each place of a group."""
    frame, matrices, scales = group.frame, np.eye(4)[None, :3], np.ones(1)
    if group.instances is not None:
        matrices, scales = group.instances.matrices, group.instances.scale
    corners = frame.unit * np.stack(np.meshgrid(*box.T), axis=-1).reshape(-1, 3)
    for matrix, scale in zip(matrices, scales.tolist(), strict=True):
        linear, unit = matrix[:, :3], scale * frame.unit
        shift, inverse = matrix[:, 3] + linear @ frame.centre, linear.T / scale**2
        off, own = float(np.abs(inverse @ linear - np.eye(3)).sum()), 0.0
        if group.instances is not None:
            terms = np.abs(matrix[:, 3]) + 4.0 * np.abs(linear) @ np.abs(frame.centre)
            own = 2.0**-52 * float(terms.sum()) / unit
        numbers = unit, error + own, MATRIX_SLACK * off
        there = shift + corners @ linear.T
        yield (
            np.array([*(inverse / frame.unit).ravel(), *shift, *numbers]),
            np.stack([there.min(axis=0), there.max(axis=0)]),
        )


def _top_tree(boxes: FloatArray) -> tuple[Any, ...]:
    """Return a tree over the boxes of places: nodes, links, order, frame, and how many may wait."""
    if not len(boxes):
        return *_no_tree(), np.array([0.0, 0.0, 0.0, 1.0]), WIDTH
    frame = Frame.about(box_around(boxes))
    rows, links, order, stack = build_tree(frame.place(boxes[:, 0]), frame.place(boxes[:, 1]), 1)
    return rows, links, order, np.array([*frame.centre, frame.unit]), stack
