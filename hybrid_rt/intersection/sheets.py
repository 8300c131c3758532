"""Sheets of patches: rays meet the patches, hits name the parameters of the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from hybrid_rt.core.records import IntArray
from hybrid_rt.intersection.kernels.patch.sheet import name_on_sheet
from hybrid_rt.intersection.kind import Finished
from meshing.sheet import PatchSheet
from meshing.trimmed import TrimmedSurface


class Sheets:
    """The sheets among the surfaces of a kind.

    Parameters
    ----------
    sheets : dict of object id to PatchSheet
    """

    def __init__(self, sheets: dict[int, PatchSheet]) -> None:
        self._sheets = sheets

    @classmethod
    def of(cls, members: Sequence[tuple[int, Any]]) -> Sheets | None:
        """Return those among (object id, surface); None if there are none."""
        sheets = {}
        for i, surface in members:
            whole = surface.surface if isinstance(surface, TrimmedSurface) else surface
            if isinstance(whole, PatchSheet):
                sheets[i] = whole
        return cls(sheets) if sheets else None

    def finish(self, object_id: IntArray, out: Finished) -> None:
        """Replace the patches' u and v in ``out`` by the sheets'."""
        for number, sheet in self._sheets.items():
            name_on_sheet(object_id, number, sheet.spans, out.patch_id, out.u, out.v)
