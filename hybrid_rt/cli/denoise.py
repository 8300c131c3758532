"""The option ``--denoise``: a second picture beside each file, for the eye."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from hybrid_rt.cli.command import REFUSALS

if TYPE_CHECKING:
    from hybrid_rt.rendering.result import RenderResult


def add_denoise_option(parser: argparse.ArgumentParser) -> None:
    """Add ``--denoise``."""
    parser.add_argument(
        "--denoise",
        action="store_true",
        help="write a second picture beside each file, a.denoised.png of a.png, by Intel Open Image "
        "Denoise: smoother and biased; no stated error refers to it (needs hybrid-rt[denoise])",
    )


def denoised_files(outputs: Mapping[str, Path]) -> dict[str, Path]:
    """Return the files of the denoised pictures, by what the user calls them; raise if one cannot be."""
    from hybrid_rt.rendering.denoising import check_denoiser, denoised_name
    from hybrid_rt.sensor.image_files import check_output

    check_denoiser()
    names = {}
    for shown, file in outputs.items():
        name = denoised_name(file)
        if name in outputs.values():
            raise ValueError(
                f"--denoise: the denoised picture of {shown!r} would be {name.name!r}, which is an "
                "--out as well: name another file"
            )
        names[str(denoised_name(shown))] = check_output(name)
    return names


def save_denoised(
    result: RenderResult, files: Mapping[str, Path], exposure: float
) -> tuple[list[str], dict[str, str]]:
    """Denoise a result, and write it where that can be; return lines on what is written, and why others are not."""
    from hybrid_rt.rendering.denoising import BIASED

    said: list[str] = []
    failures: dict[str, str] = {}
    try:
        picture = result.denoised()
    except (*REFUSALS, RuntimeError) as error:  # a RuntimeError is the denoiser's own
        return said, {"--denoise": f"--denoise: {error}"}
    seconds = picture.report["denoised"]["seconds"]
    for shown, file in files.items():
        try:
            picture.save(file, exposure)
            said.append(f"{shown}  ({BIASED}; {seconds:.2f} s)")
        except REFUSALS as error:  # the next may do better
            failures[shown] = str(error) or type(error).__name__
    return said, failures
