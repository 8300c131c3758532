"""Calibration of error estimates: noise against closed forms, t_bound against exact roots."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.noise_scenes import SEEN, UNSEEN, NoiseScene
from benchmarks.photon_truth import PHOTON_PICTURES, PhotonPicture
from hybrid_rt.analysis.ray_sets import RaySet
from hybrid_rt.core.records import BoolArray, FloatArray, HitRecord, Status
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.intersection import Intersector
from hybrid_rt.lights import RectangleLight
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.cases.campaign import STEP
from proof.cases.rays import hard_rays
from proof.judges.judge import Verdict, compare
from proof.judges.kernels.events import BAND, LEAST_COSINE
from proof.judges.oracle import Truth, first_hits

# Pixels of the pictures: enough for a mean, few enough for hundreds of pictures.
SIDE = 4
EPS = float(np.finfo(np.float64).eps)


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
    """Bounds on t against exact t: in double-double, or to 60 digits.

    Attributes
    ----------
    hits : int
        Hits whose exact t is known, at least to the last bit.
    wrong : int
        Hits that are not the first; they count nowhere else.
    exceeded : int
        Hits with |t - exact t| above t_bound.
    worst : float
        Largest |t - exact t| / t_bound; half an ulp of t is given away where the truth is rounded.
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
    """Test the bounds of certified hits of n hard rays, some thousands at a time."""
    for _, hits, truth, verdict in _judged(surfaces, n_rays, seed, threads):
        same = _same_root(hits, truth, verdict)
        t, bound = hits.t[same], hits.t_bound[same]
        excess = np.abs(t - truth.t[same]) - 0.5 * np.spacing(np.abs(t))
        yield Bounds(
            hits=int(same.sum()),
            wrong=verdict.n_wrong,
            exceeded=int((excess > bound).sum()),
            worst=verdict.worst_bound,
            looseness=_looseness(hits, truth, same),
        )


def bounds_by_digits(
    surfaces: Sequence[Any], n_hits: int, seed: int, threads: int | None = None
) -> Bounds:
    """Test the bounds of n certified hits of hard rays by their roots to 60 digits."""
    from proof.judges.many_digits import exact_t, excess

    parts, left = [], n_hits
    for rays, hits, truth, verdict in _judged(surfaces, 100 * n_hits, seed, threads):
        rows = np.flatnonzero(_same_root(hits, truth, verdict))[:left]
        found, bound = hits[rows], hits.t_bound[rows]
        exact = exact_t(surfaces, found, rays.origins[rows], rays.directions[rows])
        error = excess(found.t, exact)
        # Where Newton ends nowhere the error is nan: counted as exceeding whatever the bound.
        ratio = np.divide(error, bound, out=np.full(len(rows), np.inf), where=bound > 0.0)
        ratio[error == 0.0] = 0.0
        ratio[np.isnan(ratio)] = np.inf
        parts.append(
            Bounds(
                hits=len(rows),
                wrong=verdict.n_wrong,
                exceeded=int((ratio > 1.0).sum()),
                worst=float(ratio.max(initial=0.0)),
                looseness=_looseness(hits, truth, rows),
            )
        )
        left -= len(rows)
        if left == 0:
            break
    return Bounds(
        hits=sum(part.hits for part in parts),
        wrong=sum(part.wrong for part in parts),
        exceeded=sum(part.exceeded for part in parts),
        worst=max(part.worst for part in parts),
        looseness=np.concatenate([part.looseness for part in parts]),
    )


def _judged(
    surfaces: Sequence[Any], n_rays: int, seed: int, threads: int | None
) -> Iterator[tuple[RaySet, HitRecord, Truth, Verdict]]:
    """Yield hard rays, their certified hits, the truth and what the judge says, some thousands."""
    tracer = Intersector(surfaces, threads=threads)
    for k, begin in enumerate(range(0, n_rays, STEP)):
        rays = hard_rays(surfaces, min(STEP, n_rays - begin), seed + k)
        hits = tracer.intersect(rays.origins, rays.directions)
        truth = first_hits(surfaces, rays.origins, rays.directions, threads=threads)
        yield rays, hits, truth, compare(hits, truth)


def _same_root(hits: HitRecord, truth: Truth, verdict: Verdict) -> BoolArray:
    """Tell which hits are the oracle's first certain roots, where that knows them exactly."""
    same: BoolArray = truth.exact & hits.hit & ~truth.ambiguous & ~truth.undecided
    same &= (hits.object_id == truth.object_id) & (hits.patch_id == truth.patch_id)
    for rows in verdict.rows.values():
        same[rows] = False
    # Decided within rounding, the hit may be one that the ray only touches, before the first
    # certain root: right, but not that root.
    slack = truth.band / (np.maximum(truth.cosine, LEAST_COSINE) * truth.length)
    with np.errstate(invalid="ignore"):
        is_other = (hits.status == Status.TANGENT) & (truth.t - hits.t > slack)
    same &= ~is_other
    return same


def _looseness(hits: HitRecord, truth: Truth, rows: BoolArray | NDArray[np.intp]) -> FloatArray:
    unit = truth.band[rows] * (EPS / BAND)
    loose: FloatArray = hits.t_bound[rows] * truth.length[rows] * truth.cosine[rows] / unit
    return loose
