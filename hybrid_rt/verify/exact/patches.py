"""All crossings of a ray with Bezier patches, isolated in whole numbers.

The largest component of the direction, k, is divided out: with i and j the two others,

    f = d_k (S_i - o_i) - d_i (S_k - o_k),    g = d_k (S_j - o_j) - d_j (S_k - o_k)

vanish where S(u, v) is on the ray, and t = (S_k - o_k) / d_k. (Those of rational patches are times
the denominator W, which is positive.) Times a power of two the Bernstein
coefficients of f and g are whole numbers, and so they stay when a piece is halved: nothing is
rounded. A piece without a sign change in f, in g, or in their components along and across its
longer tangent is dropped. A piece is settled where the Jacobian of (f, g), times the adjugate of its
mean, differs from a multiple det of the identity by at most q |det|, q <= 1/9, on the piece grown by an
eighth to each side: then F = adj (f, g) / det is injective there, F(x) = 0 has a solution within
|F(p)| / (1 - q) of any p for which that ball is inside (x -> x - F(x) contracts it), and there is no
other (Krawczyk 1969). What is left after many pieces, or below any size that matters, is said to be
open.

Edges of which the ray holds every point (a collapsed edge that it meets, a straight edge that it
follows) are found exactly and divided out of f and g; so is a flat patch whose plane holds the ray.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import Any, NamedTuple

import flint
import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.verify.exact.crossings import (
    ALONG,
    OPEN,
    POINT,
    Ball,
    Crosser,
    Crossing,
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
from hybrid_rt.verify.exact.kernels.plain_pieces import pieces_left
from meshing import BezierPatches

# Whole-number matrices of flint.
Matrix = Any

# Pieces examined for one ray and patch before the rest is left open.
MOST_PIECES = 6000
# Pieces smaller than this part of the patch, as the ray sees them, are left open.
SMALLEST = 2.0**-140
# Roots are known to so many bits of their piece; within the last few a border counts as met.
ROOT_BITS = 240
BORDER_BITS = 200
# (1 + q) / (1 - q) <= 5/4: a root of the piece is certain to have its ball in the grown piece.
MOST_TURN = flint.fmpq(1, 9)
# Float64 nets keep so far from 0, in parts of their largest number, that rounding does not count.
CLEAR = 1e-9
# The same of pieces, whose numbers are rounded once; numbers below this part of others, where
# rounding may count, are looked at again in whole.
ROUNDED, PLAIN = 2.0**-48, 1e-9
# A piece that turns by more, up to rounding, is not worth the exact test.
MAY_TURN = 0.115
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


class Piece(NamedTuple):
    """Coefficients of f beside those of g, and the piece's place: u from a / 2^m on, and so on."""

    both: Matrix
    a: int
    m: int
    b: int
    n: int


def patches_crosser(surface: BezierPatches) -> Crosser:
    """Return a function that finds all crossings with patches, on shared edges one for each."""
    nets = [
        Net(
            k,
            [[rationals(point) for point in row] for row in net],
            [rationals(row) for row in weights],
            (len(net), net.shape[1]),
        )
        for k, (net, weights) in enumerate(zip(surface.patches, weights_of(surface), strict=True))
    ]
    # Float64 nets for a first look, all of one shape together.
    by_shape: dict[tuple[int, int], list[int]] = {}
    for k, net in enumerate(surface.patches):
        by_shape.setdefault(net.shape[:2], []).append(k)
    stacks = [
        (np.array(members), np.stack([surface.patches[k].reshape(-1, 3) for k in members]))
        for members in by_shape.values()
    ]

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        found = []
        for k in _near(stacks, [float(x) for x in o], [float(x) for x in d]):
            found += PatchAndRay(nets[k], o, d).crossings()
        return found

    return crossings


def weights_of(surface: BezierPatches) -> list[FloatArray]:
    """Return the weights of each patch, ones for polynomial ones."""
    if surface.weights is None:
        return [np.ones(net.shape[:2]) for net in surface.patches]
    return list(surface.weights)


def _near(stacks: list[tuple[Any, FloatArray]], o: list[float], d: list[float]) -> list[int]:
    """Return the patches whose hull the ray may meet, by float64 far beyond rounding."""
    k = int(np.abs(d).argmax())
    i, j = (k + 1) % 3, (k + 2) % 3
    near: list[int] = []
    for members, points in stacks:
        away = points - o
        margin = CLEAR * (np.abs(points).max(axis=(1, 2)) + np.abs(o).max()) * abs(d[k])
        is_near = np.ones(len(members), np.bool_)
        for c in (i, j):
            f = d[k] * away[:, :, c] - d[c] * away[:, :, k]
            is_near &= (f.min(axis=1) <= margin) & (f.max(axis=1) >= -margin)
        near += members[is_near].tolist()
    return sorted(near)


