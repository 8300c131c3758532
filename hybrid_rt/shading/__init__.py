"""Shading kernels: BSDFs, light sampling, textures, media."""
