"""The registry: how crossings with each class of surfaces are found, exactly and by the screen.

A new class of surfaces needs a class derived from `ExactSurface` and one from `SurfaceFilter` in a module
of `proof.surfaces`; they are found by themselves.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from fractions import Fraction
from functools import cache
from typing import Any, ClassVar, TypeAlias, TypeVar

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.surface import Surface
from proof.exact.crossings import Crosser
from proof.filters.kernels import bernstein, first

Entry = TypeVar("Entry")
Gap: TypeAlias = Callable[[int, float, float, list[Any]], float]
"""How far a rational point of a ray lies from the point of the surface that a hit names by its
patch, u and v; rounded. Beyond its border a surface does not go on: hits there are measured from it."""
Locate: TypeAlias = Callable[[list[Any]], tuple[float, float]]
"""(u, v), rounded, of a point of the surface given in balls."""
IsTouched: TypeAlias = Callable[[FloatArray, FloatArray, float, bool], bool]
"""Whether a ray, from its origin and unit direction, grazes the surface within a reach, or begins
so near to it. A ray that leaves the surface (the last argument) always does the latter, which then
is no reason."""


class ExactSurface(ABC):
    """All crossings with one surface, in fractions and balls.

    ``surface``: of the class that this is ``of``.
    """

    known: ClassVar[dict[type[Surface], type[ExactSurface]]] = {}

    def __init_subclass__(cls, *, of: type[Surface], **options: Any) -> None:
        """Register by the class of surfaces that it is ``of``."""
        super().__init_subclass__(**options)
        ExactSurface.known[of] = cls

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    @abstractmethod
    def crosser(self) -> Crosser:
        """Return a function that finds all crossings of a ray, of any t."""

    def locate(self) -> Locate | None:
        """Return a function that finds (u, v) of a point; None: crossings name theirs."""
        return None

    @abstractmethod
    def gap(self) -> Gap:
        """Return a function that measures how far a hit's point lies from a point of its ray."""

    @abstractmethod
    def touch(self) -> IsTouched:
        """Return a function that tells whether a ray nearly touches the surface."""

    def ball(self) -> tuple[list[float], float | None]:
        """Return the middle and the diameter, scene units; no diameter if it is unbounded."""
        low, high = self.surface.bounds
        return (0.5 * (low + high)).tolist(), float(np.linalg.norm(high - low))


class SurfaceFilter(ABC):
    """What is certain of crossings with one surface.

    ``surface``: of the class that the filter is ``of``.
    """

    known: ClassVar[dict[type[Surface], type[SurfaceFilter]]] = {}

    def __init_subclass__(cls, *, of: type[Surface], **options: Any) -> None:
        """Register by the class of surfaces that it is ``of``."""
        super().__init_subclass__(**options)
        SurfaceFilter.known[of] = cls

    # Fills in what is certain, from a table of the surface and working memory.
    kernel: Callable[..., None] | None = None

    def __init__(self, surface: Any) -> None:
        self.surface = surface
        self._table: Any = None
        self._scratch: Any = None

    def first(
        self, origins: FloatArray, directions: FloatArray, leaves: BoolArray, hit_t: FloatArray
    ) -> FloatArray:
        """Say of each ray what is certain of its first crossing with t > 0.

        ``leaves``: whether the ray leaves this surface: the crossing at its origin is left out.
        ``hit_t``: t of hits on this surface; nan for others.
        Returns what `kernels.first` names: whether there is one, t and its radius, hit_t - t and its radius, and
        from which t on there may be others. Without a kernel nothing is certain.
        """
        out = np.zeros((len(origins), first.N_COLUMNS))
        if self.kernel is None:
            out[:, first.UNSURE_FROM] = -np.inf
        else:
            self.kernel(self._table, origins, directions, leaves, hit_t, self._scratch, out)
        return out

    @abstractmethod
    def gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Return the distances (n,) of the points ``origins + along`` from those of hits.

        Rounded: by some eps of the distance from the origins and of the surface's size.
        """

    def ball(self) -> tuple[FloatArray, float]:
        """Return the middle and the diameter, scene units; -1 if it is unbounded."""
        middle, size = exact_of(self.surface).ball()
        return np.array(middle), -1.0 if size is None else size


def exact_of(surface: Any) -> ExactSurface:
    """Return the exact surface of a surface; raise TypeError if its class is not registered."""
    return _entry_of(surface, all_exact())(surface)


def filter_of(surface: Any) -> SurfaceFilter:
    """Return the filter of a surface; raise TypeError if its class is not registered."""
    return _entry_of(surface, all_filters())(surface)


def all_exact() -> dict[type[Surface], type[ExactSurface]]:
    """Return all exact surfaces by class of surface."""
    _import_all()
    return ExactSurface.known


def all_filters() -> dict[type[Surface], type[SurfaceFilter]]:
    """Return all filters by class of surface."""
    _import_all()
    return SurfaceFilter.known


@cache
def _import_all() -> None:
    """Import every module of `proof.surfaces`, so that its classes register themselves."""
    from proof import surfaces

    for module in pkgutil.iter_modules(surfaces.__path__, surfaces.__name__ + "."):
        importlib.import_module(module.name)


def _entry_of(surface: Any, register: dict[type[Any], Entry]) -> Entry:
    """Return the entry of a surface's class, or of the first class that it derives from."""
    for surface_type in type(surface).__mro__:
        if surface_type in register:
            return register[surface_type]
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )


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
