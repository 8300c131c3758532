"""Comparison of two pictures: errors, error maps, and the part that their noise explains."""

import json
import math
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeGuard

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.analysis.nearer_picture import verdicts
from hybrid_rt.analysis.picture_sheet import Pixels, error_colors, sheet
from hybrid_rt.analysis.units import percent, signed_percent
from hybrid_rt.core import exr
from hybrid_rt.core.memory import available_bytes, bytes_in_words
from hybrid_rt.core.plain_records import as_json
from hybrid_rt.rendering.versions import versions
from hybrid_rt.sensor.color import screen_pixels, srgb_to_linear
from hybrid_rt.sensor.image_files import check_output, sidecar_of
from hybrid_rt.sensor.image_metrics import DARK, picture_errors, relative_squares
from meshing.checks import as_path, text_of
from meshing.outputs import replacing

# Differences of larger numbers may be no numbers.
MOST = 1e300
# Peak memory of a comparison, in sizes of a picture's file in memory.
AT_ONCE = 8
# Files that unpack to more bytes than this, and to so many times their size, hold nearly one number alone.
MOST_UNPACKED, MOST_PACKED = 2**28, 100


@dataclass(frozen=True)
class Picture:
    """A picture read from a file, linear; with the report of its render, if it was saved."""

    name: str
    image: NDArray[np.float32]
    report: dict[str, Any] | None
    standard_error: NDArray[np.float32] | None


def load_picture(path: str | os.PathLike[str]) -> Picture:
    """Read a .npz or .exr file of `save_image`, or any .png (8 bit sRGB: quantised, clipped at 1).

    Raises FileNotFoundError or ValueError if the file is missing, or does not hold a picture.
    """
    file = as_path(path, "picture")
    if not file.is_file():
        raise FileNotFoundError(f"picture {str(file)!r}: there is no such file")
    readers = {".npz": _read_npz, ".exr": _read_exr, ".png": _read_png}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise ValueError(f"picture {str(file)!r} has an unknown ending: pass {', '.join(readers)}")
    try:
        picture = reader(file)
    except ModuleNotFoundError:
        raise ModuleNotFoundError(f"picture {str(file)!r}: {exr.NEEDED}") from None
    except _NotAPictureError:
        raise
    except Exception as error:  # whatever the reader of that format raises on a damaged file
        reason = text_of(error) or type(error).__name__
        raise ValueError(
            f"picture {str(file)!r} cannot be read ({reason[:100]}): pass a complete {file.suffix} file"
        ) from error
    _check_arrays(file, picture)
    return picture


class _NotAPictureError(ValueError):
    """A file that can be read, but holds something else."""


def _check_arrays(file: Path, picture: Picture) -> None:
    image, error = picture.image, picture.standard_error
    _check_image(file, image.dtype, image.shape)
    _check_error(file, image.shape, None if error is None else error.shape)
    for values in (image, error):
        if values is None:
            continue
        # They may be of low precision.
        if float(np.abs(values[np.isfinite(values)]).max(initial=0.0)) > MOST:
            raise ValueError(
                f"picture {str(file)!r} holds numbers beyond {MOST:g}: pass radiances, scaled if need be"
            )


def _check_image(file: Path, dtype: np.dtype[Any], shape: tuple[int, ...]) -> None:
    if len(shape) != 3 or shape[2] != 3 or 0 in shape or dtype.kind != "f":
        raise _NotAPictureError(
            f"picture {str(file)!r} holds {dtype} of shape {shape}: pass floats of shape (height, width, 3)"
        )


def _check_error(file: Path, shape: tuple[int, ...], of_error: tuple[int, ...] | None) -> None:
    if of_error not in (None, shape):
        raise _NotAPictureError(
            f"picture {str(file)!r} has shape {shape}, its standard_error {of_error}: pass a file as it "
            "was written"
        )


def _report_of(text: str | bytes | None) -> dict[str, Any] | None:
    """Return a report of ours; None for what is something else."""
    try:
        report = None if text is None else json.loads(text)
    except ValueError:
        return None
    return report if isinstance(report, dict) else None


