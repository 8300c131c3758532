"""Ways to compute a picture from a scene and an intersector, by name."""

from hybrid_rt.integrators.integrator import Integrator, RenderContext
from hybrid_rt.integrators.options import PathOptions
from hybrid_rt.integrators.path import PathTracer
from hybrid_rt.integrators.whitted import Whitted

INTEGRATORS: dict[str, type[Integrator]] = {"path": PathTracer, "whitted": Whitted}
OPTIONS: dict[str, type | None] = {"path": PathOptions, "whitted": None}

__all__ = ["INTEGRATORS", "OPTIONS", "Integrator", "PathOptions", "RenderContext"]
