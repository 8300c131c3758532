"""Hit records as tables: a DataFrame of pandas, or comma-separated text."""

import os
from collections.abc import Mapping
from typing import Any

from numpy.typing import NDArray

from meshing.checks import as_path
from meshing.outputs import replacing

Columns = Mapping[str, NDArray[Any]]

# Rows that are put into words at a time.
ROWS = 65536
UNITS = "lengths in scene units; t and t_bound in lengths of each ray's direction"


def to_dataframe(columns: Columns, what: str) -> Any:
    """Return columns (n,) as a pandas.DataFrame; ``what`` names the method that was called."""
    try:
        import pandas as pd
    except ImportError:
        raise ImportError(
            f"{what} needs pandas: pip install 'hybrid-rt[dataframe]', or use .to_csv"
        ) from None
    frame = pd.DataFrame(dict(columns))
    frame.attrs["units"] = UNITS
    return frame


def to_csv(columns: Columns, path: str | os.PathLike[str], what: str) -> None:
    """Write columns (n,) as comma-separated text; see `HitRecord.to_csv`; ``what`` names the path."""
    with replacing(as_path(path, what)) as out:
        out.write(f"{','.join(columns)}\n".encode())
        for begin in range(0, len(next(iter(columns.values()))), ROWS):
            words = [map(str, column[begin : begin + ROWS].tolist()) for column in columns.values()]
            out.writelines(f"{','.join(row)}\n".encode() for row in zip(*words, strict=True))