def _read_npz(file: Path) -> Picture:
    # Opened here: of a damaged file numpy leaves its own open.
    with file.open("rb") as opened, np.load(opened, allow_pickle=False) as data:
        if "image" not in data:
            names = ", ".join(data) or "nothing"
            raise _NotAPictureError(
                f"picture {str(file)!r} holds no array named image, but {names}: pass a file of ours"
            )
        _check_headers(file, data)
        report = _report_of(str(data["report"]) if "report" in data else None)
        error = data.get("standard_error")
        return Picture(file.name, data["image"], report, error)


def _check_headers(file: Path, data: Any) -> None:
    """Refuse arrays by what their headers say: a small file may unpack to more than memory holds."""
    shapes, n_bytes = {}, 0
    for name in ("image", "standard_error", "report"):
        if name not in data:
            continue
        with data.zip.open(f"{name}.npy") as member:
            if np.lib.format.read_magic(member) != (1, 0):  # others have headers of any length
                raise _NotAPictureError(
                    f"picture {str(file)!r} holds {name} in another format than ours: write it by np.savez"
                )
            shapes[name], _, dtype = np.lib.format.read_array_header_1_0(member)
        n_bytes += dtype.itemsize * math.prod(shapes[name])
        if name == "image":
            _check_image(file, dtype, shapes[name])
    _check_error(file, shapes["image"], shapes.get("standard_error"))
    if AT_ONCE * n_bytes > (most := available_bytes()):
        raise _NotAPictureError(
            f"picture {str(file)!r} takes {bytes_in_words(AT_ONCE * n_bytes)} of memory, this process can "
            f"have {bytes_in_words(most)}: pass a smaller picture"
        )
    if n_bytes > MOST_UNPACKED and n_bytes > MOST_PACKED * (n_packed := file.stat().st_size):
        raise _NotAPictureError(
            f"picture {str(file)!r}, of {bytes_in_words(n_packed)}, unpacks to {bytes_in_words(n_bytes)} of "
            "almost nothing but one number: if that is meant, write it by np.savez, which does not compress"
        )


def _read_exr(file: Path) -> Picture:
    planes, header = exr.read_exr(file)
    if not {"R", "G", "B"} <= planes.keys():
        raise _NotAPictureError(
            f"picture {str(file)!r} has no channels R, G, B, but {', '.join(planes)}: pass a picture"
        )
    image = np.stack([planes[c] for c in "RGB"], axis=2).astype(np.float32)
    names = [f"standard_error.{c}" for c in "RGB"]
    error = None
    if planes.keys() >= set(names):
        error = np.stack([planes[name] for name in names], axis=2).astype(np.float32)
    return Picture(file.name, image, _report_of(header.get("hybrid_rt")), error)


def _read_png(file: Path) -> Picture:
    import imageio.v3 as imageio

    pixels = imageio.imread(file)
    if pixels.ndim != 3 or pixels.shape[2] not in {3, 4} or pixels.dtype != np.uint8:
        raise _NotAPictureError(
            f"picture {str(file)!r} has {pixels.dtype} pixels of shape {pixels.shape}: pass 8 bit RGB"
        )
    sidecar = sidecar_of(file)
    report = _report_of(sidecar.read_bytes() if sidecar.is_file() else None)
    image = srgb_to_linear(pixels[:, :, :3] / 255.0).astype(np.float32)
    return Picture(file.name, image, report, None)


