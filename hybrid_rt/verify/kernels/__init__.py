"""Kernels of the oracle: bisection in float64, ends in double-double; nothing of the fast path."""
