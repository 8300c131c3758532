"""Meshes of bodies: triangles of several faces, joined where their edges meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from meshing.certified_mesh import CertifiedMesh
from meshing.checks import BoolArray, FloatArray, shown
from meshing.curve2 import polygon
from meshing.leaves import Keys
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface
from meshing.trimmed_mesh import Face, edges_of

# The share of a tolerance by which edges that are meant to meet may be apart besides their gaps, as curves of files
# are approximations of each other.
OF_JOINTS = 1e-3


def mesh_of_faces(
    surfaces: Sequence[Surface], tolerance: float, max_triangles: int
) -> CertifiedMesh:
    """Return the triangles of surfaces, joined where their edges coincide."""
    for k, surface in enumerate(surfaces):
        if not isinstance(surface, Surface):
            raise TypeError(f"tessellate surface[{k}] is {shown(surface)}: pass surfaces")
    if not surfaces:
        raise ValueError("tessellate surface is an empty list: pass at least one surface")
    joint = OF_JOINTS * tolerance if len(surfaces) > 1 else 0.0
    faces = [Face(_trimmed(surface), tolerance - joint, max_triangles) for surface in surfaces]
    for face in faces:
        face.triangulate()
    pairs = _pairs_that_meet(faces, joint)
    # Points of the other borders, and how near they are to be.
    beside: list[list[FloatArray]] = [[np.empty((0, 4))] for _ in faces]
    for i, j, gap in pairs:
        for face, other in ((faces[i], faces[j]), (faces[j], faces[i])):
            low, high = other.box
            near = face.points[face.border]
            is_near = ((near >= low - gap) & (near <= high + gap)).all(axis=1)
            reach = joint + face.gaps[is_near]
            beside[j if face is faces[i] else i].append(np.column_stack([near[is_near], reach]))
    added = [face.places_near(np.concatenate(p)) for face, p in zip(faces, beside, strict=True)]
    for face, places in zip(faces, added, strict=True):
        if len(places):
            face.add_cuts(places)
            face.triangulate()
    first = np.cumsum([0, *(len(face.points) for face in faces)])
    points = np.concatenate([face.points for face in faces])
    row, gaps = np.arange(len(points)), np.zeros(len(points))
    for face, n in zip(faces, first, strict=False):
        gaps[n + face.border] = 0.5 * joint + face.gaps
    for i, j, _ in pairs:
        _unite(row, points, first[i] + faces[i].border, first[j] + faces[j].border, gaps)
    row = _roots(row)
    np.maximum.at(gaps, row, gaps.copy())
    moved = float(np.linalg.norm(points - points[row], axis=1).max(initial=0.0))
    corners = row[np.concatenate([face.faces + n for face, n in zip(faces, first, strict=False)])]
    kept = (corners != np.roll(corners, 1, axis=1)).all(axis=1)
    kept[kept], off = _without_flaps(points, corners[kept], 2.0 * gaps[corners[kept]].max(axis=1))
    used, corners = np.unique(corners[kept], return_inverse=True)
    surface_id = np.repeat(
        np.arange(len(faces), dtype=np.int32), [len(face.faces) for face in faces]
    )[kept]
    points, corners, uv, of_row = _with_edges_of_two(
        points[used],
        corners.reshape(-1, 3),
        np.concatenate([face.uv for face in faces])[kept],
        surface_id,
    )
    return CertifiedMesh(
        points,
        corners,
        uv,
        np.concatenate([face.patch_id for face in faces])[kept][of_row],
        max(face.bound for face in faces) + moved + off,
        surface_id[of_row],
    )


def _trimmed(surface: Surface) -> TrimmedSurface:
    """Return a surface with loops; those of a whole one are its border."""
    if isinstance(surface, TrimmedSurface):
        return surface
    return TrimmedSurface(surface, [polygon([(0, 0), (1, 0), (1, 1), (0, 1)])])


def _pairs_that_meet(faces: list[Face], joint: float) -> list[tuple[int, int, float]]:
    """Return pairs of faces whose boxes meet, and the gap between these faces."""
    low, high = np.stack([face.box for face in faces], axis=1)
    gaps = np.array([face.surface.gap for face in faces])
    roundings = np.array([face.rounding for face in faces])
    found = []
    for i in range(len(faces) - 1):
        gap = joint + gaps[i] + gaps[i + 1 :] + np.maximum(roundings[i], roundings[i + 1 :])
        apart = np.maximum(low[i + 1 :] - high[i], low[i] - high[i + 1 :]).max(axis=1)
        found += [(i, i + 1 + j, float(gap[j])) for j in np.flatnonzero(apart <= gap).tolist()]
    return found


def _unite(row: NDArray[np.int64], points: FloatArray, a: Keys, b: Keys, gaps: FloatArray) -> None:
    """Unite each vertex of one border with the nearest of the other one, if it is within the sum of their gaps."""
    for mine, others in ((a, b), (b, a)):
        if not len(others) or not len(mine):
            return
        gap = float(gaps[mine].max() + gaps[others].max())
        low, high = points[others].min(axis=0) - gap, points[others].max(axis=0) + gap
        near = mine[((points[mine] >= low) & (points[mine] <= high)).all(axis=1)]
        for i in near.tolist():
            square = ((points[others] - points[i]) ** 2).sum(axis=1)
            k = int(square.argmin())
            if square[k] <= ((gaps[i] + gaps[others[k]]) * (1.0 + 1e-6)) ** 2:
                one, two = _root(row, i), _root(row, int(others[k]))
                row[max(one, two)] = min(one, two)


def _without_flaps(
    points: FloatArray, faces: NDArray[np.int64], gap: FloatArray
) -> tuple[BoolArray, float]:
    """Tell which triangles remain, and how far the others are from these.

    Where two edges of a face leave a corner side by side, nearer than a gap, a neighbour of one has vertices
    of both: flat triangles hang between them, on one edge alone and on one with more than two; or two of
    two faces lie on each other.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    longest = np.max([np.linalg.norm(x - y, axis=1) for x, y in ((a, b), (b, c), (c, a))], axis=0)
    height = np.linalg.norm(np.cross(b - a, c - a), axis=1) / np.maximum(longest, 1e-300)
    _, number, counts = np.unique(
        np.sort(faces, axis=1), axis=0, return_inverse=True, return_counts=True
    )
    kept, off = np.ones(len(faces), np.bool_), 0.0
    goes = (counts[number] == 2) & (height <= gap)
    _, number = np.unique(edges_of(faces).reshape(-1, 2), axis=0, return_inverse=True)
    number = number.reshape(-1, 3)
    while True:
        off += float(height[goes].max(initial=0.0))
        kept &= ~goes
        goes = kept & (height <= gap)
        counts = np.bincount(number[kept].ravel(), minlength=number.max(initial=-1) + 1)[number]
        goes &= (counts == 1).any(axis=1) & (counts > 2).any(axis=1)
        if not goes.any():
            break
    # Several that hang together on edges of more than two go at once, where that leaves no edge of one.
    goes, is_bad = kept & (height <= gap), kept
    while is_bad.any():
        left = np.bincount(number[kept & ~goes].ravel(), minlength=number.max(initial=-1) + 1)
        is_bad = goes & (left[number] % 2 == 1).any(axis=1)
        goes &= ~is_bad
    flaps, grown = goes & (counts > 2).any(axis=1), goes
    while grown.any():
        touched = np.bincount(number[flaps].ravel(), minlength=number.max(initial=-1) + 1) > 0
        grown = goes & ~flaps & touched[number].any(axis=1)
        flaps |= grown
    return kept & ~flaps, off + float(height[flaps].max(initial=0.0))


