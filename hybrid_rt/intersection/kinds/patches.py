"""Bezier patches of all objects: a frame and a bounding volume hierarchy of cells for those of a size and place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
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
from hybrid_rt.intersection.kernels.patch.sheet import name_on_sheets, name_parts
from hybrid_rt.intersection.kernels.patch.skew_box import COLUMN, LOWER, RECORD
from hybrid_rt.intersection.kernels.patch.trace import (
    MORE,
    PatchScratch,
    PatchTable,
    settle_doubts,
    trace_patches,
)
from hybrid_rt.intersection.kernels.search.bottoms import rows_near
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits, CoarseTriangles, guess_cells
from hybrid_rt.intersection.kernels.search.counters import NEWTONS
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kernels.search.tolerances import DEPTH, UNIT_ROUNDOFF
from hybrid_rt.intersection.kernels.search.tree import Tree, build_tree, new_stack
from hybrid_rt.intersection.kind import Finished, OneRow, Single, bottom, rows_of, widen_bounds
from hybrid_rt.intersection.kinds.closed_poles import closed_poles
from hybrid_rt.intersection.margins import Aim, Probes, Rows, Search
from hybrid_rt.intersection.members import (
    MOST_TREES,
    SMALL_PART,
    box_of,
    frame_of,
    in_frames,
)
from hybrid_rt.intersection.ray_batch import locked
from hybrid_rt.intersection.sheets import Sheets
from hybrid_rt.intersection.trims import may_hold_hits, no_trim, trim_of, trimmed_of, whole_of
from meshing import BezierPatches, TrimmedSurface
from meshing.bezier import RationalPatches
from meshing.kernels.stored_calls import Returned, StoredCall
from meshing.sheet import PatchSheet
from meshing.surface import box_around

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


class _Part(NamedTuple):
    """The patches that share a frame: the rows of a `PatchTable` are those of all patches."""

    table: PatchTable  # its frame and cells are those of the part
    told: PatchTable  # the same for rare code, which is told at run time what hot code knows
    tree: Any  # Tree; None without a search
    box: FloatArray  # (2, 3), see `box_of`; without a search nothing


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
        boxes = np.stack(
            [reduceat(points, start) for reduceat in (np.minimum.reduceat, np.maximum.reduceat)],
            axis=1,
        )
        groups = in_frames(boxes, SMALL_PART, MOST_TREES)
        self._group = np.zeros(len(boxes), np.int64)
        for number, rows in enumerate(groups):
            self._group[rows] = number
        frames = [frame_of(*box_around(boxes[rows])) for rows in groups]
        # One frame stands for all patches, else each has its own.
        of_patch = self._group if len(groups) > 1 else np.zeros(1, np.int64)
        of_point = np.repeat(self._group, lengths) if len(groups) > 1 else of_patch
        middle = np.array([frame[0] for frame in frames])
        to_frame = np.array([frame[1] for frame in frames])[:, None]
        low, high = (side - middle[of_patch] for side in np.swapaxes(boxes, 0, 1))
        # Rounded to 20 bits, so that subtracting a centre loses nothing of ordinary figures; to more
        # where a patch is so small beside the frame that it would lie far from its centre.
        exponent = np.frexp((high - low).max(axis=1) * to_frame[of_patch, 0])[1]
        step = np.ldexp(2.0**-20, np.clip(exponent + 10, -32, 0))[:, None]
        centre = np.round(0.5 * (low + high) * to_frame[of_patch] / step) * step
        left = np.concatenate(
            [r.reshape(-1, 3) for _, surface in surfaces for r in surface.remainders]
        )
        control = _difference(
            points, left, middle[of_point], np.repeat(centre, lengths, axis=0), to_frame[of_point]
        )
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
        owner = np.repeat(np.arange(len(counts)), counts) * len(groups) + self._group
        bounds = np.concatenate([surface.patch_bounds for _, surface in surfaces])
        around = _around(bounds, owner, middle[of_patch], to_frame[of_patch])
        homogeneous = control.copy()
        if not rational:
            homogeneous[:, 3] = 1.0
        poles = closed_poles(homogeneous, start.tolist(), degree.tolist(), centre, owner)
        bend = np.hstack([bend, poles.reshape(len(bend), -1)])
        trim = None
        if trimmed:
            spans = [_spans(surface) for _, surface in whole]
            scale = np.column_stack([around[:, :3] - centre, around[:, 3]])
            trim = trim_of(trimmed, counts, np.concatenate(spans), to_frame[of_patch, 0], scale)
        grid, first_cell = _grids(nets, max(finest, COARSEST), pool)
        table = PatchTable(
            middle=middle[0],
            to_frame=float(to_frame[0, 0]),
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
            grid=grid,
            first_cell=first_cell,
            place=np.empty(int(grid.prod(axis=1).sum()), np.int32),
            record=np.empty((0, RECORD)),
            cell_patch=np.empty(0, np.uint32),
            trim=trim,
        )
        self.table = table
        # The sum of `rounding_of_root` has room for one rounding of a patch's size.
        moved = np.repeat([s.moved for _, s in surfaces], counts)
        self._moved = np.where(moved * to_frame[of_patch, 0] > UNIT_ROUNDOFF * size, moved, 0.0)
        self._is_moved = bool(self._moved.any())
        self._widest, self._is_bicubic = int(degree.max()) + 1, bool((degree == 3).all())
        self._first_patch = np.full(int(object_id.max()) + 1, -1, np.int64)
        for (i, _), first in zip(surfaces, np.cumsum([0, *counts[:-1]]), strict=True):
            self._first_patch[i] = first
        tables = [table._replace(middle=m, to_frame=scale) for m, scale in frames]
        trees = [None] * len(tables)
        if finest:
            tables, trees = self._build_search(nets, tables, finest, pool)
        self._parts = [
            _Part(
                t,
                t._replace(rational=bool(rational), trim=trim or no_trim()),
                tree,
                box_of(tree, t.middle, t.to_frame) if tree else np.empty((0, 3)),
            )
            for t, tree in zip(tables, trees, strict=True)
        ]

    def _build_search(
        self, nets: _Nets, tables: list[PatchTable], finest: int, pool: Pool
    ) -> tuple[list[PatchTable], list[Any]]:
        """Return the tables with their cells, in the order of trees over them, and quarters; and the trees."""
        place, trim, begin = self.table.place, self.table.trim, 0
        record, boxes, cell_patch = _filled(nets, self.table.grid, self.table.first_cell, pool)
        keeps = np.ones(len(place), np.bool_)
        if trim is not None:
            keeps = may_hold_hits(trim, record[:, _PLACE], cell_patch)
        is_quartered = finest > COARSEST and 4 * len(place) <= MOST_CELLS
        group = self._group[cell_patch]
        in_groups, trees = np.argsort(group, kind="stable"), list[Any]()
        ends = np.searchsorted(group[in_groups], np.arange(1, len(tables)))
        for number, cells in enumerate(np.split(in_groups, ends)):
            # A tree of nothing cannot be built.
            kept = cells[keeps[cells]] if keeps[cells].any() else cells[:1]
            tree = Tree(*build_tree(boxes[kept, :3].copy(), boxes[kept, 3:].copy(), 1))
            # Cells that are wholly trimmed away come last, and in no node of the tree.
            order = np.concatenate([kept[tree.order], np.setdiff1d(cells, kept)])
            n = len(order)
            own = _aligned(5 * n if is_quartered else n)
            patch = np.empty(len(own), np.uint32)
            own[:n], patch[:n] = record[order], cell_patch[order]
            place[order] = np.arange(begin, begin + n, dtype=np.int32)
            if is_quartered:
                pool.run(_quarters(nets, own, patch, n), n)
            tables[number] = tables[number]._replace(
                place=place[begin : begin + n], record=own, cell_patch=patch
            )
            trees.append(tree)
            begin += n
        return tables, trees

    def trace(
        self, rays: Rays, guess: IntArray | None, best: Nearest, any_hit: bool, work: FloatArray
    ) -> None:
        """Lower ``best`` to the first roots on the patches."""
        cells = np.empty(0, np.int32) if guess is None else guess
        t_guess, t_before = np.full(len(cells), np.inf), best.t[: len(cells)].copy()
        begin = 0
        for part in self._parts:
            own, end = cells, begin + len(part.table.place)
            if len(self._parts) > 1:
                is_own = (begin <= cells) & (cells < end)
                own = np.where(is_own, cells - begin, -1).astype(np.int32)
            t_part = np.full(len(cells), np.inf)
            self._trace(part, rays, _NOT_MOVED, own, best, any_hit, t_part, work)
            np.minimum(t_guess, t_part, out=t_guess)
            begin = end
        if guess is not None:
            count_changed(t_guess, t_before, best, work)

    def _trace(
        self,
        part: _Part,
        rays: Rays,
        aside: FloatArray,
        cells: IntArray,
        best: Nearest,
        any_hit: bool,
        t_guess: FloatArray,
        work: FloatArray,
    ) -> None:
        """Trace rays, moved by ``aside``, world, through one part; the rest is as in the kernel."""
        scratch = self._new_scratch(part, len(best.t))
        begin, n, aside = 0, len(best.t), part.table.to_frame * aside
        while begin < n:
            some, nearest = rows_of(rays, begin, n), rows_of(best, begin, n)
            done, n_doubts = trace_patches(
                part.table, part.tree, some, aside[begin:], cells[begin:], nearest, any_hit,
                scratch, t_guess[begin:], work,
            )  # fmt: skip
            if n_doubts:
                settle_doubts(
                    part.told, some, aside[begin:], nearest, any_hit, scratch, n_doubts, work
                )
            begin += done

    def _by_part(self, patches: NDArray[Any]) -> list[tuple[_Part, Rows]]:
        """Return the parts in which some patches are, and the rows of each."""
        if len(self._parts) == 1:
            return [(self._parts[0], np.arange(len(patches)))]
        group = self._group[patches]
        return [(self._parts[g], np.flatnonzero(group == g)) for g in np.unique(group)]

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
        first_patch = first[triangles.object_id[hits.face]]
        here = np.flatnonzero(first_patch >= 0)
        for part, some in self._by_part(first_patch[here] + triangles.piece[hits.face[here]]):
            k = here[some]
            taken = np.zeros(len(k), np.bool_)
            refine_patches(
                part.told, CoarseHits(*(x[k] for x in hits)), triangles, first, rows[k], rays,
                part.table.to_frame * aside, best, self._new_basis(), taken,
            )  # fmt: skip
            accepted[k] = taken
        return accepted

    def aim(self, rays: Rays, best: Nearest, out: Finished, rows: Rows) -> Aim:
        """Return where to displace rays whose hits are in doubt."""
        n = len(rows)
        aim = Aim(np.empty(n), np.empty((n, 3)), np.empty(n, np.bool_), np.empty(n))
        for part, some in self._by_part(best.primitive[rows]):
            m, basis = len(some), self._new_basis()
            own = np.empty(m), np.empty((m, 3)), np.empty(m, np.bool_)
            aim_at_patches(part.told, rays, best, out, rows[some], basis, *own)
            aim.band[some], aim.outward[some], aim.is_edge[some] = own
            aim.frame[some] = 1.0 / part.table.to_frame
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
        rows = np.arange(len(nearest.t))
        for part in self._parts:
            some, rays, found = rows, probes.rays, nearest
            if len(self._parts) > 1:
                # The margin is wider than the band by far: it holds for rays that are moved.
                some = np.empty_like(rows)
                some = some[: rows_near(part.box, rays, nearest, some)]
                rays = Rays(*(x[some] if len(x) else x for x in rays))
                rays = rays._replace(origin=locked(rays.origin))
                found = Nearest(*(x[some] for x in nearest))
            self._trace(part, rays, probes.aside[some], _NO_CELLS, found, False, _NO_GUESS, work)
            if found is not nearest:
                for column, values in zip(nearest, found, strict=True):
                    column[some] = values

    def _new_basis(self) -> FloatArray:
        """Return scratch for Bernstein polynomials."""
        return np.empty((4, self._widest))

    def _new_scratch(self, part: _Part, n_rays: int) -> PatchScratch:
        """Return scratch for one call of `trace_patches`."""
        widest = self._widest
        return PatchScratch(
            basis=None if self._is_bicubic else self._new_basis(),
            nets=np.empty((DEPTH, widest, widest, 4)),
            room=np.empty((widest, widest, 3)),
            boxes=np.empty((DEPTH, 4)),
            stack=new_stack(part.tree, MORE),
            # Room for every record once, by one ray; memory that is not touched costs nothing.
            queue=np.empty((len(part.table.record) + n_rays, 2), np.int32),
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
        if len(self._parts) == 1:
            told = self._parts[0].told
            finish_patches(told, rays, best, kind_of, kind, self._new_basis(), out)
        else:
            own = best._replace(object_id=np.empty_like(best.object_id))
            name_parts(best, kind_of, kind, self._group, own.object_id)
            for g in np.unique(own.object_id[own.object_id >= 0]):
                told, numbers = self._parts[g].told, self._numbers
                finish_patches(told, rays, own, numbers, int(g), self._new_basis(), out)
        if self._is_moved:
            widen_bounds(self._moved, rays, best, kind_of, kind, out)
        if self._sheets is not None:
            self._sheets.finish(best.object_id, out)

    @property
    def _numbers(self) -> IntArray:
        """Numbers of parts, in place of kinds of objects: see `name_parts`."""
        return np.arange(len(self._parts), dtype=np.int32)

    def single(self, ray: OneRow, kind_of: IntArray, kind: int) -> Single:
        """See `hybrid_rt.intersection.kind.Kind.single`."""
        rays, best, out, work = ray

        def calls(part: _Part, any_hit: bool) -> list[StoredCall]:
            scratch = self._new_scratch(part, 1)
            search = StoredCall(
                trace_patches, part.table, part.tree, rays, _NOT_MOVED, _NO_CELLS, best, any_hit,
                scratch, _NO_GUESS, work,
            )  # fmt: skip
            doubts = Returned(search, 1)
            settle = StoredCall(
                settle_doubts, part.told, rays, _NOT_MOVED, best, any_hit, scratch, doubts, work,
                only_if=doubts,
            )  # fmt: skip
            return [search, settle]

        bottoms = [bottom(part.box, partial(calls, part)) for part in self._parts]
        basis, own, describe = self._new_basis(), best, list[StoredCall]()
        if len(self._parts) > 1:
            own = best._replace(object_id=np.empty(1, np.int32))
            name = StoredCall(name_parts, best, kind_of, kind, self._group, own.object_id)
            kind_of, describe = self._numbers, [name]
        describe += [
            StoredCall(
                finish_patches, part.told, rays, own, kind_of, g if own is not best else kind,
                basis, out,
            )
            for g, part in enumerate(self._parts)
        ]  # fmt: skip
        if self._sheets is not None:
            named = self._sheets.arguments(best.object_id, out)
            describe.append(StoredCall(name_on_sheets, *named))
        return Single(bottoms, describe)

    @property
    def n_trees(self) -> int:
        """Number of trees."""
        return len(self._parts)


def _difference(
    points: FloatArray,
    left: FloatArray,
    middle: FloatArray,
    centre: FloatArray,
    to_frame: FloatArray,
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


def _grids(nets: _Nets, finest: int, pool: Pool) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Choose each patch's grid: from one cell up, halved while its normals spread widely.

    Returns ``grid`` and ``first_cell`` as in `PatchTable`.
    """
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
    return grid, first


def _quarters(
    nets: _Nets, record: FloatArray, cell_patch: NDArray[np.uint32], n: int
) -> Callable[[int, int], None]:
    """Return what fills the quarters of some of n cells, behind all of them."""

    def work(begin: int, end: int) -> None:
        fill_quarters(
            *nets, record[:n], cell_patch[:n], begin, end, record[n:], cell_patch[n:]
        )  # fmt: skip

    return work


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
    bounds: FloatArray, owner: NDArray[np.int64], middle: FloatArray, to_frame: FloatArray
) -> FloatArray:
    """Return for each patch the middle and the diameter of the box around all that have its ``owner``, (k, 4)."""
    _, row = np.unique(owner, return_inverse=True)
    low, high = np.full((2, int(row.max()) + 1, 3), np.inf)
    np.minimum.at(low, row, bounds[:, 0])
    np.minimum.at(high, row, -bounds[:, 1])
    low, high = (low[row] - middle) * to_frame, (-high[row] - middle) * to_frame
    size = np.linalg.norm(high - low, axis=1, keepdims=True)
    return np.hstack([0.5 * (low + high), size])


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
