"""Kinds of lights: all code that depends on the kind of a light.

A light is sampled from a hit (next-event estimation), hit by a ray, or emits a photon or a light
subpath. Each kind has a branch for these in the functions below; besides, it has a class that
writes its row of the table, and a name.

A point of a light emits its strength (radiance, or intensity without area) times a share in
direction d: the cosine to the normal for area lights, one for points. The share over its integral
over all directions is a pdf; strength times area times that integral is the light's power.
"""

import math
from typing import Any, NamedTuple

from hybrid_rt.core.kernels.compensated import two_difference
from hybrid_rt.core.kernels.sphere_points import onto_sphere, power_of_point
from hybrid_rt.shading.kernels.parallelogram import even_point, is_even, solid_angle
from hybrid_rt.shading.kernels.texture import texture_color
from hybrid_rt.shading.kernels.warp import onto_axis
from meshing.kernels.jit import inlined

POINT, RECTANGLE, SPHERE, SURFACE, SPOT = 0, 1, 2, 3, 4

# Kinds that no ray runs into: they are not seen, and only asking finds them.
WITHOUT_AREA = (POINT, SPOT)

WHOLE_SPHERE = 4.0 * math.pi


class LightTable(NamedTuple):
    """All lights of a scene except the environment; n rows."""

    kind: Any  # (n,) int32
    # (n, 3) float64, place of a point light or spot, corner of a rectangle, centre of a sphere
    origin: Any
    edge_u: Any  # (n, 3) float64; of a sphere: (radius, 0, 0); of a spot: the axis, unit
    # (n, 3) float64; of a spot: 1 - cos of the angles where its edge begins and where it ends, 0
    edge_v: Any
    strength: Any  # (n, 3) float64, intensity (W/sr) or radiance (W/sr/m^2)
    texture: Any  # (n,) int32, row of a texture that takes the place of strength; -1: none
    # (n + 1,) float64, probability of each light to be asked where one is; the last is the sky's.
    chance: Any
    # (n + 1,) float64, probability of each light to begin a light path; the last, the sky's, is 0.
    emit: Any


class LightPoints(NamedTuple):
    """Sampled points on lights of kind `SURFACE`; rows of other lights are not read."""

    position: Any  # (n, 3) float64
    normal: Any  # (n, 3) float64, unit
    pdf_area: Any  # (n,) float64
    u: Any  # (n,) float64
    v: Any  # (n,) float64


@inlined
def has_area(lights, row):
    """Tell whether rays can hit a light."""
    return lights.kind[row] not in WITHOUT_AREA


# --- asked from a hit


@inlined
def light_point(lights, points, i, row, px, py, pz, s, t):
    """Sample a point of a light by (s, t) in [0, 1)^2, as seen from p; row i of ``points`` if a `SURFACE`.

    Returns the vector from p to the point, its length, the factor that turns the light's strength into
    irradiance at normal incidence, and the point's parameters (u, v). The factor is 1 / distance^2 for a
    point, times its share for a spot; one over the pdf per solid angle for area lights, so the estimate is
    unbiased. Zero behind the light, outside a spot's cone, inside spheres.
    """
    kind = lights.kind[row]
    if kind == SURFACE:
        return _surface_point(points, i, px, py, pz)
    if kind == SPHERE:
        return _sphere_point(lights, row, px, py, pz, s, t)
    if kind == RECTANGLE:
        return _rectangle_point(lights, row, px, py, pz, s, t)
    x, y, z = lights.origin[row, 0] - px, lights.origin[row, 1] - py, lights.origin[row, 2] - pz
    square = x * x + y * y + z * z
    distance = math.sqrt(square)
    if square == 0.0:
        return x, y, z, distance, 0.0, s, t
    factor = 1.0 / square
    if kind == SPOT:
        factor *= _spot_share(lights, row, -x / distance, -y / distance, -z / distance)
    return x, y, z, distance, factor, s, t


