"""One render of the command line, from the checked request to the saved files and what is said."""

from __future__ import annotations

import argparse
import shlex
import shutil
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid_rt.cli.command import REFUSALS, STOPPED, said_by, say
from hybrid_rt.cli.denoise import denoised_files, save_denoised
from hybrid_rt.cli.live import compare_on, open_page
from hybrid_rt.cli.options import settings_of

if TYPE_CHECKING:
    from hybrid_rt.core.progress import Progress
    from hybrid_rt.rendering.report import Report
    from hybrid_rt.rendering.result import RenderInterrupted, RenderResult
    from hybrid_rt.scene.scene import Scene


@dataclass(frozen=True)
class _Asked:
    """What a command line asks for, possible as far as that is known without the scene."""

    request: dict[str, Any]  # arguments of `render` that have options
    outputs: list[_Output]
    denoised: dict[str, Path]  # by what the user calls the pictures

    @property
    def store(self) -> Path | None:
        """The folder of the store."""
        return self.request["store"]


def render_scene(
    load: Callable[[], tuple[Scene, str]], name: str, options: argparse.Namespace
) -> int:
    """Render the scene that is loaded once files and settings are known to be possible; return the exit code.

    The picture has the given name unless ``--out`` says otherwise. ``load`` also returns the integrator that
    the scene prefers.
    """
    from hybrid_rt.core.interrupts import heard_at_stops, held_back
    from hybrid_rt.core.progress import watch_compilation

    asked = _checked(name, options)
    with ExitStack() as until_saved:
        page = until_saved.enter_context(open_page(name, options))
        with shown_progress(options.progress) as progress:
            with watch_compilation(progress):
                scene, preferred = load()
            integrator = preferred if options.integrator is None else options.integrator
            scene = _resized(scene, options.width, options.height)
            compare_on(page, scene, options.live_compare)
            # From here on, so that nothing comes between the render's end and the files.
            until_saved.enter_context(heard_at_stops())
            with _said_of_store(asked.store):
                request = {**asked.request, "integrator": integrator}
                own = settings_of(integrator, options)
                result, interrupt = rendered(
                    scene, **request, options=own, progress=progress, watch=page
                )
            until_saved.enter_context(held_back())
        # Before anything is printed: the reader of a pipe may have closed it.
        failures = _saved(result, asked.outputs, options.exposure)
        if page is not None:
            saved = [output.shown for output in asked.outputs if output.shown not in failures]
            page.finish(f"saved as {', '.join(saved)}" if saved else "it could not be saved")
        for output in asked.outputs:
            if output.shown not in failures:
                say(f"{output.shown}  ({summary(result.report)})")
    if asked.denoised:
        said, lost = save_denoised(result, asked.denoised, options.exposure)
        failures |= lost
        for line in said:
            say(line)
    if options.explain:
        from hybrid_rt.scene.plan import explain

        say(explain(result.report.plan))
    say_numbers(result.report)
    reasons, is_stopped = list(failures.values()), result.report.stopped_by == "watcher"
    if result.report.cluster is not None and result.report.cluster.lost:
        reasons.append(result.report.cluster.lost)
    if asked.store is not None:
        kept = result.report.store
        reasons += [kept.not_saved] if kept is not None and kept.not_saved else []
        say(_how_to_go_on(result.report))
    if reasons:
        raise OSError("\nhybrid-rt: ".join(reasons))
    if interrupt is not None:
        raise interrupt
    return STOPPED if is_stopped else 0


def _checked(name: str, options: argparse.Namespace) -> _Asked:
    """Refuse what cannot be, before a script runs that may take its time."""
    from hybrid_rt.rendering.arguments import Arguments, checked
    from hybrid_rt.rendering.settings import declared_in
    from hybrid_rt.sensor.image_files import keeps_channels

    outputs = [_Output(path) for path in options.out or [Path(f"{name}.png")]]
    if options.resume and options.store is None:
        raise ValueError("--resume: there is no --store to go on from, name its folder")
    if options.integrator is not None:
        settings_of(options.integrator, options)
    names = [name for name, setting in declared_in(Arguments).items() if setting.help]
    request = {name: getattr(options, name) for name in names if name != "integrator"}
    if options.store is not None:
        request["store"] = options.store.absolute()
    request = checked(request)
    channels = request["outputs"]
    if channels and not any(keeps_channels(output.file) for output in outputs):
        raise ValueError(
            f"--outputs {','.join(channels)}: a .png holds none of them: add --out {name}.npz or .exr"
        )
    denoised: dict[str, Path] = {}
    if options.denoise:
        from hybrid_rt.rendering.denoising import GUIDES

        denoised = denoised_files({output.shown: output.file for output in outputs})
        request["outputs"] = list(dict.fromkeys([*channels, *GUIDES]))
    store = request["store"]
    if store is not None:
        for output in outputs:
            if store.resolve() in output.file.resolve().parents:
                raise ValueError(
                    f"--out {output.shown} is in the folder of --store {options.store}, which "
                    "holds nothing but its render: name a file elsewhere"
                )
    return _Asked(request, outputs, denoised)


