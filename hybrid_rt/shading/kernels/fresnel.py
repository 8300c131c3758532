"""Reflection and refraction: directions by Snell's law, reflectance by Fresnel's equations."""

import math

from meshing.kernels.jit import inlined, kernel


@inlined
def fresnel(cos_i, eta):
    """Return the reflectance of unpolarised light and the cosine beyond; of total reflection (1, 0).

    ``eta`` is the index beyond the surface over that before it. The two amplitudes are (cos_i - eta cos_t)
    / (cos_i + eta cos_t) and (eta cos_i - cos_t) / (eta cos_i + cos_t).
    """
    # (eta - 1)(eta + 1) + cos^2 is eta^2 - sin^2 without the cancellation at eta near 1.
    square = (eta - 1.0) * (eta + 1.0) + cos_i * cos_i
    if square <= 0.0 or cos_i <= 0.0:
        return 1.0, 0.0
    eta_cos_t = math.sqrt(square)
    cos_t = min(eta_cos_t / eta, 1.0)
    across = (cos_i - eta_cos_t) / (cos_i + eta_cos_t)
    along = (eta * cos_i - cos_t) / (eta * cos_i + cos_t)
    return 0.5 * (across * across + along * along), cos_t


@inlined
def schlick(cos_i, eta):
    """Return Schlick's approximation of `fresnel` ("An inexpensive BRDF model", 1994)."""
    exact, cos_t = fresnel(cos_i, eta)
    if cos_t == 0.0:
        return exact, cos_t
    at_normal = ((eta - 1.0) / (eta + 1.0)) ** 2
    # The approximation holds for the cosine on the thinner side.
    cosine = cos_i if eta >= 1.0 else cos_t
    return at_normal + (1.0 - at_normal) * (1.0 - cosine) ** 5, cos_t


@inlined
def refract(dx, dy, dz, nx, ny, nz, cos_i, cos_t, ratio):
    """Refract a unit direction by Snell's law; n is on its side."""
    if ratio == 1.0:
        return dx, dy, dz
    along = cos_i / ratio - cos_t
    x, y, z = dx / ratio + along * nx, dy / ratio + along * ny, dz / ratio + along * nz
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@inlined
def mirrored(dx, dy, dz, nx, ny, nz):
    """Reflect a unit direction at a unit normal of either sign."""
    twice = 2.0 * (nx * dx + ny * dy + nz * dz)
    return dx - twice * nx, dy - twice * ny, dz - twice * nz


@kernel(allocates=True)
def mirror_directions(direction, normal, reflected):
    """Reflect unit directions (n, 3) at unit normals of either sign."""
    for i in range(direction.shape[0]):
        reflected[i, 0], reflected[i, 1], reflected[i, 2] = mirrored(
            direction[i, 0], direction[i, 1], direction[i, 2],
            normal[i, 0], normal[i, 1], normal[i, 2],
        )  # fmt: skip


@kernel(allocates=True)
def reflect_directions(direction, normal, out):
    """Reflect unit directions (n, 3) at unit normals of either sign, to unit directions."""
    for i in range(direction.shape[0]):
        x, y, z = mirrored(
            direction[i, 0], direction[i, 1], direction[i, 2],
            normal[i, 0], normal[i, 1], normal[i, 2],
        )  # fmt: skip
        length = math.sqrt(x * x + y * y + z * z)
        out[i, 0], out[i, 1], out[i, 2] = x / length, y / length, z / length


@kernel(allocates=True)
def refract_directions(direction, normal, before, beyond, out):
    """Refract unit directions (n, 3) at unit normals of either sign; nan where reflection is total."""
    for i in range(direction.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        cos_i = -(dx * nx + dy * ny + dz * nz)
        if cos_i < 0.0:
            cos_i, nx, ny, nz = -cos_i, -nx, -ny, -nz
        ratio = beyond[i] / before[i]
        # As in `fresnel`; the difference is taken before the quotient rounds it.
        change = (beyond[i] - before[i]) / before[i]
        square = change * (ratio + 1.0) + cos_i * cos_i
        if square <= 0.0 or cos_i == 0.0:
            out[i, 0] = out[i, 1] = out[i, 2] = math.nan
            continue
        out[i, 0], out[i, 1], out[i, 2] = refract(
            dx, dy, dz, nx, ny, nz, cos_i, math.sqrt(square) / ratio, ratio
        )


@kernel(allocates=True)
def split_at_glass(direction, normal, eta, use_schlick, reflectance, refracted):
    """Find the refracted direction, 0 in case of total reflection, and the reflectance of each ray."""
    for i in range(direction.shape[0]):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        cos_i = -(dx * nx + dy * ny + dz * nz)
        ratio = eta[i]
        if cos_i < 0.0:
            cos_i, nx, ny, nz = -cos_i, -nx, -ny, -nz
        cos_i = min(cos_i, 1.0)
        if use_schlick[i] != 0.0:
            part, cos_t = schlick(cos_i, ratio)
        else:
            part, cos_t = fresnel(cos_i, ratio)
        reflectance[i] = part
        x = y = z = 0.0
        if part < 1.0:
            x, y, z = refract(dx, dy, dz, nx, ny, nz, cos_i, cos_t, ratio)
        refracted[i, 0], refracted[i, 1], refracted[i, 2] = x, y, z
