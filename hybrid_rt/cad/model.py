"""Models of CAD files: their parts, where they are placed, and the surfaces that rays meet."""

from __future__ import annotations

import logging
import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.cad import edges as edges_of
from hybrid_rt.cad.faces import Part, Raw, parts_of
from hybrid_rt.cad.loops import Arc
from hybrid_rt.cad.pairs import in_pairs
from hybrid_rt.cad.process import arrays_of
from hybrid_rt.cad.records import KINDS, MM
from hybrid_rt.core import checks
from hybrid_rt.core.records import BoolArray, HitRecord, IntArray
from hybrid_rt.intersection.crossings import Crossings
from hybrid_rt.primitives import TriangleMesh
from hybrid_rt.primitives.instances import Instances
from meshing import TrimmedSurface
from meshing.checks import FloatArray, as_path, number, text_of
from meshing.surface import Surface, box_around

if TYPE_CHECKING:
    from hybrid_rt.distance.record import ClosestRecord
    from hybrid_rt.materials.material import Material
    from hybrid_rt.scene.scene import Scene

LOG = logging.getLogger(__name__)
EXACT, APPROXIMATED, REFUSED, MESH = "exact", "approximated", "refused", "mesh"
FACE = np.dtype([
    ("shape", "i4"), ("kind", "U10"), ("exactness", "U12"), ("bound", "f8"), ("gap_measured", "f8"),
    ("gap_declared", "f8"), ("is_reversed", "?"), ("color", "f8", 3), ("surfaces", "i4"),
    ("free_edges", "i4"),
])  # fmt: skip
# Points of a surface are those of OpenCASCADE up to this part of the size of what they are on, or it is refused.
AGREES = 1e-6
# Of the samples of an edge every such one is looked at; their (u, v) are rounded.
CHECKED, ROUNDING = 16, 1e-7
# A gap below this part of a part's size is rounding: where edges agree to so much, both faces are widened by it.
LEAST_GAP = 1e-9
# How many gaps a report lists, and how many refused faces a message.
LISTED, NAMED = 20, 3
# Up to so many places of a shape are copies: rays take less long than with instances, and tables little more.
COPIES = 3
# What a system can be asked for: seconds, and gigabytes of address space.
LONGEST_READING, LEAST_MEMORY, MOST_MEMORY = 1e7, 1e-3, 1e9
GREY = (0.55, 0.55, 0.55)


@dataclass(frozen=True, slots=True)
class CadPart:
    """A shape of a CAD file where it is placed.

    Attributes
    ----------
    name, instance : str
        Of the shape, and of the places in the tree of assemblies that lead to it.
    color : (3,) tuple of float, or None
        Linear RGB; that of the nearest of part, instance and assembly that has one.
    transform : (4, 4) float64
        From the shape to the model.
    is_closed : bool
        Whether every edge is shared by two faces, none of which is refused.
    shape : int
        Number of the shape; parts with the same one are copies.
    faces : slice
        Of the rows of `CadModel.faces`; those of copies are the same.
    """

    name: str
    instance: str
    color: tuple[float, float, float] | None
    transform: FloatArray
    is_closed: bool
    shape: int
    faces: slice

    @property
    def is_mirrored(self) -> bool:
        """Whether it is placed by a reflection."""
        return bool(np.linalg.det(self.transform[:3, :3]) < 0.0)

    @property
    def scale(self) -> float:
        """Lengths of the model per length of the shape."""
        return float(np.cbrt(abs(np.linalg.det(self.transform[:3, :3]))))


class Owners(NamedTuple):
    """Whose the patches and places of each surface of a model are; the last is none, for misses."""

    first_patch: NDArray[np.int64]  # of one place; where they begin in ``face``
    face: IntArray
    first_place: NDArray[np.int64]
    part: IntArray