@lru_cache(maxsize=256)
def _halves(degree: int) -> tuple[Matrix, Matrix]:
    """Return 2^n times the matrices that restrict Bernstein coefficients to either half."""
    n = degree
    lower = [
        [math.comb(i, k) << (n - i) if k <= i else 0 for k in range(n + 1)] for i in range(n + 1)
    ]
    upper = [row[::-1] for row in lower[::-1]]
    return flint.fmpz_mat(lower), flint.fmpz_mat(upper)


@lru_cache(maxsize=64)
def _grown(degree: int) -> Matrix:
    """Return 8^n times the matrix that takes coefficients from [0, 1] to [-1/8, 9/8]."""
    n = degree
    rows = []
    for i in range(n + 1):
        # Blossom at n - i times -1/8 and i times 9/8: products of (1 - x, x), in eighths.
        weights = [1]
        for k in range(n):
            near, far = (9, -1) if k < n - i else (-1, 9)
            weights = [
                (weights[j] * near if j < len(weights) else 0) + (weights[j - 1] * far if j else 0)
                for j in range(len(weights) + 1)
            ]
        rows.append(weights)
    return flint.fmpz_mat(rows)


@lru_cache(maxsize=4096)
def _part(degree: int, a: int, m: int) -> Matrix:
    """Return 2^(m n) times the matrix that restricts coefficients to a / 2^m .. (a + 1) / 2^m."""
    if m == 0:
        return flint.fmpz_mat([[int(r == c) for c in range(degree + 1)] for r in range(degree + 1)])
    return _halves(degree)[a & 1] * _part(degree, a >> 1, m - 1)


def _restricted(piece: Piece, a: int, i: int, b: int, j: int) -> Piece:
    """Return a part of a piece: u from a / 2^i to (a + 1) / 2^i of it, and so on."""
    mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
    both = _part(mu, a, i) * piece.both
    if j:
        both = both * _twice(_part(nv, b, j))
    return Piece(both, (piece.a << i) + a, piece.m + i, (piece.b << j) + b, piece.n + j)


def _twice(matrix: Matrix) -> Matrix:
    """Return the matrix for both blocks of a `Piece`, side by side, transposed."""
    n = matrix.nrows()
    wide = [[0] * (2 * n) for _ in range(2 * n)]
    for r in range(n):
        for c in range(n):
            wide[c][r] = wide[n + c][n + r] = int(matrix[r, c])
    return flint.fmpz_mat(wide)


@lru_cache(maxsize=256)
def _halves_across(degree: int) -> tuple[Matrix, Matrix]:
    lower, upper = _halves(degree)
    return _twice(lower), _twice(upper)


