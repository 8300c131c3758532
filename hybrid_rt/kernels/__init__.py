"""Numba kernels of `hybrid_rt`: numbers and arrays in, numbers and arrays out, no objects."""
