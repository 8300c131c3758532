"""What is plain to see of a piece in float64, and the exact test where it is not.

See `proof.exact.patches`.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from proof.exact.patch_pieces import Matrix, mean_jacobian, split_in_two

# Float64 numbers of pieces keep so far from 0, in parts of the largest: they are rounded once. What is
# below the second part of others, where rounding may count, is looked at again in whole.
ROUNDED, PLAIN = 2.0**-48, 1e-9
# A piece that turns by more, up to rounding, is not worth the exact test.
MAY_TURN = 0.115


class Look:
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
        return not is_plain and _is_beside(*split_in_two(self.both))

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
    """As `Look.is_beside`, exactly."""
    if _one_sign(a.entries()) or _one_sign(b.entries()):
        return True
    fu, fv, gu, gv = mean_jacobian(a, b)
    x, y = (fu, gu) if fu * fu + gu * gu >= fv * fv + gv * gv else (fv, gv)
    if x == 0 and y == 0:
        return False
    # Thirty bits of the direction are enough; whatever it is, the test is exact.
    shift = max(max(abs(x), abs(y)).bit_length() - 30, 0)
    x, y = x >> shift, y >> shift
    if x == 0 and y == 0:
        return False
    return _one_sign((x * b - y * a).entries()) or _one_sign((x * a + y * b).entries())


def _one_sign(numbers: list[Any]) -> bool:
    first = numbers[0]
    if first == 0:
        return False
    if first > 0:
        return all(x > 0 for x in numbers)
    return all(x < 0 for x in numbers)