@lru_cache(maxsize=64)
def _grown_across(degree: int) -> Matrix:
    return _twice(_grown(degree))


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
        settled: list[tuple[Rational, Rational, Rational]] = []
        left: list[Piece] = []
        pieces = 0
        room = np.empty((MOST_LEFT, 4), np.int64)
        while stack:
            piece = stack.pop()
            pieces += 1
            if pieces > MOST_PIECES:
                left += [piece, *stack]
                break
            look = _Look(piece.both)
            if look.is_beside():
                continue
            outcome = self._settle(piece) if look.may_settle() else None
            if outcome is not None:
                settled += outcome
                continue
            if self._extent(piece) < SMALLEST:
                left.append(piece)
                continue
            count = pieces_left(look.f, look.g, MAY_TURN, room)
            if count < 0:
                stack += self._halved(piece, look.is_longer_along_u())
            else:
                stack += [_restricted(piece, *place) for place in room[:count].tolist()]
        found += [self._point(*root) for root in _distinct(settled)]
        if left:
            found.append(self._left_open(left))
        return found

    # --- pieces

    def _settle(self, piece: Piece) -> list[Any] | None:
        """Return the piece's root as (u, v, radius), none if it has none; None if unsettled."""
        mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
        if mu == 0 or nv == 0:
            return None
        ga, gb = _split(_grown(mu) * piece.both * _grown_across(nv))
        j00, j01, j10, j11 = _mean_jacobian(ga, gb)
        det = j00 * j11 - j01 * j10
        if det == 0:
            return None
        q = max(
            _turn(j11 * ga - j01 * gb, mu, nv, det, True),
            _turn(j00 * gb - j10 * ga, mu, nv, det, False),
        )
        if q > MOST_TURN:
            return None
        # In units of the grown piece, 5/4 of the piece; from the middle, 1/2.
        point = flint.fmpq(1, 2), flint.fmpq(1, 2)
        fu, fv = _moved(ga, gb, (j00, j01, j10, j11), det, *point)
        if max(abs(fu), abs(fv)) > (1 + q) * flint.fmpq(2, 5):
            return []
        number = ROOT_BITS
        point = self._newton(ga, gb, point, number)
        fu, fv = _moved(ga, gb, (j00, j01, j10, j11), det, *point)
        radius = max(abs(fu), abs(fv)) / (1 - q)
        if not radius < flint.fmpq(1, 1 << 100):
            return None  # Newton has not come near; halves will
        # --- back to the patch
        five = flint.fmpq(5, 4)
        x, y = (five * c - flint.fmpq(1, 8) for c in point)
        slack = five * radius + flint.fmpq(1, 1 << BORDER_BITS)
        if not (-slack <= x <= 1 + slack and -slack <= y <= 1 + slack):
            return []
        u, v = (piece.a + x) / (1 << piece.m), (piece.b + y) / (1 << piece.n)
        return [(u, v, five * radius / (1 << min(piece.m, piece.n)))]

    @staticmethod
    def _newton(
        a: Matrix, b: Matrix, point: tuple[Rational, Rational], number: int
    ) -> tuple[Rational, Rational]:
        """Take Newton steps in fractions, rounded to ever more bits."""
        u, v = point
        known = 3
        while known < number:
            known = min(2 * known, number + 8)
            (f, fu, fv), (g, gu, gv) = _values(a, u, v), _values(b, u, v)
            det = fu * gv - fv * gu
            if det == 0:
                return point
            u = _rounded(u - (f * gv - g * fv) / det, known + 24)
            v = _rounded(v - (g * fu - f * gu) / det, known + 24)
            if not (-4 < u < 5 and -4 < v < 5):
                return point
        return u, v

    @staticmethod
    def _halved(piece: Piece, along_u: bool) -> list[Piece]:
        """Halve one side of a piece."""
        mu, nv = piece.both.nrows() - 1, piece.both.ncols() // 2 - 1
        if (along_u and mu > 0) or nv == 0:
            lower, upper = (half * piece.both for half in _halves(mu))
            return [
                Piece(lower, 2 * piece.a, piece.m + 1, piece.b, piece.n),
                Piece(upper, 2 * piece.a + 1, piece.m + 1, piece.b, piece.n),
            ]
        lower, upper = (piece.both * half for half in _halves_across(nv))
        return [
            Piece(lower, piece.a, piece.m, 2 * piece.b, piece.n + 1),
            Piece(upper, piece.a, piece.m, 2 * piece.b + 1, piece.n + 1),
        ]

    def _extent(self, piece: Piece) -> float:
        """Return how large a piece looks, in parts of the patch's distance from the ray."""
        a, b = _split(piece.both)
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
            polynomial = flint.fmpq_poly(_power_form(edge))
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
            self.f, self.g = (_without_edge(table, end, along_u) for table in tables)
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
        curves = [value(flint.fmpq_poly(_power_form(row)), v) for row in self.net.column(c)]
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
        *columns, (w, wu, wv) = [_values_of(self.net.column(c), u, v) for c in range(4)]
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


def _split(both: Matrix) -> tuple[Matrix, Matrix]:
    """Return the matrices of f and of g."""
    n = both.ncols() // 2
    table = both.tolist()
    return flint.fmpz_mat([row[:n] for row in table]), flint.fmpz_mat([row[n:] for row in table])


def _one_sign(numbers: list[Any]) -> bool:
    first = numbers[0]
    if first == 0:
        return False
    if first > 0:
        return all(x > 0 for x in numbers)
    return all(x < 0 for x in numbers)


def _mean_jacobian(a: Matrix, b: Matrix) -> tuple[Any, Any, Any, Any]:
    """Return f_u, f_v, g_u, g_v at their means, times (m + 1) (n + 1)."""
    m, n = a.nrows(), a.ncols()
    out = []
    for matrix in (a, b):
        table = matrix.tolist()
        along_u = sum(table[-1], flint.fmpz(0)) - sum(table[0], flint.fmpz(0))
        along_v = sum((row[-1] - row[0] for row in table), flint.fmpz(0))
        out += [along_u * m, along_v * n]
    return out[0], out[1], out[2], out[3]


