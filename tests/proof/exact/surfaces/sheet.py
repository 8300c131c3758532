"""Exact crossings with sheets: those with their patches."""

from __future__ import annotations

from typing import Any

import numpy as np

from meshing.sheet import PatchSheet
from meshing.spans import within_patch
from proof.exact.crossings import Crosser
from proof.exact.exact_surface import ExactSurface, Gap, IsTouched
from proof.exact.surfaces.bezier import ExactPatches


class ExactSheet(ExactSurface, of=PatchSheet):
    """Exact crossings with a sheet of patches."""

    surface: PatchSheet

    def __init__(self, surface: PatchSheet) -> None:
        super().__init__(surface)
        self._pieces = ExactPatches(surface.pieces)

    def crosser(self) -> Crosser:
        """Return a function that isolates the roots of all patches."""
        return self._pieces.crosser()

    def gap(self) -> Gap:
        """Return a function that measures from S(u, v), (u, v) across the sheet."""
        inner = self._pieces.gap()

        def gap(patch: int, u: float, v: float, point: list[Any]) -> float:
            at = np.array([u]), np.array([v]), np.array([patch])
            a, b = within_patch(self.surface.spans, *at)
            return inner(patch, float(a[0]), float(b[0]), point)

        return gap

    def touch(self) -> IsTouched:
        """Return a function that looks for places where the ray is tangent."""
        return self._pieces.touch()
