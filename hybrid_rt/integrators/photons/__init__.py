"""Photon mapping: photon tracing, the eye pass, density estimation; PPM shrinks radii in `ppm`."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from hybrid_rt.integrators.declaration import Declaration
from hybrid_rt.integrators.options import PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.techniques import FOUND_BY_PHOTONS, paths_found

if TYPE_CHECKING:
    from hybrid_rt.integrators.context import RenderContext
    from hybrid_rt.integrators.workers import Workers
    from hybrid_rt.scene.compiled import CompiledScene

WHY_NO_LIGHT_PATHS = (
    "photons find what mirrors and glass throw onto surfaces that spread light widely"
)


def _make_ppm(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.photons.ppm import ProgressiveWorkers

    return ProgressiveWorkers(context, threads)


def _make_photon_map(context: RenderContext, threads: int) -> Workers:
    from hybrid_rt.integrators.photons.photon_workers import PhotonMapWorkers

    return PhotonMapWorkers(context, threads)


def _refuse(scene: CompiledScene) -> None:
    from hybrid_rt.integrators.photons.emission import ball_of_world, powers_of_lights

    powers_of_lights(scene, ball_of_world(scene))


PPM = Declaration(
    name="ppm",
    make=_make_ppm,
    finds=lambda _: paths_found(FOUND_BY_PHOTONS),
    options=PPMOptions,
    refuse=_refuse,
    without_light_paths=WHY_NO_LIGHT_PATHS,
    sends_photons=True,
)
PHOTON_MAP = replace(
    PPM,
    name="photon_map",
    make=_make_photon_map,
    options=PhotonMapOptions,
    keeps_caustic_map=True,
)
