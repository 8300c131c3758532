"""Aspheres: surfaces of lenses and mirrors, given by their sag."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.checks import FARTHEST
from hybrid_rt.core.records import FloatArray
from hybrid_rt.primitives.axial import AxialSurface
from hybrid_rt.primitives.sag import Sag, Zones
from meshing.checks import IdArray, as_floats, as_similarity, freeze, number, shown, still_unit
from meshing.double_double import misfit, pair_of, rounded_image, stretched

# a_2 to a_32.
MOST_COEFFICIENTS = 16
# Less than this under the square root at the rim, and the conic is as steep as can be.
LEAST_UNDER_ROOT = 1e-3
# Steeper than this the height at a radius that is rounded would not be on the surface any more.
STEEPEST = 32.0
# Steps of w of the bound on the slope, where `N_ZONES` do not suffice: it is 1 % above the slope or
# less, but for the innermost twentieth of the radius.
FINE_ZONES = 1024


class Asphere(AxialSurface):
    """A rotationally symmetric lens or mirror surface, given by its sag.

    A point at distance r from the axis lies at height

        z = c r^2 / (1 + sqrt(1 - (1 + k) c^2 r^2)) + a_2 r^2 + a_4 r^4 + ...,   c = 1 / radius

    above ``origin``, along ``axis``. Rays are intersected with that formula itself.

    S(u, v) = origin + r (cos 2 pi u radial + sin 2 pi u binormal) + z(r) axis with r = v aperture /
    2 and binormal = axis x radial: v is 0 at the vertex and 1 at the rim. The normal is along S_u x
    S_v and has a negative component along ``axis``, so light that travels along ``axis`` meets the
    front side. On a flipped asphere v runs from the rim to the vertex, and the normal points to the
    other side.

    Parameters
    ----------
    radius : number but 0, scene units
        Radius of curvature of the conic part at the vertex. Positive if the centre of curvature
        lies in the direction of ``axis`` from the vertex. ``inf`` is a plane with a polynomial on
        it.
    conic : number
        Conic constant k: 0 is a sphere, -1 a paraboloid, below -1 a hyperboloid, above -1 an
        ellipsoid (above 0 an oblate one).
    coefficients : (n,) numbers, at most 16
        a_2, a_4, ... a_2n, the factors of r^2, r^4, ... r^2n, in one over scene units to the power
        1, 3, ... 2n - 1. If a prescription begins with r^4, put a zero in front.
    aperture : positive number, scene units
        Diameter of the rim, at most 1e60. Rays that pass outside it miss.
    origin : (3,) scene units
        The vertex.
    axis : (3,) direction of any length
    reference : (3,) direction of any length, optional
        u is 0 along this vector, projected onto the plane across the axis. Default: the coordinate
        axis least aligned with ``axis``.

    Raises
    ------
    ValueError, TypeError
        For a radius of 0, numbers that are not finite, an aperture within which the conic turns
        vertical or nearly so, and a slope dz / dr beyond 32.

    Attributes
    ----------
    origin, axis, radial, binormal : (3,) float64, read-only
        The last three are unit vectors.
    radius, conic, aperture : float
    coefficients : (n,) float64, read-only

    References
    ----------
    ISO 10110-12, "Optics and photonics: preparation of drawings, aspheric surfaces".
    """

    flip_of_uv = "v reversed"
    closes = (True, False)

    def __init__(
        self,
        radius: float,
        conic: float,
        coefficients: ArrayLike,
        aperture: float,
        origin: ArrayLike,
        axis: ArrayLike,
        reference: ArrayLike | None = None,
    ) -> None:
        self.radius = _as_radius(radius)
        self.conic = number(conic, "Asphere conic")
        self.coefficients = _as_coefficients(coefficients)
        self.aperture = number(aperture, "Asphere aperture", above=0.0, up_to=FARTHEST)
        self._set_frame(origin, axis, reference)
        self._check_sag()

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether v = 0 is the vertex, and whether v = 1 is."""
        return self.orientation > 0, self.orientation < 0

    def _check_sag(self) -> None:
        """Refuse a sag that ends within the aperture, or is too steep."""
        sag = self.sag
        # Half the aperture in units of the radius: no square of it overflows.
        across = 0.5 * self.aperture / self.radius
        left = 1.0 - (1.0 + self.conic) * across * across
        if not left >= LEAST_UNDER_ROOT:
            most = 2.0 * abs(self.radius) * math.sqrt((1.0 - LEAST_UNDER_ROOT) / (1.0 + self.conic))
            largest = (1.0 - LEAST_UNDER_ROOT) / (across * across) - 1.0
            raise ValueError(
                f"Asphere aperture is {self.aperture:g} with radius {self.radius:g} and conic "
                f"{self.conic:g}: the conic turns vertical within it, pass at most {most:.9g}, or "
                f"a conic of at most {largest:.9g}"
            )
        with np.errstate(all="ignore"):
            z, slope, _ = sag.at(np.array([sag.w_max]))
        if not (np.isfinite(z[0]) and np.isfinite(slope[0])):
            raise ValueError(
                f"Asphere coefficients are {shown(self.coefficients.tolist())}: at the rim their "
                "sum is no finite number, check the units of each"
            )
        self._check_slope()

    def _check_slope(self) -> None:
        """Refuse a sag that is too steep."""
        rim = math.ldexp(0.5 * self.aperture, -self.local_exponent)
        if self.local_zones.steepest(rim) <= STEEPEST:
            return
        # The coarse zones say too much of a sharp vertex, and where the slope changes quickly.
        steepest = self.sag.scaled(-self.local_exponent).zones(FINE_ZONES).steepest(rim)
        if steepest <= STEEPEST:
            return
        # The first ring's bound is that of its middle slope, which a tiny radius makes large.
        least = 0.5 * self.aperture / math.sqrt(FINE_ZONES) / STEEPEST
        squares = self.sag.w_max * np.arange(1, FINE_ZONES + 1) / FINE_ZONES
        reached = np.abs(2.0 * np.sqrt(squares) * self.sag.at(squares)[1]).max()
        if abs(self.radius) < least and reached <= STEEPEST:
            raise ValueError(
                f"Asphere radius is {self.radius:g} with aperture {self.aperture:g}: the vertex is too "
                f"sharp for bounds on its hits; pass a radius of {1.01 * least:.2g} or more, or, for the "
                "tip of an axicon, a Cone"
            )
        remedy = "pass a smaller aperture, or check the units of the coefficients"
        if not self.coefficients.any():
            remedy = (
                "pass a smaller aperture, or what light meets of a steep mirror, from radius a to b, as a "
                "SurfaceOfRevolution, which any conic can be without error: see Grazing mirrors in "
                "docs/optics.md"
            )
            if self.conic == -1.0:
                remedy += (
                    f"; here with the profile [(a*a/{2.0 * self.radius:.17g}, a), "
                    f"(a*b/{2.0 * self.radius:.17g}, (a+b)/2), (b*b/{2.0 * self.radius:.17g}, b)]"
                )
        raise ValueError(
            f"Asphere aperture is {self.aperture:g}: within it the slope dz / dr of the sag "
            f"reaches {steepest:.3g}, at most {STEEPEST:g} is possible; {remedy}"
        )

    @cached_property
    def sag(self) -> Sag:
        """The sag in scene units."""
        return Sag(1.0 / self.radius, self.conic, self.coefficients, (0.5 * self.aperture) ** 2)

    @cached_property
    def local_exponent(self) -> int:
        """The power of two by which scene units are divided so that `ball_radius` is 1/2 to 1."""
        return math.frexp(self.ball_radius)[1]

    @cached_property
    def local_zones(self) -> Zones:
        """Bounds of the sag in units of 2^`local_exponent`."""
        return self.sag.scaled(-self.local_exponent).zones()

    @cached_property
    def ball_radius(self) -> float:
        """Radius of a ball about the vertex that holds the surface, scene units."""
        half = 0.5 * self.aperture
        # In units of the half aperture, so that no power overflows.
        exponent = -math.frexp(half)[1]
        sag = self.sag.scaled(exponent)
        heights, w = np.abs(sag.zones().z).max(axis=1), sag.w_max * np.arange(1, 65) / 64
        return math.ldexp(float(np.sqrt(w + heights**2).max()), -exponent)

    @property
    def bounds(self) -> FloatArray:
        """(2, 3): lower and upper corner of a box around the surface."""
        # Of a circle about the axis the widest part along a coordinate is as long as that
        # coordinate's own part across the axis.
        across = np.hypot(self.radial, self.binormal)
        unit_length = math.ldexp(1.0, self.local_exponent)
        z = self.local_zones.z * unit_length
        rings = 0.5 * self.aperture * np.sqrt(np.arange(1, len(z) + 1) / len(z))
        ends = z[:, :, None] * self.axis
        low = ends.min(axis=1) - rings[:, None] * across
        high = ends.max(axis=1) + rings[:, None] * across
        return np.stack([self.origin + low.min(axis=0), self.origin + high.max(axis=0)])

    @property
    def size(self) -> float:
        """Twice the radius of a ball about the vertex that holds the surface, scene units."""
        return 2.0 * self.ball_radius

    def sag_at(self, r: ArrayLike) -> FloatArray:
        """Return the sag z at heights r from the axis, of any shape and either sign, scene units.

        Raises
        ------
        ValueError, TypeError
            If a height is not a number, or beyond half the aperture.
        """
        r = as_floats(r, "r")
        within = np.abs(r) <= 0.5 * self.aperture
        if not within.all():
            raise ValueError(
                f"r is {r[~within][0]:g}: pass heights from the axis of at most {0.5 * self.aperture:g}"
            )
        z, _, _ = self.sag.at(r * r)
        return z

    def _points(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        cos_u, sin_u, r = self._polar(u, v)
        return self.origin + self._world(r * cos_u, r * sin_u, self.sag.at(r * r)[0])

    def _partials(
        self, u: FloatArray, v: FloatArray, patch_id: IdArray
    ) -> tuple[FloatArray, FloatArray]:
        del patch_id
        cos_u, sin_u, r = self._polar(u, v)
        slope, turn = 2.0 * r * self.sag.at(r * r)[1], 2.0 * np.pi * r
        along_u = self._world(-turn * sin_u, turn * cos_u, np.zeros_like(r))
        along_v = 0.5 * self.aperture * self.orientation * self._world(cos_u, sin_u, slope)
        return along_u, along_v

    def _normals(self, u: FloatArray, v: FloatArray, patch_id: IdArray) -> FloatArray:
        del patch_id
        cos_u, sin_u, r = self._polar(u, v)
        slope = 2.0 * r * self.sag.at(r * r)[1]
        length = np.hypot(1.0, slope)
        across = self.orientation * slope / length
        return self._world(across * cos_u, across * sin_u, -self.orientation / length)

    def _polar(self, u: FloatArray, v: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return cosine and sine of the azimuth, and the distance from the axis."""
        a = 2.0 * np.pi * u
        return np.cos(a), np.sin(a), 0.5 * self.aperture * (v if self.orientation > 0 else 1.0 - v)

    def transformed(self, matrix: ArrayLike) -> Asphere:
        """Return the image under a similarity; see `meshing.surface.Surface.transformed`.

        A reflection reverses the axis of the image, and radius and coefficients change sign, because u
        stays a right-handed angle about the axis.
        """
        turn, shift, scale, is_reflection = as_similarity(matrix, "Asphere")
        linear = np.asarray(matrix, np.float64)[:3, :3]
        origin, off = rounded_image(linear, shift, pair_of(self.origin))
        sign = -1 if is_reflection else 1
        powers = scale ** (1.0 - 2.0 * np.arange(1, len(self.coefficients) + 1))
        axis = still_unit(sign * (turn @ self.axis), "axis")
        radial = turn @ self.radial
        radius, aperture = sign * scale * self.radius, scale * self.aperture
        coefficients = sign * self.coefficients * powers
        image = Asphere(radius, self.conic, coefficients, aperture, origin, axis, radial)
        # Bit for bit, where a scale by a power of two leaves them.
        image.axis = freeze(axis)
        image.radial = freeze(still_unit(radial - (radial @ axis) * axis, "radial"))
        image.orientation = self.orientation
        off += self.ball_radius * misfit(linear, scale, self.axis, sign * axis)
        if math.frexp(scale)[0] != 0.5:
            off += scale * 2.0**-50 * self._scaling_error()
        image.moved = off + stretched(linear, self.moved)
        return image

    def _scaling_error(self) -> float:
        """By how much the surface moves if each of its numbers changes by one part, in such parts."""
        w = np.array([self.sag.w_max])
        conic = Sag(1.0 / self.radius, self.conic, np.empty(0), float(w[0])).at(w)
        slope = self.sag.at(w)[1]
        # Of z = R f(r / R) the derivative R dz / dR is z - r dz / dr, and dz / dr is 2 r dz / dw.
        terms = np.abs(self.coefficients) * w ** np.arange(1, len(self.coefficients) + 1)
        parts = np.abs(conic[0]) + 2.0 * w * np.abs(conic[1]) + terms.sum()
        return float((parts + np.sqrt(w) * (1.0 + 2.0 * np.sqrt(w) * np.abs(slope)))[0])

    def __repr__(self) -> str:
        """Say which asphere this is."""
        return (
            f"Asphere(radius={self.radius}, conic={self.conic}, "
            f"coefficients={self.coefficients.tolist()}, aperture={self.aperture}, "
            f"origin={self.origin.tolist()}, axis={self.axis.tolist()})"
        )


def _as_radius(value: float) -> float:
    """Return a radius of curvature: any number but 0, or infinity."""
    array = as_floats(value, "Asphere radius")
    if array.shape != ():
        raise TypeError(f"Asphere radius is {shown(value)}: pass one number")
    radius = float(array)
    if math.isnan(radius) or radius == 0.0:
        raise ValueError(f"Asphere radius is {radius:g}: pass a number but 0, or inf for a plane")
    return abs(radius) if math.isinf(radius) else radius


def _as_coefficients(values: ArrayLike) -> FloatArray:
    """Return the coefficients of the polynomial, read-only."""
    array = as_floats(values, "Asphere coefficients")
    if array.ndim != 1 or len(array) > MOST_COEFFICIENTS:
        raise ValueError(
            f"Asphere coefficients have shape {array.shape}: pass a_2, a_4, ..., at most "
            f"{MOST_COEFFICIENTS} of them, [] for none"
        )
    bad = np.flatnonzero(~np.isfinite(array))
    if bad.size:
        raise ValueError(
            f"Asphere coefficient a_{2 * bad[0] + 2} is {array[bad[0]]}: pass finite numbers"
        )
    return freeze(array.copy())
