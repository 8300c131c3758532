"""One patch as one ray sees it: its pieces are searched, edges that lie on the ray are taken out.

The method is that of `proof.exact.patches`.
"""

from __future__ import annotations

import math
from functools import cached_property
from typing import Any

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from proof.exact.bernstein_sums import power_form, values_at, without_edge
from proof.exact.crossings import (
    ALONG,
    OPEN,
    POINT,
    Ball,
    Crossing,
    Polynomial,
    Rational,
    RationalVector,
    bits,
    cross,
    dot,
    is_narrow,
    norm,
    rational,
    rationals,
    roots_from_0_to_1,
    value,
)
from proof.exact.kernels.plain_pieces import pieces_left
from proof.exact.patch_pieces import (
    Matrix,
    Piece,
    halved,
    in_floats,
    is_beside,
    restricted,
    split_in_two,
)
from proof.exact.patch_settling import ROOT_BITS, distinct, settled

# Pieces examined for one ray and patch before the rest is left open.
MOST_PIECES = 6000
# Pieces smaller than this part of the patch, as the ray sees them, are left open.
SMALLEST = 2.0**-140
# Pieces that float64 may leave at once, and how far they may turn, up to rounding: those that turn by
# more are not worth the exact test.
MOST_LEFT, MAY_TURN = 256, 0.115


class Net:
    """One patch: its control points and weights as fractions.

    ``number``: that of the patch.
    ``net``, ``rest``: control points are the sums of both.
    ``columns``: the Bernstein coefficients of W S_x, W S_y, W S_z, and W.
    ``low``, ``high``: corners of the box of the control points.
    """

    def __init__(self, number: int, net: FloatArray, rest: FloatArray, weights: FloatArray) -> None:
        self.number, self.shape = number, net.shape[:2]
        self.low, self.high = net.min(axis=(0, 1)), net.max(axis=(0, 1))
        tables = [
            [
                [rational(w) * (rational(x) + rational(y)) for w, x, y in zip(*rows, strict=True)]
                for rows in zip(weights, net[..., c], rest[..., c], strict=True)
            ]
            for c in range(3)
        ]
        self.columns = [
            flint.fmpq_mat(table) for table in (*tables, [rationals(row) for row in weights])
        ]

    @cached_property
    def whole(self) -> list[tuple[Matrix, Any]]:
        """The columns as matrices of whole numbers and their denominators."""
        return [column.numer_denom() for column in self.columns]

    @cached_property
    def curves(self) -> list[list[Polynomial]]:
        """The columns' curves along v, as polynomials."""
        return [
            [flint.fmpq_poly(power_form(row)) for row in column.tolist()] for column in self.columns
        ]


