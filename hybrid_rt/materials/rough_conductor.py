"""Rough conductors: gold, silver, brass and other metals, from nearly polished to matt."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.suggestions import explains
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.materials.roughness import alpha_of
from hybrid_rt.shading.kernels.lobes.register import NARROW, ROUGH_CONDUCTOR, WIDE
from hybrid_rt.shading.kernels.lobes.rough_conductor import normal_reflectance
from hybrid_rt.textures.texture import ConstantTexture

# Measured indices, averaged over the spectrum with the weights that red, green and blue of sRGB
# (linear) have by the colour matching functions of the CIE of 1931; each weight adds up to one.
# At normal incidence they reflect within 0.014 of the measured spectra so averaged, but for the red
# of gold (0.968): its saturated 1.006 is no colour that a metal of three channels can have.
# Gold, copper, silver: Johnson and Christy, "Optical constants of the noble metals", Phys. Rev. B 6, 4370
# (1972). Aluminium: Rakic, "Algorithm for the determination of intrinsic optical constants of metal
# films: application to aluminum", Appl. Opt. 34, 4755 (1995). Brass, of 70 % copper and 30 % zinc: Querry,
# "Optical constants", report CRDC-CR-85034 (1985). Iron, nickel, chromium: Johnson and Christy, "Optical
# constants of transition metals", Phys. Rev. B 9, 5056 (1974).
METALS = {
    "gold": ((0.1077, 0.4885, 1.4777), (3.5085, 2.3377, 1.8090)),
    "copper": ((0.2371, 1.0372, 1.2982), (3.2441, 2.6011, 2.3527)),
    "silver": ((0.0554, 0.0547, 0.0427), (4.2932, 3.5431, 2.5347)),
    "aluminium": ((1.4411, 0.9885, 0.5854), (7.5579, 6.5664, 5.3061)),
    "brass": ((0.4316, 0.5154, 1.1451), (3.5837, 2.6941, 1.7543)),
    "iron": ((2.9166, 2.9214, 2.5319), (3.0649, 2.9394, 2.7419)),
    "nickel": ((2.0100, 1.9039, 1.7193), (4.1208, 3.5741, 2.8629)),
    "chromium": ((3.2240, 3.1171, 2.2559), (3.2912, 3.3388, 3.1133)),
}
# Half of what a lobe reflects leaves within 2 atan(alpha) of the mirror direction: a quarter of the
# hemisphere from here on. Of the photons around a point enough then fall within the lobe. Gathering
# costs as much as following at a roughness of about 0.57 (error x time on a ball over a floor, by
# ppm), twice as much at 0.45, 0.8 times at 0.62.
WIDE_FROM = 7.0**-0.5


@explains(alpha="roughness = sqrt(alpha)", metal="its name to RoughConductor.of")
class RoughConductor(Material):
    """A rough metal with the complex index of refraction eta + i k. Both sides reflect.

    The model has GGX microfacets with Smith's height-correlated shadowing and masking, and the
    Fresnel reflectance of conductors. Interreflection between microfacets is lost, so rougher metal
    is darker.

    Parameters
    ----------
    eta, k : number or three numbers
        Real and imaginary part of the index, relative to the surroundings, from 1e-3 to 1e3; three
        numbers are for red, green and blue. See the notes for metals that `of` does not know.
    roughness : float
        From 0.01 to 1; the alpha of GGX is its square. From 0.615 on the lobe counts as wide:
        photon density is estimated on it, and Whitted's method lights it directly. Below that, one
        sampled direction is followed.

    Raises
    ------
    ValueError, TypeError
        If an argument is out of range or not a number; the message names it.

    Attributes
    ----------
    eta, k : (3,) float64

    Notes
    -----
    Measured indices n and k of many metals and alloys are at https://refractiveindex.info. Take the
    values at about 630, 532 and 467 nm for red, green and blue. `of` has values that stand for the
    spectrum: averages with the weights that red, green and blue of sRGB have by the colour matching
    functions of the CIE of 1931. At normal incidence both reflect alike within 0.05 for its metals;
    gold differs most, with (0.94, 0.70, 0.40) at the three wavelengths, and (0.97, 0.75, 0.37) on
    average.

    References
    ----------
    Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007. Heitz,
    "Understanding the masking-shadowing function in microfacet-based BRDFs", JCGT 3(2), 2014.
    """

    def __init__(self, eta: ArrayLike, k: ArrayLike, roughness: float) -> None:
        self.eta, self.k = real, imaginary = _index(eta, "eta"), _index(k, "k")
        alpha = alpha_of(roughness, "RoughConductor roughness", "Mirror")
        color = [normal_reflectance(*pair) for pair in zip(real, imaginary, strict=True)]
        number = (*real.tolist(), *imaginary.tolist(), alpha)
        breadth = WIDE if alpha >= WIDE_FROM else NARROW
        # The colour is what is reflected at normal incidence.
        texture = ConstantTexture(np.array(color))
        self._lobes = (Lobe(ROUGH_CONDUCTOR, texture, number, breadth=breadth),)

    @classmethod
    @explains(alpha="roughness = sqrt(alpha)")
    def of(cls, metal: str, roughness: float) -> RoughConductor:
        """Return a metal with measured indices.

        Parameters
        ----------
        metal : "gold", "copper", "silver", "aluminium", "brass", "iron", "nickel" or "chromium"
        roughness : float
            As for the class.

        Raises
        ------
        ValueError, TypeError
            If the metal is not known, or the roughness is out of range.
        """
        known = checks.choice(
            metal,
            "RoughConductor metal",
            METALS,
            "or RoughConductor(eta, k, roughness) with its optical constants",
        )
        return cls(*METALS[known], roughness)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        *index, alpha = self._lobes[0].number
        eta, k = one_or_three(np.array(index[:3])), one_or_three(np.array(index[3:]))
        return call(self, eta=eta, k=k, roughness=math.sqrt(alpha))


def _index(value: ArrayLike, name: str) -> FloatArray:
    index = checks.rgb(value, f"RoughConductor {name}", up_to=1e3)
    if index.min() < 1e-3:
        raise ValueError(f"RoughConductor {name} is {index.tolist()}: pass numbers from 0.001 on")
    return index
