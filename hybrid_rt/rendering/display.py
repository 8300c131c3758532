"""How a result shows itself: on one line, as a picture, and in a notebook as a picture with its report."""

import base64
import html
import io
import math

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.one_line import cut
from hybrid_rt.rendering.report import Report
from hybrid_rt.rendering.summary import in_words, of_what, short_cautions
from hybrid_rt.rendering.units import passes_in_words, per_cent
from hybrid_rt.sensor.color import screen_pixels

# A notebook keeps the picture within its text: of larger ones it gets a smaller copy, pixels.
MOST_PIXELS = 1600
# What fits beside most notebooks' margins, and the width up to which small pictures are enlarged.
WIDEST, NARROWEST = 960, 320
# Columns of the labels in the report as text.
LABEL = 12


def one_line(image: NDArray[np.floating], report: Report) -> str:
    """Return size, integrator, passes, error and seconds of a result."""
    height, width = image.shape[:2]
    words = [f"{width} x {height}", report.settings.integrator, passes_in_words(report.passes)]
    words += [f"{report.total_seconds:.3g} s", _error(report)]
    return cut(f"RenderResult({', '.join(words)})", "...)")


def png(image: NDArray[np.floating]) -> bytes:
    """Return a linear picture (height, width, 3) as the bytes of a .png file, as `save` writes it."""
    import imageio.v3 as imageio

    file = io.BytesIO()
    imageio.imwrite(file, screen_pixels(image), extension=".png")
    return file.getvalue()


def as_html(image: NDArray[np.floating], report: Report) -> str:
    """Return the picture and its report for a notebook, in the colours of the page, be it light or dark."""
    data = base64.b64encode(png(reduced(image))).decode("ascii")
    name = html.escape(one_line(image, report))
    width = image.shape[1]
    shown, style = min(width, WIDEST), "max-width:100%;height:auto"
    if width < NARROWEST:
        shown = width * math.ceil(NARROWEST / width)
        style += ";image-rendering:pixelated"
    grid = "display:grid;grid-template-columns:max-content minmax(0,1fr);gap:0.1em 1em"
    cells = [_row(label, text) for label, text in labelled(in_words(report))]
    parts = [
        f'<img alt="{name}" width="{shown}" style="{style}" src="data:image/png;base64,{data}">',
        f'<div style="font-weight:bold;margin:0.5em 0">{name}</div>',
        f'<div style="{grid};font-size:90%">{"".join(cells)}</div>',
    ]
    return f'<div style="color:inherit;background:none;max-width:{WIDEST}px">{"".join(parts)}</div>'


def labelled(text: str) -> list[tuple[str, str]]:
    """Split a report as text into pairs: what a line is about, and what it says."""
    pairs: list[tuple[str, str]] = []
    for line in text.splitlines():
        label, words = line[:LABEL].strip(), line[LABEL:].strip()
        if label or not pairs:
            pairs.append((label, words))
        else:
            pairs[-1] = (pairs[-1][0], f"{pairs[-1][1]}\n{words}")
    return pairs


def reduced(image: NDArray[np.floating]) -> NDArray[np.floating]:
    """Return a picture of at most `MOST_PIXELS` along a side: means over squares of pixels."""
    step = math.ceil(max(image.shape[:2]) / MOST_PIXELS)
    if step == 1:
        return image
    for axis in (0, 1):
        first = np.arange(0, image.shape[axis], step)
        counts = np.diff(np.append(first, image.shape[axis]))
        shape = (-1, 1, 1) if axis == 0 else (1, -1, 1)
        image = np.add.reduceat(image, first, axis=axis, dtype=np.float64) / counts.reshape(shape)
    return image


def _row(label: str, text: str) -> str:
    weight = "bold" if label == "WARNING" else "normal"
    said = html.escape(text).replace("\n", "<br>")
    return (
        f'<div style="opacity:0.75">{html.escape(label)}</div>'
        f'<div style="font-weight:{weight};overflow-wrap:anywhere">{said}</div>'
    )


def _error(report: Report) -> str:
    error = report.relative_error
    if error is None or error.both is None or not math.isfinite(error.both):
        return "error unknown"
    cautions = short_cautions(report)
    said = f" ({'; '.join(cautions)})" if cautions else ""
    return f"error {per_cent(error.both)}{of_what(report)}{said}"
