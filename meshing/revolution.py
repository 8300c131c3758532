"""Surfaces of revolution with a Bezier profile: input checks, evaluation, transformations."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshing.checks import (
    BoolArray,
    FloatArray,
    as_direction,
    as_floats,
    as_similarity,
    as_vector,
    freeze,
    shown,
    still_unit,
    unit,
)
from meshing.kernels import lathe, subdivision
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.parametric import ParametricSurface

# Radii down to minus this part of the profile's extent are roundings of zero.
RADIUS_ROUNDING = 16.0 * 2.0**-52
# What messages call it.
PROFILE = "SurfaceOfRevolution profile"
# Profiles drawn in single precision or typed with nine digits still join.
LARGEST_GAP = 1e-9
# Halvings until a radius that may still be negative counts as zero; each divides the doubt by
# about four, so what is left after these is far below rounding.
RADIUS_HALVINGS = 40


class SurfaceOfRevolution(ParametricSurface):
    """A Bezier profile turned about an axis.

    S(u, v) = origin + Z(v) axis + R(v) (cos 2 pi u radial + sin 2 pi u binormal), where (Z, R) is
    the profile segment and binormal = axis x radial. The normal is along S_u x S_v: outward where
    the profile runs along the axis.

    Parameters
    ----------
    profile : (n + 1, 2) array, or a sequence of such segments
        Bezier points (axial position from ``origin``, radius) in scene units, degree 1 to 30.
        Each segment begins where the one before ends.
    origin, axis : (3,) arrays
        A point of the axis and its direction, of any length but zero.
    reference : (3,) array, optional
        u = 0 lies along this vector, projected normal to the axis. Default: the coordinate axis
        least aligned with ``axis``.

    Raises
    ------
    ValueError
        For wrong shapes, NaN or infinity, a radius below zero anywhere on a segment, segments that
        do not join, a segment shrunk to a point, and a profile that lies wholly on the axis.

    Attributes
    ----------
    segments : tuple of (n + 1, 2) float64, read-only
    origin, axis, radial, binormal : (3,) float64, read-only
        The last three are unit vectors.
    """

    def __init__(
        self,
        profile: ArrayLike | Iterable[ArrayLike],
        origin: ArrayLike,
        axis: ArrayLike,
        reference: ArrayLike | None = None,
    ) -> None:
        along = as_direction(axis, "SurfaceOfRevolution axis")
        if reference is None:
            start = np.zeros(3)
            start[np.argmin(np.abs(along))] = 1.0
        else:
            start = as_direction(reference, "SurfaceOfRevolution reference")
        radial = start - (start @ along) * along
        if not radial @ radial > 2.0**-80:
            raise ValueError(
                "SurfaceOfRevolution reference is parallel to the axis: pass another direction"
            )
        radial = unit(radial, "reference")
        radial = unit(radial - (radial @ along) * along, "reference")
        place = as_vector(origin, "SurfaceOfRevolution origin")
        self._set(_as_segments(profile), place, along, radial)

    def _set(
        self, segments: list[FloatArray], origin: FloatArray, axis: FloatArray, radial: FloatArray
    ) -> None:
        _check_segments(segments)
        self.segments = tuple(freeze(segment) for segment in segments)
        self.origin = freeze(origin)
        self.axis = freeze(axis)
        self.radial = freeze(radial)
        self.binormal = freeze(np.cross(axis, radial))
        self._profile = freeze(np.concatenate(segments))
        self._starts = np.cumsum([0, *map(len, segments)], dtype=np.int64)
        self._starts.setflags(write=False)
        self._frame = freeze(np.stack((origin, axis, radial, self.binormal)))

    @classmethod
    def _from_frame(
        cls, segments: list[FloatArray], origin: FloatArray, axis: FloatArray, radial: FloatArray
    ) -> SurfaceOfRevolution:
        surface = cls.__new__(cls)
        surface._set([segment.copy() for segment in segments], origin, axis, radial)
        return surface

    def __len__(self) -> int:
        """Return the number of profile segments."""
        return len(self.segments)

    @property
    def revolution_frame(self) -> FloatArray:
        """(4, 3) float64: origin, axis, radial, binormal, read-only."""
        return self._frame

    def __repr__(self) -> str:
        """Name the number of segments and the axis."""
        return f"SurfaceOfRevolution({len(self)} segments about {self.axis.tolist()})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle profile and frame; loading checks them again."""
        frame = [np.array(vector) for vector in (self.origin, self.axis, self.radial)]
        return SurfaceOfRevolution._from_frame, ([np.array(s) for s in self.segments], *frame)

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each segment, read-only."""
        # Coordinate k of a circle runs from Z axis_k - R w_k to Z axis_k + R w_k.
        w = np.hypot(self.radial, self.binormal)
        z, r = self._profile[:, :1] * self.axis, self._profile[:, 1:] * w
        n = len(self)
        starts = np.concatenate((self._starts, self._starts[1:] + self._starts[-1]))
        degrees = np.zeros((2 * n, 2), dtype=np.int64)
        degrees[:, 0] = np.diff(starts) - 1
        boxes = np.empty((2 * n, 2, 3))
        curves = self.origin + np.concatenate((z + r, z - r))
        subdivision.patch_boxes(curves, starts, degrees, None, boxes)
        # Where neither w nor the axis is 0 or 1 the products above were rounded, and so was the
        # shift by the origin.
        size = np.abs(self._profile).max() * np.where(np.isin(w, (0.0, 1.0)), 0.0, 1.0)
        rounding = 2.0**-50 * (size + np.where(self.origin == 0.0, 0.0, np.abs(curves).max(axis=0)))
        low = np.minimum(boxes[:n, 0], boxes[n:, 0]) - rounding
        high = np.maximum(boxes[:n, 1], boxes[n:, 1]) + rounding
        return freeze(np.stack((low, high), axis=1))

    def transformed(self, matrix: ArrayLike) -> SurfaceOfRevolution:
        """Return the image under a similarity, with the same (u, v).

        Parameters
        ----------
        matrix : (4, 4) array
            Acts on columns (x, y, z, 1): rotation, shift, uniform scale, reflection. Under a
            reflection the axis of the image runs the other way and its axial positions change
            sign, because u stays a right-handed angle about the axis.
        """
        orthogonal, shift, scale, is_reflection = as_similarity(matrix, "SurfaceOfRevolution")
        sign = -1.0 if is_reflection else 1.0
        axis = still_unit(sign * (orthogonal @ self.axis), "axis")
        radial = orthogonal @ self.radial
        radial = still_unit(radial - (radial @ axis) * axis, "radial")
        segments = [segment * (sign * scale, scale) for segment in self.segments]
        origin = scale * (orthogonal @ self.origin) + shift
        return self._from_frame(segments, origin, axis, radial)

    def flipped(self) -> SurfaceOfRevolution:
        """Return the same surface drawn from its other end, so with the opposite normal.

        Parameters become (u, 1 - v), and segments count from the other end.
        """
        segments = [segment[::-1].copy() for segment in reversed(self.segments)]
        return self._from_frame(segments, self.origin.copy(), self.axis.copy(), self.radial.copy())

    def _fill(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        order_u: int,
        order_v: int,
        out: FloatArray,
    ) -> None:
        lathe.evaluate_lathe(
            self._profile, self._starts, self._frame, ids, u, v, order_u, order_v, out
        )

    def _fill_normals(
        self,
        ids: NDArray[np.int64],
        u: FloatArray,
        v: FloatArray,
        out: FloatArray,
        is_degenerate: BoolArray,
    ) -> None:
        lathe.normals_of_lathe(
            self._profile, self._starts, self._frame, ids, u, v, out, is_degenerate
        )


def radius_rounding(segments: Iterable[FloatArray]) -> float:
    """Return the radius up to which a profile point counts as on the axis."""
    return RADIUS_ROUNDING * max(float(np.abs(segment).max()) for segment in segments)


def _as_segments(profile: ArrayLike | Iterable[ArrayLike]) -> list[FloatArray]:
    wanted = "pass Bezier points (axial position, radius)"
    if isinstance(profile, str | bytes) or not isinstance(profile, Iterable):
        raise TypeError(f"{PROFILE} is {shown(profile)}: {wanted}")
    parts = list(profile)
    if not parts:
        raise ValueError(f"{PROFILE} is empty: {wanted}")
    is_single = as_floats(parts[0], f"{PROFILE}[0]").ndim <= 1
    arrays: list[Any] = [parts] if is_single else parts
    names = [PROFILE] if is_single else [f"{PROFILE} segment {i}" for i in range(len(parts))]
    segments = [as_floats(array, name).copy() for array, name in zip(arrays, names, strict=True)]
    for segment, name in zip(segments, names, strict=True):
        if segment.ndim != 2 or segment.shape[1] != 2:
            raise ValueError(f"{name} has shape {segment.shape}: pass (n + 1, 2)")
        if not 1 <= len(segment) - 1 <= MAX_DEGREE:
            raise ValueError(f"{name} has degree {len(segment) - 1}: pass 1 to {MAX_DEGREE}")
        bad = np.flatnonzero(~np.isfinite(segment).all(axis=1))
        if bad.size:
            raise ValueError(
                f"{name}, point {bad[0]} is {segment[bad[0]].tolist()}: pass finite numbers"
            )
    return segments


def _check_segments(segments: list[FloatArray]) -> None:
    points = np.concatenate(segments)
    rounding = radius_rounding(segments)
    for i, segment in enumerate(segments):
        extent = float(np.ptp(segment, axis=0).max())
        if not extent > 4.0 * 2.0**-52 * float(np.abs(segment).max()):
            raise ValueError(f"{PROFILE} segment {i} is shrunk to a point: remove it")
        lowest = _lowest_radius(segment[:, 1], rounding)
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

    A piece whose Bezier points are all above that is settled; others are halved.
    """
    pieces = [radii]
    for _ in range(RADIUS_HALVINGS):
        pieces = [piece for piece in pieces if piece.min() < -rounding]
        if not pieces:
            return 0.0
        lowest = float(min(min(piece[0], piece[-1]) for piece in pieces))
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
