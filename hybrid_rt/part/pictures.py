"""Pictures of a part: as it looks, and its thickness at every pixel; and the map of it on triangles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.part.walls import Walls
from meshing import tessellate
from meshing.outputs import check_writable, replacing

WIDTH, HEIGHT, FOV = 720, 540, 32.0
LOOK = (-1.0, 1.4, -0.9)
# Colours from thin to thick, sRGB; walls that are not opposite are grey.
RAMP = np.array(
    [(165, 0, 38), (244, 109, 67), (254, 224, 144), (116, 173, 209), (49, 54, 149)], float
)
PLAIN = np.array([176.0, 180.0, 186.0])
# The map on triangles: their distance from the faces, and their edges, over the size.
MAPPED, EDGED = 1e-3, 1.0 / 60.0


def colors_of(thickness: FloatArray, low: float, high: float) -> FloatArray:
    """Return sRGB colours (n, 3), 0 to 255, of thicknesses on a logarithmic scale; grey where not finite."""
    share = np.log(np.clip(thickness, low, high) / low) / max(np.log(high / low), 1e-9)
    at = np.nan_to_num(share) * (len(RAMP) - 1)
    k = np.clip(at.astype(np.int64), 0, len(RAMP) - 2)
    rgb = RAMP[k] + (at - k)[:, None] * (RAMP[k + 1] - RAMP[k])
    return np.where(np.isfinite(thickness)[:, None], rgb, PLAIN)


def _ends_of(thickness: FloatArray) -> tuple[float, float]:
    """Return where the colours of thicknesses begin and end: the few thickest have the last one."""
    known = thickness[np.isfinite(thickness)]
    if not len(known):
        return 1.0, 2.0
    low = float(known.min())
    return low, max(float(np.quantile(known, 0.98)), 1.01 * low)


def pictures(
    walls: Walls, marks: list[FloatArray]
) -> tuple[NDArray[np.uint8], NDArray[np.uint8], float, float]:
    """Return a picture, one of the thickness at every pixel, and the ends of its scale.

    Every pixel is the mean of four certified hits, each with the thickness that a second ray measures.
    ``marks`` are places that get a ring.
    """
    low, high = walls.solid.box
    middle, size = 0.5 * (low + high), walls.size
    forward = np.array(LOOK) / np.linalg.norm(LOOK)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    eye = middle - 1.9 * size * forward
    span = np.tan(np.deg2rad(0.5 * FOV))
    x, y = np.meshgrid(
        (np.arange(2 * WIDTH) + 0.5) / WIDTH - 1.0, 1.0 - (np.arange(2 * HEIGHT) + 0.5) / HEIGHT
    )
    way = forward + span * (x.ravel()[:, None] * WIDTH / HEIGHT * right + y.ravel()[:, None] * up)
    way /= np.linalg.norm(way, axis=1)[:, None]
    hits = walls.tracer.intersect(np.broadcast_to(eye, way.shape), way)
    seen = np.flatnonzero(hits.hit & hits.front_face)
    thickness = np.full(len(way), np.nan)
    normal = hits.normal[seen]
    thickness[seen] = walls.thickness(hits.position[seen], normal)
    ends = _ends_of(thickness)
    shade = np.zeros(len(way))
    facing = np.abs((normal * way[seen]).sum(axis=1))
    shade[seen] = 0.35 + 0.65 * facing * (0.75 + 0.25 * normal[:, 2])
    images = []
    for rgb in (np.tile(PLAIN, (len(way), 1)), colors_of(thickness, *ends)):
        image = np.where(shade[:, None] > 0.0, shade[:, None] * rgb, 255.0)
        image = image.reshape(HEIGHT, 2, WIDTH, 2, 3).mean(axis=(1, 3))
        for place in marks:
            _ring(image, place - eye, (right, up, forward), span)
        images.append(np.clip(image + 0.5, 0, 255).astype(np.uint8))
    return images[0], images[1], *ends


def _ring(image: FloatArray, away: FloatArray, axes: tuple[FloatArray, ...], span: float) -> None:
    """Draw a ring about a place."""
    x, y, depth = (float(away @ axis) for axis in axes)
    if not np.isfinite(depth) or depth <= 0.0:
        return
    column = WIDTH * 0.5 + 0.5 * HEIGHT * x / (depth * span)
    row = HEIGHT * 0.5 - 0.5 * HEIGHT * y / (depth * span)
    j, i = np.meshgrid(np.arange(WIDTH), np.arange(HEIGHT))
    far = np.hypot(j - column, i - row)
    image[np.abs(far - 11.0) < 1.6] = (0.0, 0.0, 0.0)
    image[np.abs(far - 11.0) < 0.8] = (255.0, 235.0, 0.0)


def write_map(walls: Walls, file: Path) -> tuple[int, float, float]:
    """Write a PLY file of triangles in the colours of their thickness; return their number and the scale's ends.

    The thickness is that of the part itself, at the middle of each triangle.
    """
    import trimesh

    check_writable(file)
    mesh = tessellate(tuple(walls.solid.surfaces), MAPPED * walls.size)
    longest = EDGED * walls.size
    vertices, faces, of = trimesh.remesh.subdivide_to_size(  # type: ignore[no-untyped-call]
        mesh.vertices, mesh.faces, longest, max_iter=24, return_index=True
    )
    corners = mesh.vertices[mesh.faces[of]]
    middle = vertices[faces].mean(axis=1)
    weights = trimesh.triangles.points_to_barycentric(corners, middle)  # type: ignore[no-untyped-call]
    weights = np.where(
        np.isfinite(weights).all(axis=1)[:, None], np.clip(weights, 0.0, 1.0), 1.0 / 3.0
    )
    weights /= weights.sum(axis=1)[:, None]
    uv = (mesh.uv[of] * weights[..., None]).sum(axis=1)
    point, normal = np.empty_like(middle), np.empty_like(middle)
    owner = np.zeros(len(of), np.int64) if mesh.surface_id is None else mesh.surface_id[of]
    for face in np.unique(owner).tolist():
        mine = owner == face
        point[mine], normal[mine] = walls.solid.at(face, *uv[mine].T)
    thickness = walls.thickness(point, normal)
    low, high = _ends_of(thickness)
    rgb = np.clip(colors_of(thickness, low, high), 0, 255).astype(np.uint8)
    colored = trimesh.Trimesh(vertices, faces, face_colors=rgb, process=False)
    with replacing(file) as out:
        out.write(trimesh.exchange.ply.export_ply(colored))
    return len(faces), low, high
