"""The registry of kinds: which kind intersects each class of surfaces, and building them.

A kind takes all surfaces of its class at once. A new class needs an `Entry` in `ENTRIES` and
nothing else in this package.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from hybrid_rt.core.checks import FARTHEST, SMALLEST
from hybrid_rt.core.records import IntArray
from hybrid_rt.core.threads import Pool
from hybrid_rt.intersection.kind import CurvedKind, Kind
from hybrid_rt.intersection.kinds.closed_forms import ClosedForm
from hybrid_rt.intersection.members import in_frames
from hybrid_rt.intersection.trims import whole_of
from hybrid_rt.primitives import Box, Plane, Rectangle, Sphere, TriangleMesh
from hybrid_rt.primitives.asphere import Asphere
from hybrid_rt.primitives.box import TurnedBox
from hybrid_rt.primitives.instances import Instances
from hybrid_rt.primitives.torus import Torus
from meshing import BezierPatches, SurfaceOfRevolution, TrimmedSurface
from meshing.bezier import RationalPatches
from meshing.sheet import PatchSheet
from meshing.surface import Surface

ACCURACIES = ("certified", "refined", "mesh")
# From so many of a class on, a tree is faster than asking all of them. Spheres and rectangles out of
# reach are rejected eight at a time, so it takes more of these.
MANY: dict[type[Surface], int] = {
    Sphere: 96,
    Rectangle: 200,
    Box: 8,
    TurnedBox: 8,
    Torus: 16,
    Asphere: 16,
    SurfaceOfRevolution: 8,
}

# Classes that a single ray asks without a call, see `hybrid_rt.intersection.kernels.single_rays`.
SINGLE = (Sphere, Rectangle, Plane, Box)

Members: TypeAlias = list[tuple[int, Any]]
"""Object ids and surfaces of one class."""
Build: TypeAlias = Callable[[Members, str, Pool], Any]
"""Takes members, accuracy and a pool, returns the kind; imports what no other scene needs."""


@dataclass(frozen=True)
class Entry:
    """How rays intersect the surfaces of one class."""

    surface: type[Surface]
    name: str  # in the plan
    build: Build
    by_embree: tuple[str, ...] = ()  # accuracies at which they have a coarse stage


class Kinds(NamedTuple):
    """The kinds in a scene."""

    # kinds without and with a coarse stage
    direct: list[Kind]
    curved: list[CurvedKind]
    kind_of: IntArray  # (objects,) int32, index of each object's kind in ``direct + curved``
    in_embree: Members  # object ids and surfaces with a coarse stage
    plan: dict[str, dict[str, str]]  # which features are used, with reasons


def check_surfaces(surfaces: Sequence[Surface]) -> tuple[Surface, ...]:
    """Check and return the surfaces.

    Raises TypeError if an item is not a surface of a registered class.
    Raises ValueError if one is too large, too small or too far away for float64 to compute with.
    """
    for i, surface in enumerate(surfaces):
        if _entry_of(surface) is None:
            raise TypeError(
                f"surfaces[{i}] is of type {type(surface).__name__}: pass surfaces such as "
                "BezierPatches or Sphere (of an Object its .surface, of a Lens its .surfaces, for a mesh "
                "TriangleMesh(mesh))"
            )
        if surface.is_bounded:
            farthest, size = surface.reach, surface.size
            if farthest > FARTHEST or size < SMALLEST:
                raise ValueError(
                    f"surfaces[{i}] reaches {farthest:.3g} and is {size:.3g} large: scale the scene, "
                    f"coordinates up to {FARTHEST:g} and sizes from {SMALLEST:g} are possible"
                )
    return tuple(surfaces)


def by_entry(surfaces: Sequence[Surface]) -> list[list[Surface]]:
    """Return checked surfaces sorted by their entries; of those that go together one list each."""
    return [[surface for _, surface in found] for found in _members_of(surfaces).values() if found]


def count_by_kind(surfaces: Sequence[Surface]) -> dict[str, int]:
    """Count checked surfaces by the names of their entries; without those that do not occur."""
    members = _members_of(surfaces)
    return {name: len(found) for name, found in members.items() if found}


def make_kinds(surfaces: Sequence[Surface], accuracy: str, pool: Pool) -> Kinds:
    """Build the kinds that occur in a scene.

    ``pool``: shares the work of building.
    """
    kinds = Kinds([], [], np.full(len(surfaces), -1, np.int32), [], {"used": {}, "left_out": {}})
    by_name = _members_of(surfaces)
    # Numbers run through the direct kinds, then through the others.
    for goes_to_embree in (False, True):
        for entry in ALL_ENTRIES:
            if (accuracy in entry.by_embree) != goes_to_embree:
                continue
            members = by_name[entry.name]
            if not members:
                kinds.plan["left_out"][entry.name] = "the scene has none"
                continue
            if goes_to_embree:
                kinds.in_embree.extend(members)
            if goes_to_embree and accuracy == "mesh":
                kinds.plan["left_out"][entry.name] = (
                    'accuracy="mesh" takes the triangles as they are'
                )
                kinds.kind_of[[i for i, _ in members]] = len(kinds.direct)
                continue
            groups = _in_frames(members)
            for group in groups:
                kinds.kind_of[[i for i, _ in group]] = len(kinds.direct) + len(kinds.curved)
                kind = entry.build(group, accuracy, pool)
                (kinds.curved if goes_to_embree else kinds.direct).append(kind)
            in_frames = f", in {len(groups)} frames by size and place" if len(groups) > 1 else ""
            kinds.plan["used"][entry.name] = f"{len(members)}, lamps included{in_frames}"
    kinds.in_embree.sort(key=lambda member: member[0])
    return kinds


def _in_frames(members: Members) -> list[Members]:
    """Sort surfaces of one class into those that share a frame; where only trees have one, all do."""
    _, whole = whole_of(members[:1])[0]
    if len(members) == 1 or not isinstance(whole, BezierPatches | PatchSheet | TriangleMesh):
        return [members]
    bounds = np.array([surface.bounds for _, surface in members])
    return [[members[k] for k in rows] for rows in in_frames(bounds)]


def _entry_of(surface: object) -> Entry | None:
    """Return the entry of a surface's class, or of the first class that it derives from.

    Sheets are intersected as the patches that they consist of.
    """
    if isinstance(surface, TrimmedSurface):
        whole = _entry_of(surface.surface)
        return None if whole is None else _TRIMMED.get(whole.surface)
    if isinstance(surface, PatchSheet):
        surface = surface.pieces
    for surface_type in type(surface).__mro__:
        if surface_type in _BY_CLASS:
            return _BY_CLASS[surface_type]
    return None


def _members_of(surfaces: Sequence[Surface]) -> dict[str, Members]:
    """Sort checked surfaces by the names of their entries."""
    members: dict[str, Members] = {entry.name: [] for entry in ALL_ENTRIES}
    for i, surface in enumerate(surfaces):
        entry = _entry_of(surface)
        assert entry is not None
        members[entry.name].append((i, surface))
    return members


def _closed_form(of: type[Surface], module: str, one: str, several: str) -> Entry:
    """Return the entry of a class without a coarse stage, whose kernels are named after it."""

    def build(members: Members, _accuracy: str, _pool: Pool) -> Kind:
        kernels = import_module(f"hybrid_rt.intersection.kernels.{module}")
        return ClosedForm(
            members,
            getattr(kernels, f"{one}_table"),
            getattr(kernels, f"trace_{several}"),
            getattr(kernels, f"finish_{several}"),
            getattr(kernels, f"trace_{one}_tree", None),  # none of what has no end
            MANY.get(of, 0),
            alone=several if of in SINGLE else "",
        )

    return Entry(of, several.replace("_", " "), build)


def _patches(members: Members, accuracy: str, pool: Pool) -> CurvedKind:
    from hybrid_rt.intersection.kinds.patches import FINEST, PatchKind

    return PatchKind(members, pool, finest=FINEST if accuracy == "certified" else 0)


def _revolutions(members: Members, _accuracy: str, _pool: Pool) -> CurvedKind:
    from hybrid_rt.intersection.kinds.revolutions import RevolutionKind

    return RevolutionKind(members, MANY[SurfaceOfRevolution])


def _triangles(members: Members, accuracy: str, _pool: Pool) -> Kind:
    from hybrid_rt.intersection.kinds.triangles import TriangleKind

    return TriangleKind(members, search=accuracy == "certified")


def _instances(members: Members, _accuracy: str, pool: Pool) -> Any:
    from hybrid_rt.intersection.kinds.instances import InstanceKind

    def make(surfaces: list[Surface]) -> Kinds:
        return make_kinds(check_surfaces(surfaces), "certified", pool)

    return InstanceKind(members, make)


ENTRIES = (
    _closed_form(Sphere, "sphere", "sphere", "spheres"),
    _closed_form(Rectangle, "rectangle", "rectangle", "rectangles"),
    _closed_form(Plane, "plane", "plane", "planes"),
    _closed_form(Box, "box", "box", "boxes"),
    _closed_form(TurnedBox, "turned_box", "turned_box", "turned_boxes"),
    _closed_form(Torus, "torus.trace", "torus", "tori"),
    _closed_form(Asphere, "asphere.trace", "asphere", "aspheres"),
    Entry(BezierPatches, "Bezier patches", _patches, ACCURACIES),
    Entry(RationalPatches, "rational patches", _patches, ACCURACIES),
    Entry(SurfaceOfRevolution, "surfaces of revolution", _revolutions, ACCURACIES),
    # Certified hits on meshes come from a tree of our own, in float64 from the first box on.
    Entry(TriangleMesh, "triangle meshes", _triangles, ("refined", "mesh")),
    # In their places surfaces have certified hits, whatever the accuracy.
    Entry(Instances, "instances", _instances),
)


_BY_CLASS: dict[type, Entry] = {entry.surface: entry for entry in ENTRIES}
# Which classes can be trimmed: the same kinds with loops, so that whole surfaces ask for none.
_TRIMMED: dict[type, Entry] = {
    entry.surface: replace(entry, surface=TrimmedSurface, name=f"trimmed {entry.name}")
    for entry in ENTRIES
    if entry.surface.flip_of_uv
}
ALL_ENTRIES = (*ENTRIES, *_TRIMMED.values())
