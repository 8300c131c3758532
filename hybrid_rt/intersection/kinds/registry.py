"""Sorts a list of surfaces into kinds, and builds for each kind what its kernels need."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeAlias

import numpy as np

from hybrid_rt.core.checks import FARTHEST
from hybrid_rt.core.records import IntArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.kind import CurvedKind, Kind
from hybrid_rt.intersection.kinds.closed_forms import MANY, ClosedForm, Spheres
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from meshing import BezierPatches, SurfaceOfRevolution

Surface: TypeAlias = (
    BezierPatches | SurfaceOfRevolution | Sphere | Rectangle | Plane | Box | TriangleMesh
)
# From here to `FARTHEST` squares, cross products and fourth powers of lengths are float64 numbers.
SMALLEST = 1e-60
CURVED = (BezierPatches, SurfaceOfRevolution)
"""What goes to Embree as triangles first, in every accuracy."""


def check_surfaces(surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
    """Return the surfaces, or say which of them is none.

    Raises
    ------
    TypeError
        If one is no surface.
    ValueError
        If one is too large, too small or too far away for float64 to compute with.
    """
    for i, surface in enumerate(surfaces):
        if not isinstance(surface, Surface.__args__):
            raise TypeError(
                f"surfaces[{i}] is a {type(surface).__name__}: pass surfaces such as "
                "BezierPatches or Sphere (for a mesh: TriangleMesh(mesh))"
            )
        if not isinstance(surface, Plane):
            farthest, size = _reach_and_size(surface)
            if farthest > FARTHEST or size < SMALLEST:
                raise ValueError(
                    f"surfaces[{i}] reaches {farthest:.3g} and is {size:.3g} large: scale the scene, "
                    f"coordinates up to {FARTHEST:g} and sizes from {SMALLEST:g} are possible"
                )
    return tuple(surfaces)


def _reach_and_size(surface: Any) -> tuple[float, float]:
    """Return the largest coordinate and the longest side of a surface's box."""
    if isinstance(surface, Sphere):  # there may be many
        return max(map(abs, surface.center.tolist())) + surface.radius, 2.0 * surface.radius
    low, high = np.asarray(surface.bounds, dtype=np.float64)
    return float(np.abs([low, high]).max()), float((high - low).max())


def kernel_groups(surfaces: Sequence[Surface], accuracy: str, coarse: str) -> list[str]:
    """Name the kernels that first hits and shadows need, as `hybrid_rt.core.precompile` knows them."""
    kinds = {type(surface) for surface in surfaces}
    groups = [name for surface_type, name, _ in _CLOSED_FORMS if surface_type in kinds]
    if sum(isinstance(surface, Sphere) for surface in surfaces) >= MANY:
        groups.append("many spheres")
    way = accuracy if coarse == "embree" else "alone"
    patches = [s for s in surfaces if isinstance(s, BezierPatches)]
    if patches:
        is_bicubic = all(bool((s.degrees == 3).all()) for s in patches)
        groups.append(f"{'bicubic' if is_bicubic else 'Bezier'} patches, {way}")
    for surface_type, name in ((SurfaceOfRevolution, "revolutions"), (TriangleMesh, "meshes")):
        if surface_type in kinds:
            groups.append(f"{name}, {way}")
    return groups


def make_kinds(
    surfaces: Sequence[Surface], accuracy: str, pool: Pool
) -> tuple[list[Kind], list[CurvedKind], IntArray, dict[str, dict[str, str]]]:
    """Build the kinds that occur.

    Parameters
    ----------
    surfaces : sequence of surfaces
    accuracy : {"mesh", "refined", "certified"}
    pool : Pool
        Shares the work of building.

    Returns
    -------
    direct, curved : the kinds that are traced as they are, and those that go to Embree first
    kind_of : (objects,) int32, number of each object's kind in ``direct + curved``
    plan : what is used and what was left out, with the reasons
    """
    kind_of = np.full(len(surfaces), -1, np.int32)
    plan: dict[str, dict[str, str]] = {"used": {}, "left_out": {}}
    kinds: tuple[list[Any], list[Any]] = ([], [])
    number = 0
    # Certified hits on meshes come from a tree of our own, in float64 from the first box on.
    groups: tuple[tuple[Any, ...], ...] = ((*_CLOSED_FORMS, _MESHES), _CURVED)
    if accuracy != "certified":
        groups = (_CLOSED_FORMS, (*_CURVED, _MESHES))
    for group, builders in enumerate(groups):
        for surface_type, name, build in builders:
            members: list[tuple[int, Any]] = [
                (i, s) for i, s in enumerate(surfaces) if isinstance(s, surface_type)
            ]
            if not members:
                plan["left_out"][name] = "the scene has none"
                continue
            if group == 1 and accuracy == "mesh":
                plan["left_out"][name] = 'accuracy="mesh" takes the triangles as they are'
                kind_of[[i for i, _ in members]] = len(kinds[0])
                continue
            kinds[group].append(build(members, accuracy, pool))
            kind_of[[i for i, _ in members]] = number
            number += 1
            plan["used"][name] = f"{len(members)} object(s)"
    return (*kinds, kind_of, plan)


def _closed_form(name: str) -> Callable[[list[tuple[int, Any]], str, Pool], Kind]:
    return lambda members, _accuracy, _pool: ClosedForm(name, members)


def _patches(members: list[tuple[int, Any]], accuracy: str, pool: Pool) -> CurvedKind:
    from hybrid_rt.intersection.kinds.patches import FINEST, PatchKind

    return PatchKind(members, pool, finest=FINEST if accuracy == "certified" else 0)


def _revolutions(members: list[tuple[int, Any]], _accuracy: str, _pool: Pool) -> CurvedKind:
    from hybrid_rt.intersection.kinds.revolutions import RevolutionKind

    return RevolutionKind(members)


def _triangles(members: list[tuple[int, Any]], accuracy: str, _pool: Pool) -> Kind:
    from hybrid_rt.intersection.kinds.triangles import TriangleKind

    return TriangleKind(members, search=accuracy == "certified")


_CLOSED_FORMS = (
    (Sphere, "spheres", lambda members, _accuracy, _pool: Spheres(members)),
    (Rectangle, "rectangles", _closed_form("rectangles")),
    (Plane, "planes", _closed_form("planes")),
    (Box, "boxes", _closed_form("boxes")),
)
_CURVED = (
    (BezierPatches, "Bezier patches", _patches),
    (SurfaceOfRevolution, "surfaces of revolution", _revolutions),
)
_MESHES = (TriangleMesh, "triangle meshes", _triangles)
