"""Environment lights: radiance by direction, and directions sampled by radiance.

A gradient is linear in the cosine to the zenith, so its distribution is inverted in closed form. An
image is importance-sampled by texels: first the row, then the column.
"""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inlined, kernel

NO_SKY, GRADIENT, PICTURE = 0, 1, 2


class EnvironmentTable(NamedTuple):
    """An environment light: a gradient or an image."""

    kind: Any  # int
    # (3, 3) float64, rows: azimuth 0, a quarter turn (for a picture to the right), up
    frame: Any
    colors: Any  # (2, 3) float64, radiance straight down and straight up, of a gradient
    heights: Any  # (2,) float64, relative density of a gradient straight down and up
    texel: Any  # (height, width, 3) float32, row 0 at the top
    rows: Any  # (1, height + 1) float64, share of all rows before each
    columns: Any  # (height, width + 1) float64, share of the row before each texel


@inlined
def _place(sky, x, y, z):
    """Return u and v of a direction: azimuth over 2 pi, and 1 straight up, 0 straight down."""
    f = sky.frame
    across = f[0, 0] * x + f[0, 1] * y + f[0, 2] * z
    along = f[1, 0] * x + f[1, 1] * y + f[1, 2] * z
    height = f[2, 0] * x + f[2, 1] * y + f[2, 2] * z
    turn = math.atan2(along, across) / (2.0 * math.pi)
    return turn - math.floor(turn), math.atan2(height, math.hypot(across, along)) / math.pi + 0.5


@inlined
def sky_radiance(sky, x, y, z):
    """Return the radiance from a unit direction, bilinear between texels."""
    if sky.kind == GRADIENT:
        f = sky.frame
        s = 0.5 + 0.5 * (f[2, 0] * x + f[2, 1] * y + f[2, 2] * z)
        c = sky.colors
        return (
            (1.0 - s) * c[0, 0] + s * c[1, 0],
            (1.0 - s) * c[0, 1] + s * c[1, 1],
            (1.0 - s) * c[0, 2] + s * c[1, 2],
        )
    if sky.kind != PICTURE:
        return 0.0, 0.0, 0.0
    u, v = _place(sky, x, y, z)
    height, width = sky.texel.shape[0], sky.texel.shape[1]
    column, row = u * width - 0.5, (1.0 - v) * height - 0.5
    left, top = math.floor(column), math.floor(row)
    across, down = column - left, row - top
    i0, i1 = min(max(int(top), 0), height - 1), min(max(int(top) + 1, 0), height - 1)
    j0, j1 = int(left) % width, (int(left) + 1) % width
    a, b = (1.0 - across) * (1.0 - down), across * (1.0 - down)
    c, d = (1.0 - across) * down, across * down
    t = sky.texel
    return (
        a * t[i0, j0, 0] + b * t[i0, j1, 0] + c * t[i1, j0, 0] + d * t[i1, j1, 0],
        a * t[i0, j0, 1] + b * t[i0, j1, 1] + c * t[i1, j0, 1] + d * t[i1, j1, 1],
        a * t[i0, j0, 2] + b * t[i0, j1, 2] + c * t[i1, j0, 2] + d * t[i1, j1, 2],
    )


@inlined
def sky_pdf(sky, x, y, z):
    """Return the pdf per solid angle of a direction sampled by `sky_direction`."""
    if sky.kind == GRADIENT:
        f = sky.frame
        s = 0.5 + 0.5 * (f[2, 0] * x + f[2, 1] * y + f[2, 2] * z)
        low, high = sky.heights[0], sky.heights[1]
        return ((1.0 - s) * low + s * high) / (2.0 * math.pi * (low + high))
    if sky.kind != PICTURE:
        return 0.0
    u, v = _place(sky, x, y, z)
    height, width = sky.texel.shape[0], sky.texel.shape[1]
    i = min(int((1.0 - v) * height), height - 1)
    j = min(int(u * width), width - 1)
    share = (sky.rows[0, i + 1] - sky.rows[0, i]) * (sky.columns[i, j + 1] - sky.columns[i, j])
    # Within a row of texels directions are even per steradian: see `sky_direction`.
    band = math.cos(math.pi * i / height) - math.cos(math.pi * (i + 1) / height)
    return share * width / (2.0 * math.pi * band)


@inlined
def _find(shares, row, n, xi):
    """Return the last of n places in a row whose share before it is at most xi."""
    low, high = 0, n
    while high - low > 1:
        middle = (low + high) // 2
        if shares[row, middle] <= xi:
            low = middle
        else:
            high = middle
    return low


@inlined
def sky_direction(sky, xi, eta):
    """Sample a unit direction by radiance."""
    if sky.kind == GRADIENT:
        low, high = sky.heights[0], sky.heights[1]
        # Density low + (high - low) s on [0, 1]: solve (high - low) s^2 / 2 + low s = xi mean,
        # in the form that does not cancel when both are nearly equal.
        aim = xi * (low + high)
        s = aim / (low + math.sqrt(low * low + (high - low) * aim)) if aim > 0.0 else 0.0
        cosine, turn = 2.0 * min(s, 1.0) - 1.0, eta
    else:
        height, width = sky.texel.shape[0], sky.texel.shape[1]
        i = _find(sky.rows, 0, height, xi)
        down = (xi - sky.rows[0, i]) / (sky.rows[0, i + 1] - sky.rows[0, i])
        j = _find(sky.columns, i, width, eta)
        across = (eta - sky.columns[i, j]) / (sky.columns[i, j + 1] - sky.columns[i, j])
        top, bottom = math.cos(math.pi * i / height), math.cos(math.pi * (i + 1) / height)
        cosine, turn = top + (bottom - top) * down, (j + across) / width
    ring = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    a, b = ring * math.cos(2.0 * math.pi * turn), ring * math.sin(2.0 * math.pi * turn)
    f = sky.frame
    return (
        a * f[0, 0] + b * f[1, 0] + cosine * f[2, 0],
        a * f[0, 1] + b * f[1, 1] + cosine * f[2, 1],
        a * f[0, 2] + b * f[1, 2] + cosine * f[2, 2],
    )


@kernel(allocates=True)
def sky_on_rays(sky, direction, radiance, pdf):
    """Fill radiance (n, 3) and pdf (n,) for unit directions (n, 3)."""
    for i in range(direction.shape[0]):
        x, y, z = direction[i, 0], direction[i, 1], direction[i, 2]
        radiance[i, 0], radiance[i, 1], radiance[i, 2] = sky_radiance(sky, x, y, z)
        pdf[i] = sky_pdf(sky, x, y, z)
