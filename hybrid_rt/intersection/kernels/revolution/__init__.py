"""Rays against surfaces of revolution: profiles, the ray about the axis, roots, search, hits."""