def compare_pictures(
    one: Picture, other: Picture, reference: Picture | None = None
) -> dict[str, Any]:
    """Measure one picture against the other, or both against a reference; return plain numbers.

    Of each measured picture: its `PictureErrors`, the relative RMSE that noise explains (``expected``), half of the
    95 % interval that the reports give the difference of the means, and the seconds; None where reports do not say.
    ``nearest`` and ``nearest_of_most`` name the nearer of two, of all pixels and without the worst 0.1 % of them, and
    ``..._told`` whether that can be told from noise (`hybrid_rt.analysis.nearer_picture`). ``same_noise``: those with
    the random numbers of what they are compared with. ``warnings``: pairs of a name and a text of its report.
    ``clipped``: the part of the pixels of each .png that is clipped at 1, if not all are .png.

    Raises ValueError if the pictures differ in size or are not finite.
    """
    measured, target, names = _measured(one, other, reference)
    for name, picture in zip(names, [*measured, target], strict=True):
        if picture.image.shape != target.image.shape:
            raise ValueError(
                f"{name} has {_size(picture)} pixels, {names[-1]} {_size(target)}: pass pictures of "
                "one size"
            )
        n_bad = int(np.count_nonzero(~np.isfinite(picture.image).all(axis=2)))
        if n_bad:
            raise ValueError(
                f"{name} has {n_bad} pixels that are not finite: render it again without them"
            )
    rows = {}
    for name, picture in zip(names, measured, strict=False):
        rows[name] = {
            **asdict(picture_errors(picture.image, target.image)),
            "expected": _expected(picture, target),
            "mean_half_interval": _half_interval(picture, target),
            "seconds": stated_number(picture.report, "seconds", "total"),
        }
    return {
        "against": names[-1],
        "errors": rows,
        **_nearest(names, measured, target, rows),
        "same_noise": [
            name
            for name, picture in zip(names, measured, strict=False)
            if picture is not target and _share_noise(picture.report, target.report)
        ],
        "warnings": [
            (name, words)
            for name, picture in zip(names, [*measured, target], strict=True)
            for words in _warnings_of(picture.report)
        ],
        "clipped": _clipped(dict(zip(names, [*measured, target], strict=True))),
    }


def _measured(
    one: Picture, other: Picture, reference: Picture | None
) -> tuple[list[Picture], Picture, list[str]]:
    """Return what is measured, against what, and names of all, of which no two are equal."""
    pictures = [one, other] if reference is None else [one, other, reference]
    names = [picture.name for picture in pictures]
    names = [
        name if names.count(name) == 1 else f"{name} ({i + 1})" for i, name in enumerate(names)
    ]
    return pictures[:-1], pictures[-1], names


def _nearest(
    names: Sequence[str],
    measured: Sequence[Picture],
    target: Picture,
    rows: dict[str, dict[str, Any]],
) -> dict[str, Any]:
    """Return which of two pictures is nearer, by each measure, and whether that can be told."""
    found: dict[str, Any] = {}
    of_all = of_most = None
    if len(measured) == 2:
        noise: list[Any] = [rows[name]["expected"] for name in names[:2]]
        one, other = (picture.image for picture in measured)
        known = None if None in noise else max(noise)
        of_all, of_most = verdicts(one, other, target.image, known)
    for key, verdict in (("nearest", of_all), ("nearest_of_most", of_most)):
        found[key], found[f"{key}_told"] = None, None
        if verdict is not None:
            found[f"{key}_told"] = verdict.is_told
            if verdict.is_told and verdict.first_is_nearer is not None:
                found[key] = names[0 if verdict.first_is_nearer else 1]
    return found


def _share_noise(one: dict[str, Any] | None, other: dict[str, Any] | None) -> bool:
    """Tell whether two renders drew the same random numbers: one integrator, one seed."""
    drawn = [
        [report["settings"].get(name) for name in ("integrator", "seed")]
        for report in (one, other)
        if report is not None and isinstance(report.get("settings"), dict)
    ]
    return len(drawn) == 2 and drawn[0] == drawn[1] and None not in drawn[0]


def _size(picture: Picture) -> str:
    height, width, _ = picture.image.shape
    return f"{width} x {height}"


def stated_number(report: dict[str, Any] | None, part: str, name: str) -> float | None:
    """Return a number of a report; None where a report, perhaps another program's, has none."""
    inner = None if report is None else report.get(part)
    value = inner.get(name) if isinstance(inner, dict) else None
    return float(value) if is_number(value) else None


