"""Area lights on any surface: points sampled as seen or by area, and shapes that kernels sample."""

from dataclasses import replace
from functools import cached_property

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord
from hybrid_rt.lights.cells import Cells
from hybrid_rt.lights.light import LightRow
from hybrid_rt.lights.unevenness import by_brightness, is_very_uneven
from hybrid_rt.primitives import Box, Rectangle, Sphere, TriangleMesh
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE, SPHERE, LightPoints
from hybrid_rt.shading.kernels.shining_faces import Faces, angle_of_faces, sample_faces
from hybrid_rt.textures.texture import Texture
from meshing.area import AreaSampler, Weighted
from meshing.checks import IdArray
from meshing.surface import Surface
from meshing.trimmed import TrimmedSurface

# A point lies on a sphere if it is as near as this, of the radius and the centre's distance from 0.
ON = 64 * 2.0**-52
# A point inside loops is looked for among the square of so many.
ONE_OF = 16


class ShiningSurface:
    """A surface as an area light: photons leave points chosen by area, hits ask points that they see.

    A `Weighted` sampler chooses cells by the light that they send out.
    """

    def __init__(self, surface: Surface, sampler: AreaSampler) -> None:
        self.surface, self._sampler = surface, sampler

    @property
    def area(self) -> float:
        """Approximate area, scene units squared."""
        return self._sampler.area

    @property
    def is_by_brightness(self) -> bool:
        """Whether points are sampled by the light that they send out, not by area."""
        return isinstance(self._sampler, Weighted)

    @cached_property
    def _cells(self) -> Cells:
        return Cells(self.surface, self._sampler if isinstance(self._sampler, Weighted) else None)

    def choose(self, xi: FloatArray) -> tuple[IdArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v) of points sampled by area, by (n, 2) numbers in [0, 1)."""
        return self._sampler.choose(xi)

    def one_point(self) -> LightPoints:
        """Return one point on the surface; 1 row."""
        return self.points(np.array([[0.5, 0.5]]))

    def points(self, xi: FloatArray) -> LightPoints:
        """Return points sampled by area, by random numbers (n, 2) in [0, 1), as kernels take them."""
        where = self.choose(xi)
        return self._at(*where, self.pdf_area(*where))

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the pdf per area of `points`."""
        return self._sampler.pdf_area(patch_id, u, v)

    def seen_points(self, seen_from: FloatArray, xi: FloatArray) -> LightPoints:
        """Return points sampled by about the solid angle that they are seen under from points (n, 3)."""
        return self._at(*self._cells.choose(seen_from, xi))

    def _at(
        self, patch_id: IdArray, u: FloatArray, v: FloatArray, density: FloatArray
    ) -> LightPoints:
        surface = self.surface
        point, normal = surface.point(u, v, patch_id), surface.normal(u, v, patch_id)
        if isinstance(surface, TriangleMesh) and surface.texture_coordinates is not None:
            u, v = surface.texture_point(u, v, patch_id).T.copy()
        return LightPoints(point, normal, density, u, v)

    def seen_pdf_area(self, seen_from: FloatArray, hits: HitRecord) -> FloatArray:
        """Return the pdf per area with which `seen_points` samples hits on the surface."""
        return self._cells.pdf_area(seen_from, hits.patch_id.astype(np.int64), hits.u, hits.v)


class ShiningSphere(ShiningSurface):
    """A sphere as an area light, sampled by area from its own points: there that is even."""

    def __init__(self, surface: Sphere, sampler: AreaSampler) -> None:
        super().__init__(surface, sampler)
        self._ball = surface.ball

    def seen_points(self, seen_from: FloatArray, xi: FloatArray) -> LightPoints:
        """Return sampled points; see `ShiningSurface.seen_points`."""
        on = self._bears(seen_from)
        if on.all():
            return self.points(xi)
        found = super().seen_points(seen_from, xi)
        if on.any():
            for column, by_area in zip(found, self.points(xi[on]), strict=True):
                column[on] = by_area
        return found

    def seen_pdf_area(self, seen_from: FloatArray, hits: HitRecord) -> FloatArray:
        """Return the pdf per area of `seen_points`; see `ShiningSurface.seen_pdf_area`."""
        on = self._bears(seen_from)
        patch = hits.patch_id.astype(np.int64)
        if on.all():
            return self.pdf_area(patch, hits.u, hits.v)
        density = super().seen_pdf_area(seen_from, hits)
        if on.any():
            density[on] = self.pdf_area(patch[on], hits.u[on], hits.v[on])
        return density

    def _bears(self, points: FloatArray) -> BoolArray:
        """Tell which points (n, 3) lie on the sphere."""
        middle, radius = self._ball
        away = np.abs(np.linalg.norm(points - middle, axis=1) - radius)
        return away <= ON * (radius + float(np.abs(middle).max()))


