"""Kernels of rays against even aspheres."""
