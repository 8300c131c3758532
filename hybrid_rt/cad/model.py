"""Models of CAD files: their parts, where they are placed, and the surfaces that rays meet."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.cad import edges as edges_of
from hybrid_rt.cad.faces import BUILDERS, Part, Raw, parts_of
from hybrid_rt.cad.loops import Arc
from hybrid_rt.cad.pairs import in_pairs
from hybrid_rt.cad.process import arrays_of
from hybrid_rt.cad.records import KINDS, MM
from hybrid_rt.core import checks
from hybrid_rt.core.records import BoolArray
from hybrid_rt.intersection.crossings import Crossings
from hybrid_rt.primitives import TriangleMesh
from meshing.checks import FloatArray, as_path, number, text_of
from meshing.surface import Surface

if TYPE_CHECKING:
    from hybrid_rt.materials.material import Material
    from hybrid_rt.scene.scene import Scene

EXACT, APPROXIMATED, REFUSED, MESH = "exact", "approximated", "refused", "mesh"
FACE = np.dtype([
    ("part", "i4"), ("kind", "U10"), ("exactness", "U12"), ("bound", "f8"), ("gap_measured", "f8"),
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
GREY = (0.55, 0.55, 0.55)


@dataclass(frozen=True)
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
        Of the rows of `CadModel.faces`.
    """

    name: str
    instance: str
    color: tuple[float, float, float] | None
    transform: FloatArray
    is_closed: bool
    shape: int
    faces: slice


