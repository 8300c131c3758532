"""Scene scripts: Python files with a function ``scene()`` that returns a `Scene`.

A script may name the integrator that it is meant for, in ``INTEGRATOR``: "ppm" where caustics of
small lamps are to be seen, say. A command line that asks for another one has the last word.
"""

from __future__ import annotations

import os
import runpy
import traceback
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from hybrid_rt import checks
from hybrid_rt.scene import Scene
from meshing.checks import as_path


class SceneFileError(ValueError):
    """A scene script is missing, fails, or describes no scene."""


def load_scene(path: str | os.PathLike[str]) -> Scene:
    """Run a scene script and return its scene; see `load_script`."""
    return load_script(path)[0]


def preferred_integrator(names: Mapping[str, Any], file: str | os.PathLike[str]) -> str:
    """Return what a script, of which the global names are given, calls ``INTEGRATOR``, or "path".

    Raises
    ------
    SceneFileError
        If there is no such integrator.
    """
    if "INTEGRATOR" not in names:
        return "path"
    from hybrid_rt.integrators import INTEGRATORS

    try:
        return checks.choice(names["INTEGRATOR"], "INTEGRATOR", INTEGRATORS)
    except ValueError as error:
        raise SceneFileError(f"{os.fspath(file)}: {error}") from None


def load_script(path: str | os.PathLike[str]) -> tuple[Scene, str]:
    """Run a scene script; return its scene, and the integrator that it is meant for.

    The script is a program and may do whatever a program may: run only scripts you trust.

    Raises
    ------
    SceneFileError
        Naming the file, and the line where the script failed.
    """
    file = as_path(path, "scene script")
    if not file.is_file():
        raise SceneFileError(f"scene script {str(file)!r}: there is no such file")
    try:
        namespace = runpy.run_path(str(file), run_name="hybrid_rt_scene")
        describe = namespace.get("scene")
        if not callable(describe):
            raise SceneFileError(f"{file} has no function scene(): define one that returns a Scene")
        scene = describe()
    except SceneFileError:
        raise
    except (Exception, SystemExit) as error:
        raise SceneFileError(f"{file}{_line_in(file, error)}: {_described(error)}") from error
    if not isinstance(scene, Scene):
        raise SceneFileError(
            f"{file}: scene() returned {type(scene).__name__}, let it return a Scene"
        )
    return scene, preferred_integrator(namespace, file)


def _line_in(file: Path, error: BaseException) -> str:
    """Return ", line N" for the innermost line of the script that led to an error."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno}"
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if frame.filename == str(file)]
    return f", line {lines[-1]}" if lines else ""


def _described(error: BaseException) -> str:
    # Our own refusals speak for themselves; of anything else the kind matters as well.
    text = str(error)
    if isinstance(error, ValueError | FileNotFoundError) and text:
        return text
    return f"{type(error).__name__}: {text}"
