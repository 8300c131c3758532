"""First hits on true surfaces against first hits on their meshes, pixel by pixel."""

from __future__ import annotations

from typing import Any

import numpy as np

from hybrid_rt.core.progress import Progress
from hybrid_rt.core.records import FloatArray, HitRecord, Status
from hybrid_rt.intersection import Intersector
from hybrid_rt.scene.compiled import CompiledScene, compile_scene
from hybrid_rt.scene.scene import Scene
from meshing import tessellate

# The mesh to compare with, relative to the largest curved surface: about as fine as one would
# export for a picture of ordinary size.
MESH_TOLERANCE = 1e-3
# A mesh hit on the right sheet lies within the mesh's deviation of the surface, measured along the
# normal; where the surface bends away under a slanting ray it can be some times that.
SAME_SHEET = 8.0
# The accuracy for which a mesh's triangles are counted, in scene units.
FINE = 1e-6


def compare_with_mesh(
    scene: Scene, threads: int | None = None, progress: Progress | None = None
) -> dict[str, Any]:
    """Trace rays through all pixel centres, on the true surfaces and on a mesh.

    Parameters
    ----------
    scene : Scene
    threads : int, optional
        Default: the cores that this process may use.
    progress : callable, optional
        As `render` takes it.

    Returns
    -------
    dict
        Of plain numbers. ``wrong_first_hits`` counts rays for which only one of the two hits, or
        they hit different objects or different sheets of a surface; rays with status TANGENT are
        left out. ``worst_hit_error`` and ``mean_hit_error`` are distances along the ray, over the
        other rays that hit a curved surface. Empty if the scene has no curved surface.
    """
    compiled = compile_scene(scene)
    is_curved = np.array([surface.is_freeform for surface in compiled.surfaces], dtype=bool)
    if not is_curved.any():
        return {}
    if progress is not None:
        progress("Comparing with a mesh", 0, 0)
    curved = [compiled.surfaces[i] for i in np.flatnonzero(is_curved)]
    sizes = [np.linalg.norm(np.diff(surface.bounds, axis=0)) for surface in curved]
    tolerance = float(MESH_TOLERANCE * max(sizes))
    meshes = [tessellate(surface, tolerance) for surface in curved]
    deviation = max(mesh.deviation_bound for mesh in meshes)

    exact = _camera_hits(compiled, "certified", None, threads)
    meshed = _camera_hits(compiled, "mesh", tolerance, threads)
    decided = exact.status != Status.TANGENT
    # Row -1 (a miss) stands for no object here, not for the last one.
    concerned = decided & (
        (exact.hit & is_curved[exact.object_id]) | (meshed.hit & is_curved[meshed.object_id])
    )
    same_object = exact.hit & (exact.object_id == meshed.object_id)
    with np.errstate(invalid="ignore"):  # inf - inf where both miss
        error = np.abs(meshed.t - exact.t)
    off_the_sheet = error * _slant(compiled, exact) > SAME_SHEET * deviation
    right = concerned & same_object & ~off_the_sheet
    errors = error[right]
    triangles = sum(len(mesh) for mesh in meshes)
    return {
        "rays": len(exact),
        "rays_on_curved_surfaces": int(np.count_nonzero(concerned)),
        "mesh_triangles": triangles,
        "mesh_deviation_bound": deviation,
        "wrong_first_hits": int(np.count_nonzero(concerned & ~right)),
        "worst_hit_error": float(errors.max(initial=0.0)),
        "mean_hit_error": float(errors.mean()) if errors.size else 0.0,
        # Chordal deviation falls with the square of the edges, so with the number of triangles.
        "triangles_for_1e-6": round(sum(len(m) * m.deviation_bound for m in meshes) / FINE),
    }


def in_words(comparison: dict[str, Any]) -> str:
    """Format a comparison as two lines of text."""
    if not comparison:
        return "Exact against mesh: no curved surface, nothing to compare."
    c = comparison
    return (
        f"Exact against mesh: with {c['mesh_triangles']:,} triangles the hits are off by up to "
        f"{c['worst_hit_error']:.2g} (mean {c['mean_hit_error']:.1g}) scene units,\n"
        f"  and {c['wrong_first_hits']:,} of {c['rays_on_curved_surfaces']:,} rays meet the wrong "
        f"thing first. For 1e-6 a mesh would need about {c['triangles_for_1e-6']:.1e} triangles."
    )


def _camera_hits(
    scene: CompiledScene, accuracy: str, tolerance: float | None, threads: int | None
) -> HitRecord:
    camera = scene.camera
    row, column = np.divmod(np.arange(camera.width * camera.height), camera.width)
    rays = camera.rays(column + 0.5, row + 0.5)
    tracer = Intersector(scene.surfaces, accuracy=accuracy, tolerance=tolerance, threads=threads)
    return tracer.intersect(*rays)


def _slant(scene: CompiledScene, hits: HitRecord) -> FloatArray:
    """Return |cos| between the ray of each pixel and the surface it meets; nan on a miss."""
    way = hits.position - scene.camera.look_from
    with np.errstate(invalid="ignore"):
        cosine: FloatArray = np.einsum("ij,ij->i", hits.normal, way) / np.linalg.norm(way, axis=1)
    return np.abs(cosine)
