"""Profiles of surfaces of revolution: input checks, weights, the turn, and their pieces."""

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import FloatArray, as_floats, shown
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.nets import check_weights

# Radii down to minus this part of the profile's extent are roundings of zero.
RADIUS_ROUNDING = 16.0 * 2.0**-52
# What messages call it.
PROFILE = "SurfaceOfRevolution profile"
# Profiles drawn in single precision or typed with nine digits still join.
LARGEST_GAP = 1e-9
# Halvings until a radius that may still be negative counts as zero; each divides the doubt by
# about four, so what is left after these is far below rounding.
RADIUS_HALVINGS = 40
# So near to 1, a turn is whole: ends of up to 2 are rounded to half of this.
WHOLE_TURN = 2.0**-51
# Halvings of a rational segment for its box: the excess of the hull falls to 1 / 4096.
BOX_HALVINGS = 6


def radius_rounding(segments: Iterable[FloatArray]) -> float:
    """Return the radius up to which a profile point counts as on the axis."""
    return RADIUS_ROUNDING * max(float(np.abs(segment).max()) for segment in segments)


def as_segments(
    profile: ArrayLike | Iterable[ArrayLike], name: str, shape: str, coordinates: int
) -> list[FloatArray]:
    """Return the segments of a profile, each (n + 1, coordinates) float64; ``shape`` says so in words."""
    if isinstance(profile, str | bytes) or not isinstance(profile, Iterable):
        raise TypeError(f"{name} is {shown(profile)}: pass Bezier points {shape}")
    parts: list[Any] = list(profile)
    if not parts:
        raise ValueError(f"{name} is empty: pass Bezier points {shape}")
    names = [f"{name} segment {i}" for i in range(len(parts))]
    if as_floats(parts[0], f"{name}[0]").ndim <= 1:
        parts, names = [parts], [name]
    segments = [as_floats(part, what).copy() for part, what in zip(parts, names, strict=True)]
    for segment, what in zip(segments, names, strict=True):
        if segment.ndim != 2 or segment.shape[1] != coordinates:
            both = "; of circular_arc pass both, its segments and weights=" * (segment.ndim == 3)
            raise ValueError(f"{what} has shape {segment.shape}: pass (n + 1, {coordinates}){both}")
        if not 1 <= len(segment) - 1 <= MAX_DEGREE:
            raise ValueError(f"{what} has degree {len(segment) - 1}: pass 1 to {MAX_DEGREE}")
        for i in np.flatnonzero(~np.isfinite(segment).all(axis=1))[:1]:
            raise ValueError(f"{what}, point {i} is {segment[i].tolist()}: pass finite numbers")
    return segments


def as_weights(
    weights: ArrayLike | Sequence[ArrayLike | None] | None, segments: list[FloatArray], name: str
) -> list[FloatArray | None]:
    """Return the weights of each segment, None for one without."""
    if weights is None:
        return [None] * len(segments)
    if isinstance(weights, str | bytes) or not isinstance(weights, Iterable):
        raise TypeError(f"{name} is {shown(weights)}: pass one for each point")
    parts: list[Any] = list(weights)
    if len(segments) == 1 and (
        not parts or (parts[0] is not None and as_floats(parts[0], name).ndim == 0)
    ):
        parts = [parts]
    if len(parts) != len(segments):
        raise ValueError(
            f"{name} are of {len(parts)} segments, the profile has {len(segments)}: pass weights, or "
            "None, for each"
        )
    found: list[FloatArray | None] = []
    for i, (part, segment) in enumerate(zip(parts, segments, strict=True)):
        what = f"{name} of segment {i}"
        array = None if part is None else as_floats(part, what).copy()
        if array is not None:
            if array.shape != (len(segment),):
                raise ValueError(f"{what} have shape {array.shape}: pass ({len(segment)},)")
            check_weights(array, what)
        found.append(array)
    return found


