"""The options of ``hybrid-rt render``, and the settings of integrators among them."""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hybrid_rt.cli.denoise import add_denoise_option
from hybrid_rt.cli.live import add_live_options

if TYPE_CHECKING:
    from hybrid_rt.integrators import Options
    from hybrid_rt.integrators.options import Flag


def _reads(read: Callable[[str], Any]) -> Callable[[str], Any]:
    """Return a reader of an option's text, of whose errors argparse shows the words."""

    def reader(text: str) -> Any:
        try:
            return read(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None

    return reader


def add_render_options(parser: argparse.ArgumentParser) -> None:
    """Add what ``hybrid-rt render`` and scene scripts take."""
    from hybrid_rt.rendering.arguments import Arguments
    from hybrid_rt.rendering.settings import declared_in, read_whole

    defaults = {one.name: one.default for one in fields(Arguments)}
    for name, setting in declared_in(Arguments).items():
        if not setting.help:
            continue
        flag, default = f"--{name.replace('_', '-')}", defaults[name]
        if default is False:
            parser.add_argument(flag, action="store_true", help=setting.help)
            continue
        read = _reads(setting.read)
        metavar = setting.metavar
        parser.add_argument(flag, type=read, default=default, metavar=metavar, help=setting.help)
    parser.set_defaults(integrator=None)
    for of_integrator, integrators in _flags().values():
        parser.add_argument(
            f"--{of_integrator.name}",
            type=_reads(read_whole) if of_integrator.type is int else of_integrator.type,
            metavar=of_integrator.metavar,
            help=of_integrator.help.format(", ".join(integrators)),
        )
    parser.add_argument(
        "--width",
        type=_reads(read_whole),
        metavar="W",
        help="pixels; alone it keeps the picture's proportions",
    )
    parser.add_argument("--height", type=_reads(read_whole), metavar="H", help="pixels; as --width")
    parser.add_argument(
        "--out",
        type=Path,
        action="append",
        metavar="FILE",
        help=".png, .npz or .exr; may be repeated (default ./NAME.png); a report goes beside it, a.json "
        "of a.png, a.npz.json of a.npz",
    )
    parser.add_argument(
        "--exposure",
        type=exposure_stops,
        default=0.0,
        metavar="E",
        help="stops, for .png (default 0)",
    )
    add_denoise_option(parser)
    add_live_options(parser)
    parser.add_argument(
        "--explain", action="store_true", help="after rendering, say what the scene needed and why"
    )
    add_progress_options(parser)


def other_options(known: Sequence[str]) -> dict[str, str]:
    """Return options of a command, all of which are known, by the names that other programs have for them."""
    if "--passes" not in known:
        return {}
    from hybrid_rt.rendering.arguments import other_names

    meant = {name.replace("_", "-"): of.replace("_", "-") for name, of in other_names().items()}
    meant |= {"size": "width", "resolution": "width"}
    return {f"--{name}": f"--{of}" for name, of in meant.items()}


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
