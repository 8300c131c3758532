"""Means of path-traced pixels, whether they agree, and a closed form that they are held to."""

import math

import numpy as np
from scipy import stats

from hybrid_rt.rendering.renderer import render
from hybrid_rt.sensor.camera import Camera

# A test that compares means decides wrongly once in 1e5 runs with another seed.
ALARM = 1e-5


def many_rays(look_from, look_at, up=(0, 0, 1), n=32, fov=1e-6):
    """A camera whose n x n pixels all see the same point."""
    return Camera(look_from, look_at, up, vertical_fov=fov, width=n, height=n)


def samples(scene, passes=16, **settings):
    """Return one mean per pixel and channel; pixels are independent of each other."""
    return render(scene, "path", passes=passes, **settings).image.reshape(-1, 3).astype(float)


def assert_mean_equals(values, expected):
    mean = values.mean(axis=0)
    error = values.std(axis=0, ddof=1) / math.sqrt(len(values))
    limit = stats.norm.isf(ALARM / 6) * error
    # A sum of pixels in float32 is as good as this, where nothing varies at all.
    assert (np.abs(mean - expected) <= limit + 1e-6 * np.abs(expected)).all(), (
        mean,
        expected,
        error,
    )


def assert_means_agree(a, b):
    error = np.sqrt((a.var(axis=0, ddof=1) + b.var(axis=0, ddof=1)) / len(a))
    gap = np.abs(a.mean(axis=0) - b.mean(axis=0))
    assert (gap <= stats.norm.isf(ALARM / 6) * error + 1e-9).all(), (gap, error)


def irradiance(x, y, height, low, high):
    """Irradiance at (x, y, 0) below the rectangle low..high of radiance one that faces down.

    Four corners of the closed form of Siegel and Howell, configuration C-11, with signs.
    """

    def corner(a, b):
        p, q = np.hypot(a, height), np.hypot(b, height)
        return 0.5 * (a / p * np.arctan(b / p) + b / q * np.arctan(a / q))

    return (
        corner(high[0] - x, high[1] - y) - corner(low[0] - x, high[1] - y)
        - corner(high[0] - x, low[1] - y) + corner(low[0] - x, low[1] - y)
    )  # fmt: skip
