"""Quasi-random numbers, a pure function of seed, pixel, dimension and pass."""
