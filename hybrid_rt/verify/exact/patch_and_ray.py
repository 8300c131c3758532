"""One patch as one ray sees it: its pieces are searched, edges that lie on the ray are taken out.

The method is that of `hybrid_rt.verify.exact.patches`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import flint
import numpy as np

from hybrid_rt.verify.exact.bernstein_sums import power_form, sums_at, without_edge
from hybrid_rt.verify.exact.crossings import (
    ALONG,
    OPEN,
    POINT,
    Ball,
    Crossing,
    Rational,
    RationalVector,
    bits,
    cross,
    dot,
    is_narrow,
    norm,
    rational,
    roots_from_0_to_1,
    value,
)
from hybrid_rt.verify.exact.kernels.plain_pieces import pieces_left
from hybrid_rt.verify.exact.patch_look import MAY_TURN, Look
from hybrid_rt.verify.exact.patch_pieces import Piece, halved, restricted, split_in_two
from hybrid_rt.verify.exact.patch_settling import ROOT_BITS, distinct, settled

# Pieces examined for one ray and patch before the rest is left open.
MOST_PIECES = 6000
# Pieces smaller than this part of the patch, as the ray sees them, are left open.
SMALLEST = 2.0**-140
# Pieces that float64 may leave at once.
MOST_LEFT = 256


class Net(NamedTuple):
    """One patch: its control points and weights as fractions."""

    number: int
    rows: list[list[list[Rational]]]
    weights: list[list[Rational]]
    shape: tuple[int, int]

    def column(self, c: int) -> list[list[Rational]]:
        """Return the Bernstein coefficients of W S_c; those of W for ``c`` = 3."""
        if c == 3:
            return self.weights
        return [
            [w * p[c] for p, w in zip(row, weights, strict=True)]
            for row, weights in zip(self.rows, self.weights, strict=True)
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
        f, g = [], []
        for row, weights in zip(net.rows, net.weights, strict=True):
            points = [
                (w, p, p[self.k] - ok) for w, p in zip(weights, row, strict=True)
            ]  # fmt: skip
            f.append([w * (dk * (p[i] - o[i]) - d[i] * h) for w, p, h in points])
            g.append([w * (dk * (p[j] - o[j]) - d[j] * h) for w, p, h in points])
        denominator = flint.fmpz(1)
        for table in (f, g):
            for line in table:
                for x in line:
                    denominator = max(denominator, x.q)  # powers of two
        self.f = [[(x * denominator).p for x in row] for row in f]
        self.g = [[(x * denominator).p for x in row] for row in g]
        largest = max(abs(x) for table in (self.f, self.g) for row in table for x in row)
        self.largest = largest
        # t to be known to a part of this.
        reach = max(abs(float(p[c] - o[c])) for row in net.rows for p in row for c in range(3))
        self.scale = reach / self.length

    def crossings(self) -> list[Crossing]:
        """Return all crossings."""
        if self.largest == 0:
            return []
        flat = self._within_plane()
        if flat is not None:
            return flat
        found = self._take_edges()
        rows = [a + b for a, b in zip(self.f, self.g, strict=True)]
        stack = [Piece(flint.fmpz_mat(rows), 0, 0, 0, 0)]
        roots: list[tuple[Rational, Rational, Rational]] = []
        left: list[Piece] = []
        pieces = 0
        room = np.empty((MOST_LEFT, 4), np.int64)
        while stack:
            piece = stack.pop()
            pieces += 1
            if pieces > MOST_PIECES:
                left += [piece, *stack]
                break
            look = Look(piece.both)
            if look.is_beside():
                continue
            outcome = settled(piece) if look.may_settle() else None
            if outcome is not None:
                roots += outcome
                continue
            if self._extent(piece) < SMALLEST:
                left.append(piece)
                continue
            count = pieces_left(look.f, look.g, MAY_TURN, room)
            if count < 0:
                stack += halved(piece, look.is_longer_along_u())
            else:
                stack += [restricted(piece, *place) for place in room[:count].tolist()]
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
            if polynomial.is_zero():
                ends += [(*place(flint.arb(x)), self._t(*place(flint.arb(x)))) for x in (0, 1)]
                continue
            for x in roots_from_0_to_1(polynomial, ROOT_BITS):
                u, v = place(x)
                ends.append((u, v, self._t(u, v)))
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
        curves = [value(flint.fmpq_poly(power_form(row)), v) for row in self.net.column(c)]
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
            to_edge = min(to_edge, _ratio(abs(min(x, 1 - x)) * det, across) if across > 0 else 0.0)
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
        *columns, (w, wu, wv) = [sums_at(self.net.column(c), u, v) for c in range(4)]
        # (W S)_u = W S_u + W_u S.
        return (
            [(xu - wu * (x / w)) / w for x, xu, _ in columns],
            [(xv - wv * (x / w)) / w for x, _, xv in columns],
        )

    def _left_open(self, pieces: list[Piece]) -> Crossing:
        """Return one crossing for all that was left open."""
        low = high = None
        for piece in pieces:
            u = flint.arb(flint.fmpq(2 * piece.a + 1, 2 << piece.m), 0.5 ** (piece.m + 1))
            v = flint.arb(flint.fmpq(2 * piece.b + 1, 2 << piece.n), 0.5 ** (piece.n + 1))
            t = self._t(u, v)
            low = t if low is None or t.lower() < low.lower() else low
            high = t if high is None or t.upper() > high.upper() else high
        assert low is not None
        assert high is not None
        one = pieces[0]
        return Crossing(
            flint.arb(low.lower()),
            self.net.number,
            (one.a + 0.5) / 2.0**one.m,
            (one.b + 0.5) / 2.0**one.n,
            0.0,
            OPEN,
            flint.arb(high.upper()),
        )


def _ratio(a: Rational, b: Rational) -> float:
    return float(a / b)


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
