"""Light at points from the photons near them: sums over discs, exact however many there are.

The radius of a disc hangs on how densely photons fall around it: where the first photons lie close
together it is small. Radii take one of four values at most, so that a tree of points is compared
with the tree of photons by few calls of `scipy.spatial.cKDTree.sparse_distance_matrix`; before each
call its pairs are bounded from above, and points are taken in parts small enough.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.integrators.surface_light import Shading
from hybrid_rt.kernels.gather import add_photons, count_in_cells, most_neighbours
from hybrid_rt.kernels.lobes import LobeTable
from hybrid_rt.kernels.photons import Photons
from hybrid_rt.records import FloatArray

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

# Radii of points take at most so many values.
MOST_CLASSES = 4
# Photons that the disc of the first pass holds where photons fall evenly: few, as radii only
# shrink as the sixth root of the number of passes, and noise falls by itself.
NEAREST = 12
# A radius is this share of the scene's size at most and at least, in the first pass.
WIDEST, NARROWEST = 0.03, 1e-6
# Pairs of points and photons looked at together; a pair takes 24 bytes.
MOST_PAIRS = 2**20


def shrunk(radius: FloatArray, pass_number: int, alpha: float) -> FloatArray:
    """Return the radii of a pass: Knaus and Zwicker, "Progressive photon mapping", ToG 30(3), 2011.

    r_i^2 = r_1^2 Gamma(i + alpha) / (Gamma(1 + alpha) Gamma(i + 1)) with i = 1 in the first pass.
    """
    i = pass_number + 1.0
    log_share = math.lgamma(i + alpha) - math.lgamma(1.0 + alpha) - math.lgamma(i + 1.0)
    return radius * math.exp(0.5 * log_share)


class Radii:
    """The radius of the first pass around any point.

    Parameters
    ----------
    classes : (classes,) float64
        Radii that points take, rising.
    positions : (n, 3) float64
        Places of the first photons.
    radius : (n,) float64
        Distance within which each of them has as many neighbours as wanted.
    """

    def __init__(self, classes: FloatArray, positions: FloatArray, radius: FloatArray) -> None:
        self.classes = classes
        self._edges = np.sqrt(classes[:-1] * classes[1:])
        self._radius = radius
        self._tree: cKDTree | None = None
        if classes.size > 1:
            from scipy.spatial import cKDTree

            self._tree = cKDTree(positions)

    @classmethod
    def fixed(cls, radius: float) -> Radii:
        """Return the same radius everywhere."""
        return cls(np.array([radius]), np.zeros((0, 3)), np.zeros(0))

    @classmethod
    def of(cls, photons: Photons, share: float, extent: float, threads: int) -> Radii:
        """Return radii by the distances between photons.

        Parameters
        ----------
        photons : Photons
            The first ones.
        share : float
            Their number over that of a pass.
        extent : float
            Size of the scene: the radius where hardly any photon falls is a part of it.
        threads : int
        """
        position = photons.position
        wanted = max(round(NEAREST * share), 3)
        if len(position) <= 2 * wanted:
            return cls.fixed(WIDEST * extent)
        from scipy.spatial import cKDTree

        found, _ = cKDTree(position).query(position, [wanted + 1], workers=threads)
        distance = np.asarray(found, dtype=np.float64)[:, 0]
        # Where many photons fall in one point the distance is zero, and no radius may be.
        radius = distance * math.sqrt(NEAREST * share / wanted)
        radius = np.clip(radius, NARROWEST * extent, WIDEST * extent)
        low, high = np.quantile(radius, [0.02, 0.98])
        n_classes = min(MOST_CLASSES, 1 + math.ceil(math.log2(max(high / low, 1.0))))
        return cls(np.geomspace(low, high, n_classes), position, radius)

    def classes_of(self, points: FloatArray) -> NDArray[np.intp]:
        """Return the class of the radius around each point (n, 3)."""
        if self._tree is None:
            return np.zeros(len(points), dtype=np.intp)
        distance, nearest = self._tree.query(points)
        wanted = np.maximum(self._radius[nearest], distance)
        return np.searchsorted(self._edges, wanted).astype(np.intp)


class PhotonField:
    """Photons that have arrived, ready to be asked for the light they make.

    Parameters
    ----------
    photons : Photons
    radii : Radii
    shrink : float
        What multiplies the radii of the first pass.
    lobes : LobeTable
        Of the scene.
    """

    def __init__(self, photons: Photons, radii: Radii, shrink: float, lobes: LobeTable) -> None:
        from scipy.spatial import cKDTree

        self.photons = photons
        self._radii = radii
        self._radius = shrink * radii.classes
        self._lobes = lobes
        self._tree = cKDTree(photons.position)
        # The slots of a table are about as many as photons, so few cells share one.
        n_slots = 2 ** max(math.ceil(math.log2(max(len(photons.history), 1))), 10)
        self._tables = np.zeros((self._radius.size, n_slots), dtype=np.int32)
        for radius, table in zip(self._radius, self._tables, strict=True):
            count_in_cells(photons.position, 2.0 * radius, table)

    def radiance(
        self, shading: Shading, xi: FloatArray
    ) -> tuple[FloatArray, NDArray[np.int64], NDArray[np.int64]]:
        """Return the light that photons make at points, through lobes that spread it widely.

        Parameters
        ----------
        shading : Shading of n rows
        xi : (n,) float64 in [0, 1)

        Returns
        -------
        radiance : (n, 3) float64
        near : (n,) int64
            Photons that each sum has.
        chosen : (n,) int64
            One of them, chosen by xi and by what it adds; -1 where there is none.
        """
        hits = shading.hits
        n = len(hits)
        value, near = np.zeros((n, 3)), np.zeros(n, dtype=np.int64)
        chosen, xi = np.full(n, -1, dtype=np.int64), xi.copy()
        if len(self.photons.history) == 0:
            return value, near, chosen
        class_of = self._radii.classes_of(hits.position)
        for number, radius in enumerate(self._radius):
            rows = np.flatnonzero(class_of == number)
            most = np.empty(rows.size, dtype=np.int64)
            most_neighbours(hits.position[rows], radius, 2.0 * radius, self._tables[number], most)
            rows, most = rows[most > 0], most[most > 0]
            for part in _parts(most):
                self._add(shading, rows[part], radius, value, near, xi, chosen)
        return value, near, chosen

    def _add(
        self,
        shading: Shading,
        rows: NDArray[np.intp],
        radius: float,
        value: FloatArray,
        near: NDArray[np.int64],
        xi: FloatArray,
        chosen: NDArray[np.int64],
    ) -> None:
        from scipy.spatial import cKDTree

        hits, photons = shading.hits, self.photons
        pairs: Any = cKDTree(hits.position[rows]).sparse_distance_matrix(
            self._tree, radius, output_type="ndarray"
        )
        add_photons(
            rows[pairs["i"]], pairs["j"], pairs["v"], radius, self._lobes, shading.material,
            shading.colors, hits.position, hits.normal, shading.geometric, shading.directions,
            photons.direction, photons.normal, photons.power, photons.position, value, near,
            xi, chosen,
        )  # fmt: skip


def _parts(most: NDArray[np.int64]) -> list[slice]:
    """Cut points into runs with few pairs each; a run has one point at least."""
    before = np.concatenate([[0], np.cumsum(most)])
    parts, first = [], 0
    while first < most.size:
        stop = int(np.searchsorted(before, before[first] + MOST_PAIRS, side="right")) - 1
        stop = max(stop, first + 1)
        parts.append(slice(first, stop))
        first = stop
    return parts
