"""First hits by plain bisection and double-double: slow, and sharing nothing with the fast code.

No tree, no triangles, no certificate: every ray meets every patch, every profile segment and every
face. A decision that a parallel shift of the ray by 64 roundings (at the scale of ray and object)
would change is called ambiguous. Folds of a silhouette show themselves in the bisection. Rims are
judged by trying: where a ray passes the rim of a patch, a pole or an edge within that band, eight
shifted rays are traced, and only if all of them meet the surface there is the hit beyond doubt.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.records import BoolArray, FloatArray, IntArray
from hybrid_rt.verify.kernels import closed, found, patch, revolution
from meshing import BezierPatches, SurfaceOfRevolution

# A slow ray (a silhouette) may take a thousand times as long as another.
CHUNK = 512
# The rays that try a rim keep this many bands from it, where its pieces are resolved again.
SHIFT = 8.0
N_SHIFTED = 8

Trace = Callable[[FloatArray, FloatArray, FloatArray, FloatArray], None]


@dataclass(frozen=True)
class Truth:
    """First hits as the oracle finds them, one row per ray.

    Attributes
    ----------
    t : (n,) float64
        In lengths of the given direction; inf on a miss.
    object_id, patch_id : (n,) int32
        -1 on a miss.
    u, v : (n,) float64
        Surface parameters; nan on a miss and on spheres and planes.
    cos : (n,) float64
        ``|n . d| / |d|``; nan on a miss.
    scale : (n,) float64
        The larger of the distance from the origin to the middle of the object, and the object's
        size (diagonal of its bounds): the length to which roundings are relative. nan on a miss.
    ambiguous : (n,) bool
        Some decision at or before the first hit has a margin within the band.
    unresolved : (n,) bool
        The bisection was given up (counted as ambiguous too).
    """

    t: FloatArray
    object_id: IntArray
    patch_id: IntArray
    u: FloatArray
    v: FloatArray
    cos: FloatArray
    scale: FloatArray
    ambiguous: BoolArray
    unresolved: BoolArray

    def __len__(self) -> int:
        """Return the number of rays."""
        return int(self.t.size)


def first_hits(
    surfaces: Sequence[Any],
    origins: ArrayLike,
    directions: ArrayLike,
    t_min: ArrayLike = 0.0,
    t_max: ArrayLike = np.inf,
    threads: int | None = None,
) -> Truth:
    """Find the first hit of each ray.

    Parameters
    ----------
    surfaces : sequence of surfaces of any kind
    origins, directions : (n, 3)
        Scene units; directions of any length but zero.
    t_min, t_max : scalar or (n,)
        A hit needs ``t_min < t < t_max``.
    threads : int, optional
        Default: all processors.

    Returns
    -------
    Truth of n rows

    Raises
    ------
    TypeError
        For a kind of surface that the oracle does not know.
    """
    d = np.array(directions, dtype=np.float64)
    o = np.array(np.broadcast_to(np.asarray(origins, np.float64), d.shape))
    n = len(d)
    low = np.array(np.broadcast_to(np.asarray(t_min, np.float64), n))
    high = np.array(np.broadcast_to(np.asarray(t_max, np.float64), n))
    tracers = [_tracer(surface, i) for i, surface in enumerate(surfaces)]
    rows = _trace(tracers, o, d, low, high, threads)
    # A fold just behind the hit may be the hit itself, seen with roundings.
    ambiguous = rows[:, found.FOLD_T] <= rows[:, found.T] * (1 + 1e-9)
    ambiguous &= np.isfinite(rows[:, found.FOLD_T])
    _judge_rims(tracers, rows, o, d, low, high, ambiguous, threads)
    is_hit = rows[:, found.OBJECT] >= 0
    boxes = [_centre_and_size(surface) for surface in surfaces]
    centres, sizes = np.array([c for c, _ in boxes]), np.array([s for _, s in boxes])
    objects = rows[:, found.OBJECT].astype(np.int32)
    scale = np.maximum(np.linalg.norm(o - centres[objects], axis=1), sizes[objects])
    return Truth(
        t=np.where(is_hit, rows[:, found.T], np.inf),
        object_id=objects,
        patch_id=rows[:, found.PATCH].astype(np.int32),
        u=rows[:, found.U].copy(),
        v=rows[:, found.V].copy(),
        cos=rows[:, found.COS].copy(),
        scale=np.where(is_hit, scale, np.nan),
        ambiguous=ambiguous,
        unresolved=rows[:, found.UNRESOLVED] > 0,
    )


def _trace(
    tracers: Sequence[Trace],
    o: FloatArray,
    d: FloatArray,
    t_min: FloatArray,
    t_max: FloatArray,
    threads: int | None,
) -> FloatArray:
    rows = np.zeros((len(o), found.COLUMNS))
    rows[:, [found.OBJECT, found.PATCH, found.EDGE_OBJECT, found.EDGE_PATCH]] = -1
    rows[:, [found.U, found.V, found.COS, found.EDGE_U, found.EDGE_V]] = np.nan
    rows[:, [found.FOLD_T, found.EDGE_T]] = np.inf
    rows[:, found.T] = t_max

    def work(begin: int) -> None:
        part = slice(begin, begin + CHUNK)
        for trace in tracers:
            trace(o[part], d[part], t_min[part], rows[part])

    with ThreadPoolExecutor(threads or os.cpu_count()) as pool:
        list(pool.map(work, range(0, len(o), CHUNK)))
    return rows


def _judge_rims(
    tracers: Sequence[Trace],
    rows: FloatArray,
    o: FloatArray,
    d: FloatArray,
    t_min: FloatArray,
    t_max: FloatArray,
    ambiguous: BoolArray,
    threads: int | None,
) -> None:
    """Decide, by shifted rays, what happens where a ray passes a rim within the band."""
    near = 2.0 * rows[:, found.EDGE_BAND] / np.linalg.norm(d, axis=1)
    reaches = rows[:, found.EDGE_T] <= rows[:, found.T] + near
    doubtful = np.flatnonzero(reaches & np.isfinite(rows[:, found.EDGE_T]) & ~ambiguous)
    if doubtful.size == 0:
        return
    length = np.linalg.norm(d[doubtful], axis=1)
    unit = d[doubtful] / length[:, None]
    side = np.cross(unit, np.eye(3)[np.abs(unit).argmin(axis=1)])
    side /= np.linalg.norm(side, axis=1)[:, None]
    up = np.cross(unit, side)
    radius = SHIFT * rows[doubtful, found.EDGE_BAND]
    # An odd angle, so that shifts do not run along edges of figures made by hand.
    angles = 0.3 + 2.0 * np.pi * np.arange(N_SHIFTED) / N_SHIFTED
    shift = np.cos(angles)[:, None, None] * side + np.sin(angles)[:, None, None] * up
    origins = o[doubtful] + radius[:, None] * shift
    many = [np.tile(a[doubtful], (N_SHIFTED,) + (1,) * (a.ndim - 1)) for a in (d, t_min, t_max)]
    tried = _trace(tracers, origins.reshape(-1, 3), many[0], many[1], many[2], threads)
    is_hit = tried[:, found.OBJECT] >= 0
    t = np.where(is_hit, tried[:, found.T], np.inf).reshape(N_SHIFTED, -1)
    cos = np.where(is_hit, tried[:, found.COS], 1.0).reshape(N_SHIFTED, -1).min(axis=0)
    root = np.where(rows[doubtful, found.OBJECT] >= 0, rows[doubtful, found.T], np.inf)
    edge = rows[doubtful, found.EDGE_T]
    allowed = 4.0 * radius / (cos * length)
    with np.errstate(invalid="ignore"):
        as_root = ((np.abs(t - root) <= allowed) | (np.isinf(t) & np.isinf(root))).all(axis=0)
        as_edge = (np.abs(t - edge) <= allowed).all(axis=0) & ~as_root
    take = doubtful[as_edge]
    for to, source in (
        (found.T, found.EDGE_T), (found.OBJECT, found.EDGE_OBJECT),
        (found.PATCH, found.EDGE_PATCH), (found.U, found.EDGE_U), (found.V, found.EDGE_V),
    ):  # fmt: skip
        rows[take, to] = rows[take, source]
    rows[take, found.COS] = cos[as_edge]
    ambiguous[doubtful[~as_root & ~as_edge]] = True


def _centre_and_size(surface: Any) -> tuple[FloatArray, float]:
    bounds = surface.bounds
    if not np.isfinite(bounds).all():
        return surface.origin, 0.0
    return bounds.mean(axis=0), float(np.linalg.norm(bounds[1] - bounds[0]))


def _tracer(surface: Any, object_id: int) -> Trace:
    centre, size = _centre_and_size(surface)
    if isinstance(surface, BezierPatches):
        return _trace_patches(surface, object_id, centre, size)
    if isinstance(surface, SurfaceOfRevolution):
        return _trace_revolution(surface, object_id, centre, size)
    name = type(surface).__name__
    if name == "Sphere":
        return lambda o, d, t_min, rows: closed.trace_sphere(
            surface.center, surface.radius, object_id, o, d, t_min, rows
        )
    faces, ids, kind = _as_faces(surface, name)

    def trace(o: FloatArray, d: FloatArray, t_min: FloatArray, rows: FloatArray) -> None:
        work = np.empty((7, 3, 2))
        closed.trace_flat(faces, ids, kind, centre, size, object_id, o, d, t_min, rows, work)

    return trace


def _trace_patches(
    surface: BezierPatches, object_id: int, centre: FloatArray, size: float
) -> Trace:
    boxes = np.array([[p.min(axis=(0, 1)), p.max(axis=(0, 1))] for p in surface.patches])
    m, n = surface.degrees.max(axis=0).tolist()

    def trace(o: FloatArray, d: FloatArray, t_min: FloatArray, rows: FloatArray) -> None:
        stack = np.empty((patch.STACK + 1, 3, m + 1, n + 1))
        scratch = (stack, np.empty((patch.STACK + 1, 4)), np.empty((5, 32)), np.empty((3, 4)))
        patch.trace_patches(
            surface.control, surface.starts, surface.degrees, boxes, centre, size, object_id,
            o, d, t_min, rows, *scratch,
        )  # fmt: skip

    return trace


def _trace_revolution(
    surface: SurfaceOfRevolution, object_id: int, centre: FloatArray, size: float
) -> Trace:
    starts = np.cumsum([0, *map(len, surface.segments)], dtype=np.int64)
    profile = np.concatenate(surface.segments)
    n = max(map(len, surface.segments))

    def trace(o: FloatArray, d: FloatArray, t_min: FloatArray, rows: FloatArray) -> None:
        depth = revolution.STACK + 1
        scratch = (np.empty((depth, 2, n)), np.empty((depth, 4)), np.empty((2, 32)))
        revolution.trace_revolution(
            profile, starts, surface.origin, surface.axis, surface.radial, surface.binormal,
            centre, size, object_id, o, d, t_min, rows, *scratch, np.empty((6, 2)),
            np.empty((2, 4)),
        )  # fmt: skip

    return trace


def _as_faces(surface: Any, name: str) -> tuple[FloatArray, IntArray, int]:
    """Corner, two edges and their rounding, of each flat face; of a plane, point and normal."""
    if name == "Rectangle":
        faces = np.zeros((1, 5, 3))
        faces[0, :3] = surface.corner, surface.edge_u, surface.edge_v
        return faces, np.zeros(1, np.int32), closed.PARALLELOGRAM
    if name == "Plane":
        faces = np.zeros((1, 5, 3))
        faces[0, :2] = surface.origin, surface.unit_normal
        return faces, np.zeros(1, np.int32), closed.PLANE
    if name == "Box":
        faces = np.zeros((6, 5, 3))
        size, rest = _exact_difference(surface.hi, surface.lo)
        for face in range(6):
            axis = face // 2
            first, second = (axis + 1) % 3, (axis + 2) % 3
            faces[face, 0] = surface.lo
            faces[face, 0, axis] = surface.hi[axis] if face % 2 else surface.lo[axis]
            faces[face, 1, first], faces[face, 3, first] = size[first], rest[first]
            faces[face, 2, second], faces[face, 4, second] = size[second], rest[second]
        return faces, np.arange(6, dtype=np.int32), closed.PARALLELOGRAM
    if name == "TriangleMesh":
        a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
        u, u_rest = _exact_difference(b, a)
        v, v_rest = _exact_difference(c, a)
        faces = np.ascontiguousarray(np.stack([a, u, v, u_rest, v_rest], axis=1))
        return faces, np.arange(len(faces), dtype=np.int32), closed.TRIANGLE
    raise TypeError(f"the oracle knows no surface of kind {name}: add it to hybrid_rt.verify")


def _exact_difference(a: FloatArray, b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Difference and its rounding error (Knuth)."""
    s = a - b
    z = s - a
    return s, (a - (s - z)) - (b + z)
