"""Kernels of part reports."""
