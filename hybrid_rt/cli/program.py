"""The command ``hybrid-rt``: its options and subcommands."""

from __future__ import annotations

import argparse
import math
import shlex
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid_rt._version import __version__
from hybrid_rt.cli.command import REFUSALS, STOPPED, guarded, said_by
from hybrid_rt.cli.completion import SHELLS, completion_action
from hybrid_rt.cli.denoise import add_denoise_option, denoised_files, save_denoised
from hybrid_rt.cli.live import add_live_options, compare_on, open_page

if TYPE_CHECKING:
    from hybrid_rt.core.progress import Progress
    from hybrid_rt.integrators import Options
    from hybrid_rt.integrators.options import Flag
    from hybrid_rt.rendering.renderer import RenderInterrupted, RenderResult
    from hybrid_rt.scene.scene import Scene

EXAMPLES = """\
examples:
  hybrid-rt demo                                   the teapot, in some seconds, as demo.png
  hybrid-rt render scenes/vase.py                  the scene of a script, as vase.png
  hybrid-rt render scenes/vase.py --passes 64      less noise
  hybrid-rt render scenes/vase.py --target-error 0.02 --time-budget 60    until 2 %, at most 60 s
  hybrid-rt render scenes/vase.py --time-budget 30 --width 1280 --out big.png --out big.npz
  hybrid-rt render scenes/vase.py --passes 256 --live    a page that shows it grow, and stops it
  hybrid-rt render scenes/vase.py --explain        what the scene needed, and what was left out
  hybrid-rt compare a.npz b.npz --reference c.npz  errors of both, and a map of them

Scene scripts are Python programs and are executed: run only those that you trust.

exit codes: 0 done, 2 refused or not written, 130 Ctrl-C, 141 closed pipe; 1 is an error of the
program itself. All about progress, messages and exit codes: docs/command_line.md
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    options = _parser().parse_args(arguments)
    return _guarded(lambda: options.run(options))


def render_script(describe: Callable[[], Scene], file: str) -> int:
    """Run a scene script as a program, with the options of ``hybrid-rt render``.

    Parameters
    ----------
    describe : callable
        The script's function ``scene``; the script's ``INTEGRATOR`` is the default integrator.
    file : str
        The script's ``__file__``; the picture is named after it.

    Returns
    -------
    int
        The exit code.
    """
    parser = argparse.ArgumentParser(
        prog=Path(file).name, description="Make a picture of this scene."
    )
    _add_render_options(parser)
    options = parser.parse_args()

    def load() -> tuple[Scene, str]:
        import inspect

        from hybrid_rt.cli.scene_file import scene_of

        # A decorated function keeps the names of the script behind what decorates it.
        names: dict[str, Any] = getattr(inspect.unwrap(describe), "__globals__", {})
        return scene_of(describe, names, file)

    return _guarded(lambda: _render(load, Path(file).stem, options))


class _Command(argparse.ArgumentParser):
    """A command that gets its options when it is chosen.

    Integrators and outputs declare some of those of ``render``, and take a while to import, which
    no other command has to wait for.
    """

    add_options: Callable[[argparse.ArgumentParser], None] | None = None

    def complete(self) -> None:
        """Add the options, unless that is done."""
        add_options, self.add_options = self.add_options, None
        if add_options is not None:
            add_options(self)

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse arguments by all options."""
        self.complete()
        return super().parse_known_args(args, namespace)


