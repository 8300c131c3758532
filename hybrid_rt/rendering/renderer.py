"""The whole of a render: a scene in, a picture and its report out."""

from __future__ import annotations

import math
import os
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from hybrid_rt.core import checks
from hybrid_rt.core.interrupts import held_back
from hybrid_rt.core.ledger import Ledger, plain, twelve_digits
from hybrid_rt.core.precompile import want
from hybrid_rt.core.progress import Progress, watch_compilation
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators import INTEGRATORS, OPTIONS, Options, RenderContext
from hybrid_rt.integrators.media.absorption import unclosed_bodies
from hybrid_rt.integrators.options import DEEPEST
from hybrid_rt.integrators.workers import TOGETHER, Blur, Workers
from hybrid_rt.intersection import Intersector
from hybrid_rt.intersection.intersector import check_settings
from hybrid_rt.rendering.audit import audit
from hybrid_rt.rendering.channels import compute_channels
from hybrid_rt.rendering.limits import Clock, Limit
from hybrid_rt.rendering.memory import check_memory, photons_of
from hybrid_rt.rendering.summary import passes_in_words
from hybrid_rt.rendering.versions import peak_memory_mib, versions
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import compile_scene
from hybrid_rt.scene.plan import KERNELS_FOR, make_plan
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.channel_names import check_names
from hybrid_rt.sensor.film import Film
from hybrid_rt.sensor.image_files import save_image


@dataclass(frozen=True)
class RenderResult:
    """A picture and how it came about.

    Attributes
    ----------
    image : (height, width, 3) float32
        Linear radiance, row 0 at the top.
    report : dict
        Settings, counts, seconds, versions; plain types only.
    channels : dict
        The outputs asked for, by name; see `hybrid_rt.rendering.channels`.
    """

    image: NDArray[np.float32]
    report: dict[str, Any]
    channels: dict[str, NDArray[np.float32]] = field(default_factory=dict)

    def save(self, path: str | os.PathLike[str], exposure: float = 0.0) -> None:
        """Write the picture, and the report beside it; see `hybrid_rt.sensor.image_files.save_image`."""
        save_image(path, self.image, self.report, self.channels, exposure)


