"""Image files (.png, .npz, .exr), written atomically, with the report beside each."""

import importlib.util
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import exr
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.sensor.color import screen_pixels
from meshing.checks import as_path, number
from meshing.outputs import check_writable, replacing

# Exposures up to here keep their factor a number.
MOST_STOPS = 100.0


Channels = Mapping[str, NDArray[np.float32]]
# Names of a channel's parts; () is a single number per pixel.
Parts = Mapping[str, Sequence[str]]


def save_image(
    path: str | os.PathLike[str],
    image: NDArray[np.float32],
    report: dict[str, Any],
    channels: Channels | None = None,
    exposure: float = 0.0,
    parts: Parts | None = None,
) -> Path:
    """Write an image file, and its report beside it as JSON.

    ``image`` (height, width, 3) float32.
    ``path``, path ending in .png, .npz or .exr: PNG: 8 bit, sRGB, values above 1 clipped. NPZ:
    ``image`` unchanged, ``report`` as JSON text and the channels by name. EXR: 32-bit channels R,
    G, B and name.part, the report as the attribute "hybrid_rt"; needs the package OpenEXR (the
    extra "exr"). An existing file is replaced atomically.
    ``channels``: by name, (height, width) or (height, width, parts) float32; not stored in PNG.
    ``exposure``: stops: a PNG shows 2**exposure times the radiance. The other formats store
    radiance.
    ``parts``: EXR names of the components of a channel, by channel name; default: R, G and B.
    Returns the sidecar: a.json for a.png, a.npz.json for a.npz, a.npz.png.json for a.npz.png, so
    that sidecars never collide.
    Raises ValueError or OSError or ModuleNotFoundError if the suffix is unknown, the file cannot be
    created (see `meshing.outputs`), what has the name of the report is none, or OpenEXR is not
    installed.
    """
    target = check_output(path, report)
    number(exposure, "exposure", at_least=-MOST_STOPS, up_to=MOST_STOPS, hint="stops")
    if np.ndim(image) != 3 or np.shape(image)[2] != 3:
        raise ValueError(f"image has shape {np.shape(image)}: pass (height, width, 3)")
    text = as_json(report)
    with replacing(target) as file:
        content = _Content(image, text, channels or {}, exposure, parts or {})
        WRITERS[target.suffix.lower()](file, content)
    sidecar = sidecar_of(target)
    with replacing(sidecar) as file:
        file.write(text.encode())
    return sidecar


def sidecar_of(picture: Path) -> Path:
    """Return the path of an image's report; no two images share one."""
    is_short = picture.suffix == ".png" and Path(picture.stem).suffix.lower() not in WRITERS
    return picture.with_suffix(".json" if is_short else f"{picture.suffix}.json")


def keeps_channels(picture: Path) -> bool:
    """Tell whether files with this suffix store channels."""
    return picture.suffix.lower() != ".png"


def check_output(path: str | os.PathLike[str], keys: Iterable[str] = ()) -> Path:
    """Return the path if an image can be written there; raises as `save_image`.

    A file of the report's name is replaced if it has the versions of a report, or exactly ``keys``.
    """
    target = as_path(path, "output")
    if target.suffix.lower() not in WRITERS:
        raise ValueError(f"output {str(target)!r} has an unknown ending: pass {', '.join(WRITERS)}")
    sidecar = sidecar_of(target)
    for file in (target, sidecar):
        check_writable(file)
    _check_sidecar(sidecar, keys)
    if target.suffix.lower() == ".exr" and importlib.util.find_spec("OpenEXR") is None:
        raise ModuleNotFoundError(f"output {str(target)!r}: {exr.NEEDED}")
    return target


def _check_sidecar(file: Path, keys: Iterable[str]) -> None:
    """Raise FileExistsError if a file holds no report of ours: the user has named the picture alone."""
    if not file.exists():
        return
    held: Any = None
    with suppress(OSError, ValueError, RecursionError):
        held = json.loads(file.read_bytes())
    if not isinstance(held, dict) or not (is_report(held) or held.keys() == set(keys)):
        raise FileExistsError(
            f"output {str(file)!r}, the report beside the picture, exists and holds no report of ours: "
            "move that file, or name another picture"
        )


def is_report(held: dict[str, Any]) -> bool:
    """Tell whether a dict that was read from JSON is a report of ours, by the versions in it."""
    versions = held.get("versions")
    return isinstance(versions, dict) and "hybrid_rt" in versions


class _Content(NamedTuple):
    """What a file is to hold, as `save_image` takes it; the report is text."""

    image: NDArray[np.float32]
    report: str
    channels: Channels
    exposure: float
    parts: Parts


def _write_png(file: BinaryIO, of: _Content) -> None:
    import imageio.v3 as imageio

    imageio.imwrite(file, screen_pixels(of.image, of.exposure), extension=".png")


def _write_npz(file: BinaryIO, of: _Content) -> None:
    arrays = {"image": of.image, "report": np.array(of.report), **of.channels}
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]


def _write_exr(file: BinaryIO, of: _Content) -> None:
    import OpenEXR

    planes = {name: of.image[:, :, k] for k, name in enumerate("RGB")}
    for name, values in of.channels.items():
        if values.ndim == 2:
            planes[name] = values
        else:
            letters = of.parts.get(name, "RGB")
            planes |= {f"{name}.{part}": values[:, :, k] for k, part in enumerate(letters)}
    header = {
        "compression": OpenEXR.ZIP_COMPRESSION,
        "type": OpenEXR.scanlineimage,
        "hybrid_rt": of.report,
    }
    contiguous = {name: np.ascontiguousarray(plane) for name, plane in planes.items()}
    try:
        OpenEXR.File(header, contiguous).write(file.name)
    except RuntimeError as error:
        # It names the temporary file, and then the reason.
        raise OSError(str(error).strip(". ").rpartition(". ")[2]) from error


WRITERS: dict[str, Callable[[BinaryIO, _Content], None]] = {
    ".png": _write_png,
    ".npz": _write_npz,
    ".exr": _write_exr,
}
