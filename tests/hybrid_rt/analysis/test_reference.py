"""References of studies: by whom, how good, and by whom checked."""

from dataclasses import replace

import pytest
from studied import SKY, VIEW

from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.work_precision import study_picture
from hybrid_rt.lights import PointLight, RectangleLight
from hybrid_rt.materials import Dielectric, Lambertian, Mirror
from hybrid_rt.primitives import Plane, Rectangle, Sphere
from hybrid_rt.primitives.torus import Torus
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from proof.light.light_tracer import BEHIND_PANE


class TestReference:
    """Paths and photons check each other where both find all light."""

    GLOSSY = Object(Sphere((0, 0, 1.5), 0.3), Mirror())
    POINT = (PointLight((3, -5, 3), 40),)

    def study(self, objects, lights=(), sky=None, **settings):
        scene = Scene(VIEW, objects, lights, sky)
        methods = [Method("whitted", "whitted")]
        settings = {"runs": 1, "reference_passes": 8, "methods": methods, **settings}
        return study_picture(scene, (1,), **settings).reference

    def test_paths_by_photons_and_photons_by_paths(self):
        ball = Object(Sphere((0, 0, 0), 1), Lambertian(0.5))
        found = [self.study([ball], self.POINT, reference_by=name) for name in ("path", "ppm")]
        assert [r.made_by.split(",")[0] for r in found] == ["path", "ppm"]
        assert [r.check["made_by"] for r in found] == ["ppm, 2 passes", "path, 2 passes"]
        # The ball lights nothing: only jitter within pixels differs.
        assert found[0].mean == pytest.approx(found[1].mean, rel=0.02)

    def test_what_a_point_light_throws_is_found_by_photons_alone(self):
        floor = Object(Rectangle((-2, -2, -1), (4, 0, 0), (0, 4, 0)), Lambertian(0.5))
        found = self.study([floor, self.GLOSSY], self.POINT)
        assert found.made_by.startswith("ppm")
        assert found.check is None
        with pytest.raises(ValueError, match=r"'path'.* all light of this scene: pass ppm"):
            self.study([floor, self.GLOSSY], self.POINT, reference_by="path")

    def test_a_black_reference_is_refused(self):
        ball = Object(Sphere((0, 0, 0), 1), Lambertian(0.5))
        with pytest.raises(ValueError, match=r"reference is black.*Give the scene a lamp"):
            self.study([ball])

    def test_the_smaller_stated_error_is_the_reference(self):
        """A ring's caustic, seen through a pane: rare and bright for paths, easy for photons.

        Paths state 0.58 to 0.73 over six seeds, photons 0.08 to 0.10.
        """
        bench = BEHIND_PANE.scene(Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 16, 16))
        ring = Object(Torus((0, 0, 0.9), (0, 0, 1), 0.45, 0.2), Dielectric(1.5))
        others = [thing for thing in bench.objects if thing.name != "sphere"]
        lamp = RectangleLight((-0.5, -0.5, 3.5), (0, 1, 0), (1, 0, 0), 5.0)
        scene = Scene(bench.camera, [ring, *others], [lamp], bench.environment)
        methods = [Method("path", "path")]
        study = study_picture(scene, (1, 4), runs=1, reference_passes=16, methods=methods)
        assert study.reference.made_by == "ppm, certified, 4 passes"
        assert study.reference.check["made_by"] == "path, 16 passes"

    def test_reference_worse_than_what_it_judges_is_said_so(self, room):
        worse = replace(room, reference=replace(room.reference, own_error=0.5))
        found = advise(worse, 0.05, "r.py")
        assert found.headline == "5 % cannot be judged: the reference is itself off by 50 %."
        assert found.command == ""
        (todo,) = found.details
        assert "may be off by 1.7 % at most" in todo
        assert "--reference FILE.npz" in todo

    def test_poor_reference_names_its_remedy_and_what_it_can_judge(self, room):
        """Off by 4 % with 100 passes: for 6 % it needs four times as many, and it can judge 12 %."""
        own = replace(room.reference, own_error=0.04, passes=100, seconds=3.0)
        found = advise(replace(room, reference=own), 0.06, "r.py")
        assert found.headline.startswith(
            "6 % cannot be judged: the reference is itself off by 4.0 %. For 15 %: "
        )
        assert found.target == 0.15
        assert "--reference-passes 400, about 12 s instead of 3.0 s" in found.details[-1]

    def test_the_longer_reference_is_by_the_method_that_needs_less_time(self, room):
        """Paths are off by 8 % after 400 passes: they need 16 times as many, and photons 4 times.

        Photons take 0.03 or 30 s a pass, paths 0.01 s. Either is checked by a quarter as many passes of
        the other, or as many as take as long, but at least eight.
        """
        cheap = replace(
            room.reference,
            made_by="ppm, certified, 100 passes",
            own_error=0.04,
            passes=100,
            seconds=3.0,
            check={"made_by": "path, 400 passes", "passes": 400, "seconds": 4.0, "own_error": 0.08},
            power=1.0,
        )
        dear = replace(cheap, own_error=0.16, seconds=3000.0)
        for reference, photons, others in (
            # 400 x 0.03 + 100 x 0.01 s
            (cheap, "ppm --reference-passes 400, about 13 s", "by ppm, 400 passes, about 12 s"),
            # 6400 x 0.01 + 8 x 30 s
            (
                dear,
                "path --reference-passes 6400, about 5.1 min",
                "by path, 6400 passes, about 64 s",
            ),
        ):
            (*_, todo) = advise(replace(room, reference=reference), 0.06, "r.py").details
            assert f"--reference-by {photons}" in todo
            assert f"(not checked; {others})" in todo
        # A hundredth of that error takes ten thousand times the passes, 180 hours.
        (*_, todo) = advise(replace(room, reference=dear), 0.0006, "r.py").details
        assert (
            "What to do: ask for less with --target, or pass a better picture of your own" in todo
        )

    def test_where_photons_cannot_be_sent_paths_check_paths(self):
        ground = Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5))
        found = self.study([ground], sky=SKY)
        assert found.check["made_by"].startswith("path, never asking a light")
