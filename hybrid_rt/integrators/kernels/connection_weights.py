"""MIS weights of camera paths against connections to light subpaths, which find the same light.

`hybrid_rt.integrators.kernels.light_paths` derives the weights.
"""

from hybrid_rt.shading.kernels.bsdf import is_behind
from hybrid_rt.shading.kernels.emitter import density_of_light_path
from hybrid_rt.shading.kernels.light_kinds import SURFACE
from hybrid_rt.shading.kernels.scatter import connection_pdf_after
from meshing.kernels.jit import inlined

# Connections find little light, evenly: at every hit they would cost as much as the lamps. On the
# Cornell box a quarter costs 4 % in variance and saves a fifth of the time.
CONNECT_CHANCE = 0.25


@inlined
def is_found_by_light_paths(world, material, depth, light):
    """Return whether light subpaths also sample the direct light at a vertex of a camera path.

    ``material`` is that of the vertex: only narrow ones pass light on. ``depth`` are the vertices before: they
    would have to be connected to the first. ``light`` is the number of lights for the environment.
    """
    if depth == 0 or light == world.lights.kind.size or world.lights.kind[light] == SURFACE:
        return False
    return world.narrow[material]


@inlined
def arrival_pdf(world, rules, paths, material, depth, camera_pdf):
    """Return `ConnectionPdf.arrival` of a vertex: 0 if a light vertex there is not connected to the path.

    See `hybrid_rt.integrators.kernels.path_vertex.leave_vertex`.
    """
    if depth == 0:
        return camera_pdf / rules.n_light_paths
    if world.narrow[material] or paths.pdf[0] == 0.0:
        return 0.0
    if paths.has_met_wide[0] and world.narrow[world.material_of[paths.source_id[0]]]:
        return 0.0
    # Each pass has `vertices_per_path` light vertices per light subpath; a camera vertex is connected to
    # one of them, with a probability of CONNECT_CHANCE.
    return paths.pdf[0] * (rules.vertices_per_path / CONNECT_CHANCE)


@inlined
def weight_against_light_paths(world, vertices, lit, connection, i, light, x, y, z, density, pdf):
    """Return the factor on the MIS weight of next-event estimation for light that light subpaths find.

    Parameters
    ----------
    lit : Receivers
    connection : ConnectionPdf
    i : int
        Row of the vertex.
    x, y, z : float
        Unit direction to the point of the light.
    density, pdf : float
        pdf per solid angle of next-event estimation and of BSDF sampling, which are weighted already.
    """
    is_through = is_behind(vertices.normal, vertices.direction, i, x, y, z)
    stack = lit.beyond if is_through and lit.beyond.size else lit.media
    connection_pdf = connection_pdf_after(
        world.lobes, vertices, i, connection, x, y, z, pdf, is_through, stack
    )
    if connection_pdf == 0.0:
        return 1.0
    leaving = density_of_light_path(world.lights, light, 0.0, stack, i, world.lobes)
    # In this order no infinity, of a tiny connection_pdf, meets a zero.
    by_light_path = pdf * (leaving / connection_pdf) / density
    others = 1.0 + (pdf / density) ** 2
    return others / (others + by_light_path * by_light_path)
