"""Judgement of part reports by OpenCASCADE; see `tools/verify_part.py`."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from OCP.Bnd import Bnd_Box
from OCP.BRep import BRep_Builder, BRep_Tool
from OCP.BRepAdaptor import BRepAdaptor_Surface
from OCP.BRepBndLib import BRepBndLib
from OCP.BRepBuilderAPI import BRepBuilderAPI_MakeVertex
from OCP.BRepClass3d import BRepClass3d_SolidClassifier
from OCP.BRepExtrema import BRepExtrema_DistShapeShape
from OCP.BRepGProp import BRepGProp
from OCP.BRepMesh import BRepMesh_IncrementalMesh
from OCP.GeomAbs import GeomAbs_Cylinder, GeomAbs_Sphere, GeomAbs_Torus
from OCP.GeomAPI import GeomAPI_ProjectPointOnSurf
from OCP.gp import gp_Dir, gp_Lin, gp_Pnt, gp_Vec
from OCP.GProp import GProp_GProps
from OCP.IntCurvesFace import IntCurvesFace_ShapeIntersector
from OCP.Interface import Interface_Static
from OCP.STEPControl import STEPControl_AsIs, STEPControl_Reader, STEPControl_Writer
from OCP.TopAbs import TopAbs_FACE, TopAbs_IN, TopAbs_REVERSED, TopAbs_SOLID
from OCP.TopExp import TopExp_Explorer
from OCP.TopLoc import TopLoc_Location
from OCP.TopoDS import TopoDS, TopoDS_Compound
from scipy.spatial import cKDTree

from hybrid_rt import part_report, read_cad
from hybrid_rt.cli.command import say
from hybrid_rt.part.report import PartReport, Report
from proof.cases.known_parts import KnownPart

# Of volumes, areas and moments, relative; of lengths over the size, OpenCASCADE's own tolerances; of draft, degrees.
ALLOWED, NEAR, TURNED = 1e-5, 2e-6, 1e-3
# Samples are antiparallel within 1 degree; points beside edges are this part of a triangle inside.
ALIGNED, BESIDE = np.cos(np.deg2rad(1.0)), 1e-5
# Rays meet walls that lean by less than 85 degrees; points of the cloud; balls that are tried; edges that turn.
GRAZING, CLOUD, BALLS, SHARP = np.cos(np.deg2rad(85.0)), 200_000, 1500, 90.0
UNITS = {"mm": "MM", "inch": "INCH", "m": "M", "cm": "CM"}
PULL = (0.0, 0.0, 1.0)


class Places(NamedTuple):
    """Points of faces, their outward normals, and the faces."""

    points: Any
    normals: Any
    face: Any


class Judge:
    """A solid of a file as OpenCASCADE sees it."""

    def __init__(self, solid: Any, size: float) -> None:
        self.solid, self.size, self.rng = solid, size, np.random.default_rng(3)
        self.faces = [TopoDS.Face(s) for s in _each(solid, TopAbs_FACE)]
        self.surfaces = [BRepAdaptor_Surface(face) for face in self.faces]
        self.sign = [-1.0 if f.Orientation() == TopAbs_REVERSED else 1.0 for f in self.faces]
        BRepMesh_IncrementalMesh(solid, 1e-3 * size, False, 0.2, False)
        self.lines = IntCurvesFace_ShapeIntersector()
        self.lines.Load(solid, 1e-9 * size)
        self.inside = BRepClass3d_SolidClassifier(solid)
        self.triangles = [_triangles(face) for face in self.faces]

    def at(self, face: int, u: float, v: float) -> tuple[Any, Any]:
        """Return a point and its outward normal."""
        p, a, b = gp_Pnt(), gp_Vec(), gp_Vec()
        self.surfaces[face].D1(u, v, p, a, b)
        n = self.sign[face] * np.cross((a.X(), a.Y(), a.Z()), (b.X(), b.Y(), b.Z()))
        return np.array((p.X(), p.Y(), p.Z())), n / max(float(np.linalg.norm(n)), 1e-300)

    def places(self, uv: list[Any]) -> Places:
        """Return places by their (u, v) on each face."""
        rows = [(*self.at(k, *x), k) for k, some in enumerate(uv) for x in some.tolist()]
        p, n, face = zip(*rows, strict=True)
        return Places(np.array(p), np.array(n), np.array(face))

    def samples(self, n: int) -> Places:
        """Return about n places, evenly over the area, and some on each face."""
        areas = np.array([a.sum() for _, a in self.triangles])
        uv = []
        for (corners, area), share in zip(self.triangles, areas / areas.sum(), strict=True):
            k = self.rng.choice(len(area), int(share * n) + 12, p=area / area.sum())
            w = self.rng.dirichlet(np.ones(3), len(k))
            uv.append((corners[k] * w[..., None]).sum(axis=1))
        return self.places(uv)

    def beside_edges(self, n: int) -> Places:
        """Return about n places just inside faces, beside the corners of triangles that are on edges."""
        uv = []
        for corners, _ in self.triangles:
            at = BESIDE * corners.mean(axis=1, keepdims=True) + (1.0 - BESIDE) * corners
            uv.append(at.reshape(-1, 2))
        share = min(n / sum(map(len, uv)), 1.0)
        return self.places([x[self.rng.random(len(x)) < share] for x in uv])

    @cached_property
    def cloud(self) -> tuple[Places, cKDTree]:
        """A dense cloud of points."""
        places = self.samples(CLOUD)
        return places, cKDTree(places.points)

    def near_in_cloud(self, p: Any) -> tuple[float, Any, int]:
        """Return the distance of a point from the cloud, the nearest point, and its face."""
        near, k = self.cloud[1].query(p)
        return float(near), self.cloud[0].points[k], int(self.cloud[0].face[k])

    def leaves(self, p: Any, n: Any) -> tuple[float, Any, int]:
        """Return where the ray along the inward normal leaves: how far off, the normal there, and the face."""
        self.lines.Perform(gp_Lin(gp_Pnt(*p), gp_Dir(*-n)), 1e-6 * self.size, 10.0 * self.size)
        hits = sorted((self.lines.WParameter(i + 1), i + 1) for i in range(self.lines.NbPnt()))
        for t, i in hits:
            face = next(k for k, f in enumerate(self.faces) if f.IsSame(self.lines.Face(i)))
            far = self.at(face, self.lines.UParameter(i), self.lines.VParameter(i))[1]
            if abs(far @ n) >= GRAZING:
                return (t if far @ n < 0.0 else np.inf), far, face
        return np.inf, -n, -1

    def nearest(self, p: Any) -> tuple[float, Any, int]:
        """Return the distance of a point from the surface, the nearest point, and its face."""
        vertex = BRepBuilderAPI_MakeVertex(gp_Pnt(*p.tolist())).Vertex()
        # Of the faces that have what is nearest in the cloud.
        near = np.unique(self.cloud[0].face[self.cloud[1].query(p, 100)[1]]).tolist()
        found = {k: BRepExtrema_DistShapeShape(vertex, self.faces[k]) for k in near}
        k = min(near, key=lambda k: found[k].Value())
        q = found[k].PointOnShape2(1)
        return found[k].Value(), np.array((q.X(), q.Y(), q.Z())), k

    def away(self, p: Any) -> float:
        """Return the distance of a point from the surface."""
        return self.nearest(p)[0]

    def foot(self, face: int, p: Any) -> tuple[float, float]:
        """Return (u, v) of the point of a face's surface that is nearest to a point."""
        surface = BRep_Tool.Surface_s(self.faces[face])
        return GeomAPI_ProjectPointOnSurf(gp_Pnt(*p.tolist()), surface).LowerDistanceParameters()

    def is_inside(self, p: Any) -> bool:
        """Tell whether a point is inside the solid."""
        self.inside.Perform(gp_Pnt(*p.tolist()), 1e-7)
        return bool(self.inside.State() == TopAbs_IN)

    def properties(self, of: Any, shape: Any) -> GProp_GProps:
        """Integrate over a shape."""
        found = GProp_GProps()
        of(shape, found, 1e-8)
        return found


