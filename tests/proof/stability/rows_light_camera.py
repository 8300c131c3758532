"""Rows D06 to D08, D26 to D28, D30, D32, D34: camera, film and textures."""

from __future__ import annotations

import math
import tempfile
from functools import partial
from pathlib import Path
from typing import Any, cast

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.integrators import PhotonMapOptions, PPMOptions
from hybrid_rt.lights import GradientSky, ImageEnvironment, PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Emissive, Lambertian
from hybrid_rt.primitives import Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.shading.kernels.texture import texture_color
from hybrid_rt.textures import CheckerTexture, ImageTexture
from hybrid_rt.textures.table import compile_textures
from hybrid_rt.textures.texture import Texture
from proof.stability.light_run import (
    BRANCHES_CUT,
    INTEGRATORS,
    PLAIN_PATHS,
    WHITE_SKY,
    finite,
    floor,
    judged,
    off_by_pixels,
    picture,
    same,
    slab,
)
from proof.stability.row import Effort, Outcome, refusal, row

VIEW = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)
LAMP = RectangleLight((-1, -1, 3), (0, 2, 0), (2, 0, 0), 2.0)


@row("D06", "camera in glass or on its surface", "closed form: radiance n^2 in even light")
def camera_in_glass(effort: Effort) -> Outcome:
    """Standing in clear glass under a sky of radiance one shows n^2, from its face as from within."""
    outcome = Outcome()
    for ior in (1.5, 0.7):
        plate = slab(0, 1, Dielectric(ior))
        ball = Object(Sphere((0, 0, 0), 1), Dielectric(ior), "ball")
        # The shape, where the camera stands, where it looks, and the index there.
        for body, place, at, index in (
            (plate, (0, 0, 1), (0, 0, -9), ior),
            (plate, (0, 0, 0.5), (0, 0.1, -9), ior),
            (plate, (0, 0, 1), (0, 0, 9), 1.0),
            (ball, (0, 0, 1), (0.1, 0, -9), ior),
            (ball, (0.2, 0.1, 0), (0.1, 0, -9), ior),
            (ball, (0, 0, 1), (0.3, 0, 9), 1.0),
        ):
            for integrator in INTEGRATORS:
                # Whitted's method follows both branches of each hit.
                camera = Camera(place, at, (0, 1, 0), 1e-6, 8, 8)
                result = picture(
                    effort, Scene(camera, [body], environment=WHITE_SKY), integrator,
                    max_depth=100, options=PLAIN_PATHS if integrator == "path" else None,
                )  # fmt: skip
                name = f"{integrator}, {body.name}, index {ior:g}, from {place} to {at}"
                cut = 4.0 * BRANCHES_CUT if integrator != "path" else 0.0
                outcome += judged(name, result, off_by_pixels(result, index**2, 1e-5 + cut))
    return outcome


@row("D07", "view along up; fields of view of 0 and 180", "refusals; unit directions between")
def impossible_views(effort: Effort) -> Outcome:
    """Refuse by name what is no camera; the widest and narrowest that there are work."""
    sound = {"look_from": (1, 2, 3), "look_at": (4, -2, 3), "up": (0, 0, 1)}

    def camera(**changes: Any) -> Camera:
        return Camera(**{**sound, "width": 8, "height": 4, **changes})

    outcome = Outcome()
    for changes, word in (
        ({"vertical_fov": 0}, "vertical_fov"),
        ({"vertical_fov": 180}, "vertical_fov"),
        ({"vertical_fov": -1}, "vertical_fov"),
        ({"vertical_fov": math.nan}, "vertical_fov"),
        ({"up": (3, -4, 0)}, "up"),
        ({"up": (-3e300, 4e300, 1e280)}, "up"),
        ({"up": (3, -4, 1e-9)}, "up"),
        ({"up": (0, 0, 0)}, "up"),
        ({"look_at": (1, 2, 3)}, "look_at"),
        ({"look_from": (math.nan, 0, 0)}, "look_from"),
        ({"look_from": (math.inf, 0, 0)}, "look_from"),
    ):
        outcome += refusal(partial(camera, **changes), word)
    rng = effort.rng()
    for fov in (1e-300, 1e-9, 90.0, 179.999999, math.nextafter(180.0, 0.0)):
        places = rng.uniform(0, 4, (50, 2)).T
        _, directions = camera(vertical_fov=fov).rays(2 * places[0], places[1])
        outcome += same(f"fov {fov:g}", np.linalg.norm(directions, axis=1), np.ones(50), 1e-15)
    # Up within 1e-7 of the view still gives three directions at right angles.
    _, directions = camera(up=(3, -4, 5e-7)).rays(np.array([4.0]), np.array([2.0]))
    return outcome + same(
        "up along the view", directions[0] + 1.0, np.array([1.6, 0.2, 1.0]), 1e-15
    )


