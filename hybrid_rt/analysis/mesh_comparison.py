"""First hits on true surfaces against first hits on their meshes, pixel by pixel."""

from typing import Any

import numpy as np

from hybrid_rt.core.progress import Progress
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.hit_errors import certified_hits, compare
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.scene import Scene
from meshing import tessellate

# The mesh to compare with, relative to the largest curved surface: about as fine as one would
# export for a picture of ordinary size.
MESH_TOLERANCE = 1e-3
# The accuracy for which a mesh's triangles are counted, in scene units.
FINE = 1e-6


def compare_with_mesh(
    scene: Scene, threads: int | None = None, progress: Progress | None = None
) -> dict[str, Any]:
    """Trace rays through all pixel centres, on the true surfaces and on a mesh; return plain numbers.

    Rays whose exact hit is decided within rounding are left out. Errors of t are distances along the rays that
    hit a curved surface. Empty where the scene has no curved surface.
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

    camera = compiled.camera
    row, column = np.divmod(np.arange(camera.width * camera.height), camera.width)
    origins, directions = camera.rays(column + 0.5, row + 0.5)
    certified = Intersector(compiled.surfaces, threads=threads)
    exact = certified_hits(certified, origins, directions)
    mesh = Intersector(compiled.surfaces, "mesh", tolerance=tolerance, threads=threads)
    meshed = mesh.intersect(origins, directions)
    # Row -1 (a miss) stands for no object here, not for the last one.
    concerned = (exact.hits.hit & is_curved[exact.hits.object_id]) | (
        meshed.hit & is_curved[meshed.object_id]
    )
    errors = compare(exact[concerned], meshed.t[concerned], meshed.object_id[concerned])
    triangles = sum(len(mesh) for mesh in meshes)
    return {
        "rays": len(exact.hits),
        "rays_on_curved_surfaces": errors.wrong_hits.rays,
        "mesh_triangles": triangles,
        "mesh_deviation_bound": deviation,
        "wrong_first_hits": errors.wrong_hits.wrong,
        "worst_hit_error": errors.worst,
        "mean_hit_error": errors.mean,
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