def _parser(complete: bool = False) -> argparse.ArgumentParser:
    """Return the parser; ``complete``: with the options of every command."""
    parser = argparse.ArgumentParser(
        prog="hybrid-rt",
        description="Pictures of curved surfaces, traced on the surfaces themselves.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"hybrid-rt {__version__}")
    parser.add_argument(
        "--print-completion",
        choices=SHELLS,
        action=completion_action(lambda: _parser(complete=True)),
        metavar="SHELL",
        help=f"print a script that completes commands in {', '.join(SHELLS[:-1])} or {SHELLS[-1]}",
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Command)

    demo = commands.add_parser("demo", help="make a picture of the teapot and compare with meshes")
    demo.add_argument("--out", type=Path, default=Path("demo.png"), metavar="FILE")
    _add_progress_options(demo)
    demo.set_defaults(run=_run_demo)

    render = commands.add_parser(
        "render", help="make a picture of a scene script (which is executed)"
    )
    render.add_argument("scene", metavar="SCENE.py")
    render.add_options = _add_render_options
    render.set_defaults(run=_run_render)

    compare = commands.add_parser("compare", help="say how far apart pictures are, and draw where")
    compare.add_argument("a", metavar="A", help=".npz or .exr; .png is 8 bit and clipped")
    compare.add_argument("b", metavar="B", help="what A is compared with, unless there is R")
    compare.add_argument("--reference", metavar="R", help="compare A and B with this instead")
    compare.add_argument(
        "--out",
        type=Path,
        default=Path("compare.png"),
        metavar="FILE.png",
        help="(default compare.png) the figures go beside it, FILE.json",
    )
    compare.add_argument("--exposure", type=_stops, default=0.0, metavar="E", help="stops shown")
    compare.set_defaults(run=_run_compare)
    for command in commands.choices.values() if complete else ():
        command.complete()
    return parser


def _add_render_options(parser: argparse.ArgumentParser) -> None:
    from hybrid_rt.integrators import DEFAULT, INTEGRATORS
    from hybrid_rt.rendering.channels import OUTPUTS

    *others, last = INTEGRATORS
    parser.add_argument(
        "--integrator",
        metavar="I",
        help=f"{', '.join(others)} or {last} (default: what the scene names, else {DEFAULT})",
    )
    parser.add_argument("--passes", type=int, metavar="N", help="samples per pixel (default 16)")
    for flag, integrators in _flags().values():
        parser.add_argument(
            f"--{flag.name}",
            type=flag.type,
            metavar=flag.metavar,
            help=flag.help.format(", ".join(integrators)),
        )
    parser.add_argument("--time-budget", type=float, metavar="S", help="stop after S seconds")
    parser.add_argument(
        "--target-error",
        type=float,
        metavar="E",
        help="stop at this estimated relative error of the picture (0.01: one per cent)",
    )
    parser.add_argument(
        "--target-error-trimmed",
        type=float,
        metavar="E",
        help="stop at this error without the worst 0.1 %% of the pixels",
    )
    parser.add_argument("--seed", type=int, default=0, metavar="S")
    parser.add_argument("--threads", type=int, metavar="N", help="default: all cores")
    parser.add_argument(
        "--width", type=int, metavar="W", help="pixels; alone it keeps the picture's proportions"
    )
    parser.add_argument("--height", type=int, metavar="H", help="pixels; as --width")
    parser.add_argument(
        "--accuracy", default="certified", metavar="A", help="mesh, refined or certified (default)"
    )
    parser.add_argument(
        "--coarse",
        default="embree",
        metavar="C",
        help="embree (default) or none: certified hits without triangles, the same picture bit for bit",
    )
    parser.add_argument(
        "--tolerance", type=float, metavar="T", help="of the coarse mesh, in scene units"
    )
    parser.add_argument(
        "--out",
        type=Path,
        action="append",
        metavar="FILE",
        help=".png, .npz or .exr; may be repeated (default ./NAME.png); a report goes beside it, a.json "
        "of a.png, a.npz.json of a.npz",
    )
    parser.add_argument(
        "--outputs",
        default="",
        metavar="A,B",
        help=f"also keep in .npz and .exr: {', '.join(OUTPUTS)}",
    )
    parser.add_argument(
        "--exposure", type=_stops, default=0.0, metavar="E", help="stops, for .png (default 0)"
    )
    add_denoise_option(parser)
    parser.add_argument(
        "--store",
        type=Path,
        metavar="DIR",
        help="keep the sums over passes there, every ten seconds: the render can go on after Ctrl-C, a "
        "crash or its end",
    )
    parser.add_argument(
        "--resume",
        action="store_true",
        help="go on from what --store holds, if anything; --passes counts that as well",
    )
    parser.add_argument(
        "--cluster",
        metavar="ADDRESS",
        help="let workers of dask.distributed make the passes: tcp://HOST:PORT of a scheduler, or local:N "
        "for N processes",
    )
    add_live_options(parser)
    parser.add_argument("--explain", action="store_true", help="say what the scene needed and why")
    _add_progress_options(parser)


def _add_progress_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--progress",
        choices=("auto", "bar", "plain", "none"),
        default="auto",
        metavar="MODE",
        help="auto (default: a bar on terminals, else plain), bar, plain (lines for a log) or none",
    )
    parser.add_argument(
        "--quiet", action="store_const", dest="progress", const="none", help="--progress none"
    )


