"""Assemblies: places, mirrored ones too, names, colours, units."""

import numpy as np
import pytest

from hybrid_rt import Intersector, read_cad

shapes = pytest.importorskip("cad_shapes", reason="needs OCP")
from OCP.BRepPrimAPI import BRepPrimAPI_MakeBox, BRepPrimAPI_MakeCylinder

ASIDE = np.array([[0, -1, 0, 50], [1, 0, 0, 0], [0, 0, 1, 5], [0, 0, 0, 1.0]])
MIRROR = np.array([[-1, 0, 0, -30], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1.0]])


@pytest.fixture(scope="module")
def assembly(tmp_path_factory):
    bolt = BRepPrimAPI_MakeCylinder(2.0, 10.0).Shape()
    plate = BRepPrimAPI_MakeBox(20.0, 10.0, 3.0).Shape()
    parts = [
        (plate, "plate", (0.2, 0.4, 0.6), [("base", np.eye(4)), ("second", ASIDE)]),
        (bolt, "bolt", (0.8, 0.1, 0.1), [("left", ASIDE)]),
    ]
    file = tmp_path_factory.mktemp("cad") / "machine.step"
    return shapes.write_assembly(parts, file, "INCH")


@pytest.fixture(scope="module")
def model(assembly):
    return read_cad(assembly, "mm")


def test_parts_have_names_colours_and_places(model):
    names = [(part.name, part.instance.rpartition("/")[2]) for part in model.parts]
    assert names == [("plate", "base"), ("plate", "second"), ("bolt", "left")]
    assert [part.shape for part in model.parts] == [0, 0, 1]
    assert model.report["shapes"] == 2
    # Written as sRGB of eight digits or so, and back: linear.
    assert model.parts[0].color == pytest.approx((0.2, 0.4, 0.6), abs=1e-5)
    assert model.parts[1].transform == pytest.approx(ASIDE, abs=1e-10)  # a dozen digits of inches
    assert all(part.is_closed for part in model.parts)
    # The second plate: x from 40 to 50, y from 0 to 20, z from 5 to 8.
    hits = Intersector(model.surfaces, coarse="none").intersect((45, 15, 100), (0, 0, -1))
    assert hits.t[0] == pytest.approx(92.0, abs=1e-10)
    assert model.faces["part"][model.face_of[hits.object_id[0]]] == 1


def test_lengths_are_in_the_unit_of_the_file_or_that_asked_for(assembly, model):
    models = {"mm": model, "file": read_cad(assembly), "m": read_cad(assembly, "m")}
    sides = {unit: np.ptp(model.bounds, axis=0)[0] for unit, model in models.items()}
    # From 0 to the far end of the plate at 50, or to the bolt there, of radius 2.
    assert sides["mm"] == pytest.approx(52.0, abs=1e-9)
    assert sides["file"] == pytest.approx(52.0 / 25.4, abs=1e-9)
    assert sides["m"] == pytest.approx(0.052, abs=1e-11)


def test_mirrored_parts_have_normals_outward(tmp_path):
    body = shapes.drilled_cylinder()
    both = shapes.compound([body, shapes.placed(body, MIRROR)])
    model = read_cad(shapes.write(both, tmp_path / "both.brep"))
    assert len(model.parts) == 2
    rng = np.random.default_rng(4)
    directions = rng.normal(size=(200, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    aims = rng.uniform((-10, -10, 0), (10, 10, 40), (200, 3))
    tracer = Intersector(model.surfaces, coarse="none")
    hits = tracer.intersect(aims - 100 * directions, directions)
    assert hits.front_face[hits.hit].all()
    flip = np.array([-1.0, 1.0, 1.0])
    mirrored = tracer.intersect(flip * (aims - 100 * directions) + MIRROR[:3, 3], flip * directions)
    ours, theirs = (model.faces["part"][model.face_of[h.object_id]] for h in (hits, mirrored))
    # Each ray and its image, where neither is hidden by the other body.
    alone = hits.hit & mirrored.hit & (ours == 0) & (theirs == 1)
    assert alone.sum() > 50
    assert mirrored.t[alone] == pytest.approx(hits.t[alone], abs=1e-10)
    assert mirrored.front_face[alone].all()


def test_a_scene_has_the_colours_of_the_file(model):
    scene = model.scene(width=32, height=24)
    assert len(scene.objects) == len(model.surfaces) + 1
    assert scene.objects[0].name == "plate, face 0"
    materials = {id(item.material) for item in scene.objects}
    assert len(materials) == 3  # plates, bolt, ground