@row("D08", "pictures of one pixel, of one row, of none", "closed form; refusals")
def smallest_pictures(effort: Effort) -> Outcome:
    """In even light every pixel shows it, bit for bit."""
    shining, sky = floor(Emissive(0.5)), GradientSky(0.5, 0.5)
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for width, height in ((1, 1), (40, 1), (1, 7)):
            scene = Scene(VIEW.resized(width, height), [shining], environment=sky)
            image = picture(effort, scene, integrator, 2).image
            name = f"{integrator}, {width} x {height}"
            outcome += same(name, image, np.full((height, width, 3), 0.5))
    for width, height, word in ((0, 4, "width"), (4, 0, "height"), (-3, 4, "width")):
        outcome += refusal(partial(VIEW.resized, width, height), word)
    return outcome


@row("D26", "textures with values that are no colours", "refusals")
def textures_that_are_no_colours(effort: Effort) -> Outcome:
    """One bad texel among many is named when the texture is made, of a surface or of the sky."""
    outcome = Outcome()
    for bad, word in ((math.nan, "finite"), (math.inf, "finite"), (-1e-30, "negative")):
        texels = effort.rng().random((5, 4, 3))
        texels[3, 2, 1] = bad
        outcome += refusal(partial(ImageTexture, texels), word)
        outcome += refusal(partial(ImageEnvironment, texels), word)
        outcome += refusal(partial(CheckerTexture, bad, 0.5), "even")
        outcome += refusal(partial(Lambertian, (0.5, bad, 0.5)), "Lambertian color")
        outcome += refusal(partial(Emissive, (0.5, bad, 0.5)), "Emissive radiance")
        outcome += refusal(partial(GradientSky, bad, 1.0), "GradientSky bottom")
    return outcome


def _look_up(texture: Texture, u: float, v: float) -> FloatArray:
    # A second texture before it: the row must be found.
    table = compile_textures([ImageTexture(np.ones((2, 2, 3))), texture])
    return np.array(texture_color(table, 1, u, v, 0.0, 0.0, 0.0))


@row("D27", "textures of one texel, none, 16 bits, with alpha, damaged", "closed forms; refusals")
def odd_textures(effort: Effort) -> Outcome:
    """One texel is a constant; depths and alpha agree; what is no picture is refused by name."""
    import imageio.v3 as imageio

    del effort
    one = ImageTexture(np.full((1, 1, 3), 0.25))
    outcome = Outcome()
    for u, v in ((0.3, 1.0), (0.0, 0.0), (1.0, 1.0), (-7.5, 1e9)):
        outcome += same(f"one texel at {u:g}, {v:g}", _look_up(one, u, v), np.full(3, 0.25))
    eight = np.arange(0, 240, 10, dtype=np.uint8).reshape(2, 4, 3)
    sixteen = eight.astype(np.uint16) * 257
    texels = ImageTexture(eight).texels
    outcome += same("16 bits", ImageTexture(sixteen).texels, texels, 1e-6)
    alpha = np.dstack([eight, np.full((2, 4), 17, np.uint8)])
    outcome += same("alpha", ImageTexture(alpha).texels, texels)
    grey = np.repeat(eight[:, :, :1], 3, axis=2)
    outcome += same("grey", ImageTexture(eight[:, :, 0]).texels, ImageTexture(grey).texels)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "a.png"
        imageio.imwrite(file, eight)
        outcome += same("from a file", ImageTexture(file).texels, texels)
        whole = file.read_bytes()
        for name, content in (
            ("empty.png", b""),
            ("short.png", whole[: len(whole) // 2]),
            ("words.png", b"no picture at all"),
        ):
            (Path(folder) / name).write_bytes(content)
            outcome += refusal(partial(ImageTexture, Path(folder) / name), name)
        outcome += refusal(lambda: ImageTexture(Path(folder) / "missing.png"), "missing.png")
    for shape in ((0, 2, 3), (2, 0, 3), (2, 2, 5), (2, 2, 2, 3), (3,)):
        outcome += refusal(partial(ImageTexture, np.ones(shape)), "shape")
    outcome += refusal(lambda: ImageTexture(np.ones((2, 2, 3), np.int64)), "int64")
    return outcome + refusal(partial(ImageTexture, np.ones((2, 2, 3)), cast(Any, "mirror")), "wrap")


@row("D28", "texture coordinates 1, below 0 and 1e9", "closed form of the checker; whole periods")
def coordinates_far_outside(effort: Effort) -> Outcome:
    """Whole periods change nothing, and the border belongs to the square that it begins."""
    outcome = Outcome()
    checker = CheckerTexture(1.0, 0.25, (4.0, 2.0), "uv")
    for u, v in (
        (1.0, 0.0), (0.0, 1.0), (1.0, 1.0), (-0.25, 0.1), (-1e-300, 0.1), (1e9, -1e9),
        (1e9 + 0.25, 0.0), (0.25, 0.5), (-3.25, 0.75), (1e300, 1e300),
    ):  # fmt: skip
        is_even = (math.floor(4.0 * u) + math.floor(2.0 * v)) % 2 == 0
        expected = np.full(3, 1.0 if is_even else 0.25)
        outcome += same(f"checker at {u:g}, {v:g}", _look_up(checker, u, v), expected)
    texture = ImageTexture(effort.rng().random((4, 4, 3)))
    for u, v in effort.rng(1).integers(0, 16, (effort.count(50), 2)) / 16.0:
        near = _look_up(texture, u, v)
        for shift in (-1.0, 1.0, 1e9, -1e9):
            found = _look_up(texture, u + shift, v - shift)
            outcome += same(f"picture at {u:g} + {shift:g}, {v:g}", found, near, 1e-6)
    ground = Rectangle((-1, -1, 0), (2, 0, 0), (0, 2, 0))
    camera = Camera((0, 0, 3), (0, 0, 0), (0, 1, 0), 20, 8, 8)
    for scale in (1e-300, 1.0, 3.25, 1e9):
        shining = Emissive(CheckerTexture(1.0, 0.25, (scale, 2.0), "uv"))
        image = picture(effort, Scene(camera, [Object(ground, shining)])).image
        known = set(np.unique(image).tolist()) <= {0.25, 1.0}
        outcome += Outcome(rays=64).checked(known, f"checker of scale {scale:g}: other colours")
    shining = Emissive(texture)
    outcome += finite("picture", picture(effort, Scene(camera, [Object(ground, shining)])))
    return outcome


@row("D30", "lenses of diameter 0, planes of focus at 0", "the pinhole's picture; refusals")
def closed_lens(effort: Effort) -> Outcome:
    """Close the lens: without diameter it is the pinhole bit for bit, at 1e-12 to rounding."""
    ball = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))

    def image(integrator: str, **lens: float) -> FloatArray:
        camera = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12, **lens)
        scene = Scene(camera, [floor(Lambertian(0.5)), ball], [LAMP])
        result = picture(effort, scene, integrator, 2, n_photons=500, max_depth=4)
        return result.image.astype(np.float64)

    outcome = Outcome()
    for integrator in INTEGRATORS:
        pinhole = image(integrator)
        closed = image(integrator, aperture=0.0, focus_distance=1e-3)
        outcome += same(f"{integrator}, closed lens", closed, pinhole)
    tiny = image("whitted", aperture=1e-12)
    outcome += same("lens of 1e-12", tiny, image("whitted"), 1e-4)
    for aperture, focus, word in (
        (0.1, 0.0, "focus_distance"),
        (0.1, -2.0, "focus_distance"),
        (0.0, 0.0, "focus_distance"),
        (0.1, math.nan, "focus_distance"),
        (-0.1, 1.0, "aperture"),
        (math.nan, 1.0, "aperture"),
        (1e50, 1.0, "aperture"),
    ):
        outcome += refusal(
            partial(Camera, (0, 0, 1), (0, 0, 0), (0, 1, 0), aperture=aperture,
                                               focus_distance=focus), word,
        )  # fmt: skip
    return outcome


