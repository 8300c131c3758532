"""The registry: how crossings with each class of surfaces are found, exactly and by the screen.

A new class of surfaces needs a class derived from `Judged` in a module of `proof.surfaces`; it is found
by itself.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from fractions import Fraction
from functools import cache, cached_property
from typing import Any, ClassVar, TypeAlias

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray, IntArray
from meshing.surface import Surface
from proof.exact.crossings import Crosser
from proof.filters.kernels import bernstein, first

Gap: TypeAlias = Callable[[int, float, float, list[Any]], float]
"""How far a rational point of a ray lies from the point of the surface that a hit names by its
patch, u and v; rounded. Beyond its border a surface does not go on: hits there are measured from it."""
Locate: TypeAlias = Callable[[list[Any]], tuple[float, float]]
"""(u, v), rounded, of a point of the surface given in balls."""
IsTouched: TypeAlias = Callable[[FloatArray, FloatArray, float, bool], bool]
"""Whether a ray, from its origin and unit direction, grazes the surface within a reach, or begins
so near to it. A ray that leaves the surface (the last argument) always does the latter, which then
is no reason."""


class Judged(ABC):
    """All crossings with one surface, in fractions and balls; and what a screen is certain of.

    ``surface``: of the class that this is ``of``; None for what classes share.
    """

    known: ClassVar[dict[type[Surface], type[Judged]]] = {}
    # Fills in what is certain, from a table of the surface and working memory.
    kernel: Callable[..., None] | None = None

    def __init_subclass__(cls, *, of: type[Surface] | None, **options: Any) -> None:
        """Register by the class of surfaces that it is ``of``."""
        super().__init_subclass__(**options)
        if of is not None:
            Judged.known[of] = cls

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    # --- exact arithmetic

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

    # --- the screen

    def tables(self) -> tuple[Any, Any]:
        """Return what the kernel knows of the surface, and its working memory."""
        return None, None

    @cached_property
    def _tables(self) -> tuple[Any, Any]:
        return self.tables()

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
            table, scratch = self._tables
            self.kernel(table, origins, directions, leaves, hit_t, scratch, out)
        return out

    def rough_gap(
        self, origins: FloatArray, along: FloatArray, u: FloatArray, v: FloatArray, patch: IntArray
    ) -> FloatArray:
        """Return the distances (n,) of the points ``origins + along`` from S(u, v) of hits.

        Rounded: by some eps of the distance from the origins and of the surface's size.
        """
        points = self._local.point(u, v, patch)
        distance: FloatArray = np.linalg.norm(points + (self.middle - origins) - along, axis=1)
        return distance

    @cached_property
    def middle(self) -> FloatArray:
        """The middle of `ball`."""
        return np.array(self.ball()[0])

    @cached_property
    def _local(self) -> Any:
        """The surface about its middle: far from 0 its points have more digits there."""
        return self.surface.transformed(np.eye(4) - np.outer([*self.middle, 0.0], [0, 0, 0, 1.0]))

    @property
    def size(self) -> float:
        """The diameter of `ball`; -1 if the surface is unbounded."""
        size = self.ball()[1]
        return -1.0 if size is None else size


def judged_of(surface: Any) -> Judged:
    """Return what is known of a surface; raise TypeError if its class is not registered."""
    register = all_judged()
    # Derived classes are what they derive from.
    for surface_type in type(surface).__mro__:
        if surface_type in register:
            return register[surface_type](surface)
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )


@cache
def all_judged() -> dict[type[Surface], type[Judged]]:
    """Return all registered classes, after importing every module of `proof.surfaces`."""
    from proof import surfaces

    for module in pkgutil.iter_modules(surfaces.__path__, surfaces.__name__ + "."):
        importlib.import_module(module.name)
    return Judged.known


def fractions(values: Any) -> Any:
    """Return an array of floats as the fractions that they are."""
    as_fraction = np.frompyfunc(lambda x: Fraction(float(x)), 1, 1)
    return as_fraction(np.asarray(values, dtype=np.float64))


def double_double(values: Any) -> FloatArray:
    """Return fractions as sums of two float64, on a last axis."""
    flat = np.asarray(values, dtype=object).ravel()
    pairs = [(float(x), float(x - Fraction(float(x)))) for x in flat]
    return np.array(pairs).reshape(*np.shape(values), 2)


def scratch() -> first.Scratch:
    """Return working memory: room for the crossings of one ray."""
    return first.Scratch(np.zeros((3, 3)), np.zeros((first.MOST_CROSSINGS, first.CROSSING)))


def solver_scratch(degree: int) -> dict[str, FloatArray]:
    """Return working memory of `bernstein.solve`."""
    return {
        "nets": np.zeros((bernstein.DEPTH + 3, 2, degree + 1)),
        "radii": np.zeros(bernstein.DEPTH + 1),
        "spans": np.zeros((bernstein.DEPTH + 1, 2)),
        "roots": np.zeros((bernstein.ROOM, 6)),
        "unsure": np.zeros((bernstein.ROOM, 2)),
    }
