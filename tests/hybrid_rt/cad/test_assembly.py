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
    assert model.part_at(hits)[0] == 1


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
    ours, theirs = (model.part_at(h) for h in (hits, mirrored))
    # Each ray and its image, where neither is hidden by the other body.
    alone = hits.hit & mirrored.hit & (ours == 0) & (theirs == 1)
    assert alone.sum() > 50
    assert mirrored.t[alone] == pytest.approx(hits.t[alone], abs=1e-10)
    assert mirrored.front_face[alone].all()


def test_a_scene_has_the_colours_of_the_file(model):
    scene = model.scene(width=32, height=24)
    assert len(scene.objects) == len(model.surfaces) + 1
    # Two plates are copies.
    assert [item.name for item in scene.objects[5:7]] == ["plate, face 5", "plate, face 0"]
    materials = {id(item.material) for item in scene.objects}
    assert len(materials) == 3  # plates, bolt, ground


def test_what_is_placed_often_is_instances_and_hit_as_copies_are(tmp_path):
    """A rod in eight places of two colours, half of them mirrored; a plate once."""
    rng = np.random.default_rng(5)
    places = []
    for k in range(8):
        axes = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        axes[:, 0] *= np.linalg.det(axes) * (-1 if k % 2 else 1)
        place = np.eye(4)
        place[:3, :3], place[:3, 3] = axes, (60.0 * k, 0.0, 0.0)
        places.append(place)
    rod = shapes.drilled_cylinder()
    plate = BRepPrimAPI_MakeBox(20.0, 10.0, 3.0).Shape()
    parts = [
        (rod, "rod", (0.8, 0.1, 0.1), [(f"rod {k}", place) for k, place in enumerate(places)]),
        (plate, "plate", (0.2, 0.4, 0.6), [("base", ASIDE - 300 * np.eye(4, k=3))]),
    ]
    whole = shapes.compound([shapes.placed(rod, place) for place in places])
    model = read_cad(shapes.write(whole, tmp_path / "rods.brep"))
    kinds = [type(surface).__name__ for surface in model.surfaces]
    assert kinds == ["Instances", "Instances"]  # as they are and mirrored
    named = read_cad(shapes.write_assembly(parts, tmp_path / "rods.step"))
    assert len(named.parts) == 9
    assert len(named.faces) == 4 + 6  # a row for each face of each shape

    copies = [one for item in model.surfaces for k in range(4) for one in item.surface_in(k)]
    aims = rng.uniform((-20, -20, -20), (440, 20, 20), (2000, 3))
    ways = rng.normal(size=(2000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    rays = aims - 1000 * ways, ways  # from outside
    tracer = Intersector(model.surfaces, coarse="none")
    hits, same = tracer.intersect(*rays), Intersector(copies, coarse="none").intersect(*rays)
    assert (hits.hit == same.hit).all()
    assert hits.hit.sum() > 300
    off = np.abs(hits.t[hits.hit] - same.t[hits.hit])
    assert (off <= (hits.t_bound + same.t_bound)[hits.hit]).all()
    assert hits.front_face[hits.hit].all()  # mirrored ones, too
    # Copies are by surface and place; parts lie 60 apart.
    part, face = model.part_at(hits), model.face_at(hits)
    centre = np.array([model.parts[k].transform @ (0, 0, 20, 1) for k in part[hits.hit]])[:, :3]
    assert np.linalg.norm(hits.position[hits.hit] - centre, axis=1).max() < np.hypot(10, 20) + 1e-9
    n = len(model.surfaces[0].surfaces)
    assert (face[hits.hit] == (same.object_id % n)[hits.hit]).all()
    assert (part[~hits.hit] == -1).all()
    assert (face[~hits.hit] == -1).all()
    # In and out in turn, of each part.
    paired, is_paired = model.paired(tracer.intersect_all(*rays))
    assert is_paired.all()
    assert (np.bincount(paired.ray * 8 + model.part_at(paired.hits)) % 2 == 0).all()
