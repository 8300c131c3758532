"""Whitted ray tracing: direct light, mirrors, both reflection and refraction at glass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid_rt.integrators.declaration import Declaration
from hybrid_rt.integrators.techniques import FOUND_BY_WHITTED, paths_found

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers


def _make(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.whitted.whitted import Whitted
    from hybrid_rt.integrators.workers import Workers

    return Workers(context, threads, Whitted)


WHITTED = Declaration(
    name="whitted",
    make=_make,
    finds=lambda _: paths_found(FOUND_BY_WHITTED),
    asks_every_light=True,
    follows_every_branch=True,
    without_light_paths="both branches at glass are followed; light that mirrors and glass throw is not found",
)
