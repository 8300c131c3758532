"""Ways to compute a picture from a scene and an intersector, by name."""

from hybrid_rt.integrators.integrator import Integrator, RenderContext
from hybrid_rt.integrators.whitted import Whitted

INTEGRATORS: dict[str, type[Integrator]] = {"whitted": Whitted}

__all__ = ["INTEGRATORS", "Integrator", "RenderContext", "Whitted"]