def _stops(text: str) -> float:
    """Read an exposure: a factor of 2**-100 to 2**100."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not -100.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text!r} stops: pass a number from -100 to 100")
    return value


def _guarded(run: Callable[[], int | None]) -> int:
    """Run a command of this program; return its exit code."""

    def told(error: KeyboardInterrupt) -> str:
        return (
            f"hybrid-rt: {str(error) or 'interrupted: nothing is written but what is named above'}"
        )

    return guarded("hybrid-rt", run, told)


def _run_render(options: argparse.Namespace) -> int:
    from hybrid_rt.cli.scene_file import check_script, load_script

    script = check_script(options.scene)
    return _render(lambda: load_script(script), script.stem, options)


def _render(load: Callable[[], tuple[Scene, str]], name: str, options: argparse.Namespace) -> int:
    """Render the scene that is loaded once files and settings are known to be possible.

    Returns the exit code.
    """
    from hybrid_rt.core.interrupts import held_back
    from hybrid_rt.core.progress import watch_compilation
    from hybrid_rt.rendering.renderer import check_request
    from hybrid_rt.sensor.image_files import keeps_channels

    outputs = [_Output(path) for path in options.out or [Path(f"{name}.png")]]
    channels = [word.strip() for word in options.outputs.split(",") if word.strip()]
    request = {
        "passes": options.passes,
        "time_budget": options.time_budget,
        "target_error": options.target_error,
        "target_error_trimmed": options.target_error_trimmed,
        "seed": options.seed,
        "threads": options.threads,
        "accuracy": options.accuracy,
        "coarse": options.coarse,
        "tolerance": options.tolerance,
        "outputs": channels,
    }
    # A script may take its time: what it has no say in is refused before it runs.
    check_request(**request)
    if channels and not any(keeps_channels(output.file) for output in outputs):
        raise ValueError(
            f"--outputs {','.join(channels)}: a .png holds none of them: add --out {name}.npz or .exr"
        )
    denoised: dict[str, Path] = {}
    if options.denoise:
        from hybrid_rt.rendering.denoising import GUIDES

        denoised = denoised_files({output.shown: output.file for output in outputs})
        request["outputs"] = list(dict.fromkeys([*channels, *GUIDES]))
    if options.integrator is not None:
        _settings(options.integrator, options)
    store = None
    if options.store is not None:
        from hybrid_rt.rendering.store import check_folder

        store = check_folder(options.store, options.resume).absolute()
    elif options.resume:
        raise ValueError("--resume: there is no --store to go on from, name its folder")
    if options.cluster is not None:
        from hybrid_rt.rendering.cluster import check_address

        check_address(options.cluster)
    with ExitStack() as until_saved:
        page = until_saved.enter_context(open_page(name, options))
        with _shown_progress(options.progress) as progress:
            with watch_compilation(progress):
                scene, preferred = load()
            integrator = preferred if options.integrator is None else options.integrator
            scene = _resized(scene, options.width, options.height)
            compare_on(page, scene, options.live_compare)
            result, interrupt = _rendered(
                scene,
                integrator=integrator,
                options=_settings(integrator, options),
                progress=progress,
                store=store,
                resume=options.resume,
                cluster=options.cluster,
                watch=page,
                **request,
            )
            until_saved.enter_context(held_back())
        # Before anything is printed: the reader of a pipe may have closed it.
        failures = _saved(result, outputs, options.exposure)
        if page is not None:
            saved = [output.shown for output in outputs if output.shown not in failures]
            page.finish(f"saved as {', '.join(saved)}" if saved else "it could not be saved")
        for output in outputs:
            if output.shown not in failures:
                _say(f"{output.shown}  ({_summary(result.report)})")
    if denoised:
        said, lost = save_denoised(result, denoised, options.exposure)
        failures |= lost
        for line in said:
            _say(line)
    if options.explain:
        from hybrid_rt.scene.plan import explain

        _say(explain(result.report["plan"]))
    _say_numbers(result.report)
    reasons, is_stopped = list(failures.values()), result.report["stopped_by"] == "watcher"
    if result.report["cluster"] is not None and result.report["cluster"]["lost"]:
        reasons.append(result.report["cluster"]["lost"])
    if store is not None:
        kept = result.report["store"]
        reasons += [kept["not_saved"]] if kept["not_saved"] else []
        _say(_how_to_go_on(result.report, is_stopped or interrupt is not None))
    if reasons:
        raise OSError("\nhybrid-rt: ".join(reasons))
    if interrupt is not None:
        raise interrupt
    return STOPPED if is_stopped else 0


def _how_to_go_on(report: dict[str, Any], is_interrupted: bool) -> str:
    """Say what a store holds, what was lost, and by which command the render goes on."""
    from hybrid_rt.rendering.summary import passes_in_words

    kept = report["store"]
    lines = [f"  store     {note}" for note in kept["lost"]]
    before = kept["passes_before"]
    since = f", {before} of them from before" if before else ""
    lines.append(f"  store     {kept['folder']} holds {passes_in_words(report['passes'])}{since}")
    command = [Path(sys.argv[0]).name, *sys.argv[1:]]
    command += [] if "--resume" in command else ["--resume"]
    if not is_interrupted:
        command += ["--passes", str(2 * report["passes"])]
    return "\n".join([*lines, f"  go on     {shlex.join(command)}"])


class _Output:
    """A file that is asked for: what the user calls it, and where it is, wherever a script goes."""

    def __init__(self, path: Path) -> None:
        from hybrid_rt.sensor.image_files import check_output

        self.shown = str(check_output(path))
        self.file = path.absolute()


def _saved(result: RenderResult, outputs: Sequence[_Output], exposure: float) -> dict[str, str]:
    """Write a picture to every file that can be written; return why others cannot, by name."""
    failures = {}
    for output in outputs:
        try:
            result.save(output.file, exposure)
        except REFUSALS as error:  # the next may do better
            failures[output.shown] = str(error) or type(error).__name__
    return failures


def _rendered(scene: Scene, **settings: Any) -> tuple[RenderResult, RenderInterrupted | None]:
    """Render a scene; where Ctrl-C ends it, return the picture so far and the interrupt."""
    from hybrid_rt.rendering.renderer import RenderInterrupted, render

    try:
        return render(scene, **settings), None
    except RenderInterrupted as interrupt:
        return interrupt.result, interrupt


def _run_compare(options: argparse.Namespace) -> None:
    from hybrid_rt.analysis.picture_comparison import (
        check_sheet,
        compare_pictures,
        comparison_sheet,
        in_words,
        load_picture,
        save_comparison,
    )

    pictures = [options.a, options.b]
    if options.reference is not None:
        pictures.append(options.reference)
    out = check_sheet(options.out, pictures)
    one, other = load_picture(options.a), load_picture(options.b)
    reference = None if options.reference is None else load_picture(options.reference)
    comparison = compare_pictures(one, other, reference)
    sheet = comparison_sheet(one, other, reference, options.exposure)
    figures = save_comparison(out, sheet, comparison)
    _say(in_words(comparison))
    _say(f"{out}  (pictures and maps of their errors; the figures are in {figures})")


def _flags() -> dict[str, tuple[Flag, list[str]]]:
    """Return the flags of integrators' settings by name, and who has each of them."""
    from hybrid_rt.integrators import INTEGRATORS

    found: dict[str, tuple[Flag, list[str]]] = {}
    for name, declared in INTEGRATORS.items():
        for flag in declared.options.flags().values():
            found.setdefault(flag.name, (flag, []))[1].append(name)
    return found