@inlined
def _rectangle_point(lights, row, px, py, pz, s, t):
    """Choose a point evenly by solid angle, of a far rectangle by area; see `light_point`."""
    ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
    bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
    x, y, z = lights.origin[row, 0] - px, lights.origin[row, 1] - py, lights.origin[row, 2] - pz
    if is_even(x, y, z, ax, ay, az, bx, by, bz):
        x, y, z = x + s * ax + t * bx, y + s * ay + t * by, z + s * az + t * bz
        square = x * x + y * y + z * z
        distance = math.sqrt(square)
        # Edge_u x edge_v is the normal times the area.
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        factor = max(-(nx * x + ny * y + nz * z), 0.0) / (square * distance)
        return x, y, z, distance, factor, s, t
    x, y, z, u, v, factor = even_point(x, y, z, ax, ay, az, bx, by, bz, s, t)
    return x, y, z, math.sqrt(x * x + y * y + z * z), factor, u, v


@inlined
def _sphere_seen(lights, row, px, py, pz):
    """See a sphere from a point: |p - c|^2, that less r^2 (in double-double), 1 - cos of half its angle."""
    radius = lights.edge_u[row, 0]
    fx, gx = two_difference(px, lights.origin[row, 0])
    fy, gy = two_difference(py, lights.origin[row, 1])
    fz, gz = two_difference(pz, lights.origin[row, 2])
    square = fx * fx + fy * fy + fz * fz
    power = power_of_point(fx, fy, fz, gx, gy, gz, radius)
    if power <= 0.0:
        return square, 0.0, 0.0
    return square, power, radius * radius / (square * (1.0 + math.sqrt(power / square)))


@inlined
def _sphere_point(lights, row, px, py, pz, s, t):
    """Choose a direction evenly in the cone that a sphere fills; see `light_point`."""
    radius = lights.edge_u[row, 0]
    x, y, z = lights.origin[row, 0] - px, lights.origin[row, 1] - py, lights.origin[row, 2] - pz
    square, power, cone = _sphere_seen(lights, row, px, py, pz)
    if power == 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, s, t
    distance = math.sqrt(square)
    less = s * cone  # 1 - cos of the angle from the axis
    sine2 = less * (2.0 - less)
    wx, wy, wz = onto_axis(
        x / distance, y / distance, z / distance,
        1.0 - less, math.sqrt(max(sine2, 0.0)), 2.0 * math.pi * t,
    )  # fmt: skip
    # The near root is the product of both over the far one, as where rays meet spheres: shadow
    # rays end at that root to the last digits, even just beside the sphere.
    foot = x * wx + y * wy + z * wz
    far = foot + math.sqrt(max(radius * radius - square * sine2, 0.0))
    along = power / far
    return along * wx, along * wy, along * wz, along, 2.0 * math.pi * cone, s, t


@inlined
def _surface_point(points, i, px, py, pz):
    at = points.position
    x, y, z = at[i, 0] - px, at[i, 1] - py, at[i, 2] - pz
    square = x * x + y * y + z * z
    distance = math.sqrt(square)
    facing = -(points.normal[i, 0] * x + points.normal[i, 1] * y + points.normal[i, 2] * z)
    if facing <= 0.0 or points.pdf_area[i] <= 0.0:
        return x, y, z, distance, 0.0, points.u[i], points.v[i]
    factor = facing / (distance * square * points.pdf_area[i])
    return x, y, z, distance, factor, points.u[i], points.v[i]


@inlined
def light_strength(lights, textures, row, u, v, x, y, z):
    """Return the radiance (for lights without area: the intensity) at a point of a light."""
    if lights.texture[row] < 0:
        return lights.strength[row, 0], lights.strength[row, 1], lights.strength[row, 2]
    return texture_color(textures, lights.texture[row], u, v, x, y, z)


@inlined
def chosen_strength(lights, textures, points, i, row, s, t, x, y, z):
    """Return the strength of a light at the point (x, y, z) that `leaving_point` chose by (s, t)."""
    u, v = s, t
    if lights.kind[row] == SURFACE:
        u, v = points.u[i], points.v[i]
    return light_strength(lights, textures, row, u, v, x, y, z)


# --- met by a ray