@dataclass(frozen=True)
class CadModel:
    """What `read_cad` returns.

    Attributes
    ----------
    surfaces : list of Surface
        For an `Intersector`, or objects of a scene. A shape in more than three places is an `Instances`
        for each colour, with one table for all places (and one for the mirrored ones).
    owners : Owners
        What `face_at` and `part_at` look up.
    parts : list of CadPart
    faces : structured array, a row for each face of each shape, in the order of the file
        ``shape``, ``kind`` ("plane", "cylinder" ...), ``exactness`` ("exact", "approximated", "refused",
        "mesh"), ``bound`` (of what is approximated: distance, an estimate), ``gap_measured`` and
        ``gap_declared`` (largest distance from a neighbour along a shared edge, and the file's
        tolerance), ``is_reversed`` (normal against S_u x S_v of the file), ``color`` (linear RGB, nan
        if there is none), ``surfaces`` (how many it became), ``free_edges``. Lengths are those at the
        largest place of the shape.
    report : dict
        ``unit``, ``parts``, ``shapes``, ``faces`` (kind -> exactness -> count), ``gaps`` (largest first:
        gap, both faces), ``free_edges``, ``open_solids`` (of a STEP file: solids that came without all of
        their faces), ``refused`` (face, kind, reason), ``wires`` and ``points`` outside faces, which are
        ignored.
    bounds : (2, 3) float64
        Lower and upper corner of a box about what is inside the loops, from samples: it may be too small by a
        thousandth of its size. A part report has the proven box.
    """

    surfaces: list[Surface]
    owners: Owners
    parts: list[CadPart]
    faces: NDArray[Any]
    report: dict[str, Any]
    bounds: FloatArray

    def __repr__(self) -> str:
        """Count parts, faces and surfaces."""
        counts = Counter(self.faces["exactness"].tolist())
        words = ", ".join(f"{n} {name}" for name, n in counts.items())
        return f"CadModel({len(self.parts)} parts, {len(self.faces)} faces: {words}; unit {self.report['unit']})"

    @property
    def closed(self) -> BoolArray:
        """(surfaces,) bool: those that bound closed parts, as `ClosestPoint` takes them."""
        is_closed = np.array([part.is_closed for part in self.parts], np.bool_)
        return is_closed[self.owners.part[self.owners.first_place[: len(self.surfaces)]]]

    def face_at(self, hits: HitRecord | ClosestRecord) -> IntArray:
        """Return the row of `faces` of each hit, or closest point, on `surfaces`; -1 on a miss, and on what comes after them."""
        first, row = self.owners.first_patch, self._objects(hits)
        face: IntArray = self.owners.face[first[row] + hits.patch_id % np.diff(first)[row]]
        return face

    def part_at(self, hits: HitRecord | ClosestRecord) -> IntArray:
        """Return the number in `parts` of each hit, as `face_at` does."""
        row = self._objects(hits)
        place = np.where(row < len(self.surfaces), hits.instance_id, 0)
        part: IntArray = self.owners.part[self.owners.first_place[row] + np.maximum(place, 0)]
        return part

    def _objects(self, hits: HitRecord | ClosestRecord) -> IntArray:
        n = len(self.surfaces)
        of: IntArray = np.where((hits.object_id >= 0) & (hits.object_id < n), hits.object_id, n)
        return of

    def faces_in_places(self) -> list[Surface]:
        """Return the faces with an exact or approximated surface, in all places: for `tessellate`."""
        found: list[Surface] = []
        for one in self.surfaces:
            if isinstance(one, Instances):
                found += [s for k in range(len(one.matrices)) for s in one.surface_in(k)]
            else:
                found.append(one)
        return [surface for surface in found if isinstance(surface, TrimmedSurface)]

    def paired(self, crossings: Crossings) -> tuple[Crossings, BoolArray]:
        """Return crossings of `surfaces` with entries and exits of closed parts in turn.

        Rows within the gap of an edge may be there twice, once for each face, and TANGENT ones may be there or
        not: the fewest of these are left out that it takes. Nothing is promised of open parts, whose rows stay.

        Returns
        -------
        Crossings
        is_paired : (n,) bool
            Of rays for which leaving out is not enough, all rows stay, and this is False.
        """
        closed = np.array([part.is_closed for part in self.parts])
        part = self.part_at(crossings.hits)
        return in_pairs(crossings, np.where(closed[part], part, -1))

    def scene(
        self,
        *,
        material: Material | None = None,
        look_along: Sequence[float] = (-1.0, 1.4, -0.9),
        width: int = 960,
        height: int = 720,
        ground: bool = True,
    ) -> Scene:
        """Return a scene of the model in the colours of the file, with a ground and a sky.

        Parameters
        ----------
        material : Material, optional
            Of all faces; by default Lambertian in the colour of face or part, grey if there is none.
        look_along : (3,) direction in which the camera looks; z is up
        width, height : int, pixels
        ground : bool
            Whether the model stands on a plane.
        """
        from hybrid_rt.lights import GradientSky, RectangleLight
        from hybrid_rt.materials import Lambertian
        from hybrid_rt.primitives import Rectangle
        from hybrid_rt.scene.scene import Object, Scene
        from hybrid_rt.sensor.camera import Camera

        low, high = self.bounds
        middle, size = 0.5 * (low + high), float(np.linalg.norm(high - low))
        way = np.array(look_along, np.float64)
        way /= np.linalg.norm(way)
        camera = Camera(
            middle - 1.5 * size * way,
            middle,
            (0, 0, 1),
            vertical_fov=32.0,
            width=width,
            height=height,
        )
        made: dict[tuple[float, ...], Material] = {}
        objects = []
        whose = zip(self.surfaces, self.owners.first_patch, self.owners.first_place, strict=False)
        for surface, patch, place in whose:
            face, part = self.owners.face[patch], self.parts[self.owners.part[place]]
            rgb = _rgb(self.faces["color"][face]) or part.color or GREY
            look = material or made.setdefault(rgb, Lambertian(np.clip(rgb, 0.0, 0.9)))
            words = "in places" if isinstance(surface, Instances) else f"face {face}"
            objects.append(Object(surface, look, f"{part.name or 'part'}, {words}"))
        if ground:
            corner = np.array([middle[0] - 20 * size, middle[1] - 20 * size, low[2] - 1e-3 * size])
            side = 40 * size
            objects.append(
                Object(Rectangle(corner, (side, 0, 0), (0, side, 0)), Lambertian(0.4), "ground")
            )
        lamp = middle + size * np.array([-0.9, -0.9, 2.2])
        edge = 0.5 * size
        light = RectangleLight(lamp, (0, edge, 0), (edge, 0, 0), 22.0)
        return Scene(camera, objects, [light], GradientSky(0.25, 0.8, up=(0, 0, 1)))


