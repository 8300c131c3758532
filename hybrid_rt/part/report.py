"""The part report: what is asked of a CAD part, each answer with how sure it is."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from itertools import combinations
from typing import Any

import numpy as np

from hybrid_rt.cad.model import CadModel
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.core.progress import Progress
from hybrid_rt.core.records import FloatArray
from hybrid_rt.part.clearance import least_clearance
from hybrid_rt.part.extremes import Box, Draft, box_of, drafts_of
from hybrid_rt.part.features import Feature, features_of, shape_of
from hybrid_rt.part.mass import Mass, mass_of
from hybrid_rt.part.mesh_study import MeshRow, mesh_rows
from hybrid_rt.part.pairs import Found, Heard
from hybrid_rt.part.walls import Walls
from hybrid_rt.primitives.instances import Instances
from meshing import TrimmedSurface
from meshing.checks import as_direction, number
from meshing.surface import box_around

# Tolerances of answers over the size: thickness and clearance, box; drafts, radians.
FINE, BOXED, TURNED_BY = 1e-6, 1e-9, 1e-4


@dataclass(frozen=True)
class SharpEdge:
    """Faces that meet in an edge sharper than a right angle: there the thickness falls to 0."""

    faces: tuple[int, int]
    angle: float  # degrees, the least
    place: FloatArray


@dataclass(frozen=True)
class FaceRow:
    """What is known of a face of the file.

    Attributes
    ----------
    face : int
        Row of `CadModel.faces`.
    kind : str
    area : float
    radius : float
        Of a cylinder, of a sphere, of the tube of a torus; nan of others.
    thickness, ball : float
        The least of the samples, along normals and of balls inside; nan: none has an opposite wall.
    draft : Draft or None
        Degrees, if a pull direction was given.
    undercut : float
        Part of the samples that the part itself keeps from being pulled out either way; nan: not asked.
    """

    face: int
    kind: str
    area: float
    radius: float
    thickness: float
    ball: float
    draft: Draft | None
    undercut: float


@dataclass(frozen=True)
class PartReport:
    """Answers about one closed part.

    Attributes
    ----------
    name : str
    part : int
        Row of `CadModel.parts`: the first place of its shape.
    places : int
        How often it is placed.
    size : float
        Diagonal, in the unit of the model.
    mass : Mass
    box : Box
    ray, ball : Found
        Least thickness along inward normals, and least diameter of balls inside with opposite contacts.
    sharp_edges : list of SharpEdge
    faces : list of FaceRow
    features : list of Feature
    meshes : list of MeshRow
        How wrong the same answers are on meshes; empty if not asked.
    """

    name: str
    part: int
    places: int
    size: float
    mass: Mass
    box: Box
    ray: Found
    ball: Found
    sharp_edges: list[SharpEdge]
    faces: list[FaceRow]
    features: list[Feature]
    meshes: list[MeshRow]


@dataclass(frozen=True)
class Clearance:
    """How near two parts come to each other."""

    parts: tuple[int, int]
    found: Found


@dataclass(frozen=True)
class Report:
    """What `part_report` returns.

    Attributes
    ----------
    unit : str
        Of lengths.
    angle : float
    pull : (3,) unit vector or None
    parts : list of PartReport
        Of closed parts, each shape once.
    clearances : list of Clearance
    skipped : list of str
        Which parts are not reported on, and why.
    walls : list of Walls
        Of the parts, for pictures and maps.
    """

    unit: str
    angle: float
    pull: tuple[float, ...] | None
    parts: list[PartReport]
    clearances: list[Clearance]
    skipped: list[str]
    walls: list[Walls] = field(default_factory=list, repr=False)

    def to_json(self) -> str:
        """Return all of it as JSON."""
        return as_json({f.name: getattr(self, f.name) for f in fields(self) if f.name != "walls"})

    def to_csv(self) -> str:
        """Return a table of all faces."""
        text = io.StringIO(newline="")
        rows = csv.writer(text, lineterminator="\n")
        names = ["face", "kind", "area", "radius", "thickness", "ball"]
        drafts = ["draft_least", "draft_most", "draft_least_bound", "draft_most_bound"]
        rows.writerow(["part", *names, *drafts, "undercut"])
        for part in self.parts:
            for row in part.faces:
                draft = row.draft or [np.nan] * 4
                own = [getattr(row, name) for name in names]
                rows.writerow([part.part, *own, *draft, row.undercut])
        return text.getvalue()


def part_report(
    model: CadModel,
    *,
    pull: Sequence[float] | None = None,
    angle: float = 20.0,
    seconds: float = 60.0,
    clearances: bool = True,
    meshes: bool = False,
    threads: int | None = None,
    progress: Progress | None = None,
) -> Report:
    """Report on the closed parts of a CAD model: volume, box, thickness, clearance, draft, holes and fillets.

    Parameters
    ----------
    model : CadModel
        What `read_cad` returns. Open parts, and those with faces of triangles, are skipped and named.
    pull : (3,) direction, optional
        In which the part leaves its mould: asks for draft angles and undercuts.
    angle : float, degrees
        Walls are opposite if their normals differ by at most so much from antiparallel.
    seconds : float
        For each of both searches for the least thickness, and for each pair of parts.
    clearances : bool
        Of all pairs of parts whose boxes come nearer than their size.
    meshes : bool
        Whether the same answers are taken from meshes, too.
    threads : int, optional
    progress : Progress, optional
        Called with a stage, the thousandths of its time that a search has taken, and 1000.

    Returns
    -------
    Report

    Raises
    ------
    ValueError, TypeError
        For a model without closed parts, and wrong arguments.
    """
    if not isinstance(model, CadModel):
        raise TypeError(f"part_report model is {type(model).__name__}: pass what read_cad returns")
    way = None if pull is None else as_direction(pull, "part_report pull")
    turned = np.deg2rad(
        number(angle, "part_report angle", above=0.0, up_to=85.0, hint="in degrees")
    )
    limit = number(seconds, "part_report seconds", above=0.0)
    skipped, bodies = [], {}
    for k, part in enumerate(model.parts):
        surfaces, faces = surfaces_of_part(model, k)
        if not part.is_closed:
            skipped.append(f"part {k} ({part.name or 'no name'}): it is open")
        elif not all(isinstance(surface, TrimmedSurface) for surface in surfaces):
            skipped.append(f"part {k} ({part.name or 'no name'}): it has faces of triangles")
        else:
            bodies[k] = surfaces, faces
    if not bodies:
        raise ValueError(
            f"part_report: no part can be reported on ({'; '.join(skipped)}): close it, or sew its faces"
        )
    reports: list[PartReport] = []
    every: list[Walls] = []
    seen: dict[tuple[int, bool, float], int] = {}
    for k, (surfaces, faces) in bodies.items():
        part = model.parts[k]
        key = part.shape, part.is_mirrored, round(part.scale, 9)
        if key in seen:
            continue
        seen[key] = k
        same = [p for p in model.parts if (p.shape, p.is_mirrored, round(p.scale, 9)) == key]
        walls = Walls(surfaces, turned, threads)
        every.append(walls)
        reports.append(_report(model, k, len(same), walls, faces, way, limit, meshes, progress))
    return Report(
        model.report["unit"], angle, None if way is None else tuple(way.tolist()), reports,
        _clearances(bodies, limit, threads, progress) if clearances else [], skipped, every,
    )  # fmt: skip


def surfaces_of_part(model: CadModel, part: int) -> tuple[list[TrimmedSurface], list[int]]:
    """Return the surfaces of a part where it is placed, and the row in `CadModel.faces` of each."""
    owners, found, rows = model.owners, [], []
    for i, surface in enumerate(model.surfaces):
        mine = np.flatnonzero(
            owners.part[owners.first_place[i] : owners.first_place[i + 1]] == part
        )
        if not len(mine):
            continue
        own = surface.surface_in(int(mine[0])) if isinstance(surface, Instances) else [surface]
        first = owners.first_patch[i] + np.cumsum([0, *map(len, own)])[:-1]
        found += own
        rows += owners.face[first].tolist()
    return found, rows  # type: ignore[return-value]


def _report(
    model: CadModel, k: int, places: int, walls: Walls, faces: list[int], pull: FloatArray | None, seconds: float, meshes: bool,
    progress: Progress | None,
) -> PartReport:  # fmt: skip
    size, part = walls.size, model.parts[k]
    box = box_of(walls.cells, walls.roots, size, BOXED * size)
    mass, areas = mass_of(walls.solid, walls.tracer, box.corners)
    ray = walls.least_ray(FINE * size, seconds, _heard(progress, f"Thickness of part {k}"))
    ball = walls.least_ball(FINE * size, seconds, _heard(progress, f"Balls of part {k}"))
    edges = [
        SharpEdge((faces[a], faces[b]), float(np.rad2deg(j.least)), j.place)
        for (a, b), j in walls.sharp.items()
    ]
    for found in (ray, ball):
        found.faces = tuple(faces[i] if i >= 0 else -1 for i in found.faces)  # type: ignore[assignment]
        found.touching = {(faces[a], faces[b]): place for (a, b), place in found.touching.items()}
    features = [
        Feature(f.kind, f.radius, tuple(faces[i] for i in f.faces), f.axis, f.depth, f.end)
        for f in features_of(walls)
    ]
    rows = _face_rows(model, walls, faces, areas, pull)
    table = mesh_rows(walls, mass.volume, ray) if meshes else []
    return PartReport(
        part.name, k, places, size, mass, box, ray, ball, edges, rows, features, table
    )


def _face_rows(
    model: CadModel, walls: Walls, faces: list[int], areas: FloatArray, pull: FloatArray | None
) -> list[FaceRow]:
    """Return a row for each face of the file."""
    p, n, own, _ = walls.sampled
    t, ball = walls.sampled_thickness, walls.sampled_balls[0]
    undercut = np.full(len(p), np.nan)
    drafts: list[Draft] = []
    if pull is not None:
        drafts = drafts_of(walls.cells, walls.roots, walls.solid, pull, TURNED_BY)
        undercut = walls.are_undercut(p, n, pull).astype(np.float64)
    rows = []
    of_row = np.array(faces)[own]
    for face in sorted(set(faces)):
        mine = of_row == face
        draft = None
        if drafts:
            low = np.array([drafts[i] for i, f in enumerate(faces) if f == face])
            least, most = low.min(axis=0), low.max(axis=0)
            draft = Draft(*np.rad2deg([least[0], most[1], least[2], most[3]]).tolist())
        part = float(undercut[mine].mean()) if mine.any() else np.nan
        kind = str(model.faces["kind"][face])
        some = [i for i, f in enumerate(faces) if f == face]
        shape = shape_of(walls.solid.surfaces[some[0]].surface)
        rows.append(FaceRow(
            face, kind, float(areas[some].sum()), np.nan if shape is None else shape.radius,
            _least(t[mine]), _least(ball[mine]), draft, part,
        ))  # fmt: skip
    return rows


def _least(values: FloatArray) -> float:
    """Return the least finite one; nan if there is none."""
    return float(values[np.isfinite(values)].min()) if np.isfinite(values).any() else np.nan


def _heard(progress: Progress | None, stage: str) -> Heard:
    """Return what tells how much of its time a search has taken."""
    if progress is None:
        return None
    progress(stage, 0, 0)
    return lambda share: progress(stage, min(int(1000 * share), 1000), 1000)


def _clearances(
    bodies: dict[int, Any], seconds: float, threads: int | None, progress: Progress | None
) -> list[Clearance]:
    """Return the clearances of parts whose boxes come nearer than the smaller one's size."""
    boxes = {}
    for k, (surfaces, _) in bodies.items():
        boxes[k] = box_around(np.array([surface.bounds for surface in surfaces]))
    found = []
    for a, b in combinations(bodies, 2):
        apart = np.maximum(boxes[a][0] - boxes[b][1], boxes[b][0] - boxes[a][1])
        sizes = [float(np.linalg.norm(high - low)) for low, high in (boxes[a], boxes[b])]
        if np.linalg.norm(np.maximum(apart, 0.0)) <= min(sizes):
            one, other = bodies[a][0], bodies[b][0]
            heard = _heard(progress, f"Clearance of parts {a} and {b}")
            least = least_clearance(one, other, FINE * max(sizes), seconds, threads, heard)
            found.append(Clearance((a, b), least))
    return found