def is_number(value: Any) -> TypeGuard[float]:
    """Tell whether a report has a number there; True and False are none."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def _clipped(pictures: dict[str, Picture]) -> dict[str, float]:
    """Return the part of the pixels of each .png that 8 bits clip, if others show more than 1."""
    shares = {
        name: float((picture.image >= 1.0).any(axis=2).mean())
        for name, picture in pictures.items()
        if picture.name.lower().endswith(".png")
    }
    if len(shares) == len(pictures):
        return {}
    return {name: share for name, share in shares.items() if share > 0.0}


def _warnings_of(report: dict[str, Any] | None) -> list[str]:
    """Return what a report warns of; nothing if it is another program's."""
    texts = None if report is None else report.get("warnings")
    return [text for text in texts if isinstance(text, str)] if isinstance(texts, list) else []


def _expected(one: Picture, other: Picture) -> float | None:
    """Return the relative RMSE between two pictures that differ by their noise only."""
    variance = 0.0
    for picture in (one, other):
        noise = stated_number(picture.report, "noise", "relative_rmse")
        if picture.standard_error is not None:
            level = np.hypot(other.image.astype(np.float64), math.sqrt(DARK))
            share = picture.standard_error.astype(np.float64) / level
            variance += float((share * share).mean())
        elif noise is not None:
            variance += noise**2
        else:
            return None
    # One pass knows no noise.
    return math.sqrt(variance) if math.isfinite(variance) else None


def _half_interval(one: Picture, other: Picture) -> float | None:
    """Return half of the 95 % interval of the difference of two means, by what the reports state."""
    first, second = (
        stated_number(picture.report, "noise", "half_interval_95_of_image_mean")
        for picture in (one, other)
    )
    return None if first is None or second is None else math.hypot(first, second)


def in_words(comparison: dict[str, Any]) -> str:
    """Format a comparison as a text table."""
    head = (
        "relative", "of most", "by noise", "RMSE", "of most", "mean", "stated", "worst", "render",
    )  # fmt: skip
    units = ("%", "%", "%", *["radiance"] * 5, "s")
    lines = [f"against {comparison['against']}:"]
    lines += [f"  {'':24}" + "".join(f" {word:>9}" for word in row) for row in (head, units)]
    for name, row in comparison["errors"].items():
        expected = "unknown" if row["expected"] is None else f"{100.0 * row['expected']:.3g}"
        half = row["mean_half_interval"]
        of_mean = "unknown" if half is None else f"+-{half:.2g}"
        seconds = "unknown" if row["seconds"] is None else f"{row['seconds']:.2f}"
        lines.append(
            f"  {name:24} {100.0 * row['relative_rmse']:9.3g} "
            f"{100.0 * row['relative_rmse_of_most']:9.3g} {expected:>9} {row['rmse']:9.3g} "
            f"{row['rmse_of_most']:9.3g} {row['mean_error']:+9.2g} {of_mean:>9} {row['worst']:9.3g} {seconds:>9}"
        )
    lines += _verdict(comparison)
    lines += [
        "  relative   root mean square of the pixels' differences, each over sqrt(r^2 + 0.01), where r is",
        f"             the pixel of {comparison['against']}",
        "  of most    the same without the worst 0.1 % of the pixels, which may be a few white dots",
        "  by noise   what the noise of both pictures explains of the relative difference, by their reports",
        "  RMSE       root mean square of the differences themselves",
        "  mean       mean difference; stated: what both reports' intervals of the mean explain of it (95 %),",
        "             which hold noise, blur by photons, and lamps that may not have been met yet",
        "  worst      the largest difference; render: seconds, by the report",
    ]
    if comparison["nearest_told"] is not None:
        lines += [
            "  nearer     decided by the relative error of most; by that of all as well, if it says otherwise.",
            "             It cannot be told if noise explains the difference of the two errors, and that varies",
            "             over the picture by more than its size",
        ]
    return "\n".join(lines)


