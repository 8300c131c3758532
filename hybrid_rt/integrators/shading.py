"""Hits with all that shading needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.primitives.instances import Instances
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.shading.kernels.bsdf import LobeTable, Vertices
from hybrid_rt.shading.kernels.lobes.dielectric import split_rays
from hybrid_rt.shading.kernels.mesh_points import MeshPoints

NO_NORMALS = np.zeros((0, 3))
NO_RATIO, NO_MEDIA = np.zeros(0), np.zeros((0, 0), dtype=np.int32)


# Parameters of the corners of a triangle.
CORNERS = np.array([(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])


def mesh_points(scene: CompiledScene) -> MeshPoints:
    """Return what is interpolated over the meshes of a scene."""
    n = len(scene.surfaces)
    first_face, face, normal = np.full(n, -1), [np.zeros((0, 3), np.int64)], [np.zeros((0, 3))]
    n_faces = n_vertices = 0
    for i, normals in scene.vertex_normals.items():
        first_face[i] = n_faces
        face.append(scene.surfaces[i].faces + n_vertices)
        normal.append(normals)
        n_faces, n_vertices = n_faces + len(face[-1]), n_vertices + len(normals)
    first_patch, n_patches, place = np.full(n, -1), np.ones(n, np.int64), [np.zeros((0, 3, 2))]
    for i, mesh in scene.unwrapped.items():
        count = mesh.n_patches if isinstance(mesh, Instances) else len(mesh)
        first_patch[i], n_patches[i] = sum(map(len, place)), count
        patch = np.repeat(np.arange(count), 3)
        u, v = np.tile(CORNERS, (count, 1)).T.copy()
        place.append(mesh.texture_point(u, v, patch).reshape(-1, 3, 2))
    return MeshPoints(
        first_face if scene.vertex_normals else first_face[:0],
        np.concatenate(face),
        np.concatenate(normal),
        first_patch if scene.unwrapped else first_patch[:0],
        n_patches,
        np.concatenate(place),
    )


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
