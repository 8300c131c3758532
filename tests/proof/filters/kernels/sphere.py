"""Certain crossings of rays with a sphere: the quadratic, in double-double balls."""

import math
from typing import Any, NamedTuple

from meshing.kernels.jit import inner, kernel
from proof.filters.kernels.balls import (
    minus,
    over,
    plus,
    product,
    sign,
    square_root,
    times,
)
from proof.filters.kernels.first import (
    finish,
    note,
    nothing,
    square_of,
    start,
    unsure,
)


class Ball(NamedTuple):
    """One sphere."""

    centre: Any  # (3,) float64
    radius: float


@inner
def _ray(surface, o, d, leaves, hit_t, scratch, out):
    away, radius = scratch.away, surface.radius
    shift, length, reach = start(o, d, surface.centre, surface.centre, radius, leaves, away)
    if reach < 0.0:
        nothing(out)
        return
    a = square_of(d)
    b, c = (0.0, 0.0, 0.0), product(-radius, radius)
    for k in range(3):
        x = away[k, 0], away[k, 1], away[k, 2]
        b = plus(b, times(x, (d[k], 0.0, 0.0)))
        c = plus(c, times(x, x))
    square = minus(times(b, b), times(a, c))
    side = sign(square)
    if side < 0:
        nothing(out)
        return
    if side == 0:
        unsure(out)
        return
    root = square_root(square)
    cosine = root[0] / (length * radius)
    count = note(scratch.crossings, 0, over(minus((-b[0], -b[1], b[2]), root), a), cosine)
    count = note(scratch.crossings, count, over(minus(root, b), a), cosine)
    finish(
        scratch.crossings, count, shift, o, length, surface.centre, 2.0 * radius, leaves, hit_t,
        math.inf, out,
    )  # fmt: skip


@kernel
def first_on_sphere(surface, origins, directions, leaves, hit_t, scratch, out):
    """Say of each ray what is certain of its first crossing; see `turned.first_on_turned`."""
    for i in range(origins.shape[0]):
        _ray(surface, origins[i], directions[i], leaves[i], hit_t[i], scratch, out[i])
