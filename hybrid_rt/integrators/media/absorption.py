"""Beer-Lambert absorption along rays, and the count of the dielectrics that they are in."""

import numpy as np

from hybrid_rt.core.records import FloatArray, HitRecord, IntArray
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.shading.kernels.bsdf import LobeTable
from hybrid_rt.shading.kernels.medium_stack import cross_media, indices_within


def absorb(
    context: RenderContext,
    media: IntArray,
    material: IntArray,
    hits: HitRecord,
    second: IntArray,
    carried: FloatArray,
) -> None:
    """Attenuate throughput by the Beer-Lambert law between ray origins and hits.

    ``material`` (n,) int32; ``hits``, HitRecord of n rows; ``carried`` (n, 3), changed.
    ``media`` (n, STACK) int32, changed: medium stacks of the rays, see
    `hybrid_rt.shading.kernels.medium_stack`.
    ``second`` (n,) int32, or (0,): faces that coincide with the hits: see `Contacts.at`.
    """
    if context.plan["medium stack"]:
        scene = context.scene
        unclosed = np.zeros(scene.lobes.kind.size, dtype=np.int64)
        cross_media(
            media, scene.lobes, scene.glass_of, material, hits.front_face, second, hits.t, carried,
            unclosed,
        )  # fmt: skip
        for lobe in np.flatnonzero(unclosed):
            context.ledger.unclosed[int(lobe)] += int(unclosed[lobe])


def unclosed_bodies(context: RenderContext) -> tuple[dict[str, int], dict[str, int]]:
    """Return the number of rays that lost count of the dielectrics they are in, by objects' names.

    Such rays left a dielectric without having entered it, or never left it. Planes bound
    half-spaces, so they do not count.

    Returns ``not_closed``: of dielectrics with a surface that may be open; the names are those of
    such surfaces.
    ``lost``: of those made of spheres, boxes and tori, which are closed: their normals point
    inward, or there are too many within each other.
    """
    scene = context.scene
    not_closed: dict[str, int] = {}
    lost: dict[str, int] = {}
    n_objects = len(scene.names)
    for lobe, n_rays in sorted(context.ledger.unclosed.items()):
        objects = np.flatnonzero(scene.glass_of[scene.material_of[:n_objects]] == lobe)
        if all(scene.surfaces[i].is_bounded for i in objects):
            may_be_open = [i for i in objects if not scene.surfaces[i].is_closed]
            names = dict.fromkeys(scene.names[i] for i in may_be_open or objects)
            (not_closed if may_be_open else lost)[", ".join(names)] = n_rays
    return not_closed, lost


def square_of_index(media: IntArray, lobes: LobeTable) -> FloatArray:
    """Return the squared index of what fills the space around each ray, (n,).

    By it radiance in glass scales: refraction multiplies what a path carries by the square of the index
    that it comes from over that of the one that it enters, and gives it back on the way out.
    """
    ior = np.ones(len(media))
    if media.shape[1]:
        indices_within(ior, media, lobes)
    return ior * ior
