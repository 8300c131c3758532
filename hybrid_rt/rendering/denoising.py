"""A picture for the eye: noise taken off a render by Intel Open Image Denoise.

A neural network guesses the picture behind the noise from radiance, albedo and normals. It is
smoother, usually nearer to the truth, and biased: it invents as well as removes. So it is a second
picture with a name of its own, and no error that a report states refers to it.

Afra, "Intel Open Image Denoise", https://www.openimagedenoise.org.
"""

import importlib
import importlib.util
import os
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.one_line import cut
from hybrid_rt.rendering.display import png
from hybrid_rt.sensor.image_files import save_image
from meshing.checks import as_path

# What the network is guided by, besides the radiance.
GUIDES = ("albedo", "normal")
BIASED = "denoised by a neural network: smoother and biased; no stated error refers to it"
# Part of the name of every file that holds such a picture.
WORD = "denoised"


@dataclass(frozen=True)
class DenoisedPicture:
    """A denoised render: biased, and without a stated error.

    Attributes
    ----------
    image : (height, width, 3) float32
        Linear radiance, row 0 at the top.
    report : dict
        By what it was denoised, and the passes and settings of the render; plain types only.
    """

    image: NDArray[np.float32]
    report: dict[str, Any]

    def save(self, path: str | os.PathLike[str], exposure: float = 0.0) -> Path:
        """Write the picture, and its report beside it; return its path.

        A path without the word "denoised" in its name gets it: a.png becomes a.denoised.png.
        Raises as `hybrid_rt.sensor.image_files.save_image`.
        """
        target = denoised_name(path)
        save_image(target, self.image, self.report, exposure=exposure)
        return target

    def __repr__(self) -> str:
        """Name size and passes."""
        height, width = self.image.shape[:2]
        return cut(f"DenoisedPicture({width} x {height}, {self.report['passes']} passes)", "...)")

    def _repr_png_(self) -> bytes:
        """Return the picture as notebooks show it."""
        return png(self.image)


def denoised_name(path: str | os.PathLike[str]) -> Path:
    """Return the path of a denoised picture: a.denoised.png for a.png."""
    target = as_path(path, "output")
    if WORD in target.name:
        return target
    return target.with_name(f"{target.stem}.{WORD}{target.suffix}")


def check_denoiser() -> None:
    """Raise ModuleNotFoundError if the denoiser is not installed, or ImportError if it is in part."""
    needed = "denoising needs the package pyoidn: pip install 'hybrid-rt[denoise]'"
    if importlib.util.find_spec("pyoidn") is None:
        raise ModuleNotFoundError(needed)
    try:
        importlib.import_module("pyoidn")
    except ImportError as error:
        raise ImportError(f"{needed} (it cannot be imported: {error})") from None


def denoise(
    image: NDArray[np.float32], channels: Mapping[str, NDArray[np.float32]], report: dict[str, Any]
) -> DenoisedPicture:
    """Denoise a linear picture (height, width, 3) by its channels "albedo" and "normal"; nan in them is 0.

    Raises ModuleNotFoundError without the package pyoidn (the extra "denoise"), and ValueError if a channel is
    missing or a pixel is not finite.
    """
    check_denoiser()
    for name in GUIDES:
        if name not in channels:
            raise ValueError(
                f"the result has no channel {name!r}, by which denoising is guided: "
                f"pass outputs={list(GUIDES)} to render"
            )
    n_bad = int(np.count_nonzero(~np.isfinite(image).all(axis=2)))
    if n_bad:
        raise ValueError(
            f"image has {n_bad} pixels that are not finite: denoising would spread them"
        )
    import pyoidn

    began = time.perf_counter()
    albedo, normal = (np.nan_to_num(channels[name]) for name in GUIDES)
    # The channels are free of noise but not antialiased. To call them clean took twice the time and
    # left up to a quarter more squared error.
    smooth = pyoidn.denoise(image, np.clip(albedo, 0.0, 1.0), np.clip(normal, -1.0, 1.0), hdr=True)
    return DenoisedPicture(
        smooth,
        {
            "denoised": {
                "warning": BIASED,
                "by": f"Intel Open Image Denoise {pyoidn.version.oidn_version}",
                "guided_by": list(GUIDES),
                "seconds": time.perf_counter() - began,
            },
            "passes": report["passes"],
            "settings": report["settings"],
            "versions": report["versions"],
        },
    )