@row("D32", "no passes, no photons, no time", "refusals")
def nothing_asked_for(effort: Effort) -> Outcome:
    """Numbers of which there must be some are refused by name, before any work."""
    del effort
    scene = Scene(VIEW, [floor(Lambertian(0.5))], [LAMP])
    outcome = Outcome()
    for settings, word in (
        ({"passes": 0}, "passes"),
        ({"passes": -1}, "passes"),
        ({"passes": 0.5}, "passes"),
        ({"time_budget": 0.0}, "time_budget"),
        ({"time_budget": math.nan}, "time_budget"),
        ({"target_error": 0.0}, "target_error"),
        ({"target_error": -0.1}, "target_error"),
        ({"max_depth": -1}, "max_depth"),
        ({"threads": 0}, "threads"),
        ({"integrator": "none"}, "integrator"),
    ):
        outcome += refusal(partial(render, scene, **settings), word)
    outcome += refusal(lambda: PPMOptions(0), "photons_per_pass")
    outcome += refusal(lambda: PhotonMapOptions(0), "photons_per_pass")
    return outcome + refusal(lambda: PhotonMapOptions(100, 1), "nearest")


@row("D34", "scenes with nothing in them", "the background")
def nothing_to_see(effort: Effort) -> Outcome:
    """Black, or the sky; lights alone change nothing, and lobes of nothing are no error."""
    sky = GradientSky(0.25, 0.25)
    outcome = Outcome()
    for integrator in INTEGRATORS:
        for lights, environment, expected in (
            ([], None, 0.0),
            ([], sky, 0.25),
            ([PointLight((0, 0, 5), 1.0)], None, 0.0),
            ([PointLight((0, 0, 5), 1.0)], sky, 0.25),
        ):
            result = picture(effort, Scene(VIEW, [], lights, environment), integrator)
            outcome += finite(integrator, result)
            outcome += same(integrator, result.image, np.full((12, 12, 3), expected))
    return outcome
