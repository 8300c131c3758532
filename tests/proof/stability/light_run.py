"""Renders of the light rows, and how far their means are from a truth.

Errors are in units of what chance allows: the half width of an interval that misses the truth once
in 1e5 renders, by Student's t, so above 1 a row fails.
"""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import stats

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import Options, PathOptions, PhotonMapOptions, PPMOptions
from hybrid_rt.lights import GradientSky
from hybrid_rt.materials import Emissive, Mirror
from hybrid_rt.materials.material import Material
from hybrid_rt.primitives import Box, Rectangle
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.result import RenderResult
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.stability.row import Effort, Outcome

INTEGRATORS = ("path", "whitted", "ppm", "photon_map")
PHOTON_INTEGRATORS = ("ppm", "photon_map")
WHITE_SKY = GradientSky(1.0, 1.0)
# How often a comparison fails by chance.
ALARM = 1e-5
# Pictures are float32: a few roundings of that.
FLOAT32 = 1e-6
# Camera paths end by their length only: no roulette, and nothing from the lamps.
PLAIN_PATHS = PathOptions(roulette_depth=10**6, survival=1.0, light_paths=0.0)
# Passes that count as independent of each other at most; see `hybrid_rt.sensor.film`.
FEW_PASSES = 15


def eye(look_from: ArrayLike, look_at: ArrayLike, n: int = 16, up: ArrayLike = (0, 1, 0)) -> Camera:
    """Return a camera whose n x n pixels all see the same point."""
    return Camera(look_from, look_at, up, vertical_fov=1e-6, width=n, height=n)


def floor(material: Material, half: float = 9.0, height: float = 0.0) -> Object:
    """Return a level square that looks up."""
    surface = Rectangle((-half, -half, height), (2 * half, 0, 0), (0, 2 * half, 0))
    return Object(surface, material, "floor")


def slab(low: float, high: float, material: Material) -> Object:
    """Return a plate so wide that its rim is out of sight."""
    return Object(Box((-50, -50, low), (50, 50, high)), material, f"slab {low:g}")


def mirrors(color: float, radiance: float = 0.0) -> list[Object]:
    """Return two level mirrors that face each other; they may shine as well."""
    material = Emissive(radiance, Mirror(color)) if radiance else Mirror(color)
    # Shining sides look at each other.
    below = Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0))
    above = Rectangle((-9, -9, 2), (0, 18, 0), (18, 0, 0))
    return [Object(below, material, "below"), Object(above, material, "above")]


def picture(
    effort: Effort,
    scene: Scene,
    integrator: str = "path",
    passes: int = 1,
    *,
    options: Options | None = None,
    n_photons: int = 4000,
    **settings: Any,
) -> RenderResult:
    """Render in one thread, by the effort's seed, with few photons."""
    few = {"ppm": PPMOptions, "photon_map": PhotonMapOptions}.get(integrator)
    own = few(n_photons) if options is None and few else options
    return render(
        scene, integrator, passes, seed=effort.seed, threads=1, options=own, **settings
    )  # fmt: skip


def off_by_pixels(
    result: RenderResult, truth: ArrayLike, bias: float = 0.0, level: float = 0.0
) -> tuple[float, float]:
    """Return |error| and what chance allows, where pixels are independent of each other.

    The worst channel decides. ``bias`` is what may be wrong besides, relative to the truth, and
    ``level`` the same in absolute terms.
    """
    values = result.image.reshape(-1, 3).astype(np.float64)
    spread = values.std(axis=0, ddof=1) / math.sqrt(len(values)) if len(values) > 1 else np.zeros(3)
    expected = np.broadcast_to(np.asarray(truth, dtype=np.float64), (3,))
    factor = stats.t.isf(ALARM / 6.0, max(len(values) - 1, 1))
    return _worst(values.mean(axis=0) - expected, factor * spread, expected, bias, level)


def off_by_passes(
    result: RenderResult, truth: float, bias: float = 0.0, level: float = 0.0
) -> tuple[float, float]:
    """Return |error| of the picture's mean and what chance allows, from what passes differ by.

    For what pixels share: photons, and paths from the lamps.
    """
    noise = result.report["noise"]
    degrees = result.report.passes - 1 if noise["errs_on_the_safe_side"] else 3
    spread = stats.t.isf(ALARM / 2.0, degrees) * noise["standard_error_of_image_mean"]
    gap = np.array([noise["image_mean"] - truth])
    return _worst(gap, np.array([spread]), np.array([truth]), bias, level)


def _worst(
    gap: FloatArray, spread: FloatArray, truth: FloatArray, bias: float, level: float
) -> tuple[float, float]:
    allowed = spread + (FLOAT32 + bias) * np.abs(truth) + level
    error = np.abs(gap)
    units = np.divide(error, allowed, out=np.where(error > 0.0, np.inf, 0.0), where=allowed > 0.0)
    worst = int(np.argmax(np.where(np.isfinite(error), units, np.inf)))
    return float(error[worst]), float(allowed[worst])


def judged(name: str, result: RenderResult, off: tuple[float, float]) -> Outcome:
    """Return what came of one comparison; pictures must be finite besides."""
    error, allowed = off
    units = error / allowed if allowed > 0.0 else (0.0 if error == 0.0 else math.inf)
    outcome = Outcome(rays=result.report.rays["camera"], error=units) + finite(name, result)
    fault = f"{name}: off by {error:.3g} where {allowed:.3g} is allowed"
    return outcome.checked(units <= 1.0, fault)


def finite(name: str, result: RenderResult) -> Outcome:
    """Return a fault where pixels are no numbers, or negative."""
    good = bool(np.isfinite(result.image).all()) and float(result.image.min()) >= 0.0
    return Outcome().checked(good, f"{name}: pixels that are negative, infinite or no numbers")


def same(name: str, found: ArrayLike, truth: ArrayLike, relative: float = 0.0) -> Outcome:
    """Return the outcome of an identity; ``relative`` 0 asks for the same bits."""
    a, b = np.asarray(found, dtype=np.float64), np.asarray(truth, dtype=np.float64)
    if a.shape != b.shape:
        return Outcome(rays=1, faults=(f"{name}: shape {a.shape} where {b.shape} is expected",))
    if relative == 0.0:
        wrong = int(np.count_nonzero(~(a == b)))
        return Outcome(rays=a.size, wrong=wrong).checked(
            not wrong, f"{name}: {wrong} values differ"
        )
    with np.errstate(invalid="ignore", divide="ignore"):
        units = np.abs(a - b) / (relative * np.abs(b))
    units = np.where(a == b, 0.0, np.where(np.isnan(units), np.inf, units))
    worst = float(units.max(initial=0.0))
    fault = f"{name}: off by {worst * relative:.3g} of the value"
    return Outcome(rays=a.size, error=worst).checked(worst <= 1.0, fault)


def measured(run: Callable[[], RenderResult]) -> tuple[RenderResult, float]:
    """Return a render, and the most memory it held at a time beyond what there was (MiB)."""
    tracemalloc.start()
    try:
        result = run()
        return result, tracemalloc.get_traced_memory()[1] / 2**20
    finally:
        tracemalloc.stop()
