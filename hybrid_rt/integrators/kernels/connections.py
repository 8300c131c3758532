"""Connections of light vertices: to vertices of camera paths, and to the camera itself.

Their weights are derived in `hybrid_rt.integrators.kernels.light_paths`.
"""

import math

from hybrid_rt.integrators.kernels.connection_weights import CONNECT_CHANCE
from hybrid_rt.integrators.kernels.light_sampling import cast
from hybrid_rt.shading.kernels.bsdf import scattered, sides_differ
from hybrid_rt.shading.kernels.emitter import power_weight
from hybrid_rt.shading.kernels.lobes.register import EVERY
from hybrid_rt.shading.kernels.medium_stack import transmittance
from meshing.kernels.jit import inlined, kernel

# Light vertices of which one far away is connected to. A multiple of eight compiles to vector instructions
# without a rest.
CANDIDATES = 24
# Columns of the table of candidates: see `choose_far`.
X, Y, Z, ALONG_X, ALONG_Y, ALONG_Z, STEPS, CANDIDATE_COLUMNS = 0, 1, 2, 3, 4, 5, 6, 7
NONE = -1


@inlined
def sent_toward(lit, k, lobes, wx, wy, wz):
    """Return what light vertex k scatters along -w (w unit), and the pdf of the reverse path.

    The first three numbers are flux times f times the cosine toward the camera. The fourth is the
    pdf per projected solid angle with which a camera path that arrives along w would continue to
    the light, times the cosine of its arrival, over the index squared. The caller multiplies it by
    the pdf per solid angle of arriving there and divides by the squared distance.
    """
    gx, gy, gz = lit.geometric[k, 0], lit.geometric[k, 1], lit.geometric[k, 2]
    lx, ly, lz = -lit.direction[k, 0], -lit.direction[k, 1], -lit.direction[k, 2]
    toward_eye = -(gx * wx + gy * wy + gz * wz)
    toward_light = gx * lx + gy * ly + gz * lz
    nx, ny, nz = lit.normal[k, 0], lit.normal[k, 1], lit.normal[k, 2]
    ratio = lit.ratio[k]
    is_through = toward_eye * toward_light <= 0.0
    # The normal to shade by must tell the same, see `sides_differ`.
    is_shaded_through = (nx * wx + ny * wy + nz * wz) * (nx * lx + ny * ly + nz * lz) >= 0.0
    if is_through != is_shaded_through or (is_through and ratio == 0.0) or toward_light == 0.0:
        return 0.0, 0.0, 0.0, 0.0
    if is_through:
        ratio = 1.0 / ratio
    r, g, b, pdf = scattered(
        lobes, lit.material[k], lit.colors, k, nx, ny, nz, wx, wy, wz, lx, ly, lz, ratio, EVERY
    )
    if pdf <= 0.0:
        return 0.0, 0.0, 0.0, 0.0
    # The cosine in f cos is the shading normal's, that of the flux is the surface's own.
    factor = abs(toward_eye / toward_light)
    return (
        factor * r * lit.flux[k, 0],
        factor * g * lit.flux[k, 1],
        factor * b * lit.flux[k, 2],
        factor * pdf / lit.square[k],
    )


@inlined(cached=True)
def connect_to_light_vertex(world, rules, vertices, lit, depth, number, s, t, out, n):
    """Connect a vertex of a camera path to a light vertex of its pass, by a shadow ray.

    The light is weighted against BSDF sampling. What is left to `choose_far` is
    not connected here.

    Parameters
    ----------
    world : World
    rules : Rules
    vertices : Vertices of one row
    lit : Receivers of one row
    depth : int
        Vertices before this one.
    number : int
        Index of the pass among those of `World.first_of_pass`.
    s, t : float
        In [0, 1): the first samples the light vertex, the second whether the hit is connected at all.
    out : ShadowRays
        Row n is written.

    Returns
    -------
    bool
        Whether there is such a shadow ray.
    """
    of_light = world.light_vertices
    begin, end = world.first_of_pass[number], world.first_of_pass[number + 1]
    if t >= CONNECT_CHANCE or begin == end:
        return False
    k = _any_of(s, begin, end)
    if of_light.density[k] == 0.0 or of_light.steps[k] > rules.max_depth - depth - 1:
        return False
    if _is_far(world, rules, vertices, k):
        return False
    factor = (end - begin) / CONNECT_CHANCE
    return connect(
        world, vertices, lit, k, factor, rules.vertices_per_path / CONNECT_CHANCE, out, n
    )


