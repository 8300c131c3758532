"""Light that passes the surfaces of a lens in their order, its focus, and its spots."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.analysis.lens.prescription import (
    LARGEST_INDEX,
    LensSurface,
    checked_lines,
    surface_of,
)
from hybrid_rt.analysis.lens.traced import Fate, Traced, checked_rays, hits_from, warn_of_crossing
from hybrid_rt.core.one_line import cut
from hybrid_rt.core.records import FloatArray
from hybrid_rt.intersection import Intersector
from hybrid_rt.shading.snell import reflectance, refract
from meshing.checks import as_floats, number, shown, whole

# The parabasal rays of `focus` run this part of the first aperture beside the axis: aberrations of third
# order change the focal length by its square, and rounding by its inverse.
BESIDE = 1e-4
# In units of the widest aperture. Of what is longer the places of the vertices have less than ten digits.
LONGEST = 1e6
CHECK = "check its apertures, and that its surfaces lie in order"
# Rays across the light in which that is looked for which passes: first few, then many. If it spans too few
# cells, so many on each side of one that passes, or nearly does, are looked at more closely, at most so
# often: the last cells are 1e-9 of the light.
LOOKS = (64, 512)
FEW, CELLS, CLOSER_LOOKS = 8, 4, 7


class Focus(NamedTuple):
    """Where light that arrives along the axis comes together.

    Attributes
    ----------
    focal_length, back_focal_distance : float
        Distances to the focus from the rear principal plane, and from the last vertex; inf if the
        light leaves parallel to the axis, and very large if it does so up to rounding only, as behind
        an afocal lens. (Its magnification is the ratio of the heights of a ray, see `Lens.trace`.)
    """

    focal_length: float
    back_focal_distance: float


class Lens:
    """A sequence of surfaces about the z axis.

    Parameters
    ----------
    prescription : sequence of LensSurface
        The surfaces in the order in which the light meets them. A surface with the same index on
        both sides is a stop.
    index : float
        Index of refraction of the medium in front.

    Raises
    ------
    ValueError, TypeError
        For an empty prescription, indices that are not positive, negative thicknesses behind what is
        no stop, and surfaces that `Asphere` refuses; the line is named. And for one that is a million
        times longer than wide.

    Attributes
    ----------
    prescription, index
        As given; the prescription is a tuple.
    vertices : (k,) float64
        The z of each surface's vertex; the first is 0.
    surfaces : list of Asphere
        The k surfaces in their places. Their normals point against the light.
    """

    def __init__(self, prescription: Sequence[LensSurface], index: float = 1.0) -> None:
        self.index = number(index, "Lens index", above=0.0, up_to=LARGEST_INDEX)
        self.prescription = checked_lines(prescription, self.index)
        steps = [surface.thickness for surface in self.prescription]
        self.vertices = np.concatenate([[0.0], np.cumsum(steps[:-1])])
        self.surfaces = [
            surface_of(s, z, k)
            for k, (s, z) in enumerate(zip(self.prescription, self.vertices.tolist(), strict=True))
        ]
        length = sum(map(abs, steps[:-1]))
        widest = max(surface.aperture for surface in self.surfaces)
        if length > LONGEST * widest:
            raise ValueError(
                f"Lens prescription is {length:g} long, and {widest:g} wide: its vertices would lose their "
                "digits. Leave out the line of the object; rays from afar may start anywhere on their way"
            )
        self._tracers = [Intersector(surface) for surface in self.surfaces]

    def __repr__(self) -> str:
        """Return how many surfaces there are, and where the last one is."""
        far = f"{self.vertices[-1]:.6g}"
        return cut(f"Lens({len(self.surfaces)} surfaces, last vertex at z = {far})", "...)")

    def trace(self, origins: ArrayLike, directions: ArrayLike) -> Traced:
        """Refract rays at one surface after the other.

        Rays that miss an aperture, or are totally reflected, do not get through. Nor do rays whose
        next surface lies behind them: those that start behind the first one, or pass where two
        surfaces cross, since the thickness at the edge is negative there. Nor do rays that meet a
        surface from behind. A ray that starts on the first surface is refracted there, and surfaces
        may touch.

        Parameters
        ----------
        origins, directions : (n, 3) or (3,) floats
            Rays in front of the first surface, or from it; one origin goes with all directions, and one
            direction with all origins. Directions may have any length but zero.

        Returns
        -------
        Traced

        Raises
        ------
        ValueError, TypeError
            For rays that are not finite, directions of length zero, and shapes that do not match.

        Warns
        -----
        UserWarning
            If rays meet a surface behind the first one from behind, as where the lens is too thin at
            its edge.
        """
        rays = self._refracted(origins, directions)
        warn_of_crossing(rays, 3)
        return rays

    def _refracted(self, origins: ArrayLike, directions: ArrayLike) -> Traced:
        """As `trace`, without its warning."""
        starts, d = checked_rays(origins, directions)
        o, n = starts, len(starts)
        position, direction = np.full((n, 3), np.nan), np.full((n, 3), np.nan)
        path, bound, part, rows = np.zeros(n), np.zeros(n), np.ones(n), np.arange(n)
        stopped, fate = np.full(n, -1, np.int32), np.zeros(n, np.int32)
        index, last = self.index, len(self.surfaces) - 1
        for k, (tracer, surface) in enumerate(zip(self._tracers, self.prescription, strict=True)):
            hits, t = hits_from(tracer, self.surfaces[k], o, d)
            found = hits.hit & hits.front_face
            if not found.all():
                lost = ~found
                stopped[rows[lost]] = k
                # A surface that the same line meets behind the ray, or from its back, lies wrong.
                is_behind = hits.hit[lost] | tracer.intersect(o[lost], -d[lost]).hit
                fate[rows[lost]] = np.where(is_behind, Fate.BEHIND, Fate.OUTSIDE)
            rows, hits, t, o, d = rows[found], hits[found], t[found], o[found], d[found]
            bound[rows] = np.maximum(bound[rows], hits.t_bound)
            if surface.index == index and k < last:
                # A stop bends nothing. Rays go on from where they were: the next surface may touch
                # the stop or, beside the axis, lie in front of it.
                continue
            path[rows] += index * t
            part[rows] *= 1.0 - reflectance(d, hits.normal, index, surface.index)
            d = refract(d, hits.normal, index, surface.index)
            o, index = hits.position, surface.index
            goes_on = ~np.isnan(d[:, 0])
            stopped[rows[~goes_on]] = k
            fate[rows[~goes_on]] = Fate.TOTAL_REFLECTION
            rows, o, d = rows[goes_on], o[goes_on], d[goes_on]
        position[rows], direction[rows] = o, d
        path[stopped >= 0] = bound[stopped >= 0] = part[stopped >= 0] = np.nan
        return Traced(position, direction, stopped < 0, path, bound, stopped, fate, starts, part)

    def focus(self) -> Focus:
        """Find the focus of rays close to the axis, by tracing one.

        Raises
        ------
        ValueError
            If the ray does not get through.
        """
        height = BESIDE * self.prescription[0].aperture
        start = -max(abs(self.surfaces[0].bounds[:, 2]).max(), self._reaches_before()) - height
        ray = self._refracted(np.array([[height, 0.0, start]]), np.array([[0.0, 0.0, 1.0]]))
        if not ray.passed[0]:
            raise ValueError(f"a ray beside the axis does not pass the lens: {CHECK}")
        x, dx, dz = ray.position[0, 0], ray.direction[0, 0], ray.direction[0, 2]
        if dx == 0.0:
            return Focus(math.inf, math.inf)
        crosses = ray.position[0, 2] - x * dz / dx
        return Focus(float(-height * dz / dx), float(crosses - self.vertices[-1]))

    def paraxial_focus(self) -> Focus:
        """Return the focus from the product of paraxial matrices (Gaussian optics), without rays.

        That of an afocal system which collimates up to rounding only is very large instead of inf.
        """
        system, before = np.eye(2), self.index
        last = len(self.prescription) - 1
        for k, s in enumerate(self.prescription):
            a2 = s.coefficients[0] if len(s.coefficients) else 0.0
            curvature = 1.0 / s.radius + 2.0 * a2
            system = (
                np.array([[1.0, 0.0], [(before - s.index) * curvature / s.index, before / s.index]])
                @ system
            )
            if k < last:
                system = np.array([[1.0, s.thickness], [0.0, 1.0]]) @ system
            before = s.index
        height, slope = system @ (1.0, 0.0)
        if slope == 0.0:
            return Focus(math.inf, math.inf)
        return Focus(float(-1.0 / slope), float(-height / slope))

    def parallel(self, field: float, pupil: float | None = None, n: int = 64) -> Traced:
        """Trace parallel light through the lens.

        Parameters
        ----------
        field : float
            Angle to the axis, degrees, in the y-z plane.
        pupil : float, optional
            Diameter of the disc, in the plane of the first vertex, that the light fills. This is the
            entrance pupil only where the stop is the first surface. Default: the light fills the
            smallest rectangle there that holds all which the apertures let through, as found by
            rays on a grid of 64 x 64.
        n : int
            Number of rays across that disc, or along the longer side of the rectangle, on a square
            grid.

        Returns
        -------
        Traced
            One row for each ray, lost ones included. Paths begin in a plane across the light.

        Raises
        ------
        ValueError
            If no ray gets through, or an argument is outside its limits.

        Warns
        -----
        UserWarning
            As `trace`.
        """
        rays = self._filled(self._angle(field), pupil, n)
        warn_of_crossing(rays, 3)
        return rays

    def from_point(self, point: ArrayLike, pupil: float | None = None, n: int = 64) -> Traced:
        """Trace the light of a point through the lens; otherwise as `parallel`.

        Rays cross the plane of the first vertex on a square grid, so those far from the axis lie nearer to each
        other, seen from the point: power by angles is to be weighted by that. Paths begin at the point.

        Parameters
        ----------
        point : (3,) floats
            In front of the lens, z below 0: not where the light may already have met it, nor a million times
            farther away than the lens is wide.
        """
        rays = self._filled(self._point(point, "Lens point"), pupil, n)
        warn_of_crossing(rays, 3)
        return rays

    def _light(self, field: ArrayLike) -> _Light:
        """Return what a field means: an angle in degrees, or a point."""
        if np.ndim(field) == 0:
            return self._angle(field)
        return self._point(field, "Lens field", "an angle in degrees, or a point (x, y, z)")

    def _angle(self, field: Any) -> _Light:
        degrees = number(field, "Lens field", above=-90.0, below=90.0)
        angle = math.radians(degrees)
        return _Light(f"{degrees:g} degrees", np.array([0.0, math.sin(angle), math.cos(angle)]))

    def _point(self, point: ArrayLike, name: str, kinds: str = "(x, y, z)") -> _Light:
        place = as_floats(point, name)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ValueError(f"{name} is {shown(point)}: pass {kinds}")
        width = max(s.aperture for s in self.surfaces)
        # Boxes around surfaces are wider by rounding.
        nearest = round(-self._reaches_before() / width, 9) * width + 0.0
        if not place[2] < nearest:
            raise ValueError(
                f"{name} is {shown(point)}, but the lens begins at z = {nearest:g}: pass a point in front of "
                "that; trace takes rays from anywhere"
            )
        if np.abs(place).max() > LONGEST * width:
            raise ValueError(
                f"{name} is {shown(point)}, farther away than {LONGEST:g} times the width of the lens: pass an "
                "angle, as for a point at infinity"
            )
        x, y, z = place.tolist()
        return _Light(f"({x:g}, {y:g}, {z:g})", place, is_point=True)

    def _filled(self, light: _Light, pupil: float | None, n: int) -> Traced:
        """Trace the rays of `parallel` or `from_point`, without their warning."""
        whole(n, "Lens n", at_least=1)
        if pupil is None:
            points = _grid(*self._what_passes(light), n)
        else:
            half = 0.5 * number(pupil, "Lens pupil", above=0.0)
            points = _grid((-half, -half), (half, half), n)
            points = points[np.hypot(*points.T) <= half]
        rays = self._through(points, light)
        if not rays.passed.any():
            self._refuse_field(light, rays, "a larger n, if light passes between these rays")
        return rays

    def _through(self, points: FloatArray, light: _Light) -> Traced:
        """Trace light that crosses the plane of the first vertex at points (k, 2)."""
        points = np.column_stack([points, np.zeros(len(points))])
        if light.is_point:
            return self._refracted(light.vector, points - light.vector)
        # From a plane across the light, so far in front that it meets no surface.
        way = light.vector
        width = 2.0 * float(np.abs(points).max()) + self.prescription[0].aperture
        front = (width + self._reaches_before()) / way[2]
        return self._refracted(points - (front + points @ way)[:, None] * way, way)

    def _reaches_before(self) -> float:
        """Return how far what light may meet first reaches before the plane of the first vertex.

        That is the first surface that refracts, and the stops before it: behind a virtual entrance
        pupil (a stop with a negative thickness) surfaces lie in front of the first vertex.
        """
        bends = [line.index != self.index for line in self.prescription]
        first = bends.index(True) + 1 if True in bends else len(bends)
        return -min(0.0, *(float(surface.bounds[0, 2]) for surface in self.surfaces[:first]))

    def _what_passes(self, light: _Light) -> tuple[FloatArray, FloatArray]:
        """Return the corners of a rectangle, as `parallel` says, that holds what passes."""
        first = self.surfaces[0].bounds
        # Light meets the first surface within its rim, and crosses the plane of its vertex beside it.
        rim = float(np.abs(first[:, :2]).max())
        reach = rim + np.abs(first[:, 2]).max() * light.steepest(rim, float(first[0, 2]))
        for n in LOOKS:
            points, cell = _grid((-reach, -reach), (reach, reach), n), 2.0 * reach / n
            rays = self._through(points, light)
            met = points[rays.passed]
            if met.size:
                break
        wide = rays
        for _ in range(CLOSER_LOOKS):
            if met.size and np.ptp(met, axis=0).min() >= FEW * cell:
                break
            middle = met[len(met) // 2] if met.size else self._nearest_to_pass(points, rays, light)
            if middle is None:
                break
            half, n = CELLS * cell, LOOKS[0]
            points, cell = _grid(middle - half, middle + half, n), 2.0 * half / n
            rays = self._through(points, light)
            met = points[rays.passed]
            # What passes may be narrow and long, and go on beyond these points.
            while met.size and np.abs(met - middle).max() > half - cell and half < reach:
                half, n = 2.0 * half, min(2 * n, LOOKS[-1])
                points, cell = _grid(middle - half, middle + half, n), 2.0 * half / n
                rays = self._through(points, light)
                met = np.concatenate([met, points[rays.passed]])
        if not met.size:
            self._refuse_field(light, wide, "pupil=, if very little light passes")
        return met.min(axis=0) - cell, met.max(axis=0) + cell

    def _nearest_to_pass(
        self, points: FloatArray, rays: Traced, light: _Light
    ) -> FloatArray | None:
        """Return the point of the lost ray that gets farthest, and is least beside the aperture there."""
        k = int(rays.stopped_at.max())
        beside = points[(rays.stopped_at == k) & (rays.fate == Fate.OUTSIDE)]
        if not len(beside):
            return None
        rim = self.vertices[k] + float(self.surfaces[k].sag_at(0.5 * self.surfaces[k].aperture))
        if k == 0:
            at_rim = light.at(beside, rim)
        else:
            at_rim = Lens(self.prescription[:k], self.index)._through(beside, light).at(rim)
        return beside[np.hypot(*at_rim.T).argmin()]

    @staticmethod
    def _refuse_field(light: _Light, rays: Traced, remedy: str) -> NoReturn:
        lost, count = np.unique(rays.stopped_at, return_counts=True)
        raise ValueError(
            f"no light from {light.name} passes the lens: most is stopped at "
            f"prescription[{lost[count.argmax()]}]; {CHECK}; or pass {remedy}"
        )

    def spot(
        self, field: ArrayLike, z: float, pupil: float | None = None, n: int = 64
    ) -> tuple[FloatArray, FloatArray, float]:
        """Trace parallel light, or that of a point, through the lens to a plane; otherwise as `parallel`.

        Parameters
        ----------
        field : float or (3,) floats
            Angle in degrees, as for `parallel`, or a point in front of the lens, as for `from_point`; these
            also tell how many rays were lost, and where.
        z : float
            Position of the plane, from the first vertex: the focus is at
            ``vertices[-1] + focus().back_focal_distance``. Rays are carried on as they leave the lens, also
            backward to a plane in front of its last surface.

        Returns
        -------
        points : (k, 2) float64
            (x, y) of the rays that get through.
        centroid : (2,) float64
            The mean of these points; the chief ray meets the plane elsewhere if there is coma.
        rms : float
            Root mean square distance of the points from their mean.
        """
        z = number(z, "Lens.spot z")
        met = self._passed(field, pupil, n).at(z)
        centroid = met.mean(axis=0)
        return met, centroid, float(np.sqrt(((met - centroid) ** 2).sum(axis=1).mean()))

    def plane_of_least_spread(
        self, z: float, *, field: ArrayLike = 0.0, pupil: float | None = None, n: int = 64
    ) -> float:
        """Return the z, near a given one, where the spot is smallest (rms).

        Parameters are those of `spot`, all but ``z`` by name; parallel light along the axis is the default.
        The spot is measured about its centroid.

        Raises
        ------
        ValueError
            If no ray gets through, or all leave parallel to each other.
        """
        z = number(z, "Lens.plane_of_least_spread z")
        rays = self._passed(field, pupil, n)
        points = rays.at(z)
        slopes = rays.direction[:, :2] / rays.direction[:, 2:]
        points, slopes = points - points.mean(axis=0), slopes - slopes.mean(axis=0)
        spread = float((slopes * slopes).sum())
        # Slopes of parallel rays differ by rounding.
        if spread <= len(slopes) * 1e-28:
            raise ValueError(
                "all light leaves the lens in one direction: its spot is as wide everywhere"
            )
        return z - float((points * slopes).sum()) / spread

    def _passed(self, field: ArrayLike, pupil: float | None, n: int) -> Traced:
        """Return the light that gets through; warn of a lens that cannot be made."""
        rays = self._filled(self._light(field), pupil, n)
        warn_of_crossing(rays, 4)
        return rays[rays.passed]


@dataclass(frozen=True)
class _Light:
    """Parallel light in a direction, or that of a point; ``name`` is for messages."""

    name: str
    vector: FloatArray
    is_point: bool = False

    def steepest(self, rim: float, nearest: float) -> float:
        """Return the largest slope against the axis of light to within ``rim`` of it, from ``nearest`` on."""
        x, y, z = map(float, self.vector)
        return (rim + math.hypot(x, y)) / (nearest - z) if self.is_point else abs(y / z)

    def at(self, points: FloatArray, z: float) -> FloatArray:
        """Return where light through points (n, 2) of the plane z = 0 crosses another plane, (n, 2)."""
        if self.is_point:
            crossing: FloatArray = points - (points - self.vector[:2]) * (z / self.vector[2])
        else:
            crossing = points + z / self.vector[2] * self.vector[:2]
        return crossing


def _grid(low: ArrayLike, high: ArrayLike, n: int) -> FloatArray:
    """Return the middles (k, 2) of square cells that fill a rectangle, n along its longer side."""
    corner, size = np.asarray(low, dtype=np.float64), np.subtract(high, low)
    counts = np.maximum(np.round(n * size / size.max()), 1).astype(int)
    x, y = (corner[c] + size[c] * (np.arange(counts[c]) + 0.5) / counts[c] for c in (0, 1))
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
