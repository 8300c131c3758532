"""Reading OpenEXR files, by the package OpenEXR of the extra ``exr``."""

from pathlib import Path
from typing import Any

from numpy.typing import NDArray

NEEDED = "EXR needs the package OpenEXR: pip install 'hybrid-rt[exr]'"


def read_exr(file: Path) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Return the channels (height, width) of a file by name, and its header."""
    import OpenEXR

    with OpenEXR.File(str(file), separate_channels=True) as opened:
        planes = {name: channel.pixels for name, channel in opened.channels().items()}
        # A copy, as the header is emptied when the file is closed.
        return planes, dict(opened.header())
