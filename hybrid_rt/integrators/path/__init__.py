"""Path tracing: camera paths, and light subpaths connected to them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from hybrid_rt.integrators.declaration import Declaration, OtherWay
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.techniques import found_by_path, paths_found

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers


def _make(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.path.path_tracer import PathTracer
    from hybrid_rt.integrators.workers import Workers

    return Workers(context, threads, PathTracer)


PATH = Declaration(
    name="path",
    make=_make,
    finds=lambda options: paths_found(found_by_path(options.strategy, subpaths=False)),
    options=PathOptions,
    other_way=OtherWay("never asking a light", PathOptions(strategy="directions")),
    follows_single_paths=True,
)
