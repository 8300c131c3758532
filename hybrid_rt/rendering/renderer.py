"""`render`, the main loop: trace passes, add them to the film, stop at a limit, make the report."""

import logging
from contextlib import ExitStack

from hybrid_rt.core.interrupts import hear_again, heard_anywhere, heard_at_stops, kept_back
from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.precompile import want
from hybrid_rt.core.progress import watch_compilation
from hybrid_rt.core.suggestions import explains
from hybrid_rt.rendering.arguments import Arguments, other_names, takes
from hybrid_rt.rendering.audit import audit
from hybrid_rt.rendering.channels import compute_channels
from hybrid_rt.rendering.limits import Clock
from hybrid_rt.rendering.memory import check_memory
from hybrid_rt.rendering.report_making import make_report, picture_settings
from hybrid_rt.rendering.report_warnings import scene_warnings, warnings_in_words
from hybrid_rt.rendering.result import RenderInterrupted, RenderResult
from hybrid_rt.rendering.run import ClusterLost, run_passes
from hybrid_rt.rendering.set_up import Rehearsal, set_up
from hybrid_rt.rendering.unmet_light import with_unmet_light
from hybrid_rt.rendering.watcher import Beginning
from hybrid_rt.scene.scene import Scene
from hybrid_rt.sensor.film import Film

# What a report's text says as well: whoever prints that can leave these messages out.
LOG = logging.getLogger("hybrid_rt.report")
# And these at once, before a render that may not be worth its time.
SCENE_LOG = logging.getLogger("hybrid_rt.report.scene")