def read_cad(
    path: str | os.PathLike[str],
    unit: str = "file",
    *,
    sew: float | None = None,
    refuse: str = "error",
    approximate: float | None = None,
    seconds: float = 600.0,
    gigabytes: float = 16.0,
) -> CadModel:
    """Read a CAD file: STEP, IGES or BREP. Its faces are met as they are, not as triangles.

    Exact are planes, cylinders, cones, spheres, tori, surfaces of revolution, extrusions, Bezier and
    B-spline faces, with the curves that trim them in the (u, v) of the file. OpenCASCADE reads the file in a
    process of its own.

    Parameters
    ----------
    path : str or path
        .step, .stp, .iges, .igs or .brep.
    unit : {"file", "mm", "cm", "m", "inch", "ft", "um", "km"}
        Of all lengths of the model. BREP files name none: they count as mm.
    sew : float, optional
        Join faces whose edges are nearer to each other than this, as those of IGES files; file's unit.
    refuse : {"error", "skip"}
        What becomes of faces that have no form here: an error, or they are left out and reported.
    approximate : float, optional
        Replace offset surfaces by splines within this distance, in the unit of the file; OpenCASCADE
        estimates the error. By default such faces are refused.
    seconds, gigabytes : float
        What reading may take, and the address space of its process.

    Returns
    -------
    CadModel

    Raises
    ------
    FileNotFoundError, ValueError, TimeoutError, ImportError, TypeError
        One sentence that names the file and the cause.
    """
    file = as_path(path, "CAD file")
    checks.choice(unit, "read_cad unit", ("file", *MM))
    checks.choice(refuse, "read_cad refuse", ("error", "skip"))
    options: dict[str, Any] = {"unit": unit, "sew": None, "approximate": None}
    for name, value in (("sew", sew), ("approximate", approximate)):
        if value is not None:
            options[name] = number(value, f"read_cad {name}", above=0.0)
    limits = (
        number(seconds, "read_cad seconds", above=0.0, up_to=LONGEST_READING),
        number(gigabytes, "read_cad gigabytes", at_least=LEAST_MEMORY, up_to=MOST_MEMORY),
    )
    arrays = arrays_of(file, options, *limits)
    model = _model_of(arrays)
    if number_open := model.report["open_solids"]:
        LOG.warning(
            "CAD file %r: %d of its solids are not closed: faces are missing in the file, or OpenCASCADE could not "
            "read them (%d edges have a single face)", str(file), number_open, model.report["free_edges"],
        )  # fmt: skip
    if refuse == "error" and (refused := model.report["refused"]):
        named = "; ".join(f"face {r['face']} ({r['kind']}): {r['reason']}" for r in refused[:NAMED])
        raise ValueError(
            f"CAD file {str(file)!r}: {len(refused)} of {len(model.faces)} faces have no exact form here ({named}"
            f"{'; ...' if len(refused) > NAMED else ''}): pass refuse='skip' to leave them out"
        )
    return model


