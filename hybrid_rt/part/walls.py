"""Wall thickness: the least along inward normals, and of inscribed balls, each between proven bounds.

Thickness at a point is how far the ray along the inward normal goes to where it leaves the material; or the
diameter of the largest ball inside the part that touches it there. Walls are *opposite* if normals differ by
at most ``angle`` from antiparallel (of a ball: if its contacts are that near to opposite). Beside a convex edge
both thicknesses fall toward 0, at any part. So the least one is that of all local minima: chords along both
normals, and at borders of faces chords between opposite walls. Faces that meet in an edge sharper than 90 degrees
are named, and count only where a chord is along both normals.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from hybrid_rt.core.records import BoolArray, FloatArray
from hybrid_rt.distance import ClosestPoint
from hybrid_rt.intersection.intersector import Intersector
from hybrid_rt.part.cells import ALONG, BORDER, CREASE, FACE, Cells, Ints, Solid
from hybrid_rt.part.joints import Joint, joints_of
from hybrid_rt.part.kernels.bounds import BOTH, FIRST, TOUCHING
from hybrid_rt.part.pairs import Found, Heard, PairSearch
from meshing import TrimmedSurface

# Rays leave from so far inside a border, and count from so far on, over the size of the part.
INWARD, FROM = 1e-7, 1e-8
# Exits flatter than this, by the cosine with the normal, do not count: the ray runs along a side wall.
GRAZING = 0.0871557  # 85 degrees
# Side walls lean by no more than this, the sine of the angle.
FLAT_SIDE = 1e-6
# Samples are this part of the size apart, or nearer.
SAMPLED = 1.0 / 50.0
# Chords of samples are along both normals within this, radians.
ALIGNED = np.deg2rad(1.0)
# Between faces that meet in a sharp edge, within this.
ANTIPARALLEL = 1e-4
# Edges sharper than a right angle by more than this are named, radians.
SHARPER = np.deg2rad(0.1)
# Balls that are looked at in each round: whether they are inside, and how large they are. On an axis that takes long.
ASKED, TRIED_BALLS = 4000, 40
# Points on re-entrant edges at which both normals are taken.
FANNED = 257
# Times that a ball shrinks.
SHRINKINGS = 40
# Steps by which the point is found whose normal passes through a given one.
FEET = 4
# Chords of samples that are made shorter before the search, of each pair of faces so many; steps of each.
SHORTENED, OF_PAIR, SETTLINGS, SMALLEST_STEP = 120, 2, 40, 1e-13


@dataclass(frozen=True)
class Exits:
    """Where rays along inward normals leave."""

    t: FloatArray  # inf: nowhere
    normal: FloatArray
    face: Ints


class Walls:
    """The walls of a closed body.

    Parameters
    ----------
    surfaces : list of TrimmedSurface
        Its faces, normals outward.
    angle : float
        Radians.
    threads : int, optional
    """

    def __init__(
        self, surfaces: list[TrimmedSurface], angle: float, threads: int | None = None
    ) -> None:
        self.solid, self.angle, self._threads = Solid(surfaces), angle, threads
        self.tracer = Intersector(surfaces, coarse="none", threads=threads)
        self.size = self.solid.size
        self.cells = Cells([self.solid])
        self.roots = self.cells.roots(0)

    @cached_property
    def joints(self) -> list[Joint]:
        """Where its faces meet."""
        return joints_of(self.solid)

    @cached_property
    def sharp(self) -> dict[tuple[int, int], Joint]:
        """Joints sharper than a right angle, by their pair of faces: the sharpest."""
        found: dict[tuple[int, int], Joint] = {}
        for joint in self.joints:
            key = (min(joint.face, joint.other), max(joint.face, joint.other))
            if joint.least < 0.5 * np.pi - SHARPER and (
                key not in found or joint.least < found[key].least
            ):
                found[key] = joint
        return found

    @cached_property
    def creases(self) -> Ints:
        """Cells of re-entrant edges, one for each."""
        made, steps = [], np.linspace(0.0, 1.0, FANNED)
        for joint in self.joints:
            if joint.is_reentrant and self._comes_first(joint):
                side = self.solid.sides[joint.face][joint.side]
                points, own = self.solid.at(joint.face, *side.curve.point(steps).T)
                beyond = (
                    ClosestPoint(self.solid.surfaces[joint.other], threads=1).query(points).normal
                )
                made.append(self.cells.add_crease(0, joint.face, joint.side, own, beyond))
        return np.concatenate([np.empty(0, np.int64), *made])

    def _comes_first(self, joint: Joint) -> bool:
        """Tell of the two joints of an edge which one stands for it: that of a flat face."""
        flat = [not self.solid.surfaces[face].is_flat for face in (joint.face, joint.other)]
        return (flat[0], joint.face) < (flat[1], joint.other)

    @cached_property
    def samples(self) -> Ints:
        """Cells of faces that are small, with their middles inside the loops."""
        leaves = self.roots[self.cells.ints[self.roots, 3] == FACE]
        done, has = [], np.zeros(len(self.solid.surfaces), np.bool_)
        while len(leaves):
            face, is_in = self.cells.ints[leaves, 1], self.cells.ints[leaves, 6] == 1
            radius = self.cells.radius[leaves, 0]
            small = radius <= SAMPLED * self.size
            has[face[small & is_in]] = True
            # Of a narrow face cells become smaller until a middle is inside.
            done.append(leaves[small & is_in])
            leaves = leaves[~small | ~(has[face] | is_in | (radius < FROM * self.size))]
            self.cells.halved(leaves)
            leaves = self.cells.children[leaves].ravel()
            leaves = leaves[leaves >= 0]
        return np.concatenate(done)

    @cached_property
    def sampled(self) -> tuple[FloatArray, FloatArray, Ints, Exits]:
        """Points of the samples, their normals and faces, and where their rays leave."""
        some = self.samples
        points, normals = self.cells.middle[some], self.cells.frame[some][:, :3]
        return points, normals, self.cells.ints[some, 1], self.exits(points, normals)

    @cached_property
    def sampled_balls(self) -> tuple[FloatArray, FloatArray, Ints]:
        """Balls of the samples, see `balls_at`."""
        return self.balls_at(*self.sampled[:3])

    def exits(self, points: FloatArray, normals: FloatArray) -> Exits:
        """Trace rays from points of the surface along inward normals to where they leave."""
        hits = self.tracer.intersect(points, -normals, t_min=FROM * self.size)
        t, far, face = hits.t.copy(), hits.normal.copy(), hits.object_id.astype(np.int64)
        cosine = -(far * normals).sum(axis=1)
        doubtful = np.flatnonzero(hits.hit & (cosine < GRAZING))
        if len(doubtful):
            every = self.tracer.intersect_all(
                points[doubtful], -normals[doubtful], t_min=FROM * self.size
            )
            slope = -(every.hits.normal * normals[doubtful][every.ray]).sum(axis=1)
            t[doubtful] = np.inf
            for k in np.flatnonzero(np.abs(slope) >= GRAZING)[::-1].tolist():  # the first one stays
                i = doubtful[every.ray[k]]
                t[i] = every.hits.t[k] if slope[k] > 0.0 else np.inf
                far[i], face[i] = every.hits.normal[k], every.hits.object_id[k]
        return Exits(np.where(hits.hit, t, np.inf), far, face)

    def opposite(self, normals: FloatArray, exits: Exits, angle: float) -> BoolArray:
        """Tell where a ray leaves through a wall that is opposite within an angle."""
        cosine = -(normals * np.nan_to_num(exits.normal)).sum(axis=1)
        return np.isfinite(exits.t) & (cosine >= np.cos(angle))

    def thickness(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        """Return the thickness along normals at points of the surface; nan where the wall is not opposite."""
        return self._thickness(normals, self.exits(points, normals))

    @property
    def sampled_thickness(self) -> FloatArray:
        """The thickness of the samples."""
        return self._thickness(*self.sampled[1::2])

    def _thickness(self, normals: FloatArray, exits: Exits) -> FloatArray:
        return np.where(self.opposite(normals, exits, self.angle), exits.t, np.nan)

    # --- real chords

    def _into(self, cells: Ints) -> tuple[FloatArray, FloatArray]:
        """Return the middles of borders, moved into their faces, and the normals there."""
        moved, normals = np.empty((len(cells), 3)), np.empty((len(cells), 3))
        for i, cell in enumerate(cells.tolist()):
            face, k = self.cells.ints[cell, [1, 4]].tolist()
            side, s = self.solid.sides[face][k], 0.5 * float(self.cells.box[cell, :2].sum())
            point, normal = self.solid.at(face, *side.curve.point(s).T)
            moved[i] = point[0] + INWARD * self.size * side.into[round(s * (ALONG - 1))]
            normals[i] = normal[0]
        return moved, normals

    def _feet(self, q: FloatArray, direction: FloatArray) -> tuple[FloatArray, FloatArray, Ints]:
        """Return points whose normal passes through points q inside, their normals, and faces; nan: none."""
        p, n = np.full_like(q, np.nan), direction.copy()
        face = np.full(len(q), -1, np.int64)
        for _ in range(FEET):
            hits = self.tracer.intersect(q, n, t_min=FROM * self.size)
            p, face = hits.position.copy(), hits.object_id.astype(np.int64)
            n = np.where(hits.hit[:, None], hits.normal, n)
        return p, n, face

    def chords(self, a: Ints, b: Ints, kind: Ints) -> tuple[FloatArray, FloatArray, Ints]:
        """Return real chords of pairs of cells, see `Values`."""
        cells = self.cells
        value, place = np.full(len(a), np.inf), np.full((len(a), 2, 3), np.nan)
        faces = cells.ints[np.stack([a, b], axis=1), 1].copy()
        normal = cells.frame[a][:, :3]
        kind_a, kind_b = cells.ints[a, 3], cells.ints[b, 3]
        from_face = (kind_a == FACE) & (kind_b == FACE) & (cells.ints[a, 6] == 1)
        from_border = (kind_a == BORDER) & (kind_b == FACE)
        to_border = (kind_a == FACE) & (kind_b == BORDER)
        to_crease = (kind_a == FACE) & (kind_b == CREASE)
        p, n = cells.middle[a].copy(), normal.copy()
        p[from_border], n[from_border] = self._into(a[from_border])
        traced = from_face | from_border
        if to_border.any():
            p[to_border], n[to_border], at = self._feet(
                self._into(b[to_border])[0], normal[to_border]
            )
            traced |= to_border & np.isfinite(p[:, 0])
            faces[to_border, 0] = at
        if traced.any():
            rows = np.flatnonzero(traced)
            exits = self.exits(p[rows], n[rows])
            good = self.opposite(n[rows], exits, self.angle)
            good &= (kind[rows] != BOTH) | self.opposite(n[rows], exits, ALIGNED)
            value[rows] = np.where(good, exits.t, np.inf)
            far = p[rows] - np.where(good, exits.t, 0.0)[:, None] * n[rows]
            place[rows] = np.stack([p[rows], far], axis=1)
            faces[rows, 1] = exits.face
            wrong = self._is_sharp(faces[rows]) & ~self.opposite(n[rows], exits, ANTIPARALLEL)
            value[rows[wrong]] = np.inf
        if to_crease.any():
            rows = np.flatnonzero(to_crease)
            q = cells.middle[b[rows]]
            inside = q - INWARD * self.size * cells.frame[b[rows]][:, :3]
            foot, n_foot, at = self._feet(inside, normal[rows])
            way = foot - q
            length = np.linalg.norm(way, axis=1)
            cosine = (way * n_foot).sum(axis=1) / np.maximum(length, 1e-300)
            turned = np.abs(np.einsum("nij,nj->ni", cells.frame[b[rows]].reshape(-1, 3, 3), n_foot))
            inward = (cells.frame[b[rows]][:, :3] * n_foot).sum(axis=1) < 0.0
            good = np.isfinite(length) & (cosine >= np.cos(ALIGNED)) & inward
            good &= (turned[:, 1:] <= cells.spread[b[rows]][:, 1:] + 1e-6).all(axis=1)
            value[rows] = np.where(good, length, np.inf)
            place[rows], faces[rows, 0] = np.stack([foot, q], axis=1), at
        return value, place, faces

    def _is_sharp(self, faces: Ints) -> BoolArray:
        n = len(self.solid.surfaces)
        codes = np.array([i * n + j for i, j in self.sharp], np.int64)
        own = np.sort(faces, axis=1)
        return np.isin(own[:, 0] * n + own[:, 1], codes)

    # --- the least

    def _first_value(self, found: Found) -> None:
        """Take the least of the samples at which walls are antiparallel."""
        for p, n, face, exits in (self.sampled, (*self.settled, self.exits(*self.settled[:2]))):
            good = self.opposite(n, exits, ALIGNED)
            faces = np.stack([face, exits.face], axis=1)
            good &= ~self._is_sharp(faces) | self.opposite(n, exits, ANTIPARALLEL)
            t = np.where(good, exits.t, np.inf)
            far = p - np.where(good, exits.t, 0.0)[:, None] * n
            found.take(t, np.stack([p, far], axis=1), faces)

    @cached_property
    def settled(self) -> tuple[FloatArray, FloatArray, Ints]:
        """Points, normals and faces at which chords of samples end that were made shorter.

        The nearest points of both faces in turn: so chords come to be along both normals, where they are least.
        """
        p, n, own, exits = self.sampled
        turned = -(n * np.nan_to_num(exits.normal)).sum(axis=1)
        rows = np.flatnonzero(self.opposite(n, exits, self.angle))
        code = own[rows] * len(self.solid.surfaces) + exits.face[rows]
        chosen = []
        for key in (exits.t[rows], -turned[rows]):
            order = np.lexsort((key, code))
            first = np.searchsorted(code[order], code[order])
            chosen.append(rows[order[np.arange(len(order)) - first < OF_PAIR]])
        every = np.unique(np.concatenate(chosen))
        every = every[np.argsort(exits.t[every], kind="stable")[:SHORTENED]]
        faces = np.stack([own[every], exits.face[every]], axis=1)
        near = {
            k: ClosestPoint(self.solid.surfaces[k], closed=[False], threads=1)
            for k in np.unique(faces).tolist()
        }
        place, normal = p[every].copy(), n[every].copy()
        for _ in range(SETTLINGS):
            before = place.copy()
            for side in (1, 0):
                for k in np.unique(faces[:, side]).tolist():
                    mine = faces[:, side] == k
                    found = near[k].query(place[mine])
                    place[mine], normal[mine] = found.position, found.normal
            if np.abs(place - before).max(initial=0.0) < SMALLEST_STEP * self.size:
                break
        return place, normal, faces[:, 0]

    def pairs(self, search: PairSearch, reach: float, kind: int) -> tuple[Ints, Ints, Ints]:
        """Return the first pairs of cells, of chords along normals (FIRST) or of balls (TOUCHING).

        Chords along both normals are of faces and re-entrant edges alone, so are balls; others begin or end at
        a border.
        """
        kinds = self.cells.ints[self.roots, 3]
        flat, rim = self.roots[kinds == FACE], self.roots[kinds == BORDER]
        bent = self.creases
        a, b = search.near(flat, flat, reach)
        found = [(a[a <= b], b[a <= b])]
        if len(bent):
            found.append(search.near(flat, bent, reach))
            a, b = search.near(bent, bent, reach)
            found.append((a[a < b], b[a < b]))
        whole = [(a, b, BOTH) for a, b in found]
        if kind == TOUCHING:
            (a, b), *others = found
            is_sharp = self._is_sharp(self.cells.ints[np.stack([a, b], axis=1), 1])
            whole = [(x, y, BOTH) for x, y in [(a[is_sharp], b[is_sharp]), *others]]
            whole.append((a[~is_sharp], b[~is_sharp], TOUCHING))
        else:
            a, b = self._without_sharp(*search.near(rim, flat, reach))
            whole += [(a, b, FIRST), (b, a, FIRST)]
        first, second, kinds_of = zip(*whole, strict=True)
        lengths = [len(x) for x in first]
        return np.concatenate(first), np.concatenate(second), np.repeat(kinds_of, lengths)

    def _without_sharp(self, a: Ints, b: Ints) -> tuple[Ints, Ints]:
        keeps = ~self._is_sharp(self.cells.ints[np.stack([a, b], axis=1), 1])
        return a[keeps], b[keeps]

    def least_ray(self, tolerance: float, seconds: float, heard: Heard = None) -> Found:
        """Find the least thickness along inward normals."""
        found = Found()
        self._first_value(found)
        search = self._search(heard)
        pairs = self.pairs(search, min(found.value, self.size), FIRST)
        return search.least(pairs, found, self.chords, tolerance, seconds)

    def _search(self, heard: Heard) -> PairSearch:
        return PairSearch(
            self.cells, self.size, self.angle, zero=self.zero, threads=self._threads, heard=heard
        )

    @property
    def zero(self) -> float:
        """What counts as no thickness: a millionth of the size, or some gaps between faces."""
        return max(1e-6 * self.size, 4.0 * self.solid.gap)

    # --- balls

    @cached_property
    def nearest(self) -> ClosestPoint:
        """Finds the closest point of the part."""
        return ClosestPoint(
            self.solid.surfaces,
            closed=np.zeros(len(self.solid.surfaces), np.bool_),
            threads=self._threads,
        )

    def balls(
        self, p: FloatArray, n: FloatArray, t: FloatArray
    ) -> tuple[FloatArray, FloatArray, Ints]:
        """Return radii of the largest balls inside that touch at points p, their other contacts, and whose.

        A ball that reaches beyond the part shrinks to touch the point of the part that is nearest to its centre
        (Ma, Bae and Choi, "3D medial axis point approximation using nearest neighbors and the normal field",
        The Visual Computer 28, 2012); ``t`` are the thicknesses along the normals.
        """
        r = 0.5 * np.where(np.isfinite(t), t, self.size)
        q, face, left = p - 2.0 * r[:, None] * n, np.full(len(p), -1, np.int64), np.arange(len(p))
        for _ in range(SHRINKINGS):
            if not len(left):
                break
            center = p[left] - r[left, None] * n[left]
            near = self.nearest.query(center)
            way = p[left] - near.position
            smaller = (way**2).sum(axis=1) / np.maximum(2.0 * (way * n[left]).sum(axis=1), 1e-300)
            far = np.linalg.norm(way, axis=1)
            shrinks = (near.distance < r[left] * (1.0 - 1e-9)) & (smaller < r[left])
            shrinks &= far > FROM * self.size
            rows = left[shrinks]
            r[rows], q[rows] = smaller[shrinks], near.position[shrinks]
            face[rows] = near.object_id[shrinks]
            left = rows
        return r, q, face

    def balls_at(
        self, p: FloatArray, n: FloatArray, own: Ints
    ) -> tuple[FloatArray, FloatArray, Ints]:
        """Return diameters of balls with opposite contacts, their contacts, and the faces; inf: not opposite."""
        exits = self.exits(p, n)
        r, q, face = self.balls(p, n, exits.t)
        face = np.where(face < 0, exits.face, face)
        center = p - r[:, None] * n
        cosine = -(n * (q - center)).sum(axis=1) / r
        faces = np.stack([own, face], axis=1)
        good = np.isfinite(exits.t) & (cosine >= np.cos(self.angle))
        good &= ~self._is_sharp(faces) | (cosine >= np.cos(ANTIPARALLEL))
        good &= 2.0 * r > self.zero
        return np.where(good, 2.0 * r, np.inf), np.stack([p, q], axis=1), faces

    def _ball_chords(self, a: Ints, b: Ints, kind: Ints) -> tuple[FloatArray, FloatArray, Ints]:
        """Return real balls of pairs of cells, see `Values`."""
        del kind
        cells = self.cells
        value, place = np.full(len(a), np.inf), np.full((len(a), 2, 3), np.nan)
        faces = cells.ints[np.stack([a, b], axis=1), 1].copy()
        rows = np.flatnonzero((cells.ints[a, 3] == FACE) & (cells.ints[a, 6] == 1))[:TRIED_BALLS]
        if len(rows):
            of = a[rows]
            value[rows], place[rows], faces[rows] = self.balls_at(
                cells.middle[of], cells.frame[of][:, :3], cells.ints[of, 1]
            )
        return value, place, faces

    def _are_blocked(self, a: Ints, b: Ints, kind: Ints) -> BoolArray:
        """Tell which pairs touch no ball inside the part: a point of it is within all balls that touch them.

        The centre is (p + q) / 2 - r (n_p + n_q) / 2, and r is at least half the distance. Where the chord is along
        both normals they cancel.
        """
        cells = self.cells
        p, q = cells.middle[a], cells.middle[b]
        r_a, r_b = cells.radius[a, 0], cells.radius[b, 0]
        half = 0.5 * (np.linalg.norm(p - q, axis=1) - r_a - r_b)
        n_p, n_q = cells.frame[a][:, :3], cells.frame[b][:, :3]
        both = n_p + n_q
        most = half + r_a + r_b  # beyond, the pair is given up by its distance
        spread = sum(np.sqrt((cells.spread[c] ** 2).sum(axis=1)) for c in (a, b))
        tilted = (kind != BOTH)[:, None]
        center = 0.5 * (p + q) - 0.5 * half[:, None] * np.where(tilted, both, 0.0)
        off = 0.5 * most * spread + 0.5 * (most - half) * np.linalg.norm(both, axis=1)
        off = 0.5 * (r_a + r_b) + np.where(tilted[:, 0], off, 0.0)
        blocked = np.zeros(len(a), np.bool_)
        asked = np.flatnonzero(off < 0.5 * half)[:ASKED]
        if len(asked):
            distance = self.nearest.query(center[asked]).distance
            blocked[asked] = distance + off[asked] < half[asked] * (1.0 - 1e-9)
        return blocked

    def are_undercut(self, p: FloatArray, n: FloatArray, pull: FloatArray) -> BoolArray:
        """Tell which points of the surface the part itself covers both along a direction and against it.

        A point leaves the half of the mould toward which its normal leans; side walls leave either.
        """
        sine = n @ pull
        covered = []
        for sign in (1.0, -1.0):
            way = np.tile(sign * pull, (len(p), 1))
            hits = self.tracer.intersect(p + FROM * self.size * n, way, t_min=FROM * self.size)
            slope = np.abs((hits.normal * way).sum(axis=1))
            covered.append((hits.hit & ~(slope < GRAZING)) | (sign * sine < -FLAT_SIDE))
        under: BoolArray = covered[0] & covered[1]
        return under

    def least_ball(self, tolerance: float, seconds: float, heard: Heard = None) -> Found:
        """Find the least diameter of balls inside with opposite contacts."""
        found = Found()
        found.take(*self.sampled_balls)
        found.take(*self.balls_at(*self.settled))
        search = self._search(heard)
        pairs = self.pairs(search, min(found.value, self.size), TOUCHING)
        return search.least(pairs, found, self._ball_chords, tolerance, seconds, self._are_blocked)
