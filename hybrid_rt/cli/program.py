"""The command ``hybrid-rt``: its subcommands."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NoReturn

from hybrid_rt._version import __version__
from hybrid_rt.cli.command import BAD_INPUT, guarded, run_tool, say
from hybrid_rt.cli.completion import SHELLS, completion_action
from hybrid_rt.cli.options import (
    add_progress_options,
    add_render_options,
    exposure_stops,
    other_options,
)
from hybrid_rt.cli.render import render_scene, rendered, say_numbers, shown_progress, summary
from hybrid_rt.core.suggestions import option_suggestion

if TYPE_CHECKING:
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
  hybrid-rt study scenes/vase.py --out study       error against time of every method
  hybrid-rt accuracy scenes/vase.py --out mesh     how fine a mesh must be to find the same hits
  hybrid-rt cad part.step                          what a CAD file holds, and what of it is exact
  hybrid-rt part part.step --out part.html         thickness, volume, holes, each with how sure it is
  hybrid-rt render part.step                       a picture of it
  hybrid-rt rays part.step rays.npy --out hits.npz    first hits of the rays of a file
  hybrid-rt deviation part.step scan.ply --out colored.ply    how far measured points are from it

Scene scripts are Python programs and are executed: run only those that you trust.

exit codes: 0 done, 2 refused or not written, 130 Ctrl-C, 141 closed pipe, 143 SIGTERM; 1 is an
error of the program itself. All about progress, messages and exit codes: docs/command_line.md
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit code."""
    options = _parser().parse_args(arguments)
    guard: Callable[[Callable[[], int | None]], int] = options.guard
    return guard(lambda: options.run(options))


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
    parser = _Parser(prog=Path(file).name, description="Make a picture of this scene.")
    add_render_options(parser)
    options = parser.parse_args()

    def load() -> tuple[Scene, str]:
        import inspect

        from hybrid_rt.cli.scene_file import scene_of

        # A decorated function keeps the names of the script behind what decorates it.
        names: dict[str, Any] = getattr(inspect.unwrap(describe), "__globals__", {})
        return scene_of(describe, names, file)

    return _guarded(lambda: render_scene(load, Path(file).stem, options))


class _Parser(argparse.ArgumentParser):
    """A parser that knows no parts of names, and says what an unknown option may have been meant to be."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **{**options, "allow_abbrev": False})

    @property
    def known(self) -> list[str]:
        """All options that could have been given."""
        return [option for action in self._actions for option in action.option_strings]

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, and what was meant; exit."""
        if message.startswith("unrecognized arguments"):
            message += option_suggestion(message, self.known, other_options(self.known))
        super().error(message)


