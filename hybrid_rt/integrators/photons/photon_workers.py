"""Worker threads of photon mapping: they trace the photons of a pass together, then its eye pass.

While some threads still work on the eye pass of one pass, others trace the photons of the next: no
thread waits in between, and at most two photon maps exist at a time.
"""

from abc import abstractmethod
from collections import Counter
from collections.abc import Callable, Generator, Mapping
from concurrent.futures import Future
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core.ledger import twelve_digits
from hybrid_rt.core.records import FloatArray
from hybrid_rt.core.threads import result_of
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.kernels.photon_steps import (
    EMITTED,
    MET_SPECULAR,
    MET_SPREADING,
    Photons,
)
from hybrid_rt.integrators.options import PhotonMapOptions, PPMOptions
from hybrid_rt.integrators.photons.density_estimation import Field, Nearest, Points
from hybrid_rt.integrators.photons.emission import Piece, blocks_of, size_for_discs
from hybrid_rt.integrators.photons.eye_pass import EyePass
from hybrid_rt.integrators.photons.figures import (
    NO_BLUR,
    UNKNOWN_BLUR,
    Blur,
    BlurSums,
    PhotonFigures,
    Power,
)
from hybrid_rt.integrators.photons.photon_tracer import (
    AIMED_SHARE,
    PHOTON_DIMENSION,
    Balance,
    Splats,
)
from hybrid_rt.integrators.photons.pilot import find_thin_places
from hybrid_rt.integrators.rows import joined, rows_of
from hybrid_rt.integrators.workers import Made, Pass, Run, Submit, Workers

# Camera rays that one thread follows and gathers for at a time: many, as trees of many points are
# compared faster, but a sixteenth of a pass at most, for the threads to share. The order of the
# sums over photons depends on this number, so it is the same for any number of threads.
FEWEST_RAYS, MOST_RAYS, SHARE_OF_RAYS = 2**14, 2**15, 16

# From this share of points without photons on, light is missing rather than dark places common.
NEARLY_ALL = 0.99

# Light that no point has met may be this share of the light that was shown to the camera there. Of
# light of which no photon was met there are three expected at most (95 %); where half of the photons
# are aimed, the others have up to twice the mean power.
UNMET_SHARE, MOST_UNMET = 0.01, 3.0 / (1.0 - AIMED_SHARE)

# What is counted, by eye passes and beside them.
COUNTED = (
    "n_points", "n_gathered", "n_without", "n_shown", "shown_power", "n_splats", "n_caustic",
)  # fmt: skip

# Photons farther than this share of `size_for_discs` make no light at a point: around a caustic
# there is darkness, and the nearest photons lie anywhere.
FARTHEST = 0.05

BLUR_OF_NEAREST = (
    "light is blurred by discs about the nearest photons; more passes do not lessen it; "
    "blur_root_mean_square estimates it where it is above the estimate's noise"
)

T = TypeVar("T")


class PhotonPass(NamedTuple):
    """The photon maps of a pass, and the picture of its splats."""

    fields: tuple[Field, ...]
    picture: FloatArray | None
    n_splats: int
    balance: Balance


