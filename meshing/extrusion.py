"""Extrusions: profiles moved along a straight line, as Bezier patches."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from meshing.bezier import BezierPatches
from meshing.checks import FloatArray, as_floats, as_vector, shown
from meshing.double_double import exact_sum


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
    segments = _segments(profile)
    given = _weights(weights, segments)
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


def _segments(profile: ArrayLike | Iterable[ArrayLike]) -> list[FloatArray]:
    """Return the segments of a profile, each (n + 1, 3) float64."""
    if isinstance(profile, str | bytes) or not isinstance(profile, Iterable):
        raise TypeError(f"Extrusion profile is {shown(profile)}: pass Bezier points (n + 1, 3)")
    parts = list(profile)
    if not parts:
        raise ValueError("Extrusion profile is empty: pass Bezier points (n + 1, 3)")
    if as_floats(parts[0], "Extrusion profile[0]").ndim <= 1:
        parts = [np.array(parts)]
    segments = [as_floats(part, f"Extrusion profile segment {i}") for i, part in enumerate(parts)]
    for i, segment in enumerate(segments):
        if segment.ndim != 2 or segment.shape[1] != 3 or len(segment) < 2:
            raise ValueError(
                f"Extrusion profile segment {i} has shape {segment.shape}: pass (n + 1, 3)"
            )
        if not np.isfinite(segment).all():
            bad = int(np.flatnonzero(~np.isfinite(segment).all(axis=1))[0])
            raise ValueError(
                f"Extrusion profile segment {i}, point {bad} is {segment[bad].tolist()}: pass finite "
                "numbers"
            )
    return segments


def _weights(
    weights: ArrayLike | Sequence[ArrayLike | None] | None, segments: list[FloatArray]
) -> list[FloatArray | None]:
    """Return the weights of each segment, None for one without."""
    if weights is None:
        return [None] * len(segments)
    if isinstance(weights, str | bytes) or not isinstance(weights, Iterable):
        raise TypeError(f"Extrusion weights is {shown(weights)}: pass one for each point")
    parts = list(weights)
    if parts and parts[0] is not None and as_floats(parts[0], "Extrusion weights").ndim == 0:
        parts = [np.array(parts)]
    if len(parts) != len(segments):
        raise ValueError(
            f"Extrusion weights are of {len(parts)} segments, the profile has {len(segments)}: pass "
            "weights, or None, for each"
        )
    found: list[FloatArray | None] = []
    for i, (part, segment) in enumerate(zip(parts, segments, strict=True)):
        array = None if part is None else as_floats(part, f"Extrusion weights of segment {i}")
        if array is not None and array.shape != (len(segment),):
            raise ValueError(
                f"Extrusion weights of segment {i} have shape {array.shape}: pass ({len(segment)},)"
            )
        found.append(array)
    return found
