"""Mixtures of materials."""

from collections.abc import Sequence
from dataclasses import replace

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call
from hybrid_rt.materials.material import Lobe, Material
from hybrid_rt.shading.kernels.lobes.register import TRANSMITS

# Weights that should add up to one may exceed it by rounding.
_ROUNDING = 1e-12


class Mix(Material):
    """A weighted sum of materials; if the weights sum to less than 1, the rest is absorbed.

    Parameters
    ----------
    parts : sequence of (weight, Material)
        Weights are at least 0, and their sum is at most 1. At most one part may be a dielectric.
        For a mixture that emits light, pass it to `Emissive` as ``base``.

    Raises
    ------
    ValueError, TypeError
        If a part is invalid, or the weights sum to more than 1; the message names the part.
    """

    def __init__(self, parts: Sequence[tuple[float, Material]]) -> None:
        lobes: list[Lobe] = []
        named: list[tuple[float, Material]] = []
        total = 0.0
        given = checks.items(parts, "Mix parts")
        if not given:
            raise ValueError(
                "Mix parts is empty: pass (weight, material) pairs (black: Lambertian(0))"
            )
        for i, part in enumerate(given):
            try:
                weight, material = part
            except (TypeError, ValueError) as error:
                raise TypeError(
                    f"Mix part {i} is {checks.shown(part)}: pass (weight, material)"
                ) from error
            share = checks.number(weight, f"Mix part {i}, weight", at_least=0.0)
            if not isinstance(material, Material):
                raise TypeError(f"Mix part {i} is of {checks.shown(material)}: pass a material")
            if material.radiance is not None:
                raise ValueError(
                    f"Mix part {i} shines: pass Emissive(radiance, base=Mix(...)) instead"
                )
            total += share
            named.append((share, material))
            lobes += [replace(lobe, weight=share * lobe.weight) for lobe in material.lobes]
        if total > 1.0 + _ROUNDING:
            raise ValueError(
                f"Mix weights add up to {total:g}: pass at most 1 together (a surface cannot send on "
                "more light than it receives)"
            )
        if sum(lobe.traits & TRANSMITS != 0 for lobe in lobes) > 1:
            raise ValueError(
                "Mix parts: more than one part is a Dielectric: pass one, a body has one inside"
            )
        self._parts = tuple(named)
        self._lobes = tuple(lobe for lobe in lobes if lobe.weight > 0.0)

    def __repr__(self) -> str:
        """Return the call that makes it."""
        return call(self, self._parts)
