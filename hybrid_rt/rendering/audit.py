"""The share of wrong first hits at accuracy "mesh" or "refined", measured on some camera rays."""

import math

import numpy as np

from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.integrator import LENS_DIMENSION, PIXEL_DIMENSION
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.report import WrongFirstHits

# Rays compared: a share of 1e-3 is then known to within a factor of 1.6, in some 0.05 s.
RAYS = 2**14
# Half the width of a 95 % interval of the normal distribution.
NORMAL = 1.959964


def audit(context: RenderContext, threads: int | None = None) -> WrongFirstHits | None:
    """Compare first hits of camera rays with certified ones; None if the picture's are certified.

    The rays are those of the first pass through pixels spread evenly over the picture. The certified hits
    are found without triangles and without Embree, so they are independent of the method under test.
    """
    tracer = context.tracer
    if tracer.accuracy == "certified" or "embree" not in tracer.plan["used"]:
        return None
    from hybrid_rt.intersection.hit_errors import certified_hits, compare

    camera, sampler = context.scene.camera, context.sampler
    n_pixels = camera.width * camera.height
    n = min(RAYS, n_pixels)
    pixel = np.arange(n, dtype=np.uint64) * np.uint64(n_pixels) // np.uint64(n)
    row, column = np.divmod(pixel.astype(np.int64), camera.width)
    place = sampler.points(pixel, PIXEL_DIMENSION, 0)
    lens = sampler.points(pixel, LENS_DIMENSION, 0) if context.plan["lens samples"] else None
    origins, directions = camera.rays(column + place[:, 0], row + place[:, 1], lens)

    certified = Intersector(tracer.surfaces, coarse="none", threads=threads)
    exact = certified_hits(certified, origins, directions)
    own = tracer.with_own_counters()  # no work for the picture
    found = own.intersect(origins, directions)
    errors = compare(exact, found.t, found.object_id)
    wrong, n_rays = errors.wrong_hits.wrong, errors.wrong_hits.rays
    return WrongFirstHits(
        rays=n_rays,
        wrong=wrong,
        share=errors.wrong,
        interval_95=share_interval(wrong, n_rays),
        **errors.wrong_hits.counts,
        mean_error=errors.mean,
        worst_error=errors.worst,
    )


def share_interval(k: int, n: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a proportion, k of n observed.

    Wilson, "Probable inference, the law of succession, and statistical inference", JASA 22, 1927.
    scipy.stats has it too, but importing that takes 0.4 s, longer than a small render.
    """
    if n == 0:
        return 0.0, 1.0
    z2 = NORMAL * NORMAL
    middle, half = k + 0.5 * z2, NORMAL * math.sqrt(k * (n - k) / n + 0.25 * z2)
    return max(middle - half, 0.0) / (n + z2), min((middle + half) / (n + z2), 1.0)
