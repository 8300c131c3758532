"""Points sampled on surfaces that shine."""

import numpy as np

from hybrid_rt.lights.surface import shining_surface


def chosen(surface, place, n=4096, seed=3, up=(0.0, 0.0, 1.0)):
    """Return sampled points, and what each adds to the irradiance on ``place`` facing ``up``."""
    light = shining_surface(surface)
    seen_from = np.tile(np.array(place, float), (n, 1))
    points = light.seen_points(seen_from, np.random.default_rng(seed).random((n, 2)))
    way = points.position - seen_from
    distance = np.linalg.norm(way, axis=1)
    facing = np.maximum(-np.einsum("ij,ij->i", way, points.normal), 0.0)
    below = points.pdf_area * distance**4
    value = np.divide(
        facing * np.maximum(way @ np.array(up), 0.0), below, out=np.zeros(n), where=below > 0.0
    )
    return light, seen_from, points, value
