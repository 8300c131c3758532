"""All lights of a scene in one flat table."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid_rt.kernels.light import LightTable
from hybrid_rt.lights.light import Light


def compile_lights(lights: Sequence[Light]) -> LightTable:
    """Lay lights out for the kernels, row i for light i."""
    rows = [light.row for light in lights]

    def column(name: str) -> np.ndarray:
        return np.array([getattr(row, name) for row in rows], dtype=np.float64).reshape(-1, 3)

    return LightTable(
        kind=np.array([row.kind for row in rows], dtype=np.int32),
        origin=column("origin"),
        edge_u=column("edge_u"),
        edge_v=column("edge_v"),
        strength=column("strength"),
    )
