"""Branch and bound over pairs of cells: the least chord between two walls, proven.

A chord joins a point p of one cell with a point q of another, p - q = t n with n an outward normal. Where t is
least within both faces, both normals are along the chord. On borders only one, or none, need be. So there are
four kinds of pairs, and every local minimum is in one of them:

* BOTH: the chord is along both normals (of a re-entrant edge: along one between those of its faces);
* FIRST: it is along the normal of the first cell, and meets the second one within ``angle`` of its normal;
* TOUCHING: a ball touches both, its contacts at least 180 degrees less ``angle`` apart;
* ANY: nothing is asked.

With S = core + rho n a chord along both normals has t = (core_p - core_q) n + rho_p + rho_q. So walls of constant
thickness, as tubes and shells have, are proven at once. Of a cone, (S - apex) n = 0: the apex does for the core of p, and
of q where both normals are along the chord.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.part.cells import Cells, Ints
from hybrid_rt.part.kernels.bounds import FIRST, bounds_of_pairs

# Pairs that are halved at once, and those of which the value is computed.
BATCH, TRIED = 40_000, 400
# Rounds without such values, at most.
MOST_ROUNDS_WITHOUT = 8
# Pairs compared at once by their boxes.
PAIRED = 4_000_000
# Numbers are rounded, over the size of the part.
ROUNDED = 1e-12
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


# Hears the share of its time that a search has taken.
Heard = Callable[[float], None] | None
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
    threads : int, optional
    heard : Heard, optional
    """

    def __init__(
        self, cells: Cells, size: float, angle: float, *, sign: float = 1.0, zero: float = 0.0,
        threads: int | None = None, heard: Heard = None,
    ) -> None:  # fmt: skip
        self.cells, self.size, self.angle, self.sign, self.zero = cells, size, angle, sign, zero
        self._pool, self._heard = Pool(threads), heard

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
        self, pairs: tuple[Ints, Ints, Ints], found: Found, values: Values, tolerance: float, seconds: float,
        skips: Callable[[Ints, Ints, Ints], BoolArray] | None = None,
    ) -> Found:  # fmt: skip
        """Search all of some pairs (first, second, kind); ``found`` may hold a value to begin with."""
        a, b, kind = pairs
        lower = self._bounds(a, b, kind, found.value)  # compiled before the clock starts
        began = time.perf_counter()
        waits = rest = 0
        alive = np.isfinite(lower)
        a, b, kind, lower = a[alive], b[alive], kind[alive], lower[alive]
        floor = np.inf
        while len(a):
            found.n_pairs += len(a)
            if self._heard is not None:
                self._heard((time.perf_counter() - began) / seconds)
            a, b, kind, lower = self._without_touching(a, b, kind, lower, found)
            over = lower >= found.value - tolerance
            floor = min(floor, float(lower[over].min(initial=np.inf)))
            a, b, kind, lower = a[~over], b[~over], kind[~over], lower[~over]
            if not len(a) or time.perf_counter() > began + seconds:
                break
            order = np.argsort(lower, kind="stable")
            if rest == 0:
                some, before = order[:TRIED], found.value
                found.take(*values(a[some], b[some], kind[some]))
                if found.value < before:
                    waits = 0
                    continue
                # What has not helped is tried less often.
                waits = rest = min(waits + 1, MOST_ROUNDS_WITHOUT)
            else:
                rest -= 1
            some, others = order[:BATCH], order[BATCH:]
            big = np.maximum(self.cells.radius[a[some], 0], self.cells.radius[b[some], 0])
            if (big < SMALLEST * self.size).any():
                stuck = some[big < SMALLEST * self.size]
                floor = min(floor, float(lower[stuck].min()))
                some = some[big >= SMALLEST * self.size]
            x, y, z = self._halves(a[some], b[some], kind[some])
            if skips is not None and len(x):
                keeps = ~skips(x, y, z)
                x, y, z = x[keeps], y[keeps], z[keeps]
            own = self._bounds(x, y, z, found.value)
            alive = np.isfinite(own)
            a, b, kind = (
                np.concatenate([old[others], new[alive]])
                for old, new in ((a, x), (b, y), (kind, z))
            )
            lower = np.concatenate([lower[others], own[alive]])
        floor = min(floor, float(lower.min(initial=np.inf)))
        found.bound = max(min(floor, found.value) - ROUNDED * self.size, 0.0)
        if np.isinf(floor) and np.isinf(found.value):
            found.bound = np.inf
        found.is_proven = bool(found.bound >= found.value - 2.0 * tolerance)
        found.seconds = time.perf_counter() - began
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

    def _bounds(self, a: Ints, b: Ints, kind: Ints, most: float) -> FloatArray:
        """Return lower bounds of the chords of pairs; inf: there is none below ``most``."""
        lower = np.empty(len(a))
        rest = most, self.angle, self.sign, ROUNDED * self.size

        def work(begin: int, end: int) -> None:
            part = slice(begin, end)
            bounds_of_pairs(self.cells.number, a[part], b[part], kind[part], *rest, lower[part])

        self._pool.run(work, len(a))
        return lower
