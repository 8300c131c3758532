"""Lamps within glass, bodies of patches, light paths of many passes.

Where formulas divide by nothing: `test_light_at_extremes`.
"""

import math

import numpy as np
import pytest

from hybrid_rt.integrators import PathOptions
from hybrid_rt.integrators.path import light_paths
from hybrid_rt.lights import SphereLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Box, Rectangle, Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.textures import CheckerTexture
from meshing import BezierPatches

FLOOR = Object(Rectangle((-9, -9, 0), (18, 0, 0), (0, 18, 0)), Lambertian(0.5), "floor")
CAMERA = Camera((0, -4, 3), (0, 0, 0), (0, 0, 1), 40, 12, 12)


@pytest.mark.parametrize("ior", [1.0, 1.5])
def test_d20_lamp_enclosed_by_glass(ior):
    """Around both one centre: the floor gets what the shell does not send back into the lamp.

    What leaves the lamp at sine s from its normal meets the shell at sine s r / R; reflected, it
    passes the centre at the same distance and so ends in the lamp. Any source of that symmetry
    sends flux / (4 pi d^2) to a point.
    """
    radius, lamp = 0.4, SphereLight((0, 0, 2), 0.4, 5.0)
    shell = Object(Sphere((0, 0, 2), 1.0), Dielectric(ior), "shell")
    camera = Camera((0, -4, 1.5), (0, -2, 0), (0, 0, 1), 30, 12, 12)
    # Two directions: at the floor, and through the shell.
    settings = {"passes": 60, "max_depth": 2, "options": PathOptions(light_paths=64.0)}
    bare, found = (
        render(Scene(camera, objects, [lamp]), **settings).report["noise"]
        for objects in ([FLOOR], [FLOOR, shell])
    )
    sine = (np.arange(10_000) + 0.5) / 10_000
    cos_in = np.sqrt(1 - (radius * sine) ** 2)
    cos_out = np.sqrt(1 - (ior * radius * sine) ** 2)
    across = (ior * cos_in - cos_out) / (ior * cos_in + cos_out)
    along = (cos_in - ior * cos_out) / (cos_in + ior * cos_out)
    returned = (0.5 * (across**2 + along**2) * 2 * sine).mean()
    name = "standard_error_of_image_mean"
    # 4.5 standard errors: one false alarm in 1e5 seeds.
    limit = 4.5 * math.hypot(found[name], bare[name])
    assert abs(found["image_mean"] - (1 - returned) * bare["image_mean"]) < limit
    assert limit < 0.04 * bare["image_mean"]


def test_a_body_of_bezier_patches_is_the_box_that_it_describes():
    """Six bilinear patches: the same surfaces, so the same paths but where rounding decides."""
    lo, hi = np.array([-0.7, -0.5, 0.2]), np.array([0.6, 0.7, 1.3])
    nets = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        for level, swap in ((lo[axis], True), (hi[axis], False)):
            net = np.empty((2, 2, 3))
            net[..., axis] = level
            net[0, :, a], net[1, :, a] = lo[a], hi[a]
            net[:, 0, b], net[:, 1, b] = lo[b], hi[b]
            nets.append(net.transpose(1, 0, 2) if swap else net)
    lamp = SphereLight((1, -1, 4), 0.5, 10.0)
    # Through boxes whose tint is a texture, no ways to lamps are computed, as through patches.
    glass = Dielectric(1.5, 0.2, tint=CheckerTexture(1.0, 1.0))
    pictures = [
        render(
            Scene(CAMERA.resized(32, 32), [Object(body, glass), FLOOR], [lamp]),
            passes=8, seed=2,
        ).image
        for body in (BezierPatches(nets), Box(lo, hi))
    ]  # fmt: skip
    gap = np.abs(pictures[0] - pictures[1]).max(axis=2)
    assert np.mean(gap < 1e-4) > 0.99
    assert abs(pictures[0].mean() / pictures[1].mean() - 1) < 1e-2


def test_light_paths_of_many_passes_are_traced_a_few_at_a_time(monkeypatch):
    """A picture of few pixels has many passes at once: memory must not follow their number."""
    glass = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))
    scene = Scene(CAMERA, [FLOOR, glass], [SphereLight((0, 0, 3), 0.3, 5.0)])
    before = render(scene, passes=9, threads=1)
    most = []
    trace = light_paths.LightPathTracer._trace

    def recorded(self, passes, n, count, *first):
        most.append(len(passes) * count)
        return trace(self, passes, n, count, *first)

    monkeypatch.setattr(light_paths, "AT_ONCE", 200)
    monkeypatch.setattr(light_paths.LightPathTracer, "_trace", recorded)
    after = render(scene, passes=9, threads=1)
    assert max(most[1:]) <= 200  # the first are those that are counted beforehand
    np.testing.assert_array_equal(after.image, before.image)
    assert after.report["rays"] == before.report["rays"]


def test_as_many_light_paths_as_asked_for_in_parts_of_a_pass(monkeypatch):
    """Also where they are more than are traced at once, and shared among threads."""
    glass = Object(Sphere((0, 0, 1), 0.5), Dielectric(1.5))
    scene = Scene(CAMERA, [FLOOR, glass], [SphereLight((0, 0, 3), 0.3, 5.0)])
    n_pixels = CAMERA.width * CAMERA.height
    options = PathOptions(light_paths=3)
    whole = render(scene, passes=2, threads=1, options=options)
    assert whole.report["rays"]["light paths"] == 2 * 3 * n_pixels
    monkeypatch.setattr(light_paths, "AT_ONCE", n_pixels // 2 + 1)
    parts = render(scene, passes=2, threads=1, options=options)
    assert parts.report["rays"] == whole.report["rays"]
    shared = render(scene, passes=2, threads=3, options=options)
    np.testing.assert_array_equal(shared.image, parts.image)
    assert shared.report["rays"] == whole.report["rays"]
    # The splats of a pixel are added in another order.
    np.testing.assert_allclose(parts.image, whole.image, rtol=1e-5)
    with monkeypatch.context() as few:
        few.setattr(light_paths, "MOST_TOGETHER", 1)
        singly = render(scene, passes=2, threads=1, options=options)
    np.testing.assert_array_equal(singly.image, parts.image)
    assert PathOptions().n_light_paths(2**24) == 2**23
    monkeypatch.setattr(light_paths, "available_bytes", lambda: 1000)
    with pytest.raises(MemoryError, match=r"light subpaths takes .* pass a smaller light_paths"):
        render(scene, passes=2, threads=1, options=options)
