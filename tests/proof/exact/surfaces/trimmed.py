"""Exact crossings with trimmed surfaces: those with the whole surface that are inside the loops."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from meshing.trimmed import TrimmedSurface
from proof.exact.crossings import POINT, Crosser, Crossing, RationalVector, bits
from proof.exact.exact_surface import ExactSurface, Gap, IsTouched, exact_of
from proof.exact.loops import ExactLoops


class ExactTrimmed(ExactSurface, of=TrimmedSurface):
    """Exact crossings with the part of a surface inside loops, of no gap.

    Parameters of crossings are rounded, so the side of one that is within rounding of a curve is open;
    the oracle finds such crossings doubtful, since rays beside have none.

    Raises
    ------
    ValueError
        If the surface has a gap: what it accepts beyond its edge is no crossing.
    """

    surface: TrimmedSurface

    def __init__(self, surface: TrimmedSurface) -> None:
        super().__init__(surface)
        if surface.gap > 0.0:
            raise ValueError(f"{surface!r} has a gap: pass it without, exact crossings have none")
        self._whole = exact_of(surface.surface)
        self._loops = ExactLoops(surface.loops, surface.closes)

    def crosser(self) -> Crosser:
        """Return a function that finds the crossings of the whole surface and leaves some out."""
        crosser, locate, spans = self._whole.crosser(), self._whole.locate(), self.surface.spans

        def is_kept(one: Crossing, o: RationalVector, d: RationalVector) -> bool:
            if one.kind != POINT:
                return True
            at = one.u, one.v
            if locate is not None:
                with bits(256):
                    at = locate([a + one.t * b for a, b in zip(o, d, strict=True)])
            u, v = map(Fraction, at)
            if spans is not None:
                u0, u1, v0, v1 = map(Fraction, spans[one.patch_id].tolist())
                u, v = u0 + u * (u1 - u0), v0 + v * (v1 - v0)
            return self._loops.is_inside(_within(u), _within(v)) is not False

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            return [one for one in crosser(o, d) if is_kept(one, o, d)]

        return crossings

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v) of the whole surface."""
        gap, spans = self._whole.gap(), self.surface.joined_spans
        if spans is None:
            return gap

        def gap_of_segment(patch: int, u: float, v: float, point: list[Any]) -> float:
            _, _, v0, v1 = spans[patch].tolist()
            return gap(patch, u, (v - v0) / (v1 - v0), point)

        return gap_of_segment

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent to the whole surface."""
        return self._whole.touch()

    def ball(self) -> tuple[list[float], float | None]:
        """Return middle and diameter of the whole surface."""
        return self._whole.ball()


def _within(x: Fraction) -> Fraction:
    """Return a parameter just inside the border: loops along it enclose it."""
    least = Fraction(1, 1 << 60)
    return min(max(x, least), 1 - least)
