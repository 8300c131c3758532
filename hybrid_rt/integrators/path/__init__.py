"""Path tracing: camera paths, and light subpaths connected to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid_rt.integrators.declaration import Declaration, OtherWay
from hybrid_rt.integrators.options import PathOptions

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers


def _make(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.path.path_tracer import PathTracer
    from hybrid_rt.integrators.workers import Workers

    return Workers(context, threads, PathTracer)


def _finds(options: PathOptions) -> str:
    # A lamp without area is never run into: it is found where a surface that spreads light asks it.
    asked = "" if options.strategy == "directions" else "|P[DG][DGS]*E"
    return f"[LUK][DGS]*E{asked}"


PATH = Declaration(
    name="path",
    make=_make,
    finds=_finds,
    options=PathOptions,
    other_way=OtherWay("never asking a light", PathOptions(strategy="directions")),
    follows_single_paths=True,
)
