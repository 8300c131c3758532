"""Rays against surfaces: `Intersector` and its stages."""

from hybrid_rt.intersection.intersector import Intersector

__all__ = ["Intersector"]
