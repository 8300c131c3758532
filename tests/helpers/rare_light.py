"""Scenes whose light few camera paths meet, and the closed forms of their means."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from hybrid_rt.lights import PointLight, SphereLight
from hybrid_rt.lights.spot import SpotLight
from hybrid_rt.materials import Lambertian
from hybrid_rt.materials.rough_conductor import RoughConductor
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.sensor.projection import Projection
from meshing import TrimmedSurface, polygon

FLOOR = Object(Rectangle((-6, -6, 0), (12, 0, 0), (0, 12, 0)), Lambertian(0.5), "floor")
DOWN = Camera((0, 0, 1.5), (0, 0, 0), (0, 1, 0), vertical_fov=40, width=24, height=24)
PATCH = Object(Rectangle((2.8, 0.2, 3), (0.4, 0, 0), (0, -0.4, 0)), Lambertian(0.8), "patch")
BALL_LAMP, BALL_CAMERA = np.array([3.0, -5.0, 4.0]), np.array([0.0, -6.0, 0.0])


def mean_over(camera: Projection, radiance: Callable[[FloatArray], FloatArray]) -> float:
    """Return the mean over the film of a function of points on the plane z = 0."""
    place = (np.arange(96) + 0.5) / 96
    column, row = np.meshgrid(place * camera.width, place * camera.height)
    origin, way = camera.rays(column.ravel(), row.ravel())
    return float(radiance(origin - origin[:, 2:] / way[:, 2:] * way).mean())


def irradiance(point: FloatArray, place: ArrayLike, strength: float) -> FloatArray:
    """Return that of the plane z = 0 by a point light."""
    way = np.asarray(place) - point
    found: FloatArray = strength * way[:, 2] / (way**2).sum(axis=1) ** 1.5
    return found


def polished(roughness: float) -> Scene:
    """Return a ball with a highlight that is the smaller the more it is polished."""
    camera = Camera(BALL_CAMERA, (0, 0, 0), (0, 0, 1), vertical_fov=30, width=48, height=48)
    ball = Object(Sphere((0, 0, 0), 1), RoughConductor(0.2, 3.9, roughness), "ball")
    return Scene(camera, [ball], [PointLight(BALL_LAMP, 100)])


def mean_of_mirrored_point() -> float:
    """Return what the image of the lamp in a mirror ball gives the film, times Fresnel's reflectance.

    The irradiance at the camera is the lamp's intensity over the area that a narrow pencil of its rays,
    reflected by the ball, has there for each steradian (Coddington's equations). The film has 1 / (its
    area at distance 1) of its mean for each steradian about its axis, and cos^-3 times that off it.
    """
    to_lamp, to_camera = (v / np.linalg.norm(v) for v in (BALL_LAMP, BALL_CAMERA))
    # The point of reflection lies in the plane of both, where the angles are the same.
    across = to_lamp - (to_lamp @ to_camera) * to_camera
    across /= np.linalg.norm(across)
    low, high = 0.0, math.acos(to_lamp @ to_camera)
    for _ in range(60):
        turn = 0.5 * (low + high)
        normal = math.cos(turn) * to_camera + math.sin(turn) * across
        out, back = BALL_CAMERA - normal, BALL_LAMP - normal
        is_before = out @ normal / np.linalg.norm(out) > back @ normal / np.linalg.norm(back)
        low, high = (turn, high) if is_before else (low, turn)

    sight = out / np.linalg.norm(out)
    there, onward = float(np.linalg.norm(back)), float(np.linalg.norm(out))
    cos_in = normal @ sight
    bent = 2.0 * there * onward
    spread = (there + onward + bent / cos_in) * (there + onward + bent * cos_in)
    n = complex(0.2, 3.9)
    cos_t = np.sqrt(1.0 - (1.0 - cos_in**2) / n**2)
    s, p = (cos_in - n * cos_t) / (cos_in + n * cos_t), (n * cos_in - cos_t) / (n * cos_in + cos_t)
    reflectance = 0.5 * (abs(s) ** 2 + abs(p) ** 2)
    off_axis = -sight @ to_camera
    film = (2.0 * math.tan(math.radians(15.0))) ** 2
    return float(100.0 * reflectance / spread / (film * abs(off_axis) ** 3))


def port(radius: float) -> Scene:
    """Return an integrating sphere with a port over a floor, and a faint lamp beside it."""

    def opened(size: float, angle: float) -> TrimmedSurface:
        v = angle / math.pi
        loops = [polygon([(0, v), (1, v), (1, 1), (0, 1)])]
        return TrimmedSurface(Sphere((0, 0, 3), size), loops)

    sphere = Object(opened(1.0, math.asin(radius)), Lambertian(0.9), "sphere")
    jacket = Object(opened(1.05, math.asin(0.3 / 1.05)), Lambertian(0.0), "jacket")
    camera = Camera((2.4, 0, 1.2), (1.1, 0, 0), (0, 0, 1), vertical_fov=25, width=24, height=24)
    lamps = [SphereLight((0, 0, 3), 0.1, 100.0), PointLight((3, 3, 2), 0.01)]
    return Scene(camera, [FLOOR, sphere, jacket], lamps)


def mean_by_port(radius: float) -> float:
    """Return the light of the port: the wall by the sphere multiplier, and its disc's form factor."""
    camera = port(radius).camera
    open_part = 0.5 * (1.0 - math.cos(math.asin(radius)))
    wall = 0.9 * 0.1**2 * 100.0 / (1.0 - 0.9 * (1.0 - open_part - 0.1**2))
    area, place = math.pi * radius**2, np.array([0.0, 0.0, 3.0 - math.cos(math.asin(radius))])

    def radiance(point: FloatArray) -> FloatArray:
        way = place - point
        by_port = wall * area * way[:, 2] ** 2 / (way**2).sum(axis=1) ** 2
        return np.asarray(0.5 / math.pi * (by_port + irradiance(point, (3, 3, 2), 0.01)))

    return mean_over(camera, radiance)


