"""Draw error against run time for a scene or a surface, and say which settings are cheapest.

python tools/error_vs_time.py scenes/teapot.py --out teapot
python tools/error_vs_time.py hybrid_rt/data/teapot.bpt --quick
python tools/error_vs_time.py scenes/caustic_ball.py --integrators path ppm --photons 20000 200000
python tools/error_vs_time.py --compare before/curves.json after/curves.json --out both

Prints tables and answers; with --out it writes curves.json and curves.csv, and with matplotlib
curves.png and page.html, which holds pictures, error maps and diagrams and needs no other file.
Scene scripts are programs and are executed. Seconds are wall time with kernels compiled.
"""

import argparse
import csv
import importlib.util
import json
import sys
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hybrid_rt.analysis import hit_study, page, work_precision
from hybrid_rt.analysis.curves import Curve, Point, Spread, renamed
from hybrid_rt.analysis.diagrams import Diagram, save
from hybrid_rt.analysis.forecast import forecast, recommend, triangles_for
from hybrid_rt.analysis.hit_study import HitStudy
from hybrid_rt.analysis.methods import curved_surfaces, default_methods
from hybrid_rt.analysis.picture_comparison import load_picture
from hybrid_rt.analysis.work_precision import PictureStudy
from hybrid_rt.cli.command import one_or_more, run_tool, say_if_no_plots
from hybrid_rt.cli.scene_file import load_scene
from hybrid_rt.core import checks
from hybrid_rt.core.ledger import as_json
from hybrid_rt.rendering.versions import versions
from hybrid_rt.scene.scene import Scene
from hybrid_rt.verify.cases.rays import camera as random_camera
from meshing import BezierPatches


def main() -> int:
    """Run the tool; return the exit code."""
    parser = _parser()
    args = parser.parse_args()
    if args.out:
        say_if_no_plots("curves.png and no page.html")
    if args.compare:
        _compare(args)
    elif not args.source:
        parser.error("name a scene script or a .bpt file, or use --compare")
    else:
        _measure(args)
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("source", nargs="?", metavar="SCENE.py | surface FILE.bpt")
    parser.add_argument("file", nargs="?", type=Path, help=argparse.SUPPRESS)
    parser.add_argument("--out", type=Path, metavar="DIR")
    parser.add_argument("--quick", action="store_true", help="small, few passes, one run")
    parser.add_argument("--compare", nargs=2, type=Path, metavar=("A.json", "B.json"))
    parser.add_argument("--target", type=float, default=0.01, help="relative RMSE (default 0.01)")
    parser.add_argument("--reference", type=Path, help="a picture (.npz or .exr) instead of ours")
    parser.add_argument(
        "--reference-by",
        choices=work_precision.REFERENCES,
        help="checked by the other one; default: the one that states the smaller error",
    )
    parser.add_argument("--integrators", nargs="+", metavar="I", help="default: all that can")
    parser.add_argument(
        "--photons", type=one_or_more, nargs="+", default=(), metavar="N", help="of a pass"
    )
    parser.add_argument(
        "--alphas", type=float, nargs="+", default=(), metavar="A", help="of ppm (default 2/3)"
    )
    parser.add_argument("--reference-passes", type=one_or_more, help="default 1024, quick 128")
    parser.add_argument(
        "--passes", type=one_or_more, nargs="+", help="default 1 4 16 64, quick 1 4 16"
    )
    parser.add_argument("--runs", type=one_or_more, help="default 3, quick 1")
    parser.add_argument("--width", type=one_or_more, help="default 240, quick 120")
    parser.add_argument(
        "--rays", type=one_or_more, help="judged by the oracle; default 100000, quick 20000"
    )
    parser.add_argument("--threads", type=one_or_more)
    return parser


def _measure(args: argparse.Namespace) -> None:
    checks.number(args.target, "target", above=0.0)
    # "surface FILE.bpt" and "FILE.bpt" mean the same.
    file = args.file if args.source == "surface" else Path(args.source)
    if file is None:
        raise ValueError("surface has no file: name a .bpt file")
    n_rays = args.rays or (20_000 if args.quick else 100_000)
    if args.out:  # a place that cannot be written is said before the work
        args.out.mkdir(parents=True, exist_ok=True)
    studies: dict[str, Any] = {}
    try:
        _study(file, n_rays, studies, args)
    except KeyboardInterrupt:
        if studies:
            _show(str(file), studies, args)
        raise
    _show(str(file), studies, args)


