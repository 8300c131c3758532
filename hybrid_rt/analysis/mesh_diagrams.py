"""Pictures of the error of meshes: wrong hits against time, and where on a surface they are."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_rt.analysis.diagrams import plain, set_plain_ticks
from hybrid_rt.analysis.hit_study import RULE_OF_THREE
from hybrid_rt.analysis.mesh_error import RAYS, error_image
from hybrid_rt.analysis.units import number
from hybrid_rt.core.records import FloatArray
from meshing.outputs import replacing

ABOUT = {
    "random": "random rays through the box",
    "camera": "rays of a camera",
    "silhouette": "rays along the silhouette",
}
MESHES = {"mesh": ("tab:red", "o", "mesh"), "refined": ("tab:orange", "s", "refined by Newton")}
EXACT = {
    "certified": ("tab:blue", "-", "certified: none wrong"),
    'certified, coarse="none"': ("tab:green", "--", "certified without Embree: none wrong"),
}
# Inches of a picture at most.
TALL = 6.0
# Decades that the colours span: down to a thousandth of the tolerance, up to ten times it.
BELOW, ABOVE = 1e-3, 10.0


def draw_time(rungs: Sequence[Mapping[str, Any]], name: str, file: Path) -> None:
    """Draw the wrong first hits of meshes (`Rung.figures`) against the time per ray, by kind of rays."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context("default"):
        figure = Figure(figsize=(8.4, 4.6), layout="constrained")
        panels = figure.subplots(1, len(RAYS), sharey=True)
        for axes, kind in zip(panels, RAYS, strict=True):
            _draw_kind(axes, rungs, kind)
        panels[0].set_ylabel("wrong first hits, % of the rays")
        handles, labels = panels[0].get_legend_handles_labels()
        figure.legend(
            handles, labels, loc="outside lower center", ncols=2, fontsize=9, frameon=False
        )
        figure.suptitle(
            f"{name}: finer meshes send fewer rays to the wrong place, exact hits none",
            fontsize=12, fontweight="bold", x=0.01, ha="left",
        )  # fmt: skip
        with replacing(file) as opened:
            figure.savefig(opened, dpi=110, format="png")


def _draw_kind(axes: Any, rungs: Sequence[Mapping[str, Any]], kind: str) -> None:
    for accuracy, (color, marker, words) in MESHES.items():
        times = [rung["microseconds"][accuracy][kind] for rung in rungs]
        errors = [rung["errors"][accuracy][kind] for rung in rungs]
        # None wrong among n rays: at most 3 / n at 95 %, drawn hollow.
        shares = [100.0 * (e["wrong"] or RULE_OF_THREE / max(e["rays"], 1)) for e in errors]
        axes.loglog(times, shares, color=color, marker=marker, markersize=4, label=words)
        hollow = [k for k, e in enumerate(errors) if e["wrong"] == 0.0]
        axes.plot(
            [times[k] for k in hollow], [shares[k] for k in hollow], marker, color=color,
            markerfacecolor="white", markersize=4, zorder=3,
            label="hollow: none seen, at most this" if accuracy == "mesh" else None,
        )  # fmt: skip
    for accuracy, (color, line, words) in EXACT.items():
        time = float(np.median([rung["microseconds"][accuracy][kind] for rung in rungs]))
        axes.axvline(time, linestyle=line, color=color, label=words)
    axes.set_title(ABOUT[kind], fontsize=10)
    axes.set_xlabel("microseconds a ray")
    for axis in (axes.xaxis, axes.yaxis):
        set_plain_ticks(axis)
    axes.grid(visible=True, which="major", color="0.9")
    axes.set_axisbelow(True)


def draw_error(surfaces: Sequence[Any], tolerance: float, name: str, file: Path) -> None:
    """Draw the distance between a mesh and its surface, as a camera's rays meet them."""
    import matplotlib as mpl
    from matplotlib import colors, style
    from matplotlib.cm import ScalarMappable
    from matplotlib.figure import Figure
    from matplotlib.ticker import FuncFormatter

    error, shade = error_image(surfaces, tolerance, 640, 480)
    scale = colors.LogNorm(tolerance * BELOW, tolerance * ABOVE, clip=True)
    colormap = mpl.colormaps["viridis"]
    picture: FloatArray = colormap(scale(np.nan_to_num(np.maximum(error, 1e-300), posinf=1.0)))
    picture = picture[..., :3] * (0.35 + 0.65 * np.nan_to_num(shade))[..., None]
    picture[np.isnan(error)] = 1.0
    picture[np.isinf(error)] = (0.85, 0.0, 0.0)
    rows, columns = np.nonzero(~np.isnan(error))
    edge = 8
    picture = picture[
        max(rows.min() - edge, 0) : rows.max() + edge,
        max(columns.min() - edge, 0) : columns.max() + edge,
    ]
    with style.context("default"):
        height, width = picture.shape[:2]
        figure = Figure(figsize=(7.0, min(5.6 * height / width, TALL) + 0.9), layout="constrained")
        axes = figure.add_subplot()
        axes.imshow(picture, interpolation="nearest")
        axes.set_axis_off()
        figure.suptitle(
            f"{name}: how far hits on a mesh are from the true surface",
            fontsize=12, fontweight="bold", x=0.01, ha="left",
        )  # fmt: skip
        note = (
            f"tolerance of the mesh {number(tolerance, 2)} scene units; red: the mesh has nothing there, or "
            "should have nothing"
        )
        figure.supxlabel(note, fontsize=9, x=0.01, ha="left", color="0.3")
        bar = figure.colorbar(ScalarMappable(scale, colormap), ax=axes, shrink=0.8)
        bar.formatter = FuncFormatter(lambda value, _: plain(value))
        bar.set_label("distance along the ray, scene units")
        with replacing(file) as opened:
            figure.savefig(opened, dpi=110, format="png")