def spot_on_a_patch() -> Scene:
    """Return a narrow spot light on a small matt square overhead, which alone lights the floor but for a faint lamp."""
    lamps = [SpotLight((3, 0, 1), (0, 0, 1), 1000.0, 1.0), PointLight((0, 0, 1.8), 0.02)]
    return Scene(DOWN, [FLOOR, PATCH], lamps)


def mean_by_patch(part: float) -> float:
    """Return the light of a small spot on the patch: 0.8 of the power over pi, times the cosine.

    The power is ``part`` of what a lamp of intensity 1000 sends out.
    """
    power = 4.0 * math.pi * 1000.0 * part

    def radiance(point: FloatArray) -> FloatArray:
        way = np.array([3.0, 0.0, 3.0]) - point
        by_patch = 0.8 * power / math.pi * way[:, 2] ** 2 / (way**2).sum(axis=1) ** 2
        return np.asarray(0.5 / math.pi * (by_patch + irradiance(point, (0, 0, 1.8), 0.02)))

    return mean_over(DOWN, radiance)


def speck_of_light() -> Scene:
    """Return a narrow spot light on a floor in view, where it lights a part of a pixel, beside a faint lamp."""
    lamps = [SpotLight((0.31, 0.22, 1.2), (0, 0, -1), 2000.0, 0.3), PointLight((0, 0, 1.8), 0.02)]
    return Scene(DOWN, [FLOOR], lamps)


def mean_by_speck() -> float:
    """Return the light of the spot's power over the floor in view, and of the other lamp."""
    power = 2000.0 * math.pi * (1.0 - math.cos(math.radians(0.3)))  # its edge is the whole cone
    floor = (2.0 * 1.5 * math.tan(math.radians(20.0))) ** 2
    other = mean_over(DOWN, lambda point: irradiance(point, (0, 0, 1.8), 0.02))
    return 0.5 / math.pi * (power / floor + other)


def hole(part: float) -> Scene:
    """Return a lamp in a black ball with a hole of this part of all directions, below a patch out of sight."""
    v = 1.0 - math.acos(1.0 - 2.0 * part) / math.pi
    loops = [polygon([(0, 0), (1, 0), (1, v), (0, v)])]
    ball = Object(TrimmedSurface(Sphere((3, 0, 1), 0.2), loops), Lambertian(0.0), "ball")
    lamps = [PointLight((3, 0, 1), 1000.0), PointLight((0, 0, 1.8), 0.02)]
    return Scene(DOWN, [FLOOR, ball, PATCH], lamps)


RARE: dict[str, tuple[Scene, Callable[[], float]]] = {
    "highlight, roughness 0.05": (polished(0.05), mean_of_mirrored_point),
    "highlight, roughness 0.02": (polished(0.02), mean_of_mirrored_point),
    "port of 0.02": (port(0.02), lambda: mean_by_port(0.02)),
    # The edge of the spot light is its whole cone.
    "bright spot": (
        spot_on_a_patch(),
        lambda: mean_by_patch(0.25 * (1.0 - math.cos(math.radians(1.0)))),
    ),
    "hole of 1/10 000": (hole(1e-4), lambda: mean_by_patch(1e-4)),
    "speck of light": (speck_of_light(), mean_by_speck),
}
