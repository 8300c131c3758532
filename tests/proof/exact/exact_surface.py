"""The registry of the exact oracle: how it finds crossings with each class of surfaces.

A new class of surfaces needs a class derived from `ExactSurface` in a module of
`proof.exact.surfaces`; it is found by itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, TypeAlias

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing.surface import Surface
from proof.by_class import entry_of, import_all
from proof.exact.crossings import Crosser

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

    Parameters
    ----------
    surface : Surface
        Of the class that the oracle is ``of``.
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


def exact_of(surface: Any) -> ExactSurface:
    """Return the exact surface of a surface.

    Raises
    ------
    TypeError
        If its class is not registered.
    """
    return entry_of(surface, all_known())(surface)


@cache
def all_known() -> dict[type[Surface], type[ExactSurface]]:
    """Import all exact surfaces; return them by class of surface."""
    from proof.exact import surfaces

    import_all(surfaces)
    return ExactSurface.known
