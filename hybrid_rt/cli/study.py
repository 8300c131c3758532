"""``hybrid-rt study``: error against run time for a scene or a surface."""

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from hybrid_rt.analysis import answers, hit_study, study_diagrams, tables, work_precision
from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.curves import fitted_slope
from hybrid_rt.analysis.hit_study import HitStudy
from hybrid_rt.analysis.method_forecast import triangles_for
from hybrid_rt.analysis.methods import curved_surfaces, default_methods
from hybrid_rt.analysis.page import Study
from hybrid_rt.analysis.picture_comparison import load_picture
from hybrid_rt.analysis.ray_sets import camera as random_camera
from hybrid_rt.analysis.reference import REFERENCES
from hybrid_rt.analysis.units import asked, of_pixels
from hybrid_rt.analysis.work_precision import PictureStudy, StudyInterrupted
from hybrid_rt.cli.cad import add_reading, takes
from hybrid_rt.cli.command import one_or_more, say_if_no_plots, tell
from hybrid_rt.cli.rays import surfaces_of
from hybrid_rt.cli.scene_file import load_scene
from hybrid_rt.cli.study_comparison import compare
from hybrid_rt.cli.study_files import check_folder, publish_study
from hybrid_rt.core import checks
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.rendering.versions import versions
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.image_files import check_output

