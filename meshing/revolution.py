"""Surfaces of revolution with a Bezier profile, rational or not: evaluation, transformations."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from meshing.checks import (
    BoolArray,
    FloatArray,
    IdArray,
    as_affine,
    as_direction,
    as_similarity,
    as_vector,
    direction_across,
    freeze,
    still_unit,
)
from meshing.double_double import affine_image, pair_of, unit_of
from meshing.kernels import lathe, subdivision
from meshing.nets import degrees_in_words
from meshing.parametric import ParametricSurface
from meshing.profiles import (
    PROFILE,
    as_part,
    as_segments,
    as_weights,
    check_segments,
    homogeneous,
    pieces_of,
)

# Segment ends that agree to this part of the profile's size are the same point.
JOINED = 2.0**-50

Weights: TypeAlias = tuple[FloatArray | None, ...]


class SurfaceOfRevolution(ParametricSurface):
    """A Bezier profile turned about an axis.

    S(u, v) = origin + Z(v) axis + R(v) (cos a radial + sin a binormal), where (Z, R) is the profile
    segment, binormal = axis x radial, and the angle a runs over ``u_range``: 2 pi u for a whole
    turn. The normal is along S_u x S_v: outward where the profile runs along the axis.

    Parameters
    ----------
    profile : (n + 1, 2) array, or a sequence of such segments
        Bezier points (axial position from ``origin``, radius) in scene units, degree n from 1 to
        30. Each segment begins where the one before ends. A flat list of points is one curve; for
        straight lines pass pairs of points.
    origin, axis : (3,) arrays
        A point of the axis and its direction, of any length but zero.
    reference : (3,) array, optional
        The angle a is 0 along this vector, projected onto the plane across the axis. Default: the
        coordinate axis least aligned with ``axis``.
    weights : (n + 1,) array, or a sequence of one for each segment, optional
        Weights of the Bezier points, which make the segment rational: positive, the smallest at
        least 1e-6 of the largest. None, also for single segments, means that all are 1.
    u_range : two numbers
        The angles at u = 0 and at u = 1, in whole turns from ``reference``; at most one turn apart.

    Raises
    ------
    ValueError
        For wrong shapes, NaN or infinity, a negative radius anywhere on a segment, segments that
        do not join, a segment shrunk to a point, a profile that lies wholly on the axis, weights
        that are not positive or too far apart, and an empty turn.

    Attributes
    ----------
    segments : tuple of (n + 1, 2) float64, read-only
    weights : tuple of (n + 1,) float64, read-only, or None for a segment that is not rational
    u_range : tuple of two floats
    origin, axis, radial, binormal : (3,) float64, read-only
        The last three are unit vectors.
    remainder : (2, 3) float64, read-only
        What rounding left of the origin and of the axis that are meant. Rays meet the surface about
        the sums.
    moved : float
        How far, at most, the surface is from the one that is meant, scene units: what rounding did to
        profile and scale of an image.
    """

    flip_of_uv = "v reversed"

    def __init__(
        self,
        profile: ArrayLike | Iterable[ArrayLike],
        origin: ArrayLike,
        axis: ArrayLike,
        reference: ArrayLike | None = None,
        weights: ArrayLike | Sequence[ArrayLike | None] | None = None,
        u_range: ArrayLike = (0.0, 1.0),
    ) -> None:
        along = as_direction(axis, "SurfaceOfRevolution axis")
        radial = direction_across(along, reference, "SurfaceOfRevolution reference")
        place = as_vector(origin, "SurfaceOfRevolution origin")
        segments = as_segments(profile, PROFILE, "(axial position, radius)", 2)
        # Where they are equal nothing is divided.
        heavy = tuple(
            None if w is None or (w == w[0]).all() else w
            for w in as_weights(weights, segments, "SurfaceOfRevolution weights")
        )
        given = as_vector(axis, "SurfaceOfRevolution axis")
        exact, _ = unit_of(pair_of(np.ldexp(given, -math.frexp(float(np.abs(given).max()))[1])))
        left = np.stack([np.zeros(3), (exact[0] - along) + exact[1]])
        self._set(segments, place, along, radial, heavy, as_part(u_range), left)

    def rounded(self) -> SurfaceOfRevolution:
        """Return the surface about origin and axis as float64 has them, without remainders."""
        frame = self.origin, self.axis, self.radial
        return self._from_frame(self.segments, *frame, self.weights, self.u_range)

    def _set(
        self,
        segments: Sequence[FloatArray],
        origin: FloatArray,
        axis: FloatArray,
        radial: FloatArray,
        weights: Weights,
        u_range: tuple[float, float],
        remainder: FloatArray | None = None,
        moved: float = 0.0,
    ) -> None:
        check_segments(segments, weights)
        self.segments = tuple(freeze(np.array(segment)) for segment in segments)
        self.weights = tuple(None if w is None else freeze(np.array(w)) for w in weights)
        self.u_range = u_range
        self.origin, self.axis, self.radial = (freeze(np.array(x)) for x in (origin, axis, radial))
        self.binormal = freeze(np.cross(axis, radial))
        self.remainder = freeze(np.zeros((2, 3)) if remainder is None else np.array(remainder))
        self.moved = moved
        rows = self.homogeneous if self.is_rational else self.segments
        self._profile = freeze(np.concatenate(rows))
        self._starts = np.cumsum([0, *map(len, segments)], dtype=np.int64)
        self._starts.setflags(write=False)
        self._frame = freeze(np.stack((self.origin, self.axis, self.radial, self.binormal)))

    @classmethod
    def _from_frame(cls, *parts: Any) -> SurfaceOfRevolution:
        """Return the surface of what `_set` takes."""
        surface = cls.__new__(cls)
        surface._set(*parts)
        return surface

    @property
    def is_rational(self) -> bool:
        """Whether any segment has weights that differ."""
        return any(w is not None for w in self.weights)

    @property
    def is_whole_turn(self) -> bool:
        """Whether the surface closes around its axis."""
        return self.u_range[1] - self.u_range[0] == 1.0

    @property
    def closes(self) -> tuple[bool, bool]:
        """Whether a whole turn is there, and whether the profile ends where it begins."""
        first, last = self.segments[0][0], self.segments[-1][-1]
        size = max(float(np.abs(segment).max()) for segment in self.segments)
        meets = np.abs(first - last).max() <= JOINED * size < first[1]
        return self.is_whole_turn, bool(meets)

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the profile begins on the axis, and whether it ends there."""
        size = max(float(np.abs(segment).max()) for segment in self.segments)
        ends = self.segments[0][0, 1], self.segments[-1][-1, 1]
        return bool(ends[0] <= JOINED * size), bool(ends[1] <= JOINED * size)

    @cached_property
    def v_breaks(self) -> FloatArray:
        """(k + 1,) float64, from 0 to 1: where segments begin and end in one v for all of them.

        That is the v of a `TrimmedSurface` of several segments: each takes a part as long as its
        control polygon. Straight segments: as long as they are.
        """
        lengths = [np.hypot(*np.diff(segment, axis=0).T).sum() for segment in self.segments]
        breaks = np.concatenate([[0.0], np.cumsum(lengths)]) / np.sum(lengths)
        breaks[-1] = 1.0
        return freeze(breaks)

    @property
    def homogeneous(self) -> list[FloatArray]:
        """(n + 1, 3) float64 of each segment: w z, w r and w, the largest w from 1/2 to 1."""
        return [homogeneous(net, w) for net, w in zip(self.segments, self.weights, strict=True)]

    def __len__(self) -> int:
        """Return the number of profile segments."""
        return len(self.segments)

    @property
    def revolution_frame(self) -> FloatArray:
        """(4, 3) float64: origin, axis, radial, binormal, read-only."""
        return self._frame

    def __repr__(self) -> str:
        """Name the segments and their degrees, the axis, and what is special."""
        degrees = degrees_in_words([len(segment) - 1 for segment in self.segments])
        words = f"{len(self)} segment{'s' * (len(self) > 1)} of {degrees}"
        if rational := sum(weights is not None for weights in self.weights):
            words += f", {rational} of them rational," if rational < len(self) else ", rational,"
        points = np.concatenate(self.segments)
        words += f" about {self.axis.tolist()}, from {points[:, 0].min():g} to {points[:, 0].max():g} along it"
        words += f", control points up to {points[:, 1].max():g} from it"
        if not self.is_whole_turn:
            words += f", u_range={self.u_range}"
        return f"SurfaceOfRevolution({words})"

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle profile and frame; loading checks them again."""
        frame = [np.array(vector) for vector in (self.origin, self.axis, self.radial)]
        weights = tuple(None if w is None else np.array(w) for w in self.weights)
        parts = [np.array(s) for s in self.segments], *frame, weights, self.u_range
        return SurfaceOfRevolution._from_frame, (*parts, np.array(self.remainder), self.moved)

    @cached_property
    def patch_bounds(self) -> FloatArray:
        """(k, 2, 3) float64: lower and upper corner of a box around each segment, read-only."""
        # Coordinate k of a circle runs from Z axis_k - R w_k to Z axis_k + R w_k.
        w = np.hypot(self.radial, self.binormal)
        if self.is_rational:
            return self._boxes_of_pieces(w)
        z, r = self._profile[:, :1] * self.axis, self._profile[:, 1:] * w
        n = len(self)
        starts = np.concatenate((self._starts, self._starts[1:] + self._starts[-1]))
        degrees = np.zeros((2 * n, 2), dtype=np.int64)
        degrees[:, 0] = np.diff(starts) - 1
        boxes = np.empty((2 * n, 2, 3))
        least, most = self._ends_of_circles()
        up, down = (z + r, z - r) if self.is_whole_turn else (z + r * most, z + r * least)
        curves = self.origin + np.concatenate((up, down))
        subdivision.patch_boxes(curves, starts, degrees, None, boxes)
        # Where neither w nor the axis is 0 or 1 the products above were rounded, and so was the
        # shift by the origin.
        size = np.abs(self._profile).max() * np.where(np.isin(w, (0.0, 1.0)), 0.0, 1.0)
        rounding = 2.0**-50 * (size + np.where(self.origin == 0.0, 0.0, np.abs(curves).max(axis=0)))
        low = np.minimum(boxes[:n, 0], boxes[n:, 0]) - rounding
        high = np.maximum(boxes[:n, 1], boxes[n:, 1]) + rounding
        return freeze(np.stack((low, high), axis=1))

    def _ends_of_circles(self) -> tuple[FloatArray, FloatArray]:
        """Return the least and most of cos(a - a_k) over the turn, for each coordinate k, (3,)."""
        begin, end = (2.0 * np.pi * u for u in self.u_range)
        farthest = np.arctan2(self.binormal, self.radial)
        ends = np.cos(np.array([begin, end])[:, None] - farthest)
        ends = np.concatenate([ends - 2.0**-48, ends + 2.0**-48])

        def is_within(angle: FloatArray) -> BoolArray:
            return (angle - begin) % (2.0 * np.pi) <= end - begin

        return (
            np.where(is_within(farthest + np.pi), -1.0, np.maximum(ends.min(axis=0), -1.0)),
            np.where(is_within(farthest), 1.0, np.minimum(ends.max(axis=0), 1.0)),
        )

    def _boxes_of_pieces(self, w: FloatArray) -> FloatArray:
        """Return `patch_bounds` of a rational profile: boxes of the points of its pieces."""
        least, most = (-1.0, 1.0) if self.is_whole_turn else self._ends_of_circles()
        boxes = []
        for net in self.homogeneous:
            points = pieces_of(net)
            z, r = points[:, :1] * self.axis, points[:, 1:] * w
            ends = np.concatenate((z + r * least, z + r * most))
            rounding = 2.0**-46 * (np.abs(points).max() + np.abs(self.origin))
            boxes.append(
                (
                    self.origin + ends.min(axis=0) - rounding,
                    self.origin + ends.max(axis=0) + rounding,
                )
            )
        return freeze(np.array(boxes))

    def transformed(self, matrix: ArrayLike) -> SurfaceOfRevolution:
        """Return the image under a similarity; see `meshing.surface.Surface.transformed`.

        A reflection reverses the axis of the image, and the axial positions change sign, because u stays a
        right-handed angle about the axis.
        """
        orthogonal, shift, scale, is_reflection = as_similarity(
            matrix,
            "SurfaceOfRevolution",
            "scale the profile before it is turned (along the axis, or all radii), or use a NurbsSurface "
            "of revolution, which takes any affine map",
        )
        sign = -1.0 if is_reflection else 1.0
        axis = still_unit(sign * (orthogonal @ self.axis), "axis")
        radial = orthogonal @ self.radial
        radial = still_unit(radial - (radial @ axis) * axis, "radial")
        segments = [segment * (sign * scale, scale) for segment in self.segments]
        linear, _ = as_affine(matrix, "SurfaceOfRevolution")
        left_origin, left_axis = self.remainder
        origin, left = affine_image(linear, shift, (self.origin, left_origin))
        frame = np.stack([axis, radial, np.cross(axis, radial)])
        # The matrix moves points about the middle of the profile as scale and frame of the image do, but
        # for this; and what products with the scale round.
        misfit = linear @ self._frame[1:].T - scale * (frame * [[sign], [1.0], [1.0]]).T
        points = np.concatenate(self.segments)
        moved = scale * self.moved
        left_axis = sign * (linear @ left_axis) / scale
        if math.frexp(scale)[0] != 0.5:
            moved += 2.0**-53 * scale * float(np.hypot(*np.abs(points).max(axis=0)))
        if misfit.any():
            unit = math.ldexp(1.0, -math.frexp(scale)[1])
            turned = affine_image(sign * unit * linear, np.zeros(3), (self.axis, self.remainder[1]))
            exact, stretch = unit_of(turned)
            left_axis = (exact[0] - axis) + exact[1]
            # By what the axis is stretched besides the scale moves the middle along it.
            middle = 0.5 * points[:, 0].min() + 0.5 * points[:, 0].max()
            excess = float((stretch[0] - scale * unit) + stretch[1]) / unit
            left = left + sign * middle * excess * axis
            radius = float(np.hypot(points[:, 0] - middle, points[:, 1]).max())
            moved += radius * (float(np.linalg.norm(misfit, 2)) + 2.0**-51 * scale)
        return self._from_frame(
            segments, origin, axis, radial, self.weights, self.u_range, (left, left_axis), moved
        )

    def flipped(self) -> SurfaceOfRevolution:
        """Return the same surface drawn from its other end, so with the opposite normal.

        Parameters become (u, 1 - v), and segments are counted from the other end.
        """
        segments = [segment[::-1] for segment in reversed(self.segments)]
        weights = tuple(None if w is None else w[::-1] for w in reversed(self.weights))
        frame = self.origin, self.axis, self.radial
        left = self.remainder, self.moved
        return self._from_frame(segments, *frame, weights, self.u_range, *left)

    def _derivatives(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray, order_u: int, order_v: int
    ) -> FloatArray:
        out = np.empty((u.size, 3))
        lathe.evaluate_lathe(
            self._profile, self._starts, self._frame, patch_id, self._turns(u), v, order_u, order_v,
            self.is_rational or None, out,
        )  # fmt: skip
        if not self.is_whole_turn:
            out *= (self.u_range[1] - self.u_range[0]) ** order_u
        return out

    def _turns(self, u: FloatArray) -> FloatArray:
        """Return u in whole turns from the reference."""
        begin, end = self.u_range
        if (begin, end) == (0.0, 1.0):
            return u
        # So that both ends are where they were said to be.
        return np.where(u <= 0.5, begin + u * (end - begin), end - (1.0 - u) * (end - begin))

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        out, is_degenerate = np.empty((u.size, 3)), np.empty(u.size, np.bool_)
        lathe.normals_of_lathe(
            self._profile, self._starts, self._frame, patch_id, self._turns(u), v,
            self.is_rational or None, out, is_degenerate,
        )  # fmt: skip
        return out
