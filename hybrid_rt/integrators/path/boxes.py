"""The boxes of clear glass through which lamps are reached."""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.integrators.kernels.through_boxes import Boxes
from hybrid_rt.integrators.path.balls import is_clear, rows_of
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.scene.compiled import CompiledScene
from meshing import SurfaceOfRevolution
from meshing.surface import Surface

# What lies nearer to a face than this part of the box's coordinates may touch it: far more than
# rounding, and less than any gap that is meant.
NEAR = 1e-9
# The part of a face, along its edges, that is its rim: what touches only this does not matter.
RIM = 1e-6
# Cosine between edges that are taken for being at right angles: rounding, turned by any rotation.
RIGHT = 1e-12


def boxes_of(scene: CompiledScene, *, wanted: bool) -> Boxes:
    """Return the boxes of clear glass, with an index above 1; none unless ``wanted``."""
    surfaces = scene.surfaces
    rows = [i for i in range(len(surfaces)) if isinstance(surfaces[i], Box) and is_clear(scene, i)]
    return _table(scene, rows if wanted else [])


def _table(scene: CompiledScene, rows: list[int]) -> Boxes:
    surfaces = scene.surfaces
    lobe = scene.lobes.first[scene.material_of[rows]] if rows else np.zeros(0, dtype=np.int32)
    corner = np.array([surfaces[i].lo for i in rows]).reshape(-1, 3)
    edges = np.array([surfaces[i].edges for i in rows]).reshape(-1, 3, 3)
    along = np.linalg.inv(edges).transpose(0, 2, 1)
    length = np.linalg.norm(along, axis=2)
    center = corner + 0.5 * edges.sum(axis=1)
    signs = np.stack(np.meshgrid(*3 * [(-0.5, 0.5)]), axis=-1).reshape(-1, 3)
    corners = np.einsum("ck,nkx->ncx", signs, edges)
    unit = along / length[:, :, None]
    skew = np.abs(np.einsum("cik,cjk->cij", unit, unit) - np.eye(3))
    color = scene.textures.number[scene.lobes.texture[lobe], :3]
    return Boxes(
        corner=corner,
        along=np.ascontiguousarray(along),
        across=np.ascontiguousarray(unit),
        thickness=1.0 / length,
        center=center,
        square=(corners**2).sum(axis=2).max(axis=1, initial=0.0),
        surface=np.array(rows, dtype=np.int32),
        lobe=np.asarray(lobe, dtype=np.int32),
        tint=np.ascontiguousarray(scene.color_factor[lobe, None] * color, dtype=np.float64),
        is_open=open_faces(surfaces, rows),
        is_right=skew.max(axis=(1, 2), initial=0.0) <= RIGHT,
        of_surface=rows_of(scene, rows),
    )


def open_faces(surfaces: list[Surface], rows: list[int]) -> BoolArray:
    """Tell on which faces of some boxes no other surface lies, (rows, 6) bool.

    A way through glass ends or begins in its face, where a shadow ray would not tell that another
    surface is there as well. Surfaces that touch the face in points or curves do not matter.
    """
    is_open = np.ones((len(rows), 6), dtype=np.bool_)
    if not rows:
        return is_open
    bounds = np.array([surface.bounds for surface in surfaces])
    flat: dict[int, FloatArray] = {}
    for row, one in enumerate(rows):
        slack = NEAR * np.abs(bounds[one]).max()
        around = bounds[one] + ((-slack,), (slack,))
        meets = _meet(bounds, around)
        meets[one] = False
        for other in np.flatnonzero(meets).tolist():
            surface = surfaces[other]
            if isinstance(surface, (Sphere, Torus)):
                continue
            pieces = None
            if not isinstance(surface, Plane):
                if other not in flat:
                    flat[other] = _flat_pieces(surface)
                pieces = flat[other]
                ends = np.stack([pieces.min(axis=1), pieces.max(axis=1)], axis=1)
                pieces = pieces[_meet(ends, around)]
            for face in range(6):
                if is_open[row, face]:
                    is_open[row, face] = not _may_lie_on(
                        surface, pieces, surfaces[one], face, slack
                    )
    return is_open


def _meet(bounds: FloatArray, box: FloatArray) -> BoolArray:
    """Tell which bounds (n, 2, 3) have a point in common with those of a box (2, 3)."""
    meets: BoolArray = ((bounds[:, 0] <= box[1]) & (bounds[:, 1] >= box[0])).all(axis=1)
    return meets


def _may_lie_on(
    surface: Surface, pieces: FloatArray | None, box: Surface, face: int, slack: float
) -> bool:
    """Tell whether part of a surface may lie in the plane of a face, on it but for its rim.

    ``pieces`` are those of `_flat_pieces`.
    """
    assert isinstance(box, Box)
    u, v = np.meshgrid([RIM, 1.0 - RIM], [RIM, 1.0 - RIM])
    corners, normal = box.point(u.ravel(), v.ravel(), face), box.normal(0.5, 0.5, face)
    if isinstance(surface, Plane):
        return bool(np.abs((corners - surface.origin) @ surface.unit_normal).max() <= slack)
    assert pieces is not None
    if isinstance(surface, SurfaceOfRevolution):
        disc = np.cross(surface.radial, surface.binormal)
        if abs(disc @ normal) < (1.0 - NEAR) * np.linalg.norm(disc):
            return False
    heights = (pieces - corners[0]) @ normal
    is_flat = np.abs(heights).max(axis=1) <= slack
    if not isinstance(surface, (Box, Rectangle, TriangleMesh)):
        # Corners of bounds, on both sides of the plane or near it.
        is_flat = (heights.min(axis=1) <= slack) & (heights.max(axis=1) >= -slack)
    pieces = pieces[is_flat]
    low, high = corners.min(axis=0), corners.max(axis=0)
    # Across the face there is room for rounding.
    room = slack * np.abs(normal)
    meets = (pieces.min(axis=1) <= high + room) & (pieces.max(axis=1) >= low - room)
    return bool(meets.all(axis=1).any())


def _flat_pieces(surface: Surface) -> FloatArray:
    """Return corners of flat pieces that a surface consists of, or of its bounds, (n, corners, 3)."""
    if isinstance(surface, TriangleMesh):
        return np.asarray(surface.vertices[surface.faces])
    u, v = np.array([0.0, 1.0, 0.0, 1.0]), np.array([0.0, 0.0, 1.0, 1.0])
    if isinstance(surface, Rectangle):
        return surface.point(u, v)[None]
    if isinstance(surface, Box):
        return np.stack([surface.point(u, v, face) for face in range(6)])
    corners = np.stack(np.meshgrid(*3 * [[0, 1]]), axis=-1).reshape(-1, 3)
    of_bounds: FloatArray = surface.bounds[corners, np.arange(3)]
    return of_bounds[None]
