"""The usual method, tuned: a uniform mesh in Embree, Newton iteration from its hits, no proof.

One job of the pool does both stages for a block of rays, into preallocated arrays.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.kernels.embree_newton import refine
from hybrid_rt.core.records import FloatArray, IntArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.coarse.embree import CoarseScene
from meshing import BezierPatches

CELLS = 8
BLOCK = 32768


class Rival:
    """Uncertified first hits on bicubic patches.

    Parameters
    ----------
    surface : BezierPatches, polynomial, all of degree 3 x 3
    threads : int, optional

    Raises
    ------
    ValueError
        For patches of another degree.
    """

    def __init__(self, surface: BezierPatches, threads: int | None = None) -> None:
        if surface.weights is not None:
            raise ValueError(f"{surface!r} has weights: pass polynomial patches")
        for p, net in enumerate(surface.patches):
            if net.shape != (4, 4, 3):
                raise ValueError(f"patch {p} has a net of shape {net.shape}: pass bicubic patches")
        n = len(surface)
        self._control = np.zeros((16 * n, 4))
        self._control[:, :3] = np.concatenate([net.reshape(-1, 3) for net in surface.patches])
        side = CELLS + 1
        u, v = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, 1, side), indexing="ij")
        vertices = [surface.point(u.ravel(), v.ravel(), np.full(side * side, p)) for p in range(n)]
        a = (np.arange(CELLS)[:, None] * side + np.arange(CELLS)).ravel()
        lower = np.stack([a, a + side, a + 1], axis=1)
        upper = np.stack([a + side + 1, a + 1, a + side], axis=1)
        faces = np.stack([lower, upper], axis=1).reshape(-1, 3)
        faces = (faces[None] + side * side * np.arange(n)[:, None, None]).reshape(-1, 3)
        self._scene = CoarseScene(np.concatenate(vertices), faces)
        self._pool = Pool(threads)

    def intersect(self, origins: FloatArray, directions: FloatArray, out: Any) -> None:
        """Fill ``out = (t, patch, u, v)`` of n rows; inf and -1 for a miss."""
        t_all, patch_all, u_all, v_all = out
        zero, none = np.zeros(BLOCK), np.full(BLOCK, np.inf)

        def work(begin: int, end: int) -> None:
            for low in range(begin, end, BLOCK):
                rows = slice(low, min(low + BLOCK, end))
                o, d = origins[rows], directions[rows]
                face, t, u, v = self._scene.first(o, d, zero[: len(o)], none[: len(o)])
                refine(
                    self._control, CELLS, face, u, v, t, o, d,
                    t_all[rows], patch_all[rows], u_all[rows], v_all[rows],
                )  # fmt: skip

        self._pool.run(work, len(origins), BLOCK)


def buffers(n: int) -> tuple[FloatArray, IntArray, FloatArray, FloatArray]:
    """Allocate arrays for the results of n rays."""
    return np.empty(n), np.empty(n, np.int32), np.empty(n), np.empty(n)


def evaluate_with_numpy(nets: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return S, S_u, S_v of bicubic patches, one (u, v) each, in plain NumPy.

    Parameters
    ----------
    nets : (n, 4, 4, 3) float64
    u, v : (n,) float64

    Returns
    -------
    (3, n, 3) float64
    """
    values_u, slopes_u = _bernstein_with_numpy(u)
    values_v, slopes_v = _bernstein_with_numpy(v)
    rows = np.einsum("nj,nijc->nic", values_v, nets)
    return np.stack(
        [
            np.einsum("ni,nic->nc", values_u, rows),
            np.einsum("ni,nic->nc", slopes_u, rows),
            np.einsum("ni,nic->nc", values_u, np.einsum("nj,nijc->nic", slopes_v, nets)),
        ]
    )


def _bernstein_with_numpy(x: FloatArray) -> tuple[FloatArray, FloatArray]:
    y = 1.0 - x
    values = np.stack([y**3, 3 * y * y * x, 3 * y * x * x, x**3], axis=1)
    slopes = np.stack([-3 * y * y, 3 * y * y - 6 * y * x, 6 * y * x - 3 * x * x, 3 * x * x], axis=1)
    return values, slopes