class PhotonWorkers(Workers):
    """See the module; `Workers` for what it offers.

    ``options``: the class of the options.
    ``may_miss``: whether discs may be too small to hold photons: their radius was given, the view
    is small beside what the photons light, or discs are cut to the size of a surface.
    """

    options: type[PPMOptions | PhotonMapOptions]
    may_miss = False

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads, EyePass)
        self._threads = threads
        self._options: Any = context.options or self.options()
        self._counted: dict[str, Any] = Counter()
        self._balance = Balance()
        self._blocks: dict[int, list[list[Piece]]] = {}
        camera = context.scene.camera
        has_photons = context.plan["photons"]
        self._blur = BlurSums(camera.height, camera.width) if has_photons else None

    @property
    def _eye_passes(self) -> list[EyePass]:
        return cast(list[EyePass], self._integrators)

    def _find_thin_places(self, radius_at: Callable[[Points], FloatArray]) -> None:
        places = find_thin_places(self._eye_passes[0].context, radius_at)
        for eye_pass in self._eye_passes:
            eye_pass.thin_places = places

    @abstractmethod
    def _fields(self, photons: Photons, pass_number: int) -> tuple[Field, ...]:
        """Build the photon maps of a pass."""

    @abstractmethod
    def _about(self) -> dict[str, Any]:
        """Return the settings and radii for the report, and what is to be known of the blur."""

    def render_passes(
        self, passes: range, on_rays: Callable[[int], None] | None = None
    ) -> Generator[Made, None, None]:
        """Yield the passes in their order: one photon map each."""
        camera = self.context.scene.camera
        change = np.zeros_like(self._eye_passes[0].blur)
        with self._at_work() as submit:
            started = self._start(passes[0], submit)
            for k, number in enumerate(passes):
                photons: PhotonPass = result_of(started)
                # Threads trace the next photons while others follow the camera rays of this pass.
                if number + 1 in passes:
                    started = self._start(number + 1, submit)
                for eye_pass in self._eye_passes:
                    eye_pass.fields, eye_pass.blur = photons.fields, change
                done = k * camera.height * camera.width

                def heard(n: int, done: int = done) -> None:
                    if on_rays is not None:
                        on_rays(done + n)

                for made in super().render_passes(range(number, number + 1), heard):
                    assert isinstance(made, Pass)
                    # Not before: a pass that is given up is in no picture.
                    self._balance.add(photons.balance)
                    self._counted["n_splats"] += photons.n_splats
                    radiance = made.radiance
                    if photons.picture is not None:
                        radiance = radiance + photons.picture
                    yield Pass(radiance, change)

    @property
    def n_kept(self) -> int:
        """Passes of which the picture is made."""
        return 0 if self._blur is None else self._blur.n_passes

    def keep(self, made: Made) -> None:
        """Add what passes say of the blur, once they are part of the picture."""
        if self._blur is None or made.blur_change is None:
            return
        if isinstance(made, Run):
            self._blur.add_run(made.blur_change)
        else:
            self._blur.add(made.blur_change)

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the sums of the blur."""
        return {} if self._blur is None else self._blur.state()

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Take over the sums of the blur."""
        if self._blur is not None:
            self._blur.restore(state)

    def _block_size(self, n: int) -> int:
        return min(max(-(-n // SHARE_OF_RAYS), FEWEST_RAYS), MOST_RAYS)

    def _start(self, pass_number: int, submit: Submit) -> Future[PhotonPass]:
        """Start the tracing of a pass's photons in threads."""
        if not self.context.plan["photons"]:
            return submit(lambda *_: PhotonPass((), None, 0, Balance()), None)

        def finish(photons: Photons, splats: list[Splats], balance: Balance) -> PhotonPass:
            fields, picture = self._fields(photons, pass_number), self._picture(splats)
            return PhotonPass(fields, picture, sum(pixel.size for pixel, _ in splats), balance)

        n = self._options.photons_per_pass
        return self._shoot(n, pass_number, PHOTON_DIMENSION, submit, finish)

    def _shoot(
        self,
        n: int,
        pass_number: int,
        dimension: int,
        submit: Submit,
        finish: Callable[[Photons, list[Splats], Balance], T],
    ) -> Future[T]:
        """Trace photons in threads, and call ``finish`` with all of them in one of these.

        The order of photons, and of sums over them, is the same for any number of threads.
        """

        def shoot(eye_pass: EyePass, block: list[Piece]) -> tuple[Photons, list[Splats], Balance]:
            tracer = eye_pass.photon_tracer
            tracer.balance = Balance()
            photons, splats = tracer.shoot(block, pass_number, dimension, MET_SPECULAR)
            return photons, splats, tracer.balance

        if n not in self._blocks:
            self._blocks[n] = blocks_of(self._eye_passes[0].photon_tracer.groups(n))
        parts = [submit(shoot, block) for block in self._blocks[n]]

        def join(eye_pass: EyePass, _: None) -> T:
            # Threads take work in order, so all parts are done or in the hands of others.
            found = [part.result() for part in parts]
            total = Balance()
            for _, _, balance in found:
                total.add(balance)
            with eye_pass.context.ledger.stage("photon tree"):
                photons = joined([photons for photons, _, _ in found])
                return finish(photons, [one for _, splats, _ in found for one in splats], total)

        return submit(join, None)

    def _picture(self, shown: list[Splats]) -> FloatArray | None:
        """Return the splats of a pass, (height, width, 3)."""
        if not shown:
            return None
        camera = self.context.scene.camera
        picture = np.zeros((camera.height, camera.width, 3))
        for pixel, value in shown:
            np.add.at(picture.reshape(-1, 3), pixel, value)
        return picture

    def _own_counts(self) -> dict[str, Any]:
        own = {"n_emitted": self._balance.n_emitted, "n_stored": self._balance.n_stored}
        return {**self._total, **own, "power": self._balance.power.tolist()}

    @property
    def _total(self) -> dict[str, Any]:
        """What all threads have counted."""
        counted = [self._counted, *(eye_pass.counted for eye_pass in self._eye_passes)]
        return {name: sum(one[name] for one in counted) for name in COUNTED}

    def _carry_own(self, counts: dict[str, Any]) -> None:
        for name in COUNTED:
            self._counted[name] += counts.get(name, 0)
        power = np.array(counts["power"])
        self._balance.add(Balance(power, counts["n_emitted"], counts["n_stored"]))

    def _forget_own(self) -> None:
        for eye_pass in self._eye_passes:
            eye_pass.counted.clear()
        self._counted.clear()
        self._balance = Balance()

    def photons(self, blur: Blur) -> PhotonFigures:
        """Return the photon statistics of the report, in plain types."""
        counted, balance = self._total, self._balance
        power = [[twelve_digits(x) for x in part] for part in balance.power.tolist()]
        return PhotonFigures(
            **self._about(),
            per_pass=self._options.photons_per_pass,
            emitted=balance.n_emitted,
            stored=balance.n_stored,
            shown_to_camera=counted["n_splats"],
            gather_points=counted["n_points"],
            gathered_per_point=counted["n_gathered"] / max(counted["n_points"], 1),
            points_without_photons=counted["n_without"],
            points_with_shown_photons_alone=counted["n_shown"],
            blur_root_mean_square=blur.absolute,
            blur_root_mean_square_at_most=blur.absolute_at_most,
            blur_relative_rmse=blur.relative,
            blur_relative_rmse_at_most=blur.relative_at_most,
            blur_of_image_mean=blur.of_mean,
            blur_of_image_mean_standard_error=blur.of_mean_error,
            power_of_all_passes=Power(*power),
        )

    def blur(self, image: NDArray[np.float32]) -> Blur:
        """Estimate the blur (bias) of the mean of all passes so far."""
        if self._blur is None:
            return NO_BLUR
        is_met = self._total["n_gathered"] > 0
        # A black picture is none that photons, which met nothing that is seen, tell anything of.
        is_black = self._balance.n_emitted > 0 and not image.any()
        if not is_met and (is_black or (self.may_miss and self.n_missed)):
            return UNKNOWN_BLUR
        return self._blur.estimate(image)

    @property
    def n_missed(self) -> int:
        """Points that met no photon, though expected to, if these are nearly all; else 0.

        Photons that are shown to the camera are not gathered as well: where most are, few are missed.
        A point whose disc holds some has met light. What it waits for is less, if these have a power
        beside which few photons are little.
        """
        counted, n_stored = self._total, self._balance.n_stored
        if n_stored == 0 or 2 * counted["n_splats"] > n_stored:
            return 0
        n_missed = counted["n_without"]
        of_one = float(self._balance.power[EMITTED].sum()) / self._balance.n_emitted
        if MOST_UNMET * of_one < UNMET_SHARE * counted["shown_power"]:
            n_missed -= counted["n_shown"]
        return int(n_missed) if n_missed >= max(NEARLY_ALL * counted["n_points"], 1) else 0


class PhotonMapWorkers(PhotonWorkers):
    """Photon mapping with a fixed number of nearest photons per estimate.

    Jensen, "Global illumination using photon maps", EGWR 1996. Two maps are kept: photons that have met
    only mirrors, metals and glass make the caustic map, all others the global map. Each estimate takes
    the nearest photons of both. That is fast and smooth, but the discs do not shrink: more passes
    reduce noise, not blur.
    """

    options = PhotonMapOptions

    def __init__(self, context: RenderContext, threads: int) -> None:
        super().__init__(context, threads)
        self._size = size_for_discs(context)
        if context.plan["photons"]:
            self._find_thin_places(lambda points: np.minimum(FARTHEST * self._size, points.widest))

    def _fields(self, photons: Photons, pass_number: int) -> tuple[Field, ...]:
        del pass_number
        nearest, lobes = self._options.nearest, self.context.scene.lobes
        limit = FARTHEST * self._size
        is_soft = (photons.history & MET_SPREADING) != 0
        fields = [Nearest(rows_of(photons, is_soft), lobes, nearest, limit)]
        if self.context.plan["caustic map"]:
            self._counted["n_caustic"] += int(np.count_nonzero(~is_soft))
            fields.append(Nearest(rows_of(photons, ~is_soft), lobes, nearest, limit))
        return tuple(fields)

    def _about(self) -> dict[str, Any]:
        return {
            "nearest": self._options.nearest,
            "stored_in_caustic_map": self._total["n_caustic"],
            "blur": BLUR_OF_NEAREST,
        }
