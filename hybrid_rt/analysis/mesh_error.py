"""The error of meshes by tolerance, and the cost of exact hits.

Each rung of the ladder tessellates the same surfaces to a tolerance, measures how far its triangles
lie from them, and compares the first hits of accuracies "mesh" and "refined" with certified ones.
"""

import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from hybrid_rt.analysis.ray_sets import RaySet, at_box, camera, silhouettes
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.timing import in_turn
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.hit_errors import Errors, certified_hits, compare
from hybrid_rt.primitives import TriangleMesh
from meshing import TrimmedSurface, tessellate
from meshing.certified_mesh import CertifiedMesh

# Points per triangle at which deviation and normals are measured, at least so many in all.
SAMPLES, LEAST_SAMPLES = 4, 20_000
RAYS: dict[str, Callable[..., RaySet]] = {
    "random": at_box,
    "camera": camera,
    "silhouette": silhouettes,
}


@dataclass(frozen=True)
class Rung:
    """One tolerance of the ladder; lengths in scene units, angles in degrees."""

    tolerance: float
    triangles: int
    build_seconds: float
    memory: float  # bytes at the peak
    bound: float  # proven
    worst: float  # measured, as is the mean
    mean: float
    worst_angle: float  # between the normals of triangles and surface
    mean_angle: float
    errors: dict[str, dict[str, Errors]]  # by accuracy, then by kind of rays
    microseconds: dict[str, dict[str, float]]  # a ray, by accuracy, then by kind of rays

    @property
    def figures(self) -> dict[str, Any]:
        """Plain numbers, for files and diagrams: of errors ``wrong`` (share), ``rays`` and so on."""
        errors = {
            accuracy: {
                kind: {
                    "wrong": e.wrong, "rays": e.wrong_hits.rays, **e.wrong_hits.counts,
                    "mean": e.mean, "worst": e.worst,
                }
                for kind, e in kinds.items()
            }
            for accuracy, kinds in self.errors.items()
        }  # fmt: skip
        return {**vars(self), "errors": errors}


def climb(
    surfaces: Sequence[Any],
    tolerances: Sequence[float],
    n_rays: int,
    seed: int = 1,
    threads: int | None = None,
    on_rung: Callable[[Rung], None] | None = None,
) -> list[Rung]:
    """Measure the errors of each rung, then the time per ray of all rungs in turn.

    Tolerances are absolute, in scene units; there are ``n_rays`` of each kind. ``on_rung`` is called with each
    rung when its errors are known, before its times are. Surfaces of which some are trimmed are the faces of a
    body: their mesh is one, joined along the edges, and on which face a hit is does not count.
    """
    is_body = any(isinstance(surface, TrimmedSurface) for surface in surfaces)
    rays = {name: make(surfaces, n_rays, seed) for name, make in RAYS.items()}
    bare = Intersector(surfaces, coarse="none", threads=threads)
    exact = {name: certified_hits(bare, r.origins, r.directions) for name, r in rays.items()}
    rungs: list[Rung] = []
    contestants: dict[tuple[int, str], Intersector] = {}
    for number, tolerance in enumerate(tolerances):
        tracemalloc.start()
        began = time.perf_counter()
        wholes = [list(surfaces)] if is_body else surfaces
        meshes = [tessellate(whole, tolerance) for whole in wholes]
        seconds = time.perf_counter() - began
        memory = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        parts = (
            list(zip(surfaces, meshes, strict=True)) if not is_body else _faces(surfaces, meshes[0])
        )
        distances, angles = deviations(parts, seed)
        for name in ("mesh", "refined", "certified"):
            contestants[number, name] = Intersector(
                surfaces, name, tolerance=tolerance, threads=threads
            )
        if is_body:
            mesh = Intersector([TriangleMesh(meshes[0].mesh)], coarse="none", threads=threads)
            contestants[number, "mesh"] = mesh
        contestants[number, 'certified, coarse="none"'] = bare
        errors: dict[str, dict[str, Errors]] = {}
        for name in ("mesh", "refined"):
            errors[name] = {}
            for kind, r in rays.items():
                found = contestants[number, name].intersect(r.origins, r.directions)
                object_id, own = found.object_id, exact[kind].hits.object_id
                if is_body:
                    object_id = np.where(found.hit, np.maximum(own, 0), -1)
                errors[name][kind] = compare(exact[kind], found.t, object_id)
        measured = (
            float(distances.max()), float(distances.mean()), float(angles.max()), float(angles.mean()),
        )  # fmt: skip
        bound = max(mesh.deviation_bound for mesh in meshes)
        times: dict[str, dict[str, float]] = {
            name: {} for step, name in contestants if step == number
        }
        n_triangles = sum(map(len, meshes))
        rungs.append(
            Rung(tolerance, n_triangles, seconds, float(memory), bound, *measured, errors, times)
        )
        if on_rung is not None:
            on_rung(rungs[-1])
    for kind, r in rays.items():
        traces = {
            key: partial(tracer.intersect, r.origins, r.directions)
            for key, tracer in contestants.items()
        }
        timings = in_turn(traces, 3)
        for (number, name), timing in timings.items():
            rungs[number].microseconds[name][kind] = timing.median / n_rays * 1e6
    return rungs