def _each(shape: Any, kind: Any) -> Iterator[Any]:
    found = TopExp_Explorer(shape, kind)
    while found.More():
        yield found.Current()
        found.Next()


def _triangles(face: Any) -> tuple[Any, Any]:
    """Return (u, v) of the corners of triangles, and their areas."""
    mesh = BRep_Tool.Triangulation_s(face, TopLoc_Location())
    uv = np.array([(p.X(), p.Y()) for p in map(mesh.UVNode, range(1, mesh.NbNodes() + 1))])
    xyz = np.array([(p.X(), p.Y(), p.Z()) for p in map(mesh.Node, range(1, mesh.NbNodes() + 1))])
    of = np.array([mesh.Triangle(k + 1).Get() for k in range(mesh.NbTriangles())]) - 1
    a, b, c = (xyz[of[:, k]] for k in range(3))
    return uv[of], np.linalg.norm(np.cross(b - a, c - a), axis=1) + 1e-300


# --- claims


class Claims:
    """What a report claims of a part, and what OpenCASCADE says of it."""

    def __init__(self) -> None:
        self.false: list[str] = []

    def hold(self, what: str, holds: Any, words: str) -> None:
        """Note a claim that does not hold."""
        if not holds:
            self.false.append(f"{what}: {words}")

    def near(self, what: str, own: Any, judged: Any, allowed: float) -> None:
        """Note what is off by more than allowed."""
        off = float(np.abs(np.asarray(own) - np.asarray(judged)).max())
        self.hold(what, off <= allowed, f"{own}, judged {judged}: off by {off:.2g} > {allowed:.2g}")


