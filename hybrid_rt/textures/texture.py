"""The interface of textures, and the constant colour."""

import os
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.one_line import one_or_three
from hybrid_rt.core.records import FloatArray
from hybrid_rt.sensor.color import srgb_to_linear
from hybrid_rt.shading.kernels import texture as kernels
from meshing.checks import shown


@dataclass(frozen=True)
class TextureRow:
    """One row of the `TextureTable`."""

    kind: int
    number: tuple[float, ...]  # colour, second colour, scale: nine numbers, 0 where unused
    texels: NDArray[np.float32] | None = None  # (height, width, 3), linear, row 0 at the top
    wrap: int = kernels.REPEAT


class Texture(ABC):
    """A colour as a function of the surface point; immutable."""

    @property
    @abstractmethod
    def brightest(self) -> FloatArray:
        """(3,) float64: the largest value of each channel."""

    @property
    @abstractmethod
    def mean(self) -> FloatArray:
        """(3,) float64: the mean of each channel over the texture; 0 only if all of it is 0."""

    @property
    @abstractmethod
    def row(self) -> TextureRow:
        """The texture's row of the texture table."""


class ConstantTexture(Texture):
    """A constant colour (3,), linear, already checked."""

    def __init__(self, color: FloatArray) -> None:
        self._color = color

    @property
    def brightest(self) -> FloatArray:
        """Return the colour itself."""
        return self._color

    @property
    def mean(self) -> FloatArray:
        """Return the colour itself."""
        return self._color

    @property
    def row(self) -> TextureRow:
        """Return the colour's row of the texture table."""
        return TextureRow(kernels.CONSTANT, (*self._color.tolist(), *(0.0,) * 6))


def plain_color(texture: Texture) -> Any:
    """Return what a description shows of a texture: of a constant one its number or numbers."""
    return one_or_three(texture.brightest) if isinstance(texture, ConstantTexture) else texture


def as_texture(color: Texture | ArrayLike, what: str, up_to: float = 1.0) -> Texture:
    """Convert a texture, three numbers or one number to a texture of values from 0 to ``up_to``."""
    if isinstance(color, Texture):
        name = f"{what}: brightest colour of {type(color).__name__}"
        checks.rgb(color.brightest, name, up_to=up_to)
        return color
    _refuse_pictures(color, what)
    return ConstantTexture(checks.rgb(color, what, up_to=up_to))


def _refuse_pictures(color: Texture | ArrayLike, what: str) -> None:
    """Refuse the name of a picture or of a colour, and the array of a picture."""
    if isinstance(color, str | os.PathLike):
        name = shown(os.fspath(color))
        linear = linear_color(os.fspath(color))
        if linear is not None:
            raise TypeError(
                f"{what} is {name}: pass three numbers, linear; of this colour "
                f"({', '.join(f'{x:.4g}' for x in linear)})"
            )
        raise TypeError(
            f"{what} is {name}: pass a number, three numbers or a texture; of a picture, "
            f"ImageTexture({name})"
        )
    shape = getattr(color, "shape", ())
    if len(shape) > 1:
        raise ValueError(
            f"{what} has shape {tuple(shape)}: pass one number, three, or for a picture ImageTexture(array)"
        )


def linear_color(name: str) -> FloatArray | None:
    """Return the linear values (3,) of a colour as in CSS, as "#ff8000" or "orange"; None: it is none."""
    from PIL import ImageColor

    try:
        color = ImageColor.getrgb(name)
    except ValueError:
        return None
    return srgb_to_linear(np.array(color[:3]) / 255.0)
