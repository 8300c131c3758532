"""Coarse hits: Embree on triangles proposes where to look."""
