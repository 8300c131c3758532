"""The table of lobes of a scene, and the textures that colour them."""

from collections.abc import Sequence

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.materials.material import Material
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.lobes import rough_conductor, rough_dielectric
from hybrid_rt.shading.kernels.lobes.register import (
    METAL,
    NARROW,
    PHONG,
    ROUGH_CONDUCTOR,
    ROUGH_DIELECTRIC,
    TRANSMITS,
)
from hybrid_rt.shading.kernels.texture import TextureTable
from hybrid_rt.textures.table import compile_textures
from hybrid_rt.textures.texture import Texture

# Narrow lobes as `softened` widens them: roughness, whose square is the alpha of GGX, and fuzz.
SOFT = 0.5


def compile_materials(
    materials: list[Material], more: Sequence[Texture] = ()
) -> tuple[LobeTable, TextureTable]:
    """Build the lobe and texture tables; material i has the rows first[i] to first[i + 1].

    The textures ``more`` become the last rows of the texture table, in order.
    """
    lobes = [lobe for material in materials for lobe in material.lobes]
    textures: list[Texture] = []
    row_of: dict[int, int] = {}  # a picture used twice is stored once
    for lobe in lobes:
        if id(lobe.color) not in row_of:
            row_of[id(lobe.color)] = len(textures)
            textures.append(lobe.color)
    numbers = np.zeros((len(lobes), max((len(lobe.number) for lobe in lobes), default=0) or 1))
    for row, lobe in zip(numbers, lobes, strict=True):
        row[: len(lobe.number)] = lobe.number
    table = LobeTable(
        kind=np.array([lobe.kind for lobe in lobes], dtype=np.int32),
        traits=np.array([lobe.traits for lobe in lobes], dtype=np.int32),
        texture=np.array([row_of[id(lobe.color)] for lobe in lobes], dtype=np.int32),
        number=numbers,
        weight=np.array([lobe.weight for lobe in lobes], dtype=np.float64),
        first=np.cumsum([0, *(len(material.lobes) for material in materials)], dtype=np.int32),
    )
    return table, compile_textures([*textures, *more])


def color_factor(lobes: LobeTable) -> FloatArray:
    """Return the factor on the colour of each lobe: its weight; 1 for the tint of glass."""
    return np.where(lobes.traits & TRANSMITS, 1.0, lobes.weight)


def softened(lobes: LobeTable) -> LobeTable:
    """Return the table with all narrow lobes at least as wide as those of roughness `SOFT`.

    They send out about as much light, shown by many samples instead of few (Kaplanyan and Dachsbacher, 2013).
    """
    number = lobes.number.copy()
    is_narrow = lobes.traits & NARROW != 0
    alpha = SOFT * SOFT
    for kind, column, least in (
        (METAL, 0, SOFT),
        (ROUGH_CONDUCTOR, rough_conductor.ALPHA, alpha),
        (ROUGH_DIELECTRIC, rough_dielectric.ALPHA, alpha),
    ):
        rows = is_narrow & (lobes.kind == kind)
        if rows.any():
            number[rows, column] = np.maximum(number[rows, column], least)
    # The exponent whose lobe is about as wide (Walter et al. 2007, equation of alpha).
    rows = is_narrow & (lobes.kind == PHONG)
    number[rows, 0] = np.minimum(number[rows, 0], 2.0 / (alpha * alpha) - 2.0)
    return lobes._replace(number=number)