def judge(part: PartReport, first: int, report: Report, solid: Any, samples: int) -> list[str]:
    """Return what is false in the report of a part, whose faces begin at row ``first``."""
    its, claims, size = Judge(solid, part.size), Claims(), part.size
    _judge_mass(part, its, claims)
    _judge_faces(part, first, its, claims)
    places = its.samples(samples)
    _judge_draft(part, first, places, claims)
    cosine = float(np.cos(np.deg2rad(report.angle)))
    for what, some, least in (
        ("sample", places, ALIGNED),
        ("point beside an edge", its.beside_edges(samples), cosine),
    ):
        _judge_chords(part, first, its, some, least, what, claims)
    _judge_balls(part, first, its, places, cosine, claims)
    for what, found in (("ray", part.ray), ("ball", part.ball)):
        claims.hold(f"{what} bound", found.bound <= found.value, f"{found.bound} > {found.value}")
        if np.isfinite(found.value):
            p, q = found.place
            claims.near(f"{what} place", [its.away(p), its.away(q)], 0.0, NEAR * size)
            along = (p + np.linspace(0.02, 0.98, 9)[:, None] * (q - p)).tolist()
            claims.hold(
                f"{what} place", all(its.is_inside(np.array(x)) for x in along), "leaves the part"
            )
    return claims.false


def _judge_mass(part: PartReport, its: Judge, claims: Claims) -> None:
    size, mass = part.size, part.mass
    # The adaptive rule refines for the volume alone, so that its moments are off by 1e-4: Gauss and Kronrod's.
    volume = GProp_GProps()
    BRepGProp.VolumePropertiesGK_s(its.solid, volume, 1e-8, True, False, True, True, True)
    area = its.properties(BRepGProp.SurfaceProperties_s, its.solid).Mass()
    claims.near("volume", mass.volume, volume.Mass(), ALLOWED * volume.Mass())
    claims.near("area", mass.area, area, ALLOWED * area)
    claims.near("chords", mass.chord_volume, volume.Mass(), mass.chord_error)
    c = volume.CentreOfMass()
    claims.near("center", mass.center, (c.X(), c.Y(), c.Z()), ALLOWED * size)
    m = volume.MatrixOfInertia()
    inertia = np.array([[m.Value(i, j) for j in (1, 2, 3)] for i in (1, 2, 3)])
    claims.near("inertia", mass.inertia, inertia, ALLOWED * np.trace(inertia))
    bounds = Bnd_Box()
    BRepBndLib.AddOptimal_s(its.solid, bounds, False, False)
    low, high = bounds.CornerMin(), bounds.CornerMax()
    corners = np.array([(p.X(), p.Y(), p.Z()) for p in (low, high)])
    # OpenCASCADE's box is wider by its tolerance of 1e-7.
    claims.near("box", part.box.corners, corners, part.box.bound + 1e-7 + 1e-9 * size)