class RenderInterrupted(KeyboardInterrupt):
    """Ctrl-C ended a render after at least one pass.

    Attributes
    ----------
    result : RenderResult
        The picture of the passes that were complete; its report is ``stopped_by`` "interrupted".
    """

    def __init__(self, result: RenderResult) -> None:
        super().__init__(f"interrupted after {passes_in_words(result.report['passes'])}")
        self.result = result

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle as what it was made of."""
        return RenderInterrupted, (self.result,)


def render(
    scene: Scene,
    integrator: str = "path",
    passes: int | None = None,
    time_budget: float | None = None,
    target_error: float | None = None,
    *,
    seed: int = 0,
    threads: int | None = None,
    max_depth: int = 16,
    accuracy: str = "certified",
    tolerance: float | None = None,
    options: Options | None = None,
    outputs: Sequence[str] = (),
    progress: Progress | None = None,
) -> RenderResult:
    """Make a picture of a scene.

    Parameters
    ----------
    scene : Scene
    integrator : "path", "whitted", "ppm" or "photon_map"
        "path": all light but what point lights throw through glass or off mirrors. "whitted":
        direct light, mirrors and glass only. "ppm": all light, photons from the lights included;
        blurred by discs that shrink from pass to pass. "photon_map": all light, with a blur that
        stays.
    passes : int, optional
        One pass is one sample per pixel, and one set of photons where there are any. With no limit
        given: 16. The first limit reached stops.
    time_budget : float, optional
        Wall seconds for all of this call but the compilation of kernels. At least one pass runs,
        and none is started that would end too late, judged by the slowest so far.
    target_error : float, optional
        Passes are added until the picture's estimated relative root mean square error is at most
        this (0.01: one per cent), by itself with no end. The error is that of noise (see
        `hybrid_rt.sensor.film.Film.relative_error`) and of the blur of photons; what ``max_depth`` cuts off
        and the geometric error are in the report. Where a blur that passes do not lessen is above
        the target, a render without another limit ends and says so.
    seed : int
        Names the random numbers: equal seeds and settings give equal pictures, bit for bit, for any
        number of threads.
    threads : int, optional
        Default: the cores that this process may use.
    max_depth : int
        Directions that a path takes at a surface at most ("whitted": mirrored and refracted ones);
        what is lost is reported.
    accuracy, tolerance
        As `Intersector` takes them.
    options : PathOptions, PPMOptions or PhotonMapOptions, optional
        Settings of the integrator.
    outputs : sequence of str
        What else to find, as ``channels`` of the result: "depth", "position", "normal", "uv",
        "object_id", "albedo" (all behind the middle of each pixel), "samples", "standard_error",
        "half_interval" (half the width of each pixel's 95 % interval).
    progress : callable, optional
        Called with (stage, done, total); see `hybrid_rt.core.progress.Progress`.

    Returns
    -------
    RenderResult

    Raises
    ------
    ValueError, TypeError
        Before any work, if a setting is unknown or out of range.
    MemoryError
        Before any work, if the picture or the photons of a pass are more than the machine holds.
    RenderInterrupted
        A KeyboardInterrupt that holds the picture of the passes done: on Ctrl-C, or where
        ``progress`` raises one, once a pass is complete.
    """
    if not isinstance(scene, Scene):
        raise TypeError(f"render scene is {checks.shown(scene)}: pass a Scene")
    checks.choice(integrator, "integrator", INTEGRATORS)
    check_settings(accuracy, tolerance=tolerance)
    _check_options(integrator, options)
    names = check_names(outputs)
    limit = Limit(passes, time_budget, target_error)
    n_threads = Pool(threads).threads
    sampler = Sampler(seed)
    checks.whole(max_depth, "max_depth", at_least=0, up_to=DEEPEST)
    if progress is not None and not callable(progress):
        raise TypeError(f"progress is {checks.shown(progress)}: pass a function, or None")
    kind = OPTIONS[integrator]
    photons = 0 if kind is None else photons_of(options or kind())
    check_memory(scene.camera, photons, names, passes)

    with watch_compilation(progress) as compilation:
        clock = Clock(compilation)
        ledger = Ledger(lambda: clock.seconds)
        with ledger.stage("scene"):
            compiled = compile_scene(scene)
            plan = make_plan(compiled, integrator)
            want(integrator, but=[x for x, purpose in KERNELS_FOR.items() if not plan[purpose]])
        with ledger.stage("build"):
            if progress is not None:
                progress("Building", 0, 0)
            tracer = Intersector(
                compiled.surfaces, accuracy=accuracy, tolerance=tolerance, threads=1
            )
        # Threads share blocks of camera rays; within a block everything runs in one.
        context = RenderContext(
            compiled, tracer, Pool(1), plan, sampler, ledger, max_depth, options
        )
        with ledger.stage("set-up"):
            workers = INTEGRATORS[integrator](context, n_threads)
            workers.forget_seconds()
        # Before the passes, so that a time budget covers it.
        with ledger.stage("audit"):
            wrong = audit(context, n_threads)
        film = Film(scene.camera.height, scene.camera.width)
        try:
            stopped_by = _run_passes(film, workers, limit, clock, progress)
        except KeyboardInterrupt:
            if film.n_passes == 0:
                raise
            stopped_by = "interrupted"
        workers.gather()
        channels = compute_channels(names, context, film)
    settings = {
        "integrator": integrator,
        "passes": passes,
        "time_budget": time_budget,
        "target_error": target_error,
        "seed": seed,
        "threads": threads,
        "max_depth": max_depth,
        "accuracy": accuracy,
        "tolerance": tolerance,
        "outputs": list(names),
        "options": None if options is None else asdict(options),
        "width": scene.camera.width,
        "height": scene.camera.height,
    }
    blur = workers.blur(film.image)
    report = _report(plain(settings), context, film, clock, stopped_by) | workers.report(blur)
    report["geometry"]["wrong_first_hits"] = wrong
    report["relative_error"] = _relative_error(report["noise"], blur, workers.blur_stays)
    result = RenderResult(film.image, report, channels)
    if stopped_by == "interrupted":
        raise RenderInterrupted(result)
    return result


def _check_options(integrator: str, options: Options | None) -> None:
    expected = OPTIONS[integrator]
    if options is None or (expected is not None and isinstance(options, expected)):
        return
    wanted = "no options" if expected is None else expected.__name__
    raise TypeError(
        f"options are {checks.shown(options)}: integrator {integrator!r} takes {wanted}"
    )


def _run_passes(
    film: Film, workers: Workers, limit: Limit, clock: Clock, progress: Progress | None
) -> str:
    """Add passes in the order of their numbers until a limit is reached; say which."""
    camera = workers.context.scene.camera
    n_pixels = camera.width * camera.height
    at_most = max(TOGETHER // n_pixels, 1)
    show_error = getattr(progress, "note_error", None)
    show_out_of_reach = getattr(progress, "note_out_of_reach", None)
    watches_error = show_error is not None or limit.target_error is not None
    while n_together := limit.begins(film.n_passes, clock.seconds, at_most):
        n_before = n_pixels * film.n_passes
        n_expected = n_pixels * limit.expected_passes(film.n_passes)

        def on_rays(n_done: int, n_before: int = n_before, total: int = n_expected) -> None:
            if progress is not None:
                progress("Rendering", n_before + n_done, total)

        passes = range(film.n_passes, film.n_passes + n_together)
        for radiance in workers.render_passes(passes, on_rays):
            with held_back(), workers.context.ledger.stage("film"):
                film.add(radiance)
        if watches_error and film.n_passes >= limit.next_estimate():
            with workers.context.ledger.stage("noise"):
                noise, blur = film.relative_error(), workers.blur(film.image)
            # A limit to the blur falls with more passes whatever the blur does.
            stays = workers.blur_stays and blur.relative is not None
            limit.note_error(
                film.n_passes, noise, blur.counted, power=workers.error_power, blur_stays=stays
            )
            if show_error is not None:
                show_error(limit.error)
            if show_out_of_reach is not None and limit.blur_out_of_reach is not None:
                show_out_of_reach(limit.blur_out_of_reach)
    return limit.reached(film.n_passes, clock.seconds) or "passes"


def _relative_error(
    noise: dict[str, Any] | None, blur: Blur, blur_stays: bool
) -> dict[str, Any] | None:
    """Return the estimated relative errors of the picture, or None after a single pass."""
    if noise is None:
        return None
    both = math.hypot(noise["relative_rmse"], blur.counted)
    return {
        "noise": noise["relative_rmse"],
        "blur": blur.relative,
        "blur_at_most": blur.relative_at_most,
        "both": both if blur.counted < math.inf else None,
        "blur_stays": blur_stays,
    }


def _report(
    settings: dict[str, Any], context: RenderContext, film: Film, clock: Clock, stopped_by: str
) -> dict[str, Any]:
    ledger, tracer, total = context.ledger, context.tracer, clock.seconds
    n_camera = ledger.rays["camera"]
    work = tracer.counters
    n_certified = work["rays"] + work["shadow_rays"] - work["given_up"]
    return {
        "settings": settings,
        "versions": versions(),
        "passes": film.n_passes,
        "stopped_by": stopped_by,
        "seconds": {
            **{stage: round(seconds, 4) for stage, seconds in ledger.seconds.items()},
            # Threads that start, end and wait for each other, and whatever has no stage.
            "other": round(max(total - sum(ledger.seconds.values()), 0.0), 4),
            "total": round(total, 4),
        },
        "kernel_compilation_seconds": round(clock.compile_seconds, 4),
        "rays": dict(ledger.rays),
        "hits": dict(ledger.hits),
        "intersection": dict(work),
        "ended_branches": {
            **ledger.ended,
            "lost_weight_per_camera_ray": twelve_digits(ledger.lost_weight / n_camera),
        },
        "noise": film.noise(),
        "clear_bodies_not_closed": unclosed_bodies(context),
        "pixels_not_finite": int(np.count_nonzero(~np.isfinite(film.image).all(axis=2))),
        "geometry": {
            "accuracy": tracer.accuracy,
            "camera_hits": ledger.camera_hits,
            "camera_hits_without_bound": ledger.camera_hits_without_bound,
            "largest_t_bound_of_camera_hits": ledger.largest_t_bound,
            "certified_rays": n_certified if tracer.accuracy == "certified" else 0,
            "given_up": work["given_up"],
            "tangent": ledger.hits["tangent"],
            "changed_by_certificate": work["changed_by_certificate"],
        },
        "peak_memory_mib": round(peak_memory_mib(), 1),
        "plan": {"light": context.plan.as_dict(), "intersection": tracer.plan},
    }
