"""Instances: surfaces in many places, each by a similarity, with one set of tables for all of them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.records import FloatArray
from meshing.area import AreaSampler, Grid
from meshing.checks import SIMILARITY_TOLERANCE, IdArray, as_affine, as_floats, freeze, shown
from meshing.surface import Surface, box_around

# Numbers of patches are int32, as in a hit record.
MOST_PATCHES = 2**31 - 1
# A lamp is cut into cells, at least one a patch.
MOST_SHINING = 2**16


class Instances(Surface):
    """One surface, or several, in many places.

    All places share the tables by which rays meet the surfaces: a place takes its matrix and its share
    of a tree, some 130 bytes. Rays meet what `Surface.transformed` would give, but no image is made, and
    matrices are not rounded once more.

    A place of a reflection has normals along S_u x S_v, as images by `Surface.transformed` have: those of a
    closed surface point inward (of a `Box` too, whose image keeps its own). For glass, pass reflections of a
    surface that is flipped, as an object of its own.

    Parameters
    ----------
    surfaces : Surface, or sequence of Surface
        Bounded ones; other `Instances` are none.
    matrices : (n, 4, 4) or (n, 3, 4) array
        A similarity for each place: rotation, shift, uniform scale, reflection. It acts on columns
        (x, y, z, 1); a fourth row is (0, 0, 0, 1).

    Raises
    ------
    TypeError, ValueError
        For other surfaces; and for a matrix that is no similarity, or not finite: the message names its row.

    Attributes
    ----------
    surfaces : tuple of Surface
    matrices : (n, 3, 4) float64, read-only

    Notes
    -----
    ``patch_id`` counts the patches of the first surface, of the second, and so on, in the first place; then
    those in the second place. `split` takes it apart. ``instance_id`` of a hit is the row of its matrix.

    Examples
    --------
    >>> import numpy as np
    >>> from hybrid_rt import Instances, Intersector, Sphere
    >>> matrices = np.tile(np.eye(4), (1000, 1, 1))
    >>> matrices[:, 0, 3] = 3.0 * np.arange(1000)
    >>> balls = Instances(Sphere((0, 0, 0), 1), matrices)
    >>> hits = Intersector(balls).intersect([[2997.0, 0, 9], [1.5, 0, 9]], [0, 0, -1])
    >>> hits.instance_id
    array([999,  -1], dtype=int32)
    """

    def __init__(self, surfaces: Surface | Sequence[Surface], matrices: ArrayLike) -> None:
        several = (
            (surfaces,)
            if isinstance(surfaces, Surface)
            else checks.items(surfaces, "Instances surfaces")
        )
        for i, surface in enumerate(several):
            name = f"Instances surfaces[{i}] is {shown(surface)}"
            if not isinstance(surface, Surface):
                raise TypeError(f"{name}: pass surfaces such as BezierPatches or Sphere")
            if isinstance(surface, Instances):
                raise TypeError(f"{name}: pass its surfaces, and the products of both matrices")
            if not surface.is_bounded:
                raise TypeError(f"{name}, unbounded: pass it by itself, or a Rectangle")
        if not several:
            raise ValueError("Instances surfaces is empty: pass at least one surface")
        self.surfaces: tuple[Surface, ...] = several
        self.is_closed = all(surface.is_closed for surface in several)  # type: ignore[misc]
        self._first = np.cumsum([0, *map(len, several)])
        self.matrices, self.scale = _similarities(matrices)
        if self.n_patches * len(self.matrices) > MOST_PATCHES:
            raise ValueError(
                f"Instances of {len(self.matrices)} places with {self.n_patches} patches each: pass several, of "
                f"at most {MOST_PATCHES} patches in all"
            )
        sizes = self.scale * self._size
        if not checks.SMALLEST < self._size <= checks.FARTHEST:
            bad, name = self._size, "surfaces are together"
        else:
            row = int(np.abs(np.log(sizes)).argmax())
            bad, name = float(sizes[row]), f"matrices[{row}] makes them"
        if not checks.SMALLEST < bad <= checks.FARTHEST:
            raise ValueError(
                f"Instances {name} {bad:.3g} large: scale the scene, sizes from {checks.SMALLEST:g} to "
                f"{checks.FARTHEST:g} are possible"
            )

    def __len__(self) -> int:
        """Return the number of patches in all places."""
        return self.n_patches * len(self.matrices)

    def __repr__(self) -> str:
        """Count the places, and name the surfaces."""
        of = repr(self.surfaces[0]) if len(self.surfaces) == 1 else f"{len(self.surfaces)} surfaces"
        return f"Instances({of} in {len(self.matrices):,} places)"

    @property
    def n_patches(self) -> int:
        """Number of patches in each place."""
        return int(self._first[-1])

    def split(self, patch_id: ArrayLike) -> tuple[IdArray, IdArray, IdArray]:
        """Return the place, the surface, and the ``patch_id`` on that surface, of patches of hits.

        Parameters
        ----------
        patch_id : int array-like, any shape

        Raises
        ------
        IndexError
            For a number that is no patch.
        """
        ids, n = np.asarray(patch_id, np.int64), len(self)
        if ids.size and not 0 <= ids.min() <= ids.max() < n:
            bad = ids[(ids < 0) | (ids >= n)].flat[0]
            raise IndexError(
                f"Instances patch_id holds {bad}: pass 0 to {n - 1}, not those of misses"
            )
        place, rest = np.divmod(ids, self.n_patches)
        member = np.searchsorted(self._first, rest, side="right") - 1
        return place, member, rest - self._first[member]

    def surface_in(self, place: int) -> list[Surface]:
        """Return the images of the surfaces in one place, by `Surface.transformed`."""
        matrix = np.vstack([self.matrices[place], [0.0, 0.0, 0.0, 1.0]])
        return [surface.transformed(matrix) for surface in self.surfaces]

    # --- points

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        place, members = self._members_at(patch_id)
        points = np.empty((u.size, 3))
        for surface, rows, own in members:
            points[rows] = surface._points(u[rows], v[rows], own)
        return self._turned(points, place) + self.matrices[place, :, 3]

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        place, members = self._members_at(patch_id)
        s_u, s_v = np.empty((u.size, 3)), np.empty((u.size, 3))
        for surface, rows, own in members:
            s_u[rows], s_v[rows] = surface._partials(u[rows], v[rows], own)
        return self._turned(s_u, place), self._turned(s_v, place)

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        place, members = self._members_at(patch_id)
        normals = np.empty((u.size, 3))
        for surface, rows, own in members:
            normals[rows] = surface._normals(u[rows], v[rows], own)
        normals = self._turned(normals, place)
        sign = np.sign(np.linalg.det(self.matrices[place, :, :3] / self.scale[place, None, None]))
        return normals * (sign / np.linalg.norm(normals, axis=1))[:, None]

    @property
    def texture_coordinates(self) -> FloatArray | None:
        """Those of the first mesh that has some; None: textures are looked up at (u, v)."""
        found = (getattr(surface, "texture_coordinates", None) for surface in self.surfaces)
        return next((one for one in found if one is not None), None)

    def texture_point(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        """Return where textures are looked up at (u, v) of patches, (n, 2): see `TriangleMesh`."""
        points = np.stack([u, v], axis=1)
        for surface, rows, own in self._members_at(patch_id)[1]:
            if getattr(surface, "texture_coordinates", None) is not None:
                points[rows] = surface.texture_point(u[rows], v[rows], own)  # type: ignore[attr-defined]
        return points

    def _members_at(
        self, patch_id: IdArray
    ) -> tuple[IdArray, list[tuple[Surface, IdArray, IdArray]]]:
        """Return the place of each patch; and each surface, the rows on it and their own patches."""
        place, member, own = self.split(patch_id)
        rows = [np.flatnonzero(member == m) for m in range(len(self.surfaces))]
        found = [(self.surfaces[m], k, own[k]) for m, k in enumerate(rows) if k.size]
        return place, found

    def _turned(self, vectors: FloatArray, place: IdArray) -> FloatArray:
        return np.einsum("nij,nj->ni", self.matrices[place, :, :3], vectors)

    # --- shape

    @cached_property
    def box(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner of the box around the surfaces as they were given."""
        boxes = np.array(
            [s.bounds + 2.0 * s.moved * np.array([[-1.0], [1.0]]) for s in self.surfaces]
        )
        return box_around(boxes)

    @property
    def _size(self) -> float:
        return float(np.linalg.norm(self.box[1] - self.box[0]))

    @property
    def boxes(self) -> FloatArray:
        """(n, 2, 3) float64: lower and upper corner of a box around each place."""
        linear, shift = self.matrices[:, :, :3], self.matrices[:, :, 3]
        low, high = self.box
        centre = linear @ (0.5 * low + 0.5 * high)
        half = np.abs(linear) @ (0.5 * high - 0.5 * low)
        half += 2.0**-48 * (np.abs(linear) @ np.abs(self.box).max(axis=0) + np.abs(shift))
        half += 2.0 * self.moved
        centre += shift
        return np.stack([centre - half, centre + half], axis=1)

    @cached_property
    def bounds(self) -> FloatArray:
        """(2, 3) float64: lower and upper corner."""
        boxes = self.boxes
        return box_around(boxes)

    @property
    def rounding_reach(self) -> float:
        """The largest coordinate of the surfaces as they were given, in lengths of the largest place."""
        return float(np.abs(self.box).max() * self.scale.max())

    def area_sampler(self) -> AreaSampler:
        """Return the area sampler."""
        if any(s.is_triangular or hasattr(s, "loops") for s in self.surfaces) or (
            len(self) > MOST_SHINING
        ):
            raise ValueError(
                f"is {self!r}: to shine it takes surfaces that are no meshes and not trimmed, and up to "
                f"{MOST_SHINING} patches in all. Pass lamps as objects of their own, by surface.transformed(matrix)"
            )
        return Grid(self)

    def transformed(self, matrix: ArrayLike) -> Instances:
        """Return the image under a similarity; see `Surface.transformed`."""
        linear, shift = as_affine(matrix, "Instances")
        image = Instances(self.surfaces, np.concatenate([
            linear @ self.matrices[:, :, :3],
            (self.matrices[:, :, 3] @ linear.T + shift)[:, :, None],
        ], axis=2))  # fmt: skip
        # Sums of three and of four terms, of which each place has its own rounding.
        size = np.abs(linear).sum() * np.abs(self.matrices).sum(axis=1).max(axis=0)
        rounding = 2.0**-51 * float(size[:3].sum() * np.abs(self.box).max() + size[3])
        rounding += 2.0**-51 * float(np.abs(shift).sum())
        image.moved = rounding + float(np.linalg.norm(linear, 2)) * self.moved
        return image

    def flipped(self) -> Instances:
        """Return the same places of the flipped surfaces."""
        image = Instances([surface.flipped() for surface in self.surfaces], self.matrices)
        image.moved = self.moved
        return image


