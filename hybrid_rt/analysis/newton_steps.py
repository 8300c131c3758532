"""Uncertified hits after a fixed number of Newton steps: how the error depends on that number.

The tracer iterates until rounding stops it; here the number of steps is fixed, as in renderers that
take two or three. The rest is the same: Embree on triangles of a tolerance, and if Newton iteration
leaves the surface the next triangle is tried.
"""

from collections.abc import Sequence

import numpy as np

from hybrid_rt.analysis.kernels.newton_steps import Pieces, Stepped, Triangles, take_steps
from hybrid_rt.core.records import FloatArray, HitRecord, IntArray, Status
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.coarse.embree import CoarseScene
from hybrid_rt.intersection.kernels.search.coarse import CoarseHits
from hybrid_rt.intersection.kind import new_record
from meshing import BezierPatches, SurfaceOfRevolution, tessellate
from meshing.bezier import RationalPatches
from meshing.kernels.bernstein import MAX_DEGREE
from meshing.surface import Surface

# As the tracer does it: how often the next triangle is tried, and how far beyond the one before.
RETRIES = 4
STEP_OVER = 2.0**-18


class SteppedHits:
    """First hits on curved surfaces by triangles and Newton; a TypeError for surfaces that need no steps."""

    def __init__(
        self,
        surfaces: Sequence[BezierPatches | SurfaceOfRevolution],
        tolerance: float,
        threads: int | None = None,
    ) -> None:
        for number, surface in enumerate(surfaces):
            if not surface.is_freeform:
                raise TypeError(
                    f"surfaces[{number}] is a {type(surface).__name__}: pass patches and surfaces "
                    "of revolution, others have a closed form"
                )
        meshes = [tessellate(surface, tolerance) for surface in surfaces]
        firsts = np.cumsum([0, *map(len, surfaces)])
        n_vertices = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        vertices = np.concatenate([mesh.vertices for mesh in meshes])
        faces = [mesh.faces + n for mesh, n in zip(meshes, n_vertices[:-1], strict=True)]
        pieces = [mesh.patch_id + n for mesh, n in zip(meshes, firsts[:-1], strict=True)]
        self._scene = CoarseScene(vertices, np.concatenate(faces))
        self._piece_of = np.concatenate(pieces).astype(np.int64)
        self._corner_uv = np.concatenate([mesh.uv for mesh in meshes]).astype(np.float64)
        self._object_of = np.repeat(np.arange(len(surfaces), dtype=np.int32), np.diff(firsts))
        self._patch_of = np.concatenate([np.arange(len(s), dtype=np.int32) for s in surfaces])
        self._middle = 0.5 * (vertices.min(axis=0) + vertices.max(axis=0))
        self._pieces = _pieces(surfaces, self._middle)
        self._pool = Pool(threads)

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return self._scene.n_triangles

    def intersect(self, origins: FloatArray, directions: FloatArray, steps: int) -> HitRecord:
        """Return hits after ``steps`` Newton steps; with 0, the hit on the triangle.

        ``t_bound`` is inf: nothing is proven. ``residual`` is the distance left between the surface point and the
        ray point.
        """
        n = len(origins)
        record, piece = new_record(n), np.full(n, -1, np.int64)
        record.t[:], record.t_bound[:], record.residual[:] = np.inf, np.inf, 0.0

        def work(begin: int, end: int) -> None:
            self._slice(origins[begin:end], directions[begin:end], steps, record, piece, begin)

        self._pool.run(work, n)
        hit = piece >= 0
        record.status[:] = np.where(hit, Status.HIT, Status.MISS)
        record.object_id[:] = np.where(hit, self._object_of[piece], -1)
        record.patch_id[:] = np.where(hit, self._patch_of[piece], -1)
        record.position[:] = origins + np.where(hit, record.t, 0.0)[:, None] * directions
        record.front_face[:] = np.einsum("ij,ij->i", record.normal, directions) < 0.0
        return record

    def _slice(
        self,
        origin: FloatArray,
        direction: FloatArray,
        steps: int,
        record: HitRecord,
        piece: IntArray | np.ndarray,
        begin: int,
    ) -> None:
        rows = np.arange(len(origin))
        part = slice(begin, begin + len(origin))
        out = Stepped(
            record.t[part], piece[part], record.u[part], record.v[part], record.normal[part],
            record.residual[part],
        )  # fmt: skip
        triangles = Triangles(self._corner_uv, self._piece_of)
        t_start, t_max = np.zeros(len(origin)), np.full(len(origin), np.inf)
        basis = np.empty((4, MAX_DEGREE + 1))
        for _ in range(RETRIES + 1):
            face, t, u, v = self._scene.first(
                origin[rows], direction[rows], t_start[rows], t_max[rows]
            )
            is_hit = face >= 0
            rows, face, t, u, v = rows[is_hit], face[is_hit], t[is_hit], u[is_hit], v[is_hit]
            if not len(rows):
                return
            accepted = np.zeros(len(rows), np.bool_)
            take_steps(
                self._pieces, self._middle, steps, CoarseHits(face, t, u, v), triangles, rows,
                origin, direction, out, basis, accepted,
            )  # fmt: skip
            t_start[rows] = t + STEP_OVER / self._scene.frame.to_frame
            rows = rows[~accepted]


def _pieces(surfaces: Sequence[BezierPatches | SurfaceOfRevolution], middle: FloatArray) -> Pieces:
    rows = [row for surface in surfaces for row in _rows(surface, middle)]
    points, degrees, frames = zip(*rows, strict=True)
    starts = np.cumsum([0, *map(len, points)])[:-1]
    control = np.zeros((sum(map(len, points)), 4))
    control[:, :3] = np.concatenate(points)
    return Pieces(control, starts.astype(np.int64), np.array(degrees, np.int64), np.array(frames))


Row = tuple[FloatArray, tuple[int, int], FloatArray]
"""Points, degrees (-1 in u for a profile) and frame of one piece."""


def _rows(surface: Surface, middle: FloatArray) -> list[Row]:
    """Return the pieces of a surface about a point."""
    if isinstance(surface, RationalPatches):
        raise TypeError(
            f"{surface!r} is rational: pass polynomial patches, steps are counted on these"
        )
    if isinstance(surface, BezierPatches):
        return [
            (net.reshape(-1, 3) - middle, (net.shape[0] - 1, net.shape[1] - 1), np.zeros(12))
            for net in surface.patches
        ]
    if not isinstance(surface, SurfaceOfRevolution):
        raise TypeError(f"a {type(surface).__name__} has no control points")
    if surface.is_rational or not surface.is_whole_turn:
        raise TypeError(
            f"{surface!r} is rational or a part of a turn: pass whole turns of plain profiles, steps are "
            "counted on these"
        )
    frame = np.concatenate(
        (surface.origin - middle, surface.axis, surface.radial, surface.binormal)
    )
    return [
        (np.column_stack([segment, np.zeros(len(segment))]), (-1, len(segment) - 1), frame)
        for segment in surface.segments
    ]