def _verdict(comparison: dict[str, Any]) -> list[str]:
    """Say which picture is nearer to the reference, and what the differences may be due to."""
    against = comparison["against"]
    lines = _nearer(comparison)
    lines += [
        f"mean of {name}: {row['mean_error']:+.2g} from {against}, more than both reports' intervals of the mean explain (+-{half:.2g}, 95 %)"
        for name, row in comparison["errors"].items()
        if (half := row["mean_half_interval"]) is not None and abs(row["mean_error"]) > half
    ]
    lines += [
        f"WARNING: {name} is clipped at 1 in {percent(share)} of its pixels: compare a .npz or .exr"
        for name, share in comparison["clipped"].items()
    ]
    lines += [f"WARNING: {name}, by its report: {words}" for name, words in comparison["warnings"]]
    lines += [
        f"WARNING: {name} and {against} were rendered with one integrator and one seed: their noise is "
        "partly the same, so they differ by less than either differs from the truth (pass --seed)"
        for name in comparison["same_noise"]
    ]
    return lines


def _nearer(comparison: dict[str, Any]) -> list[str]:
    """Return the verdict by most pixels, and that by all pixels if it is another one."""
    found = {
        column: (comparison[key], comparison[f"{key}_told"])
        for column, key in (("of most", "nearest_of_most"), ("relative", "nearest"))
    }
    most, every = found.values()
    if most[1] is None or most == every == (None, True):
        return []
    errors = {"of most": "relative_rmse_of_most", "relative": "relative_rmse"}
    words = {}
    for column, (name, is_told) in found.items():
        by = ", ".join(
            f"{of} {percent(row[errors[column]])}" for of, row in comparison["errors"].items()
        )
        equal = "both alike" if is_told else "cannot be told, the difference may be noise"
        words[column] = f"{name or equal} ({by})"
    head = f"nearer to {comparison['against']}: "
    if most == every:
        return [f"{head}{words['of most']}"]
    return [
        f"{head}{words['of most']} without the worst 0.1 % of the pixels;",
        f"{'with them:':>{len(head) - 1}} {words['relative']}",
    ]


def error_map(image: NDArray[np.floating], reference: NDArray[np.floating]) -> Pixels:
    """Map relative errors (root mean square over channels) to colours: black 0.001, yellow 1."""
    relative = np.sqrt(relative_squares(image, reference).mean(axis=2))
    return error_colors(relative)


def comparison_sheet(
    one: Picture, other: Picture, reference: Picture | None = None, exposure: float = 0.0
) -> Pixels:
    """Return both pictures above the maps of their errors, with the scale of these."""
    measured, target, names = _measured(one, other, reference)
    panels = [
        (name, screen_pixels(picture.image, exposure))
        for name, picture in zip(names, (one, other), strict=False)
    ]
    for name, picture in zip(names, measured, strict=False):
        errors = picture_errors(picture.image, target.image)
        caption = (
            f"where {name} differs from {names[-1]}: {percent(errors.relative_rmse)} (relative RMSE), "
            f"mean {signed_percent(errors.relative_mean_error)}"
        )
        panels.append((caption, error_map(picture.image, target.image)))
    scale = "Relative difference of each pixel, root mean square over red, green and blue:"
    return sheet(panels, 2, scale=scale)


def check_sheet(path: str | os.PathLike[str], pictures: Sequence[str | os.PathLike[str]]) -> Path:
    """Return the path if a comparison of these pictures can be written there, as a .png; else raise."""
    out = as_path(path, "output")
    if any(out.resolve() == Path(picture).resolve() for picture in pictures):
        raise ValueError(f"output {str(out)!r} is one of the pictures: name another file")
    check_output(out)
    if out.suffix.lower() != ".png":
        raise ValueError(f"output {str(out)!r}: pass a .png, the map of errors is one")
    return out


def save_comparison(path: Path, sheet: Pixels, comparison: dict[str, Any]) -> Path:
    """Write a sheet as PNG (a.png) and the measurements (a.json); return the path of the latter."""
    import imageio.v3 as imageio

    with replacing(path) as file:
        imageio.imwrite(file, sheet, extension=".png")
    figures = sidecar_of(path)
    with replacing(figures) as file:
        file.write(as_json({**comparison, "versions": versions()}).encode())
    return figures