class _Look:
    """A piece in float64: what is plain to see is decided here, all else in whole numbers.

    Coefficients are rounded to 2^-52 of the largest one of f, and of g.
    """

    def __init__(self, both: Matrix) -> None:
        self.both = both
        n = both.ncols() // 2
        table = both.tolist()
        self.a, self.a_shift = _floats([x for row in table for x in row[:n]])
        self.b, self.b_shift = _floats([x for row in table for x in row[n:]])
        shape = both.nrows(), n
        self.a, self.b = self.a.reshape(shape), self.b.reshape(shape)
        # f and g in one scale; where one is lost beside the other nothing below is plain.
        shift = self.a_shift - self.b_shift
        self.f = np.ldexp(self.a, min(shift, 0))
        self.g = np.ldexp(self.b, min(-shift, 0))
        self.size = float(max(np.abs(self.f).max(), np.abs(self.g).max()))
        m, k = shape
        means = [
            ((x[-1] - x[0]).sum() * m, (x[:, -1] - x[:, 0]).sum() * k) for x in (self.f, self.g)
        ]
        (self.fu, self.fv), (self.gu, self.gv) = means

    def is_beside(self) -> bool:
        """Tell whether the ray passes by the piece's hull, or by the box along its longer tangent."""
        for one in (self.a, self.b):
            air = ROUNDED * float(np.abs(one).max())
            if one.min() > air or one.max() < -air:
                return True
        x, y = self.fu, self.gu
        if x * x + y * y < self.fv * self.fv + self.gv * self.gv:
            x, y = self.fv, self.gv
        length = math.hypot(x, y)
        is_plain = length > PLAIN * self.size
        if is_plain:
            x, y = x / length, y / length
            for one in (x * self.g - y * self.f, x * self.f + y * self.g):
                widest = float(np.abs(one).max())
                if one.min() > ROUNDED * self.size or one.max() < -ROUNDED * self.size:
                    return True
                is_plain &= widest > PLAIN * self.size
            is_plain &= all(float(np.abs(c).min()) > 0.0 for c in (self.a, self.b))
        return not is_plain and _is_beside(*_split(self.both))

    def may_settle(self) -> bool:
        """Tell whether the piece may turn so little that it holds at most one root."""
        m, n = self.f.shape
        if m == 1 or n == 1:
            return False
        det = self.fu * self.gv - self.fv * self.gu
        if abs(det) <= PLAIN * (self.fu**2 + self.fv**2 + self.gu**2 + self.gv**2):
            return True
        k = m * n
        one = (self.gv * self.f - self.fv * self.g) / det
        two = (self.fu * self.g - self.gu * self.f) / det
        turn = max(
            np.abs(k * (m - 1) * np.diff(one, axis=0) - 1.0).max()
            + np.abs(k * (n - 1) * np.diff(one, axis=1)).max(),
            np.abs(k * (m - 1) * np.diff(two, axis=0)).max()
            + np.abs(k * (n - 1) * np.diff(two, axis=1) - 1.0).max(),
        )
        return bool(turn < MAY_TURN)

    def is_longer_along_u(self) -> bool:
        """Tell which side is longer as the ray sees it."""
        u, v = (
            sum(float(np.abs(np.diff(x, axis=c)).sum(axis=c).max()) for x in (self.f, self.g))
            if self.f.shape[c] > 1
            else 0.0
            for c in range(2)
        )
        return u >= v


def _floats(numbers: list[Any]) -> tuple[FloatArray, int]:
    """Return whole numbers over a power of two."""
    shift = max(int(max(abs(x) for x in numbers)).bit_length() - 60, 0)
    return np.array([int(x >> shift) for x in numbers], dtype=np.float64), shift


def _is_beside(a: Matrix, b: Matrix) -> bool:
    """As `_Look.is_beside`, exactly."""
    if _one_sign(a.entries()) or _one_sign(b.entries()):
        return True
    fu, fv, gu, gv = _mean_jacobian(a, b)
    x, y = (fu, gu) if fu * fu + gu * gu >= fv * fv + gv * gv else (fv, gv)
    if x == 0 and y == 0:
        return False
    # Thirty bits of the direction are enough; whatever it is, the test is exact.
    shift = max(max(abs(x), abs(y)).bit_length() - 30, 0)
    x, y = x >> shift, y >> shift
    if x == 0 and y == 0:
        return False
    return _one_sign((x * b - y * a).entries()) or _one_sign((x * a + y * b).entries())


