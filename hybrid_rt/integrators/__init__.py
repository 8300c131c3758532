"""Integrators by name: path tracing, Whitted ray tracing, photon mapping (PPM, photon map)."""

from hybrid_rt.integrators.declaration import Declaration
from hybrid_rt.integrators.options import Options, PathOptions, PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.path import PATH
from hybrid_rt.integrators.photons import PHOTON_MAP, PPM
from hybrid_rt.integrators.whitted import WHITTED

# The first is what a command line takes that names none.
INTEGRATORS: dict[str, Declaration] = {
    declared.name: declared for declared in (PATH, WHITTED, PPM, PHOTON_MAP)
}
DEFAULT = PATH.name
# Those of the package; scene scripts may declare others.
OWN = tuple(INTEGRATORS)

__all__ = [
    "DEFAULT",
    "INTEGRATORS",
    "OWN",
    "Declaration",
    "Options",
    "PPMOptions",
    "PathOptions",
    "PhotonMapOptions",
]
