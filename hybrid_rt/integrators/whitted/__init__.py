"""Whitted ray tracing: direct light, mirrors, both reflection and refraction at glass."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid_rt.integrators.declaration import Declaration

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
    # Metals only show what lies about the mirrored direction: lights are not sampled there.
    finds=lambda _: "[LPK]D[GS]*E|[LUK][GS]*E",
    asks_every_light=True,
    follows_every_branch=True,
    without_light_paths="both branches at glass are followed; light that mirrors and glass throw is not found",
)
