"""Sums of light per pixel."""

from meshing.kernels.jit import kernel


@kernel
def add_to_pixels(pixel, radiance, image):
    """Add rows of ``radiance`` (n, 3) to the rows of ``image`` that ``pixel`` names, in order.

    Rows with a negative pixel are left out.
    """
    for i in range(pixel.size):
        if pixel[i] < 0:
            continue
        for k in range(3):
            image[pixel[i], k] += radiance[i, k]
