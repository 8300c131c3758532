"""Completion of the command line in shells, by shtab (extra ``completion``)."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

SHELLS = ("bash", "zsh", "tcsh")
# Arguments that are files, but no `Path`.
FILE_ARGUMENTS = ("scene", "source", "a", "b", "reference")
# What shells know as the names of files; see the documentation of shtab.
FILES = {"bash": "_shtab_compgen_files", "zsh": "_files", "tcsh": "f"}


def completion_action(parser: Callable[[], argparse.ArgumentParser]) -> type[argparse.Action]:
    """Return the action of an option that prints a completion script and ends the program."""

    class PrintCompletion(argparse.Action):
        def __call__(self, _parser: Any, _names: Any, shell: Any, _option: Any = None) -> NoReturn:
            try:
                import shtab
            except ModuleNotFoundError:
                _parser.error(
                    f"--print-completion {shell} needs shtab: pip install 'hybrid-rt[completion]'"
                )
            complete = parser()
            for action in _all_actions(complete):
                if action.type is Path or action.dest in FILE_ARGUMENTS:
                    action.complete = FILES  # type: ignore[attr-defined]
            sys.stdout.write(shtab.complete(complete, shell=shell))
            raise SystemExit(0)

    return PrintCompletion


def _all_actions(parser: argparse.ArgumentParser) -> list[argparse.Action]:
    """Return the actions of a parser and of its commands."""
    actions = list(parser._actions)
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                actions += _all_actions(command)
    return actions
