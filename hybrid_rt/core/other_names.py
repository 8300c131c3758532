"""What names are called here that other programs have, or that are misspelt."""

from __future__ import annotations

import difflib
import dis
import sys
from collections.abc import Iterable

# How like a name has to be, from 0 to 1.
LIKE = 0.7

_DISC = "TrimmedSurface(Rectangle(...), [circle((0.5, 0.5), 0.5)])"
_SUN = "a SphereLight far away, or a bright texel of an ImageEnvironment"
# What there is instead, by all the names of it in lower case.
_MEANT = {
    "directionallight distantlight distant sun sunlight parallellight": _SUN,
    "disklight disclight": f"Object({_DISC}, Emissive(radiance)), or a SphereLight",
    "arealight quadlight rectlight area quadarealight": "a RectangleLight, or an Object of Emissive",
    "meshlight light emitter emission diffuselight emissivematerial": "Emissive, the material of an Object that shines",
    "omnilight": "PointLight",
    "mesh trimesh model obj ply stl polygonmesh": "TriangleMesh(mesh), of a trimesh.Trimesh or of vertices and faces",
    "triangle triangles face": "a TriangleMesh of one or several faces, or a TrimmedSurface of a Rectangle",
    "cube cuboid": "Box",
    "quad square parallelogram": "Rectangle",
    "disk disc": _DISC,
    "ellipsoid lathe revolution": "SurfaceOfRevolution",
    "bezier bezierpatch bicubicpatch": "BezierPatches",
    "nurbs bsplinesurface": "NurbsSurface",
    "tessellate certifiedmesh": "it from the package meshing",
    "glass water dielectricmaterial transparent refractive": "Dielectric",
    "frostedglass roughglass": "RoughDielectric",
    "diffuse matte matt diffusematerial lambert": "Lambertian",
    "specular": "Mirror",
    "plastic glossy principled principledbsdf pbrmaterial standardmaterial": "Phong, or a Mix of Lambertian and Mirror",
    "conductor roughmetal ggx metallic": "RoughConductor, or Metal",
    "blend mixmaterial blendmaterial": "Mix",
    "material": "a material by its name, as Lambertian",
    "environmentmap envmap environmentlight environment hdri skybox domelight infinitelight":
        "ImageEnvironment, or GradientSky",
    "sky skylight constantenvironment background": "GradientSky",
    "perspectivecamera pinholecamera thinlenscamera perspective": "Camera",
    "orthographic orthocamera parallelcamera": "OrthographicCamera",
    "panoramacamera sphericalcamera equirectangularcamera environmentcamera": "PanoramicCamera",
    "texture bitmap bitmaptexture": "ImageTexture",
    "checkerboard checkerboardtexture": "CheckerTexture",
    "pathtracer integrator renderer photonmapper": 'render(scene, "path"), or another integrator by its name',
}  # fmt: skip
_BY_NAME = {name: meant for names, meant in _MEANT.items() for name in names.split()}


def instead(name: str, known: Iterable[str]) -> str:
    """Return what to take instead of a name that is not there, as "take ..."; or "".

    Parameters
    ----------
    name : str
    known : iterable of str
        The names that there are.
    """
    meant = _BY_NAME.get(name.lower().replace("_", ""))
    if meant is not None:
        return f"take {meant}"
    return like(name, known)


def like(name: str, known: Iterable[str]) -> str:
    """Return "did you mean ...?" for a misspelt name, or ""."""
    near = difflib.get_close_matches(name, known, 1, LIKE)
    return f"did you mean {near[0]!r}?" if near else ""


def refuse(name: str, known: Iterable[str]) -> None:
    """Raise AttributeError for a name that the package does not have.

    Of "from hybrid_rt import name" Python would drop the message, so there it is an ImportError.
    """
    hint = instead(name, known)
    if not hint:
        raise AttributeError(f"module 'hybrid_rt' has no attribute {name!r}")
    frame = sys._getframe(2)  # the caller of the package's __getattr__
    if frame.f_code.co_code[max(frame.f_lasti, 0)] == dis.opmap["IMPORT_FROM"]:
        raise ImportError(f"cannot import name {name!r} from 'hybrid_rt': {hint}", name="hybrid_rt")
    raise AttributeError(f"module 'hybrid_rt' has no attribute {name!r}: {hint}")
