"""All crossings of a ray with Bezier patches, isolated in whole numbers.

The largest component of the direction, k, is divided out: with i and j the two others,

    f = d_k (S_i - o_i) - d_i (S_k - o_k),    g = d_k (S_j - o_j) - d_j (S_k - o_k)

vanish where S(u, v) is on the ray, and t = (S_k - o_k) / d_k. (Those of rational patches are times
the denominator W, which is positive.) Times a power of two the Bernstein
coefficients of f and g are whole numbers, and so they stay when a piece is halved: nothing is
rounded. A piece without a sign change in f, in g, or in their components along and across its
longer tangent is dropped. A piece is settled where the Jacobian of (f, g), times the adjugate of its
mean, differs from a multiple det of the identity by at most q |det|, q <= 1/9, on the piece grown by an
eighth to each side: then F = adj (f, g) / det is injective there, F(x) = 0 has a solution within
|F(p)| / (1 - q) of any p for which that ball is inside (x -> x - F(x) contracts it), and there is no
other (Krawczyk 1969). What is left after many pieces, or below any size that matters, is said to be
open.

Edges of which the ray holds every point (a collapsed edge that it meets, a straight edge that it
follows) are found exactly and divided out of f and g; so is a flat patch whose plane holds the ray.
"""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import FloatArray
from meshing import BezierPatches
from proof.exact.crossings import Crosser, Crossing, RationalVector, near
from proof.exact.patch_and_ray import Net, PatchAndRay


def patches_crosser(surface: BezierPatches) -> Crosser:
    """Return a function that finds all crossings with patches, on shared edges one for each."""
    nets = [
        Net(k, net, rest, weights)
        for k, (net, rest, weights) in enumerate(
            zip(surface.patches, surface.remainders, weights_of(surface), strict=True)
        )
    ]
    # Float64 nets for a first look, all of one shape together.
    by_shape: dict[tuple[int, int], list[int]] = {}
    for k, net in enumerate(surface.patches):
        by_shape.setdefault(net.shape[:2], []).append(k)
    stacks = [
        (members, np.stack([surface.patches[k].reshape(-1, 3) for k in members]))
        for members in by_shape.values()
    ]

    def crossings(o: RationalVector, d: RationalVector) -> list[Crossing]:
        found = [members[k] for members, points in stacks for k in near(points, o, d)]
        return [one for k in sorted(found) for one in PatchAndRay(nets[k], o, d).crossings()]

    return crossings


def weights_of(surface: BezierPatches) -> list[FloatArray]:
    """Return the weights of each patch, ones for polynomial ones."""
    if surface.weights is None:
        return [np.ones(net.shape[:2]) for net in surface.patches]
    return list(surface.weights)
