"""Ways to compute a picture from a scene and an intersector, by name."""

from collections.abc import Callable

from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import Integrator
from hybrid_rt.integrators.options import PathOptions, PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.path.path_tracer import PathTracer
from hybrid_rt.integrators.whitted.whitted import Whitted
from hybrid_rt.integrators.workers import Workers


def _path(context: RenderContext, threads: int) -> Workers:
    return Workers(context, threads, PathTracer)


def _whitted(context: RenderContext, threads: int) -> Workers:
    return Workers(context, threads, Whitted)


def _ppm(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.photons.ppm import ProgressiveWorkers

    return ProgressiveWorkers(context, threads)


def _photon_map(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.photons.photon_map import PhotonMapWorkers

    return PhotonMapWorkers(context, threads)


# What makes the threads of a render: for each integrator, from the context and their number.
INTEGRATORS: dict[str, Callable[[RenderContext, int], Workers]] = {
    "path": _path,
    "whitted": _whitted,
    "ppm": _ppm,
    "photon_map": _photon_map,
}
OPTIONS: dict[str, type | None] = {
    "path": PathOptions,
    "whitted": None,
    "ppm": PPMOptions,
    "photon_map": PhotonMapOptions,
}
# What `render` takes as options.
Options = PathOptions | PPMOptions | PhotonMapOptions

__all__ = [
    "INTEGRATORS",
    "OPTIONS",
    "Integrator",
    "Options",
    "PPMOptions",
    "PathOptions",
    "PhotonMapOptions",
    "RenderContext",
]
