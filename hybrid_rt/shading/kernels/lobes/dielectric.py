"""The lobe of smooth glass: reflection and refraction, with the Fresnel reflectance."""

from hybrid_rt.shading.kernels.fresnel import fresnel, refract, schlick
from hybrid_rt.shading.kernels.medium_stack import (
    SCHLICK,
    STACK,
    filling_medium,
    ior_of,
    pass_surface,
)
from meshing.kernels.jit import inlined, kernel


@inlined
def reflectance_by(lobes, lobe, cos_i, ratio):
    """Return the reflectance at a dielectric, by the formula that it asks for, and the cosine beyond."""
    if lobes.number[lobe, SCHLICK] != 0.0:
        return schlick(cos_i, ratio)
    return fresnel(cos_i, ratio)


@inlined
def cross_surface(lobes, lobe, stack, i, cos_i, is_front, second):
    """Take ray i through a dielectric surface: reflectance, cosine beyond, index beyond over before.

    The last is 0, and so is the reflectance, where the surface is hidden in another body; see `at_glass`.
    """
    before = filling_medium(stack, i, lobes)
    pass_surface(lobe, stack, i, is_front, second)
    after = filling_medium(stack, i, lobes)
    if before == after:
        return 0.0, cos_i, 0.0
    ratio = ior_of(lobes, after) / ior_of(lobes, before)
    reflectance, cos_t = reflectance_by(lobes, lobe, min(cos_i, 1.0), ratio)
    return reflectance, cos_t, ratio


@kernel(allocates=True)
def split_rays(
    lobes, lobe, direction, normal, front_face, second, stack, reflectance, refracted, ratio
):
    """Find both branches of rays at smooth glass, and take their ``stack`` through it: see `cross_surface`.

    ``refracted`` (n, 3) is zero where reflection is total, the direction itself where the surface is
    hidden.
    """
    for i in range(lobe.size):
        dx, dy, dz = direction[i, 0], direction[i, 1], direction[i, 2]
        nx, ny, nz = normal[i, 0], normal[i, 1], normal[i, 2]
        cos_i = -(dx * nx + dy * ny + dz * nz)
        if cos_i < 0.0:
            cos_i, nx, ny, nz = -cos_i, -nx, -ny, -nz
        cos_i = min(cos_i, 1.0)
        part, cos_t, at = cross_surface(lobes, lobe[i], stack, i, cos_i, front_face[i], second)
        reflectance[i], ratio[i] = part, at
        x, y, z = dx, dy, dz
        if part == 1.0:
            x = y = z = 0.0
        elif at != 0.0:
            x, y, z = refract(dx, dy, dz, nx, ny, nz, cos_i, cos_t, at)
        refracted[i, 0], refracted[i, 1], refracted[i, 2] = x, y, z


@inlined
def reflectance_ahead(lobes, lobe, stack, i, cos_i, is_front, second):
    """Return the reflectance at a dielectric; 0 where its surface is hidden in another body."""
    kept = (
        stack[i, 0], stack[i, 1], stack[i, 2], stack[i, 3],
        stack[i, 4], stack[i, 5], stack[i, 6], stack[i, 7],
    )  # fmt: skip
    reflectance, _, _ = cross_surface(lobes, lobe, stack, i, cos_i, is_front, second)
    for k in range(STACK):
        stack[i, k] = kept[k]
    return reflectance


@inlined
def at_glass(lobes, lobe, stack, i, nx, ny, nz, dx, dy, dz, is_front, second, xi):
    """Sample reflection or refraction at a dielectric by its reflectance; n is on the side of -d.

    ``stack[i]`` is updated; ``second`` as in `hybrid_rt.shading.kernels.medium_stack`. Returns the
    direction, the factor on radiance without the tint, and whether the ray is refracted and so tinted.
    """
    # Kept for what is reflected: STACK places.
    kept = (
        stack[i, 0], stack[i, 1], stack[i, 2], stack[i, 3],
        stack[i, 4], stack[i, 5], stack[i, 6], stack[i, 7],
    )  # fmt: skip
    cos_i = min(-(nx * dx + ny * dy + nz * dz), 1.0)
    reflectance, cos_t, ratio = cross_surface(lobes, lobe, stack, i, cos_i, is_front, second)
    if ratio == 0.0:
        return dx, dy, dz, 1.0, False
    if xi < reflectance:
        for k in range(STACK):
            stack[i, k] = kept[k]
        twice = 2.0 * cos_i
        return dx + twice * nx, dy + twice * ny, dz + twice * nz, 1.0, False
    x, y, z = refract(dx, dy, dz, nx, ny, nz, cos_i, cos_t, ratio)
    # Radiance over the index squared is what stays the same across the surface.
    return x, y, z, 1.0 / (ratio * ratio), True