def _study(file: Path, n_rays: int, studies: dict[str, Any], args: argparse.Namespace) -> None:
    """Make the studies that there can be, one after the other."""
    if file.suffix == ".bpt":
        surfaces: list[Any] = [BezierPatches.read(file)]
        rays = random_camera(surfaces, n_rays, 1)
    else:
        scene = _resized(load_scene(file), args.width or (120 if args.quick else 240))
        studies["picture"] = _study_picture(scene, args)
        surfaces = curved_surfaces(scene)
        rays = hit_study.camera_rays(scene, n_rays)
    if surfaces:
        studies["hits"] = hit_study.study_hits(
            surfaces, rays, runs=3 if args.quick else 7, threads=args.threads, say=_say
        )


def _resized(scene: Scene, width: int) -> Scene:
    camera = scene.camera
    height = max(round(camera.height * width / camera.width), 1)
    return scene.with_camera(camera.resized(width, height))


def _study_picture(scene: Scene, args: argparse.Namespace) -> PictureStudy:
    return work_precision.study_picture(
        scene,
        args.passes or ([1, 4, 16] if args.quick else [1, 4, 16, 64]),
        runs=args.runs or (1 if args.quick else 3),
        reference_passes=args.reference_passes or (128 if args.quick else 1024),
        reference=None if args.reference is None else load_picture(args.reference),
        reference_by=args.reference_by,
        methods=default_methods(
            scene, args.integrators, {"photons": args.photons, "alpha": args.alphas}
        ),
        threads=args.threads,
        say=_say,
    )


def _show(name: str, studies: dict[str, Any], args: argparse.Namespace) -> None:
    sentences: list[str] = []
    diagrams: list[Diagram] = []
    tables: dict[str, page.Table] = {}
    images: dict[str, work_precision.Image] = {}
    data: dict[str, Any] = {"source": name, "versions": versions(), "target": args.target}
    if "picture" in studies:
        study: PictureStudy = studies["picture"]
        forecasts = recommend(study, args.target)
        triangles = triangles_for(
            [row for row in study.meshes if row["accuracy"] == "mesh"], args.target
        )
        sentences += page.picture_answers(study, forecasts, args.target, name, triangles)
        own = study.reference.own_error
        diagrams.append(page.picture_diagram(f"{name}: pictures", study.curves, own))
        tables["Pictures"] = page.picture_table(study.curves)
        tables[f"To a relative RMSE of {args.target:g}"] = page.forecast_table(forecasts)
        if study.meshes:
            tables["What passes do not remove"] = page.mesh_table(study)
        images = study.images
        data["picture"] = {
            **{key: value for key, value in vars(study).items() if key != "images"},
            "reference": asdict(study.reference),
            "curves": [asdict(curve) for curve in study.curves],
            "forecasts": [asdict(found) for found in forecasts],
            "triangles_for_target": triangles,
        }
    if "hits" in studies:
        hits: HitStudy = studies["hits"]
        sentences += page.hit_answers(hits)
        diagrams.append(page.hit_diagram(f"{name}: first hits", hits.curves, hits.judged))
        diagrams.append(page.distance_diagram(f"{name}: right hits", hits.curves, hits.size))
        tables["First hits"] = page.hit_table(hits.curves)
        if hits.newton:
            diagrams += page.newton_diagrams(f"{name}: Newton's steps", hits.newton, hits.size)
            tables["Newton's steps"] = page.newton_table(hits.newton)
        data["hits"] = asdict(hits)
    _print(sentences, tables)
    if args.out:
        _write(args.out, name, sentences, diagrams, tables, images, data)


def _print(sentences: Sequence[str], tables: dict[str, page.Table]) -> None:
    for title, (head, rows) in tables.items():
        cells = [tuple(head), *(tuple(row) for row in rows)]
        widths = [max(len(row[k]) for row in cells) for k in range(len(head))]
        print(f"\n{title}")
        for row in cells:
            first, *others = (
                cell.ljust(w) if k == 0 else cell.rjust(w)
                for k, (cell, w) in enumerate(zip(row, widths, strict=True))
            )
            print("  " + "  ".join([first, *others]))
    print()
    for sentence in sentences:
        print(f"- {sentence}")


