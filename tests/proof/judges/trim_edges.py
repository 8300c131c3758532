"""The edges of a trimmed surface in space: which hits are outside the loops, beyond the band or the gap."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from meshing import TrimmedSurface
from proof.judges.trim_sides import TrimSides

# A hit may lie so many bands outside: as far as those that say TANGENT may be from their ray.
OUTSIDE = 3.0
# Rays that meet an edge more flatly than this have the gap of a ray that meets it so; what lies within
# a part of that of its end may be decided either way.
FLATTEST_EDGE, AROUND_GAP = 1e-3, 0.02


class TrimEdges:
    """The loops of one trimmed surface, and its partials along them.

    Parameters
    ----------
    surface : TrimmedSurface

    Attributes
    ----------
    sides : TrimSides
    """

    def __init__(self, surface: TrimmedSurface) -> None:
        self.surface, self.sides = surface, TrimSides(surface)

    def are_outside(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any], d: FloatArray, band: FloatArray
    ) -> BoolArray:
        """Tell which hits are outside the loops, beyond the band and the gap.

        Parameters
        ----------
        u, v, patch_id : (n,)
        d : (n, 3) float64
            Directions of the rays, of any length.
        band : (n,) float64
            64 eps x scale, scene units.
        """
        u, v = np.clip(u, 0.0, 1.0), np.clip(v, 0.0, 1.0)
        outside = ~self.sides.inside(u, v)
        rows = np.flatnonzero(outside)
        u, v = u[rows], v[rows]
        seen, lies, cosine = self.steps(u, v, patch_id[rows], d[rows])
        near = np.any(self.sides.passes(u, v, seen, OUTSIDE * band[rows]), axis=0)
        if self.surface.gap > 0.0:
            reach = (1.0 + AROUND_GAP) * self.reach(cosine)
            near |= np.any(self.sides.passes(u, v, lies, reach), axis=0)
        outside[rows[near]] = False
        return outside

    def steps(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any], d: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return S_u and S_v as seen along rays and in the tangent plane, (n, 2, 2), and |cos|."""
        both = np.stack(self.surface.partials(u, v, patch_id), axis=2)
        normal = np.cross(both[..., 0], both[..., 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            normal /= np.linalg.norm(normal, axis=1)[:, None]
            way = d / np.linalg.norm(d, axis=1)[:, None]
            cosine = np.abs(np.einsum("ij,ij->i", normal, way))
        return _across(way) @ both, _across(normal) @ both, cosine

    def reach(self, cosine: FloatArray) -> FloatArray:
        """Return how far outside the loops the gap lets roots count, scene units."""
        return self.surface.gap / np.fmax(cosine, FLATTEST_EDGE)


def _across(ways: FloatArray) -> FloatArray:
    """Return two unit vectors across each of some unit vectors, (n, 2, 3)."""
    helper = np.eye(3)[np.abs(np.nan_to_num(ways)).argmin(axis=1)]
    first = np.cross(ways, helper)
    with np.errstate(divide="ignore", invalid="ignore"):
        first /= np.linalg.norm(first, axis=1)[:, None]
    return np.stack([first, np.cross(ways, first)], axis=1)
