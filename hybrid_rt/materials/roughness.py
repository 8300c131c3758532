"""Conversion of a material's roughness to the alpha of GGX."""

from hybrid_rt.core import checks

# Its square is the least alpha of the kernels.
LEAST_ROUGHNESS = 0.01


def alpha_of(roughness: float, what: str, smooth: str) -> float:
    """Return the alpha of GGX: the square of roughness, which is perceptually more uniform.

    Burley, "Physically based shading at Disney", SIGGRAPH 2012 course notes. ``smooth`` says what to use
    for smoother surfaces.
    """
    hint = f"below it use {smooth}"
    value = checks.number(roughness, what, at_least=LEAST_ROUGHNESS, up_to=1.0, hint=hint)
    return value * value
