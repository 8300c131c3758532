"""Kernels that find closest points."""
