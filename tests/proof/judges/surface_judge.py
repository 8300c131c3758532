"""The registry of judges: how hits on each class of surfaces are tested.

A new class of surfaces needs a class derived from `SurfaceJudge` in a module of
`proof.judges.surfaces`; it is found by itself.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from typing import Any, ClassVar, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray
from meshing.surface import Surface
from proof.by_class import entry_of, import_all
from proof.judges.kernels.events import Events

Worker: TypeAlias = Callable[[int, FloatArray, FloatArray, FloatArray, Events], None]
"""Notes the events of rays: from the number of the first, origins, directions, least t."""
# Numbers of mpmath, which has no types.
Number: TypeAlias = Any
Vector: TypeAlias = list[Any]
Solver: TypeAlias = Callable[[int, float, float, float, Vector, Vector], Number]
"""The t of the root near a hit: from patch, u, v, t, origin and direction."""


def about_origin(surface: Any) -> tuple[Surface, FloatArray]:
    """Return a surface shifted so that its attribute ``origin`` is at zero, and that origin."""
    origin = surface.origin
    return surface.transformed(np.eye(4) - np.outer([*origin, 0.0], [0, 0, 0, 1.0])), origin


def new_events(room: int) -> Events:
    """Return an empty list of events with room for so many."""
    return Events(
        count=np.zeros(1, np.int64),
        ray=np.empty(room, np.int64),
        t=np.empty(room),
        object_id=np.empty(room, np.int32),
        patch_id=np.empty(room, np.int32),
        u=np.empty(room),
        v=np.empty(room),
        cosine=np.empty(room),
        band=np.empty(room),
        kind=np.empty(room, np.uint8),
        at_edge=np.empty(room, np.uint8),
    )


def about_axis(surface: Any, points: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return u, distance from the axis and height of points about a surface's axis, each (n,)."""
    origin, axis, radial, binormal = surface.revolution_frame
    away = points - origin
    x, y, z = away @ radial, away @ binormal, away @ axis
    return np.arctan2(y, x) / (2.0 * np.pi) % 1.0, np.hypot(x, y), z


class SurfaceJudge(ABC):
    """The independent solvers of one surface; they share no code with the intersector.

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
        """Return the function that finds all roots of rays and near misses, for the oracle."""

    @abstractmethod
    def solver(self) -> Solver:
        """Return the function that finds the t of a hit to many digits (mpmath), to test bounds."""

    def locate(self, points: FloatArray) -> tuple[FloatArray, FloatArray] | None:
        """Return u and v of points (n, 3) of the surface; None: the events name theirs."""
        del points
        return None

    def gap(
        self,
        origins: FloatArray,
        along: FloatArray,
        u: FloatArray,
        v: FloatArray,
        patch_id: NDArray[Any],
    ) -> FloatArray:
        """Return the distances (n,) of the ray points ``origins + along`` from the hit points.

        Beyond its border the surface does not go on: hits there are measured from the border.
        """
        surface, middle = self.about_itself()
        u, v = self.within(u, v, patch_id)
        points = surface.point(u, v, patch_id)
        distance: FloatArray = np.linalg.norm(points - (origins - middle) - along, axis=1)
        return distance

    def within(
        self, u: FloatArray, v: FloatArray, patch_id: NDArray[Any]
    ) -> tuple[FloatArray, FloatArray]:
        """Return the parameters of hits, or those of a point of the border where they are beyond."""
        del patch_id
        return np.clip(u, 0.0, 1.0), np.clip(v, 0.0, 1.0)

    def about_itself(self) -> tuple[Surface, FloatArray]:
        """Return the surface moved to where its points round least, and from where (3,)."""
        return self.surface, np.zeros(3)


def judge_of(surface: Any) -> SurfaceJudge:
    """Return the judge of a surface.

    Raises
    ------
    TypeError
        If no judge is registered for its class.
    """
    return entry_of(surface, all_judges())(surface)


@cache
def all_judges() -> dict[type[Surface], type[SurfaceJudge]]:
    """Import all judges; return them by class of surface."""
    from proof.judges import surfaces

    import_all(surfaces)
    return SurfaceJudge.judges