def _write(
    folder: Path,
    name: str,
    sentences: Sequence[str],
    diagrams: Sequence[Diagram],
    tables: dict[str, page.Table],
    images: dict[str, work_precision.Image],
    data: dict[str, Any],
) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    title = f"Error against run time: {name}"
    (folder / "curves.json").write_text(as_json(data), "utf-8")
    with (folder / "curves.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        for table, (head, rows) in tables.items():
            writer.writerows([(table,), head, *rows, ()])
    if importlib.util.find_spec("matplotlib") is not None:
        save(diagrams, folder / "curves.png")
        text = page.page(title, sentences, diagrams, tables, images)
        (folder / "page.html").write_text(text, "utf-8")
    print(f"\nwrote {', '.join(sorted(str(path) for path in folder.iterdir()))}")


def _read(file: Path) -> dict[str, Any]:
    with suppress(ValueError):
        data = json.loads(file.read_text("utf-8"))
        if isinstance(data, dict):
            return data
    raise ValueError(f"{file} holds no figures: pass the curves.json of an earlier run")


def _compare(args: argparse.Namespace) -> None:
    """Overlay the curves of two earlier runs."""
    both = [_read(file) for file in args.compare]
    names = [str(file.parent / file.stem) for file in args.compare]
    diagrams: list[Diagram] = []
    tables: dict[str, page.Table] = {}
    data: dict[str, Any] = {"compared": names}
    for part in ("picture", "hits"):
        if not all(part in one for one in both):
            continue
        curves = [
            curve
            for letter, one in zip("AB", both, strict=True)
            for curve in renamed(_curves(one[part]), letter)
        ]
        data[part] = {"curves": [asdict(curve) for curve in curves]}
        if part == "picture":
            own = max(one[part]["reference"]["own_error"] or 0.0 for one in both)
            data[part]["reference"] = {"own_error": own or float("nan")}
            diagrams.append(page.picture_diagram("pictures", curves, own or float("nan")))
            tables["Pictures"] = page.picture_table(curves)
        else:
            judged = max(one[part]["judged"] for one in both)
            data[part]["judged"] = judged
            diagrams.append(page.hit_diagram("first hits", curves, judged))
            tables["First hits"] = page.hit_table(curves)
    if not diagrams:
        raise ValueError(
            f"{names[0]} and {names[1]} have no kind of curves in common: name two of one kind"
        )
    sentences = [f"A is {names[0]}, B is {names[1]}.", *_ratios(both)]
    _print(sentences, tables)
    if args.out:
        _write(args.out, " and ".join(names), sentences, diagrams, tables, {}, data)


def _curves(part: dict[str, Any]) -> list[Curve]:
    inf = float("inf")
    return [
        Curve(
            curve["name"],
            curve["flags"],
            [
                Point(
                    inf if p["setting"] is None else p["setting"],
                    Spread(**p["seconds"]),
                    Spread(**p["error"]),
                    {key: float("nan") if v is None else v for key, v in p["more"].items()},
                )
                for p in curve["points"]
            ],
            curve["bias"],
            curve["power"],
        )
        for curve in part["curves"]
    ]


def _ratios(both: Sequence[dict[str, Any]]) -> list[str]:
    """Say for methods of both runs how the seconds to the first one's target compare."""
    if not all("picture" in one for one in both):
        return []
    target = both[0]["target"]
    found = []
    for one in both:
        own = one["picture"]["reference"]["own_error"] or 0.0
        found.append({c.name: forecast(c, target, own) for c in _curves(one["picture"])})
    return [
        f"{name} to {target:g}: A {found[0][name].seconds.median:.3g} s, "
        f"B {found[1][name].seconds.median:.3g} s."
        for name in found[0]
        if name in found[1] and None not in (found[0][name].passes, found[1][name].passes)
    ]


def _say(text: str) -> None:
    print(f"  ... {text}", file=sys.stderr)


if __name__ == "__main__":
    sys.exit(run_tool(main))