def _judge_faces(part: PartReport, first: int, its: Judge, claims: Claims) -> None:
    rows = {row.face - first: row for row in part.faces}
    claims.hold("faces", sorted(rows) == list(range(len(its.faces))), f"rows are {sorted(rows)}")
    total = part.mass.area
    radii = {}
    for k, face in enumerate(its.faces):
        area = its.properties(BRepGProp.SurfaceProperties_s, face).Mass()
        claims.near(f"area of face {k}", rows[k].area, area, ALLOWED * area + 1e-8 * total)
        kind = its.surfaces[k].GetType()
        radius, surface = np.nan, its.surfaces[k]
        if kind == GeomAbs_Cylinder:
            radius = surface.Cylinder().Radius()
        elif kind == GeomAbs_Sphere:
            radius = surface.Sphere().Radius()
        elif kind == GeomAbs_Torus:
            radius = surface.Torus().MinorRadius()
        radii[k] = radius
        same = np.isnan(radius) or abs(rows[k].radius - radius) <= 1e-9 * radius
        claims.hold(f"radius of face {k}", same, f"{rows[k].radius}, judged {radius}")
    for f in part.features:
        own = [radii[k - first] for k in f.faces]
        claims.near(f"radius of {f.kind}", f.radius, own, 1e-6 * part.size)


def _judge_draft(part: PartReport, first: int, places: Places, claims: Claims) -> None:
    sine = np.rad2deg(np.arcsin(np.clip(places.normals @ PULL, -1.0, 1.0)))
    for row in part.faces:
        own, draft = sine[places.face == row.face - first], row.draft
        if draft is not None:
            within = (
                draft.least_bound - TURNED <= own.min() and own.max() <= draft.most_bound + TURNED
            )
            claims.hold(
                f"draft of face {row.face}", within, f"{draft}, judged {own.min()} to {own.max()}"
            )
            claims.hold(
                f"draft of face {row.face}", draft.least_bound - TURNED <= draft.least, f"{draft}"
            )


def _left_out(part: PartReport, first: int) -> set[tuple[int, int]]:
    """Return pairs of faces that the report names instead of giving their thickness."""
    pairs = [e.faces for e in part.sharp_edges] + [*part.ray.touching, *part.ball.touching]
    return {(min(p) - first, max(p) - first) for p in pairs}


def _judge_chords(
    part: PartReport,
    first: int,
    its: Judge,
    places: Places,
    least: float,
    what: str,
    claims: Claims,
) -> None:
    left_out = _left_out(part, first)
    for p, n, face in zip(*places, strict=True):
        t, far, other = its.leaves(p, n)
        if -far @ n < least or (min(face, other), max(face, other)) in left_out:
            continue
        if t < part.ray.bound - NEAR * part.size:
            words = f"{t} < {part.ray.bound} from face {face} to {other} at {p}, off by {np.rad2deg(np.arccos(-far @ n)):.3g} degrees"
            claims.hold(f"ray of a {what}", False, words)


def _judge_balls(
    part: PartReport, first: int, its: Judge, places: Places, cosine: float, claims: Claims
) -> None:
    left_out = _left_out(part, first)
    some = its.rng.permutation(len(places.points))[:BALLS]
    for p, n, face in zip(*(x[some] for x in places), strict=True):
        r, other, q = 0.5 * min(its.leaves(p, n)[0], part.size), -1, p
        # Points of a cloud make it no smaller than it is; what is too small is shrunk by the solid itself.
        for is_exact in (False, True):
            for _ in range(40):
                near, point, its_face = (
                    its.nearest(p - r * n) if is_exact else its.near_in_cloud(p - r * n)
                )
                way = p - point
                if near >= r * (1.0 - 1e-7) or np.linalg.norm(way) < 1e-3 * r:
                    break
                r, other, q = float(way @ way / (2.0 * (way @ n))), its_face, point
            is_small = 2.0 * r < part.ball.bound - NEAR * part.size
            opposite = other >= 0 and -n @ (q - p + r * n) >= cosine * r
            if not (is_small and opposite and (min(face, other), max(face, other)) not in left_out):
                break
        else:
            words = f"{2 * r} < {part.ball.bound} from face {face} to {other} at {p}"
            claims.hold("ball of a sample", False, words)
    if np.isfinite(part.ball.value):
        p, q = part.ball.place
        r = 0.5 * part.ball.value
        _, _, face = its.nearest(p)
        u, v = its.foot(face, p)
        n = its.at(face, u, v)[1]
        claims.near("ball inside", its.away(p - r * n), r, NEAR * part.size)
        claims.near("ball's other contact", np.linalg.norm(p - r * n - q), r, NEAR * part.size)


