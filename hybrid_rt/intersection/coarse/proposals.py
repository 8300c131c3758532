"""The coarse stage: triangles of all curved surfaces in Embree, and the use of its hits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.core.timing import Stopwatch
from hybrid_rt.intersection.coarse.embree import CoarseScene
from hybrid_rt.intersection.kernels.search.coarse import (
    CoarseHits,
    CoarseTriangles,
    finish_mesh,
    offer_faces,
)
from hybrid_rt.intersection.kernels.search.counters import NEWTONS
from hybrid_rt.intersection.kernels.search.nearest import Nearest, Rays
from hybrid_rt.intersection.kind import CurvedKind, Finished
from hybrid_rt.intersection.sheets import Sheets
from hybrid_rt.intersection.trims import coarse_triangles
from meshing import TrimmedSurface, tessellate
from meshing.surface import Surface

# Chordal tolerance of the coarse triangles over the surface's size: where they are the answer, or
# all that Newton starts from; and where a search comes after that needs no more than a guess.
MESH_TOLERANCE = 1e-3
GUESS_TOLERANCE = 4e-3
# A coarse hit that refinement rejects (the point of departure, or a triangle beside the surface)
# is stepped over this often before the ray is taken to miss.
RETRIES = 4
# Across a surface that is smaller in the frame, single precision has fewer than some hundred steps.
SMALLEST_SIZE = 2.0**-17
# The step over a rejected hit, relative to the frame: a few float32 roundings.
STEP_OVER = 2.0**-18


class Coarse:
    """Coarse hits on all surfaces that go to Embree.

    ``members``, sequence of (object id, surface).
    ``n_objects``: one more than the last object that has triangles.
    """

    def __init__(
        self, members: Sequence[tuple[int, Surface]], tolerance: float | None, relative: float
    ) -> None:
        vertices, faces, objects, pieces, corners = [], [], [], [], []
        n_vertices, coarsest = 0, 0.0
        self._sheets = Sheets.of(members)
        for object_id, surface in members:
            off = tolerance or relative * surface.size
            if isinstance(surface, TrimmedSurface):
                mesh = coarse_triangles(surface, off)
            elif surface.is_freeform:
                # Cells of a sheet go by the parameters of its patches.
                mesh = tessellate(surface.pieces, off)
            else:
                mesh, off = surface.triangles(), 0.0
            coarsest = max(coarsest, off)
            vertices.append(mesh.vertices)
            faces.append(mesh.faces + n_vertices)
            objects.append(np.full(len(mesh), object_id, np.int32))
            pieces.append(mesh.patch_id)
            corners.append(mesh.uv)
            n_vertices += len(mesh.vertices)
        self.triangles = CoarseTriangles(
            vertex=np.ascontiguousarray(np.concatenate(vertices)),
            face=np.ascontiguousarray(np.concatenate(faces), dtype=np.int64),
            object_id=np.concatenate(objects),
            piece=np.concatenate(pieces),
            corner_uv=np.ascontiguousarray(np.concatenate(corners), dtype=np.float64),
        )
        self.n_objects = int(self.triangles.object_id.max()) + 1
        self.scene = CoarseScene(self.triangles.vertex, self.triangles.face)
        self._sizes = [(object_id, surface.size) for object_id, surface in members]
        # Triangles may lie so far in front of a point of the surface, where rays are not flatter than
        # a quarter.
        self._before_targets = STEP_OVER / self.scene.frame.to_frame + 4.0 * coarsest

    def check_sizes(self, accuracy: str) -> None:
        """Check that Embree can tell the triangles of each surface apart, where it has the last word.

        Raises ValueError if a surface is too small beside all of them. It is named.
        """
        for object_id, size in self._sizes:
            if size * self.scene.frame.to_frame < SMALLEST_SIZE:
                raise ValueError(
                    f"surfaces[{object_id}] is {size:.3g} across, less than {SMALLEST_SIZE:.1g} of what goes to "
                    "Embree together: single precision cannot tell its triangles apart. "
                    f'Pass accuracy="certified" instead of {accuracy!r}'
                )

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return len(self.triangles.face)

    def propose(
        self,
        kinds: Sequence[CurvedKind],
        rays: Rays,
        best: Nearest,
        found: BoolArray,
        watch: Stopwatch,
    ) -> list[IntArray]:
        """Return the initial guess for `trace` of each kind: (n,) int32, -1 for none.

        ``rays``, Rays of n rows.
        ``best``, Nearest of n rows: its t limits the search for coarse hits.
        ``found`` (n,) bool, written: whether Embree has a hit.
        ``watch``: measures all of this.
        """
        with watch:
            hits = self.scene.first(rays.origin, rays.direction, rays.t_min, best.t)
            found[:] = hits.face >= 0
            return [kind.guesses(self, hits) for kind in kinds]

    def refine(
        self,
        kinds: Sequence[CurvedKind],
        rays: Rays,
        best: Nearest,
        work: FloatArray,
        found: BoolArray,
        watch: Stopwatch,
    ) -> None:
        """Lower ``best`` to refined coarse hits, or without kinds (accuracy "mesh") to the hits.

        ``rays``, Rays of n rows; ``best``, Nearest of n rows, changed.
        ``work`` (counters,), changed: tally of
        `hybrid_rt.intersection.kernels.search.counters.COUNTER_NAMES`.
        ``found`` (n,) bool, changed: set where Embree has a hit.
        ``watch``: measures Embree alone, without the refinement.
        """
        rows = np.arange(len(best.t))
        t_start = rays.t_min.copy()
        if len(rays.known):  # step off the triangles of the point of departure
            t_start[rays.known[:, 1] >= 0] += STEP_OVER / self.scene.frame.to_frame
            if not kinds:  # and end before those of a target
                length = np.linalg.norm(rays.direction, axis=1)
                end = rays.known[:, 2] - self._before_targets / length
                best.t[:] = np.where(rays.known[:, 3] >= 0, np.minimum(best.t, end), best.t)
        for _ in range(RETRIES + 1):
            with watch:
                hits = self.scene.first(
                    rays.origin[rows], rays.direction[rows], t_start[rows], best.t[rows]
                )
            is_hit = hits.face >= 0
            rows, hits = rows[is_hit], CoarseHits(*(column[is_hit] for column in hits))
            if not len(rows):
                return
            found[rows] = True
            accepted = np.zeros(len(rows), np.bool_)
            if not kinds:
                offer_faces(hits, self.triangles, rows, rays, t_start, best, accepted)
            for kind in kinds:
                kind.refine(self, hits, rows, rays, best, accepted)
                work[NEWTONS] += len(rows)
            t_start[rows] = hits.t + STEP_OVER / self.scene.frame.to_frame
            rows = rows[~accepted]

    def finish(
        self, rays: Rays, best: Nearest, kind_of: IntArray, kind: int, out: Finished
    ) -> None:
        """Describe hits on triangles (accuracy "mesh"): ``best.primitive`` is the face."""
        finish_mesh(self.triangles, rays, best, kind_of, kind, out)
        if self._sheets is not None:
            self._sheets.finish(best.object_id, out)
