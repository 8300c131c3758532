"""The options of ``hybrid-rt render``, and the settings of integrators among them."""

from __future__ import annotations

import argparse
import math
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from hybrid_rt.cli.denoise import add_denoise_option
from hybrid_rt.cli.live import add_live_options

if TYPE_CHECKING:
    from hybrid_rt.integrators import Options
    from hybrid_rt.integrators.options import Flag


def _seconds(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: pass seconds, such as 60") from None


def _share(text: str) -> float:
    try:
        return float(text[:-1]) / 100.0 if text.endswith("%") else float(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r}: pass a share, such as 0.02 or 2%") from None


def _whole(text: str) -> int:
    with suppress(ValueError, OverflowError):
        number = float(text) if "e" in text.lower() else int(text)
        if number == int(number):
            return int(number)
    raise argparse.ArgumentTypeError(f"{text!r}: pass a whole number, such as 64 or 1e5")


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt render`` and scene scripts take."""
    from hybrid_rt.integrators import DEFAULT, INTEGRATORS
    from hybrid_rt.rendering.channels import OUTPUTS
    from hybrid_rt.rendering.limits import DEFAULT_DEPTH

    *others, last = INTEGRATORS
    parser.add_argument(
        "--integrator",
        metavar="I",
        help=f"{', '.join(others)} or {last} (default: what the scene names, else {DEFAULT})",
    )
    parser.add_argument(
        "--passes",
        type=_whole,
        metavar="N",
        help="samples per pixel (default 16; with a time budget or target error: as many as that takes)",
    )
    for flag, integrators in _flags().values():
        parser.add_argument(
            f"--{flag.name}",
            type=_whole if flag.type is int else flag.type,
            metavar=flag.metavar,
            help=flag.help.format(", ".join(integrators)),
        )
    parser.add_argument(
        "--time-budget",
        type=_seconds,
        metavar="S",
        help="stop after S seconds of this call; on a busy machine later, by up to about a pass or group of passes",
    )
    parser.add_argument(
        "--target-error",
        type=_share,
        metavar="E",
        help="stop at this estimated relative error of the picture (0.01 or 1%%)",
    )
    parser.add_argument(
        "--target-error-trimmed",
        type=_share,
        metavar="E",
        help="stop at this error without the worst 0.1 %% of the pixels",
    )
    parser.add_argument(
        "--max-depth",
        type=_whole,
        default=DEFAULT_DEPTH,
        metavar="N",
        help=f"bounces of a path (default {DEFAULT_DEPTH})",
    )
    parser.add_argument("--seed", type=_whole, default=0, metavar="S")
    parser.add_argument("--threads", type=_whole, metavar="N", help="default: all cores")
    parser.add_argument(
        "--width", type=_whole, metavar="W", help="pixels; alone it keeps the picture's proportions"
    )
    parser.add_argument("--height", type=_whole, metavar="H", help="pixels; as --width")
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
        "--exposure",
        type=exposure_stops,
        default=0.0,
        metavar="E",
        help="stops, for .png (default 0)",
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
    parser.add_argument(
        "--explain", action="store_true", help="after rendering, say what the scene needed and why"
    )
    add_progress_options(parser)


def add_progress_options(parser: argparse.ArgumentParser) -> None:
    """Add ``--progress`` and ``--quiet``."""
    parser.add_argument(
        "--progress",
        choices=("auto", "bar", "plain", "none"),
        default="auto",
        metavar="MODE",
        help="auto (default: a bar on terminals, else plain), bar, plain (lines for a log) or none",
    )
    parser.add_argument(
        "--quiet",
        action="store_const",
        dest="progress",
        const="none",
        help="no progress; the report is still printed",
    )


def exposure_stops(text: str) -> float:
    """Read an exposure: a factor of 2**-100 to 2**100."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not -100.0 <= value <= 100.0:
        raise argparse.ArgumentTypeError(f"{text!r} stops: pass a number from -100 to 100")
    return value


def settings_of(integrator: str, options: argparse.Namespace) -> Options | None:
    """Return the settings of an integrator that a command line asks for, or None."""
    from hybrid_rt.core.checks import choice
    from hybrid_rt.integrators import INTEGRATORS

    hint = "one that a script declares is named by its INTEGRATOR instead"
    declared = INTEGRATORS[choice(integrator, "integrator", INTEGRATORS, hint)]
    flags = _flags()
    # A script may declare an integrator of its own, after the options were read.
    asked = {name: getattr(options, name.replace("-", "_"), None) for name in flags}
    asked = {name: value for name, value in asked.items() if value is not None}
    for name in asked:
        integrators = flags[name][1]
        if integrator not in integrators:
            raise ValueError(
                f"--{name}: integrator {integrator!r} has none, pass --integrator {integrators[0]}"
            )
    return declared.with_settings(asked)


def _flags() -> dict[str, tuple[Flag, list[str]]]:
    """Return the flags of integrators' settings by name, and who has each of them."""
    from hybrid_rt.integrators import INTEGRATORS

    found: dict[str, tuple[Flag, list[str]]] = {}
    for name, declared in INTEGRATORS.items():
        for flag in declared.options.flags().values():
            found.setdefault(flag.name, (flag, []))[1].append(name)
    return found
