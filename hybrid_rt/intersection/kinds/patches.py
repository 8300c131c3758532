"""Bezier patches of all objects: one frame, one table of cells, one bounding volume hierarchy."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.kernels.patch.cells import (
    FAN,
    HALF,
    MIDDLE_U,
    MIDDLE_V,
    ROW_U,
    ROW_V,
    fill_cells,
    fill_quarters,
)
from hybrid_rt.intersection.kernels.patch.finish import (
    aim_at_patches,
    count_changed,
    finish_patches,
    refine_patches,
)
from hybrid_rt.intersection.kernels.patch.rational_fan import bound_rational_bends
from hybrid_rt.intersection.kernels.patch.sheet import name_on_sheets
from hybrid_rt.intersection.kernels.patch.skew_box import COLUMN, LOWER, RECORD
from hybrid_rt.intersection.kernels.patch.trace import (
    MORE,
    PatchScratch,
    PatchTable,
    settle_doubts,
    trace_patches,
)
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits, CoarseTriangles, guess_cells
from hybrid_rt.intersection.kernels.search.counters import NEWTONS
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.tolerances import DEPTH, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree, new_stack
from hybrid_rt.intersection.kind import Finished, OneRow, Single, rows_of, widen_bounds
from hybrid_rt.intersection.kinds.closed_poles import closed_poles
from hybrid_rt.intersection.margins import Aim, Probes, Rows, Search
from hybrid_rt.intersection.members import frame_of
from hybrid_rt.intersection.sheets import Sheets
from hybrid_rt.intersection.trims import may_hold_hits, no_trim, trim_of, trimmed_of, whole_of
from meshing import BezierPatches, TrimmedSurface
from meshing.bezier import RationalPatches
from meshing.kernels.stored_calls import Returned, StoredCall
from meshing.sheet import PatchSheet

if TYPE_CHECKING:
    from hybrid_rt.intersection.coarse.proposals import Coarse

# Cells per side: enough that tangents hardly turn within one, few enough to stay in the cache; a
# cell takes 184 bytes and its share of the tree. Its quarters are asked where it turns too much.
COARSEST, FINEST = 1, 8
# Square of the normals' spread (tangent) above which a finer grid is worth its memory.
WIDE_SPREAD = 0.02
# Cells in all scenes of ordinary size stay below this; larger scenes get coarser grids.
MOST_CELLS = 4_000_000


# Columns of a record: middle and half sides in parameters.
_PLACE = [MIDDLE_U, MIDDLE_V, HALF, HALF + 1]
_NOT_MOVED = np.empty((0, 3))
_NO_CELLS, _NO_GUESS = np.empty(0, np.int32), np.empty(0)


class _Nets(NamedTuple):
    """Control nets of all patches, as in `PatchTable`."""

    control: FloatArray
    start: NDArray[np.int64]
    degree: NDArray[np.int64]
    centre: FloatArray
    rational: bool | None


class PatchKind:
    """First hits on Bezier patches, all polynomial or all rational.

    ``members``, sequence of (object id, BezierPatches, PatchSheet or TrimmedSurface of one of
    them): all of them rational, or none, and all of them trimmed, or none; else TypeError.
    ``pool``: shares the work of building.
    ``finest``: largest number of cells per side of a patch. 0: no cells and no hierarchy, so only
    `refine` and `finish` work.
    """

    def __init__(
        self,
        members: Sequence[tuple[int, BezierPatches | PatchSheet | TrimmedSurface]],
        pool: Pool,
        finest: int = FINEST,
    ) -> None:
        trimmed = trimmed_of(members)
        whole: list[tuple[int, Any]] = whole_of(members)
        surfaces: list[tuple[int, BezierPatches]] = [(i, surface.pieces) for i, surface in whole]
        self._sheets = Sheets.of(members)
        rational = True if isinstance(surfaces[0][1], RationalPatches) else None
        if any(isinstance(surface, RationalPatches) != bool(rational) for _, surface in surfaces):
            raise TypeError("polynomial and rational patches in one kind: pass each to its own")
        patches = [net for _, surface in surfaces for net in surface.patches]
        points = np.concatenate([net.reshape(-1, 3) for net in patches])
        degree = np.array([(net.shape[0] - 1, net.shape[1] - 1) for net in patches], np.int64)
        lengths = (degree + 1).prod(axis=1)
        start = np.concatenate([[0], lengths.cumsum()[:-1]]).astype(np.int64)
        counts = [len(surface) for _, surface in surfaces]
        middle, to_frame = frame_of(points.min(axis=0), points.max(axis=0))
        low = np.minimum.reduceat(points, start) - middle
        high = np.maximum.reduceat(points, start) - middle
        # Rounded to 20 bits, so that subtracting a centre loses nothing of ordinary figures; to more
        # where a patch is so small beside the frame that it would lie far from its centre.
        exponent = np.frexp((high - low).max(axis=1) * to_frame)[1]
        step = np.ldexp(2.0**-20, np.clip(exponent + 10, -32, 0))[:, None]
        centre = np.round(0.5 * (low + high) * to_frame / step) * step
        left = np.concatenate(
            [r.reshape(-1, 3) for _, surface in surfaces for r in surface.remainders]
        )
        control = _difference(points, left, middle, np.repeat(centre, lengths, axis=0), to_frame)
        size = np.sqrt(np.maximum.reduceat((control**2).sum(axis=1), start))
        bend = np.array(
            [(*_bend(net), *_fastest(net)) for net in _nets_of(control[:, :3], start, degree)]
        )
        if rational:
            weights = [s.homogeneous[:, 3] for _, s in surfaces if isinstance(s, RationalPatches)]
            control[:, 3] = np.concatenate(weights)
            control[:, :3] *= control[:, 3:]
            bound_rational_bends(control, start, degree, bend)
            # Weights that are sums are rounded: two sizes more in the sum of `rounding_of_root`.
            is_converted = np.repeat([s.remainder is not None for _, s in surfaces], counts)
            size[is_converted] *= 1.0 + 2.0 / (8.0 * degree[is_converted].sum(axis=1) + 2.0)
        nets = _Nets(control, start, degree, centre, rational)
        object_id = np.repeat(np.array([i for i, _ in surfaces], np.int32), counts)
        patch_id = np.concatenate([np.arange(n, dtype=np.int32) for n in counts])
        around = _around(surfaces, middle, to_frame, counts)
        homogeneous = control.copy()
        if not rational:
            homogeneous[:, 3] = 1.0
        poles = closed_poles(homogeneous, start.tolist(), degree.tolist(), centre, object_id)
        bend = np.hstack([bend, poles.reshape(len(bend), -1)])
        trim = None
        if trimmed:
            spans = [_spans(surface) for _, surface in whole]
            scale = np.column_stack([around[:, :3] - centre, around[:, 3]])
            trim = trim_of(trimmed, counts, np.concatenate(spans), to_frame, scale)
        self.table = PatchTable(
            middle=middle,
            to_frame=to_frame,
            control=control,
            rational=rational,
            start=start,
            degree=degree,
            centre=centre,
            size=size,
            around=around,
            bend=bend,
            object_id=object_id,
            patch_id=patch_id,
            trim=trim,
            **_cells(nets, max(finest, COARSEST), pool),
        )
        # What one compilation of rare code serves for all: it is told at run time what hot code knows.
        self._told = self.table._replace(rational=bool(rational), trim=trim or no_trim())
        # The sum of `rounding_of_root` has room for one rounding of a patch's size.
        moved = np.repeat([s.moved for _, s in surfaces], counts)
        self._moved = np.where(moved * to_frame > UNIT_ROUNDOFF * size, moved, 0.0)
        self._is_moved = bool(self._moved.any())
        self._widest, self._is_bicubic = int(degree.max()) + 1, bool((degree == 3).all())
        self._first_patch = np.full(int(object_id.max()) + 1, -1, np.int64)
        for (i, _), first in zip(surfaces, np.cumsum([0, *counts[:-1]]), strict=True):
            self._first_patch[i] = first
        if finest:
            self._build_search(pool)

    def _build_search(self, pool: Pool) -> None:
        """Fill the cells in the order of a tree over them, and their quarters."""
        t = self.table
        n = len(t.place)
        nets = _Nets(t.control, t.start, t.degree, t.centre, t.rational)
        record, boxes, cell_patch = _filled(nets, t.grid, t.first_cell, pool)
        kept = np.arange(n)
        if t.trim is not None:
            kept = np.flatnonzero(may_hold_hits(t.trim, record[:, _PLACE], cell_patch))
        self.tree = Tree(*build_tree(boxes[kept, :3].copy(), boxes[kept, 3:].copy(), 1))
        # Cells that are wholly trimmed away come last, and in no node of the tree.
        order = np.concatenate([kept[self.tree.order], np.setdiff1d(np.arange(n), kept)])
        t.record[:n], t.cell_patch[:n] = record[order], cell_patch[order]
        t.place[order] = np.arange(n, dtype=np.int32)
        if len(t.record) > n:

            def quarter(begin: int, end: int) -> None:
                fill_quarters(
                    *nets, t.record[:n], t.cell_patch[:n], begin, end, t.record[n:],
                    t.cell_patch[n:],
                )  # fmt: skip

            pool.run(quarter, n)

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the first roots on the patches."""
        cells = np.empty(0, np.int32) if guess is None else guess
        t_guess, t_before = np.empty(len(cells)), best.t[: len(cells)].copy()
        self._trace(rays, _NOT_MOVED, cells, best, any_hit, t_guess, work)
        if guess is not None:
            count_changed(t_guess, t_before, best, work)

    def _trace(
        self,
        rays: Rays,
        aside: FloatArray,
        cells: IntArray,
        best: Nearest,
        any_hit: bool,
        t_guess: FloatArray,
        work: FloatArray,
    ) -> None:
        """Trace rays, moved by ``aside`` in lengths of the frame; the rest is as in the kernel."""
        scratch = self._new_scratch(len(best.t))
        begin, n = 0, len(best.t)
        while begin < n:
            some, nearest = rows_of(rays, begin, n), rows_of(best, begin, n)
            done, n_doubts = trace_patches(
                self.table, self.tree, some, aside[begin:], cells[begin:], nearest, any_hit,
                scratch, t_guess[begin:], work,
            )  # fmt: skip
            if n_doubts:
                settle_doubts(
                    self._told, some, aside[begin:], nearest, any_hit, scratch, n_doubts, work
                )
            begin += done

    def guesses(self, coarse: Coarse, hits: CoarseHits) -> IntArray:
        """Return the cell of each coarse hit, -1 where there is none on a patch."""
        guess = np.empty(len(hits.face), np.int32)
        guess_cells(
            hits, coarse.triangles, self._first_of(coarse),
            self.table.grid, self.table.first_cell, self.table.place, guess,
        )  # fmt: skip
        return guess

    def refine(
        self,
        coarse: Coarse,
        hits: CoarseHits,
        rows: NDArray[np.int64],
        rays: Rays,
        best: Nearest,
        accepted: BoolArray,
    ) -> None:
        """Refine coarse hits on their patches by Newton iteration; lower ``best`` to them."""
        accepted |= self._refine(
            hits, coarse.triangles, self._first_of(coarse), rows, rays, _NOT_MOVED, best
        )

    def _refine(
        self,
        hits: CoarseHits,
        triangles: CoarseTriangles,
        first: NDArray[np.int64],
        rows: NDArray[np.int64],
        rays: Rays,
        aside: FloatArray,
        best: Nearest,
    ) -> BoolArray:
        """Refine hits on triangles for rays moved by ``aside``, world; return which were accepted."""
        accepted = np.zeros(len(rows), np.bool_)
        refine_patches(
            self._told, hits, triangles, first, rows, rays, self.table.to_frame * aside, best,
            self._new_basis(), accepted,
        )  # fmt: skip
        return accepted

    @property
    def frame(self) -> float:
        """Size of all patches, world units."""
        return 1.0 / self.table.to_frame

    def aim(self, rays: Rays, best: Nearest, out: Finished, rows: Rows) -> Aim:
        """Return where to displace rays whose hits are in doubt."""
        n = len(rows)
        aim = Aim(np.empty(n), np.empty((n, 3)), np.empty(n, np.bool_))
        aim_at_patches(self._told, rays, best, out, rows, self._new_basis(), *aim)
        return aim

    @property
    def searches(self) -> tuple[Search, Search]:
        """Newton from the hit, then the search."""
        return self._follow, self._search

    def _follow(self, probes: Probes, nearest: Nearest, work: FloatArray) -> None:
        # A point stands for a triangle, of which the first corner counts.
        before, rows, table = probes.before, probes.rows, self.table
        k, m = before.primitive[rows], len(rows)
        corners = np.repeat(np.column_stack([before.a[rows], before.b[rows]])[:, None], 3, axis=1)
        points = CoarseTriangles(
            np.empty((0, 3)), np.empty((0, 3), np.int64), table.object_id[k], table.patch_id[k],
            corners,
        )  # fmt: skip
        starts = CoarseHits(np.arange(m, dtype=np.int32), before.t[rows], np.zeros(m), np.zeros(m))
        self._refine(
            starts, points, self._first_patch, np.arange(m), probes.rays, probes.aside, nearest
        )
        work[NEWTONS] += m

    def _search(self, probes: Probes, nearest: Nearest, work: FloatArray) -> None:
        moves = self.table.to_frame * probes.aside
        self._trace(probes.rays, moves, _NO_CELLS, nearest, False, _NO_GUESS, work)

    def _new_basis(self) -> FloatArray:
        """Return scratch for Bernstein polynomials."""
        return np.empty((4, self._widest))

    def _new_scratch(self, n_rays: int) -> PatchScratch:
        """Return scratch for one call of `trace_patches`."""
        widest = self._widest
        return PatchScratch(
            basis=None if self._is_bicubic else self._new_basis(),
            nets=np.empty((DEPTH, widest, widest, 4)),
            room=np.empty((widest, widest, 3)),
            boxes=np.empty((DEPTH, 4)),
            stack=new_stack(self.tree, MORE),
            # Room for every record once, by one ray; memory that is not touched costs nothing.
            queue=np.empty((len(self.table.record) + n_rays, 2), np.int32),
        )

    def _first_of(self, coarse: Coarse) -> NDArray[np.int64]:
        """Return for each object its first patch here, -1 for objects of other kinds."""
        first = np.full(coarse.n_objects, -1, np.int64)
        first[: len(self._first_patch)] = self._first_patch
        return first

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe the hits that are on patches."""
        finish_patches(self._told, rays, best, kind_of, kind, self._new_basis(), out)
        if self._is_moved:
            widen_bounds(self._moved, rays, best, kind_of, kind, out)
        if self._sheets is not None:
            self._sheets.finish(best.object_id, out)

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        rays, best, out, work = ray
        scratch = self._new_scratch(1)
        found: list[list[StoredCall]] = []
        for any_hit in (False, True):
            search = StoredCall(
                trace_patches, self.table, self.tree, rays, _NOT_MOVED, _NO_CELLS, best, any_hit,
                scratch, _NO_GUESS, work,
            )  # fmt: skip
            doubts = Returned(search, 1)
            settle = StoredCall(
                settle_doubts, self._told, rays, _NOT_MOVED, best, any_hit, scratch, doubts, work,
                only_if=doubts,
            )  # fmt: skip
            found.append([search, settle])
        basis = self._new_basis()
        describe = [StoredCall(finish_patches, self._told, rays, best, kind_of, kind, basis, out)]
        if self._sheets is not None:
            named = self._sheets.arguments(best.object_id, out)
            describe.append(StoredCall(name_on_sheets, *named))
        return Single(found[0], found[1], describe)


def _difference(
    points: FloatArray, left: FloatArray, middle: FloatArray, centre: FloatArray, to_frame: float
) -> FloatArray:
    """(points + left - middle) to_frame - centre with two roundings; and a column of zeros."""
    high = points - middle
    z = high - points
    low = (points - (high - z)) - (middle + z)
    net = np.zeros((len(points), 4))
    net[:, :3] = (high * to_frame - centre) + (low + left) * to_frame
    return net


def _nets_of(
    control: FloatArray, start: NDArray[np.int64], degree: NDArray[np.int64]
) -> list[FloatArray]:
    shapes = (degree + 1).tolist()
    pieces = np.split(control, start[1:])
    return [piece.reshape(*shape, 3) for piece, shape in zip(pieces, shapes, strict=True)]


def _cells(nets: _Nets, finest: int, pool: Pool) -> dict[str, NDArray[np.generic]]:
    """Choose each patch's grid: from one cell up, halved while its normals spread widely."""
    k = len(nets.start)
    while finest > COARSEST and k * finest * finest > MOST_CELLS:
        finest //= 2
    grid = np.full((k, 2), COARSEST, np.int64)
    wide = np.arange(k)
    side = COARSEST
    while True:
        # Patches still wide get the finer grid; all others keep theirs.
        first = np.concatenate([[0], grid.prod(axis=1).cumsum()[:-1]]).astype(np.int64)
        if side >= finest or not len(wide):
            break
        record, _, _ = _filled(nets, grid, first, pool)
        worst = np.maximum.reduceat(_spread(record), first)
        wide = np.flatnonzero(worst > WIDE_SPREAD)
        side *= 2
        grid[wide] = side
    n = int(grid.prod(axis=1).sum())
    n_quarters = 4 * n if finest > COARSEST and 4 * n <= MOST_CELLS else 0
    return {
        "grid": grid,
        "first_cell": first,
        "place": np.empty(n, np.int32),
        "record": _aligned(n + n_quarters),
        "cell_patch": np.empty(n + n_quarters, np.uint32),
    }