@inlined(cached=True)
def choose_far(world, rules, vertex, vertices, depth, number, s, t):
    """Choose the far light vertex that a vertex of a camera path is connected to.

    Beyond `Rules.min_distance`, light between surfaces of `World.diffuse_only` is estimated by these
    connections alone (Kollig and Keller 2004). Of `CANDIDATES` light vertices one is chosen with a
    probability in proportion to about its unoccluded contribution (resampled importance sampling,
    Talbot, Cline and Egbert 2005).

    ``vertex``, Vertex, is scratch memory; other parameters are those of `connect_to_light_vertex`, except s
    and t: the first samples the candidates, the second which one is chosen. The light vertices of a pass are stratified into groups of
    candidates: next to each other in memory, but spread evenly over the pass, see `member`. The columns of
    `World.candidates` are the position (`X`, `Y`, `Z`), the normal on the lit side times the strength
    (`ALONG_X` and so on), and `STEPS`.

    Returns
    -------
    chosen : int
        A row of `World.light_vertices`; `NONE`, if no candidate contributes.
    factor : float
        What its light is multiplied by.
    """
    position, normal, direction = vertices.position, vertices.normal, vertices.direction
    first, stop = world.first_group[number], world.first_group[number + 1]
    if first == stop:
        return NONE, 0.0
    px, py, pz = position[0, 0], position[0, 1], position[0, 2]
    nx, ny, nz = normal[0, 0], normal[0, 1], normal[0, 2]
    if nx * direction[0, 0] + ny * direction[0, 1] + nz * direction[0, 2] > 0.0:
        nx, ny, nz = -nx, -ny, -nz
    least, most_steps = rules.min_distance * rules.min_distance, float(rules.max_depth - depth - 1)
    group, target_pdf = _any_of(s, first, stop), vertex.target_pdf
    column = world.candidates[group]
    # Columns of their own, and no sum: so this loop compiles to vector instructions.
    at_x, at_y, at_z, steps = column[X], column[Y], column[Z], column[STEPS]
    along_x, along_y, along_z = column[ALONG_X], column[ALONG_Y], column[ALONG_Z]
    for j in range(CANDIDATES):
        x, y, z = at_x[j] - px, at_y[j] - py, at_z[j] - pz
        square = x * x + y * y + z * z
        arriving = max(nx * x + ny * y + nz * z, 0.0)
        leaving = max(-(along_x[j] * x + along_y[j] * y + along_z[j] * z), 0.0)
        is_eligible = (square >= least) & (square > 0.0) & (steps[j] <= most_steps)
        target_pdf[j] = arriving * leaving / (square * square) if is_eligible else 0.0
    total = 0.0
    for j in range(CANDIDATES):
        total += target_pdf[j]
    if total == 0.0:
        return NONE, 0.0
    t *= total
    chosen = 0
    for j in range(CANDIDATES):
        if target_pdf[j] > 0.0:
            chosen = j
            if t < target_pdf[j]:
                break
            t -= target_pdf[j]
    begin, n_groups = world.first_of_pass[number], stop - first
    k = member(group - first, chosen, begin, n_groups)
    return k, n_groups * total / target_pdf[chosen]


@inlined
def member(group, j, begin, n_groups):
    """Return member j of a group of light vertices: a row of those of its pass, which begin at ``begin``.

    Groups at the end may lack their last members.
    """
    return begin + group + j * n_groups


@inlined
def _any_of(s, begin, end):
    """Return the row that a number in [0, 1) stands for."""
    return min(begin + int(s * (end - begin)), end - 1)