def _settings(integrator: str, options: argparse.Namespace) -> Options | None:
    """Return the settings of an integrator that a command line asks for, or None."""
    from hybrid_rt.core.checks import choice
    from hybrid_rt.integrators import INTEGRATORS

    declared = INTEGRATORS[choice(integrator, "integrator", INTEGRATORS)]
    flags = _flags()
    asked = {name: getattr(options, name.replace("-", "_")) for name in flags}
    asked = {name: value for name, value in asked.items() if value is not None}
    for name in asked:
        integrators = flags[name][1]
        if integrator not in integrators:
            raise ValueError(
                f"--{name}: integrator {integrator!r} has none, pass --integrator {integrators[0]}"
            )
    return declared.with_settings(asked)


def _run_demo(options: argparse.Namespace) -> None:
    from hybrid_rt import demo
    from hybrid_rt.analysis.mesh_comparison import compare_with_mesh, in_words
    from hybrid_rt.core.interrupts import held_back
    from hybrid_rt.core.precompile import want
    from hybrid_rt.core.progress import watch_compilation
    from hybrid_rt.sensor.image_files import check_output

    check_output(options.out)
    want(*demo.KERNELS)
    scene = demo.scene()
    with ExitStack() as until_saved:
        with _shown_progress(options.progress) as progress:
            result, interrupt = _rendered(
                scene, integrator="whitted", passes=demo.PASSES, progress=progress
            )
            until_saved.enter_context(held_back())
        result.save(options.out)
    _say(f"{options.out}  ({_summary(result.report)})")
    _say_numbers(result.report)
    if interrupt is not None:
        raise interrupt
    with _shown_progress(options.progress) as progress, watch_compilation(progress):
        comparison = compare_with_mesh(scene, progress=progress)
    result.report["exact_against_mesh"] = comparison
    result.save(options.out)
    _say(in_words(comparison))
    _say(f"Next: hybrid-rt render {demo.__file__} --passes 64 --width 1280 --explain")