def _with_edges_of_two(
    points: FloatArray, faces: NDArray[np.int64], uv: FloatArray, surface_id: NDArray[np.int32]
) -> tuple[FloatArray, NDArray[np.int64], FloatArray, NDArray[np.int64]]:
    """Return triangles of which no more than two share an edge, where that can be, and their former rows.

    Two faces nearer to each other than triangles are long may have the same diagonals: those of all faces but
    one get a vertex in the middle, which changes no shape.
    """
    of_row = np.arange(len(faces))
    while True:
        edges = edges_of(faces).reshape(-1, 2)
        _, number, counts = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
        shared = np.flatnonzero(counts[number] > 2)
        sides_of: dict[int, dict[bytes, list[int]]] = {}
        for k in shared.tolist():
            # Two triangles of a face have a diagonal in common in its (u, v) as well.
            a, b = uv[k // 3, [k % 3, (k % 3 + 1) % 3]].tolist()
            ends = sorted([a, b])
            key = np.array([surface_id[of_row[k // 3]], *ends[0], *ends[1]]).tobytes()
            sides_of.setdefault(int(number[k]), {}).setdefault(key, []).append(k)
        touched: set[int] = set()
        new_points, new_faces, new_uv, new_rows = ([points], [faces], [uv], [of_row])
        n = len(points)
        for groups in sides_of.values():
            pairs = [sides for sides in groups.values() if len(sides) == 2]
            is_held = sum(map(len, groups.values())) > 2 * len(pairs)
            for pair in pairs if is_held else pairs[1:]:
                triangles = {k // 3 for k in pair}
                if len(triangles) < 2 or triangles & touched:
                    continue
                touched |= triangles
                for k in pair:
                    t, i = divmod(k, 3)
                    j = (i + 1) % 3
                    halves, half_uv = np.stack([faces[t]] * 2), np.stack([uv[t]] * 2)
                    halves[0, j] = halves[1, i] = n
                    half_uv[0, j] = half_uv[1, i] = 0.5 * (uv[t, i] + uv[t, j])
                    if t == pair[0] // 3:
                        new_points.append(0.5 * (points[faces[t, i]] + points[faces[t, j]])[None])
                    new_faces.append(halves)
                    new_uv.append(half_uv)
                    new_rows.append(np.full(2, of_row[t]))
                n += 1
        if not touched:
            return points, faces, uv, of_row
        stays = np.ones(len(faces), np.bool_)
        stays[list(touched)] = False
        new_faces[0], new_uv[0], new_rows[0] = faces[stays], uv[stays], of_row[stays]
        points, faces = np.concatenate(new_points), np.concatenate(new_faces)
        uv, of_row = np.concatenate(new_uv), np.concatenate(new_rows)


def _root(row: NDArray[np.int64], i: int) -> int:
    while row[i] != i:
        i = int(row[i])
    return i


def _roots(row: NDArray[np.int64]) -> NDArray[np.int64]:
    """Return the first vertex that each is united with."""
    while (row[row] != row).any():
        row = row[row]
    return row
