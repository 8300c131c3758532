"""Holes, bosses, fillets and rounds of a part, by radius."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from hybrid_rt.core.records import FloatArray
from hybrid_rt.part.cells import TURN, Solid
from hybrid_rt.part.joints import Joint
from hybrid_rt.part.walls import Walls
from hybrid_rt.primitives import Sphere
from hybrid_rt.primitives.torus import Torus
from meshing import SurfaceOfRevolution

# Axes and radii that agree to this part of the part's size are the same; turns, over a whole one.
SAME, WHOLE = 1e-6, 0.999


@dataclass(frozen=True)
class Feature:
    """A hole, boss, fillet or round.

    Attributes
    ----------
    kind : str
        "hole" (a whole turn, concave), "boss" (convex), "fillet" (less than a turn, concave, tangent to a
        neighbour) or "round" (convex).
    radius : float
        Of the cylinder, or of the tube of a torus, or of the sphere.
    faces : tuple of int
    axis : (2, 3)
        A point and the direction; of a sphere its centre and nan.
    depth : float
        Along the axis; nan of spheres and tori.
    end : str
        Of a hole: "through" or "blind", by rays along its axis from within to either side; "" otherwise.
    """

    kind: str
    radius: float
    faces: tuple[int, ...]
    axis: FloatArray
    depth: float
    end: str


def features_of(walls: Walls) -> list[Feature]:
    """List the features of a body, largest radius first within each kind."""
    solid, size = walls.solid, walls.size
    joints: dict[int, list[Joint]] = {}
    for joint in walls.joints:
        joints.setdefault(joint.face, []).append(joint)
    groups: dict[tuple[Any, ...], list[int]] = {}
    shapes = {}
    for face, surface in enumerate(solid.surfaces):
        shape = shape_of(surface.surface)
        if shape is not None:
            shapes[face] = shape
            groups.setdefault(_key(shape, size), []).append(face)
    found = []
    for faces in groups.values():
        for some in _connected(faces, joints):
            found += _features(walls, some, shapes[some[0]], joints)
    order = ("hole", "boss", "fillet", "round")
    return sorted(found, key=lambda f: (order.index(f.kind), -f.radius, f.faces))


@dataclass(frozen=True)
class Shape:
    """A cylinder, torus (``radius`` of its tube) or sphere."""

    name: str
    radius: float
    is_concave: bool
    origin: FloatArray
    axis: FloatArray
    radial: FloatArray
    major: float = 0.0


def shape_of(surface: Any) -> Shape | None:
    """Return a cylinder, torus or sphere."""
    if isinstance(surface, Torus):
        return Shape(
            "torus", surface.minor_radius, surface.orientation < 0, surface.origin, surface.axis, surface.radial,
            surface.major_radius,
        )  # fmt: skip
    if isinstance(surface, Sphere):
        none = np.full(3, np.nan)
        return Shape(
            "sphere", surface.radius, surface.orientation < 0, surface.center, none, np.zeros(3)
        )
    if isinstance(surface, SurfaceOfRevolution) and [len(s) for s in surface.segments] == [2]:
        (a, r), (b, s) = surface.segments[0].tolist()
        if r == s:
            return Shape("cylinder", r, b < a, surface.origin, surface.axis, surface.radial)
    return None


def _key(shape: Shape, size: float) -> tuple[Any, ...]:
    """Return what is equal for faces of one cylinder, torus or sphere."""
    origin, axis = shape.origin, shape.axis
    if shape.name != "sphere":
        axis = axis * np.sign(axis[np.abs(axis).argmax()])
    if shape.name == "cylinder":
        origin = origin - (origin @ axis) * axis
    near = np.round(np.concatenate([origin, [shape.radius, shape.major]]) / (SAME * size))
    way = np.round(np.nan_to_num(axis), 6)
    return shape.name, shape.is_concave, *near.astype(int).tolist(), *way.tolist()


def _connected(faces: list[int], joints: dict[int, list[Joint]]) -> list[list[int]]:
    """Return faces in groups that share edges."""
    left, groups = set(faces), []
    while left:
        group, todo = [], [min(left)]
        left -= set(todo)
        while todo:
            face = todo.pop()
            group.append(face)
            near = {j.other for j in joints.get(face, [])} & left
            left -= near
            todo += sorted(near)
        groups.append(sorted(group))
    return groups


def _features(
    walls: Walls, faces: list[int], shape: Shape, joints: dict[int, list[Joint]]
) -> list[Feature]:
    solid = walls.solid
    if shape.name == "cylinder":
        turn, low, high = _reach(solid, faces, shape)
        if turn >= WHOLE * TURN:
            kind, end = "boss", ""
            if shape.is_concave:
                kind, end = "hole", _end(walls, shape, low, high)
            axis = np.stack([shape.origin + low * shape.axis, shape.axis])
            return [Feature(kind, shape.radius, tuple(faces), axis, high - low, end)]
    else:
        low = high = np.nan
    beyond = [j for face in faces for j in joints.get(face, []) if j.other not in faces]
    if not any(j.is_smooth for j in beyond):
        return []
    kind = "fillet" if shape.is_concave else "round"
    axis = np.stack([shape.origin, shape.axis])
    return [Feature(kind, shape.radius, tuple(faces), axis, high - low, "")]


def _reach(solid: Solid, faces: list[int], shape: Shape) -> tuple[float, float, float]:
    """Return how far faces go around an axis, and from where to where along it."""
    ends, wide = [], []
    reference = shape.radial
    binormal = np.cross(shape.axis, reference)
    for face in faces:
        for side in solid.sides[face]:
            ends.append((side.points - shape.origin) @ shape.axis)
        surface = solid.surfaces[face]
        u = np.linspace(0.0, 1.0, 721)
        v = np.linspace(0.0, 1.0, 9)[1:-1]
        grid = [x.ravel() for x in np.meshgrid(u[:-1], v, indexing="ij")]
        inside = surface.contains(*grid)[0].reshape(720, len(v)).any(axis=1)
        points = surface.point(u[:-1][inside], 0.5) - shape.origin
        wide.append(np.arctan2(points @ binormal, points @ reference) % TURN)
    angles = np.sort(np.concatenate(wide))
    if not len(angles):
        return 0.0, 0.0, 0.0
    largest = np.diff(angles, append=angles[0] + TURN).max()
    along = np.concatenate(ends)
    return (
        (TURN if largest < TURN / 90 else TURN - float(largest)),
        float(along.min()),
        float(along.max()),
    )


def _end(walls: Walls, shape: Shape, low: float, high: float) -> str:
    """Tell whether rays along the axis of a hole, from its middle, meet the part on neither side."""
    middle = shape.origin + 0.5 * (low + high) * shape.axis
    hits = walls.tracer.intersect(np.stack([middle, middle]), np.stack([shape.axis, -shape.axis]))
    # What lies farther off than the hole is deep is another wall.
    far = 0.5 * (high - low) * 1.001 + shape.radius
    return "blind" if (hits.hit & (hits.t < far)).any() else "through"