@explains(
    **other_names(),
    width="a scene whose camera has it: scene.with_camera(scene.camera.resized(width, height))",
    height="a scene whose camera has it: scene.with_camera(scene.camera.resized(width, height))",
    photons="options=PPMOptions(photons_per_pass=...)",
    photons_per_pass="options=PPMOptions(photons_per_pass=...)",
    out="the name of the file to the result: render(...).save(name)",
)
@takes(Arguments)
def render(scene: Scene, asked: Arguments) -> RenderResult:
    """Render a picture of a scene.

    Warnings go to the logger ``hybrid_rt.report`` of Python's `logging`, not to the module
    `warnings`; ``report["warnings"]`` lists the texts of all of them.

    Parameters
    ----------
    scene : Scene
    integrator : "path", "whitted", "ppm" or "photon_map"
        "path" is path tracing, which finds all light except what point and spot lights send by way
        of mirrors and smooth glass. "whitted" finds only direct light, mirrors and glass, and leaves
        out branches that carry less than a thousandth of a camera ray. "ppm" is progressive photon
        mapping, which finds all light except what point and spot lights send by way of mirrors and
        smooth glass onto metal; its blur falls from pass to pass. "photon_map" is photon mapping,
        which finds the same light; its blur stays. The report says which light of the scene is not
        found, and how much it is.
    passes : int, optional
        One pass is one sample per pixel; for the photon integrators one photon map, and one to four
        samples. Rendering stops at the first limit that is reached; if no limit is given, after 16
        passes.
    time_budget : float, optional
        Wall-clock seconds for this call, without the compilation of kernels. At least one pass
        runs. A pass is not started if it would end too late, judged by the slowest pass so far. On a
        busy machine the last pass may take longer than those, so the budget may be exceeded by about
        a pass. Building the surfaces counts, and is not cut short.
    target_error : float, optional
        Passes are added until the estimated relative root mean square error of the picture is at
        most this (0.01 is one per cent; at most 1), with no upper limit on their number. The error counts
        noise (see `hybrid_rt.sensor.film.Film.relative_errors`) and the blur of photons. It does
        not count light that the integrator does not find, what ``max_depth`` cuts off, or the
        geometric error; those are in the report. Nor does it count lamps that camera rays meet by
        chance alone (a small lamp's image in a mirror, say) and have not met yet; a warning says so
        if they may add more than the target to the image mean. While an independent estimate by photons
        says that light is missing, no target is reached: a render without another limit then ends as
        "contradicted". If a blur that more passes do not
        reduce is above the target, a render without another limit ends and reports that.
    target_error_trimmed : float, optional
        The same, but with the noise without the worst 0.1 % of the pixels, which a few bright paths
        (fireflies) can spoil in an otherwise good picture. It counts the blur of all pixels. It is
        not reached as long as twice the passes would bring more dots than these pixels hold.
    seed : int
        Equal seeds and settings give equal pictures, bit for bit, for any number of threads; on
        another kind of processor, last digits may differ.
    threads : int, optional
        Default: all cores that this process may use. The number changes no bit of the picture.
    max_depth : int
        Largest number of bounces of a path (for "whitted": of reflections and refractions; for the
        photon integrators: of paths from the camera and of photons, separately). The light that
        this cuts off is reported. The light that an integrator does not find at any depth is measured
        with 16 bounces at least. The same number is not the same set of paths in all integrators:
        at 0 "path" shows light that a ``Metal`` reflects; the others follow it, as a mirror, from
        1 on.
    accuracy, coarse, tolerance
        As for `Intersector`. ``coarse`` changes only the time, and no bit of the picture.
    options : PathOptions, PPMOptions or PhotonMapOptions, optional
        Settings of the integrator.
    outputs : sequence of str
        Additional ``channels`` of the result: "depth", "position", "normal", "uv", "object_id", "instance_id",
        "albedo" (all at pixel centres), "samples", "standard_error", "half_interval" (half the
        width of each pixel's 95 % interval of the noise alone: by ppm and photon_map it is about the
        blurred picture, and may miss the true one).
    progress : callable, optional
        Called with (stage, done, total), see `hybrid_rt.core.progress.Progress`:
        ``hybrid_rt.progress_bar()`` shows a bar on terminals and in notebooks.
    store : path, optional
        Folder in which the sums over passes are saved every ten seconds or so and at the end; see
        `hybrid_rt.rendering.store`.
    resume : bool
        Continue from the passes of the store, if it has any. ``passes`` counts them as well. The
        picture has the same bits as one that was rendered without a break.
    cluster : str, optional
        Address of a dask scheduler (``"tcp://HOST:8786"``) whose workers make the passes, or
        ``"local:N"`` for N processes on this machine; see `hybrid_rt.rendering.cluster`.
    watch : Watcher, optional
        Is informed about the render while it runs, and may stop it; ``report["stopped_by"]`` is
        then "watcher". See `hybrid_rt.rendering.watcher`.

    Returns
    -------
    RenderResult

    Raises
    ------
    ValueError, TypeError
        Before any work, if a setting is unknown or out of range.
    MemoryError
        Before any work, if the picture or the photons of a pass do not fit into memory.
    StoreError
        A ValueError, before any work: the store is in use, holds passes although ``resume`` is
        False, or holds passes of another scene, of other settings, code or versions.
    RenderInterrupted
        A KeyboardInterrupt that holds the picture of the complete passes. It is raised on Ctrl-C,
        or if ``progress`` raises KeyboardInterrupt, after the first pass. Further Ctrl-C change
        nothing.
    """
    settings, progress, watch = asked.settings, asked.progress, asked.watch
    declared, own, limit = settings.declared, settings.own, settings.limit
    n_threads, told = settings.n_threads, picture_settings(scene, settings)
    check_memory(scene.camera, own.n_photons, settings.outputs, settings.passes)
    rehearsal = Rehearsal(scene, settings)
    want(rehearsal.tasks)

    # What holds signals back ends last: to let go of a cluster takes seconds.
    with ExitStack() as held, ExitStack() as around:
        held.enter_context(heard_at_stops())
        hear_again()
        around.callback(getattr(progress, "close", lambda: None))
        kept_in, saved = None, None
        if asked.store is not None:
            from hybrid_rt.rendering.identity import identity
            from hybrid_rt.rendering.keeper import Keeper
            from hybrid_rt.rendering.store import PassStore

            try:
                kept_in = PassStore(asked.store, asked.resume)
                around.callback(kept_in.close)
                saved = kept_in.open(identity(scene, settings))
            except OSError as error:
                raise type(error)(
                    f"store {str(asked.store)!r} cannot be used ({error.strerror or error}): make room and "
                    "see that it can be written, or name another folder"
                ) from error
        compilation = around.enter_context(watch_compilation(progress, tells=progress is not None))
        clock = Clock(compilation)
        ledger = Ledger(lambda: clock.seconds)
        with heard_anywhere():
            ready = set_up(scene, settings, n_threads, ledger, progress)
        said = scene_warnings(ready.faults)
        for words in said:
            SCENE_LOG.warning(words)
        context, left_out = ready.context, ready.left_out
        workers, source = ready.workers, None
        if asked.cluster is not None:
            from hybrid_rt.rendering.cluster import Cluster

            with ledger.stage("cluster"):
                source = around.enter_context(Cluster(asked.cluster, scene, settings, workers))
        # Before the passes, so that a time budget covers it.
        with heard_anywhere(), ledger.stage("audit"):
            wrong = audit(context, n_threads)
        with heard_anywhere(), ledger.stage("light not found"):
            unfound = None
            if left_out:
                from hybrid_rt.integrators.probes.unfound_light import unfound_light

                unfound = unfound_light(context, declared.finds(own))
        check = None
        if not declared.sends_photons and settings.passes != 1:
            from hybrid_rt.integrators.probes.cross_check import CrossCheck

            check = CrossCheck(context, declared.finds(own))
        film = Film(scene.camera.height, scene.camera.width)
        keeper = None
        if kept_in is not None:
            keeper = Keeper(kept_in, film, workers, limit, clock, n_threads)
            if saved is not None:
                keeper.take_up(saved)
        if watch is not None:
            watch.begin(Beginning(scene, context, told, n_threads, clock, film, left_out, unfound))
        lost = ""
        try:
            stopped_by = run_passes(
                film, workers, limit, clock, progress, keeper, source, watch, check
            )
            # What is left to do takes seconds at most: Ctrl-C does not make it lose the picture.
            came = held.enter_context(kept_back())
        except KeyboardInterrupt:
            came = held.enter_context(kept_back())
            if film.n_passes == 0:
                raise
            stopped_by = "interrupted"
        except ClusterLost as error:
            came = held.enter_context(kept_back())
            if film.n_passes == 0:
                raise
            stopped_by, lost = "cluster_lost", str(error)
        except BaseException:
            # By a callback, say, or an integrator of the caller's: no pass is lost for that.
            held.enter_context(kept_back())
            if keeper is not None and film.n_passes and film.is_whole:
                keeper.save()
            raise
        if keeper is not None:
            with ledger.stage("store"):
                keeper.save()
        workers.gather()
        channels = compute_channels(settings.outputs, context, film)
        of_cluster = None if source is None else source.about(lost)
        of_store = None if keeper is None else keeper.report()
        report = make_report(
            told, ready, film, clock, stopped_by, check, wrong, unfound, of_cluster, of_store
        )
        if "half_interval" in channels and report.cross_check is not None:
            half = channels["half_interval"]
            channels["half_interval"] = with_unmet_light(half, report.cross_check)
        result = RenderResult(film.image, report, channels)
        for words in [*warnings_in_words(report), *([lost] if lost else [])]:
            if words not in said:
                LOG.warning(words)
        if watch is not None:
            watch.end(report)
    if came or stopped_by == "interrupted":
        raise RenderInterrupted(result)
    return result
