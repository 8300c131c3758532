"""Area lights on any surface: points sampled by area, and shapes that kernels sample directly."""

from __future__ import annotations

from dataclasses import replace
from functools import singledispatch

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights.light import LightRow
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.shading.kernels.light_kinds import RECTANGLE, SPHERE, LightPoints
from meshing.area import AreaSampler, IdArray
from meshing.surface import Surface


class ShiningSurface:
    """A surface as an area light, sampled by area.

    Parameters
    ----------
    surface : Surface
    sampler : AreaSampler
        Of that surface.
    """

    def __init__(self, surface: Surface, sampler: AreaSampler) -> None:
        self.surface, self._sampler = surface, sampler

    @property
    def area(self) -> float:
        """Approximate area, scene units squared."""
        return self._sampler.area

    def choose(self, xi: FloatArray) -> tuple[IdArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v) of points sampled by random numbers (n, 2) in [0, 1)."""
        return self._sampler.choose(xi)

    def points(self, xi: FloatArray) -> LightPoints:
        """Return points sampled by random numbers (n, 2) in [0, 1), as kernels take them."""
        patch, u, v = self.choose(xi)
        point, normal = self.surface.point(u, v, patch), self.surface.normal(u, v, patch)
        return LightPoints(point, normal, self.pdf_area(patch, u, v), u, v)

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the pdf per area of points."""
        return self._sampler.pdf_area(patch_id, u, v)


def shining_surface(surface: Surface) -> ShiningSurface | None:
    """Return a surface as an area light; None for an infinite plane.

    Raises
    ------
    ValueError
        If the area of the surface is zero.
    """
    sampler = surface.area_sampler()
    return None if sampler is None else ShiningSurface(surface, sampler)


@singledispatch
def with_shape(surface: Surface, row: LightRow, is_even: bool) -> LightRow:
    """Return the row of a light as a shape that kernels sample directly, if its surface is one.

    Each class with such a shape registers a conversion; others stay lights of kind `SURFACE`.

    Parameters
    ----------
    surface : Surface
    row : LightRow
        Its light, of kind `SURFACE`.
    is_even : bool
        Whether its radiance is constant.
    """
    del surface, is_even
    return row


@with_shape.register(Rectangle)
def _rectangle(surface: Rectangle, row: LightRow, is_even: bool) -> LightRow:
    del is_even
    return replace(
        row, kind=RECTANGLE, origin=surface.corner, edge_u=surface.edge_u, edge_v=surface.edge_v
    )


@with_shape.register(Sphere)
def _sphere(surface: Sphere, row: LightRow, is_even: bool) -> LightRow:
    # From outside, a sphere that shines evenly is better chosen from by the angle it is seen under.
    if surface.orientation < 0 or not is_even:
        return row
    size = np.array([surface.radius, 0.0, 0.0])
    return replace(row, kind=SPHERE, origin=surface.center, edge_u=size)
