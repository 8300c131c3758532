"""Faces of every kind, through files, against OpenCASCADE's own hits and closed forms."""

from pathlib import Path

import numpy as np
import pytest

from hybrid_rt import Flag, Intersector, read_cad
from hybrid_rt.cad.model import _model_of
from hybrid_rt.cad.process import arrays_of
from hybrid_rt.core.records import Status

shapes = pytest.importorskip("cad_shapes", reason="needs OCP")

DATA = Path(__file__).parents[2] / "data"
RAYS = 80
APART = 60.0


def shifted(x, y=0.0, z=0.0):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


@pytest.fixture(scope="module")
def model_of_all(tmp_path_factory):
    """Return shapes by name, and the model of one file that holds them all, in a row."""
    made = {name: make() for name, make in shapes.SHAPES.items()}
    made["inside out"] = made["torus"].Reversed()
    made["offset"] = shapes.offset_face(0.5)
    row = [shapes.placed(shape, shifted(APART * k)) for k, shape in enumerate(made.values())]
    mesh = shapes.triangles([(0, 0, 0), (4, 0, 0), (0, 4, 0)], [(0, 1, 2)])
    row.append(shapes.placed(mesh, shifted(0, 100)))
    file = tmp_path_factory.mktemp("cad") / "kinds.brep"
    model = read_cad(shapes.write(shapes.compound(row), file), approximate=1e-4)
    return made, model


@pytest.fixture
def every_kind(model_of_all):
    made, model = model_of_all
    return {name: made[name] for name in shapes.SHAPES}, model


def surfaces_of(model, part):
    face = model.owners.face[model.owners.first_patch[:-2]]
    mine = (face >= part.faces.start) & (face < part.faces.stop)
    return [model.surfaces[i] for i in np.flatnonzero(mine)]


def rays_at(box, n, seed):
    rng = np.random.default_rng(seed)
    low, high = box
    way = rng.normal(size=(n, 3))
    way /= np.linalg.norm(way, axis=1)[:, None]
    origins = 0.5 * (low + high) + np.linalg.norm(high - low) * way
    directions = low + (high - low) * rng.random((n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1)[:, None]


def test_every_face_is_exact(every_kind):
    made, model = every_kind
    assert len(model.parts) == len(made) + 3
    last = model.parts[len(made)].faces.start
    assert set(model.faces["exactness"][:last].tolist()) == {"exact"}
    assert model.report["refused"] == []
    kinds = {"plane", "cylinder", "cone", "sphere", "torus", "revolution", "extrusion", "bezier"}
    assert kinds <= set(model.report["faces"])


@pytest.mark.parametrize("name", list(shapes.SHAPES))
def test_first_hits_are_those_of_opencascade(every_kind, name):
    made, model = every_kind
    k = list(made).index(name)
    part = model.parts[k]
    surfaces = surfaces_of(model, part)
    corners = np.stack([surface.bounds for surface in surfaces])
    box = corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)
    box = (
        np.maximum(box[0], [APART * k - 25, -25, -25]),
        np.minimum(box[1], [APART * k + 25, 45, 45]),
    )
    origins, directions = rays_at(box, RAYS, 5)
    hits = Intersector(surfaces, coarse="none", threads=1).intersect(origins, directions)
    theirs = shapes.first_hits(made[name], origins - (APART * k, 0, 0), directions)
    assert np.isfinite(theirs).sum() > 10
    # OpenCASCADE ends its iterations at 1e-7 and less.
    with np.errstate(invalid="ignore"):
        is_same = (theirs == hits.t) | (np.abs(hits.t - theirs) < 1e-6)
    # Where it and we part, an edge is within its gap, or a ray grazes.
    assert (is_same | (hits.flags & Flag.EDGE > 0) | (hits.status == Status.TANGENT)).all()
    if part.is_closed:
        assert hits.front_face[hits.hit].all()


