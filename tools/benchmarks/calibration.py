"""Calibration of error estimates: noise against closed forms, t_bound against exact roots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from benchmarks.noise_scenes import SEEN, UNSEEN, NoiseScene
from benchmarks.photon_truth import PHOTON_PICTURES, PhotonPicture
from hybrid_rt.analysis.ray_sets import RaySet
from hybrid_rt.core.records import FloatArray, HitRecord, Status
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.intersection import Intersector
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.cases.rays import hard_rays
from proof.exact.judge import ExactJudge
from proof.judge import Judge

# Pixels of the pictures: enough for a mean, few enough for hundreds of pictures.
SIDE = 4
EPS = float(np.finfo(np.float64).eps)
# Rays that are judged at once.
STEP = 2_000


@dataclass(frozen=True)
class KnownPicture:
    """A scene with a known solution, to test noise estimates.

    Attributes
    ----------
    scene : Scene
    truth : (3,) float64 or None
        Radiance of every pixel. None: not known; `coverage` says what stands in for it.
    integrators : tuple of str
        Those that find all its light.
    settings : dict
        Further arguments of `render`.
    judged : tuple of str
        Of "pixels" and "means": the intervals that are to hold. Others are measured only.
    """

    scene: Scene
    truth: FloatArray | None
    integrators: tuple[str, ...]
    settings: dict[str, Any]
    judged: tuple[str, ...] = ("pixels", "means")


def _one_point(look_from: Sequence[float], look_at: Sequence[float]) -> Camera:
    """Return a camera all pixels of which see the same point."""
    return Camera(look_from, look_at, (0, 1, 0), vertical_fov=1e-6, width=SIDE, height=SIDE)


def floor_under_lamp() -> KnownPicture:
    """Return a diffuse floor under the corner of a rectangular light: a smooth integrand.

    The irradiance is the textbook formula for a parallel rectangle.
    """
    a, b, height = 1.5, 0.7, 0.9
    lamp = RectangleLight((0, 0, height), (0, b, 0), (a, 0, 0), (1, 2, 3))
    floor = Object(Rectangle((-5, -5, 0), (10, 0, 0), (0, 10, 0)), Lambertian(0.5), "floor")
    p, q = math.hypot(a, height), math.hypot(b, height)
    irradiance = 0.5 * (a / p * math.atan(b / p) + b / q * math.atan(a / q))
    camera = _one_point((-0.3, -0.2, 0.5), (0, 0, 0))
    truth = 0.5 / math.pi * irradiance * np.array([1.0, 2.0, 3.0])
    return KnownPicture(Scene(camera, [floor], [lamp]), truth, ("path", "whitted"), {})


def shining_room() -> KnownPicture:
    """Return a furnace: walls of emission 1 and albedo 1/2, so L = 1 + L / 2, over many bounces."""
    walls = Emissive((1.0, 0.5, 0.25), Lambertian(0.5))
    room = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), walls, "room")
    camera = Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, SIDE, SIDE)
    # What 60 reflections leave out is 2**-60.
    truth = np.array([2.0, 1.0, 0.5])
    return KnownPicture(Scene(camera, [room]), truth, ("path",), {"max_depth": 60})


def ball_in_a_pixel() -> KnownPicture:
    """Return an emissive sphere in the middle of one pixel: its coverage is an area ratio.

    The camera sees the sphere within an angle of arcsin(r / d), a disc on the film.
    """
    d, r, fov = 5.0, 0.6, 20.0
    ball = Object(Sphere((0, 0, 0), r), Emissive((1.0, 2.0, 4.0)), "ball")
    camera = Camera((0, 0, d), (0, 0, 0), (0, 1, 0), fov, 1, 1)
    tangent = math.tan(math.asin(r / d)) / math.tan(math.radians(0.5 * fov))
    truth = 0.25 * math.pi * tangent**2 * np.array([1.0, 2.0, 4.0])
    return KnownPicture(Scene(camera, [ball]), truth, ("path", "whitted"), {})


def with_few_photons(picture: PhotonPicture) -> KnownPicture:
    """Return a picture with shadow borders, few photons and automatic radii."""
    options = PPMOptions(5000)
    return KnownPicture(picture.scene, None, ("ppm",), {"options": options})


def of_all_kinds(picture: NoiseScene, has_rare_light: bool) -> KnownPicture:
    """Return one of the small scenes.

    Few camera rays meet a lamp in so small a picture, and no interval of its mean knows of one that
    none has met. Where much of the light is such, that is true of pixels as well.
    """
    settings = {} if picture.options is None else {"options": picture.options}
    judged = () if has_rare_light else ("pixels",)
    return KnownPicture(picture.scene, None, (picture.integrator,), settings, judged)


HAS_RARE_LIGHT = ("tiny bright lamp", "mirror cabinet")

PICTURES: dict[str, Callable[[], KnownPicture]] = {
    "floor under a lamp": floor_under_lamp,
    "shining room": shining_room,
    "ball in a pixel": ball_in_a_pixel,
    **{
        name: lambda make=make: with_few_photons(make())  # type: ignore[misc]
        for name, make in PHOTON_PICTURES.items()
    },
    **{
        name: lambda name=name, make=make: of_all_kinds(make(), name in HAS_RARE_LIGHT)  # type: ignore[misc]
        for name, make in (SEEN | UNSEEN).items()
    },
}


@dataclass(frozen=True)
class Coverage:
    """Coverage of the stated 95 % intervals.

    Attributes
    ----------
    of_pixels, of_mean : float
        Coverage over all seeds, pixels and channels; of the image mean, over all seeds.
    error_ratio : float
        Root mean square of the stated standard errors of pixels over that of the true errors.
    mean_image : (height, width, 3) float64
        The mean over all seeds.
    """

    of_pixels: float
    of_mean: float
    error_ratio: float
    mean_image: FloatArray


def coverage(
    picture: KnownPicture,
    integrator: str,
    passes: int,
    seeds: Sequence[int],
    truth: FloatArray | None = None,
) -> Coverage:
    """Render a known picture with each seed; measure the coverage of the stated intervals.

    Parameters
    ----------
    picture : KnownPicture
    integrator : str
    passes : int
    seeds : sequence of int
    truth : (height, width, 3) float64, optional
        Stands in for a truth that is not known, default the mean over all seeds. That separates
        noise from the blur of photons, which is another after more passes; but what rare paths bring
        it lacks as the pictures do, so of unbiased integrators a mean of more passes tells more.
    """
    results = [
        render(
            picture.scene,
            integrator,
            passes,
            seed=seed,
            threads=1,
            outputs=["standard_error", "half_interval"],
            **picture.settings,
        )
        for seed in seeds
    ]
    images = np.array([result.image for result in results], dtype=np.float64)
    mean_image = images.mean(axis=0)
    if picture.truth is not None:
        truth = picture.truth
    elif truth is None:
        truth = mean_image
    gap = images - truth
    # float32 pixels; where all passes agree to the last bit there is no other error.
    slack = 2.0**-23 * truth
    reach = np.array([result.channels["half_interval"] for result in results])
    noises = [result.report["noise"] for result in results]
    gaps = np.array([noise["image_mean"] for noise in noises]) - truth.mean()
    reaches = [noise["half_interval_95_of_image_mean"] for noise in noises]
    stated = [np.square(r.channels["standard_error"], dtype=np.float64).mean() for r in results]
    return Coverage(
        float((np.abs(gap) <= reach + slack).mean()),
        float((np.abs(gaps) <= reaches + slack.mean()).mean()),
        math.sqrt(float(np.mean(stated)) / float(np.square(gap).mean())),
        mean_image,
    )


@dataclass(frozen=True)
class Bounds:
    """Bounds on t against exact t.

    Attributes
    ----------
    wrong : int
        Hits that are not the first.
    exceeded : int
        Hits with |t - exact t| above t_bound.
    worst : float
        Largest |t - exact t| / t_bound, of those that were measured.
    looseness : (hits,) float64
        t_bound over eps x scale / |cos|, scale the larger of the surface's size and its distance.
    """

    wrong: int
    exceeded: int
    worst: float
    looseness: FloatArray


def bounds(
    surfaces: Sequence[Any],
    n_rays: int,
    seed: int,
    threads: int | None = None,
    exactly: bool = False,
) -> Iterator[Bounds]:
    """Test the bounds of certified hits of n hard rays, some thousands at a time.

    Exactly: by the exact roots of all rays, which tell how much of its bound each error takes; else the
    screen confirms most of them.
    """
    judge = partial(ExactJudge(surfaces).judge, marks=False) if exactly else Judge(surfaces).judge
    for rays, hits in _hits(surfaces, n_rays, seed, threads):
        verdict = judge(hits, rays.origins, rays.directions)
        yield Bounds(
            verdict.n_wrong,
            verdict.bounds_broken,
            verdict.worst_bound,
            _looseness(surfaces, hits, rays),
        )


def _hits(
    surfaces: Sequence[Any], n_rays: int, seed: int, threads: int | None
) -> Iterator[tuple[RaySet, HitRecord]]:
    """Yield hard rays and their certified hits, some thousands."""
    tracer = Intersector(surfaces, threads=threads)
    for k, begin in enumerate(range(0, n_rays, STEP)):
        rays = hard_rays(surfaces, min(STEP, n_rays - begin), seed + k)
        yield rays, tracer.intersect(rays.origins, rays.directions)


def _looseness(surfaces: Sequence[Any], hits: HitRecord, rays: RaySet) -> FloatArray:
    rows = np.flatnonzero(hits.status == Status.HIT)
    number, d = hits.object_id[rows], rays.directions[rows]
    middles = np.array([surface.middle for surface in surfaces])
    away = np.linalg.norm(rays.origins[rows] - middles[number], axis=1)
    along = hits.t[rows] * np.linalg.norm(d, axis=1)
    # What has no end is as large as the way to the hit.
    sizes = np.array([surface.size if surface.is_bounded else 0.0 for surface in surfaces])
    scale = np.maximum(away, np.where(sizes[number] > 0.0, sizes[number], along))
    slope = np.abs(np.einsum("ij,ij->i", hits.normal[rows], d))
    loose: FloatArray = hits.t_bound[rows] * slope / (EPS * scale)
    return loose