@inlined
def pdf_of_light(lights, row, ox, oy, oz, t, cosine, pdf_area):
    """Return the pdf per solid angle with which `light_point` samples a point hit at t."""
    if lights.kind[row] == SPHERE:
        _, power, cone = _sphere_seen(lights, row, ox, oy, oz)
        return 1.0 / (2.0 * math.pi * cone) if power > 0.0 else 0.0
    if lights.kind[row] == RECTANGLE:
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        x, y, z = lights.origin[row, 0] - ox, lights.origin[row, 1] - oy, lights.origin[row, 2] - oz
        if not is_even(x, y, z, ax, ay, az, bx, by, bz):
            angle = solid_angle(x, y, z, ax, ay, az, bx, by, bz)
            return 1.0 / angle if angle > 0.0 else 0.0
    return pdf_of_area(lights, row, pdf_area) * t * t / cosine


@inlined
def pdf_of_area(lights, row, pdf_area):
    """Return the pdf per area of `leaving_point`; for a `SURFACE` it is passed in."""
    if lights.kind[row] == SPHERE:
        return 1.0 / (4.0 * math.pi * lights.edge_u[row, 0] ** 2)
    if lights.kind[row] == RECTANGLE:
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        return 1.0 / math.sqrt(nx * nx + ny * ny + nz * nz)
    return pdf_area


# --- left by photons and light paths


@inlined
def leaving_point(lights, points, i, row, s, t):
    """Sample a point of a light: point, normal, one over the pdf, pdf; without area 0, 1, 1 in the end."""
    kind = lights.kind[row]
    if kind == SURFACE:
        density = points.pdf_area[i]
        area = 1.0 / density if density > 0.0 else 0.0
        return (
            points.position[i, 0], points.position[i, 1], points.position[i, 2],
            points.normal[i, 0], points.normal[i, 1], points.normal[i, 2], area, max(density, 0.0),
        )  # fmt: skip
    x, y, z = lights.origin[row, 0], lights.origin[row, 1], lights.origin[row, 2]
    if kind == RECTANGLE:
        ax, ay, az = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
        bx, by, bz = lights.edge_v[row, 0], lights.edge_v[row, 1], lights.edge_v[row, 2]
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        area = math.sqrt(nx * nx + ny * ny + nz * nz)
        return (
            x + s * ax + t * bx, y + s * ay + t * by, z + s * az + t * bz,
            nx / area, ny / area, nz / area, area, 1.0 / area,
        )  # fmt: skip
    if kind == SPHERE:
        radius = lights.edge_u[row, 0]
        nx, ny, nz = _even_direction(s, t)
        area = WHOLE_SPHERE * radius * radius
        px, py, pz = onto_sphere(x + radius * nx, y + radius * ny, z + radius * nz, x, y, z, radius)
        return px, py, pz, nx, ny, nz, area, 1.0 / area
    return x, y, z, 0.0, 0.0, 0.0, 1.0, 1.0


@inlined
def _even_direction(s, t):
    z = 1.0 - 2.0 * s
    ring, turn = math.sqrt(max(1.0 - z * z, 0.0)), 2.0 * math.pi * t
    return ring * math.cos(turn), ring * math.sin(turn), z


@inlined
def leaving_direction(lights, row, nx, ny, nz, s, t):
    """Sample a direction by its share, at a point with normal n."""
    if lights.kind[row] == POINT:
        return _even_direction(s, t)
    if lights.kind[row] == SPOT:
        less = _spot_angle(lights, row, s)
        return onto_axis(
            lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2],
            1.0 - less, math.sqrt(max(less * (2.0 - less), 0.0)), 2.0 * math.pi * t,
        )  # fmt: skip
    return onto_axis(nx, ny, nz, math.sqrt(1.0 - s), math.sqrt(s), 2.0 * math.pi * t)


@inlined
def share_of_direction(lights, row, nx, ny, nz, dx, dy, dz):
    """Return the share of its strength that a light emits along d; negative: backwards."""
    if lights.kind[row] == POINT:
        return 1.0
    if lights.kind[row] == SPOT:
        return _spot_share(lights, row, dx, dy, dz)
    return nx * dx + ny * dy + nz * dz


