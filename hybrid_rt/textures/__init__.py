"""Colours that vary over a surface: images and checkers."""

from hybrid_rt.textures.checker import CheckerTexture
from hybrid_rt.textures.image import ImageTexture

__all__ = ["CheckerTexture", "ImageTexture"]