# --- parts


def _solids(file: Path, unit: str) -> list[Any]:
    reader = STEPControl_Reader()  # which makes the setting known
    Interface_Static.SetCVal_s("xstep.cascade.unit", UNITS[unit])
    reader.ReadFile(str(file))
    reader.TransferRoots()
    return [TopoDS.Solid(s) for s in _each(reader.OneShape(), TopAbs_SOLID)]


def written(shapes: list[Any], file: Path) -> Path:
    """Write shapes as a STEP file."""
    whole, build = TopoDS_Compound(), BRep_Builder()
    build.MakeCompound(whole)
    for shape in shapes:
        build.Add(whole, shape)
    writer = STEPControl_Writer()
    writer.Transfer(whole if len(shapes) > 1 else shapes[0], STEPControl_AsIs)
    writer.Write(str(file))
    return file


def verify(file: Path, seconds: float, samples: int, known: KnownPart | None = None) -> int:
    """Print a line for each part of a file, and what is false of it; return how many claims are."""
    model = read_cad(file, refuse="skip")
    began, cpu = time.perf_counter(), time.process_time()
    report = part_report(model, pull=PULL, seconds=seconds)
    began, cpu = time.perf_counter() - began, time.process_time() - cpu
    solids = _solids(file, report.unit)
    n_false = 0
    for part in report.parts:
        # The solid of that volume, at that place.
        def off(s: Any, part: PartReport = part) -> float:
            p = GProp_GProps()
            BRepGProp.VolumeProperties_s(s, p)
            c = p.CentreOfMass()
            return float(np.abs(part.mass.center - (c.X(), c.Y(), c.Z())).max()) / part.size

        solid = min(solids, key=off)
        false = judge(part, model.parts[part.part].faces.start, report, solid, samples)
        if known is not None:
            claims, tolerance = Claims(), 2e-6 * part.size
            for what, found, exact, long in zip(
                ("ray", "ball"),
                (part.ray, part.ball),
                (known.ray, known.ball),
                known.takes_long,
                strict=True,
            ):
                claims.hold(
                    f"exact {what}",
                    exact - 1e-8 * part.size <= found.value,
                    f"{found.value} < {exact}",
                )
                claims.hold(
                    f"exact {what}",
                    found.bound <= exact + 1e-9 * part.size,
                    f"{found.bound} > {exact}",
                )
                claims.hold(
                    f"exact {what}",
                    long or found.value <= exact + tolerance,
                    f"{found.value} > {exact}",
                )
            claims.near("exact volume", part.mass.volume, known.volume, 1e-9 * known.volume)
            claims.near(
                "exact box",
                np.diff(part.box.corners, axis=0)[0],
                known.sides,
                part.box.bound * 2 + 1e-9 * part.size,
            )
            false += claims.false
        say(
            f"{(known.name if known else file.stem):28} {len(part.faces):4} faces, size {part.size:9.4f} | ray {_words(part.ray)} | "
            f"ball {_words(part.ball)} | volume {part.mass.volume:.8g} | whole {began:5.1f} s, {cpu:5.1f} cpu | {len(false)} false"
        )
        for line in false[:12]:
            say(f"    FALSE {line}")
        n_false += len(false)
    for c in report.clearances:
        say(f"    clearance {c.parts}: {_words(c.found)}")
    return n_false


def _words(found: Any) -> str:
    n = len(found.touching)
    return f"{found.value:11.7f} >= {found.bound:11.7f} {'proven' if found.is_proven else 'open  '} {found.seconds:5.1f} s {n or ''}"