@contextmanager
def _said_of_store(folder: Path | None) -> Iterator[None]:
    """Say with a Ctrl-C that leaves no picture what is in the store."""
    try:
        yield
    except KeyboardInterrupt as interrupt:
        if str(interrupt):
            raise
        if folder is None:
            raise KeyboardInterrupt(
                "interrupted before a pass was complete (those of small pictures are rendered in "
                "groups): no picture is written"
            ) from None
        from hybrid_rt.rendering.store import holds_sums

        left = "holds what it held before" if holds_sums(folder) else "holds no pass"
        raise KeyboardInterrupt(
            "interrupted before a pass was complete: no picture is written, and store "
            f"{str(folder)!r} {left}"
        ) from None


def _how_to_go_on(report: Report) -> str:
    """Say what a store holds, what was lost, and by which command the render goes on."""
    from hybrid_rt.rendering.units import passes_in_words

    kept = report.store
    assert kept is not None
    lines = [f"  store     {note}" for note in kept.lost]
    before = kept.passes_before
    since = f", {before} of them from before" if before else ""
    if not kept.not_saved:
        lines.append(f"  store     {kept.folder} holds {passes_in_words(report.passes)}{since}")
    # Where pixels are not finite what is in the sums stays, and no pass would be added.
    if report.stopped_by != "not_finite":
        words = [*sys.argv[1:], *([] if "--resume" in sys.argv else ["--resume"])]
        command = [*program_words(), *_with_limit_moved(words, report)]
        lines.append(f"  go on     {shlex.join(command)}")
    return "\n".join(lines)


def program_words() -> list[str]:
    """Return the words that this program was started by, without its arguments: they start it again."""
    name = Path(sys.argv[0]).name
    found, n_words = shutil.which(name), len(sys.orig_argv) - len(sys.argv) + 1
    is_on_path = found is not None and Path(found).resolve() == Path(sys.argv[0]).resolve()
    if is_on_path or sys.orig_argv[n_words:] != sys.argv[1:]:
        return [name]
    return sys.orig_argv[:n_words]  # "python -m hybrid_rt" and "python prog.py" among them


def _with_limit_moved(command: list[str], report: Report) -> list[str]:
    """Return a command with the limit that stopped its render moved, so that it renders further.

    To what the line "further" says, or half the error that was reached (then without a time budget, which
    was enough for the larger one). Other renders have not reached their limits: their commands stay.
    """
    from hybrid_rt.rendering.forecast import further

    stopped_by, error = report.stopped_by, report.relative_error
    if error is not None and stopped_by in report.settings.targets and error.of(stopped_by) > 0.0:
        option = f"--{stopped_by.replace('_', '-')}"
        value = f"{error.of(stopped_by) / 2:.1g}"  # as the line "further" says it
        command = _without("--time-budget", command)
    elif stopped_by in ("passes", "blur"):
        told = further(report)
        option, value = "--passes", str(2 * report.passes if told is None else told.passes)
    else:
        return command
    return [*_without(option, command), option, value]


def _without(option: str, command: list[str]) -> list[str]:
    return [
        word
        for before, word in pairwise(["", *command])
        if option not in (before, word) and not word.startswith(f"{option}=")
    ]


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


def _resized(scene: Scene, width: int | None, height: int | None) -> Scene:
    """Return the scene with other pixel counts; one of them alone keeps the proportions."""
    camera = scene.camera
    if width is None and height is None:
        return scene
    if width is None:
        assert height is not None
        width = max(round(camera.width * height / camera.height), 1)
    return scene.with_camera(camera.resized(width, height))


def rendered(scene: Scene, **settings: Any) -> tuple[RenderResult, RenderInterrupted | None]:
    """Render a scene; where Ctrl-C ends it, return the picture so far and the interrupt."""
    from hybrid_rt.rendering.renderer import render
    from hybrid_rt.rendering.result import RenderInterrupted

    try:
        return render(scene, **settings), None
    except RenderInterrupted as interrupt:
        return interrupt.result, interrupt


@contextmanager
def shown_progress(mode: str) -> Iterator[Progress | None]:
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


def summary(report: Report) -> str:
    """Return passes and seconds of a render in words."""
    from hybrid_rt.rendering.units import passes_in_words

    compiling = report.kernel_compilation_seconds
    text = f"{passes_in_words(report.passes)}, {report.total_seconds:.1f} s"
    return text + (f" and {compiling:.1f} s compiling kernels" if compiling >= 0.1 else "")


def say_numbers(report: Report) -> None:
    """Print what a report says of its render."""
    from hybrid_rt.rendering.summary import in_words

    say(in_words(report))
