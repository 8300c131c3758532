"""The report of a render: settings, seconds, counts, errors, and the light that is left out.

The page "The report" of the documentation explains every entry.
"""

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Self, TypedDict

from hybrid_rt.core import checks
from hybrid_rt.core.plain_records import absent, as_json, from_plain, inline, plain_fields
from hybrid_rt.integrators import INTEGRATORS
from hybrid_rt.integrators.photons.figures import LightNotFound, PhotonFigures
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.scene.lint.faults import Faults
from hybrid_rt.scene.lint.lamps_in_surfaces import LampInSurface
from hybrid_rt.sensor.film import Noise

# Number of the layout. It grows when an entry changes its name or its meaning, not when one is added.
LAYOUT = 1
# What a picture holds if nothing is left out.
ALL_LIGHT = "all light"
# If the worst 0.1 % of the pixels hold this share of the squared error, the noise of all is rough.
SHARE_OF_FEW = 0.5
# The stages of which the seconds do not grow with the passes.
_ONCE = (
    "scene", "build", "set-up", "cluster", "audit", "light not found", "cross-check", "channels",
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class PictureSettings(Settings):
    """The settings of a render, and the size of its picture."""

    width: int
    height: int


@dataclass(frozen=True)
class PictureNoise(Noise):
    """The noise of a picture, and the 95 % interval of its mean."""

    unmet_lamps_95: float  # what lamps that no camera ray has met may add to the mean, at most
    half_interval_95_of_image_mean: float

    @property
    def few_decide(self) -> bool:
        """Whether the noise of all pixels is that of a few bright specks."""
        return (
            self.worst_pixels > 0
            and math.isfinite(self.relative_rmse_trimmed)
            and self.worst_pixels_share_of_squared_error >= SHARE_OF_FEW
        )

    @property
    def rises(self) -> bool:
        """Whether more passes will bring more dots than there are worst pixels."""
        return self.relative_rmse_trimmed_ahead > self.relative_rmse_trimmed


@dataclass(frozen=True)
class RelativeError:
    """The estimated relative errors of a picture; None where nothing is known of the blur."""

    noise: float
    noise_trimmed: float
    blur: float | None
    blur_at_most: float | None
    both: float | None
    both_trimmed: float | None
    both_trimmed_ahead: float | None
    blur_stays: bool
    error_power: float

    def of(self, target: str) -> float:
        """Return the error that "target_error" or "target_error_trimmed" is about; inf: unknown."""
        error = self.both if target == "target_error" else self.both_trimmed
        return math.inf if error is None else error

    @property
    def stays(self) -> float:
        """The part that more passes do not reduce."""
        return (self.blur or 0.0) if self.blur_stays else 0.0


@dataclass(frozen=True)
class MeanCheck:
    """The independent estimate of the image mean, by photons."""

    photons: int
    photons_seen: int
    mean: float
    interval_95: tuple[float, float]
    of_highlights: float
    brightest_place: float
    unmet_place_95: float
    image_mean_lacks_at_most: float
    regions_lack_at_most: list[float]
    contradicts: bool
    region: int | None


@dataclass(frozen=True, kw_only=True)
class EndedBranches:
    """Paths that ended, ``by_reason``, and what those carried that limits of depth and weight ended."""

    by_reason: dict[str, int] = inline()
    lost_weight_per_camera_ray: float
    lost_share: float


@dataclass(frozen=True)
class WrongFirstHits:
    """A check of uncertified first hits, see `hybrid_rt.rendering.audit`."""

    rays: int
    wrong: int
    share: float
    interval_95: tuple[float, float]
    missed: int
    phantom: int
    farther: int
    mean_error: float
    worst_error: float


@dataclass(frozen=True)
class Geometry:
    """The geometric error."""

    accuracy: str
    camera_hits: int
    camera_hits_without_bound: int
    largest_t_bound_of_camera_hits: float
    certified_rays: int
    given_up: int
    tangent: int
    changed_by_certificate: int
    wrong_first_hits: WrongFirstHits | None


@dataclass(frozen=True)
class CoarseStage:
    """What coarse hits took; the seconds are within those of the stages that trace rays."""

    stage: str
    triangles: int
    build_seconds: float
    hit_seconds: float
    share_of_seconds: float


@dataclass(frozen=True)
class ClusterFigures:
    """What a cluster did."""

    address: str
    workers: int
    threads: int
    refused: dict[str, str]
    tasks: int
    tried_again: int
    seconds_of_tasks: float
    mib_received: float
    lost: str


class Session(TypedDict):
    """A call of `render` that added passes, as a store keeps it."""

    began: float
    passes: list[int]
    seconds: float
    kernel_compilation_seconds: float
    threads: int


@dataclass(frozen=True)
class StoreFigures:
    """What a store holds, and what of it was lost or not saved."""

    folder: str
    passes_before: int
    sessions: list[Session]
    lost: list[str]
    not_saved: str


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Report(dict[str, Any]):
    """What is known of a picture.

    It also is the dict that its JSON file holds: ``report.noise.image_mean`` is
    ``report["noise"]["image_mean"]``. The attributes are what the render found.
    What is added to the dict is written to files with it, and changes no attribute.
    """

    layout: int = LAYOUT
    settings: PictureSettings
    versions: dict[str, str]
    passes: int
    stopped_by: str
    seconds: dict[str, float]
    coarse: CoarseStage
    kernel_compilation_seconds: float
    rays: dict[str, int]
    hits: dict[str, int]
    intersection: dict[str, int]
    ended_branches: EndedBranches
    noise: PictureNoise | None
    cross_check: MeanCheck | None
    relative_error: RelativeError | None
    light_not_found: list[str]
    light_not_found_measured: LightNotFound | None
    picture_holds: str
    picture_is_blurred: bool
    clear_bodies_not_closed: dict[str, int]
    clear_bodies_lost: dict[str, int]
    lamps_in_surfaces: list[LampInSurface]
    faults: Faults = inline()
    pixels_not_finite: int
    geometry: Geometry
    peak_memory_mib: float
    plan: dict[str, dict[str, dict[str, str]]]
    photons: PhotonFigures | None = absent()
    points_missed_by_photons: int
    cluster: ClusterFigures | None
    store: StoreFigures | None
    warnings: list[str] = field(default_factory=list)
    exact_against_mesh: dict[str, Any] | None = absent()

    def __post_init__(self) -> None:
        """Be the dict as well."""
        super().update(plain_fields(self))

    def to_json(self) -> str:
        """Return the text of a JSON file; numbers that are not finite become null."""
        return as_json(self)

    @classmethod
    def from_json(cls, text: str | bytes) -> Self:
        """Return the report of such a text; see `from_dict`."""
        return cls.from_dict(json.loads(text))

    @classmethod
    def from_dict(cls, held: Mapping[str, Any]) -> Self:
        """Return the report of a dict.

        Raises ValueError if it is no report of a render, one of another layout, or of an unknown integrator.
        """
        layout = held.get("layout") if isinstance(held, Mapping) else None
        if layout != LAYOUT:
            raise ValueError(
                f"report has layout {layout}: pass that of a render by hybrid_rt, of layout {LAYOUT}"
            )
        try:
            settings = {**held["settings"], "outputs": tuple(held["settings"]["outputs"])}
            name = checks.choice(settings["integrator"], "integrator", INTEGRATORS)
            if settings["options"] is not None:
                settings["options"] = INTEGRATORS[name].options(**settings["options"])
            return from_plain(cls, {**held, "settings": settings})
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"report cannot be read: {error!r}") from error

    @property
    def share_cut_off(self) -> tuple[float, float]:
        """What limits of depth and weight have ended: of camera paths, and of photons.

        Of paths from the camera what they carried there, over what they carried behind the first surface
        that spreads light: a dark surface sends little on in any case. Of photons their power, over all
        that was emitted.
        """
        photons = self.photons
        return self.ended_branches.lost_share, 0.0 if photons is None else photons.lost_share

    @property
    def depth_cuts_off(self) -> bool:
        """Whether ``max_depth`` has ended anything, not only the limit of faint branches.

        Integrators from elsewhere may state the weight that was lost, and not how many paths lost it.
        """
        ended, (of_paths, of_photons) = self.ended_branches.by_reason, self.share_cut_off
        is_by_depth = of_paths > 0.0 and not ended.get("below least contribution", 0)
        return ended.get("at max_depth", 0) > 0 or is_by_depth or of_photons > 0.0

    @property
    def share_without_light(self) -> float:
        """The part of the pixels that are black in every pass; 0 where it is not known."""
        if self.noise is None:
            return 0.0
        return self.noise.pixels_without_light / (self.settings.width * self.settings.height)

    @property
    def unmet_at_most(self) -> float:
        """What lamps and places that no camera ray has met may add to the mean, at most (95 %)."""
        place = 0.0 if self.cross_check is None else self.cross_check.unmet_place_95
        return 0.0 if self.noise is None else max(self.noise.unmet_lamps_95, place)

    @property
    def unmet_decides(self) -> bool:
        """Whether unmet light makes the interval of the mean: if it had been met, noise would."""
        noise = self.noise
        return (
            noise is not None and 0.0 < self.unmet_at_most >= noise.half_interval_95_of_image_mean
        )

    @property
    def total_seconds(self) -> float:
        """Wall-clock seconds of the render, without the compilation of kernels."""
        return self.seconds["total"]

    @property
    def seconds_once(self) -> float:
        """The seconds that do not grow with the passes."""
        return min(sum(self.seconds.get(stage, 0.0) for stage in _ONCE), self.total_seconds)

    @property
    def seconds_of_passes(self) -> float:
        """The seconds that do."""
        return self.total_seconds - self.seconds_once

    @property
    def n_traced(self) -> int:
        """Rays traced, shadow rays included."""
        return self.intersection["rays"] + self.intersection["shadow_rays"]
