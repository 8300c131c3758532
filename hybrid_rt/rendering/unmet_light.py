"""What light that no camera ray has met may add to the mean of a picture, and what photons say it lacks.

Where a lamp is run into, by way of mirrors, metal or glass or as a speck in the picture, few camera rays
add its whole radiance, or behind a matt surface its albedo times that. So it is with the brightest place of
the sky, but for specks. As long as none has met it, all passes agree, and no variance knows of it. If n rays
have met nothing of a kind, no more than 3 of n others would in the mean, with 95 % confidence
(1 - 0.05^(1/n); Hanley and Lippman-Hand, "If nothing goes wrong, is everything all right?", JAMA 1983). Once
one has, the differences between groups of passes tell as much.

A place that reflects much light, as the inside of a sphere behind a small opening, is met by chance as
well. Photons tell how bright the brightest one is; see `hybrid_rt.integrators.probes.cross_check`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.lights.surface import shining_surface
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.sensor.film import OVERFLOWS, REGIONS, Film, MeanNoise, regions_of
from hybrid_rt.sensor.intervals import half_interval_of_mean, score_limits
from hybrid_rt.sensor.passes import GROUPS, RUN
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA
from hybrid_rt.shading.kernels.lobes.register import DIFFUSE, FOLLOWED
from hybrid_rt.shading.kernels.texture import CONSTANT

if TYPE_CHECKING:
    from hybrid_rt.integrators.probes.cross_check import CrossCheck, MeanEstimate
    from hybrid_rt.rendering.report import MeanCheck

OF_NONE_MET = 3.0
# A lamp in the picture that so many camera rays meet in the mean is no speck.
SURELY_MET = 30.0
# So many points of a lamp each way tell how large it is in the picture.
ACROSS = 16
# A pixel that holds so much of the radiance of the brightest place has met it: what lies between them
# reflects about as much.
MET = 0.3
# One of all regions is beyond these normal quantiles as rarely as one estimate beyond those of 95 % and
# of one in a thousand.
QUANTILES = 2.955, 3.836
# By this share photons and paths may differ: shading normals are not the same for both.
ALIKE = 0.05


def unmet_light(
    scene: CompiledScene, passes: int, ends_at_matt: bool = False, samples_lights: bool = True
) -> float:
    """Return how much of the picture's mean radiance may come by lamps unmet so far, at most (95 %).

    0 where lamps are not met by chance alone: mirrors, metal and glass are missing, and no lamp is
    a speck in the picture. The sky counts where there are mirrors, metal or glass.

    ``passes``: camera rays for each pixel.
    ``ends_at_matt``: whether camera paths end at surfaces that spread light, as they do where
    photons are gathered: then mirrors, metal and glass out of sight are as if they were missing.
    ``samples_lights``: False: no next-event estimation, so every lamp is met by chance.
    """
    lights, camera = scene.lights, scene.camera
    has_area = ~np.isin(lights.kind, WITHOUT_AREA)
    highest = scene.brightness.highest
    if samples_lights and not _meets_mirrors(scene, ends_at_matt):
        has_area &= _is_speck(scene, passes)
        highest = 0.0
    strength = lights.strength.mean(axis=1)
    if (share := _most_carried_on(scene)) < 1.0:
        # All but specks in sight are met behind the first surface, a matt one.
        strength = np.where(_is_speck(scene, passes), strength, share * strength)
    highest = float(strength[has_area].max(initial=highest))
    return OF_NONE_MET * highest / (passes * camera.width * camera.height)


def _most_carried_on(scene: CompiledScene) -> float:
    """Return the most that a camera ray carries behind the first surface; 1 unless all in sight are matt."""
    lobes, textures = scene.lobes, scene.textures
    colors = textures.number[lobes.texture, :3].max(axis=1, initial=0.0) * scene.color_factor
    is_matt = (lobes.kind == DIFFUSE) & (textures.kind[lobes.texture] == CONSTANT)
    # A matt material carries on the sum of its lobes.
    of_lobe = np.where(is_matt, colors, 1.0)
    of_material = [float(of_lobe[a:b].sum()) for a, b in pairwise(lobes.first.tolist())]
    in_sight = [
        of_material[material]
        for surface, material in zip(scene.surfaces, scene.material_of.tolist(), strict=True)
        if material != NOTHING and (not surface.is_bounded or scene.camera.may_see(surface.bounds))
    ]
    return min(max(in_sight, default=0.0), 1.0)


def unmet_place(scene: CompiledScene, check: CrossCheck | None, film: Film, n_rays: int) -> float:
    """Return how much the brightest place may add to the mean if no camera ray has met it (95 %)."""
    if check is None or check.mean is None:
        return 0.0
    highest = _most_carried_on(scene) * check.mean.brightest_place
    return 0.0 if film.highest_sum >= MET * highest else OF_NONE_MET * highest / n_rays


def interval_of_noise(noise: MeanNoise) -> float:
    """Return half the 95 % interval of the image mean that its noise gives."""
    return half_interval_of_mean(
        noise.standard_error_of_image_mean, noise.interval_factor, noise.bright_path_in_image_mean
    )


@dataclass(frozen=True)
class Missing:
    """What a picture lacks by an independent estimate."""

    # What its mean lacks at most: to the upper end of the estimate's 95 % interval, of the whole or
    # of all regions together, where the lower end is above the picture's; else 0
    of_mean: float
    of_regions: FloatArray  # (REGIONS,): what the mean of each region lacks, likewise
    # Whether even the limit that one estimate of a thousand is beyond is above the mean, or one of
    # a region
    is_contradicted: bool
    region: int | None  # the region that lacks the most, if none but regions are contradicted


def missing_light(
    check: CrossCheck | None, film: Film, noise: MeanNoise, half: float, lost_share: float
) -> Missing:
    """Return what a picture may lack by an independent estimate.

    An estimate by few photons that says so is repeated with more.

    ``half``: half the interval of the mean so far.
    ``lost_share``: what limits of depth cut off of what paths carried. Photons and the camera rays
    that gather them have a limit each, so together they find a part of it.
    """
    if check is None or check.mean is None:
        return Missing(0.0, np.zeros(REGIONS), False, None)
    missing = _missing(check.mean, film, noise.image_mean, half, lost_share)
    if missing.of_mean > 0.0 and check.repeat():
        missing = _missing(check.mean, film, noise.image_mean, half, lost_share)
    return missing


@OVERFLOWS
def _missing(
    estimate: MeanEstimate, film: Film, mean: float, half: float, lost_share: float
) -> Missing:
    highest = (mean + half) * (1.0 + lost_share)
    of_mean = estimate.high - mean if estimate.low > highest else 0.0
    is_contradicted, region, of_regions = estimate.least > highest, None, np.zeros(REGIONS)
    if film.n_passes >= GROUPS * RUN:
        found, variance, event = film.regions()
        # A region that no bright path has met may lack those that others show: no need for a warning.
        of_all = (event * variance).sum() / (variance.sum() or 1.0)
        lacks, lacks_much = (
            estimate.least_of_regions(quantile)
            > (1.0 + lost_share + ALIKE)
            * (found + score_limits(quantile * np.sqrt(variance), events, quantile)[1])
            for quantile, events in zip(QUANTILES, (event, np.maximum(event, of_all)), strict=True)
        )
        of_regions[lacks] = (estimate.most_of_regions(QUANTILES[0]) - found)[lacks]
        of_mean = max(of_mean, float(of_regions.mean()))
        if lacks_much.any() and not is_contradicted:
            region, is_contradicted = int(np.where(lacks_much, of_regions, 0.0).argmax()), True
    return Missing(of_mean, of_regions, is_contradicted, region)


def with_unmet_light(half: NDArray[np.float32], check: MeanCheck) -> NDArray[np.float32]:
    """Return half the intervals of pixels, no less than what they may lack.

    What the whole picture may lack may lie in all pixels, and what a region lacks in its own.
    """
    of_all = max(check.unmet_place_95, check.image_mean_lacks_at_most)
    least = np.maximum(check.regions_lack_at_most, of_all).astype(np.float32)
    wide: NDArray[np.float32] = least[regions_of(*half.shape[:2])][:, :, None]
    return np.maximum(half, wide)


def _meets_mirrors(scene: CompiledScene, ends_at_matt: bool) -> bool:
    """Tell whether camera rays may come to mirrors, metal or glass, at which they go on."""
    numbers = np.flatnonzero(scene.materials_with(FOLLOWED)[scene.material_of])
    if not ends_at_matt:
        return numbers.size > 0
    surfaces = [scene.surfaces[i] for i in numbers.tolist()]
    return any(not s.is_bounded or scene.camera.may_see(s.bounds) for s in surfaces)


def _is_speck(scene: CompiledScene, passes: int) -> BoolArray:
    """Tell which lamps are in the picture, and met by few camera rays.

    A lamp of which none of the points tried is in the picture counts if another point of it may be.
    What stands before lamps is not looked at, and a lens counts as its middle.
    """
    rays, may_be_seen = scene.once("rays to lamps", lambda: _rays_to_lamps(scene))
    return np.where(np.isnan(rays), may_be_seen, passes * rays < SURELY_MET)


def _rays_to_lamps(scene: CompiledScene) -> tuple[FloatArray, BoolArray]:
    """Return how many camera rays of a pass meet each lamp, nan if none of its points is in the picture.

    And whether another point of it may be.
    """
    rays, may_be_seen = np.full(scene.n_lights, np.inf), np.zeros(scene.n_lights, dtype=np.bool_)
    camera, side = scene.camera, (np.arange(ACROSS) + 0.5) / ACROSS
    xi = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
    for light, number in enumerate(scene.surface_of_light.tolist()):
        if number == NOTHING or not scene.surfaces[number].is_bounded:
            continue
        lamp = scene.shining.get(light)
        if lamp is None or lamp.is_by_brightness:
            lamp = shining_surface(scene.surfaces[number])
        assert lamp is not None  # a plane has no bounds
        points = lamp.points(xi)
        way, pixel, pdf = camera.sees(points.position)
        distance = np.linalg.norm(way, axis=1)
        # Per point: its part of the area, foreshortened, over the squared distance, times rays per solid angle.
        facing = -np.einsum("ij,ij->i", way, points.normal)
        counts = (facing > 0.0) & (points.pdf_area > 0.0)
        if (counts & (pixel >= 0)).any():
            below = distance**3 * points.pdf_area
            each = np.divide(facing * pdf, below, out=np.zeros_like(below), where=counts)
            rays[light] = each.mean()
        else:
            bounds = scene.surfaces[number].bounds
            rays[light] = np.nan
            may_be_seen[light] = counts.any() and camera.may_see(bounds, from_the_middle=True)
    return rays, may_be_seen
