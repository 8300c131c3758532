"""Kernels of rays against tori."""