class PatchAndRay:
    """One patch as one ray sees it."""

    def __init__(self, net: Net, o: RationalVector, d: RationalVector) -> None:
        self.net, self.o, self.d = net, o, d
        sizes = [abs(float(x)) for x in d]
        self.length = norm(sizes)
        self.k = sizes.index(max(sizes))
        i, j = (self.k + 1) % 3, (self.k + 2) % 3
        dk, ok = d[self.k], o[self.k]
        columns = net.columns
        # w (dk (p_i - o_i) - d_i (p_k - o_k)), and the same for j.
        (f, f_below), (g, g_below) = (
            (
                dk * columns[c] - d[c] * columns[self.k] - (dk * o[c] - d[c] * ok) * columns[3]
            ).numer_denom()
            for c in (i, j)
        )
        denominator = max(f_below, g_below)  # powers of two
        self.f = (f * (denominator // f_below)).tolist()
        self.g = (g * (denominator // g_below)).tolist()
        self.largest = max(abs(x) for table in (self.f, self.g) for row in table for x in row)
        # t to be known to a part of this.
        start = [float(x) for x in o]
        reach = max(np.abs(net.low - start).max(), np.abs(net.high - start).max())
        self.scale = float(reach) / self.length

    def crossings(self) -> list[Crossing]:
        """Return all crossings."""
        if self.largest == 0:
            return []
        flat = self._within_plane()
        if flat is not None:
            return flat
        found = self._take_edges()
        rows = [a + b for a, b in zip(self.f, self.g, strict=True)]
        # Whether float64 has not looked at a piece yet: it may tell where to look.
        stack = [(Piece(flint.fmpz_mat(rows), 0, 0, 0, 0), True)]
        roots: list[tuple[Rational, Rational, Rational]] = []
        left: list[Piece] = []
        pieces = 0
        room = np.empty((MOST_LEFT, 4), np.int64)
        while stack:
            piece, is_new = stack.pop()
            pieces += 1
            if pieces > MOST_PIECES:
                left += [piece, *(other for other, _ in stack)]
                break
            if is_new:
                count = pieces_left(*in_floats(piece.both), MAY_TURN, room)
                if count >= 0:
                    stack += [(restricted(piece, *place), False) for place in room[:count].tolist()]
                    continue
            if is_beside(piece.both):
                continue
            outcome = settled(piece)
            if outcome is not None:
                roots += outcome
            elif self._extent(piece) < SMALLEST:
                left.append(piece)
            else:
                stack += [(half, True) for half in halved(piece)]
        found += [self._point(*root) for root in distinct(roots)]
        if left:
            found.append(self._left_open(left))
        return found

    def _extent(self, piece: Piece) -> float:
        """Return how large a piece looks, in parts of the patch's distance from the ray."""
        a, b = split_in_two(piece.both)
        widest = max(max(m.entries()) - min(m.entries()) for m in (a, b))
        scale = self.largest << (piece.m * (a.nrows() - 1) + piece.n * (a.ncols() - 1))
        return float(flint.fmpq(widest, scale))

    # --- what the ray holds entirely

    def _within_plane(self) -> list[Crossing] | None:
        """Return the stretch of a flat patch in whose plane the ray lies, if so."""
        f = [x for row in self.f for x in row]
        g = [x for row in self.g for x in row]
        first = next(i for i in range(len(f)) if f[i] != 0 or g[i] != 0)
        if any(f[first] * y != g[first] * x for x, y in zip(f, g, strict=True)):
            return None
        one = self.f if f[first] != 0 else self.g
        ends: list[tuple[Ball, Ball, Ball]] = []
        none, all_of_it = flint.arb(0), flint.arb(1)
        for edge, place in (
            (one[0], lambda x: (none, x)),
            (one[-1], lambda x: (all_of_it, x)),
            ([row[0] for row in one], lambda x: (x, none)),
            ([row[-1] for row in one], lambda x: (x, all_of_it)),
        ):
            polynomial = flint.fmpq_poly(power_form(edge))
            is_on_it = polynomial.is_zero()
            xs = (none, all_of_it) if is_on_it else roots_from_0_to_1(polynomial, ROOT_BITS)
            ends += [(*place(x), self._t(*place(x))) for x in xs]
        if not ends:
            return []
        ends.sort(key=lambda end: float(end[2].mid()))
        (u, v, t), (_, _, t_end) = ends[0], ends[-1]
        return [Crossing(t, self.net.number, float(u.mid()), float(v.mid()), 0.0, ALONG, t_end)]

    def _take_edges(self) -> list[Crossing]:
        """Return the edges that lie on the ray, and divide them out of f and g."""
        found = []
        for _ in range(4 * max(self.net.shape)):
            tables = self.f, self.g
            edges = [
                [row for table in tables for row in table[0]],
                [row for table in tables for row in table[-1]],
                [row[0] for table in tables for row in table],
                [row[-1] for table in tables for row in table],
            ]
            which = next((i for i in range(4) if all(x == 0 for x in edges[i])), None)
            if which is None:
                break
            end, along_u = which % 2, which < 2
            if (len(self.f) if along_u else len(self.f[0])) == 1:
                break
            self.f, self.g = (without_edge(table, end, along_u) for table in tables)
            at = flint.arb(end)
            corners = [(at, flint.arb(x)) if along_u else (flint.arb(x), at) for x in (0, 1)]
            ts = sorted((self._t(u, v) for u, v in corners), key=lambda t: float(t.mid()))
            u, v = corners[0]
            kind = POINT if ts[0].overlaps(ts[1]) else ALONG
            found.append(
                Crossing(
                    ts[0], self.net.number, float(u), float(v), 0.0, kind,
                    None if kind == POINT else ts[1],
                )
            )  # fmt: skip
        return found

    # --- crossings

    def _t(self, u: Ball, v: Ball) -> Ball:
        """Return t at parameters given as balls."""
        with bits(4 * ROOT_BITS):
            depth, weight = (self._at(c, u, v) for c in (self.k, 3))
            return (depth / weight - self.o[self.k]) / self.d[self.k]

    def _at(self, c: int, u: Ball, v: Ball) -> Ball:
        """Return W S_c, or for 3 W, at parameters given as balls."""
        curves = [value(curve, v) for curve in self.net.curves[c]]
        n = len(curves) - 1
        return sum(
            (math.comb(n, i) * u**i * (1 - u) ** (n - i) * x for i, x in enumerate(curves)),
            flint.arb(0),
        )

    def _point(self, u: Rational, v: Rational, radius: Rational) -> Crossing:
        with bits(4 * ROOT_BITS):
            air = flint.arb(0, float(radius) * 1.01 + 1e-300)
            t = self._t(flint.arb(u) + air, flint.arb(v) + air)
        kind = POINT if is_narrow(t, self.scale) else OPEN
        along_u, along_v = self._tangents(u, v)
        normal = cross(along_u, along_v)
        d = self.d
        cosine = _cosine(normal, d)
        det = abs(dot(normal, d))
        to_edge = math.inf
        for x, other in ((u, along_v), (v, along_u)):
            across = _length(cross(other, d))
            to_edge = min(to_edge, float(abs(min(x, 1 - x)) * det / across) if across > 0 else 0.0)
        return Crossing(
            t,
            self.net.number,
            float(u),
            float(v),
            cosine,
            kind,
            None if kind == POINT else t,
            to_edge,
        )

    def _tangents(self, u: Rational, v: Rational) -> tuple[list[Rational], list[Rational]]:
        """Return S_u and S_v at a point, exactly."""
        *columns, (w, wu, wv) = [
            [x / below for x in sums]
            for sums, (_, below) in zip(
                values_at([matrix for matrix, _ in self.net.whole], u, v),
                self.net.whole,
                strict=True,
            )
        ]
        # (W S)_u = W S_u + W_u S.
        return (
            [(xu - wu * (x / w)) / w for x, xu, _ in columns],
            [(xv - wv * (x / w)) / w for x, _, xv in columns],
        )

    def _left_open(self, pieces: list[Piece]) -> Crossing:
        """Return one crossing for all that was left open."""
        ts = [
            self._t(
                flint.arb(flint.fmpq(2 * piece.a + 1, 2 << piece.m), 0.5 ** (piece.m + 1)),
                flint.arb(flint.fmpq(2 * piece.b + 1, 2 << piece.n), 0.5 ** (piece.n + 1)),
            )
            for piece in pieces
        ]
        one = pieces[0]
        return Crossing(
            min(t.lower() for t in ts),
            self.net.number,
            (one.a + 0.5) / 2.0**one.m,
            (one.b + 0.5) / 2.0**one.n,
            0.0,
            OPEN,
            max(t.upper() for t in ts),
        )


def _length(a: list[Rational]) -> Rational:
    """Return the length of a vector, to float64's digits, however small it is."""
    largest = max(abs(x) for x in a)
    if largest == 0:
        return largest
    return largest * rational(norm([float(x / largest) for x in a]))


def _cosine(normal: list[Rational], d: RationalVector) -> float:
    size = _length(normal)
    if size == 0:
        return 0.0
    return abs(float(dot(normal, d) / (size * _length(list(d)))))
