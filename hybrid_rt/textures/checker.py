"""Checker textures, in surface parameters or in world space."""

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import call, one_or_three
from hybrid_rt.core.records import FloatArray
from hybrid_rt.shading.kernels.texture import CHECKER_UV, CHECKER_WORLD
from hybrid_rt.textures.texture import Texture, TextureRow

# Finer squares than this are decided by the rounding of coordinates.
FINEST = 1e12


class CheckerTexture(Texture):
    """A checkerboard of two colours, in space or in the surface parameters.

    Parameters
    ----------
    even, odd : number or three numbers
        The two colours, linear, at least 0.
    scale : number, or two numbers ("uv"), or three numbers ("world")
        For "uv": number of squares along u and v. For "world": angular frequencies a, b and c along
        x, y and z, radians per scene unit; 0 leaves the colour as it is along that axis.
    space : "world" or "uv"
        "world": the colour is ``odd`` where sin(a x) sin(b y) sin(c z) < 0, so the edges of a cell
        are pi over the frequency. Where a sine is 0, as on a floor at z = 0, the cell above counts.
        "uv": squares in the surface parameters.

    Raises
    ------
    ValueError, TypeError
        If a colour or a scale is out of range, ``scale`` has another shape, or ``space`` is
        unknown.
    """

    def __init__(
        self,
        even: ArrayLike,
        odd: ArrayLike,
        scale: ArrayLike = 6.0,
        space: Literal["world", "uv"] = "world",
    ) -> None:
        checks.choice(space, "CheckerTexture space", ("world", "uv"))
        self._kind = CHECKER_UV if space == "uv" else CHECKER_WORLD
        self._even = checks.rgb(even, "CheckerTexture even")
        self._odd = checks.rgb(odd, "CheckerTexture odd")
        n_axes = 2 if space == "uv" else 3
        scales = checks.as_floats(scale, "CheckerTexture scale")
        if scales.shape not in {(), (n_axes,)}:
            raise ValueError(
                f"CheckerTexture scale has shape {scales.shape}: pass one number, or {n_axes}"
            )
        scales = np.broadcast_to(scales, (n_axes,))
        self._scale = tuple(
            checks.number(value, "CheckerTexture scale", at_least=0.0, up_to=FINEST)
            for value in scales
        )
        if not any(self._scale):
            raise ValueError("CheckerTexture scale is 0: pass a number above 0")

    def __repr__(self) -> str:
        """Return the call that makes it."""
        colors = one_or_three(self._even), one_or_three(self._odd)
        scale = self._scale[0] if len(set(self._scale)) == 1 else self._scale
        space = "uv" if self._kind == CHECKER_UV else "world"
        return call(self, *colors, scale=scale, space=space)

    @property
    def brightest(self) -> FloatArray:
        """Return the larger of the two colours, channel by channel."""
        return np.maximum(self._even, self._odd)

    @property
    def mean(self) -> FloatArray:
        """Return the mean of the two colours, channel by channel: each has half of the squares."""
        return 0.5 * self._even + 0.5 * self._odd

    @property
    def row(self) -> TextureRow:
        """Return the checker's row of the texture table."""
        scale = (*self._scale, 0.0)[:3]
        return TextureRow(self._kind, (*self._even.tolist(), *self._odd.tolist(), *scale))
