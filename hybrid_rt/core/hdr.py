"""Reading Radiance pictures (.hdr, .pic): shared exponents, RGBE.

Ward, "Real pixels", Graphics Gems II, 1991; the layout is that of the Radiance File Formats (1997).
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

# Widths of scanlines whose four components are coded one after the other.
FEWEST_CODED, MOST_CODED = 8, 32767
RUN = 128
# The exponent of a pixel is stored with this added; the components are 256ths.
EXPONENT, BITS = 128, 8


def read_hdr(file: Path) -> NDArray[np.float32]:
    """Return linear radiance (height, width, 3), row 0 at the top; raise ValueError if that is not in the file."""
    data = file.read_bytes()
    header, end, rest = data.partition(b"\n\n")
    if header[:2] != b"#?" or not end:
        raise ValueError("it does not begin as a Radiance picture does")
    if re.search(rb"^FORMAT=32-bit_rle_xyze", header, re.MULTILINE):
        raise ValueError("it holds XYZ: convert it to RGB")
    line, _, body = rest.partition(b"\n")
    size = re.fullmatch(rb"([-+])Y (\d{1,6}) \+X (\d{1,6})\s*", line)
    if size is None:
        raise ValueError(f"its size is {line[:40]!r}, not as '-Y height +X width'")
    height, width = int(size[2]), int(size[3])
    pixels = np.empty((height, width, 4), dtype=np.uint8)
    place = 0
    for row in pixels:
        place = _read_row(body, place, row)
    exponent = pixels[:, :, 3:].astype(np.int32)
    scale = np.where(exponent > 0, np.ldexp(1.0, exponent - (EXPONENT + BITS)), 0.0)
    # What the picture has been multiplied by, as several programs may have noted.
    for exposure in re.findall(rb"^EXPOSURE=\s*([-+.\deE]+)", header, re.MULTILINE):
        scale = scale / float(exposure)
    image = (pixels[:, :, :3] * scale).astype(np.float32)
    return image if size[1] == b"-" else image[::-1]


def _read_row(body: bytes, place: int, row: NDArray[np.uint8]) -> int:
    """Read the pixels (width, 4) of a scanline from a place on; return where the next one begins."""
    width = len(row)
    start = body[place : place + 4]
    is_coded = start[:2] == b"\x02\x02" and len(start) == 4 and start[2] < RUN
    if is_coded and FEWEST_CODED <= width <= MOST_CODED:
        if 256 * start[2] + start[3] != width:
            raise ValueError("a scanline has another width than the picture")
        place += 4
        for component in range(4):
            place = _read_runs(body, place, row[:, component])
        return place
    done, shift = 0, 0
    while done < width:
        pixel = body[place : place + 4]
        if len(pixel) < 4:
            raise ValueError("it is cut off")
        place += 4
        if pixel[:3] == b"\x01\x01\x01":  # the older code: so many times the pixel before
            count = pixel[3] << shift
            if done == 0 or done + count > width:
                raise ValueError("a run is longer than its scanline")
            row[done : done + count] = row[done - 1]
            done, shift = done + count, shift + 8
        else:
            row[done] = list(pixel)
            done, shift = done + 1, 0
    return place


def _read_runs(body: bytes, place: int, values: NDArray[np.uint8]) -> int:
    """Read one component of a scanline: runs of one value, and stretches of several."""
    done = 0
    while done < values.size:
        if place + 1 >= len(body):
            raise ValueError("it is cut off")
        count = body[place]
        is_run = count > RUN
        count -= RUN if is_run else 0
        found = body[place + 1 : place + 2 + (0 if is_run else count - 1)]
        if count == 0 or done + count > values.size or len(found) < (1 if is_run else count):
            raise ValueError("it is cut off, or a run is longer than its scanline")
        values[done : done + count] = np.frombuffer(found, dtype=np.uint8)
        place, done = place + 1 + len(found), done + count
    return place