def _filled(
    nets: _Nets, grid: NDArray[np.int64], first: NDArray[np.int64], pool: Pool
) -> tuple[FloatArray, FloatArray, NDArray[np.uint32]]:
    """Return the records of all cells, boxes around them, and their patches."""
    n = int(grid.prod(axis=1).sum())
    record, boxes, cell_patch = np.empty((n, RECORD)), np.empty((n, 6)), np.empty(n, np.uint32)

    def work(begin: int, end: int) -> None:
        fill_cells(*nets, grid, first, begin, end, record, boxes, cell_patch)

    pool.run(work, len(nets.start))
    return record, boxes, cell_patch


def _aligned(n: int) -> FloatArray:
    """Return n records, each on lines of the cache of its own."""
    room = np.empty(n * RECORD + 7)
    first = -(room.ctypes.data // 8) % 8
    return room[first : first + n * RECORD].reshape(n, RECORD)


def _spread(record: FloatArray) -> FloatArray:
    """Square of how far the normals of each cell spread; inf where nothing is known."""
    width_u = record[:, FAN] ** 2 * (record[:, ROW_U:LOWER:COLUMN] ** 2).sum(axis=1)
    width_v = record[:, FAN + 1] ** 2 * (record[:, ROW_V:LOWER:COLUMN] ** 2).sum(axis=1)
    return np.asarray(width_u + width_v)


def _around(
    surfaces: Sequence[tuple[int, BezierPatches]],
    middle: FloatArray,
    to_frame: float,
    counts: Sequence[int],
) -> FloatArray:
    """Return the middle of each patch's object and the diameter of its box, (k, 4)."""
    bounds = np.array([surface.bounds for _, surface in surfaces])
    low, high = (bounds[:, 0] - middle) * to_frame, (bounds[:, 1] - middle) * to_frame
    size = np.linalg.norm(high - low, axis=1, keepdims=True)
    return np.repeat(np.hstack([0.5 * (low + high), size]), counts, axis=0)


def _spans(surface: BezierPatches | PatchSheet) -> FloatArray:
    """Return u0, u1, v0, v1 of each patch on its surface, (k, 4)."""
    return np.array([(0.0, 1.0, 0.0, 1.0)]) if surface.spans is None else surface.spans


def _bend(net: FloatArray) -> tuple[float, float, float]:
    """Bound the lengths of S_uu, S_uv and S_vv by the differences of a net."""
    m, n = net.shape[0] - 1, net.shape[1] - 1
    along_u, along_v = np.diff(net, axis=0), np.diff(net, axis=1)
    return (
        m * (m - 1) * _longest(np.diff(along_u, axis=0)),
        m * n * _longest(np.diff(along_u, axis=1)),
        n * (n - 1) * _longest(np.diff(along_v, axis=1)),
    )


def _fastest(net: FloatArray) -> tuple[float, float]:
    """Squares of the lengths of the longest differences along u and v, times the degrees."""
    m, n = net.shape[0] - 1, net.shape[1] - 1
    return (m * _longest(np.diff(net, axis=0))) ** 2, (n * _longest(np.diff(net, axis=1))) ** 2


def _longest(vectors: FloatArray) -> float:
    return float(np.linalg.norm(vectors, axis=-1).max(initial=0.0))