def test_crossings_at_edges_are_paired(every_kind):
    """Rays aimed at the upper rim of a drilled rod: in and out in turn, at every one."""
    made, model = every_kind
    k = list(made).index("drilled cylinder")
    rng = np.random.default_rng(8)
    n, angle = 400, rng.random(400) * 2 * np.pi
    rim = np.column_stack([10 * np.cos(angle), 10 * np.sin(angle), np.full(n, 40.0)])
    ways = rng.normal(size=(n, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    origins = rim + np.array([APART * k, 0.0, 0.0]) - 80 * ways
    crossings = Intersector(model.surfaces, coarse="none").intersect_all(origins, ways)
    paired, is_paired = model.paired(crossings)
    assert is_paired.all()
    mine = model.part_at(paired.hits) == k
    assert (np.bincount(paired.ray[mine], minlength=n) % 2 == 0).all()
    # Outside of the band nothing is left out.
    left_out = len(crossings) - len(paired)
    assert 0 < left_out <= (crossings.hits.flags & Flag.EDGE > 0).sum()


def test_no_ray_at_an_edge_or_a_vertex_of_a_real_part_comes_out_odd():
    """Points of the edges of a part of NIST with tori: 33 of each, its ends among them."""
    file = DATA / "nist_ftc_11_asme1_rb.stp"
    model = read_cad(file)
    options = {"unit": "file", "sew": None, "approximate": None}
    points = arrays_of(file, options, 60.0, 16.0)["xyz"].reshape(-1, 3)
    ways = np.random.default_rng(12).normal(size=points.shape)
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    tracer = Intersector(model.surfaces, coarse="none")
    crossings = tracer.intersect_all(points - 200 * ways, ways)
    paired, is_paired = model.paired(crossings)
    assert is_paired.all()
    assert (paired.count % 2 == 0).all()
    # The first hit is where the ray enters, or within the gap of an edge.
    first = tracer.intersect(points - 200 * ways, ways)
    assert (first.front_face | ~first.hit | (first.flags & Flag.EDGE > 0)).all()


def test_each_curve_has_the_gap_of_its_edge():
    """Of two faces that are 1e-3 apart along one edge the other edges stay sharp."""
    options = {"unit": "file", "sew": None, "approximate": None}
    arrays = arrays_of(DATA / "nist_ftc_11_asme1_rb.stp", options, 60.0, 16.0)
    uses, xyz = arrays["uses"], arrays["xyz"]
    edge = uses["edge"][np.flatnonzero(uses["face"] == 3)[0]]
    both = np.flatnonzero(uses["edge"] == edge)
    xyz[both[0]] += (0.0, 0.0, 1e-6)
    model = _model_of(arrays)
    gap = model.faces["gap_measured"][uses["face"][both]]
    assert gap == pytest.approx(1e-6, rel=0.2)
    shares = {c.gap_share for s in model.surfaces for loop in s.loops for c in loop if s.gap > 1e-6}
    assert 1.0 in shares
    assert min(shares) < 0.1


def test_iges_of_loose_faces_is_sewed(tmp_path):
    file = shapes.write(shapes.drilled_cylinder(), tmp_path / "loose.igs", mode=0)
    loose, sewed = read_cad(file), read_cad(file, sew=1e-4)
    assert set(loose.faces["exactness"].tolist()) == {"exact"}
    assert "revolution" in loose.report["faces"]  # what IGES makes of cylinders
    assert (loose.report["free_edges"] > 0, loose.parts[0].is_closed) == (True, False)
    assert (sewed.report["free_edges"], sewed.parts[0].is_closed) == (0, True)


def test_an_inside_out_body_is_turned(model_of_all):
    made, model = model_of_all
    k = list(made).index("inside out")
    tracer = Intersector(surfaces_of(model, model.parts[k]), coarse="none")
    hit = tracer.intersect((APART * k + 20, 0, 0), (-1, 0, 0))
    assert hit.t[0] == pytest.approx(8.0, abs=1e-10)  # major 9, minor 3
    assert hit.front_face[0]


def inside_loops(surface, u, v):
    """From the square about the loops, beyond which surfaces go on a little, to the unit square."""
    control = np.concatenate([curve.control for loop in surface.loops for curve in loop])
    low, high = control.min(axis=0), control.max(axis=0)
    return low[0] + u * (high[0] - low[0]), low[1] + v * (high[1] - low[1])


def test_offsets_are_approximated_within_what_is_said(model_of_all):
    made, model = model_of_all
    names = list(made)
    (near,), (basis,) = (
        surfaces_of(model, model.parts[names.index(name)]) for name in ("offset", "Bezier")
    )
    row = model.faces[model.parts[names.index("offset")].faces][0]
    assert (row["kind"], row["exactness"]) == ("offset", "approximated")
    assert 0.0 < row["bound"] <= 1e-4
    u, v = np.random.default_rng(2).random((2, 200))
    basis = basis.transformed(shifted(APART * (names.index("offset") - names.index("Bezier"))))
    at, beside = inside_loops(basis, u, v), inside_loops(near, u, v)
    distance = basis.point(*at) + 0.5 * basis.normal(*at) - near.point(*beside)
    # An estimate by OpenCASCADE: samples may be above it by a little.
    assert np.linalg.norm(distance, axis=1).max() <= 2.0 * row["bound"]


def test_offsets_are_refused_by_default(tmp_path):
    file = shapes.write(shapes.offset_face(0.5), tmp_path / "offset.brep")
    with pytest.raises(ValueError, match=r"1 of 1 faces .*face 0 \(offset\).*approximate="):
        read_cad(file)


def test_faces_of_triangles_are_meshes(model_of_all):
    _, model = model_of_all
    assert model.report["faces"]["mesh"] == {"mesh": 1}
    hit = Intersector(surfaces_of(model, model.parts[-1])).intersect((1, 101, 5), (0, 0, -1))
    assert (hit.t[0], hit.front_face[0]) == (5.0, True)