class ShiningBox(ShiningSurface):
    """A `Box` as an area light: its faces are sampled evenly by solid angle."""

    def __init__(self, surface: Box, sampler: AreaSampler) -> None:
        super().__init__(surface, sampler)
        face, zero = np.arange(len(surface)), np.zeros(len(surface))
        edge_u, edge_v = surface.partials(zero, zero, face)
        corner, normal = surface.point(zero, zero, face), surface.normal(zero, zero, face)
        self._faces = Faces(*map(np.ascontiguousarray, (corner, edge_u, edge_v, normal)))

    def seen_points(self, seen_from: FloatArray, xi: FloatArray) -> LightPoints:
        """Return points sampled evenly by solid angle; see `ShiningSurface.seen_points`."""
        n = len(seen_from)
        points = LightPoints(np.zeros((n, 3)), np.zeros((n, 3)), *np.zeros((3, n)))
        sample_faces(self._faces, seen_from, xi, np.empty(len(self.surface)), points)
        return points

    def seen_pdf_area(self, seen_from: FloatArray, hits: HitRecord) -> FloatArray:
        """Return the pdf per area of `seen_points`; see `ShiningSurface.seen_pdf_area`."""
        angle = np.empty(len(hits))
        angle_of_faces(self._faces, seen_from, angle)
        way = hits.position - seen_from
        square = np.einsum("ij,ij->i", way, way)
        facing = np.maximum(-np.einsum("ij,ij->i", way, hits.normal), 0.0)
        below = angle * square * np.sqrt(square)
        return np.divide(facing, below, out=np.zeros_like(below), where=below > 0.0)


class ShiningTrimmed(ShiningSurface):
    """A trimmed surface as an area light: points sampled outside its loops have a pdf of 0.

    Rays may meet the surface slightly outside its loops: within the gap of an edge, and on triangles that
    an edge crosses. These hits emit too. No point is sampled there, so the density is 0, and light that
    BSDF sampling finds there counts in full.
    """

    def __init__(self, surface: TrimmedSurface, sampler: AreaSampler) -> None:
        super().__init__(surface, sampler)
        self._trimmed = surface

    def one_point(self) -> LightPoints:
        """Return one point inside the loops; of a very narrow part of a surface, one beside it."""
        side = np.arange(ONE_OF) / ONE_OF + 0.5 / ONE_OF
        points = self.points(np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2))
        row = int((points.pdf_area > 0.0).argmax())
        return LightPoints(*(column[[row]] for column in points))

    def seen_points(self, seen_from: FloatArray, xi: FloatArray) -> LightPoints:
        """Return sampled points; see `ShiningSurface.seen_points`."""
        points = super().seen_points(seen_from, xi)
        return points._replace(pdf_area=self._held(points.pdf_area, points.u, points.v))

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the pdf per area of `points`."""
        return self._held(super().pdf_area(patch_id, u, v), u, v)

    def seen_pdf_area(self, seen_from: FloatArray, hits: HitRecord) -> FloatArray:
        """Return the pdf per area of `seen_points`; see `ShiningSurface.seen_pdf_area`."""
        return self._held(super().seen_pdf_area(seen_from, hits), hits.u, hits.v)

    def _held(self, density: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return densities of points, 0 for those outside the loops."""
        return np.where(self._trimmed.contains(u, v)[0], density, 0.0)


def shining_surface(surface: Surface, radiance: Texture | None = None) -> ShiningSurface | None:
    """Return a surface as an area light; None for an infinite plane.

    Where ``radiance`` is very uneven, points are sampled by it. A ValueError says that there is no area.
    """
    sampler = surface.area_sampler()
    if sampler is None:
        return None
    if radiance is not None and is_very_uneven(radiance):
        sampler = by_brightness(surface, radiance)
    elif isinstance(surface, Box):
        return ShiningBox(surface, sampler)
    if isinstance(surface, Sphere):
        return ShiningSphere(surface, sampler)
    if isinstance(surface, TrimmedSurface):
        return ShiningTrimmed(surface, sampler)
    return ShiningSurface(surface, sampler)


def with_shape(surface: Surface, row: LightRow) -> LightRow:
    """Return the row of a light as a shape that kernels sample directly, if its surface is one."""
    texture = row.texture
    if isinstance(surface, Rectangle) and (texture is None or not is_very_uneven(texture)):
        u, v = surface.edge_u, surface.edge_v
        return replace(row, kind=RECTANGLE, origin=surface.corner, edge_u=u, edge_v=v)
    # From outside, a sphere that shines evenly is better chosen from by the angle it is seen under.
    if isinstance(surface, Sphere) and surface.orientation > 0 and texture is None:
        size = np.array([surface.radius, 0.0, 0.0])
        return replace(row, kind=SPHERE, origin=surface.center, edge_u=size)
    return row
