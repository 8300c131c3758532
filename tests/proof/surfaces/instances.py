"""Instances: each place's inverse in fractions takes a ray to the surfaces as they were given."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord
from hybrid_rt.primitives.instances import Instances
from proof.exact.crossings import (
    Crosser,
    Crossing,
    Rational,
    RationalVector,
    cross,
    dot,
    rational,
    rationals,
)
from proof.surface import Gap, IsTouched, Judged, judged_of


class Place(NamedTuple):
    """A matrix, exact: its shift, the rows of its inverse times the determinant, and that one."""

    shift: RationalVector
    rows: Sequence[RationalVector]
    volume: Rational
    scale: float

    @classmethod
    def of(cls, matrix: FloatArray, scale: float = 1.0) -> Place:
        """Return the place of a matrix (3, 4)."""
        columns = [rationals(column) for column in matrix[:, :3].T]
        rows = [cross(columns[k - 2], columns[k - 1]) for k in range(3)]
        return cls(rationals(matrix[:, 3]), rows, dot(columns[0], rows[0]), scale)

    def point(self, p: RationalVector) -> list[Rational]:
        """Return a point in the frame of the surfaces."""
        return self.vector([a - b for a, b in zip(p, self.shift, strict=True)])

    def vector(self, x: RationalVector) -> list[Rational]:
        """Return a vector in the frame of the surfaces."""
        return [dot(row, x) / self.volume for row in self.rows]


class JudgedInstances(Judged, of=Instances):
    """Crossings with surfaces in all places; the screen leaves everything to exact arithmetic."""

    surface: Instances

    def __init__(self, surface: Instances) -> None:
        super().__init__(surface)
        self._members = [judged_of(member) for member in surface.surfaces]
        pairs = zip(surface.matrices, surface.scale.tolist(), strict=True)
        self._places = [Place.of(matrix, scale) for matrix, scale in pairs]

    def crosser(self) -> Crosser:
        """Return a function that asks each surface about the ray as seen from each place."""
        crossers = [member.crosser() for member in self._members]
        first = np.cumsum([0, *map(len, self.surface.surfaces)]).tolist()
        each = self.surface.n_patches

        def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
            found = []
            for number, place in enumerate(self._places):
                p, q = place.point(o), place.vector(d)
                for begin, crosser in zip(first, crossers, strict=False):
                    found += [
                        replace(
                            one,
                            patch_id=number * each + begin + one.patch_id,
                            to_edge=one.to_edge * place.scale,
                        )
                        for one in crosser(p, q)
                    ]
            return found

        return crossings

    def gap(self) -> Gap:
        """Return a function that measures in the place of the patch."""
        gaps = [member.gap() for member in self._members]

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            number, member, own = (int(x) for x in self.surface.split(patch))
            place = self._places[number]
            return place.scale * gaps[member](own, u, v, place.point(point))

        return gap

    def touch(self) -> IsTouched:
        """Return a function that asks each surface about the ray as seen from each place, rounded."""
        touches = [member.touch() for member in self._members]

        def is_touched(origin: FloatArray, d: FloatArray, reach: float, leaves: bool) -> bool:
            for place in self._places:
                o = np.array([float(x) for x in place.point(rationals(origin))])
                along = np.array([float(x) for x in place.vector(rationals(d))])
                unit = along / np.linalg.norm(along)
                if any(touch(o, unit, reach / place.scale, leaves) for touch in touches):
                    return True
            return False

        return is_touched

    def ball(self) -> tuple[list[float], float | None]:
        """Return the middle and the size of the only place as those of its only surface, else of the box."""
        if len(self._places) > 1 or len(self._members) > 1:
            return super().ball()
        place, (middle, size) = self._places[0], self._members[0].ball()
        away = self.surface.matrices[0, :, :3] @ np.array(middle)
        there = [float(rational(x) + s) for x, s in zip(away.tolist(), place.shift, strict=True)]
        return there, None if size is None else place.scale * size


def one_by_one(instances: Instances, hits: HitRecord) -> tuple[list[Instances], HitRecord]:
    """Return each surface in each place as an object of its own, and hits as hits on these.

    So that the band is that of the surface in its place.
    """
    several, n = [], len(instances.surfaces)
    for matrix in instances.matrices:
        several += [Instances(surface, matrix[None]) for surface in instances.surfaces]
    place, member, own = instances.split(np.maximum(hits.patch_id, 0))
    number = np.where(hits.hit, place * n + member, -1).astype(np.int32)
    return several, replace(hits, object_id=number, patch_id=own.astype(np.int32))
