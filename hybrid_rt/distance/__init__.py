"""Distances from points to surfaces, proven: the closest point, and deviations of scans."""

from hybrid_rt.distance.closest import ClosestPoint, closest_point
from hybrid_rt.distance.record import Closeness, ClosestRecord

__all__ = ["Closeness", "ClosestPoint", "ClosestRecord", "closest_point"]
