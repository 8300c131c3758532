"""A self-contained HTML page of a study: the answer, how it was measured, diagrams, tables, pictures."""

import base64
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib import resources
from string import Template

import numpy as np

from hybrid_rt.analysis.diagrams import NARROW, Diagram, as_svg
from hybrid_rt.analysis.picture_comparison import error_map
from hybrid_rt.analysis.picture_sheet import Pixels, error_colors
from hybrid_rt.analysis.reference import Image
from hybrid_rt.analysis.tables import Table
from hybrid_rt.analysis.units import percent, signed_percent
from hybrid_rt.sensor.color import screen_pixels
from hybrid_rt.sensor.image_metrics import picture_errors


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
    """Return the HTML page: ``data/study.html``, filled in."""
    # An option is not broken at its hyphens.
    words = " ".join(f"<span>{escape(word)}</span>" for word in study.command.split(" "))
    return Template(
        (resources.files("hybrid_rt") / "data" / "study.html").read_text("utf-8")
    ).substitute(
        title=escape(study.title),
        asked=escape(study.asked),
        answer=escape(study.answer),
        command=f"<pre>{words}</pre>" if study.command else "",
        details=as_items(study.details),
        measured="".join(map(_row, study.measured)),
        findings=f"<h2>What else was found</h2><ul>{as_items(study.findings)}</ul>"
        if study.findings
        else "",
        diagrams="\n".join(map(_diagram, study.diagrams)),
        tables="\n".join(map(as_table, study.tables)),
        pictures=_pictures(study.images) if study.images else "",
    )


def as_items(sentences: Sequence[str]) -> str:
    """Return the items of an HTML list."""
    return "".join(f"<li>{escape(text)}</li>" for text in sentences)


def _row(cells: Sequence[str], tag: str = "td") -> str:
    return "<tr>" + "".join(f"<{tag}>{escape(cell)}</{tag}>" for cell in cells) + "</tr>"


def as_table(table: Table) -> str:
    """Return an HTML table with its title, and the words below it."""
    rows = _row(table.head, "th") + "".join(map(_row, table.rows))
    words = "".join(f'<p class="words">{escape(text)}</p>' for text in table.words)
    return f'<h2>{escape(table.title)}</h2><div class="scroll"><table>{rows}</table></div>{words}'


def _pictures(images: Mapping[str, Image]) -> str:
    reference = images["reference"]
    parts = [
        "<h2>Pictures, and where they are off</h2>",
        "<p>Left the picture after its most passes, right the relative error of every pixel:</p>",
        _colour_scale(),
        f'<div class="pair">{as_figure(as_png(screen_pixels(reference)), "reference")}</div>',
    ]
    for name, image in images.items():
        if name == "reference":
            continue
        errors = picture_errors(image, reference)
        caption = (
            f"{name}: off by {percent(errors.relative_rmse)}, {percent(errors.relative_rmse_of_most)} without "
            f"the worst 0.1 % of the pixels; mean off by {signed_percent(errors.relative_mean_error)}"
        )
        both = (
            as_figure(as_png(screen_pixels(image)), name),
            as_figure(as_png(error_map(image, reference)), caption),
        )
        parts.append(f'<div class="pair">{"".join(both)}</div>')
    return "\n".join(parts)


def _colour_scale() -> str:
    stops = [10.0 ** (-3.0 + 0.375 * k) for k in range(9)]
    colors = ", ".join("rgb({}, {}, {})".format(*color) for color in error_colors(np.array(stops)))
    return (
        f'<div class="scale" style="background: linear-gradient(to right, {colors})"></div>'
        '<div class="ticks"><span>0.1 % and below</span><span>1 %</span><span>10 %</span>'
        "<span>100 % and above</span></div>"
    )


def as_figure(uri: str, caption: str) -> str:
    """Return an HTML figure."""
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


def as_png(pixels: Pixels) -> str:
    """Return the URI of pixels as a PNG file."""
    import imageio.v3 as imageio

    buffer = io.BytesIO()
    imageio.imwrite(buffer, pixels, extension=".png")
    return _uri("image/png", buffer.getvalue())


def _uri(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode('ascii')}"
