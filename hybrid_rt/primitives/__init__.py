"""Analytic surfaces (sphere, torus, plane, rectangle, box) and triangle meshes."""

from hybrid_rt.primitives.box import Box
from hybrid_rt.primitives.plane import Plane
from hybrid_rt.primitives.rectangle import Rectangle
from hybrid_rt.primitives.sphere import Sphere
from hybrid_rt.primitives.triangle_mesh import TriangleMesh

__all__ = ["Box", "Plane", "Rectangle", "Sphere", "TriangleMesh"]
