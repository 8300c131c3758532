"""Sheets of patches: rays meet the patches, hits name the parameters of the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.intersection.kernels.patch.sheet import name_on_sheets
from hybrid_rt.intersection.kind import Finished


class Sheets:
    """The surfaces of a kind whose pieces share one (u, v): sheets of patches, trimmed profiles.

    ``spans``, dict of object id to (k, 4): u0, u1, v0, v1 of each piece.
    """

    def __init__(self, spans: dict[int, FloatArray]) -> None:
        self._first = np.full(max(spans) + 1, -1, np.int64)
        ends = np.cumsum([0, *map(len, spans.values())])
        self._first[list(spans)] = ends[:-1]
        self._spans = np.concatenate(list(spans.values()))

    @classmethod
    def of(cls, members: Sequence[tuple[int, Any]]) -> Sheets | None:
        """Return those among (object id, surface); None if there are none."""
        spans = {i: surface.spans for i, surface in members if surface.spans is not None}
        return cls(spans) if spans else None

    def finish(self, object_id: IntArray, out: Finished) -> None:
        """Replace the pieces' u and v in ``out`` by those of the whole surface."""
        name_on_sheets(*self.arguments(object_id, out))

    def arguments(self, object_id: IntArray, out: Finished) -> tuple[Any, ...]:
        """Return the arguments of `name_on_sheets`, by which `finish` does it."""
        return object_id, self._first, self._spans, out.patch_id, out.u, out.v
