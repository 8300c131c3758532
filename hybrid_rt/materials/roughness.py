"""How rough surfaces are, as materials take it and as kernels do."""

from __future__ import annotations

from hybrid_rt.core import checks

# Its square is the least alpha of the kernels.
LEAST_ROUGHNESS = 0.01


def alpha_of(roughness: float, what: str, smooth: str) -> float:
    """Return the alpha of GGX facets: the square of a roughness, which so looks even in steps.

    Burley, "Physically based shading at Disney", SIGGRAPH 2012 course notes.

    Parameters
    ----------
    roughness : float
        0.01 to 1.
    what, smooth : str
        What is being described, and what to use where it is smoother than that.

    Raises
    ------
    ValueError, TypeError
        For anything else; ``what`` is named.
    """
    hint = f"below it use {smooth}"
    value = checks.number(roughness, what, at_least=LEAST_ROUGHNESS, up_to=1.0, hint=hint)
    return value * value
