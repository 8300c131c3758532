"""The lines of a lens prescription, and the surfaces that they describe."""

from collections.abc import Sequence
from dataclasses import dataclass

from hybrid_rt.primitives.asphere import Asphere
from meshing.checks import number, shown

# Nothing that light passes has a larger one; wavelengths in nanometres or angstroms have.
LARGEST_INDEX = 100.0


@dataclass(frozen=True)
class LensSurface:
    """One line of a lens prescription.

    Attributes
    ----------
    radius : float
        Radius of curvature at the vertex, positive if the surface is convex towards the incoming
        light; inf is a plane.
    thickness : float
        Distance from this vertex to the next one; 0: they touch. That of the last surface is not used.
    index : float
        Index of refraction behind this surface, above 0 and at most 100.
    aperture : float
        Clear diameter, twice the semi-diameter of other programs.
    conic : float
        Conic constant.
    coefficients : tuple of float
        a_2, a_4, ... as for `Asphere`.
    """

    radius: float
    thickness: float
    index: float
    aperture: float
    conic: float = 0.0
    coefficients: tuple[float, ...] = ()


def checked_lines(prescription: Sequence[LensSurface], index: float) -> tuple[LensSurface, ...]:
    """Return the lines of a prescription, checked; ``index`` is that of the medium in front."""
    try:
        lines = tuple(prescription)
    except TypeError:
        raise TypeError(
            f"Lens prescription is {shown(prescription)}: pass a list of LensSurface"
        ) from None
    if not lines:
        raise ValueError("Lens prescription is empty: pass at least one LensSurface")
    for k, line in enumerate(lines):
        if not isinstance(line, LensSurface):
            raise TypeError(
                f"Lens prescription[{k}] is {shown(line)}: pass LensSurface(radius, thickness, index, "
                "aperture)"
            )
        number(
            line.index,
            f"Lens prescription[{k}].index",
            above=0.0,
            up_to=LARGEST_INDEX,
            hint="of refraction, not the wavelength: 1.5168, as there is no catalogue of glasses; "
            "mirrors are no part of a Lens",
        )
        if k < len(lines) - 1:
            hint = "" if k else "leave out the line of the object, parallel light needs none"
            thickness = number(line.thickness, f"Lens prescription[{k}].thickness", hint=hint)
            if thickness < 0.0 and line.index != index:
                raise ValueError(
                    f"Lens prescription[{k}].thickness is {shown(line.thickness)}: pass at least 0, as light "
                    "meets the surfaces in their order; only behind a stop (the same index on both "
                    "sides) may it be negative"
                )
        index = line.index
    return lines


def surface_of(line: LensSurface, z: float, k: int) -> Asphere:
    """Return the surface of line k, with its vertex at z."""
    try:
        shape = line.radius, line.conic, line.coefficients, line.aperture
        return Asphere(*shape, (0.0, 0.0, z), (0.0, 0.0, 1.0))
    except (ValueError, TypeError) as error:
        raise type(error)(f"Lens prescription[{k}]: {error}") from None
