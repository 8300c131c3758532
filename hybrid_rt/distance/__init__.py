"""Distances from points to surfaces, proven: the closest point, and deviations of scans."""

from hybrid_rt.distance.closest import ClosestPoint, closest_point
from hybrid_rt.distance.record import ClosestRecord, Closeness

__all__ = ["ClosestPoint", "ClosestRecord", "Closeness", "closest_point"]
