"""What is interpolated over meshes at a hit: the normal to shade by, and where textures are looked up."""

from typing import Any, NamedTuple

import numpy as np

from meshing.kernels.jit import inlined, kernel


class MeshPoints(NamedTuple):
    """Vertex normals and texture coordinates of all meshes; columns of objects are empty if none has any."""

    first_face: Any  # (objects,) int64: row of a smooth mesh's first face; -1: another object
    face: Any  # (f, 3) int64, rows of ``normal``
    normal: Any  # (v, 3) float64
    first_patch: (
        Any  # (objects,) int64: row in ``place`` of an object with texture coordinates; or -1
    )
    n_patches: Any  # (objects,) int64: of an object in one place
    place: Any  # (p, 3, 2) float64: texture coordinates of the corners (0, 0), (1, 0) and (0, 1)


@inlined
def texture_point(meshes, object_id, patch_id, u, v):
    """Return where textures are looked up at a hit."""
    if meshes.first_patch.size == 0 or object_id < 0 or meshes.first_patch[object_id] < 0:
        return u, v
    p = meshes.place[meshes.first_patch[object_id] + patch_id % meshes.n_patches[object_id]]
    # Where all corners are at one place, as in palettes, so is the result, to the last bit.
    return (
        p[0, 0] + u * (p[1, 0] - p[0, 0]) + v * (p[2, 0] - p[0, 0]),
        p[0, 1] + u * (p[1, 1] - p[0, 1]) + v * (p[2, 1] - p[0, 1]),
    )


@inlined
def shading_normal(meshes, object_id, patch_id, u, v, direction, flat):
    """Return the normal to shade a hit by.

    Where a ray arrives on different sides of the two normals, along silhouettes, that is the face normal,
    ``flat``.
    """
    if object_id < 0 or meshes.first_face[object_id] < 0:
        return flat[0], flat[1], flat[2]
    face, normal = meshes.face[meshes.first_face[object_id] + patch_id], meshes.normal
    w = 1.0 - u - v
    x = w * normal[face[0], 0] + u * normal[face[1], 0] + v * normal[face[2], 0]
    y = w * normal[face[0], 1] + u * normal[face[1], 1] + v * normal[face[2], 1]
    z = w * normal[face[0], 2] + u * normal[face[1], 2] + v * normal[face[2], 2]
    length = np.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        x, y, z = x / length, y / length, z / length
    before = flat[0] * direction[0] + flat[1] * direction[1] + flat[2] * direction[2]
    after = x * direction[0] + y * direction[1] + z * direction[2]
    if before * after > 0.0:
        return x, y, z
    return flat[0], flat[1], flat[2]


@kernel
def texture_points(meshes, object_id, patch_id, u, v, out):
    """Write where textures are looked up at n hits to ``out`` (2, n)."""
    for i in range(object_id.size):
        out[0, i], out[1, i] = texture_point(meshes, object_id[i], patch_id[i], u[i], v[i])


@kernel
def shading_normals(meshes, object_id, patch_id, u, v, direction, flat, out):
    """Write the normals to shade n hits by to ``out`` (n, 3)."""
    for i in range(object_id.size):
        out[i, 0], out[i, 1], out[i, 2] = shading_normal(
            meshes, object_id[i], patch_id[i], u[i], v[i], direction[i], flat[i]
        )