def _similarities(matrices: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return checked matrices (n, 3, 4), read-only, and their scales (n,)."""
    array = as_floats(matrices, "Instances matrices")
    if array.ndim != 3 or array.shape[1:] not in ((4, 4), (3, 4)) or not len(array):
        raise ValueError(
            f"Instances matrices has shape {array.shape}: pass (n, 4, 4) or (n, 3, 4), at least one"
        )

    def refuse(is_bad: Any, why: str, remedy: str) -> None:
        if is_bad.any():
            row = int(is_bad.argmax())
            raise ValueError(
                f"Instances matrices[{row}] = {array[row].tolist()} {why} ({np.count_nonzero(is_bad)} "
                f"such row(s)): {remedy}"
            )

    refuse(~np.isfinite(array).all(axis=(1, 2)), "is not finite", "pass finite numbers")
    if array.shape[1] == 4:
        refuse(
            (array[:, 3] != (0.0, 0.0, 0.0, 1.0)).any(axis=1),
            "has another last row",
            "pass an affine map, last row (0, 0, 0, 1)",
        )
    kept = freeze(np.ascontiguousarray(array[:, :3]) if array.shape[1] == 4 else array.copy())
    linear = kept[:, :, :3]
    largest = np.abs(linear).max(axis=(1, 2))
    refuse(largest == 0.0, "has scale 0", "leave that place out")
    # By a power of two first, so that no square overflows.
    unit = np.ldexp(1.0, np.frexp(largest)[1])
    linear = linear / unit[:, None, None]
    scale = np.sqrt(np.einsum("nij,nij->n", linear, linear) / 3.0)
    linear = linear / scale[:, None, None]
    gram = np.einsum("nik,njk->nij", linear, linear) - np.eye(3)
    refuse(
        ~(np.abs(gram).max(axis=(1, 2)) <= SIMILARITY_TOLERANCE),
        "is no similarity",
        "pass rotations, shifts, uniform scales or reflections; for other maps pass "
        "surface.transformed(matrix) by itself",
    )
    return kept, freeze(scale * unit)
