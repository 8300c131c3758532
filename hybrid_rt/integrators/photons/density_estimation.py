"""Photon density estimation over discs around hit points; scipy's cKDTree finds the neighbours.

The disc is chosen in one of two ways. `Discs` have a given radius and count all photons within it:
for progressive photon mapping. The initial radius of a point depends on the density of a first set
of photons around it; points are grouped in a few classes, each searched by its largest radius,
since `scipy.spatial.cKDTree` takes one radius at a time. `Nearest` discs reach as far as a given
number of photons: Jensen's photon maps.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.density_estimate import (
    Sums,
    add_photons,
    count_in_cells,
    most_neighbours,
)
from hybrid_rt.integrators.kernels.photon_steps import IS_SHOWN, MET_SPECULAR, Photons
from hybrid_rt.integrators.shading import NO_RATIO
from hybrid_rt.scene.compiled import CompiledScene
from hybrid_rt.sensor.projection import Projection
from hybrid_rt.shading.kernels.bsdf import LobeTable, Vertices
from hybrid_rt.shading.kernels.lobes.register import WIDE

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

IdArray = NDArray[np.int64]
# Numbers of points, numbers of photons, distances.
Pairs = tuple[NDArray[np.intp], NDArray[np.intp], FloatArray]

# Points are searched in so many classes at most. Radii within one differ by half at most where
# that suffices: photons found beyond a point's own radius are found in vain.
MOST_CLASSES, RATIO = 8, 1.5
# Photons that the disc of the first pass holds where photons fall evenly: few, as radii only
# shrink as the sixth root of the number of passes, and noise falls by itself.
NEAREST = 24
# Pixels that the radius of a disc spans at least in the first pass.
PIXELS = 1.0
# A radius is this share of the scene's size at most and at least, in the first pass.
WIDEST, NARROWEST = 0.03, 1e-6
# A radius that is asked for may be larger. Of discs beyond this share the surfaces fill a part only:
# light is lost, and half the disc loses as much, so the estimate of blur would not see it.
WIDEST_ASKED = 0.25
# Nor are discs wider than this part of the surface that they lie on.
WIDEST_ON_SURFACE = 0.25
# So many photons are searched for first, and at points that have more once again for more.
FEW_PHOTONS = (64, 256)
# Pairs of points and photons looked at together; a pair takes 24 bytes.
MOST_PAIRS = 2**20
# Light tracing pays where at least this share of the pilot pass's caustic photons lies in dense places,
# and of these is seen by the camera, judged by so many of them at most.
LEAST_DENSE, MOST_JUDGED = 0.02, 1024
# A segment to a photon ends this much of its length before it.
BEFORE_END = 1e-6


@dataclass(frozen=True)
class Points:
    """Hit points of the eye pass ("measurement points" in PPM); n rows."""

    # (n, 3): position, shading normal, and direction of the camera path's ray
    position: FloatArray
    normal: FloatArray
    direction: FloatArray
    geometric: FloatArray  # (n, 3): geometric normals, if they differ from ``normal``; else (0, 3)
    material: IntArray  # (n,) int32
    colors: FloatArray  # (n, most lobes of a material, 3): zero for lobes that are left out
    # (n,) bool: the camera sees the point directly: photons that were splatted do not count there
    is_direct: BoolArray
    xi: FloatArray  # (n,) in [0, 1): samples one photon for each point
    widest: FloatArray  # (n,): radius of a disc at most, unless it is given: see `widest_discs`

    @property
    def vertices(self) -> Vertices:
        """The arrays as kernels take them."""
        return Vertices(
            self.material, self.colors, self.position, self.normal, self.direction,
            self.geometric, NO_RATIO,
        )  # fmt: skip


class Field(ABC):
    """Stored photons, arranged for density estimation.

    ``lobes``: of the scene.
    """

    def __init__(self, photons: Photons, lobes: LobeTable) -> None:
        from scipy.spatial import cKDTree

        self.photons = photons
        self._lobes = lobes
        self._tree: cKDTree = cKDTree(photons.position)

    def radiance(self, points: Points) -> tuple[Sums, FloatArray]:
        """Estimate the radiance that the wide lobes of points reflect from photons.

        The second array (n,) has the radii of the discs.
        """
        n = points.material.size
        sums = Sums(
            np.zeros((n, 3)),
            np.zeros((n, 3)),
            np.zeros(n, dtype=np.int64),
            np.full(n, -1, dtype=np.int64),
        )
        if not len(self.photons.history):
            return sums, np.zeros(n)
        return sums, self._gather(points, points.xi.copy(), sums)

    @abstractmethod
    def _gather(self, points: Points, xi: FloatArray, sums: Sums) -> FloatArray:
        """Find pairs of points and photons and `_add` them, all pairs of a point at once.

        Returns the radii.
        """

    def _add(
        self, pairs: Pairs, radius: FloatArray, points: Points, xi: FloatArray, sums: Sums
    ) -> None:
        add_photons(
            *pairs, radius, self._lobes, points.vertices, points.is_direct, self.photons, xi, sums
        )  # fmt: skip


class Radii:
    """The initial radius (that of the first pass) around any point.

    ``classes`` (classes,): largest radius of each class of points, increasing.
    ``positions`` (n, 3): positions of the first photons.
    ``radius`` (n,): distance within which each of these photons has the desired number of
    neighbours.
    ``is_sparse``: whether what is seen is small beside what the photons light.
    ``is_given``: whether the user asked for this radius: then it is that of every disc.
    """

    def __init__(
        self,
        classes: FloatArray,
        positions: FloatArray,
        radius: FloatArray,
        is_sparse: bool = False,
        is_given: bool = False,
    ) -> None:
        self.classes, self.is_sparse, self.is_given = classes, is_sparse, is_given
        self._radius = radius
        self._tree: cKDTree | None = None
        if radius.size:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(positions)

    @classmethod
    def fixed(cls, radius: float, is_given: bool = False) -> Radii:
        """Return the same radius everywhere."""
        return cls(np.array([radius]), np.zeros((0, 3)), np.zeros(0), is_given=is_given)

    @classmethod
    def of(
        cls, photons: Photons, share: float, camera: Projection, extent: float, threads: int
    ) -> Radii:
        """Return radii from the distances between photons.

        ``photons``: the first ones; ``share``: their number over that of a pass. Discs are at least as wide
        as the pixels of ``camera``: smaller ones add noise and no resolution. Where photons are very
        sparse, the radius is a fraction of ``extent``, the size of the scene.
        """
        position = photons.position
        if len(position) <= 2 * _neighbours(share):
            return cls.fixed(WIDEST * extent)
        # Where many photons fall in one point the distance is zero, and no radius may be.
        radius = np.maximum(
            _radii_around(position, share, threads), PIXELS * camera.pixel_widths(position)
        )
        # The widest disc would hold less than a photon: what is seen is small beside what they light.
        is_sparse = bool(np.median(radius) > math.sqrt(NEAREST) * WIDEST * extent)
        widest = (WIDEST_ASKED if is_sparse else WIDEST) * extent
        radius = np.clip(radius, NARROWEST * extent, widest)
        low, high = np.quantile(radius, [0.02, 0.98])
        n_classes = min(MOST_CLASSES, math.ceil(math.log(max(high / low, RATIO)) / math.log(RATIO)))
        step = (high / low) ** (1.0 / n_classes)
        classes = low * step ** np.arange(1.0, n_classes + 1.0)
        return cls(classes, position, radius, is_sparse)

    def are_cut(self, scene: CompiledScene) -> bool:
        """Tell whether some surface that light is gathered on is small beside the largest radius."""
        gathers = scene.materials_with(WIDE)[scene.material_of]
        return bool((widest_discs(scene)[gathers] < self.classes[-1]).any())

    def around(self, points: FloatArray, widest: FloatArray) -> tuple[FloatArray, NDArray[np.intp]]:
        """Return the initial radius, ``widest`` at most, and the class of each point (n, 3)."""
        if self._tree is None:
            radius = np.full(len(points), self.classes[-1])
        else:
            distance, nearest = self._tree.query(points)
            radius = np.minimum(np.maximum(self._radius[nearest], distance), self.classes[-1])
        if not self.is_given:
            radius = np.minimum(radius, widest)
        return radius, np.searchsorted(self.classes, radius)


class Discs(Field):
    """Discs of given radius.

    ``photons``, ``lobes``: see `Field`.
    ``shrink``: factor on the initial radii.
    """

    def __init__(self, photons: Photons, lobes: LobeTable, radii: Radii, shrink: float) -> None:
        super().__init__(photons, lobes)
        self._radii, self._shrink = radii, shrink
        self._reach = shrink * radii.classes
        # The slots of a table are about as many as photons, so few cells share one.
        n_slots = 2 ** max(math.ceil(math.log2(max(len(photons.history), 1))), 10)
        self._tables = np.zeros((self._reach.size, n_slots), dtype=np.int32)
        for reach, table in zip(self._reach, self._tables, strict=True):
            count_in_cells(photons.position, 2.0 * reach, table)

    def shown_photons(self, points: Points, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return, for some points, the nearest photon if it is one that was shown to the camera.

        ``rows`` (n,) int64: points whose discs hold no photon to be gathered.
        Returns (n,) int64: a photon within the point's disc, on its side of the surface, that does
        not count there as it was splatted; -1 if there is none.
        """
        found = np.full(rows.size, -1, dtype=np.intp)
        if not len(self.photons.history):
            return found
        position = points.position[rows]
        radius = self._shrink * self._radii.around(position, points.widest[rows])[0]
        distance, number = self._tree.query(position, distance_upper_bound=self._reach[-1])
        within = np.flatnonzero((np.asarray(distance) < radius) & points.is_direct[rows])
        rows, nearest = rows[within], np.asarray(number)[within]
        normal = points.geometric if points.geometric.size else points.normal
        faces = np.einsum("ij,ij->i", normal[rows], points.direction[rows]) <= 0.0
        agree = np.einsum("ij,ij->i", normal[rows], self.photons.normal[nearest]) > 0.0
        is_shown = (self.photons.history[nearest] & IS_SHOWN) != 0
        found[within] = np.where(is_shown & (faces == agree), nearest, -1)
        return found

    def _gather(self, points: Points, xi: FloatArray, sums: Sums) -> FloatArray:
        first_radius, class_of = self._radii.around(points.position, points.widest)
        radius = self._shrink * first_radius
        for number, reach in enumerate(self._reach):
            rows = np.flatnonzero(class_of == number)
            most = np.empty(rows.size, dtype=np.int64)
            position = points.position[rows]
            most_neighbours(position, reach, 2.0 * reach, self._tables[number], most)
            rows, most = rows[most > 0], most[most > 0]
            for at_most in FEW_PHOTONS:
                is_full = np.zeros(rows.size, dtype=np.bool_)
                for first in range(0, rows.size, MOST_PAIRS // at_most):
                    part = slice(first, first + MOST_PAIRS // at_most)
                    pairs, is_full[part] = self._few(points, rows[part], reach, at_most)
                    self._add(pairs, radius, points, xi, sums)
                rows, most = rows[is_full], most[is_full]
            for part in _parts(most):
                self._add(self._all(points, rows[part], reach), radius, points, xi, sums)
        return radius

    def _few(
        self, points: Points, rows: NDArray[np.intp], reach: float, at_most: int
    ) -> tuple[Pairs, BoolArray]:
        """Find the photons of points that have fewer than ``at_most``; mark the other points.

        This is several times as fast as comparing trees, and threads do not wait for each other.
        """
        found, number = self._tree.query(points.position[rows], at_most, distance_upper_bound=reach)
        distance = np.asarray(found, dtype=np.float64)
        is_near = np.isfinite(distance)
        is_full = is_near[:, -1].copy()
        is_near[is_full] = False
        row, k = np.nonzero(is_near)
        return (rows[row], np.asarray(number)[row, k], distance[row, k]), is_full

    def _all(self, points: Points, rows: NDArray[np.intp], reach: float) -> Pairs:
        """Find all photons of points, whatever their number."""
        from scipy.spatial import cKDTree

        pairs: Any = cKDTree(points.position[rows]).sparse_distance_matrix(
            self._tree, reach, output_type="ndarray"
        )
        return rows[pairs["i"]], pairs["j"], pairs["v"]


class Nearest(Field):
    """Discs around the given number of nearest photons, with a largest radius.

    ``photons``, ``lobes``: see `Field`.
    ``limit``: largest radius, scene units.
    """

    def __init__(self, photons: Photons, lobes: LobeTable, nearest: int, limit: float) -> None:
        super().__init__(photons, lobes)
        self._nearest = min(nearest, max(len(photons.history), 1))
        self._limit = limit

    def _gather(self, points: Points, xi: FloatArray, sums: Sums) -> FloatArray:
        position = points.position
        at_once = max(MOST_PAIRS // self._nearest, 1)
        radius = np.full(len(position), self._limit)
        for first in range(0, len(position), at_once):
            stop = min(first + at_once, len(position))
            found, number = self._tree.query(
                position[first:stop], range(1, self._nearest + 1), distance_upper_bound=self._limit
            )
            distance = np.asarray(found, dtype=np.float64)
            # Where fewer lie within the limit, the disc reaches to the limit. A disc within which
            # all of them coincide still has a radius.
            farthest = np.where(np.isfinite(distance[:, -1]), distance[:, -1], self._limit)
            farthest = np.minimum(farthest, points.widest[first:stop])
            radius[first:stop] = np.maximum(farthest, NARROWEST * self._limit)
            row, k = np.nonzero(np.isfinite(distance))
            pairs = first + row, np.asarray(number)[row, k], distance[row, k]
            self._add(pairs, radius, points, xi, sums)
        return radius


class Places:
    """Places of a scene, and how far around each of them counts.

    ``position`` (n, 3).
    ``reach`` (n,).
    """

    def __init__(self, position: FloatArray, reach: FloatArray) -> None:
        from scipy.spatial import cKDTree

        self._tree: cKDTree = cKDTree(position)
        self._position, self._reach = position, reach

    def near(self, position: FloatArray) -> NDArray[np.intp]:
        """Return which points (n, 3) lie within the reach of the nearest place."""
        found, nearest = self._tree.query(position, distance_upper_bound=self._reach.max())
        distance, nearest = np.asarray(found), np.asarray(nearest)
        within = np.flatnonzero(np.isfinite(distance))
        return within[distance[within] < self._reach[nearest[within]]]


class DensePlaces(Places):
    """Caustic photons of a first set, and the radius around each in which caustics are dense; or 0."""

    @classmethod
    def of(
        cls, photons: Photons, share: float, camera: Projection, threads: int
    ) -> DensePlaces | None:
        """Return where a disc as wide as a pixel holds enough caustic photons; None: nowhere.

        ``share`` is the number of these photons over that of a pass.
        """
        position = photons.position[photons.history == MET_SPECULAR]
        if len(position) <= _neighbours(share):
            return None
        pixel = PIXELS * camera.pixel_widths(position)
        is_dense = _radii_around(position, share, threads) < pixel
        if is_dense.mean() < LEAST_DENSE:
            return None
        return cls(position, np.where(is_dense, pixel, 0.0))

    def are_seen(self, context: RenderContext) -> bool:
        """Tell whether the camera sees enough of the dense caustics directly, not through glass."""
        dense = self._position[self._reach > 0.0]
        judged = dense[:: max(len(dense) // MOST_JUDGED, 1)]
        way, _, pdf = context.scene.camera.sees(judged)
        tracer = context.tracer.with_own_counters()
        is_hidden = tracer.occluded(judged - way, way, 1.0 - BEFORE_END)
        return bool(np.mean((pdf > 0.0) & ~is_hidden) >= LEAST_DENSE)


def _neighbours(share: float) -> int:
    """Return how many neighbours of a photon are looked for where only a share of a pass was sent."""
    return max(round(NEAREST * share), 3)


def _radii_around(position: FloatArray, share: float, threads: int) -> FloatArray:
    """Return the radius about each photon that holds `NEAREST` others of a pass."""
    from scipy.spatial import cKDTree

    wanted = _neighbours(share)
    found, _ = cKDTree(position).query(position, [wanted + 1], workers=threads)
    return np.asarray(found, dtype=np.float64)[:, 0] * math.sqrt(NEAREST * share / wanted)


def widest_discs(scene: CompiledScene) -> FloatArray:
    """Return the widest radius of discs on each surface, (surfaces,); infinite on endless ones.

    A disc that reaches over the edge of its surface finds no photons there. If most of it does, half
    the disc loses as much, and the estimate of blur does not see it.
    """
    return WIDEST_ON_SURFACE * scene.widths


def _parts(most: IdArray) -> list[slice]:
    """Cut points into runs with few pairs each; a run has one point at least."""
    before = np.concatenate([[0], np.cumsum(most)])
    parts, first = [], 0
    while first < most.size:
        stop = int(np.searchsorted(before, before[first] + MOST_PAIRS, side="right")) - 1
        stop = max(stop, first + 1)
        parts.append(slice(first, stop))
        first = stop
    return parts
