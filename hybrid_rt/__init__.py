"""Exact ray tracing of curved surfaces, with the error stated beside every result.

Names are imported on first use. So ``import hybrid_rt`` takes next to no time, and a scene without
curved surfaces never loads what they need.
"""

from importlib import import_module
from typing import Any

from hybrid_rt._version import __version__

_HOMES = {
    "Asphere": "primitives.asphere",
    "Box": "primitives",
    "CadModel": "cad.model",
    "Camera": "sensor.camera",
    "CheckerTexture": "textures",
    "Closeness": "distance",
    "ClosestPoint": "distance",
    "ClosestRecord": "distance",
    "Crossings": "intersection.crossings",
    "Dielectric": "materials",
    "Emissive": "materials",
    "Flag": "core.records",
    "GradientSky": "lights",
    "HitRecord": "core.records",
    "ImageEnvironment": "lights",
    "ImageTexture": "textures",
    "Instances": "primitives.instances",
    "Intersector": "intersection",
    "Lambertian": "materials",
    "Metal": "materials",
    "Mirror": "materials",
    "Mix": "materials",
    "NamedPoints": "core.records",
    "Object": "scene.scene",
    "OrthographicCamera": "sensor.orthographic",
    "PPMOptions": "integrators",
    "PanoramicCamera": "sensor.panoramic",
    "PathOptions": "integrators",
    "Phong": "materials",
    "PhotonMapOptions": "integrators",
    "Plane": "primitives",
    "PointLight": "lights",
    "Rectangle": "primitives",
    "RectangleLight": "lights",
    "RenderInterrupted": "rendering.result",
    "RenderResult": "rendering.result",
    "RoughConductor": "materials.rough_conductor",
    "RoughDielectric": "materials.rough_dielectric",
    "Scene": "scene.scene",
    "Sphere": "primitives",
    "SphereLight": "lights",
    "SpotLight": "lights.spot",
    "Status": "core.records",
    "Torus": "primitives.torus",
    "TriangleMesh": "primitives",
    "closest_point": "distance",
    "part_report": "part.report",
    "progress_bar": "rendering.progress_bar",
    "read_cad": "cad.model",
    "reflect": "shading.snell",
    "reflectance": "shading.snell",
    "refract": "shading.snell",
    "render": "rendering.renderer",
}

# What scenes are made of, too; the package `meshing` defines it, and loads it on first use as well.
_OF_MESHING = frozenset((
    "BezierPatches", "Cone", "Curve2", "Cylinder", "Extrusion", "NurbsSurface", "PatchSheet",
    "SurfaceOfRevolution", "TrimmedSurface", "bspline", "circle", "circular_arc", "polygon",
))  # fmt: skip

__all__ = ["__version__", *sorted({*_HOMES, *_OF_MESHING})]  # noqa: PLE0604  (names of modules loaded on demand)


def __getattr__(name: str) -> Any:
    """Import a public name from the module that defines it."""
    if name in _OF_MESHING:
        value = getattr(import_module("meshing"), name)
    elif name in _HOMES:
        value = getattr(import_module(f"hybrid_rt.{_HOMES[name]}"), name)
    else:
        import_module("hybrid_rt.core.suggestions").refuse(name, __all__)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    """List the public names."""
    return sorted(__all__)
