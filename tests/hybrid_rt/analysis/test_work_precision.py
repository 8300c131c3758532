"""Studies of tiny scenes of which everything is known."""

import base64
import io
import math
import re
from dataclasses import replace
from xml.etree import ElementTree

import imageio.v3 as imageio
import numpy as np
import pytest

from hybrid_rt.analysis import page as error_page
from hybrid_rt.analysis.curves import Curve, Spread, renamed, spread
from hybrid_rt.analysis.diagrams import Diagram, Line, Mark, as_svg, save
from hybrid_rt.analysis.forecast import recommend
from hybrid_rt.analysis.hit_study import RULE_OF_THREE, camera_rays, study_hits
from hybrid_rt.analysis.methods import Method, size_of
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.work_precision import study_picture
from hybrid_rt.lights import GradientSky, PointLight
from hybrid_rt.materials import Emissive, Lambertian, Mirror
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera
from hybrid_rt.verify.light.light_tracer import BEHIND_PANE
from meshing import SurfaceOfRevolution

TUBE = SurfaceOfRevolution([[-1.0, 1.0], [1.0, 1.0]], (0, 0, 0), (0, 0, 1))
VIEW = Camera((0, -6, 0.5), (0, 0, 0), (0, 0, 1), vertical_fov=30, width=24, height=16)
SKY = GradientSky(0.3, 1.0, up=(0, 0, 1))
SCENE = Scene(VIEW, [Object(TUBE, Lambertian(0.5))], environment=SKY)


def test_spread_and_names():
    assert spread([3.0, 1.0, 2.0]) == Spread(2.0, 1.0, 3.0)
    assert renamed([Curve("law", "", [])], "A")[0].name == "A: law"


@pytest.fixture(scope="module")
def room():
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    truth = Picture("truth", np.full((12, 16, 3), 2.0, np.float32), None, None)
    methods = [Method("path", "path"), Method("again", "path")]
    return study_picture(scene, (4, 16, 64), runs=2, reference=truth, methods=methods, threads=1)


@pytest.fixture(scope="module")
def tube():
    return study_hits([TUBE], camera_rays(SCENE, 4000), tolerances=(1e-2, 1e-4), runs=2, threads=1)


class TestPictures:
    """A closed room that shines and reflects half: radiance 2 everywhere, by Whitted 3/2."""

    @pytest.mark.statistical
    def test_errors_fall_as_noise_does(self, room):
        for curve in room.curves:
            first, _, last = (point.error.median for point in curve.points)
            assert 2.0 < first / last < 10.0  # 4 by independent passes, more by nets
            assert [point.setting for point in curve.points] == [4, 16, 64]
            assert all(point.seconds.least <= point.seconds.most for point in curve.points)

    @pytest.mark.statistical
    def test_stated_errors_are_the_true_ones(self, room):
        """192 pixels, 2 runs: 20 % is some 4 standard deviations."""
        point = room.curves[0].points[-1]
        assert point.more["stated_error"] == pytest.approx(point.error.median, rel=0.2)

    def test_same_method_same_errors(self, room):
        one, other = (curve.points[-1].error for curve in room.curves)
        assert one == other
        np.testing.assert_array_equal(room.images["path"], room.images["again"])

    def test_recommended_is_the_cheapest(self, room):
        found = recommend(room, 0.05)
        seconds = [f.seconds.median for f in found]
        assert seconds == sorted(seconds)
        assert all(f.seconds.least <= f.seconds.median <= f.seconds.most for f in found)
        assert all(f.bias == 0.0 for f in found)

    def test_curves_without_an_error_cannot_be_drawn(self, room):
        none = Spread(0.0, 0.0, 0.0)
        curves = [
            replace(c, points=[replace(p, error=none) for p in c.points]) for c in room.curves
        ]
        with pytest.raises(ValueError, match="room: all are equal to the reference"):
            error_page.picture_diagram("room", curves, math.nan)

    def test_page_needs_no_other_file(self, room):
        forecasts = recommend(room, 0.05)
        answers = error_page.picture_answers(room, forecasts, 0.05, "room.py", math.nan)
        assert "hybrid-rt render room.py --integrator path --passes" in answers[0]
        diagram = error_page.picture_diagram("room", room.curves, room.reference.own_error)
        tables = {"points": error_page.picture_table(room.curves)}
        text = error_page.page("A <room>", answers, [diagram], tables, room.images)
        assert "A &lt;room&gt;" in text
        assert text.count("data:image/svg+xml") == 1
        assert text.count("<tr>") == 1 + 6
        links = re.findall(r'(?:src|href)="([^"]*)"', text)
        assert len(links) == 1 + 1 + 2 * 2
        for link in links:
            kind, data = link.split(",", 1)
            file = base64.b64decode(data)
            if kind == "data:image/svg+xml;base64":
                assert ElementTree.fromstring(file).tag.endswith("svg")
                continue
            assert kind == "data:image/png;base64"
            assert imageio.imread(io.BytesIO(file)).shape == (12, 16, 3)


