"""A ray in the frame of an asphere, and how far it is above the sag."""

from typing import NamedTuple

import numpy as np

from meshing.kernels.jit import inlined, inner

# Beyond the rim the root goes on until this is left under it.
LEAST_UNDER_ROOT = 2.0**-12


class Line(NamedTuple):
    """A ray in the frame of an asphere: x + s v, |v| = 1; and the conic that it meets."""

    x: float
    y: float
    z: float
    vx: float
    vy: float
    vz: float
    across: float  # vx^2 + vy^2
    turn: float  # x vx + y vy
    curvature: float
    under_root: float


@inner
def look(line, coefficient, k, s):
    """Return g, g', g'' and F at s; ``coefficient`` is that of `AsphereTable`."""
    x, y = line.x + s * line.vx, line.y + s * line.vy
    w = x * x + y * y
    root = np.sqrt(max(1.0 - line.under_root * w, LEAST_UNDER_ROOT))
    rate = 0.5 * line.curvature / root
    bend = 0.5 * rate * line.under_root / (root * root)
    a = b = e = 0.0
    q = w - coefficient[k, 0]
    for j in range(coefficient.shape[1] - 1, 1, -1):
        e = e * q + b
        b = b * q + a
        a = a * q + coefficient[k, j]
    sag = line.curvature * w / (1.0 + root) + (coefficient[k, 1] + a * q)
    rate += a + b * q
    bend += 2.0 * (b + e * q)
    turn = 2.0 * (x * line.vx + y * line.vy)
    g = (line.z + s * line.vz) - sag
    return g, line.vz - rate * turn, -(bend * turn * turn + 2.0 * rate * line.across), rate


@inlined
def gradient(line, s, rate):
    """Return the length of the gradient of z - sag(w), where dsag / dw is ``rate``."""
    x, y = line.x + s * line.vx, line.y + s * line.vy
    return np.sqrt(1.0 + 4.0 * (x * x + y * y) * rate * rate)
