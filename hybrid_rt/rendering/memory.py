"""The memory that a render will take, checked before it begins."""

from collections.abc import Sequence

from hybrid_rt.core.memory import available_bytes, bytes_in_words
from hybrid_rt.rendering.channels import numbers_per_pixel
from hybrid_rt.sensor.projection import Projection

# Of each pixel, as measured: sums of four groups and of squares, one pass, the picture and its file (177);
# by photons also the blur of each pixel and its squares, and points that wait for photons (340).
PER_PIXEL, PER_PIXEL_WITH_PHOTONS = 175, 340
# Of each photon of a pass, with its share of the tree, where most arrive somewhere: 173 by ppm, 228 by
# a photon map.
PER_PHOTON = 200
# Passes whose photons exist at a time: while one is looked at the next is shot.
PHOTON_SETS = 2


def check_memory(
    camera: Projection, photons: int, outputs: Sequence[str], passes: int | None = None
) -> None:
    """Raise MemoryError if a render needs more memory than this process can have.

    ``photons`` are those of a pass; ``passes`` the largest number, None if it is unlimited.
    """
    n_pixels, available = camera.width * camera.height, available_bytes()
    per_pixel = PER_PIXEL_WITH_PHOTONS if photons else PER_PIXEL
    per_pixel += 4 * numbers_per_pixel(outputs)
    for_pixels = n_pixels * per_pixel
    for_photons = min(passes or PHOTON_SETS, PHOTON_SETS) * photons * PER_PHOTON
    if for_pixels + for_photons > available:
        what = f"a picture of {camera.width} x {camera.height} pixels"
        if photons:
            what += f" by passes of {photons} photons"
        raise MemoryError(
            f"{what} takes about {bytes_in_words(for_pixels + for_photons)} of memory, this process can have "
            f"{bytes_in_words(available)}: ask for fewer {'photons' if for_photons > for_pixels else 'pixels'}"
        )
