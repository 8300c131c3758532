"""Messages for keywords that a function or a class does not take."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

from hybrid_rt.core.other_names import like

T = TypeVar("T", bound=Callable[..., Any])


def explains(**meant: str) -> Callable[[T], T]:
    """Return a decorator: calls with a keyword that does not exist are told what is meant by it.

    Parameters
    ----------
    **meant : str
        What to pass instead, by the names that other programs have for it. Misspelled names need not
        be given.
    """

    def decorate(target: T) -> T:
        inner = cast(Any, target).__init__ if isinstance(target, type) else target
        takes = [
            name for name in inspect.signature(inner).parameters if name not in ("self", "cls")
        ]

        @functools.wraps(inner)
        def call(*values: Any, **keywords: Any) -> Any:
            for name in keywords:
                if name not in takes:
                    raise TypeError(
                        f"{target.__qualname__} has no argument {name!r}: {_instead(name, takes, meant)}"
                    )
            return inner(*values, **keywords)

        if not isinstance(target, type):
            return cast(T, call)
        cast(Any, target).__init__ = call
        return target

    return decorate


def _instead(name: str, takes: list[str], meant: dict[str, str]) -> str:
    if name in meant:
        return f"pass {meant[name]}"
    return like(name, takes) or f"it takes {', '.join(takes)}"
