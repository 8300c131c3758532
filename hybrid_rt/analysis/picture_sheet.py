"""Sheets of pictures: a caption above each, as long as it needs, and a scale of colours below."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import FloatArray

Pixels = NDArray[np.uint8]

# Relative errors shown from the darkest colour to the brightest, and colours between.
LEAST_SHOWN, MOST_SHOWN = 1e-3, 1.0
_COLORS = np.array([
    (0, 0, 4), (33, 12, 74), (87, 16, 110), (138, 34, 106), (188, 55, 84), (228, 90, 49),
    (249, 142, 9), (249, 203, 53), (252, 255, 164),
], dtype=np.float64)  # fmt: skip
SCALE_WORDS = ((1e-3, "0.1 % and below"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 % and above"))

# Pixels: between pictures and around the sheet; letters and lines; the scale's bar.
GAP, MARGIN, LETTERS, LINE, BAR = 12, 12, 15, 20, 16
# Narrower pictures are enlarged by a whole number: captions need room.
LEAST_WIDTH = 320


def error_colors(relative: FloatArray) -> Pixels:
    """Map relative errors of any shape to colours, on a logarithmic scale from 0.001 to 1."""
    decades = math.log10(MOST_SHOWN / LEAST_SHOWN)
    level = np.log10(np.clip(relative, LEAST_SHOWN, MOST_SHOWN) / LEAST_SHOWN) / decades
    places = np.linspace(0.0, 1.0, len(_COLORS))
    channels = [np.interp(level, places, _COLORS[:, c]) for c in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def sheet(
    panels: Sequence[tuple[str, Pixels]],
    columns: int,
    *,
    title: str = "",
    scale: str = "",
    least_width: int = LEAST_WIDTH,
) -> Pixels:
    """Join pictures (height, width, 3) row by row, each with its caption above it.

    ``scale`` says what the colours of `error_colors` show; "": no scale. Pictures narrower than ``least_width``
    are enlarged by a whole number.
    """
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(LETTERS)
    height, width, _ = panels[0][1].shape
    factor = max(-(-least_width // width), 1)
    height, width = height * factor, width * factor
    columns = min(columns, len(panels))
    rows = -(-len(panels) // columns)
    captions = [_wrapped(caption, width, font) for caption, _ in panels]
    total = columns * width + (columns - 1) * GAP
    titles = _wrapped(title, total, font) if title else []
    lines = [max(len(c) for c in captions[r * columns : (r + 1) * columns]) for r in range(rows)]
    top = MARGIN + len(titles) * LINE + (GAP if titles else 0)
    tall = top + sum(n * LINE + height + GAP for n in lines)
    scale_lines = _wrapped(scale, total, font) if scale else []
    tall += len(scale_lines) * LINE + BAR + LINE + GAP if scale else 0
    drawn = Image.new("RGB", (total + 2 * MARGIN, tall), "white")
    draw = ImageDraw.Draw(drawn)
    draw.multiline_text((MARGIN, MARGIN), "\n".join(titles), "black", font, spacing=LINE - LETTERS)
    y = top
    for row in range(rows):
        for column in range(columns):
            k = row * columns + column
            if k == len(panels):
                break
            x = MARGIN + column * (width + GAP)
            text = "\n".join(captions[k])
            above = y + (lines[row] - len(captions[k])) * LINE
            draw.multiline_text((x, above), text, "black", font, spacing=LINE - LETTERS)
            large = panels[k][1].repeat(factor, axis=0).repeat(factor, axis=1)
            drawn.paste(Image.fromarray(large), (x, y + lines[row] * LINE))
        y += lines[row] * LINE + height + GAP
    if scale:
        draw.multiline_text((MARGIN, y), "\n".join(scale_lines), "black", font, spacing=5)
        _draw_scale(drawn, draw, font, y + len(scale_lines) * LINE)
    return np.asarray(drawn)


def _draw_scale(drawn: Any, draw: Any, font: Any, y: int) -> None:
    from PIL import Image

    width = min(drawn.width - 2 * MARGIN, 2 * LEAST_WIDTH)
    shares = np.logspace(math.log10(LEAST_SHOWN), math.log10(MOST_SHOWN), width)
    bar = np.broadcast_to(error_colors(shares), (BAR, width, 3))
    drawn.paste(Image.fromarray(np.ascontiguousarray(bar)), (MARGIN, y))
    decades = math.log10(MOST_SHOWN / LEAST_SHOWN)
    for share, words in SCALE_WORDS:
        place = math.log10(share / LEAST_SHOWN) / decades
        x = MARGIN + place * (width - font.getlength(words))
        draw.text((x, y + BAR + 1), words, "black", font)


def _wrapped(text: str, width: int, font: Any) -> list[str]:
    """Break a text into lines that fit, within words if there is no other way."""
    lines = [""]
    for word in text.split():
        longer = f"{lines[-1]} {word}".strip()
        if font.getlength(longer) <= width:
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for letter in word:
            if font.getlength(lines[-1] + letter) > width:
                lines.append("")
            lines[-1] += letter
    return lines
