"""The registry of filters: what is certain of a ray's first crossing with each class of surfaces.

A new class of surfaces needs a class derived from `SurfaceFilter` in a module of
`proof.filters.surfaces`; it is found by itself. Without one the exact judge is asked
about all its rays.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.surface import Surface
from proof.by_class import entry_of, import_all
from proof.filters.kernels import bernstein, first


class SurfaceFilter(ABC):
    """What is certain of crossings with one surface.

    Parameters
    ----------
    surface : Surface
        Of the class that the filter is ``of``.
    """

    known: ClassVar[dict[type[Surface], type[SurfaceFilter]]] = {}

    def __init_subclass__(cls, *, of: type[Surface], **options: Any) -> None:
        """Register by the class of surfaces that it is ``of``."""
        super().__init_subclass__(**options)
        SurfaceFilter.known[of] = cls

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    @abstractmethod
    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say of each ray what is certain of its first crossing with t > 0.

        Parameters
        ----------
        origins, directions : (n, 3) float64
        leaves : (n,) bool
            Whether the ray leaves this surface: the crossing at its origin is left out.
        hit_t : (n,) float64
            t of hits on this surface; nan for others.

        Returns
        -------
        (n, N_COLUMNS) float64
            See `kernels.first`: whether there is one, t and its radius, hit_t - t and its radius,
            and from which t on there may be others.
        """

    @abstractmethod
    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Return the distances (n,) of the points ``origins + along`` from those of hits.

        Rounded: by some eps of the distance from the origins and of the surface's size.
        """

    def ball(self) -> tuple[FloatArray, float]:
        """Return the middle and the diameter, scene units; -1 if it is unbounded."""
        low, high = self.surface.bounds
        return 0.5 * (low + high), float(np.linalg.norm(high - low))


def filter_of(surface: Any) -> SurfaceFilter:
    """Return the filter of a surface.

    Raises
    ------
    TypeError
        If its class is not registered.
    """
    return entry_of(surface, all_filters())(surface)


@cache
def all_filters() -> dict[type[Surface], type[SurfaceFilter]]:
    """Import all filters; return them by class of surface."""
    from proof.filters import surfaces

    import_all(surfaces)
    return SurfaceFilter.known


def fractions(values: Any) -> Any:
    """Return an array of floats as the fractions that they are."""
    as_fraction = np.frompyfunc(lambda x: Fraction(float(x)), 1, 1)
    return as_fraction(np.asarray(values, dtype=np.float64))


def double_double(values: Any) -> FloatArray:
    """Return fractions as sums of two float64, on a last axis."""
    flat = np.asarray(values, dtype=object).ravel()
    pairs = [(float(x), float(x - Fraction(float(x)))) for x in flat]
    return np.array(pairs).reshape(*np.shape(values), 2)


def crossings_scratch() -> FloatArray:
    """Return room for the crossings of one ray."""
    return np.zeros((first.MOST_CROSSINGS, first.CROSSING))


def solver_scratch(degree: int) -> dict[str, FloatArray]:
    """Return working memory of `bernstein.solve`."""
    return {
        "nets": np.zeros((bernstein.DEPTH + 3, 2, degree + 1)),
        "radii": np.zeros(bernstein.DEPTH + 1),
        "spans": np.zeros((bernstein.DEPTH + 1, 2)),
        "roots": np.zeros((bernstein.ROOM, 6)),
        "unsure": np.zeros((bernstein.ROOM, 2)),
    }
