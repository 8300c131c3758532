"""Parallelograms that shine together, as the faces of a box: sampled evenly by solid angle.

A face is chosen by the solid angle that it is seen under, then a point of it as by
`hybrid_rt.shading.kernels.parallelogram`. Faces seen from behind have none.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.shading.kernels.parallelogram import even_point, solid_angle
from meshing.kernels.jit import inlined, kernel


class Faces(NamedTuple):
    """Parallelograms; m rows. Their fronts are on the side of u x v."""

    corner: Any  # (m, 3) float64
    edge_u: Any  # (m, 3) float64
    edge_v: Any  # (m, 3) float64
    normal: Any  # (m, 3) float64, unit


@inlined
def _angle(faces, k, px, py, pz):
    """Return the solid angle of face k, seen from p."""
    return solid_angle(
        faces.corner[k, 0] - px, faces.corner[k, 1] - py, faces.corner[k, 2] - pz,
        faces.edge_u[k, 0], faces.edge_u[k, 1], faces.edge_u[k, 2],
        faces.edge_v[k, 0], faces.edge_v[k, 1], faces.edge_v[k, 2],
    )  # fmt: skip


@kernel(allocates=True)
def sample_faces(faces, seen_from, xi, angle, points):
    """Sample points (n rows, written) evenly by solid angle; ``angle`` (m,) is scratch memory.

    Their ``pdf_area`` is 0 where every face is seen from behind.
    """
    position, normal, pdf_area, u, v = points
    for i in range(pdf_area.size):
        px, py, pz = seen_from[i, 0], seen_from[i, 1], seen_from[i, 2]
        total = 0.0
        for k in range(angle.size):
            angle[k] = _angle(faces, k, px, py, pz)
            total += angle[k]
        pdf_area[i] = 0.0
        if total <= 0.0:
            continue
        rest, chosen = xi[i, 0] * total, 0
        for k in range(angle.size):
            if angle[k] > 0.0:
                chosen = k
                if rest < angle[k]:
                    break
                rest -= angle[k]
        k = chosen
        x, y, z, u[i], v[i], _ = even_point(
            faces.corner[k, 0] - px, faces.corner[k, 1] - py, faces.corner[k, 2] - pz,
            faces.edge_u[k, 0], faces.edge_u[k, 1], faces.edge_u[k, 2],
            faces.edge_v[k, 0], faces.edge_v[k, 1], faces.edge_v[k, 2],
            min(rest / angle[k], 1.0), xi[i, 1],
        )  # fmt: skip
        position[i, 0], position[i, 1], position[i, 2] = px + x, py + y, pz + z
        nx, ny, nz = faces.normal[k, 0], faces.normal[k, 1], faces.normal[k, 2]
        normal[i, 0], normal[i, 1], normal[i, 2] = nx, ny, nz
        # As rounded, so that what follows from it is 1 / total to the last digits.
        x, y, z = position[i, 0] - px, position[i, 1] - py, position[i, 2] - pz
        square = x * x + y * y + z * z
        if square > 0.0:
            pdf_area[i] = -(nx * x + ny * y + nz * z) / (math.sqrt(square) * square * total)


@kernel(allocates=True)
def angle_of_faces(faces, seen_from, total):
    """Compute the solid angle ``total`` (n,) of all faces together, seen from points (n, 3)."""
    for i in range(total.size):
        total[i] = 0.0
        for k in range(faces.corner.shape[0]):
            total[i] += _angle(faces, k, seen_from[i, 0], seen_from[i, 1], seen_from[i, 2])
