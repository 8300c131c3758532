"""Coarse hits from Embree; the only module that imports it.

Embree works in float32, so the triangles are first centred, and scaled by a power of two. Origins
of distant rays are advanced in float64 before they are rounded, and rays that miss the box of all
triangles stay here: Embree takes 80 ns even for these. The result is approximate: a
triangle, and about where on it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.intersection.kernels.search.coarse import (
    CoarseFrame,
    CoarseHits,
    hits_of_rows,
    rays_to_float32,
)
from hybrid_rt.intersection.members import frame_of

# What float32 rounds, and far more: in sizes of the frame.
ROUNDED = 1e-5


class CoarseScene:
    """Triangles in Embree.

    ``vertices`` (v, 3), world frame; ``faces`` (f, 3) integer.
    """

    def __init__(self, vertices: FloatArray, faces: NDArray[np.integer[Any]]) -> None:
        is_used = np.zeros(len(vertices), np.bool_)
        is_used[faces.ravel()] = True
        vertices = np.where(is_used[:, None], vertices, vertices[faces[0, 0]])
        lo, hi = vertices.min(axis=0), vertices.max(axis=0)
        middle, to_frame = frame_of(lo, hi)
        half = (0.5 * hi - 0.5 * lo) * to_frame * (1.0 + ROUNDED) + ROUNDED
        self.frame = CoarseFrame(middle, to_frame, half)
        self._vertices = ((vertices - middle) * to_frame).astype(np.float32)
        self._faces = np.ascontiguousarray(faces, dtype=np.int32)
        self._scene: Any = None
        self._build()

    def _build(self) -> None:
        from embreex.mesh_construction import TriangleMesh
        from embreex.rtcore_scene import EmbreeScene

        scene = EmbreeScene(robust=True)
        TriangleMesh(scene, self._vertices, self._faces)
        # Embree builds its tree on the first ray; after that any number of threads may trace.
        ray = np.zeros((1, 3), np.float32)
        scene.run(ray, ray + np.float32(1.0))
        self._scene = scene

    @property
    def n_triangles(self) -> int:
        """Number of triangles."""
        return len(self._faces)

    def first(
        self, origin: FloatArray, direction: FloatArray, t_min: FloatArray, t_max: FloatArray
    ) -> CoarseHits:
        """Return the first hits of rays on the triangles.

        ``origin``, ``direction`` (n, 3): world frame.
        ``t_min``, ``t_max`` (n,): in lengths of ``direction``; Embree's float32 rounds them.
        Returns CoarseHits of n rows: ``t`` in lengths of ``direction``.
        """
        n = len(origin)
        near, away = np.empty((n, 3), np.float32), np.empty((n, 3), np.float32)
        reach, shift, rows = np.empty(n, np.float32), np.empty(n), np.empty(n, np.int64)
        m = rays_to_float32(
            origin, direction, t_min, t_max, self.frame, near, away, reach, shift, rows
        )
        hits = CoarseHits(np.empty(n, np.int32), np.empty(n), np.empty(n), np.empty(n))
        found = self._scene.run(near[:m], away[:m], dists=reach[:m], output=1)
        hits_of_rows(
            found["primID"], found["tfar"], found["u"], found["v"], shift[:m], rows[:m],
            self.frame.to_frame, hits,
        )  # fmt: skip
        return hits

    def __getstate__(self) -> dict[str, Any]:
        """Embree's memory cannot be copied: an unpickled scene is built again."""
        return {k: v for k, v in self.__dict__.items() if k != "_scene"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Build Embree's scene again."""
        self.__dict__.update(state)
        self._build()
