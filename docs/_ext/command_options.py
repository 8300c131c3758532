"""A directive that documents commands from their argparse parsers.

``.. command:: hybrid-rt`` takes the parser of `hybrid_rt.cli.main`, ``.. command:: tools/*.py`` those of
all tools; subcommands follow as sections of their own.
"""

from __future__ import annotations

import argparse
import re
from collections.abc import Iterator

from docutils import nodes
from docutils.statemachine import StringList
from parsers import ROOT, parser_of, subcommands
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective


def lines_of(parser: argparse.ArgumentParser, name: str) -> Iterator[str]:
    """Yield the reStructuredText of one command, without its subcommands."""
    parser.prog = name
    usage = parser.format_usage().removeprefix("usage: ")
    yield from ["", ".. code-block:: text", "", *_indented(usage), ""]
    if parser.description:
        yield from ["", "::", "", *_indented(parser.description), ""]
    yield from [f".. program:: {name}", ""]
    for action in parser._actions:
        if action.help == argparse.SUPPRESS or isinstance(
            action, argparse._HelpAction | argparse._SubParsersAction
        ):
            continue
        yield from [f".. option:: {_signature(parser, action)}", ""]
        yield from [*_indented(_escaped(_help(parser, action))), ""]


def _signature(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    formatter = parser._get_formatter()
    if not action.option_strings:
        return formatter._format_args(action, action.metavar or action.dest)
    default = action.dest.upper()
    taken = "" if action.nargs == 0 else f" {formatter._format_args(action, default)}"
    return ", ".join(option + taken for option in action.option_strings)


def _help(parser: argparse.ArgumentParser, action: argparse.Action) -> str:
    words = parser._get_formatter()._expand_help(action) if action.help else ""
    is_told = "default" in words or action.default in (None, False, "", [], argparse.SUPPRESS)
    if not action.option_strings or action.nargs == 0 or is_told:
        return words
    return f"{words} (default {action.default})".strip()


def _escaped(text: str) -> str:
    return re.sub(r"([*`|_\\<>])", r"\\\1", text)


def _indented(text: str) -> list[str]:
    return [f"   {line}" for line in text.rstrip().splitlines()]


class Command(SphinxDirective):
    """``.. command:: PROGRAM``, or a pattern of scripts below the project's root."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return a section for each command and for each of its subcommands."""
        wanted = self.arguments[0]
        scripts = [str(file.relative_to(ROOT)) for file in sorted(ROOT.glob(wanted))]
        sections = []
        for program in scripts or [wanted]:
            self.env.note_dependency(str(ROOT / program))
            parser = parser_of(program)
            for name, command in {program: parser, **subcommands(parser, program)}.items():
                sections.append(self._section(name, command))
        return sections

    def _section(self, name: str, parser: argparse.ArgumentParser) -> nodes.Node:
        section = nodes.section(ids=[nodes.make_id(name)], names=[name])
        section += nodes.title(name, "", nodes.literal(name, name))
        body = nodes.Element()
        self.state.nested_parse(StringList(list(lines_of(parser, name)), source=name), 0, body)
        section += body.children
        return section


def setup(app: Sphinx) -> dict[str, bool]:
    """Add the directive."""
    app.add_directive("command", Command)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
