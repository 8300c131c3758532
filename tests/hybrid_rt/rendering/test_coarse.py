"""Pictures with and without coarse hits on triangles."""

import subprocess
import sys

import numpy as np
import pytest

from hybrid_rt import demo
from hybrid_rt.core.ledger import Ledger
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.lights import GradientSky, SphereLight
from hybrid_rt.materials import Dielectric, Lambertian
from hybrid_rt.primitives import Sphere
from hybrid_rt.rendering.renderer import render
from hybrid_rt.rendering.set_up import set_up
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.rendering.summary import in_words
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera

CURVED = {"patches": demo.teapot, "a turned surface": lambda: demo.vase(0.0, 0.0, 1.0)}


class TestCoarseStage:
    @staticmethod
    def scene_of(name):
        """Return a curved surface and a glass ball beside it."""
        curved = CURVED[name]()
        low, high = curved.bounds
        middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
        camera = Camera(
            middle + size * np.array([0.3, -1.2, 0.6]), middle, (0, 0, 1), width=24, height=18
        )
        objects = [
            Object(curved, Lambertian(0.6)),
            Object(Sphere(middle + size * np.array([0.4, 0, 0]), 0.15 * size), Dielectric()),
        ]
        lamp = SphereLight(middle + size * np.array([0, -1, 1]), 0.1 * size, 20.0)
        return Scene(camera, objects, [lamp], GradientSky(0.2, 0.5))

    @pytest.mark.parametrize("name", CURVED)
    def test_no_bit_hangs_on_it(self, name):
        pictured = self.scene_of(name)
        for integrator in ("path", "ppm"):
            options = PPMOptions(2000) if integrator == "ppm" else None
            results = [
                render(pictured, integrator, 2, coarse=coarse, options=options)
                for coarse in ("embree", "none")
            ]
            np.testing.assert_array_equal(results[0].image, results[1].image)
            of_embree, of_none = (result.report["coarse"] for result in results)
            assert of_embree["stage"] == "embree"
            assert of_embree["triangles"] > 100
            assert of_none == {
                "stage": "none", "triangles": 0, "build_seconds": 0.0, "hit_seconds": 0.0,
                "share_of_seconds": 0.0,
            }  # fmt: skip
            texts = [in_words(result.report) for result in results]
            assert 'coarse="none" makes the same picture, bit for bit, without them' in texts[0]
            assert "coarse" not in texts[1]

    @pytest.mark.parametrize("threads", [1, 2])
    def test_its_share_is_one_of_wall_seconds(self, threads):
        """It is part of the stages that trace rays, and those are part of the whole."""
        pictured = self.scene_of("patches")
        pictured = pictured.with_camera(pictured.camera.resized(160, 120))
        report = render(pictured, "path", 4, threads=threads).report
        seconds, coarse = report["seconds"], report["coarse"]
        tracing = sum(seconds[stage] for stage in ("intersect", "shadow rays", "light paths"))
        assert 0.0 < coarse["hit_seconds"] < tracing
        # Laps are summed from rounded figures.
        together = coarse["build_seconds"] + coarse["hit_seconds"]
        assert coarse["share_of_seconds"] == pytest.approx(together / seconds["total"], abs=1e-3)

    def test_its_seconds_are_without_the_compilation_of_kernels(self):
        standing = Ledger(now=lambda: 5.0)  # as the render's clock does meanwhile
        tracer = set_up(self.scene_of("patches"), Settings(), 1, standing).context.tracer
        assert tracer.n_triangles > 100
        assert tracer.coarse_build_seconds == 0.0

    def test_accuracies_of_triangles_need_it(self):
        with pytest.raises(ValueError, match='coarse="none" leaves no triangles for accuracy'):
            render(self.scene_of("patches"), coarse="none", accuracy="mesh")


def test_without_a_coarse_stage_nothing_is_cut_into_triangles():
    code = """
import sys
import meshing
from hybrid_rt import Camera, Lambertian, Object, Scene, demo, render

def forbidden(*_):
    raise AssertionError
meshing.tessellate = forbidden
camera = Camera((0, -20, 8), (0, 0, 0), (0, 0, 1), width=4, height=3)
objects = [Object(surface, Lambertian(0.5)) for surface in (demo.vase(0.0, 0.0, 1.0), demo.teapot())]
render(Scene(camera, objects), passes=1, coarse="none")
print({"embreex", "hybrid_rt.intersection.coarse.embree"} & set(sys.modules))
"""
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=120
    )
    assert done.stdout.strip() == "set()"
