"""The precision of flint's balls, one thread at a time: flint has one for all (needs python-flint)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from threading import RLock

_LOCK = RLock()


@contextmanager
def bits(number: int) -> Iterator[None]:
    """Work with balls of so many bits."""
    import flint

    with _LOCK:
        before, flint.ctx.prec = flint.ctx.prec, number
        try:
            yield
        finally:
            flint.ctx.prec = before
