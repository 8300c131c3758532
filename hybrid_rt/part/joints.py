"""Where faces meet: the face beyond each trim curve, and the angle between them inside the material."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.part.cells import ALONG, SMOOTH, Solid

# Curves compared at once.
CHUNK = 512


class Joint(NamedTuple):
    """A trim curve of a face, and the face beyond it; angles are those inside the material, in radians."""

    face: int
    side: int
    other: int
    least: float
    most: float
    place: FloatArray
    normals: FloatArray  # (ALONG, 3), of the other face

    @property
    def is_reentrant(self) -> bool:
        """Whether the material is on more than one side of either face, somewhere."""
        return self.most > np.pi + SMOOTH

    @property
    def is_smooth(self) -> bool:
        """Whether both faces are tangent all along."""
        return self.most < np.pi + SMOOTH and self.least > np.pi - SMOOTH


def joints_of(solid: Solid) -> list[Joint]:
    """Find the joints of a solid, each from both of its faces; seams are none.

    The face beyond is the one that has a trim curve nearest to the middle of this one, at 17 points of each.
    """
    every = [
        (face, k, side) for face, sides in enumerate(solid.sides) for k, side in enumerate(sides)
    ]
    if not every:
        return []
    owner = np.array([face for face, _, _ in every])
    points, into, normals = (
        np.array([getattr(side, name) for _, _, side in every])
        for name in ("points", "into", "normals")
    )
    bend = np.linalg.norm(points[:, 2:] - 2.0 * points[:, 1:-1] + points[:, :-2], axis=2).max(
        axis=1
    )
    gap = np.array([solid.surfaces[face].gap for face in owner])
    reach = bend + 4.0 * gap + 1e-7 * solid.size
    low, high = points.min(axis=1) - reach[:, None], points.max(axis=1) + reach[:, None]
    middle = points[:, ALONG // 2]
    found = [(np.empty(0, np.int64), np.empty(0, np.int64))]
    for k in range(0, len(every), CHUNK):
        part = slice(k, k + CHUNK)
        is_near = owner[part, None] != owner
        for axis in range(3):
            is_near &= (middle[part, axis, None] >= low[:, axis]) & (
                middle[part, axis, None] <= high[:, axis]
            )
        i, j = np.nonzero(is_near)
        found.append((i + k, j))
    own, beyond = (np.concatenate(x) for x in zip(*found, strict=True))
    off = np.concatenate([
        _apart(middle[own[k : k + CHUNK], None], points[beyond[k : k + CHUNK]])[0][:, 0]
        for k in range(0, max(len(own), 1), CHUNK)
    ])  # fmt: skip
    order = np.lexsort((beyond, off, own))
    order = order[np.diff(own[order], prepend=-1) != 0]
    order = order[off[order] <= reach[own[order]] + reach[beyond[order]]]
    joints = []
    for k in range(0, len(order), CHUNK):
        i, j = own[order[k : k + CHUNK]], beyond[order[k : k + CHUNK]]
        angle, turned = _angles(points[i], into[i], normals[i], points[j], normals[j])
        inner = angle[:, 1:-1]  # where curves end, normals may have no limit
        least, most = inner.min(axis=1).tolist(), inner.max(axis=1).tolist()
        joints += [
            Joint(every[a][0], every[a][1], int(owner[b]), x, y, middle[a], n)
            for a, b, x, y, n in zip(i.tolist(), j.tolist(), least, most, turned, strict=True)
        ]
    return joints


def _apart(points: FloatArray, line: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return distances of points (n, k, 3) from polylines (n, m, 3), and where the nearest are, in segments."""
    begin, way = line[:, None, :-1], np.diff(line, axis=1)[:, None]
    away = points[:, :, None] - begin
    share = np.clip((away * way).sum(axis=3) / np.maximum((way**2).sum(axis=3), 1e-300), 0.0, 1.0)
    off = np.linalg.norm(away - share[..., None] * way, axis=3)
    k = off.argmin(axis=2)[..., None]
    least, at = (np.take_along_axis(x, k, axis=2)[..., 0] for x in (off, share))
    return least, k[..., 0] + at


def _angles(
    points: FloatArray, into: FloatArray, normals: FloatArray, line: FloatArray, beyond: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return angles inside the material along curves, (n, ALONG), and the normals of the other faces there."""
    _, at = _apart(points, line)
    low = np.clip(at.astype(np.int64), 0, ALONG - 2)
    share = (at - low)[..., None]
    one, two = (np.take_along_axis(beyond, (low + k)[..., None], axis=1) for k in (0, 1))
    other = (1.0 - share) * one + share * two
    other /= np.maximum(np.linalg.norm(other, axis=2), 1e-300)[..., None]
    sine = (into * other).sum(axis=2)  # below 0: convex
    return np.pi + np.arctan2(sine, (normals * other).sum(axis=2)), other