def _model_of(arrays: dict[str, Any]) -> CadModel:
    """Return the model of what the child process has written."""
    head, raw, uses = arrays["head"], arrays["faces"], arrays["uses"]
    shared = edges_of.measured(uses, arrays["xyz"], len(raw))
    gaps, declared = edges_of.gaps_of_faces(shared, len(raw))
    built = _built(arrays, shared.of_use)
    parts, box = _parts(head, built, shared.n_free, arrays["xyz"], uses["face"])
    scale = np.zeros(len(head["shapes"]))
    for part in parts:
        scale[part.shape] = max(scale[part.shape], part.scale)
    scale = scale[raw["shape"]]
    faces = np.zeros(len(raw), FACE)
    for name in ("shape", "color"):
        faces[name] = raw[name]
    faces["kind"] = np.array(KINDS)[raw["kind"]]
    faces["is_reversed"], faces["free_edges"] = raw["reversed"], shared.n_free
    faces["bound"], faces["gap_measured"] = raw["bound"] * scale, gaps * scale
    faces["gap_declared"] = declared * scale
    faces["surfaces"] = [len(face.surfaces) for face in built]
    faces["exactness"] = np.select(
        [faces["surfaces"] == 0, faces["kind"] == "mesh", raw["bound"] > 0.0],
        [REFUSED, MESH, APPROXIMATED], EXACT,
    )  # fmt: skip
    counts: dict[Any, Counter[Any]] = {}
    for kind, exactness in faces[["kind", "exactness"]].tolist():
        counts.setdefault(kind, Counter())[exactness] += 1
    gap = shared.gap * scale[shared.face[:, 0]]
    report = {
        "unit": head["unit"], "parts": len(parts), "shapes": len({part.shape for part in parts}),
        "closed_parts": sum(part.is_closed for part in parts), "open_solids": head["open_solids"],
        "faces": {kind: dict(of) for kind, of in counts.items()},
        "gaps": [
            {"gap": float(gap[e]), "faces": shared.face[e].tolist(),
             "declared": float(shared.declared[e] * scale[shared.face[e, 0]])}
            for e in np.argsort(-gap, kind="stable")[:LISTED].tolist()
        ],
        "free_edges": int(shared.n_free.sum()),
        "refused": [
            {"face": k, "kind": KINDS[raw["kind"][k]], "reason": face.reason}
            for k, face in enumerate(built) if not face.surfaces
        ],
        "wires": head["wires"], "points": head["points"],
    }  # fmt: skip
    return CadModel(*_placed(parts, built, faces["color"]), parts, faces, report, box)


class _Built(NamedTuple):
    """What became of a face: its surfaces, or why it has none, and points of it that edges do not show."""

    surfaces: list[Surface]
    reason: str
    points: FloatArray


