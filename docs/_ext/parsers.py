"""The argparse parsers of all commands, without running them."""

from __future__ import annotations

import argparse
import runpy
import sys
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from unittest import mock

ROOT = Path(__file__).parents[2]
# What judges compute by. Their options do not depend on it, so the extra "docs" is enough for the site.
BY_JUDGES = ("flint", "grimp", "mpmath")


class _ParserSeen(BaseException):
    """Carries a parser out of the program that made it."""


def parser_of(program: str) -> argparse.ArgumentParser:
    """Return the parser of ``hybrid-rt``, or of a script given by its path from the project's root."""
    if program == "hybrid-rt":
        from hybrid_rt.cli import main

        return _seen(main)
    for name in BY_JUDGES:
        if sys.modules.get(name) is None and find_spec(name) is None:
            sys.modules[name] = mock.MagicMock(name=name)
    with mock.patch.object(sys, "argv", [program]):
        names = runpy.run_path(str(ROOT / program), run_name="documented")
    return _seen(names["main"])


def _seen(main: Callable[[], object]) -> argparse.ArgumentParser:
    def stop(parser: argparse.ArgumentParser, *_: object) -> None:
        raise _ParserSeen(parser)

    # _Command, the class of subcommands, parses by parse_known_args: the outermost is parse_args.
    with mock.patch.object(argparse.ArgumentParser, "parse_args", stop):
        try:
            main()
        except _ParserSeen as seen:
            return seen.args[0]
    raise ValueError(f"{main} parses no arguments")


def subcommands(
    parser: argparse.ArgumentParser, program: str
) -> dict[str, argparse.ArgumentParser]:
    """Return the subcommands of a program's parser by their full names, with all their options."""
    found: dict[str, argparse.ArgumentParser] = {}
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            found |= {f"{program} {name}": command for name, command in action.choices.items()}
    for command in found.values():
        add_options, command.add_options = getattr(command, "add_options", None), None
        if add_options is not None:
            add_options(command)
    return found
