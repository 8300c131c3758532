"""Curved surfaces that several tests use."""

import math

import numpy as np

from meshing import BezierPatches, SurfaceOfRevolution


def ball_of_revolution(center, radius, n_arcs=8):
    """A sphere whose profile is n cubic arcs: off by less than 1e-6 of the radius at eight."""
    step = math.pi / n_arcs
    handle = 4 / 3 * math.tan(step / 4)
    segments = []
    for k in range(n_arcs):
        a, b = math.pi - k * step, math.pi - (k + 1) * step
        p, q = np.array([math.cos(a), math.sin(a)]), np.array([math.cos(b), math.sin(b)])
        points = [p, p + handle * np.array([p[1], -p[0]]), q - handle * np.array([q[1], -q[0]]), q]
        segments.append(radius * np.array(points))
    segments[0][0, 1] = segments[-1][-1, 1] = 0.0
    return SurfaceOfRevolution(segments, center, (0, 0, 1))


def dome(height=2.0):
    """A curved biquadratic patch that shines down on the floor below it."""
    grid = np.array([[[x, y, height] for y in (-0.7, 0.0, 0.7)] for x in (-1.0, 0.0, 1.0)])
    grid[1, 1, 2] += 0.8
    grid[0, 1, 0] -= 0.5
    return BezierPatches(grid[None]).flipped()
