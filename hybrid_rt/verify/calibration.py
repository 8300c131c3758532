"""Are stated errors true? Noise against closed forms, t_bound against double-double."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.camera import Camera
from hybrid_rt.intersection import Intersector
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.records import FloatArray, Status
from hybrid_rt.rendering import render
from hybrid_rt.scene import Object, Scene
from hybrid_rt.verify.campaign import STEP
from hybrid_rt.verify.judge import compare
from hybrid_rt.verify.kernels.events import BAND
from hybrid_rt.verify.oracle import first_hits
from hybrid_rt.verify.rays import hard_rays

# Pixels of the pictures: enough for a mean, few enough for hundreds of pictures.
SIDE = 4
EPS = float(np.finfo(np.float64).eps)


@dataclass(frozen=True)
class KnownPicture:
    """A scene of which every pixel's true radiance is known.

    Attributes
    ----------
    scene : Scene
    truth : (3,) float64
        Of every pixel.
    settings : dict
        What `render` takes besides.
    has_bounces : bool
        Whether light comes by way of other surfaces, which Whitted's method leaves out.
    """

    scene: Scene
    truth: FloatArray
    settings: dict[str, Any]
    has_bounces: bool = False


def _one_point(look_from: Sequence[float], look_at: Sequence[float]) -> Camera:
    """Return a camera all pixels of which see the same point."""
    return Camera(look_from, look_at, (0, 1, 0), vertical_fov=1e-6, width=SIDE, height=SIDE)


def floor_under_lamp() -> KnownPicture:
    """Return a matt floor under the corner of a rectangular lamp: a smooth integrand.

    The irradiance is that of a textbook's parallel rectangle.
    """
    a, b, height = 1.5, 0.7, 0.9
    lamp = RectangleLight((0, 0, height), (0, b, 0), (a, 0, 0), (1, 2, 3))
    floor = Object(Rectangle((-5, -5, 0), (10, 0, 0), (0, 10, 0)), Lambertian(0.5), "floor")
    p, q = math.hypot(a, height), math.hypot(b, height)
    irradiance = 0.5 * (a / p * math.atan(b / p) + b / q * math.atan(a / q))
    camera = _one_point((-0.3, -0.2, 0.5), (0, 0, 0))
    truth = 0.5 / math.pi * irradiance * np.array([1.0, 2.0, 3.0])
    return KnownPicture(Scene(camera, [floor], [lamp]), truth, {})


def shining_room() -> KnownPicture:
    """Return a closed room whose walls shine and reflect half: L = 1 + L / 2, over many bounces."""
    walls = Emissive((1.0, 0.5, 0.25), Lambertian(0.5))
    room = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), walls, "room")
    camera = Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, SIDE, SIDE)
    # What 60 reflections leave out is 2**-60.
    return KnownPicture(Scene(camera, [room]), np.array([2.0, 1.0, 0.5]), {"max_depth": 60}, True)


def ball_in_a_pixel() -> KnownPicture:
    """Return a shining ball in the middle of one pixel: its share of the pixel is an area.

    The camera sees the ball within an angle of arcsin(r / d), a disc on the film.
    """
    d, r, fov = 5.0, 0.6, 20.0
    ball = Object(Sphere((0, 0, 0), r), Emissive((1.0, 2.0, 4.0)), "ball")
    camera = Camera((0, 0, d), (0, 0, 0), (0, 1, 0), fov, 1, 1)
    tangent = math.tan(math.asin(r / d)) / math.tan(math.radians(0.5 * fov))
    truth = 0.25 * math.pi * tangent**2 * np.array([1.0, 2.0, 4.0])
    return KnownPicture(Scene(camera, [ball]), truth, {})


PICTURES: dict[str, Callable[[], KnownPicture]] = {
    "floor under a lamp": floor_under_lamp,
    "shining room": shining_room,
    "ball in a pixel": ball_in_a_pixel,
}


@dataclass(frozen=True)
class Coverage:
    """How often the truth fell into the stated 95 % intervals.

    Attributes
    ----------
    of_pixels, of_mean : float
        Shares, over all seeds, pixels and channels; over all seeds.
    error_ratio : float
        Root mean square of the stated standard errors of pixels over that of the true errors.
    """

    of_pixels: float
    of_mean: float
    error_ratio: float


def coverage(picture: KnownPicture, integrator: str, passes: int, seeds: Sequence[int]) -> Coverage:
    """Render a known picture with each seed and see whether the stated intervals hold the truth."""
    pixels, means, stated, true = [], [], 0.0, 0.0
    for seed in seeds:
        result = render(
            picture.scene,
            integrator,
            passes,
            seed=seed,
            threads=1,
            outputs=["standard_error"],
            **picture.settings,
        )
        noise, error = result.report["noise"], result.channels["standard_error"]
        gap = result.image.astype(np.float64) - picture.truth
        # float32 pixels; where all passes agree to the last bit there is no other error.
        slack = 2.0**-23 * picture.truth
        pixels.append(np.abs(gap) <= noise["interval_factor"] * error + slack)
        reach = noise["interval_factor"] * noise["standard_error_of_image_mean"]
        means.append(abs(noise["image_mean"] - picture.truth.mean()) <= reach + slack.mean())
        stated += float(np.square(error, dtype=np.float64).mean())
        true += float((gap * gap).mean())
    return Coverage(float(np.mean(pixels)), float(np.mean(means)), math.sqrt(stated / true))


@dataclass(frozen=True)
class Bounds:
    """Stated bounds of t against the truth.

    Attributes
    ----------
    hits : int
        Hits whose true t is known to the last bit.
    wrong : int
        Other hits, which are not even the first; they count nowhere else.
    exceeded : int
        Hits with |t - exact t| above t_bound.
    worst : float
        Largest |t - exact t| / t_bound, half an ulp of t given away.
    looseness : (hits,) float64
        t_bound over eps x scale / |cos|, scale the larger of the surface's size and its distance.
    """

    hits: int
    wrong: int
    exceeded: int
    worst: float
    looseness: FloatArray


def bounds(
    surfaces: Sequence[Any], n_rays: int, seed: int, threads: int | None = None
) -> Iterator[Bounds]:
    """Judge the bounds of certified hits of n hard rays, some thousands at a time."""
    tracer = Intersector(surfaces, threads=threads)
    for k, begin in enumerate(range(0, n_rays, STEP)):
        rays = hard_rays(surfaces, min(STEP, n_rays - begin), seed + k)
        hits = tracer.intersect(rays.origins, rays.directions)
        truth = first_hits(surfaces, rays.origins, rays.directions, threads=threads)
        verdict = compare(hits, truth)
        same = truth.exact & hits.hit & ~truth.ambiguous & ~truth.undecided
        same &= (hits.object_id == truth.object_id) & (hits.patch_id == truth.patch_id)
        for rows in verdict.rows.values():
            same[rows] = False
        # Decided within rounding, the hit may be one that the ray only touches, before the first
        # certain root: right, but not that root.
        slack = truth.band / (np.maximum(truth.cosine, 1e-13) * truth.length)
        with np.errstate(invalid="ignore"):
            is_other = (hits.status == Status.TANGENT) & (truth.t - hits.t > slack)
        same &= ~is_other
        t, bound = hits.t[same], hits.t_bound[same]
        excess = np.abs(t - truth.t[same]) - 0.5 * np.spacing(np.abs(t))
        unit = truth.band[same] * (EPS / BAND)
        looseness = bound * truth.length[same] * truth.cosine[same] / unit
        yield Bounds(
            hits=int(same.sum()),
            wrong=verdict.n_wrong,
            exceeded=int((excess > bound).sum()),
            worst=verdict.worst_bound,
            looseness=looseness,
        )
