"""The table of textures of a scene."""

import numpy as np

from hybrid_rt.core.records import IntArray
from hybrid_rt.shading.kernels.texture import CONSTANT, TextureTable
from hybrid_rt.textures.texture import Texture


def compile_textures(textures: list[Texture]) -> TextureTable:
    """Build the texture table; row i is texture i."""
    rows = [texture.row for texture in textures]
    images = np.zeros((len(rows), 4), dtype=np.int64)
    # One black texel keeps the array's type where no texture is a picture.
    texels = [np.zeros((1, 3), dtype=np.float32)]
    start = 1
    for image, row in zip(images, rows, strict=True):
        if row.texels is not None:
            height, width = row.texels.shape[:2]
            image[:] = start, height, width, row.wrap
            texels.append(row.texels.reshape(-1, 3))
            start += height * width
    return TextureTable(
        kind=np.array([row.kind for row in rows], dtype=np.int32),
        number=np.array([row.number for row in rows], dtype=np.float64).reshape(-1, 9),
        image=images,
        texel=np.concatenate(texels),
    )


def needs_lookup(textures: TextureTable, rows: IntArray) -> bool:
    """Tell whether any of the colours in these rows varies over its surface."""
    return bool((textures.kind[rows] != CONSTANT).any())
