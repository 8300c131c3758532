"""Trimmed surfaces for tests, and rays past their edges.

Those that the judges have as well come from `proof.cases.trimmed_surfaces`.
"""

import numpy as np

from meshing import (
    BezierPatches,
    NurbsSurface,
    SurfaceOfRevolution,
    TrimmedSurface,
    circle,
    polygon,
)
from proof.cases.rational_surfaces import octants
from proof.cases.trimmed_surfaces import cut_lens, wavy_loop, windowed_cylinder, windowed_torus
from proof.cases.trimmed_surfaces import drilled_part as turned_part
from proof.cases.trimmed_surfaces import drilled_plate as slanted_plane
from proof.cases.trimmed_surfaces import trimmed_patch as bumpy
from proof.cases.trimmed_surfaces import windowed_ball as _windowed_ball

__all__ = [
    "OUTLINE", "ball_piece", "bumpy", "cap", "cut_lens", "edge_rays", "nurbs_torus", "nurbs_tube",
    "part_of_cone", "plate", "ring", "sheet", "slanted_plane", "turned_part", "wavy_loop",
    "windowed_ball", "windowed_cylinder", "windowed_torus",
]  # fmt: skip

OUTLINE = polygon([(0, 0), (1, 0), (1, 1), (0, 1)])


def plate(loops=None, gap=0.0):
    """The square of side 2 about the origin, in z = 0, with a round hole of radius 1/2."""
    flat = BezierPatches([[[[-1, -1, 0], [-1, 1, 0]], [[1, -1, 0], [1, 1, 0]]]])
    return TrimmedSurface(flat, loops or [OUTLINE, circle((0.5, 0.5), 0.25)], gap)


def sheet(seed=2):
    """A NURBS surface of 3 x 2 patches with three holes across their borders."""
    rng = np.random.default_rng(seed)
    knots_u, knots_v = [0, 0, 0, 0, 1, 2, 3, 3, 3, 3], [0, 0, 0, 1, 2, 2, 2]
    x, y = np.meshgrid(np.linspace(-1, 1, 6), np.linspace(-1, 1, 4), indexing="ij")
    net = np.stack([x, y, rng.uniform(-0.3, 0.3, (6, 4))], axis=-1)
    surface = NurbsSurface(net, knots_u, knots_v, (3, 2), rng.uniform(0.5, 2, (6, 4)))
    holes = [circle((1 / 3, 0.5), 0.2), circle((0.7, 0.4), (0.1, 0.25)), circle((0.8, 0.9), 0.05)]
    return TrimmedSurface(surface, [OUTLINE, *holes])


def ball_piece():
    """A rational octant of the unit sphere, inside a circle in (u, v)."""
    net, weights = octants().patches[0], octants().weights[0]
    return TrimmedSurface(BezierPatches([net], [weights]), [circle((0.5, 0.5), 0.35)])


def edge_rays(surface, n, seed, reach=3.0):
    """Rays past points of the loops, beside them by 1e-1 to 1e-14 in (u, v), or not at all.

    Returns
    -------
    origins, directions : (n, 3)
    beside : (n,) float64, about how far the ray passes the edge, scene units
    """
    rng = np.random.default_rng(seed)
    curves = [curve for loop in surface.loops for curve in loop]
    at = np.array(
        [
            curves[k].point(rng.choice([0.0, 1.0, 0.5, rng.random()]))[0]
            for k in rng.integers(len(curves), size=n)
        ]
    )
    beside = rng.choice([0.0, *10.0 ** -np.arange(1, 15)], n)
    turn = rng.uniform(0, 2 * np.pi, n)
    at += beside[:, None] * np.column_stack([np.cos(turn), np.sin(turn)])
    # Where the surface closes on itself an edge goes on at its other border.
    u, v = np.where(np.array(surface.closes)[:, None], at.T % 1.0, np.clip(at.T, 0.0, 1.0))
    point, normal = surface.point(u, v), surface.normal(u, v)
    away = rng.normal(size=(n, 3))
    away /= np.linalg.norm(away, axis=1)[:, None]
    away += 0.4 * normal * np.sign(np.einsum("ij,ij->i", away, normal))[:, None]
    return point + reach * away, -away, beside * surface.size


def windowed_ball():
    """A flipped sphere with a window over a pole's meridians, a round one across the seam."""
    return _windowed_ball().flipped()


def part_of_cone():
    """Part of a cone's turn inside one smooth outline."""
    rng = np.random.default_rng(5)
    cone = SurfaceOfRevolution([(0, 0.2), (1, 1)], (0, 0, 0), (0, 0, 1), u_range=(0.1, 0.75))
    return TrimmedSurface(cone, [wavy_loop(rng, 0.35, 4, 3, False)])


def cap():
    """A cap of the unit sphere, turned from a rational quarter circle: v from 1/2 on."""
    quarter = [(0, 1), (1, 1), (1, 0)]
    dome = SurfaceOfRevolution(quarter, (0, 0, 0), (0, 0, 1), weights=(1, np.sqrt(0.5), 1))
    return TrimmedSurface(dome, [polygon([(0, 0.5), (1, 0.5), (1, 1), (0, 1)])])


def ring():
    """Three quarters of a ring whose profile ends where it begins, cut across that place."""
    segments = [
        [(-0.3, 0.7), (-0.3, 1.2)],
        [(-0.3, 1.2), (0, 1.5), (0.4, 1.2)],
        [(0.4, 1.2), (0.3, 0.7)],
        [(0.3, 0.7), (-0.3, 0.7)],
    ]
    whole = SurfaceOfRevolution(segments, (0, 0, 0.1), (0.1, 0.3, 1), u_range=(-0.1, 0.65))
    notch = polygon([(0.3, -0.1), (0.5, -0.15), (0.6, 0.2), (0.35, 0.12)])
    return TrimmedSurface(whole, [OUTLINE, notch, circle((0.3, 0.6), (0.1, 0.2))])


# Nine points of the unit circle as four rational quarters; the last is the first.
AROUND = np.array([(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)])
AROUND_WEIGHTS = np.where(np.arange(9) % 2, np.sqrt(0.5), 1.0)
AROUND_KNOTS = [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4]


def nurbs_tube():
    """The cylinder of radius 1 about z from -1 to 1 as a NURBS surface that closes in u."""
    net = np.array([[(x, y, z) for z in (-1.0, 1.0)] for x, y in AROUND])
    weights = np.repeat(AROUND_WEIGHTS[:, None], 2, axis=1)
    return NurbsSurface(net, AROUND_KNOTS, [0, 0, 1, 1], (2, 1), weights)


def nurbs_torus():
    """The torus of radii 1 and 1/2 about z as a NURBS surface that closes in u and in v."""
    net = np.array(
        [[(x * (1 + 0.5 * r), y * (1 + 0.5 * r), 0.5 * z) for r, z in AROUND] for x, y in AROUND]
    )
    weights = AROUND_WEIGHTS[:, None] * AROUND_WEIGHTS
    return NurbsSurface(net, AROUND_KNOTS, AROUND_KNOTS, 2, weights)