@contextmanager
def _shown_progress(mode: str) -> Iterator[Progress | None]:
    """Show the progress of what runs within; messages come above the bar."""
    from hybrid_rt.rendering.progress_bar import StreamDisplay, progress_bar

    progress = progress_bar(mode, sys.stderr)
    if not isinstance(progress, StreamDisplay):
        yield None
        return
    with said_by(progress.say):
        try:
            yield progress
        finally:
            progress.close()


def _resized(scene: Scene, width: int | None, height: int | None) -> Scene:
    """Return the scene with other pixel counts; one of them alone keeps the proportions."""
    camera = scene.camera
    if width is None and height is None:
        return scene
    if width is None:
        assert height is not None
        width = max(round(camera.width * height / camera.height), 1)
    elif height is None:
        height = max(round(camera.height * width / camera.width), 1)
    return scene.with_camera(camera.resized(width, height))


def _summary(report: dict[str, Any]) -> str:
    from hybrid_rt.rendering.summary import passes_in_words

    seconds = report["seconds"]
    compiling = report["kernel_compilation_seconds"]
    text = f"{passes_in_words(report['passes'])}, {seconds['total']:.1f} s"
    return text + (f" and {compiling:.1f} s compiling kernels" if compiling >= 0.1 else "")


def _say_numbers(report: dict[str, Any]) -> None:
    from hybrid_rt.rendering.summary import in_words

    _say(in_words(report))


def _say(text: str) -> None:
    print(text)  # noqa: T201  (a command's result belongs on the standard output)
