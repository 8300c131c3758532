"""What a misspelt name in a scene script was meant to be, or an option that no command has.

Python itself suggests names only where it prints a traceback, and suggests none for arguments and
options.
"""

from __future__ import annotations

import builtins
import inspect
import re
from collections.abc import Iterable
from contextlib import suppress
from difflib import get_close_matches
from types import TracebackType
from typing import Any

from hybrid_rt.core.other_names import instead

_NO_SUCH_ARGUMENT = re.compile(r"([\w.]+)\(\) got an unexpected keyword argument '(\w+)'")
# What other renderers call it.
_OPTION_OF = {
    "--samples": "--passes",
    "--samples-per-pixel": "--passes",
    "--spp": "--passes",
    "--iterations": "--passes",
    "--bounces": "--max-depth",
    "--max-bounces": "--max-depth",
    "--depth": "--max-depth",
    "--size": "--width",
    "--resolution": "--width",
}


def option_suggestion(message: str, known: Iterable[str]) -> str:
    """Return ": did you mean ...?" for the first unknown option that resembles a known one, or "".

    Parameters
    ----------
    message : str
        Of argparse: "unrecognized arguments: ...".
    known : iterable of str
        Options of the command, "--passes" and so on.
    """
    known = [option for option in known if option.startswith("--")]
    for word in message.partition(": ")[2].split():
        wrong = word.partition("=")[0].lower()
        if not wrong.startswith("--"):
            continue
        near = [_OPTION_OF.get(wrong, ""), *get_close_matches(wrong, known, n=1)]
        for option in near:
            if option in known:
                return f": did you mean {option}?"
    return ""


def suggestion(error: BaseException) -> str:
    """Return ": did you mean ...?" for a name, attribute or argument that is misspelt, or "".

    Of an argument that resembles none it says which ones there are.

    Parameters
    ----------
    error : BaseException
        As it was caught, with its traceback.
    """
    with suppress(Exception):  # whatever is wrong here must not hide the error
        wrong, known = _wrong_and_known(error)
        if not wrong:
            return ""
        known = [name for name in known if name[:1] != "_"]
        meant = "" if isinstance(error, TypeError) else instead(wrong, ())
        if meant or "did you mean" in str(error):
            return "" if meant in str(error) else f": {meant}"
        near = get_close_matches(wrong, known, n=1)
        if near:
            return f": did you mean {near[0]!r}?"
        return f": it takes {', '.join(known)}" if isinstance(error, TypeError) and known else ""
    return ""


def _wrong_and_known(error: BaseException) -> tuple[str | None, Iterable[str]]:
    """Return the word that is wrong, and the words that would have been right."""
    if isinstance(error, NameError):
        return error.name, _names(error.__traceback__)
    if isinstance(error, AttributeError):
        return error.name, dir(error.obj)
    called = _NO_SUCH_ARGUMENT.search(str(error)) if isinstance(error, TypeError) else None
    if called is None:
        return "", []
    names = _names(error.__traceback__)
    return called[2], inspect.signature(names[called[1].partition(".")[0]]).parameters


def _names(trace: TracebackType | None) -> dict[str, Any]:
    """Return everything that has a name where an error was raised."""
    if trace is None:
        return {}
    while trace.tb_next is not None:
        trace = trace.tb_next
    return vars(builtins) | trace.tb_frame.f_globals | trace.tb_frame.f_locals
