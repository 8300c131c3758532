"""Texture lookups for a batch of hits, from one flat table."""

import math
from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import inlined, kernel

CONSTANT, IMAGE, CHECKER_UV, CHECKER_WORLD = 0, 1, 2, 3
REPEAT, CLAMP = 0, 1


class TextureTable(NamedTuple):
    """All textures of a scene; n rows."""

    kind: Any  # (n,) int32
    number: Any  # (n, 9) float64: colour, second colour, scale
    image: Any  # (n, 4) int64: first texel, height, width, wrap
    texel: Any  # (m, 3) float32, linear, row 0 at the top


@inlined
def _wrapped(index, size, wrap):
    """Return the texel of an index from -1 to ``size``."""
    if wrap == REPEAT:
        # Not by a remainder, which takes a division of integers.
        if index < 0:
            index += size
        elif index >= size:
            index -= size
    return min(max(index, 0), size - 1)


@inlined
def _texel_row(coordinate, size, wrap):
    """Return the two neighbouring texels of a coordinate in [0, 1] and the weight of the second."""
    if wrap == REPEAT:
        # Reduced before it is scaled: a coordinate of 1e9 must not overflow the index.
        coordinate -= math.floor(coordinate)
    else:
        coordinate = min(max(coordinate, 0.0), 1.0)
    place = coordinate * size - 0.5
    low = math.floor(place)
    first = int(low)
    return _wrapped(first, size, wrap), _wrapped(first + 1, size, wrap), place - low


@inlined
def texture_color(textures, row, u, v, x, y, z):
    """Return the linear colour of one texture at one point."""
    kind = textures.kind[row]
    number = textures.number
    if kind == IMAGE:
        start, height = textures.image[row, 0], textures.image[row, 1]
        width, wrap = textures.image[row, 2], textures.image[row, 3]
        left, right, across = _texel_row(u, width, wrap)
        low, high, down = _texel_row(1.0 - v, height, wrap)
        low, high = start + low * width, start + high * width
        w00, w01 = (1.0 - across) * (1.0 - down), across * (1.0 - down)
        w10, w11 = (1.0 - across) * down, across * down
        a, b, c, d = low + left, low + right, high + left, high + right
        t = textures.texel
        return (
            w00 * t[a, 0] + w01 * t[b, 0] + w10 * t[c, 0] + w11 * t[d, 0],
            w00 * t[a, 1] + w01 * t[b, 1] + w10 * t[c, 1] + w11 * t[d, 1],
            w00 * t[a, 2] + w01 * t[b, 2] + w10 * t[c, 2] + w11 * t[d, 2],
        )
    is_second = False
    if kind == CHECKER_UV:
        squares = math.floor(u * number[row, 6]) + math.floor(v * number[row, 7])
        is_second = squares % 2.0 != 0.0
    elif kind == CHECKER_WORLD:
        # A sine is negative in every second interval of pi. Counted, not computed: on the plane z = 0
        # the third one is 0.
        halves = (
            np.floor(number[row, 6] * x / math.pi)
            + np.floor(number[row, 7] * y / math.pi)
            + np.floor(number[row, 8] * z / math.pi)
        )
        is_second = halves % 2.0 != 0.0
    first = 3 if is_second else 0
    return number[row, first], number[row, first + 1], number[row, first + 2]


@kernel(allocates=True)
def lobe_colors(textures, lobe_texture, factor, first_lobe, material, u, v, position, colors):
    """Look up ``colors`` (n, most lobes, 3) of the lobes of each hit; not of negative materials.

    Each lobe has a texture, and a factor on its colour.
    """
    for i in range(material.size):
        if material[i] < 0:
            continue
        first = first_lobe[material[i]]
        for j in range(first_lobe[material[i] + 1] - first):
            r, g, b = texture_color(
                textures, lobe_texture[first + j], u[i], v[i],
                position[i, 0], position[i, 1], position[i, 2],
            )  # fmt: skip
            part = factor[first + j]
            colors[i, j, 0], colors[i, j, 1], colors[i, j, 2] = part * r, part * g, part * b
