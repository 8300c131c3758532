"""Files of triangle meshes, as trimesh reads them, but for OBJ files with relative indices.

A face of an OBJ file may count vertices backwards from where it stands; trimesh counts from the end of
the file, and so takes those of another part.
"""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

from meshing.checks import check_is_file, text_of

if TYPE_CHECKING:
    import trimesh

# What faces, lines and points count: positions, texture coordinates, normals, in the order of "1/2/3".
COUNTED = (b"v", b"vt", b"vn")
_FREE_FORM = re.compile(rb"^[ \t]*(cstype|surf|curv)\b", re.MULTILINE)
# Bytes of a binary STL file: header with the number of triangles, and each of these.
STL_HEADER, STL_TRIANGLE = 84, 50
CAD_FILES = (".step", ".stp", ".iges", ".igs", ".brep")
_COUNTING = re.compile(rb"^[ \t]*[flp][ \t][^\n]*-", re.MULTILINE)


def read_mesh(file: Path) -> trimesh.Trimesh:
    """Return the mesh of a file: all its parts as one; errors name the file, or the package that is missing."""
    what = f"TriangleMesh file {str(file)!r}"
    check_is_file(file, what)
    if file.suffix.lower() in CAD_FILES:
        raise ValueError(f"{what} is a CAD file, without triangles: hybrid_rt.read_cad reads it")
    import trimesh

    try:
        mesh = _read_obj(file) if file.suffix.lower() == ".obj" else trimesh.load_mesh(file)
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"{what}: trimesh reads {file.suffix} by a package that is missing ({error}): install it"
        ) from None
    except NotImplementedError:
        raise ValueError(
            f"{what} has an ending that trimesh does not read: pass an STL, PLY, OBJ or glTF file, say"
        ) from None
    except Exception as error:  # whatever the reader of that format raises
        reason = text_of(error) or type(error).__name__
        raise ValueError(
            f"{what} cannot be read ({reason[:100]}): pass a complete {file.suffix} file"
        ) from error
    if not len(getattr(mesh, "faces", ())):
        raise ValueError(f"{what} holds no triangles{_why_empty(file)}: pass a mesh")
    return mesh


def _why_empty(file: Path) -> str:
    """Return why a file holds no triangles, as far as that is known."""
    content = file.read_bytes()
    if file.suffix.lower() == ".obj" and _FREE_FORM.search(content):
        return ", but free-form curves or surfaces"
    if file.suffix.lower() == ".stl" and len(content) >= STL_HEADER:
        n = int.from_bytes(content[STL_HEADER - 4 : STL_HEADER], "little")
        if n and len(content) != STL_HEADER + n * STL_TRIANGLE:
            return (
                f" that can be told: its header announces {n}, which take {STL_HEADER + n * STL_TRIANGLE} bytes, "
                f"and it has {len(content)}"
            )
    header, _, _ = content.partition(b"end_header")
    if file.suffix.lower() == ".ply" and b"element face" not in header:
        return ", but a cloud of points"
    return ""


def _read_obj(file: Path) -> trimesh.Trimesh:
    import trimesh

    content = io.BytesIO(with_absolute_indices(file.read_bytes()))
    beside = trimesh.resolvers.FilePathResolver(str(file))  # of materials and pictures
    return trimesh.load_mesh(content, file_type="obj", resolver=beside)


def with_absolute_indices(content: bytes) -> bytes:
    """Return an OBJ file with indices that count from its beginning, from 1."""
    content = re.sub(rb"\\\r?\n", b" ", content)  # lines that go on
    if not _COUNTING.search(content):
        return content
    counts = dict.fromkeys(COUNTED, 0)
    lines = content.splitlines()
    for number, line in enumerate(lines):
        words = line.partition(b"#")[0].split()
        if not words:
            continue
        if words[0] in counts:
            counts[words[0]] += 1
        elif words[0] in (b"f", b"l", b"p"):
            found = [_absolute(word, counts, number + 1) for word in words[1:]]
            lines[number] = b" ".join([words[0], *found])
    return b"\n".join(lines) + b"\n"


def _absolute(word: bytes, counts: dict[bytes, int], number: int) -> bytes:
    parts = word.split(b"/")
    for k, (part, kind) in enumerate(zip(parts, COUNTED, strict=False)):
        if part.startswith(b"-"):
            index = counts[kind] + 1 + int(part)
            if index < 1:
                raise ValueError(
                    f"line {number} counts back {-int(part)} of {counts[kind]} {kind.decode()}"
                )
            parts[k] = str(index).encode()
    return b"/".join(parts)