@dataclass(frozen=True)
class CadModel:
    """What `read_cad` returns.

    Attributes
    ----------
    surfaces : list of Surface
        For an `Intersector`, or objects of a scene.
    face_of : (surfaces,) int32
        The row of ``faces`` of each surface, so of the ``object_id`` of hits: ``face_of[hits.object_id]``.
    parts : list of CadPart
    faces : structured array, a row for each face of each part, in the order of the file
        ``part``, ``kind`` ("plane", "cylinder" ...), ``exactness`` ("exact", "approximated", "refused",
        "mesh"), ``bound`` (of what is approximated: distance, an estimate), ``gap_measured`` and
        ``gap_declared`` (largest distance from a neighbour along a shared edge, and the file's
        tolerance), ``is_reversed`` (normal against S_u x S_v of the file), ``color`` (linear RGB, nan
        if there is none), ``surfaces`` (how many it became), ``free_edges``.
    report : dict
        ``unit``, ``parts``, ``shapes``, ``faces`` (kind -> exactness -> count), ``gaps`` (largest first:
        gap, both faces), ``free_edges``, ``refused`` (face, kind, reason), ``wires`` and ``points``
        outside faces, which are ignored.
    """

    surfaces: list[Surface]
    face_of: NDArray[np.int32]
    parts: list[CadPart]
    faces: NDArray[Any]
    report: dict[str, Any]
    box: FloatArray

    def __repr__(self) -> str:
        """Count parts, faces and surfaces."""
        counts = Counter(self.faces["exactness"].tolist())
        words = ", ".join(f"{n} {name}" for name, n in counts.items())
        return f"CadModel({len(self.parts)} parts, {len(self.faces)} faces: {words}; unit {self.report['unit']})"

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner of a box about what is inside the loops, nearly."""
        return self.box

    def paired(self, crossings: Crossings) -> tuple[Crossings, BoolArray]:
        """Return crossings of `surfaces` with entries and exits of closed parts in turn.

        Rows within the gap of an edge may be there twice, once for each face: the fewest of these are left
        out that it takes. Nothing is promised of open parts, whose rows stay.

        Returns
        -------
        Crossings
        is_paired : (n,) bool
            Of rays for which leaving out is not enough, all rows stay, and this is False.
        """
        closed = np.array([part.is_closed for part in self.parts])
        part = self.faces["part"][self.face_of[crossings.hits.object_id]]
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
        for k, surface in zip(self.face_of.tolist(), self.surfaces, strict=True):
            part = self.parts[self.faces["part"][k]]
            color = self.faces["color"][k]
            rgb = tuple(color.tolist()) if np.isfinite(color).all() else part.color or GREY
            look = material or made.setdefault(rgb, Lambertian(np.clip(rgb, 0.0, 0.9)))
            objects.append(Object(surface, look, f"{part.name or 'part'}, face {k}"))
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
        number(seconds, "read_cad seconds", above=0.0),
        number(gigabytes, "read_cad gigabytes", above=0.0),
    )
    arrays = arrays_of(file, options, *limits)
    model = _model_of(arrays)
    if refuse == "error" and (refused := model.report["refused"]):
        named = "; ".join(f"face {r['face']} ({r['kind']}): {r['reason']}" for r in refused[:NAMED])
        raise ValueError(
            f"CAD file {str(file)!r}: {len(refused)} of {len(model.faces)} faces have no exact form here ({named}"
            f"{'; ...' if len(refused) > NAMED else ''}): pass refuse='skip' to leave them out"
        )
    return model


def _model_of(arrays: dict[str, Any]) -> CadModel:
    """Return the model of what the child process has written."""
    head, raw = arrays["head"], arrays["faces"]
    uses, xyz = arrays["uses"], arrays["xyz"]
    shared = edges_of.measured(uses, xyz, len(raw))
    gaps, declared = edges_of.gaps_of_faces(shared, len(raw))
    built, reasons, bounds = _built(arrays, gaps)
    surfaces: list[Surface] = []
    owner: list[int] = []
    parts: list[CadPart] = []
    rows: list[tuple[Any, ...]] = []
    boxes: list[list[FloatArray]] = []
    pairs: list[dict[str, Any]] = []
    refused: list[dict[str, Any]] = []
    first = 0
    for placed in head["placed"]:
        begin, end = head["shapes"][placed["shape"]]["faces"]
        if begin == end:
            continue  # wires and points only
        matrix, number_of_part = np.array(placed["matrix"]), len(parts)
        is_moved, is_mirrored = (matrix != np.eye(4)).any(), np.linalg.det(matrix[:3, :3]) < 0.0
        scale = float(np.cbrt(abs(np.linalg.det(matrix[:3, :3]))))
        for k in range(begin, end):
            for surface in built[k]:
                copy = surface.transformed(matrix) if is_moved else surface
                surfaces.append(copy.flipped() if is_mirrored else copy)
                owner.append(first + k - begin)
            kind = KINDS[raw["kind"][k]]
            exactness = REFUSED if not built[k] else MESH if kind == "mesh" else EXACT
            bound = float(raw["bound"][k]) * scale
            if exactness == EXACT and bound:
                exactness = APPROXIMATED
            rows.append((
                number_of_part, kind, exactness, bound, gaps[k] * scale, declared[k] * scale,
                raw["reversed"][k], raw["color"][k], len(built[k]), shared.n_free[k],
            ))  # fmt: skip
            if not built[k]:
                refused.append({"face": first + k - begin, "kind": kind, "reason": reasons[k]})
        mine = (uses["face"] >= begin) & (uses["face"] < end)
        points = [xyz[mine].reshape(-1, 3), *(bounds[k] for k in range(begin, end))]
        corners = np.concatenate(points) @ matrix[:3, :3].T + matrix[:3, 3]
        if len(corners):
            boxes.append([corners.min(axis=0), corners.max(axis=0)])
        here = (shared.face[:, 0] >= begin) & (shared.face[:, 0] < end)
        largest = np.flatnonzero(here)[np.argsort(-shared.gap[here], kind="stable")[:LISTED]]
        pairs += [
            {"gap": float(shared.gap[e] * scale), "faces": (shared.face[e] + first - begin).tolist(),
             "declared": float(shared.declared[e] * scale)}
            for e in largest.tolist()
        ]  # fmt: skip
        is_closed = not shared.n_free[begin:end].any() and all(built[begin:end])
        color = None if placed["color"] is None else tuple(placed["color"])
        parts.append(CadPart(
            placed["name"], placed["instance"], color, matrix, is_closed, placed["shape"],
            slice(first, first + end - begin),
        ))  # fmt: skip
        first += end - begin
    faces = np.array(rows, FACE)
    counts: dict[str, dict[str, int]] = {}
    for (kind, exactness), n in Counter(
        zip(faces["kind"].tolist(), faces["exactness"].tolist(), strict=True)
    ).items():
        counts.setdefault(kind, {})[exactness] = n
    report = {
        "unit": head["unit"], "parts": len(parts), "shapes": len({part.shape for part in parts}),
        "closed_parts": sum(part.is_closed for part in parts), "faces": counts,
        "gaps": sorted(pairs, key=lambda pair: -pair["gap"])[:LISTED],
        "free_edges": int(faces["free_edges"].sum()), "refused": refused,
        "wires": head["wires"], "points": head["points"],
    }  # fmt: skip
    box = np.array(boxes) if boxes else np.zeros((1, 2, 3))
    return CadModel(
        surfaces, np.array(owner, np.int32), parts, faces, report,
        np.stack([box[:, 0].min(axis=0), box[:, 1].max(axis=0)]),
    )  # fmt: skip


def _built(
    arrays: dict[str, Any], gaps: FloatArray
) -> tuple[list[list[Surface]], list[str], list[FloatArray]]:
    """Return the surfaces of each face, or why it has none, and points of it that edges do not show."""
    raw, uses, numbers, xyz = arrays["faces"], arrays["uses"], arrays["numbers"], arrays["xyz"]
    of_face = np.searchsorted(uses["face"], np.arange(len(raw) + 1))  # they are in that order
    built: list[list[Surface]] = []
    reasons: list[str] = []
    bounds: list[FloatArray] = []
    for k, row in enumerate(raw):
        mine = slice(of_face[k], of_face[k + 1])
        kind, reason = KINDS[row["kind"]], str(row["reason"])
        found: list[Surface] = []
        points = np.empty((0, 3))
        if kind == "mesh" and not reason:
            n, m = row["size"][:2].tolist()
            vertices, faces = np.split(numbers[row["at"] : row["at"] + 3 * (n + m)], [3 * n])
            sides = faces.reshape(m, 3).astype(np.int64)
            mesh = TriangleMesh(_Triangles(vertices.reshape(n, 3), sides))  # type: ignore[arg-type]
            found, points = [mesh.flipped() if row["reversed"] else mesh], mesh.vertices
        elif not reason and kind in BUILDERS:
            size = float(np.ptp(xyz[mine].reshape(-1, 3), axis=0).max(initial=0.0))
            gap = max(edges_of.BETWEEN * float(gaps[k]), LEAST_GAP * size) + float(row["bound"])
            face = Raw(
                kind, bool(row["reversed"]), row["size"].tolist(), numbers[row["at"] :],
                _wires(uses[mine], numbers, xyz[mine]), gap,
            )  # fmt: skip
            try:
                parts = parts_of(face)
                found = [part.trimmed(face) for part in parts]
                points = np.concatenate([part.extremes() for part in parts])
                if (jump := max(part.jump() for part in parts)) > AGREES * size:
                    raise ValueError(f"a loop jumps by {jump:.3g} where it has no edge")
                off = _off(parts, arrays["uv"][mine], xyz[mine])
                if off > AGREES * size + 2.0 * float(row["bound"]):
                    raise ValueError(f"its surface is {off:.3g} from OpenCASCADE's")
            except (ValueError, TypeError) as error:
                found, reason = [], text_of(error)
        built.append(found)
        reasons.append(reason or f"no class for a face of kind {kind!r}")
        bounds.append(points)
    return built, reasons, bounds


@dataclass(frozen=True)
class _Triangles:
    vertices: FloatArray
    faces: NDArray[np.int64]


def _wires(uses: NDArray[Any], numbers: FloatArray, xyz: FloatArray) -> list[list[Arc]]:
    """Return the arcs of each wire of a face."""
    wires: dict[int, list[Arc]] = {}
    for row, both in zip(uses, xyz[:, [0, -1]], strict=True):
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
            Arc(points, degree, weights, knots, ends, reach)
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
