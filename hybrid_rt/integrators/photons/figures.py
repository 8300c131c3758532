"""What a report says of photons, and of the light that they alone find."""

from dataclasses import dataclass

from hybrid_rt.core.plain_records import absent

# Light that an integrator does not find and that is not measured either.
NOT_MEASURED = "paths without a surface that spreads light widely"


@dataclass(frozen=True)
class LightNotFound:
    """Light that an integrator does not find, of paths that meet a wide lobe."""

    photons: int  # photons traced
    max_depth: int  # bounces that they were followed for
    # What they carried there, over what they carried behind their first surface: about the share of
    # this light that has more bounces, and that ``mean`` lacks
    lost_share: float
    # What it would add to the mean of the picture over pixels and channels; None if not known
    mean: float | None = None
    # None where nothing of a group of photons reaches the camera: what is seen so rarely has no
    # interval that holds
    half_interval_95: float | None = None
    why_unknown: str = ""  # Why there is no ``mean``; "": there is
    share_of_image_mean: float | None = None
    not_measured: str = NOT_MEASURED


@dataclass(frozen=True)
class Power:
    """Power by channel, summed over all passes: emitted, and what became of it."""

    emitted: list[float]
    escaped: list[float]
    absorbed: list[float]
    lost: list[float]


@dataclass(frozen=True, kw_only=True)
class PhotonFigures:
    """Settings, counts, blur and power of the photons of a render.

    The page "The report" of the documentation explains them. Those that may be None belong to one
    integrator.
    """

    per_pass: int
    emitted: int
    stored: int
    stored_in_caustic_map: int | None = absent()
    shown_to_camera: int
    alpha: float | None = absent()
    first_radii: list[float] | None = absent()
    last_radii: list[float] | None = absent()
    camera_rays_per_pixel: int | None = absent()
    shadow_rays_per_point: int | None = absent()
    nearest: int | None = absent()
    gather_points: int
    gathered_per_point: float
    points_without_photons: int
    points_with_shown_photons_alone: int
    blur: str
    blur_root_mean_square: float | None
    blur_root_mean_square_at_most: float | None
    blur_relative_rmse: float | None
    blur_relative_rmse_at_most: float | None
    blur_of_image_mean: float | None
    blur_of_image_mean_standard_error: float | None
    power_of_all_passes: Power

    @property
    def lost_share(self) -> float:
        """The power that ``max_depth`` cut off, over all that was emitted."""
        power = self.power_of_all_passes
        return sum(power.lost) / sum(power.emitted) if any(power.lost) else 0.0
