"""Snell's law on arrays of rays, for those who trace lenses and mirrors themselves."""

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core.records import FloatArray
from hybrid_rt.shading.kernels.fresnel import reflect_directions, refract_directions, split_at_glass
from meshing.checks import as_floats, shown, units


def refract(direction: ArrayLike, normal: ArrayLike, n1: ArrayLike, n2: ArrayLike) -> FloatArray:
    """Refract directions at surfaces between two media by Snell's law, n1 sin i = n2 sin t.

    Parameters
    ----------
    direction : (n, 3) or (3,) floats, of any length but zero
        The direction in which the light travels.
    normal : (n, 3) or (3,) floats, of any length but zero
        Normals of either sign, such as ``hits.normal``.
    n1, n2 : number or (n,) floats, positive
        Indices of refraction of the medium that the light comes from, and of the one beyond.

    Returns
    -------
    (n, 3) or (3,) float64
        Unit vectors; nan in case of total reflection, which includes light along the surface.

    Raises
    ------
    ValueError, TypeError
        For vectors that are zero or not finite, indices that are not positive and finite, and
        shapes that do not match.

    Examples
    --------
    >>> import numpy as np
    >>> inside = refract((np.sqrt(0.5), 0.0, np.sqrt(0.5)), (0, 0, -1), 1.0, np.sqrt(2.0))
    >>> np.round(np.degrees(np.arcsin(inside[0])), 12)
    np.float64(30.0)
    """
    d, n, is_single = _pairs(direction, normal)
    before, beyond = _indices(n1, "n1", len(d)), _indices(n2, "n2", len(d))
    out = np.empty_like(d)
    refract_directions(d, n, before, beyond, out)
    return out[0] if is_single else out


def reflect(direction: ArrayLike, normal: ArrayLike) -> FloatArray:
    """Reflect directions at mirrors.

    Parameters
    ----------
    direction, normal : (n, 3) or (3,) floats, of any length but zero
        The direction in which the light travels, and normals of either sign.

    Returns
    -------
    (n, 3) or (3,) float64
        Unit vectors.

    Raises
    ------
    ValueError, TypeError
        For vectors that are zero or not finite, and shapes that do not match.
    """
    d, n, is_single = _pairs(direction, normal)
    out = np.empty_like(d)
    reflect_directions(d, n, out)
    return out[0] if is_single else out


def reflectance(
    direction: ArrayLike, normal: ArrayLike, n1: ArrayLike, n2: ArrayLike
) -> float | FloatArray:
    """Return the part of the power that is reflected between two media, by Fresnel's equations.

    The light is unpolarised, and the media do not absorb. Behind a slanted surface it is polarised in
    part, which the next surface would need to know: see the how-to on non-sequential rays.

    Parameters
    ----------
    direction, normal, n1, n2
        Those of `refract`.

    Returns
    -------
    (n,) float64, or float for single vectors
        1 in case of total reflection. What is left is refracted.

    Raises
    ------
    ValueError, TypeError
        As `refract`.

    Examples
    --------
    >>> round(reflectance((0, 0, 1), (0, 0, 1), 1.0, 1.5), 12)
    0.04
    """
    d, n, is_single = _pairs(direction, normal)
    eta = _indices(n2, "n2", len(d)) / _indices(n1, "n1", len(d))
    out = np.empty(len(d))
    split_at_glass(d, n, eta, np.zeros(len(d)), out, np.empty_like(d))
    return float(out[0]) if is_single else out


def _pairs(direction: ArrayLike, normal: ArrayLike) -> tuple[FloatArray, FloatArray, bool]:
    """Return unit directions and normals (n, 3), and whether both were given as one vector."""
    d, n = _vectors(direction, "direction"), _vectors(normal, "normal")
    is_single = d.ndim == n.ndim == 1
    d, n = d.reshape(-1, 3), n.reshape(-1, 3)
    if len(d) != len(n) and 1 not in (len(d), len(n)):
        raise ValueError(
            f"{len(d)} directions but {len(n)} normals: pass one of each per ray, or one for all"
        )
    shape = np.broadcast_shapes(d.shape, n.shape)
    return _units(d, "direction", shape), _units(n, "normal", shape), is_single


def _vectors(values: ArrayLike, name: str) -> FloatArray:
    array = as_floats(values, name)
    if array.ndim not in (1, 2) or array.shape[-1] != 3:
        raise ValueError(f"{name} has shape {array.shape}: pass (n, 3) or one vector (3,)")
    return array


def _units(vectors: FloatArray, name: str, shape: tuple[int, ...]) -> FloatArray:
    """Return unit vectors of a shape."""
    largest = np.abs(vectors).max(axis=1, initial=0.0)
    bad = np.flatnonzero(~((largest > 0.0) & (largest < np.inf)))
    if bad.size:
        raise ValueError(
            f"{name}[{bad[0]}] = {vectors[bad[0]].tolist()} is no direction ({bad.size} such row(s)): "
            "leave out rays that miss, or that were reflected totally"
        )
    return np.array(np.broadcast_to(units(vectors), shape), order="C")


def _indices(values: ArrayLike, name: str, n: int) -> FloatArray:
    """Return one index of refraction per ray."""
    array = as_floats(values, name)
    if array.shape not in ((), (1,), (n,)):
        raise ValueError(f"{name} has shape {array.shape} for {n} rays: pass one number or ({n},)")
    if not ((array > 0.0) & (array < np.inf)).all():
        raise ValueError(f"{name} is {shown(values)}: pass indices of refraction above 0")
    return np.array(np.broadcast_to(array.reshape(-1), (n,)), order="C")
