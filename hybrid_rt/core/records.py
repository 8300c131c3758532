"""Hit records and their status. Data only.

A batch has its ray axis first. Every array is float64 unless its line says otherwise.
"""

from __future__ import annotations

import os
from dataclasses import dataclass, fields
from enum import IntEnum, IntFlag
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int32]
BoolArray = NDArray[np.bool_]


def selected(record: Any, rows: object) -> list[NDArray[Any]]:
    """Return the columns of a record, each at some rows: a mask, an index array, a slice or one integer."""
    if isinstance(rows, int | np.integer):
        rows = [rows]
    return [getattr(record, field.name)[rows] for field in fields(record)]


class Status(IntEnum):
    """Outcome of a ray: MISS, HIT or TANGENT.

    TANGENT is a hit or a miss, as ``hit`` says, that rounding decides: moving the ray by 64 eps x
    scale may change the answer, or ``t_bound`` of a root reaches across t_min or t_max. Scale is the
    distance of the ray's origin from the middle of the surface, or the size of the surface if that is
    larger; for 100 mm the band is 1.4e-12 mm. By how much rounding has moved an image by ``transformed``
    is added.
    """

    MISS = 0
    HIT = 1
    TANGENT = 2


class Flag(IntFlag):
    """Further properties of a hit, which may be combined.

    NORMAL_DEGENERATE: S_u x S_v vanishes here, and the normal is its limit from inside the patch.
    EDGE: within the ``gap`` of an edge of a `TrimmedSurface`, so a neighbouring face may be meant;
    never set where the gap is 0.
    """

    NONE = 0
    NORMAL_DEGENERATE = 1
    EDGE = 2


@dataclass(frozen=True)
class HitRecord:
    """First hits, one row per ray, in the order of the rays.

    Attributes
    ----------
    t : (n,) float64
        Distance in lengths of the given direction; inf on a miss.
    object_id : (n,) int32
        Index in the sequence of surfaces; -1 on a miss.
    patch_id : (n,) int32
        Index of the patch, profile segment, face of a mesh (in input order) or face of a box;
        otherwise 0.
    u, v : (n,) float64
        Surface parameters; nan on a miss. No bound is stated on them, nor on what is computed from
        them: position and normal.
    position : (n, 3) float64
        The point of the surface at (u, v), scene units, world frame; nan on a miss.
    normal : (n, 3) float64
        Unit normal along S_u x S_v, finite also at poles and collapsed edges; nan on a miss.
    front_face : (n,) bool
        Whether the ray came from the side to which the normal points.
    status : (n,) uint8
        `Status` of the row.
    flags : (n,) uint8
        `Flag` of the row.
    t_bound : (n,) float64
        Proven bound on ``|t - exact t|``, in the unit of t; inf where nothing is proven (accuracy
        "mesh"). On rows of status TANGENT it holds if the exact ray meets the surface there: it may
        pass by, and meet another place first.
    residual : (n,) float64
        ``|S(u, v) - (o + t d)|`` in scene units; nan on a miss.
    instance_id : (n,) int32
        Row of the place that was hit of `Instances`; -1 on a miss and on other surfaces.
    """

    t: FloatArray
    object_id: IntArray
    patch_id: IntArray
    u: FloatArray
    v: FloatArray
    position: FloatArray
    normal: FloatArray
    front_face: BoolArray
    status: NDArray[np.uint8]
    flags: NDArray[np.uint8]
    t_bound: FloatArray
    residual: FloatArray
    instance_id: IntArray

    def __len__(self) -> int:
        """Return the number of rays."""
        return int(self.t.size)

    def __getitem__(self, rows: object) -> HitRecord:
        """Select rows by a mask, an index array or a slice; one integer gives a record of one."""
        return HitRecord(*selected(self, rows))

    def __repr__(self) -> str:
        """Count rays, hits and statuses; name the range of t and the largest bound of hits."""
        n = len(self)
        counts = [f"{np.count_nonzero(self.status == s):,} {s.name}" for s in Status]
        line = f"HitRecord({n:,} ray{'' if n == 1 else 's'}, {int(self.hit.sum()):,} hit: "
        line += ", ".join(text for text in counts if not text.startswith("0 "))
        if not self.hit.any():
            return line.removesuffix(": ") + ")"
        t, bound = self.t[self.hit], self.t_bound[self.hit].max()
        return f"{line}; t {t.min():.4g} to {t.max():.4g}, t_bound up to {bound:.2g})"

    @property
    def hit(self) -> BoolArray:
        """(n,) bool: the rays that found a surface."""
        return self.object_id >= 0

    def to_dataframe(self) -> Any:
        """Return a pandas.DataFrame of n rows, one column per number.

        Columns: t, object_id, patch_id, u, v, x, y, z (position), nx, ny, nz (normal), front_face,
        status (MISS, HIT, TANGENT), normal_degenerate, edge (the flags, as bools), t_bound,
        residual, instance_id. Lengths are in scene units; t and t_bound are in lengths of each ray's direction.

        Raises
        ------
        ImportError
            If pandas is not installed.
        """
        from hybrid_rt.core.hit_table import to_dataframe

        return to_dataframe(self.columns(), "HitRecord.to_dataframe")

    def to_csv(self, path: str | os.PathLike[str]) -> None:
        """Write the columns of `to_dataframe` as comma-separated text, UTF-8, with a header line.

        Numbers are written so that they are read back bit for bit. On a miss t is inf and the other
        floats are nan. An existing file is replaced.

        Parameters
        ----------
        path : str or path

        Raises
        ------
        TypeError, OSError
            If ``path`` is not a path, or cannot be written.
        """
        from hybrid_rt.core.hit_table import to_csv

        to_csv(self.columns(), path, "HitRecord.to_csv path")

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return the columns of `to_dataframe` by name, each (n,), in order."""
        names = np.array([status.name for status in Status])
        return {
            "t": self.t,
            "object_id": self.object_id,
            "patch_id": self.patch_id,
            "u": self.u,
            "v": self.v,
            **dict(zip(("x", "y", "z"), self.position.T, strict=True)),
            **dict(zip(("nx", "ny", "nz"), self.normal.T, strict=True)),
            "front_face": self.front_face,
            "status": names[self.status],
            "normal_degenerate": (self.flags & Flag.NORMAL_DEGENERATE) != 0,
            "edge": (self.flags & Flag.EDGE) != 0,
            "t_bound": self.t_bound,
            "residual": self.residual,
            "instance_id": self.instance_id,
        }


@dataclass(frozen=True)
class NamedPoints:
    """Points that rays leave from or go to: the part of a `HitRecord` needed for that.

    Attributes
    ----------
    object_id : (n,) int32
        -1: none.
    position : (n, 3) float64
    """

    object_id: IntArray
    position: FloatArray

    def __len__(self) -> int:
        """Return the number of rays."""
        return int(self.object_id.size)
