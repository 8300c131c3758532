"""One vertex of a camera path, from the hit to the direction that it goes on in.

The pieces are those of `hybrid_rt.shading.kernels`: here is said in which order they are called. The loop that
calls them is `hybrid_rt.integrators.kernels.followed_paths`.
"""

from typing import Any, NamedTuple

import numpy as np

from hybrid_rt.integrators.kernels import by_mirrors, through_boxes, through_spheres
from hybrid_rt.integrators.kernels.branches import (
    carried_outside,
    reflected_share,
    split_off_reflected,
)
from hybrid_rt.integrators.kernels.connection_weights import (
    arrival_pdf,
    is_found_by_light_paths,
)
from hybrid_rt.integrators.kernels.connections import (
    NONE,
    choose_far,
    connect,
    connect_to_light_vertex,
)
from hybrid_rt.integrators.kernels.glass_and_mirrors import (
    note_step,
    sample_specular,
    weight_of_emission,
)
from hybrid_rt.integrators.kernels.light_sampling import (
    NOTHING,
    Receivers,
    choose_light,
    sample_light,
)
from hybrid_rt.integrators.kernels.vertex_points import (
    CHOICE,
    CONNECT,
    DIRECTION,
    FAR,
    TO_LIGHT,
)
from hybrid_rt.shading.kernels.bsdf import Vertices
from hybrid_rt.shading.kernels.emitter import Met, light_on_ray
from hybrid_rt.shading.kernels.lobes.register import DELTA, EVERY, SPREADS
from hybrid_rt.shading.kernels.medium_stack import (
    cross_medium,
    look_beyond_one,
)
from hybrid_rt.shading.kernels.scatter import (
    ABSORBED,
    LEFT,
    SCATTERED,
    SPECULAR,
    STOPPED,
    ConnectionPdf,
    scatter_one,
)
from hybrid_rt.shading.kernels.texture import texture_color
from meshing.kernels.jit import inlined

# Shadow rays of a vertex at most, without and with those by way of mirrors and glass: to a lamp, and of
# both kinds of connections.
FEW_SHADOW_RAYS = 3
MOST_SHADOW_RAYS = (
    FEW_SHADOW_RAYS + through_spheres.MOST_RAYS + through_boxes.MOST_RAYS + by_mirrors.MOST_RAYS
)


class World(NamedTuple):
    """What a scene holds, as paths read it."""

    material_of: Any  # (surfaces,) int32; `NOTHING` for lights
    light_of: Any  # (surfaces,) int32; `NOTHING` for what does not shine
    surface_of_light: Any  # (lights,) int32
    lobes: Any  # LobeTable
    color_factor: Any  # (lobes,) float64
    glass_of: Any  # (materials,) int32, dielectric lobe
    split_glass_of: (
        Any  # (materials,) int32, its only lobe if that is smooth glass; `NOTHING`: another
    )
    rough_glass_of: Any  # (materials,) int32, its dielectric lobe if that is rough; (0,): none is
    textures: Any  # TextureTable
    meshes: Any  # MeshPoints
    lights: Any  # LightTable
    light_cdf: Any  # (lights + 1,) float64, cumulative distribution of the lights
    sky: Any  # EnvironmentTable
    diffuse_only: Any  # (materials,) bool, no other lobes spread light
    narrow: Any  # (materials + 1,) bool, see `hybrid_rt.integrators.kernels.light_paths`
    is_smooth: Any  # (objects,) bool, interpolated shading normals; (0,) without light paths
    light_vertices: Any  # LightVertices
    candidates: Any  # (groups, CANDIDATE_COLUMNS, CANDIDATES) float64, see `choose_far`
    first_of_pass: Any  # (passes + 1,) int64, rows of `light_vertices`
    first_group: Any  # (passes + 1,) int64, rows of `candidates`
    balls: Any  # Balls
    boxes: Any  # Boxes
    mirrors: Any  # Mirrors


class Rules(NamedTuple):
    """Settings of the integrator; what follows from the plan."""

    seed: Any  # uint64
    first_dimension: Any  # uint64, of the random numbers of the first vertex
    follows: Any  # bool, each path is followed to its end before the next begins
    strategy: Any  # int, see `hybrid_rt.shading.kernels.emitter`
    samples_lights: Any  # bool, next-event estimation
    has_sky: Any  # bool
    has_light_paths: Any  # bool
    # int, lights that next-event estimation by way of mirrors and glass samples at all vertices: see
    # `hybrid_rt.integrators.kernels.ways`
    specular_lights: Any
    rr_radiance: Any  # float, radiance, see `factor_of_taken`
    n_light_paths: Any  # float, light subpaths of a pass
    min_distance: Any  # float, see `choose_far`
    vertices_per_path: Any  # float, expected number of light vertices per light subpath
    max_depth: Any  # int
    roulette_depth: Any  # int
    survival: Any  # float
    samples_last_vertex: Any  # bool, non-delta lobes are followed at the last vertex


