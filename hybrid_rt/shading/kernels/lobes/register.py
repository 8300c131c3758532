"""The register of lobes: which kinds there are, and what is true of each.

A kind is a name, not a rank. Whoever wants lobes of some sort asks for traits, by a mask of bits:
`lobes.traits[row] & SPREADS` is true of each lobe that has one of the bits in `SPREADS`.
"""

# How widely a lobe spreads light; each has one of these three.
# Wide: photons are gathered there, and Whitted's method lights it by shadow rays.
WIDE = 1
# Narrow: it has a density per solid angle, so lights are sampled through it; but what it reflects
# is found by following one sampled direction. A gather of photons would find few within the lobe.
NARROW = 2
# A delta distribution: mirror and smooth glass. Nothing but the lobe itself chooses its directions.
DELTA = 4
# Light passes to the other side: this is the surface of a clear body. Rays keep count of the body,
# its numbers begin as `hybrid_rt.shading.kernels.medium_stack` says, and its colour is a tint of
# what passes, not of what is reflected. Such a lobe is followed: DELTA or NARROW.
TRANSMITS = 8

SPREADS = WIDE | NARROW
FOLLOWED = NARROW | DELTA
EVERY = WIDE | NARROW | DELTA

DIFFUSE, PHONG, METAL, MIRROR, DIELECTRIC = range(5)

TRAITS = {
    DIFFUSE: WIDE,
    PHONG: WIDE,
    METAL: NARROW,
    MIRROR: DELTA,
    DIELECTRIC: DELTA | TRANSMITS,
}