def _parts(
    head: dict[str, Any], built: list[_Built], n_free: NDArray[np.int64], xyz: FloatArray, face: NDArray[np.int32]
) -> tuple[list[CadPart], FloatArray]:  # fmt: skip
    """Return the parts, and a box around them."""
    points, closed = [], []
    for shape in head["shapes"]:
        begin, end = shape["faces"]
        mine = slice(*np.searchsorted(face, (begin, end)))  # they are in that order
        points.append(
            np.concatenate([xyz[mine].reshape(-1, 3), *(f.points for f in built[begin:end])])
        )
        closed.append(not n_free[begin:end].any() and all(f.surfaces for f in built[begin:end]))
    parts, boxes = [], [np.zeros((2, 3))]
    matrices = np.array([placed["matrix"] for placed in head["placed"]])
    for placed, matrix in zip(head["placed"], matrices, strict=True):
        faces, shape = slice(*head["shapes"][placed["shape"]]["faces"]), placed["shape"]
        if faces.start == faces.stop:
            continue  # wires and points only
        color = None if placed["color"] is None else tuple(placed["color"])
        parts.append(CadPart(
            placed["name"], placed["instance"], color, matrix, closed[shape], shape, faces
        ))  # fmt: skip
        if len(points[shape]):
            corners = points[shape] @ matrix[:3, :3].T + matrix[:3, 3]
            boxes.append(np.stack([corners.min(axis=0), corners.max(axis=0)]))
    box = np.array(boxes[len(boxes) > 1 :])
    return parts, box_around(box)


def _placed(
    parts: list[CadPart], built: list[_Built], color: FloatArray
) -> tuple[list[Surface], Owners]:
    """Return the surfaces, and whose they are: `Instances` of shapes in more than `COPIES` places."""

    @cache
    def outward(row: int, is_mirrored: bool) -> list[Surface]:
        found = built[row].surfaces
        return [surface.flipped() for surface in found] if is_mirrored else found

    counts = Counter((part.shape, part.is_mirrored) for part in parts)
    groups: dict[tuple[Any, ...], tuple[list[int], list[int]]] = {}
    for k, part in enumerate(parts):
        form = part.shape, part.is_mirrored
        rows = list(range(part.faces.start, part.faces.stop))
        if counts[form] <= COPIES:
            groups |= {(k, row): ([row], [k]) for row in rows}
            continue
        by_color: dict[Any, list[int]] = {}
        for row in rows:
            by_color.setdefault(_rgb(color[row]), []).append(row)
        for own, some in by_color.items():
            key = (*form, own, part.color if own is None else None)
            groups.setdefault(key, (some, []))[1].append(k)
    surfaces: list[Surface] = []
    owned: list[tuple[NDArray[Any], list[int]]] = []
    for rows, numbers in groups.values():
        part = parts[numbers[0]]
        found = [(row, one) for row in rows for one in outward(row, part.is_mirrored)]
        if counts[part.shape, part.is_mirrored] <= COPIES:
            matrix = part.transform
            is_moved = (matrix != np.eye(4)).any()
            surfaces += [one.transformed(matrix) if is_moved else one for _, one in found]
            owned += [(np.full(len(one), row), numbers) for row, one in found]
        elif found:
            of, members = zip(*found, strict=True)
            surfaces.append(Instances(members, [parts[k].transform for k in numbers]))
            owned.append((np.repeat(of, [len(one) for one in members]), numbers))
    owned.append((np.array([-1]), [-1]))  # of misses
    (first_patch, face), (first_place, part_of) = (
        (np.cumsum([0, *map(len, each)]), np.concatenate(each).astype(np.int32))
        for each in zip(*owned, strict=True)
    )
    return surfaces, Owners(first_patch, face, first_place, part_of)


def _rgb(color: FloatArray) -> tuple[float, ...] | None:
    return tuple(color.tolist()) if np.isfinite(color).all() else None


def _built(arrays: dict[str, Any], gaps: FloatArray) -> list[_Built]:
    """Return what becomes of each face; ``gaps`` are those of uses."""
    raw, uses, xyz = arrays["faces"], arrays["uses"], arrays["xyz"]
    of_face = np.searchsorted(uses["face"], np.arange(len(raw) + 1))  # they are in that order
    built = []
    for row, begin, end in zip(raw, of_face, of_face[1:], strict=False):
        found, reason, points = list[Surface](), str(row["reason"]), np.empty((0, 3))
        if not reason:
            try:
                mine = [each[begin:end] for each in (gaps, uses, arrays["uv"], xyz)]
                found, points = _surfaces(row, arrays["numbers"], *mine)
            except (ValueError, TypeError) as error:
                reason = text_of(error)
        built.append(_Built(found, reason, points))
    return built


