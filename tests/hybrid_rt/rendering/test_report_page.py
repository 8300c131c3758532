"""docs/reference/report.md has every key of every report, and no other."""

import inspect
import json
import pickle
import re
from contextlib import nullcontext
from copy import deepcopy
from dataclasses import FrozenInstanceError, fields, replace
from pathlib import Path

import numpy as np
import pytest

import hybrid_rt as rt
from helpers.reports import changed
from hybrid_rt.analysis.mesh_comparison import compare_with_mesh
from hybrid_rt.rendering import denoising
from hybrid_rt.rendering.report import LAYOUT, ClusterFigures, Report

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "report.md"
CELLS = re.findall(r"^\| (`[^|]+`) \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
ROWS = [key for cell in CELLS for key in re.findall(r"`([^`]+)`", cell)]
DOCUMENTED = set(ROWS)
# Keys of renders by processes of dask, which take seconds to start: see the last test.
# So are those of denoised pictures, which need a large package.
OF_DENOISED = {key for key in DOCUMENTED if key.startswith("denoised.")}
OF_CLUSTERS = {key for key in DOCUMENTED if re.match(r"cluster\.|seconds\.cluster", key)}
# What only fault brings: bodies that are not what they should be.
OF_FAULTS = {"clear_bodies_lost.*"}


# Here the scene, the integrator's options and the packages give the names.
OPEN = re.compile(r"plan\.\w+\.\w+\.|clear_bodies_\w+\.|settings\.options\.|versions\.")


def keys_of(report, head=""):
    """Return the keys of a report as the page writes them; a dict that is empty counts as one."""
    keys = set()
    for name, value in report.items():
        key = head + ("*" if OPEN.fullmatch(head) else name)
        keys |= keys_of(value, f"{key}.") if isinstance(value, dict) and value else {key}
    return keys


class Watcher:
    """Watches a render, and does nothing."""

    film_lock, stop_asked = nullcontext(), False

    def begin(self, beginning):
        """Hear, once, what is rendered."""

    note_rays = note = end = lambda *_: None


def scene(body):
    """A ball of glass, an open body of glass or a patch over a floor, under two lamps."""
    camera = rt.Camera((0, -5, 2), (0, 0, 0.5), (0, 0, 1), width=40, height=30)
    floor = rt.Object(rt.Rectangle((-3, -3, 0), (6, 0, 0), (0, 6, 0)), rt.Lambertian(0.7), "floor")
    lamps = [rt.RectangleLight((-1, -1, 4), (0, 2, 0), (2, 0, 0), 5), rt.PointLight((2, -2, 3), 9)]
    return rt.Scene(camera, [floor, body], lamps)


def bodies():
    from meshing import BezierPatches

    net = np.zeros((1, 2, 2, 3))
    net[0, :, :, 0], net[0, :, :, 1] = [[-1, -1], [1, 1]], [[-1, 1], [-1, 1]]
    net[0, :, :, 2] = [[1.0, 1.2], [1.2, 1.0]]
    sheet = BezierPatches(net)
    return {
        "ball": rt.Object(rt.Sphere((0, 0, 1), 0.5), rt.Dielectric(1.5), "ball"),
        "open": rt.Object(
            rt.Rectangle((-2, 3.5, 0), (4, 0, 0), (0, 0, 3)), rt.Dielectric(1.5), "half a body"
        ),
        "matt": rt.Object(sheet, rt.Lambertian(0.5), "sheet"),
    }


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """Reports that together have all keys: of every integrator, kept, told options, with a check."""
    body, store = bodies(), tmp_path_factory.mktemp("store") / "kept"
    few, one = {"passes": 2, "threads": 1}, {"passes": 1, "threads": 1}
    ppm = rt.PPMOptions(photons_per_pass=20_000)
    ball = scene(body["ball"])
    results = [
        rt.render(ball, "path", passes=4, threads=1, outputs=["depth"], target_error=0.01),
        rt.render(ball, "whitted", store=store, max_depth=1, watch=Watcher(), **few),
        rt.render(ball, "ppm", options=ppm, max_depth=2, **few),
        rt.render(ball, "photon_map", options=rt.PhotonMapOptions(500), max_depth=2, **few),
        rt.render(scene(body["open"]), "whitted", max_depth=1, **one),
        rt.render(scene(body["matt"]), "path", accuracy="refined", **one),
    ]
    found = [result.report for result in results]
    against_mesh = compare_with_mesh(scene(body["matt"]), 1)
    found[-1] = replace(found[-1], exact_against_mesh=against_mesh)
    return found


def test_every_key_is_documented(reports):
    for report in reports:
        assert (
            keys_of(report) - DOCUMENTED - {"clear_bodies_lost", "clear_bodies_not_closed"} == set()
        )


def test_every_documented_key_exists_and_is_documented_once(reports):
    assert sorted(ROWS) == sorted(DOCUMENTED)
    found = set().union(*map(keys_of, reports))
    assert DOCUMENTED - found - OF_CLUSTERS - OF_DENOISED - OF_FAULTS == set()


def test_what_is_looked_up_first_are_attributes(reports):
    result = rt.RenderResult(np.zeros((1, 1, 3), np.float32), reports[0])
    assert result.error == reports[0]["relative_error"]["both"]
    assert (result.seconds, result.passes) == (reports[0]["seconds"]["total"], 4)
    assert np.isnan(rt.RenderResult(result.image, reports[-1]).error)
    unknown = changed(reports[0], relative_error={"both": None})
    assert rt.RenderResult(result.image, unknown).error == np.inf


def test_a_report_is_the_dict_of_its_file_and_read_from_it(reports):
    for report in reports:
        held = json.loads(report.to_json())
        assert json.loads(json.dumps(report)) == held
        again = Report.from_json(report.to_json())
        assert json.loads(again.to_json()) == held
        assert again.settings == report.settings
        assert again.faults == report.faults
        assert again.passes == report["passes"] == held["passes"]
        for copy in (pickle.loads(pickle.dumps(report)), deepcopy(report)):
            assert isinstance(copy, Report)
            assert copy == report
            assert copy.photons == report.photons


def test_the_dict_may_get_entries_and_the_attributes_stay(reports):
    report = deepcopy(reports[0])
    with pytest.raises(FrozenInstanceError):
        report.passes = 3
    report["note"] = "of mine"
    assert json.loads(report.to_json())["note"] == "of mine"
    assert pickle.loads(pickle.dumps(report))["note"] == "of mine"
    assert Report.from_json(report.to_json()).noise == report.noise == reports[0].noise
    other = replace(report, passes=3)
    assert (other.passes, other["passes"], report.passes) == (3, 3, 4)
    assert type(report | {"passes": 3}) is dict


def test_other_layouts_and_other_files_are_refused(reports):
    held = dict(reports[0])
    for other in ({**held, "layout": LAYOUT + 1}, {"passes": 3}):
        with pytest.raises(ValueError, match="report has layout"):
            Report.from_dict(other)
    with pytest.raises(ValueError, match="report has layout None"):
        Report.from_json("[]")
    del held["noise"]
    with pytest.raises(ValueError, match="report cannot be read: KeyError\\('noise'\\)"):
        Report.from_dict(held)


def test_keys_of_clusters_and_denoised_pictures_are_those_that_the_code_writes():
    written = {f"cluster.{one.name}" for one in fields(ClusterFigures)}
    assert written | {"seconds.cluster"} == OF_CLUSTERS
    written = re.findall(r'^ {16}"(\w+)":', inspect.getsource(denoising), re.MULTILINE)
    assert {f"denoised.{key}" for key in written} == OF_DENOISED