def _turn(matrix: Matrix, mu: int, nv: int, det: Any, along_u: bool) -> Rational:
    """Return how far the derivatives of one row of F leave the identity, in parts of det."""
    table = matrix.tolist()
    k = (mu + 1) * (nv + 1)
    zero = flint.fmpz(0)
    one = det if along_u else zero
    two = zero if along_u else det
    worst_u = max(
        abs(k * mu * (below[j] - above[j]) - one)
        for above, below in pairwise(table)
        for j in range(nv + 1)
    )
    worst_v = max(abs(k * nv * (row[j + 1] - row[j]) - two) for row in table for j in range(nv))
    return flint.fmpq(worst_u + worst_v, abs(det))


def _moved(
    a: Matrix, b: Matrix, jacobian: tuple[Any, Any, Any, Any], det: Any, u: Rational, v: Rational
) -> tuple[Rational, Rational]:
    """Return F at a point."""
    j00, j01, j10, j11 = jacobian
    k = a.nrows() * a.ncols()
    f, g = _values(a, u, v)[0], _values(b, u, v)[0]
    return k * (j11 * f - j01 * g) / det, k * (j00 * g - j10 * f) / det


def _values(matrix: Matrix, u: Rational, v: Rational) -> tuple[Rational, Rational, Rational]:
    """Return a Bernstein sum and its two derivatives at a point, exactly."""
    return _values_of(matrix.tolist(), u, v)


def _values_of(table: list[list[Any]], u: Rational, v: Rational) -> tuple[Any, Any, Any]:
    bu, du = _basis(len(table) - 1, u)
    bv, dv = _basis(len(table[0]) - 1, v)
    zero = flint.fmpq(0)
    rows = [sum((w * x for w, x in zip(bv, row, strict=True)), zero) for row in table]
    slopes = [sum((w * x for w, x in zip(dv, row, strict=True)), zero) for row in table]
    return (
        sum((w * x for w, x in zip(bu, rows, strict=True)), zero),
        sum((w * x for w, x in zip(du, rows, strict=True)), zero),
        sum((w * x for w, x in zip(bu, slopes, strict=True)), zero),
    )


def _basis(n: int, x: Rational) -> tuple[list[Rational], list[Rational]]:
    """Return the Bernstein polynomials at a point, and their derivatives."""
    x = flint.fmpq(x)
    y = 1 - x
    xs, ys = [flint.fmpq(1)], [flint.fmpq(1)]
    for _ in range(n):
        xs.append(xs[-1] * x)
        ys.append(ys[-1] * y)
    values = [math.comb(n, i) * xs[i] * ys[n - i] for i in range(n + 1)]
    lower = [math.comb(n - 1, i) * xs[i] * ys[n - 1 - i] for i in range(n)]
    slopes = [n * ((lower[i - 1] if i else 0) - (lower[i] if i < n else 0)) for i in range(n + 1)]
    return values, slopes


def _rounded(x: Rational, number: int) -> Rational:
    """Return a fraction rounded to so many bits after the point."""
    return flint.fmpq((x * (1 << number)).floor(), 1 << number)


def _without_edge(table: list[list[Any]], end: int, along_u: bool) -> list[list[Any]]:
    """Divide a Bernstein sum by u, 1 - u, v or 1 - v: its edge there is zero."""
    if not along_u:
        rows = _without_edge([list(row) for row in zip(*table, strict=True)], end, True)
        return [list(row) for row in zip(*rows, strict=True)]
    n = len(table) - 1
    lcm = math.lcm(*range(1, n + 1))
    if end == 0:
        return [[x * (lcm * n // (i + 1)) for x in table[i + 1]] for i in range(n)]
    return [[x * (lcm * n // (n - i)) for x in table[i]] for i in range(n)]


def _distinct(
    roots: list[tuple[Rational, Rational, Rational]],
) -> list[tuple[Rational, Rational, Rational]]:
    """Keep one of the roots that neighbouring pieces share, and those on the patch."""
    slack = flint.fmpq(1, 1 << (BORDER_BITS - 8))
    kept: list[tuple[Rational, Rational, Rational]] = []
    for u, v, radius in roots:
        reach = radius + slack
        if not (-reach <= u <= 1 + reach and -reach <= v <= 1 + reach):
            continue
        if any(abs(u - x) <= reach + r and abs(v - y) <= reach + r for x, y, r in kept):
            continue
        kept.append((u, v, radius))
    return kept


def _power_form(coefficients: list[Any]) -> list[Rational]:
    """Return the power coefficients of a Bernstein sum."""
    n = len(coefficients) - 1
    out = []
    for k in range(n + 1):
        total = flint.fmpq(0)
        for i in range(k + 1):
            total += (-1) ** (k - i) * math.comb(n, k) * math.comb(k, i) * coefficients[i]
        out.append(total)
    return out


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