class Vertex(NamedTuple):
    """Where a path has arrived; one row."""

    hit: Any  # Record
    geometric: Any  # (1, 3) float64, the geometric normal if ``hit.normal`` is another; else (0, 3)
    second: Any  # (1,) int32, or (0,), see `hybrid_rt.shading.kernels.medium_stack`
    light_point: Any  # LightPoints of one row; none where no light is of kind `SURFACE`
    material: Any  # (1,) int32
    colors: Any  # (1, lobes of a material at most, 3) float64
    ratio: Any  # (1,) float64, or (0,) without rough glass
    beyond: Any  # (1, STACK) int32, or (0, 0): media beyond rough glass
    xi: Any  # (1, 2) float64, samples the direction
    choice: Any  # (1, 2) float64, samples the lobe and survival
    onward: Any  # (1, 3) float64, the sampled direction
    target_pdf: Any  # (CANDIDATES,) float64, see `choose_far`
    arrival_pdf: Any  # (1,) float64, see `ConnectionPdf.arrival`
    found: Any  # (MOST_WAYS,) float64, see `sample_through_spheres`


class Block(NamedTuple):
    """Camera rays."""

    pixel: Any  # (n,) uint64; with the sample it names the path's random numbers
    sample: Any  # (n,) uint64
    origins: Any  # (n, 3) float64
    directions: Any  # (n, 3) float64, unit
    media: Any  # (STACK,) int32, or (0,): the medium stack that they begin in
    # What they are weighed against light paths by; (0,) without.
    camera_pdf: Any  # (n,) float64, see `hybrid_rt.sensor.projection.Projection.direction_pdf`
    pass_number: Any  # (n,) int64, among the passes that are traced together


class Tally(NamedTuple):
    """What is counted."""

    fates: Any  # (5,) int64, see `hybrid_rt.shading.kernels.scatter`
    # (3,) float64: number of paths that the depth limit ended, what they carried (see `carried_outside`), and
    # what all paths carried behind the first surface that spreads light, or to the end if there was none
    lost: Any
    unclosed: Any  # (lobes,) int64, see `cross_medium`
    # Of rays that are traced one by one:
    status: Any  # (3,) int64, first hits by `Status`
    hits: Any  # (3,) int64: rays that hit, those of the camera, those without a bound
    shadow: Any  # (1,) int64: shadow rays
    bound: Any  # (1,) float64, largest finite `t_bound` of a camera ray


@inlined
def absorbed_on_the_way(world, paths, vertex, unclosed):
    """Attenuate throughput by the Beer-Lambert law; set the material of the hit."""
    hit = vertex.hit
    vertex.material[0] = NOTHING
    if hit.object_id[0] >= 0:
        vertex.material[0] = world.material_of[hit.object_id[0]]
    if paths.media.shape[1] == 0:
        return
    r, g, b = cross_medium(
        paths.media, 0, world.lobes, world.glass_of, vertex.material[0], hit.front_face[0],
        vertex.second, hit.t[0], unclosed,
    )  # fmt: skip
    paths.throughput[0, 0] *= r
    paths.throughput[0, 1] *= g
    paths.throughput[0, 2] *= b


@inlined(cached=True)
def emitted(world, rules, paths, vertex, depth, pdf_area):
    """Return the radiance that the ray has run into, MIS-weighted.

    ``depth`` is the number of vertices before; ``pdf_area`` is the density of choosing the point on a light
    of kind `SURFACE`.
    """
    hit, light = vertex.hit, NOTHING
    if hit.object_id[0] < 0:
        if rules.has_sky:
            light = world.lights.kind.size
    elif hit.front_face[0]:  # a light's back is black
        light = world.light_of[hit.object_id[0]]
    if light < 0:
        return 0.0, 0.0, 0.0
    # Lamps are sampled by area: it is the face that is seen foreshortened, however it is shaded.
    face = vertex.geometric if vertex.geometric.shape[0] else hit.normal
    met = Met(hit.t, hit.u, hit.v, hit.position, face)
    connection_pdf = 0.0
    if paths.connection_pdf.size:
        # Behind delta lobes light subpaths are the only other technique; behind others it takes a narrow surface.
        source = paths.source_id[0]
        if paths.pdf[0] == 0.0 or is_found_by_light_paths(
            world, world.material_of[source], depth - 1, light
        ):
            connection_pdf = paths.connection_pdf[0]
    r, g, b = light_on_ray(
        world.lights, world.sky, world.textures, light, 0, met, paths.origins, paths.directions,
        paths.pdf[0], pdf_area, connection_pdf, paths.media, world.lobes, rules.strategy,
    )  # fmt: skip
    if paths.chain.size:
        weight = weight_of_emission(world, paths, hit.t[0], face, light)
        return weight * r, weight * g, weight * b
    return r, g, b


