"""docs/reference/report.md has every key of every report, and no other."""

import inspect
import re
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pytest

import hybrid_rt as rt
from hybrid_rt.analysis.mesh_comparison import compare_with_mesh
from hybrid_rt.rendering import denoising
from hybrid_rt.rendering.cluster import Cluster

PAGE = Path(__file__).parents[3] / "docs" / "reference" / "report.md"
ROWS = re.findall(r"^\| `([^`]+)` \|", PAGE.read_text(encoding="utf-8"), re.MULTILINE)
DOCUMENTED = set(ROWS)
# Keys of renders by processes of dask, which take seconds to start: see the last test.
# So are those of denoised pictures, which need a large package.
OF_DENOISED = {key for key in DOCUMENTED if key.startswith("denoised.")}
OF_CLUSTERS = {key for key in DOCUMENTED if re.match(r"cluster\.|seconds\.cluster", key)}
# What only fault brings: bodies that are not what they should be.
OF_FAULTS = {"clear_bodies_lost.*"}


# Here the scene and the integrator's options give the names.
OPEN = re.compile(r"plan\.\w+\.\w+\.|clear_bodies_\w+\.|settings\.options\.")


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
    found[-1] = found[-1] | {"exact_against_mesh": compare_with_mesh(scene(body["matt"]), 1)}
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
    unknown = {"relative_error": {"both": None}}
    assert np.isnan(rt.RenderResult(result.image, reports[-1]).error)
    assert rt.RenderResult(result.image, reports[0] | unknown).error == np.inf


def test_keys_of_clusters_and_denoised_pictures_are_those_that_the_code_writes():
    written = set(re.findall(r'"(\w+)":', inspect.getsource(Cluster.about))) | {"lost"}
    assert {f"cluster.{key}" for key in written} | {"seconds.cluster"} == OF_CLUSTERS
    written = re.findall(r'^ {16}"(\w+)":', inspect.getsource(denoising), re.MULTILINE)
    assert {f"denoised.{key}" for key in written} == OF_DENOISED
