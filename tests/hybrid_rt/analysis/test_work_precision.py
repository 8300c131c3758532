"""Studies of tiny scenes of which everything is known."""

import base64
import io
import math
import os
import re
import signal
import time
from xml.etree import ElementTree

import imageio.v3 as imageio
import numpy as np
import pytest
from studied import SCENE

from hybrid_rt.analysis import answers, study_diagrams, tables, work_precision
from hybrid_rt.analysis.advice import advise
from hybrid_rt.analysis.method_forecast import forecasts_of
from hybrid_rt.analysis.methods import Method
from hybrid_rt.analysis.page import Study, page
from hybrid_rt.analysis.picture_comparison import Picture
from hybrid_rt.analysis.study_runs import next_passes
from hybrid_rt.analysis.work_precision import StudyInterrupted, study_picture
from hybrid_rt.integrators import PPMOptions
from hybrid_rt.materials import Emissive, Lambertian
from hybrid_rt.primitives import Box
from hybrid_rt.scene.scene import Object, Scene
from hybrid_rt.sensor.camera import Camera


class TestNextPasses:
    def test_four_times_as_many_until_the_seconds_are_filled(self):
        """0.5 s and 0.1 s a pass: 10 s are filled by 95 passes."""
        spent = {}
        while (n := next_passes(spent, 10.0)) is not None:
            spent[n] = 0.5 + 0.1 * n
        assert list(spent) == [1, 4, 16, 95]

    def test_a_pass_that_takes_as_long_is_the_only_one(self):
        assert next_passes({1: 9.1}, 10.0) is None
        assert next_passes({1: 30.0}, 10.0) is None

    def test_hardly_more_passes_are_not_worth_a_render(self):
        assert next_passes({1: 1.0, 80: 80.0}, 91.0) is None
        assert next_passes({1: 1.0, 80: 80.0}, 93.0) == 93

    def test_times_of_a_busy_machine_end_nothing(self):
        assert next_passes({1: 1.0, 4: 0.9}, 10.0) == 16


@pytest.mark.parametrize("work", [{}, {"passes": (1, 4), "seconds": 1.0}])
def test_passes_or_seconds(work):
    with pytest.raises(ValueError, match="pass the one or the other"):
        study_picture(SCENE, **work)


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
        found = forecasts_of(room, 0.05)
        seconds = [f.seconds.median for f in found]
        assert seconds == sorted(seconds)
        assert all(f.seconds.least <= f.seconds.median <= f.seconds.most for f in found)
        assert all(f.bias == 0.0 for f in found)

    def test_page_needs_no_other_file(self, room):
        advice = advise(room, 0.05, "a <room>.py")
        diagram = study_diagrams.picture_diagram(room.curves, room.reference.own_error)
        study = Study(
            "A <room>", "Asked: which?", advice.headline, advice.command, advice.details,
            measured=answers.conditions(answers.picture_conditions(room, (32, 24)), "room.py"),
            diagrams=[diagram], tables=[tables.picture_table(room.curves)], images=room.images,
        )  # fmt: skip
        text = page(study)
        assert "A &lt;room&gt;" in text
        assert f'<p class="answer">{advice.headline}</p>' in text
        assert "16 x 12 pixels; the scene&#x27;s own camera has 32 x 24" in text
        assert "relative RMSE against the reference" in text
        # One diagram, for wide screens and narrow ones.
        assert text.count("data:image/svg+xml") == 2
        links = re.findall(r'(?:src|href|srcset)="([^"]*)"', text)
        assert len(links) == 2 + 1 + 2 * 2
        assert not re.findall(r"https?://", re.sub(r'(?:src|srcset)="[^"]*"', "", text))
        for link in links:
            kind, data = link.split(",", 1)
            file = base64.b64decode(data)
            if kind == "data:image/svg+xml;base64":
                assert ElementTree.fromstring(file).tag.endswith("svg")
                continue
            assert kind == "data:image/png;base64"
            assert imageio.imread(io.BytesIO(file)).shape == (12, 16, 3)


def test_a_second_ctrl_c_does_not_take_what_was_measured(monkeypatch):
    """It comes while the curves of what the first one left are computed."""

    def interrupted(*arguments):
        os.kill(os.getpid(), signal.SIGINT)
        time.sleep(0.01)
        return curve(*arguments)

    def stops(text):
        if text.startswith("run 2"):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.01)

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    walls = Object(Box((-1, -1, -1), (1, 1, 1)).flipped(), Emissive(1.0, Lambertian(0.5)))
    scene = Scene(Camera((0, 0, 0), (1, 0.2, 0.1), (0, 0, 1), 90, 16, 12), [walls])
    truth = Picture("truth", np.full((12, 16, 3), 2.0, np.float32), None, None)
    curve = work_precision._curve
    monkeypatch.setattr(work_precision, "_curve", interrupted)
    settings = {"reference": truth, "methods": [Method("path", "path")], "threads": 1}
    with pytest.raises(StudyInterrupted) as caught:
        study_picture(scene, (4,), runs=2, say=stops, **settings)
    assert [curve.name for curve in caught.value.study.curves] == ["path"]
    assert signal.signal(signal.SIGINT, before) is signal.default_int_handler


@pytest.mark.statistical
def test_two_methods_agree_and_a_mesh_does_not():
    larger = SCENE.with_camera(SCENE.camera.resized(48, 32))
    study = study_picture(
        larger, (4, 16), runs=1, reference_passes=64, methods=[Method("path", "path")], threads=1
    )
    check = study.reference.check
    # Whichever states the smaller error is the reference, and checked by the other.
    made_by = {study.reference.made_by.partition(",")[0], check["made_by"].partition(",")[0]}
    assert made_by == {"path", "ppm"}
    # By Student's t with 3 degrees of freedom four 95 % intervals are passed once in 1000 runs.
    assert abs(check["gap"]) < 4.0 * check["gap_half_interval"]
    explained = math.hypot(check["by_noise"], check["by_blur"])
    assert check["difference"] == pytest.approx(explained, rel=0.3)
    refined, coarse, _, fine = study.meshes
    assert (refined["accuracy"], coarse["accuracy"]) == ("refined", "mesh")
    assert coarse["error"] > 3.0 * fine["error_at_most"]
    assert coarse["error"] > 3.0 * refined["error_at_most"]
    assert coarse["triangles"] < fine["triangles"]
    assert coarse["error"] < coarse["error_at_most"]


@pytest.mark.nightly
def test_meshes_are_judged_by_the_method_with_less_noise():
    """Whitted's method leaves out light; half a million photons bring little to a tube under a sky."""
    methods = [
        Method("whitted", "whitted"),
        Method("photons", "ppm", options=PPMOptions(500_000)),
        Method("paths", "path"),
    ]
    truth = Picture("truth", np.full((16, 24, 3), 0.5, np.float32), None, None)
    common = {"runs": 1, "reference": truth, "methods": methods, "threads": 1}
    study = study_picture(SCENE, (2,), trimmed=True, **common)
    assert study.trimmed
    assert [row["method"].partition(",")[0] for row in study.meshes] == ["paths"] * 4
    study = study_picture(SCENE, (2,), meshes_by="whitted", **common)
    assert {row["method"].partition(",")[0] for row in study.meshes} == {"whitted"}
    with pytest.raises(ValueError, match=r"meshes_by is 'photon_map', .* pass whitted or ppm"):
        study_picture(SCENE, (2,), meshes_by="photon_map", **common)