@pytest.mark.statistical
def test_two_methods_agree_and_a_mesh_does_not():
    study = study_picture(
        SCENE, (4, 16), runs=1, reference_passes=64, methods=[Method("path", "path")], threads=1
    )
    check = study.reference.check
    # Student's t with 3 degrees of freedom on either side: 12.9 is passed once in 1000 runs.
    assert check["made_by"].startswith("ppm")
    assert abs(check["gap"]) < 12.9 * check["gap_error"]
    explained = math.hypot(check["by_noise"], check["by_blur"])
    assert check["difference"] == pytest.approx(explained, rel=0.3)
    refined, coarse, _, fine = study.meshes
    assert (refined["accuracy"], coarse["accuracy"]) == ("refined", "mesh")
    assert coarse["error"] > 3.0 * fine["error"]
    assert coarse["error"] > 3.0 * refined["error"]
    assert coarse["triangles"] < fine["triangles"]
    assert coarse["error"] < coarse["error_at_most"]


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

    def test_the_smaller_stated_error_is_the_reference(self):
        """A caustic seen through a pane: rare and bright for paths, easy for photons."""
        scene = BEHIND_PANE.scene(Camera((0, -3, 2.2), (0, 0, 0.3), (0, 0, 1), 45, 16, 16))
        methods = [Method("path", "path")]
        study = study_picture(scene, (1, 4), runs=1, reference_passes=16, methods=methods)
        assert study.reference.made_by == "ppm, certified, 4 passes"
        assert study.reference.check["made_by"] == "path, 16 passes"

    def test_reference_worse_than_what_it_judges_is_said_so(self, room):
        worse = replace(room, reference=replace(room.reference, own_error=0.5))
        answers = error_page.picture_answers(worse, recommend(worse, 0.05), 0.05, "r.py", math.nan)
        assert "forecasts say nothing" in answers[0]

    def test_where_photons_cannot_be_sent_paths_check_paths(self):
        ground = Object(Plane((0, 0, -1), (0, 0, 1)), Lambertian(0.5))
        found = self.study([ground], sky=SKY)
        assert found.check["made_by"].startswith("path, never asking a light")


class TestHits:
    def test_certified_hits_are_right_and_meshes_are_not(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        assert tube.rays == pytest.approx(4000, rel=0.02)
        assert all(
            p.error.median == 0.0
            for name, points in curves.items()
            if name.startswith("certified")
            for p in points
        )
        coarse, fine = curves["mesh"]
        assert coarse.error.median > fine.error.median
        assert coarse.more["triangles"] < fine.more["triangles"]
        # A chord of tolerance e lies within e of the arc, on average two thirds of it; slant adds.
        assert 0.3 * coarse.setting < coarse.more["mean_dt"] < 3.0 * coarse.setting
        assert curves["refined"][0].more["mean_dt"] < 1e-14
        assert math.isinf(curves["certified, no Embree"][0].setting)

    def test_answers_and_diagrams(self, tube):
        cost, share, mesh, newton = error_page.hit_answers(tube)
        assert "us per ray" in cost
        assert f"Of {tube.judged} judged rays" in share
        assert "triangles^-" in mesh
        marks = [
            m for line in error_page.hit_diagram("tube", tube.curves, 9).lines for m in line.marks
        ]
        n_none = sum(p.error.median == 0.0 for c in tube.curves for p in c.points)
        assert len(marks) == sum(len(curve.points) for curve in tube.curves)
        assert sum(mark.is_limit for mark in marks) == n_none
        assert {mark.y[0] for mark in marks if mark.is_limit} == {RULE_OF_THREE / 9}
        head, rows = error_page.hit_table(tube.curves)
        assert all(len(row) == len(head) for row in rows)

        assert "before the first step" in newton
        for diagram in error_page.newton_diagrams("tube", tube.newton, tube.size):
            assert [len(line.marks) for line in diagram.lines] == [6] * len(tube.newton)
        head, rows = error_page.newton_table(tube.newton)
        assert all(len(row) == len(head) for row in rows)

    def test_newton_mends_distances_and_no_decisions(self, tube):
        curves = {curve.name: curve.points for curve in tube.curves}
        # Rounding may decide one ray otherwise; triangles are met in float32 here, there in float64.
        one_ray = 1.5 / tube.judged
        for stepped, mesh, refined in zip(
            tube.newton, curves["mesh"], curves["refined"], strict=True
        ):
            points = stepped.points
            assert [p.setting for p in points] == [0, 1, 2, 3, 4, 6]
            assert points[0].more["mean_dt"] == pytest.approx(mesh.more["mean_dt"], rel=1e-4)
            assert points[0].error.median == pytest.approx(mesh.error.median, abs=one_ray)
            assert points[-1].error.median == pytest.approx(refined.error.median, abs=one_ray)
            assert points[-1].more["mean_dt"] < 1e-13
            assert points[-1].more["worst_residual"] < 1e-12

    def test_size_is_the_diagonal(self):
        assert size_of([TUBE]) == pytest.approx(math.sqrt(12), rel=1e-9)


class TestDiagram:
    def mark(self, x, y, **more):
        return Mark((x, x, x), (y, y, y), **more)

    def test_words_and_marks_are_drawn(self, tmp_path):
        marks = [self.mark(10.0**k, 10.0 ** (-0.5 * k), label=f"n{k}") for k in range(5)]
        marks.append(self.mark(1e5, 1e-3, is_limit=True))
        diagram = Diagram("t", "x", "y", [Line("half", marks)], (-0.5,), ("<floor>", 0.02))
        svg = as_svg(diagram)
        assert svg == as_svg(diagram)
        words = {text.text.strip() for text in ElementTree.fromstring(svg).iter() if text.text}
        assert words >= {"t", "x", "y", "half", "slope -0.5", "<floor>", "n0", "n4"}
        save([diagram] * 3, tmp_path / "a.png")
        assert imageio.imread(tmp_path / "a.png").shape[:2] == (2 * 506, 2 * 880)

    @pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf])
    def test_what_has_no_logarithm_is_refused(self, value):
        with pytest.raises(ValueError, match=rf"diagram 't' has the value {value}: pass"):
            Diagram("t", "x", "y", [Line("l", [self.mark(1.0, value)])])

    def test_nothing_to_draw_is_refused(self):
        with pytest.raises(ValueError, match="has no marks"):
            Diagram("t", "x", "y", [])
