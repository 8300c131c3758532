"""Where light comes from."""

from hybrid_rt.lights.gradient_sky import GradientSky
from hybrid_rt.lights.point import PointLight
from hybrid_rt.lights.rectangle import RectangleLight

__all__ = ["GradientSky", "PointLight", "RectangleLight"]
