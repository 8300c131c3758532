"""What camera paths are weighed against: light subpaths that bring the same light.

`hybrid_rt.integrators.kernels.light_paths` derives the weights.
"""

from hybrid_rt.integrators.kernels.connections import CONNECT_CHANCE
from hybrid_rt.shading.kernels.bsdf import is_behind
from hybrid_rt.shading.kernels.emitter import density_of_light_path
from hybrid_rt.shading.kernels.light_kinds import SURFACE
from hybrid_rt.shading.kernels.scatter import Rivals, rival_after
from meshing.kernels.jit import inlined


@inlined
def is_passed_on(world, material, depth, light):
    """Tell whether light subpaths bring what a vertex of a camera path got straight from a light.

    Parameters
    ----------
    world : World
    material : int
        Of the vertex; only narrow ones pass light on.
    depth : int
        Vertices before that one. They would have to be connected to the first.
    light : int
        The number of lights for the environment.
    """
    if depth == 0 or light == world.lights.kind.size or world.lights.kind[light] == SURFACE:
        return False
    return world.narrow[material]


@inlined
def density_before(world, rules, paths, material, depth, camera_pdf):
    """Return `Rivals.before` of a vertex: above zero if a light vertex there would be connected to the path.

    Parameters are those of `hybrid_rt.integrators.kernels.path_vertex.leave_vertex`, and the vertex's
    ``material``.
    """
    if depth == 0:
        return camera_pdf / rules.n_light_paths
    if world.narrow[material] or paths.pdf[0] == 0.0:
        return 0.0
    if paths.has_met_wide[0] and world.narrow[world.material_of[paths.source_id[0]]]:
        return 0.0
    # Of the light vertices of a pass, `of_use` a path, one is connected to, with a probability of
    # CONNECT_CHANCE.
    return paths.pdf[0] * (rules.of_use / CONNECT_CHANCE)


@inlined
def weight_against_light_paths(world, paths, vertex, vertices, light, x, y, z, density, pdf):
    """Return what the weight of next-event estimation is multiplied by for the light that `is_passed_on`.

    Parameters
    ----------
    x, y, z : float
        Unit direction to the point of the light.
    density, pdf : float
        pdf per solid angle of next-event estimation and of BSDF sampling, which are weighted already.
    """
    hit = vertex.hit
    rivals = Rivals(hit.t, vertex.before, world.is_smooth, hit.object_id, paths.rival)
    is_through = is_behind(hit.normal, paths.directions, 0, x, y, z)
    stack = vertex.beyond if is_through and vertex.beyond.size else paths.media
    rival = rival_after(world.lobes, vertices, 0, rivals, x, y, z, pdf, is_through, stack)
    if rival == 0.0:
        return 1.0
    leaving = density_of_light_path(world.lights, light, 0.0, stack, 0, world.lobes)
    # In this order no infinity, of a rival that is next to nothing, meets a zero.
    by_light_path = pdf * (leaving / rival) / density
    others = 1.0 + (pdf / density) ** 2
    return others / (others + by_light_path * by_light_path)
