"""Rays behind a lens, and what becomes of each."""

from __future__ import annotations

import os
import warnings
from dataclasses import dataclass, fields
from enum import IntEnum

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.hit_table import to_csv
from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, IntArray, selected
from hybrid_rt.intersection import Intersector
from hybrid_rt.primitives.asphere import Asphere
from meshing.checks import as_floats, units

# Surfaces nearer to each other than this, over the size of coordinates, touch: rounding moves a point by
# less.
TOUCHING = 1e-12


class Fate(IntEnum):
    """What becomes of a ray at a lens.

    PASSED: it gets through. OUTSIDE: it meets a surface nowhere within the aperture. TOTAL_REFLECTION: it is
    totally reflected at a surface. BEHIND: a surface lies behind it, or is met from behind, as where
    two surfaces cross because the thickness at the edge is negative.
    """

    PASSED = 0
    OUTSIDE = 1
    TOTAL_REFLECTION = 2
    BEHIND = 3


@dataclass(frozen=True)
class Traced:
    """Rays behind the last surface of a lens. It has a length, and ``rays[rows]`` selects some.

    (For points and normals at each surface, follow the rays by an `Intersector` of `Lens.surfaces`, one
    after the other, and `hybrid_rt.refract`.)

    Attributes
    ----------
    position, direction : (n, 3) float64
        The point on the last surface, and the unit direction behind it; nan if a ray does not get
        through.
    passed : (n,) bool
        Whether a ray gets through.
    path : (n,) float64
        Optical path length from the origin of the ray to the last surface: lengths times indices.
    t_bound : (n,) float64
        The largest bound on the error of any hit of the ray, given the ray that arrives there; the
        bounds of several surfaces are not added up. nan if a ray does not get through.
    stopped_at : (n,) int32
        The line of the prescription, from 0, whose surface a ray misses or is totally reflected at;
        -1 if it gets through.
    fate : (n,) int32
        Why: see `Fate`.
    origins : (n, 3) float64
        Where the rays start, also lost ones. Those of `Lens.parallel` lie in a plane across the light in
        front of the lens.
    transmittance : (n,) float64
        The part of a ray's power that no surface reflects: uncoated glass that does not absorb, and light
        that is unpolarised at each surface (see `hybrid_rt.reflectance`). nan if a ray does not get through.
    """

    position: FloatArray
    direction: FloatArray
    passed: BoolArray
    path: FloatArray
    t_bound: FloatArray
    stopped_at: IntArray
    fate: IntArray
    origins: FloatArray
    transmittance: FloatArray

    def __len__(self) -> int:
        """Return the number of rays."""
        return len(self.passed)

    def __getitem__(self, rows: object) -> Traced:
        """Select rays by a mask, an index array or a slice; one integer gives one ray."""
        return Traced(*selected(self, rows))

    def at(self, z: float) -> FloatArray:
        """Return the points (n, 2) at which the rays meet the plane across the axis at z."""
        way = (z - self.position[:, 2]) / self.direction[:, 2]
        return self.position[:, :2] + way[:, None] * self.direction[:, :2]

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write one row per ray as comma-separated text, UTF-8, with a header line.

        The columns are passed (1 or 0), ox, oy, oz (the origin), x, y, z, dx, dy, dz, path, t_bound,
        stopped_at, fate and transmittance. Numbers are written so that they are read back bit for bit; nan where a
        ray does not get through. An existing file is replaced.

        Raises
        ------
        TypeError, OSError
            If ``path`` is not a path, or cannot be written.
        """
        columns = {
            "passed": self.passed.astype(np.uint8),
            **dict(zip(("ox", "oy", "oz"), self.origins.T, strict=True)),
            **dict(zip(("x", "y", "z"), self.position.T, strict=True)),
            **dict(zip(("dx", "dy", "dz"), self.direction.T, strict=True)),
            "path": self.path,
            "t_bound": self.t_bound,
            "stopped_at": self.stopped_at,
            "fate": self.fate,
            "transmittance": self.transmittance,
        }
        to_csv(columns, path, "Traced.to_csv path")

    def __repr__(self) -> str:
        """Return how many rays there are, and how many got through."""
        return f"Traced({len(self)} rays, {int(self.passed.sum())} passed)"


def checked_rays(origins: ArrayLike, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return as many origins as unit directions, (n, 3) each."""
    o, d = as_floats(origins, "Lens.trace origins"), as_floats(directions, "Lens.trace directions")
    for name, array in (("origins", o), ("directions", d)):
        if array.ndim not in (1, 2) or array.shape[-1] != 3:
            raise ValueError(
                f"Lens.trace {name} has shape {array.shape}: pass (n, 3) or one vector (3,)"
            )
        bad = np.flatnonzero(~np.isfinite(np.atleast_2d(array)).all(axis=1))
        if bad.size:
            raise ValueError(
                f"Lens.trace {name}[{bad[0]}] is not finite ({bad.size} such ray(s)): leave such rays out"
            )
    o, d = np.atleast_2d(o), np.atleast_2d(d)
    if len(o) != len(d) and 1 not in (len(o), len(d)):
        raise ValueError(
            f"Lens.trace got {len(o)} origins and {len(d)} directions: pass as many of each, or one"
        )
    zero = np.flatnonzero(~d.any(axis=1))
    if zero.size:
        raise ValueError(
            f"Lens.trace directions[{zero[0]}] has length zero ({zero.size} such ray(s)): leave such rays out"
        )
    o, d = np.broadcast_arrays(o, units(d))
    return o.copy(), d.copy()


def hits_from(
    tracer: Intersector, surface: Asphere, o: FloatArray, d: FloatArray
) -> tuple[HitRecord, FloatArray]:
    """Return the hits of rays on one surface and their t; rays may start on it, but for rounding."""
    hits: HitRecord = tracer.intersect(o, d)
    t = hits.t.copy()
    missed = np.flatnonzero(~(hits.hit & hits.front_face))
    if missed.size:
        step = TOUCHING * (np.abs(surface.bounds).max() + np.abs(o[missed]).max(axis=1))
        again = tracer.intersect(o[missed] - step[:, None] * d[missed], d[missed])
        near = again.hit & again.front_face & (again.t <= 2.0 * step)
        rows, again = missed[near], again[near]
        for column in fields(HitRecord):
            getattr(hits, column.name)[rows] = getattr(again, column.name)
        t[rows] = again.t - step[near]
    return hits, t


def warn_of_crossing(rays: Traced, stacklevel: int) -> None:
    """Warn of rays for which two surfaces of a lens cross."""
    behind = rays.stopped_at[(rays.fate == Fate.BEHIND) & (rays.stopped_at > 0)]
    if len(behind):
        warnings.warn(
            f"Lens: {len(behind)} of {len(rays)} rays meet the surface of prescription[{behind.min()}] "
            "from behind, and count as lost: is the lens thick enough at its edge?",
            stacklevel=stacklevel,
        )
