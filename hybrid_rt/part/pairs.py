"""Branch and bound over pairs of cells: the least chord between two walls, proven.

A chord joins a point p of one cell with a point q of another, p - q = t n with n an outward normal. Where t is
least within both faces, both normals are along the chord. On borders only one, or none, need be. So there are
four kinds of pairs, and every local minimum is in one of them:

* BOTH: the chord is along both normals (of a re-entrant edge: along one between those of its faces);
* FIRST: it is along the normal of the first cell, and meets the second one within ``angle`` of its normal;
* TOUCHING: a ball touches both, its contacts at least 180 degrees less ``angle`` apart;
* ANY: nothing is asked.

With S = core + rho n a chord along both normals has t = (core_p - core_q) n + rho_p + rho_q. So walls of constant
thickness, as tubes and shells have, are proven at once.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.part.cells import Cells, Ints

BOTH, FIRST, TOUCHING, ANY = range(4)
# Pairs that are halved at once, and those of which the value is computed.
BATCH, TRIED = 40_000, 400
# Pairs compared at once by their boxes.
PAIRED = 4_000_000
# Numbers are rounded, over the size of the part; normals, and angles.
ROUNDED, TILTED = 1e-12, 1e-9
# Of faces that meet, cells are halved down to this part of the size.
MEETING = 1e-6
# Cells smaller than this part of the size are no longer halved.
SMALLEST = 1e-10


@dataclass
class Found:
    """What a search has found.

    Attributes
    ----------
    value : float
        The least that was found; inf: none.
    bound : float
        Proven: no value is below it.
    place : (2, 3) ends of the chord
    faces : pair of int
    touching : dict
        By pair of faces: where they come so near to each other that it counts as 0.
    is_proven : bool
        Whether the search has ended within the tolerance.
    """

    value: float = np.inf
    bound: float = 0.0
    place: FloatArray = field(default_factory=lambda: np.full((2, 3), np.nan))
    faces: tuple[int, int] = (-1, -1)
    touching: dict[tuple[int, int], FloatArray] = field(default_factory=dict)
    is_proven: bool = False
    n_pairs: int = 0
    seconds: float = 0.0

    def take(self, values: FloatArray, places: FloatArray, faces: Ints) -> None:
        """Keep the least of some values, with its place (2, 3) and its two faces."""
        if len(values) and values.min() < self.value:
            k = int(values.argmin())
            self.value, self.place = float(values[k]), places[k]
            self.faces = int(faces[k, 0]), int(faces[k, 1])


# Of pairs of cells (first, second, kind): values, places and faces of real chords, inf where there is none.
Values = Callable[[Ints, Ints, Ints], tuple[FloatArray, FloatArray, Ints]]


class PairSearch:
    """Finds the least chord between cells.

    Parameters
    ----------
    cells : Cells
    size : float
        Of the part: rounding is relative to it.
    angle : float
        Radians, see the module.
    sign : float
        1: chords inside the material; -1: outside.
    zero : float
        Pairs of faces that come nearer than this count as touching, and no further; 0: none does.
    """

    def __init__(
        self, cells: Cells, size: float, angle: float, *, sign: float = 1.0, zero: float = 0.0
    ) -> None:
        self.cells, self.size, self.angle, self.sign, self.zero = cells, size, angle, sign, zero

    def near(self, first: Ints, second: Ints, reach: float) -> tuple[Ints, Ints]:
        """Return pairs of cells whose boxes are within reach of each other."""
        low, high = self._boxes(first)
        low_2, high_2 = self._boxes(second)
        rows = max(PAIRED // max(len(second), 1), 1)
        found = [(np.empty(0, np.int64), np.empty(0, np.int64))]
        for k in range(0, len(first), rows):
            part = slice(k, k + rows)
            is_near = np.ones((len(low[part]), len(second)), np.bool_)
            for axis in range(3):
                is_near &= low[part, axis, None] <= high_2[:, axis] + reach
                is_near &= high[part, axis, None] >= low_2[:, axis] - reach
            i, j = np.nonzero(is_near)
            found.append((first[part][i], second[j]))
        a, b = zip(*found, strict=True)
        return np.concatenate(a), np.concatenate(b)

    def _boxes(self, cells: Ints) -> tuple[FloatArray, FloatArray]:
        corners = self.cells.corners[cells].reshape(-1, 4, 3)
        eps = self.cells.eps[cells]
        return corners.min(axis=1) - eps, corners.max(axis=1) + eps

    def least(
        self, pairs: tuple[Ints, Ints, Ints], found: Found, values: Values, tolerance: float, deadline: float,
        skips: Callable[[Ints, Ints, Ints], BoolArray] | None = None,
    ) -> Found:  # fmt: skip
        """Search all of some pairs (first, second, kind); ``found`` may hold a value to begin with."""
        began = time.perf_counter()
        a, b, kind = pairs
        lower, alive = self._bounds(a, b, kind, found.value)
        a, b, kind, lower = a[alive], b[alive], kind[alive], lower[alive]
        floor = np.inf
        while len(a):
            found.n_pairs += len(a)
            a, b, kind, lower = self._without_touching(a, b, kind, lower, found)
            over = lower >= found.value - tolerance
            floor = min(floor, float(lower[over].min(initial=np.inf)))
            a, b, kind, lower = a[~over], b[~over], kind[~over], lower[~over]
            if not len(a) or time.perf_counter() > deadline:
                break
            order = np.argsort(lower, kind="stable")
            some = order[:TRIED]
            before = found.value
            found.take(*values(a[some], b[some], kind[some]))
            if found.value < before:
                continue
            some, rest = order[:BATCH], order[BATCH:]
            big = np.maximum(self.cells.radius[a[some], 0], self.cells.radius[b[some], 0])
            if (big < SMALLEST * self.size).any():
                stuck = some[big < SMALLEST * self.size]
                floor = min(floor, float(lower[stuck].min()))
                some = some[big >= SMALLEST * self.size]
            x, y, z = self._halves(a[some], b[some], kind[some])
            if skips is not None and len(x):
                keeps = ~skips(x, y, z)
                x, y, z = x[keeps], y[keeps], z[keeps]
            own, alive = self._bounds(x, y, z, found.value)
            a, b, kind = (
                np.concatenate([old[rest], new[alive]]) for old, new in ((a, x), (b, y), (kind, z))
            )
            lower = np.concatenate([lower[rest], own[alive]])
        floor = min(floor, float(lower.min(initial=np.inf)))
        found.bound = max(min(floor, found.value) - ROUNDED * self.size, 0.0)
        if np.isinf(floor) and np.isinf(found.value):
            found.bound = np.inf
        found.is_proven = bool(found.bound >= found.value - 2.0 * tolerance)
        found.seconds += time.perf_counter() - began
        return found

    def _without_touching(
        self, a: Ints, b: Ints, kind: Ints, lower: FloatArray, found: Found
    ) -> tuple[Ints, Ints, Ints, FloatArray]:
        """Name pairs of faces that meet, and leave them out."""
        if not self.zero:
            return a, b, kind, lower
        radius = self.cells.radius
        meets = (lower <= self.zero) & (radius[a, 0] + radius[b, 0] <= MEETING * self.size)
        if meets.any():
            for i in np.flatnonzero(meets).tolist():
                faces = self.cells.ints[[a[i], b[i]], 1].tolist()
                key = (min(faces), max(faces))
                found.touching.setdefault(key, self.cells.middle[a[i]].copy())
            n = int(self.cells.ints[: self.cells.n, 1].max()) + 1
            code = np.array([i * n + j for i, j in found.touching])
            own = np.sort(self.cells.ints[np.stack([a, b]), 1], axis=0)
            keeps = ~np.isin(own[0] * n + own[1], code)
            a, b, kind, lower = a[keeps], b[keeps], kind[keeps], lower[keeps]
        return a, b, kind, lower

    def _halves(self, a: Ints, b: Ints, kind: Ints) -> tuple[Ints, Ints, Ints]:
        """Return pairs of the halves: of the larger cell, or of both."""
        r_a, r_b = self.cells.radius[a, 0], self.cells.radius[b, 0]
        cuts_a, cuts_b = r_a > 0.7 * r_b, r_b > 0.7 * r_a
        self.cells.halved(np.concatenate([a[cuts_a], b[cuts_b]]))
        x = np.where(
            cuts_a[:, None], self.cells.children[a], np.stack([a, np.full(len(a), -1)], axis=1)
        )
        y = np.where(
            cuts_b[:, None], self.cells.children[b], np.stack([b, np.full(len(b), -1)], axis=1)
        )
        first, second = np.repeat(x, 2, axis=1).ravel(), np.tile(y, 2).ravel()
        whole = np.repeat(kind, 4)
        # Of a cell with itself each pair is there twice.
        twice = np.repeat((a == b) & (kind != FIRST), 4) & (first > second)
        keeps = (first >= 0) & (second >= 0) & ~twice
        return first[keeps], second[keeps], whole[keeps]

    def _bounds(self, a: Ints, b: Ints, kind: Ints, most: float) -> tuple[FloatArray, BoolArray]:
        """Return lower bounds of chords of pairs, and whether there may be any below ``most``."""
        lower, alive = np.zeros(len(a)), np.ones(len(a), np.bool_)
        for begin in range(0, len(a), BATCH):
            part = slice(begin, begin + BATCH)
            lower[part], alive[part] = self._bounds_of(a[part], b[part], kind[part], most)
        return lower, alive

    def _bounds_of(self, a: Ints, b: Ints, kind: Ints, most: float) -> tuple[FloatArray, BoolArray]:
        cells, n = self.cells, len(a)
        p, q = (cells.corners[c].reshape(n, 4, 3) for c in (a, b))
        # --- by the direction between the middles
        way = cells.middle[a] - cells.middle[b]
        way = way / np.maximum(np.linalg.norm(way, axis=1), 1e-300)[:, None]
        lower = np.einsum("nkj,nj->nk", p, way).min(axis=1) - np.einsum("nkj,nj->nk", q, way).max(
            axis=1
        )
        lower -= self._eps(a, b, way[:, None])[:, 0]
        alive = np.ones(n, np.bool_)
        frames = [
            cells.frame[c].reshape(n, 3, 3) * np.array([self.sign, 1.0, 1.0])[:, None]
            for c in (a, b)
        ]
        spreads = [cells.spread[c] + TILTED for c in (a, b)]
        # Angles by which normals of each may be off those of the middles, and of the second turned to the first.
        widths = [
            2.0 * np.arcsin(np.minimum(0.5 * np.sqrt((s**2).sum(axis=1)), 1.0)) for s in spreads
        ]
        turn = -(frames[0][:, 0] * frames[1][:, 0]).sum(axis=1)
        between = np.arccos(np.clip(turn, -1.0, 1.0))
        both, first, touching = kind == BOTH, kind == FIRST, kind == TOUCHING
        for own, (own_frame, other_frame) in enumerate((frames, frames[::-1])):
            x, y = (p, q) if own == 0 else (q, p)
            spread, wide = spreads[own], spreads[1 - own]
            along = np.einsum("nij,nkj->nik", own_frame, x), np.einsum("nij,nkj->nik", own_frame, y)
            eps = self._eps(a, b, own_frame)
            low = along[0].min(axis=2) - along[1].max(axis=2) - eps
            high = along[0].max(axis=2) - along[1].min(axis=2) + eps
            apart = np.maximum(np.maximum(low, -high), 0.0)
            lower = np.maximum(lower, np.sqrt((apart**2).sum(axis=1)))
            product = np.einsum("nij,nkj->nik", own_frame, other_frame)
            turned = -product[:, :, 0]
            reach = np.einsum("nik,nk->ni", np.abs(product), wide)
            # --- the chord is along the own normal
            is_normal = both | (first if own == 0 else False)
            lateral = most * spread[:, 1:]
            fits = (high[:, 0] > 0.0) | (spread[:, 0] >= 1.0)
            fits &= ((low[:, 1:] <= lateral) & (high[:, 1:] >= -lateral)).all(axis=1)
            alive &= fits | ~is_normal
            # --- both are along it
            fits = turned[:, 0] + reach[:, 0] >= 1.0 - spread[:, 0]
            fits &= (np.abs(turned[:, 1:]) <= spread[:, 1:] + reach[:, 1:]).all(axis=1)
            alive &= fits | ~both
            if is_normal.any() or touching.any():
                # The cosine between the normals, turned to each other.
                least = np.minimum(between + widths[0] + widths[1], self.angle + TILTED)
                least = np.where(both, 1.0, np.cos(least))
                by_core = self._core_bound(a, b, own, own_frame, spread, least, is_normal)
                lower = np.where(is_normal, np.maximum(lower, by_core), lower)
            # --- a ball touches both: p - q = r (n_p - n_q)
            if touching.any():
                r = 0.5 * most
                left = np.minimum(r * (turned[:, 1:] - spread[:, 1:] - reach[:, 1:]), 0.0)
                right = np.maximum(r * (turned[:, 1:] + spread[:, 1:] + reach[:, 1:]), 0.0)
                fits = ((low[:, 1:] <= right) & (high[:, 1:] >= left)).all(axis=1) & (
                    high[:, 0] > 0.0
                )
                alive &= fits | ~touching
                # 2 r (1 + c) / 2 = (core_p - core_q) n_p + rho_p + rho_q c, monotone in c = -n_p n_q.
                ends = [
                    2.0 * self._core_bound(a, b, own, own_frame, spread, c) / (1.0 + c)
                    for c in (least, np.ones(n))
                ]
                lower = np.where(touching, np.maximum(lower, np.minimum(*ends)), lower)
            # --- walls are opposite
            alive &= (between - widths[0] - widths[1] <= self.angle) | both | (kind == ANY)
        return lower, alive & (lower < most)

    def _eps(self, a: Ints, b: Ints, directions: FloatArray) -> FloatArray:
        """Return how far points of both cells are from their hulls along directions (n, k, 3)."""
        eps = np.full(directions.shape[:2], ROUNDED * self.size)
        for cell in (a, b):
            eps += self.cells.eps_along(cell, directions)
        return eps

    def _core_bound(
        self,
        a: Ints,
        b: Ints,
        own: int,
        frame: FloatArray,
        spread: FloatArray,
        cosine: FloatArray,
        is_chord: BoolArray | bool = False,
    ) -> FloatArray:
        """Return (core_p - core_q) n_p + rho_p - rho_q n_q n_p at least; -n_q n_p is from ``cosine`` to 1."""
        cells, n = self.cells, len(a)
        x, y = (cells.core[c].reshape(n, 4, 3) for c in ((a, b) if own == 0 else (b, a)))
        eps = cells.core_eps[a] + cells.core_eps[b] + ROUNDED * self.size
        along = np.einsum("nij,nkj->nik", frame, x), np.einsum("nij,nkj->nik", frame, y)
        low = along[0].min(axis=2) - along[1].max(axis=2) - eps
        high = along[0].max(axis=2) - along[1].min(axis=2) + eps
        far = np.maximum(np.abs(low), np.abs(high))
        share = 1.0 - spread[:, 0]
        least = np.minimum(np.minimum(low[:, 0], low[:, 0] * share), high[:, 0] * share)
        least = least - far[:, 1] * spread[:, 1] - far[:, 2] * spread[:, 2]
        first, second = (a, b) if own == 0 else (b, a)
        one, other = (self.sign * cells.rho[c, 0] for c in (first, second))
        bound = least + one + np.minimum(other, other * cosine)
        # A chord that meets a convex cylinder or sphere goes past its core: t - rho_p = |q - core_p|, and q is rho_q
        # from its axis or centre.
        way = cells.way[second]
        off = x - y[:, :1]
        off = off - np.einsum("nkj,nj->nk", off, way)[..., None] * way[:, None]
        aside = np.linalg.norm(off, axis=2).max(axis=1) + eps[:, 0]
        holds = is_chord & (cells.is_round[second, 0] > 0.0) & (aside < other * cosine)
        found: FloatArray = np.where(holds, np.maximum(bound, one + other - aside), bound)
        return found