def as_part(u_range: ArrayLike) -> tuple[float, float]:
    """Return where a turn begins and ends."""
    array = as_floats(u_range, "SurfaceOfRevolution u_range")
    if array.shape != (2,):
        raise ValueError(f"SurfaceOfRevolution u_range has shape {array.shape}: pass two numbers")
    begin, end = array.tolist()
    if end - begin != 1.0 and abs(end - begin - 1.0) <= WHOLE_TURN:
        # As 1.15 - 0.15 is by rounding: a turn that is meant to close does.
        begin = end - 1.0
        end = begin + 1.0
    if not (-1.0 <= begin < end <= 2.0 and end - begin <= 1.0 and end - begin >= 2.0**-40):
        raise ValueError(
            f"SurfaceOfRevolution u_range is {(begin, end)}: pass where the turn begins and ends, "
            "between -1 and 2, at most one turn apart"
        )
    return begin, end


def cosine_and_sine(turns: float) -> tuple[float, float]:
    """Return cosine and sine of an angle in whole turns, exact at quarters."""
    quarter = math.floor(4.0 * turns + 0.5)
    angle = 2.0 * math.pi * (turns - 0.25 * quarter)
    c, s = math.cos(angle), math.sin(angle)
    return ((c, s), (-s, c), (-c, -s), (s, -c))[quarter % 4]


def homogeneous(points: FloatArray, weights: FloatArray | None) -> FloatArray:
    """Return w z, w r and w of Bezier points (n + 1, 3); the largest w is from 1/2 to 1."""
    w = np.ones(len(points)) if weights is None else weights
    w = w * math.ldexp(1.0, -math.frexp(float(w.max()))[1])
    return np.column_stack([points * w[:, None], w])


def pieces_of(net: FloatArray) -> FloatArray:
    """Halve a rational segment, `homogeneous`, repeatedly: the points of all pieces, (m, 2)."""
    pieces = [net]
    for _ in range(BOX_HALVINGS):
        pieces = [half for piece in pieces for half in halve_curve(piece)]
    points = np.concatenate(pieces)
    return points[:, :2] / points[:, 2:]


def check_segments(segments: Sequence[FloatArray], weights: Sequence[FloatArray | None]) -> None:
    """Check that radii are not negative, that segments join and have an extent."""
    points = np.concatenate(segments)
    rounding = radius_rounding(segments)
    for i, segment in enumerate(segments):
        extent = float(np.ptp(segment, axis=0).max())
        if not extent > 4.0 * 2.0**-52 * float(np.abs(segment).max()):
            raise ValueError(f"{PROFILE} segment {i} is shrunk to a point: remove it")
        # With weights above 0 the sum of their products with the radii has the radius' sign.
        lowest = _lowest_radius(homogeneous(segment, weights[i])[:, 1:], rounding)
        if lowest < -rounding:
            raise ValueError(
                f"{PROFILE} segment {i} reaches radius {lowest:.6g}: cut it where it meets the axis, "
                "radii must not be negative"
            )
    if not points[:, 1].max() > rounding:
        raise ValueError(f"{PROFILE} lies wholly on the axis: pass radii above 0")
    size = float(np.ptp(points, axis=0).max())
    for i, (one, other) in enumerate(pairwise(segments)):
        gap = float(np.abs(one[-1] - other[0]).max())
        if gap > LARGEST_GAP * size:
            raise ValueError(
                f"{PROFILE} segments {i} and {i + 1} do not join: one ends at "
                f"{one[-1].tolist()}, the next begins at {other[0].tolist()}; make both points "
                "equal, or make two surfaces"
            )


def _lowest_radius(radii: FloatArray, rounding: float) -> float:
    """Find a negative radius of a segment, or prove that none is below ``-rounding``.

    ``radii`` are w r and w. A piece whose Bezier points are all above that is settled; others are
    halved.
    """
    pieces = [radii]
    for _ in range(RADIUS_HALVINGS):
        pieces = [p for p in pieces if (p[:, 0] + rounding * p[:, 1]).min() < 0.0]
        if not pieces:
            return 0.0
        lowest = float(min((p[[0, -1], 0] / p[[0, -1], 1]).min() for p in pieces))
        if lowest < -rounding:
            return lowest
        pieces = [half for piece in pieces for half in halve_curve(piece)]
    return 0.0


def halve_curve(points: NDArray[np.float64]) -> tuple[FloatArray, FloatArray]:
    """Halve a curve: Bezier points of both halves, one point per row."""
    first, second = np.empty_like(points), np.empty_like(points)
    current = points
    for level in range(len(points)):
        first[level], second[-1 - level] = current[0], current[-1]
        current = 0.5 * (current[:-1] + current[1:])
    return first, second
