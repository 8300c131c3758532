"""Scene scripts: Python files with a function ``scene()`` that returns a `Scene`.

A script may name its default integrator in ``INTEGRATOR``, for example "ppm" for caustics of small
lights. The command line overrides it.
"""

import importlib
import os
import runpy
import sys
import traceback
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from types import ModuleType
from typing import Any

from hybrid_rt.core import checks
from hybrid_rt.core.suggestions import suggestion
from hybrid_rt.scene.scene import Scene
from meshing.checks import as_path, text_of

# What people pass who take a mesh for a scene.
MESHES = (".obj", ".stl", ".ply", ".off", ".glb", ".gltf", ".3mf")
# What is passed by mistake: pictures, their reports, scenes of other programs.
NO_SCRIPTS = (".npz", ".npy", ".png", ".exr", ".jpg", ".json", ".blend", ".pov")


class SceneFileError(ValueError):
    """A scene script is missing, fails, or returns no scene."""


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Run a scene script and return its scene.

    A script is a Python program that may do anything: run only scripts that you trust. It may
    import files that lie beside it.

    Parameters
    ----------
    path : str or path
        A Python file with a function ``scene()`` that returns a `Scene`.

    Raises
    ------
    SceneFileError
        The message names the file, and the line where the script failed.
    """
    return load_script(path)[0]


def check_script(path: str | os.PathLike[str]) -> Path:
    """Return the path of a scene script; raise if there is no such file."""
    file = as_path(path, "scene script")
    if not file.is_file():
        raise SceneFileError(f"scene script {os.fspath(path)!r}: there is no such file")
    if file.suffix.lower() in MESHES:
        raise SceneFileError(
            f"scene script {os.fspath(path)!r}: that is a mesh; write a script, a .py with a function "
            f"scene(), that holds Object(TriangleMesh.read({file.name!r}), MATERIAL)"
        )
    if file.suffix.lower() in NO_SCRIPTS:
        raise SceneFileError(
            f"scene script {os.fspath(path)!r}: that is none; pass a .py with a function scene()"
        )
    return file


def load_script(path: str | os.PathLike[str]) -> tuple[Scene, str]:
    """Run a scene script; return its scene and its default integrator; see `load_scene`.

    What it imports from beside it is forgotten afterwards, so that the next script imports its own.
    """
    file = check_script(path)
    with _importing_beside(file):
        with _naming(file):
            names = runpy.run_path(str(file), run_name="hybrid_rt_scene")
        return scene_of(names.get("scene"), names, file)


def scene_of(
    describe: Any, names: Mapping[str, Any], file: str | os.PathLike[str]
) -> tuple[Scene, str]:
    """Return the scene of a script's function, and the default integrator among the script's ``names``."""
    file = Path(file)
    if not callable(describe):
        raise SceneFileError(
            f"{file} has no function scene(): define one that returns a Scene, or, if it renders by "
            f"itself, run python {file}"
        )
    with _naming(file):
        scene = describe()
    if not isinstance(scene, Scene):
        raise SceneFileError(
            f"{file}: scene() returned {type(scene).__name__}, let it return a Scene"
        )
    from hybrid_rt.integrators import DEFAULT, INTEGRATORS

    if "INTEGRATOR" not in names:
        return scene, DEFAULT
    try:
        return scene, checks.choice(names["INTEGRATOR"], "INTEGRATOR", INTEGRATORS)
    except ValueError as error:
        raise SceneFileError(f"{file}: {error}") from None


@contextmanager
def _importing_beside(file: Path) -> Iterator[None]:
    """Let imports find files beside a script; forget what was imported from there at the end."""
    folder = file.resolve().parent
    path, before = list(sys.path), set(sys.modules)
    sys.path.insert(0, str(folder))
    importlib.invalidate_caches()  # the folder may have new files
    try:
        yield
    finally:
        sys.path[:] = path
        beside = {
            name
            for name, module in sys.modules.items()
            if "." not in name and name not in before and _lies_in(folder, module)
        }
        for name in [name for name in sys.modules if name.partition(".")[0] in beside]:
            del sys.modules[name]


def _lies_in(folder: Path, module: ModuleType) -> bool:
    """Tell whether a module is a file or a package of this folder."""
    spec = getattr(module, "__spec__", None)
    places = [] if spec is None else list(spec.submodule_search_locations or [spec.origin])
    return any(Path(place).resolve().parent == folder for place in places if place)


@contextmanager
def _naming(file: Path) -> Iterator[None]:
    """Turn whatever a script raises into an error that names it; Ctrl-C stays what it is."""
    try:
        yield
    except (SceneFileError, KeyboardInterrupt):
        raise
    except BaseException as error:
        raise SceneFileError(f"{file}{_line_in(file, error)}: {_described(error)}") from error


def _line_in(file: Path, error: BaseException) -> str:
    """Return ", line N" for the innermost line of the script that led to an error."""
    if isinstance(error, SyntaxError) and error.filename == str(file):
        return f", line {error.lineno}" if error.lineno else ""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    return f", line {lines[-1]}" if lines else ""


def _described(error: BaseException) -> str:
    # Our own refusals speak for themselves; of anything else the kind matters as well.
    text = text_of(error)
    if isinstance(error, ValueError | FileNotFoundError) and text:
        return text
    kind = type(error).__name__
    return f"{kind}: {text}{suggestion(error)}" if text else kind
