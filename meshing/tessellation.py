"""Certified tessellation: triangles within a proven distance of surfaces, without cracks."""

from dataclasses import replace

import numpy as np

from meshing.body_mesh import mesh_of_faces
from meshing.certified_mesh import CertifiedMesh
from meshing.checks import FloatArray, number, whole
from meshing.leaves import cut, rings_of_leaves
from meshing.sheet import PatchSheet
from meshing.spans import across
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface

# About 3 GB with everything that is needed on the way.
MAX_TRIANGLES = 20_000_000


def tessellate(
    surface: Surface | list[Surface] | tuple[Surface, ...],
    tolerance: float,
    *,
    max_triangles: int = MAX_TRIANGLES,
) -> CertifiedMesh:
    """Tessellate a surface into triangles within a proven distance of it.

    Parameters
    ----------
    surface : Surface, or a list of them
        BezierPatches, NurbsSurface, SurfaceOfRevolution, Rectangle, Sphere, Torus, or a TrimmedSurface of
        one. A list is the faces of a body: where the edges of two are no farther apart than the sum of their
        ``gap`` and a thousandth of the tolerance, both get the same vertices. So the mesh of a body without openings is watertight.
    tolerance : float
        Largest distance allowed, absolute, in scene units. A tolerance below the rounding of the
        surface's coordinates may be missed, and one below the gaps between faces; ``deviation_bound`` says
        what was reached.
    max_triangles : int
        Largest number of triangles allowed for each surface; checked before they are made.

    Returns
    -------
    CertifiedMesh
        Adaptive: few triangles where the surface is flat, many where it is curved. The tolerance
        is that of (u, v) too: a turned disc or cone takes more triangles than its shape alone, as
        straight lines in (u, v) bend in space. There are no cracks within patches or across shared
        edges, and closed surfaces are watertight. Of a trimmed surface these are triangles of the part
        inside the loops, whose edges become chords: the bound holds for these as well.

    Raises
    ------
    ValueError
        If the tolerance is not positive and finite, or takes more than ``max_triangles``.
    TypeError
        For other surfaces.

    References
    ----------
    Filip, Magedson, Markot, "Surface algorithms using bounds on derivatives", Computer Aided
    Geometric Design 3, 1986.
    """
    tolerance = number(tolerance, "tessellate tolerance", above=0.0, hint="in scene units")
    whole(max_triangles, "tessellate max_triangles", at_least=1, up_to=2**31 - 1)
    if isinstance(surface, list | tuple):
        return mesh_of_faces(surface, tolerance, max_triangles)
    if isinstance(surface, TrimmedSurface):
        return replace(mesh_of_faces([surface], tolerance, max_triangles), surface_id=None)
    if isinstance(surface, PatchSheet):
        mesh = tessellate(surface.pieces, tolerance, max_triangles=max_triangles)
        return _on_sheet(mesh, surface.spans)
    pieces = cut(surface, tolerance, max_triangles)
    rings = rings_of_leaves(surface, pieces)
    every = np.ones(len(rings.leaves), np.bool_)
    triangles = rings.triangles(every, tolerance, max_triangles)
    return CertifiedMesh(rings.points, *triangles, float(pieces.bound))


def whole_triangles(surface: TrimmedSurface, tolerance: float) -> CertifiedMesh:
    """Return the triangles of the untrimmed surface that reach inside the loops, uncut."""
    mesh = tessellate(surface.surface, tolerance)
    if surface.joined_spans is not None:
        mesh = _on_sheet(mesh, surface.joined_spans)
    low, high = mesh.uv.min(axis=1), mesh.uv.max(axis=1)
    boxes = np.stack([low[:, 0], high[:, 0], low[:, 1], high[:, 1]], axis=1)
    keeps = ~surface.is_outside(boxes)
    return replace(mesh, faces=mesh.faces[keeps], uv=mesh.uv[keeps], patch_id=mesh.patch_id[keeps])


def _on_sheet(mesh: CertifiedMesh, spans: FloatArray) -> CertifiedMesh:
    """Return a mesh of pieces with the (u, v) across all of them."""
    u, v = across(spans, mesh.uv[..., 0], mesh.uv[..., 1], mesh.patch_id[:, None])
    return replace(mesh, uv=np.stack([u, v], axis=-1))
