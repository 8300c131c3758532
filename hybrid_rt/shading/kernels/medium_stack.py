"""The medium stack of a ray: the dielectrics that it has entered and not yet left.

Where bodies overlap, the one with the highest priority fills the space; among equals, the one
entered last. A surface at which that does not change is invisible (Schmidt and Budge, "Simple
nested dielectrics in ray traced images", JGT 7(2), 2002).

Where faces of two bodies coincide, a ray crosses both at once, with no air between. The second face
is a number per ray: 0 for none, lobe + 1 if it is entered, -(lobe + 1) if it is left; the array is
empty if no bodies touch.
"""

import math

from meshing.kernels.jit import inlined, kernel

NONE = -1
# Bodies within bodies; one that is entered beyond is not seen, and found out when it is left.
STACK = 8

# Columns of a dielectric in `LobeTable.number`.
IOR, SCHLICK, ABSORPTION, PRIORITY = 0, 1, 2, 5

# Facets between media turn light by about the difference of the indices times their slope. Below
# this difference, light passes rough glass as it passes smooth glass.
MATCHED = 1e-6


@inlined
def filling_medium(stack, i, lobes):
    """Return the lobe that fills the space around ray i, or `NONE`."""
    found, highest = NONE, -math.inf
    for k in range(STACK):
        lobe = stack[i, k]
        if lobe != NONE and lobes.number[lobe, PRIORITY] >= highest:
            found, highest = lobe, lobes.number[lobe, PRIORITY]
    return found


@inlined
def place_of(stack, i, lobe):
    """Return the last index of a lobe in a stack, or `NONE`."""
    for k in range(STACK - 1, -1, -1):
        if stack[i, k] == lobe:
            return k
    return NONE


@inlined
def push(stack, i, lobe):
    """Enter a body: append it to the stack."""
    for k in range(STACK):
        if stack[i, k] == NONE:
            stack[i, k] = lobe
            return


@inlined
def drop(stack, i, place):
    """Leave a body: remove it from the stack."""
    for k in range(place, STACK - 1):
        stack[i, k] = stack[i, k + 1]
    stack[i, STACK - 1] = NONE


@inlined
def begin_with(stack, i, lobe):
    """Insert a body at the bottom of the stack: the ray started inside it."""
    for k in range(STACK - 1, 0, -1):
        stack[i, k] = stack[i, k - 1]
    stack[i, 0] = lobe


@inlined
def ior_of(lobes, lobe):
    """Return the index of refraction of a lobe; 1 for `NONE`."""
    return 1.0 if lobe == NONE else lobes.number[lobe, IOR]


@kernel(allocates=True)
def indices_within(ior, stack, lobes):
    """Write the index of refraction (n,) of what fills the space around each ray."""
    for i in range(ior.size):
        ior[i] = ior_of(lobes, filling_medium(stack, i, lobes))


@inlined
def transmittance(stack, i, lobes, length):
    """Return the Beer-Lambert transmittance over a distance in the medium of ray i."""
    medium = filling_medium(stack, i, lobes)
    if medium == NONE:
        return 1.0, 1.0, 1.0
    return (
        _left(lobes.number[medium, ABSORPTION], length),
        _left(lobes.number[medium, ABSORPTION + 1], length),
        _left(lobes.number[medium, ABSORPTION + 2], length),
    )


@inlined
def _left(density, length):
    # A way that never leaves clear glass is not weakened: 0 x inf is 0 here.
    return math.exp(-density * length) if density > 0.0 else 1.0


@inlined
def cross_medium(stack, i, lobes, glass_of, material, is_front, second, t, unclosed):
    """Return the transmittance between the origin of ray i and its hit; see `cross_media`.

    A ray that hits a dielectric from inside has been in it from the start: the body is inserted in the
    stack if it is missing.
    """
    if material >= 0 and not is_front:
        glass = glass_of[material]
        if glass != NONE and place_of(stack, i, glass) == NONE:
            begin_with(stack, i, glass)
            unclosed[glass] += 1
    if second.size and second[i] < 0 and place_of(stack, i, -second[i] - 1) == NONE:
        begin_with(stack, i, -second[i] - 1)
        unclosed[-second[i] - 1] += 1
    if t == math.inf:
        for k in range(STACK):
            if stack[i, k] != NONE:
                unclosed[stack[i, k]] += 1
    return transmittance(stack, i, lobes, t)


@kernel(allocates=True)
def cross_media(stack, lobes, glass_of, material, front_face, second, t, throughput, unclosed):
    """Attenuate ``throughput`` (n, 3) by the Beer-Lambert law between ray origins and hits at ``t`` (n,).

    ``stack`` (n, STACK) changes as in `cross_medium`; ``second`` is as in the module. ``unclosed`` (lobes,)
    counts rays that leave a body without having entered it, or never leave one: its surface is not closed.
    """
    for i in range(material.size):
        r, g, b = cross_medium(
            stack, i, lobes, glass_of, material[i], front_face[i], second, t[i], unclosed
        )
        throughput[i, 0] *= r
        throughput[i, 1] *= g
        throughput[i, 2] *= b


@inlined
def leave(stack, i, lobe):
    """Leave a body if the ray is in it."""
    place = place_of(stack, i, lobe)
    if place != NONE:
        drop(stack, i, place)


@inlined
def pass_surface(lobe, stack, i, is_front, second):
    """Enter or leave a body, and the one whose face coincides; entering comes first."""
    other = second[i] if second.size else 0
    if is_front:
        push(stack, i, lobe)
    if other > 0:
        push(stack, i, other - 1)
    if not is_front:
        leave(stack, i, lobe)
    if other < 0:
        leave(stack, i, -other - 1)


@inlined
def look_beyond_one(lobes, lobe, stack, i, is_front, second, beyond):
    """Return the ``ratio`` of ray i, and set row i of ``beyond``: see `look_beyond`."""
    for k in range(STACK):
        beyond[i, k] = stack[i, k]
    if lobe == NONE:
        return 0.0
    pass_surface(lobe, beyond, i, is_front, second)
    before, after = filling_medium(stack, i, lobes), filling_medium(beyond, i, lobes)
    at = ior_of(lobes, after) / ior_of(lobes, before)
    return at if before != after and abs(at - 1.0) > MATCHED else 0.0


@kernel(allocates=True)
def look_beyond(lobes, lobe, stack, front_face, second, beyond, ratio):
    """Find the media beyond the rough glass that rays have hit; its ``lobe`` (n,) is `NONE` for other hits.

    Written are ``beyond`` (n, STACK), the stacks of transmitted rays, and ``ratio`` (n,), the index beyond
    over that before; 0 without rough glass, and where both sides have the same medium or index, so that it
    does not scatter.
    """
    for i in range(lobe.size):
        ratio[i] = look_beyond_one(lobes, lobe[i], stack, i, front_face[i], second, beyond)
