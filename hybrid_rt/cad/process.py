"""The child process that reads CAD files: bounded in time and memory, free to crash, answered by arrays."""

from __future__ import annotations

import importlib.util
import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from meshing.checks import check_is_file

# Of the child, which finds this package where this process has it, and nothing beside its own file.
PROGRAM = (
    "import sys; sys.path.insert(0, sys.argv[1]); from hybrid_rt.cad.opencascade import main; "
    "sys.exit(main(*sys.argv[2:]))"
)
PLACE = str(Path(__file__).parents[2])
REFUSED = 4
SUFFIXES = (".step", ".stp", ".iges", ".igs", ".brep")
MESHES = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")


def check_file(file: Path) -> str:
    """Return what messages call a file; raise if there is none, or of an unknown kind."""
    what = f"CAD file {str(file)!r}"
    if file.suffix.lower() not in SUFFIXES:
        hint = "of a mesh, TriangleMesh.read" if file.suffix.lower() in MESHES else "convert it"
        raise ValueError(
            f"{what} ends in {file.suffix or 'nothing'!r}: pass one of {', '.join(SUFFIXES)}, or {hint}"
        )
    check_is_file(file, what)
    return what


def arrays_of(
    file: Path, options: dict[str, Any], seconds: float, gigabytes: float
) -> dict[str, Any]:
    """Return what `hybrid_rt.cad.opencascade` writes of a file.

    Raises
    ------
    FileNotFoundError, ValueError, TimeoutError, ImportError
        One sentence, with the name of the file, what is wrong, and what to do.
    """
    what = check_file(file)
    if importlib.util.find_spec("OCP") is None:
        raise ImportError(
            f"{what} is read by OpenCASCADE, which is missing: pip install 'hybrid-rt[cad]'"
        )
    with tempfile.TemporaryDirectory(prefix="hybrid_rt_cad_") as folder:
        out = Path(folder) / "arrays.npz"
        limits = {"bytes": int(gigabytes * 1e9), "seconds": math.ceil(seconds)}
        wanted = json.dumps({**options, **limits})
        command = [
            sys.executable,
            "-P",
            "-c",
            PROGRAM,
            PLACE,
            str(file.resolve()),
            str(out),
            wanted,
        ]
        try:
            ended = subprocess.run(
                command, stdin=subprocess.DEVNULL, capture_output=True, timeout=seconds, check=False
            )
        except subprocess.TimeoutExpired:
            raise TimeoutError(
                f"{what} takes longer than seconds={seconds:g} to read: pass more, or repair the file"
            ) from None
        said = ended.stdout.decode("utf-8", "replace").strip().rpartition("\n")[2]
        if ended.returncode == REFUSED:
            raise ValueError(f"{what} {said}")
        if ended.returncode or not out.is_file():
            last = ended.stderr.decode("utf-8", "replace").strip().rpartition("\n")[2][:160]
            why = last or f"it ended by signal {-ended.returncode}"
            raise ValueError(
                f"{what} makes OpenCASCADE fail ({why}): the file is damaged, or too large"
            )
        with np.load(out, allow_pickle=False) as found:
            arrays = {name: found[name] for name in found.files}
    return {**arrays, "head": json.loads(arrays["head"].tobytes())}
