"""Lights and environments."""

from hybrid_rt.lights.gradient_sky import GradientSky
from hybrid_rt.lights.image_environment import ImageEnvironment
from hybrid_rt.lights.point import PointLight
from hybrid_rt.lights.rectangle import RectangleLight
from hybrid_rt.lights.sphere import SphereLight

__all__ = ["GradientSky", "ImageEnvironment", "PointLight", "RectangleLight", "SphereLight"]
