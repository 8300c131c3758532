"""How hits on each class of surfaces are judged: the one table that all judges ask.

A new class of surfaces needs a class derived from `SurfaceJudge` in a module of the room
`hybrid_rt.verify.judges.surfaces`; nothing else here is told of it.
"""

from __future__ import annotations

import importlib
import pkgutil
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from hybrid_rt.verify.judges.kernels.events import Events
from meshing.surface import Surface

Worker: TypeAlias = Callable[[int, FloatArray, FloatArray, FloatArray, Events], None]
"""Notes the events of rays: from the number of the first, origins, directions, least t."""
# Numbers of mpmath, which has no types.
Number: TypeAlias = Any
Vector: TypeAlias = list[Any]
Solver: TypeAlias = Callable[[int, float, float, float, Vector, Vector], Number]
"""The t of the root near a hit: from patch, u, v, t, origin and direction."""


class SurfaceJudge(ABC):
    """What is known of one surface, sharing no code with what finds the hits.

    Parameters
    ----------
    surface : Surface
        Of the class that the judge is ``of``.
    """

    judges: ClassVar[dict[type[Surface], type[SurfaceJudge]]] = {}
    examples: ClassVar[dict[str, Callable[[], list[Any]]]] = {}
    """Surfaces of the class by which campaigns judge it, by the name of their scene."""

    def __init_subclass__(cls, *, of: type[Surface], **options: Any) -> None:
        """Register a judge by the class of surfaces that it is ``of``."""
        super().__init_subclass__(**options)
        SurfaceJudge.judges[of] = cls

    def __init__(self, surface: Any) -> None:
        self.surface = surface

    @abstractmethod
    def worker(self, object_id: int) -> Worker:
        """Return what notes all roots of rays, and what rounding could make one (the oracle)."""

    @abstractmethod
    def solver(self) -> Solver:
        """Return what finds the t of a hit to many digits by mpmath (judges bounds of t)."""

    def gap(
        self,
        origins: FloatArray,
        along: FloatArray,
        u: FloatArray,
        v: FloatArray,
        patch_id: NDArray[Any],
    ) -> FloatArray:
        """Return how far the points ``origins + along`` of rays lie from those of their hits, (n,)."""
        points = self.surface.point(u, v, patch_id)
        distance: FloatArray = np.linalg.norm(points - origins - along, axis=1)
        return distance


def judge_of(surface: Any) -> SurfaceJudge:
    """Return the judge of a surface.

    Raises
    ------
    TypeError
        If nobody judges its class.
    """
    judges = all_judges()
    for surface_type in type(surface).__mro__:
        if surface_type in judges:
            return judges[surface_type](surface)
    raise TypeError(
        f"surface is a {type(surface).__name__}: pass one of meshing or hybrid_rt.primitives"
    )


@cache
def all_judges() -> dict[type[Surface], type[SurfaceJudge]]:
    """Return the judges by classes of surfaces: every module of the room is imported."""
    from hybrid_rt.verify.judges import surfaces

    for module in pkgutil.iter_modules(surfaces.__path__, surfaces.__name__ + "."):
        importlib.import_module(module.name)
    return SurfaceJudge.judges
