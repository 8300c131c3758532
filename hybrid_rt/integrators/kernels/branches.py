"""Both branches of a camera path at glass that the camera sees, straight or by way of glass and mirrors.

A path that chooses reflection by its reflectance, 0.04 at glass, and then meets a lamp adds the
lamp's whole radiance to one pixel in 25. Here both branches are followed, each with its share (Arvo
and Kirk, "Particle transport and image synthesis", SIGGRAPH 1990). Behind the first surface that
spreads light, one branch is chosen: light arrives there from many directions anyway.
"""

from hybrid_rt.integrators.kernels.compaction import copy_path
from hybrid_rt.integrators.kernels.glass_and_mirrors import note_step
from hybrid_rt.shading.kernels.bsdf import leaves_through_face
from hybrid_rt.shading.kernels.fresnel import mirrored
from hybrid_rt.shading.kernels.lobes.dielectric import reflectance_ahead
from hybrid_rt.shading.kernels.medium_stack import filling_medium, ior_of
from meshing.kernels.jit import inlined

# Of one camera ray. The reflected branch itself chooses.
MOST_SPLITS = 2
# Less than this of a camera ray is no branch of its own.
LEAST_SHARE = 0.02
# The largest number below 1: a choice that is refraction.
LAST = 1.0 - 2.0**-53


@inlined
def carried_outside(world, paths):
    """Return the largest channel of what a path carries, in glass as it will be outside again."""
    left = paths.throughput
    carried = max(left[0, 0], left[0, 1], left[0, 2])
    if paths.media.shape[1] > 0:
        # See `hybrid_rt.shading.kernels.scatter.scatter_one`.
        carried *= ior_of(world.lobes, filling_medium(paths.media, 0, world.lobes)) ** 2
    return carried


@inlined
def reflected_share(world, rules, paths, vertex, depth):
    """Return the reflectance at glass of which both branches are followed; 0: one is chosen."""
    glass = world.split_glass_of[vertex.material[0]]
    if glass < 0 or paths.splits[0] == 0 or paths.carried[0] > 0.0 or depth >= rules.max_depth:
        return 0.0
    normal, d = vertex.hit.normal, paths.directions
    cosine = normal[0, 0] * d[0, 0] + normal[0, 1] * d[0, 1] + normal[0, 2] * d[0, 2]
    share = reflectance_ahead(
        world.lobes, glass, paths.media, 0, abs(cosine), vertex.hit.front_face[0], vertex.second
    )
    carried = carried_outside(world, paths)
    return share if carried * min(share, 1.0 - share) >= LEAST_SHARE else 0.0


@inlined(cached=True)
def split_off_reflected(world, paths, vertex, share, branch):
    """Divide a path at glass: write the reflected part, and leave the rest; tell whether it goes on.

    ``paths`` keeps what is refracted, which has not left yet: the choice of ``vertex`` is refraction then.
    ``branch``, Paths of one row, is written; ``share`` is its reflectance.
    """
    hit, d = vertex.hit, paths.directions
    vertex.choice[0, 0] = LAST
    paths.splits[0] -= 1
    copy_path(paths, 0, branch, 0)
    branch.splits[0] = 0
    branch.pdf[0] = 0.0
    normal = hit.normal
    x, y, z = mirrored(d[0, 0], d[0, 1], d[0, 2], normal[0, 0], normal[0, 1], normal[0, 2])
    for k in range(3):
        branch.throughput[0, k] *= share
        paths.throughput[0, k] *= 1.0 - share
        branch.origins[0, k] = hit.position[0, k]
    if branch.connection_pdf.size:
        branch.joined[0] = False
        if world.is_smooth[hit.object_id[0]]:
            branch.connection_pdf[0] = 0.0
    vertex.onward[0, 0], vertex.onward[0, 1], vertex.onward[0, 2] = x, y, z
    if branch.chain.size:
        note_step(world, branch, vertex, False, normal)
    branch.source_id[0] = hit.object_id[0]
    branch.directions[0, 0], branch.directions[0, 1], branch.directions[0, 2] = x, y, z
    # The interpolated normal of a mesh may reflect into the face.
    return not leaves_through_face(vertex.geometric, 0, d, x, y, z)