@inlined
def look_up_surface(world, paths, vertex):
    """Look up the colours of the lobes and what lies beyond; tell which lobes there are.

    Returns whether one is not a delta, and whether one is.
    """
    hit, material, lobes = vertex.hit, vertex.material[0], world.lobes
    spreads = mirrors = False
    first = lobes.first[material]
    for j in range(lobes.first[material + 1] - first):
        spreads |= lobes.traits[first + j] & SPREADS != 0
        mirrors |= lobes.traits[first + j] & DELTA != 0
        r, g, b = texture_color(
            world.textures, lobes.texture[first + j], hit.u[0], hit.v[0],
            hit.position[0, 0], hit.position[0, 1], hit.position[0, 2],
        )  # fmt: skip
        part = world.color_factor[first + j]
        vertex.colors[0, j, 0] = part * r
        vertex.colors[0, j, 1] = part * g
        vertex.colors[0, j, 2] = part * b
    if vertex.ratio.size:
        vertex.ratio[0] = look_beyond_one(
            lobes, world.rough_glass_of[material], paths.media, 0, hit.front_face[0],
            vertex.second, vertex.beyond,
        )  # fmt: skip
    return spreads, mirrors


@inlined(cached=True)
def leave_vertex(
    world, rules, paths, vertex, depth, camera_pdf, number, points, column, branch, rays, n
):
    """Next-event estimation and connections at a vertex, then sample the BSDF.

    Parameters
    ----------
    world : World
    rules : Rules
    paths : Paths of one row
        Becomes the ray that goes on.
    vertex : Vertex
    depth : int
        Vertices before this one.
    camera_pdf : float
        pdf per solid angle of the camera ray's direction; read if there are light paths.
    number : int
        Index of the pass among those of `World.first_of_pass`.
    points : RunPoints
    column : int
        Of this vertex among them.
    branch : Paths of one row
        Written if both branches at glass are followed.
    rays : ShadowRays
        Up to `MOST_SHADOW_RAYS` rows are written from row n on.

    Returns
    -------
    fate : int, see `hybrid_rt.shading.kernels.scatter`
    n : int, rows of ``rays``
    has_branch : bool
        Whether ``branch`` goes on as well.
    """
    hit, xi = vertex.hit, points.xi
    spreads, mirrors = look_up_surface(world, paths, vertex)
    diffuse_only = rules.has_light_paths and world.diffuse_only[vertex.material[0]]
    # What this surface sends back along a far ray is known already, but for that of delta lobes.
    is_known = diffuse_only and paths.joined[0] and hit.t[0] >= rules.min_distance
    if is_known and not mirrors:
        return ABSORBED, n, False
    vertices = Vertices(
        vertex.material, vertex.colors, hit.position, hit.normal, paths.directions,
        vertex.geometric, vertex.ratio,
    )  # fmt: skip
    lit = Receivers(
        paths.camera_ray, hit.object_id, paths.throughput, paths.media, vertex.beyond,
        vertex.light_point,
    )  # fmt: skip
    connection = ConnectionPdf(
        hit.t, vertex.arrival_pdf, world.is_smooth, hit.object_id, paths.connection_pdf
    )
    reaches = spreads and rules.has_light_paths and not is_known and depth < rules.max_depth
    chosen, factor = NONE, 0.0
    if reaches and diffuse_only and rules.min_distance < np.inf:
        # First, so that it has arrived when it is read.
        s, t = xi[0, FAR, column], xi[1, FAR, column]
        chosen, factor = choose_far(world, rules, vertex, vertices, depth, number, s, t)
    # --- direct light
    if rules.has_light_paths:
        vertex.arrival_pdf[0] = arrival_pdf(
            world, rules, paths, vertex.material[0], depth, camera_pdf
        )
    if spreads and rules.samples_lights and not is_known:
        s, t = xi[0, TO_LIGHT, column], xi[1, TO_LIGHT, column]
        light, s = choose_light(world.light_cdf, world.lights.chance, s)
        is_found = rules.has_light_paths and is_found_by_light_paths(
            world, vertex.material[0], depth, light
        )
        n += sample_light(
            world, rules.strategy, EVERY, vertices, lit, 0, light, s, t, 1.0, connection, is_found,
            rays, n,
        )  # fmt: skip
    # --- connections: light of other surfaces, and caustics
    is_narrow = world.narrow[vertex.material[0]]
    if reaches and not (is_narrow and paths.has_met_wide[0]):
        s, t = xi[0, CONNECT, column], xi[1, CONNECT, column]
        n += connect_to_light_vertex(world, rules, vertices, lit, depth, number, s, t, rays, n)
        if chosen != NONE:
            n += connect(world, vertices, lit, chosen, factor, 0.0, rays, n)
    # --- caustics of balls, boxes and flat mirrors
    is_anchored = False
    if spreads and paths.chain.size:
        is_anchored, n = sample_specular(world, rules, paths, vertex, vertices, depth, rays, n)
    # --- where it goes next, and whether it stops
    for k in range(2):
        vertex.xi[0, k] = xi[k, DIRECTION, column]
        vertex.choice[0, k] = xi[k, CHOICE, column]
    is_last, has_branch = depth == rules.max_depth, False
    if paths.media.shape[1] > 0:
        share = reflected_share(world, rules, paths, vertex, depth)
        if share > 0.0:
            has_branch = split_off_reflected(world, paths, vertex, share, branch)
    fate = scatter_one(
        world.lobes, vertices, 0, vertex.xi, vertex.choice, paths.media, vertex.second,
        not is_last or rules.samples_last_vertex, not is_last,
        rules.survival if depth >= rules.roulette_depth else 0.0,
        paths.carried[0], connection, vertex.onward, paths.throughput, paths.pdf,
    )  # fmt: skip
    if fate == SCATTERED or paths.carried[0] > 0.0:
        paths.carried[0] = carried_outside(world, paths)
    if rules.has_light_paths:
        paths.joined[0] = diffuse_only and paths.pdf[0] > 0.0
        paths.has_met_wide[0] |= paths.pdf[0] > 0.0 and not is_narrow
    if is_known and paths.pdf[0] > 0.0:
        return ABSORBED, n, False
    if paths.chain.size and fate >= SCATTERED:
        note_step(world, paths, vertex, is_anchored, hit.normal)
    paths.source_id[0] = hit.object_id[0]
    for k in range(3):
        paths.origins[0, k] = hit.position[0, k]
        paths.directions[0, k] = vertex.onward[0, k]
    return fate, n, has_branch


