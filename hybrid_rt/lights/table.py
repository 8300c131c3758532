"""The table of lights, and the probabilities with which one of them is sampled."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.light import LightRow
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA, LightTable

# Where one light is asked, half the choices follow power and half go round: the brightest light
# may be far away.
ROUND = 0.5


def compile_lights(
    rows: Sequence[LightRow], texture_of: Sequence[int], has_sky: bool
) -> LightTable:
    """Build the light table; row i is light i, ``texture_of`` the row of each one's texture, or -1."""

    def column(name: str) -> FloatArray:
        return np.array([getattr(row, name) for row in rows], dtype=np.float64).reshape(-1, 3)

    chance = _chances(np.array([row.power for row in rows]), has_sky)
    kind = np.array([row.kind for row in rows], dtype=np.int32)
    return LightTable(
        kind=kind,
        origin=column("origin"),
        edge_u=column("edge_u"),
        edge_v=column("edge_v"),
        strength=column("strength"),
        texture=np.array(texture_of, dtype=np.int32),
        chance=chance,
        emit=_emission(chance, kind),
    )


def _chances(power: FloatArray, has_sky: bool) -> FloatArray:
    """Return how often each light is asked, the sky last; nothing for lights without power."""
    chance = np.zeros(power.size + 1)
    shines = power > 0.0
    if shines.any():
        chance[:-1] = (1.0 - ROUND) * power / power.sum() + ROUND * shines / shines.sum()
    if has_sky:
        # How much of it arrives, nobody knows beforehand: as often as a light of mean power.
        sky = 1.0 / (1.0 + shines.sum())
        chance *= 1.0 - sky
        chance[-1] = sky
    return chance


def _emission(chance: FloatArray, kind: NDArray[np.int32]) -> FloatArray:
    """Return how often each light begins a light path: those that have an area, as they are asked."""
    emit = chance.copy()
    emit[-1] = 0.0
    emit[:-1][np.isin(kind, WITHOUT_AREA)] = 0.0
    total = emit.sum()
    return emit / total if total > 0.0 else emit