REFERENCE_FILE = "reference.npz"
DESCRIPTION = """\
Draw error against run time for a scene or a surface, and say which settings are cheapest.

Prints tables and answers; with --out it writes curves.json, curves.csv, tables.tex (for LaTeX) and
the reference that it made, reference.npz, and with matplotlib curves.png, curves.pdf (vectors) and
page.html, which holds pictures, error maps and diagrams and needs no other file.
Scene scripts are programs and are executed. Seconds are wall time with kernels compiled.
"""
EXAMPLES = """\
examples:
  hybrid-rt study scenes/teapot.py --out teapot
  hybrid-rt study hybrid_rt/data/teapot.bpt --quick
  hybrid-rt study part.step --quick
  hybrid-rt study scenes/caustic_ball.py --integrators path ppm --photons 20000 200000
  hybrid-rt study scenes/teapot.py --seconds 10 --only pictures
  hybrid-rt study --compare before/curves.json after/curves.json --out both
"""


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt study`` takes."""
    add = parser.add_argument
    add("source", nargs="?", metavar="SCENE.py | surface FILE.bpt | part.step")
    add("file", nargs="?", type=Path, help=argparse.SUPPRESS)
    add("--out", type=Path, metavar="DIR")
    add("--quick", action="store_true", help="small, few passes, one run")
    add(
        "--only",
        choices=("pictures", "hits"),
        help="of a scene; default: pictures, then first hits",
    )
    add("--compare", nargs=2, type=Path, metavar=("A.json", "B.json"))
    either = parser.add_mutually_exclusive_group().add_argument
    either("--target", type=float, default=0.01, help="relative RMSE (default 0.01)")
    either(
        "--target-trimmed",
        type=float,
        metavar="E",
        help="instead: without the worst 0.1 %% of the pixels, which are left out of all errors",
    )
    add(
        "--reference",
        type=Path,
        help="a picture (.npz or .exr) instead of ours, which is then neither made nor checked",
    )
    add(
        "--reference-by",
        choices=REFERENCES,
        help="checked by the other one; default: the one that states the smaller error",
    )
    add("--integrators", nargs="+", metavar="I", help="default: all that can")
    add("--certified-only", action="store_true", help="no meshes and no uncertified hits")
    add(
        "--meshes-by",
        metavar="I",
        help="integrator; default: the one with the least noise in a time",
    )
    add(
        "--photons",
        type=one_or_more,
        nargs="+",
        default=(),
        metavar="N",
        help="of a pass; not of the reference",
    )
    add("--alphas", type=float, nargs="+", default=(), metavar="A", help="of ppm (default 2/3)")
    add(
        "--light-paths",
        type=float,
        nargs="+",
        default=(),
        metavar="N",
        help="of path, per camera ray (default 0.5)",
    )
    add(
        "--reference-passes",
        type=one_or_more,
        help="default 1024, quick 128; a second method makes a quarter as many, or as many as take as long, and "
        "the better picture is the reference",
    )
    until = parser.add_mutually_exclusive_group().add_argument
    until("--passes", type=one_or_more, nargs="+", help="default 1 4 16 64, quick 1 4 16")
    until(
        "--seconds",
        type=float,
        metavar="S",
        help="instead: 1, 4, 16 ... passes of each method until a render takes about S seconds",
    )
    add("--runs", type=one_or_more, help="default 3, quick 1")
    add("--width", type=one_or_more, help="default: that of the scene, at most 240, quick 120")
    add("--rays", type=one_or_more, help="of first hits; default 100000, quick 20000")
    add("--threads", type=one_or_more)
    add_reading(parser)


def run(args: argparse.Namespace) -> None:
    """Measure and print what is asked for, or compare two earlier runs."""
    if args.out:
        say_if_no_plots("curves.png, no curves.pdf and no page.html")
    if args.compare:
        if args.source:
            raise ValueError(f"--compare measures nothing: leave out {args.source}, or --compare")
        compare(args)
    elif not args.source:
        raise ValueError("name a scene script, a .bpt or a CAD file, or use --compare")
    else:
        _measure(args)


def _measure(args: argparse.Namespace) -> None:
    if args.target_trimmed is not None:
        args.target = args.target_trimmed
    checks.number(args.target, "target", above=0.0)
    if args.file is not None and args.source != "surface":
        raise ValueError(f"{args.source} and {args.file} are two studies: name one at a time")
    # "surface FILE.bpt" and "FILE.bpt" mean the same.
    file = args.file if args.source == "surface" else Path(args.source)
    if file is None:
        raise ValueError("surface has no file: name a .bpt file")
    is_surface = takes(file, args) or file.suffix == ".bpt"
    if is_surface and args.only == "pictures":
        raise ValueError(
            f"{file} is a surface, without pictures: name a scene, or leave out --only"
        )
    n_rays = args.rays or (20_000 if args.quick else 100_000)
    if args.out:
        check_folder(args.out)
        if not is_surface and args.only != "hits" and args.reference is None:
            check_output(args.out / REFERENCE_FILE)
    studies: dict[str, Any] = {}
    scene = None if is_surface else load_scene(file)
    full_size = None if scene is None else (scene.camera.width, scene.camera.height)
    try:
        _study(file, scene, n_rays, studies, args)
    except BaseException:  # what was measured took its time, whatever went wrong after it
        if studies:
            _show(str(file), studies, full_size, args)
        raise
    _show(str(file), studies, full_size, args)


def _study(
    file: Path, scene: Scene | None, n_rays: int, studies: dict[str, Any], args: argparse.Namespace
) -> None:
    """Make the studies that there can be, one after the other."""
    if scene is None:
        surfaces: list[Any] = surfaces_of(args, file)[0]
    else:
        most = 120 if args.quick else 240
        camera = scene.camera.resized(args.width or min(most, scene.camera.width))
        scene = scene.with_camera(camera)
        if args.only != "hits":
            try:
                studies["picture"] = _study_picture(scene, args)
            except StudyInterrupted as interrupt:
                studies["picture"] = interrupt.study
                raise
        surfaces = [] if args.only == "pictures" else curved_surfaces(scene)
        if args.only == "hits" and not surfaces:
            surfaces = [x.surface for x in scene.objects if x.surface.is_bounded]
            if not surfaces:
                raise ValueError(
                    f"{file} has no surface that ends, whose first hits could be timed: leave out --only hits"
                )
    if surfaces:
        rays = (
            random_camera(surfaces, n_rays, 1)
            if scene is None
            else hit_study.camera_rays(scene, n_rays)
        )
        studies["hits"] = hit_study.study_hits(
            surfaces, rays, runs=3 if args.quick else 7, threads=args.threads, say=_tell_step
        )


def _study_picture(scene: Scene, args: argparse.Namespace) -> PictureStudy:
    def keep(reference: RenderResult) -> None:
        if args.out:
            file = args.out / REFERENCE_FILE
            reference.save(file)
            _tell_step(f"wrote {file}: --reference {file} spares it next time")

    passes = args.passes or ([1, 4, 16] if args.quick else [1, 4, 16, 64])
    return work_precision.study_picture(
        scene,
        passes if args.seconds is None else None,
        seconds=args.seconds,
        runs=args.runs or (1 if args.quick else 3),
        reference_passes=args.reference_passes or (128 if args.quick else 1024),
        reference=None if args.reference is None else load_picture(args.reference),
        reference_by=args.reference_by,
        methods=default_methods(
            scene,
            args.integrators,
            {"photons": args.photons, "alpha": args.alphas, "light-paths": args.light_paths},
        ),
        certified_only=args.certified_only,
        meshes_by=args.meshes_by,
        trimmed=args.target_trimmed is not None,
        threads=args.threads,
        say=_tell_step,
        keep=keep,
    )


def _show(
    name: str, studies: dict[str, Any], full_size: tuple[int, int] | None, args: argparse.Namespace
) -> None:
    shown = Study(f"Error against run time: {name}")
    measured: answers.Conditions = []
    data: dict[str, Any] = {"source": name, "versions": versions(), "target": args.target}
    if "picture" in studies:
        measured += answers.picture_conditions(studies["picture"], full_size)
        data["picture"] = _show_picture(studies["picture"], name, full_size, args.target, shown)
    if "hits" in studies:
        hits: HitStudy = studies["hits"]
        measured.append(
            ("first hits", f"{hits.rays:,} rays of the camera, {hits.judged:,} meet something")
        )
        cost, *others = answers.hit_answers(hits)
        if "picture" in studies:
            others.insert(0, cost)
        else:
            shown.asked = "Asked: what do exact first hits cost, and how often are others wrong?"
            shown.answer = cost
        shown.findings += others
        shown.diagrams += [
            study_diagrams.hit_diagram(hits.curves, hits.judged),
            study_diagrams.distance_diagram(hits.curves, hits.size),
        ]
        shown.tables.append(tables.hit_table(hits.curves))
        if hits.newton:
            shown.diagrams += study_diagrams.newton_diagrams(hits.newton, hits.size)
            shown.tables.append(tables.newton_table(hits))
        data["hits"] = asdict(hits)
    shown.measured = answers.conditions(measured, name)
    publish_study(shown, data, args.out)


def _show_picture(
    study: PictureStudy, name: str, full_size: tuple[int, int] | None, target: float, shown: Study
) -> dict[str, Any]:
    """Add a picture study to what is shown; return its figures."""
    advice = advise(study, target, name, full_size)
    triangles = triangles_for(
        [row for row in study.meshes if row["accuracy"] == "mesh"], advice.target
    )
    shown.asked = (
        f"Asked: which method renders this scene soonest to an error of {asked(target)}"
        f"{of_pixels(study.trimmed)}, on this machine?"
    )
    shown.answer, shown.command = advice.headline, advice.command
    shown.details += advice.details
    shown.findings += [
        *answers.bias_answers(study), *answers.time_answers(study),
        *answers.dots_answers(study, target), *answers.mesh_answer(study, advice.target, triangles),
    ]  # fmt: skip
    own = study.reference.own_error
    shown.diagrams.append(study_diagrams.picture_diagram(study.curves, own, study.trimmed))
    shown.tables.append(tables.forecast_table(advice.forecasts, advice.target, study.trimmed))
    if len(study.curves) > 1:
        shown.tables.append(tables.equal_time_table(study.curves, own, study.trimmed))
    slopes = [fitted_slope(curve, own) for curve in study.curves]
    shown.tables.append(tables.slope_table(slopes, study.trimmed))
    shown.tables.append(tables.picture_table(study.curves, study.trimmed))
    if study.meshes:
        shown.tables.append(tables.mesh_table(study))
    shown.images = study.images
    return {
        **{key: value for key, value in vars(study).items() if key != "images"},
        "reference": asdict(study.reference),
        "curves": [asdict(curve) for curve in study.curves],
        "slopes": [asdict(slope) for slope in slopes],
        "answer": {"headline": advice.headline, "command": advice.command},
        "forecast_target": advice.target,
        "forecasts": [asdict(found) for found in advice.forecasts],
        "triangles_for_target": triangles,
    }


def _tell_step(text: str) -> None:
    tell(f"  ... {text}")
