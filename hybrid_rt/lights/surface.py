"""Light from any surface: points of it chosen by area.

A surface is cut into cells of its parameters. A cell is chosen by its area, then a point evenly in
its parameters, so the density per area is P(cell) / (cell size |S_u x S_v|): exact, however good
or bad the areas of the cells are known.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.shading.kernels.light_kinds import LightPoints

# Cells along u and v of one patch. The density within a cell varies as |S_u x S_v| does there:
# by a few percent for a bicubic patch.
CELLS = 16

IdArray = NDArray[np.int64]


class ShiningSurface(ABC):
    """A surface as a light: points chosen by area.

    Parameters
    ----------
    surface : surface
    areas : (cells,) float64
        Areas of the cells, about; scene units squared.

    Attributes
    ----------
    area : float
        Their sum.

    Raises
    ------
    ValueError
        If that is not above 0 and finite. The caller names the surface.
    """

    def __init__(self, surface: Any, areas: FloatArray) -> None:
        self.surface = surface
        self.area = float(areas.sum())
        if not (np.isfinite(self.area) and self.area > 0.0):
            raise ValueError(f"has area {self.area:g}: leave it out, it cannot shine")
        self._share = areas / self.area
        self._before = np.concatenate([[0.0], np.cumsum(self._share)])

    def choose(self, xi: FloatArray) -> tuple[IdArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v) of points chosen by numbers (n, 2) in [0, 1)."""
        cell = np.searchsorted(self._before, xi[:, 0], side="right") - 1
        cell = np.minimum(cell, self._share.size - 1)
        rest = np.clip((xi[:, 0] - self._before[cell]) / self._share[cell], 0.0, 1.0)
        return self._within(cell, rest, xi[:, 1])

    def points(self, xi: FloatArray) -> LightPoints:
        """Return points chosen by numbers (n, 2) in [0, 1), as kernels take them."""
        patch, u, v = self.choose(xi)
        point, normal = self.surface.point(u, v, patch), self.surface.normal(u, v, patch)
        return LightPoints(point, normal, self.pdf_area(patch, u, v), u, v)

    @abstractmethod
    def _within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        """Return (patch_id, u, v) of points chosen within cells."""

    @abstractmethod
    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        """Return the density per area with which points are chosen."""


class _Even(ShiningSurface):
    """Rectangles, boxes, meshes and spheres: the same density everywhere."""

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        del patch_id, v
        return np.full(u.size, 1.0 / self.area)


class _Squares(_Even):
    """Faces whose parameters fill the square evenly."""

    def _within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        return cell, xi, eta


class _Triangles(_Even):
    """Faces whose parameters are the weights of two vertices."""

    def _within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        root = np.sqrt(xi)
        return cell, root * (1.0 - eta), root * eta


class _Ball(_Even):
    """A sphere: even in the azimuth and in the height."""

    def _within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        return cell, eta, np.arccos(np.clip(1.0 - 2.0 * xi, -1.0, 1.0)) / np.pi


class _Grid(ShiningSurface):
    """Patches and surfaces of revolution: a grid of cells on each."""

    def __init__(self, surface: Any) -> None:
        middle = (np.arange(CELLS) + 0.5) / CELLS
        u, v = np.meshgrid(middle, middle, indexing="ij")
        patch = np.repeat(np.arange(len(surface)), CELLS * CELLS)
        u, v = np.tile(u.ravel(), len(surface)), np.tile(v.ravel(), len(surface))
        # Three by three points in each cell: even one that vanishes in the middle gets its share.
        areas = np.zeros(patch.size)
        for i in (-0.4, 0.0, 0.4):
            for j in (-0.4, 0.0, 0.4):
                areas += _stretch(surface, patch, u + i / CELLS, v + j / CELLS)
        super().__init__(surface, areas / (9.0 * CELLS * CELLS))

    def _within(
        self, cell: IdArray, xi: FloatArray, eta: FloatArray
    ) -> tuple[IdArray, FloatArray, FloatArray]:
        patch, place = np.divmod(cell, CELLS * CELLS)
        i, j = np.divmod(place, CELLS)
        return patch, (i + xi) / CELLS, (j + eta) / CELLS

    def pdf_area(self, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
        i = np.clip((u * CELLS).astype(np.int64), 0, CELLS - 1)
        j = np.clip((v * CELLS).astype(np.int64), 0, CELLS - 1)
        share = self._share[(patch_id * CELLS + i) * CELLS + j]
        stretch = _stretch(self.surface, patch_id, u, v)
        # Where the surface collapses to a point there is no area to be found.
        density: FloatArray = np.where(
            stretch > 0.0, share * CELLS * CELLS / np.maximum(stretch, 1e-300), 0.0
        )
        return density


def shining_surface(surface: Any) -> ShiningSurface | None:
    """Return what chooses points of a surface; None for a plane, which has no end.

    Raises
    ------
    ValueError
        If the surface has no area.
    """
    if isinstance(surface, Plane):
        return None
    if isinstance(surface, Rectangle):
        area = np.linalg.norm(np.cross(surface.edge_u, surface.edge_v))
        return _Squares(surface, np.array([area]))
    if isinstance(surface, Box):
        x, y, z = surface.hi - surface.lo
        return _Squares(surface, np.array([y * z, y * z, z * x, z * x, x * y, x * y]))
    if isinstance(surface, Sphere):
        return _Ball(surface, np.array([4.0 * np.pi * surface.radius**2]))
    if isinstance(surface, TriangleMesh):
        a, b, c = (surface.vertices[surface.faces[:, k]] for k in range(3))
        return _Triangles(surface, 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1))
    return _Grid(surface)


def _stretch(surface: Any, patch_id: IdArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return |S_u x S_v|."""
    s_u, s_v = surface.partials(u, v, patch_id)
    stretch: FloatArray = np.linalg.norm(np.cross(s_u, s_v), axis=1)
    return stretch
