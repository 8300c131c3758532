"""A self-contained HTML page of a study: the answer, how it was measured, diagrams, tables, pictures."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

from hybrid_rt.analysis.diagrams import NARROW, Diagram, as_svg
from hybrid_rt.analysis.picture_comparison import error_map
from hybrid_rt.analysis.picture_sheet import Pixels, error_colors
from hybrid_rt.analysis.reference import Image
from hybrid_rt.analysis.tables import Table
from hybrid_rt.analysis.units import percent, signed_percent
from hybrid_rt.sensor.color import screen_pixels
from hybrid_rt.sensor.image_metrics import picture_errors

_STYLE = """
body { font: 16px/1.5 sans-serif; max-width: 1080px; margin: 1.5em auto; padding: 0 1em; color: #222; }
h1 { font-size: clamp(20px, 3vw, 28px); line-height: 1.2; overflow-wrap: anywhere; }
h2 { margin: 2em 0 0.4em; font-size: 20px; }
.asked { color: #555; margin: 0; }
.answer { font-size: clamp(20px, 3.2vw, 32px); font-weight: bold; line-height: 1.25; margin: 0.3em 0; }
pre { background: #f2f2f2; padding: 0.7em; white-space: pre-wrap; overflow-wrap: anywhere; }
pre span { display: inline-block; max-width: 100%; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
td, th { padding: 3px 9px; text-align: right; border-bottom: 1px solid #ddd; vertical-align: top; }
.scroll td, th { white-space: nowrap; }
td:first-child, th:first-child { text-align: left; white-space: nowrap; }
.measured td { text-align: left; overflow-wrap: anywhere; }
.words { font-size: 13px; color: #555; margin: 0.3em 0; max-width: 80em; }
figure { margin: 0.5em 0; }
figcaption { font-size: 14px; color: #444; overflow-wrap: anywhere; }
img.diagram { width: 100%; max-width: 860px; height: auto; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 300px), 480px)); gap: 8px; }
.pair img { width: 100%; image-rendering: pixelated; }
.scale { width: min(100%, 480px); height: 18px; }
.ticks { display: flex; justify-content: space-between; width: min(100%, 480px); font-size: 13px; }
"""

READ = (
    (
        "The error of a picture is its relative RMSE against the reference: the root of the mean of "
        "(x - r)^2 / (r^2 + 0.01) over pixels and channels. At 10 % noise is plainly seen, at 1 % hardly."
    ),
    (
        "A pass is one sample for every pixel. More passes make the noise smaller: four times the passes, "
        "half the noise. What passes do not make smaller is called bias here: light that a method does not "
        "find, triangles in place of curved surfaces, blur that stays."
    ),
    (
        "certified: the first hit of every ray is proven. refined: hits on triangles, moved onto the curved "
        "surface by Newton's iteration, without proof. mesh: hits on triangles alone, the number after it "
        "is their tolerance."
    ),
)


@dataclass
class Study:
    """What a page shows."""

    title: str
    asked: str = ""
    answer: str = ""  # shown large
    command: str = ""
    details: list[str] = field(default_factory=list)  # sentences below the answer
    findings: list[str] = field(default_factory=list)  # further ones
    measured: list[tuple[str, str]] = field(default_factory=list)  # names and values
    diagrams: list[Diagram] = field(default_factory=list)
    tables: list[Table] = field(default_factory=list)
    images: Mapping[str, Image] = field(default_factory=dict)  # with error maps


def page(study: Study) -> str:
    """Return the HTML page."""
    title = escape(study.title)
    parts = [
        '<!doctype html><html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{title}</title><style>{_STYLE}</style></head><body>",
        f"<h1>{title}</h1>",
        f'<p class="asked">{escape(study.asked)}</p>',
        f'<p class="answer">{escape(study.answer)}</p>',
    ]
    if study.command:
        # An option is not broken at its hyphens.
        words = " ".join(f"<span>{escape(word)}</span>" for word in study.command.split(" "))
        parts.append(f"<pre>{words}</pre>")
    parts += [_list(study.details), "<h2>How this was measured</h2>"]
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(value)}</td></tr>"
        for name, value in study.measured
    )
    parts += [
        f'<table class="measured">{rows}</table>',
        "<h2>How to read this page</h2>",
        _list(READ),
    ]
    if study.findings:
        parts += ["<h2>What else was found</h2>", _list(study.findings)]
    parts += map(_diagram, study.diagrams)
    parts += map(_table, study.tables)
    if study.images:
        parts += _pictures(study.images)
    parts.append("</body></html>")
    return "\n".join(parts)


def _list(sentences: Sequence[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(text)}</li>" for text in sentences) + "</ul>"


def _table(table: Table) -> str:
    first = "".join(f"<th>{escape(word)}</th>" for word in table.head)
    others = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in table.rows
    )
    words = "".join(f'<p class="words">{escape(text)}</p>' for text in table.words)
    return (
        f'<h2>{escape(table.title)}</h2><div class="scroll"><table><tr>{first}</tr>{others}</table>'
        f"</div>{words}"
    )


def _pictures(images: Mapping[str, Image]) -> list[str]:
    reference = images["reference"]
    parts = [
        "<h2>Pictures, and where they are off</h2>",
        "<p>Left the picture after its most passes, right the relative error of every pixel:</p>",
        _colour_scale(),
        '<div class="pair">',
        _figure(_png(screen_pixels(reference)), "reference"),
        "</div>",
    ]
    for name, image in images.items():
        if name == "reference":
            continue
        errors = picture_errors(image, reference)
        caption = (
            f"off by {percent(errors.relative_rmse)}, {percent(errors.relative_rmse_of_most)} without "
            f"the worst 0.1 % of the pixels; mean off by {signed_percent(errors.relative_mean_error)}"
        )
        parts.append('<div class="pair">')
        parts.append(_figure(_png(screen_pixels(image)), name))
        parts.append(_figure(_png(error_map(image, reference)), f"{name}: {caption}"))
        parts.append("</div>")
    return parts


def _colour_scale() -> str:
    stops = [10.0 ** (-3.0 + 0.375 * k) for k in range(9)]
    colors = ", ".join("rgb({}, {}, {})".format(*color) for color in error_colors(np.array(stops)))
    return (
        f'<div class="scale" style="background: linear-gradient(to right, {colors})"></div>'
        '<div class="ticks"><span>0.1 % and below</span><span>1 %</span><span>10 %</span>'
        "<span>100 % and above</span></div>"
    )


def _figure(uri: str, caption: str) -> str:
    text = escape(caption)
    return f'<figure><img src="{uri}" alt="{text}"><figcaption>{text}</figcaption></figure>'


def _diagram(diagram: Diagram) -> str:
    wide, narrow = (
        _uri("image/svg+xml", svg.encode()) for svg in (as_svg(diagram), as_svg(diagram, NARROW))
    )
    title = escape(diagram.title)
    return (
        f'<h2>{title}</h2><figure><picture><source media="(max-width: 640px)" srcset="{narrow}">'
        f'<img class="diagram" alt="{title}" src="{wide}"></picture>'
        f"<figcaption>{escape(diagram.note)}</figcaption></figure>"
    )


def _png(pixels: Pixels) -> str:
    import imageio.v3 as imageio

    buffer = io.BytesIO()
    imageio.imwrite(buffer, pixels, extension=".png")
    return _uri("image/png", buffer.getvalue())


def _uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
