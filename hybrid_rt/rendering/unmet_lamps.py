"""What lamps, or a sun in the sky, that no camera ray has met may add to the mean of a picture.

Where a lamp is run into, by way of mirrors, metal or glass or as a speck in the picture, few camera rays
add its whole radiance. So it is with the brightest place of the sky, but for specks. As long as none has
met it, all passes agree, and no variance knows of it. If n rays have met nothing of a kind, no more than
3 of n others would in the mean, with 95 % confidence (1 - 0.05^(1/n); Hanley and Lippman-Hand, "If
nothing goes wrong, is everything all right?", JAMA 1983). Once one has, the differences between groups of
passes tell as much.
"""

from __future__ import annotations

import numpy as np

from hybrid_rt.core.records import BoolArray
from hybrid_rt.scene.compiled import NOTHING, CompiledScene
from hybrid_rt.shading.kernels.light_kinds import WITHOUT_AREA
from hybrid_rt.shading.kernels.lobes.register import FOLLOWED

OF_NONE_MET = 3.0
# A lamp in the picture that so many camera rays meet in the mean is no speck.
SURELY_MET = 30.0


def unmet_light(scene: CompiledScene, passes: int, ends_at_matt: bool = False) -> float:
    """Return how much of the picture's mean radiance may come by lamps unmet so far, at most (95 %).

    0 where no camera ray meets a lamp by chance: mirrors, metal and glass are missing, and no lamp is
    a speck in the picture. The sky counts where there are mirrors, metal or glass.

    Parameters
    ----------
    scene : CompiledScene
    passes : int
        Camera rays for each pixel.
    ends_at_matt : bool
        Whether camera paths end at surfaces that spread light, as they do where photons are gathered:
        then mirrors, metal and glass out of sight are as if they were missing.
    """
    lights, camera = scene.lights, scene.camera
    has_area = ~np.isin(lights.kind, WITHOUT_AREA)
    highest = scene.brightness.highest
    if not _meets_mirrors(scene, ends_at_matt):
        has_area &= _is_speck(scene, passes)
        highest = 0.0
    highest = float(lights.strength.mean(axis=1)[has_area].max(initial=highest))
    return OF_NONE_MET * highest / (passes * camera.width * camera.height)


def _meets_mirrors(scene: CompiledScene, ends_at_matt: bool) -> bool:
    """Tell whether camera rays may come to mirrors, metal or glass, at which they go on."""
    numbers = np.flatnonzero(scene.materials_with(FOLLOWED)[scene.material_of])
    if not ends_at_matt:
        return numbers.size > 0
    surfaces = [scene.surfaces[i] for i in numbers.tolist()]
    return any(not s.is_bounded or scene.camera.may_see(s.bounds) for s in surfaces)


def _is_speck(scene: CompiledScene, passes: int) -> BoolArray:
    """Tell which lamps are in the picture, and met by few camera rays."""
    is_speck = np.zeros(scene.n_lights, dtype=np.bool_)
    for light, number in enumerate(scene.surface_of_light.tolist()):
        if number == NOTHING or not scene.surfaces[number].is_bounded:
            continue
        low, high = scene.surfaces[number].bounds
        way, pixel, pdf = scene.camera.sees(0.5 * (low + high)[None])
        square = float(np.square(high - low).sum())
        met = passes * float(pdf[0]) * square / max(float(np.square(way).sum()), 1e-300)
        is_speck[light] = pixel[0] >= 0 and met < SURELY_MET
    return is_speck