class _Command(_Parser):
    """A command that gets its options when it is chosen: to import what declares them takes a while."""

    add_options: Callable[[argparse.ArgumentParser], None] | None = None
    is_chosen = False

    def complete(self) -> None:
        """Add the options, unless that is done."""
        add_options, self.add_options = self.add_options, None
        if add_options is not None:
            try:
                add_options(self)
            except ImportError as error:  # numba, say, by its environment variables
                self.exit(BAD_INPUT, f"{self.prog.split()[0]}: {error}\n")

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse arguments by all options."""
        self.complete()
        self.is_chosen = True
        return super().parse_known_args(args, namespace)


class _Program(argparse.ArgumentParser):
    """The parser of ``hybrid-rt``, which hears of options that no command knows."""

    commands: Mapping[str, _Command] = MappingProxyType({})

    def error(self, message: str) -> NoReturn:
        """Say what is wrong, what was meant, and where options are listed; exit."""
        if message.startswith("unrecognized arguments"):
            chosen = [name for name, command in self.commands.items() if command.is_chosen]
            name = chosen[0] if chosen else "COMMAND"
            known = self.commands[name].known if chosen else []
            message += option_suggestion(message, known, other_options(known))
            message += f"{' ' if message.endswith('?') else ': '}hybrid-rt {name} --help lists what there is"
        super().error(message)


def _parser(complete: bool = False) -> argparse.ArgumentParser:
    """Return the parser; ``complete``: with the options of every command."""
    parser = _Program(
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
    add_progress_options(demo)
    demo.set_defaults(run=_run_demo, guard=_guarded)

    render = commands.add_parser(
        "render", help="make a picture of a scene script (which is executed), or of a CAD file"
    )
    render.add_argument("scene", metavar="SCENE.py", help="or part.step, .iges, .brep")
    render.add_options = _add_render_options
    render.set_defaults(run=_run_render, guard=_guarded)

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
    compare.add_argument(
        "--exposure", type=exposure_stops, default=0.0, metavar="E", help="stops shown"
    )
    compare.set_defaults(run=_run_compare, guard=_guarded)

    _add_tool(commands, "study", "draw error against run time, of all methods")
    _add_tool(commands, "accuracy", "tell how fine a mesh must be")
    _add_tool(commands, "cad", "tell what a CAD file holds, and what of it is exact")
    _add_tool(commands, "part", "report on a CAD part: thickness, volume, draft, with proof")
    _add_tool(commands, "rays", "trace the rays of a file, and write their hits")
    _add_tool(commands, "deviation", "tell how far measured points are from a model")
    parser.commands = commands.choices
    for command in commands.choices.values() if complete else ():
        command.complete()
    return parser


def _guarded(run: Callable[[], int | None]) -> int:
    """Run a command of this program; return its exit code."""

    def told(error: KeyboardInterrupt) -> str:
        return (
            f"hybrid-rt: {str(error) or 'interrupted: nothing is written but what is named above'}"
        )

    return guarded("hybrid-rt", run, told)


def _add_tool(commands: Any, name: str, words: str) -> None:
    """Add a command of the module of its name, which keeps what it has found when it is interrupted."""

    def module() -> Any:
        return import_module(f"hybrid_rt.cli.{name}")

    def add_options(parser: argparse.ArgumentParser) -> None:
        parser.description, parser.epilog = module().DESCRIPTION, module().EXAMPLES
        parser.formatter_class = argparse.RawDescriptionHelpFormatter
        module().add_options(parser)

    command = commands.add_parser(name, help=words)
    command.add_options = add_options
    command.set_defaults(
        run=lambda options: module().run(options), guard=lambda run: run_tool(run, "hybrid-rt")
    )


def _add_render_options(parser: argparse.ArgumentParser) -> None:
    from hybrid_rt.cli.cad import add_reading

    add_render_options(parser)
    add_reading(parser.add_argument_group("CAD files"))


def _run_render(options: argparse.Namespace) -> int:
    from hybrid_rt.cad.process import check_file
    from hybrid_rt.cli.cad import read, takes
    from hybrid_rt.cli.scene_file import check_script, load_script
    from hybrid_rt.integrators import DEFAULT

    file = Path(options.scene)
    if takes(file, options):
        check_file(file)
        return render_scene(lambda: (read(options, file).scene(), DEFAULT), file.stem, options)
    script = check_script(options.scene)
    return render_scene(lambda: load_script(script), script.stem, options)


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
    say(in_words(comparison))
    say(f"{out}  (pictures and maps of their errors; the figures are in {figures})")


def _run_demo(options: argparse.Namespace) -> None:
    from hybrid_rt import demo
    from hybrid_rt.analysis.mesh_comparison import compare_with_mesh, in_words
    from hybrid_rt.core.interrupts import heard_at_stops, held_back
    from hybrid_rt.core.progress import watch_compilation
    from hybrid_rt.sensor.image_files import check_output

    check_output(options.out)
    scene = demo.scene()
    with ExitStack() as until_saved:
        with shown_progress(options.progress) as progress:
            until_saved.enter_context(heard_at_stops())
            result, interrupt = rendered(
                scene, integrator="whitted", passes=demo.PASSES, progress=progress
            )
            until_saved.enter_context(held_back())
        result.save(options.out)
    say(f"{options.out}  ({summary(result.report)})")
    say_numbers(result.report)
    if interrupt is not None:
        raise interrupt
    with shown_progress(options.progress) as progress, watch_compilation(progress):
        comparison = compare_with_mesh(scene, progress=progress)
    replace(result, report=replace(result.report, exact_against_mesh=comparison)).save(options.out)
    say(in_words(comparison))
    say(f"Next: hybrid-rt render {demo.__file__} --passes 64 --width 1280 --explain")
