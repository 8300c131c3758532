"""The part report as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import resources
from string import Template

import numpy as np

from hybrid_rt.analysis.page import as_figure, as_items, as_png, as_table
from hybrid_rt.analysis.tables import Table
from hybrid_rt.part.mesh_study import largest_allowed
from hybrid_rt.part.pairs import Found
from hybrid_rt.part.pictures import RAMP, pictures
from hybrid_rt.part.report import PartReport, Report
from hybrid_rt.part.walls import Walls

# Rows of the tables of features and faces.
LISTED = 60

HOW = (
    (
        "Thickness along normals: how far the ray along the inward normal goes to where it leaves. Largest ball: "
        "the diameter of the largest ball inside that touches the wall, its contacts opposite. Both are the least "
        "of their kind; a search over pairs of pieces of all faces proves that none is less than the bound."
    ),
    (
        "Where faces meet in an edge sharper than a right angle, thickness falls to 0: these edges are named, and "
        "count only where walls are antiparallel."
    ),
    (
        "Proven: by bounds on the exact surfaces of the file. Estimate: the difference of two numbers of nodes. "
        "Interval: of 99 %, by random chords. Sampled: the least of samples, which may miss less."
    ),
)


def page_of(report: Report, title: str, walls: Sequence[Walls]) -> str:
    """Return the page; ``walls`` are those of the parts of the report, for the pictures."""
    parts: list[str] = []
    for part, own in zip(report.parts, walls, strict=True):
        parts += _part(part, own, report)
    if report.clearances:
        rows = [
            ["{} and {}".format(*c.parts), _value(c.found), f"{c.found.bound:.6g}", _sure(c.found), _place(c.found)]
            for c in report.clearances
        ]  # fmt: skip
        head = ["parts", "distance", "proven at least", "", "where"]
        parts.append(as_table(Table("Clearance", head, rows)))
    if report.skipped:
        parts += ["<h2>Left out</h2><ul>", as_items(report.skipped), "</ul>"]
    return Template(
        (resources.files("hybrid_rt") / "data" / "part.html").read_text("utf-8")
    ).substitute(
        title=escape(title),
        asked=escape(
            f"Walls are opposite within {report.angle:g} degrees; lengths in {report.unit}."
        ),
        parts="\n".join(parts),
        how=as_items(HOW),
    )


def answers(part: PartReport, unit: str) -> Table:
    """Return the table of what is known of a whole part."""
    mass, box = part.mass, part.box
    sides = " x ".join(f"{side:.6g}" for side in (box.corners[1] - box.corners[0]).tolist())
    rows = [
        ["thickness along normals", _value(part.ray), f"at least {part.ray.bound:.8g}", _sure(part.ray), _place(part.ray)],
        ["largest ball, where it is least", _value(part.ball), f"at least {part.ball.bound:.8g}", _sure(part.ball), _place(part.ball)],
        ["volume", f"{mass.volume:.10g}", f"+- {mass.volume_error:.1g}", "estimate", "exact faces, quadrature"],
        ["", f"{mass.chord_volume:.6g}", f"+- {mass.chord_error:.2g}", "interval", f"{mass.chords:,} chords, {mass.unpaired} not paired"],
        ["area", f"{mass.area:.10g}", f"+- {mass.area_error:.1g}", "estimate", "exact faces, quadrature"],
        ["centre of mass", ", ".join(f"{x:.8g}" for x in mass.center.tolist()), f"+- {mass.center_error:.1g}", "estimate", ""],
        ["", ", ".join(f"{x:.6g}" for x in mass.chord_center.tolist()), f"+- {mass.chord_center_error:.2g}", "interval", "by chords"],
        ["box", sides, f"+- {box.bound:.1g}", "proven", ""],
    ]  # fmt: skip
    moments = ", ".join(f"{x:.8g}" for x in np.diag(mass.inertia).tolist())
    products = ", ".join(f"{mass.inertia[i, j]:.4g}" for i, j in ((0, 1), (1, 2), (2, 0)))
    words = [f"inertia about the centre, density 1: {moments}; off the diagonal {products}"]
    title = f"Part {part.part}: {part.name or 'no name'}" + (
        f", in {part.places} places" if part.places > 1 else ""
    )
    head = ["", "value", "error, or bound", "how sure", "where, or how"]
    return Table(f"{title} ({unit})", head, rows, words)


def warnings_of(part: PartReport) -> list[str]:
    """Return sentences about edges at which there is no thickness."""
    said = [
        f"Faces {e.faces[0]} and {e.faces[1]} meet at {e.angle:.4g} degrees, near {_at(e.place)}: there thickness falls to 0."
        for e in part.sharp_edges
    ]
    for found, what in ((part.ray, "normals"), (part.ball, "balls")):
        said += [
            f"Faces {a} and {b} come together near {_at(place)}; chords along {what} between them are not searched."
            for (a, b), place in found.touching.items()
        ]
    return said


def tables_of(part: PartReport) -> list[Table]:
    """Return the tables of features, faces and meshes."""
    made = []
    if part.features:
        rows = [
            [f.kind, f"{f.radius:.6g}", "" if np.isnan(f.depth) else f"{f.depth:.6g}", f.end, _at(f.axis[0]), ", ".join(map(str, f.faces[:6]))]
            for f in part.features[:LISTED]
        ]  # fmt: skip
        head = ["kind", "radius", "length", "end", "at", "faces"]
        made.append(Table(f"Holes and fillets: {len(part.features)}", head, rows))
    head = ["face", "kind", "area", "thickness", "ball"]
    has_draft = any(row.draft for row in part.faces)
    head += ["draft from", "to", "undercut"] if has_draft else []
    rows = []
    for row in sorted(part.faces, key=lambda r: (np.isnan(r.thickness), r.thickness))[:LISTED]:
        cells = [str(row.face), row.kind, *map(_number, (row.area, row.thickness, row.ball))]
        if row.draft:
            cells += [
                f"{row.draft.least_bound:.4f}",
                f"{row.draft.most_bound:.4f}",
                f"{100 * row.undercut:.0f} %",
            ]
        rows.append(cells)
    words = [
        "Thickness and ball: the least of samples. Draft, degrees: proven bounds. Undercut: part of the samples."
    ]
    made.append(
        Table(f"Faces, the thinnest first: {len(rows)} of {len(part.faces)}", head, rows, words)
    )
    if part.meshes:
        rows = [
            [f"{m.tolerance:.4g}", f"{m.triangles:,}", f"{100 * m.volume_error:.3g} %", f"{100 * m.thickness_error:.3g} %", f"{m.deviation:.3g}"]
            for m in part.meshes
        ]  # fmt: skip
        words = [
            f"{what} is within 1 % at tolerances up to {largest_allowed(part.meshes, name):.3g}."
            for what, name in (
                ("Volume", "volume_error"),
                ("The least thickness", "thickness_error"),
            )
        ] + ["A deviation d is 1 % wrong where the mesh is off by d / 100: see the last column."]
        head = ["tolerance", "triangles", "volume off", "thickness off", "mesh off by"]
        made.append(Table("The same from a mesh", head, rows, words))
    return made


def _part(part: PartReport, walls: Walls, report: Report) -> list[str]:
    places = [found.place.mean(axis=0) for found in (part.ray, part.ball)]
    plain, colored, low, high = pictures(walls, places)
    made = [as_table(answers(part, report.unit))]
    if said := warnings_of(part):
        made += ["<h3>Edges without thickness</h3><ul>", as_items(said), "</ul>"]
    stops = ", ".join("rgb({:.0f}, {:.0f}, {:.0f})".format(*rgb) for rgb in RAMP.tolist())
    made += [
        '<div class="pair">',
        as_figure(as_png(plain), "the part; rings mark the thinnest places, through what lies before them"),
        "<div>",
        as_figure(as_png(colored), "thickness along normals at every pixel; grey: no opposite wall"),
        f'<div class="scale" style="background: linear-gradient(to right, {stops})">',
        f"<span>{low:.4g}</span><span>{high:.4g}</span></div></div></div>",
    ]  # fmt: skip
    return made + [as_table(table) for table in tables_of(part)]


def _value(found: Found) -> str:
    return "none" if np.isinf(found.value) else f"{found.value:.8g}"


def _sure(found: Found) -> str:
    return "proven" if found.is_proven else "least found, bound proven"


def _place(found: Found) -> str:
    if np.isinf(found.value):
        return ""
    return f"faces {found.faces[0]} and {found.faces[1]}, from {_at(found.place[0])} to {_at(found.place[1])}"


def _at(point: Iterable[float]) -> str:
    return "(" + ", ".join(f"{x:.5g}" for x in point) + ")"


def _number(x: float) -> str:
    return "" if np.isnan(x) else f"{x:.6g}"
