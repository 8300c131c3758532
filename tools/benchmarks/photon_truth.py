"""Floors lit by photons whose illumination is known otherwise, to test the blur estimate.

A mirror reflects a light to a floor; the solution is the floor lit directly by the mirror image of
the light. The caustic of a glass sphere is computed by an independent light tracer without density
estimation.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Lambertian, Mirror
from hybrid_rt.primitives import Rectangle
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.sensor.projection import Projection
from proof.light.light_tracer import BALL

SIDE = 12
# The lamp stands upright before the mirror x = 0 and faces it; a square with these edges.
LAMP_X, LAMP_Z, LAMP_SIDE, RADIANCE = 0.4, 1.0, 0.4, 100.0
ALBEDO = 0.5
# Points per side of a pixel at which closed forms are taken.
POINTS = 8


@dataclass(frozen=True)
class PhotonPicture:
    """A picture that photons blur.

    Attributes
    ----------
    scene : Scene
    options : PPMOptions
        Large discs and many photons, so that the blur exceeds the noise.
    truth : callable
        Returns the exact radiance (height, width), and its own mean squared error.
    """

    scene: Scene
    options: PPMOptions
    truth: Callable[[], tuple[FloatArray, float]]


def smooth_floor() -> PhotonPicture:
    """Return a floor lit by way of a mirror; its irradiance is a closed form."""
    scene = _mirrored(with_screen=False)
    options = PPMOptions(100_000, initial_radius=0.6)
    return PhotonPicture(scene, options, lambda: (_light_of_image(scene.camera), 0.0))


def soft_shadow() -> PhotonPicture:
    """Return the same with the soft shadow of a screen, from shadow rays to the mirror image."""

    def truth() -> tuple[FloatArray, float]:
        result = render(_without_mirror(), passes=SHADOW_PASSES, seed=1)
        error = result.report["noise"]["root_mean_square_standard_error_of_pixels"]
        return result.image[:, :, 0].astype(np.float64), error**2

    options = PPMOptions(20_000, initial_radius=0.2)
    return PhotonPicture(_mirrored(with_screen=True), options, truth)


def caustic_edge() -> PhotonPicture:
    """Return the caustic under a glass sphere with its rim and the shadow, from light tracing."""
    camera = Camera((0, -3, 0.9), (0, 0, 0), (0, 0, 1), 10, SIDE, SIDE)

    def truth() -> tuple[FloatArray, float]:
        halves = [
            BALL.picture(
                BALL.floor_light(COUNTED // 2, CELLS, seed), COUNTED // 2, camera, RAYS_PER_SIDE
            )
            for seed in (1, 2)
        ]
        # The mean of the halves is off by half of what they differ.
        return 0.5 * (halves[0] + halves[1]), float(np.square(0.5 * (halves[0] - halves[1])).mean())

    options = PPMOptions(10_000, initial_radius=0.1)
    return PhotonPicture(BALL.scene(camera), options, truth)


# Both are sure to a tenth of the blur, in a few seconds.
SHADOW_PASSES = 2**12
COUNTED, CELLS = 10**8, 1024
# Of a pixel of the caustic: several for each cell that it sees. With 8 the truth itself was off by
# 0.0027 at the rim, more than the blur of discs that ppm chooses by itself.
RAYS_PER_SIDE = 32

PHOTON_PICTURES: dict[str, Callable[[], PhotonPicture]] = {
    "caustic edge": caustic_edge,
    "soft shadow": soft_shadow,
    "smooth floor": smooth_floor,
}


@dataclass(frozen=True)
class Blur:
    """The true blur of pictures and their estimates of it; absolute, over pixels.

    Attributes
    ----------
    true : float
        Root mean square of the mean of all pictures minus the truth, with the noise subtracted.
    noise : float
        Root mean square of a picture minus that mean.
    stated : (seeds,) float64
        ``blur_root_mean_square`` of each report; if that is None, the limit.
    at_most : (seeds,) float64
        ``blur_root_mean_square_at_most`` of each report.
    """

    true: float
    noise: float
    stated: FloatArray
    at_most: FloatArray

    @property
    def ratio(self) -> float:
        """Root mean square of the estimates over the true blur; nan if that is lost in the noise."""
        if self.true == 0.0:
            return math.nan
        return math.sqrt(float(np.square(self.stated).mean())) / self.true

    @property
    def within_half(self) -> float:
        """Fraction of pictures whose estimate is within 50 % of the true blur."""
        return float((np.abs(self.stated - self.true) <= 0.5 * self.true).mean())

    @property
    def below_limit(self) -> float:
        """Fraction of pictures whose limit is above the true blur."""
        return float((self.true <= self.at_most).mean())


def blur(
    picture: PhotonPicture, passes: int, seeds: Sequence[int], threads: int | None = None
) -> Blur:
    """Render a picture with each seed (two or more); compare estimated and true blur."""
    images, stated, at_most = [], [], []
    for seed in seeds:
        result = render(
            picture.scene,
            "ppm",
            passes,
            seed=seed,
            threads=threads,
            options=picture.options,
        )
        images.append(result.image.mean(axis=2, dtype=np.float64))
        photons = result.report["photons"]
        at_most.append(photons["blur_root_mean_square_at_most"])
        estimate = photons["blur_root_mean_square"]
        stated.append(at_most[-1] if estimate is None else estimate)
    truth, own_square = picture.truth()
    noise = float(np.var(images, axis=0, ddof=1).mean())
    gap = np.mean(images, axis=0) - truth
    true = float(np.square(gap).mean()) - noise / len(images) - own_square
    return Blur(math.sqrt(max(true, 0.0)), math.sqrt(noise), np.array(stated), np.array(at_most))


def _mirrored(with_screen: bool) -> Scene:
    # As much of it as throws light on what is seen and on the discs around.
    mirror = Object(Rectangle((0, -0.7, 0.3), (0, 1.4, 0), (0, 0, 1)), Mirror(1), "mirror")
    # Edges in this order: it shines towards the mirror.
    corner = (LAMP_X, -0.5 * LAMP_SIDE, LAMP_Z)
    lamp = RectangleLight(corner, (0, 0, LAMP_SIDE), (0, LAMP_SIDE, 0), RADIANCE)
    return _floor_scene([mirror], lamp, with_screen)


def _without_mirror() -> Scene:
    """Return the scene with the image of the lamp in place of lamp and mirror."""
    corner = (-LAMP_X, -0.5 * LAMP_SIDE, LAMP_Z)
    lamp = RectangleLight(corner, (0, LAMP_SIDE, 0), (0, 0, LAMP_SIDE), RADIANCE)
    return _floor_scene([], lamp, with_screen=True)


def _floor_scene(objects: list[Object], lamp: RectangleLight, with_screen: bool) -> Scene:
    """Return a floor seen from above beyond the lamp, where none of its light comes straight."""
    floor = Object(Rectangle((0.02, -1, 0), (1.98, 0, 0), (0, 2, 0)), Lambertian(ALBEDO), "floor")
    objects = [floor, *objects]
    if with_screen:
        screen = Rectangle((0.6, -0.15, 0.3), (0.2, 0, 0), (0, 0.3, 0))
        objects.append(Object(screen, Lambertian(0.0), "screen"))
    camera = Camera((1.07, 0, 2), (1.07, 0, 0), (0, 1, 0), 14, SIDE, SIDE)
    return Scene(camera, objects, [lamp])


def _light_of_image(camera: Projection) -> FloatArray:
    """Return the radiance (height, width) of the floor under the whole image of the lamp.

    Lambert's formula: the irradiance of a polygon is half its radiance times the sum over edges of
    the angle that they span, times the cosine between the normal of that angle's plane and the
    floor's.
    """
    shift = (np.arange(POINTS) + 0.5) / POINTS
    row, column, down, across = np.meshgrid(
        np.arange(camera.height), np.arange(camera.width), shift, shift, indexing="ij"
    )
    x, y = ((a + b).ravel().astype(np.float64) for a, b in ((column, across), (row, down)))
    origins, directions = camera.rays(x, y)
    places = origins - origins[:, 2:] / directions[:, 2:] * directions
    low, high = LAMP_Z, LAMP_Z + LAMP_SIDE
    left, right = -0.5 * LAMP_SIDE, 0.5 * LAMP_SIDE
    corners = [(-LAMP_X, y, z) for y, z in ((left, low), (right, low), (right, high), (left, high))]
    seen = [np.array(corner) - places for corner in corners]
    seen = [v / np.linalg.norm(v, axis=1, keepdims=True) for v in seen]
    total = np.zeros(len(places))
    for a, b in zip(seen, [*seen[1:], seen[0]], strict=True):
        across_both = np.cross(a, b)
        length = np.linalg.norm(across_both, axis=1)
        angle = np.arctan2(length, np.einsum("ij,ij->i", a, b))
        total += angle * across_both[:, 2] / length
    radiance = ALBEDO / math.pi * 0.5 * RADIANCE * np.abs(total)
    of_pixels: FloatArray = radiance.reshape(camera.height, camera.width, -1).mean(axis=2)
    return of_pixels
