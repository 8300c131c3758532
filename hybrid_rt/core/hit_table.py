"""Hit records as tables: a DataFrame of pandas, or comma-separated text."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from meshing.checks import as_path

if TYPE_CHECKING:
    from hybrid_rt.core.records import HitRecord

# Rows that are put into words at a time.
ROWS = 65536
UNITS = "lengths in scene units; t and t_bound in lengths of each ray's direction"


def columns_of(hits: HitRecord) -> dict[str, Any]:
    """Return the columns of a table, each (n,), in order."""
    from hybrid_rt.core.records import Status

    names = np.array([status.name for status in Status])
    return {
        "t": hits.t,
        "object_id": hits.object_id,
        "patch_id": hits.patch_id,
        "u": hits.u,
        "v": hits.v,
        **dict(zip(("x", "y", "z"), hits.position.T, strict=True)),
        **dict(zip(("nx", "ny", "nz"), hits.normal.T, strict=True)),
        "front_face": hits.front_face,
        "status": names[hits.status],
        "flags": hits.flags,
        "t_bound": hits.t_bound,
        "residual": hits.residual,
    }


def to_dataframe(hits: HitRecord) -> Any:
    """Return hits as a pandas.DataFrame; see `HitRecord.to_dataframe`."""
    try:
        import pandas as pd
    except ImportError:
        raise ImportError(
            "HitRecord.to_dataframe needs pandas: pip install 'hybrid-rt[dataframe]', or use .to_csv"
        ) from None
    frame = pd.DataFrame(columns_of(hits))
    frame.attrs["units"] = UNITS
    return frame


def to_csv(hits: HitRecord, path: str | os.PathLike[str]) -> None:
    """Write hits as comma-separated text; see `HitRecord.to_csv`."""
    file = as_path(path, "HitRecord.to_csv path")
    columns = columns_of(hits)
    with file.open("w", encoding="utf-8", newline="\n") as out:
        out.write(",".join(columns) + "\n")
        for begin in range(0, len(hits), ROWS):
            words = [map(str, column[begin : begin + ROWS].tolist()) for column in columns.values()]
            out.writelines(",".join(row) + "\n" for row in zip(*words, strict=True))
