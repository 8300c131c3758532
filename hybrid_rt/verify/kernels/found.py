"""What the oracle keeps of one ray: a row of figures, lowered by every surface in turn."""

import numpy as np

from meshing.kernels.jit import inner

# Columns of the row. FOLD_T: nearest candidate that is undecided within rounding. EDGE_*: nearest
# place where the ray passes the rim of a patch, a pole or an edge within rounding; whether that
# matters is decided by shifting the ray (`bisection.py`).
T, OBJECT, PATCH, U, V, COS, FOLD_T = 0, 1, 2, 3, 4, 5, 6
EDGE_T, EDGE_BAND, EDGE_OBJECT, EDGE_PATCH, EDGE_U, EDGE_V = 7, 8, 9, 10, 11, 12
NODES, UNRESOLVED = 13, 14
COLUMNS = 15

# Decisions with a margin below this many roundings at the scale of ray and object are ambiguous.
BAND = 64.0 * 2.0**-52


@inner
def offer(found, i, t, object_id, patch, u, v, cos, doubt, t_min):
    """Take a root if it is the first; ``doubt`` is the band in units of t."""
    if abs(t - t_min) <= doubt:
        found[i, FOLD_T] = min(found[i, FOLD_T], t)
    if t_min < t < found[i, T]:
        found[i, T] = t
        found[i, OBJECT] = object_id
        found[i, PATCH] = patch
        found[i, U] = u
        found[i, V] = v
        found[i, COS] = cos


@inner
def note_fold(found, i, t, t_min):
    """Keep the nearest candidate that rounding leaves open."""
    if t > t_min:
        found[i, FOLD_T] = min(found[i, FOLD_T], t)


@inner
def note_edge(found, i, t, band, object_id, patch, u, v, t_min):
    """Keep the nearest place where the ray meets a rim."""
    if t_min < t < found[i, EDGE_T]:
        found[i, EDGE_T] = t
        found[i, EDGE_BAND] = band
        found[i, EDGE_OBJECT] = object_id
        found[i, EDGE_PATCH] = patch
        found[i, EDGE_U] = u
        found[i, EDGE_V] = v


@inner
def slab(boxes, p, o, i, d, wide):
    """Distance in units of t at which a ray enters a box widened by ``wide``; inf if it does not."""
    low, high = -np.inf, np.inf
    for c in range(3):
        a, b = boxes[p, 0, c] - wide - o[i, c], boxes[p, 1, c] + wide - o[i, c]
        if d[i, c] == 0.0:
            if a > 0.0 or b < 0.0:
                return np.inf
        else:
            x, y = a / d[i, c], b / d[i, c]
            low, high = max(low, min(x, y)), min(high, max(x, y))
    # Each side is off by three roundings.
    if low - 4e-15 * abs(low) > high + 4e-15 * abs(high):
        return np.inf
    return low