@inlined
def _is_far(world, rules, vertices, k):
    """Return whether light between a vertex and light vertex k is left to `choose_far`."""
    if rules.min_distance == math.inf or not world.diffuse_only[vertices.material[0]]:
        return False
    square = 0.0
    for c in range(3):
        square += (world.light_vertices.position[k, c] - vertices.position[0, c]) ** 2
    return (
        square >= rules.min_distance * rules.min_distance
        and world.diffuse_only[world.light_vertices.material[k]]
    )


@inlined(cached=True)
def connect(world, vertices, lit, k, factor, vertices_per_path, out, n):
    """Write row n of the shadow rays, to light vertex k, whose light is multiplied by ``factor``.

    ``vertices_per_path`` is the expected number of such connections of a light subpath in a pass; 0 if
    BSDF sampling does not find this light.
    """
    material, colors, position, normal, direction, geometric, ratio = vertices
    lobes, of_light = world.lobes, world.light_vertices
    place = of_light.position
    x, y, z = (
        place[k, 0] - position[0, 0], place[k, 1] - position[0, 1], place[k, 2] - position[0, 2]
    )  # fmt: skip
    square = x * x + y * y + z * z
    if square == 0.0 or sides_differ(geometric, normal, 0, direction, x, y, z):
        return False
    distance = math.sqrt(square)
    wx, wy, wz = x / distance, y / distance, z / distance
    fr, fg, fb, pdf = scattered(
        lobes, material[0], colors, 0,
        normal[0, 0], normal[0, 1], normal[0, 2],
        direction[0, 0], direction[0, 1], direction[0, 2], wx, wy, wz,
        ratio[0] if ratio.size else 0.0, EVERY,
    )  # fmt: skip
    if pdf <= 0.0:
        return False
    r, g, b, onward = sent_toward(of_light, k, lobes, wx, wy, wz)
    if onward <= 0.0:
        return False
    factor /= square
    if vertices_per_path > 0.0:
        factor *= power_weight(of_light.density[k], pdf / square * vertices_per_path * onward)
    value = factor * r * fr, factor * g * fg, factor * b * fb
    end = place[k, 0], place[k, 1], place[k, 2]
    return cast(
        lobes, vertices, lit, 0, (x, y, z), distance, value, of_light.object_id[k], end, out, n
    )


@kernel(allocates=True)
def splat_light_vertices(lit, lobes, way, pdf, n_paths, media, steps_left, value):
    """Compute the radiance that light vertices scatter toward the camera.

    Parameters
    ----------
    way : (n, 3) float64
        Vector from the camera to each light vertex.
    pdf : (n,) float64
        pdf per solid angle of the camera's directions within the pixel; 0 outside the picture.
    n_paths : float
        Light subpaths per pixel sample.
    media : (n, STACK) int32, or (n, 0)
        Medium stack of the camera.
    steps_left : int
        Directions that a path may take at surfaces: ``max_depth``.
    value : (n, 3) float64, written
        Radiance added to the pixel if the connection is unoccluded.
    """
    for k in range(pdf.size):
        value[k, 0] = value[k, 1] = value[k, 2] = 0.0
        if pdf[k] <= 0.0 or lit.density[k] == 0.0 or lit.steps[k] > steps_left:
            continue
        square = way[k, 0] ** 2 + way[k, 1] ** 2 + way[k, 2] ** 2
        distance = math.sqrt(square)
        r, g, b, onward = sent_toward(
            lit, k, lobes, way[k, 0] / distance, way[k, 1] / distance, way[k, 2] / distance
        )
        if onward <= 0.0:
            continue
        factor = pdf[k] / square
        factor *= power_weight(lit.density[k], factor / n_paths * onward)
        if media.shape[1] > 0:
            p, q, s = transmittance(media, k, lobes, distance)
            r, g, b = r * p, g * q, b * s
        value[k, 0], value[k, 1], value[k, 2] = factor * r, factor * g, factor * b
