"""Numba kernels of `meshing`: numbers and arrays in, numbers and arrays out, no objects."""