def _surfaces(
    row: Any,
    numbers: FloatArray,
    gaps: FloatArray,
    uses: NDArray[Any],
    uv: FloatArray,
    xyz: FloatArray,
) -> tuple[list[Surface], FloatArray]:
    """Return the surfaces of a face, compared with OpenCASCADE's, and points of it."""
    kind, own, bound = KINDS[row["kind"]], numbers[row["at"] :], float(row["bound"])
    if kind == "mesh":
        n, m = row["size"][:2].tolist()
        sides = own[3 * n : 3 * (n + m)].reshape(m, 3).astype(np.int64)
        mesh = TriangleMesh(_Triangles(own[: 3 * n].reshape(n, 3), sides))  # type: ignore[arg-type]
        return [mesh.flipped() if row["reversed"] else mesh], mesh.vertices
    size = float(np.ptp(xyz.reshape(-1, 3), axis=0).max(initial=0.0))
    gaps = np.maximum(edges_of.BETWEEN * gaps, LEAST_GAP * size) + bound
    wires, widest = _wires(uses, numbers, xyz, gaps), float(gaps.max(initial=0.0))
    face = Raw(kind, bool(row["reversed"]), row["size"].tolist(), own, wires, widest)
    parts = parts_of(face)
    found: list[Surface] = [part.trimmed(face) for part in parts]
    if (jump := max(part.jump() for part in parts)) > AGREES * size:
        raise ValueError(f"a loop jumps by {jump:.3g} where it has no edge")
    if (off := _off(parts, uv, xyz)) > AGREES * size + 2.0 * bound:
        how = f"is {off:.3g} from OpenCASCADE's" if np.isfinite(off) else "ends before its edges do"
        raise ValueError(f"its surface {how}")
    return found, np.concatenate([part.extremes() for part in parts])


@dataclass(frozen=True)
class _Triangles:
    vertices: FloatArray
    faces: NDArray[np.int64]


def _wires(
    uses: NDArray[Any], numbers: FloatArray, xyz: FloatArray, gaps: FloatArray
) -> list[list[Arc]]:
    """Return the arcs of each wire of a face."""
    wires: dict[int, list[Arc]] = {}
    for row, both, gap in zip(uses, xyz[:, [0, -1]], gaps.tolist(), strict=True):
        n, degree, at = int(row["points"]), int(row["degree"]), int(row["at"])
        points = numbers[at : at + 2 * n].reshape(n, 2)
        weights, knots = None, None
        at += 2 * n
        if row["rational"]:
            weights, at = numbers[at : at + n], at + n
        if degree > 1 or n > 2:
            knots = numbers[at : at + n + degree + 1]
        ends = both[::-1] if row["reversed"] else both
        reach = float(max(row["corner"], row["tolerance"]))
        wires.setdefault(int(row["wire"]), []).append(
            Arc(points, degree, weights, knots, ends, reach, gap)
        )
    return list(wires.values())


def _off(parts: list[Part], uv: FloatArray, xyz: FloatArray) -> float:
    """Return how far points of a face's edges are from those of its surfaces, at most."""
    uv, xyz = uv[:, ::CHECKED].reshape(-1, 2), xyz[:, ::CHECKED].reshape(-1, 3)
    off, is_seen = 0.0, np.zeros(len(uv), np.bool_)
    for part in parts:  # of a face of several parts each has some of the points
        u, v = part.unit(uv)
        here = (u >= -ROUNDING) & (u <= 1.0 + ROUNDING) & (v >= -ROUNDING) & (v <= 1.0 + ROUNDING)
        if here.any():
            at = part.point(np.clip(u[here], 0.0, 1.0), np.clip(v[here], 0.0, 1.0))
            off = max(off, float(np.linalg.norm(at - xyz[here], axis=1).max()))
            is_seen |= here
    return off if is_seen.all() else np.inf