@inlined
def _lose(world, paths, tally):
    """Count a path that the depth limit ends, and what it might have carried."""
    weight = carried_outside(world, paths)
    tally.lost[0] += 1
    tally.lost[1] += weight
    if paths.carried[0] == 0.0:
        tally.lost[2] += weight


@inlined
def arrive(world, rules, paths, vertex, depth, pdf_area, radiance, tally):
    """Add the light that a path has run into; tell whether it goes on at this vertex."""
    absorbed_on_the_way(world, paths, vertex, tally.unclosed)
    r, g, b = emitted(world, rules, paths, vertex, depth, pdf_area)
    row = paths.camera_ray[0]
    radiance[row, 0] += paths.throughput[0, 0] * r
    radiance[row, 1] += paths.throughput[0, 1] * g
    radiance[row, 2] += paths.throughput[0, 2] * b
    m, first = vertex.material[0], world.lobes.first
    ends = m < 0 or first[m] == first[m + 1]  # a lamp, or a material that emits alone
    if ends and paths.carried[0] == 0.0 and max(r, g, b) > 0.0:
        tally.lost[2] += carried_outside(world, paths)
    if m < 0:
        if depth <= rules.max_depth:
            tally.fates[LEFT] += 1
        return False
    if depth > rules.max_depth:
        if not ends:
            _lose(world, paths, tally)
        return False
    return True


@inlined
def depart(world, rules, paths, vertex, depth, block, points, column, branch, rays, n, tally):
    """Leave a vertex; see `leave_vertex` for what is returned."""
    row = paths.camera_ray[0]
    camera_pdf, number = 0.0, 0
    if rules.has_light_paths:
        camera_pdf, number = block.camera_pdf[row], block.pass_number[row]
        if camera_pdf < 0.0:  # of parallel rays: per area across them, so here per solid angle
            camera_pdf *= -vertex.hit.t[0] * vertex.hit.t[0]
    had_spread = paths.carried[0] > 0.0
    fate, n, has_branch = leave_vertex(
        world, rules, paths, vertex, depth, camera_pdf, number, points, column, branch, rays, n
    )
    if not had_spread:
        tally.lost[2] += paths.carried[0]
    tally.fates[fate] += 1
    tally.fates[SPECULAR] += has_branch
    if fate == STOPPED:
        _lose(world, paths, tally)
    return fate, n, has_branch
