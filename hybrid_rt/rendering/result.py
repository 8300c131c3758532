"""What a render returns: a picture, its report, and what is done with them."""

import math
import os
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.rendering.channels import OUTPUTS
from hybrid_rt.rendering.denoising import DenoisedPicture, denoise
from hybrid_rt.rendering.display import as_html, one_line, png
from hybrid_rt.rendering.forecast import Forecast, forecast
from hybrid_rt.rendering.report import Report
from hybrid_rt.rendering.units import passes_in_words
from hybrid_rt.sensor.image_files import save_image


@dataclass(frozen=True)
class RenderResult:
    """A picture and its report.

    Attributes
    ----------
    image : (height, width, 3) float32
        Linear radiance, row 0 at the top.
    report : Report
        Settings, counts, seconds and versions: a dict of plain types, with its entries as attributes.
        ``report.to_json()`` is the text of the file beside the picture. The page "The report" of the
        documentation explains every entry.
    channels : dict
        The requested ``outputs`` by name, (height, width) or (height, width, k) arrays, such as
        ``channels["depth"]``. The page "Pictures as files" lists them.
    """

    image: NDArray[np.float32]
    report: Report
    channels: dict[str, NDArray[np.float32]] = field(default_factory=dict)

    @property
    def error(self) -> float:
        """The estimated relative root mean square error of the picture: noise, and blur of photons.

        A target error is compared with this value. It is nan after a single pass, and inf if
        nothing is known of the blur. Where the blur cannot be distinguished from the noise of its
        estimate (``relative_error.blur`` of the report is None), its upper limit ``blur_at_most``
        counts in its place, so the error is mostly overstated. Of spots and lines narrower than the
        discs of photons the blur may be stated two or more times too small; then ``blur_at_most``
        tells more. It counts neither light that the integrator does not find, nor lamps that no camera
        ray has met (``noise.unmet_lamps_95`` of the report), nor the geometric error.
        """
        error = self.report.relative_error
        return math.nan if error is None else error.of("target_error")

    @property
    def error_trimmed(self) -> float:
        """As `error`, without the noise of the worst 0.1 % of the pixels.

        A few bright paths may dominate `error` in a picture that looks fine.
        """
        error = self.report.relative_error
        return math.nan if error is None else error.of("target_error_trimmed")

    @property
    def mean(self) -> float:
        """Mean radiance over all pixels and channels; see `mean_half_interval`."""
        return float(self.image.mean(dtype=np.float64))

    @property
    def mean_half_interval(self) -> float:
        """Half of the 95 % interval of `mean`, radiance; nan after a single pass.

        ``noise.half_interval_95_of_image_mean`` of the report: noise, blur of photons, and what lamps
        that no camera ray has met may add. It counts neither light that the integrator does not find
        nor what ``max_depth`` cuts off.
        """
        noise = self.report.noise
        return math.nan if noise is None else noise.half_interval_95_of_image_mean

    @property
    def seconds(self) -> float:
        """Wall-clock seconds of the render, without the compilation of kernels."""
        return self.report.total_seconds

    @property
    def passes(self) -> int:
        """Number of passes of which the picture is the mean."""
        return self.report.passes

    def forecast(self, error: float, *, trimmed: bool = False) -> Forecast | None:
        """Return the passes and seconds, all from the first one on, that a relative error takes.

        Parameters
        ----------
        error : float
            Of `error` or, if ``trimmed``, of `error_trimmed`.
        trimmed : bool
            Whether the worst 0.1 % of the pixels are left out.

        Returns
        -------
        Forecast or None
            With ``passes`` and ``seconds``. None: no number of passes brings it, or, as after a single pass,
            nothing is known.
        """
        return forecast(self.report, checks.number(error, "error", above=0.0), trimmed=trimmed)

    def save(self, path: str | os.PathLike[str], exposure: float = 0.0) -> None:
        """Write the picture, and the report beside it; see `hybrid_rt.sensor.image_files.save_image`.

        Parameters
        ----------
        path : path
            Its ending is the format: .png, .npz or .exr.
        exposure : float
            Stops by which a .png is brighter, or darker if negative; other formats hold the radiance.
        """
        parts = {name: output.parts for name, output in OUTPUTS.items()}
        save_image(path, self.image, self.report, self.channels, exposure, parts)

    def denoised(self) -> DenoisedPicture:
        """Return a smoother, biased picture; see `hybrid_rt.rendering.denoising.denoise`.

        The render needs ``outputs=["albedo", "normal"]``. No error in the report refers to it.
        """
        return denoise(self.image, self.channels, self.report)

    def __repr__(self) -> str:
        """Name size, integrator, passes, error and seconds."""
        return one_line(self.image, self.report)

    def _repr_png_(self) -> bytes:
        """Return the picture as notebooks show it: as `save` writes it to a .png file."""
        return png(self.image)

    def _repr_html_(self) -> str:
        """Return the picture and its report as notebooks show them."""
        return as_html(self.image, self.report)


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a render after at least one pass.

    Attributes
    ----------
    result : RenderResult
        The picture of the complete passes. ``report.stopped_by`` is "interrupted", unless all
        passes were complete when Ctrl-C was pressed.
    """

    def __init__(self, result: RenderResult) -> None:
        super().__init__(f"interrupted after {passes_in_words(result.report.passes)}")
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as what it was made of."""
        return RenderInterrupted, (self.result,)
