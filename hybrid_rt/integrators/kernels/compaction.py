"""Stream compaction of ray batches: selecting rows of many arrays at once, and sums per pixel.

Each kernel makes one pass over memory; NumPy would make a dozen, each with a temporary array.
"""

from typing import Any, NamedTuple

from hybrid_rt.integrators.kernels.ways import N_COLUMNS, OTHER
from meshing.kernels.jit import inlined, kernel


class Paths(NamedTuple):
    """Active paths, in the order of their camera rays."""

    camera_ray: Any  # (n,) int64, row in the block of camera rays
    pixel: Any  # (n,) uint64; with the sample it names the path's random numbers
    sample: Any  # (n,) uint64
    origins: Any  # (n, 3) float64
    directions: Any  # (n, 3) float64, unit
    throughput: Any  # (n, 3) float64, what one unit of radiance on this ray adds to its pixel
    pdf: Any  # (n,) float64, density of the direction; 0 where it had no choice
    # (n,) float64, largest channel of the throughput behind the vertex before; 0: all surfaces so far
    # were mirrors or glass
    carried: Any
    splits: Any  # (n,) int8, how often it may still be divided, see `hybrid_rt.integrators.kernels.branches`
    # (n,) float64, see `hybrid_rt.integrators.kernels.light_paths`; (0,) where nothing is compared with it
    connection_pdf: Any
    media: Any  # (n, STACK) int32, dielectrics that the ray is in; (n, 0): there are none
    source_id: Any  # (n,) int32, object that the ray leaves from; -1 at the camera
    # (n,) bool, the light that diffuse surfaces send along the ray is found by connections; (0,): none
    joined: Any
    # (n,) bool, a surface that is not narrow has spread it, see `hybrid_rt.integrators.kernels.light_paths`;
    # (0,): as above
    has_met_wide: Any
    # See `hybrid_rt.integrators.kernels.ways`; (0,) and (0, 9) without its technique:
    chain: Any  # (n,) int8, what was met since the last non-delta vertex
    anchor: Any  # (n, 9) float64, where that vertex is, and what was sampled there


@inlined
def copy_path(source, i, target, j):
    """Copy row i of some paths to row j of others."""
    target.camera_ray[j] = source.camera_ray[i]
    target.pixel[j] = source.pixel[i]
    target.sample[j] = source.sample[i]
    target.pdf[j] = source.pdf[i]
    target.carried[j] = source.carried[i]
    target.splits[j] = source.splits[i]
    if source.connection_pdf.size:
        target.connection_pdf[j] = source.connection_pdf[i]
        target.joined[j] = source.joined[i]
        target.has_met_wide[j] = source.has_met_wide[i]
    if source.chain.size:
        target.chain[j] = source.chain[i]
        if source.chain[i] != OTHER:
            for k in range(N_COLUMNS):
                target.anchor[j, k] = source.anchor[i, k]
    target.source_id[j] = source.source_id[i]
    for k in range(3):
        target.origins[j, k] = source.origins[i, k]
        target.directions[j, k] = source.directions[i, k]
        target.throughput[j, k] = source.throughput[i, k]
    for k in range(source.media.shape[1]):
        target.media[j, k] = source.media[i, k]


@kernel(allocates=True)
def add_products(camera_ray, throughput, value, radiance):
    """Add throughput x value, both (n, 3), to the rows ``camera_ray`` of ``radiance``."""
    for i in range(camera_ray.size):
        for k in range(3):
            radiance[camera_ray[i], k] += throughput[i, k] * value[i, k]


@kernel(allocates=True)
def add_unblocked(camera_ray, follows, blocked, value, radiance):
    """Add the values (n, 3) of unoccluded rays to the rows ``camera_ray`` of ``radiance``.

    ``follows`` (n,) is as in `hybrid_rt.integrators.kernels.light_sampling.ShadowRays`; ``blocked`` (n,) bool.
    """
    is_blocked = False
    for i in range(camera_ray.size):
        is_blocked = blocked[i] or (follows[i] and is_blocked)
        if not is_blocked:
            for k in range(3):
                radiance[camera_ray[i], k] += value[i, k]


@kernel(allocates=True)
def add_to_pixels(pixel, radiance, image):
    """Add rows of ``radiance`` (n, 3) to the rows ``pixel`` of ``image``, in order.

    Rows with a negative pixel are left out.
    """
    for i in range(pixel.size):
        if pixel[i] < 0:
            continue
        for k in range(3):
            image[pixel[i], k] += radiance[i, k]