@inlined
def shares_together(lights, row):
    """Return the integral of the share over all directions, steradians."""
    if lights.kind[row] == POINT:
        return WHOLE_SPHERE
    if lights.kind[row] == SPOT:
        # The edge, x^2 (3 - 2 x) over equal solid angles, counts half.
        return math.pi * (lights.edge_v[row, 0] + lights.edge_v[row, 1])
    return math.pi


@inlined
def largest_share(lights, row, nx, ny, nz, ax, ay, az, cone):
    """Return approximately the largest share in a cone about the unit axis a, at a point of normal n.

    ``cone`` is 1 - cos of half the cone's angle; 2: all directions.
    """
    kind = lights.kind[row]
    # Half of a ball faces away from anything: see `distance_through`.
    if cone >= 1.0 or kind in (POINT, SPHERE):
        return 1.0
    if kind == SPOT:
        nx, ny, nz = lights.edge_u[row, 0], lights.edge_u[row, 1], lights.edge_u[row, 2]
    cosine = ax * nx + ay * ny + az * nz
    if cosine >= 1.0 - cone:
        return 1.0
    nearest = cosine_beside(cosine, cone)
    return _share_at(lights, row, 1.0 - nearest) if kind == SPOT else max(nearest, 0.0)


@inlined
def cosine_beside(cosine, cone):
    """Return the cosine of an angle reduced by half the angle of a cone."""
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return cosine * (1.0 - cone) + sine * math.sqrt(cone * (2.0 - cone))


@inlined
def opposite_point(lights, row, px, py, pz, nx, ny, nz):
    """Return the point of a closed ball opposite to p, whose normal is n."""
    across = distance_through(lights, row)
    return onto_sphere(
        px - across * nx, py - across * ny, pz - across * nz,
        lights.origin[row, 0], lights.origin[row, 1], lights.origin[row, 2], lights.edge_u[row, 0],
    )  # fmt: skip


@inlined
def _spot_share(lights, row, dx, dy, dz):
    """Return the share of its intensity that a spot sends along the unit direction d."""
    # |d - a|^2 / 2 is 1 - cos without its cancellation; of opposite ones it may round above 2.
    x, y, z = dx - lights.edge_u[row, 0], dy - lights.edge_u[row, 1], dz - lights.edge_u[row, 2]
    return _share_at(lights, row, min(0.5 * (x * x + y * y + z * z), 2.0))


@inlined
def _share_at(lights, row, less):
    """Return the share at an angle from the axis of which 1 - cos is ``less``."""
    inside = lights.edge_v[row, 1] - less
    width = lights.edge_v[row, 1] - lights.edge_v[row, 0]
    if inside < 0.0:
        return 0.0
    if inside >= width:
        return 1.0
    x = inside / width
    return x * x * (3.0 - 2.0 * x)


@inlined
def _spot_angle(lights, row, s):
    """Choose an angle from the axis by its share, through s in [0, 1); return 1 - cos of it."""
    bright, dark = lights.edge_v[row, 0], lights.edge_v[row, 1]
    rest = s * (bright + dark) - 2.0 * bright
    if rest < 0.0:
        return 0.5 * s * (bright + dark)
    # Of the edge's power the part 1 - F(x), F(x) = x^3 (2 - x), lies nearer to the axis. F is
    # convex, and the start at or above the root, so Newton's steps fall toward it and never pass.
    aim = max(1.0 - rest / (dark - bright), 0.0) if dark > bright else 1.0
    x = aim ** (1.0 / 3.0)
    for _ in range(8):
        if x <= 0.0:
            break
        step = (x * x * x * (2.0 - x) - aim) / (2.0 * x * x * (3.0 - 2.0 * x))
        x -= step
        if step <= 1e-15 * x:
            break
    return dark - x * (dark - bright)


@inlined
def distance_through(lights, row):
    """Return how far behind a point of a closed ball the opposite one, which light aimed inward leaves, lies."""
    return 2.0 * lights.edge_u[row, 0] if lights.kind[row] == SPHERE else 0.0
