"""Which technique finds which light: classes of light paths x techniques x weights, for each integrator.

A class is a regular expression in the notation of `hybrid_rt.integrators.light_found`: the light, the surfaces
that it meets, the eye. Each path falls into one class at most; what falls into none is not found. The techniques of
a class all sample its paths, and the power heuristic (Veach 1997) weights them to one. A class that
only one technique samples counts whole. So no light counts twice, and none is lost.

`tests/hybrid_rt/integrators/test_techniques.py` holds these tables against what the kernels do.
"""

from typing import NamedTuple

EMISSION = "BSDF sampling runs into the light"
NEXT_EVENT = "next-event estimation"
# A light subpath, connected to the camera or to a vertex of a camera path: see
# `hybrid_rt.integrators.kernels.light_paths`.
SUBPATH = "light subpath"
# A light vertex chosen among many, see `hybrid_rt.integrators.kernels.connections.choose_far`.
FAR_CONNECTION = "connection between distant diffuse surfaces"
# By way of one ball, box or flat mirror, see `hybrid_rt.integrators.kernels.ways`.
SPECULAR_NEXT_EVENT = "next-event estimation by way of mirrors and glass"
PHOTONS = "photon density estimation"


# A regular expression that nothing fits.
NO_PATH = "(?!)"


class Found(NamedTuple):
    """A class of light paths, and the techniques that are weighted to one there."""

    paths: str
    techniques: tuple[str, ...]


# What light subpaths bring, behind the light: from the last wide surface on whose way a mirror, a lens or a
# narrow surface came last, to the eye, to a wide surface, or to a narrow one that the eye sees by way of
# narrow and delta lobes alone; and from narrow surfaces that come behind a delta lobe, to the eye.
_CAUSTIC = "(?:{0}D)(?:[SG]+D)*(?:E|D[DGS]*E|G[SG]*E|S[SG]*GE)|{0}GE"
CAUSTIC = f"(?:{_CAUSTIC.format('[SG]+')})"
# Points of meshes, patches and turned bodies are sampled otherwise by next-event estimation than light
# subpaths leave them, so the first surface is no narrow one.
CAUSTIC_OF_SURFACE = f"(?:{_CAUSTIC.format('S[SG]*')})"


def found_by_path(
    strategy: str,
    *,
    subpaths: bool,
    of_surface: bool = False,
    far: bool = False,
    by_way: str = "",
) -> tuple[Found, ...]:
    """Return what the integrator "path" finds by a strategy of `PathOptions`.

    ``subpaths``: light subpaths are traced. ``of_surface``: lights ``L`` are emissive meshes, patches or turned
    bodies. ``far``: connections find light between diffuse surfaces; ``F`` between two of these stands
    for a long way. ``by_way``: the lights that all surfaces reach for by way of mirrors and glass: ``L`` where
    light subpaths are of no use, ``K`` if it is bright in few directions. Such an S next to the light is a
    body by way of which lights can be sampled.
    """
    if strategy == "directions":
        return (Found("[LUK][DGS]*E", (EMISSION,)),)
    both = (EMISSION, NEXT_EVENT) if strategy == "both" else (NEXT_EVENT,)
    found = (
        Found("U[DGS]*E", (EMISSION,)),
        Found("P[DG][DGS]*E", (NEXT_EVENT,)),
        *_without_subpaths("K", both, "S[DG]" if "K" in by_way else NO_PATH),
    )
    if not subpaths:
        return (*found, *_without_subpaths("L", both, "S[DG]" if "L" in by_way else NO_PATH))
    caustic = CAUSTIC_OF_SURFACE if of_surface else CAUSTIC
    near = "(?!.*F)" if far else ""
    found = (
        *found,
        # Where a mirror or lens is next to the light, and another one next to the surface that it throws light
        # onto, light subpaths leave a gap.
        *_without_subpaths(f"L{near}(?!{caustic})", both, "S[DG]S"),
        Found(f"L{near}(?={caustic})S[DGS]*E", (EMISSION, SUBPATH)),
        Found(f"L{near}(?={caustic})G[DGS]*E", (EMISSION, NEXT_EVENT, SUBPATH)),
    )
    return (*found, Found("L[DGSF]*DFD[DGSF]*E", (FAR_CONNECTION,))) if far else found


def _without_subpaths(light: str, both: tuple[str, ...], by_way: str) -> tuple[Found, ...]:
    """Return what is found of a light; ``by_way``: surfaces next to it that it is sampled by way of."""
    return (
        Found(f"{light}(?!{by_way})(?:S[DGS]*)?E", (EMISSION,)),
        Found(f"{light}{by_way}[DGS]*E", (EMISSION, SPECULAR_NEXT_EVENT)),
        Found(f"{light}[DG][DGS]*E", both),
    )


# Metals only show what lies about the mirrored direction: lights are not sampled there.
FOUND_BY_WHITTED = (
    Found("[LUK][GS]*E", (EMISSION,)),
    Found("[LPK]D[GS]*E", (NEXT_EVENT,)),
)

# Lights are sampled, and photons gathered, where light is spread widely; metals sample lights too, but
# photons do not stay on them. What runs into a lamp needs neither.
FOUND_BY_PHOTONS = (
    Found("[LUK](?:S[GS]*)?E", (EMISSION,)),
    Found("[LK]G[GS]*E", (EMISSION, NEXT_EVENT)),
    Found("UG[GS]*E", (EMISSION,)),
    Found("PG[GS]*E", (NEXT_EVENT,)),
    Found("[LPK]D[GS]*E", (NEXT_EVENT,)),
    # Scenes with planes that shine, U, are refused.
    Found("[LPK][DGS]+D[GS]*E|U[DGS]*D[GS]*E", (PHOTONS,)),
)


def paths_found(found: tuple[Found, ...]) -> str:
    """Return the regular expression of all classes together."""
    return "|".join(of_class.paths for of_class in found)
