"""Distances from points to surfaces, proven: the closest point, and deviations of scans."""

from hybrid_rt.distance.closest import ClosestPoint, closest_point
from hybrid_rt.distance.deviation import Deviation, Fit, best_fit, deviation, measure
from hybrid_rt.distance.record import Closeness, ClosestRecord
from hybrid_rt.distance.scans import Scan

__all__ = [
    "Closeness", "ClosestPoint", "ClosestRecord", "Deviation", "Fit", "Scan", "best_fit", "closest_point",
    "deviation", "measure",
]  # fmt: skip
