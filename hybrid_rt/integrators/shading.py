"""Hits with all that shading needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.shading.kernels.bsdf import LobeTable, Vertices
from hybrid_rt.shading.kernels.lobes.dielectric import split_rays

NO_NORMALS = np.zeros((0, 3))
NO_RATIO, NO_MEDIA = np.zeros(0), np.zeros((0, 0), dtype=np.int32)


@dataclass(frozen=True)
class Shading:
    """Hits with all that shading needs: normals, material, lobe colours, media."""

    hits: HitRecord  # HitRecord of n rows: ``normal`` is the shading normal
    directions: FloatArray  # (n, 3): directions of the incoming rays
    material: IntArray  # (n,) int32
    colors: FloatArray  # (n, most lobes of a material, 3)
    # (n, 3), or (0, 3): geometric normals, if they differ from the shading normals
    geometric: FloatArray
    # (n,), or (0,): refractive index beyond the surface over that before it, where rough glass
    # transmits; else 0. Empty if the scene has no rough glass.
    ratio: FloatArray
    beyond: IntArray  # (n, STACK) int32, or (0, 0): medium stacks of rays transmitted there

    @property
    def vertices(self) -> Vertices:
        """The arrays as kernels take them."""
        hits = self.hits
        return Vertices(
            self.material, self.colors, hits.position, hits.normal, self.directions,
            self.geometric, self.ratio,
        )  # fmt: skip


def glass_branches(
    lobes: LobeTable,
    lobe: IntArray,
    shading: Shading,
    rows: NDArray[np.intp],
    media: IntArray,
    second: IntArray,
) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
    """Return what `split_rays` finds for some rays: reflectance, refracted direction, ratio, media beyond.

    ``lobe`` (rows,) are the dielectrics that they hit; the rest is of all rays, ``second`` as in
    `Contacts.at`.
    """
    n, hits = rows.size, shading.hits
    reflectance, refracted, ratio = np.empty(n), np.empty((n, 3)), np.empty(n)
    beyond = media[rows]
    split_rays(
        lobes, lobe, shading.directions[rows], hits.normal[rows], hits.front_face[rows],
        second[rows] if second.size else second, beyond, reflectance, refracted, ratio,
    )  # fmt: skip
    return reflectance, refracted, ratio, beyond