def _faces(surfaces: Sequence[Any], mesh: CertifiedMesh) -> list[tuple[Any, CertifiedMesh]]:
    """Return the surfaces that have triangles in the mesh of a body, each with these."""
    assert mesh.surface_id is not None
    parts = []
    for k in np.unique(mesh.surface_id).tolist():
        rows = mesh.surface_id == k
        own = replace(mesh, faces=mesh.faces[rows], uv=mesh.uv[rows], patch_id=mesh.patch_id[rows])
        parts.append((surfaces[k], own))
    return parts


def deviations(
    parts: Sequence[tuple[Any, CertifiedMesh]], seed: int
) -> tuple[FloatArray, FloatArray]:
    """Sample triangles of surfaces: return distances at equal (u, v), and angles between normals in degrees."""
    rng = np.random.default_rng(seed)
    distances, angles = [], []
    for surface, mesh in parts:
        repeat = max(SAMPLES, -(-LEAST_SAMPLES // len(mesh)))
        face = np.repeat(np.arange(len(mesh)), repeat)
        weights = rng.dirichlet((1.0, 1.0, 1.0), len(face))
        u, v = np.einsum("ij,ijk->ki", weights, mesh.uv[face])
        corners = mesh.vertices[mesh.faces[face]]
        points = np.einsum("ij,ijk->ik", weights, corners)
        normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        length = np.linalg.norm(normal, axis=1)
        some = length > 0.0
        true = surface.normal(u, v, mesh.patch_id[face])
        cosine = np.einsum("ij,ij->i", normal[some], true[some]) / length[some]
        angles.append(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
        distances.append(np.linalg.norm(points - surface.point(u, v, mesh.patch_id[face]), axis=1))
    return np.concatenate(distances), np.concatenate(angles)


def error_image(
    surfaces: Sequence[Any], tolerance: float, width: int, height: int
) -> tuple[FloatArray, FloatArray]:
    """Trace a picture by mesh and surface; return (height, width) errors of t and |cos| at the exact hit.

    The error is in scene units, nan where both miss, inf where one does.
    """
    low = np.min([s.bounds[0] for s in surfaces], axis=0)
    high = np.max([s.bounds[1] for s in surfaces], axis=0)
    middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
    forward = np.array([0.35, 0.8, -0.35])
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right /= np.linalg.norm(right)
    up = np.cross(right, forward)
    row, column = np.indices((height, width))
    x, y = (column + 0.5 - width / 2) / width, (height / 2 - row - 0.5) / width
    directions = forward + 0.75 * (x[..., None] * right + y[..., None] * up)
    origin = middle - 1.45 * size * forward
    exact = Intersector(surfaces, coarse="none").intersect(origin, directions)
    meshed = Intersector(surfaces, "mesh", tolerance=tolerance).intersect(origin, directions)
    length = np.linalg.norm(directions.reshape(-1, 3), axis=1)
    with np.errstate(invalid="ignore"):
        error = np.abs(meshed.t - exact.t) * length
        shade = np.abs(np.einsum("ij,ij->i", exact.normal, directions.reshape(-1, 3))) / length
    return error.reshape(height, width), shade.reshape(height, width)
