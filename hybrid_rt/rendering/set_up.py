"""From a scene to what makes its passes: tables, intersector, plan, workers."""

from collections.abc import Iterator
from copy import deepcopy
from dataclasses import dataclass, replace

from hybrid_rt.core.ledger import Ledger
from hybrid_rt.core.precompile import Task
from hybrid_rt.core.progress import Progress
from hybrid_rt.core.threads import Pool
from hybrid_rt.integrators.context import RenderContext
from hybrid_rt.integrators.workers import Workers
from hybrid_rt.intersection import Intersector
from hybrid_rt.rendering.settings import Settings
from hybrid_rt.sampling.sampler import Sampler
from hybrid_rt.scene.compiled import CompiledScene, compile_scene
from hybrid_rt.scene.lint.faults import Faults, faults_of
from hybrid_rt.scene.lint.lamps_in_surfaces import LampInSurface, with_lamps_lifted
from hybrid_rt.scene.plan import Plan, make_plan
from hybrid_rt.scene.scene import Scene

# Pixels that meet most materials and lights of a picture.
REHEARSED = 48, 36


@dataclass(frozen=True)
class Rehearsal:
    """A render in small, which calls the kernels of its integrator."""

    scene: Scene
    settings: Settings

    def tasks(self) -> Iterator[Task]:
        """Yield what other processes can do; `Intersector` has what calls the kernels of the surfaces.

        Triangles are met in place of the surfaces: they need fewer kernels.
        """
        scene = self.scene.with_camera(self.scene.camera.resized(*REHEARSED))
        settings = replace(self.settings, accuracy="mesh", coarse="embree", tolerance=None)
        yield rehearse_passes, (scene, settings)
        yield rehearse_checks, (scene, settings)


def rehearse_passes(scene: Scene, settings: Settings) -> None:
    """Make passes."""
    workers = set_up(scene, settings, 1, Ledger()).workers
    for made in workers.render_passes(range(2)):
        workers.keep(made)


def rehearse_checks(scene: Scene, settings: Settings) -> None:
    """Send the photons by which a render looks for light that it does not find."""
    from hybrid_rt.integrators.probes.cross_check import CrossCheck
    from hybrid_rt.integrators.probes.unfound_light import unfound_light

    declared = settings.declared
    ready, found = set_up(scene, settings, 1, Ledger()), declared.finds(settings.own)
    if ready.left_out:
        unfound_light(ready.context, found)
    if not declared.sends_photons and settings.passes != 1:
        CrossCheck(ready.context, found)


@dataclass(frozen=True)
class Ready:
    """What makes passes."""

    context: RenderContext  # its plan also has what pilot passes decided
    plan: Plan  # as the scene alone decides it: what further workers begin with
    workers: Workers
    left_out: list[str]  # light that is not found, see `Declaration.left_out_light`
    sunken: list[LampInSurface]
    faults: Faults


def set_up(
    scene: Scene, settings: Settings, threads: int, ledger: Ledger, progress: Progress | None = None
) -> Ready:
    """Make all that passes need; ``ledger`` gets the seconds of each stage."""
    declared, own = settings.declared, settings.own
    with ledger.stage("scene"):
        compiled = compile_scene(scene)
        left_out = declared.left_out_light(compiled, own)
        plan = make_plan(compiled, declared.with_options(own), left_out)
    with ledger.stage("build"):
        if progress is not None:
            progress("Building", 0, 0)

        def build(flat: CompiledScene) -> Intersector:
            ways = settings.accuracy, settings.coarse, settings.tolerance
            began = ledger.now()
            built = Intersector(flat.surfaces, *ways, threads=1)
            # The render's clock stands still while kernels are compiled, the tracer's own does not.
            built.coarse_build_seconds = min(built.coarse_build_seconds, ledger.now() - began)
            built.now = ledger.now
            return built

        compiled, tracer, sunken = with_lamps_lifted(scene, compiled, build)
        faults = faults_of(compiled, tracer)
    # Threads share blocks of camera rays; within a block everything runs in one.
    sampler = Sampler(settings.seed)
    context = RenderContext(
        compiled, tracer, Pool(1), plan, sampler, ledger, settings.max_depth, own
    )
    of_scene = deepcopy(plan)
    with ledger.stage("set-up"):
        workers = declared.make(context, threads)
        workers.forget_seconds()
    return Ready(context, of_scene, workers, left_out, sunken, faults)
