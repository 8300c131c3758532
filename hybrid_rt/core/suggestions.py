"""What is meant by a name, an argument or an option that is not there: misspelt, or another program's."""

import functools
import inspect
import re
import sys
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from types import TracebackType
from typing import Any, TypeVar, cast

T = TypeVar("T", bound=Callable[..., Any])

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
    """Return what to take instead of a name that is not among the known ones, as "take ..."; or ""."""
    meant = _BY_NAME.get(name.lower().replace("_", ""))
    return like(name, known) if meant is None else f"take {meant}"


def like(name: str, known: Iterable[str]) -> str:
    """Return "did you mean ...?" for a misspelt name, or ""."""
    near = nearest(name, known)
    return f"did you mean {near!r}?" if near else ""


def nearest(name: str, known: Iterable[str]) -> str:
    """Return the name that a misspelt one resembles most, or ""."""
    import difflib

    return next(iter(difflib.get_close_matches(name, known, 1, LIKE)), "")


def refuse(name: str, known: Iterable[str]) -> None:
    """Raise AttributeError for a name that the package does not have.

    Of "from hybrid_rt import name" Python would drop the message, so there it is an ImportError.
    """
    hint = instead(name, known)
    if not hint:
        raise AttributeError(f"module 'hybrid_rt' has no attribute {name!r}")
    import dis

    frame = sys._getframe(2)  # the caller of the package's __getattr__
    if frame.f_code.co_code[max(frame.f_lasti, 0)] == dis.opmap["IMPORT_FROM"]:
        raise ImportError(f"cannot import name {name!r} from 'hybrid_rt': {hint}", name="hybrid_rt")
    raise AttributeError(f"module 'hybrid_rt' has no attribute {name!r}: {hint}")


def explains(**meant: str) -> Callable[[T], T]:
    """Return a decorator: calls with a keyword that does not exist are told what is meant by it.

    ``meant`` says what to pass instead, by the names that other programs have for it.
    """

    def decorate(target: T) -> T:
        inner = cast(Any, target).__init__ if isinstance(target, type) else target
        takes = [
            name for name in inspect.signature(inner).parameters if name not in ("self", "cls")
        ]

        @functools.wraps(inner)
        def call(*values: Any, **keywords: Any) -> Any:
            for name in keywords:
                if name not in takes:
                    words = f"pass {meant[name]}" if name in meant else _argument(name, takes)
                    raise TypeError(f"{target.__qualname__} has no argument {name!r}: {words}")
            return inner(*values, **keywords)

        if not isinstance(target, type):
            return cast(T, call)
        cast(Any, target).__init__ = call
        return target

    return decorate


def _argument(name: str, takes: Iterable[str]) -> str:
    return like(name, takes) or f"it takes {', '.join(takes)}"


def option_suggestion(message: str, known: Iterable[str], meant: Mapping[str, str]) -> str:
    """Return ": did you mean ...?" for the first unknown option that resembles a known one, or "".

    ``message`` is argparse's; ``meant`` has options by the names that other programs have for them.
    """
    known = [option for option in known if option.startswith("--")]
    for word in message.partition(": ")[2].split():
        wrong = word.partition("=")[0].lower()
        near = meant.get(wrong, "")
        near = near if near in known else nearest(wrong, known)
        if wrong.startswith("--") and near:
            return f": did you mean {near}?"
    return ""


def suggestion(error: BaseException) -> str:
    """Return ": did you mean ...?" for a name, attribute or argument that is misspelt, or "".

    Of an argument that resembles none it says which ones there are. Python itself suggests names only
    where it prints a traceback, and none for arguments.
    """
    with suppress(Exception):  # whatever is wrong here must not hide the error
        wrong, known = _wrong_and_known(error)
        public = [name for name in known if name[:1] != "_"]
        if wrong and "did you mean" not in str(error):
            words = (_argument if isinstance(error, TypeError) else instead)(wrong, public)
            return f": {words}" if words and words not in str(error) else ""
    return ""


_NO_SUCH_ARGUMENT = re.compile(r"([\w.]+)\(\) got an unexpected keyword argument '(\w+)'")


def _wrong_and_known(error: BaseException) -> tuple[str | None, Iterable[str]]:
    """Return the word that is wrong, and the words that would have been right."""
    if isinstance(error, NameError):
        return error.name, _names(error.__traceback__)
    if isinstance(error, AttributeError):
        return error.name, dir(error.obj)
    called = _NO_SUCH_ARGUMENT.search(str(error)) if isinstance(error, TypeError) else None
    if called is None:
        return "", []
    names = _names(error.__traceback__)
    return called[2], inspect.signature(names[called[1].partition(".")[0]]).parameters


def _names(trace: TracebackType | None) -> dict[str, Any]:
    """Return everything that has a name where an error was raised."""
    import builtins

    if trace is None:
        return {}
    while trace.tb_next is not None:
        trace = trace.tb_next
    return vars(builtins) | trace.tb_frame.f_globals | trace.tb_frame.f_locals
