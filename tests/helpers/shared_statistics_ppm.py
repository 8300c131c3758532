"""Progressive photon mapping as it was first published: statistics shared between rounds.

Hachisuka, Ogaki and Jensen, "Progressive photon mapping", ToG 27(5), 2008. Points are fixed; each
keeps its radius, a number of photons and their summed light, which every round of photons changes.
A reference for the independent passes of the integrator: the same photons, another update, and
plain NumPy for the sums.
"""

from __future__ import annotations

import math

import numpy as np

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import MET_SPECULAR, Photons
from hybrid_rt.integrators.media.contacts import Contacts
from hybrid_rt.integrators.photons.emission import blocks_of
from hybrid_rt.integrators.photons.photon_tracer import PHOTON_DIMENSION, PhotonTracer
from hybrid_rt.integrators.rows import joined
from hybrid_rt.intersection import Intersector
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.plan import make_plan
from hybrid_rt.scene.scene import Scene


def make_photon_tracer(scene: Scene, seed: int, max_depth: int = 16) -> PhotonTracer:
    """Return what sends out the photons of a scene, in one thread."""
    compiled = compile_scene(scene)
    tracer = Intersector(compiled.surfaces, threads=1)
    plan = make_plan(compiled, INTEGRATORS["ppm"])
    contacts = Contacts(compiled, tracer) if plan["contacts"] else None
    return PhotonTracer(
        RenderContext(compiled, tracer, Pool(1), plan, Sampler(seed), Ledger(), max_depth), contacts
    )


def all_photons(
    photon_tracer: PhotonTracer, n_photons: int, pass_number: int, least_history: int = MET_SPECULAR
) -> Photons:
    """Return the photons of a pass that are stored; ``least_history`` 0 keeps straight ones."""
    return joined(
        [
            photon_tracer.shoot(block, pass_number, PHOTON_DIMENSION, least_history)[0]
            for block in blocks_of(photon_tracer.groups(n_photons))
        ]
    )


def shared_statistics(
    photon_tracer: PhotonTracer,
    points: FloatArray,
    normal: FloatArray,
    albedo: float,
    rounds: int,
    photons_per_round: int,
    radius: float,
    alpha: float = 2.0 / 3.0,
) -> FloatArray:
    """Return the radiance that photons make at points of a matt plane, after each round.

    Parameters
    ----------
    photon_tracer : PhotonTracer
    points : (n, 3) float64
    normal : (3,) float64
        Of the plane, unit, on the side that is looked at.
    albedo : float
    rounds, photons_per_round : int
    radius : float
        At the start.
    alpha : float
        Share of the photons of a round that are kept.

    Returns
    -------
    (rounds, n, 3) float64
    """
    from scipy.spatial import cKDTree

    squared = np.full(len(points), radius * radius)
    kept = np.zeros(len(points))
    light = np.zeros((len(points), 3))
    results = np.empty((rounds, len(points), 3))
    for number in range(rounds):
        photons = all_photons(photon_tracer, photons_per_round, number)
        is_seen = (photons.normal @ normal) > 0.5
        position, power = photons.position[is_seen], photons.power[is_seen].astype(np.float64)
        tree = cKDTree(position)
        for i, near in enumerate(tree.query_ball_point(points, np.sqrt(squared))):
            found = len(near)
            if found == 0:
                continue
            light[i] += power[near].sum(axis=0)
            share = (kept[i] + alpha * found) / (kept[i] + found)
            kept[i] += alpha * found
            squared[i] *= share
            light[i] *= share
        # The power of a photon is already that over the number of photons of a round.
        area = math.pi * squared[:, None] * (number + 1.0)
        results[number] = albedo / math.pi * light / area
    return results
