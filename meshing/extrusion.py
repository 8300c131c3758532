"""Extrusions: profiles moved along a straight line, as Bezier patches."""

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from meshing.bezier import BezierPatches
from meshing.checks import as_vector
from meshing.double_double import exact_sum
from meshing.profiles import as_segments, as_weights


def Extrusion(
    profile: ArrayLike | Iterable[ArrayLike],
    direction: ArrayLike,
    weights: ArrayLike | Sequence[ArrayLike | None] | None = None,
) -> BezierPatches:
    """Return the surface that a Bezier profile sweeps as it moves along a straight line.

    S(u, v) = C(u) + v direction, which is exactly a patch of degree n x 1 for each segment C. The
    normal is along C' x direction.

    Parameters
    ----------
    profile : (n + 1, 3) array, or a sequence of such segments
        Bezier points in scene units, degree 1 to 30; they need not lie in a plane.
    direction : (3,) array
        From v = 0 to v = 1, in scene units; its length is that of the extrusion.
    weights : (n + 1,) array, or a sequence of one for each segment, optional
        Weights of the Bezier points, positive; they make a segment rational, as circular arcs are
        (`circular_arc`). None, also for single segments, means that all are 1.

    Returns
    -------
    BezierPatches
        One patch for each segment.

    Raises
    ------
    ValueError, TypeError
        For wrong shapes, numbers that are not finite, a direction that is zero or along a whole
        segment, and weights that `BezierPatches` refuses.
    """
    way = as_vector(direction, "Extrusion direction")
    if not way.any():
        raise ValueError("Extrusion direction is the zero vector: pass where the profile ends")
    segments = as_segments(profile, "Extrusion profile", "(n + 1, 3)", 3)
    given = as_weights(weights, segments, "Extrusion weights")
    size = float(np.linalg.norm(way))
    for i, segment in enumerate(segments):
        steps = np.diff(segment, axis=0)
        aside = np.linalg.norm(np.cross(steps, way / size), axis=1).max()
        # Far from the origin the points themselves are rounded by as much as the second term.
        extent, place = np.abs(segment - segment[0]).max(), np.abs(segment).max()
        if not aside > 2.0**-40 * extent + 2.0**-50 * place:
            raise ValueError(
                f"Extrusion profile segment {i} runs along direction {way.tolist()} all the way: "
                "pass another direction, there would be no area"
            )
    ends = [exact_sum(segment, way) for segment in segments]
    nets = [
        (np.stack([segment, end], axis=1), np.stack([np.zeros_like(left), left], axis=1))
        for segment, (end, left) in zip(segments, ends, strict=True)
    ]
    if all(w is None for w in given):
        return BezierPatches.of_pairs(nets)
    return BezierPatches.of_pairs(
        nets,
        [
            np.ones(net.shape[:2]) if w is None else np.column_stack([w, w])
            for (net, _), w in zip(nets, given, strict=True)
        ],
    )
